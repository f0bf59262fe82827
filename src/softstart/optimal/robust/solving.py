"""One torque profile for several drives: scenarios, search, exact runs, the worth of a contact sensor."""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from numbers import Real
from typing import Any

import numpy as np

from softstart.arrays import Vector
from softstart.controller import make_controller
from softstart.drive import Drive
from softstart.errors import InputError
from softstart.optimal.momentum import momentum_bound
from softstart.optimal.problem import Problem
from softstart.optimal.result import (
    InfeasibleError,
    LowerBound,
    OptimumError,
    RobustOptimum,
    SensorWorth,
    Verdict,
)
from softstart.optimal.robust.descent import Point, Rules, descend, evaluate
from softstart.optimal.robust.evaluation import Evaluator, ProfileParameters, Staircase, merged, refined
from softstart.optimal.robust.guesses import Evolution, Family, gentleness, quickness
from softstart.profile import TorqueProfile
from softstart.quantities import show
from softstart.start.simulation import simulate


def scenarios_of(
    drive: Drive,
    *,
    gaps: Iterable[float] = (),
    inertias: Iterable[float] = (),
    load_torques: Iterable[float] = (),
) -> tuple[Drive, ...]:
    """The full grid of a drive's gaps (rad), load inertias (kg m2) and load torques (N m), and its positions.

    A list left out keeps the drive's own value. The drive itself comes first, also where it is not on the
    grid, since K_dyn refers to the first scenario. Raises InputError for values that no drive can have.

    >>> nominal = Drive.load("crane-4amtkf")
    >>> [s.gap for s in scenarios_of(nominal, gaps=[0.3, 0.5, 1.0])]
    [0.5, 0.3, 1.0]
    >>> len(scenarios_of(nominal, gaps=[0.3, 1.0], inertias=[0.07, 0.175]))
    5
    """
    if not isinstance(drive, Drive):
        raise InputError(
            "drive: one profile for several gaps, load inertias or load torques is found for a Drive, not "
            "for a chain; leave these out, or reduce the chain to a drive."
        )
    own = (("gaps", "gap"), ("inertias", "load_inertia"), ("load_torques", "load_torque"))
    lists = [
        _values(name, given) for (name, _), given in zip(own, (gaps, inertias, load_torques), strict=True)
    ]
    axes = [
        list(dict.fromkeys(values)) or [getattr(drive, key)]
        for values, (_, key) in zip(lists, own, strict=True)
    ]
    grid = [
        drive.with_gap(gap, load_inertia=load_inertia, load_torque=load_torque)
        for gap, load_inertia, load_torque in itertools.product(*axes)
    ]
    return tuple(dict.fromkeys(one for each in (drive, *grid) for one in each.positions.values()))


def _values(name: str, given: Iterable[float]) -> list[float]:
    try:
        values = [float(value) for value in given]
    except (TypeError, ValueError):
        raise InputError(f"{name} = {given!r}: give a list of numbers in SI units.") from None
    return values


