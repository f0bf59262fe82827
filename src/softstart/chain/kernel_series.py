"""The Taylor series of one span, with gears that have losses.

Between two events the chain is linear, and the torques on it are sums of a line, an exponential and
harmonics; so all coefficients follow from one another. A span reaches three over the fastest rate of the
chain in its present mode, where some thirty coefficients leave nothing but rounding; shorter ones take fewer.

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

from softstart.chain.kernel_records import CONTACT, DOUBLED, JOINED, ORDERS, PRESSED, WELDED, Record, Start
from softstart.plant.jit import compiled, inlined
from softstart.plant.layout import MOTION, PLANT, STATE

REACH = 3.0
TRUNCATION = 1e-18
LEAST, MOST = 4, ORDERS - 2  # coefficients of a span


# load curves, bodies and gears ----------------------------------------------------------------------


@compiled
def set_piece(mass: Record, piece: int) -> None:
    """The straight piece of the load curve on which the mass is: `piece` of the points lie before it."""
    mass.piece = piece
    mass.slope = 0.0
    if piece == 0:
        mass.offset = mass.torque_at[0]
    elif piece == mass.points:
        mass.offset = mass.torque_at[piece - 1]
    else:
        rise = mass.torque_at[piece] - mass.torque_at[piece - 1]
        mass.slope = rise / (mass.at[piece] - mass.at[piece - 1])
        mass.offset = mass.torque_at[piece - 1] - mass.slope * mass.at[piece - 1]


@compiled
def find_piece(mass: Record) -> None:
    """The same by the present speed or angle, as at the start and where a blow has changed the speed."""
    if mass.points == 0:
        return
    where = mass.angle if mass.by_angle != 0 else mass.w
    piece = 0
    while piece < mass.points and mass.at[piece] <= where:
        piece += 1
    mass.passed = 0
    set_piece(mass, piece)


@compiled
def join_bodies(masses: Record, shafts: Record) -> None:
    """Which masses move as one, their inertia, the friction that can hold them, what their gears pass on."""
    first = 0
    for i in range(masses.size):
        mass = masses[i]
        if i == 0 or (shafts[i - 1].mode != WELDED and shafts[i - 1].mode != PRESSED):
            first = i
            mass.body_J = 0.0
            mass.hold = 0.0
            mass.stuck = 0
            mass.rubbing = 0
            mass.gears = 0
        mass.first = first
        body = masses[first]
        body.body_J += mass.J
        if mass.rubs != 0:
            body.rubbing += 1
            body.hold += mass.Mc
            if mass.direction == 0.0:
                body.stuck = 1
    for k in range(shafts.size):
        set_gear(masses, shafts, k)


@compiled
def set_gear(masses: Record, shafts: Record, k: int) -> None:
    """The share of the torque of shaft k that acts on the masses beside it, in the present directions."""
    shaft = shafts[k]
    shaft.before = 1.0
    shaft.after = 1.0
    if shaft.eta == 1.0:
        return
    i = k + shaft.gear
    masses[masses[i].first].gears += 1
    forward = shaft.sign * masses[i].direction  # power flows towards the last mass
    if forward == 0.0:
        return
    if i == k:
        shaft.before = 1.0 / shaft.eta if forward > 0.0 else shaft.eta
    else:
        shaft.after = shaft.eta if forward > 0.0 else 1.0 / shaft.eta


@compiled
def grip(shafts: Record, j: int, direction: float, o: int) -> float:
    """The coefficient of order o of the friction of the gears at mass j, were it to move so."""
    total = 0.0
    for k in range(max(j - 1, 0), min(j + 1, shafts.size)):
        shaft = shafts[k]
        if shaft.eta == 1.0 or k + shaft.gear != j:
            continue
        driven = shaft.sign * direction if j > k else -shaft.sign * direction
        share = (1.0 - shaft.eta if driven > 0.0 else 1.0 / shaft.eta - 1.0) * shaft.sign
        total += share * shaft.torque[o]
    return total


@compiled
def body_grip(masses: Record, shafts: Record, i: int, direction: float, o: int) -> float:
    """The same of all gears of the body that begins with mass i."""
    total = 0.0
    for j in range(i, masses.size):
        if masses[j].first != i:
            break
        total += grip(shafts, j, direction, o)
    return total


@compiled
def held_by(masses: Record, shafts: Record, i: int, j: int, held: float, o: int) -> float:
    """What of `held`, the coefficient of order o of what holds the body i, falls to its mass j.

    What each of several holds is not determined. None holds more than it can if each is used to the same
    share at the beginning of the span, `used`; from there on a gear goes with its torque, and reactive loads
    take what is left.
    """
    body = masses[i]
    direction = 1.0 if body.used >= 0.0 else -1.0
    of_gear = abs(body.used) * direction * grip(shafts, j, direction, o)
    of_gears = abs(body.used) * direction * body_grip(masses, shafts, i, direction, o)
    part = masses[j].Mc / body.hold if body.hold > 0.0 else 1.0 / body.rubbing
    return of_gear + (held - of_gears) * part


# the length of a span -------------------------------------------------------------------------------


@inlined
def fastest_rate(start: Start) -> float:
    """An upper bound of the rates of the chain in its present mode, 1/s.

    Gershgorin's theorem on the matrix of the shafts, c_k (1/J_a + 1/J_b) with sqrt(c_k c_l)/J beside it, and
    the same of the dampings; of load curves the largest slope over its inertia, whatever its sign.
    """
    masses, shafts = start.masses, start.shafts
    springs = 0.0
    dampers = 0.0
    ground = 0.0
    held = 0.0
    curved = masses[0].curves != 0
    before_c = 0.0
    before_d = 0.0
    before_row = 0.0
    before_damping = 0.0
    shared = 0.0
    for i in range(masses.size):
        mass = masses[i]
        if mass.first == i:
            shared = 0.0 if mass.stuck != 0 else 1.0 / mass.body_J
            to_ground = 0.0
            curve = 0.0
            j = i
            while j < masses.size and masses[j].first == i:
                to_ground += masses[j].ground
                if curved:
                    if masses[j].by_angle != 0:
                        curve += abs(masses[j].slope)
                    else:
                        to_ground += abs(masses[j].slope)
                j += 1
            ground = max(ground, to_ground * shared)
            if curved:
                held = max(held, curve * shared)
        if i + 1 == masses.size or masses[i + 1].first != i + 1:
            continue
        shaft = shafts[i]
        c = 0.0
        d = 0.0
        if shaft.mode in (CONTACT, JOINED):
            c = shaft.c
            d = shaft.d
        elif shaft.mode == DOUBLED:
            c = 2.0 * shaft.c
        share = max(shaft.before, shaft.after)
        c *= share
        d *= share
        after = 0.0 if masses[i + 1].stuck != 0 else 1.0 / masses[i + 1].body_J
        coupling = math.sqrt(c * before_c) * shared
        friction = math.sqrt(d * before_d) * shared
        springs = max(springs, before_row + coupling)
        dampers = max(dampers, before_damping + friction)
        before_row = c * (shared + after) + coupling
        before_damping = d * (shared + after) + friction
        before_c = c
        before_d = d
    springs = max(springs, before_row) + held
    dampers = max(dampers, before_damping) + ground
    rate = 0.5 * (dampers + math.sqrt(dampers * dampers + 4.0 * springs))
    for tone in start.tones:
        rate = max(rate, tone.omega)
    return rate


def needed(reach: float) -> int:
    """How many coefficients a span of so many inverse rates needs."""
    n = 0
    term = 1.0
    while term > TRUNCATION and n < MOST - 2:
        n += 1
        term *= reach / n
    return max(n + 2, LEAST)


def largest_reach(n: int) -> float:
    """The largest reach for which n coefficients are enough."""
    low, high = 0.0, 2.0 * REACH
    while math.nextafter(low, high) < high:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if needed(middle) <= n else (low, middle)
    return low


REACHES = np.array([largest_reach(n) for n in range(LEAST, MOST)])


@compiled
def orders(reach: float) -> int:
    """How many coefficients a span of so many inverse rates needs: `needed`, from a table."""
    n = MOST
    while n > LEAST and reach <= REACHES[n - 1 - LEAST]:
        n -= 1
    return n


# the series -----------------------------------------------------------------------------------------


@inlined
def expand_torques(start: Start, h: float, n: int) -> None:
    """The coefficients of the motor torque and of the exciting torques."""
    p = start.p.view(PLANT)[0]
    x = start.x.view(STATE)[0]
    m, u = start.m.view(MOTION)[0], start.u
    for o in range(n + 1):
        u[o] = 0.0
    u[0] = m.ua
    u[1] = m.ub * h
    if m.ue != 0.0:
        lag = p.lag
        term = m.ue
        for o in range(n + 1):
            u[o] += term
            term *= -h / (lag * (o + 1.0))
        if m.slow_lag != 0.0:
            u[0] = x.u
            u[1] = (x.ref - x.u) * h / lag
    for mass in start.masses:
        mass.outside[0] = mass.mean
        for o in range(1, n + 1):
            mass.outside[o] = 0.0
    for tone in start.tones:
        outside = start.masses[tone.mass].outside
        phase = tone.omega * x.time
        cos = math.cos(phase)
        sin = math.sin(phase)
        turn = tone.omega * h
        even = tone.cosine * cos + tone.sine * sin
        odd = (tone.sine * cos - tone.cosine * sin) * turn
        for o in range(0, n + 1, 2):
            outside[o] += even
            even *= -turn * turn / ((o + 1.0) * (o + 2.0))
            if o < n:
                outside[o + 1] += odd
                odd *= -turn * turn / ((o + 2.0) * (o + 3.0))


@inlined
def curve_torque(mass: Record, o: int, share: float) -> float:
    """The coefficient of order o of the load curve's torque; the next one of the angle follows too."""
    if mass.by_angle != 0:
        if o == 0:
            mass.turned[0] = mass.angle
        torque = mass.slope * mass.turned[o]
        mass.turned[o + 1] = share * mass.speed[o]
    else:
        torque = mass.slope * mass.speed[o]
    if o == 0:
        torque += mass.offset
    return torque


