"""One start, finished: its states at any instant, its events, stages and figures."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import IO, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from softstart import formulas
from softstart.arrays import Matrix, Vector
from softstart.controller.base import Controller, label_of
from softstart.drive import Drive, Machine
from softstart.errors import InputError, SimulationError
from softstart.input.files import write_whole
from softstart.kernel import records as rec
from softstart.kernel.guard import FAULTS
from softstart.results import Result
from softstart.start import metrics
from softstart.start.engine import run_one
from softstart.start.kernel_input import MAX_EVENTS, SETTLING_PERIODS, KernelInput
from softstart.start.status import Status, status_of
from softstart.start.trajectory import StartRecorder, Trajectory

EVENT_NAMES = {
    rec.CLOSED: "gap closed",
    rec.OPENED: "gap opened",
    rec.STARTS: "load starts",
    rec.STOPS: "load stops",
    rec.TARGET_REACHED: "target speed reached",
    rec.RELEASED: "brake released",
    rec.IMPACT: "impact",
    rec.SETTLED: "impacts over, flanks press",
}
OF_MOTOR = {rec.STARTS: "motor starts", rec.STOPS: "motor stops"}
OF_GEAR = {rec.STARTS: "gear lets go", rec.STOPS: "gear holds"}
PLOT_POINTS = 1500


class Event(NamedTuple):
    """Something that happened at a located instant.

    `value` is the flank, the sign of the motion, the speed reached, or what an impact loses in J; `place` the
    index of the shaft or mass; `impulse` that of an impact in N m s.
    """

    time: float
    kind: str
    value: float
    place: int = 0
    impulse: float = 0.0


@dataclass(frozen=True)
class Stage:
    """A span with a gap between motor and load open (odd number) or none (even), [G]; times in s."""

    number: int
    start: float
    end: float
    side: int  # 0 gap open, +1 driving flank, -1 other flank, of the shaft beside the motor
    peak_torque: float  # signed, N m: largest |T| of the stage, of the shaft that is loaded most
    peak_time: float

    @property
    def duration(self) -> float:
        """Length in s."""
        return self.end - self.start


class Trace:
    """A state of a `Run` at the instants `t`, by its name in `Run.at`."""

    def __init__(self, meaning: str) -> None:
        self.__doc__ = meaning

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = name

    def __get__(self, run: Run, owner: type) -> Vector:
        return self if run is None else run._traces[self.name]


class Clipped(NamedTuple):
    """What a start's demand lost at the torque limits: its largest excess in N m, and for how long, s."""

    excess: float
    time: float


def named_states(states: Mapping[str, Vector], rows: KernelInput) -> dict[str, Vector]:
    """The states of a trajectory under the names of `Run.at`."""
    motor, load = int(rows.machine.motor), int(rows.machine.load)
    between = states["twist"][:, min(motor, load) : max(motor, load)].sum(axis=1)
    of_masses = {
        "phi1": states["phi"][:, motor], "phi2": states["phi"][:, load], "w1": states["w"][:, motor],
        "w2": states["w"][:, load], "theta": between if motor < load else -between,
    }  # fmt: skip
    single = states["T"][:, 0] if rows.count == 2 else states["T"]
    v = of_masses["w1"] - of_masses["w2"]
    return {**states, **of_masses, "v": v, "torques": states["T"], "T": single}


def write_columns(path: str | Path, columns: Mapping[str, Vector]) -> None:
    """Write columns of numbers under their headings as CSV, with all digits."""
    table = np.column_stack(list(columns.values()))

    def write(stream: IO[str]) -> None:
        np.savetxt(stream, table, delimiter=",", header=",".join(columns), comments="", fmt="%.17g")

    write_whole(Path(path), write)


