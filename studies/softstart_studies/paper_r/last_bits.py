"""Natural vibration to the last bit: the motion with several gaps is chaotic, its figures follow the bits.

Bisection on the tridiagonal matrix of Golub and Kahan, whose eigenvalues the frequencies and their negatives
are, by counts of negative pivots (J. Demmel, W. Kahan, SIAM J. Sci. Stat. Comput. 11 (1990) 873-912,
doi:10.1137/0911052). It has no library in it, so a motion that starts from a shape is the same with each.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from softstart.chain import Chain, Vibration
from softstart.vibration import vibration_at, with_gaps_closed

__all__ = ["frequencies", "natural_vibration"]

Vector = NDArray[np.float64]
TINY = float(np.finfo(np.float64).tiny)


def natural_vibration(chain: Chain) -> Vibration:
    """As `softstart.natural_vibration`, with frequencies between two neighbouring numbers."""
    bodies = with_gaps_closed(chain.at_motor_shaft())
    return vibration_at(chain, frequencies(bodies.J, bodies.c))


def frequencies(J: Vector, c: Vector) -> Vector:
    """The elastic frequencies in rad/s, ascending; all brackets are halved side by side.

    >>> frequencies(np.array([0.035, 0.175]), np.array([368.465])).round(6)
    array([112.397])
    """
    squares = np.column_stack([c / J[:-1], c / J[1:]]).ravel()
    low, high = np.full(c.size, np.sqrt(TINY)), np.full(c.size, 2.1 * np.sqrt(squares.max()))
    going = True
    while going:
        middle = np.where(high < 4.0 * low, 0.5 * (low + high), np.sqrt(low) * np.sqrt(high))
        going = bool(np.any((low < middle) & (middle < high)))
        pivot, negative = -middle, np.ones(c.size, np.int64)
        for square in squares:
            pivot = -middle - square / pivot
            pivot[pivot == 0.0] = -TINY
            negative += pivot < 0.0
        above = negative - c.size - 1 <= np.arange(c.size)
        low, high = np.where(above, middle, low), np.where(above, high, middle)
    found: Vector = 0.5 * (low + high)
    return found
