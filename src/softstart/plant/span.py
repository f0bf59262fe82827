"""One span: the motion between two instants, and the event that ends it.

`torque_course` and `begin_span` turn the state into the coefficients of the motion; `next_event` finds the
earliest event within the horizon. Every event that has just fired is masked, so that a start on the
switching surface does not fire it indefinitely.
"""

from __future__ import annotations

import math

from numba import from_dtype, types

from softstart.plant.coupled import begin_coupled
from softstart.plant.crossing import (
    LOST, NO_CROSSING, RISING, ROUNDING, WATCH, bounds, first_crossing,
)  # fmt: skip
from softstart.plant.jit import apart, inlined
from softstart.plant.layout import (
    BACK, BREAKAWAY, BROKE_AWAY, DEAD_ZONE, EXIT, GRAZE_LOWER, GRAZE_UPPER, LEFT_BEYOND, LEFT_LOWER,
    LEFT_UPPER, LOWER, MODELICA, MOTION, MOTOR_BACKWARD, MOTOR_FORWARD, MOTOR_STOP, NO_EVENT, PLANT, REACHED,
    REJOIN, REJOINED, RELEASE, STATE, STOP,
    SWITCH, SWITCHED, UNSOLVED, UPPER,
    Motion, Plant, Septuple, State,
)  # fmt: skip
from softstart.plant.motion import (
    COUPLED, derivatives, forcing_tail, motion, prepare, remainders, write_without_cancelling,
)  # fmt: skip
from softstart.plant.exchange import shaft_torque
from softstart.plant.steady import GRAZE, largest_gain, steady_exit, steady_target
from softstart.plant.terms import MAX_STEPS

MUCH_LONGER = 1e3  # a lag than the slewing or than an elastic period: more digits would cancel
MUCH_FASTER = 1e4  # a torque that rises, than the spring can answer
HELD = 1e-9  # of the torques on a motor at rest: what they lack of moving it, to be more than rounding
MOST_PARTS = 1e4  # a power series needs steps no longer than the lag; so many of them at most


@inlined
def torque_course(p: Plant, x: State, m: Motion) -> None:
    """The motor torque of the span: u(s) = ua + ub s + ue exp(-s/lag), after slew limiter and lag.

    The demand is a line, DEMAND + DEMAND_SLOPE s. A slew limiter that is not on it runs towards it at its
    rate and meets it at SLEW_END; one that is on it follows, unless the line is too steep.
    """
    demand = x.demand
    ub = x.demand_slope
    m.slew_end = math.inf
    if x.ref != demand:
        if p.rate < math.inf:
            away = demand - x.ref
            slope = ub
            ub = math.copysign(p.rate, away)
            if slope == 0.0:
                m.slew_end = away / ub
            elif (ub - slope) * away > 0.0:
                m.slew_end = away / (ub - slope)
        else:
            x.ref = demand
    elif abs(ub) > p.rate:
        ub = math.copysign(p.rate, ub)
    ua = x.ref - ub * p.lag
    ue = 0.0
    if p.lag > 0.0:
        ue = x.u - ua
        if abs(ue) <= 1e-16 * (abs(ua) + abs(x.u)):
            ue = 0.0
    else:
        x.u = ua
    m.ua = ua
    m.ub = ub
    m.ue = ue
    m.slow_lag = 1.0 if lag_is_slow(p, m) else 0.0


@inlined
def lag_is_slow(p: Plant, m: Motion) -> bool:
    """Whether the lag is so long that ua, ub s and ue exp(-s/lag) cancel each other's digits."""
    return m.ue != 0.0 and (
        p.lag > MUCH_LONGER * p.period or abs(m.ub) * p.lag > MUCH_LONGER * (abs(p.u_min) + abs(p.u_max))
    )


