"""A finished start: traces, figures, settling, energy, export; its bounds in length and time."""

from __future__ import annotations

import csv
import math
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest
from tests.softstart.kernel.pieces import Pieces
from tests.twin import chain_of

import softstart
from softstart import (
    Drive,
    InputError,
    Run,
    SimulationError,
    Status,
    TorqueProfile,
    compare,
    formulas,
    machine_table,
    simulate,
)  # fmt: skip
from softstart.controller import Command, CompiledController, PlainController, compiled_step, make_controller
from softstart.controller.compiled import Vector
from softstart.kernel.records import Measured
from softstart.start import engine
from softstart.views.starts import clipped_torque

CRANE = Drive.load("crane-4amtkf")
DAMPED = CRANE.replace(damping=1.0, load_kind="reactive")


@pytest.fixture(scope="module")
def run() -> Run:
    return simulate(CRANE, "reduced-first-stage")


def test_traces_are_states_within_the_run(run: Run) -> None:
    states = run.at(run.t)
    for name in ("phi1", "phi2", "w1", "w2", "u", "T", "theta"):
        np.testing.assert_array_equal(states[name], getattr(run, name))
    assert run.at([[0.1, 0.2], [0.3, 0.35]])["w2"].shape == (2, 2)
    for beyond in (run.end_time + 1.0, [0.1, -0.1], math.nan):
        with pytest.raises(ValueError, match="within the run"):
            run.at(beyond)


def test_start_time_is_the_first_instant_at_the_target(run: Run) -> None:
    assert float(run.at(run.start_time)["w2"]) == pytest.approx(CRANE.target_speed, rel=1e-12)
    earlier = run.at(np.linspace(0.0, run.start_time * (1 - 1e-9), 5000))
    assert earlier["w2"].max() < CRANE.target_speed
    assert run.end_time == pytest.approx(run.start_time + CRANE.elastic_period, rel=1e-12)


def test_stages_tile_the_run_and_hold_the_peaks(run: Run) -> None:
    assert [stage.number for stage in run.stages] == list(range(1, len(run.stages) + 1))
    assert run.stages[0].start == 0.0
    assert run.stages[-1].end == run.end_time
    for one, following in zip(run.stages, run.stages[1:], strict=False):
        assert one.end == following.start
    assert max(abs(stage.peak_torque) for stage in run.stages) == run.peak_torque
    for stage in run.stages:
        assert (stage.side == 0) == (stage.number % 2 == 1)
        seen = np.abs(run.at(np.linspace(stage.start, stage.end, 400)[1:-1])["T"]).max()
        assert seen <= abs(stage.peak_torque) * (1 + 1e-12) + 1e-9
        assert seen >= 0.999 * abs(stage.peak_torque) - 1e-9 or stage is run.stages[-1]


def test_settling_of_a_damped_drive() -> None:
    run = simulate(DAMPED, "direct", until=2.0)
    settled = run.settling_time(0.1)
    assert 0.0 < settled < 1.0
    mean = formulas.mean_shaft_torque(62.0, 0.035, 0.175, 7.16)
    after = run.at(np.linspace(settled, 2.0, 20_000))["T"]
    assert np.abs(after - mean).max() <= 0.1 * mean * (1 + 1e-6)
    assert abs(float(run.at(settled - 1e-6)["T"]) - mean) > 0.1 * mean * (1 - 1e-3)
    assert run.settling_time(0.5) < settled < run.settling_time(0.01)
    assert math.isnan(simulate(CRANE, "direct", until=1.0).settling_time())
    with pytest.raises(InputError, match="band = 0"):
        run.settling_time(0.0)


def test_the_torque_is_settled_for_one_elastic_period_at_least() -> None:
    settled = simulate(DAMPED, "direct", until=2.0).settling_time(0.1)
    for periods, found in ((1.01, settled), (0.99, math.nan)):
        short = simulate(DAMPED, "direct", until=settled + periods * DAMPED.elastic_period)
        assert short.settling_time(0.1) == pytest.approx(found, rel=1e-12, nan_ok=True)


