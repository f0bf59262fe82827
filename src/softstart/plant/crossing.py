"""The first crossing, certified.

Each event is the first zero of f = c0 + alpha z + beta v + gamma a + kappa w2 along a span, where
z, v, a are the twist coordinate and its derivatives and w2 is the load speed. Newton or bisection
may skip a pair of zeros; this does not. At s, with f > 0 and |f''| <= M2 from there on,

    f(s + x) >= f + f' x - M2 x^2/2,

so the first zero of the parabola is a step that provably passes no zero of f. The steps shrink
quadratically onto a simple zero, always from the left. M2 follows from the energy of the
oscillation, which damping can only lower. Far from an event a single evaluation proves that the
whole span is free of it, which is why sampled controllers cost so little.
"""

from __future__ import annotations

import math

from softstart.plant.coupled import coupled_bounds, coupled_load
from softstart.plant.jit import compiled, inlined
from softstart.plant.layout import Motion, Quintuple, Septuple
from softstart.plant.motion import (
    COUPLED, IN_PARTS, SERIES, derivatives, forcing_from_start, forcing_tail, motion, remainders, slow_part,
)  # fmt: skip
from softstart.plant.terms import crossing_by_terms

NO_CROSSING = -1.0
LOST = -2.0  # the iteration did not end: reported as an error, never passed over

# how f behaves at the start: f > 0; f = 0 and about to rise, because its event has just been handled
WATCH, RISING = 0.0, 1.0  # floats: numba would compile the search anew for a literal integer

ROUNDING = 4.0 * 2.220446049250313e-16
SHORTEST_PART, LONGER_PART = 1e-18, 1e3  # of a span that is searched part by part
PATIENCE = 2_000  # steps; most searches take fewer than ten


@compiled
def overdamped_bounds(m: Motion, s: float, end: float, y: float, yv: float, tail: float) -> Quintuple:
    """The same for two real decay rates: the energy bound would hold the fast one against the slow motion."""
    zeta = m.zeta
    w0sq = m.w0sq
    rate = m.rate
    fast = zeta + m.root_q
    slow = w0sq / fast
    apart = fast - slow
    a = abs(yv + fast * y) / apart
    b = abs(yv + slow * y) / apart
    y1 = a * slow + b * fast
    y2 = a * slow**2 + b * fast**2
    y3 = a * slow**3 + b * fast**3
    y4 = a * slow**4 + b * fast**4
    y5 = a * slow**5 + b * fast**5
    if tail > 0.0:  # what the rest of the lag adds, from rest
        length = min(1.0 / rate, end - s)
        w0 = tail * length / apart
        w1 = tail * min(length, 2.0 / apart)
        w2 = tail + 2.0 * zeta * w1 + w0sq * w0
        w3 = rate * tail + 2.0 * zeta * w2 + w0sq * w1
        w4 = rate * rate * tail + 2.0 * zeta * w3 + w0sq * w2
        w5 = rate * rate * rate * tail + 2.0 * zeta * w4 + w0sq * w3
        y1, y2, y3, y4, y5 = y1 + w1, y2 + w2, y3 + w3, y4 + w4, y5 + w5
    return y1 + abs(m.p1), y2, y3, y4, y5


@compiled
def bounds_from_start(m: Motion, s: float, end: float, z: float, v: float) -> Quintuple:
    """`bounds` where the right-hand side is written from its start."""
    if m.form == COUPLED:
        return coupled_bounds(m, end)
    rate = m.rate
    length = end - s
    f, rise, _ = forcing_from_start(m, end)
    bend = abs(m.E) * rate * rate * (math.exp(-rate * s) if m.E != 0.0 else 1.0)
    push = max(abs(m.f0), abs(f)) + abs(m.f1) * end + bend * end * end
    jolt = max(abs(m.f1), abs(rise))
    if m.free != 0.0:
        return abs(v) + push * length, push, jolt, bend, rate * bend
    w0sq = m.w0sq
    twice = 2.0 * m.zeta
    if m.form == SERIES:  # too short for the spring: z and z' hardly change but for the push
        speed = abs(v) + push * length
        y2 = push + 1.05 * (twice * speed + w0sq * (abs(z) + speed * length))
        y3 = jolt + twice * y2 + w0sq * 1.05 * speed
        y4 = bend + twice * y3 + w0sq * y2
        return 1.05 * speed, y2, y3, y4, rate * bend + twice * y4 + w0sq * y3
    slow, speed, _ = slow_part(m, s)
    y = z - m.p0 - m.p1 * s - slow
    yv = v - m.p1 - speed
    bend = abs(m.p2) * rate * rate * math.exp(-rate * s)
    most = abs(m.p1) + abs(slow_part(m, end)[1]) + abs(speed)
    if m.q < -0.01 * w0sq:
        y1, y2, y3, y4, y5 = overdamped_bounds(m, s, end, y, yv, 0.0)
        y1 -= abs(m.p1)
    else:
        y1 = math.sqrt(yv * yv + w0sq * y * y)
        y2 = (twice + m.w0) * y1
        y3 = twice * y2 + w0sq * y1
        y4 = twice * y3 + w0sq * y2
        y5 = twice * y4 + w0sq * y3
    return (y1 + most, y2 + bend, y3 + rate * bend, y4 + rate * rate * bend, y5 + rate * rate * rate * bend)


