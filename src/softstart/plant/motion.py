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
from softstart.plant.layout import (
    BRANCH, DD, FA, FB, FE, FREE, K, LAMBDA, P0, P1, P2, Q, ROOT_Q, V0, W0, W0SQ, Y0, YV0, Z0, ZETA,
    Pair, Triple, Vector,
)  # fmt: skip

# how the response to the exponential is computed
NO_EXPONENTIAL, PARTICULAR, REAL_ROOTS, NEAR_TRIPLE = 0.0, 1.0, 2.0, 3.0


@inlined
def prepare(
    m: Vector, z0: float, v0: float, k: float, dd: float, w0sq: float, w0: float, inverse_w0sq: float,
    zeta: float, a: float, b: float, e: float, rate: float,
) -> None:  # fmt: skip
    """Coefficients of the span that starts at (z0, v0); a, b, e are accelerations, rate = lambda."""
    m[Z0] = z0
    m[V0] = v0
    m[FA] = a
    m[FB] = b
    m[FE] = e
    m[LAMBDA] = rate
    m[K] = k
    m[DD] = dd
    if k == 0.0:
        m[FREE] = 1.0
        m[W0SQ] = 0.0
        m[ZETA] = 0.0
        return
    m[FREE] = 0.0
    m[W0SQ] = w0sq
    m[W0] = w0
    m[ZETA] = zeta
    if zeta == 0.0:
        q = w0sq
        m[ROOT_Q] = w0
    else:
        q = w0sq - zeta * zeta
        m[ROOT_Q] = math.sqrt(abs(q))
    m[Q] = q
    p1 = b * inverse_w0sq
    p0 = (a - 2.0 * zeta * p1) * inverse_w0sq
    m[P0] = p0
    m[P1] = p1
    m[Y0] = z0 - p0
    m[YV0] = v0 - p1
    m[P2] = 0.0
    if e == 0.0:
        m[BRANCH] = NO_EXPONENTIAL
        return
    # the particular solution E exp(-lambda s)/resonance serves unless lambda is (nearly) a decay rate
    shift = zeta - rate
    resonance = shift * shift + q
    if q > 1e-4 * w0sq or abs(resonance) > 1e-3 * (w0sq + rate * rate):
        m[BRANCH] = PARTICULAR
        p2 = e / resonance
        m[P2] = p2
        m[Y0] -= p2
        m[YV0] += rate * p2
    else:
        m[BRANCH] = REAL_ROOTS if -q > 1e-4 * w0sq else NEAR_TRIPLE


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
def exponential_response(m: Vector, s: float) -> Pair:
    """Z and z' from rest under E exp(-lambda s) alone, where lambda meets a decay rate of the spring."""
    e = m[FE]
    rate = m[LAMBDA]
    zeta = m[ZETA]
    q = m[Q]
    tail = math.exp(-rate * s)
    if m[BRANCH] == REAL_ROOTS:
        root = m[ROOT_Q]
        slow = -m[W0SQ] / (zeta + root)
        fast = -(zeta + root)
        x = (slow + rate) * s
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
def motion(m: Vector, s: float) -> Pair:
    """Z and z' at s."""
    if m[FREE] != 0.0:
        z = m[Z0] + s * (m[V0] + s * (0.5 * m[FA] + s * (m[FB] / 6.0)))
        v = m[V0] + s * (m[FA] + 0.5 * s * m[FB])
        e = m[FE]
        if e != 0.0:
            x = m[LAMBDA] * s
            e1 = -math.expm1(-x)
            v += e * e1 / m[LAMBDA]
            if x > 0.02:
                z += e * (x - e1) / (m[LAMBDA] * m[LAMBDA])
            else:  # x - (1 - exp(-x)) without cancellation
                z += e * s * s * (0.5 - x * (1 / 6 - x * (1 / 24 - x * (1 / 120 - x * (1 / 720 - x / 5040)))))
        return z, v
    cos, sin = decaying_pair(m[ZETA], m[Q], m[ROOT_Q], s)
    slope = m[YV0] + m[ZETA] * m[Y0]
    y = m[Y0] * cos + slope * sin
    yv = m[YV0] * cos - (m[ZETA] * m[YV0] + m[W0SQ] * m[Y0]) * sin
    z = y + m[P0] + m[P1] * s
    v = yv + m[P1]
    if m[FE] != 0.0:
        if m[BRANCH] == PARTICULAR:
            tail = m[P2] * math.exp(-m[LAMBDA] * s)
            z += tail
            v -= m[LAMBDA] * tail
        else:
            dz, dv = exponential_response(m, s)
            z += dz
            v += dv
    return z, v


@inlined
def forcing_tail(m: Vector, s: float) -> float:
    """E exp(-lambda s), what is left of the torque lag."""
    if m[FE] == 0.0 or s == 0.0:
        return m[FE]
    return m[FE] * math.exp(-m[LAMBDA] * s)


@inlined
def derivatives(m: Vector, s: float, z: float, v: float, tail: float) -> Triple:
    """z'', z''' and z'''' at s, from the equation of motion."""
    a = m[FA] + m[FB] * s + tail - 2.0 * m[ZETA] * v - m[W0SQ] * z
    jerk = m[FB] - m[LAMBDA] * tail - 2.0 * m[ZETA] * a - m[W0SQ] * v
    snap = m[LAMBDA] * m[LAMBDA] * tail - 2.0 * m[ZETA] * jerk - m[W0SQ] * a
    return a, jerk, snap
