"""Strategies side by side on one drive, and what they do when it has changed: `compare`."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from statistics import NormalDist
from typing import Any, Final, NamedTuple, Protocol, runtime_checkable

import numpy as np

from softstart.chain.machines import MachineLike, as_machine
from softstart.controller.base import Controller, Effort, label_of
from softstart.controller.finding import ready_controller_names
from softstart.controller.parameters import set_to_text
from softstart.drive import Drive
from softstart.drive.data_sheet import DataSheet
from softstart.drive.machine import Machine
from softstart.drive.machine_table import MachineTable
from softstart.drive.plausibility import plausibility_warnings
from softstart.errors import InputError, Mistakes, SimulationError
from softstart.profile import TorqueProfile
from softstart.quantities import read_multiple, show, time_above_0
from softstart.results import Result
from softstart.start import metrics
from softstart.start.demand import ControllerLike, as_controller
from softstart.start.recommendation import (
    CASES,
    HIGHER,
    SLOW,
    Case,
    Recommendation,
    Row,
    checked_limits,
    keeps,
    recommend,
)
from softstart.start.run import Run
from softstart.start.setting import Judge, for_limits, over_time
from softstart.start.simulation import DEFAULT_DRIVE, simulate
from softstart.views.numbers import plural, units_of

REFERENCE = metrics.REFERENCE
WORN_GAP = 4.0
LIGHT_INERTIA = 0.4
SCALED: Final = {"gap x4": {"gaps": WORN_GAP}, "J2 x0.4": {"load_inertia": LIGHT_INERTIA}}
LEFT_POSSIBLE = "the upper end of 95 %"  # the case of a row whose drive is known within intervals
SOFT_END = "soft shaft"  # the case of a row whose drive is of unknown stiffness
UNCERTAIN_FIGURES: Final = ("k_dyn", "peak_torque")
FEWEST_KNOWN: Final = 0.9  # of the drives drawn whose start must have such a figure
AT_TIME: Final = "1.3x"  # of the settled time of direct: the time at which strategies are compared


class _Share(NamedTuple):
    """How much an interval holds, and how many standard deviations its ends are away."""

    inside: float
    quantile: float


INTERVAL: Final = _Share(0.95, NormalDist().inv_cdf(0.975))


@runtime_checkable
class Uncertain(Protocol):
    """A drive that is known within intervals: `softstart.Identification`."""

    @property
    def drive(self) -> Drive: ...
    def draws(self, count: int = ..., seed: int = ...) -> MachineTable:
        """Drives that are left possible."""


def intervals(
    run: Run,
    drawn: MachineTable,
    controller: ControllerLike,
    until: float | str | None = None,
    fitted_to: Machine | None = None,
) -> dict[str, tuple[float, float]]:
    """The interval of 95 % of K_dyn, peak torque and start time over drives that are left possible.

    Under a strategy that holds the speed it is the settled time instead of the start time. The controller is
    set up as in `run`; each K_dyn refers to the mean torque of its own drive. Where the life of the shaft
    line is limited, `used_life` in % too.
    """
    starts = simulate(drawn, controller, until, fitted_to=fitted_to or run.drive)
    names = (*UNCERTAIN_FIGURES, "settled_time" if run.regulated else "start_time")
    none = np.full(drawn.shape, math.nan)  # where none has settled
    every = {name: np.asarray(starts.get(name, none)) for name in names}
    middle = {name: float(getattr(run, name)) for name in names}
    if checked_limits(run.drive).life is not None:
        one = (
            simulate(each, controller, until, fitted_to=fitted_to or run.drive) for each in drawn.elements()
        )
        every["used_life"] = np.array([Case.of(start).used_life for start in one])
        middle["used_life"] = Case.of(run).used_life
    found = {}
    for name, values in every.items():
        known = values[np.isfinite(values)]
        if known.size < FEWEST_KNOWN * values.size:
            found[name] = (math.nan, math.nan)
            continue
        lower, upper = np.quantile(known, [0.5 - 0.5 * INTERVAL.inside, 0.5 + 0.5 * INTERVAL.inside])
        found[name] = (min(float(lower), middle[name]), max(float(upper), middle[name]))
    return found


class TooSlow(NamedTuple):
    """A strategy that does not settle within the time of a comparison at equal time.

    `settled_time` is its shortest, s, NaN where it does not settle, and `set_to` the value for that.
    """

    name: str
    parameter: str
    settled_time: float
    set_to: str

    def within(self, at: float) -> str:
        """As a sentence."""
        if not self.parameter:
            return f"{self.name} settles in {self.settled_time:.4g} s, not within {at:.4g} s."
        if math.isnan(self.settled_time):
            return f"{self.name}: no value of {self.parameter} settles within {at:.4g} s."
        return (
            f"{self.name}: no value of {self.parameter} settles within {at:.4g} s; the quickest, "
            f"{self.set_to}, settles in {self.settled_time:.4g} s."
        )


@dataclass(frozen=True, eq=False, repr=False)
class Comparison(Result, view="starts.comparison_sheet"):
    """Strategies side by side on one drive.

    Attributes
    ----------
    drive : Drive or Chain
        The drive, or the chain, that is started.
    rows : tuple of Row
        One for each strategy, in the order given: its `run`, `settled_lost` (s), `k_dyn_worn_gap`,
        `k_dyn_light_load`, `flags`, and the `margins` to limits.
    fitted_to : Drive or None
        The drive for which the strategies are set up, None where that is `drive` itself.
    worst_case : tuple of str
        The changes of the drive under which its limits must be kept as well.
    soft_end : Comparison or None
        The strategies set up for the soft end of what an unknown stiffness may be, and started there.
    at_time : float or None
        The time within which all have settled, s, where they are compared at equal time: each row has its
        `setting` of the time parameter.
    too_slow : tuple of TooSlow
        Strategies that no value of their time parameter makes quick enough for that: not among the rows.
    tried : tuple of Row
        Where limits are not kept: the setting of a strategy that came nearest.

    Examples
    --------
    >>> from softstart import Drive, compare
    >>> table = compare(Drive.load("crane-4amtkf"), ["direct", "reduced-first-stage"])
    >>> [row.run.controller.name for row in table.rows]
    ['direct', 'reduced-first-stage']
    >>> [row.name for row in table.recommendation.best]
    ['direct']

    References
    ----------
    K_dyn: [G] (16).
    """

    drive: Machine
    rows: tuple[Row, ...]
    fitted_to: Machine | None = None
    worst_case: tuple[str, ...] = CASES
    soft_end: Comparison | None = None
    at_time: float | None = None
    too_slow: tuple[TooSlow, ...] = ()
    tried: tuple[Row, ...] = ()

    def __repr__(self) -> str:
        """One line with the gentlest and the hardest start.

        >>> compare("crane-4amtkf", ["direct", "ramp"])
        <Comparison: 2 strategies on Crane travel drive 4AMTKF(H)112L6, K_dyn 2.106 (ramp) to 3.118 (direct)>
        """
        rows = sorted(self.rows, key=lambda row: row.run.k_dyn)
        ends = " to ".join(f"{row.run.k_dyn:.3f} ({row.name})" for row in (rows[0], rows[-1])[: len(rows)])
        return f"<Comparison: {plural(len(rows), 'strategy')} on {self.drive.name}, K_dyn {ends}>"

    @cached_property
    def recommendation(self) -> Recommendation:
        """What is recommended, and why."""
        return recommend(self.drive, self.rows, self.tried)

    @property
    def at_equal_time(self) -> str:
        """The lowest K_dyn of each class of effort at equal time; "" for strategies as they are."""
        if self.at_time is None:
            return ""
        lowest: dict[Effort, Row] = {}
        for row in sorted(self.rows, key=lambda row: row.run.k_dyn):
            lowest.setdefault(row.effort, row)
        parts = [
            f"{effort.meaning}: {row.name}, {row.run.k_dyn:.3f}{f' ({row.set_to})' if row.setting else ''}"
            for effort, row in sorted(lowest.items(), key=lambda one: one[0].order)
        ]
        return f"Lowest K_dyn of starts that settle within {self.at_time:.4g} s, with {'; '.join(parts)}."

    @cached_property
    def at_this_end(self) -> Recommendation:
        """What is recommended if the stiffness is that of `drive`, whatever happens at the soft end."""
        rows = (replace(row, worst_case=tuple({*row.worst_case} - {SOFT_END})) for row in self.rows)
        return recommend(self.drive, tuple(rows), self.tried)

    def summary(self) -> dict[str, object]:
        """Everything as plain data, for JSON."""
        return {
            "drive": self.drive.name,
            "fitted_to": None if self.fitted_to is None else self.fitted_to.name,
            "recommendation": self.recommendation.summary(),
            "strategies": [row.summary() for row in self.rows],
            "plausibility_warnings": plausibility_warnings(self.drive),
            **({} if self.soft_end is None else {"soft_end": self.soft_end.summary()}),
            **({} if self.at_time is None else {"at_time": self.at_time}),
            **({} if self.at_time is None else {"too_slow": [one._asdict() for one in self.too_slow]}),
        }


def compare(
    drive: MachineLike | Uncertain | DataSheet = DEFAULT_DRIVE,
    controllers: Sequence[ControllerLike] | ControllerLike | None = None,
    *,
    parameters: Mapping[str, Mapping[str, object]] | None = None,
    until: float | str | None = None,
    fitted_to: Machine | None = None,
    worst_case: Sequence[str] | None = None,
    at_time: float | str | None = None,
) -> Comparison:
    """Start the drive or chain under each controller and compare K_dyn, start time and robustness.

    Parameters
    ----------
    drive : Drive, Chain, Identification, DataSheet, str or path
        One drive, a chain, or the name or file of one of them. Controllers are set up for a chain as they are
        in `simulate`. Of a drive with a soft end of its stiffness, as of a data sheet without any, the stiff
        end counts; limits must be kept at the soft end as well, and `soft_end` compares the strategies as set
        up for that. With an identification each row has `intervals` over 200 drives that its logs leave
        possible, and limits must be kept at their upper ends as well.
    controllers : sequence of str or Controller, optional
        Each as in `simulate`. By default all installed controllers that need no parameter, and those that
        are given parameters.
    parameters : mapping, optional
        A controller's name -> its parameters (SI numbers or strings with a unit).
    until : float or str, optional
        End of each start, s or with a unit. By default one elastic period after the start time.
    fitted_to : Drive or Chain, name or path, optional
        The drive for which the controllers are set up, if not `drive`: how they fare on a drive that is not
        the one they assume.
    worst_case : sequence of str, optional
        Which of "gap x4" and "J2 x0.4" must keep the limits of the drive as well; by default both.
    at_time : float or str, optional
        Compare at equal time: of 64 values of the time parameter of each strategy (its `time_parameter`) that
        with the lowest K_dyn among those whose load has settled within this time, s or with a unit, or a
        multiple of the settled time of direct as "1.3x". A strategy without such a parameter, or to which it
        is given, counts as it is.

    Returns
    -------
    Comparison
        One row for each controller, in the order given; at equal time of those that are quick enough. Where
        the drive has limits and no simpler strategy keeps them as it is, the row is that of the best setting
        of its time parameter and `Controller.settings`.

    Raises
    ------
    InputError
        Bad input; all its mistakes at once.
    SimulationError
        A start on `drive` that cannot be finished.

    Examples
    --------
    >>> from softstart import compare
    >>> row = compare("crane-4amtkf", ["direct"]).rows[0]
    >>> round(row.run.k_dyn, 3), round(row.k_dyn_worn_gap, 3)
    (3.118, 4.865)
    >>> assumed = row.run.drive.replace(stiffness=0.5 * row.run.drive.stiffness)
    >>> table = compare("crane-4amtkf", ["shaped", "pulse-coast-hold"], fitted_to=assumed)
    >>> [round(row.run.k_dyn, 3) for row in table.rows]
    [1.678, 1.274]
    >>> compare("crane-4amtkf", ["direct", "s-curve"], at_time="1.3x").rows[1].set_to
    'time 0.134 s'

    References
    ----------
    K_dyn: [G] (16).
    """
    known, drawn, soft = as_far_as_known(drive)
    drive = as_machine(known)
    fitted_to = None if fitted_to is None else as_machine(fitted_to, "fitted_to")
    counted = (
        (worst_case,) if isinstance(worst_case, str) else CASES if worst_case is None else tuple(worst_case)
    )
    if not set(counted) <= set(CASES):
        named = " and ".join(f'"{case}"' for case in CASES)
        raise InputError(f"worst_case = {worst_case!r}: there are {named}; () is the drive as it is alone.")
    made = make_controllers(controllers, parameters or {})
    direct = simulate(drive, REFERENCE, until)
    start = partial(
        compared,
        drive,
        direct=direct,
        until=until,
        fitted_to=fitted_to,
        worst_case=counted,
        drawn=drawn,
        soft=soft,
    )
    at_soft_end = None
    if soft is not None:
        at_soft_end = compare(
            soft, made, until=until, fitted_to=fitted_to, worst_case=counted, at_time=at_time
        )
    if at_time is not None:
        at = equal_time(at_time, direct)
        found = [row_at_time(drive, one, direct, at, fitted_to, start) for one in made]
        rows = tuple(one for one in found if isinstance(one, Row))
        too_slow = tuple(one for one in found if isinstance(one, TooSlow))
        if not rows:
            reasons = " ".join(one.within(at) for one in too_slow)
            raise InputError(f"at_time = {show(at_time)}: give a longer time. {reasons}")
        return Comparison(drive, rows, fitted_to, rows[0].worst_case, at_soft_end, at, too_slow)
    rows = tuple(map(start, made))
    rows, tried = set_for_limits(drive, rows, made, direct, start, fitted_to, soft)
    return Comparison(drive, rows, fitted_to, rows[0].worst_case, at_soft_end, tried=tried)


def equal_time(at_time: float | str, direct: Run) -> float:
    """The time of a comparison at equal time, s: itself, or a multiple of the settled time of direct."""
    advice = f", or a multiple of the settled time of direct, as {AT_TIME}"
    if multiple := read_multiple(at_time, "at_time"):
        if not 0.0 < multiple[0] < math.inf:
            raise InputError(f"at_time = {show(at_time)}: give a time above 0 s{advice}.")
        if math.isnan(direct.settled_time):
            raise InputError(f"at_time = {show(at_time)}: direct does not settle; give a time in s.")
        return float(multiple[0] * direct.settled_time)
    return time_above_0(at_time, "at_time", advice)


def row_at_time(
    drive: Machine,
    controller: Controller,
    direct: Run,
    at: float,
    fitted_to: Machine | None,
    start: Callable[[Controller], Row],
) -> Row | TooSlow:
    """The row of a strategy whose time parameter is set for the lowest K_dyn within a time."""
    name = label_of(controller)
    span = float(direct.settled_time)
    tried = over_time(drive, controller, at if math.isnan(span) else span, at, fitted_to)
    if tried is None:
        row = start(controller)
        settled = float(row.run.settled_time)
        return row if settled <= at else TooSlow(name, "", settled, "")
    if (setting := tried.best(at)) is None:
        value, settled = tried.quickest or ({}, math.nan)
        return TooSlow(name, tried.name, settled, set_to_text(controller, value, units_of(direct.drive)))
    return replace(start(replace(controller, **setting)), setting=setting)


def set_for_limits(
    drive: Machine,
    rows: tuple[Row, ...],
    controllers: Sequence[Controller],
    direct: Run | None,
    start: Callable[[Controller], Row],
    fitted_to: Machine | None = None,
    soft: Drive | None = None,
) -> tuple[tuple[Row, ...], tuple[Row, ...]]:
    """The rows with strategies set for the limits of the drive; and settings that do not keep them.

    Class by class of effort, the least first: where no strategy keeps the limits as it is, each is set, until
    one does. Above that class those below an encoder have their time parameter set if they do not keep the
    limits. The row of a setting, with all its changed machines, decides.
    """
    limits = checked_limits(drive)
    if not limits or direct is None or math.isnan(direct.settled_time):
        return rows, ()
    changed = [drive.scaled(**SCALED[case]) for case in CASES if case in rows[0].worst_case]
    changed += [soft] if soft is not None else []
    slow = math.inf if drive.limits.start_time is not None else SLOW
    judge = Judge(drive, changed, limits, float(direct.k_dyn), float(direct.settled_time), slow, HIGHER)
    found, tried, done = list(rows), list[Row](), False
    for effort in Effort:
        places = [i for i, row in enumerate(rows) if row.effort is effort]
        if effort is Effort.SENSOR or (done and effort.order >= Effort.ENCODER.order):
            break
        if any(keeps(rows[i], limits) for i in places):
            done = True
            continue
        before = done
        for i in places:
            setting = for_limits(controllers[i], judge, fitted_to, alone=before)
            if not setting:
                continue
            try:
                row = replace(start(replace(controllers[i], **setting)), setting=setting, label=rows[i].label)
            except SimulationError:  # in one of its changed machines
                continue
            if keeps(row, limits):
                found[i] = row
            else:
                tried.append(row)
        done = done or any(keeps(found[i], limits) for i in places)
    return tuple(found), tuple(tried)


def as_far_as_known(
    drive: Any, count: int = 200, name: str = "drive"
) -> tuple[Any, MachineTable | None, Drive | None]:
    """The machine itself, `count` drives where it is known within intervals, and that of the soft end.

    `name` is the argument's.
    """
    if isinstance(drive, DataSheet):
        drive = drive.drive
    if isinstance(drive, Uncertain):
        return drive.drive, drive.draws(count), None
    drive = as_machine(drive, name)
    return drive, None, drive.soft if isinstance(drive, Drive) else None


def make_controllers(
    controllers: Sequence[ControllerLike] | ControllerLike | None,
    parameters: Mapping[str, Mapping[str, object]],
) -> list[Controller]:
    """The controllers to compare, by default all that are ready; InputError holds all mistakes at once."""
    if isinstance(controllers, str | os.PathLike | Controller | TorqueProfile) or callable(controllers):
        controllers = [controllers]
    asked: list[Any] = list(ready_controller_names(parameters) if controllers is None else controllers)
    if not asked:
        raise InputError("controllers: name at least one; `softstart controllers` lists them.")
    wrong = Mistakes()
    unused = set(parameters) - {one for one in asked if isinstance(one, str)}
    if unused:
        wrong.sentences.append(
            f"parameters for {', '.join(sorted(unused))}: that controller is not among those compared."
        )
    made: list[Controller] = []
    for one in asked:
        with wrong.collect():
            made.append(as_controller(one, parameters.get(one) if isinstance(one, str) else None))
    wrong.raise_if_any()
    return made


def compared(
    drive: Machine,
    controller: Controller,
    direct: Run | None,
    until: float | str | None = None,
    fitted_to: Machine | None = None,
    worst_case: tuple[str, ...] = CASES,
    drawn: MachineTable | None = None,
    soft: Drive | None = None,
) -> Row:
    """The row of one controller; `direct` is the start that its times are compared with.

    `drawn` are the drives that are left possible, where the drive is known within intervals; `soft` is that
    at the soft end of what an unknown stiffness may be.
    """
    run = simulate(drive, controller, until, fitted_to=fitted_to)
    _ = run.settled_time  # now, while what a controller prints is still caught
    cases = {case: changed_case(drive, controller, case, until, fitted_to) for case in CASES}
    if soft is not None:
        cases[SOFT_END] = changed_case(drive, controller, SOFT_END, until, fitted_to, soft)
        worst_case = (*worst_case, SOFT_END)
    if drawn is None:
        return Row(run, direct, cases, worst_case)
    found = intervals(run, drawn, controller, until, fitted_to)
    own = Case.of(run)
    upper = {name.replace("settled", "start"): ends[1] for name, ends in found.items()}
    cases[LEFT_POSSIBLE] = Case(**{"used_life": own.used_life, **upper})
    return Row(run, direct, cases, (*worst_case, LEFT_POSSIBLE), intervals=found)


def changed_case(
    drive: Machine,
    controller: Controller,
    case: str,
    until: float | str | None = None,
    fitted_to: Machine | None = None,
    soft: Drive | None = None,
) -> Case:
    """A controller set up for `drive`, with 4 times its gap, 0.4 of its load inertia, or on `soft`."""
    changed = drive.scaled(**SCALED[case]) if soft is None else soft
    try:
        return Case.of(simulate(changed, controller, until, fitted_to=fitted_to or drive, base=drive))
    except SimulationError:
        return Case.of(None)
