"""The Taylor polynomials of one span.

Between two events the machine is linear, and the torques on it are sums of a line, an exponential and
harmonics; so all coefficients follow from one another, in three passes for each order: torques of the shafts,
accelerations of the bodies, twists. A span reaches three over the fastest rate of the machine in its present
modes, where some thirty coefficients leave nothing but rounding; shorter ones take fewer.

Masses joined by rigid shafts, or by rigid flanks that press, are one body; what their joints carry follows
from the balance of each mass.

A gear of efficiency eta sits between its shaft and the mass on the other side of it, and has the speed w of
that mass. Of the shaft torque T it passes `eta T` on to the mass when power flows that way, and takes `T/eta`
from it when power flows back. The difference is friction on the mass, against its motion:

    (1 - eta) |T|      where the shaft drives the mass
    (1/eta - 1) |T|    where the mass drives the shaft

It passes continuously through T = 0, and jumps where the speed changes its sign with a torque on: there the
mass sticks while the torque that moves it lies between the two (A. F. Filippov, Differential Equations with
Discontinuous Righthand Sides, 1988), as one with a reactive load does, with limits that go with T.
"""

from __future__ import annotations

import math

import numpy as np
from numba import types

from softstart.arrays import Matrix
from softstart.kernel.jit import separately_compiled, inner, as_record
from softstart.kernel.motor import expand_torque
from softstart.kernel.records import (
    CONTACT,
    DOUBLED,
    JOINED,
    ORDERS,
    PRESSED,
    TONE,
    TONE_TYPE,
    WELDED,
    WORK_TYPE,
    Record,
)

REACH = 3.0
TRUNCATION = 1e-17
LEAST, MOST = 4, ORDERS - 2  # coefficients of a span


# load curves, bodies and gears ----------------------------------------------------------------------


@inner
def set_piece(s: Record, i: int, piece: int) -> None:
    """The straight piece of its load curve on which mass i is: `piece` of the points lie before it."""
    s.piece[i] = piece
    s.incline[i] = 0.0
    s.modes_changed = 1.0
    last = s.points[i]
    if piece == 0:
        s.offset[i] = s.torque_at[i, 0]
    elif piece == last:
        s.offset[i] = s.torque_at[i, last - 1]
    else:
        rise = s.torque_at[i, piece] - s.torque_at[i, piece - 1]
        s.incline[i] = rise / (s.at[i, piece] - s.at[i, piece - 1])
        s.offset[i] = s.torque_at[i, piece - 1] - s.incline[i] * s.at[i, piece - 1]
        if abs(s.offset[i]) <= 1e-15 * abs(s.torque_at[i, piece - 1]):  # rounding: no torque breaks friction
            s.offset[i] = 0.0


@inner
def find_piece(s: Record, i: int) -> None:
    """The same by the present speed or angle, as at the start and where a blow has changed the speed."""
    if s.points[i] == 0:
        return
    where = s.angle[i] if s.by_angle[i] != 0.0 else s.w[i]
    piece = 0
    while piece < s.points[i] and s.at[i, piece] <= where:
        piece += 1
    s.passed[i] = 0
    set_piece(s, i, piece)


@inner
def set_gear(s: Record, k: int) -> None:
    """The share of the torque of shaft k that acts on the masses beside it, in the present directions."""
    s.share_before[k] = 1.0
    s.share_after[k] = 1.0
    if s.eta[k] == 1.0:
        return
    i = k + int(s.gear[k])
    s.lossy_gears[s.body[i]] += 1
    forward = s.sign[k] * s.direction[i]  # power flows towards the last mass
    if forward == 0.0:
        return
    if i == k:
        s.share_before[k] = 1.0 / s.eta[k] if forward > 0.0 else s.eta[k]
    else:
        s.share_after[k] = s.eta[k] if forward > 0.0 else 1.0 / s.eta[k]


@inner
def gear_friction(s: Record, i: int, direction: float, o: int) -> float:
    """The coefficient of order o of the friction of the gears at the body i, were it to move so."""
    total = 0.0
    for k in range(s.n - 1):
        j = k + int(s.gear[k])
        if s.eta[k] == 1.0 or s.body[j] != i:
            continue
        driven = s.sign[k] * direction if j > k else -s.sign[k] * direction
        share = (1.0 - s.eta[k] if driven > 0.0 else 1.0 / s.eta[k] - 1.0) * s.sign[k]
        total += share * s.torque[k, o]
    return total


# the length of a span -------------------------------------------------------------------------------


