"""The best small change of a staircase by the linearised plant: one linear program."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from softstart.optimal.robust.plays import Course, Plays
from softstart.optimal.robust.shape import Matrix, Staircase
from softstart.profile import Vector

Aim = Literal["gentle", "quick"]
Indices = NDArray[np.int64]

PRICE = 100.0  # of lateness: torque range a start time asked for; more than any lateness gains
WATCHED = 0.8  # of the worst peak: torques that cannot come so high within the trust region are left out
EDGE_REACH = 0.02  # s that an edge may move at full trust
EDGE_SHARE = 0.4  # of the width beside it, at most


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
    enough: float = 1e-7  # of the torque range: the descent ends where less is promised

    @property
    def span(self) -> float:
        """The torque range, N m."""
        return self.high - self.low


@dataclass(frozen=True, eq=False)
class Step:
    """A change of all unknowns, and by how much it should lower the merit (N m)."""

    change: Vector
    promise: float


def merit(peak: float, late: float, shape: Staircase, start_time: float, rules: Rules) -> float:
    """What a descent brings down, N m: the peak with prices, or the latest start time; `late` in s."""
    if rules.aim == "quick":
        return (late + start_time) / start_time * rules.span
    steps = sum(float(np.abs(np.diff(part.levels)).sum()) for part in shape.parts)
    return max(peak, rules.floor) + PRICE * rules.span * max(late, 0.0) / start_time + rules.calm * steps


def free_edges(shape: Staircase, rules: Rules) -> Indices:
    """Which edges may move: those at which the torque steps."""
    if not rules.edges:
        return np.zeros(0, dtype=np.int64)
    jumps = np.concatenate([np.abs(np.diff(part.levels)) for part in shape.parts])
    return np.flatnonzero(jumps > 1e-3 * rules.span)


def linear_step(
    plays: Plays,
    courses: Sequence[Course],
    shape: Staircase,
    rules: Rules,
    trust: float,
    earlier: float = 0.0,
) -> Step | None:
    """The change x of the unknowns within the trust region that is best by the linearised plant:

        minimise  P + price s + calm sum |steps|
        subject to  |T_i(t_j) + dT_i(t_j) x| <= P,  t_i + dt_i x <= start_time - earlier + s

    (aim quick: the latest t_i + dt_i x). None where HiGHS finds none.
    """
    from scipy.optimize import linprog
    from scipy.sparse import csr_array, vstack

    n = shape.n_levels
    used = np.concatenate([np.arange(n), n + free_edges(shape, rules)])
    box = _box(shape, rules, trust)[used]
    jumps, flat, steps_now = _jumps(shape, used.size, rules)
    extra = 2 + jumps.shape[0] // 2
    if rules.aim == "gentle":
        dense, right = _gentle(plays, courses, used, box, rules, earlier, extra)
        cost = np.concatenate(
            [np.zeros(used.size), [1.0, PRICE * rules.span], np.full(extra - 2, rules.calm)]
        )
    else:
        dense, right = _quick(plays, courses, used, rules, extra)
        cost = np.concatenate([np.zeros(used.size), [1.0, PRICE * rules.span], np.zeros(extra - 2)])
    rows = vstack([csr_array(dense), jumps]) if extra > 2 else csr_array(dense)
    bounds = np.concatenate([box, np.tile([0.0, np.inf], (extra, 1))])
    if rules.aim == "gentle":
        bounds[used.size, 0] = rules.floor
    # dense and small: presolving takes longer than it saves (with it a whole descent takes 1.8 times as long)
    answer = linprog(
        cost,
        rows,
        np.concatenate([right, flat]),
        bounds=bounds,
        method="highs-ds",
        options={"presolve": False},
    )
    if answer.x is None:
        return None
    change = np.zeros(shape.unknowns.size)
    change[used] = answer.x[: used.size]
    return Step(change, _now(plays, courses, rules, earlier) + rules.calm * steps_now - float(answer.fun))


def _box(shape: Staircase, rules: Rules, trust: float) -> Matrix:
    """Least and largest change of each unknown."""
    levels = shape.unknowns[: shape.n_levels]
    reach = trust * rules.span
    widths = [np.diff(np.append(part.edges, np.inf)) for part in shape.parts]
    before, after = (np.concatenate([w[side] for w in widths]) for side in (slice(None, -1), slice(1, None)))
    room = EDGE_REACH * trust
    lower = [np.clip(rules.low - levels, -reach, 0.0), -np.minimum(EDGE_SHARE * before, room)]
    upper = [np.clip(rules.high - levels, 0.0, reach), np.minimum(EDGE_SHARE * after, room)]
    return np.stack([np.concatenate(lower), np.concatenate(upper)], axis=1)


def _jumps(shape: Staircase, columns: int, rules: Rules) -> tuple[Matrix, Vector, float]:
    """Rows  +-(step + change of step) - r <= 0  with one r for each step, and the sum of steps now."""
    from scipy.sparse import csr_array

    if rules.calm == 0.0:
        return csr_array((0, columns + 2)), np.zeros(0), 0.0
    below, offset = [], 0
    for part in shape.parts:
        below.append(offset + np.arange(part.levels.size - 1))
        offset += part.levels.size
    lower = np.concatenate(below)
    count = lower.size
    here = np.concatenate([np.diff(part.levels) for part in shape.parts])
    k = np.arange(count)
    row = np.concatenate([k, k, k, count + k, count + k, count + k])
    column = np.concatenate([lower + 1, lower, columns + 2 + k] * 2)
    one = np.ones(count)
    value = np.concatenate([one, -one, -one, -one, one, -one])
    matrix = csr_array((value, (row, column)), shape=(2 * count, columns + 2 + count))
    return matrix, np.concatenate([-here, here]), float(np.abs(here).sum())


def _gentle(
    plays: Plays,
    courses: Sequence[Course],
    used: Indices,
    box: Matrix,
    rules: Rules,
    earlier: float,
    extra: int,
) -> tuple[Matrix, Vector]:
    """Rows over (x, P, s, ...): torques below P, starts in time."""
    reach = np.abs(box).max(axis=1)
    worst = max(course.peak for course in courses)
    rows, right = [], []
    for course in courses:
        S, T = course.dT[:, used], course.T
        swing = np.abs(S) @ reach
        for sign in (1.0, -1.0):
            near = sign * T + swing > WATCHED * worst
            block = np.zeros((int(near.sum()), used.size + extra))
            block[:, : used.size] = sign * S[near]
            block[:, used.size] = -1.0
            rows.append(block)
            right.append(-sign * T[near])
    for course in courses:
        row = np.zeros((1, used.size + extra))
        row[0, : used.size] = course.dlate[used] / plays.start_time
        row[0, used.size + 1] = -1.0
        rows.append(row)
        right.append(np.array([-(course.late + earlier) / plays.start_time]))
    return np.concatenate(rows), np.concatenate(right)


def _quick(
    plays: Plays, courses: Sequence[Course], used: Indices, rules: Rules, extra: int
) -> tuple[Matrix, Vector]:
    """Rows over (x, latest start time as a torque, unused, ...)."""
    rows = np.zeros((len(courses), used.size + extra))
    scale = rules.span / plays.start_time
    for row, course in zip(rows, courses, strict=True):
        row[: used.size] = scale * course.dlate[used]
        row[used.size] = -1.0
    return rows, np.array([-scale * (course.late + plays.start_time) for course in courses])


def _now(plays: Plays, courses: Sequence[Course], rules: Rules, earlier: float) -> float:
    """The objective at no change."""
    late = max(course.late for course in courses)
    if rules.aim == "quick":
        return (late + plays.start_time) / plays.start_time * rules.span
    worst = max(rules.floor, *(course.peak for course in courses))
    return worst + PRICE * rules.span * max(late + earlier, 0.0) / plays.start_time
