"""Duties: one start is `simulate`, a mirrored duty is mirrored, a step begins where the last has ended."""

from __future__ import annotations

import math

import numpy as np
import pytest

from softstart import Chain, Drive, Duty, DutyRun, DutyStep, InputError, SimulationError, run_duty, simulate
from softstart.plugins import controller_names
from softstart.start.metrics import energy_balance

STRATEGIES = [name for name in controller_names() if name != "profile"]
CONVEYOR = Drive.load("conveyor-11kw")
GO_AND_STOP = [DutyStep("start"), DutyStep("hold", time=0.5), DutyStep("stop", by="coast")]


def bits(run: DutyRun) -> list[bytes]:
    return [phase.trajectory.states.tobytes() for phase in run.phases]


def joints(run: DutyRun) -> list[tuple[np.ndarray, np.ndarray]]:
    """Twists and speeds before and after each joint of two phases."""
    pairs = zip(run.phases, run.phases[1:], strict=False)
    states = [(first.trajectory, then.trajectory) for first, then in pairs]
    return [
        (
            np.concatenate([one.of_shafts("twist")[-1], one.of_masses("speed")[-1]]),
            np.concatenate([other.of_shafts("twist")[0], other.of_masses("speed")[0]]),
        )
        for one, other in states
    ]


@pytest.mark.parametrize("name", STRATEGIES)
@pytest.mark.parametrize("machine", ["crane-4amtkf", "hoist-15kw", "conveyor-11kw", "crane-4-mass"])
def test_a_duty_of_one_start_is_simulate_to_the_bit(machine: str, name: str) -> None:
    duty, run = run_duty(machine, name, Duty([DutyStep("start")])), simulate(machine, name)
    assert not duty.repeated
    assert duty.cycles == 1
    (phase,) = duty.phases
    assert phase.trajectory.states.tobytes() == run.shown.trajectory.states.tobytes()
    assert duty.k_dyn == pytest.approx(run.k_dyn, rel=1e-14)
    assert duty.rows[0].start_time == run.limited_time or math.isnan(run.limited_time)


def mirrored(duty: Duty, target: float) -> Duty:
    """The same duty the other way round."""
    steps, direction = [], 1.0
    for step in duty.steps:
        if step.do in ("start", "jog"):
            direction = math.copysign(1.0, step.set_speed or 1.0)
        elif step.do == "reverse":
            direction = -direction
        if step.do in ("start", "jog", "reverse"):
            steps.append(step.replace(set_speed=-direction * abs(step.set_speed or target)))
        else:
            steps.append(step)
    return Duty(steps)


@pytest.mark.parametrize("lines", [0, 1024])
@pytest.mark.parametrize("name", STRATEGIES)
def test_a_mirrored_duty_gives_the_mirrored_run_to_the_bit(name: str, lines: int) -> None:
    top = CONVEYOR.maximum_torque
    drive = CONVEYOR.replace(
        minimum_torque=-top, torque_noise=0, encoder_lines=lines, encoder_phase=0.25,
        start_position=0.3 * CONVEYOR.gap,
    )  # fmt: skip
    other = drive.replace(start_position=-0.3 * drive.gap, encoder_phase=0.75)
    duty = Duty(
        [
            DutyStep("start"), DutyStep("hold", time=0.3), DutyStep("reverse"), DutyStep("hold", angle=50.0),
            DutyStep("stop", by="torque", braking_torque=50.0), DutyStep("jog", time=0.1, by="coast"),
        ]
    )  # fmt: skip
    forth = run_duty(drive, name, duty, fitted_to=drive)
    back = run_duty(other, name, mirrored(duty, drive.target_speed), fitted_to=drive)
    for one, two in zip(forth.executed, back.executed, strict=True):
        assert np.array_equal(one.largest, -two.smallest)
        assert np.array_equal(one.smallest, -two.largest)
        assert (one.time, one.begin, one.contacts) == (two.time, two.begin, two.contacts)
        assert one.angle == -two.angle
    assert forth.worst.number == back.worst.number


def test_states_are_continuous_from_phase_to_phase() -> None:
    drive = CONVEYOR.replace(minimum_torque=-100.0)
    duty = Duty(
        [
            *GO_AND_STOP, DutyStep("load", torque=60.0, inertia=1.3), DutyStep("jog", time=0.1, repeat=2),
            DutyStep("start"), DutyStep("reverse"), DutyStep("stop", by="torque"),
        ]
    )  # fmt: skip
    for name in ("direct", "speed-ramp", "take-up"):
        run = run_duty(drive, name, duty)
        for before, after in joints(run):
            assert np.array_equal(before, after)
        ends = [(one.end, two.begin) for one, two in zip(run.executed, run.executed[1:], strict=False)]
        np.testing.assert_allclose(*np.transpose(ends), rtol=1e-13)


