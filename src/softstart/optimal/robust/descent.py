"""Descent from a staircase: linear programs within a trust region, judged by the exact plant."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from softstart.arrays import Matrix, Vector
from softstart.optimal.lp.rows import Limits, Sparse
from softstart.optimal.robust.evaluation import Evaluator, Indices, ProfileParameters, Staircase, Trajectory

Aim = Literal["gentle", "quick"]

PRICE = 100.0  # of lateness: torque range a start time asked for; more than any lateness gains
WATCHED = 0.8  # of the worst peak: torques that cannot come so high within the trust region are left out
EDGE_REACH = 0.02  # s that an edge may move at full trust
EDGE_SHARE = 0.4  # of the width beside it, at most
FIRST_ROWS = 50  # of a linear program that is given its rows as they are needed
BROKEN = 1e-9  # relative to the torques: a row is broken by more than rounding


@dataclass(frozen=True, eq=False)
class Rules:
    """What a descent keeps to: torque limits in N m, its aim, whether edges may move, how it goes on.

    `calm` weighs the sum of all torque steps against the peak: enough to choose the quietest of profiles that
    are equally good, too little to matter else.
    """

    low: float
    high: float
    aim: Aim = "gentle"
    edges: bool = False
    calm: float = 0.0
    floor: float = 0.0  # N m: a peak below it is worth no more
    rounds: int = 80
    trust: float = 0.1  # of the torque range, at first
    enough: float = 1e-7  # of the torque range: the descent ends where less is predicted

    @property
    def span(self) -> float:
        """The torque range, N m."""
        return self.high - self.low


@dataclass(frozen=True, eq=False)
class Step:
    """A change of all unknowns, and by how much it should lower the merit (N m)."""

    change: Vector
    predicted_gain: float


def free_edges(staircase: Staircase, rules: Rules) -> Indices:
    """Which edges may move: those at which the torque steps."""
    if not rules.edges:
        return np.zeros(0, dtype=np.int64)
    jumps = np.concatenate([np.abs(np.diff(part.levels)) for part in staircase.parts])
    return np.flatnonzero(jumps > 1e-3 * rules.span)


def linear_step(
    evaluator: Evaluator,
    trajectories: Sequence[Trajectory],
    staircase: Staircase,
    rules: Rules,
    trust: float,
    earlier: float = 0.0,
) -> Step | None:
    """The change x of the unknowns within the trust region that is best by the linearised plant:

        minimise  P + price s + calm sum |steps|
        subject to  |T_i(t_j) + dT_i(t_j) x| <= P,  t_i + dt_i x <= start_time - earlier + s

    (aim quick: the latest t_i + dt_i x). None where HiGHS finds none.
    """
    n = staircase.n_levels
    used = np.concatenate([np.arange(n), n + free_edges(staircase, rules)])
    box = _box(staircase, rules, trust)[used]
    jumps, flat, steps_now = _jumps(staircase, used.size, rules)
    extra = 2 + jumps.count // 2
    if rules.aim == "gentle":
        dense, right = _gentle(evaluator, trajectories, used, box, rules, earlier, extra)
        cost = np.concatenate(
            [np.zeros(used.size), [1.0, PRICE * rules.span], np.full(extra - 2, rules.calm)]
        )
    else:
        dense, right = _quick(evaluator, trajectories, used, rules, extra)
        cost = np.concatenate([np.zeros(used.size), [1.0, PRICE * rules.span], np.zeros(extra - 2)])
    bounds = np.concatenate([box, np.tile([0.0, np.inf], (extra, 1))])
    if rules.aim == "gentle":
        bounds[used.size, 0] = rules.floor
    answer = _least(cost, dense, right, jumps, flat, bounds)
    if answer is None:
        return None
    change = np.zeros(staircase.unknowns.size)
    change[used] = answer[: used.size]
    return Step(
        change, _now(evaluator, trajectories, rules, earlier) + rules.calm * steps_now - float(cost @ answer)
    )


def _least(
    cost: Vector, dense: Matrix, right: Vector, jumps: Sparse, flat: Vector, bounds: Matrix
) -> Vector | None:
    """The x with the least cost x, subject to dense x <= right, jumps x <= flat and bounds; None if none is.

    Hardly one row of `dense` in thirty binds. The program begins with those that have least room and takes up
    those that its answer breaks, until none is broken: the same optimum in a third of the time.
    """
    room = right - dense @ np.clip(0.0, bounds[:, 0], bounds[:, 1])
    used = np.zeros(right.size, dtype=bool)
    used[np.argsort(room, kind="stable")[:FIRST_ROWS]] = True
    while True:
        # dense and small: presolving takes longer than it saves (with it a descent takes 1.8 times as long)
        rows = Sparse.stacked([Sparse.dense(dense[used]), jumps])
        limits = Limits(cost, rows, np.concatenate([right[used], flat]), Sparse.stacked([]), np.zeros(0))
        answer = limits.solved(bounds, presolve=False)
        if answer is None:
            return None
        broken = (dense @ answer.x - right > BROKEN * np.abs(right).max()) & ~used
        if not broken.any():
            return answer.x
        used |= broken


def _box(staircase: Staircase, rules: Rules, trust: float) -> Matrix:
    """Least and largest change of each unknown."""
    levels = staircase.unknowns[: staircase.n_levels]
    reach = trust * rules.span
    widths = [np.diff(np.append(part.edges, np.inf)) for part in staircase.parts]
    before, after = (np.concatenate([w[side] for w in widths]) for side in (slice(None, -1), slice(1, None)))
    room = EDGE_REACH * trust
    lower = [np.clip(rules.low - levels, -reach, 0.0), -np.minimum(EDGE_SHARE * before, room)]
    upper = [np.clip(rules.high - levels, 0.0, reach), np.minimum(EDGE_SHARE * after, room)]
    return np.stack([np.concatenate(lower), np.concatenate(upper)], axis=1)


def _jumps(staircase: Staircase, columns: int, rules: Rules) -> tuple[Sparse, Vector, float]:
    """Rows  +-(step + change of step) - r <= 0  with one r for each step, and the sum of steps now."""
    if rules.calm == 0.0:
        return Sparse.stacked([]), np.zeros(0), 0.0
    below, offset = [], 0
    for part in staircase.parts:
        below.append(offset + np.arange(part.levels.size - 1))
        offset += part.levels.size
    lower = np.concatenate(below)
    count = lower.size
    here = np.concatenate([np.diff(part.levels) for part in staircase.parts])
    k = np.arange(count)
    row = np.concatenate([k, k, k, count + k, count + k, count + k])
    column = np.concatenate([lower + 1, lower, columns + 2 + k] * 2)
    one = np.ones(count)
    value = np.concatenate([one, -one, -one, -one, one, -one])
    return Sparse(2 * count, row, column, value), np.concatenate([-here, here]), float(np.abs(here).sum())


def _gentle(
    evaluator: Evaluator,
    trajectories: Sequence[Trajectory],
    used: Indices,
    box: Matrix,
    rules: Rules,
    earlier: float,
    extra: int,
) -> tuple[Matrix, Vector]:
    """Rows over (x, P, s, ...): torques below P, starts in time."""
    reach = np.abs(box).max(axis=1)
    worst = max(trajectory.peak for trajectory in trajectories)
    rows, right = [], []
    for trajectory in trajectories:
        S, T = trajectory.dT[:, used], trajectory.T
        swing = np.abs(S) @ reach
        for sign in (1.0, -1.0):
            near = sign * T + swing > WATCHED * worst
            block = np.zeros((int(near.sum()), used.size + extra))
            block[:, : used.size] = sign * S[near]
            block[:, used.size] = -1.0
            rows.append(block)
            right.append(-sign * T[near])
    for trajectory in trajectories:
        row = np.zeros((1, used.size + extra))
        row[0, : used.size] = trajectory.dlate[used] / evaluator.start_time
        row[0, used.size + 1] = -1.0
        rows.append(row)
        right.append(np.array([-(trajectory.late + earlier) / evaluator.start_time]))
    return np.concatenate(rows), np.concatenate(right)


def _quick(
    evaluator: Evaluator, trajectories: Sequence[Trajectory], used: Indices, rules: Rules, extra: int
) -> tuple[Matrix, Vector]:
    """Rows over (x, latest start time as a torque, unused, ...)."""
    rows = np.zeros((len(trajectories), used.size + extra))
    scale = rules.span / evaluator.start_time
    for row, trajectory in zip(rows, trajectories, strict=True):
        row[: used.size] = scale * trajectory.dlate[used]
        row[used.size] = -1.0
    return rows, np.array([-scale * (trajectory.late + evaluator.start_time) for trajectory in trajectories])


def _now(evaluator: Evaluator, trajectories: Sequence[Trajectory], rules: Rules, earlier: float) -> float:
    """The objective at no change."""
    late = max(trajectory.late for trajectory in trajectories)
    if rules.aim == "quick":
        return (late + evaluator.start_time) / evaluator.start_time * rules.span
    worst = max(rules.floor, *(trajectory.peak for trajectory in trajectories))
    return worst + PRICE * rules.span * max(late + earlier, 0.0) / evaluator.start_time


STALLED = 8  # rounds over which a descent must gain something
SMALLEST_TRUST = 1e-6
MENDINGS = 6


@dataclass(frozen=True, eq=False)
class Point:
    """A staircase and its figures on the exact plant."""

    staircase: Staircase
    peak: float  # worst |T|, N m
    late: float  # s by which the latest start misses the time asked for; 0 or below if all are in time


def evaluate(evaluator: Evaluator, parameters: ProfileParameters, staircase: Staircase) -> Point:
    """The exact plant's word on one staircase."""
    figures = evaluator.figures(parameters, staircase.unknowns)
    return Point(staircase, float(figures.peak.max()), float(evaluator.lateness(figures).max()))


