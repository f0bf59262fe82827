"""Torque is never cut off in silence: how far and for how long a demand lay beyond the limits."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import pytest
from tests.twin import plain

from softstart import Drive, TorqueProfile, compare, simulate
from softstart.cli import main
from softstart.controller import Command, Controller, PlainController, make_controller
from softstart.controller.base import CompiledController, Measured
from softstart.controller.finding import ready_controller_names
from softstart.views import starts

CRANE = Drive.load("crane-4amtkf")  # 0 to 64 N m, Ms 62 N m
ABOVE = TorqueProfile([0.0, 0.1, 0.1, 0.3, 0.4], [0.0, 128.0, 20.0, 20.0, -30.0])
END = 0.5
# 64 to 128 N m in 50 ms; below 0 N m from 0.34 s on
WANTED = (64.0, 0.05 + END - 0.34)


def played(profile: TorqueProfile, **parameters: Any) -> Controller:
    return make_controller("profile", {"profile": profile, **parameters})


@dataclass(frozen=True)
class Endless(PlainController):
    """Asks for all there is; then for 30 N m."""

    name: ClassVar[str] = "endless"

    def step(self, measured: Measured, state: tuple[float, ...]) -> Command:
        return Command(math.inf, 0.1) if measured.time == 0.0 else Command(30.0)


def test_a_profile_beyond_the_limits_is_measured_in_closed_form() -> None:
    run = simulate(CRANE, played(ABOVE), END)
    np.testing.assert_allclose(run.clipped, WANTED, rtol=1e-12)
    when = np.linspace(0.0, END, 1001)[:-1]
    np.testing.assert_allclose(run.at(when)["u"], np.clip(ABOVE.at(when), 0.0, 64.0), atol=1e-9)


def test_batch_recorded_start_and_plain_twin_give_the_same_bits() -> None:
    for drive in (CRANE, CRANE.replace(torque_lag=0.004, computing_delay=0.002, damping=1.0)):
        controller = played(ABOVE)
        assert isinstance(controller, CompiledController)
        run = simulate(drive, controller, END)
        twin = simulate(drive, plain(controller, drive), END)
        batch = simulate([drive], controller, END)
        assert run.clipped == twin.clipped
        assert run.clipped == (batch.torque_excess.item(), batch.torque_excess_time.item())
        assert run.peak_torque == twin.peak_torque == batch.peak_torque.item()
        np.testing.assert_allclose(run.clipped, WANTED, rtol=1e-12)


def test_chains_measure_it_too() -> None:
    run = simulate("crane-4-mass", played(ABOVE), END)
    np.testing.assert_allclose(run.clipped, WANTED, rtol=1e-12)
    assert run.summary()["clipped"] == run.clipped._asdict()


def test_a_constant_demand_is_cut_off_to_the_end_of_the_run() -> None:
    run = simulate(CRANE, make_controller("direct", {"torque": "80 N*m"}))
    assert run.clipped == (16.0, run.end_time)


def test_lag_and_rate_limit_are_no_clipping() -> None:
    slow = CRANE.replace(torque_lag=0.02, torque_rate=300.0)
    assert simulate(slow, "direct").clipped == (0.0, 0.0)


@pytest.mark.parametrize("name", sorted(ready_controller_names({})))
def test_no_controller_asks_for_more_than_the_shipped_drive_has(name: str) -> None:
    assert simulate(CRANE, name).clipped == (0.0, 0.0)


def test_a_profile_obeys_the_limits_of_the_machine_that_runs() -> None:
    """Set up for a drive that cannot brake, it brakes one that can."""
    braking = TorqueProfile([0.0, 0.1, 0.2], [40.0, 40.0, -50.0])
    both = CRANE.replace(minimum_torque=-64.0)
    run = simulate(both, played(braking), END, fitted_to=CRANE)
    assert run.at(0.3)["u"] == -50.0
    assert run.clipped == (0.0, 0.0)
    other = simulate(CRANE, played(braking), END, fitted_to=both)
    assert other.at(0.3)["u"] == 0.0
    np.testing.assert_allclose(other.clipped, (50.0, END - 0.1 - 0.1 * 40.0 / 90.0), rtol=1e-12)


def test_a_sampled_profile_is_cut_off_sample_by_sample() -> None:
    run = simulate(CRANE, played(ABOVE, period=0.01), END)
    means = 128.0 * (np.arange(10) + 0.5) / 10.0
    np.testing.assert_allclose(run.at(np.arange(10) * 0.01 + 0.005)["u"], np.minimum(means, 64.0))
    assert run.clipped.excess == pytest.approx(128.0 * 0.95 - 64.0, rel=1e-12)
    assert run.clipped.time == pytest.approx(0.05 + END - 0.34, rel=1e-12)


def test_the_worst_of_several_positions_counts() -> None:
    drive = CRANE.replace(start_position="unknown")
    run = simulate(drive, played(ABOVE), END)
    batch = simulate([drive], played(ABOVE), END)
    np.testing.assert_allclose(run.clipped, WANTED, rtol=1e-12)
    assert run.clipped == (batch.torque_excess.item(), batch.torque_excess_time.item())


@pytest.mark.parametrize(
    ("controller", "sentence"),
    [
        (make_controller("ramp", {"full_torque": 80.0}), "up to 16 N m beyond the limits 0 and 64 N m"),
        (played(ABOVE), "up to 64 N m beyond the limits 0 and 64 N m, for 0.21 s"),
        (Endless(), "infinite beyond the limits 0 and 64 N m, for 0.1 s"),
    ],
    ids=["ramp", "profile", "endless"],
)
def test_it_is_said_once(controller: Controller, sentence: str) -> None:
    until = None if controller.name == "ramp" else END
    table = compare(CRANE, [controller], until=until)
    assert sum(sentence in note for note in starts.remarks(table)) == 1
    run = table.rows[0].run
    assert sum(sentence in text for row in starts.figure_rows(run) for text in row) == 1
    assert starts.outcome(run).startswith(run.status.value)
    assert sentence in starts.outcome(run)


def test_a_controller_that_relies_on_the_limits_is_not_reported_but_measured() -> None:
    @dataclass(frozen=True)
    class Feedback(PlainController):
        saturates: ClassVar[bool] = True

        def step(self, measured: Measured, state: tuple[float, ...]) -> Command:
            return Command(100.0 if measured.motor_speed < 50.0 else 40.0, measured.time + 0.001)

    run = simulate(CRANE, Feedback())
    assert run.clipped.excess == 36.0
    assert starts.clipped_torque(run) == ""


def test_commands_say_it_in_table_and_json(capsys: pytest.CaptureFixture[str]) -> None:
    line = ["simulate", "crane-4amtkf", "--controller", "ramp", "--param", "full_torque=80"]
    main(line)
    assert "up to 16 N m beyond" in capsys.readouterr().out
    main([*line, "--json"])
    told = json.loads(capsys.readouterr().out)["clipped"]
    assert told["excess"] == 16.0
    assert 0.3 < told["time"] < 0.4
