"""The first crossing again, for motions whose rates lie decades apart.

`crossing` bounds f'' by the energy of the motion. Where a stiff damper holds the flanks together, or a slow
lag moves a spring that has long stopped swinging, that energy is far larger than what still bends f, and its
steps become too short to arrive. Here f is written as the sum that it is,

    f = polynomial + sum of C exp(-r s) + one decaying oscillation,

with one term for each rate. A term C exp(-r x) has the second derivative r^2 C exp(-r x), which is monotone:
on [s, s + h] it is least at one of the ends, and a term that has decayed weighs nothing, however stiff it is.
The oscillation is bounded by its amplitude, or by its value now less h times the bound of its third
derivative, whichever is sharper. The sum L of these least values is a lower bound of f'' on the window, so

    f(s + x) >= f + f' x + min(L, 0) x^2/2    for 0 <= x <= h,

and the first zero of the right side, or h, is a step that passes no zero. The window is eight times the last
step, so that L follows f'' itself.

Each term also says how far rounding can move it. Below their sum N nothing is known of the sign of f:
the search keeps 2 N away from zero, so that it always gets on, and reports a crossing where f falls below N
while it certainly falls, or below -N.
"""

from __future__ import annotations

import math

from numba import from_dtype, types

from softstart.plant.jit import apart, compiled, inlined
from softstart.plant.layout import MOTION, Motion, Septuple
from softstart.plant.motion import (
    IN_PARTS, PARTICULAR, decaying_pair, derivatives, exponential_response, forcing_from_start, forcing_tail,
    motion, remainders, slow_part,
)  # fmt: skip

ROUNDING = 4.0 * 2.220446049250313e-16
MAX_STEPS = 20_000
WIDER = 8.0  # the next window, in steps
STILL = 1e-290  # a motion below this is none


@inlined
def least(weight: float, rate: float, s: float, end: float) -> float:
    """The least value of weight exp(-rate x) on [s, end]."""
    return weight * math.exp(-rate * (end if weight > 0.0 else s))


@compiled
def terms_of_slow_flight(m: Motion, c0: float, alpha: float, beta: float, s: float, end: float) -> Septuple:
    """`terms_of_flight` where the right-hand side is written from its start: f'' lies above its tangents."""
    z, v = motion(m, s)
    a, rise, bend = forcing_from_start(m, s)
    later, steeper, last = forcing_from_start(m, end)
    here, there = alpha * a + beta * rise, alpha * later + beta * steeper
    slope, slope_there = alpha * rise + beta * bend, alpha * steeper + beta * last
    lowest = min(here, there)
    if slope < 0.0 < slope_there:
        lowest = here + slope * (end - s)
    size = abs(alpha) * (abs(m.f0) + abs(a) + abs(later)) + abs(beta) * (abs(m.f1) + abs(rise) + abs(steeper))
    return (
        c0 + alpha * z + beta * v,
        alpha * v + beta * a,
        here,
        lowest - ROUNDING * size,
        max(abs(slope), abs(slope_there)),
        abs(c0) + abs(alpha) * (abs(m.z0) + abs(m.v0 * s) + abs(z)) + abs(beta) * (abs(m.v0) + abs(v)),
        abs(alpha) * (abs(m.v0) + abs(v)) + abs(beta) * (abs(m.f0) + abs(a)),
    )


@compiled
def terms_of_flight(m: Motion, c0: float, alpha: float, beta: float, s: float, end: float) -> Septuple:
    """`terms` while the gap is open: f'' is a line and one exponential, whose least value is known."""
    z, v = motion(m, s)
    a, jerk, _ = derivatives(m, s, z, v, forcing_tail(m, s))
    rate = m.rate
    rise = alpha * m.B
    fading = m.E * (alpha - beta * rate)
    e = math.exp(-rate * s)
    lowest = min(rise * s + fading * e, rise * end + fading * math.exp(-rate * end))
    if fading > 0.0 and rise > 0.0 and rate > 0.0:  # convex: the least value may lie within
        x = math.log(rate * fading / rise) / rate
        if s < x < end:
            lowest = rise * (x + 1.0 / rate)
    size = abs(alpha * m.A) + abs(beta * m.B) + abs(rise) * end + abs(fading) * e
    return (
        c0 + alpha * z + beta * v,
        alpha * v + beta * a,
        alpha * a + beta * jerk,
        alpha * m.A + beta * m.B + lowest - ROUNDING * size,
        abs(rise) + abs(rate * fading) * e,
        abs(c0) + abs(alpha) * (abs(m.z0) + abs(m.v0 * s) + abs(z)) + abs(beta) * (abs(m.v0) + abs(v)),
        abs(alpha) * (abs(m.v0) + abs(m.A * s)) + abs(beta) * (abs(m.A) + abs(m.E)),
    )


