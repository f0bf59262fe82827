"""How a recorded motion of the drive answers to errors of its torque: variational equations, exactly.

Between two events the drive is linear, x' = A x + b r + constants, with x = (motor angle, twist, both speeds,
realised torque) and r the demand behind the slew limiter. The sensitivity of x to the error e_q of the torque
in the samples of block q is a column of X,

    X' = A X + b R        R: 0 or 1 in a held sample, a hat where samples are joined by lines

While the limiter slews, r does not depend on the demand, so R stays as it was. At an event, where g(x) = 0,
the instant moves with the errors by dt = -dg/g', and

    X(+) = X(-) + (x'(-) - x'(+)) dt

This is nothing where the torques are continuous. It is something where a damped shaft closes (`dead-zone`:
and opens), whose torque jumps by d v and may break the load or the motor away, and where load or motor stop.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from softstart.arrays import Matrix, Vector
from softstart.kernel.jit import compiled
from softstart.plant.layout import DEAD_ZONE, PLANT, SEGMENT, Plant, Segment

PHI1, THETA, W1, W2, U, REF, RISE = range(7)  # rows of X; the last is the slope of the demand
SIZE: Final = 7
TERMS: Final = 20  # of the series of a step with |A| h <= 1: what is left out is below 1/20!


@compiled
def generator(p: Plant, row: Segment, slewing: bool, a: Matrix) -> float:
    """A of a span with the demand and its slope as states; returns a bound of its rates."""
    k, d = row.k, row.dd
    for i in range(SIZE):
        for j in range(SIZE):
            a[i, j] = 0.0
    a[PHI1, W1] = 1.0
    a[THETA, W1], a[THETA, W2] = 1.0, -1.0
    if row.held == 0.0:
        a[W1, THETA], a[W1, W1], a[W1, W2] = -k * p.inv_J1, -d * p.inv_J1 - p.decay1, d * p.inv_J1
        a[W1, U if p.lag > 0.0 else REF] = p.inv_J1
    if row.load != 0.0:
        a[W2, THETA], a[W2, W1], a[W2, W2] = k * p.inv_J2, d * p.inv_J2, -d * p.inv_J2 - p.decay2
    if not slewing:
        a[REF, RISE] = 1.0
    rate = math.sqrt(k * (p.inv_J1 + p.inv_J2)) + d * (p.inv_J1 + p.inv_J2) + p.decay1 + p.decay2
    if p.lag > 0.0:
        a[U, U], a[U, REF] = -1.0 / p.lag, 1.0 / p.lag
        rate += 1.0 / p.lag
    return rate


@compiled
def transition(a: Matrix, rate: float, h: float, power: Matrix, other: Matrix, step: Matrix) -> None:
    """exp(A h) into `step`: the series of a part of h, squared as often as h was halved."""
    halved = 0
    while rate * h > 1.0:
        h *= 0.5
        halved += 1
    for i in range(SIZE):
        for j in range(SIZE):
            step[i, j] = power[i, j] = 1.0 if i == j else 0.0
    for n in range(1, TERMS):
        product(a, power, h / n, other)
        for i in range(SIZE):
            for j in range(SIZE):
                power[i, j] = other[i, j]
                step[i, j] += other[i, j]
    for _ in range(halved):
        product(step, step, 1.0, other)
        for i in range(SIZE):
            for j in range(SIZE):
                step[i, j] = other[i, j]


@compiled
def product(a: Matrix, b: Matrix, scale: float, into: Matrix) -> None:
    """A matrix product times a number."""
    for i in range(SIZE):
        for j in range(SIZE):
            into[i, j] = 0.0
        for m in range(SIZE):
            share = scale * a[i, m]
            if share != 0.0:
                for j in range(SIZE):
                    into[i, j] += share * b[m, j]


@compiled
def carry(step: Matrix, X: Matrix, next_X: Matrix, active: int) -> None:
    """The first columns of X over one step."""
    for i in range(REF):
        for q in range(active):
            next_X[i, q] = 0.0
        for m in range(SIZE):
            share = step[i, m]
            if share != 0.0:
                for q in range(active):
                    next_X[i, q] += share * X[m, q]
    for i in range(REF):
        for q in range(active):
            X[i, q] = next_X[i, q]


@compiled
def accelerations(p: Plant, mode: Segment, now: Segment) -> tuple[float, float]:
    """Those of motor and load in the mode of one span at the first instant of another."""
    torque = mode.k * (now.theta - 0.5 * mode.side * p.gap) + mode.dd * now.v
    push = now.u - mode.motor * p.friction - torque
    motor = 0.0 if mode.held != 0.0 else push * p.inv_J1 - p.decay1 * (now.w2 + now.v)
    load = 0.0 if mode.load == 0.0 else (torque - mode.load * p.Mc) * p.inv_J2 - p.decay2 * now.w2
    return motor, load


@compiled
def pass_event(p: Plant, before: Segment, after: Segment, X: Matrix, active: int) -> None:
    """X across the event between two spans."""
    motor_before, load_before = accelerations(p, before, after)
    motor_after, load_after = accelerations(p, after, after)
    closes = before.side == 0.0 and after.side != 0.0
    opens = before.side != 0.0 and after.side == 0.0 and p.law == DEAD_ZONE
    if (closes or opens) and after.v != 0.0:
        for q in range(active):
            dt = -X[THETA, q] / after.v
            X[W1, q] += (motor_before - motor_after) * dt
            X[W2, q] += (load_before - load_after) * dt
    if before.load not in (0.0, after.load):
        kept = load_after / load_before if load_before != 0.0 else 0.0
        for q in range(active):
            X[W2, q] *= kept
    if before.motor not in (0.0, after.motor):
        kept = motor_after / motor_before if motor_before != 0.0 else 0.0
        for q in range(active):
            X[W1, q] *= kept


@compiled
def sensitivities(
    drive: Vector, segments: Matrix, knots: Vector, held: bool, block: int, times: Vector, wanted: int,
    X: Matrix, next_X: Matrix, square: Matrix, out: Matrix,
) -> None:  # fmt: skip
    """Row `wanted` of X at the instants, which rise; the arrays from X up to `out` are scratch."""
    p = drive.view(PLANT)[0]
    a, power, other, step = square[0], square[1], square[2], square[3]
    last, columns, spans = knots.shape[0] - 1, X.shape[1], segments.shape[0]
    for i in range(SIZE):
        for q in range(columns):
            X[i, q] = 0.0
    knot, active, j = 0, 0, 0
    for number in range(spans):
        row = segments[number].view(SEGMENT)[0]
        if number > 0:
            pass_event(p, segments[number - 1].view(SEGMENT)[0], row, X, active)
        slewing = abs(row.ub) == p.rate
        rate = generator(p, row, slewing, a)
        t, ends = row.start, number == spans - 1
        while True:
            sampled = j < times.shape[0] and (times[j] < row.end or ends)
            if not sampled and t >= row.end:
                break
            until = times[j] if sampled else row.end
            h = max(until - t, 0.0)
            if h > 0.0:
                while knot < last and knots[knot + 1] <= t + 0.5 * h:
                    knot += 1
                active = min((knot + 1) // block if knot < last else knot // block, columns - 1) + 1
                if not slewing:
                    for q in range(active):
                        X[REF, q] = 0.0
                joined = not held and knot < last and t + 0.5 * h > knots[0]
                q, after = knot // block, (knot + 1) // block
                if joined:
                    length = knots[knot + 1] - knots[knot]
                    share = (t - knots[knot]) / length
                    X[RISE, q] -= 1.0 / length
                    X[RISE, after] += 1.0 / length
                    if not slewing:
                        X[REF, q] += 1.0 - share
                        X[REF, after] += share
                elif not slewing:
                    X[REF, q] = 1.0
                transition(a, rate, h, power, other, step)
                carry(step, X, next_X, active)
                if joined:
                    X[RISE, q] = X[RISE, after] = 0.0
                t = until
            if sampled:
                for q in range(columns):
                    out[j, q] = X[wanted, q]
                j += 1


def torque_sensitivities(
    drive: Vector, segments: Matrix, knots: Vector, *, held: bool, block: int, times: Vector, speed: bool
) -> Matrix:
    """d(motor angle or speed)/d(torque in a block of samples) at these instants, a row for each.

    The torque of the samples begins at the knots; before the first knot it is as there. It is held until the
    next knot, or joined by lines.
    """
    columns = math.ceil(knots.size / block)
    out = np.zeros((times.size, columns))
    X, next_X = np.zeros((SIZE, columns)), np.zeros((SIZE, columns))
    sensitivities(
        drive, segments, knots, held, block, times, W1 if speed else PHI1, X, next_X,
        np.zeros((4, SIZE, SIZE)), out,
    )  # fmt: skip
    return out
