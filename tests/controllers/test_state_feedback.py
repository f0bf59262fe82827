"""state-feedback: gains against the Riccati equations, loop margins, and what the start makes of it."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm
from tests.controllers.starts import CRANE, index, traced

from softstart import Drive, InputError, records, simulate
from softstart.drive import library
from softstart_controllers import contact_designs
from softstart_controllers import state_feedback as sf
from softstart_controllers.contact_designs import (
    LOAD_NOISE,
    NOISE_PER_DECADE,
    PER_DECADE,
    RATIO_STEPS,
    SHARE_STEPS,
    WEIGHTS_PER_DECADE,
    feedback_gains,
    observer_gains,
)
from softstart_controllers.state_feedback import StateFeedback

CRANES = list(itertools.product((0.5, 2.0), (0.07, 0.175), (0.0, 0.002), ("active", "reactive")))


def crane(gap: float, J2: float, lag: float, kind: Any) -> Drive:
    return CRANE.replace(gap=gap, load_inertia=J2, torque_lag=lag, load_kind=kind)


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


@pytest.mark.parametrize("noise", [-8, 0, 12])
def test_filter_is_the_stationary_kalman_filter(noise: int) -> None:
    h, ratio, share = 10 ** (-19 / PER_DECADE), 2 / RATIO_STEPS, 33 / SHARE_STEPS
    A = np.zeros((5, 5))
    A[0, 1] = A[2, 3] = A[3, 4] = 1.0
    A[1, 2:4] = -share, -2.0 * ratio * share
    A[3, 2:4] = -1.0, -2.0 * ratio
    n = 2000  # the noise of a sample, by small steps
    fine = expm(h / n * A)
    Q = np.zeros((5, 5))
    for _ in range(n):
        Q = fine @ Q @ fine.T + h / n * np.diag([0.0, 0.0, 0.0, 1.0, LOAD_NOISE])
    F, C, R = expm(h * A), np.eye(1, 5), 10.0 ** (noise / NOISE_PER_DECADE)
    P = np.eye(5)
    for _ in range(4000):
        P = F @ P @ F.T + Q
        K = P @ C.T / (C @ P @ C.T + R)
        P = (np.eye(5) - K @ C) @ P
    assert observer_gains(h, ratio, share, R) == pytest.approx(K[:, 0], rel=2e-3)


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


def test_a_lag_of_nothing_is_no_lag() -> None:
    assert feedback_gains(0.1, 0.0, 1e-9, 1.0, 1.0) == feedback_gains(0.1, 0.0, 0.0, 1.0, 1.0)


def test_thousands_of_weights_need_few_designs(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = set()
    monkeypatch.setattr(contact_designs, "_feedback", lambda *group: asked.add(group) or [1.0, 2.0, 0.0])
    for q, r in 10 ** np.random.default_rng(2).uniform(-1.5, 1.5, (5000, 2)):
        assert feedback_gains(0.1, 0.0, 0.0, q, r) == pytest.approx([1.0, 2.0, 0.0])
    assert len(asked) <= 17 * 17


def distance_to_instability(drive: Drive, plant: Drive) -> float:
    """Smallest |1 + L| of the loop, cut at the demand; 1/that is the peak of its sensitivity."""
    p = StateFeedback().fitted(drive).vector(drive).view(sf.PARAMETERS)[0]
    h = float(p.landing.period)

    def closed(of: Drive, lag: float) -> tuple[Any, Any]:
        """phi1, w1, z, z' and load torque or lagging torque."""
        A, B, both = np.zeros((5, 5)), np.zeros((5, 1)), 1.0 / of.J1 + 1.0 / of.J2
        A[0, 1] = A[2, 3] = 1.0
        A[1, 2:4] = -of.c / of.J1, -of.d / of.J1
        A[3, 2:4] = -of.c * both, -of.d * both
        if lag > 0.0:
            A[1, 4] = A[3, 4] = 1.0 / of.J1
            A[4, 4], B[4, 0] = -1.0 / lag, 1.0 / lag
        else:
            A[3, 4] = 1.0 / of.J2
            B[1, 0] = B[3, 0] = 1.0 / of.J1
        return sampled(A, B, h)

    lag = float(plant.torque_lag)
    Ap, Bp = closed(plant, lag)
    Am, Bm = closed(drive, 0.0)
    K = np.array([[p.k_angle], [p.k_speed], [p.k_twist], [p.k_rate], [p.k_load]])
    keep = np.eye(5) - K @ np.eye(1, 5)
    square = drive.Omega**2
    smallest = math.inf
    for w in np.geomspace(1e-4, math.pi, 1500) / h:
        back = np.exp(-1j * w * h)  # one sample back
        x = np.linalg.solve(np.eye(5) / back - Ap, Bp[:, 0])
        u = mean = back
        if lag > 0.0:
            u = x[4]
            mean = back + back * (u - 1.0) * lag / h * (1.0 - math.exp(-h / lag))
        known = np.linalg.solve(np.eye(5) - keep @ Am * back, keep @ Bm[:, 0] * mean + K[:, 0] * x[0])
        twist = (u / drive.J1 + known[4] / drive.J2) / square
        level = -p.f_twist * known[2] - p.f_rate * known[3] / drive.Omega
        level -= p.f_torque * twist
        answer = drive.J1 * (level * square - known[4] / drive.J2)
        smallest = min(smallest, abs(1.0 - answer))
    return smallest