@compiled
def bounds(m: Motion, s: float, end: float, z: float, v: float, tail: float) -> Quintuple:
    """Upper bounds of |z'| to |z'''''| on [s, end]."""
    if m.form != IN_PARTS:
        return bounds_from_start(m, s, end, z, v)
    tail = abs(tail)
    rate = m.rate
    if m.free != 0.0:
        y2 = abs(m.A) + abs(m.B) * end + tail
        y3 = abs(m.B) + rate * tail
        y4 = rate * rate * tail
        return abs(v) + y2 * (end - s), y2, y3, y4, rate * y4
    y = z - m.p0 - m.p1 * s
    yv = v - m.p1
    w0sq = m.w0sq
    w0 = m.w0
    if m.q < -0.01 * w0sq:
        return overdamped_bounds(m, s, end, y, yv, tail)
    radius = math.sqrt(yv * yv + w0sq * y * y)
    if tail > 0.0:
        radius += tail * min(1.0 / rate, end - s)
    twice = 2.0 * m.zeta
    y2 = (twice + w0) * radius + tail
    y3 = twice * y2 + w0sq * radius + rate * tail
    y4 = twice * y3 + w0sq * y2 + rate * rate * tail
    y5 = twice * y4 + w0sq * y3 + rate * rate * rate * tail
    return radius + abs(m.p1), y2, y3, y4, y5


@compiled
def load_speed(m: Motion, load: Septuple, s: float, v: float) -> float:
    """w2 at s from the total momentum; load = (w2_0, a, b, e, ratio, factor, offset), see `advance`."""
    if m.form == COUPLED:
        return coupled_load(m, s, s)[0]
    w2 = load[0] + s * (load[1] + 0.5 * s * load[2]) - load[4] * (v - m.v0)
    if m.slow_lag != 0.0:
        _, third, _ = remainders(m.rate * s)
        w2 += load[3] * third / m.rate
    elif load[3] != 0.0:
        w2 -= load[3] * math.expm1(-m.rate * s) / m.rate
    return w2


@inlined
def first_crossing(
    m: Motion, c0: float, alpha: float, beta: float, gamma: float, kappa: float,
    load: Septuple, start: float, begin: float, end: float,
) -> float:  # fmt: skip
    """First s in [begin, end] at which f falls through zero, or NO_CROSSING."""
    s = crossing_within(m, c0, alpha, beta, gamma, kappa, load, start, begin, end)
    if s == LOST and m.form == COUPLED:  # M2 of the whole span is far too large at its start: begin with less
        s = NO_CROSSING
        part = begin + SHORTEST_PART * (end - begin)
        while s == NO_CROSSING and begin < end:
            s = crossing_within(m, c0, alpha, beta, gamma, kappa, load, start, begin, min(part, end))
            begin, start, part = part, WATCH, LONGER_PART * part
    return s


