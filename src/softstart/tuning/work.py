"""The parts of the work: each depends on the question and its own arguments alone, in whatever process."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from softstart.arrays import Vector
from softstart.tuning.ranking import cost
from softstart.tuning.search import Found, polish, search
from softstart.tuning.together import Cost, Search, together
from softstart.tuning.trials import Trials

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
