"""The motion within one span, in closed form.

Between two events the twist coordinate z obeys one linear equation,

    z'' + 2 zeta z' + w0^2 z = A + B s + E exp(-lambda s),

with w0 = zeta = 0 while the gap is open. The right-hand side is the motor torque after slew limiter
(linear) and lag (exponential) plus the load torque, over the inertias. `prepare` computes the
coefficients once a span, `motion` evaluates z and z' at any s; under-, over- and critically damped
springs and a lag that resonates with the damping run through the same smooth formulas.

Where the lag is far longer than the span, A, B s and E exp(-lambda s) are far larger than their sum. There
`write_without_cancelling` turns to what the right-hand side and its slope are at the start,

    f0 + f1 s + E chi(s),   chi(s) = exp(-lambda s) - 1 + lambda s,

of which no part is larger than the whole. Where the torque rises far faster than the spring can answer, a
power series takes over, since the particular solution B s/w0^2 is far larger than the motion. With viscous
friction of motor or load the twist depends on their speeds as well: `coupled` has the series of all three.
"""

from __future__ import annotations

import math

from softstart.plant.coupled import coupled_derivatives, coupled_motion
from softstart.plant.jit import compiled, inlined
from softstart.plant.layout import Motion, Pair, Triple

# how the response to the exponential is computed
NO_EXPONENTIAL, PARTICULAR, REAL_ROOTS, NEAR_TRIPLE = 0.0, 1.0, 2.0, 3.0

# the right-hand side as A + B s + E exp(-lambda s), as f0 + f1 s + E chi(s), that by a power series, and
# as the power series of `coupled`
IN_PARTS, FROM_START, SERIES, COUPLED = 0.0, 1.0, 2.0, 3.0
SERIES_TERMS = 24  # lambda s may be up to 1


@inlined
def prepare(
    m: Motion, z0: float, v0: float, k: float, dd: float, w0sq: float, w0: float, inverse_w0sq: float,
    zeta: float, a: float, b: float, e: float, rate: float,
) -> None:  # fmt: skip
    """Coefficients of the span that starts at (z0, v0); a, b, e are accelerations, rate = lambda."""
    m.z0 = z0
    m.v0 = v0
    m.A = a
    m.B = b
    m.E = e
    m.rate = rate
    m.k = k
    m.dd = dd
    m.form = IN_PARTS
    if k == 0.0:
        m.free = 1.0
        m.w0sq = 0.0
        m.zeta = 0.0
        return
    m.free = 0.0
    m.w0sq = w0sq
    m.w0 = w0
    m.zeta = zeta
    if zeta == 0.0:
        q = w0sq
        m.root_q = w0
    else:
        q = w0sq - zeta * zeta
        m.root_q = math.sqrt(abs(q))
    m.q = q
    p1 = b * inverse_w0sq
    p0 = (a - 2.0 * zeta * p1) * inverse_w0sq
    m.p0 = p0
    m.p1 = p1
    m.y0 = z0 - p0
    m.yv0 = v0 - p1
    m.p2 = 0.0
    if e == 0.0:
        m.branch = NO_EXPONENTIAL
        return
    # the particular solution E exp(-lambda s)/resonance serves unless lambda is (nearly) a decay rate
    shift = zeta - rate
    resonance = shift * shift + q
    if q > 1e-4 * w0sq or abs(resonance) > 1e-3 * (w0sq + rate * rate):
        m.branch = PARTICULAR
        p2 = e / resonance
        m.p2 = p2
        m.y0 -= p2
        m.yv0 += rate * p2
    else:
        m.branch = REAL_ROOTS if -q > 1e-4 * w0sq else NEAR_TRIPLE


@compiled
def remainders(x: float) -> Triple:
    """Of the series of exp(-x), x >= 0, what follows its first two, three and four terms, without sign."""
    if x > 1.0:
        second = x + math.expm1(-x)
        third = 0.5 * x * x - second
        return second, third, x * x * x / 6.0 - third
    fourth = 1.0
    for n in range(22, 4, -1):
        fourth = 1.0 - x / n * fourth
    fourth *= x * x * x * x / 24.0
    third = x * x * x / 6.0 - fourth
    return 0.5 * x * x - third, third, fourth


