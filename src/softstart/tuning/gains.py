"""The best gains of each cell, and one set of gains for all."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from softstart.arrays import Vector
from softstart.store import Records
from softstart.tuning.ranges import inside
from softstart.tuning.search import Found, search
from softstart.tuning.trials import Judged, Trials, cost, in_time
from softstart.tuning.work import (
    Advice,
    CellSearch,
    Log,
    Workers,
    ask_neighbours,
    cell_costs,
    own_values,
    search_cells,
    set_costs,
    set_values,
)

STARTS_A_CALL, LARGEST_BLOCK = 600, 12  # handed to a worker at a time; the answer does not depend on it
TURNS = 3  # times that each cell asks its neighbours
SMOOTHINGS = 4
SHARES = (1.0, 0.75, 0.5, 0.25)  # of the way to the median of the neighbours
EQUALLY_GOOD = 1e-3  # share of the metric that smoothness may cost


@dataclass(frozen=True, eq=False)
class ScheduleFound:
    """Gains by name, one value a cell; what they reach; their costs, and those of each restart."""

    values: dict[str, Vector]
    judged: Judged
    costs: Vector
    restart_costs: Vector
    kept_default: Any  # whether a cell's defaults were best, one a cell


def schedule(workers: Workers, saved: Records, log: Log) -> ScheduleFound:
    """The best gains of every cell."""
    trials = workers.trials
    question = trials.question
    cells = range(len(question.cells))
    pairs = [CellSearch(cell, restart) for cell in cells for restart in range(question.restarts)]
    found = _parts(workers, saved, log, "schedule, searches", search_cells, pairs)
    restart_costs = np.array([one.cost for one in found]).reshape(len(cells), question.restarts)
    best = [
        min(found[i : i + question.restarts], key=lambda one: one.cost)
        for i in range(0, len(found), question.restarts)
    ]
    places = np.array([one.place for one in best])
    costs = np.array([one.cost for one in best])
    changed = np.ones(len(cells), dtype=bool)
    for turn in range(TURNS):
        asking = [cell for cell in cells if any(changed[list(question.neighbours(cell))])]
        if not asking:
            break
        items = [Advice(c, turn, places[c], float(costs[c]), _beside(trials, c, places)) for c in asking]
        title = f"schedule, neighbours asked, turn {turn + 1}"
        after = _parts(workers, saved, log, title, ask_neighbours, items)
        changed[:] = False
        for cell, one in zip(asking, after, strict=True):
            changed[cell] = one.cost < costs[cell]
            places[cell], costs[cell] = one.place, one.cost
    return _settled(workers, _smooth(workers, places, costs), restart_costs)


def _parts(
    workers: Workers, saved: Records, log: Log, title: str, work: Any, items: list[Any]
) -> list[Found]:
    """The results of all items, those saved taken from there; several a call, whatever the workers."""
    question = workers.trials.question
    found: dict[int, Found] = {}
    for index, item in enumerate(items):
        record = saved.find(_key(item))
        if record is not None:
            found[index] = Found(np.array(record["place"]), record["cost"], record["tried"])
    missing = [index for index in range(len(items)) if index not in found]
    size = min(max(STARTS_A_CALL // (question.population * len(question.scenarios)), 1), LARGEST_BLOCK)
    blocks = [missing[i : i + size] for i in range(0, len(missing), size)]
    log.begin(title, len(items), len(found))
    for k, results in workers.each(work, [([items[index] for index in block],) for block in blocks]):
        for index, one in zip(blocks[k], results, strict=True):
            found[index] = one
            record = {"place": one.place.tolist(), "cost": one.cost, "tried": one.tried}
            saved.add({"part": _key(items[index]), **record})
            log.did(one.tried * len(question.scenarios))
    return [found[index] for index in range(len(items))]


def _key(item: CellSearch | Advice) -> tuple[str, int, int]:
    """Under which an item is saved."""
    if isinstance(item, CellSearch):
        return ("cell", item.cell, item.restart)
    return ("neighbours", item.cell, item.turn)


def _beside(trials: Any, cell: int, places: Vector) -> Vector:
    """Where the neighbours' gains lie in a cell: as multiples of its own defaults, and as they are."""
    question = trials.question
    near = list(question.neighbours(cell))
    theirs = own_values(trials, near, places[near])
    same = [one.place(theirs[one.name], trials.own_defaults[one.name][cell]) for one in question.ranges]
    return np.concatenate([places[near], np.stack(same, axis=-1)])


def _smooth(workers: Workers, places: Vector, costs: Vector) -> Vector:
    """Places nearer to the median of their neighbours, where that is equally good within 0.1 %.

    First all parameters move together, then each by itself: one that hardly matters is often far off.
    """
    trials = workers.trials
    question = trials.question
    cells = range(len(question.cells))
    allowed = np.where(in_time(costs), costs + EQUALLY_GOOD * np.abs(costs), -np.inf)
    shares = np.array(SHARES)[:, None, None]
    near = [list(question.neighbours(cell)) for cell in cells]
    size = places.shape[1]
    for _ in range(SMOOTHINGS):
        for mask in np.concatenate([np.ones((1, size)), np.eye(size)]) if size > 1 else np.ones((1, 1)):
            aims = [np.median(places[some], axis=0) if some else places[c] for c, some in enumerate(near)]
            nearer = places + shares * mask * (np.array(aims) - places)
            found = cell_costs(trials, np.tile(list(cells), len(SHARES)), nearer.reshape(-1, size))
            good = found.reshape(len(SHARES), len(cells)) <= allowed
            moving = np.flatnonzero(np.any(good, axis=0))
            places = places.copy()
            places[moving] = nearer[np.argmax(good, axis=0)[moving], moving]  # the farthest that is good
    return places


