"""A machine through a duty of starts, stops, reversals, jogs and load changes: `run_duty`."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from numbers import Integral
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from softstart import formulas
from softstart.arrays import Matrix, Vector
from softstart.chain.machines import MachineLike, as_machine
from softstart.controller.base import Controller, label_of
from softstart.drive import Drive, Machine
from softstart.drive.duty import Duty, DutyStep, check_duty, way_of_stop
from softstart.errors import InputError
from softstart.results import OneLine, Result
from softstart.start.demand import ControllerLike, as_controller
from softstart.start.duty_cycle import DutyCycle, Phase
from softstart.start.duty_life import Counted, DutyLife, count_cycles, life_of
from softstart.start.fatigue import STILL, impact_energies
from softstart.start.metrics import REFERENCE
from softstart.start.recommendation import Margin
from softstart.start.run import named_states, write_columns
from softstart.start.trajectory import FIRST_ROWS
from softstart.views.numbers import units_of

KEPT_CYCLES = 2  # whose trace is kept
PLOT_POINTS = 3000
MOST_INSTANTS = 10_000  # of reversals, and of events, of a trace
STILL_IN_TRACE = 1e-4  # of the mean torque: smaller reversals need no instant of the trace


@dataclass(frozen=True, eq=False, repr=False)
class StepRun(OneLine):
    """A step of a duty as it was carried out. Torques and angles are at the motor shaft, in SI.

    Attributes
    ----------
    number : int
        The step in the file, from 1.
    step : DutyStep
        What was asked for.
    cycle : int
        In which cycle, from 1.
    how : str
        How the strategy, or the stop in its place, did it: "strategy", "strategy, anew in the other
        direction", "torque", "coast", "brake", ...
    begin, end : float
        Its first and last instant, s of the duty.
    time : float
        How long it took, s: of a stop until all masses stand.
    start_time : float
        Of a start or a reversal the time from its command until the load has its set speed, s: settled where
        the strategy holds the speed; else NaN.
    angle : float
        Angle by which the load turned, rad.
    largest, smallest : array of shape (n - 1,)
        Largest and smallest torque of each shaft, N m, signed.
    contacts : int
        How often the gaps between motor and load came to be closed.
    impact_energy : array of shape (n - 1,)
        Kinetic energy of the relative motion at all impacts of each shaft, J.
    impulses : array of shape (n - 1,)
        Largest impulse of each rigid gap, N m s.
    phases : tuple of Phase
        What is recorded of it; empty beyond the first cycles.
    turns : tuple of array of shape (k, 2)
        Time and torque of the turning points of each shaft; empty beyond the first cycles.
    """

    number: int
    step: DutyStep
    cycle: int
    how: str
    begin: float
    end: float
    time: float
    start_time: float
    angle: float
    largest: Vector
    smallest: Vector
    contacts: int
    impact_energy: Vector
    impulses: Vector
    phases: tuple[Phase, ...] = ()
    turns: tuple[Matrix, ...] = ()

    def summary(self) -> dict[str, object]:
        """The figures under the names used everywhere."""
        return {
            "step": self.number,
            "do": self.step.do,
            "cycle": self.cycle,
            "how": self.how,
            "peak_torque": self.peak_torque,
            "largest_torques": self.largest.tolist(),
            "smallest_torques": self.smallest.tolist(),
            "impact_energies": self.impact_energy.tolist(),
            "impulses": self.impulses.tolist(),
            "contacts": self.contacts,
            "begin": self.begin,
            "time": self.time,
            "start_time": self.start_time,
            "angle": self.angle,
        }

    @property
    def configured(self) -> bool:
        """Whether it stopped as configured, since the step does not say how and the strategy cannot stop."""
        return self.step.do in ("stop", "jog") and self.step.by is None and self.how != "strategy"

    @property
    def peak_torques(self) -> Vector:
        """Largest |T| of each shaft, N m."""
        return np.maximum(self.largest, -self.smallest)

    @property
    def peak_torque(self) -> float:
        """Largest |T| of all shafts, N m."""
        return float(self.peak_torques.max())


@dataclass(frozen=True, eq=False, repr=False)
class DutyRun(Result, view="duties.duty_sheet"):
    """A machine through some cycles of a duty. It is returned by `run_duty`.

    Attributes
    ----------
    drive : Drive or Chain
        The machine, with its first load.
    controller : Controller
        The strategy as it was set up.
    duty : Duty
        One cycle.
    base : Drive, Chain or None
        The machine to whose mean torque K_dyn refers, if not `drive`.
    cycles : int
        How many were computed: one where the duty ends in motion.
    repeated : bool
        Whether the machine stands at the end of a cycle, so that it can be repeated.
    executed : tuple of StepRun
        Each step of each cycle, in order of time.
    turning_points : tuple of array of shape (k, 2)
        Of each shaft time, s, and torque, N m, at the reversals of its torque, from the second cycle on; of
        the only one if there is one.

    Examples
    --------
    >>> from softstart import Duty, DutyStep, run_duty
    >>> duty = Duty(steps=[DutyStep(do="start"), DutyStep(do="hold", time=1), DutyStep(do="stop")])
    >>> run = run_duty("conveyor-11kw", "ramp", duty)
    >>> [(row.step.do, round(run.k_dyn_of(row), 3)) for row in run.rows]
    [('start', 1.159), ('hold', 1.0), ('stop', 0.215)]
    """

    drive: Any  # a Machine
    controller: Controller
    duty: Duty
    stop: str
    base: Machine | None
    cycles: int
    repeated: bool
    executed: tuple[StepRun, ...]
    turning_points: tuple[Matrix, ...]

    @property
    def controller_name(self) -> str:
        """Name of the controller."""
        return label_of(self.controller)

    @property
    def base_torque(self) -> float:
        """The mean torque to which K_dyn refers, N m: M12avg of a start under the full starting torque."""
        return float((self.base or self.drive).mean_torque)

    def k_dyn_of(self, step: StepRun) -> float:
        """Largest |T| of a step over `base_torque`."""
        return float(formulas.dynamic_coefficient(step.peak_torque, self.base_torque))

    @cached_property
    def rows(self) -> tuple[StepRun, ...]:
        """Each step of the file with its worst figures of all cycles and repetitions.

        Time, angle and phases are of the one with the largest |T|.
        """
        of_step: dict[int, list[StepRun]] = {}
        for one in self.executed:
            of_step.setdefault(one.number, []).append(one)
        hardest = {n: max(each, key=lambda one: one.peak_torque) for n, each in of_step.items()}
        return tuple(
            replace(_worst_of(hardest[n], each), contacts=max(one.contacts for one in each))
            for n, each in sorted(of_step.items())
        )

    @cached_property
    def regulated(self) -> bool:
        """Whether the strategy holds the speed, so that the load settles in a band on both sides of it."""
        return self.controller.regulation(self.drive.design_drive) is not None

    def margins(self, life: DutyLife | None = None) -> tuple[tuple[StepRun | None, Margin], ...]:
        """The margin of each step to each of its limits, and that of a life to the required one: no step."""
        used = None if life is None else life.margin(self.drive.limits)
        steps = [(row, margin) for row in self.rows for margin in self.margins_of(row)]
        return (*steps, *([] if used is None else [(None, used)]))

    @property
    def uses_configured_stop(self) -> bool:
        """Whether a step stops as configured, since it does not say how and the strategy cannot stop."""
        return any(one.configured for one in self.executed)

    @property
    def stop_setting(self) -> str:
        """Whether `stop` is the "default" of the machine, or another one that was "configured"."""
        usual = way_of_stop(DutyStep("stop"), self.drive, None, self.controller.can_stop)
        return "default" if self.stop == usual else "configured"

    @property
    def counted_cycles(self) -> int:
        """The number of cycles of the duty to which `turning_points` belong."""
        return max(self.cycles - 1, 1)

    @property
    def starts(self) -> int:
        """Starts, reversals and jogs in one cycle."""
        first = [one for one in self.executed if one.cycle == 1]
        return sum(one.step.do in ("start", "reverse", "jog") for one in first)

    @cached_property
    def _counted(self) -> tuple[Counted, ...]:
        """The rainflow cycles of each shaft."""
        begins = np.array([one.begin for one in self.executed])
        steps = [one.number - 1 for one in self.executed]
        return tuple(count_cycles(points, begins, steps) for points in self.turning_points)

    def life(self, slope: float | None = None) -> DutyLife:
        """How long each shaft lasts.

        The rainflow cycles are those of the whole trace, both signs, from the second cycle on. Cycles of the
        duty are counted as one that repeats itself; Miner's rule adds the damage by the S-N curve of the
        machine, or with this slope, see `fatigue`.

        Raises
        ------
        InputError
            For a shaft without damping, whose rattling never ends, and for a rigid gap.
        """
        return life_of(
            self.drive, self._counted, self.counted_cycles, self.duty.shift, len(self.duty.steps), slope
        )

    def margins_of(self, step: StepRun) -> tuple[Margin, ...]:
        """The margin of a step to each limit of torque and start time that it has."""
        share = np.nan_to_num(step.peak_torques / self.drive.permissible_torques)
        figures = {
            "peak_torque": step.peak_torque,
            "used_torque": 100.0 * float(share.max()),
            "start_time": step.start_time,
        }
        names, units = {"start_time": "settled time"} if self.regulated else {}, units_of(self.drive)
        return tuple(
            Margin(replace(limit, name=names.get(limit.figure, limit.name)), figures[limit.figure], "", units)
            for limit in self.drive.limits.each
            if not math.isnan(figures.get(limit.figure, math.nan))
        )

    @property
    def worst(self) -> StepRun:
        """The step with the largest |T|."""
        return max(self.executed, key=lambda one: one.peak_torque)

    @property
    def k_dyn(self) -> float:
        """Dynamic coefficient of the worst step."""
        return self.k_dyn_of(self.worst)

    @property
    def phases(self) -> tuple[Phase, ...]:
        """What is recorded, in order of time: of the first two cycles."""
        return tuple(phase for one in self.executed for phase in one.phases)

    @cached_property
    def t(self) -> Vector:
        """Instants of the traces of the first two cycles, s: a grid, events, reversals of torque."""
        last, still = self.phases[-1].end, STILL_IN_TRACE * self.base_torque
        turns = self._reversals(still)
        while turns.size > MOST_INSTANTS + 2 * len(self.phases):  # many shafts that rattle
            still *= 4.0
            turns = self._reversals(still)
        edges = np.concatenate([phase.trajectory.events["time"] + phase.time for phase in self.phases])
        edges = edges if edges.size <= MOST_INSTANTS else edges[:0]
        grid = np.linspace(0.0, last, PLOT_POINTS)
        whole = np.concatenate([grid, edges, np.nextafter(edges, 0.0), turns])
        return np.unique(whole.clip(0.0, last))

    def _reversals(self, still: float) -> Vector:
        """When the torque of any shaft has turned by more than `still`, N m, and steps begin, both sides."""
        recorded = [one for one in self.executed if one.phases]
        begins = np.array([phase.begin for phase in self.phases])
        found = [begins, np.nextafter(begins, 0.0)]
        for points in (points for one in recorded for points in one.turns):
            large = np.abs(np.diff(points[:, 1])) > still
            found.append(points[np.append(large, False) | np.append(False, large), 0])
        return np.concatenate(found)

    @cached_property
    def traces(self) -> dict[str, Vector]:
        """The states at `t`, see `at`."""
        return self.at(self.t)

    def to_csv(self, path: str | Path, times: ArrayLike | None = None) -> None:
        """Write the states under a header with units, at `times` or the plot's instants."""
        instants = self.t if times is None else np.asarray(times, dtype=np.float64).ravel()
        states = self.traces if times is None else self.at(instants)
        named = named_states(states, self.phases[0].trajectory.input)
        write_columns(path, {"t [s]": instants, **self.drive.columns_of(named)})

    @property
    def cycle_time(self) -> float:
        """How long the last cycle took, s."""
        last = [one for one in self.executed if one.cycle == self.cycles]
        return last[-1].end - last[0].begin

    def summary(self) -> dict[str, object]:
        """All figures under the names used everywhere (JSON, tables, docs)."""
        return {
            **self.drive.identity,
            "controller": self.controller_name,
            "parameters": self.controller.parameters,
            "stop": self.stop,
            "cycles": self.cycles,
            "cycle_time": self.cycle_time,
            "base": (self.base or self.drive).name,
            "base_torque": self.base_torque,
            "k_dyn": self.k_dyn,
            "worst_step": self.worst.number,
            "steps": [
                {
                    **row.summary(),
                    "k_dyn": self.k_dyn_of(row),
                    "limits": [margin.summary() for margin in self.margins_of(row)],
                }
                for row in self.rows
            ],
        }

    def at(self, times: ArrayLike) -> dict[str, Vector]:
        """States at any instants of the first two cycles: phi, w of masses, twist, T of shafts, and u.

        A last axis is of masses or shafts. Where something jumps the value is the one after the jump.
        """
        when = np.asarray(times, dtype=np.float64).ravel()
        phases = self.phases
        begins = np.array([phase.begin for phase in phases])
        if when.size and not (when.min() >= 0.0 and when.max() <= phases[-1].end * (1.0 + 1e-12)):
            raise ValueError(f"times must lie within the recorded cycles, 0 to {phases[-1].end:.6g} s.")
        which = (np.searchsorted(begins, when, side="right") - 1).clip(0)
        states: dict[str, Vector] = {}
        for j in np.unique(which).tolist():
            phase, own = phases[j], which == j
            found = phase.trajectory.at(when[own] - phase.time)
            found["phi"] = found["phi"] + phase.angle
            for name, values in found.items():
                whole = states.setdefault(name, np.empty((when.size, *values.shape[1:])))
                whole[own] = values
        return states


