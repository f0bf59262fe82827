"""The describing function of the gap against Fourier integrals, limits, and the exact free vibration."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad

from softstart import Command, Drive, PlainController, simulate
from softstart.linear.limit_cycles import bias_for, mean_twist_beyond, share

AMPLITUDES = st.floats(0.01, 50.0)


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


@given(AMPLITUDES, st.floats(0.0, 2.0))
def test_is_the_formula_of_nordin_and_gutman(amplitude, half):
    if amplitude <= half:
        assert share(amplitude, half) == 0.0
        return
    r = half / amplitude
    said = 1.0 - 2.0 / math.pi * (math.asin(r) + r * math.sqrt(1.0 - r * r))
    assert share(amplitude, half) == pytest.approx(said, abs=1e-14)


@given(AMPLITUDES, st.floats(-500.0, 500.0), st.floats(0.0, 2.0))
def test_the_bias_carries_the_mean_torque(amplitude, torque, half):
    bias = bias_for(torque, amplitude, half, 100.0)
    assert 100.0 * mean_twist_beyond(amplitude, half, bias) == pytest.approx(torque, abs=1e-8)


def free_vibration(drive, amplitude):
    """Frequency of two masses through the gap: exact (crossed at v = Omega (A - gap/2)), and by N(A)."""
    exact = 2.0 * math.pi / (2.0 * math.pi + 2.0 * drive.gap / (amplitude - 0.5 * drive.gap)) * drive.Omega
    return exact, drive.Omega * math.sqrt(share(amplitude, 0.5 * drive.gap))


class Coasting(PlainController):
    """No torque at all."""

    def step(self, measured, state):
        return Command(0.0)


def test_the_free_vibration_of_two_masses():
    drive = Drive.load("crane-4amtkf").replace(load_torque=0.0, load_kind="active")
    speed = 20.0
    share_2 = drive.J2 / (drive.J1 + drive.J2)
    run = simulate(
        drive.replace(initial_motor_speed=speed * share_2, initial_load_speed=-speed * (1.0 - share_2)),
        Coasting(), 2.0,
    )  # fmt: skip
    closings = [event.time for event in run.events if event.kind == "gap closed" and event.value > 0.0]
    amplitude = float(np.max(run.theta))
    exact, described = free_vibration(drive, amplitude)
    # the amplitude is read off the plot's instants, which hold the peaks
    assert 2.0 * math.pi / np.diff(closings).mean() == pytest.approx(exact, rel=1e-9)
    assert np.diff(closings) == pytest.approx(2.0 * math.pi / exact, rel=1e-9)
    assert abs(described / exact - 1.0) < 0.05