def check_scenarios(scenarios: Sequence[Drive], start_time: Any, base: Any) -> tuple[Drive, ...]:
    """The scenarios as a tuple, or one InputError with everything that is wrong."""
    if isinstance(scenarios, Drive) or not isinstance(scenarios, Sequence) or isinstance(scenarios, str):
        raise InputError(
            f"scenarios = {scenarios!r}: give a list of Drives; scenarios_of makes one from a drive's gaps, "
            "inertias and load torques."
        )
    drives = tuple(one for each in scenarios for one in getattr(each, "positions", {"": each}).values())
    if not drives:
        raise InputError("scenarios: the list is empty; give one Drive or more.")
    if (
        not isinstance(start_time, Real)
        or isinstance(start_time, bool)
        or not 0.0 < float(start_time) < math.inf
    ):
        raise InputError(f"start_time = {start_time!r}: give the time allowed in s, above 0.")
    if base is not None and not isinstance(base, Drive):
        raise InputError(f"base = {base!r}: K_dyn refers to one single Drive; Drive.load reads one.")
    wrong: list[str] = []
    for i, drive in enumerate(drives):
        try:
            reached(drive, float(start_time), base)
        except InputError as error:
            wrong += [f"scenario {i + 1}: {sentence}" for sentence in error.sentences]
    if not wrong:
        low, high = limits(drives)
        if low >= high:
            wrong.append(
                f"scenarios: one needs a torque of at least {low:g} N m, another allows {high:g} N m at "
                "most; one profile cannot serve both, so leave one of them out."
            )
        wrong += [
            f"scenario {i + 1}: load_torque = {drive.Mc:g} N m, but the torque that all scenarios allow is "
            f"only {high:g} N m; leave out the scenario with the weakest motor."
            for i, drive in enumerate(drives)
            if drive.Mc >= high
        ]
    if wrong:
        raise InputError(wrong)
    return tuple(reached(drive, float(start_time), base).drive for drive in drives)


def reached(drive: Drive, start_time: float, base: Drive | None) -> Problem:
    """A scenario by itself: the load is to reach its target speed in time."""
    return Problem(drive, start_time=start_time, terminal="reached", base=base)


def limits(drives: Sequence[Drive]) -> tuple[float, float]:
    """The torque in N m that every scenario allows: highest of the lowest, lowest of the highest."""
    problems = [reached(drive, 1.0, None) for drive in drives]
    return max(p.lowest_torque for p in problems), min(p.highest_torque for p in problems)


def differing(drives: Sequence[Drive], count: int) -> tuple[Drive, ...]:
    """So many of the drives that differ most in gap, inertia, load torque, stiffness; in their order.

    The two ends of the widest spread come first, then always the one farthest from those chosen.

    >>> drive = Drive.load("crane-4amtkf")
    >>> [d.gap for d in differing([drive.replace(gap=g) for g in (0.3, 0.4, 0.5, 0.7)], 2)]
    [0.3, 0.7]
    """
    if len(drives) <= count:
        return tuple(drives)
    rows = np.array([[d.gap, d.J1, d.J2, d.Mc, d.c, d.d, d.Ms] for d in drives], dtype=np.float64)
    rows = rows / np.maximum(np.abs(rows).max(axis=0), 1e-300)
    apart = np.linalg.norm(rows[:, None] - rows[None], axis=2)
    chosen = [int(i) for i in np.unravel_index(int(np.argmax(apart)), apart.shape)]
    while len(chosen) < count:
        chosen.append(int(np.argmax(apart[chosen].min(axis=0))))
    return tuple(drives[i] for i in sorted(chosen[:count]))


Progress = Callable[[str], None]

SEED = 0  # of everything random here: the same question has the same answer
EVOLUTIONS = ((3, 0), (4, 1))  # steps and seed of the searches over short staircases of any kind
QUICK_EVOLUTIONS = ((3, 0), (3, 1), (4, 0), (4, 1), (5, 0), (5, 1))
REPRESENTED = 3  # scenarios that the first rounds are over
DENSE, SPARSE = 12, 6  # intervals of an elastic period in the first rounds: in the first two periods, then
FIRST_ROUNDS = 8  # of the descent from each start
ALIKE = 3e-3  # relative: peaks after the first rounds that count as one
PURSUED, FINISHED = 4, 1  # how many are followed to the end of the coarse grid, and on the fine one
COARSE, FINE = 40, 90  # intervals
ROUNDS = 80  # of each descent, at most
CALM, CALMER = 2e-5, 3e-4  # weights of the torque steps, during the search and where the peak may not rise
MERGED = 0.002  # of the torque range: neighbouring levels that become one
TIDY_COST = 2e-4  # relative, that a calmer profile of fewer knots may cost