def run_duty(
    drive: MachineLike,
    controller: ControllerLike = REFERENCE,
    duty: Duty | str | None = None,
    *,
    stop: str | None = None,
    cycles: int = 2,
    parameters: Mapping[str, object] | None = None,
    fitted_to: MachineLike | None = None,
    base: MachineLike | None = None,
    progress: Callable[[StepRun], None] | None = None,
) -> DutyRun:
    """A machine through cycles of a duty, exactly: each step begins in the state that the last has left.

    Start and reversal follow the strategy. One that cannot reverse is started anew in the other direction, in
    motion. Backwards a torque strategy sees and demands everything with the other sign. Where the load has
    its set speed such a strategy is over: its torque goes in a straight line, in one elastic period, to the
    one that holds the load. A stop is by the strategy, if it can, or by a torque, by coasting, or by the
    brake; it ends when all masses stand: within 1 % of the target speed for one period of the load on the
    held motor. An unknown start position is tried for the first step only; the duty goes on from the one with
    the largest |T|.

    Parameters
    ----------
    drive : Drive, Chain, str or path
        The machine.
    controller : str, Controller, ...
        The strategy, as in `simulate`.
    duty : Duty or path, optional
        One cycle; by default that of the machine's file.
    stop : str, optional
        "strategy", "torque", "coast" or "brake", for steps that do not say it: by default the strategy if it
        can stop, else torque if the motor has a negative smallest torque, else coast.
    cycles : int
        How often the cycle is carried out, one behind the other; once if it ends in motion.
    parameters, fitted_to, base : as in `simulate`.
    progress : callable, optional
        `progress(step)` is called after each step; what it raises ends the duty.

    Returns
    -------
    DutyRun

    Raises
    ------
    InputError
        For bad input; all its mistakes at once.
    SimulationError
        If a step cannot be finished, or does not end.

    Examples
    --------
    >>> from softstart import Duty, DutyStep, run_duty
    >>> jog = Duty(steps=[DutyStep(do="jog", time="200 ms", by="coast")])
    >>> run_duty("conveyor-11kw", "direct", jog, cycles=3).cycles
    3

    References
    ----------
    K_dyn: [G] (16). Rainflow counting: ASTM E1049.
    """
    machine = as_machine(drive)
    strategy = as_controller(controller, parameters)
    cycle = duty_of(machine, duty)
    if isinstance(cycles, bool) or not isinstance(cycles, Integral) or cycles < 1:
        raise InputError(f"cycles = {cycles}: the number of cycles is a whole number of 1 or more.")
    ready, design = strategy.set_up((as_machine(fitted_to) if fitted_to else machine).design_drive)
    stop_by = checked_stop(machine, ready, design, cycle, stop)
    count = 1 if cycle.ends_moving else int(cycles)
    reference = None if base is None else as_machine(base, "base")
    return duty_run(machine, ready, design, cycle, stop_by, count, reference, progress)


