"""ramp and s-curve: the torque is the documented one, sample by sample; the mean of a lagging torque."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as some
from tests.controllers.starts import CRANE

from softstart import simulate
from softstart.controller import CompiledController, make_controller
from softstart_controllers.ramp import Ramp
from softstart_controllers.s_curve import SCurve
from softstart_controllers.sampled import mean_torque

PERIOD = 0.001
MIDDLES = (np.arange(250) + 0.5) * PERIOD


def demand(controller: CompiledController) -> np.ndarray:
    """Torque held in each of the first 250 samples, N m; without lag it is the demand."""
    return simulate(CRANE, controller).at(MIDDLES)["u"]


@pytest.mark.parametrize("time", [0.0, 0.1234])
def test_ramp_is_a_straight_line_held_for_a_period(time: float) -> None:
    t = np.arange(250) * PERIOD
    share = np.minimum(1.0, t / time) if time else np.ones(250)
    assert np.allclose(demand(Ramp(initial=10.0, time=time)), 10.0 + 52.0 * share, rtol=0, atol=1e-12)


@pytest.mark.parametrize("rounding", [0.3, 1.0])
def test_s_curve_is_the_double_integral_of_its_jerk(rounding: float) -> None:
    """Jerk +j in the first rounded end, -j in the last one, 0 between: integrated numerically."""
    time, end = 0.1, 0.5 * rounding
    x = np.linspace(0.0, 1.0, 100_001)
    rate = np.minimum(1.0, np.minimum(x, 1 - x) / end) if end else np.ones_like(x)
    s = np.concatenate([[0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]))])
    course = np.interp(np.arange(250) * PERIOD / time, x, s / s[-1])
    got = demand(SCurve(initial=5.0, time=time, rounding=rounding))
    assert np.allclose(got, 5.0 + 57.0 * course, rtol=0, atol=1e-6)


@pytest.mark.parametrize("cls", [Ramp, SCurve])
def test_begins_with_a_braking_load_and_never_below_zero(cls: type[Ramp] | type[SCurve]) -> None:
    assert cls().fitted(CRANE).initial == 7.16
    assert cls().fitted(CRANE.replace(load_torque=-3.0)).initial == 0.0


@pytest.mark.parametrize("cls", [Ramp, SCurve])
def test_active_load_does_not_run_back_in_a_closed_drive(cls: type[Ramp] | type[SCurve]) -> None:
    """Started in contact with the twist that carries the load, u >= Mc keeps T >= Mc."""
    carrying = CRANE.replace(start_position=0.25 + 7.16 / 368.465)
    assert simulate(carrying, cls()).w2.min() >= -1e-9


@pytest.mark.parametrize(("cls", "overshoot"), [(Ramp, 0.02), (SCurve, 0.01)])
def test_whole_elastic_periods_leave_no_oscillation_in_a_closed_drive(
    cls: type[Ramp] | type[SCurve], overshoot: float
) -> None:
    """The sampled staircase, 112 steps, leaves little: K_dyn = 1 is the mean torque under Ms."""
    carrying = CRANE.replace(start_position=0.25 + 7.16 / 368.465)
    assert 1.0 <= simulate(carrying, cls()).k_dyn < 1.0 + overshoot
    assert simulate(carrying, cls(time=0.5 * CRANE.elastic_period)).k_dyn > 1.2


torques = some.floats(-1000, 1000)


@given(torques, torques, some.floats(0.01, 30))
def test_mean_torque_is_exact_for_any_lag(before: float, demand: float, samples: float) -> None:
    """`samples` sample periods per lag: the closed-form mean of an exponential."""
    tail = math.exp(-samples)
    after = demand + (before - demand) * tail
    exact = demand + (before - demand) * (1 - tail) / samples
    # the end value is given to its last bit only, which says little of its distance from the demand
    away = abs(before - demand)
    blurred = 2**-52 * abs(demand) / (tail * away) if away else 0.0
    tolerance = (2e-6 + min(1.0, blurred)) * away + 1e-9
    assert mean_torque(before, after, demand) == pytest.approx(exact, rel=1e-9, abs=tolerance)


@pytest.mark.parametrize(("elastic", "period"), [(0.1, 1e-3), (0.033, 1e-3), (0.016, 0.5e-3)])
def test_a_stiff_drive_is_sampled_32_times_an_elastic_period(elastic: float, period: float) -> None:
    stiff = CRANE.replace(stiffness=0.035 * 0.175 / 0.21 * (2.0 * math.pi / elastic) ** 2)
    for name in ("ramp", "shaped", "state-feedback"):
        assert make_controller(name).defaults(stiff)["period"] == pytest.approx(period, rel=1e-12)