class RobustSearch:
    """The searches, one after the other, each from the best of those before."""

    def __init__(
        self, drives: Sequence[Drive], start_time: float, react: bool, progress: Progress, quick: bool = False
    ) -> None:
        self.drives, self.start_time, self.react, self.progress = tuple(drives), start_time, react, progress
        self.low, self.high = limits(drives)
        self.less = 2 if quick else 1  # times fewer starts, rounds and intervals
        self.rules = Rules(self.low, self.high, calm=CALM, rounds=ROUNDS // self.less**3)
        self.evaluator = Evaluator(drives, start_time)

    def best(self) -> Point:
        """The gentlest point found that is in time; InfeasibleError if none is."""
        coarse = []
        for staircase in self._pursued():
            coarse.append(descend(self.evaluator, staircase, self.rules, 1e-4))
            self.progress(f"coarse grid: peak {coarse[-1].peak:.3f} N m")
        fine = []
        for point in _different(coarse, ALIKE)[:FINISHED]:
            staircase = self._refined(point.staircase, FINE // self.less)
            fine.append(descend(self.evaluator, staircase, self.rules, 1e-5))
            self.progress(f"fine grid: peak {fine[-1].peak:.3f} N m")
        best = _different(fine)[0]
        best = best if self.less > 1 else self._calmed(best)
        if best.late > 0.0:
            raise OptimumError(
                f"robust optimum: a start within {self.start_time:g} s was found and lost again."
            )
        return best

    def _pursued(self) -> list[Staircase]:
        """Where to go on from: the best after a few rounds of each start, over differing scenarios."""
        quick = self._quick() if self._constant(self.evaluator).late > 0.0 else []
        evaluator = Evaluator(differing(self.drives, REPRESENTED), self.start_time)
        rules = replace(self.rules, calm=0.0, rounds=FIRST_ROUNDS // self.less)
        points = []
        for staircase in [*self._starts(evaluator), *quick]:
            start = staircase.cut(*[self._grid()] * 2)
            points.append(descend(evaluator, start, rules, 1e-4))
            self.progress(f"first rounds: peak {points[-1].peak:.3f} N m")
        pursued = _different(points, ALIKE)[: max(PURSUED // self.less, 1)]
        return [point.staircase for point in pursued] + quick

    def _starts(self, evaluator: Evaluator) -> list[Staircase]:
        """Members of the family from all over, and the best short staircases of any kind."""
        starts = Family(evaluator, self.low, self.high, self.react).spread(SEED, self.less)
        for steps, seed in EVOLUTIONS[: len(EVOLUTIONS) // self.less or 1]:
            search = Evolution(evaluator, steps, self.low, self.high, self.react)
            starts.append(search.best(gentleness(evaluator, self.high - self.low), SEED + seed)[1])
        return starts

    def _grid(self) -> Vector:
        """Edges for the first rounds: close together while the gaps close, then wider."""
        period = max(float(drive.elastic_period) for drive in self.drives)
        dense = min(2.0 * period, self.evaluator.horizon)
        rest = self.evaluator.horizon - dense
        count = min(max(math.ceil(rest / period * SPARSE), 2), COARSE)  # a stiff shaft has many periods
        early = np.linspace(0.0, dense, math.ceil(dense / period * DENSE) + 1)[:-1]
        return np.concatenate([early, np.linspace(dense, dense + rest, count + 1)[:-1]])

    def _calmed(self, fine: Point) -> Point:
        """As good with quieter torque, then with few levels whose edges move: the last that costs nothing."""
        floor = fine.peak * (1.0 + 0.1 * TIDY_COST)
        calm = descend(
            self.evaluator,
            fine.staircase,
            replace(self.rules, calm=CALMER, floor=floor, rounds=ROUNDS // 2),
            1e-5,
        )
        few = merged(calm.staircase, MERGED * (self.high - self.low))
        tidy = descend(self.evaluator, few, replace(self.rules, edges=True, calm=0.0), 1e-6)
        self.progress(f"moving edges: peak {tidy.peak:.3f} N m")
        in_time = [point for point in (tidy, calm, fine) if point.late <= max(fine.late, 0.0)]
        least = min(point.peak for point in in_time)
        return next(point for point in in_time if point.peak <= least * (1.0 + TIDY_COST))

    def _constant(self, evaluator: Evaluator) -> Point:
        """The highest torque all the time."""
        staircase = self._flat(self.high)
        return evaluate(evaluator, ProfileParameters(staircase, self.drives[0]), staircase)

    def _flat(self, torque: float) -> Staircase:
        level = np.array([torque, torque])
        edges = np.array([0.0, 0.5 * self.start_time])
        return Staircase(edges, level, Staircase(edges, level) if self.react else None)

    def _quick(self) -> list[Staircase]:
        """A start in time, as the constant torque is none; InfeasibleError if none is found."""
        patient = Evaluator(self.drives, 100.0 * self.start_time)
        constant = self._constant(patient)
        latest = constant.late + patient.start_time
        evaluator = Evaluator(self.drives, latest)
        rules = replace(self.rules, aim="quick", calm=0.0)
        points = [descend(evaluator, self._refined(self._flat(self.high), COARSE), rules)]
        for steps, seed in QUICK_EVOLUTIONS:
            search = Evolution(evaluator, steps, self.low, self.high, self.react)
            staircase = search.best(quickness(evaluator), seed)[1]
            points.append(descend(evaluator, refined(staircase, evaluator.horizon, COARSE), rules))
        best = min(points, key=lambda point: point.late)
        best = descend(evaluator, refined(best.staircase, evaluator.horizon, FINE), rules)
        self.progress(f"quickest start found: {best.late + latest:.6f} s")
        if best.late + latest > self.start_time:
            raise InfeasibleError(self._verdict(evaluator, best))
        return [best.staircase]

    def _verdict(self, evaluator: Evaluator, quickest: Point) -> Verdict:
        parameters = ProfileParameters(quickest.staircase, self.drives[0])
        late = evaluator.lateness(evaluator.figures(parameters, quickest.staircase.unknowns))[0]
        slowest = self.drives[int(np.argmax(late))]
        shortest = (quickest.late + evaluator.start_time) * (1.0 + 1e-6)
        who = (
            f"gap {slowest.gap:g} rad, load inertia {slowest.J2:g} kg m2, load torque {slowest.Mc:g} N m, "
            f"start position {show(slowest.start_position)}"
            f"{f' ({slowest.name})' if slowest.name else ''}"
        )
        sentence = (
            f"A start time of {self.start_time:g} s is too short for one profile over {len(self.drives)} "
            f"scenario{'s' if len(self.drives) > 1 else ''}: the shortest found is {shortest:.6g} s, and "
            f"the slowest scenario is the one with {who}; the torque limit is {self.high:g} N m."
        )
        return Verdict(reached(slowest, self.start_time, None), shortest, "torque limit", sentence)

    def _refined(self, staircase: Staircase, intervals: int) -> Staircase:
        return refined(staircase, self.evaluator.horizon, intervals)


def _different(points: Sequence[Point], alike: float = 5e-4) -> list[Point]:
    """The points in order, best first, without those that are as good as one before."""
    ordered = sorted(points, key=lambda point: (max(point.late, 0.0), point.peak))
    kept: list[Point] = []
    for point in ordered:
        if all(abs(point.peak - other.peak) > alike * other.peak for other in kept):
            kept.append(point)
    return kept


BoundOf = Callable[[Drive], LowerBound]
UNUSED = (
    "No profile that reacts to the contact was found that is better than the best blind one: the sensor is "
    "left unused, and this is the blind profile."
)


def optimize_robust(
    scenarios: Sequence[Drive],
    start_time: float,
    *,
    react_to_contact: bool = False,
    quick: bool = False,
    base: Drive | None = None,
    progress: Progress | None = None,
    bound_of: BoundOf | None = None,
) -> RobustOptimum:
    """Find the torque profile with the least worst K_dyn over several drives, all in time.

        minimise over u   max_i  peak |T_i| / M12avg_base
        subject to        w2_i reaches target_speed_i by start_time, lowest_torque <= u <= highest_torque

    u is a function of time that is common to all drives; the peak is that of the whole run, to one elastic
    period after the drive's own start time. Any drive goes: damped, reactive load, lag, rate.

    The result is the best of several searches on the exact plant, not proved best: a blind profile over wide
    gaps has many local optima, and a gentler one may be missed. `lower_bound` says how much better any
    profile could be.

    Parameters
    ----------
    scenarios : sequence of Drive
        The drives; `softstart.optimal.robust.scenarios_of` makes them from gaps, inertias and load torques.
    start_time : float
        The time allowed, s.
    react_to_contact : bool
        Allow one profile until the gap first closes and another one, on a clock that starts there, from then
        on, or the blind profile where that is better (see `note`). Both are searched: twice the time.
    quick : bool
        Look for the blind profile from fewer starts and on a coarser grid, for one point of a curve.
    base : Drive, optional
        The drive to whose mean shaft torque K_dyn refers; by default the first scenario.
    progress : callable, optional
        Called with a text after each stage of the search.
    bound_of : callable, optional
        Gives the bound of one scenario by itself, in K_dyn of `base`; by default the momentum bound.

    Returns
    -------
    RobustOptimum
        The profile, its exact run on each drive, and the bound.

    Raises
    ------
    InputError
        For bad input.
    InfeasibleError
        Where no profile was found that starts all drives in time.
    OptimumError
        If the exact runs contradict the search.

    Examples
    --------
    >>> drive = Drive.load("crane-4amtkf").replace(target_speed=60)
    >>> best = optimize_robust([drive], start_time=0.2883042)
    >>> 0.909 < best.k_dyn < 0.912, max(best.start_times) <= 0.2883042
    (True, True)

    References
    ----------
    How good it is, and how it is searched: docs/optimal-starts.md, docs/theory/optimum.md.
    """
    blind = _optimum(scenarios, start_time, False, base, progress or _quiet, bound_of, quick=quick)
    if not react_to_contact:
        return blind
    return _reacting(blind, progress or _quiet)


def _optimum(
    scenarios: Sequence[Drive], start_time: float, react: bool, base: Drive | None, progress: Progress,
    bound_of: BoundOf | None, bound: LowerBound | None = None, quick: bool = False,
) -> RobustOptimum:  # fmt: skip
    """The best profile found of one kind, run on the exact plant and checked."""
    began = time.perf_counter()
    drives = check_scenarios(scenarios, start_time, base)
    start_time = float(start_time)
    known = base or drives[0]
    # in an order of their own, each once: what comes out does not depend on how they were listed
    sorted_once = sorted(dict.fromkeys(drives), key=lambda drive: drive.to_toml())
    best = RobustSearch(sorted_once, start_time, react, progress, quick).best()
    profile = best.staircase.tidy()
    runs = tuple(
        simulate(drive, make_controller("profile", {"profile": profile}), base=known) for drive in drives
    )
    if bound is None:
        bounds = [(bound_of or _momentum(start_time, known))(drive) for drive in drives]
        bound = max(bounds, key=lambda one: one.k_dyn)
    seconds = time.perf_counter() - began
    optimum = RobustOptimum(drives, start_time, known, react, profile, runs, bound, seconds)
    _check(optimum, best.peak)
    return optimum


def _reacting(blind: RobustOptimum, progress: Progress) -> RobustOptimum:
    """The best profile found that may react: a drive may also leave its sensor unused."""
    unused = replace(blind, react_to_contact=True, note=UNUSED)
    try:
        found = _optimum(
            blind.scenarios, blind.start_time, True, blind.base, progress, None, blind.lower_bound
        )
    except InfeasibleError:  # in time only by the clock
        return unused
    return found if found.k_dyn < blind.k_dyn else replace(unused, seconds=blind.seconds + found.seconds)


def worth_of_contact_sensor(
    scenarios: Sequence[Drive],
    start_time: float,
    *,
    base: Drive | None = None,
    progress: Progress | None = None,
    bound_of: BoundOf | None = None,
    k_dyn_alone: Callable[[Drive], float] | None = None,
) -> SensorWorth:
    """Find the robust optima with and without a sensor of the contact, side by side.

    Parameters
    ----------
    scenarios : sequence of Drive
        The drives.
    start_time : float
        The time allowed, s.
    base : Drive, optional
        The drive to whose mean shaft torque K_dyn refers; by default the first scenario.
    progress : callable, optional
        Called with a text after each stage of the search.
    bound_of : callable, optional
        Gives the bound of one scenario by itself, in K_dyn of `base`; by default the momentum bound.
    k_dyn_alone : callable, optional
        Gives the least K_dyn of one scenario by itself, in K_dyn of the base drive: what a drive could have
        whose gap, inertia and load torque were known.

    Returns
    -------
    SensorWorth
        Both optima, and by how many per cent the sensor lowers the worst K_dyn.

    Raises
    ------
    InputError
        For bad input.
    InfeasibleError
        Where no profile was found that starts all drives in time.
    OptimumError
        If the exact runs contradict the search.

    Examples
    --------
    A search takes some seconds for each drive; that its input is wrong is known at once:

    >>> worth_of_contact_sensor([], start_time=0.3)
    Traceback (most recent call last):
    softstart.errors.InputError: scenarios: the list is empty; give one Drive or more.

    References
    ----------
    docs/optimal-starts.md.
    """
    progress = progress or _quiet

    blind = _optimum(scenarios, start_time, False, base, lambda text: progress(f"blind: {text}"), bound_of)
    reacting = _reacting(blind, lambda text: progress(f"reacting: {text}"))
    alone = None if k_dyn_alone is None else tuple(k_dyn_alone(drive) for drive in blind.scenarios)
    return SensorWorth(blind, reacting, alone)


def _quiet(text: str) -> None:
    """No progress is shown."""


def _momentum(start_time: float, base: Drive) -> BoundOf:
    def bound_of(drive: Drive) -> LowerBound:
        return momentum_bound(reached(drive, start_time, base))

    return bound_of


def _check(optimum: RobustOptimum, claimed: float) -> None:
    """The runs shown are those that were optimised, in time and within the limits; else OptimumError."""
    late = [t for t in optimum.start_times if not t <= optimum.start_time]
    if late:
        raise OptimumError(
            f"robust optimum: a scenario starts at {late[0]!r} s instead of {optimum.start_time!r} s."
        )
    peak = max(run.peak_torque for run in optimum.runs)
    if abs(peak - claimed) > 1e-6 * claimed:
        raise OptimumError(f"robust optimum: claimed a peak of {claimed!r} N m, the plant says {peak!r} N m.")
    low, high = limits(optimum.scenarios)
    if not all(_within(part, low, high) for part in (optimum.profile, optimum.profile.after_contact)):
        raise OptimumError(f"robust optimum: its torque leaves the limits of {low:g} to {high:g} N m.")
    if optimum.k_dyn < optimum.lower_bound.k_dyn * (1.0 - 1e-9):
        raise OptimumError(
            f"robust optimum: K_dyn {optimum.k_dyn!r} lies below its bound {optimum.lower_bound.k_dyn!r}."
        )


def _within(profile: TorqueProfile | None, low: float, high: float) -> bool:
    return profile is None or bool(np.all((profile.torque >= low) & (profile.torque <= high)))
