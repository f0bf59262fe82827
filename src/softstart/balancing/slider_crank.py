"""The slider crank, exactly: height of the piston, its derivatives, and their harmonics.

The piston moves on a line through the crank axis. phi is the angle of the crank from top dead centre (TDC).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from softstart.arrays import Vector

__all__ = ["SliderCrank", "acceleration_harmonics", "inertia_torque_harmonics"]


@dataclass(frozen=True)
class SliderCrank:
    """Crank radius `r` and length `rod` of the connecting rod, both in m, rod > r.

    >>> crank = SliderCrank(0.0355, 0.121)
    >>> round(crank.ratio, 4), float(crank.height(0.0))
    (0.2934, 0.1565)
    """

    r: float
    rod: float

    @property
    def ratio(self) -> float:
        """The ratio lambda of crank radius and rod length."""
        return self.r / self.rod

    def height(self, phi: ArrayLike) -> Vector:
        """Height in m of the piston pin above the crank axis, r cos(phi) + sqrt(rod^2 - r^2 sin(phi)^2)."""
        phi = np.asarray(phi, dtype=np.float64)
        found: Vector = self.r * np.cos(phi) + self.rod * self._cosine(phi)
        return found

    def slope(self, phi: ArrayLike) -> Vector:
        """First derivative of the height by phi, in m/rad; at constant w the piston's speed over w.

        >>> float(SliderCrank(1.0, 3.0).slope(math.pi / 2))
        -1.0
        """
        phi = np.asarray(phi, dtype=np.float64)
        found: Vector = -self.r * np.sin(phi) * (1.0 + self.ratio * np.cos(phi) / self._cosine(phi))
        return found

    def curvature(self, phi: ArrayLike) -> Vector:
        """Second derivative of the height by phi, in m/rad^2; at constant w the acceleration over w^2.

        >>> float(SliderCrank(1.0, 4.0).curvature(0.0))
        -1.25
        """
        phi = np.asarray(phi, dtype=np.float64)
        q = self._cosine(phi)
        bend = np.cos(2.0 * phi) / q + (0.5 * self.ratio * np.sin(2.0 * phi)) ** 2 / q**3
        found: Vector = -self.r * (np.cos(phi) + self.ratio * bend)
        return found

    def _cosine(self, phi: Vector) -> Vector:
        """Cosine of the angle between rod and cylinder."""
        return np.sqrt(1.0 - (self.ratio * np.sin(phi)) ** 2)


def samples_needed(ratio: float, orders: int = 0) -> int:
    """So many samples of a revolution that the harmonics up to `orders` are exact to rounding.

    The rod's square root is singular at sin(phi) = 1/lambda, arccosh(1/lambda) off the real axis: harmonics
    fall by that factor an order.

    >>> samples_needed(0.3), samples_needed(0.95)
    (64, 256)
    """
    return int(2 ** math.ceil(math.log2(max(32.0, 80.0 / math.acosh(1.0 / ratio), 2 * orders + 2))))


@lru_cache(maxsize=64)
def acceleration_harmonics(ratio: float, orders: int) -> tuple[float, ...]:
    """A_q, q = 0 .. orders, of the acceleration -r w^2 sum A_q cos(q phi), by FFT of the exact one.

    A_1 = 1 is that of [B](1).

    >>> [round(a, 6) for a in acceleration_harmonics(0.25, 4)]
    [0.0, 1.0, 0.254025, 0.0, -0.004098]
    """
    n = samples_needed(ratio, orders)
    acceleration = SliderCrank(1.0, 1.0 / ratio).curvature(2.0 * np.pi * np.arange(n) / n)
    found = -2.0 / n * np.fft.rfft(acceleration).real[: orders + 1]
    found[0] = found[3::2] = 0.0  # by symmetry
    return tuple(found.tolist())


@lru_cache(maxsize=64)
def inertia_torque_harmonics(ratio: float, orders: int) -> tuple[float, ...]:
    """B_k, k = 0 .. orders, of the inertia torque m r^2 w^2 sum B_k sin(k phi), [B](3), by FFT.

    The torque of a mass m at the piston pin on the crank at constant speed is -m w^2 s' s''.

    >>> [round(b, 6) for b in inertia_torque_harmonics(0.25, 4)]
    [0.0, 0.063506, -0.50013, -0.192056, -0.016129]
    """
    n = 2 * samples_needed(ratio, orders)
    phi, crank = 2.0 * np.pi * np.arange(n) / n, SliderCrank(1.0, 1.0 / ratio)
    found = 2.0 / n * np.fft.rfft(crank.slope(phi) * crank.curvature(phi)).imag[: orders + 1]
    found[0] = 0.0
    return tuple(found.tolist())