def duty_of(machine: Machine, duty: Duty | str | None) -> Duty:
    """The duty that is given, by itself or by its file, or that of the machine."""
    cycle = machine.duty if duty is None else duty
    cycle = cycle if isinstance(cycle, Duty | None) else Duty.load_for(machine, cycle)
    if cycle is None:
        raise InputError(
            f"duty is missing: {machine.name} has no [[duty]]; add one to its file, or give one of its own."
        )
    return cycle


def checked_stop(
    machine: Machine, controller: Controller, design: Drive, duty: Duty, stop: str | None
) -> str:
    """How steps stop that do not say it; InputError for a duty that the machine or strategy cannot do."""
    holds = controller.regulation(design) is not None
    check_duty(machine, duty, stop, controller.can_stop, controller.can_reverse, holds, label_of(controller))
    return way_of_stop(DutyStep("stop"), machine, stop, controller.can_stop)


def duty_run(
    machine: Machine, controller: Controller, design: Drive, duty: Duty, stop: str, count: int,
    base: Machine | None = None, progress: Callable[[StepRun], None] | None = None,
) -> DutyRun:  # fmt: skip
    """So many cycles of a duty that has been checked, under a controller that is set up, recorded."""
    still = STILL * float((base or machine).mean_torque)
    executed, points = list[StepRun](), list[list[Matrix]]()
    for ran, turns in carried_out(machine, controller, design, duty, stop, count, still):
        if progress is not None:
            progress(ran)
        kept = ran.cycle <= KEPT_CYCLES
        executed.append(replace(ran, turns=tuple(turns)) if kept else replace(ran, phases=()))
        if ran.cycle > 1 or count == 1:
            points.append(turns)
    shafts = range(len(machine.shaft_names))
    whole = tuple(np.concatenate([turns[s] for turns in points]) for s in shafts)
    repeated = not duty.ends_moving
    return DutyRun(machine, controller, duty, stop, base, count, repeated, tuple(executed), whole)


