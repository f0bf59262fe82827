"""The condition of the reduction [R]: what is merged must swing far above what is wanted."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from softstart.chain.frequencies import elastic_frequencies
from softstart.chain.joints import closed
from softstart.chain.model import Chain

__all__ = ["FACTOR", "error_bound", "pieces"]

Vector = NDArray[np.float64]

FACTOR = 10.0
"""How far: `w_partial^2 >= FACTOR w^2`. One step then moves `w` by 5.4 % at most (see `error_bound`)."""


def error_bound(Omega: Vector, inverse_squares: float) -> Vector:
    """How far, as a share, frequencies `Omega` can be moved by steps with this sum of `1/w_partial^2`.

    Every step keeps `1/w_i^2`, of every frequency, within `1/w_partial^2`: squared periods move by at most
    the squared period of the partial system. Proof for a shared mass I with springs c1, c2 and S = c1 + c2,
    w' being the frequency afterwards. (1) Put the mass where its springs hold it, at rest: its kinetic energy
    is less than that of its shares by I (c1 c2/S^2) (x1 - x2)^2, which is the strain energy over
    w_partial^2; hence w^2 <= w'^2/(1 - w'^2/w_partial^2). (2) Leave it out of the true shape: with p
    where the springs would hold it, the strain energy is at most w^2 (kinetic energy + I p^2
    w^2/(w_partial^2 - w^2)); hence w'^2 <= w^2/(1 - w^2/w_partial^2). Both hold for each
    frequency by the min-max principle. A pair is the same seen from the torques, where compliances are the
    masses.

    >>> error_bound(np.array([1.0]), 0.1).round(3)
    array([0.054])
    """
    moved = Omega * Omega * inverse_squares
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(moved < 1.0, 1.0 / np.sqrt(1.0 - moved) - 1.0, math.inf)


def pieces(chain: Chain) -> list[tuple[tuple[str, ...], float]]:
    """The pieces between the gaps, with their lowest elastic frequency in rad/s; single masses are left out.

    >>> pieces(Chain.load("crane-4-mass"))
    []
    """
    arrays = chain.at_motor_shaft()
    if not arrays.gap.any():
        return []
    names = [mass.name for mass in chain.masses]
    cuts: list[int] = [0, *(np.flatnonzero(arrays.gap > 0.0) + 1).tolist(), len(names)]
    body = closed(arrays)
    found = []
    for first, last in pairwise(cuts):
        group = body.body[first:last]
        inner = body.shaft[(body.shaft >= first) & (body.shaft < last - 1)]
        if inner.size:
            J = np.zeros(inner.size + 1)
            np.add.at(J, group - group[0], arrays.J[first:last])
            found.append((tuple(names[first:last]), float(elastic_frequencies(J, arrays.c[inner])[0])))
    return found
