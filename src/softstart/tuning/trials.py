"""What the tuner minimises: the cost of candidate gains, judged by starts that one batch simulates.

A *job* is what gains are wanted for: each cell of the schedule, judged by the scenarios of that cell, or the
one robust set, judged by all cells. The cost of a candidate is its metric, K_dyn if nobody says otherwise, at
the quantile over the starts of its job (1: the worst start), if these keep the bound on the start time; else
the larger, the later they are.

Candidates race against the cost that each of them has to beat: the starts that decided lately come first, and
once a candidate has lost, nothing more of it is simulated. The cost of one that wins is the same to the bit.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softstart.arrays import Indices, Vector
from softstart.chain.machines import varied
from softstart.controller import CompiledController, Controller, make_controller
from softstart.errors import InputError
from softstart.hints import nearest
from softstart.parallel import Pool
from softstart.start.batch import Batch, prepared
from softstart.start.duty_batch import DutyBatch
from softstart.start.results import limited_time
from softstart.tuning.problem import MARGIN, TuningProblem

Values = Mapping[str, Vector]  # parameter -> one value a candidate

PATIENCE = 3.0  # a start is given up at so many times the longest bound
STARTS_A_CALL = 20_000  # for the sake of memory
STARTS_A_THREAD = 600  # in a call of one of several threads, which hear no Ctrl-C meanwhile


class Judged(NamedTuple):
    """Metric and time in s of starts. Axes: candidate, start of its job. NaN where a start failed.

    `start_time` is that which the bound is on, the settled time of a strategy that holds the speed.
    """

    metric: Vector
    start_time: Vector

    def at(self, index: Any) -> Judged:
        """A part of both."""
        return Judged(self.metric[index], self.start_time[index])


class Raced(NamedTuple):
    """Costs of candidates, infinite of those that lost.

    `deciders` are the starts, of those of the job of each candidate, that decided it; `starts` so many were
    made.
    """

    costs: Vector
    deciders: Indices
    starts: int


class Trials:
    """Candidates for the jobs of a problem: one for each cell or, if `robust`, one for all cells.

    `defaults` are the parameters as the controller derives them, by name, one a job; `default` is what they
    reach and `bound` the bound on the start time of each start in s (axes: job, start).
    """

    def __init__(
        self, problem: TuningProblem, robust: bool, known: tuple[Judged, Vector] | None = None
    ) -> None:
        self.problem, self.robust = problem, robust
        self.controller = problem.recipe.make()
        count, scenarios = len(problem.cells), len(problem.scenarios)
        starts = np.arange(count * scenarios)
        self.starts_of = starts.reshape(1 if robust else count, -1)  # job -> its starts, cell by cell
        cells = [problem.drive_of(cell) for cell in range(count)]
        self.drives = [problem.drive.design_drive] if robust else [one.design_drive for one in cells]
        self.base = np.repeat([one.mean_torque for one in cells], scenarios)
        self.batch = _starts_of_cells(problem)
        set_up = [self.controller.set_up(drive)[0] for drive in self.drives]
        self.compiled = isinstance(set_up[0], CompiledController) and problem.plan is None
        self.defaults = {name: _defaults(problem, name, set_up) for name in problem.names}
        size = self.starts_of.shape[1]
        self.spared = size - _kept(size, problem.quantile)  # so many starts of a candidate do not count
        self.decided = np.zeros(self.starts_of.shape)  # how many candidates each start has decided lately
        self.time_limit: float | None = None
        self.timeless = np.zeros(self.starts_of.shape, dtype=bool)
        self.default, self.bound = known or self._measured()
        self.timeless = self.default.start_time == 0.0
        if np.isfinite(longest := float(self.bound.max())):
            self.time_limit = PATIENCE * longest + self._longest_dwell()

    def __reduce__(self) -> tuple[object, ...]:  # made again in another process
        return Trials, (self.problem, self.robust, (self.default, self.bound))

    def _measured(self) -> tuple[Judged, Vector]:
        """What the defaults reach, and the bounds that follow."""
        limit, default = self.problem.start_time, self.judged(np.arange(len(self.drives)), {})
        if self.problem.plan is not None:
            # a duty of jogs has no start time to bound, nor has a start that ends before its set speed
            timeless = np.isnan(default.start_time) & ~np.isnan(default.metric)
            default = Judged(default.metric, np.where(timeless, 0.0, default.start_time))
        if limit is not None and limit.multiple:
            bound = limit.value * self._direct()[self.starts_of]
        elif limit is not None or self.problem.limited:
            bound = np.full(self.starts_of.shape, limit.value if limit else math.inf)
        else:
            bound = np.where(np.isnan(default.start_time), np.inf, default.start_time)
        return default, np.where(default.start_time == 0.0, np.inf, bound)

    def _longest_dwell(self) -> float:
        """For how long a start must be settled at most, s, under a strategy that holds the speed; else 0."""
        highest = {one.name: one.ends(self.defaults[one.name])[1].tolist() for one in self.problem.ranges}
        dwells = [0.0]
        for job, drive in enumerate(self.drives):
            values = {name: ends[job] for name, ends in highest.items()}
            with suppress(InputError):
                ready, own = replace(self.controller, **values).set_up(drive)
                if regulation := ready.regulation(own):
                    dwells.append(regulation.dwell)
        return max(dwells)

    def _direct(self) -> Vector:
        """Start time, or settled time, of `direct` for every start."""
        problem = self.problem
        drives = [problem.drive_of(cell).design_drive for cell in range(len(problem.cells))]
        figures = self.batch.figures(
            make_controller("direct").set_ups(drives), 1.0, settled=problem.time == "settled_time"
        )
        start_times: Vector = figures[problem.time if problem.plan is None else "start_time"][0]
        if np.any(failed := np.isnan(start_times)):
            gap, inertia = problem.cells[int(failed.argmax()) // len(problem.scenarios)]
            raise InputError(
                f"start_time: direct does not bring a load of {inertia:g} kg m2 behind a gap of {gap:g} rad "
                "to its target speed; give the start time in s instead of a multiple."
            )
        return start_times

    def values(self, jobs: Indices, places: Vector) -> dict[str, Vector]:
        """Values of the tuned parameters at places in their ranges; the last axis are the parameters."""
        return {
            one.name: one.value(places[..., k], self.defaults[one.name][jobs])
            for k, one in enumerate(self.problem.ranges)
        }

    def places(self, jobs: Indices, values: Values) -> Vector:
        """The places of values; the last axis are the parameters."""
        each = [one.place(values[one.name], self.defaults[one.name][jobs]) for one in self.problem.ranges]
        return np.stack(each, axis=-1)

    def costs(self, jobs: Indices, places: Vector) -> Vector:
        """The cost of each place, one a row, for a job of its own."""
        return self.cost(jobs, self.judged(jobs, self.values(jobs, places)))

    def raced(self, jobs: Indices, places: Vector, most: Vector, order: Indices) -> Raced:
        """The costs of places that are `most` at most; the starts of each in its `order`, 1, 1, 2, 4, ....

        A candidate has lost once more of its starts than the quantile spares are beyond the `limits`.
        """
        values, limits = self.values(jobs, places), self.limits(jobs, most)
        judged = Judged(*np.full((2, *order.shape), np.nan))
        beyond, known = np.zeros((2, *order.shape), dtype=bool), np.zeros(order.shape, dtype=bool)
        running, done = np.flatnonzero(most > -math.inf), 0
        while running.size and done < order.shape[1]:
            which = order[running, done : done + max(done, 1)]
            at = running[:, None], which
            now = self.judged(jobs[running], _at(values, running), which=which, limits=limits.at(at))
            judged.metric[at], judged.start_time[at] = now
            failed = np.isnan(now.metric) | np.isnan(now.start_time)
            beyond[:, *at] = failed | (np.array(now) > np.array(limits.at(at)))
            known[at] = True
            lost = beyond[:, running].sum(axis=-1).max(axis=0) > self.spared
            running = running[~lost | (most[running] >= UNFINISHED)]
            done += which.shape[1]
        costs = np.full(len(jobs), np.inf)
        costs[running] = self.cost(jobs[running], judged.at(running))
        one_by_one = judged.at((..., None))
        alone = cost(one_by_one.metric, one_by_one.start_time, self.bound[jobs][..., None], 1.0)
        return Raced(costs, np.where(known, alone, -np.inf).argmax(axis=1), int(known.sum()))

    def limits(self, jobs: Indices, most: Vector) -> Judged:
        """Metric and time that no start of a candidate may exceed, if its cost is to be `most` at most."""
        # with no metric below 0 the mean over the starts only adds to the cost
        decides = in_time(most) & self.problem.metric.startswith(NEVER_NEGATIVE)
        late = np.where(most < UNFINISHED, np.maximum(most / TOO_SLOW - 1.0, 0.0), np.inf)
        bound = self.bound[jobs]
        metric = np.broadcast_to(np.where(decides, most, np.inf)[:, None], bound.shape)
        return Judged(metric, bound * (1.0 + late + 2.0 * SLACK)[:, None])  # twice: for rounding

    def _give_up(self, starts: Indices, limits: Judged | None) -> tuple[Vector, Vector] | None:
        """Torque in N m and time in s with which a start is beyond the limits, as `Batch.results` takes them.

        Where the quantile spares starts a peak says nothing of the time, nor the other way round.
        """
        if limits is None or self.spared:
            return None
        metric = self.problem.metric
        base: Any = self.base[starts] if metric == "k_dyn" else 1.0 if metric == "peak_torque" else math.inf
        return ((1.0 + SLACK) * base * limits.metric).ravel(), limits.start_time.ravel()

    def cost(self, jobs: Indices, judged: Judged) -> Vector:
        """The cost of what candidates reach."""
        return cost(judged.metric, judged.start_time, self.bound[jobs], self.problem.quantile)

    def latest(self, jobs: Indices, judged: Judged) -> Vector:
        """Start time over its bound, at the quantile over the starts of each job."""
        return np.asarray(upper(judged.start_time / self.bound[jobs], self.problem.quantile))

    def judged(
        self,
        jobs: Indices,
        values: Values,
        to_the_end: bool = False,
        which: Indices | None = None,
        limits: Judged | None = None,
    ) -> Judged:
        """What candidates reach, each for a job of its own; NaN where the controller refuses its values.

        Without values: the controller as it is. `which` starts of its job each candidate makes: all by
        default. A start that is given up as it is beyond the `limits` has NaN too. `to_the_end` for gains
        that are settled: a start flies through its gaps in spans that end with the time limit, and rounds by
        their length; without it the figures are those of `simulate` to the bit.
        """
        if which is None:
            which = np.tile(np.arange(self.starts_of.shape[1]), (len(jobs), 1))
        starts, timeless = (
            np.take_along_axis(one[jobs], which, axis=1) for one in (self.starts_of, self.timeless)
        )
        set_ups = (
            replace(self.controller, **{name: float(value[k]) for name, value in values.items()}).set_up(
                self.drives[job]
            )
            for k, job in enumerate(jobs.tolist())
        )
        try:
            limit = None if to_the_end else self.time_limit
            figures = self.batch.figures(
                set_ups, self.base[starts].ravel(), starts.ravel(), time_limit=limit,
                give_up=self._give_up(starts, limits),
            )  # fmt: skip
        except InputError:
            if not values:
                raise  # the defaults are no candidate: the input is wrong
            if len(jobs) == 1:
                return Judged(*np.full((2, *starts.shape), np.nan))
            each = [
                self.judged(jobs[k], _at(values, k), to_the_end, which[k], limits and limits.at(k))
                for k in (slice(k, k + 1) for k in range(len(jobs)))
            ]
            return Judged(*(np.concatenate(parts) for parts in zip(*each, strict=True)))
        metric = self.problem.metric
        if metric not in figures and values:
            return Judged(*np.full((2, *starts.shape), np.nan))  # one that only starts have that get so far
        if metric not in figures:
            near = nearest(metric, figures)
            hint = f"did you mean {near}?" if near else f"choose one of {', '.join(figures)}."
            what = "start" if self.problem.plan is None else "duty"
            raise InputError(f'metric = "{metric}": this is not a result of a {what}; {hint}')
        time = limited_time(figures).reshape(starts.shape)
        figure = figures[metric][0].reshape(starts.shape)
        time = np.where(timeless & ~np.isnan(figure), 0.0, time)
        return Judged(1.0 - figure if metric == MARGIN else figure.astype(np.float64), time)


def _at(values: Values, index: Any) -> Values:
    """The values of some candidates."""
    return {name: value[index] for name, value in values.items()}


def _starts_of_cells(problem: TuningProblem) -> Batch | DutyBatch:
    """The machines that start, or carry out a duty: of each cell, one by one, those of all scenarios."""
    of_cells: dict[str, Any] = dict(zip(("gap", "load_inertia"), np.array(problem.cells).T, strict=True))
    drives: list[Any] = [problem.drive_of(cell) for cell in range(len(problem.cells))]
    columns_by_name = {}
    for name in sorted({*of_cells, *(name for one in problem.scenarios for name in one)}):
        # of a chain each gap goes with all others
        value = (
            of_cells[name]
            if name in of_cells
            else np.array([float(one.parameter_value(name).value) for one in drives])
        )
        columns = [one[name].of(value) if name in one else value for one in problem.scenarios]
        columns_by_name[name] = np.stack(columns, axis=1).ravel()
    machines = varied(problem.drive, columns_by_name)
    if problem.plan is not None:
        return DutyBatch.of(machines, problem.plan, [problem.metric])
    return prepared(machines)


def _defaults(problem: TuningProblem, name: str, set_up: list[Controller]) -> Vector:
    """A tuned parameter as the controller derives it for each job."""
    values = [one.parameters[name] for one in set_up]
    if None in values:
        raise InputError(
            f"free: the controller {problem.recipe.label} derives no default for {name}; "
            "tuning starts from the default, so give the parameter one."
        )
    return np.array(values, dtype=np.float64)


class Part(NamedTuple):
    """Some of the candidates, each a place for a job of its own, and what each has to beat."""

    which: slice
    trials: Trials
    jobs: Indices
    places: Vector
    most: Vector
    order: Indices


def _raced(part: Part) -> Raced:
    return part.trials.raced(part.jobs, part.places, part.most, part.order)


def race(trials: Trials, pool: Pool, jobs: Indices, places: Vector, most: Vector) -> Raced:
    """`raced` by the workers of a pool, in any number of parts: the same bits."""
    order = np.argsort(-trials.decided[jobs], axis=1, kind="stable")
    room = STARTS_A_THREAD if pool.threads and pool.count > 1 else STARTS_A_CALL
    size = min(-(-len(jobs) // pool.count), max(room // trials.starts_of.shape[1], 1))
    each = (slice(k, k + size) for k in range(0, len(jobs), size))
    parts = (Part(one, trials, jobs[one], places[one], most[one], order[one]) for one in each)
    costs, deciders, starts = np.empty(len(jobs)), np.empty(len(jobs), dtype=int), 0
    for part, raced in pool.results(_raced, parts):
        costs[part.which], deciders[part.which] = raced.costs, raced.deciders
        starts += raced.starts
    trials.decided *= MEMORY
    np.add.at(trials.decided, (jobs, deciders), 1.0)
    return Raced(costs, deciders, starts)


# damage without points of an S-N curve counts cycles of 1 N m: 1e31 by a slope of 13, in a drive of 250 N m
TOO_SLOW = 1e100  # where the costs of candidates begin that start, but not in time
UNFINISHED = 1e130  # where those begin that do not start at all
SLACK = 1e-9  # of the bound on the start time, for rounding
# metrics that begin so
NEVER_NEGATIVE = ("k_dyn", "peak_torque", "used_torque", "start_time", "settled_time", "damage", MARGIN)
MEMORY = 0.5  # of what decided candidates, from one generation to the next
TIE = 1e-6  # share of the metric within which the mean over the starts decides


def _within(values: Vector, quantile: float) -> Vector:
    """The share `quantile` of the last axis, rising."""
    return np.sort(values, axis=-1)[..., : _kept(np.shape(values)[-1], quantile)]


def _kept(count: int, quantile: float) -> int:
    """How many of so many starts a quantile counts."""
    return max(math.ceil(quantile * count - 1e-9), 1)


def upper(values: Vector, quantile: float) -> Vector:
    """The value that the share `quantile` of the last axis does not exceed; one of the values.

    >>> float(upper(np.array([3.0, 1.0, 2.0, np.inf]), 0.75)), float(upper(np.array([3.0, 1.0]), 1.0))
    (3.0, 3.0)
    """
    return _within(values, quantile)[..., -1]


def excess(start_time: Vector, bound: Vector | float, quantile: float) -> Vector:
    """By which share the start time is beyond its bound, 0 or more; infinite where a start fails."""
    share = np.where(np.isnan(start_time), np.inf, np.maximum(start_time / bound - 1.0, 0.0))
    over = upper(share, quantile)
    return np.where(over <= SLACK, 0.0, over)


def cost(metric: Vector, start_time: Vector, bound: Vector | float, quantile: float) -> Vector:
    """The lower the better: in time beats too slow, less too slow beats more, then the metric decides.

    The last axis are the starts that one candidate is judged by; metric and start time both count at their
    `quantile` over these. Where metrics are the same within 1e-6, the mean over the starts decides. A start
    that fails or does not reach its target speed is the worst of all, and candidates with fewer of them are
    better.

    >>> t = np.array([[0.3], [0.4], [0.5], [np.nan]])
    >>> cost(np.array([[2.0], [1.0], [1.0], [1.0]]), t, 0.35, 1.0).argsort().tolist()
    [0, 1, 2, 3]
    """
    failed = np.isnan(metric) | np.isnan(start_time)
    kept = _within(np.where(failed, np.inf, metric), quantile)
    value = kept[..., -1] + TIE * kept.mean(axis=-1)
    over = excess(np.where(failed, np.nan, start_time), bound, quantile)
    timely = np.isfinite(over)
    ranked = np.where(over == 0.0, value, TOO_SLOW * (1.0 + np.where(timely, over, 0.0)))
    unfinished = UNFINISHED * (1.0 + failed.mean(axis=-1))
    return np.asarray(np.where(timely & np.isfinite(value), ranked, unfinished))


def in_time(costs: ArrayLike) -> NDArray[np.bool_]:
    """Whether a cost is that of a candidate within its bound on the start time."""
    return np.asarray(costs) < TOO_SLOW
