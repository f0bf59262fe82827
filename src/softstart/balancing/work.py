"""Integrals over a cycle: exact to rounding, since the law of the pressure is smooth between known angles.

A pressure is given as `weights @ shapes(theta)`: whatever is linear in it (work, torque, harmonics) is
computed once for each shape, for all speeds and loads.
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Sequence
from functools import lru_cache
from itertools import pairwise
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from softstart.balancing.parts import CYCLE_ANGLE, Cylinders
from softstart.balancing.slider_crank import Vector

__all__ = ["GasCycle", "nodes", "shape_work", "torque_harmonics"]

LONGEST = math.pi / 12.0  # rad, of a panel
MANY = 100  # breaks, as of a measured pressure, leave panels so short that few nodes do


class GasCycle(Hashable, Protocol):
    """Where the pressure comes from: a simple cycle, or one measured."""

    @property
    def crankcase_pressure(self) -> float:
        """Pressure in Pa below the pistons."""

    def breaks(self) -> tuple[float, ...]:
        """Angles in rad between which the pressure is smooth."""

    def shapes(self, cylinders: Cylinders, theta: Vector) -> Vector:
        """Shapes of the pressure at angles in rad, one row a shape."""

    def weights(self, cylinders: Cylinders, speed: float, load: float) -> Vector:
        """What to multiply the shapes with for the pressure difference in Pa on the piston."""

    def refuse(self, cylinders: Cylinders) -> Sequence[str]:
        """What cannot be with these cylinders."""


@lru_cache(maxsize=2)
def _gauss(count: int) -> tuple[Vector, Vector]:
    x, w = np.polynomial.legendre.leggauss(count)
    return np.asarray(x, dtype=np.float64), np.asarray(w, dtype=np.float64)


def nodes(breaks: Sequence[float]) -> tuple[Vector, Vector]:
    """Gauss-Legendre nodes in [0, 4 pi) and their weights, none across a break.

    >>> theta, weights = nodes((1.0, 2.0))
    >>> bool(abs(weights @ np.cos(theta) ** 2 - 2 * math.pi) < 1e-13)
    True
    """
    edges = [0.0, *(b for b in sorted(breaks) if 0.0 < b < CYCLE_ANGLE), CYCLE_ANGLE]
    places, weights = [], []
    for low, high in pairwise(edges):
        parts = max(1, math.ceil((high - low) / LONGEST))
        x, w = _gauss(10 if len(breaks) > MANY else 24)
        half = 0.5 * (high - low) / parts
        for i in range(parts):
            places.append(low + half * (2 * i + 1 + x))
            weights.append(half * w)
    return np.concatenate(places), np.concatenate(weights)


@lru_cache(maxsize=32)
def _torque_shapes(cycle: GasCycle, cylinders: Cylinders) -> tuple[Vector, Vector]:
    """The nodes, and weights times the torque on the crank of each shape of pressure."""
    theta, weights = nodes(cycle.breaks())
    per_pressure = -cylinders.area * cylinders.crank.slope(theta)
    return theta, cycle.shapes(cylinders, theta) * per_pressure * weights


@lru_cache(maxsize=64)
def _shape_work(cycle: GasCycle, cylinders: Cylinders) -> tuple[float, ...]:
    return tuple(float(w) for w in _torque_shapes(cycle, cylinders)[1].sum(axis=1))


def shape_work(cycle: GasCycle, cylinders: Cylinders) -> Vector:
    """Work in J of one cycle of one cylinder for each shape."""
    return np.array(_shape_work(cycle, cylinders), dtype=np.float64)


@lru_cache(maxsize=32)
def _torque_harmonics(cycle: GasCycle, cylinders: Cylinders, highest: int) -> NDArray[np.complex128]:
    theta, torque = _torque_shapes(cycle, cylinders)
    turning = np.exp(-0.5j * np.outer(theta, np.arange(2 * highest + 1)))
    # einsum: threads of a BLAS cost more than such a small product where other processes work too
    found: NDArray[np.complex128] = np.einsum("sn,nj->sj", torque, turning) * (2.0 / CYCLE_ANGLE)
    found[:, 0] *= 0.5
    found.setflags(write=False)
    return found


def torque_harmonics(cycle: GasCycle, cylinders: Cylinders, highest: int) -> NDArray[np.complex128]:
    """C_j of the torque Re sum C_j exp(i j theta/2), j = 0 .. 2 highest, of one cylinder; a row a shape."""
    return _torque_harmonics(cycle, cylinders, highest)
