"""The exact crank drive, and its harmonics in two independent ways."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from softstart.balancing.slider_crank import SliderCrank, acceleration_harmonics, inertia_torque_harmonics
from softstart_studies.paper_b.orders import acceleration_series, inertia_torque_series

PHI = np.linspace(0.0, 2.0 * np.pi, 97)
ratios = st.floats(0.02, 0.9)


def complex_step(function, phi):
    """Derivative without differences: the imaginary part of f(phi + i h)/h."""
    return function(phi + 1e-30j).imag / 1e-30


def height(crank, phi):
    return crank.r * np.cos(phi) + np.sqrt(crank.rod**2 - (crank.r * np.sin(phi)) ** 2)


@settings(max_examples=30, deadline=None)
@given(ratios, st.floats(1e-3, 10.0))
def test_derivatives_are_those_of_the_height(ratio, r):
    crank = SliderCrank(r, r / ratio)
    slope = complex_step(lambda phi: height(crank, phi), PHI)
    assert crank.height(PHI) == pytest.approx(height(crank, PHI), rel=1e-14)
    assert crank.slope(PHI) == pytest.approx(slope, abs=1e-13 * r)

    def slope_of(phi):
        q = np.sqrt(1.0 - (ratio * np.sin(phi)) ** 2)
        return -r * np.sin(phi) - r * ratio * np.sin(phi) * np.cos(phi) / q

    assert crank.curvature(PHI) == pytest.approx(complex_step(slope_of, PHI), abs=1e-11 * r)


@settings(max_examples=40, deadline=None)
@given(ratios)
def test_power_series_and_fft_agree(ratio):
    assert acceleration_series(ratio, 24) == pytest.approx(acceleration_harmonics(ratio, 24), abs=1e-12)
    assert inertia_torque_series(ratio, 24) == pytest.approx(inertia_torque_harmonics(ratio, 24), abs=1e-12)


@settings(max_examples=30, deadline=None)
@given(st.floats(0.02, 0.5))
def test_the_harmonics_make_up_the_exact_course(ratio):
    crank = SliderCrank(ratio, 1.0)
    q = np.arange(61)
    force = np.cos(np.outer(PHI, q)) @ np.array(acceleration_harmonics(ratio, 60))
    assert force == pytest.approx(-crank.curvature(PHI) / ratio, abs=1e-12)
    torque = np.sin(np.outer(PHI, q)) @ np.array(inertia_torque_harmonics(ratio, 60))
    assert torque == pytest.approx(-crank.slope(PHI) * crank.curvature(PHI) / ratio**2, abs=1e-12)


def test_textbook_coefficients():
    x = 0.01
    A = acceleration_harmonics(x, 6)
    assert A[1] == 1.0
    assert A[2] == pytest.approx(x + x**3 / 4 + 15 * x**5 / 128, rel=1e-12)
    assert A[4] == pytest.approx(-(x**3) / 4 - 3 * x**5 / 16, abs=1e-14)
    B = inertia_torque_harmonics(0.1, 4)
    x = 0.1  # the next terms are of x^7, x^6, x^7, x^6
    assert B[1] == pytest.approx(x / 4 + x**3 / 16 + 15 * x**5 / 512, abs=3 * x**7)
    assert B[2] == pytest.approx(-1 / 2 - x**4 / 32, abs=3 * x**6)
    assert B[3] == pytest.approx(-3 * x / 4 - 9 * x**3 / 32 - 81 * x**5 / 512, abs=3 * x**7)
    assert B[4] == pytest.approx(-(x**2) / 4 - x**4 / 8, abs=3 * x**6)
