"""Natural frequencies and shapes of a free chain, to the last digits even where they lie far apart.

The mass-normalised stiffness of a chain is B'B with B bidiagonal, one row a shaft, so the elastic
frequencies are the singular values of B, and the rigid one, exactly 0, is not computed at all: B has one row
less than columns. They are bisected on the tridiagonal matrix of Golub and Kahan, whose eigenvalues they and
their negatives are, and whose counts of eigenvalues are right to the last bits of the smallest (J. Demmel,
W. Kahan, SIAM J. Sci. Stat. Comput. 11 (1990) 873-912, doi:10.1137/0911052); the usual eigensolvers keep the
digits of the largest only.

A shape is two Holzer tables, one from each end, that meet at the mass where they fit best: the twisted
factorisation of I. S. Dhillon, B. N. Parlett, Linear Algebra Appl. 387 (2004) 1-28,
doi:10.1016/j.laa.2003.12.028.
"""

from __future__ import annotations

import math
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

__all__ = ["elastic_frequencies", "shapes"]

Vector = NDArray[np.float64]

_compiled: Any = numba.njit(cache=True, error_model="numpy")
_TINY = float(np.finfo(np.float64).tiny)


def elastic_frequencies(J: Vector, c: Vector) -> Vector:
    """The elastic frequencies in rad/s, ascending, of the inertias `J` and the stiffnesses `c` between them.

    >>> import numpy as np
    >>> elastic_frequencies(np.array([0.035, 0.175]), np.array([368.465])).round(6)
    array([112.397])
    """
    found: Vector = _bisected(np.ascontiguousarray(J), np.ascontiguousarray(c))
    return found


def shapes(J: Vector, c: Vector, omega: Vector) -> Vector:
    """The shapes at the elastic frequencies `omega`, one row each: amplitudes of the masses, largest one 1.

    >>> import numpy as np
    >>> J, c = np.array([1.0, 3.0]), np.array([3.0])
    >>> shapes(J, c, elastic_frequencies(J, c)).round(12)
    array([[ 1.        , -0.33333333]])
    """
    found: Vector = _twisted(np.ascontiguousarray(J), np.ascontiguousarray(c), np.ascontiguousarray(omega))
    return found


@_compiled
def _bisected(J: Vector, c: Vector) -> Vector:
    """All brackets halved side by side: a frequency has i others below it, counted by negative pivots."""
    n = c.size
    squares = np.empty(2 * n)
    squares[0::2] = c / J[:-1]
    squares[1::2] = c / J[1:]
    low, high = np.full(n, math.sqrt(_TINY)), np.full(n, 2.1 * math.sqrt(squares.max()))
    middle, pivot, negative = np.empty(n), np.empty(n), np.empty(n, np.int64)
    going = True
    while going:
        going = False
        for i in range(n):
            a, b = low[i], high[i]
            middle[i] = 0.5 * (a + b) if b < 4.0 * a else math.sqrt(a) * math.sqrt(b)
            going = going or a < middle[i] < b
            pivot[i], negative[i] = -middle[i], 1
        for k in range(2 * n):
            for i in range(n):
                p = -middle[i] - squares[k] / pivot[i]
                p = p if p != 0.0 else -_TINY
                negative[i] += 1 if p < 0.0 else 0
                pivot[i] = p
        for i in range(n):
            if negative[i] - n - 1 <= i:
                low[i] = middle[i]
            else:
                high[i] = middle[i]
    return 0.5 * (low + high)


@_compiled
def _twisted(J: Vector, c: Vector, omega: Vector) -> Vector:
    n = J.size
    found = np.zeros((omega.size, n))
    # the torque before a mass per its amplitude, and the amplitude of the next mass over that of the last
    before, behind = np.zeros(n), np.zeros(n)
    forth, back = np.ones(n), np.ones(n)
    for i in range(omega.size):
        square = omega[i] * omega[i]
        for k in range(n - 1):
            through = before[k] + square * J[k]
            step = 1.0 - through / c[k]
            forth[k + 1] = step if step != 0.0 else 1e-30
            before[k + 1] = through / forth[k + 1]
        for k in range(n - 1, 0, -1):
            through = behind[k] + square * J[k]
            step = 1.0 - through / c[k - 1]
            back[k - 1] = step if step != 0.0 else 1e-30
            behind[k - 1] = through / back[k - 1]
        meet, least = 0, math.inf
        for k in range(n):
            misfit = abs(square * J[k] + before[k] + behind[k]) / J[k]
            if misfit < least:
                meet, least = k, misfit
        found[i, meet] = 1.0
        for k in range(meet, 0, -1):
            found[i, k - 1] = found[i, k] / forth[k]
        for k in range(meet, n - 1):
            found[i, k + 1] = found[i, k] / back[k]
        largest = 0.0
        for k in range(n):
            if abs(found[i, k]) > abs(largest):
                largest = found[i, k]
        found[i] /= largest
    return found
