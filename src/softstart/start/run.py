"""One start, finished: its states at any instant, its events, stages and figures."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import IO, Any, NamedTuple, Self, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softstart.controller.base import Controller
from softstart.drive import Drive
from softstart.errors import SimulationError
from softstart.input.files import write_whole
from softstart.late import late
from softstart.plant import layout as at
from softstart.plant import record
from softstart.start import metrics
from softstart.start.engine import MAX_EVENTS, Recorder, run_one
from softstart.start.status import Status, status_of

Vector = NDArray[np.float64]
notebook = late("softstart.views.notebook")
starts = late("softstart.views.starts")  # above this module; see softstart.late

EVENT_NAMES = {
    at.CLOSED: "gap closed",
    at.OPENED: "gap opened",
    at.LOAD_STARTS: "load starts",
    at.LOAD_STOPS: "load stops",
    at.TARGET_REACHED: "target speed reached",
    at.RELEASED: "brake released",
    at.MOTOR_STARTS: "motor starts",
    at.MOTOR_STOPS: "motor stops",
}
AnyRun = TypeVar("AnyRun", bound="BaseRun")
PLOT_POINTS = 1500
SETTLING_PERIODS = 5.0  # elastic periods after the start time, over which a load must keep its speed


@dataclass(frozen=True)
class Event:
    """Something that happened at a located instant: time in s, what, and with which flank or sign."""

    time: float
    kind: str
    value: float


@dataclass(frozen=True)
class Stage:
    """A span with the gap open (odd number) or closed (even), [G]; times in s, peak torque in N m."""

    number: int
    start: float
    end: float
    side: int  # 0 gap open, +1 driving flank, -1 other flank
    peak_torque: float  # signed, largest |T| of the stage
    peak_time: float

    @property
    def duration(self) -> float:
        """Length in s."""
        return self.end - self.start


class Clipped(NamedTuple):
    """What a start's demand lost at the torque limits: its largest excess in N m, and for how long, s."""

    excess: float
    time: float


