"""Undamped contacts under constant torque: closed formulas, and what repeats is not computed again."""

from __future__ import annotations

import math

from softstart.plant.crossing import LOST, NO_CROSSING
from softstart.plant.jit import compiled, inlined
from softstart.plant.layout import (
    ASK_ON_GAP, CONTACTS, EVENTS, EXIT, FA, GAP, GAP_EVENTS, INV_J, J1, K, LAST_V, LOAD, MC, MEMO_DONE,
    MEMO_P, MEMO_S, MEMO_V, MEMO_W, NO_EVENT, P0, PHI2, REACTIVE, SIDE, STAGE, STAGE_PEAK_TIME,
    STAGE_START, START_TIME, STEADY, TARGET, TIME, V0, W0, W0SQ, W2, Y0, Z0, Septuple, Vector,
)  # fmt: skip

# A flank touched with an overlap below this share of the gap is grazed, not hit: from theta = -gap/2 the
# drive comes back to that flank with zero speed after each rebound, and rounding alone would decide.
GRAZE = 1e-12


@inlined
def steady_exit(m: Vector, horizon: float) -> tuple[int, float]:
    """[G](15): y = rho cos(w0 s - alpha) falls back to -p0 at w0 s = alpha + acos(-p0/rho)."""
    w0 = m[W0]
    v0 = m[V0]
    if m[Z0] == 0.0:
        if v0 <= 0.0:
            return (NO_EVENT, horizon) if (v0 == 0.0 and m[P0] > 0.0) else (EXIT, 0.0)
        speed = v0
        if v0 != m[MEMO_V] or m[P0] != m[MEMO_P] or w0 != m[MEMO_W]:
            m[MEMO_V] = v0
            m[MEMO_P] = m[P0]
            m[MEMO_W] = w0
            m[MEMO_DONE] = 0.0
            m[MEMO_S] = 2.0 * math.atan2(v0, -w0 * m[P0]) / w0
        s = m[MEMO_S]
    else:
        reach = v0 * v0 + m[W0SQ] * m[Z0] * (m[Z0] - 2.0 * m[P0])  # w0^2 (rho^2 - p0^2)
        if reach <= 0.0:
            return NO_EVENT, horizon
        speed = math.sqrt(reach)
        s = (math.atan2(v0, w0 * m[Y0]) + math.atan2(speed, -w0 * m[P0])) / w0
        s = max(s, 0.0)  # rounding, on the very flank
    if s >= horizon:
        return NO_EVENT, horizon
    m[LAST_V] = -speed
    return EXIT, s


@inlined
def largest_gain(p: Vector, m: Vector, load: Septuple, contact: float) -> float:
    """How much load speed a contact from flank to flank can gain at most on its way, Mc >= 0.

    At its end it has gained `gain`; before, w2 was higher only by what Mc takes while T < Mc at the end. From
    there back z grows at least as v0 s as long as z < P0, so this lasts Mc/(c v0) at most.
    """
    level = p[MC] / m[K]
    if level > m[P0]:
        return max(0.0, load[1] * contact) + load[4] * (math.sqrt(m[V0] ** 2 + m[W0SQ] * m[Y0] ** 2) + m[V0])
    gain = load[1] * contact + 2.0 * load[4] * m[V0]
    return max(0.0, gain) - load[6] * level / m[V0]


@compiled
def bounce(p: Vector, x: Vector, m: Vector, load: Septuple, until: float) -> int:
    """Contact and flight repeat while nothing else happens: take them in one stride; returns how many.

    Called at the start of a contact whose twin has been gone through before (MEMO). Each line is the
    arithmetic that the spans would do one by one, in the same order: a recorded start has the same bits.
    """
    v0 = m[V0]
    a = m[FA]
    if a <= 0.0 or v0 * v0 - 2.0 * a * p[GAP] > -2.0 * a * GRAZE * p[GAP]:
        return 0  # the flight reaches the other flank
    contact = m[MEMO_S]
    flight = -2.0 * -v0 / a
    slope = load[6]
    share = p[J1] * p[INV_J]
    swing = abs(load[4]) * (math.sqrt(v0 * v0 + m[W0SQ] * m[Y0] * m[Y0]) + v0)
    rise = largest_gain(p, m, load, contact)
    fall = min(0.0, load[1] * contact) - swing
    push = contact * contact * (0.5 * load[1] + contact * load[2] / 6.0)
    done = 0
    while True:
        t = x[TIME]
        w2 = x[W2]
        if not contact < until - t or (math.isnan(x[START_TIME]) and w2 + rise >= p[TARGET]):
            return done
        if p[REACTIVE] != 0.0 and w2 + fall <= 0.0:
            return done
        parted = t + contact
        if not flight < until - parted:
            return done
        after = w2 + contact * (load[1] + 0.5 * contact * load[2]) - load[4] * (-v0 - v0)
        met = after + flight * slope
        if p[REACTIVE] != 0.0 and met <= 0.0:
            return done
        x[PHI2] += contact * (w2 + share * v0) + push
        x[PHI2] += flight * (after + 0.5 * flight * slope)
        x[W2] = met
        x[TIME] = parted + flight
        x[STAGE] += 2.0
        x[STAGE_START] = x[TIME]
        x[STAGE_PEAK_TIME] = x[TIME]
        x[EVENTS] += 2.0
        x[GAP_EVENTS] += 2.0
        x[CONTACTS] += 1.0
        done += 1


@inlined
def repeats(p: Vector, x: Vector, m: Vector) -> bool:
    """The span that begins is a contact like the last one, and no controller waits for gap events."""
    return (
        m[MEMO_DONE] != 0.0
        and m[STEADY] != 0.0
        and m[Z0] == 0.0
        and m[V0] > 0.0
        and m[V0] == m[MEMO_V]
        and m[P0] == m[MEMO_P]
        and m[W0] == m[MEMO_W]
        and x[SIDE] > 0.0
        and x[LOAD] > 0.0
        and x[ASK_ON_GAP] == 0.0
        and p[MC] >= 0.0
    )


@compiled
def steady_target(m: Vector, load: Septuple, target: float, end: float) -> float:
    """First instant at which the load has its target speed, in a contact from flank to flank (end).

    The load gains speed while T > Mc, one stretch around the peak of T at end/2. Before the peak w2 is
    convex there, behind it concave: Newton's method, begun at the peak, runs to the only crossing from one
    side, whichever half it lies in.
    """
    w0 = m[W0]
    s = 0.5 * end
    z = m[P0] + math.sqrt(m[P0] * m[P0] + m[V0] * m[V0] / m[W0SQ])
    v = 0.0
    direction = 0.0
    for step_number in range(100):
        if step_number > 0:
            sin = math.sin(w0 * s)
            cos = math.cos(w0 * s)
            z = m[P0] * (1.0 - cos) + m[V0] / w0 * sin
            v = m[P0] * w0 * sin + m[V0] * cos
        short = target - (load[0] + load[1] * s + load[4] * (m[V0] - v))
        gain = load[5] * m[K] * z + load[6]
        if gain <= 0.0:
            return NO_CROSSING
        step = short / gain
        if direction == 0.0:
            direction = math.copysign(1.0, step)
        if step * direction <= 0.0 or s + step == s:
            return s
        s += step
        if s >= end:
            return NO_CROSSING
    return LOST