def test_energy_and_momentum_of_every_step() -> None:
    """Work of the motor and the loads is kinetic and elastic energy and what is lost, in each phase."""
    drive = CONVEYOR.replace(minimum_torque=-100.0, motor_friction=1.0, brake_torque=120.0)
    duty = Duty([*GO_AND_STOP, DutyStep("load", inertia=1.3, torque=20.0), DutyStep("jog", time=0.2)])
    run = run_duty(drive, "ramp", duty)
    for phase in run.phases:
        energy = energy_balance(phase.trajectory)
        assert abs(energy.residual) <= 1e-9 * (
            abs(energy.motor) + abs(energy.load) + abs(energy.kinetic) + 1.0
        )
    assert len(run.phases) > 10


def test_the_stop_of_a_torque_source_lasts_as_long_as_momentum_says() -> None:
    """A stiff drive without a gap: w(t) = w0 - (u + Mc) t/J to standstill, angle w0^2 J/(2 (u + Mc))."""
    drive = Drive(
        motor_inertia=0.1, starting_torque=50, minimum_torque=-50, stiffness=1e5, damping=5.0, gap=0,
        load_inertia=0.4, load_torque=10, load_kind="reactive", target_speed=100,
    )  # fmt: skip
    duty = Duty(
        [DutyStep("start"), DutyStep("hold", time=1), DutyStep("stop", by="torque", braking_torque=15)]
    )
    start, hold, stop = run_duty(drive, "direct", duty, cycles=1).executed
    assert start.start_time == pytest.approx(100 * 0.5 / 40, rel=1e-3)
    speed = hold.angle / hold.time
    assert speed == pytest.approx(100, rel=5e-3)
    assert stop.time == pytest.approx(0.5 * (speed - 1.0) / 25, rel=5e-3)  # to 1 % of the target speed
    assert stop.angle == pytest.approx(speed**2 * 0.5 / 50, rel=5e-3)


def test_a_brake_of_this_torque_stops_the_motor() -> None:
    """Closed after its delay, it takes (brake + Mc)/J; the motor is held by friction then."""
    drive = Drive(
        motor_inertia=0.1, starting_torque=50, stiffness=1e5, damping=5.0, gap=0, load_inertia=0.4,
        load_torque=10, load_kind="reactive", target_speed=100, brake_torque=30, closing_delay=0.2,
    )  # fmt: skip
    run = run_duty(
        drive,
        "direct",
        Duty([*GO_AND_STOP[:1], DutyStep("hold", time=1), DutyStep("brake"), DutyStep("hold", time=1)]),
    )
    stop = run.executed[2]
    speed = run.executed[1].angle / run.executed[1].time
    slower = speed - 10 / 0.5 * 0.2  # coasts while the brake closes
    assert stop.time == pytest.approx(0.2 + (slower - 1.0) * 0.5 / 40, rel=5e-3)
    held = run.executed[3].phases[-1].trajectory
    assert held.of_masses("direction")[-1].tolist() == [0.0, 0.0]  # friction holds both


def test_an_opening_delay_follows_torque_proving() -> None:
    hoist = Drive.load("hoist-15kw")
    late = hoist.replace(opening_delay=0.05)
    first, then = simulate(hoist, "ramp"), simulate(late, "ramp")
    assert then.release_time == pytest.approx(first.release_time + 0.05, rel=1e-12)


def test_a_duty_on_a_chain() -> None:
    chain = Chain.load("crane-4-mass").with_damping_ratio(0.03)
    duty = Duty([DutyStep("start"), DutyStep("hold", angle=20.0), DutyStep("stop", time=3.0, by="coast")])
    with pytest.raises(InputError, match="runs away"):
        run_duty(chain, "ramp", Duty([DutyStep("start"), DutyStep("stop", by="coast")]))
    run = run_duty(chain.replace(brake_torque=200.0), "ramp", duty)
    assert run.executed[1].angle == pytest.approx(20.0, rel=1e-9)
    assert run.executed[0].largest.shape == (3,)