@compiled
def write_without_cancelling(m: Motion, f0: float, f1: float, series: bool) -> None:
    """The right-hand side by its value f0 and its slope f1 at the start; see the head of this file."""
    m.f0 = f0
    m.f1 = f1
    if series:
        m.form = SERIES
        return
    if m.free == 0.0:
        if m.branch != PARTICULAR:
            return  # nor does a lag that meets a decay rate of the spring cancel
        # chi has the particular solution (chi + beta chi' + constant)/w0^2
        inverse = 1.0 / m.w0sq
        rate = m.rate
        shift = m.zeta - rate
        beta = -(m.zeta + shift) / (shift * shift + m.q)
        m.p3 = m.E * inverse
        m.p4 = m.p3 * beta
        m.p1 = f1 * inverse
        bent = rate * rate * m.p3
        m.p0 = (f0 - 2.0 * m.zeta * m.p1 - bent * (1.0 + beta * (m.zeta + shift))) * inverse
        m.y0 = m.z0 - m.p0
        m.yv0 = m.v0 - m.p1 - rate * rate * m.p4
    m.form = FROM_START


@compiled
def slow_part(m: Motion, s: float) -> Triple:
    """Of the particular solution to E chi(s), what is not constant, and its first two derivatives."""
    rate = m.rate
    x = rate * s
    chi, _, _ = remainders(x)
    slope = -rate * math.expm1(-x)
    bend = rate * rate * math.exp(-x)
    return (
        m.p3 * chi + m.p4 * slope,
        m.p3 * slope + m.p4 * bend,
        (m.p3 - rate * m.p4) * bend,
    )


@compiled
def motion_from_start(m: Motion, s: float) -> Pair:
    """Z and z' at s where the right-hand side is written from its start."""
    if m.form == COUPLED:
        return coupled_motion(m, s)
    rate = m.rate
    if m.form == SERIES:
        before, this = m.z0, m.v0  # the n-th and the next derivative at 0, times s^n/n!
        z, v = m.z0, m.v0
        power = 1.0
        forcing = m.E
        for n in range(SERIES_TERMS):
            push = m.f0 if n == 0 else m.f1 if n == 1 else forcing
            before, this = this, push - 2.0 * m.zeta * this - m.w0sq * before
            power *= s / (n + 1.0)
            z += before * power
            v += this * power
            forcing *= -rate
            if n > 3 and abs(this * power) <= 1e-18 * abs(v) and abs(before * power) <= 1e-18 * abs(z):
                break
        return z, v
    if m.free != 0.0:
        _, third, fourth = remainders(rate * s)
        z = m.z0 + s * (m.v0 + s * (0.5 * m.f0 + s * (m.f1 / 6.0))) + m.E * (fourth / rate) / rate
        return z, m.v0 + s * (m.f0 + 0.5 * s * m.f1) + m.E * third / rate
    cos, sin = decaying_pair(m.zeta, m.q, m.root_q, s)
    slow, speed, _ = slow_part(m, s)
    z = m.y0 * cos + (m.yv0 + m.zeta * m.y0) * sin + m.p0 + m.p1 * s + slow
    return z, m.yv0 * cos - (m.zeta * m.yv0 + m.w0sq * m.y0) * sin + m.p1 + speed


@compiled
def forcing_from_start(m: Motion, s: float) -> Triple:
    """The right-hand side at s, and its first two derivatives, where it is written from its start."""
    if m.E == 0.0:
        return m.f0 + m.f1 * s, m.f1, 0.0
    x = m.rate * s
    chi, _, _ = remainders(x)
    bend = m.rate * m.rate * m.E * math.exp(-x)
    return m.f0 + m.f1 * s + m.E * chi, m.f1 - m.rate * m.E * math.expm1(-x), bend


@inlined
def decaying_pair(zeta: float, q: float, root_q: float, s: float) -> Pair:
    """exp(-zeta s) cos(sqrt(q) s) and exp(-zeta s) sin(sqrt(q) s)/sqrt(q), smooth through q = 0."""
    x = q * s * s
    if x > 1e-6:
        decay = math.exp(-zeta * s) if zeta != 0.0 else 1.0
        angle = root_q * s
        return decay * math.cos(angle), decay * math.sin(angle) / root_q
    if x < -1e-6:
        # exp(-zeta s) cosh: written with the two decay rates, so that neither overflows
        slow = math.exp(-(zeta * zeta + q) / (zeta + root_q) * s) if zeta > 0.0 else math.exp(root_q * s)
        fast = math.exp(-(zeta + root_q) * s)
        return 0.5 * (slow + fast), 0.5 * (slow - fast) / root_q
    decay = math.exp(-zeta * s)
    return (
        decay * (1.0 - x / 2.0 + x * x / 24.0),
        decay * s * (1.0 - x / 6.0 + x * x / 120.0),
    )