def test_the_load_has_settled_at_999_of_its_speed_for_five_elastic_periods() -> None:
    """A load that falls back crosses 99.9 % upwards there; one that falls after five periods has settled."""
    swinging = simulate(CRANE, "reduced-first-stage")
    settled = swinging.settled_time
    before, after = simulate(CRANE, "reduced-first-stage", until=1.0).at([settled - 1e-7, settled])["w2"]
    assert after == pytest.approx(0.999 * CRANE.target_speed, rel=1e-12)
    assert swinging.start_time < settled
    assert before < after
    # 1 N m never slows this load down; then the motor brakes
    weak = CRANE.replace(gap=0.0, load_torque=0.0, target_speed=2.0, minimum_torque=-62.0)
    start, period = simulate(weak, Pieces(pieces=((0.0, 1.0),))).start_time, 2.0 * math.pi / weak.Omega
    for periods, found in ((4.5, math.nan), (5.5, start)):
        braked = Pieces(pieces=((0.0, 1.0), (start + periods * period, -62.0)))
        assert simulate(weak, braked).settled_time == pytest.approx(found, rel=1e-12, nan_ok=True)


def test_a_start_without_end_is_given_up_after_a_hundred_stiff_ones_and_a_hundred_periods() -> None:
    """Counted from the release of a brake."""
    drive, weak = CRANE.replace(load_kind="reactive", damping=2.0, start_position=0.0), {"torque": 7.0}
    limit = 100.0 * (0.21 * drive.target_speed / (62.0 - 7.16) + 2.0 * math.pi / drive.Omega)
    for given, begin in (({}, 0.0), ({"brake": "motor", "release": 0.25}, 0.25)):
        run = simulate(drive.replace(**given), "direct", parameters=weak)
        assert run.status is Status.NOT_REACHED
        assert run.end_time == pytest.approx(begin + limit, rel=1e-12)


@pytest.mark.parametrize(
    ("beyond", "said"), [(1e-10, ""), (1e-8, "up to 6.4e-07 N m"), (0.05, "up to 3.2 N m")]
)
def test_a_demand_beyond_the_motor_is_told_but_for_rounding(beyond: float, said: str) -> None:
    """The motor has 64 N m."""
    run = simulate(CRANE, Pieces(pieces=((0.0, 64.0 * (1.0 + beyond)),)))
    told = clipped_torque(run)
    assert bool(told) == bool(said)
    assert said in told
    assert run.clipped.time == pytest.approx(run.end_time, rel=1e-12)


def test_csv_reads_back(run: Run, tmp_path: Path) -> None:
    run.to_csv(tmp_path / "start.csv")
    with (tmp_path / "start.csv").open(encoding="utf-8") as file:
        header, *rows = csv.reader(file)
    assert header == ["t [s]", "phi1 [rad]", "phi2 [rad]", "w1 [rad/s]", "w2 [rad/s]", "u [N*m]", "T [N*m]"]
    table = np.array(rows, dtype=float)
    np.testing.assert_array_equal(table[:, 0], run.t)
    np.testing.assert_array_equal(table[:, 6], run.T)
    with pytest.raises(InputError, match="cannot be written there"):
        run.to_csv(tmp_path / "nowhere" / "start.csv")


def test_a_start_that_never_arrives_says_so() -> None:
    run = simulate(CRANE.replace(load_kind="reactive"), "direct", parameters={"torque": 7.0}, time_limit=3.0)
    assert run.status is Status.NOT_REACHED
    assert math.isnan(run.start_time)
    assert run.end_time == 3.0
    assert 0.0 < run.k_dyn < 1.0  # the motor alone swings against the resting load
    assert simulate(CRANE, "direct", until=0.1).status is Status.STOPPED_EARLY


def test_the_figure_shows_the_run(run: Run) -> None:
    torque, speed, twist = run.plot().axes
    drawn = next(line for line in torque.lines if line.get_label() == "shaft torque T")
    np.testing.assert_array_equal(drawn.get_ydata(), run.T)
    open_stages = [stage for stage in run.stages if stage.side == 0]
    shaded = [path.get_extents() for shade in twist.collections for path in shade.get_paths()]
    np.testing.assert_allclose([one.intervalx for one in shaded], [(s.start, s.end) for s in open_stages])
    assert f"{run.start_time:.4f}" in speed.get_title(loc="left")


