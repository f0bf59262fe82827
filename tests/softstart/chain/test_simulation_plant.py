"""Two masses as a chain against the two-mass plant, whose closed forms are another way to the same start."""

from __future__ import annotations

import numpy as np
import pytest
from tests.softstart.plant.pieces import Pieces
from tests.softstart.plant.test_against_oracle import case, drive_of

from softstart import Drive, simulate
from softstart.chain import Chain, simulate

BLOCKS = 6
STARTS_PER_BLOCK = 50


def compare(seed: int, overdamped: bool = False) -> None:
    """Same events, and peak and final state to 1e-11, whatever the scales of the drive."""
    drawn = case(seed)
    if drawn["gap"] == 0.0:
        return  # the plant's spring does not pull there, the chain's does
    if overdamped:
        critical = 2.0 * np.sqrt(drawn["c"] * drawn["J1"] * drawn["J2"] / (drawn["J1"] + drawn["J2"]))
        drawn["d"] = float(critical * 10 ** np.random.default_rng(seed).uniform(0.0, 1.5))
    drive = drawn.design_drive
    played = Pieces(pieces=tuple(drawn["torque_pieces"]), end=drawn["t_end"])
    plant = simulate(drive, played, until=drawn["t_end"])
    chain = simulate(Chain.from_drive(drive), played, until=drawn["t_end"], fitted_to=drive)
    there, here = plant.at(plant.end_time), chain.at(chain.end_time)
    speed = max(np.abs(plant.w1).max(), np.abs(plant.w2).max())
    twist = max(np.abs(plant.theta).max(), drawn["gap"])
    assert [e.kind for e in chain.events] == [e.kind for e in plant.events], seed
    assert here["w"] == pytest.approx([float(there["w1"]), float(there["w2"])], abs=1e-11 * speed), seed
    assert here["twist"][0] == pytest.approx(float(there["theta"]), abs=1e-11 * twist), seed
    assert chain.peak_torque == pytest.approx(plant.peak_torque, rel=1e-11), seed
    energy = chain.energy
    moved = abs(energy.motor) + abs(energy.load) + abs(energy.kinetic) + abs(energy.shafts)
    assert abs(energy.residual) < 1e-11 * moved, seed


@pytest.mark.parametrize("block", range(BLOCKS))
def test_random_starts(block):
    for seed in range(block * STARTS_PER_BLOCK, (block + 1) * STARTS_PER_BLOCK):
        compare(seed)


def test_the_start_at_which_the_torque_comes_back_within_rounding():
    """`modelica`, overlapping flanks: one of 1500 random starts, it opened repeatedly at one instant."""
    compare(335)


def test_overdamped_shafts():
    """Damping from 1 to 30 times the critical one."""
    for seed in range(10_000, 10_050):
        compare(seed, overdamped=True)


def test_a_lag_far_longer_than_the_start():
    """The limiter rises within a microsecond, the lag takes 1e5 s: the torque keeps its last digits."""
    drive = Drive.load("crane-4amtkf").replace(
        torque_lag=1e5, torque_rate=62e6, load_torque=1e-9, start_position="mid-gap"
    )
    plant = simulate(drive, "direct", until=30.0)
    chain = simulate(Chain.from_drive(drive), "direct", until=30.0, fitted_to=drive)
    t = np.array([1e-7, 1e-6, 1e-3, 10.0, 30.0])
    late = 0.5e-6  # as if the whole step came in the middle of the slewing
    step = -62.0 * np.expm1((late - t[2:]) / 1e5)
    np.testing.assert_allclose(chain.at(t)["u"][2:], step, rtol=1e-12)
    np.testing.assert_allclose(chain.at(t)["u"], plant.at(t)["u"], rtol=1e-12)
    assert chain.events[0].time == pytest.approx(plant.first_contact, rel=1e-12)
    np.testing.assert_allclose(chain.at(t)["w"][:, 0], plant.at(t)["w1"], rtol=1e-9)


@pytest.mark.parametrize(
    ("start", "peak", "events", "twist"),
    [
        (0.0, 257.18400593175536, 20, 0.082380438497258424),
        (-1.0, 336.94171218858844, 16, -0.99664341243459861),
    ],
)
def test_the_anchors_of_fifty_digits(start, peak, events, twist):
    """Drive of [G], gap 2 rad, 62 N m, 1 s; from the flank it grazes that flank after each rebound."""
    drive = Drive.load("crane-4amtkf").replace(gap=2.0, start_position=start)
    run = simulate(Chain.from_drive(drive), "direct", 1.0, fitted_to=drive)
    assert run.peak_torque == pytest.approx(peak, rel=1e-13)
    assert sum(e.kind.startswith("gap") for e in run.events) == events
    assert run.at(1.0)["twist"][0] == pytest.approx(twist, abs=1e-12)
