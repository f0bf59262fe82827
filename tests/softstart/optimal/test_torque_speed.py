"""A torque-speed curve: the start of a rigid drive by independent integration; what is refused at once."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from tests.twin import chain_of

from softstart import Chain, Drive, InfeasibleError, InputError, optimize
from softstart.chain.elements import Mass, Motor, Shaft
from softstart.cli import main
from softstart.optimal.problem import Problem
from softstart.optimal.torque_speed import RigidStart

CRANE = Drive.load("crane-4amtkf")
CURVES = {
    "falling": ((0.0, 62.0), (90.0, 40.0)),
    "rising, then falling": ((0.0, 30.0), (60.0, 61.0), (110.0, 9.0)),
    "above the torque of the motor at first": ((0.0, 90.0), (100.0, 20.0)),
    "flat": ((0.0, 50.0), (1.0, 50.0)),
}
FAN = Chain(
    [
        Mass(0.035),
        Mass(
            0.175, torque=7.0, damping=0.05, curve_speed=[0.0, 50.0, 92.0], curve_torque=[0.0, 3.0, 9.0]
        ),
    ],
    [Shaft(368.465, gap=0.5)], Motor(62.0), target_speed=92.0,
)  # fmt: skip


def integrated(machine, J: float, curve, load, begin: float = 0.0) -> float:
    """The time to the target speed by Runge and Kutta."""
    speed, torque = np.array(curve).T
    slope = np.diff(torque) / np.diff(speed)

    def rate(_, w):
        u = min(62.0, float(np.min(torque[:-1] + slope * (w[0] - speed[:-1]))))
        return [(u - load(w[0])) / J]

    reached = lambda _, w: w[0] - float(machine.target_speed)  # noqa: E731
    reached.terminal = True
    found = solve_ivp(rate, (0.0, 9.0), [begin], events=reached, rtol=1e-10, atol=1e-12, max_step=1e-3)
    return float(found.t_events[0][0])


@pytest.mark.parametrize("curve", CURVES.values(), ids=CURVES)
def test_the_time_of_a_rigid_drive(curve) -> None:
    time = integrated(CRANE, 0.21, curve, lambda w: 7.16)
    for machine in (CRANE, chain_of(CRANE)):
        assert RigidStart(machine, curve).time == pytest.approx(time, rel=1e-7)


def test_the_time_under_a_fan_with_friction() -> None:
    load = lambda w: 7.0 + 0.05 * w + np.interp(w, [0.0, 50.0, 92.0], [0.0, 3.0, 9.0])  # noqa: E731
    time = integrated(FAN, 0.21, CURVES["falling"], load)
    assert RigidStart(FAN, CURVES["falling"]).time == pytest.approx(time, rel=1e-7)


def test_from_another_speed() -> None:
    drive = CRANE.replace(initial_speed=40.0)
    time = integrated(drive, 0.21, CURVES["falling"], lambda w: 7.16, 40.0)
    assert RigidStart(drive, CURVES["falling"]).time == pytest.approx(time, rel=1e-7)


@pytest.mark.parametrize(
    ("curve", "at", "motor"),
    [
        (((0.0, 5.0), (90.0, 5.0)), 0.0, 5.0),
        (
            ((0.0, 62.0), (90.0, 7.0)),
            92.15,
            62.0 - 55.0 / 90.0 * 880 * math.pi / 30,
        ),  # the last piece goes on
        (((0.0, 7.16), (50.0, 60.0), (100.0, 60.0)), 0.0, 7.16),
        (((0.0, 62.0), (60.0, 62.0), (92.0, 0.0)), 92.15, 62.0 - 62.0 / 32.0 * (880 * math.pi / 30 - 60.0)),
    ],
)
def test_a_curve_below_the_load_is_refused_at_once(curve, at: float, motor: float) -> None:
    """Within what the first descent would take a hundred times."""
    for options in ({"start_time": "1.2x"}, {"minimise": "start_time"}, {"start_time": 0.01}):
        with pytest.raises(InfeasibleError) as caught:
            optimize(CRANE, torque_speed=curve, **options)
        assert math.isinf(caught.value.verdict.shortest_start_time)
        sentence = str(caught.value)
        assert f"at {at:.4g} rad/s the motor has {motor:.4g} N m and the load takes 7.16 N m" in sentence


@pytest.mark.parametrize("line", ["pareto", "pareto --start-times 1.2x", "optimize", "optimize --limits"])
def test_the_commands_say_so_in_one_sentence(line: str, capfd: pytest.CaptureFixture[str]) -> None:
    limits = ("--set", "limits.shaft_torque=60") if "--limits" in line else ()
    assert main([*line.split(), *limits, "--torque-speed", "0:5,90:5"]) == 3
    out, err = capfd.readouterr()
    assert (out, err.count("\n")) == ("", 1)
    assert "--torque-speed: at 0 rad/s the motor has 5 N m and the load takes 7.16 N m" in err


@pytest.mark.parametrize("curve", [((0.0, 62.0), (90.0, -5.0)), ((0.0, -5.0), (90.0, -5.0))])
def test_a_negative_limit_is_bad_input(curve) -> None:
    with pytest.raises(InputError, match=r"-5 N m at .* rad/s: a limit of the torque is 0 or more"):
        Problem(CRANE, 0.5, torque_speed=curve)


@pytest.mark.slow
def test_the_example_of_the_help() -> None:
    """The multiple is that of the rigid drive, as the motor does not have the torque of direct."""
    curve = CURVES["falling"]
    best = optimize(CRANE, torque_speed=curve)
    assert best.problem.start_time == pytest.approx(1.2 * RigidStart(CRANE, curve).time)
    run = best.run
    assert (run.u <= 62.0 - 22.0 / 90.0 * run.w1 + 1e-3).all()
    assert run.at([best.end_time])["w2"][0] == pytest.approx(CRANE.target_speed, rel=1e-4)
    assert best.k_dyn < 0.755  # 0.75407 with every row of the curve in every program


@pytest.mark.slow
def test_the_shortest_start_of_a_large_motor_is_that_of_a_rigid_drive() -> None:
    """Case 08: 110 elastic periods, and no gap: the elasticity matters within 0.1 % only."""
    rpm = math.pi / 30.0
    drive = Drive(
        motor_inertia=80.0, starting_torque=12_732.0, load_inertia=50.0, load_torque=1000.0,
        load_kind="reactive", stiffness=5e6, damping=500.0, gap=0.0, target_speed=1480.0 * rpm,
    )  # fmt: skip
    curve = ((0.0, 10e3), (1400.0 * rpm, 25e3), (1500.0 * rpm, 1.0))
    best = optimize(drive, minimise="start_time", torque_speed=curve)
    assert best.end_time == pytest.approx(RigidStart(drive, curve).time, rel=1e-3)
