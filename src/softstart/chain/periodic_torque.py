"""A torque that is periodic in the crank angle: its mean and its harmonics."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from softstart.arrays import Vector, plain_fields
from softstart.errors import InputError


@dataclass(frozen=True, eq=False)
class PeriodicTorque:
    """mean + sum cosine_k cos(orders_k speed t) + sine_k sin(orders_k speed t), in N m.

    Time 0 is the firing dead centre of the first cylinder, where crank angle 0 is.

    Parameters
    ----------
    mean : float
        Mean torque, N m.
    orders : array_like of shape (n,)
        Multiples of the crank speed above 0, with halves for a four-stroke engine.
    cosine, sine : array_like of shape (n,)
        Amplitudes of the harmonics, N m.
    speed : float
        Crank speed, rad/s.

    Raises
    ------
    InputError
        If the arrays differ in size, a value is not finite, or an order or the speed is not above 0.

    Examples
    --------
    >>> torque = PeriodicTorque(50.0, [1.0], [0.0], [20.0], speed=100.0)
    >>> float(torque.at(math.pi / 200))
    70.0

    References
    ----------
    [B] (2), (3).
    """

    mean: float
    orders: Vector
    cosine: Vector
    sine: Vector
    speed: float

    def __post_init__(self) -> None:
        for name in ("orders", "cosine", "sine"):
            values = np.array(getattr(self, name), dtype=np.float64).ravel()
            values.setflags(write=False)
            object.__setattr__(self, name, values)
        if not self.orders.size == self.cosine.size == self.sine.size:
            sizes = f"{self.orders.size}, {self.cosine.size} and {self.sine.size}"
            raise InputError(f"orders, cosine, sine: they have {sizes} values; give as many of each.")
        if not (math.isfinite(self.speed) and self.speed > 0.0):
            raise InputError(f"speed = {self.speed}: the crank turns at a speed above 0 rad/s.")
        if not np.all(np.isfinite([self.mean, *self.orders, *self.cosine, *self.sine])):
            raise InputError("mean, orders, cosine, sine: all must be finite numbers.")
        if np.any(self.orders <= 0.0):
            raise InputError("orders: each must be above 0; the constant part is mean.")

    def at(self, t: ArrayLike) -> Vector:
        """The torque in N m at times in s."""
        return self.at_angle(self.speed * np.asarray(t, dtype=np.float64))

    def at_angle(self, phi: ArrayLike) -> Vector:
        """The torque in N m at crank angles in rad."""
        phase = np.multiply.outer(np.asarray(phi, dtype=np.float64), self.orders)
        torque: Vector = self.mean + np.cos(phase) @ self.cosine + np.sin(phase) @ self.sine
        return torque

    @property
    def frequencies(self) -> Vector:
        """Frequency of each harmonic in rad/s."""
        return self.orders * self.speed

    @property
    def amplitudes(self) -> Vector:
        """Amplitude of each harmonic in N m."""
        return np.hypot(self.cosine, self.sine)

    def summary(self) -> dict[str, Any]:
        """Everything as plain data, for JSON."""
        return plain_fields(self)
