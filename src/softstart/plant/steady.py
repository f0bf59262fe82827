"""Undamped contacts under constant torque: closed formulas, and what repeats is not computed again."""

from __future__ import annotations

import math

from softstart.plant.crossing import LOST, NO_CROSSING
from softstart.plant.jit import compiled, inlined
from softstart.plant.layout import EXIT, NO_EVENT, Motion, Plant, Septuple, State

# A flank touched with an overlap below this share of the gap is grazed, not hit: from theta = -gap/2 the
# drive comes back to that flank with zero speed after each rebound, and rounding alone would decide.
GRAZE = 1e-12


@inlined
def steady_exit(m: Motion, horizon: float) -> tuple[int, float]:
    """[G](15): y = rho cos(w0 s - alpha) falls back to -p0 at w0 s = alpha + acos(-p0/rho)."""
    w0 = m.w0
    v0 = m.v0
    if m.z0 == 0.0:
        if v0 <= 0.0:
            return (NO_EVENT, horizon) if (v0 == 0.0 and m.p0 > 0.0) else (EXIT, 0.0)
        speed = v0
        if v0 != m.memo_v or m.p0 != m.memo_p or w0 != m.memo_w:
            m.memo_v = v0
            m.memo_p = m.p0
            m.memo_w = w0
            m.memo_done = 0.0
            m.memo_s = 2.0 * math.atan2(v0, -w0 * m.p0) / w0
        s = m.memo_s
    else:
        reach = v0 * v0 + m.w0sq * m.z0 * (m.z0 - 2.0 * m.p0)  # w0^2 (rho^2 - p0^2)
        if reach <= 0.0:
            return NO_EVENT, horizon
        speed = math.sqrt(reach)
        s = (math.atan2(v0, w0 * m.y0) + math.atan2(speed, -w0 * m.p0)) / w0
        s = max(s, 0.0)  # rounding, on the very flank
    if s >= horizon:
        return NO_EVENT, horizon
    m.last_v = -speed
    return EXIT, s


@inlined
def largest_gain(p: Plant, m: Motion, load: Septuple, contact: float) -> float:
    """How much load speed a contact from flank to flank can gain at most on its way, Mc >= 0.

    At its end it has gained `gain`; before, w2 was higher only by what Mc takes while T < Mc at the end. From
    there back z grows at least as v0 s as long as z < P0, so this lasts Mc/(c v0) at most.
    """
    level = p.Mc / m.k
    if level > m.p0:
        return max(0.0, load[1] * contact) + load[4] * (math.sqrt(m.v0**2 + m.w0sq * m.y0**2) + m.v0)
    gain = load[1] * contact + 2.0 * load[4] * m.v0
    return max(0.0, gain) - load[6] * level / m.v0


@compiled
def bounce(p: Plant, x: State, m: Motion, load: Septuple, until: float) -> int:
    """Contact and flight repeat while nothing else happens: take them in one stride; returns how many.

    Called at the start of a contact whose twin has been gone through before (MEMO). Each line is the
    arithmetic that the spans would do one by one, in the same order: a recorded start has the same bits.
    """
    v0 = m.v0
    a = m.A
    if a <= 0.0 or v0 * v0 - 2.0 * a * p.gap > -2.0 * a * GRAZE * p.gap:
        return 0  # the flight reaches the other flank
    contact = m.memo_s
    flight = -2.0 * -v0 / a
    slope = load[6]
    share = p.J1 * p.inv_J
    swing = abs(load[4]) * (math.sqrt(v0 * v0 + m.w0sq * m.y0 * m.y0) + v0)
    rise = largest_gain(p, m, load, contact)
    fall = min(0.0, load[1] * contact) - swing
    push = contact * contact * (0.5 * load[1] + contact * load[2] / 6.0)
    done = 0
    while True:
        t = x.time
        w2 = x.w2
        if not contact < until - t or (math.isnan(x.start_time) and w2 + rise >= p.target):
            return done
        if p.reactive != 0.0 and w2 + fall <= 0.0:
            return done
        parted = t + contact
        if not flight < until - parted:
            return done
        after = w2 + contact * (load[1] + 0.5 * contact * load[2]) - load[4] * (-v0 - v0)
        met = after + flight * slope
        if p.reactive != 0.0 and met <= 0.0:
            return done
        x.phi2 += contact * (w2 + share * v0) + push
        x.phi2 += flight * (after + 0.5 * flight * slope)
        x.w2 = met
        x.time = parted + flight
        x.stage += 2.0
        x.stage_start = x.time
        x.stage_peak_time = x.time
        x.events += 2.0
        x.gap_events += 2.0
        x.contacts += 1.0
        done += 1


@inlined
def repeats(p: Plant, x: State, m: Motion) -> bool:
    """The span that begins is a contact like the last one, and no controller waits for gap events."""
    return (
        m.memo_done != 0.0
        and m.steady != 0.0
        and m.z0 == 0.0
        and m.v0 > 0.0
        and m.v0 == m.memo_v
        and m.p0 == m.memo_p
        and m.w0 == m.memo_w
        and x.side > 0.0
        and x.load > 0.0
        and x.ask_on_gap == 0.0
        and p.Mc >= 0.0
        and p.friction == 0.0
    )


@compiled
def steady_target(m: Motion, load: Septuple, target: float, end: float) -> float:
    """First instant at which the load has its target speed, in a contact from flank to flank (end).

    The load gains speed while T > Mc, one stretch around the peak of T at end/2. Before the peak w2 is
    convex there, behind it concave: Newton's method, begun at the peak, runs to the only crossing from one
    side, whichever half it lies in.
    """
    w0 = m.w0
    s = 0.5 * end
    z = m.p0 + math.sqrt(m.p0 * m.p0 + m.v0 * m.v0 / m.w0sq)
    v = 0.0
    direction = 0.0
    for step_number in range(100):
        if step_number > 0:
            sin = math.sin(w0 * s)
            cos = math.cos(w0 * s)
            z = m.p0 * (1.0 - cos) + m.v0 / w0 * sin
            v = m.p0 * w0 * sin + m.v0 * cos
        short = target - (load[0] + load[1] * s + load[4] * (m.v0 - v))
        gain = load[5] * m.k * z + load[6]
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
