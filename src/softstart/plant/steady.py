"""An undamped contact under constant torque: events by closed formula, and by a Newton that cannot stray."""

from __future__ import annotations

import math

from softstart.plant.crossing import LOST, NO_CROSSING
from softstart.plant.jit import compiled, inlined
from softstart.plant.layout import (
    EXIT, K, LAST_V, MEMO_P, MEMO_S, MEMO_V, MEMO_W, NO_EVENT, P0, V0, W0, W0SQ, Y0, Z0, Septuple, Vector,
)  # fmt: skip


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


@compiled
def steady_target(m: Vector, load: Septuple, target: float, end: float) -> float:
    """First instant at which the load has its target speed, in a contact from flank to flank (end).

    The load gains speed while T > Mc, one stretch around the peak of T at end/2. Before the peak w2 is
    convex there, behind it concave: Newton's method, begun at the peak, runs to the only crossing from one
    side, whichever half it lies in.
    """
    w0 = m[W0]
    s = 0.5 * end
    direction = 0.0
    for _ in range(100):
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
