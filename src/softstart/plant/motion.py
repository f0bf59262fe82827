"""The motion within one span, in closed form.

Between two events the twist coordinate z obeys one linear equation,

    z'' + 2 zeta z' + w0^2 z = A + B s + E exp(-lambda s),

with w0 = zeta = 0 while the gap is open. The right-hand side is the motor torque after slew limiter
(linear) and lag (exponential) plus the load torque, over the inertias. `prepare` computes the
coefficients once a span, `motion` evaluates z and z' at any s; under-, over- and critically damped
springs and a lag that resonates with the damping run through the same smooth formulas.
"""

from __future__ import annotations

import math

from softstart.plant.jit import compiled, inlined
from softstart.plant.layout import Motion, Pair, Triple

# how the response to the exponential is computed
NO_EXPONENTIAL, PARTICULAR, REAL_ROOTS, NEAR_TRIPLE = 0.0, 1.0, 2.0, 3.0


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
    a = m.A + m.B * s + tail - 2.0 * m.zeta * v - m.w0sq * z
    jerk = m.B - m.rate * tail - 2.0 * m.zeta * a - m.w0sq * v
    snap = m.rate * m.rate * tail - 2.0 * m.zeta * jerk - m.w0sq * a
    return a, jerk, snap