@inlined
def each_alone(masses: Record, shafts: Record) -> bool:
    """Whether no masses move as one, no gear has losses, and no load follows a curve."""
    alone = masses[0].curves == 0
    for i in range(1, masses.size):
        if masses[i].first != i or shafts[i - 1].eta != 1.0:
            alone = False
    return alone


@inlined
def expand_alone(start: Start, h: float, n: int) -> None:
    """As `expand` where each mass moves alone: the same operations without bodies, gears and load curves."""
    masses, shafts, u = start.masses, start.shafts, start.u
    count = masses.size
    motor = start.place.motor
    for o in range(n + 1):
        share = h / (o + 1.0)
        before = 0.0
        for i in range(count):
            mass = masses[i]
            w = mass.speed[o]
            q = mass.outside[o]
            if i == motor:
                q += u[o]
            if mass.ground != 0.0:
                q -= mass.ground * w
            if o == 0:
                q -= mass.direction * mass.Mc + mass.active
            mass.outside[o] = q
            total = 0.0 + q
            if i > 0:
                total += before
            after = 0.0
            if i + 1 < count:
                shaft = shafts[i]
                v = w - masses[i + 1].speed[o]
                if shaft.mode in (CONTACT, JOINED, DOUBLED):
                    z = shaft.twist[o]
                    if o == 0:
                        z -= shaft.side * shaft.half
                    if shaft.mode == DOUBLED:
                        after = 2.0 * shaft.c * z
                    else:
                        after = shaft.c * z
                        if shaft.d != 0.0:
                            after += shaft.d * v
                shaft.torque[o] = after
                shaft.twist[o + 1] = share * v
                total -= after
            stuck = mass.stuck != 0
            mass.held[o] = total if stuck else 0.0
            mass.speed[o + 1] = (0.0 if stuck else total / mass.body_J) * share
            if o == 0:
                if stuck:
                    mass.used = total / mass.hold if mass.hold > 0.0 else 0.0
                mass.size = abs(q) + abs(before) + abs(after)
                mass.influence = mass.size / mass.body_J
            before = after
        start.phi[o + 1] = share * masses[motor].speed[o]


