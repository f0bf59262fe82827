"""The Taylor series of one span.

Between two events the chain is linear, and the torques on it are sums of a line, an exponential and
harmonics; so all coefficients follow from one another. A span reaches three over the fastest rate of the
chain in its present mode, where some thirty coefficients leave nothing but rounding; shorter ones take fewer.

Masses joined by rigid shafts, or by rigid flanks that press, are one body; what their joints carry follows
from the balance of each mass.
"""

from __future__ import annotations

import math

from softstart.chain.kernel_gears import body_grip, held_by, set_gears
from softstart.chain.kernel_layout import (
    ACTIVE,
    AFTER,
    BEFORE,
    BODY_J,
    CONTACT,
    COSINE,
    DIRECTION,
    DOUBLED,
    FIRST,
    GEARS,
    GROUND,
    HALF,
    HELD,
    HOLD,
    INFLUENCE,
    JOINED,
    MC,
    MEAN,
    MODE,
    MOTOR,
    OMEGA,
    ON,
    ORDERS,
    OUTSIDE,
    PHI_LINE,
    PRESSED,
    RUBBING,
    RUBS,
    SIDE,
    SINE,
    SIZE,
    SPEED,
    STUCK,
    THETA,
    TORQUE,
    TWIST,
    U_LINE,
    USED,
    WELDED,
    C,
    Cube,
    D,
    J,
    Matrix,
    Vector,
    W,
)
from softstart.plant.jit import compiled
from softstart.plant.layout import LAG, PHI2, TIME, UA, UB, UE

REACH = 3.0
TRUNCATION = 1e-18


@compiled
def join_bodies(masses: Matrix, shafts: Matrix, mass: Matrix, shaft: Matrix) -> None:
    """Which masses move as one, their inertia, the friction that can hold them, what their gears pass on."""
    first = 0
    for i in range(masses.shape[0]):
        if i == 0 or (shaft[i - 1, MODE] != WELDED and shaft[i - 1, MODE] != PRESSED):
            first = i
            mass[i, BODY_J] = 0.0
            mass[i, HOLD] = 0.0
            mass[i, STUCK] = 0.0
            mass[i, RUBBING] = 0.0
            mass[i, GEARS] = 0.0
        mass[i, FIRST] = first
        mass[first, BODY_J] += masses[i, J]
        if masses[i, RUBS] != 0.0:
            mass[first, RUBBING] += 1.0
            mass[first, HOLD] += masses[i, MC]
            if mass[i, DIRECTION] == 0.0:
                mass[first, STUCK] = 1.0
    set_gears(shafts, mass, shaft)


@compiled
def fastest_rate(masses: Matrix, shafts: Matrix, tones: Matrix, mass: Matrix, shaft: Matrix) -> float:
    """An upper bound of the rates of the chain in its present mode, 1/s.

    Gershgorin's theorem on the matrix of the shafts, c_k (1/J_a + 1/J_b) with sqrt(c_k c_l)/J beside it, and
    the same of the dampings.
    """
    springs = 0.0
    dampers = 0.0
    ground = 0.0
    before_c = 0.0
    before_d = 0.0
    before_row = 0.0
    before_damping = 0.0
    shared = 0.0
    for i in range(masses.shape[0]):
        first = int(mass[i, FIRST])
        if first == i:
            shared = 0.0 if mass[i, STUCK] != 0.0 else 1.0 / mass[i, BODY_J]
            held = 0.0
            j = i
            while j < masses.shape[0] and int(mass[j, FIRST]) == i:
                held += masses[j, GROUND]
                j += 1
            ground = max(ground, held * shared)
        if i + 1 == masses.shape[0] or int(mass[i + 1, FIRST]) != i + 1:
            continue
        mode = shaft[i, MODE]
        c = 0.0
        d = 0.0
        if mode in (CONTACT, JOINED):
            c = shafts[i, C]
            d = shafts[i, D]
        elif mode == DOUBLED:
            c = 2.0 * shafts[i, C]
        share = max(shaft[i, BEFORE], shaft[i, AFTER])
        c *= share
        d *= share
        after = 0.0 if mass[i + 1, STUCK] != 0.0 else 1.0 / mass[i + 1, BODY_J]
        coupling = math.sqrt(c * before_c) * shared
        friction = math.sqrt(d * before_d) * shared
        springs = max(springs, before_row + coupling)
        dampers = max(dampers, before_damping + friction)
        before_row = c * (shared + after) + coupling
        before_damping = d * (shared + after) + friction
        before_c = c
        before_d = d
    springs = max(springs, before_row)
    dampers = max(dampers, before_damping) + ground
    rate = 0.5 * (dampers + math.sqrt(dampers * dampers + 4.0 * springs))
    for j in range(tones.shape[0]):
        rate = max(rate, tones[j, OMEGA])
    return rate


