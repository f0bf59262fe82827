"""One start of a chain, finished: its states at any instant, its events, peaks and work."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from softstart import formulas
from softstart.arrays import Vector
from softstart.chain import kernel_start as kernel
from softstart.chain.kernel_records import (
    CLOSED,
    CONTACT,
    DOUBLED,
    GEAR_HOLDS,
    GEAR_LETS_GO,
    IMPACT,
    JOINED,
    LOAD_STARTS,
    LOAD_STOPS,
    MOTOR,
    OPENED,
    SETTLED,
    TARGET_REACHED,
    WORK,
    Numbers,
    Record,
    Start,
)  # fmt: skip
from softstart.chain.model import Chain
from softstart.controller.base import Controller
from softstart.drive import Drive
from softstart.errors import SimulationError
from softstart.late import late
from softstart.plant import layout
from softstart.start import metrics
from softstart.start.engine import FIRST_ROWS, Recorder, run_one
from softstart.start.run import BaseRun
from softstart.start.status import Status, status_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

views = late("softstart.views.chains")

EVENT_NAMES = {
    CLOSED: "gap closed",
    OPENED: "gap opened",
    LOAD_STARTS: "load starts",
    LOAD_STOPS: "load stops",
    TARGET_REACHED: "target speed reached",
    IMPACT: "impact",
    SETTLED: "impacts over, flanks press",
    GEAR_LETS_GO: "gear lets go",
    GEAR_HOLDS: "gear holds",
}


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
class ChainRun(BaseRun):
    """One start of a chain. Angles, speeds and torques in SI at the motor shaft.

    It is returned by `simulate_chain`. The traces are for plotting, one row for each instant; `at(times)`
    evaluates any instant exactly; peaks and events are located, not read off the traces. N is the number of
    masses.

    Attributes
    ----------
    chain : Chain
        The chain that was started.
    controller : Controller or None
        The controller as it was set up; None where the motor was off.
    base : Drive, Chain or None
        The drive or chain to whose mean torque K_dyn refers; None where it is that of the chain itself.
    status : Status
        How the start ended.
    t, u : array of shape (n,)
        Instants of the traces, s, and motor torque, N m.
    phi, w : array of shape (n, N)
        Angles, rad, and speeds, rad/s, of the masses.
    twist, T : array of shape (n, N - 1)
        Twists, rad, and torques, N m, of the shafts.
    k_dyn : float
        Dynamic coefficient: the largest torque of all shafts, at the motor shaft, over `base_torque`.
    k_dyns, utilisation : array of shape (N - 1,)
        The same of each shaft, and its torque over its permissible torque (NaN where none is given).
    peak_torques, peak_times : array of shape (N - 1,)
        Largest |T| of each shaft, N m, and its instant, s.
    peak_impulses : array of shape (N - 1,)
        Largest impulse of the impacts of each rigid gap, N m s.
    start_time, end_time : float
        First instant at which the load mass has its target speed (NaN if never), and end of the run, s.
    events : tuple of ChainEvent
        Contacts, impacts and others, in order of time.
    energy : ChainEnergy
        Energy balance, J.
    numbers : Numbers
        The chain as the kernel has it.
    recorded : Start
        Records of the kernel at the end.
    told : Drive or None
        The drive for which the controller was set up.
    positions : mapping of str to ChainRun
        The starts from each position, if it is unknown. Then K_dyn, peaks and times are the largest of them.

    Examples
    --------
    >>> from softstart import simulate_chain
    >>> run = simulate_chain("crane-4-mass", "direct")
    >>> run.peak_torques.shape, run.w.shape == (run.t.size, 4)
    ((3,), True)
    >>> run.status.value
    'The load reached its target speed.'

    References
    ----------
    Everything at one shaft: [R], docs/theory/reduction.md; K_dyn: [G] (16); accuracy of the Taylor series:
    docs/theory/numerics.md.
    """

    chain: Chain
    controller: Controller | None
    base: Drive | Chain | None
    status: Status
    numbers: Numbers  # the chain as the kernel has it
    recorded: Start  # the kernel's records at the end
    told: Drive | None = None
    positions: Mapping[str, ChainRun] = field(default_factory=dict)

    def __repr__(self) -> str:
        """One line that says what came out."""
        peaks = f"peaks {self.peak_torques.round(3)} N m"
        return f"<ChainRun: {self.controller_name} on {self.chain.name}, {peaks}, {self._outcome}>"

    # figures -------------------------------------------------------------------------------------------

    @property
    def _final(self) -> Vector:
        return self.recorded.x

    @property
    def drive(self) -> Chain:
        """The chain: what a start of a drive has under this name."""
        return self.chain

    @property
    def elastic_period(self) -> float:
        """The period of the first natural frequency with all gaps closed, s."""
        return float(self.numbers.p.view(layout.PLANT)[0].period)

    @property
    def peak_torques(self) -> Vector:
        """Largest |T| of each shaft, N m, located; impacts of rigid flanks have `peak_impulses` instead."""
        runs = self.positions.values() or (self,)
        peaks: Vector = np.max([np.abs(run.recorded.shafts["peak"]) for run in runs], axis=0)
        return peaks

    @property
    def peak_times(self) -> Vector:
        """When |T| of each shaft is largest, s."""
        times: Vector = self.recorded.shafts["peak_time"].copy()
        return times

    @property
    def peak_impulses(self) -> Vector:
        """Largest impulse of each shaft's impacts, N m s; 0 where none was."""
        impulses: Vector = self.recorded.shafts["impulse"].copy()
        return impulses

    @property
    def motor_shaft(self) -> int:
        """The index of the shaft beside the motor, on the way to the load."""
        return self.numbers.place.motor_shaft

    @property
    def worst_shaft(self) -> int:
        """The index of the shaft with the largest torque at the motor shaft."""
        return int(self.peak_torques.argmax())

    @property
    def peak_torque(self) -> float:
        """Largest |T| of all shafts, N m."""
        return float(self.peak_torques[self.worst_shaft])

    @property
    def peak_time(self) -> float:
        """When that is, s."""
        return float(self.peak_times[self.worst_shaft])

    @property
    def base_torque(self) -> float:
        """The mean torque to which K_dyn refers, N m: that of `base`, or of the chain itself."""
        return mean_torque_of(self.base or self.chain)

    @property
    def k_dyn(self) -> float:
        """Dynamic coefficient of the whole run, [G](16): largest torque of all shafts over `base_torque`."""
        return float(self.k_dyns[self.worst_shaft])

    @property
    def k_dyns(self) -> Vector:
        """Dynamic coefficient of each shaft."""
        return np.asarray(formulas.dynamic_coefficient(self.peak_torques, self.base_torque))

    @property
    def shaft_factors(self) -> Vector:
        """Largest |T| of each shaft over its own mean torque under full starting torque; NaN if that is 0."""
        torque = math.nan if self.chain.motor is None else self.chain.motor.starting_torque
        mean = np.abs(self.chain.at_motor_shaft().mean_torques(torque))
        return self.peak_torques / np.where(mean > 0.0, mean, np.nan)

    @property
    def utilisation(self) -> Vector:
        """Largest |T| of each shaft over its permissible torque; NaN where none is given."""
        found: Vector = self.peak_torques / self.chain.at_motor_shaft().permissible
        return found

    @property
    def used_torque(self) -> float:
        """Largest |T| over the permissible torque of its shaft, %; 0 where none is given."""
        return 100.0 * float(np.nan_to_num(self.utilisation).max())

    @property
    def contacts(self) -> int:
        """How often gaps closed."""
        return int(np.isin(self.recorded.events["kind"], [CLOSED, IMPACT]).sum())

    @property
    def first_contact(self) -> float:
        """Instant of the first contact of any gap, s; NaN if none closes."""
        times = self._edges()[np.isin(self.recorded.events["kind"], [CLOSED, IMPACT])]
        return float(times.min()) if times.size else math.nan

    @property
    def stages(self) -> int:
        """The number of the last stage: odd while a gap from motor to load is open, even while none is."""
        return int(self._final[layout.STAGE])

    @cached_property
    def events(self) -> tuple[ChainEvent, ...]:
        """All events, in order."""
        rows = self.recorded.events[np.argsort(self._edges(), kind="stable")]
        return tuple(
            ChainEvent(time, EVENT_NAMES[kind], place, value, impulse)
            for time, kind, place, value, impulse in rows.tolist()
        )

    @property
    def _continued(self) -> ChainRun:
        """The same start to the end of settling at least; this one where it fails beyond its own end."""
        if self.controller is None or self.told is None or not self.end_time < self.settling_end:
            return self
        recorder = ChainRecorder(self.numbers, int(self.controller.sensors))
        try:
            reason = run_one(self.controller, self.told, recorder, self.settling_end)
        except SimulationError:
            return self
        if not status_of(reason, True, True).finished:
            return self
        return replace(self, recorded=recorder.finished())

    # states --------------------------------------------------------------------------------------------

    def at(self, times: ArrayLike) -> dict[str, Vector]:
        """States at any instants within the run, evaluated from the series of their spans.

        Returns u of the shape of `times`, and phi, w (a last axis of masses), twist and T (of shafts). At an
        instant where something jumps the value is the one after the jump.
        """
        when = np.asarray(times, dtype=np.float64)
        flat = self._instants(when)
        index = (np.searchsorted(self.recorded.spans["start"], flat, side="right") - 1).clip(0)
        count = self.numbers.count
        motor = np.empty(flat.size, MOTOR)
        w, twist, T = (np.empty((flat.size, columns)) for columns in (count, count - 1, count - 1))
        kernel.states_at(self._replayed(), index, flat, motor, w, twist, T)
        relative = angles_of(twist)
        place = self.numbers.place.motor
        phi = motor["phi"][:, None] + relative - relative[:, place : place + 1]
        shaped = {"phi": phi, "w": w, "twist": twist, "T": T}
        found = {name: values.reshape(*when.shape, -1) for name, values in shaped.items()}
        return {**found, "u": motor["u"].reshape(when.shape)}

    def load_at(self, times: ArrayLike) -> tuple[Vector, Vector]:
        """Speed of the load mass, rad/s, and the torque that speeds it up, N m, at any instants of the run.

        Of that torque gears with losses and exciting torques are left out.
        """
        states, arrays, load = self.at(times), self.chain.at_motor_shaft(), self.numbers.place.load
        speed, T = states["w"][..., load], states["T"]
        push = -arrays.Mc[load] - arrays.d_ground[load] * speed
        if load > 0:
            push = push + T[..., load - 1]
        if load < T.shape[-1]:
            push = push - T[..., load]
        return speed, push

    def _replayed(self) -> Start:
        """A start with the records of this one, whose state may be overwritten."""
        run = self.recorded
        records = {name: getattr(run, name) for name in ("spans", "span_masses", "span_shafts", "events")}
        return self.numbers.start()._replace(**records)

    def _edges(self) -> Vector:
        edges: Vector = self.recorded.events["time"]
        return edges

    def _peak_times(self) -> Vector:
        return self.peak_times

    def _columns(self, states: dict[str, Vector]) -> dict[str, Vector]:
        masses = [mass.name for mass in self.chain.masses]
        shafts = self.chain.shaft_names
        columns = {"u [N*m]": states["u"]}
        for name, unit, parts in (
            ("phi", "rad", masses), ("w", "rad/s", masses), ("twist", "rad", shafts), ("T", "N*m", shafts),
        ):  # fmt: skip
            columns |= {f"{name} {part} [{unit}]": states[name][:, i] for i, part in enumerate(parts)}
        return columns

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

    # what follows from them ----------------------------------------------------------------------------

    @cached_property
    def energy(self) -> ChainEnergy:
        """Energy balance of the run."""
        given, run = self.numbers, self.recorded
        works = np.zeros(1, WORK)
        kernel.work_of(self._replayed(), works)
        motor, exciting, load, ground, shafts, gears = works[0].tolist()
        moves = np.isfinite(given.masses["J"])
        before, after = given.masses[moves], run.masses[moves]
        kinetic = 0.5 * float(before["J"] @ (after["w"] ** 2 - before["w0"] ** 2))
        rows = run.span_shafts
        final = np.empty((1, rows.shape[1]), rows.dtype)
        for name in rows.dtype.names:
            final[name] = run.shafts[name]
        elastic = _stored(given, final) - _stored(given, rows[:1])
        # flanks may part while the spring is still loaded, and meet again: that energy goes, or comes
        later = np.concatenate([rows[1:], final])
        earlier = rows.copy()
        earlier["theta"] = later["theta"]
        shafts += _stored(given, earlier) - _stored(given, later)
        struck = np.isin(run.events["kind"], [IMPACT, SETTLED])
        impacts = float(run.events["value"][struck].sum())
        residual = motor + exciting - kinetic - elastic - load - ground - shafts - gears - impacts
        return ChainEnergy(motor, exciting, kinetic, elastic, load, ground, shafts, gears, impacts, residual)

    def plot(self) -> Figure:
        """Torques, speeds and twists over time."""
        figure: Figure = views.run_figure(self)
        return figure

    def summary(self) -> dict[str, Any]:
        """All figures under the names used everywhere."""
        known = self.base is not None or self.chain.motor is not None
        return {
            "chain": self.chain.name,
            "assumed": self.chain.assumed,
            **self._controller_and_status(),
            "warnings": list(self.chain.warnings),
            "base": None if self.base is None else self.base.name,
            "base_torque": self.base_torque if known else None,
            "k_dyn": self.k_dyn if known else None,
            "k_dyns": self.k_dyns.tolist() if known else None,
            "shaft_factors": [None if math.isnan(one) else one for one in self.shaft_factors.tolist()],
            "worst_shaft": self.chain.shaft_names[self.worst_shaft],
            "utilisation": [None if math.isnan(one) else one for one in self.utilisation.tolist()],
            "peak_torque": self.peak_torque,
            "peak_time": self.peak_time,
            "peak_torques": self.peak_torques.tolist(),
            "peak_times": self.peak_times.tolist(),
            "peak_impulses": self.peak_impulses.tolist(),
            "start_time": self.start_time,
            "settled_time": self.settled_time,
            "contacts": self.contacts,
            "stages": self.stages,
            "events": len(self.events),
            "energy": asdict(self.energy),
            "end_time": self.end_time,
            **({"positions": self.by_position()} if self.positions else {}),
        }


