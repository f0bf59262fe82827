"""Motor, shaft and load from motor angle and motor torque alone: two Kalman filters.

Compiled steps must not allocate, so each filter keeps its numbers in a record that the caller owns.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from softstart.controller.compiled import Double, compiled, inner, record

Matrix = NDArray[np.float64]
N = 5


class Free:
    """The motor turning free: phi1, w1, 1/J1 and their covariances."""

    angle: Double
    speed: Double
    inverse: float
    p00: float
    p01: float
    p02: float
    p11: float
    p12: float
    p22: float


class ShaftEstimate:
    """The shaft in contact: phi1, w1, z (twist beyond the gap), w2, b = 1/J2; P is their covariance.

    F and G are matrices to work in.
    """

    phi1: Double
    w1: float
    z: float
    w2: float
    b: float
    P: Matrix
    F: Matrix
    G: Matrix


FREE, SHAFT = record(Free), record(ShaftEstimate, P=(N, N), F=(N, N), G=(N, N))


@compiled
def free_predict(m: Free, u: float, lead: float, h: float, noise: float) -> None:
    """The free motor h later: w1' = u/J1, under the mean torque u with its `lead` (`contact.torque_lead`).

    1/J1 is an unknown of its own, which the pulse reveals; `noise` (rad^2/s^2) is what the torque measured
    may be wrong by, as variance of w1.

    >>> m = np.zeros(9).view(FREE)[0]
    >>> m.inverse = 2.0
    >>> free_predict(m, 3.0, 0.0, 0.5, 0.0)
    >>> [float(value) for value in (m.angle, m.speed, m.inverse)]
    [0.75, 3.0, 2.0]
    """
    g = u * h
    f = 0.5 * g * h + lead * h * h
    m.angle += h * m.speed + f * m.inverse
    m.speed += g * m.inverse
    p00, p01, p02 = m.p00, m.p01, m.p02
    p11, p12, p22 = m.p11, m.p12, m.p22
    row00, row01, row02 = p00 + h * p01 + f * p02, p01 + h * p11 + f * p12, p02 + h * p12 + f * p22
    row11, row12 = p11 + g * p12, p12 + g * p22
    m.p00 = row00 + h * row01 + f * row02 + noise * h * h / 3.0
    m.p01 = row01 + g * row02 + 0.5 * noise * h
    m.p02 = row02
    m.p11 = row11 + g * row12 + noise
    m.p12 = row12


@compiled
def free_update(m: Free, angle: float, variance: float) -> None:
    """Correct by the encoder's angle, whose error has this variance in rad^2."""
    p00, p01, p02 = m.p00, m.p01, m.p02
    total = p00 + variance
    k0, k1, k2 = p00 / total, p01 / total, p02 / total
    error = angle - m.angle
    m.angle += k0 * error
    m.speed += k1 * error
    m.inverse += k2 * error
    m.p00 = (1.0 - k0) * p00
    m.p01 = (1.0 - k0) * p01
    m.p02 = (1.0 - k0) * p02
    m.p11 -= k1 * p01
    m.p12 -= k1 * p02
    m.p22 -= k2 * p02


@compiled
def load_acceleration(T: float, w2: float, b: float, Mc: float, Mb: float) -> float:
    """w2' under the shaft torque T, b = 1/J2; at rest the load stays there while Mb <= T <= Mc.

    Mc and Mb are its torque in forward and in backward motion: equal without friction, opposite where all of
    it is friction.

    >>> load_acceleration(5.0, 0.0, 2.0, 7.0, 7.0), load_acceleration(5.0, 0.0, 2.0, 7.0, -7.0)
    (-4.0, 0.0)
    """
    if w2 > 0.0 or Mb == Mc:
        return b * (T - Mc)
    if w2 < 0.0 or Mb > T:
        return b * (T - Mb)
    return b * max(T - Mc, 0.0)


@compiled
def shaft(z: float, rate: float, c: float, d: float) -> float:
    """T = max(0, c z + d z') in contact, 0 with the gap open.

    >>> shaft(0.1, 2.0, 50.0, 0.5), shaft(-0.1, 2.0, 50.0, 0.5), shaft(0.1, -20.0, 50.0, 0.5)
    (6.0, 0.0, 0.0)
    """
    return max(0.0, c * z + d * rate) if z >= 0.0 else 0.0


@compiled
def predicted_motion(
    w1: float, z: float, w2: float, b: float, u: float, h: float, a: float, c: float, d: float, Mc: float,
    Mb: float,
) -> tuple[float, float, float, float]:  # fmt: skip
    """Way of the motor, w1, z and w2 a time h later under the constant motor torque u (Runge-Kutta, order 4).

    a = 1/J1 and b = 1/J2: w1' = a (u - T), z' = w1 - w2, w2' as in `load_acceleration`.

    >>> way, w1, z, w2 = predicted_motion(1.0, 0.0, 0.0, 2.0, 0.0, 0.01, 2.0, 50.0, 0.0, 0.0, 0.0)
    >>> round(z, 7), round(float(np.sin(0.01 * 200**0.5)) / 200**0.5, 7)
    (0.0099667, 0.0099667)
    """
    half = 0.5 * h
    T = shaft(z, w1 - w2, c, d)
    f1, g1, r1 = a * (u - T), load_acceleration(T, w2, b, Mc, Mb), w1 - w2
    x, y, way = w1 + half * f1, w2 + half * g1, z + half * r1
    T = shaft(way, x - y, c, d)
    f2, g2, r2 = a * (u - T), load_acceleration(T, y, b, Mc, Mb), x - y
    x, y, way = w1 + half * f2, w2 + half * g2, z + half * r2
    T = shaft(way, x - y, c, d)
    f3, g3, r3 = a * (u - T), load_acceleration(T, y, b, Mc, Mb), x - y
    x, y, way = w1 + h * f3, w2 + h * g3, z + h * r3
    T = shaft(way, x - y, c, d)
    f4, g4, r4 = a * (u - T), load_acceleration(T, y, b, Mc, Mb), x - y
    after = w2 + h / 6.0 * (g1 + 2.0 * (g2 + g3) + g4)
    if Mb != Mc and w2 > 0.0 and after < 0.0:  # friction stops it
        after = 0.0
    return (
        h * w1 + h * h / 6.0 * (f1 + f2 + f3),
        w1 + h / 6.0 * (f1 + 2.0 * (f2 + f3) + f4),
        z + h / 6.0 * (r1 + 2.0 * (r2 + r3) + r4),
        after,
    )


