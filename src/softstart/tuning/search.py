"""Differential evolution of many populations at once: every generation of all of them is one call.

A point is a place in a unit box. Costs are only compared, so that jumps of the cost do no harm.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from softstart.arrays import Indices, Vector

# which search each place (one a row) belongs to, and the cost that matters at most -> costs, right up to that
Costs = Callable[[Indices, Vector, Vector], Vector]

CONVERGED = 1e-4  # standard deviation of a population's costs, over their mean
WEIGHTS = 0.5, 1.0  # of the difference of two members, drawn for each candidate
CROSSOVER = 0.7  # share of the parameters that are changed
AGREES = 0.01  # of the best: within this share of it searches agree


class Populations(NamedTuple):
    """Places (axes: search, member, parameter), their costs, and the generation."""

    places: Vector
    costs: Vector
    generation: int = 0

    @property
    def best(self) -> tuple[Vector, Vector]:
        """The best place of each search, and its cost."""
        rows, k = np.arange(len(self.costs)), self.costs.argmin(axis=1)
        return self.places[rows, k], self.costs[rows, k]


def populations(costs: Costs, seeds: Vector, size: int, random: tuple[int, ...]) -> Populations:
    """The first ones: the seeds (axes: search, seed, parameter), and a Latin hypercube of at least `size`."""
    rng = np.random.default_rng(random)
    fresh = max(size - seeds.shape[1], size // 2, 5)
    places = np.concatenate([seeds, [latin(rng, fresh, seeds.shape[2]) for _ in seeds]], axis=1)
    searches = np.repeat(np.arange(len(places)), places.shape[1])
    cost = costs(searches, np.concatenate(places), np.full(searches.shape, np.inf))
    return Populations(places, cost.reshape(places.shape[:2]))


def evolve(
    costs: Costs, first: Populations, random: tuple[int, ...], generations: int, converged: float = CONVERGED
) -> Iterator[Populations]:
    """The populations after each further generation; DE/best/1/bin.

    v = x_best + F (x_a - x_b), F drawn from 0.5 to 1, at random where it leaves the box; 70 % of its
    parameters replace those of a member. The candidate stays if it is no worse, so that a larger cost need
    not be known. A search whose costs are
    nearly equal is at its end. With the populations of an interrupted search the same ones follow: each
    generation has random numbers of its own.

    R. Storn, K. Price, J. Global Optim. 11 (1997) 341-359, doi:10.1023/A:1008202821328.

    >>> bowl = lambda which, x, most: np.sum((x - 0.3) ** 2, axis=1)
    >>> first = populations(bowl, np.full((1, 1, 2), 0.9), 16, (0,))
    >>> *_, last = evolve(bowl, first, (0,), 40)
    >>> last.best[0].round(2).tolist()
    [[0.3, 0.3]]
    """
    places, cost, begin = first
    for number in range(begin + 1, generations + 1):
        active = np.flatnonzero(cost.std(axis=1) > converged * np.abs(cost.mean(axis=1)))
        if not active.size:
            return
        candidates = _candidates(places, cost, np.random.default_rng((*random, number)))[active]
        searches = np.repeat(active, places.shape[1])
        candidate_costs = costs(searches, np.concatenate(candidates), cost[active].ravel())
        candidate_costs = candidate_costs.reshape(candidates.shape[:2])
        better = candidate_costs <= cost[active]
        places, cost = places.copy(), cost.copy()
        places[active] = np.where(better[..., None], candidates, places[active])
        cost[active] = np.where(better, candidate_costs, cost[active])
        yield Populations(places, cost, number)


def _candidates(places: Vector, costs: Vector, rng: np.random.Generator) -> Vector:
    """A candidate for each member of each search; the same whatever other searches are at their end."""
    searches, members, size = places.shape
    rows, member = np.arange(searches)[:, None], np.arange(members)
    step = rng.integers(1, members, (searches, members))
    other = rng.integers(1, members - 1, (searches, members))
    a, b = (member + step) % members, (member + other + (other >= step)) % members  # two different others
    best = places[rows, costs.argmin(axis=1)[:, None]]
    weight = rng.uniform(*WEIGHTS, (searches, members, 1))
    mutant = best + weight * (places[rows, a] - places[rows, b])
    mutant = np.where((mutant < 0.0) | (mutant > 1.0), rng.random(places.shape), mutant)
    changed = rng.random(places.shape) < CROSSOVER
    changed |= np.arange(size) == rng.integers(size, size=(searches, members, 1))  # at least one
    return np.where(changed, mutant, places)


def latin(rng: np.random.Generator, count: int, size: int) -> Vector:
    """A Latin hypercube in the unit box: each place, one a row, in a stratum of its own along every axis."""
    strata = rng.permuted(np.tile(np.arange(count), (size, 1)), axis=1).T
    places: Vector = (strata + rng.random(strata.shape)) / count
    return places


def agreement(costs: Sequence[float] | Vector, settled: float) -> int:
    """How many of several searches came within 1 % of the best of them and of what was settled on.

    >>> agreement([1.0, 1.005, 1.2], 1.1)
    2
    """
    best = min(settled, *costs)
    return int(np.sum(np.asarray(costs) <= best + AGREES * (abs(best) or 1.0)))
