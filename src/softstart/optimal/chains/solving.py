"""The best start of a chain: seeds from strategies or a global search, then `search`, then a check."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from softstart.arrays import Vector
from softstart.chain.model import Chain
from softstart.controller import make_controller, ready_controller_names
from softstart.errors import InputError, SimulationError
from softstart.late import late
from softstart.optimal.chains.problem import (
    SHORT,
    ChainOptimum,
    ChainProblem,
    check,
    earliest_pull,
    momentum_bound,
)
from softstart.optimal.chains.search import PROMISE, TASTE, Found, Search
from softstart.optimal.chains.starts import Player
from softstart.optimal.problem import USUAL, StartTime
from softstart.optimal.result import (
    InfeasibleError,
    LowerBound,
    NotConverged,
    OptimumError,
    Trial,
    Verdict,
)
from softstart.optimal.shortest import start_time_of_direct
from softstart.profile import TorqueProfile
from softstart.start.run import Run
from softstart.start.simulation import simulate

collocation = late("softstart.optimal.chains.collocation")
global_search = late("softstart.optimal.chains.global_search")

CMA = "cma"
TRACE = 20_001  # instants of a trace that becomes a first demand
RUNS = 4  # of the global search
FINISHED = 2
DAMPED = (0.02, 0.01, 0.004)  # damping ratios through which an undamped chain is approached
SIMILAR = "the demand of a similar problem"
ORDERS = 3  # of contacts, in which the collocation is solved until its replay has the same
NEAR = 0.01  # of K_dyn: so much above the answer a collocation is content
AGREED = 2e-3  # of K_dyn: the collocation and its replay
METHOD = "successive linear programs on the exact start, from {}"


@dataclass(frozen=True, eq=False)
class Warm:
    """The demand of an optimum, from which a similar problem can start."""

    end: float
    time: Vector
    torque: Vector


def optimize_chain(
    problem: ChainProblem,
    *,
    tolerance: float = 0.005,
    time_limit: float = math.inf,
    seeds: Sequence[str] | None = None,
    warm: Any = None,
    why: str = "",
    confirm: bool = False,
) -> ChainOptimum:
    """The start of a chain with the least largest torque of all its shafts; see `softstart.optimize`."""
    began = time.perf_counter()
    bound = momentum_bound(problem)
    if math.isinf(bound.k_dyn):
        raise InfeasibleError(_too_short(problem))
    names = checked_seeds(seeds)
    if problem.drive.warnings and not isinstance(warm, Warm):
        warm = _from_damped(problem, names, tolerance, time_limit)
    search = Search(problem, Player(problem.drive))
    first = _first_demands(search, names, warm)
    until = began + time_limit
    least = PROMISE * tolerance
    # a few programs from each seed, then all the way from a similar problem's answer and the best of these
    tasted: list[tuple[str, Found]] = []
    for k, (name, found) in enumerate(first):
        if time_limit <= 0.0 and k > 0 and name != SIMILAR:
            continue
        if len(tasted) >= FINISHED and time.perf_counter() > until:
            break
        down = search.descended(found.torques, TASTE, least)
        tasted.append((name, found if down is None else down))
    tasted.sort(key=lambda one: (one[0] != SIMILAR, one[1].merit))
    tried: list[Trial] = []
    best: tuple[str, Found] | None = None
    for name, start in tasted:
        more = isinstance(warm, Warm) or time.perf_counter() <= until
        enough = len(tried) >= (FINISHED if more else 1)
        if best is not None and best[1].miss.max() <= SHORT and enough:
            break  # where all before missed the terminal condition, the next one too
        since = time.perf_counter()
        done = search.descended(start.torques, least=least)
        done = None if done is None else search.finished(done)
        value = None if done is None else done.played.peak / problem.base_torque
        failure = "" if done is not None and done.miss.max() <= SHORT else "the terminal condition is missed"
        tried.append(Trial("slp", value, time.perf_counter() - since, failure))
        if done is not None and (best is None or _rank(done) < _rank(best[1])):
            best = (name, done)
    for one in first:  # a demand may be the best start itself, as the full torque near the shortest time
        if one[1].miss.max() <= SHORT and (best is None or _rank(one[1]) < _rank(best[1])):
            best = one
    if best is None or best[1].miss.max() > SHORT:
        raise OptimumError(_none_found(problem))
    if time.perf_counter() < until and any(shaft.gap for shaft in problem.drive.shafts):  # else one optimum
        since = time.perf_counter()
        around = search.finished(search.beyond(best[1], tolerance, until))
        if around is not None:
            tried.append(
                Trial("slp", around.played.peak / problem.base_torque, time.perf_counter() - since, "")
            )
            best = min(best, (best[0], around), key=lambda one: _rank(one[1]))
    answer = _checked(search, best[1], bound, began, METHOD.format(best[0]) + why)
    answer = replace(answer, tried=tuple(tried))
    return _confirmed(search, answer, began) if confirm else answer


def _rank(found: Found) -> tuple[bool, float]:
    return found.miss.max() > SHORT, found.merit


def _checked(search: Search, found: Found, bound: LowerBound, began: float, why: str) -> ChainOptimum:
    """The answer as the exact chain runs it under the `profile` controller."""
    problem = search.problem
    profile = search.profile(found.torques).simplified()
    player = make_controller("profile", {"profile": profile})
    run = simulate(problem.drive, player, search.until, base=problem.base or problem.drive)
    end = search.end
    if problem.terminal == "reached" and run.start_time <= end:
        end = run.start_time
    claimed = found.played.peak / problem.base_torque
    check(problem, run, profile, end, claimed, bound)
    return ChainOptimum(
        problem=problem,
        profile=profile,
        run=run,
        bound=bound,
        method="slp",
        why=why,
        claimed=claimed,
        end_time=end,
        seconds=time.perf_counter() - began,
        warm=Warm(search.end, search.knots, found.torques),
    )


def _confirmed(search: Search, best: ChainOptimum, began: float) -> ChainOptimum:
    """The better of an answer and that of the collocation, which has only the order of contacts from it."""
    problem, since = best.problem, time.perf_counter()
    run, other, failure = best.run, None, ""
    for _ in range(ORDERS):
        try:
            profile, claimed = _collocated(problem, run, best.k_dyn)
            fine = Search(problem, search.player)
            fine.knots = profile.time
            played = fine.play(fine.allowed(profile.torque))
            found = None if played is None else fine.finished(played)
            if found is None:
                failure = "its demand could not be simulated"
                break
            other = _checked(fine, found, best.bound, since, f"gentler than that of {best.method}")
        except (InputError, NotConverged, OptimumError) as stopped:
            failure = str(stopped)
            break
        run = other.run
        if abs(claimed / other.k_dyn - 1.0) <= AGREED:
            break
    else:
        failure = f"K_dyn {claimed:.4f} was claimed: the contacts of its replay come in another order"
    value = None if other is None else other.k_dyn
    tried = (*best.tried, Trial("collocation", value, time.perf_counter() - since, failure))
    if other is not None and other.k_dyn < best.k_dyn:
        best = replace(other, method="collocation")
    return replace(best, tried=tried, seconds=time.perf_counter() - began)


def _collocated(problem: ChainProblem, run: Run, known: float) -> tuple[TorqueProfile, float]:
    """From straight lines between the contacts; where that leads to no start as gentle, from `run` itself."""
    found, failed = [], None
    for straight in (True, False):
        try:
            found.append(collocation.solve(problem, run, straight))
        except NotConverged as stopped:
            failed = stopped
            continue
        if found[-1][1] <= known * (1.0 + NEAR):
            break
    if not found:
        assert failed is not None
        raise failed
    return min(found, key=lambda one: one[1])


# first demands ---------------------------------------------------------------------------------------------


def checked_seeds(seeds: Sequence[str] | None) -> list[str]:
    """The names of the seeds: by default all controllers that need no parameter."""
    if seeds is None:
        return list(ready_controller_names())
    names = [seeds] if isinstance(seeds, str) else list(seeds)
    if not names:
        raise InputError("seeds: the list is empty; name controllers, or cma for a global search.")
    for name in names:
        if is_global(name):
            global_search.require_cma()
        else:
            make_controller(name)
    return names


def is_global(name: str) -> bool:
    """Whether a seed is the global search: cma, or with other random numbers cma2, cma3 ..."""
    return name == CMA or (name.startswith(CMA) and name[len(CMA) :].isdigit())


def _first_demands(search: Search, names: Sequence[str], warm: Any) -> list[tuple[str, Found]]:
    """The seeds, the best first."""
    problem, found = search.problem, []
    demands = [(name, one) for name in names for one in _demands(search, name)]
    if isinstance(warm, Warm):
        scaled = warm.time * (search.end / warm.end)
        demands.insert(0, (SIMILAR, lambda: search.sampled(scaled, warm.torque)))
    for name, demand in demands:
        try:
            played = search.play(demand())
        except SimulationError:
            continue
        if played is not None:
            found.append((name, played))
    if not found:
        raise OptimumError(
            f"{problem.drive.name}: no strategy could be simulated that the search starts from."
        )
    return sorted(found, key=lambda one: one[1].merit)


def _from_damped(problem: ChainProblem, names: list[str], tolerance: float, time_limit: float) -> Warm | None:
    """The optimum of an undamped chain with a little damping, less and less of it.

    Undamped masses rattle, so that strategies lead to poor local optima; damped ones do not.
    """
    warm: Warm | None = None
    for ratio in DAMPED:
        shafts = tuple(one.replace(damping_ratio=ratio) for one in problem.drive.shafts)
        near = replace(problem, drive=replace(problem.drive, shafts=shafts))
        try:
            found = optimize_chain(
                near, tolerance=tolerance, time_limit=0.0 if warm else time_limit, seeds=names, warm=warm
            )
        except OptimumError:
            break
        warm = found.warm
    return warm


def _demands(search: Search, name: str) -> list[Callable[[], Vector]]:
    """The torque of a strategy on this chain, or those of several runs of the global search."""
    if is_global(name):
        number = int(name[len(CMA) :] or 1)

        def searched(run: int) -> Callable[[], Vector]:
            return lambda: search.sampled(*global_search.found(search, RUNS * (number - 1) + run + 1))

        return [searched(run) for run in range(RUNS)]

    def traced() -> Vector:
        run = simulate(search.problem.drive, name)
        times = np.linspace(0.0, min(run.end_time, search.until), TRACE)
        return search.sampled(times, run.at(times)["u"])

    return [traced]


# where there is none ---------------------------------------------------------------------------------------


def _too_short(problem: ChainProblem) -> Verdict:
    """No shaft can drive the load before the start is to be over."""
    shortest = earliest_pull(problem)
    return Verdict(
        problem,
        shortest,
        "the gaps, even under full torque",
        f"No start of {problem.drive.name} ends within {problem.start_time:g} s: no shaft drives the load "
        f"before {shortest:.6g} s, whatever the torque.",
    )


def _none_found(problem: ChainProblem) -> str:
    text = f"No start within {problem.start_time:g} s with terminal {problem.terminal} was found. "
    try:
        direct = start_time_of_direct(problem.drive)
    except SimulationError:
        return text + "The constant starting torque (direct) never reaches the target speed."
    return (
        text + f"The constant starting torque (direct) reaches the target speed after {direct:.6g} s; "
        "give more time."
    )


def asked_of_chain(
    chain: Chain, start_time: float | str | None, terminal: Any, base: Any, **others: Any
) -> tuple[ChainProblem, str]:
    """The problem as `optimize` was asked for it, and what its start time is if none was given."""
    bound = USUAL if start_time is None else StartTime.of(start_time)
    options = {name: value for name, value in others.items() if value is not None}
    ChainProblem(chain, 1.0, terminal or "reached", base=base, **options)
    seconds = bound.seconds(lambda: start_time_of_direct(chain))
    problem = ChainProblem(chain, seconds, terminal or "reached", base=base, **options)
    return problem, f"; no start time given: {bound} that of direct" if start_time is None else ""