@compiled
def shaft_predict(
    x: ShaftEstimate, u: float, lead: float, h: float, a: float, c: float, d: float, Mc: float,
    Mb: float, speed_noise: float, twist_noise: float, load_noise: float,
) -> None:  # fmt: skip
    """The shaft in contact h later (`predicted_motion`); covariance by F = 1 + h A + h^2 A^2/2 + h^3 A^3/6.

    A is the Jacobian at the middle of the sample, with dT = c dz + d (dw1 - dw2):

        dphi1' = dw1,  dw1' = -a dT,  dz' = dw1 - dw2,  dw2' = b dT + (T - Mc) db,  db' = 0

    The noises are the variances that the sample adds to w1, z and w2.
    """
    b = x.b
    _, w1, z, w2 = predicted_motion(x.w1, x.z, x.w2, b, u, 0.5 * h, a, c, d, Mc, Mb)
    T = shaft(z, w1 - w2, c, d)
    in_contact = 1.0 if T > 0.0 else 0.0
    moves = 0.0 if Mb != Mc and w2 == 0.0 and Mb <= T <= Mc else 1.0
    on_w1 = -h * a * in_contact
    on_w2 = h * b * in_contact * moves
    by_b = h * load_acceleration(T, w2, 1.0, Mc, Mb) * moves
    for j in range(N):  # F = 1 + h A (1 + h A/2 (1 + h A/3)), a column at a time
        f0 = f1 = f2 = f3 = 0.0
        f4 = 1.0 if j == 4 else 0.0
        for share in (3.0, 2.0, 1.0):
            f0 += 1.0 if j == 0 else 0.0
            f1 += 1.0 if j == 1 else 0.0
            f2 += 1.0 if j == 2 else 0.0
            f3 += 1.0 if j == 3 else 0.0
            dT = c * f2 + d * (f1 - f3)
            f0, f1, f2, f3 = (
                h * f1 / share,
                on_w1 * dT / share,
                h * (f1 - f3) / share,
                (on_w2 * dT + by_b * f4) / share,
            )
        x.F[0, j] = f0 + (1.0 if j == 0 else 0.0)
        x.F[1, j] = f1 + (1.0 if j == 1 else 0.0)
        x.F[2, j] = f2 + (1.0 if j == 2 else 0.0)
        x.F[3, j] = f3 + (1.0 if j == 3 else 0.0)
        x.F[4, j] = f4
    for i in range(N):  # G = F P
        for j in range(N):
            total = 0.0
            for k in range(N):
                total += x.F[i, k] * x.P[k, j]
            x.G[i, j] = total
    for i in range(N):  # P = G F'
        for j in range(i, N):
            total = 0.0
            for k in range(N):
                total += x.G[i, k] * x.F[j, k]
            x.P[i, j] = total
            x.P[j, i] = total
    x.P[1, 1] += speed_noise
    x.P[2, 2] += twist_noise
    x.P[3, 3] += load_noise
    way, w1, z, w2 = predicted_motion(x.w1, x.z, x.w2, b, u, h, a, c, d, Mc, Mb)
    x.phi1 += way + a * lead * h * h
    x.w1 = w1
    x.z = z + a * lead * h * h
    x.w2 = w2


@compiled
def shaft_update(x: ShaftEstimate, angle: float, variance: float, least: float, most: float) -> None:
    """Correct by the encoder's angle; 1/J2 stays between `least` and `most`."""
    total = x.P[0, 0] + variance
    error = angle - x.phi1
    for i in range(N):
        x.F[0, i] = x.P[i, 0] / total  # the gain
        x.F[1, i] = x.P[0, i]
    x.phi1 += x.F[0, 0] * error
    x.w1 += x.F[0, 1] * error
    x.z += x.F[0, 2] * error
    x.w2 += x.F[0, 3] * error
    x.b += x.F[0, 4] * error
    for i in range(N):
        for j in range(N):
            x.P[i, j] -= x.F[0, i] * x.F[1, j]
    x.b = min(max(x.b, least), most)


@inner
def copy(m: Free, to: Free) -> None:
    """The filter of the free motor once more."""
    to.angle = m.angle
    to.speed = m.speed
    to.inverse = m.inverse
    to.p00 = m.p00
    to.p01 = m.p01
    to.p02 = m.p02
    to.p11 = m.p11
    to.p12 = m.p12
    to.p22 = m.p22
