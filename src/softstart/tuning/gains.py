"""The best gains of each job: searched, smoothed over the grid, no worse than the defaults."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from softstart.arrays import Indices, Vector
from softstart.errors import InputError
from softstart.parallel import Pool
from softstart.store import PartStore
from softstart.tuning.search import CONVERGED, Populations, evolve, populations
from softstart.tuning.trials import TIE, Judged, Trials, in_time, race

SMOOTHINGS = 4
SHARES = (1.0, 0.75, 0.5, 0.25)  # of the way to the median of the neighbours
EQUALLY_GOOD = 1e-3  # share of the metric that smoothness may cost
WIDER = 2  # times the population of a cell: a worst case over many starts is rougher than one start
DIGITS = (6, 9, 12)  # of gains
ROUNDED = 1e-4  # share of the metric that their rounding may cost
KEPT_EACH = 1.0  # s, after which an unfinished search is written down again


@dataclass(frozen=True, eq=False)
class GainSearch:
    """Gains by name, one value a job; what they reach; their costs, and those of each restart."""

    values: dict[str, Vector]
    judged: Judged
    costs: Vector
    restart_costs: Vector


Progress = Callable[[str], object]


class StartCounter:
    """Counts starts, or duties, and tells whoever wants to know how far it is.

    >>> StartCounter(print).tell("schedule", 1, 40)
    schedule, generation 1 of 40, 0 starts
    """

    def __init__(self, progress: Progress | None, what: str = "starts") -> None:
        self.progress, self.what = progress, what
        self.began, self.starts = time.perf_counter(), 0

    @property
    def seconds(self) -> float:
        """Since the work began."""
        return time.perf_counter() - self.began

    def tell(self, title: str, done: int = 0, total: int = 0, unit: str = "generation") -> None:
        """What is being done, how much of it is, and how fast."""
        if self.progress is not None:
            parts = f", {unit} {done} of {total}" if total else ""
            rate = f", {self.starts / self.seconds:,.0f}/s" if self.starts else ""
            self.progress(f"{title}{parts}, {self.starts:,} {self.what}{rate}")


def best_gains(
    trials: Trials, pool: Pool, parts: PartStore, log: StartCounter, schedule: GainSearch | None = None
) -> GainSearch:
    """The best gains of every job; those of some cells of a `schedule` begin the first search of one set."""
    problem = trials.problem
    if not np.any(np.isfinite(trials.default.metric)):
        what, verb = ("start", "starts") if problem.plan is None else ("duty", "is carried out")
        raise InputError(
            f"metric = {problem.metric_name}: no {what} of {problem.recipe.label} with its defaults has "
            f"this result; choose another metric, or give parameters with which it {verb}."
        )
    jobs, restarts = len(trials.drives), problem.restarts
    last = _searched(trials, pool, parts, log, schedule)
    restart_costs = last.best[1].reshape(jobs, restarts)
    best = np.arange(jobs) * restarts + restart_costs.argmin(axis=1)
    places, best_costs = (part[best] for part in last.best)
    if not trials.robust:
        places = _smooth(trials, pool, places, best_costs)
    return _rounded(trials, _settled(trials, places, restart_costs))


def _searched(
    trials: Trials, pool: Pool, parts: PartStore, log: StartCounter, schedule: GainSearch | None
) -> Populations:
    """All searches to their end: the restarts of each job in a row. What is kept is gone on from."""
    problem = trials.problem
    title = "robust set" if trials.robust else "schedule"
    part, random = [title, schedule is not None], (problem.seed, 2 + trials.robust)
    searches = np.repeat(np.arange(len(trials.drives)), problem.restarts)
    size = problem.population * (WIDER if trials.robust else 1)

    def cost_of(indices: Indices, places: Vector, most: Vector) -> Vector:
        raced = race(trials, pool, searches[indices], places, most)
        log.starts += raced.starts
        return raced.costs

    if record := parts.find(part):
        now = Populations(np.array(record["places"]), np.array(record["costs"]), record["generation"])
    else:
        now = populations(cost_of, _seeds(trials, schedule, searches, size // 2), size, random)
    written, unkept = time.monotonic(), record is None

    def keep() -> None:
        nonlocal written, unkept
        places, reached, generation = now
        parts.add(
            {"part": part, "places": places.tolist(), "costs": reached.tolist(), "generation": generation}
        )
        written, unkept = time.monotonic(), False

    # of several starts the mean is still to become small where the worst one is the same
    converged = CONVERGED * (TIE if trials.starts_of.shape[1] > 1 else 1.0)
    for later in evolve(cost_of, now, random, problem.generations, converged):
        now, unkept = later, True
        if time.monotonic() > written + KEPT_EACH:
            keep()
        log.tell(title, now.generation, problem.generations)
    if unkept:
        keep()
    return now


def _seeds(trials: Trials, schedule: GainSearch | None, searches: Indices, most: int) -> Vector:
    """The first places of each search: the defaults; of the first one of a set the gains of cells too.

    The other searches begin alone, so that agreeing means something.
    """
    defaults = trials.places(searches, {name: value[searches] for name, value in trials.defaults.items()})
    if schedule is None:
        return defaults[:, None]
    count = len(schedule.costs)
    cells = sorted({round(k) for k in np.linspace(0, count - 1, min(most, count))})
    gains = {name: value[cells] for name, value in schedule.values.items()}
    others = np.random.default_rng((trials.problem.seed, 4)).random(
        (len(searches), len(cells), defaults.shape[1])
    )
    others[0] = trials.places(np.zeros(len(cells), dtype=int), gains)
    return np.concatenate([defaults[:, None], others], axis=1)


def _smooth(trials: Trials, pool: Pool, places: Vector, best_costs: Vector) -> Vector:
    """Places nearer to the median of their neighbours, where that is equally good within 0.1 %.

    First all parameters move together, then each by itself: one that hardly matters is often far off.
    """
    cells, size = np.arange(len(places)), places.shape[1]
    allowed = np.where(in_time(best_costs), best_costs + EQUALLY_GOOD * np.abs(best_costs), -np.inf)
    near = [list(trials.problem.neighbours(cell)) or [cell] for cell in cells.tolist()]
    masks = np.concatenate([np.ones((1, size)), np.eye(size)])[: size + (size > 1)]
    for mask in np.tile(masks, (SMOOTHINGS, 1)):
        aims = np.array([np.median(places[some], axis=0) for some in near])
        nearer = places + np.array(SHARES)[:, None, None] * mask * (aims - places)
        jobs, most = (np.tile(one, len(SHARES)) for one in (cells, allowed))
        costs = race(trials, pool, jobs, nearer.reshape(-1, size), most).costs
        good = (costs <= most).reshape(len(SHARES), -1)
        moving = np.flatnonzero(np.any(good, axis=0))
        places = places.copy()
        places[moving] = nearer[np.argmax(good, axis=0)[moving], moving]  # the farthest that is good
    return places


def _settled(trials: Trials, places: Vector, restart_costs: Vector) -> GainSearch:
    """The gains with what they reach; the defaults where these are better, and allowed."""
    jobs = np.arange(len(places))
    values, defaults = trials.values(jobs, places), trials.defaults
    tuned, default = trials.judged(jobs, values, to_the_end=True), trials.default
    ours, before = trials.cost(jobs, tuned), trials.cost(jobs, default)
    nearest = trials.values(jobs, trials.places(jobs, defaults))  # within the ranges
    allowed = [np.isclose(nearest[name], defaults[name], rtol=1e-9) for name in defaults]
    back = (before < ours) & np.all(allowed, axis=0)
    values = {name: np.where(back, defaults[name], value) for name, value in values.items()}
    judged = Judged(*(np.where(back[:, None], *both) for both in zip(default, tuned, strict=True)))
    return GainSearch(values, judged, np.where(back, before, ours), restart_costs)


def _rounded(trials: Trials, search: GainSearch) -> GainSearch:
    """Gains with few digits, of one set all its parameters, the derived ones too: as their file has them.

    What each job reaches is what its rounded values reach: in time as before, never worse than the defaults,
    and no more than `ROUNDED` above the exact ones; else they have more digits, or all.
    """
    values = {name: value.copy() for name, value in search.values.items()}
    if trials.robust:
        exact = replace(trials.controller, **{name: float(value[0]) for name, value in values.items()})
        parameters = exact.set_up(trials.drives[0])[0].parameters
        numbers = {k: v for k, v in parameters.items() if isinstance(v, float) and math.isfinite(v)}
        values = {name: np.array([value]) for name, value in numbers.items()}
    costs, judged = search.costs.copy(), Judged(*(part.copy() for part in search.judged))
    left = np.arange(len(costs))
    before = trials.cost(left, trials.default)
    allowed = np.maximum(costs, np.minimum(before, (1.0 + ROUNDED) * costs))
    # strictly: `cost` lets a start be late by the rounding of its instants, which gains must not use up
    latest = np.maximum(trials.latest(left, judged), 1.0)
    for digits in DIGITS:
        tried = {
            name: np.array([float(f"{one:.{digits}g}") for one in value[left]])
            for name, value in values.items()
        }
        reached = trials.judged(left, tried, to_the_end=True)
        cost = trials.cost(left, reached)
        good = (cost <= allowed[left]) & ~(trials.latest(left, reached) > latest[left])
        for part, new in zip(
            (*values.values(), *judged, costs), (*tried.values(), *reached, cost), strict=True
        ):
            part[left[good]] = new[good]
        left = left[~good]
        if not left.size:
            break
    return GainSearch(values, judged, costs, search.restart_costs)
