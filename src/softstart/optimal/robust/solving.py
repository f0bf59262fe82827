"""The robust optimum: from a first look over short staircases down to the last edge, and its exact runs."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from softstart.controller import make_controller
from softstart.drive import Drive
from softstart.optimal.result import InfeasibleError, LowerBound, OptimumError, Verdict
from softstart.optimal.robust.descent import Place, descend, look
from softstart.optimal.robust.linear_step import Rules
from softstart.optimal.robust.outcome import RobustOptimum, SensorWorth
from softstart.optimal.robust.plays import Plays
from softstart.optimal.robust.scenarios import check_scenarios, limits, reached
from softstart.optimal.robust.search import ROUNDS as LOOK_ROUNDS
from softstart.optimal.robust.search import Search, gentleness, quickness
from softstart.optimal.robust.shape import Player, Staircase, merged, refined
from softstart.profile import TorqueProfile
from softstart.simulation import simulate

BoundOf = Callable[[Drive], LowerBound]
Progress = Callable[[str], None]

LOOKS = tuple((steps, seed) for steps in (3, 4, 5, 6) for seed in range(4))  # of each first look
QUICK_LOOKS = ((3, 0), (3, 1), (4, 0), (4, 1), (5, 0), (5, 1))
PURSUED, FINISHED = 10, 2  # how many of them are followed on the coarse grid, and on the fine one
COARSE, FINE = 40, 90  # intervals
ROUNDS = 80  # of each descent, at most
CALM, CALMER = 2e-5, 3e-4  # weights of the torque steps, on the way and where the peak may not rise
MERGED = 0.002  # of the torque range: neighbouring levels that become one
TIDY_COST = 2e-4  # relative, that a calmer profile of fewer knots may cost


def optimize_robust(
    scenarios: Sequence[Drive],
    start_time: float,
    *,
    react_to_contact: bool = False,
    base: Drive | None = None,
    progress: Progress | None = None,
    bound_of: BoundOf | None = None,
) -> RobustOptimum:
    """The torque profile with the least worst K_dyn over several drives, all in time.

        minimise over u   max_i  peak |T_i| / M12avg_base
        subject to        w2_i reaches target_speed_i by start_time, lowest_torque <= u <= highest_torque

    u is a function of time that is common to all drives; with `react_to_contact` it is one function until
    the gap first closes and another one, on a clock that starts there, from then on. The peak is that of the
    whole run, to one elastic period after the drive's own start time. `base` (the first scenario, if none is
    given) is the drive that K_dyn refers to. Any drive goes: damped, reactive load, lag, rate.

    What comes out is the best of several searches on the exact plant, not proved best: a blind profile over
    wide gaps has many local optima, and a gentler one may be missed. `lower_bound` says how much better any
    profile could be. `bound_of(drive)` gives the bound of one scenario by itself, in K_dyn of `base` (the
    momentum bound, if none is given).

    Raises InputError for bad input, InfeasibleError where no profile was found that starts all in time.

    >>> drive = Drive.load("crane-4amtkf").replace(target_speed=60)
    >>> best = optimize_robust([drive, drive.replace(gap=0.501)], start_time=0.2883042)
    >>> 0.91 < best.k_dyn < 0.92, max(best.start_times) <= 0.2883042
    (True, True)
    """
    began = time.perf_counter()
    drives = check_scenarios(scenarios, start_time, base)
    start_time = float(start_time)
    known = base or drives[0]
    # in an order of their own, each once: what comes out does not depend on how they were listed
    sorted_once = sorted(dict.fromkeys(drives), key=lambda drive: drive.to_toml())
    best = _Pursuit(sorted_once, start_time, react_to_contact, progress or _quiet).best()
    profile = best.shape.tidy()
    runs = tuple(
        simulate(drive, make_controller("profile", {"profile": profile}), base=known) for drive in drives
    )
    bounds = [(bound_of or _momentum(start_time, known))(drive) for drive in drives]
    bound = max(bounds, key=lambda one: one.k_dyn)
    optimum = RobustOptimum(
        drives, start_time, known, react_to_contact, profile, runs, bound, time.perf_counter() - began
    )
    _check(optimum, best)
    return optimum


def worth_of_contact_sensor(
    scenarios: Sequence[Drive],
    start_time: float,
    *,
    base: Drive | None = None,
    progress: Progress | None = None,
    bound_of: BoundOf | None = None,
    k_dyn_alone: Callable[[Drive], float] | None = None,
) -> SensorWorth:
    """The robust optima with and without a sensor of the contact, side by side.

    `k_dyn_alone(drive)` gives the least K_dyn of one scenario by itself, in K_dyn of the base drive: what a
    drive could have whose gap, inertia and load torque were known. Raises as `optimize_robust`.
    """
    say = progress or _quiet

    def optimum(react: bool, word: str) -> RobustOptimum:
        return optimize_robust(
            scenarios,
            start_time,
            react_to_contact=react,
            base=base,
            progress=lambda text: say(f"{word}: {text}"),
            bound_of=bound_of,
        )

    blind, reacting = optimum(False, "blind"), optimum(True, "reacting")
    alone = None if k_dyn_alone is None else tuple(k_dyn_alone(drive) for drive in blind.scenarios)
    return SensorWorth(blind, reacting, alone)


def _quiet(text: str) -> None:
    """No progress is shown."""


class _Pursuit:
    """The searches, one after the other, each from the best of those before."""

    def __init__(self, drives: Sequence[Drive], start_time: float, react: bool, say: Progress) -> None:
        self.drives, self.start_time, self.react, self.say = tuple(drives), start_time, react, say
        self.low, self.high = limits(drives)
        self.rules = Rules(self.low, self.high, calm=CALM, rounds=ROUNDS)
        self.plays = Plays(drives, start_time)

    def best(self) -> Place:
        """The gentlest place found that is in time; InfeasibleError if none is."""
        starts = self._starts()
        coarse = []
        for shape in starts:
            coarse.append(descend(self.plays, self._refined(shape, COARSE), self.rules, 1e-4))
            self.say(f"coarse grid: peak {coarse[-1].peak:.3f} N m")
        fine = []
        for place in _different(coarse)[:FINISHED]:
            fine.append(descend(self.plays, self._refined(place.shape, FINE), self.rules, 1e-5))
            self.say(f"fine grid: peak {fine[-1].peak:.3f} N m")
        best = self._calmed(_different(fine)[0])
        if best.late > 0.0:
            raise OptimumError(
                f"robust optimum: a start within {self.start_time:g} s was found and lost again."
            )
        return best

    def _calmed(self, fine: Place) -> Place:
        """As good with quieter torque, then with few levels whose edges move: the last that costs nothing."""
        floor = fine.peak * (1.0 + 0.1 * TIDY_COST)
        calm = descend(
            self.plays, fine.shape, replace(self.rules, calm=CALMER, floor=floor, rounds=ROUNDS // 2), 1e-5
        )
        few = merged(calm.shape, MERGED * (self.high - self.low))
        tidy = descend(self.plays, few, replace(self.rules, edges=True, calm=0.0), 1e-6)
        self.say(f"moving edges: peak {tidy.peak:.3f} N m")
        in_time = [place for place in (tidy, calm, fine) if place.late <= max(fine.late, 0.0)]
        least = min(place.peak for place in in_time)
        return next(place for place in in_time if place.peak <= least * (1.0 + TIDY_COST))

    def _starts(self) -> list[Staircase]:
        """Where to go down from: the best short staircases, and a quick start if all are late."""
        quick = self._quick() if self._constant(self.plays).late > 0.0 else []
        looks = []
        for steps, seed in LOOKS:
            search = Search(self.plays, steps, self.low, self.high, self.react)
            looks.append(search.best(gentleness(self.plays, self.high - self.low), seed, LOOK_ROUNDS))
            self.say(f"first look, {steps} steps: cost {looks[-1][0]:.4f}")
        looks.sort(key=lambda one: one[0])
        return [*(shape for _, shape in looks[:PURSUED]), *quick]

    def _constant(self, plays: Plays) -> Place:
        """The highest torque all the time."""
        shape = self._flat(self.high)
        return look(plays, Player(shape, self.drives[0]), shape)

    def _flat(self, torque: float) -> Staircase:
        level = np.array([torque, torque])
        edges = np.array([0.0, 0.5 * self.start_time])
        return Staircase(edges, level, Staircase(edges, level) if self.react else None)

    def _quick(self) -> list[Staircase]:
        """A start in time, as the constant torque is none; InfeasibleError if none is found."""
        patient = Plays(self.drives, 100.0 * self.start_time)
        constant = self._constant(patient)
        latest = constant.late + patient.start_time
        plays = Plays(self.drives, latest)
        rules = replace(self.rules, aim="quick", calm=0.0)
        places = [descend(plays, self._refined(self._flat(self.high), COARSE), rules)]
        for steps, seed in QUICK_LOOKS:
            search = Search(plays, steps, self.low, self.high, self.react)
            shape = search.best(quickness(plays), seed, LOOK_ROUNDS)[1]
            places.append(descend(plays, refined(shape, plays.horizon, COARSE), rules))
        best = min(places, key=lambda place: place.late)
        best = descend(plays, refined(best.shape, plays.horizon, FINE), rules)
        self.say(f"quickest start found: {best.late + latest:.6f} s")
        if best.late + latest > self.start_time:
            raise InfeasibleError(self._verdict(plays, best))
        return [best.shape]

    def _verdict(self, plays: Plays, quickest: Place) -> Verdict:
        player = Player(quickest.shape, self.drives[0])
        late = plays.lateness(plays.figures(player, quickest.shape.unknowns))[0]
        slowest = self.drives[int(np.argmax(late))]
        shortest = (quickest.late + plays.start_time) * (1.0 + 1e-6)
        who = (
            f"gap {slowest.gap:g} rad, load inertia {slowest.J2:g} kg m2, load torque {slowest.Mc:g} N m"
            f"{f' ({slowest.name})' if slowest.name else ''}"
        )
        sentence = (
            f"start_time = {self.start_time:g} s is too short for one profile over {len(self.drives)} "
            f"scenario{'s' if len(self.drives) > 1 else ''}: the shortest found is {shortest:.6g} s, and "
            f"the slowest scenario is the one with {who}; the torque limit is {self.high:g} N m."
        )
        return Verdict(reached(slowest, self.start_time, None), shortest, "torque limit", sentence)

    def _refined(self, shape: Staircase, intervals: int) -> Staircase:
        return refined(shape, self.plays.horizon, intervals)


def _different(places: Sequence[Place]) -> list[Place]:
    """The places in order, best first, without those that are as good as one before."""
    ordered = sorted(places, key=lambda place: (max(place.late, 0.0), place.peak))
    kept: list[Place] = []
    for place in ordered:
        if all(abs(place.peak - other.peak) > 5e-4 * other.peak for other in kept):
            kept.append(place)
    return kept


def _momentum(start_time: float, base: Drive) -> BoundOf:
    def bound_of(drive: Drive) -> LowerBound:
        from softstart.optimal.momentum import momentum_bound

        return momentum_bound(reached(drive, start_time, base))

    return bound_of


def _check(optimum: RobustOptimum, best: Place) -> None:
    """The runs shown are those that were optimised, in time and within the limits; else OptimumError."""
    late = [t for t in optimum.start_times if not t <= optimum.start_time]
    if late:
        raise OptimumError(
            f"robust optimum: a scenario starts at {late[0]!r} s instead of {optimum.start_time!r} s."
        )
    peak = max(run.peak_torque for run in optimum.runs)
    if abs(peak - best.peak) > 1e-6 * best.peak:
        raise OptimumError(
            f"robust optimum: claimed a peak of {best.peak!r} N m, the plant says {peak!r} N m."
        )
    low, high = limits(optimum.scenarios)
    if not all(_within(part, low, high) for part in (optimum.profile, optimum.profile.after_contact)):
        raise OptimumError(f"robust optimum: its torque leaves the limits of {low:g} to {high:g} N m.")
    if optimum.k_dyn < optimum.lower_bound.k_dyn * (1.0 - 1e-9):
        raise OptimumError(
            f"robust optimum: K_dyn {optimum.k_dyn!r} lies below its bound {optimum.lower_bound.k_dyn!r}."
        )


def _within(profile: TorqueProfile | None, low: float, high: float) -> bool:
    return profile is None or bool(np.all((profile.torque >= low) & (profile.torque <= high)))
