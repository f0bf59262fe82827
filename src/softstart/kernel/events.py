"""The event that ends a span: gaps that close and open, damping regimes, friction, the target speed.

Events are first roots of Taylor polynomials on [0, 1], certified: at x, with f > 0 and |f'''| <= M3 up to the
end, `f(x + d) >= f + f' d + f'' d^2/2 - M3 d^3/6`, so a step up to which this is above zero provably passes
no zero of f. The steps shrink onto a simple zero, always from the left. The largest torque of each shaft is
located in the same way, never read off a grid.
"""

from __future__ import annotations

import math

from numba import types

from softstart.arrays import Vector
from softstart.kernel.jit import separately_compiled, inner
from softstart.kernel.records import (
    BACK, BEYOND, BREAK_BACK, BREAK_FORWARD, CONTACT, DEAD_ZONE, DOUBLED, EXIT, JOINED, LET_GO, LOWER,
    MODELICA, NO_EVENT, OPEN, POINT_ABOVE, POINT_BELOW, PRESSED, REACHED, REJOIN, RELEASE, SETTLE, SLOWED,
    STOP, SWITCH, TRAVELLED, TURNED, UNSOLVED, UPPER, WORK_TYPE, Record,
)  # fmt: skip
from softstart.kernel.series import gear_friction

_I, _F = types.int64, types.float64
NONE = -1.0
LOST = -2.0  # the iteration did not end: reported as an error, never passed over
EPS = 2.220446049250313e-16
MAX_STEPS = 20_000
CLEARLY = 1e4  # what is above so many times its rounding is not zero
FAINT = 1e-10  # a leading coefficient below this share of what follows is taken for rounding
LOST_IN = 1e-21  # and a value: it moves no root by more than that share of the span


@inner
def value(f: Vector, n: int, x: float) -> float:
    """The polynomial f_0 + ... + f_n x^n."""
    square = x * x  # even and odd powers apart: each step waits for the one before it
    even, odd = 0.0, 0.0
    top = n - n % 2
    if top < n:
        odd = f[n]
    for i in range(top, 0, -2):
        even = even * square + f[i]
        odd = odd * square + f[i - 1]
    return even * square + f[0] + odd * x


@inner
def safe_step(y: float, dy: float, bend: float, third: float, room: float) -> float:
    """A step d <= room up to which y + dy x + bend x^2/2 - third x^3/6 is certainly above zero."""
    reach = room
    step = 0.0
    for _ in range(3):
        most = third * reach / 3.0 - bend  # -f'' in the mean, up to `reach`
        if most <= 0.0:
            last = reach if dy >= 0.0 or y + dy * reach >= 0.0 else -y / dy
        else:
            root = math.sqrt(dy * dy + 2.0 * most * y)
            last = 2.0 * y / (root - dy) if dy < 0.0 else (root + dy) / most
        if last >= reach:
            return reach
        if last <= 1.5 * step:
            return max(last, step)
        step = last
        reach = math.sqrt(step * reach)
    return step


@separately_compiled(types.float64(WORK_TYPE, _I, _I, _F, _F))
def crossing(s: Record, low: int, n: int, begin: float, end: float) -> float:
    """First x in [begin, end] at which s.f/x^low falls through zero; it is positive, or rises, at `begin`."""
    f = s.f
    third = 0.0
    power = 1.0
    for i in range(3, n - low + 1):
        third += i * (i - 1) * (i - 2) * abs(f[low + i]) * power
        power *= end
    x = begin
    for _ in range(MAX_STEPS):
        y = f[n]
        dy = 0.0
        bend = 0.0  # half of f''
        size = abs(y)  # of its terms: rounding is in proportion
        for i in range(n - 1, low - 1, -1):
            bend = bend * x + dy
            dy = dy * x + y
            y = y * x + f[i]
            size = size * x + abs(f[i])
        if y <= EPS * size:
            if dy < 0.0:
                return x
            # it touches zero, or leaves it: beyond the next instant at which it is surely above
            most = third * (end - x) / 3.0 - 2.0 * bend
            if most <= 0.0:
                return NONE
            x += max(2.0 * dy / most, 2.0 * math.sqrt(EPS * size / most), EPS * end)
        else:
            step = safe_step(y, dy, 2.0 * bend, third, end - x)
            if x + step >= end:
                return NONE
            if x + step <= x:
                return x
            x += step
        if x > end:
            return NONE
    return LOST