@inlined
def series_serves(p: Plant, x: State, m: Motion, horizon: float) -> bool:
    """Whether the closed form of a short span would cancel: a slow lag, a torque too fast for the spring."""
    if x.side == 0.0 or (m.ub == 0.0 and m.slow_lag == 0.0):
        return False
    stiff = 1.0 + (x.doubled if x.doubled > 0.0 else 0.0)
    rates = math.sqrt(stiff * p.w0sq_slip) + p.d * (p.inv_J1 + p.inv_J2)  # above those of the span
    return (
        (m.slow_lag != 0.0 or abs(m.ub) > MUCH_FASTER * rates * (abs(p.u_min) + abs(p.u_max)))
        and rates * horizon < 1e-2
        and horizon < MOST_PARTS * (p.lag if p.lag > 0.0 else math.inf)
    )


@inlined
def torque_after(p: Plant, x: State, m: Motion, s: float, left: float) -> float:
    """The motor torque after s, as the span began with x; `left` is exp(-s/lag)."""
    if m.slow_lag != 0.0:
        y = s / p.lag
        return x.u + (x.ref - x.u) * -math.expm1(-y) + m.ub * p.lag * remainders(y)[0]
    return m.ua + m.ub * s + m.ue * left


@inlined
def begin_span(p: Plant, x: State, m: Motion, horizon: float) -> Septuple:
    """Coefficients of the motion from the state x on; returns those of the load speed."""
    drag = x.motor * p.friction
    ua = m.ua - drag
    ub = m.ub
    ue = m.ue
    rate = 1.0 / p.lag if p.lag > 0.0 else 0.0
    m.last_v = math.nan
    m.end_known = 0.0
    m.passing = math.nan
    side = x.side
    stuck = x.load == 0.0
    held = x.held != 0.0
    inv_J1 = 0.0 if held else p.inv_J1  # a motor that is held moves as one of infinite inertia
    a = ua * inv_J1
    b = ub * inv_J1
    e = ue * inv_J1
    friction = x.load * p.Mc
    if not stuck:
        a += friction * p.inv_J2
    m.steady = 0.0
    if p.decay1 != 0.0 or p.decay2 != 0.0:
        k, dd = 0.0, 0.0
        if side != 0.0:
            k, dd = (2.0 * p.c, 0.0) if x.doubled != 0.0 else (p.c, p.d)
        z0 = x.theta if side == 0.0 else side * x.theta - 0.5 * p.gap
        v0 = x.v if side == 0.0 else side * x.v
        prepare(m, z0, v0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, rate)
        m.form = COUPLED
        m.k = k
        m.dd = dd
        m.w0sq = k * (p.inv_J1 + p.inv_J2)
        begin_coupled(p, x, m, k, dd, drag)
        return (x.w2, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    if side == 0.0:
        prepare(m, x.theta, x.v, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, a, b, e, rate)
        side = 1.0
    else:
        k = p.c
        dd = p.d
        if x.doubled != 0.0:
            k *= 2.0
            dd = 0.0
        w0sq, w0, inverse_w0sq = p.w0sq_slip, p.w0_slip, p.inv_w0sq
        inverse_inertia = inv_J1 + p.inv_J2
        if stuck or held or x.doubled != 0.0:
            if stuck:
                inverse_inertia = inv_J1
            w0sq = k * inverse_inertia
            w0 = math.sqrt(w0sq)
            inverse_w0sq = 1.0 / w0sq if w0sq > 0.0 else 0.0
        if dd == 0.0 and ub == 0.0 and ue == 0.0 and not held:
            m.steady = 1.0
        z0 = side * x.theta - 0.5 * p.gap
        zeta = 0.5 * dd * inverse_inertia
        if w0sq > 0.0:
            prepare(
                m, z0, side * x.v, k, dd, w0sq, w0, inverse_w0sq, zeta, side * a, side * b, side * e, rate
            )
        else:  # motor held and load stuck: the twist stays as it is
            prepare(m, z0, side * x.v, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, rate)
            m.k = k
            m.dd = dd
    slope = (x.ref - x.u) * rate if p.lag > 0.0 else ub
    series = series_serves(p, x, m, horizon)
    if (m.slow_lag != 0.0 or series) and not held:
        f0 = (x.u - drag) * inv_J1
        if not stuck:
            f0 += friction * p.inv_J2
        write_without_cancelling(m, side * f0, side * slope * inv_J1, series)
    if stuck:
        return (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    if held:
        return (x.w2, 0.0, 0.0, 0.0, side, side * p.inv_J2, -friction * p.inv_J2)
    inverse = p.inv_J
    if m.slow_lag != 0.0:
        ua, ub = x.u - drag, slope
    return (
        x.w2, (ua - friction) * inverse, ub * inverse, ue * inverse,
        side * p.J1 * inverse, side * p.inv_J2, -friction * p.inv_J2,
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
def flank_event(p: Plant, x: State, m: Motion, load: Septuple, horizon: float) -> tuple[int, float]:
    """The flank that is reached first while the gap is open."""
    half = 0.5 * p.gap
    tolerance = GRAZE * p.gap
    if x.beyond != 0.0:
        b = x.beyond
        start = RISING if x.mask == LEFT_BEYOND else WATCH
        s = first_crossing(m, p.c * half, -b * p.c, -b * p.d, 0.0, 0.0, load, start, 0.0, horizon)
        back = first_crossing(m, -half, b, 0.0, 0.0, 0.0, load, WATCH, 0.0, s if s >= 0.0 else horizon)
        if back >= 0.0:
            return BACK, back
        if s < -1.0 or back < -1.0:
            return UNSOLVED, 0.0
        return (REJOIN, s) if s >= 0.0 else (NO_EVENT, horizon)
    left_upper = x.mask == LEFT_UPPER
    left_lower = x.mask == LEFT_LOWER
    v = x.v
    if m.ub == 0.0 and m.ue == 0.0 and m.form != COUPLED:
        a = m.A
        up = time_to_flank(half - x.theta, v, a, left_upper, tolerance)
        down = time_to_flank(half + x.theta, -v, -a, left_lower, tolerance)
        s = min(up, down)
        if s >= horizon:
            return NO_EVENT, horizon
        if up <= down:
            m.last_v = math.sqrt(max(0.0, v * v + 2.0 * a * (half - x.theta)))
            return UPPER, up
        m.last_v = -math.sqrt(max(0.0, v * v - 2.0 * a * (half + x.theta)))
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
    if p.gap > 0.0 and sign * a < 0.0 and v * v <= -2.0 * sign * a * tolerance:
        return (GRAZE_LOWER if lower else GRAZE_UPPER), s
    return (LOWER if lower else UPPER), s


@inlined
def exit_event(p: Plant, x: State, m: Motion, load: Septuple, horizon: float) -> tuple[int, float]:
    """The instant at which the flanks part (or the damping regime of `modelica` changes)."""
    modelica = p.law == MODELICA and p.d > 0.0
    # the search by terms would take the rounding of a torque that has just risen from zero for its fall
    begun = RISING if x.mask == REJOINED and m.by_terms != 0.0 else WATCH
    if modelica:
        sign = 1.0 if x.doubled != 0.0 else -1.0
        start = RISING if x.mask == SWITCHED else WATCH
        s = first_crossing(m, 0.0, -sign * p.c, sign * p.d, 0.0, 0.0, load, start, 0.0, horizon)
        if s < -1.0:
            return UNSOLVED, 0.0
        if x.doubled != 0.0:
            return (SWITCH, s) if s >= 0.0 else (NO_EVENT, horizon)
        out = first_crossing(m, 0.0, m.k, m.dd, 0.0, 0.0, load, begun, 0.0, s if s >= 0.0 else horizon)
        if out >= 0.0:
            return EXIT, out
        return (SWITCH, s) if s >= 0.0 else (NO_EVENT, horizon)
    if m.steady != 0.0:
        return steady_exit(m, horizon)
    if p.law != DEAD_ZONE and m.dd > 0.0:
        s = first_crossing(m, 0.0, m.k, m.dd, 0.0, 0.0, load, begun, 0.0, horizon)
    else:
        s = first_crossing(m, 0.0, 1.0, 0.0, 0.0, 0.0, load, WATCH, 0.0, horizon)
    if s < -1.0:
        return UNSOLVED, 0.0
    return (EXIT, s) if s >= 0.0 else (NO_EVENT, horizon)


@inlined
def load_event_open(p: Plant, x: State, load: Septuple) -> tuple[int, float]:
    """Stop of the load or target speed while the gap is open: the load speed is linear then."""
    slope = load[6]
    if x.load == 0.0 or slope == 0.0:
        return NO_EVENT, math.inf
    if p.reactive != 0.0:
        return STOP, max(0.0, -x.w2 / slope)
    if math.isnan(x.start_time):
        s = (p.target - x.w2) / slope
        if s >= 0.0:
            return REACHED, s
    return NO_EVENT, math.inf


@inlined
def load_event_contact(p: Plant, x: State, m: Motion, load: Septuple, horizon: float) -> tuple[int, float]:
    """Breakaway, stop or target speed of the load while the gap is closed."""
    event = NO_EVENT
    end = horizon
    if x.load == 0.0:
        s = first_crossing(m, p.Mc, -m.k, -m.dd, 0.0, 0.0, load, WATCH, 0.0, end)
        if s >= 0.0:
            event = BREAKAWAY
            end = s
        if p.law == DEAD_ZONE and m.dd > 0.0 and s >= -1.0:
            s = first_crossing(m, p.Mc, m.k, m.dd, 0.0, 0.0, load, WATCH, 0.0, end)
            if s >= 0.0:
                event = BREAKAWAY
                end = s
        return (event, end) if s >= -1.0 else (UNSOLVED, 0.0)
    low = -math.inf
    high = math.inf
    if m.steady != 0.0:
        # how far the load speed can swing at all: most spans need no search
        swing = abs(load[4]) * (math.sqrt(m.v0 * m.v0 + m.w0sq * m.y0 * m.y0) + abs(m.v0))
        low = x.w2 + min(0.0, load[1] * end) - swing
        high = x.w2 + max(0.0, load[1] * end) + swing
    s = -1.0
    if p.reactive != 0.0 and (low if x.load > 0.0 else -high) <= 0.0:
        start = RISING if x.mask == BROKE_AWAY else WATCH
        s = first_crossing(m, 0.0, 0.0, 0.0, 0.0, x.load, load, start, 0.0, end)
        if s >= 0.0:
            event = STOP
            end = s
    if s >= -1.0 and high >= p.target and math.isnan(x.start_time):
        flank_to_flank = event == NO_EVENT and m.z0 == 0.0 and not math.isnan(m.last_v) and p.friction == 0.0
        if flank_to_flank and x.side > 0.0 and x.load > 0.0:
            if p.Mc < 0.0 or x.w2 + largest_gain(p, m, load, end) >= p.target:
                s = steady_target(m, load, p.target, end)
            if s >= 0.0:  # no change of motion: noted on the way to the other end of the contact
                m.passing = s
                s = -1.0
        else:
            s = first_crossing(m, p.target, 0.0, 0.0, 0.0, -1.0, load, WATCH, 0.0, end)
        if s >= 0.0:
            event = REACHED
            end = s
    return (event, end) if s >= -1.0 else (UNSOLVED, 0.0)


@apart(
    types.float64(
        from_dtype(PLANT), from_dtype(STATE), from_dtype(MOTION), types.float64, types.float64, types.float64
    )
)
def release_event(p: Plant, x: State, m: Motion, sign: float, holds: float, end: float) -> float:
    """When the torques on a motor that is held overcome what holds it, if before `end`.

    The first zero of holds + sign (T - u) > 0, by the parabolas of `crossing`: |u''| is at most |ue|/lag^2.
    A brake (holds = 0, sign = 1) is released when the motor torque meets the shaft torque.
    """
    side = x.side
    s = 0.0
    rate = 1.0 / p.lag if p.lag > 0.0 else 0.0
    for _ in range(MAX_STEPS):
        z, v = motion(m, s)
        a, _, _ = derivatives(m, s, z, v, 0.0)
        rest = m.ue * math.exp(-rate * s)
        f, slope, most = -(m.ua + m.ub * s + rest), rate * rest - m.ub, abs(rest) * rate * rate
        scale = abs(m.ua) + abs(m.ub * s) + abs(rest) + holds
        if m.slow_lag != 0.0:
            f = -torque_after(p, x, m, s, 0.0)
            slope = (x.u - x.ref) * rate * math.exp(-rate * s) + m.ub * math.expm1(-rate * s)
            scale = abs(x.u) + abs(f)
        if side != 0.0:
            _, b2, b3, _, _ = bounds(m, s, end, z, v, 0.0)
            f += side * (m.k * z + m.dd * v)
            slope += side * (m.k * v + m.dd * a)
            most += m.k * b2 + m.dd * b3
            scale += abs(m.k * z) + abs(m.dd * v)
        f, slope = holds + sign * f, sign * slope
        if f <= ROUNDING * scale:
            return s
        root = math.sqrt(slope * slope + 2.0 * most * f)
        if slope < 0.0:
            step = 2.0 * f / (root - slope)
        elif most > 0.0:
            step = (root + slope) / most
        else:
            return NO_CROSSING
        if s + step >= end:
            return NO_CROSSING
        if s + step <= s:
            return s
        s += step
    return LOST


@inlined
def next_event(p: Plant, x: State, m: Motion, load: Septuple, horizon: float) -> tuple[int, float]:
    """The event that ends this span and when, at most `horizon` from now."""
    event, s = event_of_the_shaft(p, x, m, load, horizon)
    if x.held == 1.0 and p.release_at == math.inf and event != UNSOLVED:
        at = release_event(p, x, m, 1.0, 0.0, s)
        if at < -1.0:
            return UNSOLVED, 0.0
        if at >= 0.0:
            m.last_v = math.nan
            return RELEASE, at
    if p.friction != 0.0 and x.held != 1.0 and event != UNSOLVED:
        other, at = friction_event(p, x, m, load, s)
        if other != NO_EVENT:
            m.last_v = math.nan
            return other, at
    return event, s


@inlined
def friction_event(p: Plant, x: State, m: Motion, load: Septuple, end: float) -> tuple[int, float]:
    """The motor that its friction holds is moved, or one that slides stands still, if before `end`."""
    if x.held != 0.0:
        s = release_event(p, x, m, 1.0, p.friction, end)
        back = release_event(p, x, m, -1.0, p.friction, s if s >= 0.0 else end)
        if s < -1.0 or back < -1.0:
            return UNSOLVED, 0.0
        if back >= 0.0:
            return MOTOR_BACKWARD, back
        return (MOTOR_FORWARD, s) if s >= 0.0 else (NO_EVENT, end)
    side = x.side if x.side != 0.0 else 1.0
    start = WATCH
    if x.v + x.w2 == 0.0:  # it has just begun to slide; but an impact at this very instant may hold it
        torque = shaft_torque(p, x)
        rounding = HELD * (p.friction + abs(x.u) + abs(x.ref) + abs(torque))
        if x.motor * (x.u - torque) < p.friction - rounding:
            return MOTOR_STOP, 0.0
        start = RISING
    s = first_crossing(m, 0.0, 0.0, x.motor * side, 0.0, x.motor, load, start, 0.0, end)
    if s < -1.0:
        return UNSOLVED, 0.0
    return (MOTOR_STOP, s) if s >= 0.0 else (NO_EVENT, end)


@inlined
def event_of_the_shaft(p: Plant, x: State, m: Motion, load: Septuple, horizon: float) -> tuple[int, float]:
    """The earliest event of flanks and load."""
    if x.side == 0.0:
        event, s = flank_event(p, x, m, load, horizon)
        if m.form != COUPLED:
            other, at = load_event_open(p, x, load)
            if at < s:
                m.last_v = math.nan
                return other, at
            return event, s
    else:
        event, s = exit_event(p, x, m, load, horizon)
    if event == UNSOLVED:
        return event, s
    other, at = load_event_contact(p, x, m, load, s)
    if other != NO_EVENT:
        m.last_v = math.nan
        return other, at
    return event, s
