"""Where a polynomial of a step crosses zero: all roots in (0, 1], none missed, by Bernstein coefficients.

A polynomial lies within the range of its Bernstein coefficients, and has no more roots than they have changes
of sign. Halving the span until there is one change or none therefore finds every root.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from softstart.arrays import Vector

__all__ = ["definite", "definite_integral", "first_root", "leading", "roots", "value"]

NOTHING = 1e-13  # a term below this share of the largest one is rounding
DEEPEST = 48


@lru_cache(maxsize=64)
def _to_bernstein(degree: int) -> Vector:
    """Matrix from powers u^j to Bernstein coefficients: b_i = sum over j <= i of C(i, j)/C(n, j) a_j."""
    n = degree
    return np.array(
        [[math.comb(i, j) / math.comb(n, j) if j <= i else 0.0 for j in range(n + 1)] for i in range(n + 1)]
    )


@lru_cache(maxsize=64)
def _halves(degree: int) -> tuple[Vector, Vector]:
    """Matrices from Bernstein coefficients on a span to those on its left and right half (de Casteljau)."""
    n = degree
    left = np.array(
        [[math.comb(i, j) / 2.0**i if j <= i else 0.0 for j in range(n + 1)] for i in range(n + 1)]
    )
    return left, left[::-1, ::-1]


def value(a: Vector, u: float) -> float:
    """The polynomial sum of a_n u^n at u.

    >>> value(np.array([1.0, 2.0, 3.0]), 2.0)
    17.0
    """
    return _horner(a.tolist(), u)


def _horner(terms: list[float], u: float) -> float:
    found = 0.0
    for term in reversed(terms):
        found = found * u + term
    return found


def definite_integral(a: Vector, u: float) -> float:
    """Integral of the polynomial from 0 to u.

    >>> definite_integral(np.array([1.0, 2.0, 3.0]), 2.0)
    14.0
    """
    return u * value(a / np.arange(1, a.size + 1), u)


def leading(a: Vector, jitter: float = 0.0) -> int:
    """Index of the first term that is more than rounding; the number of terms if none is.

    `jitter` is what rounding may move the beginning by, as a share of the step: a term that such a shift
    can make is none.

    >>> leading(np.array([1e-18, 0.0, 2.0])), leading(np.zeros(2))
    (2, 2)
    >>> leading(np.array([1e-9, 2.0]), jitter=1e-9)
    1
    """
    sizes = np.abs(a)
    most = float(sizes.max())
    if most == 0.0:
        return a.size
    noise = np.full(a.size, NOTHING * most)
    noise[:-1] += jitter * np.arange(1, a.size) * sizes[1:]
    return int(np.argmax(sizes > noise))


def first_root(a: Vector, jitter: float = 0.0) -> float | None:
    """First u in (0, 1] where the polynomial, negative behind u = 0, reaches zero; None if there is none.

    Leading terms that are mere rounding count as zero: an event that was just handled is not found again.

    >>> first_root(np.array([-1.0, 4.0])), first_root(np.array([-1.0, 0.5]))
    (0.25, None)
    """
    q = a[leading(a, jitter) :]
    if q.size < 2:
        return None
    if abs(q[0]) > np.abs(q[1:]).sum():
        return None
    found = roots(q, first=True)
    return found[0] if found else None


def roots(a: Vector, first: bool = False) -> list[float]:
    """All simple roots in (0, 1] in order, or only the first.

    >>> [round(u, 12) for u in roots(np.array([0.08, -0.6, 1.0]))]
    [0.2, 0.4]
    """
    if a.size < 2:
        return []
    found: list[float] = []
    _search(_to_bernstein(a.size - 1) @ a, a, 0.0, 1.0, found, first, 0)
    return found


def _search(
    b: Vector, a: Vector, low: float, high: float, found: list[float], first: bool, depth: int
) -> None:
    signs = np.sign(b)
    signs = signs[signs != 0.0]
    changes = int(np.count_nonzero(signs[1:] != signs[:-1])) if signs.size else 0
    if changes == 0:
        if b[-1] == 0.0 and signs.size and high <= 1.0 and (not found or found[-1] < high):
            found.append(high)
        return
    if changes == 1 and b[0] * b[-1] < 0.0:
        found.append(_bracketed(a, low, high))
        return
    if depth >= DEEPEST:
        found.append(0.5 * (low + high))  # a double root, as nearly as floats tell
        return
    middle = 0.5 * (low + high)
    left, right = _halves(b.size - 1)
    _search(left @ b, a, low, middle, found, first, depth + 1)
    if not (first and found):
        _search(right @ b, a, middle, high, found, first, depth + 1)


def _bracketed(a: Vector, low: float, high: float) -> float:
    """The one root between low and high: Newton, kept inside the bracket by halving."""
    terms = a.tolist()
    slopes = (a[1:] * np.arange(1, a.size)).tolist()
    rising = _horner(terms, high) > 0.0 or _horner(terms, low) < 0.0
    u = 0.5 * (low + high)
    for _ in range(100):
        y = _horner(terms, u)
        if y == 0.0:
            return u
        if (y > 0.0) == rising:
            high = u
        else:
            low = u
        slope = _horner(slopes, u)
        new = u - y / slope if slope != 0.0 else low
        if not low < new < high:
            new = 0.5 * (low + high)
        if abs(new - u) <= 1e-16 * max(abs(u), 1e-300) or new in (low, high):
            return new
        u = new
    return u


def definite(a: Vector, b: Vector, u: float) -> float:
    """Integral of the product of two polynomials from 0 to u, every term of it.

    >>> definite(np.array([0.0, 1.0]), np.array([0.0, 3.0]), 2.0)
    8.0
    """
    return definite_integral(np.convolve(a, b), u)
