"""Roots of a step's polynomials: none missed, none invented."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from softstart.clutch.polynomials import definite, definite_integral, first_root, roots, value


@settings(max_examples=60, deadline=None, derandomize=True)
@given(
    st.lists(st.integers(1, 99), min_size=1, max_size=5, unique=True),
    st.lists(st.floats(1.2, 4.0), max_size=3),
)
def test_all_roots_are_found(inside, outside):
    known = sorted(one / 100.0 for one in inside)
    a = np.poly([*known, *outside])[::-1]
    found = roots(a)
    assert found == pytest.approx(known, abs=1e-9)  # five roots a hundredth apart: 1e-16 times the condition
    sign = -1.0 if value(a, 0.0) > 0.0 else 1.0
    assert first_root(sign * a) == pytest.approx(known[0], abs=1e-9)


def test_the_sine_of_a_step():
    # the 24th order of sin over the 1.9 radians of a step, as it is used: cos crosses zero at pi/2
    n = np.arange(25)
    factorial = np.concatenate([[1.0], np.cumprod(np.arange(1.0, 25.0))])
    cosine = np.where(n % 2 == 0, (-1.0) ** (n // 2), 0.0) / factorial * 1.9**n
    assert roots(cosine) == pytest.approx([np.pi / 2 / 1.9], rel=1e-15)


def test_a_root_at_the_beginning_is_not_found_again():
    assert first_root(np.array([1e-19, -1.0, 2.0])) == pytest.approx(0.5)
    assert first_root(np.array([0.0, -1.0, 0.5])) is None
    assert first_root(np.array([0.0, 0.0, -1.0, 4.0])) == pytest.approx(0.25)


def test_products_are_integrated_in_full():
    a, b = np.arange(1.0, 6.0), np.array([2.0, 0.0, -1.0])
    assert definite(a, b, 0.7) == pytest.approx(
        definite_integral(np.polymul(a[::-1], b[::-1])[::-1], 0.7), rel=1e-15
    )
