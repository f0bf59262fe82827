"""What has bitten others on this very problem, each once."""

from __future__ import annotations

import math

import numpy as np
import pytest

from softstart import Command, Drive, Measured, PlainController, SimulationError, Status, records, simulate

CRANE = Drive.load("crane-4amtkf")


def test_the_cap_on_events_raises() -> None:
    with pytest.raises(SimulationError, match="control instants than max_events allows"):
        simulate(CRANE, "direct", until=10.0, max_events=10)
    table = simulate(records(CRANE, gap=[0.5, 2.0]), "direct", until=10.0, max_events=10)
    assert set(table.status.values) == {Status.TOO_MANY_EVENTS.name}
    assert np.isnan(table.k_dyn).all()


def test_a_reactive_load_rests_until_the_shaft_moves_it() -> None:
    run = simulate(CRANE.replace(load_kind="reactive"), "direct")
    starts = next(event for event in run.events if event.kind == "load starts")
    assert float(run.at(starts.time)["T"]) == pytest.approx(7.16, rel=1e-12)
    before = run.at(np.linspace(0.0, starts.time, 50))
    assert np.all(before["w2"] == 0.0)
    assert np.all(before["phi2"] == 0.0)
    assert run.at(run.t)["w2"].min() == 0.0  # never backwards
    # treating it as active is some percent off, and turns the load backwards first
    active = simulate(CRANE, "direct")
    assert active.w2.min() < -0.5
    assert 0.005 < abs(active.k_dyn / run.k_dyn - 1.0) < 0.05


def test_a_reactive_load_stops_and_rests_when_the_torque_ends() -> None:
    class Push(PlainController):
        name = "push"

        def step(self, measured: Measured, state: tuple[float, ...]) -> Command:
            if measured.time < 0.1:
                return Command(30.0, 0.1)
            return Command(0.0)

    run = simulate(CRANE.replace(load_kind="reactive", damping=0.5), Push(), until=20.0)
    assert run.status is Status.STOPPED_EARLY
    assert run.events[-1].kind in {"load stops", "gap closed", "gap opened"}
    end = run.at(20.0)
    assert float(end["w2"]) == 0.0
    assert len(run.events) < 400


def test_the_far_flank_is_grazed_not_hit() -> None:
    """From theta = -gap/2 every rebound comes back to that flank with speed zero, to rounding."""
    for gap in (0.01, 7.3):
        run = simulate(CRANE.replace(gap=gap, start_position=-gap / 2), "direct", until=1.0)
        assert {stage.side for stage in run.stages} == {0, 1}
        assert float(np.min(run.theta)) == pytest.approx(-gap / 2, abs=1e-9 * gap)


def test_the_peak_is_not_read_off_a_grid() -> None:
    run = simulate(CRANE.replace(gap=2.0), "direct", until=1.0)
    errors = []
    for step in (10e-3, 1e-3):
        seen = np.abs(run.at(np.arange(0.0, 1.0, step))["T"]).max()
        errors.append(1.0 - seen / run.peak_torque)
    assert errors[0] > 1e-3  # what a 10 ms grid would have claimed
    assert float(run.at(run.peak_time)["T"]) == pytest.approx(run.peak_torque, rel=1e-13)
    assert np.abs(run.T).max() <= run.peak_torque * (1 + 1e-13)


@pytest.mark.parametrize("speeds", [(0.0, 0.0), (3.0, 0.0), (0.0, 3.0)])
def test_a_start_on_the_flank(speeds: tuple[float, float]) -> None:
    """v = 0 on the flank is 0/0 in the textbook root."""
    drive = CRANE.replace(
        start_position=0.25, initial_motor_speed=speeds[0], initial_load_speed=speeds[1], target_speed=50.0
    )
    run = simulate(drive, "direct")
    assert run.status is Status.REACHED
    if speeds[0] >= speeds[1]:
        assert run.first_contact == 0.0
        v = speeds[0] - speeds[1]
        expected = 1.0 + math.sqrt(1.0 + (368.465 * v / (drive.Omega * run.peak_torque / run.k_dyn)) ** 2)
        assert run.k_dyn_first_contact == pytest.approx(expected, rel=1e-12)
    else:
        assert run.first_contact > 0.0


def test_a_start_in_contact() -> None:
    """Shaft wound up by 0.1 rad before the start: T swings about its mean from c*0.1."""
    run = simulate(CRANE.replace(start_position=0.35), "direct")
    mean = run.peak_torque / run.k_dyn
    assert run.stages[0].number == 2
    assert run.stages[0].peak_torque == pytest.approx(mean + abs(36.8465 - mean), rel=1e-12)


def test_a_minute_of_impacts() -> None:
    """Undamped constant torque repeats exactly: after 859 contacts the twist is that of the first cycle."""
    run = simulate(CRANE, "direct", until=60.0)
    assert run.contacts > 850
    first, second, third = run.stages[:3]
    cycle = second.duration + third.duration
    assert all(
        stage.duration == pytest.approx((second if stage.side else third).duration, rel=1e-12)
        for stage in run.stages[1:-1]
    )
    phase = math.fmod(60.0 - first.duration, cycle)
    assert float(run.at(60.0)["theta"]) == pytest.approx(
        float(run.at(first.duration + phase)["theta"]), abs=1e-9
    )
    assert abs(run.energy.residual) < 1e-11 * run.energy.motor