def _settled(workers: Workers, places: Vector, restart_costs: Vector) -> ScheduleFound:
    """The gains with what they reach; the defaults where these are better, and allowed."""
    trials = workers.trials
    question, yardstick = trials.question, trials.yardstick
    cells = list(range(len(question.cells)))
    defaults = trials.own_defaults
    values = own_values(trials, cells, places)
    tuned, bound = trials.to_the_end().of_pairs(values, cells), yardstick.own_bound
    ours = cost(tuned.metric, tuned.start_time, bound, question.quantile)
    before = cost(yardstick.own.metric, yardstick.own.start_time, bound, question.quantile)
    back = np.asarray((before < ours) & inside(question.ranges, defaults, defaults))
    values = {name: np.where(back, defaults[name], value) for name, value in values.items()}
    judged = Judged(
        np.where(back[:, None], yardstick.own.metric, tuned.metric),
        np.where(back[:, None], yardstick.own.start_time, tuned.start_time),
    )
    return ScheduleFound(values, judged, np.where(back, before, ours), restart_costs, back)


WIDER = 2  # times the population of a cell: a worst case over many starts is rougher than one start


@dataclass(frozen=True, eq=False)
class SetFound:
    """Gains by name; what they reach in each cell and scenario; their cost and that of each restart."""

    values: dict[str, float]
    judged: Judged
    cost: float
    restart_costs: Vector
    kept_default: bool


def robust_set(workers: Workers, saved: Records, log: Log, scheduled: ScheduleFound | None) -> SetFound:
    """The set whose worst case, or quantile, over all starts is least."""
    trials = workers.trials
    question = trials.question
    starts = len(question.cells) * len(question.scenarios)
    chunk = max(1, STARTS_A_CALL // starts)

    def costs(places: Vector) -> Vector:
        parts = [(places[i : i + chunk],) for i in range(0, len(places), chunk)]
        found = np.concatenate(workers.all(set_costs, parts))
        log.did(len(places) * starts, parts=0)
        return found

    found: list[Found] = []
    for restart in range(question.restarts):
        log.begin(f"robust set, search {restart + 1} of {question.restarts}")
        # gains of the cells begin the first search; the others begin alone, so that agreeing means something
        helped = scheduled is not None and restart == 0
        part = ("robust", int(helped), restart)
        record = saved.find(part)
        if record is None:
            population = WIDER * question.population
            seeds = _seeds_of_set(trials, scheduled if helped else None, population // 2)
            one = search(costs, seeds, (question.seed, 4, restart), population, question.generations)
            saved.add({"part": part, "place": one.place.tolist(), "cost": one.cost, "tried": one.tried})
        else:
            one = Found(np.array(record["place"]), record["cost"], record["tried"])
        found.append(one)
    return _settled_set(trials, min(found, key=lambda one: one.cost), np.array([one.cost for one in found]))


def _seeds_of_set(trials: Trials, scheduled: ScheduleFound | None, most: int) -> Vector:
    """Places of the defaults, and of the gains of some cells."""
    ranges, defaults = trials.question.ranges, trials.nominal_defaults
    rows = [np.array([float(one.place(defaults[one.name], defaults[one.name])) for one in ranges])]
    if scheduled is not None:
        count = len(trials.question.cells)
        for cell in sorted({round(k) for k in np.linspace(0, count - 1, min(most, count))}):
            gains = {name: value[cell] for name, value in scheduled.values.items()}
            rows.append(np.array([float(one.place(gains[one.name], defaults[one.name])) for one in ranges]))
    return np.stack(rows)


def _settled_set(trials: Trials, best: Found, restart_costs: Vector) -> SetFound:
    """The gains with what they reach; the defaults if these are better, and allowed."""
    question, yardstick = trials.question, trials.yardstick
    values = {name: float(value[0]) for name, value in set_values(trials, best.place[None]).items()}
    tuned = trials.to_the_end().of_set({name: np.array([value]) for name, value in values.items()})
    judged = Judged(tuned.metric[0], tuned.start_time[0])
    ours, before = (
        float(
            cost(
                one.metric.ravel(), one.start_time.ravel(), yardstick.nominal_bound.ravel(), question.quantile
            )
        )
        for one in (judged, yardstick.nominal)
    )
    defaults = trials.nominal_defaults
    if before < ours and bool(inside(question.ranges, defaults, defaults)):
        return SetFound(dict(defaults), yardstick.nominal, before, restart_costs, True)
    return SetFound(values, judged, ours, restart_costs, False)