@dataclass(frozen=True, eq=False, repr=False)
class Run(Result, view="starts.run_sheet"):
    """One start under one controller. Angles in rad, speeds and torques at the motor shaft, in SI units.

    It is returned by `simulate`. The traces are for plotting; `at(times)` evaluates any instant exactly;
    peaks and events are located, not read off the traces. Traces have the shape (n,); those of all masses or
    shafts have a column for each.

    Attributes
    ----------
    drive : Drive or Chain
        The machine that was started.
    controller : Controller or None
        The controller as it was set up; None where the motor was off.
    base : Drive, Chain or None
        The machine to whose mean torque K_dyn refers, if not `drive`.
    status : Status
        How the start ended.
    trajectory : Trajectory
        The start as the kernel recorded it.
    positions : mapping of str to Run
        The starts from each position, if it is unknown. Then K_dyn, peaks with their instants, impulses,
        impact speed, excess of the demand, start and settled times are the largest among them, each by
        itself. Traces, events, stages, contacts, energy and end of the run are those of `shown`.
    design_drive : Drive or None
        The drive whose numbers the controller works with, if not `drive`.

    Examples
    --------
    >>> from softstart import Drive, simulate
    >>> run = simulate(Drive.load("crane-4amtkf"), "direct")
    >>> run.status.success, run.status.message
    (True, 'The load reached its target speed.')
    >>> [round(stage.duration, 4) for stage in run.stages[:2]]
    [0.0166, 0.0367]
    >>> float(run.at(run.peak_time)["T"].round(6)) == round(run.peak_torque, 6)
    True
    >>> simulate("crane-4-mass", "direct").k_dyns.round(2)
    array([6.3 , 3.78, 3.63])

    References
    ----------
    [G]: the stages (1) to (15), K_dyn (16), of the first contact (17) and (18); everything at one shaft: [R].
    """

    drive: Any  # a Machine; what only drives or only chains have is asked for too
    controller: Controller | None
    base: Machine | None
    status: Status
    trajectory: Trajectory
    design_drive: Drive | None = None
    positions: Mapping[str, Run] = field(default_factory=dict)

    def __repr__(self) -> str:
        """One line that says what came out.

        >>> from softstart import Drive, simulate
        >>> simulate(Drive.load("crane-4amtkf"), "direct")
        <Run: direct on Crane travel drive 4AMTKF(H)112L6, K_dyn 3.118, start time 0.3735 s>
        """
        known = f"K_dyn {self.k_dyn:.3f}" if self._has_base else f"peak torque {self.peak_torque:.4g} N m"
        reached = not math.isnan(self.limited_time)
        outcome = f"{self.limited_name} {self.limited_time:.4f} s" if reached else self.status.value
        return f"<Run: {self.controller_name} on {self.drive.name}, {known}, {outcome}>"

    @property
    def controller_name(self) -> str:
        """Name of the controller."""
        return "no motor torque" if self.controller is None else label_of(self.controller)

    @property
    def doubts(self) -> list[str]:
        """What the controller says against its own settings, a sentence each."""
        if self.controller is None or self.drive.motor is None:
            return []
        return self.controller.doubts(self.design_drive or self.drive.design_drive)

    @property
    def position(self) -> str:
        """Where the start begins, of an unknown position the worst for the shaft; "" for an angle."""
        if self.positions:
            return max(self.positions, key=lambda name: float(self.positions[name].peak_torque))
        return str(next(iter(self.drive.positions)))

    @property
    def each(self) -> tuple[Run, ...]:
        """The starts from each position, this one alone where that is known."""
        return tuple(self.positions.values()) or (self,)

    @property
    def shown(self) -> Run:
        """The start to which traces, events and stages belong: of an unknown position that of `position`."""
        return self.positions[self.position] if self.positions else self

    def _worst(self, figure: Callable[[Run], float], worst: np.ufunc = np.maximum) -> float:
        """A figure of this start, or the largest of those from each position."""
        return float(worst.reduce([figure(run) for run in self.each]))

    def _of_shafts(self, name: str) -> Matrix:
        """What the kernel notes of each shaft: a row for each position, a column for each shaft."""
        return np.stack([run.trajectory.shafts[name] for run in self.each])

    # figures -------------------------------------------------------------------------------------------

    @property
    def _notes(self) -> rec.ResultRecord:
        return self.trajectory.notes

    @property
    def peak_torques(self) -> Vector:
        """Largest |T| of each shaft, N m, located; impacts of rigid flanks have `peak_impulses` instead."""
        peaks: Vector = np.abs(self._of_shafts("peak")).max(axis=0)
        return peaks

    @property
    def peak_times(self) -> Vector:
        """When |T| of each shaft is largest, s: in the start in which it is."""
        where = np.abs(self._of_shafts("peak")).argmax(axis=0)
        times: Vector = self._of_shafts("peak_time")[where, np.arange(where.size)]
        return times

    @property
    def peak_impulses(self) -> Vector:
        """Largest impulse of each shaft's impacts, N m s; 0 where none was."""
        impulses: Vector = self._of_shafts("impulse").max(axis=0)
        return impulses

    @property
    def motor_shaft(self) -> int:
        """The index of the shaft beside the motor, on the way to the load."""
        return self.trajectory.input.motor_shaft

    @property
    def worst_shaft(self) -> int:
        """The index of the shaft with the largest torque at the motor shaft."""
        return int(self.peak_torques.argmax())

    @property
    def peak_torque(self) -> float:
        """Largest |T| of all shafts, N m."""
        return float(self.peak_torques[self.worst_shaft])

    @property
    def peak_torque_at_output(self) -> float:
        """The same at the output of the gear of the drive, with its losses, N m; NaN without a gear."""
        gear = self.drive.gear
        return math.nan if gear is None else float(gear.to_output(self.peak_torque, "N*m"))

    @property
    def peak_time(self) -> float:
        """When that is, s."""
        return float(self.peak_times[self.worst_shaft])

    @property
    def _has_base(self) -> bool:
        return self.base is not None or self.drive.motor is not None

    @property
    def base_torque(self) -> float:
        """The mean torque to which K_dyn refers, N m: M12avg of `base`, or of the machine itself, [G](16)."""
        return float((self.base or self.drive).mean_torque)

    @property
    def k_dyn(self) -> float:
        """Dynamic coefficient of the whole run, [G](16): largest torque of all shafts over `base_torque`."""
        return float(self.k_dyns[self.worst_shaft])

    @property
    def k_dyns(self) -> Vector:
        """Dynamic coefficient of each shaft."""
        return np.asarray(formulas.dynamic_coefficient(self.peak_torques, self.base_torque))

    @property
    def k_dyn_first_contact(self) -> float:
        """Dynamic coefficient of stage 2 alone, the one that [G] gives in (17) and (18); NaN without one.

        Where the run ends within stage 2 it is the one so far. A start in contact begins with stage 2.
        """

        def of_stage_2(run: Run) -> float:
            if math.isnan(run.trajectory.notes.stage_2_end):
                return math.nan
            peak = float(np.abs(run.trajectory.shafts["first_peak"]).max())
            return float(formulas.dynamic_coefficient(peak, self.base_torque))

        return self._worst(of_stage_2, np.fmax)

    @property
    def shaft_factors(self) -> Vector:
        """Largest |T| of each shaft over its own mean torque under full starting torque; NaN if that is 0."""
        mean = np.abs(self.drive.shaft_means)
        return self.peak_torques / np.where(mean > 0.0, mean, np.nan)

    @property
    def utilisation(self) -> Vector:
        """Largest |T| of each shaft over its permissible torque; NaN where none is given."""
        return self.peak_torques / self.drive.permissible_torques

    @property
    def permissible_torque(self) -> float:
        """What the shaft permits that is loaded most, N m at the motor shaft; NaN where it is not given."""
        return float(self.drive.permissible_torques[self.worst_shaft])

    @property
    def used_torque(self) -> float:
        """Largest |T| over the permissible torque of its shaft, %; 0 where none is given."""
        return 100.0 * float(np.nan_to_num(self.utilisation).max())

    @property
    def start_time(self) -> float:
        """First instant at which the load has its target speed, s; NaN if it never has.

        Counted from the command of the start, so that it includes what the torque takes to release a brake.
        """
        return self._worst(lambda run: float(run.trajectory.notes.start_time))

    @cached_property
    def settled_time(self) -> float:
        """From when on the load keeps its speed, s; NaN if it does not.

        Under a strategy that holds the speed: within 2 % of the target, to the end of the run. Under a torque
        strategy: not below 99.9 % of the target, and never before the start time. This is judged over five
        elastic periods after that, for which the run is computed further where it is shorter; see
        `metrics.settled_time`.
        """
        if self.regulated:
            return self._worst(lambda run: float(run.trajectory.notes.settled))
        target = float(self.drive.target_speed)
        return self._worst(lambda run: metrics.settled_time(run._continued.trajectory, target))

    @property
    def regulated(self) -> bool:
        """Whether the strategy holds the speed, so that the load settles in a band on both sides of it."""
        return bool(self.trajectory.input.machine.regulated)

    @property
    def fault(self) -> str:
        """The fault at which a sampled controller gave up, after which it demands no torque; "" for none."""
        return FAULTS[int(self._worst(lambda run: float(run.trajectory.notes.fault)))]

    @property
    def overshoot(self) -> float:
        """Share of the target speed by which the load exceeds it at most; NaN under a torque strategy."""
        return self._worst(lambda run: float(run.trajectory.notes.overshoot))

    @property
    def band(self) -> float:
        """Share of the target speed within which the load settles under a strategy that holds the speed."""
        target = float(self.drive.target_speed)
        return float(self.trajectory.input.machine.band_high) / target - 1.0 if self.regulated else math.nan

    @property
    def limited_time(self) -> float:
        """What a limit on the start time bounds, s: the settled time under a strategy that holds the speed.

        Such a load may settle without passing its target. Under a torque strategy it is the start time.
        """
        return self.settled_time if self.regulated else self.start_time

    @property
    def limited_name(self) -> str:
        """Its name: "start time" or "settled time"."""
        return "settled time" if self.regulated else "start time"

    @property
    def settling_end(self) -> float:
        """Until when it is judged whether the load has settled, s."""
        return self.start_time + SETTLING_PERIODS * self.elastic_period

    def settling_time(self, band: float = 0.1) -> float:
        """From when on the shaft torque stays settled, s; NaN if it does not within the run.

        That of the load speed is `settled_time`.

        Settled: the gap stays closed and |T - M12avg| <= band * M12avg_base, where M12avg is the mean torque
        of the shaft beside the motor under the torques of the instant, of a drive (u J2 + Mc J1)/(J1 + J2),
        friction included. It must hold for one elastic period at least, to the end of the run.

        Raises:
            InputError: If `band` is not a finite number above 0.
        """
        if not 0.0 < band < math.inf:
            raise InputError(f"band = {band}: the band is a share of the mean torque above 0, e.g. 0.1.")

        def settled(run: Run) -> float:
            if not run.stages or run.stages[-1].number % 2:
                return math.nan
            begin, last = run.stages[-1].start, run.end_time - run.elastic_period
            if begin > last:
                return math.nan  # too short to be called settled
            time = run.trajectory.torque_settles(run.motor_shaft, begin, band * run.base_torque)
            return time if time <= last else math.nan

        return self._worst(settled)

    @property
    def elastic_period(self) -> float:
        """The period of the first natural frequency with all gaps closed, 2 pi/Omega, s."""
        return float(self.trajectory.input.machine.period)

    @property
    def end_time(self) -> float:
        """End of the run, s."""
        return float(self._notes.time)

    @property
    def release_time(self) -> float:
        """When the brake was released, s; NaN without a brake, or if it was not."""
        return float(self._notes.release_time)

    @property
    def first_contact(self) -> float:
        """Instant of the first contact, s: the length of stage 1. Of a chain, when the last gap closes."""
        return float(self._notes.first_contact)

    @property
    def impact_speed(self) -> float:
        """Speed at which the flanks first meet, rad/s: dw12 of [G](10)."""
        return self._worst(lambda run: float(run.trajectory.notes.impact_speed), np.fmax)

    @property
    def torque_at_contact(self) -> float:
        """Motor torque at the first contact, N m."""
        return float(self._notes.contact_torque)

    @property
    def contacts(self) -> int:
        """How often the gaps between motor and load came to be closed; a start in contact counts as one."""
        return int(self._notes.contacts)

    @property
    def clipped(self) -> Clipped:
        """How far, and for how long, the demand lay beyond the torque limits; inf: an infinite excess."""
        excess = self._worst(lambda run: float(run.trajectory.notes.excess))
        return Clipped(excess, self._worst(lambda run: float(run.trajectory.notes.excess_time)))

    @property
    def stage_durations(self) -> tuple[float, float]:
        """Lengths of stages 1 and 2, s: 0 for stage 1 of a start in contact; NaN where one does not end."""
        by_number = {stage.number: stage for stage in self.stages}
        last = self.stages[-1].number if self.stages else 0
        first, second = (by_number[n].duration if n in by_number and n != last else math.nan for n in (1, 2))
        if self.stages and self.stages[0].number == 2:
            first = 0.0
        return first, second

    def _kind(self, event: np.void) -> str:
        kind, place, machine = int(event["kind"]), int(event["place"]), self.trajectory.input
        if kind in OF_GEAR:
            mass = machine.masses[0, place].view(rec.MASS)[0]
            if mass.friction > 0.0 and place == int(machine.machine.motor):
                return OF_MOTOR[kind]
            if mass.Mc == 0.0:
                return OF_GEAR[kind]
        return EVENT_NAMES[kind]

    @cached_property
    def events(self) -> tuple[Event, ...]:
        """All events in order of time."""
        rows = self.trajectory.events[np.argsort(self.trajectory.events["time"], kind="stable")]
        return tuple(
            Event(float(e["time"]), self._kind(e), float(e["value"]), int(e["place"]), float(e["impulse"]))
            for e in rows
        )

    @cached_property
    def stages(self) -> tuple[Stage, ...]:
        """All stages that take time; the last one ends with the run."""
        peaks, sides = self.trajectory.stage_peaks(), self.trajectory.of_shafts("side")[:, self.motor_shaft]
        at_start = self.trajectory.index(peaks[:, 1])
        stages = []
        for row, span in zip(peaks, at_start, strict=True):
            number, torques, times = int(row[0]), row[3::2], row[4::2]
            worst = int(np.abs(torques).argmax())
            side = 0 if number % 2 else int(sides[span])
            peak = float(torques[worst]), float(times[worst])
            stages.append(Stage(number, float(row[1]), float(row[2]), side, *peak))
        return tuple(stages)

    @property
    def _continued(self) -> Run:
        """The same start to the end of settling at least; this one where it fails beyond its own end."""
        if self.controller is None or not self.end_time < self.settling_end:
            return self
        recorder = StartRecorder(
            self.trajectory.input.with_limits(max_events=MAX_EVENTS), int(self.controller.sensors)
        )
        try:
            reason = run_one(self.controller, self.design_drive or self.drive, recorder, self.settling_end)
        except SimulationError:
            return self
        if not status_of(reason, True, True).finished:
            return self
        return replace(self, trajectory=recorder.finished())

    # states --------------------------------------------------------------------------------------------

    def at(self, times: ArrayLike) -> dict[str, Vector]:
        """States at any instants within the run, evaluated from the series of their spans.

        Returns arrays of the shape of `times` under phi1, phi2, w1, w2 (of motor and load), theta (= phi1 -
        phi2), v (= w1 - w2), u, and T of a single shaft; phi and w have a last axis of masses, twist, torques
        and T of several a last axis of shafts. Where something jumps the value is the one after the jump.
        """
        when = np.asarray(times, dtype=np.float64)
        flat = np.ascontiguousarray(when.ravel())
        if flat.size and not (flat.min() >= 0.0 and flat.max() <= self.end_time * (1 + 1e-12)):
            raise ValueError(f"times must lie within the run, 0 to {self.end_time:.6g} s.")
        every = named_states(self.trajectory.at(flat), self.trajectory.input)
        return {
            name: values.reshape(when.shape if values.ndim == 1 else (*when.shape, values.shape[1]))
            for name, values in every.items()
        }

    @cached_property
    def t(self) -> Vector:
        """Instants of the traces, s: an even grid and every event and located peak."""
        edges = self.trajectory.events["time"]
        grid = np.linspace(0.0, self.end_time, PLOT_POINTS)
        peaks = [self.trajectory.shafts["peak_time"], [stage.peak_time for stage in self.stages]]
        when = np.concatenate([grid, edges, np.nextafter(edges, 0.0), *peaks])
        return np.unique(when.clip(0.0, self.end_time))

    @cached_property
    def _traces(self) -> dict[str, Vector]:
        return self.at(self.t)

    phi = Trace("Angles of the masses, rad; that of the load is 0 at the start.")
    w = Trace("Speeds of the masses, rad/s.")
    twist = Trace("Twists of the shafts, rad.")
    torques = Trace("Torques of the shafts, N m, a column for each.")
    T = Trace("Shaft torque, N m; of several shafts a column for each.")
    u = Trace("Motor torque, N m.")
    phi1 = Trace("Angle of the motor, rad.")
    phi2 = Trace("Angle of the load, rad.")
    w1 = Trace("Speed of the motor, rad/s.")
    w2 = Trace("Speed of the load, rad/s.")
    theta = Trace("Twist phi1 - phi2, rad.")

    def columns(self, times: ArrayLike | None = None) -> dict[str, Vector]:
        """The states by headings with units, at `times` or the plot's instants."""
        instants = self.t if times is None else np.asarray(times, dtype=np.float64).ravel()
        return {"t [s]": instants, **self.drive.columns_of(self.at(instants))}

    def to_dataframe(self, times: ArrayLike | None = None) -> Any:
        """The same as a pandas.DataFrame."""
        import pandas  # comes with xarray

        return pandas.DataFrame(self.columns(times))

    def to_csv(self, path: str | Path, times: ArrayLike | None = None) -> None:
        """Write the states under a header with units, at `times` or the plot's instants."""
        write_columns(path, self.columns(times))

    @cached_property
    def energy(self) -> metrics.Energy:
        """Energy balance of the run."""
        return metrics.energy_balance(self.trajectory)

    def by_position(self) -> dict[str, Any]:
        """K_dyn and start time from each position, and which is the worst for the shaft."""
        each = {
            name: {"k_dyn": run.k_dyn, "start_time": run.start_time, "settled_time": run.settled_time}
            for name, run in self.positions.items()
        }
        return {"worst": self.position, **each}

    def summary(self) -> dict[str, object]:
        """All figures under the names used everywhere (JSON, tables, docs)."""
        first, second = self.stage_durations
        known = self._has_base
        return {
            **self.drive.identity,
            "controller": self.controller_name,
            "parameters": {} if self.controller is None else self.controller.parameters,
            "status": self.status.name,
            "status_text": self.status.value,
            **({"fault": self.fault} if self.fault else {}),
            "clipped": self.clipped._asdict(),
            "k_dyn": self.k_dyn if known else None,
            "k_dyn_first_contact": self.k_dyn_first_contact if known else None,
            "base": None if self.base is None else self.base.name,
            "base_torque": self.base_torque if known else None,
            "k_dyns": self.k_dyns.tolist() if known else None,
            "shaft_factors": [None if math.isnan(share) else share for share in self.shaft_factors.tolist()],
            "worst_shaft": self.drive.shaft_names[self.worst_shaft],
            "utilisation": [None if math.isnan(share) else share for share in self.utilisation.tolist()],
            "peak_torque": self.peak_torque,
            **({} if self.drive.gear is None else {"peak_torque_at_output": self.peak_torque_at_output}),
            "peak_time": self.peak_time,
            "peak_torques": self.peak_torques.tolist(),
            "peak_times": self.peak_times.tolist(),
            "peak_impulses": self.peak_impulses.tolist(),
            "start_time": self.start_time,
            "first_contact": self.first_contact,
            "contacts": self.contacts,
            "impact_speed": self.impact_speed,
            "torque_at_contact": self.torque_at_contact,
            "stage_1_duration": first,
            "stage_2_duration": second,
            "stages": int(self._notes.stage),
            "events": len(self.trajectory.events),
            "settled_time": self.settled_time,
            **({"overshoot": self.overshoot} if self.regulated else {}),
            "torque_settling_time": self.settling_time() if known else None,
            "energy": {**asdict(self.energy), "dissipated": self.energy.dissipated},
            "end_time": self.end_time,
            **({} if math.isnan(self.release_time) else {"release_time": self.release_time}),
            **({"positions": self.by_position()} if self.positions else {}),
        }


def worst_run(runs: Mapping[str, Run], machine: Machine) -> Run:
    """The start of a machine whose position is unknown, from those of each position."""
    hardest = max(runs.values(), key=lambda run: run.peak_torque)
    statuses = [run.status for run in runs.values()]
    status = max(statuses, key=list(Status).index)  # of those that end a run: not released is worst
    return replace(hardest, drive=machine, status=status, positions=dict(runs))
