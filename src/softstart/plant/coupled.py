"""The motion of a span with viscous friction, where the twist depends on the speeds of the masses.

With the friction b1 w1 of the motor and b2 w2 of the load, in the coordinates of the side in contact,

    z' = v = side (w1 - w2),    T = side (c z + d v),
    w1' = (u - T)/J1 - (b1/J1) w1,    w2' = (T - Mc)/J2 - (b2/J2) w2,

with T = 0 while the gap is open, w1' = 0 while the motor is held, w2' = 0 while the load is stuck. These are
three coupled linear equations under a known u(s). Their solution is its own power series, whose coefficients
follow from one another; v keeps its own series, so that it is not a difference of two speeds. In the units
(w0 z, v, w2) no row of the system's matrix has a sum above

    rho = w0 + 2 zeta + 2 (b1/J1 + b2/J2) + 1/lag,

so the n-th term of a span of the length h is at most (rho h)^n/n! of the first ones. Spans are cut at
rho h = 3/2, where the first term that is left out is below 1e-18. No rates are computed, so none can meet.
"""

from __future__ import annotations

import math

from softstart.plant.jit import compiled
from softstart.plant.layout import COUPLED_TERMS, Motion, Pair, Plant, Quintuple, State, Triple

LONGEST = 1.5  # rho h


@compiled
def begin_coupled(p: Plant, x: State, m: Motion, k: float, dd: float, drag: float) -> None:
    """The power series of the span that starts at x; `drag` is what Coulomb friction takes off the torque."""
    side = x.side if x.side != 0.0 else 1.0
    stuck, held = x.load == 0.0, x.held != 0.0
    lag = p.lag if m.ue != 0.0 else 0.0
    mobility = p.inv_J1 + p.inv_J2
    rho = math.sqrt(k * mobility) + dd * mobility + 2.0 * (p.decay1 + p.decay2)
    if lag > 0.0:
        rho += 1.0 / lag
    h = LONGEST / rho
    m.length = h
    z, v, w2 = m.z_terms, m.v_terms, m.w2_terms
    z[0], v[0], w2[0] = m.z0, m.v0, x.w2
    w1 = 0.0 if held else x.w2 + side * m.v0
    if lag > 0.0:  # u'' = (ub - u')/lag, and each further derivative is -1/lag times the last
        u, rise = x.u, (x.ref - x.u) / lag * h
        bend = 0.5 * (m.ub * h - rise) * (h / lag)
    else:
        u, rise, bend = m.ua, m.ub * h, 0.0
    push = u - drag
    against = x.load * p.Mc
    for n in range(COUPLED_TERMS - 1):
        torque = side * (k * z[n] + dd * v[n])
        a1 = 0.0 if held else (push - torque) * p.inv_J1 - p.decay1 * w1
        a2 = 0.0 if stuck else (torque - against) * p.inv_J2 - p.decay2 * w2[n]
        part = h / (n + 1.0)
        z[n + 1] = part * v[n]
        v[n + 1] = part * side * (a1 - a2)
        w2[n + 1] = part * a2
        w1 = part * a1
        against = 0.0
        if n == 0:
            push = rise
        elif n == 1:
            push = bend
        else:
            push *= -h / (n + 1.0) / lag if lag > 0.0 else 0.0


@compiled
def coupled_motion(m: Motion, s: float) -> Pair:
    """Z and z' at s."""
    y = s / m.length
    z = v = 0.0
    for n in range(COUPLED_TERMS - 1, -1, -1):
        z = z * y + m.z_terms[n]
        v = v * y + m.v_terms[n]
    return z, v


@compiled
def coupled_derivatives(m: Motion, s: float) -> Triple:
    """z'', z''' and z'''' at s."""
    y = s / m.length
    a = jerk = snap = 0.0
    for n in range(COUPLED_TERMS - 1, 0, -1):
        term = n * m.v_terms[n]
        a = a * y + term
        if n > 1:
            term *= n - 1.0
            jerk = jerk * y + term
        if n > 2:
            snap = snap * y + term * (n - 2.0)
    h = m.length
    return a / h, jerk / h / h, snap / h / h / h


@compiled
def coupled_bounds(m: Motion, end: float) -> Quintuple:
    """Upper bounds of |z'| to |z'''''| up to `end`: the series with all its terms positive."""
    y = end / m.length
    b1 = b2 = b3 = b4 = b5 = 0.0
    for n in range(COUPLED_TERMS - 1, -1, -1):
        term = abs(m.v_terms[n])
        b1 = b1 * y + term
        if n > 0:
            term *= n
            b2 = b2 * y + term
        if n > 1:
            term *= n - 1.0
            b3 = b3 * y + term
        if n > 2:
            term *= n - 2.0
            b4 = b4 * y + term
        if n > 3:
            b5 = b5 * y + term * (n - 3.0)
    h = m.length
    return b1, b2 / h, b3 / h / h, b4 / h / h / h, b5 / h / h / h / h


@compiled
def coupled_load(m: Motion, s: float, end: float) -> Quintuple:
    """w2, w2' and w2'' at s; upper bounds of |w2''| and |w2'''| up to `end`."""
    y, far = s / m.length, end / m.length
    w2 = a = jerk = b2 = b3 = 0.0
    for n in range(COUPLED_TERMS - 1, -1, -1):
        term = m.w2_terms[n]
        w2 = w2 * y + term
        if n > 0:
            term *= n
            a = a * y + term
        if n > 1:
            term *= n - 1.0
            jerk = jerk * y + term
            b2 = b2 * far + abs(term)
        if n > 2:
            b3 = b3 * far + abs(term) * (n - 2.0)
    h = m.length
    return w2, a / h, jerk / h / h, b2 / h / h, b3 / h / h / h


@compiled
def coupled_travel(m: Motion, s: float) -> float:
    """What the load has turned by at s."""
    y = s / m.length
    angle = 0.0
    for n in range(COUPLED_TERMS - 1, -1, -1):
        angle = angle * y + m.w2_terms[n] / (n + 1.0)
    return angle * s