def test_peaks_of_the_kernel_are_those_of_the_turning_points() -> None:
    run = run_duty(CONVEYOR, "ramp", Duty(GO_AND_STOP))
    for step in run.executed:
        noted = max(float(np.abs(phase.trajectory.shafts["peak"]).max()) for phase in step.phases)
        assert noted == pytest.approx(step.peak_torque, rel=1e-12)


def test_an_unknown_position_is_tried_for_the_first_step_only() -> None:
    drive = CONVEYOR.replace(start_position="unknown")
    run, starts = run_duty(drive, "direct", Duty(GO_AND_STOP)), simulate(drive, "direct")
    assert run.executed[0].peak_torque == pytest.approx(starts.peak_torque, rel=1e-13)
    known = run_duty(drive.replace(start_position=starts.position), "direct", Duty(GO_AND_STOP))
    assert bits(run) == bits(known)


def test_more_cycles_change_nothing_before_them() -> None:
    two, five = (run_duty(CONVEYOR, "ramp", Duty(GO_AND_STOP), cycles=n) for n in (2, 5))
    assert bits(two) == bits(five)
    assert [one.peak_torque for one in five.executed[:6]] == [one.peak_torque for one in two.executed]
    assert five.turning_points[0].shape[0] > 2 * two.turning_points[0].shape[0]


def test_one_trace_over_the_whole() -> None:
    run = run_duty(CONVEYOR, "ramp", Duty(GO_AND_STOP))
    end = run.phases[-1].end
    times = np.linspace(0.0, end, 4001)
    states = run.at(times)
    travelled = sum(step.angle for step in run.executed)
    assert states["phi"][-1, 1] - states["phi"][0, 1] == pytest.approx(travelled, rel=1e-12)
    steps = np.diff(states["phi"][:, 1])
    assert np.abs(steps).max() <= 1.05 * np.abs(states["w"][:, 1]).max() * (times[1] - times[0])
    with pytest.raises(ValueError, match="recorded"):
        run.at([end + 1.0])


@pytest.mark.parametrize("cycles", [0, True, 1.5])
def test_refused_numbers_of_cycles(cycles: object) -> None:
    with pytest.raises(Exception, match="whole number"):
        run_duty(CONVEYOR, "direct", Duty(GO_AND_STOP), cycles=cycles)  # type: ignore[arg-type]


def test_a_duty_of_a_speed_controller_is_simulate_with_commands() -> None:
    """Start, stop and reversal are changes of what is commanded, the state of the loop goes on."""
    drive = CONVEYOR.replace(minimum_torque=-150.0, encoder_lines=0)
    duty = Duty([DutyStep("start", time=2.0), DutyStep("reverse", time=3.0), DutyStep("stop", time=2.0)])
    run = run_duty(drive, "speed-ramp", duty, cycles=1)
    n = drive.target_speed
    whole = simulate(drive, "speed-ramp", 7.0, commands=[(2.0, 1, -n), (5.0, 0, -n)])
    for phase in run.phases:
        last = phase.trajectory.states[-1]
        state = whole.at(last[1])
        assert phase.trajectory.of_masses("speed")[-1] == pytest.approx(
            [float(state["w1"]), float(state["w2"])], rel=1e-9, abs=1e-9
        )
    assert run.k_dyn == pytest.approx(whole.k_dyn, rel=1e-12)


def test_a_motor_that_cannot_brake_starts_backwards_as_forwards() -> None:
    duty = Duty([DutyStep("start"), DutyStep("stop", by="coast")])
    back = Duty([DutyStep("start", set_speed=-CONVEYOR.target_speed), DutyStep("stop", by="coast")])
    drive = CONVEYOR.replace(start_position="mid-gap", torque_noise=0.0, encoder_lines=0)
    for name in ("direct", "speed-ramp"):
        one, two = run_duty(drive, name, duty), run_duty(drive, name, back)
        assert [-step.angle for step in one.executed] == [step.angle for step in two.executed]


def test_a_brake_is_closed_before_the_first_step() -> None:
    hoist = Drive.load("hoist-15kw")
    run = run_duty(hoist, "direct", Duty([DutyStep("hold", time=0.5), DutyStep("start")]))
    assert run.executed[0].largest[0] == pytest.approx(hoist.active_torque, rel=0.01)
    assert run.executed[0].angle == pytest.approx(0.0, abs=1e-3)


