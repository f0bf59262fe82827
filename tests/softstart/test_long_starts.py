"""A start is bounded in length and memory, and a controller that does not return is named."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import pytest
from tests.twin import chain_of

from softstart import Chain, Drive, SimulationError, simulate
from softstart.controller import Command, CompiledController, PlainController, compiled_step, make_controller
from softstart.controller.base import Measured
from softstart.controller.compiled import Vector
from softstart.start import engine

CRANE = Drive.load("crane-4amtkf")
HEAVY = CRANE.replace(load_inertia=35_000.0)  # 960,000 elastic periods to its target speed


def test_a_start_that_is_too_long_is_given_up() -> None:
    batch = simulate([HEAVY, CRANE], "ramp")
    assert batch.status.values.tolist() == ["TOO_LONG", "REACHED"]
    assert math.isnan(batch.k_dyn[0])
    with pytest.raises(SimulationError, match=r"more than 100,000 elastic periods.*Check the units"):
        simulate(CRANE, "direct", until=1e9)


@pytest.mark.slow
@pytest.mark.parametrize("machine", [HEAVY, chain_of(HEAVY)], ids=["drive", "chain"])
def test_a_start_that_is_too_long_names_the_remedy(machine: Drive | Chain) -> None:
    with pytest.raises(SimulationError, match=r"more than 100,000 elastic periods.*Check the units"):
        simulate(machine, "ramp")


@pytest.mark.slow
def test_the_longest_start_keeps_its_energy() -> None:
    run = simulate(CRANE.replace(load_inertia=3500.0), "ramp")
    assert run.end_time > 96_000 * CRANE.replace(load_inertia=3500.0).elastic_period
    assert abs(run.energy.residual) < 1e-9 * run.energy.motor


def test_a_start_that_does_not_reach_its_target_is_not_too_long() -> None:
    """A hundred times a stiff start is beyond the bound here, ten times is not: that tells enough."""
    drive = CRANE.replace(load_inertia=300.0, damping=2.0)
    assert simulate([drive], make_controller("direct", {"torque": 6.0})).status.item() == "NOT_REACHED"


@dataclass(frozen=True)
class Sleeper(PlainController):
    """Does not return for a while."""

    name: ClassVar[str] = "sleeper"

    def step(self, measured: Measured, state: tuple[float, ...]) -> Command:
        if measured.time == 0.0:
            time.sleep(1.0)
        return Command(62.0)


@compiled_step
def spin(parameters: Vector, measured: Vector, state: Vector, command: Vector) -> None:
    """Works for about a second."""
    x = 0.5
    for _ in range(100_000_000):
        x = math.sin(x) + 0.5
    command[0] = 62.0 + 1e-300 * x
    command[1] = math.inf


@dataclass(frozen=True)
class Spinner(CompiledController):
    """Works for a while, compiled."""

    name: ClassVar[str] = "spinner"
    kernel: ClassVar[Any] = spin

    def vector(self, drive: Drive) -> Vector:
        return np.zeros(1)


@pytest.mark.parametrize(
    ("controller", "batch"),
    [(Sleeper(), False), (Sleeper(), True), pytest.param(Spinner(), False, marks=pytest.mark.slow)],
)
def test_a_controller_that_does_not_return_is_named_once(
    controller: PlainController | CompiledController,
    batch: bool,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(engine, "SILENCE", 0.2)
    simulate([CRANE] if batch else CRANE, controller)
    said = capsys.readouterr().err
    assert said.count(f"The controller {controller.name} has not returned for 0.2 s") == 1
    simulate(CRANE, "direct")
    assert capsys.readouterr().err == ""
