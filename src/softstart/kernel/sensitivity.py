"""How a recorded start answers to the torques of its demand: variational equations, exactly.

The demand is linear between knots (two at one instant are a step), and column q belongs to the torque of the
knots that q owns. Between two events the machine is linear, so that the sensitivity X of its state x (twists,
speeds, realised motor torque and, if it is asked for, angle of the motor) follows

    X' = A X + B r        r: the sensitivity of the demand, a hat about each knot of q

with the A of the span's modes; it goes from one end of a span to the other by the same Taylor series as the
start itself. Knots are control instants, so that r is a line in each span; while a demand that is constant is
beyond the slew limiter, r stays as it was. At an event the instant moves with the torques, by dt = -dg/g' for
the event function g, and

    X(+) = X(-) + (x'(-) - x'(+)) dt

which is nothing where the forces are continuous: all openings under `no-pull`, all events of `modelica` and
of undamped shafts, breaking away. It is something where a damped shaft closes (`dead-zone`: and opens), whose
torque jumps by d v at z = 0 and may break a mass away at once, and where a mass with friction stops or turns
round.
"""

from __future__ import annotations

import numpy as np
from numba import types
from numpy.typing import NDArray

from softstart.arrays import Matrix, Vector
from softstart.kernel.jit import compiled_as, inner, as_record
from softstart.kernel.records import (
    CONTACT, DEAD_ZONE, MODELICA, OF_MASS, OF_SHAFT, OPEN, ORDERS, S_END, S_MASSES, S_START, WORK, Record,
)  # fmt: skip
from softstart.kernel.replay import restore
from softstart.kernel.series import REACH, orders
from softstart.kernel.start import rate_of

Rows = NDArray[np.float64]
Owners = NDArray[np.int64]
_I = types.Array(types.int64, 1, "C")
_A = types.Array(types.float64, 1, "C")
_M = types.Array(types.float64, 2, "C")
_T = types.Array(types.float64, 3, "C")


@inner
def transition(s: Record, h: float, n: int, size: int, series: Rows) -> None:
    """Taylor coefficients over a span of length h of the answers to a unit of each part of the state.

    `series[i, j]` is the answer of part i to part j: to twists, speeds, realised torque (if there is a lag),
    angle of the motor (if `size` has room for it), a demand that is 1, and one that rises by 1 over the span.
    Part `size` is the demand itself.
    """
    count = s.n
    joints = count - 1
    motor = joints + count
    for j in range(size + 2):
        for i in range(size + 1):
            series[i, j, 0] = 0.0
        if j < size:
            series[j, j, 0] = 1.0
        for o in range(n + 1):
            series[size, j, o] = 0.0
        if j == size:
            series[size, j, 0] = 1.0
        elif j == size + 1:
            series[size, j, 1] = 1.0
        for o in range(n):
            share = h / (o + 1.0)
            if s.lag > 0.0:
                u = series[motor, j, o]
                series[motor, j, o + 1] = share * (series[size, j, o] - u) / s.lag
            else:
                u = series[size, j, o]
                series[motor, j, o + 1] = 0.0
            if size > motor + 1:
                series[motor + 1, j, o + 1] = share * series[joints + s.at_motor, j, o]
            T = 0.0
            for i in range(count):
                w = series[joints + i, j, o]
                total = -(s.ground[i] + s.incline[i]) * w  # of load curves by speed; none is by angle here
                if i == s.at_motor:
                    total += u
                if i > 0:
                    total += s.share_after[i - 1] * T
                T = 0.0
                if i < joints:
                    v = w - series[joints + i + 1, j, o]
                    T = s.stiff[i] * series[i, j, o] + s.damp[i] * v
                    series[i, j, o + 1] = share * v
                    total -= s.share_before[i] * T
                series[joints + i, j, o + 1] = share * total * s.inverse_J[i]


@inner
def propagated(
    series: Rows, n: int, x: float, X: Rows, hat: Rows, active: int, first: int, into: Rows
) -> None:  # fmt: skip
    """X after the share x of the span, its rows from `first` on; columns from `active` on are 0."""
    size = X.shape[0]
    for i in range(into.shape[0]):
        for q in range(active):
            into[i, q] = 0.0
        for j in range(size + 2):
            share = series[first + i, j, n]
            for o in range(n - 1, -1, -1):
                share = share * x + series[first + i, j, o]
            if share == 0.0:
                continue
            for q in range(active):
                into[i, q] += share * (X[j, q] if j < size else hat[j - size, q])


@inner
def carried_torque(
    s: Record, k: int, series: Rows, n: int, x: float, X: Rows, hat: Rows, active: int, into: Rows, row: int
) -> None:
    """The sensitivity of the torque of shaft k after the share x of the span, into `into[row, k]`."""
    for q in range(into.shape[2]):
        into[row, k, q] = 0.0
    c, d = s.stiff[k], s.damp[k]
    if c == 0.0:
        return
    w = s.n - 1 + k
    size = X.shape[0]
    for j in range(size + 2):
        share = 0.0
        for o in range(n, -1, -1):
            share = share * x + c * series[k, j, o] + d * (series[w, j, o] - series[w + 1, j, o])
        if share == 0.0:
            continue
        for q in range(active):
            into[row, k, q] += share * (X[j, q] if j < size else hat[j - size, q])


