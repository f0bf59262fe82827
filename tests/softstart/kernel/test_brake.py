"""A motor held by its brake until torque proving or a time: against the oracle, and in closed form."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from tests.softstart.kernel.pieces import Pieces
from tests.softstart.kernel.test_against_oracle import case, compare_with_oracle

from softstart import Drive, Status, simulate

HOIST = Drive(
    motor_inertia=0.19, starting_torque=250, stiffness=3200, gap="6 deg", load_inertia=0.065, load_torque=120,
    damping=1.5, target_speed="970 rpm", start_position="hanging",
)  # fmt: skip
HELD = HOIST.replace(brake="motor", torque_lag=0.02)


def braked(seed: int) -> dict[str, Any]:
    """A random start of a motor that is held: half by torque proving, half until a time."""
    drawn = case(seed)
    rng = np.random.default_rng([seed, 1])
    drawn["w1_0"] = 0.0
    drawn["release"] = math.inf if rng.random() < 0.5 else float(rng.uniform(0.02, 0.6)) * drawn["t_end"]
    if rng.random() < 0.5 and drawn["kind"] == "active":  # as a hoist: in equilibrium
        drawn["theta0"], drawn["w2_0"] = 0.5 * drawn["gap"] + drawn["Mc"] / drawn["c"], 0.0
    drawn["target"] = max(drawn["target"], drawn["w2_0"] + 1e-3 * abs(drawn["w2_0"]))
    return drawn


def test_against_the_oracle() -> None:
    for seed in range(20):
        drawn = braked(seed)
        if drawn["gap"] > 0.0 or drawn["theta0"] != 0.0:  # the oracle begins with the flanks apart
            compare_with_oracle(drawn, seed, within=1e-9)


def test_torque_proving_through_a_lag() -> None:
    """U = Ms (1 - exp(-t/lag)) reaches Mc at lag log(Ms/(Ms - Mc)); until then nothing moves."""
    run = simulate(HELD, "direct")
    assert run.release_time == pytest.approx(0.02 * math.log(250 / (250 - 120)), rel=1e-12)
    held = run.at(np.linspace(0.0, run.release_time, 50))
    for name in ("phi1", "phi2", "w1", "w2"):
        assert np.abs(held[name]).max() == pytest.approx({"phi1": HELD.theta0}.get(name, 0.0), abs=1e-12)
    np.testing.assert_allclose(held["T"], 120.0, rtol=1e-12)
    limited = simulate(HOIST.replace(brake="motor", torque_rate=1000), "direct")
    assert limited.release_time == pytest.approx(0.120, rel=1e-12)


def test_a_load_on_the_flank_swings_between_nothing_and_twice_its_weight() -> None:
    """Let down on a motor that is held: T = Mc (1 - cos(sqrt(c/J2) t)), undamped."""
    drive = HOIST.replace(start_position="driving-flank", damping=0.0, brake="motor", release=1.0)
    run = simulate(drive, "direct", until=0.9)
    assert run.peak_torque == pytest.approx(240.0, rel=1e-12)
    t = np.linspace(0.0, 0.05, 30)
    np.testing.assert_allclose(run.at(t)["T"], 120.0 * (1.0 - np.cos(math.sqrt(3200 / 0.065) * t)), atol=1e-9)
    assert np.abs(run.at(t)["w1"]).max() == 0.0


def test_released_at_once_it_is_a_start_without_a_brake() -> None:
    for drive in (HOIST, HOIST.replace(start_position="mid-gap")):
        free = simulate(drive, "direct")
        for release in ("torque", 0.0):  # torque without lag is there at once
            run = simulate(drive.replace(brake="motor", release=release), "direct")
            assert run.peak_torque == free.peak_torque
            assert run.start_time == free.start_time


def test_a_torque_that_never_reaches_the_load_says_so() -> None:
    run = simulate(HELD, Pieces(pieces=((0.0, 100.0),)), until=2.0)
    assert run.status is Status.NOT_RELEASED
    assert run.status.finished
    assert "held by its brake" in run.status.value
    assert math.isnan(run.release_time)
    assert run.peak_torque == pytest.approx(120.0)
