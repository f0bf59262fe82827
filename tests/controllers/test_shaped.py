"""shaped: the steps cancel the swing, exactly where the model is right and as gently as the textbook says
where it is not; then the whole start.

The exact plant plays the steps through `profile`, from a start on the flank with the speed of an impact.
"""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from tests.controllers.starts import CRANE, CRANES

from softstart import Drive, simulate
from softstart.profile import TorqueProfile
from softstart_controllers.profile import Profile
from softstart_controllers.shaped import Shaped
from softstart_controllers.shaping import (
    ZV,
    ZVD,
    Levels,
    levels,
    oscillation,
    plan_levels,
    sensitivity,
    vector,
)

FULL = 62.0
NONE = (0.0, 0.0)


def model(drive: Drive) -> tuple[float, float, float]:
    """Pole and reduced inertia."""
    ratio = 0.5 * drive.d * drive.Omega / drive.c
    omega = drive.Omega * math.sqrt(1.0 - ratio**2)
    return -ratio * drive.Omega, omega, drive.J1 * drive.J2 / (drive.J1 + drive.J2)


def mean(drive: Drive, u: float) -> float:
    return (u * drive.J2 + drive.Mc * drive.J1) / (drive.J1 + drive.J2)


def on_the_flank(drive: Drive, impact: float) -> Drive:
    """A start at the instant of a contact whose c dw12/Omega is this share of the mean torque."""
    speed = impact * mean(drive, FULL) * drive.Omega / drive.c
    return drive.replace(start_position=0.5 * drive.gap, initial_motor_speed=speed, target_speed=1e4)


def steps(drive: Drive, order: int, a: float) -> Levels:
    """The levels from the instant of contact on, without torque before it."""
    sigma, omega, inertia = model(drive)
    v = drive.initial_motor_speed
    before = mean(drive, 0.0)
    W = vector(0.0, v, drive.c, sigma, omega, drive.torque_lag, before)
    D = sensitivity(v, 0.0, inertia, sigma, omega, drive.torque_lag, before)
    return levels(order, W, D, mean(drive, FULL), sigma, omega, a)


def left_over(nominal: Drive, order: int, a: float, plant: Drive | None = None, wait: float = 0.0) -> float:
    """Amplitude of T about its mean once the steps are over, as a share of the mean."""
    drive = plant or nominal
    torques = [(M * (drive.J1 + drive.J2) - drive.Mc * drive.J1) / drive.J2 for M in steps(nominal, order, a)]
    knots = a * np.arange(order + 1)
    profile = TorqueProfile(np.repeat(knots, 2)[1:], np.repeat([*torques[:order], FULL], 2)[:-1])
    end = order * a + wait
    run = simulate(drive, Profile(profile=profile), until=end + 1e-9)
    assert run.contacts == 1
    at = run.at([end])
    sigma, omega, _ = model(drive)
    rate = at["w1"][0] - at["w2"][0]
    z = (at["T"][0] - drive.d * rate) / drive.c - mean(drive, FULL) / drive.c
    swinging = math.hypot(z, (rate - sigma * z) / omega) * math.exp(-sigma * wait)
    return float(drive.c * swinging / mean(drive, FULL))


# the steps -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("ratio", [0.0, 0.3])
def test_from_rest_they_are_the_textbooks(ratio: float) -> None:
    """Singer and Seering: amplitudes 1 : K and 1 : 2 K : K^2, half a damped period apart."""
    K = math.exp(-math.pi * ratio / math.sqrt(1.0 - ratio**2))
    sigma, omega = -ratio / math.sqrt(1.0 - ratio**2), 1.0
    M = levels(ZV, NONE, NONE, 1.0, sigma, omega, 0.5 * math.pi)
    assert M[:2] == pytest.approx((1.0 / (1.0 + K),) * 2, rel=1e-12)
    first, second = 1.0 / (1.0 + K) ** 2, (1.0 + 2.0 * K) / (1.0 + K) ** 2
    M = levels(ZVD, NONE, NONE, 1.0, sigma, omega, 0.5 * math.pi)
    assert list(M) == pytest.approx([first, first, second, second], rel=1e-12)


SHARES = st.sampled_from([0.0, 0.01, 0.1, 0.5])