LAGGING = CRANE.replace(torque_lag=0.005, encoder_lines=1024)


@pytest.mark.parametrize("drive", [*map(Drive.load, library.names()), LAGGING], ids=lambda drive: drive.name)
def test_phase_margin_is_at_least_45_degrees(drive: Drive) -> None:
    """2 arcsin(d/2) with the distance d: 0.86 at the least, so 51 degrees."""
    assert 2.0 * math.asin(0.5 * distance_to_instability(drive, drive)) > math.radians(45.0)


def test_phase_margin_with_a_wrong_stiffness_and_inertia() -> None:
    for c, J2 in itertools.product((0.8, 1.25), (0.5, 2.0)):
        plant = CRANE.replace(stiffness=c * CRANE.c, load_inertia=J2 * CRANE.J2)
        assert 2.0 * math.asin(0.5 * distance_to_instability(CRANE, plant)) > math.radians(30.0)


# estimate ------------------------------------------------------------------------------------------------


def test_gap_and_start_position_enter_nowhere() -> None:
    for other in (CRANE.replace(gap=2.0), CRANE.replace(gap=0.0), CRANE.replace(start_position=-0.25)):
        fitted = StateFeedback().fitted(other)
        assert fitted == StateFeedback().fitted(CRANE)
        assert np.array_equal(fitted.vector(other), fitted.vector(CRANE))


@pytest.mark.parametrize(("gap", "J2", "lag", "kind"), CRANES)
def test_estimates_stay_close_from_the_first_look_on(gap: float, J2: float, lag: float, kind: Any) -> None:
    """In shares of M12avg_base, 4096 lines. Worst of the 16: T 0.06, w1 0.3 rad/s, load torque 0.13."""
    drive = crane(gap, J2, lag, kind)
    run, trace = traced(drive, StateFeedback())
    closed = trace[trace[:, 1 + index(sf.STATE, "phase")] == sf.CLOSED]
    true = run.at(closed[:, 0])
    base = drive.mean_torque
    assert np.abs(drive.c * closed[:, 1 + index(sf.STATE, "z")] - true["T"]).max() < 0.1 * base
    assert np.abs(closed[:, 1 + index(sf.STATE, "speed")] - true["w1"]).max() < 0.8
    assert np.abs(closed[:, 1 + index(sf.STATE, "load")] - drive.Mc).max() < 0.25 * base


# the start -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("gap", "J2", "lag", "kind"), CRANES)
def test_softer_than_current_limit_feedback_and_about_as_quick(
    gap: float, J2: float, lag: float, kind: Any
) -> None:
    """K_dyn at most 1.04; the light active load falls into the gap of 2 rad: 1.22.

    Start times 0.96 to 1.04 of theirs, the longest with a light load and a wide gap, which is closed slower.
    """
    drive = crane(gap, J2, lag, kind)
    run = simulate(drive, StateFeedback())
    theirs = simulate(drive, "current-limit-feedback")
    falls = gap == 2.0 and J2 == 0.07 and kind == "active"
    assert run.k_dyn < (1.3 if falls else 1.06)
    assert run.contacts == 1
    assert run.k_dyn < theirs.k_dyn + 0.02
    assert run.start_time < 1.05 * theirs.start_time


def test_a_heavier_load_torque_is_estimated_and_allowed_for() -> None:
    """Integral action: T settles at the nominal reference, with less torque than the nominal load would take.

    With an ideal encoder; the ripple of a real one is cut off at the full torque, so T stays 0.3 % below.
    """
    ideal = CRANE.replace(encoder_lines=0)
    heavier = ideal.replace(load_torque=14.0, target_speed=400.0)
    run = simulate(heavier, StateFeedback(), fitted_to=ideal)
    assert run.T[-1] == pytest.approx(CRANE.mean_torque, rel=1e-9)
    assert run.u[-1] == pytest.approx(62.0 - (14.0 - CRANE.Mc) * CRANE.J1 / CRANE.J2, rel=1e-6)


def test_invariant_to_gap_inertia_and_stiffness() -> None:
    """One set of gains, of the crane with J2 = 5 J1; a reactive load. K_dyn over the nominal base."""
    nominal = CRANE.replace(load_kind="reactive", torque_lag=0.002)
    gaps, inertias, factors = np.meshgrid(
        [0.25, 1.0, 4.0], [0.07, 0.175, 0.35], [0.8, 1.0, 1.25], indexing="ij"
    )
    drives = records(nominal, gap=gaps, load_inertia=inertias, stiffness=factors * CRANE.c)
    peaks = simulate(drives, StateFeedback(), fitted_to=nominal, base=nominal).k_dyn.values
    assert peaks.max() < 1.35
    assert np.ptp(peaks, axis=0).max() < 0.12


def test_gives_up_waiting() -> None:
    run = simulate(CRANE, StateFeedback(threshold=1e6, patience=0.3))
    assert run.at([0.302])["u"][0] == 62.0


def test_refuses_what_no_design_can_serve() -> None:
    with pytest.raises(InputError, match="torque_weight"):
        StateFeedback(torque_weight=0.0)
