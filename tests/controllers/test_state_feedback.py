"""state-feedback: gains against the Riccati equations, loop margins, and what the start makes of it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm
from tests.controllers.starts import CRANE, CRANES

from softstart import Drive, machine_table, simulate
from softstart_controllers.regulator import PER_DECADE, RATIO_STEPS, WEIGHTS_PER_DECADE, feedback_gains
from softstart_controllers.state_feedback import StateFeedback

# gains ---------------------------------------------------------------------------------------------------


def sampled(A: Any, B: Any, h: float) -> tuple[Any, Any]:
    n, m = B.shape
    whole = expm(h * np.block([[A, B], [np.zeros((m, n + m))]]))
    return whole[:n, :n], whole[:n, n:]


@pytest.mark.parametrize("lag", [None, -10])
@pytest.mark.parametrize(("torque_weight", "rate_weight"), [(0, 0), (4, -3)])
def test_feedback_solves_the_riccati_equation(lag: int | None, torque_weight: int, rate_weight: int) -> None:
    """Against the iterated Riccati equation, on a point of the grid."""
    h, ratio = 10 ** (-19 / PER_DECADE), 5 / RATIO_STEPS
    tau = 0.0 if lag is None else 10 ** (lag / PER_DECADE)
    weights = [10 ** (steps / WEIGHTS_PER_DECADE) for steps in (torque_weight, rate_weight)]
    if lag is None:
        A, B = sampled(np.array([[0.0, 1.0], [-1.0, -2.0 * ratio]]), np.array([[0.0], [1.0]]), h)
        Q = np.diag(weights)
    else:
        A = np.array([[0.0, 1.0, 0.0], [-1.0, -2.0 * ratio, 1.0], [0.0, 0.0, -1.0 / tau]])
        A, B = sampled(A, np.array([[0.0], [0.0], [1.0 / tau]]), h)
        Q = np.diag([*weights, 0.0])
    P = np.zeros_like(A)
    for _ in range(5000):
        K = np.linalg.solve(np.eye(1) + B.T @ P @ B, B.T @ P @ A)
        P = Q + A.T @ P @ (A - B @ K)
    got = feedback_gains(h, ratio, tau, *weights)
    assert got[: len(A)] == pytest.approx(K[0], rel=1e-7)
    assert got[len(A) :] == [0.0] * (3 - len(A))


def test_gains_between_the_weights_of_the_grid_are_close_to_their_own_design() -> None:
    import control

    rng = np.random.default_rng(1)
    h, tau = 10 ** (-19 / PER_DECADE), 10 ** (-14 / PER_DECADE)
    A = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 1.0], [0.0, 0.0, -1.0 / tau]])
    A, B = sampled(A, np.array([[0.0], [0.0], [1.0 / tau]]), h)
    q, r = 10 ** rng.uniform(-1.5, 1.5, (2, 10))
    for one, other in zip(q.tolist(), r.tolist(), strict=True):
        got = np.array(feedback_gains(h, 0.0, tau, one, other))
        K, _, _ = control.dlqr(A, B, np.diag([one, other, 0.0]), np.eye(1))
        assert np.abs(got - K[0]).max() < 0.01 * np.abs(K[0]).max()


# the start -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("drive", CRANES, ids=range(8))
def test_soft_and_quicker_than_current_limit_feedback(drive: Drive) -> None:
    """K_dyn at most 1.04; the light active load falls into the gap of 2 rad: 1.22.

    Start times 0.93 to 0.99 of theirs, K_dyn at most 0.032 more.
    """
    run = simulate(drive, StateFeedback())
    theirs = simulate(drive, "current-limit-feedback")
    falls = drive.gap == 2.0 and drive.load_kind == "active"
    assert run.k_dyn < (1.3 if falls else 1.06)
    assert run.contacts == 1
    assert run.k_dyn < theirs.k_dyn + 0.04
    assert run.start_time < theirs.start_time


def test_a_load_torque_and_inertia_not_as_told_leave_the_full_torque() -> None:
    """What is wrong with the load goes into the estimate of J2: the motor comes to its full torque."""
    other = CRANE.replace(load_torque=14.0, load_inertia=0.1, encoder_lines=0, target_speed=400.0)
    run = simulate(other, StateFeedback(), fitted_to=CRANE.replace(encoder_lines=0))
    u = 0.99 * 62.0
    assert run.u[-1] == pytest.approx(u, rel=1e-6)
    assert run.T[-1] == pytest.approx((u * other.J2 + 14.0 * other.J1) / (other.J1 + other.J2), rel=1e-6)
    assert run.k_dyn < 1.05


def test_invariant_to_gap_inertia_and_stiffness() -> None:
    """One set of gains, of the crane with J2 = 5 J1; a reactive load. K_dyn over the nominal base."""
    nominal = CRANE.replace(load_kind="reactive", torque_lag=0.002)
    gaps, inertias, factors = np.meshgrid(
        [0.25, 1.0, 4.0], [0.07, 0.175, 0.35], [0.8, 1.0, 1.25], indexing="ij"
    )
    drives = machine_table(nominal, gap=gaps, load_inertia=inertias, stiffness=factors * CRANE.c)
    peaks = simulate(drives, StateFeedback(), fitted_to=nominal, base=nominal).k_dyn.values
    assert peaks.max() < 1.35
    assert np.ptp(peaks, axis=0).max() < 0.12
