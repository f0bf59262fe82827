"""The orders of the inertia torque by power series in lambda, beside the FFT of the package."""

from __future__ import annotations

import numpy as np

from softstart.arrays import Vector
from softstart.balancing.slider_crank import inertia_torque_harmonics


def acceleration_series(ratio: float, orders: int) -> Vector:
    """A_q by power series in lambda: A_2 = lambda + lambda^3/4 + 15 lambda^5/128 + ...

    >>> [round(float(a), 6) for a in acceleration_series(0.25, 4)]
    [0.0, 1.0, 0.254025, 0.0, -0.004098]
    """
    return np.arange(orders + 1) * _speed_series(ratio, orders)


def inertia_torque_series(ratio: float, orders: int) -> Vector:
    """B_k by power series in lambda: B_1 = lambda/4 + lambda^3/16 + 15 lambda^5/512 + ...

    The products of the harmonics of s' and s'' are summed up to orders where they vanish.

    >>> [round(float(b), 6) for b in inertia_torque_series(0.25, 4)[1:]]
    [0.063506, -0.50013, -0.192056, -0.016129]
    """
    n = 256
    sine = _speed_series(ratio, n)  # s' = -r sum sine_p sin(p phi), s'' = -r sum p sine_p cos(p phi)
    cosine = np.arange(n + 1) * sine
    sums = np.convolve(sine, cosine)  # sin p cos q = [sin(p + q) + sin(p - q)]/2
    differences = np.correlate(sine, cosine, "full")  # index n + p - q
    k = np.arange(orders + 1)
    return np.asarray(-0.5 * (sums[k] + differences[n + k] - differences[n - k]))


def _speed_series(ratio: float, orders: int) -> Vector:
    """S_q of s' = -r sum S_q sin(q phi): S_1 = 1, S_2i = 2 i c_2i/lambda, by the binomial series of the rod's
    sqrt(1 - lambda^2 sin^2 phi) = sum c_2i cos(2 i phi), sin^2 phi = (2 - e^2i phi - e^-2i phi)/4.
    """
    found, power, factor, j = np.zeros(orders + 3), np.ones(1), 1.0, 0
    found[1] = 1.0
    while abs(factor) > 1e-19:
        j += 1
        factor *= (j - 1.5) / j * ratio**2  # C(1/2, j) (-lambda^2)^j
        power = np.convolve(power, [-0.25, 0.5, -0.25])  # of sin^2j, from e^-2ij phi to e^2ij phi
        i = np.arange(1, min(j, orders // 2) + 1)
        found[2 * i] += 4.0 * i * factor * power[j + i] / ratio
    return found[: orders + 1]


def series_difference(ratio: float) -> float:
    """Largest difference of FFT and power series among B_0 .. B_12.

    >>> series_difference(0.3) < 1e-14
    True
    """
    return float(np.abs(inertia_torque_harmonics(ratio, 12) - inertia_torque_series(ratio, 12)).max())
