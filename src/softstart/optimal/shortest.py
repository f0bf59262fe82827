"""The shortest start time that a problem allows, and the verdict on one that is shorter."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from typing import Any

from softstart.chain.model import Chain
from softstart.drive import Drive
from softstart.errors import SimulationError
from softstart.late import late
from softstart.optimal.lp import ideal, whole_search
from softstart.optimal.lp.motion import Contact, entry_of
from softstart.optimal.lp.rows import AIM
from softstart.optimal.momentum import momentum_shortest_time
from softstart.optimal.problem import Problem
from softstart.optimal.result import Candidate, NotConverged, Verdict
from softstart.start.simulation import simulate

collocation = late("softstart.optimal.collocation.search")

COARSE, FINE = 40, 80  # steps of the linear programs
WITHIN = 2e-6  # of the start time
MOST_TRIALS = 40
LONGEST = 100.0  # times the least that momentum allows: no start time beyond it is tried


def shortest_start_time(problem: Problem) -> float:
    """The shortest t_f in s of any start of the problem whose gap closes once; infinite if there is none, nan
    if the search for it did not converge.

    K_dyn may be anything unless the problem bounds it. The greatest speed that can be had at a given t_f is a
    linear program, and it rises with t_f; where it is not linear, collocation minimises t_f.

    >>> from softstart import Drive
    >>> drive = Drive.load("crane-4amtkf").replace(target_speed=60.0)
    >>> round(shortest_start_time(Problem(drive, 0.3)), 4)
    0.2498
    """
    if len(problem.drive.positions) > 1:  # no profile for all of them can be quicker
        return max(
            shortest_start_time(replace(problem, drive=one)) for one in problem.drive.positions.values()
        )
    plain = _plain(problem)
    bounded = problem.k_dyn is not None or problem.heat is not None
    if not bounded and not (ideal.not_linear(plain) and whole_search.not_linear(plain)):
        return _of_linear(plain)
    quickest = replace(problem, start_time=None, minimise="start_time")
    try:
        return float(collocation.solve(quickest).end_time)
    except NotConverged:
        return math.inf if bounded else math.nan  # without bounds there is always a start


def _plain(problem: Problem) -> Problem:
    return replace(problem, start_time=1.0, minimise="k_dyn", k_dyn=None, heat=None)


@lru_cache(maxsize=128)  # verdicts on several start times of a drive ask for the same ones
def _of_linear(plain: Problem) -> float:
    return _quickest_whole(plain)[0] if ideal.not_linear(plain) else _by_linear_program(plain)


@lru_cache(maxsize=128)
def _quickest_whole(
    plain: Problem,
) -> tuple[float, whole_search.PhaseOrder | None, whole_search.Timing | None]:
    """The shortest t_f of all orders of phases, nan if there was none, with the instants of that start."""
    found = [(*_by_whole_program(plain, order), order) for order in whole_search.phase_orders(plain)]
    known = [(end, order, at) for end, at, order in found if math.isfinite(end)]
    return min(known, key=lambda one: one[0], default=(math.nan, None, None))


def from_quickest(problem: Problem) -> Candidate | None:
    """The optimum of a problem for the whole start's program, looked for from the quickest start on."""
    assert problem.start_time is not None
    end, order, at = _quickest_whole(_plain(problem))
    if order is None or at is None or not end < problem.start_time:
        return None
    return whole_search.solve(problem, (order, (at[0], at[1], min(end * (1.0 + 1e-3), problem.start_time))))


def _by_linear_program(problem: Problem) -> float:
    """The t_f at which the greatest speed is the target: on a coarse grid, then on a fine one near there."""
    entry = entry_of(problem)
    te = math.nan

    def speed_at(end: float, steps: int) -> float:
        nonlocal te
        speed, te = ideal.greatest_speed(problem, entry, end, steps, te)
        if not math.isfinite(speed):
            te = math.nan
        return speed

    soonest = max(momentum_shortest_time(problem), entry.earliest)
    return _quickest(problem, soonest, speed_at)


