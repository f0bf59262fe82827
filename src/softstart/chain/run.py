"""One start of a chain, finished: its states at any instant, its events, peaks and work."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softstart.chain import kernel_layout as at
from softstart.chain import kernel_record as record
from softstart.chain.kernel_input import Numbers
from softstart.chain.model import Chain
from softstart.controller.base import Controller
from softstart.drive import Drive
from softstart.errors import InputError
from softstart.plant import layout as plant
from softstart.start import metrics
from softstart.start.status import Status

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["ChainEnergy", "ChainEvent", "ChainRun"]

Vector = NDArray[np.float64]

EVENT_NAMES = {
    at.CLOSED: "gap closed",
    at.OPENED: "gap opened",
    at.LOAD_STARTS: "load starts",
    at.LOAD_STOPS: "load stops",
    at.TARGET_REACHED: "target speed reached",
    at.IMPACT: "impact",
    at.SETTLED: "impacts over, flanks press",
    at.GEAR_LETS_GO: "gear lets go",
    at.GEAR_HOLDS: "gear holds",
}
OF_A_SHAFT = frozenset({at.CLOSED, at.OPENED, at.IMPACT, at.SETTLED})
PLOT_POINTS = 1500


class ChainEvent(NamedTuple):
    """Something that happened at a located instant.

    `place` is the index of the shaft or mass, `value` the flank, the sign of the motion, the speed reached,
    or what an impact loses in J; `impulse` that of an impact in N m s.
    """

    time: float
    kind: str
    place: int
    value: float
    impulse: float


@dataclass(frozen=True)
class ChainEnergy:
    """Where the energy went, J; `residual` is what the sum misses and shows the accuracy of the run.

    motor + exciting = kinetic + elastic + load + ground + shafts + gears + impacts + residual, all from the
    start of the run: work of the motor and of the exciting torques, change of kinetic and elastic energy,
    work against the load torques, damping to the ground and in the shafts, losses of gears (never below 0),
    impacts of rigid flanks.
    """

    motor: float
    exciting: float
    kinetic: float
    elastic: float
    load: float
    ground: float
    shafts: float
    gears: float
    impacts: float
    residual: float


@dataclass(frozen=True, eq=False, repr=False)
class ChainRun:
    """One start of a chain. Angles, speeds and torques in SI at the motor shaft.

    `.t, .phi, .w, .twist, .T, .u` are traces for plotting, a row an instant; `at(times)` evaluates any
    instant exactly; peaks and events are located, not read off these traces.
    """

    chain: Chain
    controller: Controller | None
    base: Drive | None
    status: Status
    numbers: Numbers
    final: Vector
    mass: at.Matrix
    shaft: at.Matrix
    segments: at.Matrix
    event_rows: at.Matrix

    def __repr__(self) -> str:
        """One line that says what came out."""
        end = (
            f"start time {self.start_time:.4f} s" if self.start_time == self.start_time else self.status.value
        )
        peaks = f"peaks {self.peak_torques.round(3)} N m"
        return f"<ChainRun: {self._controller_name} on {self.chain.name}, {peaks}, {end}>"

    @property
    def _controller_name(self) -> str:
        if self.controller is None:
            return "no motor torque"
        return self.controller.name or type(self.controller).__name__

    # figures -------------------------------------------------------------------------------------------

    @property
    def peak_torques(self) -> Vector:
        """Largest |T| of each shaft, N m, located; impacts of rigid flanks have `peak_impulses` instead."""
        return np.abs(self.shaft[:, at.PEAK])

    @property
    def peak_times(self) -> Vector:
        """When |T| of each shaft is largest, s."""
        return self.shaft[:, at.PEAK_TIME].copy()

    @property
    def peak_impulses(self) -> Vector:
        """Largest impulse of each shaft's impacts, N m s; 0 where none was."""
        return self.shaft[:, at.IMPULSE].copy()

    @property
    def motor_shaft(self) -> int:
        """The index of the shaft beside the motor, on the way to the load."""
        return int(self.numbers.place[at.MOTOR_SHAFT])

    @property
    def peak_torque(self) -> float:
        """Largest |T| of the shaft beside the motor, N m."""
        return float(self.peak_torques[self.motor_shaft])

    @property
    def peak_time(self) -> float:
        """When that is, s."""
        return float(self.peak_times[self.motor_shaft])

    @property
    def k_dyn(self) -> float:
        """Dynamic coefficient of the shaft beside the motor, [G](16), over the mean torque of the base."""
        if self.base is None:
            raise InputError("base: K_dyn refers to the mean torque of a drive; give base to simulate_chain.")
        return float(metrics.k_dyn(self.peak_torque, self.base))

    @property
    def start_time(self) -> float:
        """First instant at which the load mass has its target speed, s; NaN if it never has."""
        return float(self.final[plant.START_TIME])

    @property
    def end_time(self) -> float:
        """End of the run, s."""
        return float(self.final[plant.TIME])

    @property
    def stages(self) -> int:
        """The number of the last stage: odd while a gap from motor to load is open, even while none is."""
        return int(self.final[plant.STAGE])

    @cached_property
    def events(self) -> tuple[ChainEvent, ...]:
        """All events, in order."""
        rows = self.event_rows[np.argsort(self.event_rows[:, at.E_TIME], kind="stable")]
        return tuple(
            ChainEvent(float(t), EVENT_NAMES[float(kind)], int(place), float(value), float(impulse))
            for t, kind, place, value, impulse in rows
        )

    # states --------------------------------------------------------------------------------------------

    def at(self, times: ArrayLike) -> dict[str, Vector]:
        """States at any instants within the run, evaluated from the series of their spans.

        Returns u of the shape of `times`, and phi, w (a last axis of masses), twist and T (of shafts). At an
        instant where something jumps the value is the one after the jump.
        """
        when = np.asarray(times, dtype=np.float64)
        flat = np.ascontiguousarray(when.ravel())
        if flat.size and not (flat.min() >= 0.0 and flat.max() <= self.end_time * (1 + 1e-12)):
            raise ValueError(f"times must lie within the run, 0 to {self.end_time:.6g} s.")
        index = (np.searchsorted(self.segments[:, at.S_START], flat, side="right") - 1).clip(0)
        count = self.numbers.count
        out = np.empty((flat.size, 3 * count))
        x, m, mass, shaft, series, lines = self.numbers.scratch()
        given = self.numbers
        record.states_at(
            given.p, x, m, given.place, given.masses, given.shafts, given.tones, mass, shaft, series, lines,
            self.segments, index, flat, out,
        )  # fmt: skip
        w, twist, T = np.split(out[:, 2:], [count, 2 * count - 1], axis=1)
        motor = int(given.place[at.MOTOR])
        relative = np.concatenate([np.zeros((flat.size, 1)), -np.cumsum(twist, axis=1)], axis=1)
        phi = out[:, :1] + relative - relative[:, motor : motor + 1]
        shaped = {"phi": phi, "w": w, "twist": twist, "T": T}
        found = {name: values.reshape(*when.shape, -1) for name, values in shaped.items()}
        return {**found, "u": out[:, 1].reshape(when.shape)}

    @cached_property
    def t(self) -> Vector:
        """Instants of the traces, s: an even grid and every event and peak."""
        grid = np.linspace(0.0, self.end_time, PLOT_POINTS)
        edges = self.event_rows[:, at.E_TIME]
        when = np.concatenate([grid, edges, np.nextafter(edges, 0.0), self.peak_times])
        return np.unique(when.clip(0.0, self.end_time))

    @cached_property
    def _traces(self) -> dict[str, Vector]:
        return self.at(self.t)

    @property
    def phi(self) -> Vector:
        """Angles of the masses, rad; that of the load mass is 0 at the start."""
        return self._traces["phi"]

    @property
    def w(self) -> Vector:
        """Speeds of the masses, rad/s."""
        return self._traces["w"]

    @property
    def twist(self) -> Vector:
        """Twists of the shafts, rad."""
        return self._traces["twist"]

    @property
    def T(self) -> Vector:
        """Torques of the shafts, N m."""
        return self._traces["T"]

    @property
    def u(self) -> Vector:
        """Motor torque, N m."""
        return self._traces["u"]

    # what follows from them ----------------------------------------------------------------------------

    @cached_property
    def energy(self) -> ChainEnergy:
        """Energy balance of the run."""
        given = self.numbers
        x, m, mass, shaft, series, lines = given.scratch()
        work = np.zeros(record.N_WORK)
        record.work_of(
            given.p, x, m, given.place, given.masses, given.shafts, given.tones, mass, shaft, series, lines,
            self.segments, work,
        )  # fmt: skip
        motor, exciting, load, ground, shafts, gears = work.tolist()
        kinetic = 0.5 * float(
            given.masses[:, at.J] @ (self.mass[:, at.W] ** 2 - given.masses[:, at.W_0] ** 2)
        )
        rows = self._shaft_rows
        final = self.shaft[None, :, [at.THETA, at.MODE, at.SIDE]]
        elastic = _stored(given, final) - _stored(given, rows[:1])
        # flanks may part while the spring is still loaded, and meet again: that energy goes, or comes
        after = np.concatenate([rows[1:], final])
        before = np.concatenate([after[:, :, :1], rows[:, :, 1:]], axis=2)
        shafts += _stored(given, before) - _stored(given, after)
        struck = np.isin(self.event_rows[:, at.E_KIND], [at.IMPACT, at.SETTLED])
        impacts = float(self.event_rows[struck, at.E_VALUE].sum())
        residual = motor + exciting - kinetic - elastic - load - ground - shafts - gears - impacts
        return ChainEnergy(motor, exciting, kinetic, elastic, load, ground, shafts, gears, impacts, residual)

    @property
    def _shaft_rows(self) -> Vector:
        """THETA, MODE and SIDE of each shaft at the start of each span."""
        width = at.S_MASS + 2 * self.numbers.count
        rows = self.segments[:, width:].reshape(self.segments.shape[0], -1, at.OF_SHAFT)
        return rows[:, :, :3]

    def plot(self) -> Figure:
        """Torques, speeds and twists over time."""
        from softstart.chain.pictures_of_runs import run_figure

        figure: Figure = run_figure(self)
        return figure

    def summary(self) -> dict[str, Any]:
        """All figures under the names used everywhere."""
        return {
            "chain": self.chain.name,
            "assumed": self.chain.assumed,
            "controller": self._controller_name,
            "parameters": {} if self.controller is None else self.controller.parameters,
            "status": self.status.name,
            "status_text": self.status.value,
            "base": None if self.base is None else self.base.name,
            "k_dyn": None if self.base is None else self.k_dyn,
            "peak_torque": self.peak_torque,
            "peak_time": self.peak_time,
            "peak_torques": self.peak_torques.tolist(),
            "peak_times": self.peak_times.tolist(),
            "peak_impulses": self.peak_impulses.tolist(),
            "start_time": self.start_time,
            "stages": self.stages,
            "events": len(self.events),
            "energy": asdict(self.energy),
            "end_time": self.end_time,
        }


def _stored(given: Numbers, rows: at.Matrix) -> float:
    """The sum of the elastic energies of all shafts, in J, over rows of (THETA, MODE, SIDE)."""
    theta, mode, side = rows[..., 0], rows[..., 1], rows[..., 2]
    acting = np.isin(mode, [at.CONTACT, at.DOUBLED, at.JOINED])
    z = np.where(acting, theta - side * given.shafts[:, at.HALF], 0.0)
    return float(np.sum(0.5 * given.shafts[:, at.C] * z * z))
