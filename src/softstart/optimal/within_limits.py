"""The quickest start that keeps the limits of a drive, or a bound on K_dyn.

The least K_dyn falls with the start time, so the quickest start that keeps a permissible shaft torque is the
gentlest one of the first start time at which it does: a root, and each value on the way is an optimum by the
method that is exact for it, with its lower bound. A life that is asked for joins in: what is looked for is
the first of these gentlest starts that keeps all. Where no formula solves the problem, the search begins at
the least start time that the CasADi problem finds.

How good the answer is: where a lower bound of the peak lies above the permissible torque, no start of that
time or less keeps it. The longest such time is a lower bound of the start time.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import replace

from softstart.drive import Drive, Limits
from softstart.drive.limits import Limit
from softstart.errors import InputError
from softstart.late import late
from softstart.optimal import pulse_coast_hold
from softstart.optimal.exact import hold_of
from softstart.optimal.momentum import momentum_bound, momentum_shortest_time
from softstart.optimal.problem import Problem
from softstart.optimal.result import (
    InfeasibleError,
    Kept,
    NotConverged,
    Optimum,
    OptimumError,
    Trial,
    Verdict,
)
from softstart.optimal.shortest import Bracket, shortest_start_time
from softstart.start.recommendation import Margin, Row, checked_limits, unchecked_life

collocation = late("softstart.optimal.collocation.search")

AIM = 1.0 - 2e-6  # of a limit: an answer on the near side of it
WITHIN = 1e-5  # of the start time
WITHIN_SEVERAL = 1e-3  # the same where one profile serves several positions: each try takes long
EDGE = 1e-4  # so much longer than the shortest start, its program is sure to find one
EDGES = (1e-6, 1e-5, EDGE)  # which it often finds sooner
LONGEST = 100.0  # times what the inertia alone takes at full torque: no longer start time is tried
MOST_TRIALS = 30
NO_TIME = 1e-3  # elastic periods: where momentum rules out nothing, the search begins there
PROOFS = 4  # shorter start times whose certificates are asked for, after the answer


def check_limits(drive: Drive) -> None:
    """InputError where no limit of the drive bounds what a start does to the shaft.

    >>> check_limits(Drive.load("hoist-15kw"))
    Traceback (most recent call last):
    softstart.errors.InputError: limits: ... has no permissible shaft torque; give limits.shaft_torque...
    """
    limits = checked_limits(drive)
    if limits.shaft_torque is None and limits.life is None:
        raise InputError(
            f"limits: {drive.name or 'the drive'} has no permissible shaft torque; give "
            f'limits.shaft_torque in its file, as "175 N*m". {unchecked_life(drive)}'.rstrip()
        )


def quickest(
    problem: Problem,
    solve: Callable[[Problem], Optimum],
    certified: Callable[[Optimum], Optimum],
    seconds: float = math.inf,
) -> Optimum:
    """The quickest of the gentlest starts that keep the limits; where a problem minimises the start time, its
    bound on K_dyn, which it may leave out.

    `solve` finds the gentlest one of a time, `certified` proves its bound, which the search does not need.
    The start time of `problem` does not count. After `seconds` of the clock no further start time is tried
    once a start that keeps the limits is known. Raises InfeasibleError where there is none.
    """
    began = time.perf_counter()
    search = _Search(problem, solve, certified)
    found = certified(search.first_that_keeps(began + seconds))
    at_least, covers = search.proved(found)
    own = problem.minimise == "start_time"
    limits = search.limits if own else checked_limits(problem.drive)
    what = "this K_dyn" if problem.k_dyn is not None else "the target speed" if own else "the limits"
    answer = Trial(found.method, found.end_time, time.perf_counter() - began, "")
    return replace(
        found,
        problem=problem if own else found.problem,
        why=f"{found.why}; the first start time whose gentlest start keeps {what}",
        kept=Kept(
            search.margins(found, limits), at_least, covers, "" if own else unchecked_life(problem.drive)
        ),
        tried=(*search.hints, answer) if own else (),
        seconds=time.perf_counter() - began,
    )


class _Search:
    """Start times that were tried, each with its gentlest start."""

    def __init__(
        self,
        problem: Problem,
        solve: Callable[[Problem], Optimum],
        certified: Callable[[Optimum], Optimum],
    ) -> None:
        self.asked, self.solve, self.certified = problem, solve, certified
        self.problem = replace(problem, start_time=1.0, minimise="k_dyn", k_dyn=None)  # any time
        own = problem.minimise == "start_time"
        self.limits = Limits() if own else replace(checked_limits(problem.drive), start_time=None)
        most = self.limits.shaft_torque
        self.allowed = problem.k_dyn or math.inf if most is None else most / problem.base_torque
        self.tried: list[Optimum] = []
        self.hints: list[Trial] = []
        self.shortest = 0.0  # no start with one contact is quicker, as far as that is known, s
        drive = problem.drive
        alone = float(drive.J1 + drive.J2) * problem.target / problem.highest_torque
        released = float(drive.release_time) if math.isfinite(drive.release_time) else 0.0
        self.no_time = NO_TIME * float(drive.elastic_period)
        self.longest = LONGEST * (released + alone + float(drive.elastic_period))
        self.soonest = self._soonest()

    def _soonest(self) -> float:
        """No start keeps the permissible torque in less time, s, however often the gap closes."""
        low = max(momentum_shortest_time(self.problem), self.no_time)
        if not self._too_hard(low):
            return low
        high = 2.0 * low
        while self._too_hard(high):
            if high > self.longest:
                least = self._bound(high) * self.problem.base_torque
                raise self._none(f"within {high:.4g} s no start has a peak below {least:.4g} N m")
            high *= 2.0
        while high - low > 1e-12 * high:
            middle = 0.5 * (low + high)
            low, high = (middle, high) if self._too_hard(middle) else (low, middle)
        return high

    def _bound(self, end: float) -> float:
        return momentum_bound(replace(self.problem, start_time=end)).k_dyn

    def _too_hard(self, end: float) -> bool:
        return self._bound(end) > self.allowed

    def first_that_keeps(self, until: float) -> Optimum:
        """The gentlest start of the least start time that is found, by regula falsi."""
        within = WITHIN if len(self.problem.drive.positions) == 1 else WITHIN_SEVERAL
        if math.isinf(self.allowed) and self.limits.life is None:
            return self._shortest()
        hint = self._hint()
        bracket, found, end = Bracket(), None, max(self.soonest * (1.0 + 1e-9), hint)
        if hint == 0.0:  # else the root is near: steps from one side find it, bisection from afar does not
            bracket.low = self.soonest
        for _ in range(MOST_TRIALS):
            best = self._gentlest(end)
            share = math.inf if best is None else self._share(best)
            if best is not None and share <= 1.0:
                found = best
                if share >= 1.0 - within or end <= max(self.soonest, self.shortest) * (1.0 + 2.0 * EDGE):
                    break
            bracket.take(end, end * min(max(share - AIM, -0.5), 1.0) if best else math.inf)
            bracket.low = max(bracket.low, min(self.shortest, bracket.high))
            late = found is not None and time.perf_counter() > until
            if late or bracket.high - bracket.low <= within * end or end > self.longest:
                break
            end = max(bracket.next(), self.soonest * (1.0 + 1e-9))
            if end <= self.shortest:
                end = self.shortest * (1.0 + EDGE)
        if found is None:
            raise self._none(self._nearest())
        return found

    def _shortest(self) -> Optimum:
        """The shortest start, whatever its K_dyn."""
        self.shortest = end = shortest_start_time(self.problem)
        for edge in EDGES if math.isfinite(end) else ():
            best = self._gentlest(end * (1.0 + edge))
            if best is not None:
                return best
        raise self._none(self._nearest())

    def _hint(self) -> float:
        """The least start time that collocation claims, s; 0 where the formula is quick, or it finds none."""
        if len(self.problem.drive.positions) > 1 or not pulse_coast_hold.applies(self.problem):
            return 0.0
        hold = hold_of(self.problem)
        began = time.perf_counter()
        most = self.allowed if math.isfinite(self.allowed) else None  # a life bounds no K_dyn
        bounded = replace(hold.free, start_time=None, minimise="start_time", k_dyn=most)
        try:
            end = hold.until + float(collocation.solve(bounded).end_time)
        except (NotConverged, InputError) as failed:
            self.hints.append(Trial("collocation", None, time.perf_counter() - began, str(failed)))
            return 0.0
        self.hints.append(Trial("collocation", end, time.perf_counter() - began, ""))
        return end

    def _gentlest(self, end: float) -> Optimum | None:
        try:
            best = self.solve(replace(self.problem, start_time=end))
        except InfeasibleError as none:
            if math.isinf(none.verdict.shortest_start_time):
                raise
            self.shortest = max(self.shortest, none.verdict.shortest_start_time)  # nan: as it was
            return None
        except (OptimumError, NotConverged):
            return None
        self.tried.append(best)
        return best

    def margins(self, best: Optimum, limits: Limits) -> tuple[Margin, ...]:
        """Those of the start, by the rule of `compare`; of an unknown position the worst."""
        found = Row(best.run, None, worst_case=()).margins(limits)
        if self.asked.k_dyn is None:
            return found
        return (*found, Margin(Limit("K_dyn", "1", "k_dyn", self.asked.k_dyn), best.k_dyn, ""))

    def _share(self, best: Optimum) -> float:
        """The largest share of a limit that a start takes."""
        return max((1.0 - one.share for one in self.margins(best, self.limits)), default=0.0)

    def proved(self, found: Optimum) -> tuple[float, str]:
        """No start that keeps the permissible torque takes less time than this, s; what that covers."""
        least = self.soonest if self.soonest > self.no_time else 0.0
        by_momentum = least, momentum_bound(found.problem).covers
        if found.bound.kind != "certificate" or math.isinf(self.allowed):
            return by_momentum
        # K_dyn falls so many times as fast as the time rises; the certificate lies as far below it as here
        others = [one for one in self.tried if one.end_time != found.end_time]
        near = min(others, key=lambda one: abs(one.end_time - found.end_time), default=None)
        steep = 1.0
        if near is not None:
            steep = abs(math.log(near.k_dyn / found.k_dyn) / math.log(near.end_time / found.end_time))
        step = 1.2 * max(self.allowed / found.bound.k_dyn - 1.0, WITHIN) / max(steep, 0.1)
        for _ in range(PROOFS):
            end = found.end_time * (1.0 - step)
            if end <= self.soonest:
                break
            best = self._gentlest(end)
            if best is None and end <= self.shortest:
                break
            bound = None if best is None else self.certified(best).bound
            if bound is not None and bound.k_dyn > self.allowed:
                return end, bound.covers
            step *= 2.0
        return by_momentum

    def _nearest(self) -> str:
        if not self.tried:
            return f"no start of up to {self.longest:.4g} s was found at all"
        nearest = min(self.tried, key=self._share)
        worst = min(self.margins(nearest, self.limits), key=lambda one: one.share, default="")
        return f"the nearest start that was found takes {nearest.end_time:.4g} s, {worst}"

    def _none(self, reason: str) -> InfeasibleError:
        name = self.problem.drive.name
        if self.asked.minimise == "start_time":
            bound = self.asked.k_dyn
            most_k = "" if bound is None else f" with K_dyn of {bound:g} or less"
            sentence = f"start_time: no start of {name}{most_k} was found: {reason}."
            return InfeasibleError(Verdict(self.asked, math.inf, "the bound on K_dyn", sentence))
        most, life = self.limits.shaft_torque, self.limits.life
        asked = [] if most is None else [f"shaft torque {most:.4g} N m"]
        asked += [] if life is None else [f"life {life / 3600.0:.4g} h"]
        sentence = f"limits: no start of {name} keeps them ({', '.join(asked)}): {reason}."
        return InfeasibleError(Verdict(self.problem, math.inf, "the limits", sentence))
