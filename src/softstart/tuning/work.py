"""The parts of the work, who computes them, and how far it is.

Each part depends on the question and its own arguments alone, so that the answer is the same wherever it is
computed.
"""

from __future__ import annotations

import pickle
import time
from collections.abc import Callable, Iterator, Sequence
from functools import lru_cache, partial
from typing import Any, NamedTuple

import numpy as np

from softstart.arrays import Vector
from softstart.errors import InputError
from softstart.parallel import Pool, checked_workers, why_not_sendable
from softstart.tuning.search import Cost, Found, Search, polish, search, together
from softstart.tuning.trials import Trials, cost

NEIGHBOURLY_STEP = 0.04


class CellSearch(NamedTuple):
    """One of several searches for the gains of a cell."""

    cell: int
    restart: int


class Advice(NamedTuple):
    """The place and cost of a cell's gains, and the places that its neighbours propose in this turn."""

    cell: int
    turn: int
    place: Vector
    cost: float
    others: Vector


def own_values(trials: Trials, cells: Any, places: Vector) -> dict[str, Vector]:
    """Values of the tuned parameters for cells at places: the last axis of `places` are the parameters."""
    chosen = np.asarray(cells)
    return {
        one.name: one.value(places[..., k], trials.own_defaults[one.name][chosen])
        for k, one in enumerate(trials.question.ranges)
    }


def set_values(trials: Trials, places: Vector) -> dict[str, Vector]:
    """Values of the tuned parameters for all cells at places, one place a row."""
    return {
        one.name: one.value(places[:, k], trials.nominal_defaults[one.name])
        for k, one in enumerate(trials.question.ranges)
    }


def cell_costs(trials: Trials, cells: Any, places: Vector) -> Vector:
    """Costs of places, one a row, each for a cell of its own."""
    chosen = np.asarray(cells)
    judged = trials.of_pairs(own_values(trials, chosen, places), chosen)
    bound = trials.yardstick.own_bound[chosen]
    return cost(judged.metric, judged.start_time, bound, trials.question.quantile)


def set_costs(trials: Trials, places: Vector) -> Vector:
    """Costs of places, one a row, for all cells and scenarios at once."""
    judged = trials.of_set(set_values(trials, places))
    rows = len(places)
    bound = trials.yardstick.nominal_bound.ravel()
    return cost(
        judged.metric.reshape(rows, -1), judged.start_time.reshape(rows, -1), bound, trials.question.quantile
    )


def own_default_place(trials: Trials, cell: int) -> Vector:
    """Where the defaults of a cell lie."""
    values = [(one, trials.own_defaults[one.name][cell]) for one in trials.question.ranges]
    return np.array([float(one.place(value, value)) for one, value in values])


def search_cells(trials: Trials, items: Sequence[CellSearch]) -> list[Found]:
    """The best gains of cells, each from a seed of its own."""
    q = trials.question

    def one(item: CellSearch) -> Search:
        seeds, random = own_default_place(trials, item.cell), (q.seed, 2, item.cell, item.restart)
        return lambda costs: search(costs, seeds, random, q.population, q.generations)

    return _for_cells(trials, [item.cell for item in items], [one(item) for item in items])


def ask_neighbours(trials: Trials, items: Sequence[Advice]) -> list[Found]:
    """The gains of cells, or better ones from near the places that their neighbours propose."""

    def one(item: Advice) -> Search:
        def advised(costs: Cost) -> Found:
            found = costs(item.others)
            k, tried = int(np.argmin(found)), len(item.others)
            if not found[k] < item.cost:
                return Found(item.place, item.cost, tried)
            random = (trials.question.seed, 3, item.cell, item.turn)
            generations = trials.question.generations
            after = polish(costs, item.others[k], float(found[k]), random, generations, NEIGHBOURLY_STEP)
            return after._replace(tried=after.tried + tried)

        return advised

    return _for_cells(trials, [item.cell for item in items], [one(item) for item in items])


