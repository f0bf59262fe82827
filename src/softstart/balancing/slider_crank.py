"""The slider crank, exactly: height of the piston, its derivatives, and their harmonics.

The piston moves on a line through the crank axis. phi is the angle of the crank from top dead centre (TDC).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from softstart.arrays import Vector

__all__ = ["SliderCrank", "acceleration_harmonics", "inertia_torque_harmonics"]

# The rod's square root is singular at sin(phi) = 1/lambda: harmonics fall by exp(arccosh(1/lambda)) an order.
# Of so many samples of a turn they are exact to rounding, even for a rod 0.1 % longer than the crank.
PHI = 2.0 * np.pi * np.arange(4096) / 4096


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
        return self.r * np.cos(phi) + self.rod * self._cosine(phi)

    def slope(self, phi: ArrayLike) -> Vector:
        """First derivative of the height by phi, in m/rad; at constant w the piston's speed over w.

        >>> float(SliderCrank(1.0, 3.0).slope(np.pi / 2))
        -1.0
        """
        phi = np.asarray(phi, dtype=np.float64)
        return -self.r * np.sin(phi) * (1.0 + self.ratio * np.cos(phi) / self._cosine(phi))

    def curvature(self, phi: ArrayLike) -> Vector:
        """Second derivative of the height by phi, in m/rad^2; at constant w the acceleration over w^2.

        >>> float(SliderCrank(1.0, 4.0).curvature(0.0))
        -1.25
        """
        phi = np.asarray(phi, dtype=np.float64)
        q = self._cosine(phi)
        bend = np.cos(2.0 * phi) / q + (0.5 * self.ratio * np.sin(2.0 * phi)) ** 2 / q**3
        return -self.r * (np.cos(phi) + self.ratio * bend)

    def _cosine(self, phi: Vector) -> Vector:
        """Cosine of the angle between rod and cylinder."""
        return np.sqrt(1.0 - (self.ratio * np.sin(phi)) ** 2)


def acceleration_harmonics(ratio: float, orders: int) -> Vector:
    """A_q, q = 0 .. orders, of the acceleration -r w^2 sum A_q cos(q phi), by FFT of the exact one.

    A_1 = 1 is that of [B](1).

    >>> acceleration_harmonics(0.25, 4).round(6).tolist()
    [0.0, 1.0, 0.254025, 0.0, -0.004098]
    """
    harmonics: Vector = -2.0 / PHI.size * np.fft.rfft(SliderCrank(1.0, 1.0 / ratio).curvature(PHI)).real
    harmonics[0] = harmonics[3::2] = 0.0  # by symmetry
    return harmonics[: orders + 1]


def inertia_torque_harmonics(ratio: float, orders: int) -> Vector:
    """B_k, k = 0 .. orders, of the inertia torque m r^2 w^2 sum B_k sin(k phi), [B](3), by FFT.

    The torque of a mass m at the piston pin on the crank at constant speed is -m w^2 s' s''.

    >>> inertia_torque_harmonics(0.25, 4).round(6).tolist()
    [0.0, 0.063506, -0.50013, -0.192056, -0.016129]
    """
    crank = SliderCrank(1.0, 1.0 / ratio)
    harmonics: Vector = 2.0 / PHI.size * np.fft.rfft(crank.slope(PHI) * crank.curvature(PHI)).imag
    harmonics[0] = 0.0
    return harmonics[: orders + 1]