@given(st.sampled_from([ZV, ZVD]), st.floats(0.0, 1.0), SHARES, SHARES, st.floats(0.7, 1.4))
@settings(max_examples=60, deadline=None)
def test_nothing_swings_after_the_last_step(
    order: int, impact: float, ratio: float, lag: float, length: float
) -> None:
    """With any impact, damping, lag and duration, on the exact plant; a lag has to die out first."""
    free = CRANE.replace(minimum_torque=-1e4, maximum_torque=1e4, contact_law="dead-zone")
    damped = free.replace(damping=2.0 * ratio * CRANE.c / CRANE.Omega, torque_lag=lag / CRANE.Omega)
    drive = on_the_flank(damped, impact)
    _, omega, _ = model(drive)
    a = length * 0.5 * math.pi / omega
    assume(min(steps(drive, order, a)) >= 0.0)  # the shaft would let go
    assert left_over(drive, order, a, wait=45.0 * drive.torque_lag) < 1e-9


@pytest.mark.parametrize("error", [-0.3, 0.2])
def test_what_is_left_is_the_sensitivity_curve_of_the_textbook(error: float) -> None:
    """|cos(pi x/2)| for ZV, its square for ZVD, x = true over assumed frequency; of the step's own swing."""
    nominal = on_the_flank(CRANE.replace(load_torque=0.0), 0.0)
    plant = nominal.replace(stiffness=CRANE.c * (1 + error) ** 2)
    a = 0.5 * math.pi / nominal.Omega
    curve = abs(math.cos(0.5 * math.pi * (1 + error)))
    assert left_over(nominal, ZV, a, plant) == pytest.approx(curve, rel=1e-9)
    assert left_over(nominal, ZVD, a, plant) == pytest.approx(curve**2, rel=1e-8)


@pytest.mark.parametrize(("order", "power"), [(ZV, 1), (ZVD, 2)])
@pytest.mark.parametrize("impact", [0.0, 0.6])
def test_an_error_of_the_frequency_is_felt_in_the_second_order_under_a_lag_too(
    order: int, power: int, impact: float
) -> None:
    """With half the error ZV leaves half the swing, ZVD a quarter, from rest and after an impact."""
    free = CRANE.replace(minimum_torque=-1e4, maximum_torque=1e4, contact_law="dead-zone")
    nominal = on_the_flank(free.replace(torque_lag=0.3 / CRANE.Omega), impact)
    plants = [nominal.replace(stiffness=CRANE.c * (1.0 + error) ** 2) for error in (0.01, 0.005)]
    a, wait = 0.5 * math.pi / nominal.Omega, 45.0 * nominal.torque_lag
    whole, half = (left_over(nominal, order, a, plant, wait) for plant in plants)
    assert math.log2(whole / half) == pytest.approx(power, abs=0.02)


@given(st.sampled_from([ZV, ZVD]), st.floats(0.0, 1.2), st.floats(-1.5, 1.5), st.floats(0.0, 0.4))
@settings(max_examples=200, deadline=None)
def test_planned_levels_rise_and_keep_the_torque_in_its_range(
    order: int, T: float, rate: float, ratio: float
) -> None:
    """From any state: K_dyn = 1 as far as the state allows, checked by following the levels in fine steps."""
    sigma, omega, h = -ratio / math.sqrt(1.0 - ratio**2), 1.0, 0.05
    W = vector(T, rate, 1.0, sigma, omega, 0.0, 0.0)
    D = sensitivity(rate, T, 1.0 / (1.0 + sigma**2), sigma, omega, 0.0, 0.0)
    n, *M = plan_levels(order, W, D, 0.0, 1.0, sigma, omega, h)
    assume(n > 0)
    assert all(later >= earlier - 2e-9 for earlier, later in itertools.pairwise([0.0, *M, 1.0]))
    z, v, seen = T, rate, [T]
    for level in M[:order]:
        for _ in range(20 * n):
            z, v = oscillation(z, v, level, sigma, omega, h / 20)
            seen.append(z)
    assert (z, v) == pytest.approx((1.0, 0.0), abs=1e-9)
    assert min(seen) > -0.021
    assert max(seen) < max(T, 1.0) + 0.021


# the start -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("shaper", ["zv", "zvd"])
@pytest.mark.parametrize("drive", CRANES, ids=range(8))
def test_starts_without_a_swing(drive: Drive, shaper: str) -> None:
    """K_dyn at most 1.03; the light active load falls into the gap of 2 rad: 1.25 (zv), 1.07 (zvd)."""
    run = simulate(drive, Shaped(shaper=shaper))
    falls = drive.gap == 2.0 and drive.load_kind == "active"
    assert run.k_dyn < (1.3 if falls else 1.03)
    assert run.contacts == 1
