"""One span: the motion between two instants, and the event that ends it.

`torque_course` and `begin_span` turn the state into the coefficients of the motion; `next_event` finds the
earliest event within the horizon. Every event that has just fired is masked, so that a start on the
switching surface does not fire it for ever.
"""

from __future__ import annotations

import math

from softstart.plant.crossing import RISING, WATCH, first_crossing
from softstart.plant.jit import inlined
from softstart.plant.layout import (
    BACK, BEYOND, BREAKAWAY, BROKE_AWAY, C, D, DD, DEAD_ZONE, DEMAND, DEMAND_SLOPE, DOUBLED, END_KNOWN, EXIT,
    FA, GAP, GRAZE_LOWER, GRAZE_UPPER, INV_J, INV_J1, INV_J2, INV_W0SQ, J1, K, LAG, LAST_V, LAW, LEFT_BEYOND,
    LEFT_LOWER, LEFT_UPPER, LOAD, LOWER, MASK, MC, MODELICA, NO_EVENT, PASSING, RATE, REACHED, REACTIVE,
    REF, REJOIN, SIDE, SLEW_END, START_TIME, STEADY, STOP, SWITCH, SWITCHED, TARGET, THETA, U, UA, UB,
    UE, UNSOLVED, UPPER, V, V0, W0SQ, W0SQ_SLIP, W0_SLIP, W2, Y0, Z0, Septuple, Vector,
)  # fmt: skip
from softstart.plant.motion import derivatives, forcing_tail, motion, prepare
from softstart.plant.steady import GRAZE, largest_gain, steady_exit, steady_target


@inlined
def torque_course(p: Vector, x: Vector, m: Vector) -> None:
    """The motor torque of the span: u(s) = ua + ub s + ue exp(-s/lag), after slew limiter and lag.

    The demand is a line, DEMAND + DEMAND_SLOPE s. A slew limiter that is not on it runs towards it at its
    rate and meets it at SLEW_END; one that is on it follows, unless the line is too steep.
    """
    demand = x[DEMAND]
    ub = x[DEMAND_SLOPE]
    m[SLEW_END] = math.inf
    if x[REF] != demand:
        if p[RATE] < math.inf:
            away = demand - x[REF]
            slope = ub
            ub = math.copysign(p[RATE], away)
            if slope == 0.0:
                m[SLEW_END] = away / ub
            elif (ub - slope) * away > 0.0:
                m[SLEW_END] = away / (ub - slope)
        else:
            x[REF] = demand
    elif abs(ub) > p[RATE]:
        ub = math.copysign(p[RATE], ub)
    ua = x[REF] - ub * p[LAG]
    ue = 0.0
    if p[LAG] > 0.0:
        ue = x[U] - ua
        if abs(ue) <= 1e-16 * (abs(ua) + abs(x[U])):
            ue = 0.0
    else:
        x[U] = ua
    m[UA] = ua
    m[UB] = ub
    m[UE] = ue