@separately_compiled(types.float64(WORK_TYPE, _I, _F, _I, _F, _F))
def first_root(s: Record, n: int, end: float, zeros: int, noise: float, faint: float) -> float:
    """First x in [0, end] at which the event function f = s.f falls below zero.

    The first `zeros` coefficients are zero by the nature of what has just happened, unless f_0 clearly is
    not, where speeds have jumped. Of the others `noise` (of f_0) and `faint` (of the rest) say what may be
    rounding. Where f begins at zero it is divided by powers of x, and the first coefficient that counts says
    whether it falls at once.
    """
    f = s.f
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
    return crossing(s, low, n, 0.0, end)


@inner
def event_at(x: float, kind: int, event: int, end: float) -> tuple[int, float]:
    """The first event and its instant: `kind` at the root x if there is one, else `event` at `end`."""
    if event == UNSOLVED or x < NONE:
        return UNSOLVED, 0.0
    return (kind, x) if x >= 0.0 else (event, end)


# events of shafts -----------------------------------------------------------------------------------

ROUNDING = 4.0 * EPS
# a flank that is touched with an overlap below this share of the gap is grazed: no contact
GRAZE = 1e-9
# impacts that pile up within this share of a span are over: the accumulation time is known
PILED_UP = 1e-9
# flanks as elastic as this may bounce indefinitely: once they rise by this share of the gap they rest
ELASTIC, FLAT = 0.999, 1e-12
# `zeros` of a contact whose torque has just come back: it begins at zero
REJOINED = 3


@inner
def deviation_bound(f: Vector, n: int) -> float:
    """How far a polynomial is from its beginning at most."""
    total = 0.0
    for o in range(1, n + 1):
        total += abs(f[o])
    return total * (1.0 + 1e-12)


@inner
def set_line(f: Vector, series: Vector, n: int, constant: float, factor: float) -> None:
    """F = constant + factor * series."""
    for o in range(n + 1):
        f[o] = factor * series[o]
    f[0] += constant


@inner
def rounding_of_torque(s: Record, k: int) -> float:
    """Rounding errors of c times the overlap."""
    return ROUNDING * s.c[k] * (abs(s.theta[k]) + s.half_gap[k])


@inner
def influence(s: Record, i: int) -> float:
    """The torques on the body of mass i over its inertia."""
    return s.torque_scale[s.body[i]] / s.body_J[s.body[i]]


@inner
def rounding_of_twist(s: Record, k: int, h: float) -> float:
    """Rounding errors of the accelerations beside shaft k, as a share of its twist within the span."""
    return 1e-14 * h * h * (influence(s, k) + influence(s, k + 1))


@inner
def faint_torque(s: Record, k: int, h: float, noise: float) -> float:
    """What these errors are in the torque of the shaft, to first order: c z and d z'.

    Of `first_root` of s.f, which asks for it only where f begins at zero.
    """
    if s.f[0] > CLEARLY * noise or h == 0.0:
        return 0.0
    return (s.c[k] + s.d[k] / h) * rounding_of_twist(s, k, h)


@inner
def flanks(s: Record, k: int, h: float, n: int, end: float) -> tuple[int, float]:
    """The flank of an open gap that is reached first, or the end of impacts that pile up on one."""
    half_gap, theta = s.half_gap[k], s.theta[k]
    twist = s.twist[k]
    if deviation_bound(twist, n) < half_gap - abs(theta):
        return NO_EVENT, end
    faint = rounding_of_twist(s, k, h)
    if s.rigid[k] != 0.0 and s.leading_zeros[k] == 0 and abs(theta) == half_gap and half_gap > 0.0:
        side = math.copysign(1.0, theta)
        rebound = -side * twist[1]
        press = side * twist[2]
        e = s.restitution[k]
        if press > faint and rebound >= 0.0:
            flat = e > ELASTIC and rebound * rebound <= 8.0 * press * FLAT * half_gap
            if flat or rebound <= PILED_UP * (1.0 - e) * press:
                return SETTLE, 0.0
    event = NO_EVENT
    for which in range(2):
        side = 1.0 - 2.0 * which
        zeros = s.leading_zeros[k] if s.side[k] == side else 0
        set_line(s.f, twist, n, half_gap, -side)
        x = first_root(s, n, end, zeros, ROUNDING * half_gap, faint)
        event, end = event_at(x, UPPER if which == 0 else LOWER, event, end)
    return event, end


