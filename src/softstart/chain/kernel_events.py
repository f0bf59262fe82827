"""The event that ends a span: gaps that close and open, damping regimes, friction, the target speed.

Events are first roots of Taylor polynomials on [0, 1], certified: at x, with f > 0 and |f''| <= M2 up to the
end, `f(x + d) >= f + f' d - M2 d^2/2`, so the first zero of that parabola is a step that provably passes no
zero of f. The steps shrink quadratically onto a simple zero, always from the left. The largest torque of each
shaft is located in the same way, never read off a grid.
"""

from __future__ import annotations

import math

from softstart.arrays import Vector
from softstart.chain.kernel_records import (
    BACK,
    BEYOND,
    BREAK_BACK,
    BREAK_FORWARD,
    CONTACT,
    DOUBLED,
    EXIT,
    JOINED,
    LOWER,
    NO_EVENT,
    OPEN,
    POINT_ABOVE,
    POINT_BELOW,
    PRESSED,
    REACHED,
    REJOIN,
    RELEASE,
    SETTLE,
    STOP,
    SWITCH,
    TURNED,
    UNSOLVED,
    UPPER,
    Record,
    Start,
)  # fmt: skip
from softstart.chain.kernel_series import body_grip
from softstart.plant.jit import compiled, inlined
from softstart.plant.layout import DEAD_ZONE, MODELICA, PLANT, STATE

NONE = -1.0
LOST = -2.0  # the iteration did not end: reported as an error, never passed over
EPS = 2.220446049250313e-16
MAX_STEPS = 20_000
CLEARLY = 1e4  # what is above so many times its rounding is not zero
FAINT = 1e-10  # a leading coefficient below this share of what follows is taken for rounding


@compiled
def value(f: Vector, n: int, x: float) -> float:
    """The polynomial f_0 + ... + f_n x^n."""
    total = f[n]
    for i in range(n - 1, -1, -1):
        total = total * x + f[i]
    return total


@compiled
def crossing(f: Vector, low: int, n: int, begin: float, end: float) -> float:
    """First x in [begin, end] at which f/x^low falls through zero; it is positive, or rises, at `begin`."""
    most = 0.0
    power = 1.0
    for i in range(2, n - low + 1):
        most += i * (i - 1) * abs(f[low + i]) * power
        power *= end
    x = begin
    for _ in range(MAX_STEPS):
        y = f[n]
        dy = 0.0
        size = abs(y)  # of its terms: rounding is in proportion
        for i in range(n - 1, low - 1, -1):
            dy = dy * x + y
            y = y * x + f[i]
            size = size * x + abs(f[i])
        if y <= EPS * size:
            if dy < 0.0:
                return x
            if most == 0.0:
                return NONE
            x += max(2.0 * dy / most, 2.0 * math.sqrt(EPS * size / most), EPS * end)
        else:
            if most == 0.0:
                if dy >= 0.0:
                    return NONE
                step = -y / dy
            else:
                root = math.sqrt(dy * dy + 2.0 * most * y)
                step = 2.0 * y / (root - dy) if dy < 0.0 else (root + dy) / most
            if x + step <= x:
                return x
            x += step
        if x > end:
            return NONE
    return LOST


@compiled
def first_root(f: Vector, n: int, end: float, zeros: int, noise: float, faint: float) -> float:
    """First x in [0, end] at which f falls below zero.

    The first `zeros` coefficients are zero by the nature of what has just happened, unless f_0 clearly is
    not, where speeds have jumped. Of the others `noise` (of f_0) and `faint` (of the rest) say what may be
    rounding. Where f begins at zero it is divided by powers of x, and the first coefficient that counts says
    whether it falls at once.
    """
    low = zeros
    if f[0] > CLEARLY * noise:
        low = 0
    elif zeros == 0:
        if f[0] < -noise:
            return 0.0
        if f[0] <= noise:
            low = 1
    if low > 0:
        while True:
            if low > n:
                return NONE
            rest = 0.0
            for i in range(low + 1, n + 1):
                rest += abs(f[i])
            least = max(faint, FAINT * rest)
            if f[low] > least:
                break
            if f[low] < -least:
                return 0.0
            low += 1
    rest = 0.0
    power = end
    for i in range(low + 1, n + 1):
        rest += abs(f[i]) * power
        power *= end
    if f[low] > rest * (1.0 + 1e-12):
        return NONE
    return crossing(f, low, n, 0.0, end)


# events of shafts -----------------------------------------------------------------------------------

