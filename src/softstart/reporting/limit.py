"""How gentle any start could be: a bound for every start time, and the optima found in the time given."""

from __future__ import annotations

import json
import math
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np

from softstart.drive import Drive
from softstart.errors import InputError
from softstart.optimal.front_points import FrontPoint
from softstart.optimal.momentum import momentum_bound, momentum_shortest_time
from softstart.optimal.problem import Problem, Terminal
from softstart.optimal.result import InfeasibleError, OptimumError
from softstart.reporting.known import KnownStart, known_starts

TERMINAL: Terminal = "reached"
SHARES = (1.02, 1.05, 1.1, 1.2, 1.35, 1.6)  # of the start time of direct, where optima are looked for
INSTANTS = 80  # of the curve of the bound
EARLIER = 0.85  # of the quickest strategy: from where on the curve is drawn
POLL = 0.1  # s
GENTLER = 0.999  # times an optimum: what is no more than its last digits is not gentler
QUICK_SHARE = 0.3  # of the budget is kept for starts that are good and not proved best

Tell = Callable[[float, str], object]


@dataclass(frozen=True)
class Limit:
    """What no start can go below, and what the best one reaches.

    `times` (s) and `bounds`: a K_dyn that no torque over time within the motor's limits can go below, however
    it is controlled. `shortest`: no torque at all is quicker, s. `points`: optima, each re-simulated exactly;
    `missing` start times (s) whose optimum was not found within `budget` s. `known` are starts found by a
    quick search where there is no optimum, or a less gentle one. `refusal` says why there is nothing.
    """

    times: tuple[float, ...] = ()
    bounds: tuple[float, ...] = ()
    shortest: float = math.nan
    points: tuple[FrontPoint, ...] = ()
    missing: tuple[float, ...] = ()
    known: tuple[KnownStart, ...] = ()
    budget: float = 0.0
    refusal: str = ""

    def optimum_at(self, start_time: float) -> FrontPoint | None:
        """The optimum for a start time, if it was found."""
        return next((p for p in self.points if p.found and p.start_time_bound == start_time), None)

    def gentlest_known(self, start_time: float) -> float | None:
        """Least K_dyn of all optima and other starts found that take no longer, None without any."""
        found = [p.k_dyn for p in self.found if p.k_dyn is not None and p.start_time_bound <= start_time]
        found += [one.k_dyn for one in self.known if one.start_time <= start_time]
        return min(found, default=None)

    @property
    def gave_up(self) -> list[FrontPoint]:
        """Start times at which the search came to its end without an optimum."""
        return [p for p in self.points if p.status == "NOT_FOUND"]

    @property
    def found(self) -> list[FrontPoint]:
        """The optima in order of start time."""
        return sorted((p for p in self.points if p.found), key=lambda p: p.start_time_bound)

    def summary(self) -> dict[str, Any]:
        """As plain data."""
        return {
            "terminal": TERMINAL,
            "shortest_start_time": self.shortest,
            "start_time": list(self.times),
            "k_dyn_lower_bound": list(self.bounds),
            "optima": [
                {key: value for key, value in p.summary().items() if key not in ("profile", "seconds")}
                for p in self.points
            ],
            "not_found": list(self.missing),
            "known_starts": [one.summary() for one in self.known],
            "budget": self.budget,
            "refusal": self.refusal,
        }


def bound_at(drive: Drive, start_time: float) -> float | None:
    """The K_dyn that no start within `start_time` s can go below; None where there is no bound.

    >>> round(bound_at(Drive.load("crane-4amtkf").replace(target_speed=60.0), 0.2883042), 4)
    0.9092
    """
    if not start_time > 0.0:
        return None
    try:
        bound = momentum_bound(Problem(drive, start_time, TERMINAL)).k_dyn
    except InputError:
        return None
    return bound if math.isfinite(bound) else None


