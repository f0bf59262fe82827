"""The certified first root of a polynomial: none is passed over, however close two of them lie."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numba import njit
from numpy.polynomial.polynomial import polyfromroots, polymul, polyval

from softstart.kernel.events import NONE, first_root
from softstart.kernel.records import N_WORK, WORK


@njit
def first_root_of(work, f, end, zeros, noise, faint):
    s = work.view(WORK)[0]
    for i in range(f.size):
        s.f[i] = f[i]
    return first_root(s, f.size - 1, end, zeros, noise, faint)


def root(coefficients, end=1.0, zeros=0, noise=0.0, faint=0.0) -> float:
    f = np.ascontiguousarray(coefficients, dtype=np.float64)
    return float(first_root_of(np.zeros(N_WORK), f, end, zeros, noise, faint))


@given(
    roots=st.lists(st.floats(-2.0, 3.0).filter(lambda r: abs(r) > 1e-3), min_size=1, max_size=7),
    end=st.floats(0.1, 1.0),
)
@settings(max_examples=200, deadline=None)
def test_the_first_root_is_found(roots, end):
    ordered = sorted(roots)
    assume(all(c - a > 0.05 for a, c in zip(ordered, ordered[2:], strict=False)))  # pairs, but no triples
    f = polyfromroots(roots)
    f = f * np.sign(f[0])
    inside = sorted(r for r in roots if 0 < r <= end * (1.0 + 1e-9))  # a root on the end is one to rounding
    found = root(f, end)
    size = float(np.abs(f).sum())
    # before the root f is positive, and to the end without one, but for roots that touch or lie on the end
    before = np.linspace(0.0, end if found == NONE else found, 1000)[:-1]
    assert polyval(before, f).min() > -1e-12 * size
    if found != NONE:
        assert polyval(found, f) == pytest.approx(0.0, abs=1e-13 * size)
        assert inside


@pytest.mark.parametrize("apart", [1e-2, 1e-4, 1e-6])
def test_a_pair_of_close_roots_is_not_passed_over(apart):
    f = polyfromroots([0.6, 0.6 + apart, -1.0])
    assert root(f) == pytest.approx(0.6, abs=1e-9)
    # a touch is no crossing
    assert root(polymul(polyfromroots([0.5, 0.5]), [1.0, 0.3]) + 1e-9 * np.array([1, 0, 0, 0])) == NONE


def test_what_begins_at_zero():
    assert root([0.0, 1.0, -2.0]) == pytest.approx(0.5, rel=1e-14)  # rises, falls back
    assert root([0.0, -1.0, 2.0]) == 0.0  # falls at once
    assert root([0.0, 0.0, 1.0]) == NONE
    assert root([0.0, 0.0, 0.0, -1.0]) == 0.0
    assert root([0.0, 0.0, 0.0]) == NONE  # nothing at all
    assert root([-1e-3, 1.0]) == 0.0  # below zero before
    assert root([-1e-17, 1.0, -4.0], noise=1e-15) == pytest.approx(0.25, rel=1e-14)
    # 1e-17 is rounding where the event has just been handled, 1e-3 is a jump
    assert root([1e-17, -1e-18, 1.0, -2.0], zeros=2, noise=1e-16) == pytest.approx(0.5, rel=1e-14)
    assert root([1e-3, -1.0, 1.0], zeros=2, noise=1e-16) == pytest.approx(1e-3, rel=2e-3)


def test_a_root_far_down_a_long_span_has_all_its_digits():
    """A flight of 1 ms seen on a span of 40 s: the rounding is that of the terms at the root."""
    a, v, h = 1800.0, 0.9, 40.0
    s = root([0.0, v * h, -0.5 * a * h * h]) * h
    assert s == pytest.approx(2 * v / a, rel=1e-14)
    s = root([1e-3, v * h, -0.5 * a * h * h]) * h
    exact = (v + np.sqrt(v * v + 2 * a * 1e-3)) / a
    assert s == pytest.approx(exact, rel=1e-13)
