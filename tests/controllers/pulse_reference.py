"""The filters of pulse-coast-hold written down again, in numpy and by other means: matrix exponentials."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.linalg import expm

Array = NDArray[np.float64]


class FreeMotor:
    """phi1, w1, 1/J1 of a motor turning free, by the textbook."""

    def __init__(self, x: Array, P: Array) -> None:
        self.x, self.P = np.array(x, float), np.array(P, float)

    def predict(self, u: float, early: float, h: float, noise: float) -> None:
        F = np.array([[1.0, h, 0.5 * u * h * h + early * h * h], [0.0, 1.0, u * h], [0.0, 0.0, 1.0]])
        white = noise / h  # of w1', constant over the sample in spectral density
        Q = white * np.array([[h**3 / 3, h**2 / 2, 0.0], [h**2 / 2, h, 0.0], [0.0, 0.0, 0.0]])
        self.x, self.P = F @ self.x, F @ self.P @ F.T + Q

    def update(self, angle: float, variance: float) -> None:
        H = np.array([[1.0, 0.0, 0.0]])
        K = self.P @ H.T / (H @ self.P @ H.T + variance)
        self.x = self.x + K[:, 0] * (angle - self.x[0])
        keep = np.eye(3) - K @ H
        self.P = keep @ self.P @ keep.T + variance * K @ K.T  # Joseph's form


class Shaft:
    """phi1, w1, z, w2, 1/J2 in contact, load moving: an extended Kalman filter.

    The state goes on by scipy's integrator at 1e-12, the covariance by the matrix exponential of the Jacobian
    at the middle of the sample.
    """

    def __init__(self, x: Array, P: Array, a: float, c: float, d: float, Mc: float) -> None:
        self.x, self.P = np.array(x, float), np.array(P, float)
        self.a, self.c, self.d, self.Mc = a, c, d, Mc

    def rates(self, x: Array, u: float) -> Array:
        _, w1, z, w2, b = x
        T = max(0.0, self.c * z + self.d * (w1 - w2)) if z >= 0.0 else 0.0
        return np.array([w1, self.a * (u - T), w1 - w2, b * (T - self.Mc), 0.0])

    def after(self, u: float, h: float) -> Array:
        end = solve_ivp(lambda t, x: self.rates(x, u), (0.0, h), self.x, rtol=1e-12, atol=1e-14)
        return np.array(end.y[:, -1])

    def jacobian(self, x: Array, u: float) -> Array:
        """By central differences."""
        columns = []
        for i in range(5):
            step = 1e-6 * max(1.0, abs(x[i]))
            up, down = x.copy(), x.copy()
            up[i] += step
            down[i] -= step
            columns.append((self.rates(up, u) - self.rates(down, u)) / (2.0 * step))
        return np.array(columns).T

    def predict(self, u: float, h: float, noises: tuple[float, float, float]) -> None:
        F = expm(h * self.jacobian(self.after(u, 0.5 * h), u))
        self.x, self.P = self.after(u, h), F @ self.P @ F.T + np.diag([0.0, *noises, 0.0])

    def update(self, angle: float, variance: float) -> None:
        H = np.array([[1.0, 0.0, 0.0, 0.0, 0.0]])
        K = self.P @ H.T / (H @ self.P @ H.T + variance)
        self.x = self.x + K[:, 0] * (angle - self.x[0])
        keep = np.eye(5) - K @ H
        self.P = keep @ self.P @ keep.T + variance * K @ K.T


def way_lost(s: float, V: float, slope: float, a: float, c: float, d: float) -> float:
    """How far the motor is behind a free one, the shaft loaded by the twist that a free motor would make."""
    n = 200_000
    t = (np.arange(n) + 0.5) * s / n
    z = (V - slope * s) * t + 0.5 * slope * t * t
    T = c * z + d * (V - slope * s + slope * t)
    return float(np.sum(a * T * (s - t)) * s / n)
