"""Natural frequencies, shapes, nodes and Holzer tables against independent computations."""

from __future__ import annotations

import math
from decimal import Decimal, getcontext
from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import eigh

from softstart.chain import Chain, Mass, Shaft, natural_vibration
from softstart.chain.vibration import elastic_frequencies, partial_systems, shapes, squared_frequencies
from softstart.errors import InputError

Vector = NDArray[np.float64]


def stiffness_matrix(c: Vector) -> Vector:
    K = np.zeros((c.size + 1, c.size + 1))
    for k, stiffness in enumerate(c):
        K[k : k + 2, k : k + 2] += stiffness * np.array([[1.0, -1.0], [-1.0, 1.0]])
    return K


def random_chain(rng: np.random.Generator, n: int, decades: float) -> tuple[Vector, Vector]:
    return 10 ** rng.uniform(-decades, decades, n), 10 ** rng.uniform(-decades, decades, n - 1)


@pytest.mark.parametrize("n", [2, 3, 4, 7, 12, 20])
def test_frequencies_are_those_of_a_dense_solver(n: int) -> None:
    rng = np.random.default_rng(n)
    for _ in range(20):
        J, c = random_chain(rng, n, 0.7)
        dense = np.sqrt(eigh(stiffness_matrix(c), np.diag(J), eigvals_only=True)[1:])
        np.testing.assert_allclose(elastic_frequencies(J, c), dense, rtol=1e-10)


def test_frequencies_of_equal_masses_and_springs() -> None:
    """Closed form: 2 sqrt(c/J) sin(k pi/(2 n))."""
    n = 200
    found = elastic_frequencies(np.full(n, 0.25), np.full(n - 1, 9.0))
    exact = [2.0 * 6.0 * math.sin(k * math.pi / (2 * n)) for k in range(1, n)]
    np.testing.assert_allclose(found, exact, rtol=1e-14)


def count_below(J: list[Decimal], c: list[Decimal], square: Decimal) -> int:
    """How many natural frequencies, the rigid one among them, lie below: signs of the pivots of K - w^2 J."""
    count, pivot = 0, Decimal(0)
    for k in range(len(J)):
        diagonal = (c[k - 1] if k else 0) + (c[k] if k < len(c) else 0) - square * J[k]
        pivot = Decimal(diagonal) - (c[k - 1] * c[k - 1] / pivot if k else 0)
        count += pivot < 0
    return count


@pytest.mark.parametrize("seed", range(4))
def test_frequencies_keep_their_digits_over_many_decades(seed: int) -> None:
    """80 digits: each frequency lies within 4e-15 of itself; a dense solver keeps none of the lowest."""
    getcontext().prec = 80
    rng = np.random.default_rng(seed)
    J, c = random_chain(rng, 9, 5.0)
    exact_J, exact_c = [Decimal(float(x)) for x in J], [Decimal(float(x)) for x in c]
    for i, w in enumerate(elastic_frequencies(J, c)):
        low, high = (Decimal(float(w)) * Decimal(1 + side) for side in (-4e-15, 4e-15))
        assert count_below(exact_J, exact_c, low * low) <= i + 1 < count_below(exact_J, exact_c, high * high)


@pytest.mark.parametrize("decades", [1.0, 6.0])
def test_shapes_are_orthogonal_and_give_their_frequency_back(decades: float) -> None:
    rng = np.random.default_rng(3)
    for n in (2, 3, 8, 20, 40):
        J, c = random_chain(rng, n, decades)
        omega = elastic_frequencies(J, c)
        x = shapes(J, c, omega)
        assert np.abs(x).max(axis=1) == pytest.approx(np.ones(n - 1))
        normal = x * np.sqrt(J) / np.sqrt((x * x) @ J)[:, None]
        np.testing.assert_allclose(normal @ normal.T, np.eye(n - 1), atol=1e-12)
        np.testing.assert_allclose(normal @ np.sqrt(J) / math.sqrt(J.sum()), 0.0, atol=1e-12)  # no momentum
        rayleigh = np.sqrt((np.diff(x, axis=1) ** 2 @ c) / ((x * x) @ J))
        np.testing.assert_allclose(rayleigh, omega, rtol=1e-12)


