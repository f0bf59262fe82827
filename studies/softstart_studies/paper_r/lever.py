"""The lever rule of [R]: partial systems merged one after the other, with a proved error.

Compliances are lengths. A mass between two springs is shared between its neighbours, more to the side of the
stiffer spring; a pair of masses becomes one at its centre of mass, and its compliance goes to the shafts
beside it. The partial system of the highest frequency goes first. Gaps of merged sections add up.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softstart.chain import Chain
from softstart.study import Table
from softstart.vibration import elastic_frequencies, reduce_chain, with_gaps_closed

__all__ = ["Lever", "chains_table", "error_bound", "lever"]

Vector = NDArray[np.float64]


class Lever(NamedTuple):
    """What is left: inertias `J`, stiffnesses `c`; `squares` of the partial frequencies that were merged."""

    J: Vector
    c: Vector
    squares: Vector


def lever(J: Vector, c: Vector, to: int = 2, ends: tuple[int, int] | None = None) -> Lever:
    """The chain of the inertias `J` and the stiffnesses `c` between them with `to` masses.

    The masses `ends` (motor and load; by default the first and the last) are never shared or put together.

    >>> lever(np.array([1.0, 0.2, 5.0]), np.array([3.0, 1.5])).J.round(6)
    array([1.133333, 5.066667])
    """
    inertias, stiffnesses, squares = J.tolist(), c.tolist(), []
    first, last = sorted(ends or (0, J.size - 1))
    while len(inertias) > to:
        J, c = np.array(inertias), np.array(stiffnesses)
        inner, pairs = range(1, J.size - 1), range(c.size)
        masses = [((c[k - 1] + c[k]) / J[k], k, False) for k in inner if k not in (first, last)]
        joints = [(c[k] / J[k] + c[k] / J[k + 1], k, True) for k in pairs if (k, k + 1) != (first, last)]
        square, k, pair = max(masses + joints)
        squares.append(square)
        if pair:
            left = J[k + 1] / (J[k] + J[k + 1])
            for beside, share in ((k - 1, left), (k + 1, 1.0 - left)):
                if 0 <= beside < c.size:  # nothing twists beyond an end
                    stiffnesses[beside] = 1.0 / (1.0 / c[beside] + share / c[k])
            inertias[k : k + 2] = [J[k] + J[k + 1]]
            del stiffnesses[k]
        else:
            left = c[k - 1] / (c[k - 1] + c[k])
            inertias[k - 1 : k + 2] = [J[k - 1] + left * J[k], J[k + 1] + (1.0 - left) * J[k]]
            stiffnesses[k - 1 : k + 1] = [left * c[k]]
        first, last = first - (first > k), last - (last > k)
    return Lever(np.array(inertias), np.array(stiffnesses), np.array(squares))


def error_bound(Omega: Vector, squares: Vector) -> Vector:
    """How far, as a share, frequencies `Omega` are moved at most by merging partial systems of these squares.

    |1/w'^2 - 1/w^2| <= sum of 1/w_partial^2 for every frequency; the proof: docs/theory/reduction.md.

    >>> error_bound(np.array([1.0]), np.array([10.0])).round(3)
    array([0.054])
    """
    moved = Omega * Omega * np.sum(1.0 / squares)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(moved < 1.0, 1.0 / np.sqrt(1.0 - moved) - 1.0, np.inf)


def chains_table() -> Table:
    """The shipped chains by the lever rule and by the modal reduction."""
    rows = []
    for name in ("crane-4-mass", "tractor-like"):
        modal = reduce_chain(Chain.load(name))
        arrays = modal.chain.at_motor_shaft()
        bodies = with_gaps_closed(arrays)
        motor, load = int(bodies.body[arrays.motor]), int(bodies.body[arrays.load])
        two = lever(bodies.J, bodies.c, ends=(motor, load))
        w, after = modal.whole.Omega, float(elastic_frequencies(two.J, two.c)[0])
        bound = float(error_bound(np.array([w]), two.squares)[0])
        lever_row = (after, 100.0 * (after / w - 1.0), 100.0 * bound, float(two.squares.min()) / w**2)
        inertias = (*two.J.tolist(), modal.J1, modal.J2)
        rows.append((name, *(round(x, 3) for x in (w, *lever_row)), *(round(J, 5) for J in inertias)))
    return Table(
        "The shipped chains: two masses by the lever rule, and by the modal reduction, which keeps w",
        ("chain", "w, rad/s", "lever: w, rad/s", "error, %", "at most, %", "least (w_p/w)^2",
         "lever: J1, kg m2", "J2, kg m2", "modal: J1, kg m2", "J2, kg m2"),
        rows,
    )  # fmt: skip
