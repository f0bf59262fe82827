"""Any instant of a recorded start, and its work, from the series of its spans."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from softstart.chain import kernel_layout as at
from softstart.chain.kernel_layout import (
    DIRECTION,
    PHI_LINE,
    SPEED,
    TORQUE,
    TWIST,
    U_LINE,
    Cube,
    Matrix,
    Vector,
)
from softstart.chain.kernel_roots import value
from softstart.chain.kernel_series import expand, fastest_rate, join_bodies, orders
from softstart.plant.jit import compiled
from softstart.plant.layout import LAG, PHI2, TIME, UA, UB, UE

# the work of motor and exciting torques, against the loads, in damping to the ground, in shafts and gears
MOTOR_WORK, EXCITING_WORK, LOAD_WORK, GROUND_WORK, SHAFT_WORK, GEAR_WORK = range(6)
N_WORK = 6


@compiled
def restore(x: Vector, m: Vector, row: Vector, mass: Matrix, shaft: Matrix) -> None:
    """The state at the start of a recorded span."""
    x[TIME] = row[at.S_START]
    m[UA] = row[at.S_UA]
    m[UB] = row[at.S_UB]
    m[UE] = row[at.S_UE]
    x[PHI2] = row[at.S_PHI]
    j = at.S_MASS
    for i in range(mass.shape[0]):
        mass[i, at.W] = row[j]
        mass[i, DIRECTION] = row[j + 1]
        j += 2
    for k in range(shaft.shape[0]):
        shaft[k, at.THETA] = row[j]
        shaft[k, at.MODE] = row[j + 1]
        shaft[k, at.SIDE] = row[j + 2]
        shaft[k, at.SIGN] = row[j + 3]
        j += at.OF_SHAFT


@compiled
def spread(p: Vector, x: Vector, m: Vector, place: Vector, masses: Matrix, shafts: Matrix, tones: Matrix,
           mass: Matrix, shaft: Matrix, series: Cube, lines: Matrix, row: Vector) -> int:  # fmt: skip
    """The series of a recorded span, over its length; returns how many coefficients."""
    restore(x, m, row, mass, shaft)
    join_bodies(masses, shafts, mass, shaft)
    h = row[at.S_END] - row[at.S_START]
    rate = fastest_rate(masses, shafts, tones, mass, shaft)
    if m[UE] != 0.0:
        rate = max(rate, 1.0 / p[LAG])
    n = min(orders(rate * h), at.ORDERS - 2)
    expand(p, x, m, place, masses, shafts, tones, mass, shaft, series, lines, h, n)
    return n


@compiled
def states_at(p: Vector, x: Vector, m: Vector, place: Vector, masses: Matrix, shafts: Matrix, tones: Matrix,
              mass: Matrix, shaft: Matrix, series: Cube, lines: Matrix, segments: Matrix,
              index: NDArray[np.int64], times: Vector, out: Matrix) -> None:  # fmt: skip
    """Row j of out: motor angle, motor torque, speeds, twists and shaft torques at times[j]."""
    count = masses.shape[0]
    last = -1
    n = 0
    for j in range(times.shape[0]):
        row = segments[index[j]]
        if index[j] != last:
            n = spread(p, x, m, place, masses, shafts, tones, mass, shaft, series, lines, row)
            last = index[j]
        length = row[at.S_END] - row[at.S_START]
        s = min(max((times[j] - row[at.S_START]) / length, 0.0), 1.0)
        out[j, 0] = value(lines[PHI_LINE], n, s)
        out[j, 1] = value(lines[U_LINE], n, s)
        for i in range(count):
            out[j, 2 + i] = value(series[SPEED, i], n, s)
        for k in range(count - 1):
            out[j, 2 + count + k] = value(series[TWIST, k], n, s)
            out[j, 1 + 2 * count + k] = value(series[TORQUE, k], n, s)


@compiled
def product(f: Vector, g: Vector, n: int) -> float:
    """The integral of f g over [0, 1]."""
    total = 0.0
    for i in range(n + 1):
        inner = 0.0
        for j in range(n + 1):
            inner += g[j] / (i + j + 1.0)
        total += f[i] * inner
    return total


@compiled
def work_of(p: Vector, x: Vector, m: Vector, place: Vector, masses: Matrix, shafts: Matrix, tones: Matrix,
            mass: Matrix, shaft: Matrix, series: Cube, lines: Matrix, segments: Matrix,
            work: Vector) -> None:  # fmt: skip
    """Work in J over all recorded spans, by exact quadrature of their series."""
    count = masses.shape[0]
    motor = int(place[at.MOTOR])
    for r in range(segments.shape[0]):
        row = segments[r]
        n = spread(p, x, m, place, masses, shafts, tones, mass, shaft, series, lines, row)
        h = row[at.S_END] - row[at.S_START]
        of_motor = h * product(lines[U_LINE], series[SPEED, motor], n)
        work[MOTOR_WORK] += of_motor
        exciting = -of_motor
        for i in range(count):
            speed = series[SPEED, i]
            ground = 0.0
            if masses[i, at.GROUND] != 0.0:
                ground = h * masses[i, at.GROUND] * product(speed, speed, n)
            turned = speed[0]
            for o in range(1, n + 1):
                turned += speed[o] / (o + 1.0)
            load = h * mass[i, DIRECTION] * masses[i, at.MC] * turned + h * masses[i, at.ACTIVE] * turned
            work[GROUND_WORK] += ground
            work[LOAD_WORK] += load
            exciting += h * product(series[at.OUTSIDE, i], speed, n) + ground + load
        work[EXCITING_WORK] += exciting
        for k in range(count - 1):
            mode = shaft[k, at.MODE]
            if mode not in (at.CONTACT, at.DOUBLED, at.JOINED):
                continue
            for o in range(n + 1):
                lines[at.EVENT_LINE, o] = series[TORQUE, k, o] - shafts[k, at.C] * series[TWIST, k, o]
                lines[at.SPARE, o] = series[SPEED, k, o] - series[SPEED, k + 1, o]
            lines[at.EVENT_LINE, 0] += shafts[k, at.C] * shaft[k, at.SIDE] * shafts[k, at.HALF]
            work[SHAFT_WORK] += h * product(lines[at.EVENT_LINE], lines[at.SPARE], n)
            if shafts[k, at.ETA] != 1.0:
                for after in range(2):
                    lost = 1.0 - shaft[k, at.AFTER] if after == 1 else shaft[k, at.BEFORE] - 1.0
                    if lost != 0.0:
                        work[GEAR_WORK] += h * lost * product(series[TORQUE, k], series[SPEED, k + after], n)