@pytest.mark.parametrize(
    ("drives", "options", "said"),
    [
        (CRANE, {"until": 0.0}, "until = 0.0"),
        (CRANE, {"until": "1 rad"}, 'until = "1 rad"'),
        (CRANE, {"time_limit": -1.0}, "time_limit = -1"),
        (CRANE, {"base": 3}, "base: give one Drive or Chain"),
        (CRANE, {"fitted_to": machine_table(CRANE, gap=[0.5, 2.0])}, "fitted_to: a table of shape (2,)"),
        (CRANE, {"max_events": 0}, "max_events = 0"),
        ([], {}, "drive"),
        ([CRANE, 1], {}, "drive"),
        (3.0, {}, "drive"),
    ],
)
def test_bad_arguments(drives: Any, options: dict[str, Any], said: str) -> None:
    with pytest.raises(InputError) as caught:
        simulate(drives, "direct", **options)
    (sentence,) = caught.value.sentences
    assert said in sentence


def test_torque_at_contact_of_a_start_in_contact() -> None:
    assert simulate(CRANE.replace(start_position=0.3), "direct").torque_at_contact == 62.0
    assert simulate(CRANE.replace(start_position=0.3, torque_lag=0.01), "direct").torque_at_contact == 0.0


HEAVY = CRANE.replace(load_inertia=35_000.0)  # 960,000 elastic periods to its target speed


def test_a_start_that_is_too_long_is_given_up() -> None:
    batch = simulate([HEAVY, CRANE], "ramp")
    assert batch.status.values.tolist() == ["TOO_LONG", "REACHED"]
    assert math.isnan(batch.k_dyn[0])


@pytest.mark.slow
def test_a_start_that_is_too_long_names_the_remedy() -> None:
    for machine, until in ((HEAVY, None), (chain_of(HEAVY), None), (CRANE, 1e9)):
        with pytest.raises(SimulationError, match=r"more than 100,000 elastic periods.*Check the units"):
            simulate(machine, "ramp", until)


@pytest.mark.slow
def test_the_longest_start_keeps_its_energy() -> None:
    run = simulate(CRANE.replace(load_inertia=3500.0), "ramp")
    assert run.end_time > 96_000 * run.drive.elastic_period
    assert abs(run.energy.residual) < 1e-9 * run.energy.motor


def test_a_start_that_does_not_reach_its_target_is_not_too_long() -> None:
    """A hundred times a stiff start is beyond the bound here, ten times is not: that tells enough."""
    drive = CRANE.replace(load_inertia=300.0, damping=2.0)
    assert simulate([drive], make_controller("direct", {"torque": 6.0})).status.item() == "NOT_REACHED"


def test_a_start_with_too_fast_a_motion_is_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    """Damping of 1e7 N m s/rad: 3.4e8/s, a span in 9 ns. Recorded or not, spans are bounded in number."""
    stiff = CRANE.replace(damping=1e7)
    with pytest.raises(SimulationError, match=r"units of damping, .* direct, t = 0\.0166\d+ s, 1 events"):
        simulate(stiff, "direct", max_events=100)
    batch = simulate([stiff, CRANE], "direct", max_events=100, workers=1)
    assert batch.status.values.tolist() == ["TOO_STIFF", "REACHED"]
    assert np.isnan(batch.k_dyn.values[0])
    monkeypatch.setattr("softstart.start.trajectory.MOST_BYTES", 1_000_000)
    with pytest.raises(SimulationError, match="or more memory"):
        simulate(stiff, "direct")


class Sleeper(PlainController):
    """Does not return before it has been named, and then some looks of the watcher later."""

    name = "sleeper"

    def step(self, measured: Measured, state: tuple[float, ...]) -> Command:
        latest = time.monotonic() + 60.0
        while measured.time == 0.0 and time.monotonic() < latest:
            if "sleeper has been in step()" in cast("Any", sys.stderr).getvalue():
                time.sleep(0.3)
                break
            time.sleep(0.01)
        return Command(62.0)


@compiled_step
def spin(parameters: Vector, measured: Vector, state: Vector, command: Vector) -> None:
    """Works for about a second."""
    x = 0.5
    for _ in range(100_000_000):
        x = math.sin(x) + 0.5
    command[0] = 62.0 + 1e-300 * x
    command[1] = math.inf