@inner
def demand_hats(s: Record, knots: Vector, owners: Owners, at: int, t: float, h: float, hat: Rows) -> int:
    """The hats at t and their rise until t + h; returns the knot before, sought from `at` on."""
    middle = t + 0.5 * h
    last = knots.shape[0] - 1
    while at < last and knots[at + 1] <= middle:
        at += 1
    q, after = owners[at], owners[min(at + 1, last)]
    limited = q == after and abs(s.slope) == s.rate  # by the slew limiter: the demand does not rise by itself
    for p in range(after + 1):
        hat[0, p] = hat[0, p] + hat[1, p] if limited else 0.0
        hat[1, p] = 0.0
    if limited or middle < s.begins_at:  # until its brake is open the demand is 0
        return at
    share = 0.0 if at == last else max(t - knots[at], 0.0) / (knots[at + 1] - knots[at])
    rise = 0.0 if at == last or middle < knots[0] else h / (knots[at + 1] - knots[at])
    hat[0, q] += 1.0 - share
    hat[0, after] += share
    hat[1, q] -= rise
    hat[1, after] += rise
    return at


@inner
def pass_event(s: Record, span: Vector, rates: Rows, X: Rows, columns: int) -> None:
    """X across the event between a recorded span and the next one, at whose beginning the state is.

    `rates[0, i]` is the acceleration of mass i before, `rates[1, i]` after.
    """
    joints = s.n - 1
    for k in range(joints):
        if s.d[k] == 0.0 or s.law[k] == MODELICA:
            continue
        before, after = int(span[S_MASSES + OF_MASS * s.n + OF_SHAFT * k + 1]), s.mode[k]
        jump = 0.0  # of the damping, as z = 0 is passed
        if before == OPEN and after == CONTACT:
            jump = s.d[k]
        elif before == CONTACT and after == OPEN and s.law[k] == DEAD_ZONE:
            jump = -s.d[k]
        v = s.w[k] - s.w[k + 1]
        if jump == 0.0 or v == 0.0:  # flanks that touch, and part or press as a mass breaks away
            continue
        for i in range(k, k + 2):
            share = jump * (s.share_after[k] if i > k else -s.share_before[k]) * s.inverse_J[i]
            if span[S_MASSES + OF_MASS * i + 1] == 0.0:  # held before: the blow may break it away
                share = rates[1, i] / v
            if s.inverse_J[i] == 0.0:
                continue
            for q in range(columns):
                X[joints + i, q] += share * X[k, q]
    for i in range(joints + 1):
        was, now = span[S_MASSES + OF_MASS * i + 1], s.direction[i]
        if was in (now, 0.0) or rates[0, i] == 0.0:
            continue
        kept = 0.0 if now == 0.0 else rates[1, i] / rates[0, i]
        for q in range(columns):
            X[joints + i, q] *= kept


@compiled_as(types.void(_A, _M, _M, _A, _I, _A, _T, _A, types.int64, _T, _M, _M, _M, _M, _T))
def sensitivities(
    work: Vector, tones: Matrix, spans: Matrix, knots: Vector, owners: Owners, times: Vector,
    torques: Rows, marks: Vector, first: int, states: Rows, X: Rows, next_X: Rows, hat: Rows, rates: Rows,
    series: Rows,
) -> None:  # fmt: skip
    """Of a recorded start: d T_k(times[j])/d u_q into torques[j, k, q], X(marks[j]) into states[j].

    Knot k belongs to column `owners[k]`, which rise. Of X are given the rows from `first` on. `times` and
    `marks` rise and lie within the run. At an event the value is the one after it. The arrays behind `states`
    are scratch.
    """
    s = as_record(work, WORK)
    count = s.n
    joints = count - 1
    size = X.shape[0]
    columns = X.shape[1]
    motor = joints + count - first
    knot = 0
    for i in range(size):
        for q in range(columns):
            X[i, q] = 0.0
    j = 0
    mark = 0
    rows = spans.shape[0]
    for row in range(rows):
        n = restore(s, tones, spans, row)
        start, end = spans[row, S_START], spans[row, S_END]
        length = end - start
        for i in range(count):
            rates[1, i] = s.speed[i, 1] / length
        if row > 0:
            pass_event(s, spans[row - 1], rates, X, columns)
        for i in range(count):
            rate = 0.0
            for o in range(1, n + 1):
                rate += o * s.speed[i, o]
            rates[0, i] = rate / length
        rate = rate_of(s)
        if s.lag > 0.0:
            rate = max(rate, 1.0 / s.lag)
        parts = int(rate * length / REACH) + 1
        h = length / parts
        n = min(orders(rate * h), ORDERS - 2)
        transition(s, h, n, size, series)
        for part in range(parts):
            t = start + part * h
            knot = demand_hats(s, knots, owners, knot, t, h, hat)
            active = owners[min(knot + 1, knots.shape[0] - 1)] + 1
            ends = row == rows - 1 and part == parts - 1
            until = end if part == parts - 1 else t + h
            while mark < marks.shape[0] and (marks[mark] < until or ends):
                x = (marks[mark] - t) / h
                propagated(series, n, x, X, hat, active, first, states[mark])
                if s.lag == 0.0 and 0 <= motor < states.shape[1]:
                    for q in range(active):
                        states[mark, motor, q] = hat[0, q] + hat[1, q] * x
                mark += 1
            while j < times.shape[0] and (times[j] < until or ends):
                for k in range(joints):
                    carried_torque(s, k, series, n, (times[j] - t) / h, X, hat, active, torques, j)
                j += 1
            propagated(series, n, 1.0, X, hat, active, 0, next_X)
            for i in range(size):
                for q in range(active):
                    X[i, q] = next_X[i, q]
