"""The search for the best point of a unit box: differential evolution, then a polish without derivatives.

Several searches run at once, so that the candidates of all of them are started in one batch.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Sequence
from queue import SimpleQueue
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import differential_evolution

from softstart.arrays import Vector
from softstart.tuning.ranges import latin

Cost = Callable[[Vector], Vector]  # places, one a row, to their costs

CONVERGED = 1e-4  # standard deviation of the population's costs, over their mean
FIRST_STEP, LAST_STEP = 0.08, 2e-4
AGREES = 0.01  # of the best: within this share of it searches agree
POLLS = 1.5  # of the polish, at most, for each generation of the search


class Found(NamedTuple):
    """The best place, its cost, and how many candidates were tried."""

    place: Vector
    cost: float
    tried: int


def search(cost: Cost, seeds: Any, random: tuple[int, ...], population: int, generations: int) -> Found:
    """The least cost in the unit box, by scipy's differential evolution over whole generations at a time.

    `seeds` (one a row) belong to the first population, the others fill the box as a Latin hypercube; `random`
    seeds the generator. The polish of `polish` follows. The answer is never worse than any seed.

    >>> found = search(lambda x: np.sum((x - 0.3) ** 2, axis=1), [[0.9, 0.9]], (0,), 16, 30)
    >>> found.place.round(2).tolist(), found.cost < 1e-5
    ([0.3, 0.3], True)
    """
    rng = np.random.default_rng(random)
    first = np.atleast_2d(np.asarray(seeds, dtype=np.float64))
    size = first.shape[1]
    # at least as many fresh places as seeds, however many seeds there are
    fresh = max(population - len(first), population // 2, 5)
    start = np.concatenate([first, latin(rng, fresh, size)])
    best = Found(first[0], np.inf, 0)

    def costs(columns: Vector) -> Vector:
        nonlocal best
        places = columns.T if columns.ndim == 2 else columns[None, :]
        found = cost(places)
        k = int(np.argmin(found))
        tried = best.tried + len(places)
        best = (
            Found(places[k].copy(), float(found[k]), tried)
            if found[k] < best.cost
            else best._replace(tried=tried)
        )
        return found if columns.ndim == 2 else found[0]

    differential_evolution(
        costs, [(0.0, 1.0)] * size, init=start, maxiter=generations, tol=CONVERGED, seed=rng,
        polish=False, vectorized=True, updating="deferred",
    )  # fmt: skip
    after = polish(cost, best.place, best.cost, (*random, 1), generations)
    return after._replace(tried=best.tried + after.tried)


def polish(
    cost: Cost,
    place: Vector,
    known: float,
    random: tuple[int, ...],
    generations: int,
    step: float = FIRST_STEP,
) -> Found:
    """The least cost near a place: a mesh search with whole polls, without derivatives.

    Each poll tries, in one batch, a step along every axis and along as many random orthogonal directions,
    both ways. The best one that is better becomes the centre; where none is, the step is halved, down to 2e-4
    of the box. Jumps of the cost do no harm: only values are compared.
    """
    rng = np.random.default_rng(random)
    tried = 0
    for _ in range(math.ceil(POLLS * generations)):
        if step < LAST_STEP:
            break
        turned, _ = np.linalg.qr(rng.normal(size=(place.size, place.size)))
        ways = np.concatenate(
            [np.eye(place.size), turned] if place.size > 1 else [np.eye(1), 0.5 * np.eye(1)]
        )
        places = np.clip(place + step * np.concatenate([ways, -ways]), 0.0, 1.0)
        found = cost(places)
        tried += len(places)
        k = int(np.argmin(found))
        if found[k] < known:
            place, known = places[k], float(found[k])
        else:
            step *= 0.5
    return Found(place, known, tried)


def agreement(costs: Any, best: float) -> tuple[int, float]:
    """How many of several searches came within 1 % of the best, and how far apart they are over the best.

    >>> agreement([1.0, 1.005, 1.2], 1.0)
    (2, 0.2)
    """
    values = np.asarray(costs, dtype=np.float64)
    scale = abs(best) or 1.0
    near = int(np.sum(values <= best + AGREES * scale))
    return near, float(f"{(values.max() - min(best, values.min())) / scale:.12g}")


Search = Callable[[Cost], Any]
Batch = Callable[[Vector, Vector], Vector]  # whose place each row is, and the rows, to their costs


class _StoppedError(Exception):
    """Ends a search that is waiting when another one has failed."""


def together(batch: Batch, searches: Sequence[Search]) -> list[Any]:
    """The results of searches, each a function of a cost function, in order.

    Each search runs as if it were alone, in a thread of its own. Whenever all that still run have asked for
    the costs of some places, `batch` is called once with these, in the calling thread. A cost depends on the
    search and the place alone, so the results do not depend on what else runs.

    >>> def halve(cost):
    ...     return float(cost(np.array([[2.0]]))[0]) / 2
    >>> together(lambda whose, places: places[:, 0] * (1 + whose), [halve, halve])
    [1.0, 2.0]
    """
    asked: SimpleQueue[tuple[int, bool, Any]] = SimpleQueue()
    answers: list[SimpleQueue[Any]] = [SimpleQueue() for _ in searches]

    def run(index: int, search: Search) -> None:
        def cost(places: Vector) -> Vector:
            asked.put((index, False, places))
            answer = answers[index].get()
            if answer is None:
                raise _StoppedError
            found: Vector = answer
            return found

        try:
            asked.put((index, True, search(cost)))
        except BaseException as error:
            asked.put((index, True, error))

    threads = [threading.Thread(target=run, args=pair, daemon=True) for pair in enumerate(searches)]
    for thread in threads:
        thread.start()
    found: list[Any] = [None] * len(searches)
    running, waiting = len(searches), dict[int, Vector]()
    try:
        while running:
            index, ended, what = asked.get()
            if ended:
                running -= 1
                if isinstance(what, BaseException):
                    raise what
                found[index] = what
            else:
                waiting[index] = what
            if running and len(waiting) == running:
                order = sorted(waiting)
                rows = [waiting[i] for i in order]
                costs = batch(np.repeat(order, [len(row) for row in rows]), np.concatenate(rows))
                waiting.clear()
                for i, part in zip(
                    order, np.split(costs, np.cumsum([len(row) for row in rows])[:-1]), strict=True
                ):
                    answers[i].put(part)
    finally:
        for queue in answers:
            queue.put(None)  # whoever still waits is sent home
        for thread in threads:
            thread.join()
    return found
