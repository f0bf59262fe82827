"""Balancer shafts: what they do, what the designs leave, and engines that need others."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.softstart.balancing.engines import RPM, engine

from softstart.balancing import BalancerShaft, Counterweights, Engine, balance
from softstart.balancing.design import balancer_arm, free_force, two_shafts
from softstart.balancing.engine import ORDERS, TURNS, force_at, largest_of_orders, shaking_of_shafts
from softstart.balancing.slider_crank import inertia_torque_harmonics
from softstart.errors import InputError

VAZ = Engine.load("vaz-11113")
HALF = Counterweights(0.5, 1.0)
PHI = np.linspace(0.0, 2.0 * np.pi, 181)


def forces_and_moment(shafts, phi, w):
    """By vectors: each mass on its circle, its force, and place x force about the crank."""
    force, moment = np.zeros(phi.size, complex), np.zeros(phi.size)
    for one in shafts:
        pull = one.imbalance * (one.ratio * w) ** 2 * np.exp(1j * (one.ratio * phi + one.phase))
        up, side = pull.real, pull.imag
        force = force + pull
        moment += one.height * side - one.offset * up
    return force, moment


RATIOS, PLACES = st.sampled_from([-3, -2, -1, 1, 2, 3]), st.floats(-0.3, 0.3)
shafts = st.lists(
    st.builds(BalancerShaft, st.floats(1e-3, 0.1), RATIOS, st.floats(-4.0, 4.0), PLACES, PLACES),
    min_size=1,
    max_size=4,
)


@settings(max_examples=40, deadline=None)
@given(shafts)
def test_forces_and_moment_of_shafts(some):
    force, _, moment = shaking_of_shafts(some)
    exact_force, exact_moment = forces_and_moment(some, PHI, 1.0)
    assert force_at(force, PHI) == pytest.approx(exact_force, abs=1e-13)
    course = (np.exp(1j * np.outer(PHI, ORDERS)) @ moment).real
    assert course == pytest.approx(exact_moment, abs=1e-13)


@settings(max_examples=15, deadline=None)
@given(
    st.integers(1, 2), st.floats(0.15, 0.3), st.floats(0.05, 0.15), st.floats(0.0, 1.0), st.floats(0.0, 6.28)
)
def test_the_complete_design_leaves_nothing_of_first_order(count, rod, stroke, load, turn):
    # throws at any angle to the crank angle 0, so that the phase of the shafts matters too
    angles = [(turn + 2.0 * math.pi * i) % (4.0 * math.pi) for i in range(count)]
    made = engine(firing_angles=angles, weights=HALF, rod_length=rod, stroke=stroke)
    w = 3000.0 * RPM
    pair = two_shafts(made, balancer_arm(made, w, load))
    of_shafts, _, moment = shaking_of_shafts(pair)
    unit = count * made.masses.reciprocating * made.cylinders.crank.r
    assert largest_of_orders(made.crank_shaking[0] + of_shafts)[1] < 1e-14 * unit * 10
    left = -made.torque_harmonics(w, load)[2] + w**2 * moment[2]
    assert abs(left) < 1e-11 * abs(made.torque_harmonics(w, load)[2])


def test_residuals_are_those_of_the_shafts_themselves():
    found = balance(VAZ, ["4500 rpm"])
    i = found.tuning_index
    w = found.tuning_speed
    for name in ("inertia-only", "fixed-h", "fixed-h-e"):
        one = found.residual(name)
        own = balance(replace(VAZ, shafts=one.shafts), ["4500 rpm"]).residual("own-shafts")
        assert own.first_order_moment[i] == pytest.approx(one.first_order_moment[i], abs=1e-9)
        assert own.moment[i] == pytest.approx(one.moment[i], rel=1e-12)
        assert own.force[i] == pytest.approx(one.force[i], rel=1e-12)
        # and over the crank angle, by vectors
        force, moment = forces_and_moment(one.shafts, PHI, w)
        fine = moment - VAZ.torque(PHI, w)
        first = 2.0 * np.mean((fine * np.exp(-1j * PHI))[:-1])
        # 180 samples of the gas torque
        assert abs(first) == pytest.approx(one.first_order_moment[i], abs=5e-3)
        crank = w**2 * force_at(np.where(abs(TURNS) < 2, VAZ.crank_shaking[0], 0.0), PHI)
        assert np.abs(force + crank).max() < 1e-9


def test_designs_as_in_b():
    found = balance(VAZ)
    i, w = found.tuning_index, found.tuning_speed
    fixed, variable, both = (found.residual(name) for name in ("fixed-h", "variable-h", "variable-h-e"))
    first = VAZ.torque_harmonics(w)[2]
    a, b = first.real, -first.imag
    F_b = found.imbalance * w**2
    assert fixed.height[i] == pytest.approx(b / F_b, rel=1e-13)  # M_b = h F_b equals the sine
    assert both.offset[i] == pytest.approx(a / F_b, rel=1e-13)
    assert fixed.first_order_moment[i] == pytest.approx(abs(a), rel=1e-12)
    assert np.all(both.first_order_moment < 1e-11)
    assert variable.first_order_moment_sine == pytest.approx(0.0, abs=1e-11)
    assert fixed.first_order_moment_sine[i] == pytest.approx(0.0, abs=1e-11)
    assert np.all(np.abs(np.delete(fixed.first_order_moment_sine, i)) > 1e-3)  # complete at one speed only
    # h(n) falls: its product with n^2 is the sine of the torque
    assert np.all(np.diff(variable.height) < 0.0)


def test_inertia_only_leaves_the_gas():
    found = balance(VAZ)
    alone = found.residual("inertia-only")
    gas = [abs(VAZ.gas_harmonics(float(w))[2]) for w in found.speeds]
    assert alone.first_order_moment == pytest.approx(gas, rel=1e-12)
    # h = 2 r B_1: the masses cancel out
    B_1 = inertia_torque_harmonics(35.5 / 121, 1)[1]
    assert alone.height == pytest.approx(2.0 * 0.0355 * B_1, rel=1e-12)
    heavy = balance(Engine.load("vaz-11113", also={"masses.reciprocating": 2.0})).residual("inertia-only")
    assert heavy.height == pytest.approx(alone.height, rel=1e-12)


@pytest.mark.parametrize("throws", [(0, 240, 120), (0, 270, 135, 360, 50)], ids=str)
def test_couples_count_like_forces(throws):
    """sum m r w^2 A_n exp(i n alpha) z over the cylinders; shafts take the first order, half each."""
    made = replace(engine(firing_angles=np.radians(throws)), gas=None)
    w, r, z = 6000.0 * RPM, 0.042, np.array(made.cylinders.places)
    A = {1: 1.0, 2: 0.3 + 0.3**3 / 4 + 15 * 0.3**5 / 128 + 0.3**7 * 35 / 512, 4: -(0.3**3) / 4}
    exact = {n: abs(0.5 * r * w**2 * A[n] * np.exp(1j * n * np.radians(throws)) @ z) for n in A}
    found = balance(made)
    told = {row["order"]: row["couple"] for row in found.orders()}
    for n, couple in exact.items():
        assert told.get(n, 0.0) == pytest.approx(couple, rel=2e-4 if n < 4 else 0.1, abs=1e-9)
    i = found.tuning_index
    half, none = (found.residual(name) for name in ("couple-shaft", "two-couple-shafts"))
    assert half.first_order_couple[i] == pytest.approx(0.5 * exact[1], rel=1e-12)
    assert none.first_order_couple[i] < 1e-12 * exact[1]
    assert none.first_order_force == pytest.approx(found.residual("none").first_order_force, rel=1e-12)
    fitted = replace(made, shafts=found.residual("couple-shaft").shafts, counterweights=HALF)
    assert balance(fitted).residual("own-shafts").first_order_couple[i] < 1e-12 * exact[1]


def test_a_four_cylinder_engine_has_nothing_for_two_shafts_at_crank_speed():
    made = engine((1, 3, 4, 2))
    found = balance(made)
    assert [one.name for one in found.residuals] == ["none"]
    assert "nothing to balance" in found.note
    with pytest.raises(InputError, match="gives the gas torque; add one"):
        replace(made, gas=None).torque(PHI, 300.0)
    assert free_force(made) == 0.0


def test_speed_fluctuation_by_the_energy():
    w = 2000.0 * RPM
    phi = np.linspace(0.0, 4.0 * np.pi, 20001)
    torque = VAZ.torque(phi, w)
    step = phi[1] - phi[0]
    excess = np.concatenate([[0.0], np.cumsum(0.5 * (torque[1:] + torque[:-1]) * step)])
    excess -= excess[-1] * phi / phi[-1]
    expected = np.ptp(excess) / (VAZ.masses.inertia * w**2)
    assert VAZ.speed_fluctuation(w) == pytest.approx(expected, rel=1e-4)  # 24 orders
    assert engine().speed_fluctuation(w) is None


def test_bad_arguments_are_refused():
    for arguments, says in (({"speeds": ["4500 Hz"]}, "Hz is a frequency"), ({"load": 2.0}, "from 0 to 1")):
        with pytest.raises(InputError, match=says):
            balance(VAZ, **arguments)
    with pytest.raises(InputError, match="none, inertia-only"):
        balance(VAZ).residual("some")
