"""Lower bound of K_dyn for every start time, and the optima found in the time given."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from softstart.drive import Machine
from softstart.errors import InputError
from softstart.optimal.bounds import momentum_bound, momentum_shortest_time
from softstart.optimal.front import FrontPoint, front_point
from softstart.optimal.optimize import optimize
from softstart.optimal.path import Path as StartPath
from softstart.optimal.problem import Problem, Terminal
from softstart.optimal.pulse_coast_hold import NotApplicable, applies, solve_pulse_coast_hold
from softstart.parallel import DiedError, Worker
from softstart.parallel import Progress as WorkerProgress
from softstart.results import OneLine
from softstart.start.recommendation import Row

TIGHT = 1.0  # per cent between an optimum and a lower bound that counts as proof
TERMINAL: Terminal = "reached"
SHARES = (1.0, 1.02, 1.05, 1.1, 1.2, 1.35, 1.6)  # of the start time of direct, where optima are looked for
INSTANTS = 80  # of the curve of the bound
EARLIER = 0.85  # of the quickest strategy: from where on the curve is drawn
POLL = 0.1  # s


@dataclass(frozen=True, repr=False)
class OptimumCurve(OneLine):
    """What no start can go below, and what the best ones found reach.

    `times` (s) and `bounds`: a K_dyn that no torque over time within the motor's limits can go below, however
    it is controlled. `shortest`: no torque at all is quicker, s. `points`: optima, each re-simulated exactly;
    `missing` start times (s) whose optimum was not found within `budget` s, and why there is `no_formula`.
    `refusal` says why there is nothing.
    """

    times: tuple[float, ...] = ()
    bounds: tuple[float, ...] = ()
    shortest: float = math.nan
    points: tuple[FrontPoint, ...] = ()
    missing: tuple[float, ...] = ()
    budget: float = 0.0
    refusal: str = ""
    no_formula: str = ""

    @property
    def found(self) -> list[FrontPoint]:
        """The optima in order of start time."""
        return sorted((p for p in self.points if p.found), key=lambda p: p.start_time_bound)

    def optimum_at(self, start_time: float) -> FrontPoint | None:
        """The optimum for a start time, if it was found."""
        return next((p for p in self.found if p.start_time_bound == start_time), None)

    def lowest_known(self, start_time: float, rows: Sequence[Row]) -> float | None:
        """Lowest K_dyn of `rows` and of the optima that take no longer, None without any."""
        found = [p.k_dyn for p in self.found if p.k_dyn is not None and p.start_time_bound <= start_time]
        return min([*found, *(r.run.k_dyn for r in rows if r.run.start_time <= start_time)], default=None)

    def proofs(self, drive: Machine) -> tuple[list[float], list[tuple[float, float]], list[float]]:
        """Optima proved against every start, against starts whose gap closes once, and those not proved.

        Of the first and the last the per cent above the lower bound; of the second start time and per cent.
        """
        every, single, loose = list[float](), list[tuple[float, float]](), list[float]()
        for p in self.found:
            bound, once = bound_at(drive, p.start_time_bound), p.k_dyn_lower_bound_once
            known = math.inf if p.k_dyn is None else p.k_dyn
            over, left = (100.0 * (known / one - 1.0) if one else math.inf for one in (bound, once))
            if over <= TIGHT:
                every.append(max(over, 0.001))
            elif left <= TIGHT:
                single.append((p.start_time_bound, max(left, 0.001)))
            else:
                loose.append(over)
        return every, single, loose

    def summary(self) -> dict[str, Any]:
        """As plain data."""
        left_out = ("profile", "seconds")
        points = [{k: v for k, v in p.summary().items() if k not in left_out} for p in self.points]
        return {
            "terminal": TERMINAL,
            "shortest_start_time": self.shortest,
            "start_time": list(self.times),
            "k_dyn_lower_bound": list(self.bounds),
            "optima": points,
            "not_found": list(self.missing),
            "budget": self.budget,
            "refusal": self.refusal,
        }


def bound_at(drive: Machine, start_time: float) -> float | None:
    """The K_dyn that no start within `start_time` s can go below; None where there is no bound.

    >>> from softstart import Drive
    >>> round(bound_at(Drive.load("crane-4amtkf").replace(target_speed=60.0), 0.2883042), 4)
    0.9092
    """
    if not start_time > 0.0:
        return None
    try:
        bound = momentum_bound(Problem(drive, start_time, TERMINAL))
    except InputError:
        return None
    return bound.k_dyn if math.isfinite(bound.k_dyn) and bound.kind != "none" else None


def limit(
    drive: Machine,
    chosen: Sequence[float],
    own: Sequence[float],
    reference: float,
    budget: float,
    progress: Callable[[float, str], object],
    meanwhile: Callable[[], object] = lambda: None,
) -> OptimumCurve:
    """The limit for start times around those of the strategies, `own`, of which those `chosen` matter most.

    Where there is a formula the optima are computed at once. At the others, those chosen and shares of the
    start time of direct, `reference` in s, they are searched in a process of their own that is ended after
    `budget` s. `meanwhile` is called once while that process computes.
    """
    try:
        problem = Problem(drive, 1.0, TERMINAL)
    except InputError as error:
        meanwhile()
        return OptimumCurve(refusal=error.sentences[0])
    shortest = momentum_shortest_time(problem)
    least = reference if math.isfinite(reference) else min(own, default=math.nan)
    if not (math.isfinite(least) and math.isfinite(shortest)):
        meanwhile()
        return OptimumCurve(
            refusal="No strategy reaches the target speed, so there is no start time to judge by."
        )
    asked = list(dict.fromkeys([*chosen, *(share * least for share in SHARES)]))
    early, late = max(1.0005 * shortest, EARLIER * min(*asked, *own)), max(*asked, *own, 1.05 * shortest)
    times = np.linspace(early, late, INSTANTS).tolist()
    curve = [(t, bound) for t in times if (bound := bound_at(drive, t)) is not None]
    points = list(_by_formula(drive, dict.fromkeys([*asked, *own])))
    left = [t for t in asked if t not in {p.start_time_bound for p in points}]
    points += _in_own_process(drive, left if budget > 0.0 else [], budget, progress, meanwhile)
    settled = {p.start_time_bound for p in points if p.status != "NOT_FOUND"}
    return OptimumCurve(
        tuple(t for t, _ in curve),
        tuple(bound for _, bound in curve),
        shortest,
        tuple(sorted(points, key=lambda p: p.start_time_bound)),
        tuple(sorted(t for t in asked if t not in settled)),
        budget,
        no_formula=applies(problem) or "so near the shortest start time",
    )


def _by_formula(drive: Machine, asked: Iterable[float]) -> Iterator[FrontPoint]:
    """Optima of the closed form, where it holds."""
    for start_time in asked:
        with suppress(NotApplicable):
            solve_pulse_coast_hold(Problem(drive, start_time, TERMINAL))
            yield FrontPoint.of_optimum(optimize(drive, start_time, terminal=TERMINAL), start_time)


def _in_own_process(
    drive: Machine,
    asked: Sequence[float],
    budget: float,
    progress: Callable[[float, str], object],
    meanwhile: Callable[[], object],
) -> list[FrontPoint]:
    """Optima by search, as many as are found in time."""
    if not asked:
        meanwhile()
        return []
    points: list[FrontPoint] = []
    worker = Worker(quiet=True)
    try:
        worker.submit(stream_optima, drive, asked, reports=True)
        began = time.monotonic()
        meanwhile()
        message = None
        while message is None or message.kind == "part":
            if message is not None:
                points.append(message.content)
            spent = time.monotonic() - began
            progress(min(spent / budget, 1.0), f"looking for the optimum, at most {budget:g} s")
            message = worker.receive(min(POLL, max(budget - spent, 0.0)))
            if message is None and spent >= budget:
                break
    except DiedError:
        pass  # what it found counts
    finally:
        worker.kill()
    return points


def stream_optima(drive: Machine, start_times: Sequence[float], *, progress: WorkerProgress) -> None:
    """Look for the optima of start times and send each at once: the first one, then by distance to it."""
    path = StartPath(Problem(drive, 1.0, TERMINAL))
    for start_time in sorted(start_times, key=lambda one: abs(one - start_times[0])):
        progress.part(front_point(replace(path.problem, start_time=start_time), path))