@compiled
def expand(start: Start, h: float, n: int) -> None:
    """All coefficients of the span of length h that begins with the present state and modes."""
    x = start.x.view(STATE)[0]
    masses, shafts = start.masses, start.shafts
    count = masses.size
    motor = start.place.motor
    expand_torques(start, h, n)
    start.phi[0] = x.phi2
    for mass in masses:
        mass.speed[0] = mass.w
    for shaft in shafts:
        shaft.twist[0] = shaft.theta
    if each_alone(masses, shafts):
        expand_alone(start, h, n)
        return
    for o in range(n + 1):
        share = h / (o + 1.0)
        for k in range(count - 1):
            shaft = shafts[k]
            if shaft.mode in (CONTACT, JOINED, DOUBLED):
                z = shaft.twist[o]
                if o == 0:
                    z -= shaft.side * shaft.half
                if shaft.mode == DOUBLED:
                    shaft.torque[o] = 2.0 * shaft.c * z
                else:
                    torque = shaft.c * z
                    if shaft.d != 0.0:
                        torque += shaft.d * (masses[k].speed[o] - masses[k + 1].speed[o])
                    shaft.torque[o] = torque
            else:
                shaft.torque[o] = 0.0
        i = 0
        while i < count:
            body = masses[i]
            last = i
            total = 0.0
            size = 0.0
            while True:
                mass = masses[last]
                q = mass.outside[o]
                if last == motor:
                    q += start.u[o]
                if mass.ground != 0.0:
                    q -= mass.ground * mass.speed[o]
                if mass.points > 0:
                    q -= curve_torque(mass, o, share)
                if o == 0:
                    q -= mass.direction * mass.Mc + mass.active
                    size += abs(q)
                mass.outside[o] = q
                total += q
                if last + 1 == count or masses[last + 1].first != i:
                    break
                last += 1
            if i > 0:
                total += shafts[i - 1].after * shafts[i - 1].torque[o]
            if last + 1 < count:
                total -= shafts[last].before * shafts[last].torque[o]
            stuck = body.stuck != 0
            held = total if stuck else 0.0
            rise = 0.0 if stuck else total / body.body_J
            body.held[o] = held
            if o == 0:
                if i > 0:
                    size += shafts[i - 1].after * abs(shafts[i - 1].torque[0])
                if last + 1 < count:
                    size += shafts[last].before * abs(shafts[last].torque[0])
                if stuck:
                    direction = 1.0 if held >= 0.0 else -1.0
                    most = body.hold + body_grip(masses, shafts, i, direction, 0)
                    body.used = held / most if most > 0.0 else 0.0
                body.size = size
                body.influence = size / body.body_J
            for j in range(i, last + 1):
                mass = masses[j]
                mass.speed[o + 1] = rise * share
                if j < last:  # the joint carries what the masses before it leave
                    carried = mass.outside[o] - (total if math.isinf(mass.J) else mass.J * rise)
                    if stuck and mass.rubs != 0:
                        carried -= held_by(masses, shafts, i, j, held, o)
                    if j > 0:
                        carried += shafts[j - 1].after * shafts[j - 1].torque[o]
                    shafts[j].torque[o] = carried
            i = last + 1
        for k in range(count - 1):
            shafts[k].twist[o + 1] = share * (masses[k].speed[o] - masses[k + 1].speed[o])
        start.phi[o + 1] = share * masses[motor].speed[o]