class ChainRecorder(Recorder):
    """One start of a chain in the kernel."""

    def __init__(self, given: Numbers, sees: int, rows: int = FIRST_ROWS) -> None:
        super().__init__(given.p, sees, recording=False)
        self.start = given.start(rows)
        self.x, self.m = self.start.x, self.start.m

    def begin(self, until: float) -> None:
        kernel.begin(self.start, until)

    def advance(self) -> int:
        reason: int = kernel.advance(self.start)
        return reason

    def run(self, step: Any, numbers: Vector, state: Vector, command: Vector) -> int:
        reason: int = kernel.run(step, numbers, self.sees, self.start, self.measured, state, command)
        return reason

    def measure(self) -> None:
        kernel.measure_chain(self.start, self.sees, self.measured)

    def grow(self) -> None:
        start = self.start
        if start.x[layout.N_SEGMENTS] < start.spans.size:
            self.start = start._replace(events=_doubled(start.events))
            return
        self.start = start._replace(
            spans=_doubled(start.spans),
            span_masses=_doubled(start.span_masses),
            span_shafts=_doubled(start.span_shafts),
        )

    def finished(self) -> Start:
        """The start with the records that are filled."""
        start = self.start
        spans, events = int(start.x[layout.N_SEGMENTS]), int(start.x[layout.N_EVENTS])
        return start._replace(
            spans=start.spans[:spans].copy(),
            span_masses=start.span_masses[:spans].copy(),
            span_shafts=start.span_shafts[:spans].copy(),
            events=start.events[:events].copy(),
        )


def _doubled(rows: Record) -> Record:
    return np.concatenate([rows, np.zeros_like(rows)])


def mean_torque_of(machine: Drive | Chain) -> float:
    """M12avg of a drive or a chain under its starting torque, N m."""
    return machine.mean_torque if isinstance(machine, Chain) else float(metrics.base_torque(machine))


def _stored(given: Numbers, rows: Record) -> float:
    """The sum of the elastic energies of all shafts, in J, over recorded rows of shafts."""
    acting = np.isin(rows["mode"], [CONTACT, DOUBLED, JOINED])
    z = np.where(acting, rows["theta"] - rows["side"] * given.shafts["half"], 0.0)
    return float(np.sum(0.5 * given.shafts["c"] * z * z))


def angles_of(twist: Vector) -> Vector:
    """Angles of the masses relative to the first, rad, from the twists of the shafts; a row an instant."""
    return np.concatenate([np.zeros((len(twist), 1)), -np.cumsum(twist, axis=1)], axis=1)