@compiled
def terms(
    m: Motion, c0: float, alpha: float, beta: float, gamma: float, kappa: float, load: Septuple, s: float,
    end: float,
) -> Septuple:  # fmt: skip
    """F, f', f'' at s, least f'' on [s, end], bound of |f'''| from s on, sizes of the terms of f, f'."""
    if m.free != 0.0:
        w2, rise = kappa * (load[0] + load[6] * s), kappa * load[6]
        if m.form != IN_PARTS:
            flight = terms_of_slow_flight(m, c0, alpha, beta, s, end)
        else:
            flight = terms_of_flight(m, c0, alpha, beta, s, end)
        f, slope, curve, lowest, third, size, steep = flight
        return f + w2, slope + rise, curve, lowest, third, size + abs(w2), steep + abs(rise)
    rate, w0sq, w0, zeta, p1 = m.rate, m.w0sq, m.w0, m.zeta, m.p1
    # w2 holds -load[4] v, see `crossing.load_speed`
    beta -= kappa * load[4]
    # the polynomial
    f = c0 + alpha * (m.p0 + p1 * s) + beta * p1
    size = abs(c0) + abs(alpha) * (abs(m.p0) + abs(p1 * s)) + abs(beta * p1)
    slope = alpha * p1
    curve = 0.0
    steep = abs(slope)
    if kappa != 0.0:
        f += kappa * (load[0] + s * (load[1] + 0.5 * s * load[2]) + load[4] * m.v0)
        slope += kappa * (load[1] + s * load[2])
        curve = kappa * load[2]
        speeds = abs(load[0]) + s * (abs(load[1]) + 0.5 * s * abs(load[2])) + abs(load[4] * m.v0)
        size += abs(kappa) * speeds
        steep += abs(kappa) * (abs(load[1]) + s * abs(load[2]))
    lowest = curve
    bent = abs(curve)
    third = 0.0
    swinging = m.q >= -0.01 * w0sq
    fast = zeta + m.root_q
    slow = w0sq / fast
    near, far = (slow, fast) if abs(rate - slow) < abs(rate - fast) else (fast, slow)
    resonant = 0.0
    p2 = m.p2
    returned = 0.0
    # what is left of the lag
    if m.E != 0.0:
        e = math.exp(-rate * s)
        if m.branch != PARTICULAR:
            resonant = m.E * e
            if not swinging:
                # the response is E/(2 root) (g_slow - g_fast) with
                # g_r = (exp(-r s) - exp(-lambda s))/(lambda - r);
                # of the far rate these are two terms, of the near one they stay together
                p2 = (0.5 if near == slow else -0.5) * m.E / (m.root_q * (rate - far))
                returned = -p2
        amount = p2 * (alpha - beta * rate + gamma * rate * rate)
        whole = abs(p2) * (abs(alpha) + abs(beta) * rate + abs(gamma) * rate * rate) * e
        bend = rate * rate * amount
        if m.form != IN_PARTS:
            d0, d1, d2 = slow_part(m, s)
            f += alpha * d0 + beta * d1 + gamma * d2
            slope += alpha * d1 + (beta - gamma * rate) * d2
            size += abs(alpha * d0) + abs(beta * d1) + abs(gamma * d2)
            steep += abs(alpha * d1) + (abs(beta) + abs(gamma) * rate) * abs(d2)
        else:
            f += amount * e
            size += whole
            steep += rate * whole
            slope -= rate * amount * e
        if kappa != 0.0 and m.slow_lag != 0.0:
            chi, third_part, _ = remainders(rate * s)
            f += kappa * load[3] * third_part / rate
            size += abs(kappa * load[3] * third_part / rate)
            slope += kappa * load[3] * chi
            steep += abs(kappa * load[3] * chi)
            curve += kappa * load[3] * rate
            lowest += kappa * load[3] * rate
            bend -= kappa * load[3] * rate
        elif kappa != 0.0:
            gained = kappa * load[3] * math.expm1(-rate * s) / rate
            f -= gained
            size += abs(gained)
            slope += kappa * load[3] * e
            steep += abs(kappa * load[3] * e)
            bend -= kappa * load[3] * rate
        curve += bend * e
        lowest += least(bend, rate, s, end)
        bent += abs(bend) * e
        third += rate * abs(bend) * e
    # the mass on the spring
    y0, yv0 = m.y0, m.yv0
    y = yv = 0.0
    if swinging:
        cos, sin = decaying_pair(zeta, m.q, m.root_q, s)
        y = y0 * cos + (yv0 + zeta * y0) * sin
        yv = yv0 * cos - (zeta * yv0 + w0sq * y0) * sin
    else:
        for i in range(2):
            r, other, sign = (slow, fast, 1.0) if i == 0 else (fast, slow, -1.0)
            amount = sign * (yv0 + other * y0) / (fast - slow)
            whole = (abs(yv0) + other * abs(y0)) / (fast - slow)
            if r == far:
                amount += returned
                whole += abs(returned)
            e = math.exp(-r * s)
            amount *= (alpha - beta * r + gamma * r * r) * e
            whole *= (abs(alpha) + abs(beta) * r + abs(gamma) * r * r) * e
            f += amount
            slope -= r * amount
            curve += r * r * amount
            lowest += r * r * amount * (math.exp(-r * (end - s)) if amount > 0.0 else 1.0)
            third += r * r * r * abs(amount)
            size += whole
            steep += r * whole
            bent += r * r * whole
    if swinging or resonant != 0.0:
        ya = yj = ys = 0.0
        if swinging:
            if resonant != 0.0:
                dz, dv = exponential_response(m, s)
                y += dz
                yv += dv
            ya = resonant - 2.0 * zeta * yv - w0sq * y
            yj = -rate * resonant - 2.0 * zeta * ya - w0sq * yv
            ys = rate * rate * resonant - 2.0 * zeta * yj - w0sq * ya
        else:  # g' = exp(-lambda s) - r g
            e = math.exp(-rate * s)
            x = (rate - near) * s
            if abs(x) > 1.0:
                y = (math.exp(-near * s) - e) / (rate - near)
            else:
                y = e * s * (math.expm1(x) / x if abs(x) > 1e-8 else 1.0 + 0.5 * x)
            amount = (0.5 if near == slow else -0.5) * m.E / m.root_q
            e *= amount
            y *= amount
            yv = e - near * y
            ya = -rate * e - near * yv
            yj = rate * rate * e - near * ya
            ys = -rate * rate * rate * e - near * yj
        f += alpha * y + beta * yv + gamma * ya
        slope += alpha * yv + beta * ya + gamma * yj
        bending = alpha * ya + beta * yj + gamma * ys
        if not swinging:
            # g is the slope of -exp(-x s) in x somewhere between r and lambda; its n-th derivative in s is at
            # most (n x^(n-1) + s x^n) exp(-x s), and s exp(-x s) is largest at s = 1/x
            low, high = min(near, rate), max(near, rate)
            whole = abs(0.5 * m.E / m.root_q)
            fading = whole * math.exp(-low * s)
            longest = s * fading if low * s > 1.0 else whole * math.exp(-1.0) / low
            b2 = high * (2.0 * fading + high * longest)
            b3 = high**2 * (3.0 * fading + high * longest)
            b4 = high**3 * (4.0 * fading + high * longest)
            b5 = high**4 * (5.0 * fading + high * longest)
            radius = (fading + high * longest) * max(1.0, w0 / high, high / w0)
            most = abs(alpha) * b2 + abs(beta) * b3 + abs(gamma) * b4
            jolt = abs(alpha) * b3 + abs(beta) * b4 + abs(gamma) * b5
        elif m.q > 0.01 * w0sq and resonant == 0.0:
            # y = Re(G exp(lambda s)) with |lambda| = w0: each derivative of f has this amplitude, times w0
            radius = math.hypot(w0 * y0, (yv0 + zeta * y0) * (w0 / m.root_q)) * math.exp(-zeta * s)
            whole = math.hypot(
                alpha - beta * zeta + gamma * (zeta * zeta - m.q), m.root_q * (beta - 2.0 * gamma * zeta)
            )
            most = w0 * radius * whole
            jolt = w0sq * radius * whole
        else:
            radius = math.hypot(yv, w0 * y)
            if resonant != 0.0:
                radius += abs(resonant) * min(1.0 / rate, end - s)
            b2 = (2.0 * zeta + w0) * radius + abs(resonant)
            b3 = 2.0 * zeta * b2 + w0sq * radius + rate * abs(resonant)
            b4 = 2.0 * zeta * b3 + w0sq * b2 + rate * rate * abs(resonant)
            b5 = 2.0 * zeta * b4 + w0sq * b3 + rate * rate * rate * abs(resonant)
            most = abs(alpha) * b2 + abs(beta) * b3 + abs(gamma) * b4
            jolt = abs(alpha) * b3 + abs(beta) * b4 + abs(gamma) * b5
        curve += bending
        lowest += max(-most, bending - jolt * (end - s))
        third += jolt
        bent += most
        whole = (abs(alpha) / w0 + abs(beta) + abs(gamma) * w0) * radius
        size += whole
        steep += w0 * whole
    return f, slope, curve, lowest - ROUNDING * bent, third, size, steep