def descend(evaluator: Evaluator, staircase: Staircase, rules: Rules, stalled: float = 1e-6) -> Point:
    """The best staircase reached from `staircase`, in time if any of those passed was.

    A step of the linear program is kept only if the exact plant's merit falls by a part of the predicted
    gain; else the trust region shrinks. Ends where the predicted gain is below `rules.enough`, or where the
    last rounds gained less than `stalled`, both relative to the torque range.
    """
    parameters = ProfileParameters(staircase, evaluator.drives[0])
    here = best = evaluate(evaluator, parameters, staircase)
    trust, trajectories = rules.trust, _trajectories(evaluator, parameters, here, rules)
    merits = [_merit(here, evaluator, rules)]
    for _ in range(rules.rounds):
        step = linear_step(evaluator, trajectories, here.staircase, rules, trust)
        if step is None or step.predicted_gain <= rules.enough * rules.span:
            break
        tried = evaluate(evaluator, parameters, _moved(here, step.change, rules))
        gain = merits[-1] - _merit(tried, evaluator, rules)
        if gain < 0.5 * step.predicted_gain and tried.late > 0.0 and rules.aim == "gentle":
            tried, gain = _mended(
                evaluator, parameters, trajectories, here, tried, trust, rules, merits[-1] - gain, gain
            )
        if gain > 0.05 * step.predicted_gain:
            trust = min(2.0 * trust, 0.5) if gain > 0.6 * step.predicted_gain else trust
            here = tried
            best = (
                here
                if rules.aim == "quick" or _rank(here, evaluator, rules) < _rank(best, evaluator, rules)
                else best
            )
            trajectories = _trajectories(evaluator, parameters, here, rules)
        else:
            trust *= 0.3
        merits.append(_merit(here, evaluator, rules))
        few = merits[-STALLED:]
        if trust < SMALLEST_TRUST or (
            len(few) == STALLED and few[0] - few[-1] < stalled * rules.span and gain > 0
        ):
            break
    if rules.aim == "gentle" and here.late > 0.0:
        mended = in_time(evaluator, parameters, here, rules, trust)
        best = mended if _rank(mended, evaluator, rules) < _rank(best, evaluator, rules) else best
    return best


