"""The harmonics of the slider crank by power series in lambda: the second way, beside the FFT."""

from __future__ import annotations

import numpy as np

from softstart.arrays import Vector
from softstart.balancing.slider_crank import samples_needed


def acceleration_series(ratio: float, orders: int) -> Vector:
    """The same A_q from the power series in lambda: A_2 = lambda + lambda^3/4 + 15 lambda^5/128 + ...

    >>> [round(float(a), 6) for a in acceleration_series(0.25, 4)]
    [0.0, 1.0, 0.254025, 0.0, -0.004098]
    """
    q = np.arange(orders + 1)
    return q * _speed_series(ratio, orders)


def inertia_torque_series(ratio: float, orders: int) -> Vector:
    """The same B_k from the power series: B_1 = lambda/4 + lambda^3/16 + 15 lambda^5/512 + ...

    The products of the harmonics of s' and s'' are summed up to orders where they vanish.

    >>> [round(float(b), 6) for b in inertia_torque_series(0.25, 4)[1:]]
    [0.063506, -0.50013, -0.192056, -0.016129]
    """
    n = max(samples_needed(ratio), orders)
    sine = _speed_series(ratio, n)  # s' = -r sum sine_p sin(p phi), s'' = -r sum p sine_p cos(p phi)
    cosine = np.arange(n + 1) * sine
    sums = np.convolve(sine, cosine)  # sin p cos q = [sin(p + q) + sin(p - q)]/2
    differences = np.correlate(sine, cosine, "full")  # index n + p - q
    k = np.arange(orders + 1)
    found: Vector = -0.5 * (sums[k] + differences[n + k] - differences[n - k])
    return found


def _speed_series(ratio: float, orders: int) -> Vector:
    """S_q of s' = -r sum S_q sin(q phi): S_1 = 1, S_2i = 2 i c_2i/lambda."""
    found = np.zeros(orders + 1)
    found[1:2] = 1.0
    even = np.arange(2, orders + 1, 2)
    found[even] = even * _rod_series(ratio, orders // 2)[1:] / ratio
    return found


def _rod_series(ratio: float, count: int) -> Vector:
    """c_0, c_2 .. c_2count of sqrt(1 - lambda^2 sin(phi)^2) = sum c_2i cos(2 i phi), by the binomial series.

    sqrt(1 - x) = 1 - sum_j |C(1/2, j)| x^j, and
    sin^2j = 4^-j [C(2j, j) + 2 sum_i (-1)^i C(2j, j-i) cos(2 i phi)].
    """
    i = np.arange(count)
    signs = np.where(np.arange(count + 1) % 2, -2.0, 2.0)
    signs[0] = 1.0
    found = np.zeros(count + 1)
    found[0] = 1.0
    term, middle, j = 1.0, 1.0, 0  # |C(1/2, j)| lambda^2j and 4^-j C(2j, j)
    while term > 1e-19:
        j += 1
        term *= abs(j - 1.5) / j * ratio**2
        middle *= (2 * j - 1) / (2 * j)
        row = middle * np.cumprod(np.concatenate([[1.0], np.maximum(j - i, 0) / (j + i + 1)]))
        found -= term * signs * row
    return found