@inner
def set_damping_excess(s: Record, k: int, n: int, sign: float) -> None:
    """F = sign (c z - d z') of a contact, which says where `modelica` caps the damping."""
    for o in range(n + 1):
        s.f[o] = sign * (s.c[k] * s.twist[k, o] - s.d[k] * (s.speed[k, o] - s.speed[k + 1, o]))
    s.f[0] -= sign * s.c[k] * s.spring_zero[k]


@inner
def parting(s: Record, k: int, h: float, n: int, end: float) -> tuple[int, float]:
    """The instant at which flanks in contact part, or at which the damping regime changes."""
    side = s.side[k]
    event = NO_EVENT
    rejoined = s.leading_zeros[k] == REJOINED
    zeros = 1 if rejoined else 0
    noise = rounding_of_torque(s, k)
    if s.law[k] == MODELICA and s.d[k] > 0.0:
        doubled = s.mode[k] == DOUBLED
        set_damping_excess(s, k, n, -side if doubled else side)
        x = first_root(s, n, end, 0 if rejoined else s.leading_zeros[k], noise, faint_torque(s, k, h, noise))
        event, end = event_at(x, SWITCH, event, end)
        if doubled:
            return event, end
        set_line(s.f, s.torque[k], n, 0.0, side)
        faint = faint_torque(s, k, h, noise)
    elif s.law[k] != DEAD_ZONE and s.d[k] > 0.0:
        if deviation_bound(s.torque[k], n) < side * s.torque[k, 0]:
            return NO_EVENT, end
        set_line(s.f, s.torque[k], n, 0.0, side)
        faint = faint_torque(s, k, h, noise)
    else:
        if deviation_bound(s.twist[k], n) < side * s.theta[k] - s.half_gap[k]:
            return NO_EVENT, end
        set_line(s.f, s.twist[k], n, -s.half_gap[k], side)
        noise, faint = ROUNDING * s.half_gap[k], rounding_of_twist(s, k, h)
    return event_at(first_root(s, n, end, zeros, noise, faint), EXIT, event, end)


@inner
def returning(s: Record, k: int, h: float, n: int, end: float) -> tuple[int, float]:
    """From overlapping flanks without torque: the torque comes back, or they part."""
    side = s.side[k]
    for o in range(n + 1):
        s.f[o] = -side * (s.c[k] * s.twist[k, o] + s.d[k] * (s.speed[k, o] - s.speed[k + 1, o]))
    s.f[0] += s.c[k] * s.half_gap[k]
    noise = rounding_of_torque(s, k)
    x = first_root(s, n, end, s.leading_zeros[k], noise, faint_torque(s, k, h, noise))
    event, end = event_at(x, REJOIN, NO_EVENT, end)
    set_line(s.f, s.twist[k], n, -s.half_gap[k], side)
    x = first_root(s, n, end, 0, ROUNDING * s.half_gap[k], rounding_of_twist(s, k, h))
    return event_at(x, BACK, event, end)


@inner
def releasing(s: Record, k: int, n: int, end: float) -> tuple[int, float]:
    """Rigid flanks part when they would have to pull."""
    if deviation_bound(s.torque[k], n) < s.side[k] * s.torque[k, 0]:
        return NO_EVENT, end
    set_line(s.f, s.torque[k], n, 0.0, s.side[k])
    noise = 1e-14 * s.torque_scale[s.body[k]]
    return event_at(first_root(s, n, end, 0, noise, noise), RELEASE, NO_EVENT, end)


@inner
def turning(s: Record, k: int, h: float, n: int, end: float) -> tuple[int, float]:
    """The instant at which the torque of a shaft that may pull changes its sign."""
    pulls = s.mode[k] == CONTACT and s.law[k] == DEAD_ZONE and s.d[k] > 0.0
    if not pulls and s.mode[k] != JOINED:
        return NO_EVENT, end
    set_line(s.f, s.torque[k], n, 0.0, s.sign[k])
    noise = s.c[k] * (abs(s.theta[k]) + s.half_gap[k]) + s.d[k] * (abs(s.w[k]) + abs(s.w[k + 1]))
    # a twist near 0 has the rounding of those before it
    noise = ROUNDING * (noise + s.torque_scale[s.body[k]])
    x = first_root(s, n, end, s.leading_zeros[k], noise, faint_torque(s, k, h, noise))
    return event_at(x, TURNED, NO_EVENT, end)


