"""Partial systems of a chain [R]: what may be merged because it swings far above the wanted range.

Two kinds. A *mass* between its two springs, their far ends held: `Omega^2 = (c1 + c2)/I`. A *pair* of masses
and the spring between them, free: `Omega^2 = c (I1 + I2)/(I1 I2)`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from softstart.chain.joints import closed
from softstart.chain.model import Chain

__all__ = ["PartialSystem", "partial_systems", "squared_frequencies"]

Vector = NDArray[np.float64]
Kind = Literal["mass", "pair"]


@dataclass(frozen=True)
class PartialSystem:
    """One partial system: its kind, the names of its masses, and its frequency `Omega` in rad/s."""

    kind: Kind
    masses: tuple[str, ...]
    Omega: float

    def summary(self) -> dict[str, Any]:
        """The same as plain data."""
        return {"kind": self.kind, "masses": list(self.masses), "Omega": self.Omega}


def squared_frequencies(J: Vector, c: Vector) -> tuple[Vector, Vector]:
    """`Omega^2` of the masses (NaN at the ends, which have one spring) and of the pairs.

    >>> squared_frequencies(np.array([1.0, 2.0, 3.0]), np.array([6.0, 4.0]))
    (array([nan,  5., nan]), array([9.        , 3.33333333]))
    """
    of_mass = np.full(J.size, np.nan)
    of_mass[1:-1] = (c[:-1] + c[1:]) / J[1:-1]
    return of_mass, c / J[:-1] + c / J[1:]


def partial_systems(chain: Chain) -> tuple[PartialSystem, ...]:
    """All partial systems of the chain with its gaps closed, the highest frequency first.

    >>> [round(system.Omega) for system in partial_systems(Chain.load("crane-4-mass"))]
    [1581, 1459, 866, 649, 418]
    """
    body = closed(chain.at_motor_shaft())
    names: list[str] = ["" for _ in body.J]
    for mass, b in zip(chain.masses, body.body, strict=True):
        names[b] = f"{names[b]} + {mass.name}" if names[b] else mass.name
    of_mass, of_pair = squared_frequencies(body.J, body.c)
    systems = [
        PartialSystem("mass", (names[k],), float(of_mass[k]) ** 0.5) for k in range(1, body.J.size - 1)
    ]
    systems += [
        PartialSystem("pair", (names[k], names[k + 1]), float(of_pair[k]) ** 0.5) for k in range(body.c.size)
    ]
    return tuple(sorted(systems, key=lambda system: -system.Omega))
