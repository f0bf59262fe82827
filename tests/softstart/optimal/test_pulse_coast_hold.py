"""The closed form against the exact plant; its limits."""

from __future__ import annotations

import math
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.softstart.optimal.drives import CRANE, played

from softstart import Drive
from softstart.optimal.problem import Problem
from softstart.optimal.pulse_coast_hold import (
    NotApplicable,
    PulseCoastHoldStarts,
    applies,
    solve_pulse_coast_hold,
)


def checked(problem: Problem) -> float:
    """K_dyn, after everything that the form promises has been found true on the exact plant."""
    profile, end_time, claimed = solve_pulse_coast_hold(problem)
    drive = problem.drive
    run = played(drive, profile, end_time + drive.elastic_period)
    state = run.at(end_time)
    assert problem.start_time is not None
    assert end_time <= problem.start_time * (1 + 1e-12)
    assert run.start_time <= end_time
    assert state["w2"] == pytest.approx(drive.target_speed, rel=1e-8)
    assert run.contacts == 1
    assert 0.0 <= profile.torque.min() <= profile.torque.max() <= drive.Ms
    assert run.k_dyn == pytest.approx(claimed, rel=1e-9)
    if problem.terminal == "synchronous":
        assert abs(state["v"]) <= 1e-8 * drive.target_speed
    return claimed


def test_a_load_that_comes_back_by_itself_sets_the_least_peak() -> None:
    drive = CRANE.replace(gap=4.0)
    starts = PulseCoastHoldStarts.of(Problem(drive, 100.0))
    assert starts.least_peak > drive.Mc
    profile, end_time, claimed = solve_pulse_coast_hold(Problem(drive, 100.0))
    assert end_time < 10.0
    assert claimed == pytest.approx(starts.least_peak / Problem(drive, 1.0).base_torque, rel=1e-12)
    assert checked(Problem(drive, 100.0)) == claimed
    assert profile.torque[0] == 0.0
    # by the load's fall over half the gap, and energy: c z^2/2 of the relative motion
    v = math.sqrt(2.0 * drive.Mc / drive.J2 * 2.0)
    T0 = drive.Mc * drive.J1 / (drive.J1 + drive.J2)
    assert starts.least_peak == pytest.approx(T0 + math.hypot(T0, drive.c * v / drive.Omega), rel=1e-12)


def test_reached_before_the_peak_of_the_shaft_torque() -> None:
    drive = CRANE.replace(target_speed=2.0)
    starts = PulseCoastHoldStarts.of(Problem(drive, 1.0))
    course = starts.course(1.5 * starts.most_held)
    within = 0.6 * course.t_peak + 0.4 * course.t_contact
    drive = drive.replace(target_speed=starts.load_speed(course, within, 1.5 * starts.most_held))
    profile, _, claimed = solve_pulse_coast_hold(Problem(drive, within, "reached"))
    assert claimed == pytest.approx(1.5, rel=1e-6)
    run = played(drive, profile, course.t_peak + 0.2 * drive.elastic_period)
    assert run.k_dyn == pytest.approx(claimed, rel=1e-12)
    assert run.start_time == pytest.approx(within, rel=1e-9)
    with pytest.raises(NotApplicable, match="before the shaft torque is at its peak"):
        solve_pulse_coast_hold(Problem(drive, within))


def test_no_hold_beyond_the_motor() -> None:
    with pytest.raises(NotApplicable, match=r"would need 63.618. N m, and the motor has 62 N m"):
        solve_pulse_coast_hold(Problem(CRANE, 0.2522662))
    with pytest.raises(NotApplicable, match="even full torque"):
        solve_pulse_coast_hold(Problem(CRANE, 0.02))


@pytest.mark.parametrize(
    ("changes", "terms", "reason"),
    [
        ({"damping": 0.5}, {}, "damped"),
        ({"load_kind": "reactive"}, {}, "reactive"),
        ({"load_friction": 8.0}, {}, "friction holds it at rest"),
        ({"load_friction": 2.0}, {}, "between falling and rising"),
        ({"torque_lag": 0.002}, {}, "lags"),
        ({"torque_rate": 500.0}, {}, "rate"),
        ({"minimum_torque": -10.0}, {}, "brake"),
        ({"initial_load_speed": 5.0}, {}, "runs away"),
        ({"start_position": -0.3}, {}, "wound up"),
        ({}, {"terminal": "steady"}, "T = Mc"),
        ({}, {"torque_speed": ((0.0, 62.0), (90.0, 20.0))}, "over its speed"),
        ({}, {"smoothness": 0.01}, "smooth"),
        ({}, {"heat": 0.2}, "heat"),
        ({}, {"minimise": "heat"}, "the least heat, and this form has the least K_dyn"),
    ],
)
def test_what_it_is_not_for(changes: Any, terms: Any, reason: str) -> None:
    assert reason in applies(Problem(CRANE.replace(**changes), 0.4, **terms))


@settings(max_examples=60, deadline=None)
@given(
    inertia_ratio=st.floats(0.1, 30.0),
    load=st.just(0.0) | st.floats(0.0, 0.9),
    windups=st.floats(0.0, 30.0),
    position=st.floats(-0.5, 0.5),
    falls=st.just(0.0) | st.floats(-0.3, 0.0),
    periods=st.floats(0.3, 30.0),
    ahead=st.floats(0.0, 0.3),
    share=st.floats(0.02, 1.0 - 1e-6),
    terminal=st.sampled_from(["synchronous", "reached"]),
)
def test_any_drive_keeps_the_promises(
    inertia_ratio: float, load: float, windups: float, position: float, falls: float, periods: float,
    ahead: float, share: float, terminal: Any,
) -> None:  # fmt: skip
    J1, Ms, Omega = 0.02, 50.0, 120.0
    J2 = J1 * inertia_ratio
    c = Omega**2 * J1 * J2 / (J1 + J2)
    target = (1.0 - load) * Ms / (J1 + J2) * periods * 2.0 * math.pi / Omega
    drive = Drive(
        motor_inertia=J1, load_inertia=J2, starting_torque=Ms, load_torque=load * Ms, stiffness=c,
        gap=windups * Ms / c, start_position=position * windups * Ms / c, initial_motor_speed=ahead * target,
        initial_load_speed=falls * target, target_speed=target,
        load_kind="active" if load else "reactive",
    )  # fmt: skip
    starts = PulseCoastHoldStarts.of(Problem(drive, 1.0))
    least = max(starts.least_peak, drive.Mc)
    P = least + share * (starts.most_held - least)
    course = starts.course(P)
    if least >= starts.most_held or starts.load_speed(course, course.t_peak, P) >= target:
        return
    start_time = course.t_peak + J2 * (target - starts.load_speed(course, course.t_peak, P)) / (P - drive.Mc)
    if start_time > 1e4:
        return
    assert checked(Problem(drive, start_time, terminal)) == pytest.approx(
        P / Problem(drive, 1.0).base_torque, rel=1e-6
    )