ROUNDING = 4.0 * EPS
# a flank that is touched with an overlap below this share of the gap is grazed, not hit, as in the plant
GRAZE = 1e-12
# impacts that pile up within this share of a span are over: the accumulation time is known
PILED_UP = 1e-9
# flanks as elastic as this may bounce indefinitely: once they rise by GRAZE of the gap or less, they rest
ELASTIC = 0.999
# `zeros` of a contact whose torque has just come back: it begins at zero
REJOINED = 3


@inlined
def cannot_change_by(f: Vector, n: int, distance: float) -> bool:
    """Whether a polynomial stays within `distance` of its beginning."""
    total = 0.0
    for o in range(1, n + 1):
        total += abs(f[o])
    return total * (1.0 + 1e-12) < distance


@inlined
def set_line(f: Vector, series: Vector, n: int, constant: float, factor: float) -> None:
    """F = constant + factor * series."""
    for o in range(n + 1):
        f[o] = factor * series[o]
    f[0] += constant


@inlined
def rounding_of_torque(shaft: Record) -> float:
    """Rounding errors of c times the overlap."""
    return ROUNDING * shaft.c * (abs(shaft.theta) + shaft.half)


@inlined
def flanks(start: Start, k: int, h: float, n: int, end: float) -> tuple[int, float]:
    """The flank of an open gap that is reached first, or the end of impacts that pile up on one."""
    shaft = start.shafts[k]
    masses = start.masses
    half = shaft.half
    theta = shaft.theta
    if cannot_change_by(shaft.twist, n, half - abs(theta)):
        return NO_EVENT, end
    faint = 1e-14 * h * h * (masses[masses[k].first].influence + masses[k + 1].influence)
    if shaft.rigid != 0 and shaft.zeros == 0 and abs(theta) == half and half > 0.0:
        side = math.copysign(1.0, theta)
        rebound = -side * shaft.twist[1]
        press = side * shaft.twist[2]
        e = shaft.restitution
        if press > faint and rebound >= 0.0:
            flat = e > ELASTIC and rebound * rebound <= 8.0 * press * GRAZE * half
            if flat or rebound <= PILED_UP * (1.0 - e) * press:
                return SETTLE, 0.0
    event = NO_EVENT
    for which in range(2):
        side = 1.0 - 2.0 * which
        zeros = shaft.zeros if shaft.side == side else 0
        set_line(start.f, shaft.twist, n, half, -side)
        s = first_root(start.f, n, end, zeros, ROUNDING * half, faint)
        if s < NONE:
            return UNSOLVED, 0.0
        if s >= 0.0:
            event = UPPER if which == 0 else LOWER
            end = s
    return event, end


@inlined
def parting(start: Start, k: int, n: int, end: float) -> tuple[int, float]:
    """The instant at which flanks in contact part, or at which the damping regime changes."""
    shaft = start.shafts[k]
    f = start.f
    side = shaft.side
    d = shaft.d
    noise = rounding_of_torque(shaft)
    rejoined = shaft.zeros == REJOINED
    zeros = 1 if rejoined else 0
    if shaft.law == MODELICA and d > 0.0:
        doubled = shaft.mode == DOUBLED
        sign = -side if doubled else side
        before, after = start.masses[k].speed, start.masses[k + 1].speed
        for o in range(n + 1):
            f[o] = sign * (shaft.c * shaft.twist[o] - d * (before[o] - after[o]))
        f[0] -= sign * shaft.c * side * shaft.half
        s = first_root(f, n, end, 0 if rejoined else shaft.zeros, noise, 0.0)
        if s < NONE:
            return UNSOLVED, 0.0
        event = NO_EVENT
        if s >= 0.0:
            event = SWITCH
            end = s
        if doubled:
            return event, end
        set_line(f, shaft.torque, n, 0.0, side)
        s = first_root(f, n, end, zeros, noise, 0.0)
        if s < NONE:
            return UNSOLVED, 0.0
        return (EXIT, s) if s >= 0.0 else (event, end)
    if shaft.law != DEAD_ZONE and d > 0.0:
        if cannot_change_by(shaft.torque, n, side * shaft.torque[0]):
            return NO_EVENT, end
        set_line(f, shaft.torque, n, 0.0, side)
    else:
        if cannot_change_by(shaft.twist, n, side * shaft.theta - shaft.half):
            return NO_EVENT, end
        set_line(f, shaft.twist, n, -shaft.half, side)
        noise = ROUNDING * shaft.half
    s = first_root(f, n, end, zeros, noise, 0.0)
    if s < NONE:
        return UNSOLVED, 0.0
    return (EXIT, s) if s >= 0.0 else (NO_EVENT, end)


