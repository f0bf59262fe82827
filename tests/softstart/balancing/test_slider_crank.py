"""The exact crank drive, and its harmonics in two independent ways."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from softstart.balancing.slider_crank import SliderCrank, acceleration_harmonics, inertia_torque_harmonics

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


@settings(max_examples=30, deadline=None)
@given(st.floats(0.02, 0.5))
def test_the_harmonics_make_up_the_exact_course(ratio):
    crank = SliderCrank(ratio, 1.0)
    q = np.arange(61)
    force = np.cos(np.outer(PHI, q)) @ np.array(acceleration_harmonics(ratio, 60))
    assert force == pytest.approx(-crank.curvature(PHI) / ratio, abs=1e-12)
    torque = np.sin(np.outer(PHI, q)) @ np.array(inertia_torque_harmonics(ratio, 60))
    assert torque == pytest.approx(-crank.slope(PHI) * crank.curvature(PHI) / ratio**2, abs=1e-12)