# friction, brake, the target speed, and the first of all --------------------------------------------


@inner
def friction(s: Record, i: int, h: float, n: int, end: float) -> tuple[int, float]:
    """Breakaway or stop of the body that begins with mass i, or that its torque lets the brake go."""
    noise = ROUNDING * (s.torque_scale[i] + s.friction_limit[i])
    event = NO_EVENT
    if s.braked != 0.0 and s.body[s.at_motor] == i:
        if s.release_at < math.inf:  # released by time
            return event, end
        if s.toward * s.net_torque[i, 0] >= -noise:  # a torque that just holds the load is proved
            return LET_GO, 0.0
        set_line(s.f, s.net_torque[i], n, 0.0, -s.toward)
        return event_at(first_root(s, n, end, 0, noise, noise), LET_GO, event, end)
    if s.friction_count[i] == 0:
        return event, end
    if s.stuck[i] != 0:
        room = s.friction_limit[i] - abs(s.net_torque[i, 0])
        if s.lossy_gears[i] == 0 and deviation_bound(s.net_torque[i], n) < room:
            return event, end
        for which in range(2):
            set_line(s.f, s.net_torque[i], n, s.friction_limit[i], -1.0 + 2.0 * which)
            if s.lossy_gears[i] != 0:
                for o in range(n + 1):
                    s.f[o] += gear_friction(s, i, 1.0 - 2.0 * which, o)
            # an excess that `first_root` would pass over in the speed of the body, once let go, is none
            if s.f[0] < 0.0 and s.f[0] >= -FAINT * deviation_bound(s.f, n):
                s.f[0] = 0.0
            x = first_root(s, n, end, 0, noise, noise)
            event, end = event_at(x, BREAK_FORWARD if which == 0 else BREAK_BACK, event, end)
        return event, end
    j = i
    while s.has_friction[j] == 0.0:
        j += 1
    reach = deviation_bound(s.speed[i], n)
    if reach < s.direction[j] * s.w[i]:
        return event, end
    set_line(s.f, s.speed[i], n, 0.0, s.direction[j])
    if abs(s.f[0]) <= LOST_IN * reach:  # of a body let go within rounding: what follows decides
        s.f[0] = 0.0
    faint = 1e-14 * h * (s.torque_scale[i] + s.friction_limit[i]) / s.body_J[i]
    return event_at(first_root(s, n, end, 0, 0.0, faint), STOP, event, end)


@inner
def next_point(s: Record, i: int, h: float, n: int, end: float) -> tuple[int, float]:
    """The next point of its load curve that mass i passes: the torque is continuous there, its slope not."""
    angular = s.by_angle[i] != 0.0
    faint = 1e-14 * h * influence(s, i) * (h if angular else 1.0)
    event = NO_EVENT
    for which in range(2):
        sign = 1.0 - 2.0 * which
        piece = s.piece[i] if which == 0 else s.piece[i] - 1
        if piece < 0 or piece >= s.points[i]:
            continue
        point = s.at[i, piece]
        if angular:
            set_line(s.f, s.rotation[i], n, sign * point, -sign)
        else:
            set_line(s.f, s.speed[i], n, sign * point, -sign)
        zeros = 1 if s.passed[i] == -sign else 0
        if zeros == 0 and deviation_bound(s.f, n) < s.f[0]:
            continue
        x = first_root(s, n, end, zeros, ROUNDING * abs(point), faint)
        event, end = event_at(x, POINT_ABOVE if which == 0 else POINT_BELOW, event, end)
    return event, end


@inner
def event_of_shaft(s: Record, k: int, h: float, n: int, end: float) -> tuple[int, float]:
    """The next event of shaft k by its mode."""
    mode = s.mode[k]
    event = NO_EVENT
    if mode == OPEN:
        event, end = flanks(s, k, h, n, end)
    elif mode in (CONTACT, DOUBLED):
        event, end = parting(s, k, h, n, end)
    elif mode == BEYOND:
        event, end = returning(s, k, h, n, end)
    elif mode == PRESSED:
        event, end = releasing(s, k, n, end)
    if s.eta[k] != 1.0 and event != UNSOLVED:
        turned, end = turning(s, k, h, n, end)
        if turned != NO_EVENT:
            event = turned
    return event, end


