"""The robust optimum: its search, its exact runs, and what a contact sensor is worth."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from softstart.controller import make_controller
from softstart.drive import Drive
from softstart.optimal.result import InfeasibleError, LowerBound, OptimumError
from softstart.optimal.robust.outcome import RobustOptimum, SensorWorth
from softstart.optimal.robust.pursuit import Progress, Pursuit
from softstart.optimal.robust.scenarios import check_scenarios, limits, reached
from softstart.profile import TorqueProfile
from softstart.start.simulation import simulate

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
    base: Drive | None = None,
    progress: Progress | None = None,
    bound_of: BoundOf | None = None,
) -> RobustOptimum:
    """The torque profile with the least worst K_dyn over several drives, all in time.

        minimise over u   max_i  peak |T_i| / M12avg_base
        subject to        w2_i reaches target_speed_i by start_time, lowest_torque <= u <= highest_torque

    u is a function of time that is common to all drives; with `react_to_contact` it is one function until
    the gap first closes and another one, on a clock that starts there, from then on (or the blind profile,
    where that is better: see `note`; both are searched, so this takes twice as long). The peak is that of the
    whole run, to one elastic period after the drive's own start time. `base` (the first scenario, if none is
    given) is the drive that K_dyn refers to. Any drive goes: damped, reactive load, lag, rate.

    What comes out is the best of several searches on the exact plant, not proved best: a blind profile over
    wide gaps has many local optima, and a gentler one may be missed. `lower_bound` says how much better any
    profile could be. `bound_of(drive)` gives the bound of one scenario by itself, in K_dyn of `base` (the
    momentum bound, if none is given).

    Raises InputError for bad input, InfeasibleError where no profile was found that starts all in time.

    >>> drive = Drive.load("crane-4amtkf").replace(target_speed=60)
    >>> best = optimize_robust([drive], start_time=0.2883042)
    >>> 0.909 < best.k_dyn < 0.912, max(best.start_times) <= 0.2883042
    (True, True)
    """
    blind = _optimum(scenarios, start_time, False, base, progress or _quiet, bound_of)
    if not react_to_contact:
        return blind
    return _reacting(blind, progress or _quiet)


def _optimum(
    scenarios: Sequence[Drive], start_time: float, react: bool, base: Drive | None, say: Progress,
    bound_of: BoundOf | None, bound: LowerBound | None = None,
) -> RobustOptimum:  # fmt: skip
    """The best profile found of one kind, run on the exact plant and checked."""
    began = time.perf_counter()
    drives = check_scenarios(scenarios, start_time, base)
    start_time = float(start_time)
    known = base or drives[0]
    # in an order of their own, each once: what comes out does not depend on how they were listed
    sorted_once = sorted(dict.fromkeys(drives), key=lambda drive: drive.to_toml())
    best = Pursuit(sorted_once, start_time, react, say).best()
    profile = best.shape.tidy()
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


def _reacting(blind: RobustOptimum, say: Progress) -> RobustOptimum:
    """The best profile found that may react: a drive may also leave its sensor unused."""
    unused = replace(blind, react_to_contact=True, note=UNUSED)
    try:
        found = _optimum(blind.scenarios, blind.start_time, True, blind.base, say, None, blind.lower_bound)
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
    """The robust optima with and without a sensor of the contact, side by side.

    `k_dyn_alone(drive)` gives the least K_dyn of one scenario by itself, in K_dyn of the base drive: what a
    drive could have whose gap, inertia and load torque were known. Raises as `optimize_robust`.
    """
    say = progress or _quiet

    blind = _optimum(scenarios, start_time, False, base, lambda text: say(f"blind: {text}"), bound_of)
    reacting = _reacting(blind, lambda text: say(f"reacting: {text}"))
    alone = None if k_dyn_alone is None else tuple(k_dyn_alone(drive) for drive in blind.scenarios)
    return SensorWorth(blind, reacting, alone)


def _quiet(text: str) -> None:
    """No progress is shown."""


def _momentum(start_time: float, base: Drive) -> BoundOf:
    def bound_of(drive: Drive) -> LowerBound:
        from softstart.optimal.momentum import momentum_bound

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
