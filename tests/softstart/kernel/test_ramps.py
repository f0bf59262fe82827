"""A demand that moves in a line: against the oracle, against steps, and the slew limiter that chases it."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
import pytest
from tests.softstart.kernel.pieces import Pieces
from tests.softstart.kernel.test_against_oracle import case, compare_with_oracle

from softstart import (
    Command,
    CompiledController,
    Drive,
    Measured,
    PlainController,
    SimulationError,
    TorqueProfile,
    simulate,
)
from softstart.arrays import Vector
from softstart.controller import compiled_step, make_controller
from softstart.kernel.motor import ASK_AGAIN, M_TIME, SLOPE, TORQUE

CRANE = Drive.load("crane-4amtkf")
BLOCKS = 3
DRIVES_PER_BLOCK = 24


def ramped(seed: int) -> dict[str, Any]:
    """A random start whose pieces are lines: some go on where the last one ended, some hold."""
    drawn = case(seed)
    rng = np.random.default_rng(seed)
    pieces = drawn["torque_pieces"]
    most = max(abs(u) for _, u in pieces)
    ends = [*(t for t, _ in pieces[1:]), drawn["t_end"]]
    after = [*(u for _, u in pieces[1:]), pieces[0][1]]
    lines = []
    for (t, u), end, goes_on in zip(pieces, ends, after, strict=True):
        aim = (goes_on, u, most * float(rng.uniform(-0.3, 1.0)))[rng.choice(3, p=[0.4, 0.2, 0.4])]
        lines.append((t, u, (aim - u) / (end - t)))
    return drawn | {"torque_pieces": lines}


@pytest.mark.hypothesis
@pytest.mark.parametrize("block", range(BLOCKS))
def test_ramps_against_the_oracle(block: int) -> None:
    """All contact laws, both kinds of load, with and without lag, rate limit and damping."""
    for seed in range(50_000 + block * DRIVES_PER_BLOCK, 50_000 + (block + 1) * DRIVES_PER_BLOCK):
        compare_with_oracle(ramped(seed), seed)


def test_a_ramp_through_a_lag_is_the_closed_form() -> None:
    """lag u' = k t - u from u = 0: u = k (t - lag) + k lag exp(-t/lag)."""
    lag, k = 0.01, 150.0
    run = simulate(CRANE.replace(torque_lag=lag), Pieces(pieces=((0.0, 0.0, k),), end=0.3), until=0.3)
    t = np.linspace(0.0, 0.3, 400)
    np.testing.assert_allclose(run.at(t)["u"], k * (t - lag) + k * lag * np.exp(-t / lag), atol=1e-12)


@pytest.mark.parametrize(
    ("torque", "slope", "meets"),
    [
        (50.0, -200.0, 50.0 / 1200.0),  # the line comes down to the limiter
        (20.0, 300.0, 20.0 / 700.0),  # it runs away, but slower
        (0.0, 900.0, 0.0),  # on it from the first instant
    ],
)
def test_the_limiter_meets_a_moving_line(torque: float, slope: float, meets: float) -> None:
    """From 0 at the rate of 1000 N m/s, then along the line."""
    drive = CRANE.replace(torque_rate=1000.0)
    run = simulate(drive, Pieces(pieces=((0.0, torque, slope),), end=0.06), until=0.06)
    t = np.linspace(0.0, 0.06, 301)
    u = np.where(t < meets, 1000.0 * t, torque + slope * t)
    np.testing.assert_allclose(run.at(t)["u"], u, atol=1e-11)
    assert meets == 0.0 or np.abs(run.trajectory.spans[:, 0] - meets).min() < 1e-15


@dataclass(frozen=True)
class Answer(PlainController):
    """One answer, then a constant torque."""

    name: ClassVar[str] = "answer"
    answer: Command = field(default_factory=lambda: Command(0.0))

    def step(self, measured: Measured, state: tuple[float, ...]) -> Command:
        return self.answer if measured.time == 0.0 else Command(30.0)


@pytest.mark.parametrize(
    "answer",
    [Command(1.0, math.inf, (), 5.0), Command(1.0, 0.1, (), math.nan), Command(math.inf, 0.1, (), -1.0)],
)
def test_a_slope_without_an_end_is_refused(answer: Command) -> None:
    with pytest.raises(SimulationError, match="slope without an end"):
        simulate(CRANE, Answer(answer))


@compiled_step
def slope_once(parameters: Vector, measured: Vector, state: Vector, command: Vector) -> None:
    """A slope in the first answer only: later ones do not write it."""
    command[TORQUE] = 20.0
    command[ASK_AGAIN] = measured[M_TIME] + 0.05
    if measured[M_TIME] == 0.0:
        command[SLOPE] = 400.0


@dataclass(frozen=True)
class SlopeOnce(CompiledController):
    """Ramps for 50 ms."""

    name: ClassVar[str] = "slope-once"
    kernel: ClassVar[Any] = slope_once

    def vector(self, drive: Drive) -> Vector:
        return np.zeros(1)


def test_a_slope_that_is_not_written_again_is_none() -> None:
    run = simulate(CRANE, SlopeOnce(), until=0.2)
    assert run.at([0.0, 0.025, 0.05, 0.08, 0.12])["u"].tolist() == [20.0, 30.0, 20.0, 20.0, 20.0]


def test_contacts_under_a_slope_are_never_taken_for_repeated_ones() -> None:
    """Undamped contacts repeat under a constant torque only: the batch, which strides, has the same bits."""
    for slope in (0.0, 1e-9, -3.0):
        drive = CRANE.replace(target_speed=800.0)
        player = Pieces(pieces=((0.0, 40.0, slope), (1.5, 40.0 + 1.5 * slope)), end=math.inf)
        run = simulate(drive, player, until=2.5)
        batch = simulate([drive], player, until=2.5)
        assert run.contacts > 5
        assert float(batch.contacts[0]) == run.contacts
        assert float(batch.peak_torque[0]) == run.peak_torque


def test_ramps_that_join_leave_no_splinters_behind_the_limiter() -> None:
    """Where a line goes on from the end of the last one, rounding is no step that the limiter would chase."""
    knots = np.linspace(0.0, 0.3, 301)
    torque = 30.0 + 25.0 * np.sin(40.0 * knots)
    player = make_controller("profile", {"profile": TorqueProfile(knots, torque)})
    run = simulate(CRANE.replace(torque_rate=5000.0, torque_lag=0.002), player, until=0.3)
    lengths = np.diff(run.trajectory.spans[1:, :2], axis=1)
    assert len(lengths) < 301 + 40
    assert lengths.min() > 1e-7  # splinters are a rounding of the torque over the rate, 1e-18 s