@inner
def fastest_rate(s: Record) -> float:
    """An upper bound of the rates of the machine in its present modes, 1/s.

    Gershgorin's theorem on the matrix of the shafts, c_k (1/J_a + 1/J_b) with sqrt(c_k c_l)/J beside it, and
    the same of the dampings; of load curves the largest slope over its inertia, whatever its sign.
    """
    springs, dampers, ground, incline_rate = 0.0, 0.0, 0.0, 0.0
    before_c, before_d, before_row, before_damping = 0.0, 0.0, 0.0, 0.0
    i = 0
    while i < s.n:
        shared = s.inverse_J[i]
        to_ground, incline = 0.0, 0.0
        j = i
        while j < s.n and s.body[j] == i:
            to_ground += s.ground[j]
            if s.points[j] > 0:
                if s.by_angle[j] != 0.0:
                    incline += abs(s.incline[j])
                else:
                    to_ground += abs(s.incline[j])
            j += 1
        ground = max(ground, to_ground * shared)
        incline_rate = max(incline_rate, incline * shared)
        if j == s.n:
            break
        k = j - 1
        share = max(s.share_before[k], s.share_after[k])
        c, d = s.stiff[k] * share, s.damp[k] * share
        coupling = math.sqrt(c * before_c) * shared
        friction = math.sqrt(d * before_d) * shared
        springs = max(springs, before_row + coupling)
        dampers = max(dampers, before_damping + friction)
        before_row = c * (shared + s.inverse_J[j]) + coupling
        before_damping = d * (shared + s.inverse_J[j]) + friction
        before_c, before_d = c, d
        i = j
    springs = max(springs, before_row) + incline_rate
    dampers = max(dampers, before_damping) + ground
    # the larger root of lambda^2 = dampers lambda + springs
    return 0.5 * (dampers + math.sqrt(dampers * dampers + 4.0 * springs))


@separately_compiled(types.void(WORK_TYPE))
def apply_modes(s: Record) -> None:
    """What follows from the modes: bodies and what holds them, springs that act, gears, the fastest rate."""
    first = 0
    s.bodies = 0.0
    for i in range(s.n):
        if i == 0 or (s.mode[i - 1] != WELDED and s.mode[i - 1] != PRESSED):
            first = i
            s.body_J[i] = 0.0
            s.friction_limit[i] = 0.0
            s.stuck[i] = 0
            s.friction_count[i] = 0
            s.lossy_gears[i] = 0
        else:
            s.bodies = 1.0
        s.body[i] = first
        s.body_J[first] += s.J[i]
        s.constant_torque[i] = s.mean[i] - s.active[i] - s.direction[i] * (s.Mc[i] + s.friction[i])
        if s.points[i] > 0:
            s.constant_torque[i] -= s.offset[i]
        if s.has_friction[i] != 0.0:
            s.friction_count[first] += 1
            s.friction_limit[first] += s.Mc[i] + s.friction[i]
            if s.direction[i] == 0.0:
                s.stuck[first] = 1
        if s.braked != 0.0 and i == s.at_motor:
            s.stuck[first] = 1
    for i in range(s.n):
        first = s.body[i]
        s.inverse_J[i] = 0.0 if s.stuck[first] != 0 else 1.0 / s.body_J[first]
    for k in range(s.n - 1):
        spring = s.mode[k] == CONTACT or s.mode[k] == JOINED
        s.stiff[k] = s.c[k] if spring else (2.0 * s.c[k] if s.mode[k] == DOUBLED else 0.0)
        s.damp[k] = s.d[k] if spring else 0.0
        s.spring_zero[k] = s.side[k] * s.half_gap[k]
        set_gear(s, k)
    s.rate_bound = fastest_rate(s)
    s.modes_changed = 0.0


def needed(reach: float) -> int:
    """How many coefficients a span of so many inverse rates needs."""
    n = 0
    term = 1.0
    while term > TRUNCATION and n < MOST - 1:
        n += 1
        term *= reach / n
    return max(n + 1, LEAST)


def largest_reach(n: int) -> float:
    """The largest reach for which n coefficients are enough."""
    low, high = 0.0, 2.0 * REACH
    while math.nextafter(low, high) < high:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if needed(middle) <= n else (low, middle)
    return low


REACHES = np.array([largest_reach(n) for n in range(LEAST, MOST)])


@inner
def orders(reach: float) -> int:
    """How many coefficients a span of so many inverse rates needs: `needed`, from a table."""
    n = LEAST
    while n < MOST and reach > REACHES[n - LEAST]:
        n += 1
    return n


# the series -----------------------------------------------------------------------------------------


@separately_compiled(types.void(WORK_TYPE, TONE_TYPE, types.float64, types.int64))
def add_tone(s: Record, tone: Record, h: float, n: int) -> None:
    """The coefficients of one harmonic of an exciting torque, added to those of its mass."""
    i = int(tone.mass)
    # cos(phase + turn x) by angle addition: even and odd powers of x apart
    phase = tone.omega * s.time
    cos = math.cos(phase)
    sin = math.sin(phase)
    turn = tone.omega * h
    even = tone.cosine * cos + tone.sine * sin
    odd = (tone.sine * cos - tone.cosine * sin) * turn
    for o in range(0, n + 1, 2):
        s.exciting_torque[i, o] += even
        even *= -turn * turn / ((o + 1.0) * (o + 2.0))
        if o < n:
            s.exciting_torque[i, o + 1] += odd
            odd *= -turn * turn / ((o + 2.0) * (o + 3.0))


