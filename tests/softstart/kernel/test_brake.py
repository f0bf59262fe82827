"""A motor held by its brake until torque proving or a time: against the oracle, and in closed form.

`python -m tests.softstart.kernel.test_brake 300` compares 300 random drives and prints the worst differences.
"""

from __future__ import annotations

import math
import sys
from typing import Any

import numpy as np
import pytest
from tests.oracle import integrate
from tests.softstart.kernel.pieces import Pieces, TwoSteps
from tests.softstart.kernel.test_against_oracle import KINDS, case, run_of

from softstart import Drive, InputError, Status, records, simulate

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


def differences(seed: int) -> tuple[float, float]:
    """Of the peak, relative, and of the event times, over the length of the run."""
    drawn = braked(seed)
    without = ("closed", "opened") if drawn["gap"] == 0.0 else ()  # there the spring pulls, and has no flanks
    if without and drawn["theta0"] == 0.0:
        return 0.0, 0.0  # the oracle begins with the flanks apart
    run, other = run_of(drawn), integrate(**drawn | ({"law": "dead-zone"} if without else {}))
    events = [one for one in other.events if one[1] not in without]
    first = sum(event.time == 0.0 for event in run.events)  # what happens at t = 0 has no order
    names, kinds = [KINDS[event.kind] for event in run.events], [kind for _, kind in events]
    assert (sorted(names[:first]), names[first:]) == (sorted(kinds[:first]), kinds[first:]), seed
    mine, theirs = np.array([event.time for event in run.events]), np.array([time for time, _ in events])
    peak = abs(run.peak_torque - other.peak) / max(other.peak, 1e-4 * drawn["c"] * 1e-8)
    return peak, float(np.abs(mine - theirs).max(initial=0.0)) / drawn["t_end"]


@pytest.mark.parametrize("block", range(4))
def test_against_the_oracle(block: int) -> None:
    found = [differences(seed) for seed in range(10 * block, 10 * block + 10)]
    assert np.max(found) <= 1e-8  # of both


def test_torque_proving_through_a_lag() -> None:
    """U = Ms (1 - exp(-t/lag)) reaches Mc at lag log(Ms/(Ms - Mc)); until then nothing moves."""
    run = simulate(HELD, "direct")
    assert run.release_time == pytest.approx(0.02 * math.log(250 / (250 - 120)), rel=1e-12)
    held = run.at(np.linspace(0.0, run.release_time, 50))
    for name in ("phi1", "phi2", "w1", "w2"):
        assert np.abs(held[name]).max() == pytest.approx({"phi1": HELD.theta0}.get(name, 0.0), abs=1e-12)
    np.testing.assert_allclose(held["T"], 120.0, rtol=1e-12)


def test_torque_proving_through_a_rate_limit() -> None:
    run = simulate(HOIST.replace(brake="motor", torque_rate=1000), "direct")
    assert run.release_time == pytest.approx(0.120, rel=1e-12)


def test_a_torque_that_holds_the_load_from_the_beginning_releases_at_once() -> None:
    for held in (Pieces(((0.0, 120.0), (0.01, 250.0))), Pieces(((0.0, 125.0),))):
        assert simulate(HOIST.replace(brake="motor"), held, until=0.1).release_time == 0.0


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


def test_a_batch_and_a_plain_twin_have_the_same_bits() -> None:
    gaps = [0.05, 0.1, 0.4]
    for release in ("torque", 0.03):
        drive = HELD.replace(release=release)
        many = simulate(records(drive, gap=gaps), TwoSteps(first=90.0, switch=0.05, second=250.0))
        for i, gap in enumerate(gaps):
            one = drive.replace(gap=gap)
            run = simulate(one, TwoSteps(first=90.0, switch=0.05, second=250.0))
            plain = simulate(one, Pieces(pieces=((0.0, 90.0), (0.05, 250.0))))
            assert run.peak_torque == plain.peak_torque == float(many.peak_torque[i])
            assert run.start_time == plain.start_time == float(many.start_time[i])
            assert run.release_time == plain.release_time == float(many.release_time[i])
        assert (release == "torque") == (run.release_time > 0.05)


def test_a_torque_that_never_reaches_the_load_says_so() -> None:
    run = simulate(HELD, Pieces(pieces=((0.0, 100.0),)), until=2.0)
    assert run.status is Status.NOT_RELEASED
    assert run.status.finished
    assert "held by its brake" in run.status.value
    assert math.isnan(run.release_time)
    assert run.peak_torque == pytest.approx(120.0)
    many = simulate([HELD], Pieces(pieces=((0.0, 100.0),)), until=2.0)
    assert many.status.values.tolist() == ["NOT_RELEASED"]


def test_energy_is_balanced_while_the_motor_is_held() -> None:
    run = simulate(HELD.replace(start_position="driving-flank", release=0.2), "s-curve")
    assert abs(run.energy.residual) < 1e-9 * run.energy.motor


def test_a_motor_that_is_held_does_not_turn() -> None:
    with pytest.raises(InputError, match="a motor that is held stands still"):
        HELD.replace(initial_motor_speed=1.0)


if __name__ == "__main__":
    worst = np.max([differences(seed) for seed in range(int(sys.argv[1]))], axis=0)
    print(f"{sys.argv[1]} random drives with a brake: peaks within {worst[0]:.1e}, events {worst[1]:.1e}")
