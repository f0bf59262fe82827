"""One set of gains for all cells and scenarios, set up for the nominal drive."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from softstart.arrays import Vector
from softstart.store import Records
from softstart.tuning.log import Log
from softstart.tuning.ranges import inside
from softstart.tuning.ranking import cost
from softstart.tuning.schedule import ScheduleFound
from softstart.tuning.search import Found, search
from softstart.tuning.trials import Judged, Trials
from softstart.tuning.work import set_costs, set_values
from softstart.tuning.workers import Workers

WIDER = 2  # times the population of a cell: a worst case over many starts is rougher than one start
STARTS_A_CALL = 600  # handed to a worker at a time, whatever their number: the answer does not depend on it


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
            seeds = _seeds(trials, scheduled if helped else None, population // 2)
            one = search(costs, seeds, (question.seed, 4, restart), population, question.generations)
            saved.add({"part": part, "place": one.place.tolist(), "cost": one.cost, "tried": one.tried})
        else:
            one = Found(np.array(record["place"]), record["cost"], record["tried"])
        found.append(one)
    return _settled(trials, min(found, key=lambda one: one.cost), np.array([one.cost for one in found]))


def _seeds(trials: Trials, scheduled: ScheduleFound | None, most: int) -> Vector:
    """Places of the defaults, and of the gains of some cells."""
    ranges, defaults = trials.question.ranges, trials.nominal_defaults
    rows = [np.array([float(one.place(defaults[one.name], defaults[one.name])) for one in ranges])]
    if scheduled is not None:
        count = len(trials.question.cells)
        for cell in sorted({round(k) for k in np.linspace(0, count - 1, min(most, count))}):
            gains = {name: value[cell] for name, value in scheduled.values.items()}
            rows.append(np.array([float(one.place(gains[one.name], defaults[one.name])) for one in ranges]))
    return np.stack(rows)


def _settled(trials: Trials, best: Found, restart_costs: Vector) -> SetFound:
    """The gains with what they reach; the defaults if these are better, and allowed."""
    question, yardstick = trials.question, trials.yardstick
    values = {name: float(value[0]) for name, value in set_values(trials, best.place[None]).items()}
    tuned = trials.of_set({name: np.array([value]) for name, value in values.items()})
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
