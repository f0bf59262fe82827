"""Gentle starts found by a quick search, where the optimum takes a long one. They are not proved best."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass

import numpy as np

from softstart.arrays import Matrix, Vector
from softstart.controller import make_controller
from softstart.drive import Drive
from softstart.errors import SimulationError
from softstart.optimal.robust.evaluation import Evaluator, ProfileParameters, Staircase
from softstart.optimal.robust.guesses import crossing_time, offspring
from softstart.start.simulation import simulate

SEED = 0  # the same question has the same answer
SPREAD, MEMBERS, ROUNDS = 4000, 64, 400
STALLED, WORTH = 150, 1e-3  # a search ends where so many rounds gain less than this share
HANDED_ON = 8  # members that go on to the next, longer start time
LATE = 100.0  # what being late costs, relative to the time asked for
NEVER = 10.0  # of the time asked for: how late a start counts that does not reach the speed
LEVELS, EDGES = 5, 4
PULSE, COAST, CATCH, COAST_AGAIN, LEVEL, LEVEL_AGAIN, HOLD = range(7)
N_NUMBERS = 7


@dataclass(frozen=True)
class GentleStart:
    """A start within `start_time_bound` s that was found and simulated; a gentler one may exist.

    `start_time` (s), `k_dyn` and `contacts` are those of the exact plant.
    """

    start_time_bound: float
    start_time: float
    k_dyn: float
    contacts: int

    def summary(self) -> dict[str, float]:
        """As plain data."""
        return asdict(self)


def gentle_starts(drive: Drive, start_times: Sequence[float], seconds: float) -> list[GentleStart]:
    """Gentle starts of any drive, as many of the start times (s) as are done within about `seconds`.

    Differential evolution on the exact plant over torques of five levels known beforehand (pulse, coast,
    catch, coast, hold), first for the first start time, then the others in order, each going on from the one
    before. Nothing is proved of them: they say from above what `bound_at` says from below.

    >>> crane = Drive.load("crane-4amtkf").replace(torque_lag=0.002)
    >>> found, = gentle_starts(crane, [0.4], 60.0)
    >>> found.start_time <= 0.4, 0.96 < found.k_dyn < 1.0
    (True, True)
    """
    search = _Search(drive, max(start_times, default=0.0), time.monotonic() + seconds)
    found: list[GentleStart] = []
    for start_time in [*start_times[:1], *sorted(start_times[1:])]:
        best = search.best(start_time)
        if search.over:
            break
        quick = [one for one in found if one.start_time <= start_time]
        known = [one for one in [_run(drive, search, best, start_time), *quick] if one is not None]
        if known:
            least = min(known, key=lambda one: one.k_dyn)
            found.append(GentleStart(start_time, least.start_time, least.k_dyn, least.contacts))
    return sorted(found, key=lambda one: one.start_time_bound)


def _run(drive: Drive, search: _Search, numbers: Vector, start_time: float) -> GentleStart | None:
    """The start as the exact plant makes it, None if it is late."""
    profile = search.staircase(numbers).tidy()
    try:
        run = simulate(drive, make_controller("profile", {"profile": profile}))
    except SimulationError:
        return None
    if not run.start_time <= start_time:
        return None
    return GentleStart(start_time, run.start_time, run.k_dyn, run.contacts)


class _Search:
    """A population that is carried from one start time to the next."""

    def __init__(self, drive: Drive, longest: float, until: float) -> None:
        self.until = until
        self.low, self.high = float(drive.minimum_torque), float(min(drive.Ms, drive.maximum_torque))
        self.period = float(drive.elastic_period)
        self.crossing = crossing_time(drive, self.high)
        self.evaluator = Evaluator(list(drive.positions.values()), longest)
        # a stand-in whose levels and edges can be told from each other
        self.parameters = ProfileParameters(self.staircase(np.full(N_NUMBERS, 0.55)), drive)
        self.random = np.random.default_rng(SEED)
        self.spread: tuple[Matrix, Vector, Vector] | None = None
        self.handed_on = np.zeros((0, N_NUMBERS))

    @property
    def over(self) -> bool:
        """Whether the time is up."""
        return time.monotonic() > self.until

    def best(self, start_time: float) -> Vector:
        """The numbers of the gentlest member for a start time."""
        if self.spread is None:
            first = self.random.random((SPREAD, N_NUMBERS))
            self.spread = first, *self._figures(first)
        here, peak, reached = self.spread
        order = np.argsort(self._cost(peak, reached, start_time))[:MEMBERS]
        here = np.concatenate([self.handed_on, here[order]])[:MEMBERS]
        costs = self._cost(*self._figures(here), start_time)
        last, since = math.inf, 0
        for _ in range(ROUNDS):
            since = 0 if float(costs.min()) < last * (1.0 - WORTH) else since + 1
            last = last if since else float(costs.min())
            if self.over or since > STALLED:
                break
            tried = offspring(self.random, here, costs)
            new = self._cost(*self._figures(tried), start_time)
            gain = new < costs
            here[gain], costs[gain] = tried[gain], new[gain]
        order = np.argsort(costs)
        self.handed_on = here[order[:HANDED_ON]]
        best: Vector = here[order[0]]
        return best

    def staircase(self, numbers: Vector) -> Staircase:
        """The torque over time of one member."""
        unknowns = self._unknowns(numbers[None, :])[0]
        return Staircase(np.concatenate([[0.0], unknowns[LEVELS:]]), unknowns[:LEVELS].copy())

    def _unknowns(self, numbers: Matrix) -> Matrix:
        """Levels (N m) and edges (s) of members, a row each, from their numbers between 0 and 1."""
        least = 1e-3 * self.period
        longest = np.zeros(EDGES)
        longest[PULSE] = max(self.crossing, 0.25 * self.period)
        longest[COAST] = self.period + 0.3 * self.crossing
        longest[CATCH], longest[COAST_AGAIN] = 0.4 * self.period, 0.8 * self.period
        edges = np.cumsum(least + longest * numbers[:, :EDGES], axis=1)
        full = np.full(numbers.shape[0], self.high)
        level, again = (
            self.low + (self.high - self.low) * np.clip(1.3 * numbers[:, i] - 0.3, 0.0, 1.0)
            for i in (LEVEL, LEVEL_AGAIN)
        )
        hold = self.high * np.clip(0.25 + 0.8 * numbers[:, HOLD], 0.0, 1.0)
        return np.column_stack([full, level, full, again, hold, edges])

    def _figures(self, numbers: Matrix) -> tuple[Vector, Vector]:
        """Worst peak (N m, inf where a start was given up) and start time (s, NaN where there is none)."""
        figures = self.evaluator.figures(self.parameters, self._unknowns(numbers))
        return figures.peak.max(axis=1), figures.start_time.max(axis=1)

    def _cost(self, peak: Vector, reached: Vector, start_time: float) -> Vector:
        late = np.where(np.isnan(reached), NEVER, np.maximum(reached / start_time - 1.0, 0.0))
        cost: Vector = peak / self.high + LATE * late
        return cost