@inlined
def returning(start: Start, k: int, n: int, end: float) -> tuple[int, float]:
    """From overlapping flanks without torque: the torque comes back, or they part."""
    shaft = start.shafts[k]
    f = start.f
    side = shaft.side
    before, after = start.masses[k].speed, start.masses[k + 1].speed
    for o in range(n + 1):
        f[o] = -side * (shaft.c * shaft.twist[o] + shaft.d * (before[o] - after[o]))
    f[0] += shaft.c * shaft.half
    event = NO_EVENT
    s = first_root(f, n, end, shaft.zeros, rounding_of_torque(shaft), 0.0)
    if s < NONE:
        return UNSOLVED, 0.0
    if s >= 0.0:
        event = REJOIN
        end = s
    set_line(f, shaft.twist, n, -shaft.half, side)
    s = first_root(f, n, end, 0, ROUNDING * shaft.half, 0.0)
    if s < NONE:
        return UNSOLVED, 0.0
    return (BACK, s) if s >= 0.0 else (event, end)


@inlined
def releasing(start: Start, k: int, n: int, end: float) -> tuple[int, float]:
    """Rigid flanks part when they would have to pull."""
    shaft = start.shafts[k]
    masses = start.masses
    if cannot_change_by(shaft.torque, n, shaft.side * shaft.torque[0]):
        return NO_EVENT, end
    set_line(start.f, shaft.torque, n, 0.0, shaft.side)
    noise = 1e-14 * masses[masses[k].first].size
    s = first_root(start.f, n, end, 0, noise, noise)
    if s < NONE:
        return UNSOLVED, 0.0
    return (RELEASE, s) if s >= 0.0 else (NO_EVENT, end)


@inlined
def turning(start: Start, k: int, n: int, end: float) -> tuple[int, float]:
    """The instant at which the torque of a shaft that may pull changes its sign."""
    shaft = start.shafts[k]
    masses = start.masses
    pulls = shaft.mode == CONTACT and shaft.law == DEAD_ZONE and shaft.d > 0.0
    if not pulls and shaft.mode != JOINED:
        return NO_EVENT, end
    for o in range(n + 1):
        start.f[o] = shaft.sign * shaft.torque[o]
    noise = shaft.c * (abs(shaft.theta) + shaft.half)
    noise += shaft.d * (abs(masses[k].w) + abs(masses[k + 1].w))
    noise += masses[masses[k].first].size  # a twist near 0 has the rounding of those before it
    s = first_root(start.f, n, end, shaft.zeros, ROUNDING * noise, 0.0)
    if s < NONE:
        return UNSOLVED, 0.0
    return (TURNED, s) if s >= 0.0 else (NO_EVENT, end)


# friction, the target speed, and the first of all ---------------------------------------------------


@inlined
def friction(start: Start, i: int, h: float, n: int, end: float) -> tuple[int, float]:
    """Breakaway or stop of the body that begins with mass i."""
    masses, f = start.masses, start.f
    body = masses[i]
    if body.rubbing == 0:
        return NO_EVENT, end
    noise = ROUNDING * (body.size + body.hold)
    event = NO_EVENT
    if body.stuck != 0:
        geared = body.gears != 0
        if not geared and cannot_change_by(body.held, n, body.hold - abs(body.held[0])):
            return event, end
        for which in range(2):
            set_line(f, body.held, n, body.hold, -1.0 + 2.0 * which)
            if geared:
                for o in range(n + 1):
                    f[o] += body_grip(masses, start.shafts, i, 1.0 - 2.0 * which, o)
            s = first_root(f, n, end, 0, noise, noise)
            if s < NONE:
                return UNSOLVED, 0.0
            if s >= 0.0:
                event = BREAK_FORWARD if which == 0 else BREAK_BACK
                end = s
        return event, end
    j = i
    while masses[j].rubs == 0:
        j += 1
    direction = masses[j].direction
    if cannot_change_by(body.speed, n, direction * body.w):
        return event, end
    set_line(f, body.speed, n, 0.0, direction)
    faint = 1e-14 * h * (body.size + body.hold) / body.body_J
    s = first_root(f, n, end, 0, 0.0, faint)
    if s < NONE:
        return UNSOLVED, 0.0
    return (STOP, s) if s >= 0.0 else (event, end)


@inlined
def next_point(start: Start, i: int, h: float, n: int, end: float) -> tuple[int, float]:
    """The next point of its load curve that mass i passes: the torque is continuous there, its slope not."""
    mass = start.masses[i]
    body = start.masses[mass.first]
    faint = 1e-14 * h * body.influence
    event = NO_EVENT
    for which in range(2):
        sign = 1.0 - 2.0 * which
        piece = mass.piece if which == 0 else mass.piece - 1
        if piece < 0 or piece >= mass.points:
            continue
        point = mass.at[piece]
        if mass.by_angle != 0:
            set_line(start.f, mass.turned, n, sign * point, -sign)
        else:
            set_line(start.f, mass.speed, n, sign * point, -sign)
        zeros = 1 if mass.passed == -sign else 0
        if zeros == 0 and cannot_change_by(start.f, n, start.f[0]):
            continue
        if mass.by_angle != 0:
            s = first_root(start.f, n, end, zeros, ROUNDING * abs(point), faint * h)
        else:
            s = first_root(start.f, n, end, zeros, ROUNDING * abs(point), faint)
        if s < NONE:
            return UNSOLVED, 0.0
        if s >= 0.0:
            event = POINT_ABOVE if which == 0 else POINT_BELOW
            end = s
    return event, end