def carried_out(
    machine: Machine, controller: Controller, design: Drive, duty: Duty, stop: str, cycles: int,
    still: float | None = None,
) -> Iterator[tuple[StepRun, list[Matrix]]]:  # fmt: skip
    """Each step of so many cycles as it was carried out, with the turning points of each shaft.

    These are reversals by more than `still`, N m. Without it nothing is recorded: there are no turning points
    and no energies of impacts, and of the torques of each shaft only the one with the largest |T|.
    """
    steps, moving, room = duty.expanded(), duty.ends_moving, 0 if still is None else FIRST_ROWS
    runner: DutyCycle | None = None
    for k in range(cycles):
        for j, (index, step) in enumerate(steps):
            last = moving and j == len(steps) - 1
            if runner is not None:
                yield _carry_out(runner, step, index, k, last, still)
                continue
            # an unknown position is tried from each side
            tried = [DutyCycle(one, controller, design, stop, room) for one in machine.positions.values()]
            done = [_carry_out(one, step, index, 0, last, still) for one in tried]
            hardest = max(range(len(done)), key=lambda i: done[i][0].peak_torque)
            runner, (ran, turns) = tried[hardest], done[hardest]
            yield _worst_of(ran, [one for one, _ in done]), turns


def _carry_out(
    runner: DutyCycle, step: DutyStep, index: int, cycle: int, last: bool, still: float | None
) -> tuple[StepRun, list[Matrix]]:
    """A step, and the turning points of each shaft in it."""
    runner.step, runner.cycle = index, cycle
    anew = step.do == "reverse" and not runner.controller.can_reverse
    phases = runner.carry_out(step, last)
    turns, energies = list[Matrix](), np.full(runner.rows.count - 1, math.nan)
    largest, smallest = (peaks := _peaks(phases)), peaks
    if still is not None:
        shafts = range(runner.rows.count - 1)
        for s in shafts:
            of_phases = [
                phase.trajectory.turning_points(s, still) + np.array([phase.time, 0.0]) for phase in phases
            ]
            turns.append(np.concatenate(of_phases))
        of_impacts = [[impact_energies(phase.trajectory, s).sum() for s in shafts] for phase in phases]
        energies = np.sum(of_impacts, axis=0)
        # the kernel has located the largest |T|, to the bit as without a record
        # a step of no length, as a start at its set speed, has no points
        ends = np.array(
            [[turn[:, 1].max(initial=-np.inf), turn[:, 1].min(initial=np.inf)] for turn in turns]
        ).T
        ends = ends.clip(-np.abs(peaks), np.abs(peaks))
        largest, smallest = np.where(peaks > 0.0, peaks, ends[0]), np.where(peaks < 0.0, peaks, ends[1])
    how = "strategy, anew in the other direction" if anew else "strategy"
    held = "strategy" if runner.go else "holding torque" if runner.speed != 0.0 else "at rest"
    if step.do in ("stop", "jog"):
        how = step.by or runner.stop_by
    elif step.do in ("brake", "hold", "load"):
        how = {"brake": "brake", "hold": held, "load": ""}[step.do]
    begin, end = phases[0].begin, phases[-1].end
    rests = [phase.rest for phase in phases if not math.isnan(phase.rest)]
    first = phases[0]
    notes = first.trajectory.notes
    starts = step.do in ("start", "reverse")
    reached = notes.start_time if runner.regulation is None else notes.settled
    run = StepRun(
        index + 1, step, cycle + 1, how, begin, end,
        (max(rests[-1], begin) if rests and step.time is None else end) - begin,
        first.time + float(reached) - begin if starts else math.nan,
        float(sum(phase.travel for phase in phases)),
        largest,
        smallest,
        int(sum(phase.trajectory.notes.contacts for phase in phases)),
        energies,
        np.max([phase.trajectory.shafts["impulse"] for phase in phases], axis=0),
        tuple(phases),
    )  # fmt: skip
    return run, turns


def _peaks(phases: Sequence[Phase]) -> Vector:
    """The torque of each shaft whose |T| is the largest of all phases, N m, signed."""
    peaks = np.array([phase.trajectory.shafts["peak"] for phase in phases])
    return peaks[np.abs(peaks).argmax(axis=0), np.arange(peaks.shape[1])]


def _worst_of(shown: StepRun, each: Sequence[StepRun]) -> StepRun:
    """A step from several positions: the figures of `shown`, and of each shaft the largest torques of all."""
    return replace(
        shown,
        largest=np.max([one.largest for one in each], axis=0),
        smallest=np.min([one.smallest for one in each], axis=0),
        impact_energy=np.max([one.impact_energy for one in each], axis=0),
        impulses=np.max([one.impulses for one in each], axis=0),
        start_time=max(one.start_time for one in each),
    )