def test_the_rigid_mode_is_exactly_zero_and_flat() -> None:
    vibration = natural_vibration(Chain.load("tractor-like"))
    assert vibration.Omega[0] == 0.0
    assert np.all(vibration.shape[0] == 1.0)
    assert np.all(vibration.torque[0] == 0.0)
    assert vibration.nodes[0] == ()


def test_torques_balance_every_mass() -> None:
    """J Omega^2 x is what the shaft behind carries more than the one before; both equal c times the twist."""
    vibration = natural_vibration(Chain.load("tractor-like"))
    arrays = vibration.chain.at_motor_shaft()
    for Omega, x, torque in zip(vibration.Omega, vibration.shape, vibration.torque, strict=True):
        net = np.diff(np.concatenate([[0.0], torque, [0.0]]))
        scale = np.abs(arrays.J * Omega**2 * x).max() + 1e-300
        np.testing.assert_allclose(net / scale, arrays.J * Omega**2 * x / scale, atol=1e-12)
        np.testing.assert_allclose(torque / scale, arrays.c * (x[:-1] - x[1:]) / scale, atol=1e-9)


def test_mode_m_has_m_nodes_and_they_rest() -> None:
    vibration = natural_vibration(Chain.load("tractor-like"))
    for m, nodes in enumerate(vibration.nodes):
        assert len(nodes) == m
        for node in nodes:
            x, y = vibration.shape[m, node.shaft : node.shaft + 2]
            assert x + node.share * (y - x) == pytest.approx(0.0, abs=1e-15)


def test_a_node_at_a_mass() -> None:
    chain = Chain([Mass(1), Mass(5), Mass(1)], [Shaft(2), Shaft(2)])
    (node,) = natural_vibration(chain).nodes[1]
    assert (node.shaft, node.share) in ((0, pytest.approx(1.0)), (1, pytest.approx(0.0)))


def test_the_holzer_table_ends_at_zero() -> None:
    vibration = natural_vibration(Chain.load("tractor-like"))
    for mode in range(1, 6):
        rows = vibration.holzer(mode)
        largest = max(abs(row.sum) for row in rows)
        assert abs(rows[-1].sum) < 1e-9 * largest
        for row, behind in pairwise(rows):
            assert row.shape - behind.shape == pytest.approx(row.sum / row.stiffness, rel=1e-6)


def test_rigid_joints_move_as_one_mass() -> None:
    rigid = Chain(
        [Mass(1), Mass(2), Mass(3), Mass(4)],
        [Shaft(5), Shaft(gap=0.1, restitution=0.5, ratio=2), Shaft("inf")],
    )
    one = Chain([Mass(1), Mass(2 + (3 + 4) / 4)], [Shaft(5)])
    vibration = natural_vibration(rigid)
    np.testing.assert_allclose(vibration.Omega, natural_vibration(one).Omega, rtol=1e-15)
    assert vibration.shape[1, 1] == vibration.shape[1, 2] == vibration.shape[1, 3]
    assert vibration.torque[1, 2] == pytest.approx(-(4 / 4) * vibration.Omega[1] ** 2 * vibration.shape[1, 3])
    with pytest.raises(InputError, match="nothing vibrates"):
        natural_vibration(Chain([Mass(1), Mass(1)], [Shaft("inf")]))


def test_partial_systems_by_hand() -> None:
    masses, pairs = squared_frequencies(np.array([1.0, 2.0, 3.0]), np.array([6.0, 4.0]))
    assert masses[1] == 5.0
    assert list(pairs) == pytest.approx([9.0, 4 / 2 + 4 / 3])
    systems = partial_systems(Chain([Mass(1), Mass(2), Mass(3)], [Shaft(6), Shaft(4)]))
    assert [system.kind for system in systems] == ["pair", "mass", "pair"]
    assert systems[0].Omega == 3.0