@separately_compiled(types.int64(WORK_TYPE, _F, _I))
def next_event(s: Record, h: float, n: int) -> int:
    """The first event of the span, at the shaft or mass `s.event_place` and its share `s.event_share`."""
    first = NO_EVENT
    s.event_place, s.event_share = 0, 1.0
    for k in range(s.n - 1):
        event, x = event_of_shaft(s, k, h, n, s.event_share)
        if event != NO_EVENT:
            first, s.event_place, s.event_share = event, k, x
        if event == UNSOLVED:
            return first
    for i in range(s.n):
        if s.body[i] == i and (s.friction_count[i] != 0 or s.braked != 0.0):
            event, x = friction(s, i, h, n, s.event_share)
            # the friction of a gear goes with the sign of its torque: at one instant that turns first
            if event != NO_EVENT and (event == UNSOLVED or first != TURNED or x < s.event_share):
                first, s.event_place, s.event_share = event, i, x
            if event == UNSOLVED:
                return first
        if s.points[i] > 0:
            event, x = next_point(s, i, h, n, s.event_share)
            if event != NO_EVENT:
                first, s.event_place, s.event_share = event, i, x
            if event == UNSOLVED:
                return first
    load = s.at_load
    if math.isnan(s.start_time) and deviation_bound(s.speed[load], n) >= s.target - s.toward * s.w[load]:
        set_line(s.f, s.speed[load], n, s.target, -s.toward)
        x = first_root(s, n, s.event_share, 0, ROUNDING * s.target, 0.0)
        first, s.event_share = event_at(x, REACHED, first, s.event_share)
        if first == REACHED:
            s.event_place = load
    if not math.isnan(s.slow) and first != UNSOLVED:
        set_line(s.f, s.speed[s.at_motor], n, -s.slow, s.toward)
        x = first_root(s, n, s.event_share, 0, ROUNDING * s.target, 0.0)
        first, s.event_share = event_at(x, SLOWED, first, s.event_share)
    if not math.isnan(s.travel_end) and first != UNSOLVED:
        set_line(s.f, s.angle_u, n, s.travel_end, -s.toward)
        x = first_root(s, n, s.event_share, 0, ROUNDING * abs(s.travel_end), 0.0)
        first, s.event_share = event_at(x, TRAVELLED, first, s.event_share)
    return first


# the largest torque ---------------------------------------------------------------------------------

SAME = 1e-12  # peaks that differ by less are equal but for rounding


@inner
def keep_peak(s: Record, k: int, torque: float, time: float) -> None:
    """Note a candidate for the largest |T|; of those equal but for rounding the first has the time."""
    largest = abs(s.peak[k])
    if abs(torque) > largest:
        if abs(torque) > largest * (1.0 + SAME):
            s.peak_time[k] = time
        s.peak[k] = torque


@separately_compiled(types.int64(WORK_TYPE, _I, _I, _F, _F))
def peak_within(s: Record, k: int, n: int, end: float, h: float) -> int:
    """Note the largest |T| of shaft k up to `end` if it is above the largest so far; 0 if it is lost."""
    f, torque = s.f, s.torque[k]
    if abs(torque[0]) + deviation_bound(torque, n) <= abs(s.peak[k]):
        return 1
    keep_peak(s, k, torque[0], s.time)
    keep_peak(s, k, value(torque, n, end), s.time + end * h)
    bend = 0.0
    for o in range(2, n + 1):
        bend += o * abs(torque[o])
    if end == 0.0 or bend * (1.0 + 1e-12) < abs(torque[1]):
        return 1  # it rises or falls all the way
    for which in range(2):
        sign = 1.0 - 2.0 * which
        begin = 0.0
        while True:
            # where it rises above the largest so far
            set_line(f, torque, n, abs(s.peak[k]) * (1.0 + ROUNDING), -sign)
            above = first_root(s, n, end, 0, 0.0, 0.0) if begin == 0.0 else crossing(s, 0, n, begin, end)
            if above < NONE:
                return 0
            if above < 0.0:
                break
            # and the extreme behind it
            for o in range(n):
                f[o] = sign * (o + 1.0) * torque[o + 1]
            f[n] = 0.0
            top = crossing(s, 0, n - 1, above, end)
            if top < NONE:
                return 0
            if top < 0.0:
                break  # it rises to the end, which is noted
            highest = value(torque, n, top)
            if sign * highest <= abs(s.peak[k]):
                break
            keep_peak(s, k, highest, s.time + top * h)
            begin = top
    return 1