class Spinner(CompiledController):
    """Works for a while, compiled."""

    name = "spinner"
    kernel = spin

    def vector(self, drive: Drive) -> Vector:
        return np.zeros(1)


@pytest.mark.parametrize(
    ("controller", "batch"),
    [(Sleeper(), False), (Sleeper(), True), pytest.param(Spinner(), False, marks=pytest.mark.slow)],
)
def test_a_controller_that_does_not_return_is_named_once(
    controller: Any, batch: bool, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(engine, "SILENCE", 0.2)
    simulate([CRANE] if batch else CRANE, controller)
    said = capsys.readouterr().err
    sentence = f"Controller {controller.name} has been in step() for 0.2 s. Press Ctrl-C to abort."
    assert said.count(sentence) == 1
    assert threading.get_ident() not in engine._computing  # it is watched no longer


def test_controllers_that_come_and_go_in_many_threads_are_watched_to_the_last(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Whoever comes first starts the watcher, and there is never a second one."""
    for _ in range(2):
        with ThreadPoolExecutor(8) as pool:
            list(pool.map(lambda _: engine.watched(Sleeper()).__enter__(), range(200)))
            engine._computing.clear()
        monkeypatch.setattr(engine, "SILENCE", 0.2)
        deadline = time.monotonic() + 60.0
        with engine.watched(Sleeper()):
            while not (err := capsys.readouterr().err) and time.monotonic() < deadline:
                time.sleep(0.02)
        assert err.count("has been in step() for 0.2 s") == 1
        monkeypatch.setattr(engine, "SILENCE", 60.0)  # those of the pool above need not be done in 0.2 s
    assert [one.name for one in threading.enumerate()].count("softstart-watch") == 1


def test_a_torque_over_time_is_a_controller_in_any_form() -> None:
    """A ramp as arrays, profile and function is the ramp of the controller `profile`, to the last digits."""
    times, torques = [0.0, 0.1, 0.2], [10.0, 62.0, 62.0]
    profile = TorqueProfile(times, torques)
    wanted = simulate(CRANE, "profile", parameters={"profile": profile})
    for controller in (profile, (times, torques), lambda t: float(np.interp(t, times, torques))):
        run = simulate(CRANE, controller)
        assert run.k_dyn == pytest.approx(wanted.k_dyn, rel=1e-9)
        assert run.start_time == pytest.approx(wanted.start_time, rel=1e-9)
    assert [row.name for row in compare(CRANE, [profile, "direct"]).rows] == ["profile", "direct"]


def test_times_have_units_and_the_crane_is_the_default() -> None:
    run = simulate(until="200 ms")
    assert (run.drive, run.controller_name, run.end_time) == (CRANE, "direct", 0.2)
    assert (run.status.success, run.status.message) == (False, run.status.value)
    late = simulate(CRANE, "ramp", time_limit="100 ms")
    assert (late.status.name, late.end_time) == ("NOT_REACHED", 0.1)


class Sampled(PlainController):
    """Returns its torque alone, every 1 ms."""

    name = "sampled"
    period = 0.001

    def step(self, measured: Measured, state: tuple[float, ...]) -> float:
        return min(62.0, 620.0 * measured.time)


class Stepped(Sampled):
    """The same, in full."""

    def step(self, measured: Measured, state: tuple[float, ...]) -> Any:
        sample = round(measured.time / 0.001)
        return Command(min(62.0, 620.0 * measured.time), (sample + 1.0) * 0.001, state)


def test_a_sampled_controller_may_return_the_torque_alone() -> None:
    one, other = simulate(CRANE, Sampled()), simulate(CRANE, Stepped())
    assert one.trajectory.states.tobytes() == other.trajectory.states.tobytes()
    stepless = type("Stepless", (Sampled,), {"period": None})
    with pytest.raises(InputError, match="of a controller with a `period`, the torque alone"):
        simulate(CRANE, stepless())


def test_the_public_names_are_what_dir_shows() -> None:
    assert dir(softstart) == sorted(softstart.__all__)
    assert {"Mass", "Motor", "Shaft", "compiled_step", "make_controller", "parameter"} <= set(dir(softstart))