@compiled
def crossing_within(
    m: Motion, c0: float, alpha: float, beta: float, gamma: float, kappa: float,
    load: Septuple, start: float, begin: float, end: float,
) -> float:  # fmt: skip
    """As `first_crossing`, with one bound of f'' for the whole of [begin, end]."""
    if m.by_terms != 0.0 and m.form < SERIES:
        return crossing_by_terms(m, c0, alpha, beta, gamma, kappa, load, start != WATCH, begin, end)
    s = begin
    begun = start == WATCH
    flat = False
    origin = begin
    for _ in range(PATIENCE):
        if s == 0.0:
            z, v = m.z0, m.v0  # the state at the start needs no evaluation
        else:
            z, v = motion(m, s)
        tail = forcing_tail(m, s)
        a, jerk, snap = derivatives(m, s, z, v, tail)
        b1, b2, b3, b4, b5 = bounds(m, s, end, z, v, tail)
        f = c0 + alpha * z + beta * v + gamma * a
        slope = alpha * v + beta * a + gamma * jerk
        curve = alpha * a + beta * jerk + gamma * snap
        most = abs(alpha) * b2 + abs(beta) * b3 + abs(gamma) * b4
        third = abs(alpha) * b3 + abs(beta) * b4 + abs(gamma) * b5
        rest = abs(m.p0) if m.free == 0.0 and m.form < SERIES else 0.0
        scale = abs(c0) + abs(alpha) * (abs(z) + rest) + abs(beta * v) + abs(gamma * a)
        if kappa != 0.0 and m.form == COUPLED:
            w2, rise, bend, most_bend, most_third = coupled_load(m, s, end)
            f += kappa * w2
            slope += kappa * rise
            curve += kappa * bend
            most += abs(kappa) * most_bend
            third += abs(kappa) * most_third
            scale += abs(kappa * w2)
        elif kappa != 0.0:
            w2 = load_speed(m, load, s, v)
            f += kappa * w2
            slope += kappa * (load[5] * (m.k * z + m.dd * v) + load[6])
            curve += kappa * load[5] * (m.k * v + m.dd * a)
            most += abs(kappa * load[5]) * (m.k * b1 + m.dd * b2)
            third += abs(kappa * load[5]) * (m.k * b2 + m.dd * b3)
            scale += abs(kappa) * (abs(w2) + abs(load[4] * v))
        if flat:
            if f < -ROUNDING * scale and start == WATCH:
                return origin
            if f <= ROUNDING * scale:
                s = origin + 2.0 * (s - origin)
                if s >= end:
                    return NO_CROSSING
                continue
            flat = False
        if not begun or f <= ROUNDING * scale:
            if most == 0.0 and slope <= 0.0 and curve == 0.0:
                return s if (begun and slope < 0.0) else NO_CROSSING
            reach = 1.0 / (m.rate + math.sqrt(m.w0sq) + 1.0 / end)
            if abs(slope) <= 1e-13 * most * reach and abs(curve) <= 1e-13 * most:
                # Nothing but rounding: u and u' start from zero on a closed gap. See which way it goes.
                origin = s
                flat = True
                begun = True
                s += 1e-3 * reach
                if s >= end:
                    return NO_CROSSING
                continue
            # f is zero to rounding: falling, it crosses here; otherwise step out to where it is positive
            if begun and (slope < 0.0 or (slope == 0.0 and curve < 0.0)):
                return s
            out = slope / most if slope > 0.0 and most > 0.0 else 0.0
            if curve > 0.0 and third > 0.0:
                # rounding may have left a trace of the event just handled: step over it
                out = max(out, 1.5 * curve / third, -4.0 * slope / curve)
            elif curve > 0.0 and kappa != 0.0:  # a motor that breaks away in the gap: its jerk is constant
                out = max(out, -4.0 * slope / curve)
            if out > 0.0:
                pass
            elif slope < 0.0:
                return s
            else:
                return NO_CROSSING
            begun = True
            s += max(out, 1e-15 * end)
        else:
            root = math.sqrt(slope * slope + 2.0 * most * f)
            if slope < 0.0:
                step = 2.0 * f / (root - slope)
                if s + step <= s:
                    return s
            elif most > 0.0:
                step = (root + slope) / most
                near = s - origin
                if step < 0.1 * near and gamma == 0.0 and kappa == 0.0:
                    # M2 is far too large here, its terms cancel: bound f'' over the next stretch alone
                    local = abs(curve) + near * abs(alpha * jerk + beta * snap)
                    local += 0.5 * near * near * (abs(alpha) * b4 + abs(beta) * b5)
                    if local < most:
                        step = min(near, (slope + math.sqrt(slope * slope + 2.0 * local * f)) / local)
            else:
                return NO_CROSSING
            s += step
        if s >= end:
            return NO_CROSSING
    if m.form == COUPLED:
        return LOST
    # The rates of this start lie decades apart: from here on, and in its other spans, each has its own bound
    m.by_terms = 1.0
    if flat:
        s = origin
    return crossing_by_terms(m, c0, alpha, beta, gamma, kappa, load, not begun, s, end)