def test_an_undamped_machine_never_rests() -> None:
    crane = Drive.load("crane-4amtkf").replace(load_kind="reactive", start_position="mid-gap")
    with pytest.raises(SimulationError, match=r"\[duty\] 2.*does not come to rest.*damping"):
        run_duty(crane, "direct", Duty([DutyStep("start"), DutyStep("stop", by="coast")]))
    run = run_duty(crane, "direct", Duty([DutyStep("start"), DutyStep("stop", by="coast", time=8.0)]))
    assert run.executed[1].time == pytest.approx(8.0, rel=1e-12)


def test_a_reversal_by_a_speed_controller_needs_a_braking_torque() -> None:
    duty = Duty([DutyStep("start"), DutyStep("reverse")])
    with pytest.raises(InputError, match=r"\[duty\] 2.*speed-ramp.*minimum_torque"):
        run_duty(CONVEYOR, "speed-ramp", duty)
    assert run_duty(CONVEYOR, "direct", duty).executed[1].how == "strategy, anew in the other direction"


def test_a_motor_that_friction_stops_has_slowed_down() -> None:
    """Friction holds the motor at the root of its speed; there the brake is commanded."""
    drive = Drive(
        motor_inertia=0.0612, starting_torque=26, minimum_torque=-20, motor_friction=2.0, stiffness=1344,
        damping=4.6, gap=0.032, load_inertia=0.167, load_torque=8.4, load_kind="reactive", target_speed=5.9,
        brake_torque=24.0, closing_delay=0.014, encoder_lines=0, start_position=0.0,
    )  # fmt: skip
    run = run_duty(drive, "direct", Duty([DutyStep("start"), DutyStep("stop", by="coast")]), cycles=1)
    stop = run.executed[1]
    assert stop.phases[0].end == pytest.approx(0.209340581, rel=1e-8)
    assert stop.phases[1].end == pytest.approx(stop.phases[0].end + 0.014, rel=1e-12)


def test_a_load_that_changes_takes_time() -> None:
    drive = CONVEYOR.replace(brake_torque=200.0, closing_delay=0.1)
    steps = [DutyStep("start"), DutyStep("stop", by="coast"), DutyStep("load", torque=40.0)]
    run = run_duty(drive, "direct", Duty(steps))
    for step in run.executed:
        assert 0.0 <= step.time <= step.end - step.begin


def test_a_load_that_the_motor_cannot_hold_back_is_refused() -> None:
    hoist = Drive.load("hoist-15kw").replace(brake_torque=300.0)
    down = Duty([DutyStep("start", set_speed=-50.0), DutyStep("hold", time=1), DutyStep("brake")])
    with pytest.raises(SimulationError, match=r"\[duty\] 2.*-120 N\*m that hold the load.*minimum_torque"):
        run_duty(hoist, "direct", down)
    assert run_duty(hoist.replace(minimum_torque=-250.0), "direct", down).executed[1].time == 1.0


@pytest.mark.parametrize("name", ["ramp", "shaped", "speed-ramp", "take-up", "state-feedback"])
def test_a_strategy_begins_when_its_brake_is_open(name: str) -> None:
    """Not against it: the same start, later by the opening delay, alone and in a duty."""
    free = CONVEYOR.replace(start_position="driving-flank", encoder_lines=0, torque_noise=0)
    held = free.replace(brake_torque=200.0, opening_delay=0.08)
    one, two = simulate(free, name, fitted_to=free), simulate(held, name, fitted_to=free)
    assert two.k_dyn == pytest.approx(one.k_dyn, rel=1e-9)
    assert two.limited_time == pytest.approx(one.limited_time + 0.08, rel=1e-9)
    assert two.release_time == 0.08
    duty = Duty([DutyStep("start"), DutyStep("brake"), DutyStep("hold", time=1.0)])
    first, again = run_duty(held, name, duty, fitted_to=free).executed[::3]
    assert first.start_time == pytest.approx(two.limited_time, rel=1e-9)
    assert again.start_time == pytest.approx(two.limited_time, rel=0.05)


def test_a_machine_stands_when_its_load_does_not_swing_back() -> None:
    """The load on the held motor swings more slowly than both masses: it stands for one of its periods."""
    crane = Drive.load("long-travel-3kw").replace(brake_torque=36.0, closing_delay=0.06)
    run = run_duty(crane, "direct", Duty([DutyStep("start"), DutyStep("brake"), DutyStep("hold", time=2.0)]))
    for step in run.executed[2::3]:
        assert run.k_dyn_of(step) < 0.13  # what friction holds, 5 N m
        assert abs(step.angle) < 0.02