def in_time(
    evaluator: Evaluator, parameters: ProfileParameters, late: Point, rules: Rules, trust: float
) -> Point:
    """A point that is a little late, moved until it is in time."""
    for _ in range(MENDINGS):
        if late.late <= 0.0:
            break
        trajectories = _trajectories(evaluator, parameters, late, rules)
        step = linear_step(
            evaluator, trajectories, late.staircase, rules, max(trust, 1e-3), earlier=0.1 * late.late + 1e-10
        )
        if step is None:
            break
        late = evaluate(evaluator, parameters, _moved(late, step.change, rules))
    return late


def _mended(
    evaluator: Evaluator, parameters: ProfileParameters, trajectories: Sequence[Trajectory], here: Point,
    tried: Point, trust: float, rules: Rules, tried_merit: float, gain: float,
) -> tuple[Point, float]:  # fmt: skip
    """The same step once more, aimed earlier by what it came too late; and what it gains."""
    step = linear_step(evaluator, trajectories, here.staircase, rules, trust, earlier=1.02 * tried.late)
    if step is None:
        return tried, gain
    again = evaluate(evaluator, parameters, _moved(here, step.change, rules))
    more = tried_merit - _merit(again, evaluator, rules)
    return (again, gain + more) if more > 0.0 else (tried, gain)


def _trajectories(
    evaluator: Evaluator, parameters: ProfileParameters, point: Point, rules: Rules
) -> list[Trajectory]:
    free = free_edges(point.staircase, rules)
    return [
        evaluator.trajectory(i, parameters, point.staircase, free, rules.low, rules.high)
        for i in range(len(evaluator.drives))
    ]


def _merit(point: Point, evaluator: Evaluator, rules: Rules) -> float:
    """What a descent brings down, N m: the peak with prices, or the latest start time."""
    start_time = evaluator.start_time
    if rules.aim == "quick":
        return (point.late + start_time) / start_time * rules.span
    steps = sum(float(np.abs(np.diff(part.levels)).sum()) for part in point.staircase.parts)
    late = PRICE * rules.span * max(point.late, 0.0) / start_time
    return max(point.peak, rules.floor) + late + rules.calm * steps


def _rank(point: Point, evaluator: Evaluator, rules: Rules) -> tuple[float, float]:
    """Less is better: in time first, then the merit."""
    return max(point.late, 0.0), _merit(point, evaluator, rules)


def _moved(point: Point, change: Vector, rules: Rules) -> Staircase:
    values = point.staircase.unknowns + change
    n = point.staircase.n_levels
    values[:n] = np.clip(values[:n], rules.low, rules.high)
    return point.staircase.with_unknowns(values)
