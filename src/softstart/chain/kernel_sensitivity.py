"""How a recorded start of a chain answers to the torques of its demand: variational equations, exactly.

The demand is linear between knots (two at one instant are a step), and column q belongs to the torque of
knot q. Between two events the chain is linear, so that the sensitivity X of its state x (twists, speeds,
realised motor torque) follows

    X' = A X + B r        r: the sensitivity of the demand, a hat about knot q

with the A of the span's modes; it goes from one end of a span to the other by the same Taylor series as the
start itself. Knots are control instants, so that r is a line in each span. At an event the instant moves with
the torques, by dt = -dg/g' for the event function g, and

    X(+) = X(-) + (x'(-) - x'(+)) dt

which is nothing where the forces are continuous: all openings under `no-pull`, all events of `modelica` and
of undamped shafts, breaking away. It is something where a damped shaft closes (`dead-zone`: and opens), whose
torque jumps by d v at z = 0 and may break a mass away at once, and where a mass with friction stops or turns
round.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from softstart.arrays import Vector
from softstart.chain.kernel_records import CONTACT, DOUBLED, JOINED, OPEN, ORDERS, Record, Start
from softstart.chain.kernel_series import REACH, orders
from softstart.chain.kernel_start import rate_of, restore
from softstart.plant.jit import compiled
from softstart.plant.layout import DEAD_ZONE, MODELICA, PLANT

Rows = NDArray[np.float64]


@compiled
def transition(start: Start, lag: float, h: float, n: int, series: Rows) -> None:
    """Taylor coefficients over a span of length h of the answers to a unit of each part of the state.

    `series[i, j]` is the answer of part i to part j: to twists, speeds, realised torque (if there is a lag),
    a demand that is 1, and one that rises by 1 over the span. Part `size` is the demand itself.
    """
    masses, shafts = start.masses, start.shafts
    count = masses.size
    joints = count - 1
    motor = start.place.motor
    size = joints + count + 1
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
            if lag > 0.0:
                u = series[size - 1, j, o]
                series[size - 1, j, o + 1] = share * (series[size, j, o] - u) / lag
            else:
                u = series[size, j, o]
                series[size - 1, j, o + 1] = 0.0
            T = 0.0
            for i in range(count):
                mass = masses[i]
                w = series[joints + i, j, o]
                total = -(mass.ground + mass.slope) * w  # of load curves by speed; none is by angle here
                if i == motor:
                    total += u
                if i > 0:
                    total += shafts[i - 1].after * T
                T = 0.0
                if i < joints:
                    v = w - series[joints + i + 1, j, o]
                    T = stiffness_now(shafts[i]) * series[i, j, o] + damping_now(shafts[i]) * v
                    series[i, j, o + 1] = share * v
                    total -= shafts[i].before * T
                series[joints + i, j, o + 1] = 0.0 if mass.stuck != 0 else share * total / mass.body_J


@compiled
def stiffness_now(shaft: Record) -> float:
    """The stiffness that acts in the present mode."""
    if shaft.mode == DOUBLED:
        return 2.0 * shaft.c
    return shaft.c if shaft.mode in (CONTACT, JOINED) else 0.0


@compiled
def damping_now(shaft: Record) -> float:
    """The damping that acts in the present mode."""
    return shaft.d if shaft.mode in (CONTACT, JOINED) else 0.0


@compiled
def carried(series: Rows, n: int, s: float, size: int, X: Rows, hat: Rows, active: int, into: Rows) -> None:
    """X after the share s of the span, into `into`; columns from `active` on have not begun."""
    for i in range(size):
        for q in range(active):
            into[i, q] = 0.0
        for j in range(size + 2):
            share = series[i, j, n]
            for o in range(n - 1, -1, -1):
                share = share * s + series[i, j, o]
            if share == 0.0:
                continue
            for q in range(active):
                into[i, q] += share * (X[j, q] if j < size else hat[j - size, q])


@compiled
def carried_torque(
    shaft: Record,
    k: int,
    series: Rows,
    n: int,
    s: float,
    size: int,
    X: Rows,
    hat: Rows,
    active: int,
    into: Rows,
    row: int,
) -> None:
    """The sensitivity of the torque of shaft k after the share s of the span, into `into[row, k]`."""
    for q in range(into.shape[2]):
        into[row, k, q] = 0.0
    c, d = stiffness_now(shaft), damping_now(shaft)
    if c == 0.0:
        return
    w = size // 2 - 1 + k
    for j in range(size + 2):
        share = 0.0
        for o in range(n, -1, -1):
            share = share * s + c * series[k, j, o] + d * (series[w, j, o] - series[w + 1, j, o])
        if share == 0.0:
            continue
        for q in range(active):
            into[row, k, q] += share * (X[j, q] if j < size else hat[j - size, q])


@compiled
def demand_hats(knots: Vector, t: float, h: float, hat: Rows) -> int:
    """The hats at t and their rise until t + h; returns how many columns have begun."""
    middle = t + 0.5 * h
    last = knots.shape[0] - 1
    at = 0
    while at < last and knots[at + 1] <= middle:
        at += 1
    for q in range(at + 1):
        hat[0, q] = 0.0
        hat[1, q] = 0.0
    if at == last:
        hat[0, at] = 1.0
        return at + 1
    length = knots[at + 1] - knots[at]
    share = (t - knots[at]) / length
    hat[0, at] = 1.0 - share
    hat[1, at] = -h / length
    hat[0, at + 1] = share
    hat[1, at + 1] = h / length
    return at + 2


@compiled
def pass_event(start: Start, row: int, rates: Rows, X: Rows, columns: int) -> None:
    """X across the event between span `row`, whose end the records hold in `rates`, and the next one.

    The records are at the beginning of the next span; `rates[0, i]` is the acceleration of mass i before,
    `rates[1, i]` after.
    """
    joints = start.shafts.size
    for k in range(joints):
        shaft = start.shafts[k]
        if shaft.d == 0.0 or shaft.law == MODELICA:
            continue
        before, after = start.span_shafts[row, k].mode, shaft.mode
        jump = 0.0  # of the damping, as z = 0 is passed
        if before == OPEN and after == CONTACT:
            jump = shaft.d
        elif before == CONTACT and after == OPEN and shaft.law == DEAD_ZONE:
            jump = -shaft.d
        if jump == 0.0:
            continue
        v = start.masses[k].w - start.masses[k + 1].w
        for i in range(k, k + 2):
            mass = start.masses[i]
            share = jump * (shaft.after if i > k else -shaft.before) / mass.body_J
            if start.span_masses[row, i].direction == 0.0:  # held before: the blow may break it away
                share = rates[1, i] / v
            if mass.stuck != 0:
                continue
            for q in range(columns):
                X[joints + i, q] += share * X[k, q]
    for i in range(joints + 1):
        was, now = start.span_masses[row, i].direction, start.masses[i].direction
        if was in (now, 0.0) or rates[0, i] == 0.0:
            continue
        kept = 0.0 if now == 0.0 else rates[1, i] / rates[0, i]
        for q in range(columns):
            X[joints + i, q] *= kept


@compiled
def sensitivities(
    start: Start,
    knots: Vector,
    times: Vector,
    torques: Rows,
    marks: Vector,
    states: Rows,
    X: Rows,
    next_X: Rows,
    hat: Rows,
    rates: Rows,
    series: Rows,
) -> None:
    """Of a recorded start: d T_k(times[j])/d u_q into torques[j, k, q], dX(marks[j]) into states[j].

    `times` and `marks` rise and lie within the run. At an event the value is the one after it. The arrays
    behind `states` are scratch.
    """
    count = start.masses.size
    joints = count - 1
    size = joints + count + 1
    columns = knots.shape[0]
    lag = start.p.view(PLANT)[0].lag
    for i in range(size):
        for q in range(columns):
            X[i, q] = 0.0
    j = 0
    mark = 0
    rows = start.spans.size
    for row in range(rows):
        n = restore(start, row)
        span = start.spans[row]
        length = span.end - span.start
        for i in range(count):
            rates[1, i] = start.masses[i].speed[1] / length
        if row > 0:
            pass_event(start, row - 1, rates, X, columns)
        for i in range(count):
            rate = 0.0
            for o in range(1, n + 1):
                rate += o * start.masses[i].speed[o]
            rates[0, i] = rate / length
        rate = rate_of(start)
        if lag > 0.0:
            rate = max(rate, 1.0 / lag)
        parts = int(rate * length / REACH) + 1
        h = length / parts
        n = min(orders(rate * h), ORDERS - 2)
        transition(start, lag, h, n, series)
        for part in range(parts):
            t = span.start + part * h
            active = demand_hats(knots, t, h, hat)
            ends = row == rows - 1 and part == parts - 1
            until = span.end if part == parts - 1 else t + h
            while mark < marks.shape[0] and (marks[mark] < until or ends):
                carried(series, n, (marks[mark] - t) / h, size, X, hat, active, next_X)
                for i in range(size):
                    for q in range(columns):
                        states[mark, i, q] = next_X[i, q] if q < active else 0.0
                if lag == 0.0:
                    for q in range(active):
                        states[mark, size - 1, q] = hat[0, q] + hat[1, q] * (marks[mark] - t) / h
                mark += 1
            while j < times.shape[0] and (times[j] < until or ends):
                for k in range(joints):
                    share = (times[j] - t) / h
                    carried_torque(start.shafts[k], k, series, n, share, size, X, hat, active, torques, j)
                j += 1
            carried(series, n, 1.0, size, X, hat, active, next_X)
            for i in range(size):
                for q in range(active):
                    X[i, q] = next_X[i, q]