@compiled
def outside(x: Vector, m: Vector, lag: float, masses: Matrix, tones: Matrix, h: float, n: int,
            series: Cube, lines: Matrix) -> None:  # fmt: skip
    """The coefficients of the motor torque and of the exciting torques."""
    for o in range(n + 1):
        lines[U_LINE, o] = 0.0
    lines[U_LINE, 0] = m[UA]
    lines[U_LINE, 1] = m[UB] * h
    if m[UE] != 0.0:
        term = m[UE]
        for o in range(n + 1):
            lines[U_LINE, o] += term
            term *= -h / (lag * (o + 1.0))
    for i in range(masses.shape[0]):
        series[OUTSIDE, i, 0] = masses[i, MEAN]
        for o in range(1, n + 1):
            series[OUTSIDE, i, o] = 0.0
    for j in range(tones.shape[0]):
        i = int(tones[j, ON])
        phase = tones[j, OMEGA] * x[TIME]
        cos = math.cos(phase)
        sin = math.sin(phase)
        turn = tones[j, OMEGA] * h
        even = tones[j, COSINE] * cos + tones[j, SINE] * sin
        odd = (tones[j, SINE] * cos - tones[j, COSINE] * sin) * turn
        for o in range(0, n + 1, 2):
            series[OUTSIDE, i, o] += even
            even *= -turn * turn / ((o + 1.0) * (o + 2.0))
            if o < n:
                series[OUTSIDE, i, o + 1] += odd
                odd *= -turn * turn / ((o + 2.0) * (o + 3.0))


@compiled
def orders(reach: float) -> int:
    """How many coefficients a span of so many inverse rates needs."""
    n = 0
    term = 1.0
    while term > TRUNCATION and n < ORDERS - 4:
        n += 1
        term *= reach / n
    return max(n + 2, 4)


@compiled
def expand(p: Vector, x: Vector, m: Vector, place: Vector, masses: Matrix, shafts: Matrix, tones: Matrix,
           mass: Matrix, shaft: Matrix, series: Cube, lines: Matrix, h: float, n: int) -> None:  # fmt: skip
    """All coefficients of the span of length h that begins with the present state and modes."""
    count = masses.shape[0]
    motor = int(place[MOTOR])
    outside(x, m, p[LAG], masses, tones, h, n, series, lines)
    lines[PHI_LINE, 0] = x[PHI2]
    for i in range(count):
        series[SPEED, i, 0] = mass[i, W]
        if i + 1 < count:
            series[TWIST, i, 0] = shaft[i, THETA]
    for o in range(n + 1):
        share = h / (o + 1.0)
        for k in range(count - 1):
            mode = shaft[k, MODE]
            if mode in (CONTACT, JOINED, DOUBLED):
                z = series[TWIST, k, o]
                if o == 0:
                    z -= shaft[k, SIDE] * shafts[k, HALF]
                if mode == DOUBLED:
                    series[TORQUE, k, o] = 2.0 * shafts[k, C] * z
                else:
                    series[TORQUE, k, o] = shafts[k, C] * z
                    if shafts[k, D] != 0.0:
                        series[TORQUE, k, o] += shafts[k, D] * (series[SPEED, k, o] - series[SPEED, k + 1, o])
            else:
                series[TORQUE, k, o] = 0.0
        i = 0
        while i < count:
            last = i
            total = 0.0
            size = 0.0
            while True:
                q = series[OUTSIDE, last, o]
                if last == motor:
                    q += lines[U_LINE, o]
                if masses[last, GROUND] != 0.0:
                    q -= masses[last, GROUND] * series[SPEED, last, o]
                if o == 0:
                    q -= mass[last, DIRECTION] * masses[last, MC] + masses[last, ACTIVE]
                    size += abs(q)
                series[OUTSIDE, last, o] = q
                total += q
                if last + 1 == count or int(mass[last + 1, FIRST]) != i:
                    break
                last += 1
            if i > 0:
                total += shaft[i - 1, AFTER] * series[TORQUE, i - 1, o]
            if last + 1 < count:
                total -= shaft[last, BEFORE] * series[TORQUE, last, o]
            stuck = mass[i, STUCK] != 0.0
            held = total if stuck else 0.0
            rise = 0.0 if stuck else total / mass[i, BODY_J]
            series[HELD, i, o] = held
            if o == 0:
                if i > 0:
                    size += shaft[i - 1, AFTER] * abs(series[TORQUE, i - 1, 0])
                if last + 1 < count:
                    size += shaft[last, BEFORE] * abs(series[TORQUE, last, 0])
                if stuck:
                    direction = 1.0 if held >= 0.0 else -1.0
                    most = mass[i, HOLD] + body_grip(shafts, mass, shaft, series, i, direction, 0)
                    mass[i, USED] = held / most if most > 0.0 else 0.0
                mass[i, SIZE] = size
                mass[i, INFLUENCE] = size / mass[i, BODY_J]
            for j in range(i, last + 1):
                series[SPEED, j, o + 1] = rise * share
                if j < last:  # the joint carries what the masses before it leave
                    carried = series[OUTSIDE, j, o] - masses[j, J] * rise
                    if stuck and masses[j, RUBS] != 0.0:
                        carried -= held_by(masses, shafts, mass, shaft, series, i, j, held, o)
                    if j > 0:
                        carried += shaft[j - 1, AFTER] * series[TORQUE, j - 1, o]
                    series[TORQUE, j, o] = carried
            i = last + 1
        for k in range(count - 1):
            series[TWIST, k, o + 1] = share * (series[SPEED, k, o] - series[SPEED, k + 1, o])
        lines[PHI_LINE, o + 1] = share * series[SPEED, motor, o]