@inner
def expand_tones(s: Record, tones: Matrix, h: float, n: int) -> None:
    """The coefficients of the exciting torques."""
    for i in range(s.n):
        for o in range(n + 1):
            s.exciting_torque[i, o] = 0.0
    for row in range(tones.shape[0]):
        add_tone(s, as_record(tones[row], TONE), h, n)


@inner
def curve_torque(s: Record, i: int, o: int, share: float) -> float:
    """The coefficient of order o of the load curve's torque; the next one of the angle follows too."""
    if s.by_angle[i] != 0.0:
        if o == 0:
            s.rotation[i, 0] = s.angle[i]
        s.rotation[i, o + 1] = share * s.speed[i, o]
        return s.incline[i] * s.rotation[i, o]
    return s.incline[i] * s.speed[i, o]


@inner
def join(s: Record, o: int, share: float) -> None:
    """The masses of each body move as one, and its rigid joints carry what the masses before them leave.

    What each of several masses that rub holds is not determined: here each its share of what can hold.
    """
    i = 0
    while i < s.n:
        total = 0.0
        end = i
        while end < s.n and s.body[end] == i:
            total += s.net_torque[end, o]
            end += 1
        rise = total * s.inverse_J[i]
        carried = 0.0
        for j in range(i, end):
            s.speed[j, o + 1] = share * rise
            carried += s.net_torque[j, o] - (total if math.isinf(s.J[j]) else s.J[j] * rise)
            if s.stuck[i] != 0:
                if s.braked != 0.0 and s.body[s.at_motor] == i:
                    carried -= total if j == s.at_motor else 0.0
                elif s.friction_limit[i] > 0.0:
                    if s.has_friction[j] != 0.0:
                        carried -= total * (s.Mc[j] + s.friction[j]) / s.friction_limit[i]
                elif s.has_friction[j] != 0.0:
                    carried -= total / s.friction_count[i]
            if j + 1 < end:
                s.torque[j, o] = carried
        s.net_torque[i, o] = total
        i = end


@inner
def note_scale(s: Record) -> None:
    """The sum of the absolute torques on each body, which is the scale of its rounding.

    That of a spring is the difference of c theta and c gap/2.
    """
    i = 0
    while i < s.n:
        scale = 0.0
        if i > 0:
            scale += s.share_after[i - 1] * (abs(s.torque[i - 1, 0]) + s.stiff[i - 1] * s.half_gap[i - 1])
        j = i
        while True:
            scale += abs(s.constant_torque[j]) + abs(s.ground[j] * s.w[j])
            if j == s.at_motor:
                scale += abs(s.torque_u[0])
            if s.tones != 0.0:
                scale += abs(s.exciting_torque[j, 0])
            j += 1
            if j == s.n or s.body[j] != i:
                break
        if j < s.n:
            scale += s.share_before[j - 1] * (abs(s.torque[j - 1, 0]) + s.stiff[j - 1] * s.half_gap[j - 1])
        s.torque_scale[i] = scale
        i = j


@separately_compiled(types.void(WORK_TYPE, types.float64, types.int64))
def expand(s: Record, h: float, n: int) -> None:
    """All coefficients of the span of length h that begins with the present state and modes."""
    speed, twist, torque, net_torque = s.speed, s.twist, s.torque, s.net_torque
    count, motor, load = s.n, s.at_motor, s.at_load
    forced, curved, bodies = s.tones != 0.0, s.curves != 0.0, s.bodies != 0.0
    expand_torque(s, h, n)
    s.angle_u[0] = s.phi
    for i in range(count):
        speed[i, 0] = s.w[i]
    for k in range(count - 1):
        twist[k, 0] = s.theta[k]
    for o in range(n + 1):
        share = h / (o + 1.0)
        passed_on = 0.0
        for i in range(count):
            w = speed[i, o]
            total = passed_on - s.ground[i] * w
            if i == motor:
                total += s.torque_u[o]
            if o == 0:
                total += s.constant_torque[i]
            if forced:
                total += s.exciting_torque[i, o]
            if curved and s.points[i] > 0:
                total -= curve_torque(s, i, o, share)
            if i + 1 < count:
                v = w - speed[i + 1, o]
                z = twist[i, o] - s.spring_zero[i] if o == 0 else twist[i, o]
                T = s.stiff[i] * z + s.damp[i] * v  # T = c z + d z'; undamped M12 of [G](7)
                torque[i, o] = T
                twist[i, o + 1] = share * v
                total -= s.share_before[i] * T
                passed_on = s.share_after[i] * T
            net_torque[i, o] = total
            speed[i, o + 1] = share * s.inverse_J[i] * total  # J w' = sum of torques, [G](1), (7)
        if bodies:
            join(s, o, share)
        s.angle_u[o + 1] = share * speed[load, o]
    note_scale(s)