@compiled
def exponential_response(m: Motion, s: float) -> Pair:
    """Z and z' from rest under E exp(-lambda s) alone, where lambda meets a decay rate of the spring."""
    e = m.E
    rate = m.rate
    zeta = m.zeta
    q = m.q
    tail = math.exp(-rate * s)
    if m.branch == REAL_ROOTS:
        root = m.root_q
        slow = -m.w0sq / (zeta + root)
        fast = -(zeta + root)
        x = (slow + rate) * s
        if x > 600.0:  # exp(x) would overflow, where exp(-lambda s) is long gone
            g_slow = math.exp(slow * s) / (slow + rate)
        else:
            g_slow = tail * s * (math.expm1(x) / x if abs(x) > 1e-8 else 1.0 + 0.5 * x)
        x = (fast + rate) * s
        g_fast = tail * s * (math.expm1(x) / x if abs(x) > 1e-8 else 1.0 + 0.5 * x)
        half = e / (2.0 * root)
        return half * (g_slow - g_fast), half * (slow * g_slow - fast * g_fast)
    if rate * s > 700.0:
        return 0.0, 0.0
    # All three rates within a few percent: exp(-lambda s) J(s), where J = int_0^s exp(-shift y) S(y) dy
    # solves J'' + 2 shift J' + resonance J = 1 from rest; its power series converges at once.
    shift = zeta - rate
    resonance = shift * shift + q
    before = 0.0
    this = 0.5
    power = s * s
    term = total = 0.5 * power
    total_rate = s
    for n in range(2, 200):
        after = (-2.0 * shift * n * this - resonance * before) / ((n + 1.0) * n)
        before = this
        this = after
        total_rate += (n + 1.0) * this * power
        power *= s
        last = term
        term = this * power
        total += term
        if abs(last) + abs(term) <= 1e-18 * abs(total):  # every other term is 0 where shift is
            break
    return e * tail * total, e * tail * (total_rate - rate * total)


@inlined
def motion(m: Motion, s: float) -> Pair:
    """Z and z' at s."""
    if m.form != IN_PARTS:
        return motion_from_start(m, s)
    if m.free != 0.0:
        z = m.z0 + s * (m.v0 + s * (0.5 * m.A + s * (m.B / 6.0)))
        v = m.v0 + s * (m.A + 0.5 * s * m.B)
        e = m.E
        if e != 0.0:
            x = m.rate * s
            e1 = -math.expm1(-x)
            v += e * e1 / m.rate
            if x > 0.02:
                z += e * (x - e1) / (m.rate * m.rate)
            else:  # x - (1 - exp(-x)) without cancellation
                z += e * s * s * (0.5 - x * (1 / 6 - x * (1 / 24 - x * (1 / 120 - x * (1 / 720 - x / 5040)))))
        return z, v
    cos, sin = decaying_pair(m.zeta, m.q, m.root_q, s)
    slope = m.yv0 + m.zeta * m.y0
    y = m.y0 * cos + slope * sin
    yv = m.yv0 * cos - (m.zeta * m.yv0 + m.w0sq * m.y0) * sin
    z = y + m.p0 + m.p1 * s
    v = yv + m.p1
    if m.E != 0.0:
        if m.branch == PARTICULAR:
            tail = m.p2 * math.exp(-m.rate * s)
            z += tail
            v -= m.rate * tail
        else:
            dz, dv = exponential_response(m, s)
            z += dz
            v += dv
    return z, v


@inlined
def forcing_tail(m: Motion, s: float) -> float:
    """E exp(-lambda s), what is left of the torque lag."""
    if m.E == 0.0 or s == 0.0:
        return m.E
    return m.E * math.exp(-m.rate * s)


@inlined
def derivatives(m: Motion, s: float, z: float, v: float, tail: float) -> Triple:
    """z'', z''' and z'''' at s, from the equation of motion."""
    if m.form != IN_PARTS:
        if m.form == COUPLED:
            return coupled_derivatives(m, s)
        f, rise, bend = forcing_from_start(m, s)
        a = f - 2.0 * m.zeta * v - m.w0sq * z
        jerk = rise - 2.0 * m.zeta * a - m.w0sq * v
        return a, jerk, bend - 2.0 * m.zeta * jerk - m.w0sq * a
    a = m.A + m.B * s + tail - 2.0 * m.zeta * v - m.w0sq * z
    jerk = m.B - m.rate * tail - 2.0 * m.zeta * a - m.w0sq * v
    snap = m.rate * m.rate * tail - 2.0 * m.zeta * jerk - m.w0sq * a
    return a, jerk, snap