def _by_whole_program(
    problem: Problem, order: whole_search.PhaseOrder
) -> tuple[float, whole_search.Timing | None]:
    """The same where the gap part counts too, and the instants of that start."""
    near: whole_search.Timing | None = None

    def speed_at(end: float, steps: int) -> float:
        nonlocal near
        speed, found = whole_search.greatest_speed(problem, order, end, steps, near)
        near = found if math.isfinite(speed) else near
        return speed

    return _quickest(problem, max(momentum_shortest_time(problem), order.tb), speed_at), near


def _quickest(problem: Problem, soonest: float, speed_at: Callable[[float, int], float]) -> float:
    """The end in s at which `speed_at(end, steps)` is the target; no end before `soonest` is enough."""
    if not math.isfinite(soonest):
        return math.inf
    contact = Contact.of(problem.drive)
    slope = (problem.highest_torque - contact.Mc) / (contact.J1 + contact.J2)
    end = 1.2 * soonest + math.pi / contact.Omega
    for steps, within in ((COARSE, 1e-3), (FINE, WITHIN)):
        bracket = Bracket()
        for _ in range(MOST_TRIALS):
            missing = (problem.target * AIM - speed_at(end, steps)) / slope
            bracket.take(end, missing)
            if abs(missing) <= within * end:
                bracket.high = min(bracket.high, end + max(missing, 0.0))
                break
            if bracket.high - bracket.low <= within * end or end > LONGEST * soonest:
                break
            end = bracket.next()
        end = bracket.high
        if not math.isfinite(end):
            return math.inf
    return end


class Bracket:
    """Where between two times what is missing, a time that falls with it, is zero: regula falsi (Illinois).

    While one side is not known yet, a step by as much as is `missing`, corrected by what the last one
    brought; 1.3 times as long where nothing is known.

    >>> bracket, t = Bracket(), 1.0
    >>> for _ in range(8):
    ...     missing = 2.0 - t**3
    ...     bracket.take(t, missing)
    ...     t = bracket.next()
    >>> round(t, 6)
    1.259921
    """

    def __init__(self) -> None:
        self.low, self.high = 0.0, math.inf
        self.missing_at = [math.inf, -math.inf]  # at low and high; halved where a side stays twice
        self.tried: list[tuple[float, float]] = []

    def take(self, end: float, missing: float) -> None:
        """An end too early (missing above 0), or one that is enough."""
        side = 0 if missing > 0.0 else 1
        if self.tried and (self.tried[-1][1] > 0.0) == (missing > 0.0):
            self.missing_at[1 - side] *= 0.5
        self.missing_at[side] = missing
        self.tried.append((end, missing))
        if side == 0:
            self.low = max(self.low, end)
        else:
            self.high = min(self.high, end)

    def next(self) -> float:
        """The next end to be tried."""
        if self.low == 0.0 or math.isinf(self.high):
            return self._from_one_side()
        low, high = self.missing_at
        if not (math.isfinite(low) and math.isfinite(high)):
            return 0.5 * (self.low + self.high)
        return min(max((self.low * high - self.high * low) / (high - low), self.low), self.high)

    def _from_one_side(self) -> float:
        end, missing = self.tried[-1]
        if not math.isfinite(missing):
            return 1.3 * end
        steeper = 1.0
        if len(self.tried) > 1:
            before, more = self.tried[-2]
            if math.isfinite(more) and more != missing:
                steeper = min(max((end - before) / (more - missing), 1.0), 4.0)
        return max(end + steeper * missing, 0.5 * end)


