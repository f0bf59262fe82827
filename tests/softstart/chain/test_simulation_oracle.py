"""The start of a chain against an independent integration: DOP853 between located events."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from tests.softstart.chain.oracle_starts import both, differences, random_chain

from softstart.chain import Chain


@given(seed=st.integers(0, 2**32 - 1), count=st.integers(2, 8))
@settings(max_examples=6, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow])
def test_random_chains(seed, count):
    """Gaps, damping, all contact laws, friction on any mass, lag, slew limit, excitation, motor anywhere."""
    run, oracle = both(**random_chain(np.random.default_rng(seed), count))
    found = differences(run, oracle)
    assert max(found.values()) < 1e-8, found
    energy = run.energy
    moved = abs(energy.motor) + abs(energy.exciting) + abs(energy.kinetic) + abs(energy.load)
    assert abs(energy.residual) < 1e-11 * moved


@given(seed=st.integers(0, 2**32 - 1), count=st.integers(2, 6))
@settings(max_examples=4, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow])
def test_random_chains_with_a_rigid_gap(seed, count):
    """The same with one gap that closes by impacts; the oracle cannot follow impacts that pile up."""
    drawn = random_chain(np.random.default_rng(seed), count, rigid=True)
    try:
        run, oracle = both(**drawn)
    except RuntimeError:
        assert drawn["restitution"][~np.isnan(drawn["restitution"])][0] < 1.0
        return
    found = differences(run, oracle)
    assert max(found.values()) < 1e-8, found


@pytest.mark.parametrize("reactive", [False, True])
def test_four_masses_with_three_gaps(reactive):
    """The shipped chain at full torque: peaks, instants and final state to 1e-8 over dozens of contacts."""
    arrays = Chain.load("crane-4-mass").at_motor_shaft()
    nothing = np.zeros(4)
    run, oracle = both(
        J=np.array(arrays.J), c=np.array(arrays.c), d=np.array(arrays.d), gap=np.array(arrays.gap),
        law=list(arrays.law), restitution=np.full(3, math.nan), theta0=np.zeros(3), w0=nothing,
        Mc=np.array(arrays.Mc), reactive=np.array([False, False, False, reactive]), ground=nothing, tones=[],
        pieces=[(0.0, 62.0)], lag=0.0, rate=math.inf, motor=0, t_end=0.15, target=5.0,
    )  # fmt: skip
    assert len(run.events) > 25
    found = differences(run, oracle)
    assert max(found.values()) < 1e-8, found
