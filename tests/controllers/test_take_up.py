"""take-up: several gaps, motor-side measurements, one set of gains."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import control
import numpy as np
import pytest
from tests.controllers.several_gaps import NOMINAL, crane_cells, played, random_chains, rigid_time

from softstart import Drive, compare, simulate
from softstart.controller import make_controller
from softstart.drive import library
from softstart_controllers.shaft_observer import design, predict

FIT = NOMINAL.design_drive


@pytest.fixture(scope="module")
def groups() -> dict[str, Any]:
    return {name: (cells, *played(cells, "take-up", NOMINAL)) for name, cells in crane_cells(5, 3).items()}


def test_nominal_chain():
    """The best profile found for this start time has 0.896, without a lag, and knows the chain."""
    K, time = played([NOMINAL], "take-up", NOMINAL)
    assert K[0] <= 1.10
    assert time[0] * rigid_time(NOMINAL) <= 0.49


def test_unknown_gaps_positions_loads_and_phases(groups):
    """One set of gains; a wide gap behind a light load costs what the falling load brings along."""
    for name, most in (("gaps x0.5", 1.3), ("driving flank", 1.2), ("undamped", 2.5)):
        assert groups[name][1].max() <= most, name
    assert np.mean(groups["gaps x1"][1]) <= 1.25
    assert groups["stiffness or J1 20 % off"][1].max() <= 1.5
    assert all(np.isfinite(time).all() and time.max() < 3.0 for _, _, time in groups.values())


def test_gentler_than_every_other_feedback_once_gaps_are_open(groups):
    for name in ("gaps x0.5", "gaps x1", "gaps x2"):
        cells, ours, _ = groups[name]
        for other in ("pulse-coast-hold", "current-limit-feedback"):
            theirs, _ = played(cells, other, NOMINAL)
            assert ours.mean() < 0.9 * theirs.mean(), (name, other)


def test_never_rattles_once_the_load_is_met():
    """From the torque's rise on no flank is left for longer than the light parts bounce.

    The load's own shaft opens at most twice, in the bounce of the first contact.
    """
    for chain in crane_cells(6, 2)["gaps x1"]:
        run = simulate(chain, "take-up", fitted_to=NOMINAL)
        after = run.at(np.linspace(0.5 * run.start_time, run.end_time, 4000))["T"]
        assert (after > 0.0).all()


def test_a_light_part_is_no_load():
    """A motor whose only partner is light until a gap far behind it stays at its low speed."""
    far = replace(
        NOMINAL,
        shafts=(*NOMINAL.shafts[:2], NOMINAL.shafts[2].replace(gap="4 rad", start_position=-1.9)),
        masses=(*NOMINAL.masses[:3], NOMINAL.masses[3].replace(torque=0.0)),
    )
    own = make_controller("take-up").fitted(FIT).parameters
    run = simulate(far, "take-up", until=0.3, fitted_to=NOMINAL)
    w1 = run.at(np.linspace(0.05, 0.3, 500))["w"][:, 0]
    assert w1.max() < 1.5 * own["take_up_speed"]


def test_on_two_masses_it_is_gentle_and_the_rule_prefers_pulse_coast_hold():
    for name in library.names():
        drive = Drive.load(name)
        theirs = simulate(drive, "pulse-coast-hold").k_dyn
        assert simulate(drive, "take-up").k_dyn <= 1.1 * max(1.0, theirs), name
    found = compare("crane-4amtkf", ["direct", "shaped", "pulse-coast-hold", "take-up"]).recommendation
    assert "take-up" not in {row.name for row in found.best}


def test_other_chains():
    """Three to five masses, one gap to three, light parts in between, active and reactive loads."""
    chains = random_chains(2, 9)
    ours = np.array([played([chain], "take-up") for chain in chains])[..., 0]
    curve = np.array([played([chain], "s-curve") for chain in chains])[..., 0]
    assert np.isfinite(ours).all()
    assert ours[:, 0].mean() < 0.7 * curve[:, 0].mean()
    assert ours[:, 0].max() < 0.8 * curve[:, 0].max()


@pytest.mark.parametrize("steps", [-360, -200, 60])
def test_gains_are_the_stationary_kalman_filter(steps: int) -> None:
    """The same by iterating the Riccati equation of `predict` with h = J1 = 1; the observer is stable."""
    A = np.array([predict(*unit, 0.0, 1.0, 1.0) for unit in np.eye(4)]).T
    G, C = np.array([[-1.0 / 24.0, -1.0 / 6.0, 0.5, 1.0]]).T, np.eye(1, 4)  # of a constant T''
    gains = design(steps)
    K = np.array(gains[:4])[:, None]
    Q = 10.0 ** (steps * 0.05) * G @ G.T
    assert np.abs(np.linalg.eigvals((np.eye(4) - K @ C) @ A)).max() < 1.0
    if steps >= -200:
        P = np.eye(4)
        for _ in range(3000):
            P = A @ P @ A.T + Q
            step_gain = P @ C.T / (C @ P @ C.T + 1.0)
            P = (np.eye(4) - step_gain @ C) @ P
        assert np.allclose(K, step_gain, rtol=1e-6, atol=1e-9)
        assert gains.torque_deviation == pytest.approx(math.sqrt(P[2, 2]), rel=1e-6)
        keep = np.eye(4) - K @ C
        behind = np.linalg.solve(np.eye(4) - keep @ A, keep @ G)  # under a T'' of 1 that never ends
        assert gains.rate_lag == pytest.approx(behind[3, 0], rel=1e-9)
    else:
        L, _, _ = control.dlqe(A, G, C, np.array([[10.0 ** (steps * 0.05)]]), np.eye(1))
        assert np.allclose(A @ K, L, rtol=1e-9)
