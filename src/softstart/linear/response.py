"""Frequency responses of sampled systems, and where a function of frequency passes zero."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from softstart.linear.realisation import System

Complex = NDArray[np.complex128]
Vector = NDArray[np.float64]

LOWEST = 1e-5  # of the highest frequency
PER_DECADE = 200
NEAR = 30  # frequencies on either side of a pole


def at_points(system: System, z: Complex) -> Complex:
    """C (z - A)^-1 B + D at every z, shape (points, outputs, inputs).

    >>> one = System(*(np.array([[value]]) for value in (0.5, 1.0, 1.0, 0.0)))
    >>> at_points(one, np.array([1.0 + 0j])).ravel().tolist()
    [(2+0j)]
    """
    points = np.atleast_1d(np.asarray(z, dtype=np.complex128))
    n = system.A.shape[0]
    shifted = points[:, None, None] * np.eye(n) - system.A
    inputs = np.broadcast_to(system.B, (points.size, *system.B.shape))
    return np.asarray(system.C @ np.linalg.solve(shifted, inputs) + system.D, dtype=np.complex128)


def poles(system: System) -> Complex:
    """The eigenvalues of A."""
    return np.asarray(np.linalg.eigvals(system.A), dtype=np.complex128)


def frequencies(period: float, near: Complex) -> Vector:
    """Frequencies in rad/s up to half the sample rate, close together near these poles."""
    highest = math.pi / period
    count = int(PER_DECADE * -math.log10(LOWEST))
    grid = [np.geomspace(LOWEST * highest, highest * (1.0 - 1e-9), count)]
    for pole in near:
        angle = abs(float(np.angle(pole))) / period
        if abs(pole) > 0.0 and LOWEST * highest < angle < highest:
            width = max(abs(math.log(abs(pole))) / period, 1e-7 * angle)
            away = np.geomspace(0.1 * width, 0.5 * angle, NEAR) if 0.1 * width < 0.5 * angle else np.zeros(0)
            grid += [angle - away, angle + away]
    whole = np.unique(np.concatenate(grid))
    return whole[(whole >= LOWEST * highest) & (whole < highest)]


def zeros_of(function: Callable[[Vector], Vector], grid: Vector, largest: float) -> list[float]:
    """All zeros between neighbours of the grid with different signs.

    A change of sign through infinity (a pole) is none: at a zero the function is below `largest`.
    """
    from scipy.optimize import brentq

    values = function(grid)
    found = []
    for index in np.flatnonzero(np.signbit(values[:-1]) != np.signbit(values[1:])):
        left, right = grid[index], grid[index + 1]
        root = brentq(
            lambda w: float(function(np.array([w]))[0]), left, right, xtol=1e-13 * right, rtol=1e-14
        )
        there = abs(float(function(np.array([root]))[0]))
        if there <= min(abs(values[index]), abs(values[index + 1])) + 1e-9 and there < largest:
            found.append(float(root))
    return found
