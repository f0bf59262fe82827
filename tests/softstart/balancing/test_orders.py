"""Torques and forces by order: exact courses, independent statics, and the textbook's engines."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.softstart.balancing.engines import ORDERS, RPM, engine

from softstart.balancing import Counterweights
from softstart.balancing.engine import ORDERS as HALVES
from softstart.balancing.engine import TURNS, force_at, largest_of_orders
from softstart.balancing.slider_crank import acceleration_harmonics

PHI = np.linspace(0.0, 4.0 * np.pi, 361)
W = 4000.0 * RPM
lengths = st.fixed_dictionaries(
    {"stroke": st.floats(0.04, 0.2), "rod_length": st.floats(0.12, 0.4), "bore": st.floats(0.04, 0.2)}
)
orders = st.sampled_from(sorted(ORDERS.values()))


@settings(max_examples=20, deadline=None)
@given(lengths, orders)
def test_orders_make_up_the_inertia_torque(geometry, order):
    made = engine(order, **geometry)
    series = (np.exp(1j * np.outer(PHI, HALVES)) @ (W**2 * made.inertia_harmonics)).real
    exact = made.inertia_torque(PHI, W)
    scale = len(order) * made.masses.reciprocating * (made.cylinders.crank.r * W) ** 2
    # 24 orders: what is beyond falls with the 24th power of half the ratio
    assert series == pytest.approx(exact, abs=scale * (1e-12 + made.cylinders.crank.ratio**22))


@settings(max_examples=20, deadline=None)
@given(lengths, orders, st.floats(10.0, 1000.0))
def test_inertia_does_no_work_over_a_cycle_and_is_the_loss_of_kinetic_energy(geometry, order, w):
    made = engine(order, **geometry)
    n = 4096
    phi = 4.0 * np.pi * np.arange(n) / n
    torque = made.inertia_torque(phi, w)
    assert torque.mean() == pytest.approx(0.0, abs=1e-12 * np.abs(torque).max())
    assert made.inertia_harmonics[0] == 0.0
    # T = -dE/dphi, E the kinetic energy of the pistons, differentiated by FFT
    energy = np.zeros(n)
    for firing in made.cylinders.firing_angles:
        energy += 0.5 * made.masses.reciprocating * (made.cylinders.crank.slope(phi - firing) * w) ** 2
    rate = np.fft.ifft(0.5j * np.fft.fftfreq(n, 1.0 / n) * np.fft.fft(energy)).real
    scale = 0.5 * len(order) * made.masses.reciprocating * (made.cylinders.crank.r * w) ** 2
    assert torque == pytest.approx(-rate, abs=1e-9 * scale)


@pytest.mark.parametrize("order", ORDERS.values())
def test_reaction_torque_by_the_side_forces_of_the_pistons(order):
    # Independent statics: the side force of each piston, F tan(beta) at its height, is all that turns the
    # housing about the crank axis: bearing forces pass through it.
    made = engine(order)
    crank, cylinders = made.cylinders.crank, made.cylinders
    moment = np.zeros(PHI.size)
    for firing in cylinders.firing_angles:
        phi = PHI - firing
        beta = np.arcsin(crank.ratio * np.sin(phi))
        push = (made.pressure(np.mod(phi, 4 * np.pi), W) - made.gas.crankcase_pressure) * cylinders.area
        push += made.masses.reciprocating * W**2 * crank.curvature(phi)  # what the rod bears, downwards
        moment += push * np.tan(beta) * crank.height(phi)
    assert made.torque(PHI, W) == pytest.approx(moment, abs=1e-10 * np.abs(moment).max())


@pytest.mark.parametrize("order", ORDERS.values())
def test_forces_are_the_loss_of_momentum(order):
    shares = Counterweights(0.3, 0.8)
    made = engine(order, weights=shares)
    m, rotating = made.masses.reciprocating, made.masses.rotating
    crank = made.cylinders.crank
    force, couple = np.zeros(PHI.size, complex), np.zeros(PHI.size, complex)
    for firing, place in zip(made.cylinders.firing_angles, made.cylinders.places, strict=True):
        phi = PHI - firing
        one = -m * crank.curvature(phi) + (0.2 * rotating - 0.3 * m) * crank.r * np.exp(1j * phi)
        force, couple = force + one, couple + place * one
    found, turning = made.crank_shaking
    scale = len(order) * m * crank.r
    assert force_at(found, PHI) == pytest.approx(force, abs=1e-12 * scale)
    assert force_at(turning, PHI) == pytest.approx(couple, abs=1e-12 * scale)


@pytest.mark.parametrize("order", ORDERS.values())
def test_gas_torque_has_orders_of_half_the_cylinders(order):
    # [B](2): sum M = z A0 + z sum_k A_{kz/2} cos + B_{kz/2} sin
    z, one = len(order), engine((1,)).gas_harmonics(W)
    found = engine(order).gas_harmonics(W)
    kept = np.arange(found.size) % z == 0
    assert found[kept] == pytest.approx(z * one[kept], rel=1e-12)
    assert np.all(found[~kept] == 0.0)


@pytest.mark.parametrize("order", [(1,), (1, 3, 4, 2)])
def test_gas_orders_agree_with_an_fft_that_is_refined(order):
    made = engine(order)
    errors = []
    for n in (720, 2880):
        phi = 4.0 * np.pi * np.arange(n) / n
        fft = 2.0 / n * np.fft.rfft(made.gas_torque(phi, W))[1:13]
        errors.append(float(np.abs(fft - made.gas_harmonics(W)[1:13]).max()))
    scale = float(np.abs(made.gas_harmonics(W)).max())
    assert errors[1] < 1e-5 * scale
    # kinks of the torque: second order, until rounding
    assert errors[1] < 0.1 * errors[0] or errors[1] < 1e-12 * scale


# the textbook's engines --------------------------------------------------------------------------------


def first_and_second(made):
    force, couple = made.crank_shaking
    unit = made.masses.reciprocating * made.cylinders.crank.r
    return largest_of_orders(force)[1:3] / unit, largest_of_orders(couple)[1:3] / (
        unit * made.cylinders.spacing
    )


A2 = acceleration_harmonics(0.042 / 0.14, 2)[2]


def test_single_cylinder_and_half_of_it_on_the_crank():
    force, _ = first_and_second(engine((1,)))
    assert force == pytest.approx([1.0, A2], rel=1e-12)
    half = engine((1,), weights=Counterweights(0.5, 1.0))
    shaking = half.crank_shaking[0]
    assert shaking[1] == pytest.approx(0.0, abs=1e-18)
    # what is left turns against the crank with constant size m r/2
    left = force_at(np.where(abs(TURNS) < 2, shaking, 0.0), PHI)
    assert np.abs(left) == pytest.approx(0.5 * 0.5 * 0.042, rel=1e-12)
    assert np.unwrap(np.angle(left)) == pytest.approx(-PHI, abs=1e-9)


def test_two_and_four_cylinders() -> None:
    together, opposite = engine((1, 2)), engine(firing_angles=(0.0, math.pi))
    for made, forces, couples in (
        (together, [2.0, 2.0 * A2], [0.0, 0.0]),
        (opposite, [0.0, 2.0 * A2], [1.0, 0.0]),
        (engine((1, 3, 4, 2)), [0.0, 4.0 * A2], [0.0, 0.0]),
    ):
        force, couple = first_and_second(made)
        assert force == pytest.approx(forces, abs=1e-12)
        assert couple == pytest.approx(couples, abs=1e-12)


# units -------------------------------------------------------------------------------------------------


@settings(max_examples=20, deadline=None)
@given(st.floats(0.1, 10.0), st.floats(0.1, 10.0))
def test_size_and_speed_scale_as_their_dimensions(k, speed):
    # lengths times k: inertia torque times k^2, force times k, gas torque (pressure times volume) times k^3
    small, large = (engine((1, 2), bore=0.08 * f, stroke=0.084 * f, rod_length=0.14 * f) for f in (1.0, k))
    assert large.inertia_harmonics == pytest.approx(k**2 * small.inertia_harmonics, rel=1e-12)
    assert large.gas_harmonics(W) == pytest.approx(k**3 * small.gas_harmonics(W), rel=1e-9, abs=1e-12)
    assert large.crank_shaking[0] == pytest.approx(k * small.crank_shaking[0], rel=1e-12)
    assert small.inertia_torque(PHI, speed * W) == pytest.approx(speed**2 * small.inertia_torque(PHI, W))