class BaseRun(ABC):
    """What finished starts of drives and of chains have in common."""

    drive: Any  # Drive or Chain
    controller: Controller | None
    status: Status
    positions: Mapping[str, Any]

    def _repr_html_(self) -> Any:
        """What a notebook shows."""
        return notebook.of_run(self)

    @property
    @abstractmethod
    def elastic_period(self) -> float:
        """Its elastic period, s."""

    @property
    @abstractmethod
    def k_dyn(self) -> float:
        """Dynamic coefficient of the whole run, [G](16)."""

    @property
    @abstractmethod
    def _continued(self) -> Self:
        """The same start to the end of settling at least; this one where it fails beyond its own end."""

    @abstractmethod
    def load_at(self, times: ArrayLike) -> tuple[Vector, Vector]:
        """Speed of the load, rad/s, and the torque that speeds it up, N m, at any instants of the run."""

    @property
    @abstractmethod
    def peak_torque(self) -> float:
        """Largest |T| of the (motor's) shaft, N m, located."""

    @property
    @abstractmethod
    def _final(self) -> Vector:
        """The kernel's state at the end."""

    @abstractmethod
    def at(self, times: ArrayLike) -> dict[str, Vector]:
        """States at any instants within the run."""

    @abstractmethod
    def _edges(self) -> Vector:
        """Times of the events, s."""

    @abstractmethod
    def _peak_times(self) -> Vector:
        """Times of the peaks that are located, s."""

    @abstractmethod
    def _columns(self, states: dict[str, Vector]) -> dict[str, Vector]:
        """The columns of `to_csv` after the time, by their headings."""

    @property
    def controller_name(self) -> str:
        """Name of the controller."""
        if self.controller is None:
            return "no motor torque"
        return self.controller.name or type(self.controller).__name__

    @property
    def _outcome(self) -> str:
        """The start time in words, or why there is none."""
        if math.isnan(self.start_time):
            return self.status.value
        return f"start time {self.start_time:.4f} s"

    @property
    def position(self) -> str:
        """Where the start begins, of an unknown position the worst for the shaft; "" for an angle."""
        if self.positions:
            return max(self.positions, key=lambda name: float(self.positions[name].peak_torque))
        return str(next(iter(self.drive.positions)))

    def _worst(self, figure: Callable[[Any], float], worst: Any = np.maximum) -> float:
        """A figure of this start, or the largest of those from each position."""
        runs = self.positions.values() or (self,)
        return float(worst.reduce([figure(run) for run in runs]))

    @property
    def start_time(self) -> float:
        """First instant at which the load has its target speed, s; NaN if it never has.

        Counted from the command of the start, so that it includes what the torque takes to release a brake.
        """
        return self._worst(lambda run: float(run._final[at.START_TIME]))

    @cached_property
    def settled_time(self) -> float:
        """From when on the load keeps its speed, not below 99.9 % of the target, s; NaN if it does not.

        Never before the start time. It is judged over five elastic periods after that, for which the run is
        computed further where it is shorter. See `metrics.settled_time` for the definition.
        """
        return self._worst(lambda run: metrics.settled_time(run._continued))

    @property
    def settling_end(self) -> float:
        """Until when it is judged whether the load has settled, s."""
        return self.start_time + SETTLING_PERIODS * self.elastic_period

    @property
    def used_torque(self) -> float:
        """Largest |T| over the permissible torque of its shaft, %; 0 where none is given for it."""
        return 0.0

    @property
    def end_time(self) -> float:
        """End of the run, s."""
        return float(self._final[at.TIME])

    @property
    def clipped(self) -> Clipped:
        """How far, and for how long, the demand lay beyond the torque limits; inf: an infinite excess."""
        excess = self._worst(lambda run: float(run._final[at.EXCESS]))
        return Clipped(excess, self._worst(lambda run: float(run._final[at.EXCESS_TIME])))

    def _instants(self, times: ArrayLike) -> Vector:
        """The times as one row; raises ValueError for one outside of the run."""
        flat = np.ascontiguousarray(np.asarray(times, dtype=np.float64).ravel())
        if flat.size and not (flat.min() >= 0.0 and flat.max() <= self.end_time * (1 + 1e-12)):
            raise ValueError(f"times must lie within the run, 0 to {self.end_time:.6g} s.")
        return flat

    @cached_property
    def t(self) -> Vector:
        """Instants of the traces, s: an even grid and every event and located peak."""
        edges = self._edges()
        grid = np.linspace(0.0, self.end_time, PLOT_POINTS)
        when = np.concatenate([grid, edges, np.nextafter(edges, 0.0), self._peak_times()])
        return np.unique(when.clip(0.0, self.end_time))

    @cached_property
    def _traces(self) -> dict[str, Vector]:
        return self.at(self.t)

    @property
    def u(self) -> Vector:
        """Motor torque, N m."""
        return self._traces["u"]

    @property
    def T(self) -> Vector:
        """Shaft torque, N m; of a chain a column for each shaft."""
        return self._traces["T"]

    def to_csv(self, path: str | Path, times: ArrayLike | None = None) -> None:
        """Write the states under a header with units, at `times` or the plot's instants."""
        when = self.t if times is None else np.asarray(times, dtype=np.float64).ravel()
        columns = {"t [s]": when, **self._columns(self.at(when))}
        header, table = ",".join(columns), np.column_stack(list(columns.values()))

        def write(stream: IO[Any]) -> None:
            np.savetxt(stream, table, delimiter=",", header=header, comments="", fmt="%.17g")

        write_whole(Path(path), write)

    def by_position(self) -> dict[str, Any]:
        """K_dyn and start time from each position, and which is the worst for the shaft."""
        each = {
            name: {"k_dyn": run.k_dyn, "start_time": run.start_time, "settled_time": run.settled_time}
            for name, run in self.positions.items()
        }
        return {"worst": self.position, **each}

    def _controller_and_status(self) -> dict[str, Any]:
        """What every summary says of them."""
        return {
            "controller": self.controller_name,
            "parameters": {} if self.controller is None else self.controller.parameters,
            "status": self.status.name,
            "status_text": self.status.value,
            "clipped": self.clipped._asdict(),
        }