def start_time_of_direct(drive: Drive | Chain) -> float:
    """Start time under the constant starting torque, s. Raises SimulationError where there is none.

    >>> from softstart import Drive
    >>> round(start_time_of_direct(Drive.load("crane-4amtkf")), 4)
    0.3735
    """
    start: Any = simulate  # of chains too
    run = start(drive, "direct")
    if math.isnan(run.start_time):
        raise SimulationError(
            f"direct does not bring this load to its target speed ({run.status.value[:-1]}); "
            "give start times in s instead of multiples."
        )
    return float(run.start_time)


def verdict_on(problem: Problem) -> Verdict:
    """Why the problem has no solution, which constraint is the cause, and what start time would be enough."""
    assert problem.start_time is not None
    bound = problem.start_time
    shortest = shortest_start_time(problem)
    none_found = math.isinf(shortest)
    if math.isnan(shortest):
        constraint, least = _constraint(problem, shortest), momentum_shortest_time(problem)
        shown = f"the shortest start time was not found, it is no less than {least:.6g} s"
    elif none_found:
        constraint = "probably the first contact, so hard that the gap opens again whatever the motor does"
        shown = f"none was found up to {LONGEST * momentum_shortest_time(problem):.4g} s, which is no proof"
        if problem.k_dyn is not None or problem.heat is not None:
            shown = "the search for the least start time found none, which is no proof"
            constraint = (
                f"heat <= {problem.heat:g} s" if problem.k_dyn is None else f"K_dyn <= {problem.k_dyn:g}"
            )
    else:
        constraint, shown = _constraint(problem, shortest), f"the shortest start time is {shortest:.6g} s"
    text = (
        f"No torque {'was found that ' if none_found else ''}brings {problem.drive.name} to "
        f"{problem.target:g} rad/s ({problem.terminal}) within {bound:g} s while the gap closes only once; "
        f"what forbids it is {constraint}; {shown}."
    )
    return Verdict(problem, shortest, constraint, text + _with_several_contacts(problem))


def _constraint(problem: Problem, shortest: float) -> str:
    """The first limit without which the start time would do."""
    assert problem.start_time is not None
    drive, bound = problem.drive, problem.start_time
    if bound < momentum_shortest_time(problem):
        return f"the largest motor torque of {problem.highest_torque:g} N m, even if it acted all the time"
    ideal = drive.replace(torque_lag=0.0, torque_rate=math.inf)
    plain = replace(
        problem, drive=ideal, torque_speed=(), smoothness=0.0, k_dyn=None, heat=None, minimise="k_dyn"
    )
    unbounded = problem.k_dyn is None and problem.heat is None
    if (unbounded and problem.ideal_torque) or shortest_start_time(plain) > bound:
        return "the gap and the swing of the shaft, which cost time at the largest motor torque"
    dropped = {
        f"the torque lag of {drive.torque_lag:g} s": replace(problem, drive=drive.replace(torque_lag=0.0)),
        f"the torque rate of {drive.torque_rate:g} N m/s": replace(
            problem, drive=drive.replace(torque_rate=math.inf)
        ),
        "the torque-speed curve of the motor": replace(problem, torque_speed=()),
    }
    if problem.k_dyn is not None:
        dropped[f"the bound of {problem.k_dyn:g} on K_dyn"] = replace(problem, k_dyn=None)
    if problem.heat is not None:
        dropped[f"the bound of {problem.heat:g} s on the heat"] = replace(problem, heat=None)
    for name, without in dropped.items():
        if without != problem and shortest_start_time(without) <= bound:
            return name
    return "the limits of the motor torque together"


def _with_several_contacts(problem: Problem) -> str:
    """What constant torque does in that time, if it does: then the gap closes more than once."""
    if problem.terminal != "reached" or problem.start_time is None:
        return ""
    try:
        run = simulate(problem.drive, "direct", base=problem.base)
    except SimulationError:
        return ""
    if not run.start_time <= problem.start_time:
        return ""
    return (
        f" Constant torque gets there in {run.start_time:.6g} s, with {run.contacts} contacts and "
        f"K_dyn {run.k_dyn:.3f}."
    )
