"""Starts of chains against an independent integration: DOP853 between located events."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from tests.softstart.chain.oracle_starts import both, differences, random_chain, with_losses

from softstart import Run

SEEDS = st.integers(0, 2**32 - 1)


def examples(count: int) -> settings:
    return settings(
        max_examples=count, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow]
    )


def balanced(run: Run) -> None:
    """The energy balance closes, and gears take energy only."""
    energy = run.energy
    moved = abs(energy.motor) + abs(energy.exciting) + abs(energy.kinetic) + abs(energy.load)
    assert abs(energy.residual) < 1e-11 * moved
    assert energy.gears >= -1e-14 * moved


def agree(drawn: dict[str, Any]) -> Run:
    """The start of the kernel, which the oracle confirms."""
    run, oracle = both(**drawn)
    found = differences(run, oracle)
    assert max(found.values()) < 1e-8, found
    balanced(run)
    return run


@given(seed=SEEDS, count=st.integers(2, 8))
@examples(6)
def test_random_chains(seed, count):
    """Gaps, damping, all contact laws, friction on any mass, lag, slew limit, excitation, motor anywhere."""
    agree(random_chain(np.random.default_rng(seed), count))


@given(seed=SEEDS, count=st.integers(2, 6))
@examples(4)
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


@given(seed=SEEDS, count=st.integers(2, 5))
@example(141, 5)  # flanks that overlap meet again with T = 0 but for rounding, whose sign means nothing
@examples(4)
def test_gears_with_losses(seed, count):
    """Gears on either side of their shafts, gaps, all contact laws, friction, masses held by gears."""
    rng = np.random.default_rng(seed)
    agree(with_losses(rng, random_chain(rng, count)))


@given(seed=SEEDS, count=st.integers(2, 8), rigid=st.booleans())
@settings(max_examples=60, deadline=None, derandomize=True)
def test_a_gear_never_gives_energy(seed, count, rigid):
    """And the balance closes, with impacts of rigid gaps beside the gears too; nothing is lost at eta = 1."""
    rng = np.random.default_rng(seed)
    drawn = with_losses(rng, random_chain(rng, count, rigid))
    run = both(**drawn, check=False)[0]
    balanced(run)
    assert (drawn["efficiency"] < 1.0).any() or run.energy.gears == 0.0


def held_at(drawn: dict[str, Any], end: int) -> dict[str, Any]:
    """The chain with its first (0) or last (-1) mass held fast, motor and load on masses that move."""
    count = drawn["J"].size
    J, w0, Mc = drawn["J"].copy(), drawn["w0"].copy(), drawn["Mc"].copy()
    J[end], w0[end], Mc[end] = math.inf, 0.0, 0.0
    motor = min(max(drawn["motor"], 1), count - 1) if end == 0 else min(drawn["motor"], count - 2)
    return drawn | {"J": J, "w0": w0, "Mc": Mc, "motor": motor, "load": -1 if end == 0 else -2}


@given(seed=SEEDS, count=st.integers(3, 6), end=st.sampled_from([0, -1]))
@examples(4)
def test_a_chain_held_at_an_end(seed, count, end):
    agree(held_at(random_chain(np.random.default_rng(seed), count), end))


@given(seed=SEEDS, count=st.integers(2, 5), by_angle=st.booleans())
@examples(5)
def test_load_curves(seed, count, by_angle):
    """Torques over speed or angle, falling and rising, on up to two masses; reactive loads, lag and gaps."""
    rng = np.random.default_rng(seed)
    drawn = random_chain(rng, count)
    run = both(**drawn, check=False)[0]
    w = run.at(np.linspace(0.0, drawn["t_end"], 50))
    curves = {}
    for i in {int(rng.integers(count)), count - 1}:
        course = w["phi" if by_angle else "w"][:, i]
        size = max(float(np.ptp(course)), 1e-3)
        points = course.min() + size * np.sort(rng.uniform(-0.1, 1.1, 4)) + size * 0.02 * np.arange(4)
        curves[i] = (points, rng.uniform(-0.2, 0.5, 4) * drawn["pieces"][0][1], by_angle)
    agree(drawn | {"curves": curves})


@given(seed=SEEDS, share=st.floats(-0.9, 0.9))
@examples(3)
def test_torque_at_the_start_behind_a_lag(seed, share):
    drawn = random_chain(np.random.default_rng(seed), 3)
    drawn |= {"lag": 0.05 * drawn["t_end"], "u0": share * drawn["pieces"][0][1]}
    agree(drawn)
    agree(drawn | {"lag": 0.0, "rate": 8.0 * drawn["pieces"][0][1] / drawn["t_end"]})