@dataclass(frozen=True, eq=False, repr=False)
class Run(BaseRun):
    """One start under one controller. All angles in rad at the motor shaft, SI units.

    It is returned by `simulate`. The traces are for plotting; `at(times)` evaluates any instant exactly;
    peaks and events are located, not read off the traces.

    Attributes
    ----------
    drive : Drive
        The drive that was started.
    controller : Controller
        The controller as it was set up.
    base : Drive
        The drive to whose mean torque K_dyn refers.
    status : Status
        How the start ended.
    t : array of shape (n,)
        Instants of the traces, s.
    phi1, phi2 : array of shape (n,)
        Angles of motor and load, rad.
    w1, w2 : array of shape (n,)
        Speeds of motor and load, rad/s.
    theta : array of shape (n,)
        Twist phi1 - phi2, rad.
    u, T : array of shape (n,)
        Motor torque after limits and lag, and shaft torque, N m.
    k_dyn, k_dyn_first_contact : float
        Dynamic coefficient of the whole run, and of stage 2 alone.
    peak_torque, peak_time : float
        Largest |T|, N m, and its instant, s.
    clipped : Clipped
        How far (`excess`, N m) and for how long (`time`, s) the controller's demand lay beyond the torque
        limits of the drive, where it is cut off.
    start_time, end_time : float
        First instant at which the load has its target speed (NaN if never), and end of the run, s.
    events : tuple of Event
        Contacts and others, in order of time.
    stages : tuple of Stage
        Spans with the gap open (odd number) or closed (even).
    plant, final : array of one dimension
        Parameters of the drive as the kernel has them, and its state and figures at the end.
    segments, event_rows, stage_rows : array of two dimensions
        Records of the kernel: a row for each span, event and stage.
    position : str
        Where the start begins: a word of `start_position`, "" for an angle. Of an unknown position the one
        with the largest |T|, to which traces, events and stages belong.
    positions : mapping of str to Run
        The starts from each position, if it is unknown. Then K_dyn, impact speed, start and settled time are
        the largest among them.
    told : Drive or None
        The drive whose numbers the controller works with, if not `drive`.

    Examples
    --------
    >>> from softstart import Drive, simulate
    >>> run = simulate(Drive.load("crane-4amtkf"), "direct")
    >>> run.status.value
    'The load reached its target speed.'
    >>> [round(stage.duration, 4) for stage in run.stages[:2]]
    [0.0166, 0.0367]
    >>> float(run.at(run.peak_time)["T"].round(6)) == round(run.peak_torque, 6)
    True

    References
    ----------
    [G]: the stages (1) to (15), K_dyn (16), of the first contact (17) and (18); docs/theory/stages.md.
    """

    drive: Drive
    controller: Controller
    base: Drive
    status: Status
    plant: Vector
    final: Vector
    segments: at.Matrix
    event_rows: at.Matrix
    stage_rows: at.Matrix
    positions: Mapping[str, Run] = field(default_factory=dict)
    told: Drive | None = None

    def __repr__(self) -> str:
        """One line that says what came out.

        >>> from softstart import Drive, simulate
        >>> simulate(Drive.load("crane-4amtkf"), "direct")
        <Run: direct on Crane travel drive 4AMTKF(H)112L6, K_dyn 3.118, start time 0.3735 s>
        """
        name = f"{self.controller_name} on {self.drive.name}"
        return f"<Run: {name}, K_dyn {self.k_dyn:.3f}, {self._outcome}>"

    # figures -------------------------------------------------------------------------------------------

    @property
    def peak_torque(self) -> float:
        """Largest |T| of the run, N m, located."""
        return abs(float(self.final[at.PEAK]))

    @property
    def peak_time(self) -> float:
        """When |T| is largest, s."""
        return float(self.final[at.PEAK_TIME])

    @property
    def k_dyn(self) -> float:
        """Dynamic coefficient of the whole run, [G](16): peak torque over the mean torque of `base`."""
        return float(metrics.k_dyn(self.peak_torque, self.base))

    @property
    def elastic_period(self) -> float:
        """The elastic period of the drive, 2 pi/Omega, s."""
        return float(self.drive.elastic_period)

    def load_at(self, times: ArrayLike) -> tuple[Vector, Vector]:
        """Speed of the load, rad/s, and the torque that speeds it up, N m, at any instants of the run."""
        states = self.at(times)
        return states["w2"], states["T"] - self.drive.Mc - self.drive.load_viscous_friction * states["w2"]

    @property
    def _continued(self) -> Run:
        """The same start to the end of settling at least; this one where it fails beyond its own end."""
        if not self.end_time < self.settling_end:
            return self
        p = self.plant.copy()
        p.view(at.PLANT)[0]["event_cap"] = MAX_EVENTS
        recorder = Recorder(p, int(self.controller.sensors))
        try:
            reason = run_one(self.controller, self.told or self.drive, recorder, self.settling_end)
        except SimulationError:
            return self
        if not status_of(reason, True, True).finished:
            return self
        segments, events, stages = recorder.rows()
        final = recorder.x.copy()
        return replace(self, final=final, segments=segments, event_rows=events, stage_rows=stages)

    @property
    def release_time(self) -> float:
        """When the brake was released, s; NaN without a brake, or if it was not."""
        return float(self.final[at.RELEASE_TIME])

    @property
    def k_dyn_first_contact(self) -> float:
        """Dynamic coefficient of stage 2 alone, the one that [G] gives in (17) and (18); NaN without one.

        Where the run ends within stage 2 it is the one so far. A start in contact begins with stage 2.
        """

        def own(run: Run) -> float:
            ended = not math.isnan(run.final[at.STAGE_2_END])
            return float(metrics.k_dyn(run.final[at.FIRST_PEAK], self.base)) if ended else math.nan

        return self._worst(own, np.fmax)

    @property
    def first_contact(self) -> float:
        """Instant of the first contact, s: the length of stage 1."""
        return float(self.final[at.FIRST_CONTACT])

    @property
    def impact_speed(self) -> float:
        """Speed at which the flanks first meet, rad/s: dw12 of [G](10)."""
        return self._worst(lambda run: float(run.final[at.IMPACT_SPEED]), np.fmax)

    @property
    def torque_at_contact(self) -> float:
        """Motor torque at the first contact, N m."""
        return float(self.final[at.CONTACT_TORQUE])

    @property
    def contacts(self) -> int:
        """How often the gap closed; a start in contact counts as one, though there is no event."""
        return int(self.final[at.CONTACTS])

    @property
    def stage_durations(self) -> tuple[float, float]:
        """Lengths of stages 1 and 2, s; NaN for a stage that does not end within the run or is not there."""
        by_number = {stage.number: stage for stage in self.stages}
        last = self.stages[-1].number if self.stages else 0
        first, second = (by_number[n].duration if n in by_number and n != last else math.nan for n in (1, 2))
        return first, second

    @cached_property
    def events(self) -> tuple[Event, ...]:
        """All events in order of time."""
        return tuple(Event(float(t), EVENT_NAMES[float(kind)], float(v)) for t, kind, v in self.event_rows)

    @cached_property
    def stages(self) -> tuple[Stage, ...]:
        """All stages; the last one ends with the run."""
        return tuple(
            Stage(int(n), float(start), float(end), int(side), float(peak), float(when))
            for n, start, end, side, peak, when in self.stage_rows
        )

    # states --------------------------------------------------------------------------------------------

    def at(self, times: ArrayLike) -> dict[str, Vector]:
        """States at any instants within the run, evaluated from the closed forms.

        Returns arrays of the shape of `times` under phi1, phi2, w1, w2, u, T, theta (= phi1 - phi2) and v
        (= w1 - w2). At an instant where a torque jumps the value is the one after the jump.
        """
        when = np.asarray(times, dtype=np.float64)
        flat = self._instants(when)
        index = np.searchsorted(self.segments[:, at.S_START], flat, side="right") - 1
        states = self.states_in(index.clip(0), flat)
        return {name: values.reshape(when.shape) for name, values in states.items()}

    def states_in(self, segment: NDArray[np.int64], times: Vector) -> dict[str, Vector]:
        """States at `times` by the motion of the given recorded spans: at a jump, the side one wants."""
        out = np.empty((times.size, record.N_OUT))
        flat = np.ascontiguousarray(times.ravel())
        scratch = np.zeros(at.N_X), np.zeros(at.N_M)
        record.states_at(self.plant, self.segments, segment.ravel(), flat, *scratch, out)
        names = ("phi1", "phi2", "w1", "w2", "u", "T", "theta", "v")
        return {name: out[:, i].reshape(times.shape) for i, name in enumerate(names)}

    @property
    def _final(self) -> Vector:
        return self.final

    def _edges(self) -> Vector:
        return self.event_rows[:, at.E_TIME]

    def _peak_times(self) -> Vector:
        return self.stage_rows[:, at.G_PEAK_TIME]

    def _columns(self, states: dict[str, Vector]) -> dict[str, Vector]:
        units = {"phi1": "rad", "phi2": "rad", "w1": "rad/s", "w2": "rad/s", "u": "N*m", "T": "N*m"}
        return {f"{name} [{unit}]": states[name] for name, unit in units.items()}

    @property
    def phi1(self) -> Vector:
        """Motor angle, rad."""
        return self._traces["phi1"]

    @property
    def phi2(self) -> Vector:
        """Load angle, rad."""
        return self._traces["phi2"]

    @property
    def w1(self) -> Vector:
        """Motor speed, rad/s."""
        return self._traces["w1"]

    @property
    def w2(self) -> Vector:
        """Load speed, rad/s."""
        return self._traces["w2"]

    @property
    def theta(self) -> Vector:
        """Twist phi1 - phi2, rad; contact is at |theta| = gap/2."""
        return self._traces["theta"]

    # what follows from them ----------------------------------------------------------------------------

    def settling_time(self, band: float = 0.1) -> float:
        """From when on the shaft torque stays settled, s; NaN if it does not within the run.

        That of the load speed is `settled_time`.

        Settled: the gap stays closed and |T - M12avg| <= band * M12avg_base, where M12avg is the mean shaft
        torque (u J2 + Mc J1)/(J1 + J2) under the motor torque of the instant, less its friction.
        """
        return self._worst(lambda run: metrics.settling_time(run, band))

    @cached_property
    def energy(self) -> metrics.Energy:
        """Energy balance of the run."""
        return metrics.energy_balance(self)

    def plot(self) -> Any:
        """Torques, speeds and twist over time, stages shaded."""
        return starts.run_figure(self)

    def summary(self) -> dict[str, Any]:
        """All figures under the names used everywhere (JSON, tables, docs)."""
        first, second = self.stage_durations
        return {
            "drive": self.drive.name,
            **self._controller_and_status(),
            "contact_law": self.drive.contact_law,
            "load_kind": self.drive.load_kind,
            "k_dyn": self.k_dyn,
            "k_dyn_first_contact": self.k_dyn_first_contact,
            "peak_torque": self.peak_torque,
            "peak_time": self.peak_time,
            "start_time": self.start_time,
            "first_contact": self.first_contact,
            "contacts": self.contacts,
            "impact_speed": self.impact_speed,
            "torque_at_contact": self.torque_at_contact,
            "stage_1_duration": first,
            "stage_2_duration": second,
            "settled_time": self.settled_time,
            "torque_settling_time": self.settling_time(),
            "energy": asdict(self.energy),
            "end_time": self.end_time,
            **({} if self.drive.brake == "none" else {"release_time": self.release_time}),
            **({"positions": self.by_position()} if self.positions else {}),
        }


def worst_run(runs: Mapping[str, AnyRun], **machine: Any) -> AnyRun:
    """The start of a drive or chain whose position is unknown, from those of each position.

    `machine` is its field: `drive`, or `chain`.
    """
    hardest = max(runs.values(), key=lambda run: run.peak_torque)
    statuses = [run.status for run in runs.values()]
    status = next((one for one in statuses if one is not Status.REACHED), Status.REACHED)
    return replace(hardest, **machine, status=status, positions=dict(runs))  # type: ignore[type-var]