@inlined
def crossing_by_terms(
    m: Motion, c0: float, alpha: float, beta: float, gamma: float, kappa: float, load: Septuple,
    rising: bool, begin: float, end: float,
) -> float:  # fmt: skip
    """As `crossing.first_crossing`: first s at which f falls through zero, -1 without one, -2 if lost."""
    a, b, c, d, e, f, g = load
    return search(m, c0, alpha, beta, gamma, kappa, a, b, c, d, e, f, g, 1.0 if rising else 0.0, begin, end)


@apart(types.float64(from_dtype(MOTION), *[types.float64] * 15))
def search(
    m: Motion, c0: float, alpha: float, beta: float, gamma: float, kappa: float, w2: float, by_a: float,
    by_b: float, by_e: float, ratio: float, factor: float, offset: float, begun: float, begin: float,
    end: float,
) -> float:  # fmt: skip
    """The search by terms; the load's numbers one by one."""
    load = (w2, by_a, by_b, by_e, ratio, factor, offset)
    rising = begun != 0.0
    s = begin
    window = end - begin
    shift = 0.0
    for _ in range(MAX_STEPS):
        window = min(window, end - s)
        f, slope, curve, lowest, third, size, steep = terms(
            m, c0, alpha, beta, gamma, kappa, load, s, s + window
        )
        if size <= STILL:
            return -1.0
        unknown = ROUNDING * size
        falling = slope < -ROUNDING * steep
        bend = max(0.0, -lowest)
        step = 0.0
        if rising:  # the event at `begin` has just been handled: f is zero there, whatever rounding says
            rising = False
            shift = min(f, 0.0)
            if curve > 0.0 and third > 0.0:
                # f >= f' x + f'' x^2/2 - third x^3/6; a trace of the event in f' is stepped over
                step = max(1.5 * curve / third, -4.0 * slope / curve)
            elif falling:
                return s
        f -= shift
        if step == 0.0:
            if f < -unknown or (f <= unknown and falling):
                return s
            above = max(f, 0.0) + 2.0 * unknown
            root = math.hypot(slope, math.sqrt(2.0 * bend) * math.sqrt(above))
            if slope < 0.0:
                step = 2.0 * above / (root - slope)
            else:
                step = (root + slope) / bend if bend > 0.0 else math.inf
            step = min(step, window)
            if s + step <= s < end:
                if falling:
                    return s
                step = 1e-15 * s
        s += step
        if s >= end:
            return -1.0
        window = WIDER * step
    return -2.0
