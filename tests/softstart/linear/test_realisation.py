"""Minimal realisations: the same transfer function, the known order, whatever the coordinates."""

from __future__ import annotations

import control
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from softstart.linear.systems import System, minimal, moved, observable

Z = np.exp(1j * np.linspace(0.05, 3.1, 40)) * 1.02


def hidden(rng, order, unmoved, unshown):
    """A system with a core of known order, and states that the input misses or the output does not see."""
    n = order + unmoved + unshown
    core = np.diag(rng.uniform(-0.95, 0.95, order))
    A = np.zeros((n, n))
    A[:order, :order] = core
    A[order : order + unmoved, order : order + unmoved] = np.diag(rng.uniform(-0.9, 1.0, unmoved))
    A[order + unmoved :, order + unmoved :] = np.diag(rng.uniform(-0.9, 1.0, unshown))
    A[:order, order : order + unmoved] = rng.normal(size=(order, unmoved))  # acts, but nothing moves it
    A[order + unmoved :, :order] = rng.normal(size=(unshown, order))  # is moved, but acts on nothing
    B, C = np.zeros((n, 1)), np.zeros((1, n))
    B[:order] = rng.uniform(0.5, 1.5, (order, 1))
    B[order + unmoved :] = rng.normal(size=(unshown, 1))
    C[:, :order] = rng.uniform(0.5, 1.5, (1, order))
    C[:, order : order + unmoved] = rng.normal(size=(1, unmoved))
    return System(A, B, C, np.array([[0.3]]))


@given(st.integers(0, 10_000), st.integers(1, 4), st.integers(0, 3), st.integers(0, 3))
def test_order_and_transfer_function(seed, order, unmoved, unshown):
    rng = np.random.default_rng(seed)
    plain = hidden(rng, order, unmoved, unshown)
    turned, _ = np.linalg.qr(rng.normal(size=plain.A.shape))
    sizes = 10.0 ** rng.uniform(-3, 3, plain.A.shape[0])
    change = turned * sizes[None, :]
    back = np.linalg.inv(change)
    mixed = System(back @ plain.A @ change, back @ plain.B, plain.C @ change, plain.D)
    smaller = minimal(mixed)
    assert smaller.A.shape[0] <= order
    before, after = plain.response(Z), smaller.response(Z)
    assert np.max(np.abs(before - after)) <= 1e-6 * np.max(np.abs(before))


def test_nothing_that_counts_is_dropped():
    rng = np.random.default_rng(3)
    whole = control.drss(6, 1, 1)
    system = System(whole.A, whole.B, whole.C, whole.D)
    turned, _ = np.linalg.qr(rng.normal(size=(6, 6)))
    mixed = System(turned.T @ system.A @ turned, turned.T @ system.B, system.C @ turned, system.D)
    assert minimal(mixed).A.shape[0] == minimal(system).A.shape[0]
    assert np.allclose(mixed.response(Z), minimal(mixed).response(Z), rtol=1e-7, atol=1e-9)


def test_a_defective_integrator_is_taken_out_whole():
    # the double pole at 1 of a turning mass, which the output does not show
    A = np.array([[1.0, 1.0, 0.0], [0.0, 1.0, 0.3], [0.0, 0.0, 0.5]])
    system = System(A, np.ones((3, 1)), np.array([[0.0, 0.0, 1.0]]), np.zeros((1, 1)))
    assert pytest.approx(np.array([[0.5]])) == observable(system)


def test_counters_go_by_structure_whatever_their_effect():
    # state 1 only counts itself, and its column (the effect of a switch) is enormous
    A = np.array([[0.5, 1e9], [0.0, 1.0]])
    system = System(A, np.array([[1.0], [0.0]]), np.array([[1.0, 7.0]]), np.zeros((1, 1)))
    assert moved(system) == [0]
    assert moved(system.part([0]).dual()) == [0]