@inlined
def next_event(start: Start, h: float, n: int) -> tuple[int, int, float]:
    """The first event of the span, on which shaft or mass, and where on [0, 1]."""
    p = start.p.view(PLANT)[0]
    x = start.x.view(STATE)[0]
    masses, shafts = start.masses, start.shafts
    found = NO_EVENT
    where = 0
    end = 1.0
    s = 0.0
    for k in range(shafts.size):
        mode = shafts[k].mode
        event = NO_EVENT
        if mode == OPEN:
            event, s = flanks(start, k, h, n, end)
        elif mode in (CONTACT, DOUBLED):
            event, s = parting(start, k, n, end)
        elif mode == BEYOND:
            event, s = returning(start, k, n, end)
        elif mode == PRESSED:
            event, s = releasing(start, k, n, end)
        if event != NO_EVENT:
            if event == UNSOLVED:
                return event, k, 0.0
            found, where, end = event, k, s
        if shafts[k].eta != 1.0:
            event, s = turning(start, k, n, end)
            if event == UNSOLVED:
                return event, k, 0.0
            if event != NO_EVENT:
                found, where, end = event, k, s
    for i in range(masses.size):
        if masses[i].first == i:
            event, s = friction(start, i, h, n, end)
            if event != NO_EVENT:
                if event == UNSOLVED:
                    return event, i, 0.0
                found, where, end = event, i, s
    if masses[0].curves != 0:
        for i in range(masses.size):
            event, s = next_point(start, i, h, n, end)
            if event != NO_EVENT:
                if event == UNSOLVED:
                    return event, i, 0.0
                found, where, end = event, i, s
    load = start.place.load
    target = p.target
    speed = masses[load].speed
    if math.isnan(x.start_time) and not cannot_change_by(speed, n, target - masses[load].w):
        set_line(start.f, speed, n, target, -1.0)
        s = first_root(start.f, n, end, 0, ROUNDING * target, 0.0)
        if s < NONE:
            return UNSOLVED, load, 0.0
        if s >= 0.0:
            found, where, end = REACHED, load, s
    return found, where, end


# the largest torque ---------------------------------------------------------------------------------

SAME = 1e-12  # peaks that differ by less are equal but for rounding


@inlined
def keep_peak(shaft: Record, torque: float, time: float) -> None:
    """Note a candidate for the largest |T|; of those equal but for rounding the first has the time."""
    largest = abs(shaft.peak)
    if abs(torque) > largest:
        if abs(torque) > largest * (1.0 + SAME):
            shaft.peak_time = time
        shaft.peak = torque


@inlined
def peak_within(start: Start, k: int, n: int, end: float, t: float, h: float) -> bool:
    """Note the largest |T| of shaft k up to `end` if it is above the largest so far; False if it is lost."""
    shaft = start.shafts[k]
    f, torque = start.f, shaft.torque
    total = 0.0
    for o in range(1, n + 1):
        total += abs(torque[o])
    if abs(torque[0]) + total <= abs(shaft.peak):
        return True
    keep_peak(shaft, torque[0], t)
    keep_peak(shaft, value(torque, n, end), t + end * h)
    if end == 0.0:
        return True
    for which in range(2):
        sign = 1.0 - 2.0 * which
        begin = 0.0
        while True:
            # where it rises above the largest so far
            for o in range(n + 1):
                f[o] = -sign * torque[o]
            f[0] += abs(shaft.peak) * (1.0 + ROUNDING)
            above = first_root(f, n, end, 0, 0.0, 0.0) if begin == 0.0 else crossing(f, 0, n, begin, end)
            if above < NONE:
                return False
            if above < 0.0:
                break
            # and the extreme behind it
            for o in range(n):
                f[o] = sign * (o + 1.0) * torque[o + 1]
            f[n] = 0.0
            top = crossing(f, 0, n - 1, above, end)
            if top < NONE:
                return False
            if top < 0.0:
                break  # it rises to the end, which is noted
            highest = value(torque, n, top)
            if sign * highest <= abs(shaft.peak):
                break
            keep_peak(shaft, highest, t + top * h)
            begin = top
    return True