@inlined
def begin_span(p: Vector, x: Vector, m: Vector) -> Septuple:
    """Coefficients of the motion from the state x on; returns those of the load speed."""
    ua = m[UA]
    ub = m[UB]
    ue = m[UE]
    rate = 1.0 / p[LAG] if p[LAG] > 0.0 else 0.0
    m[LAST_V] = math.nan
    m[END_KNOWN] = 0.0
    m[PASSING] = math.nan
    side = x[SIDE]
    stuck = x[LOAD] == 0.0
    a = ua * p[INV_J1]
    b = ub * p[INV_J1]
    e = ue * p[INV_J1]
    friction = x[LOAD] * p[MC]
    if not stuck:
        a += friction * p[INV_J2]
    m[STEADY] = 0.0
    if side == 0.0:
        prepare(m, x[THETA], x[V], 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, a, b, e, rate)
        side = 1.0
    else:
        k = p[C]
        dd = p[D]
        if x[DOUBLED] != 0.0:
            k *= 2.0
            dd = 0.0
        w0sq, w0, inverse_w0sq = p[W0SQ_SLIP], p[W0_SLIP], p[INV_W0SQ]
        inverse_inertia = p[INV_J1] + p[INV_J2]
        if stuck or x[DOUBLED] != 0.0:
            if stuck:
                inverse_inertia = p[INV_J1]
            w0sq = k * inverse_inertia
            w0 = math.sqrt(w0sq)
            inverse_w0sq = 1.0 / w0sq
        if dd == 0.0 and ub == 0.0 and ue == 0.0:
            m[STEADY] = 1.0
        z0 = side * x[THETA] - 0.5 * p[GAP]
        zeta = 0.5 * dd * inverse_inertia
        prepare(m, z0, side * x[V], k, dd, w0sq, w0, inverse_w0sq, zeta, side * a, side * b, side * e, rate)
    if stuck:
        return (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    inverse = p[INV_J]
    return (
        x[W2], (ua - friction) * inverse, ub * inverse, ue * inverse,
        side * p[J1] * inverse, side * p[INV_J2], -friction * p[INV_J2],
    )  # fmt: skip


@inlined
def time_to_flank(distance: float, v: float, a: float, just_left: bool, tolerance: float) -> float:
    """First s > 0 with v s + a s^2/2 = distance >= 0, inf without one; no cancellation, no 0/0."""
    if distance <= 0.0:
        if not just_left and (v > 0.0 or (v == 0.0 and a > 0.0)):
            return 0.0
        return -2.0 * v / a if (v < 0.0 and a > 0.0) else math.inf
    square = v * v + 2.0 * a * distance
    if a < 0.0 and square <= -2.0 * a * tolerance:
        return math.inf
    root = math.sqrt(square)
    if v >= 0.0:
        return 2.0 * distance / (v + root) if v + root > 0.0 else math.inf
    return (root - v) / a if a > 0.0 else math.inf


@inlined
def flank_event(p: Vector, x: Vector, m: Vector, load: Septuple, horizon: float) -> tuple[int, float]:
    """The flank that is reached first while the gap is open."""
    half = 0.5 * p[GAP]
    tolerance = GRAZE * p[GAP]
    if x[BEYOND] != 0.0:
        b = x[BEYOND]
        start = RISING if x[MASK] == LEFT_BEYOND else WATCH
        s = first_crossing(m, p[C] * half, -b * p[C], -b * p[D], 0.0, 0.0, load, start, 0.0, horizon)
        back = first_crossing(m, -half, b, 0.0, 0.0, 0.0, load, WATCH, 0.0, s if s >= 0.0 else horizon)
        if back >= 0.0:
            return BACK, back
        if s < -1.0 or back < -1.0:
            return UNSOLVED, 0.0
        return (REJOIN, s) if s >= 0.0 else (NO_EVENT, horizon)
    left_upper = x[MASK] == LEFT_UPPER
    left_lower = x[MASK] == LEFT_LOWER
    v = x[V]
    if m[UB] == 0.0 and m[UE] == 0.0:
        a = m[FA]
        up = time_to_flank(half - x[THETA], v, a, left_upper, tolerance)
        down = time_to_flank(half + x[THETA], -v, -a, left_lower, tolerance)
        s = min(up, down)
        if s >= horizon:
            return NO_EVENT, horizon
        if up <= down:
            m[LAST_V] = math.sqrt(max(0.0, v * v + 2.0 * a * (half - x[THETA])))
            return UPPER, up
        m[LAST_V] = -math.sqrt(max(0.0, v * v - 2.0 * a * (half + x[THETA])))
        return LOWER, down
    start = RISING if left_upper else WATCH
    up = first_crossing(m, half, -1.0, 0.0, 0.0, 0.0, load, start, 0.0, horizon)
    start = RISING if left_lower else WATCH
    down = first_crossing(m, half, 1.0, 0.0, 0.0, 0.0, load, start, 0.0, up if up >= 0.0 else horizon)
    if up < -1.0 or down < -1.0:
        return UNSOLVED, 0.0
    if up < 0.0 and down < 0.0:
        return NO_EVENT, horizon
    lower = down >= 0.0
    s = down if lower else up
    sign = -1.0 if lower else 1.0
    z, v = motion(m, s)
    a, _, _ = derivatives(m, s, z, v, forcing_tail(m, s))
    if p[GAP] > 0.0 and sign * a < 0.0 and v * v <= -2.0 * sign * a * tolerance:
        return (GRAZE_LOWER if lower else GRAZE_UPPER), s
    return (LOWER if lower else UPPER), s


@inlined
def exit_event(p: Vector, x: Vector, m: Vector, load: Septuple, horizon: float) -> tuple[int, float]:
    """The instant at which the flanks part (or the damping regime of `modelica` changes)."""
    modelica = p[LAW] == MODELICA and p[D] > 0.0
    if modelica:
        sign = 1.0 if x[DOUBLED] != 0.0 else -1.0
        start = RISING if x[MASK] == SWITCHED else WATCH
        s = first_crossing(m, 0.0, -sign * p[C], sign * p[D], 0.0, 0.0, load, start, 0.0, horizon)
        if s < -1.0:
            return UNSOLVED, 0.0
        if x[DOUBLED] != 0.0:
            return (SWITCH, s) if s >= 0.0 else (NO_EVENT, horizon)
        out = first_crossing(m, 0.0, m[K], m[DD], 0.0, 0.0, load, WATCH, 0.0, s if s >= 0.0 else horizon)
        if out >= 0.0:
            return EXIT, out
        return (SWITCH, s) if s >= 0.0 else (NO_EVENT, horizon)
    if m[STEADY] != 0.0:
        return steady_exit(m, horizon)
    if p[LAW] != DEAD_ZONE and m[DD] > 0.0:
        s = first_crossing(m, 0.0, m[K], m[DD], 0.0, 0.0, load, WATCH, 0.0, horizon)
    else:
        s = first_crossing(m, 0.0, 1.0, 0.0, 0.0, 0.0, load, WATCH, 0.0, horizon)
    if s < -1.0:
        return UNSOLVED, 0.0
    return (EXIT, s) if s >= 0.0 else (NO_EVENT, horizon)


@inlined
def load_event_open(p: Vector, x: Vector, load: Septuple) -> tuple[int, float]:
    """Stop of the load or target speed while the gap is open: the load speed is linear then."""
    slope = load[6]
    if x[LOAD] == 0.0 or slope == 0.0:
        return NO_EVENT, math.inf
    if p[REACTIVE] != 0.0:
        return STOP, max(0.0, -x[W2] / slope)
    if math.isnan(x[START_TIME]):
        s = (p[TARGET] - x[W2]) / slope
        if s >= 0.0:
            return REACHED, s
    return NO_EVENT, math.inf


@inlined
def load_event_contact(p: Vector, x: Vector, m: Vector, load: Septuple, horizon: float) -> tuple[int, float]:
    """Breakaway, stop or target speed of the load while the gap is closed."""
    event = NO_EVENT
    end = horizon
    if x[LOAD] == 0.0:
        s = first_crossing(m, p[MC], -m[K], -m[DD], 0.0, 0.0, load, WATCH, 0.0, end)
        if s >= 0.0:
            event = BREAKAWAY
            end = s
        if p[LAW] == DEAD_ZONE and m[DD] > 0.0 and s >= -1.0:
            s = first_crossing(m, p[MC], m[K], m[DD], 0.0, 0.0, load, WATCH, 0.0, end)
            if s >= 0.0:
                event = BREAKAWAY
                end = s
        return (event, end) if s >= -1.0 else (UNSOLVED, 0.0)
    low = -math.inf
    high = math.inf
    if m[STEADY] != 0.0:
        # how far the load speed can swing at all: most spans need no search
        swing = abs(load[4]) * (math.sqrt(m[V0] * m[V0] + m[W0SQ] * m[Y0] * m[Y0]) + abs(m[V0]))
        low = x[W2] + min(0.0, load[1] * end) - swing
        high = x[W2] + max(0.0, load[1] * end) + swing
    s = -1.0
    if p[REACTIVE] != 0.0 and (low if x[LOAD] > 0.0 else -high) <= 0.0:
        start = RISING if x[MASK] == BROKE_AWAY else WATCH
        s = first_crossing(m, 0.0, 0.0, 0.0, 0.0, x[LOAD], load, start, 0.0, end)
        if s >= 0.0:
            event = STOP
            end = s
    if s >= -1.0 and high >= p[TARGET] and math.isnan(x[START_TIME]):
        flank_to_flank = event == NO_EVENT and m[Z0] == 0.0 and not math.isnan(m[LAST_V])
        if flank_to_flank and x[SIDE] > 0.0 and x[LOAD] > 0.0:
            if p[MC] < 0.0 or x[W2] + largest_gain(p, m, load, end) >= p[TARGET]:
                s = steady_target(m, load, p[TARGET], end)
            if s >= 0.0:  # no change of motion: noted on the way to the other end of the contact
                m[PASSING] = s
                s = -1.0
        else:
            s = first_crossing(m, p[TARGET], 0.0, 0.0, 0.0, -1.0, load, WATCH, 0.0, end)
        if s >= 0.0:
            event = REACHED
            end = s
    return (event, end) if s >= -1.0 else (UNSOLVED, 0.0)


@inlined
def next_event(p: Vector, x: Vector, m: Vector, load: Septuple, horizon: float) -> tuple[int, float]:
    """The event that ends this span and when, at most `horizon` from now."""
    if x[SIDE] == 0.0:
        event, s = flank_event(p, x, m, load, horizon)
        other, at = load_event_open(p, x, load)
        if at < s:
            m[LAST_V] = math.nan
            return other, at
        return event, s
    event, s = exit_event(p, x, m, load, horizon)
    if event == UNSOLVED:
        return event, s
    other, at = load_event_contact(p, x, m, load, s)
    if other != NO_EVENT:
        m[LAST_V] = math.nan
        return other, at
    return event, s
