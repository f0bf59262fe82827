"""The describing function of the gap against Fourier integrals and the exact free vibration."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad

from softstart.linear.limit_cycles import bias_for, mean_twist_beyond, share


def fourier(amplitude, half, bias):
    """Mean and first sine coefficient of the dead zone of bias + amplitude sin, by quadrature."""

    def beyond(x):
        return x - half if x > half else x + half if x < -half else 0.0

    corners = [math.asin((edge - bias) / amplitude) for edge in (half, -half) if abs(edge - bias) < amplitude]
    points = sorted(
        {*(c % (2 * math.pi) for c in corners), *((math.pi - c) % (2 * math.pi) for c in corners)}
    )

    def integral(weight):
        return quad(
            lambda t: weight(t) * beyond(bias + amplitude * math.sin(t)), 0.0, 2.0 * math.pi,
            points=points or None, limit=200, epsabs=1e-12,
        )[0]  # fmt: skip

    return integral(lambda _: 1.0) / (2.0 * math.pi), integral(math.sin) / (math.pi * amplitude)


@pytest.mark.parametrize("bias", [0.0, -0.4, 1.3])
@pytest.mark.parametrize("amplitude", [0.7, 3.0])
def test_is_the_first_harmonic(amplitude, bias):
    mean, first = fourier(amplitude, 0.5, bias)
    assert share(amplitude, 0.5, bias) == pytest.approx(first, abs=1e-9)
    assert mean_twist_beyond(amplitude, 0.5, bias) == pytest.approx(mean, abs=1e-9)


@given(st.floats(0.01, 50.0), st.floats(-500.0, 500.0), st.floats(0.0, 2.0))
def test_the_bias_carries_the_mean_torque(amplitude, torque, half):
    bias = bias_for(torque, amplitude, half, 100.0)
    assert 100.0 * mean_twist_beyond(amplitude, half, bias) == pytest.approx(torque, abs=1e-8)


def test_its_error_for_the_free_vibration_of_two_masses():
    """Omega sqrt(N/c) over the exact Omega/(1 + gap/(pi (A - gap/2))): the table of docs/linear-view.md."""
    for amplitude, percent in ((1.01, 122.0), (1.1, 33.0), (1.5, 6.4), (2.0, 2.3), (4.0, 0.3)):  # in gap/2
        exact = 1.0 / (1.0 + 2.0 / (math.pi * (amplitude - 1.0)))
        found = 100.0 * (math.sqrt(share(amplitude, 1.0)) / exact - 1.0)
        assert found == pytest.approx(percent, rel=0.01, abs=0.05)  # digits of the table
