"""Both loops of speed-ramp against python-control, and the limit cycle of the Nordin and Gutman rig."""

from __future__ import annotations

import itertools
import math

import control
import numpy as np
import pytest

from softstart import Drive, linear_view, simulate
from softstart.views.linear import linear_sheet

RIG = Drive.load("nordin-servo-60kw")
SLOW_FILTER = {"filter_time": 0.01, "kp": 166.66, "tn": 0.072, "torque_limit": 764.0}
# the describing function is that of the dead-zone law; without load the cycle has no bias
UNLOADED = RIG.replace(load_torque=0.0, contact_law="dead-zone")


@pytest.fixture(scope="module")
def cycling():
    return linear_view(UNLOADED, "speed-ramp", SLOW_FILTER)


def discrete_loop(drive, p, alone):
    """L(z) of PI controller, filter and held plant with a sample of delay, by python-control."""
    T, lag = p["period"], float(drive.torque_lag)
    J1, J2, c, d = (float(value) for value in (drive.J1, drive.J2, drive.c, drive.d))
    if alone:
        plant = control.ss([[0.0]], [[1.0 / J1]], [[1.0]], [[0.0]])
    else:
        plant = control.ss(
            [[-d / J1, d / J1, -c / J1], [d / J2, -d / J2, c / J2], [1.0, -1.0, 0.0]],
            [[1.0 / J1], [0.0], [0.0]], [[1.0, 0.0, 0.0]], [[0.0]],
        )  # fmt: skip
    actuator = control.ss([[-1.0 / lag]], [[1.0 / lag]], [[1.0]], [[0.0]])
    held = control.sample_system(plant * actuator, T, method="zoh")
    share = 1.0 - math.exp(-T / p["filter_time"])
    low_pass = control.tf([share, 0.0], [1.0, share - 1.0], T)
    pi = control.tf([p["kp"], p["kp"] * (T / p["tn"] - 1.0)], [1.0, -1.0], T)
    return control.ss(low_pass * pi * control.tf([1.0], [1.0, 0.0], T)) * held


@pytest.mark.parametrize("name", ["crane-4amtkf", pytest.param("nordin-servo-60kw", marks=pytest.mark.slow)])
def test_both_loops_are_those_of_python_control(name):
    # without an encoder the speed is measured as it is, not as a difference of angles
    drive = Drive.load(name).replace(torque_lag=0.003, computing_delay=0.001, encoder_lines=0)
    view = linear_view(drive, "speed-ramp", {"filter_time": 0.004})
    w = np.geomspace(1.0, 0.99 * math.pi / view.loop.period, 1000)
    for loop in (view.loop, view.loop.with_gaps_open):
        L = discrete_loop(drive, view.controller.parameters, loop.open)
        exact = L(np.exp(1j * w * loop.period))
        # the step is differentiated numerically
        np.testing.assert_allclose(loop.broken.at(w, loop.period), exact, rtol=1e-6)
        # of a response over frequency, as polynomials in z lose their digits; it is interpolated by splines
        gain, phase, _, crossover = control.margin(control.FRD(exact, w, smooth=True))
        assert loop.margins.gain_margin == pytest.approx(gain, rel=1e-4)
        assert math.degrees(loop.margins.phase_margin) == pytest.approx(phase, abs=0.01)
        assert min(abs(one.frequency / crossover - 1.0) for one in loop.margins.gain_crossovers) < 1e-4
        closed = control.feedback(L, 1)
        first = int(np.flatnonzero(np.abs(closed(np.exp(1j * w * loop.period))) < math.sqrt(0.5))[0])
        assert w[first - 1] <= loop.bandwidth <= w[first]
        assert loop.stable == bool(np.all(np.abs(closed.poles()) < 1.0))


def mean_vibration(drive, cycle, begin=6.0, end=9.0):
    """Frequency and amplitude of the twist, means over the cycles of these seconds.

    Single cycles differ by 4 %, as their period is no multiple of the sample period. The start is in the
    middle of the gap, at the cycle's speeds.
    """
    rate, share = cycle.amplitude * cycle.frequency, drive.J2 / (drive.J1 + drive.J2)
    held = float(drive.target_speed)
    begun = drive.replace(
        initial_motor_speed=held + rate * share, initial_load_speed=held - rate * (1.0 - share)
    )
    late = np.linspace(begin, end, 60_001)
    twist = simulate(begun, "speed-ramp", end, parameters=SLOW_FILTER).at(late)["theta"]
    up = np.flatnonzero(np.diff(np.signbit(twist).astype(int)) < 0)
    swings = [0.5 * np.ptp(twist[first:last]) for first, last in itertools.pairwise(up)]
    return 2.0 * math.pi / np.diff(late[up]).mean(), np.mean(swings)


@pytest.mark.parametrize(
    ("law", "frequency", "amplitude"), [("dead-zone", 0.003, 0.01), ("no-pull", 0.08, 0.25)]
)
def test_the_rig_ends_in_the_limit_cycle_that_was_predicted(cycling, law, frequency, amplitude):
    """Within 0.3 % and 1 % of the describing function, which is that of the dead zone; a flank that cannot
    pull loses its damping torque as it parts, so the twist swings further."""
    (cycle,) = cycling.cycles
    assert cycle.stable
    w, swing = mean_vibration(UNLOADED.replace(contact_law=law), cycle)
    assert w == pytest.approx(cycle.frequency, rel=frequency)
    assert swing == pytest.approx(cycle.amplitude, rel=amplitude)


def test_what_is_unstable_is_said_before_the_table(cycling):
    assert linear_sheet(cycling).status == cycling.warning == cycling.summary()["warning"]
    assert cycling.warning.startswith(
        "Unstable with the gap open, where the motor is alone: an oscillation at 18"
    )
    assert "to a limit cycle of 186.6 rad/s, amplitude of the twist 0.00281 rad" in cycling.warning
    assert cycling.loop.stable


@pytest.mark.slow
def test_a_loop_that_is_unstable_in_contact_is_said_first():
    calm = linear_view(RIG, "speed-ramp")
    assert calm.warning == linear_sheet(calm).status == ""
    assert calm.loop.with_gaps_open.margins.phase_margin > math.radians(30.0)
    shaking = linear_view(RIG, "speed-ramp", {"kp": 1500.0})
    assert shaking.warning.startswith("Unstable with the gap closed: an oscillation at ")