def limit(drive: Drive, own: Sequence[float], reference: float, budget: float, tell: Tell) -> Limit:
    """The limit for start times around those of the strategies, `own`, of which the first matter most.

    Where there is a formula the optima are computed at once; the others, by linear program or collocation,
    in a process of their own that is ended after `budget` s. `reference` is the start time of direct, s.
    """
    try:
        Problem(drive, 1.0, TERMINAL)
    except InputError as error:
        return Limit(refusal=error.sentences[0])
    shortest = momentum_shortest_time(Problem(drive, 1.0, TERMINAL))
    least = reference if math.isfinite(reference) else min(own, default=math.nan)
    if not (math.isfinite(least) and math.isfinite(shortest)):
        return Limit(refusal="No strategy reaches the target speed, so there is no start time to judge by.")
    asked = list(dict.fromkeys([*own, *(share * least for share in SHARES)]))
    longest = max(*asked, 1.05 * shortest)
    soonest = max(1.0005 * shortest, EARLIER * min(asked))
    times = np.linspace(soonest, longest, INSTANTS)
    bounds = [bound_at(drive, float(t)) for t in times]
    curve = [(float(t), b) for t, b in zip(times, bounds, strict=True) if b is not None]
    points, left = _by_formula(drive, asked)
    known: list[KnownStart] = []
    if left and budget > 0.0:
        began = time.monotonic()
        points += _in_own_process(drive, left, (1.0 - QUICK_SHARE) * budget, tell)
        tell(1.0, "looking for gentle starts")
        best = {p.start_time_bound: p.k_dyn for p in points if p.k_dyn is not None}
        order = sorted(left, key=lambda t: t in best)  # those without an optimum first
        known = known_starts(drive, order, budget - (time.monotonic() - began))
        known = [one for one in known if one.k_dyn < GENTLER * best.get(one.start_time_bound, math.inf)]
    settled = {p.start_time_bound for p in points if p.status != "NOT_FOUND"}
    return Limit(
        times=tuple(t for t, _ in curve),
        bounds=tuple(b for _, b in curve),
        shortest=shortest,
        points=tuple(sorted(points, key=lambda p: p.start_time_bound)),
        missing=tuple(sorted(t for t in asked if t not in settled)),
        known=tuple(known),
        budget=budget,
    )


def _by_formula(drive: Drive, asked: Iterable[float]) -> tuple[list[FrontPoint], list[float]]:
    """Optima of the closed form, and the start times for which there is none."""
    from softstart.optimal.solving import optimize

    points, left = [], []
    for start_time in asked:
        try:
            best = optimize(drive, start_time, terminal="reached", method="closed-form")
            points.append(FrontPoint.of_optimum(best, start_time))
        except (InputError, InfeasibleError, OptimumError):
            left.append(start_time)
    return points, left


def _in_own_process(drive: Drive, asked: Sequence[float], budget: float, tell: Tell) -> list[FrontPoint]:
    """Optima by the other methods, as many as are found in time."""
    task = json.dumps({"drive": drive.to_toml(), "start_times": list(asked), "terminal": TERMINAL})
    with tempfile.TemporaryFile("w+", encoding="utf-8") as told:
        process = subprocess.Popen(
            [sys.executable, "-m", "softstart.reporting.limit_worker"],
            stdin=subprocess.PIPE, stdout=told, stderr=subprocess.DEVNULL, text=True,
        )  # fmt: skip
        try:
            assert process.stdin is not None
            with suppress(BrokenPipeError), process.stdin:  # it may have ended already
                process.stdin.write(task)
            began = time.monotonic()
            while process.poll() is None and (spent := time.monotonic() - began) < budget:
                tell(spent / budget, f"looking for the optimum, at most {budget:g} s")
                time.sleep(POLL)
        finally:
            process.kill()
            process.wait()
        told.seek(0)
        lines = told.read().split("\n")[:-1]  # what follows the last line break was cut off
    return [FrontPoint.of_record(json.loads(line)) for line in lines]
