"""The drive at the sample instants, against an independent exponential and shifts by whole samples."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import expm
from tests.softstart.linear.speed_loops import CRANE

from softstart.linear.sampled_plant import exponential, in_contact, motor_alone, sampled
from softstart.linear.systems import at_points

Z = np.exp(1j * np.linspace(0.05, 3.0, 30)) * 1.01


@given(st.integers(0, 1000), st.floats(-6.0, 1.5))
def test_the_exponential(seed, decade):
    matrix = 10.0**decade * np.random.default_rng(seed).normal(size=(6, 6))
    known = expm(matrix)
    assert np.max(np.abs(exponential(matrix) - known)) <= 1e-11 * np.max(np.abs(known))


@pytest.mark.parametrize("lag", [0.0, 0.003])
@pytest.mark.parametrize("differencing", [False, True])
def test_whole_samples_of_delay_are_powers_of_z(lag, differencing):
    drive = CRANE.replace(torque_lag=lag, damping=1.0)
    for plant in (in_contact(drive), motor_alone(drive)):
        for fraction in (0.0, 0.0004):
            plain = sampled(plant, 0.001, fraction, (1, 2, 3), differencing)
            late = sampled(plant, 0.001, 0.003 + fraction, (1, 2, 3), differencing)
            expected = at_points(plain.system, Z) * (Z**-3)[:, None, None]
            assert at_points(late.system, Z) == pytest.approx(expected, rel=1e-9, abs=1e-12)


def test_a_delay_of_all_but_a_sample_goes_over_into_one():
    plant = in_contact(CRANE)
    almost = at_points(sampled(plant, 0.001, 0.001 * (1 - 1e-9), (1, 2, 3), True).system, Z)
    whole = at_points(sampled(plant, 0.001, 0.001, (1, 2, 3), True).system, Z)
    # the torque measured just before a sample is then that of the demand before; all else is continuous
    assert almost[:, :2] == pytest.approx(whole[:, :2], rel=1e-6)