def _for_cells(trials: Trials, cells: Sequence[int], searches: Sequence[Search]) -> list[Found]:
    """Searches for cells, with one batch of starts for all at a time."""
    which = np.array(cells)
    found: list[Found] = together(lambda whose, places: cell_costs(trials, which[whose], places), searches)
    return found


Work = Callable[..., Any]
WORTH_SHARING = 20_000  # starts from which on processes are started


class Part(NamedTuple):
    """`work(trials, *arguments)`; `packed` makes the same trials in another process."""

    number: int
    work: Work
    arguments: tuple[Any, ...]
    packed: bytes = b""


@lru_cache(maxsize=2)
def _trials_of(packed: bytes) -> Trials:
    return Trials(*pickle.loads(packed))


def _computed_elsewhere(part: Part) -> Any:
    return part.work(_trials_of(part.packed), *part.arguments)


def _computed(trials: Trials, part: Part) -> Any:
    return part.work(trials, *part.arguments)


class Workers:
    """Spreads parts of the work on `trials` over a pool."""

    def __init__(self, trials: Trials, pool: Pool) -> None:
        self.trials, self.pool = trials, pool
        trials.stopping = pool.stopping
        self._packed = b""

    def each(self, work: Work, items: Sequence[tuple[Any, ...]]) -> Iterator[tuple[int, Any]]:
        """Index and result of each item, as they are finished."""
        here = self.pool.scheduler is None and (self.pool.threads or self.pool.count == 1 or len(items) < 2)
        if not here and not self._packed:
            self._packed = pickle.dumps((self.trials.question, self.trials.yardstick))
        parts = (Part(k, work, item, b"" if here else self._packed) for k, item in enumerate(items))
        function = partial(_computed, self.trials) if here else _computed_elsewhere
        if here and len(items) < 2:
            yield from ((part.number, function(part)) for part in parts)
        else:
            yield from ((part.number, result) for part, result in self.pool.results(function, parts))

    def all(self, work: Work, items: Sequence[tuple[Any, ...]]) -> list[Any]:
        """The results in the order of the items."""
        found = dict(self.each(work, items))
        return [found[index] for index in range(len(items))]


def pool_for(trials: Trials, workers: int | None, scheduler: str | None, starts: int) -> Pool:
    """Where to make about so many starts: threads for compiled controllers, else processes, or a cluster."""
    count = checked_workers(workers, scheduler)
    if not trials.compiled and starts < WORTH_SHARING:
        count = 1
    if scheduler is not None or (count > 1 and not trials.compiled):
        reason = why_not_sendable(trials.question)
        if reason and (workers is not None or scheduler is not None):
            given = f"workers = {workers}" if scheduler is None else "scheduler"
            raise InputError(
                f"{given}: the controller or the metric cannot be handed to another process ({reason}); "
                "define it at the top level of a module, or give workers=1."
            )
        count = 1 if reason else count
    return Pool(count, threads=trials.compiled, scheduler=scheduler, describe=_described)


def _described(part: Part) -> str:
    return f"part {part.number + 1} of the tuning"


Progress = Callable[[str], object]


class Log:
    """Counts starts, and tells whoever wants to know.

    >>> log = Log(print)
    >>> log.begin("schedule", 12)
    schedule 0 of 12, 0 starts
    """

    def __init__(self, progress: Progress | None) -> None:
        self.progress = progress
        self.began = time.perf_counter()
        self.starts = 0
        self.title, self.total, self.done = "", 0, 0

    def begin(self, title: str, total: int = 0, done: int = 0) -> None:
        """A new piece of work, of so many parts."""
        self.title, self.total, self.done = title, total, done
        self._tell()

    def did(self, starts: int, parts: int = 1) -> None:
        """So many starts more, and parts."""
        self.starts += starts
        self.done += parts
        self._tell()

    @property
    def seconds(self) -> float:
        """Since the work began."""
        return time.perf_counter() - self.began

    def _tell(self) -> None:
        if self.progress is None:
            return
        parts = f" {self.done} of {self.total}" if self.total else ""
        rate = f", {self.starts / self.seconds:,.0f}/s" if self.starts else ""
        self.progress(f"{self.title}{parts}, {self.starts:,} starts{rate}")
