"""When the gap closed, told from how far the motor is behind a free one, and the shaft from then on."""

from __future__ import annotations

import math

from softstart.controller.compiled import compiled, inner
from softstart_controllers.shaft_filter import Free, N, Shaft, move

HALVINGS = 40
SMALL = 1e-4  # for differences
TIME_DEVIATION = 0.3  # of the time since contact, before the samples since then are looked at


@compiled
def lean(before: float, after: float, demand: float, mean: float) -> float:
    """How much earlier than its mean the torque of a sample acts: (int int u)/h^2 - mean/2, in N m.

    `before` and `after` are the torques measured at its ends, `demand` the constant demand in it, which the
    torque follows exponentially. With x = ln(b/a), b = demand - before, a = demand - after it is
    int int u = h^2 (demand/2 - b/x + (b - a)/x^2). A fast torque has none: it is at its demand.

    >>> lean(0.0, 0.0, 0.0, 0.0), round(lean(10.0, 9.99, 0.0, 9.995), 6), round(0.01 / 12, 6)
    (0.0, 0.000833, 0.000833)
    """
    b = demand - before
    a = demand - after
    if a * b <= 0.0:
        return 0.0
    if abs(b - a) <= 1e-2 * abs(b):  # what is left out is of second order
        return (before - after) / 12.0
    x = math.log(b / a)
    return 0.5 * (demand - mean) - b / x + (b - a) / (x * x)


@compiled
def mean_of_ramp(before: float, after: float, reach: float) -> float:
    """Mean torque of a sample in which it slewed from `before` to `after`, and then stayed there, in N m.

    `reach` is what the slew limiter lets it change in a whole sample.

    >>> mean_of_ramp(40.0, 20.0, 20.0), mean_of_ramp(10.0, 0.0, 20.0), mean_of_ramp(5.0, 5.0, 20.0)
    (30.0, 2.5, 5.0)
    """
    change = after - before
    return after - 0.5 * change * min(abs(change) / reach, 1.0)


@compiled
def lean_of_ramp(before: float, after: float, reach: float) -> float:
    """How much earlier than its mean that torque acts, as `lean`, in N m.

    >>> round(lean_of_ramp(40.0, 20.0, 20.0) * 12.0, 9), round(lean_of_ramp(10.0, 0.0, 20.0) * 12.0, 9)
    (20.0, 10.0)
    """
    change = after - before
    share = min(abs(change) / reach, 1.0)
    return -change * share * (0.25 - share / 6.0)


@compiled
def deviation(s: float, V: float, slope: float, a: float, c: float, d: float) -> float:
    """How far in rad the motor is behind a free one, s after contact: a int int (c z + d z') ds ds.

    V is the relative speed that a free motor would have now and `slope` its rate, so z' = V - slope s at the
    contact; what the shaft has taken from z' since is of higher order. Undamped and coasting it is
    a c V s^3/6: it grows with the cube of the time, and the loss of speed with its square.

    >>> round(deviation(0.003, 15.0, 0.0, 1 / 0.035, 368.465, 0.0), 8)
    0.00071061
    """
    way = s * s * (0.5 * V - slope * s / 3.0)
    return a * (d * way + c * s * s * s * (V / 6.0 - 0.125 * slope * s))


@compiled
def time_since_contact(
    behind: float, V: float, slope: float, a: float, c: float, d: float, longest: float
) -> float:
    """The s up to `longest`, and up to V/slope, at which the deviation is `behind`; by bisection.

    >>> round(time_since_contact(0.0007106, 15.0, 0.0, 1 / 0.035, 368.465, 0.0, 0.01), 6)
    0.003
    """
    low, high = 0.0, longest
    if slope > 0.0:
        high = min(high, max(V, 0.0) / slope)
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        if deviation(middle, V, slope, a, c, d) < behind:
            low = middle
        else:
            high = middle
    return high


@inner
def since_contact(
    angle: float, s: float, speed: float, w2: float, b: float, drift: float, u: float, a: float, c: float,
    d: float, Mc: float, reactive: float,
) -> tuple[float, float, float, float, float]:  # fmt: skip
    """phi1, w1, z, w2 and b now, s after contact.

    Without the contact the motor would have this angle and speed, and the load w2 - b drift now: the load
    torque has taken that impulse from it. From the contact on all go under the motor torque u.
    """
    rolling = Mc * s if drift != 0.0 else 0.0
    way, w1, z, load = move(
        speed - a * u * s, 0.0, w2 - b * (drift - rolling), b, u, s, a, c, d, Mc, reactive
    )
    return angle - s * (speed - 0.5 * a * u * s) + way, w1, z, load, b


@compiled
def take_up(
    x: Shaft, m: Free, s: float, s_variance: float, u: float, w2: float, w2_variance: float,
    drift: float, b: float, b_variance: float, a: float, c: float, d: float, Mc: float, reactive: float,
) -> None:  # fmt: skip
    """Begin the filter of the shaft, a time s after contact, from the free motor now.

    The first guess owes its errors to s, to the free motion, to w2 and to 1/J2 = b. The covariance is the sum
    of what each of them does to (phi1, w1, z, w2, 1/J2), by central differences.
    """
    speed = m.speed
    for k in range(N):
        for j in range(N):
            x.P[k, j] = 0.0
    x.P[0, 0] = m.p00
    for cause in range(4):
        at_s = SMALL * s if cause == 0 else 0.0
        at_speed = SMALL * (abs(speed) + abs(w2)) if cause == 1 else 0.0
        at_w2 = SMALL * (abs(speed) + abs(w2)) if cause == 2 else 0.0
        at_b = SMALL * b if cause == 3 else 0.0
        step = at_s + at_speed + at_w2 + at_b
        variance = (s_variance, m.p11, w2_variance, b_variance)[cause]
        if step <= 0.0:
            continue
        up = since_contact(
            m.angle, s + at_s, speed + at_speed, w2 + at_w2, b + at_b, drift, u, a, c, d, Mc, reactive
        )
        down = since_contact(
            m.angle, s - at_s, speed - at_speed, w2 - at_w2, b - at_b, drift, u, a, c, d, Mc, reactive
        )
        for k in range(N):
            x.F[0, k] = (up[k] - down[k]) / (2.0 * step)
        for k in range(N):
            for j in range(N):
                x.P[k, j] += variance * x.F[0, k] * x.F[0, j]
        if cause == 1:  # angle and speed of the free motion err together
            for k in range(N):
                x.P[0, k] += m.p01 * x.F[0, k]
                x.P[k, 0] += m.p01 * x.F[0, k]
    x.phi1, x.w1, x.z, x.w2, x.b = since_contact(m.angle, s, speed, w2, b, drift, u, a, c, d, Mc, reactive)
