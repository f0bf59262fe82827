"""The shared pieces of the sampled controllers."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as some
from tests.controllers.starts import CRANE

from softstart.kernel.motor import encoder_count
from softstart_controllers.sampled import mean_torque, patience

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


@given(torques, torques)
def test_mean_torque_without_lag_is_the_demand(before: float, demand: float) -> None:
    assert mean_torque(before, demand, demand) == demand


@given(torques, torques, torques)
def test_mean_torque_lies_between_its_ends_and_the_demand(before: float, after: float, demand: float) -> None:
    low, high = min(before, after, demand), max(before, after, demand)
    assert low - 1e-9 <= mean_torque(before, after, demand) <= high + 1e-9


def test_ideal_encoder_has_no_count() -> None:
    assert encoder_count(0) == 0.0
    assert encoder_count([0, 1]).tolist() == [0.0, math.pi / 2]


def test_patience_outlasts_every_start_of_the_crane() -> None:
    assert patience(CRANE) > 10 * 0.3735
