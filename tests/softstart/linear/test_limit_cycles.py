"""Limit cycles through the gap: predicted by the describing function, seen on the exact plant."""

from __future__ import annotations

import cmath

import numpy as np
import pytest
from tests.softstart.linear.speed_loops import FREE, SpeedPI
from tests.twin import chain_of

from softstart import linear_view, simulate
from softstart.linear.limit_cycles import n_at, share

# speed control behind a slow actuator: stable while the flank presses, not with the load let go
SLOW = FREE.replace(
    torque_lag=0.02, computing_delay=0.01, damping=2.0, contact_law="dead-zone", load_torque=0.0
)


@pytest.fixture(scope="module")
def unbiased():
    return linear_view(SLOW, SpeedPI(4.0, 20.0))


def vibration(drive, controller, cycle):
    """Frequency and amplitude of the twist on the exact plant, 5 s after a start in the middle of the gap.

    It starts at the speed that is controlled, with the cycle's largest rate of the twist.
    """
    rate, share_2 = cycle.amplitude * cycle.frequency, drive.J2 / (drive.J1 + drive.J2)
    w1, w2 = controller.reference + rate * share_2, controller.reference - rate * (1.0 - share_2)
    begun = drive.replace(initial_motor_speed=w1, initial_load_speed=w2, target_speed=1e6)
    late = np.linspace(5.0, 6.0, 4001)
    twist = simulate(begun, controller, 6.0, time_limit=10.0).at(late)["theta"]
    up = np.flatnonzero(np.diff(np.signbit(twist - 0.5 * (twist.min() + twist.max())).astype(int)) < 0)
    return 2.0 * np.pi / np.diff(late[up]).mean(), 0.5 * np.ptp(twist)


@pytest.mark.parametrize(("load_torque", "frequency", "amplitude"), [(0.0, 0.04, 0.08), (7.16, 0.1, 0.1)])
def test_the_exact_plant_ends_in_the_cycle_that_was_predicted(load_torque, frequency, amplitude):
    drive = SLOW.replace(load_torque=load_torque)
    view = linear_view(drive, SpeedPI(4.0, 20.0))
    found = view.cycles[-1]
    assert view.loop.stable
    assert found.stable
    assert (found.bias == 0.0) == (found.mean_torque == 0.0) == (load_torque == 0.0)
    # one harmonic of a twist whose shaft torque is zero for a third of the time: a few per cent
    w, swing = vibration(drive, view.controller, found)
    assert w == pytest.approx(found.frequency, rel=frequency)
    assert swing == pytest.approx(found.amplitude, rel=amplitude)


def test_a_chain_of_two_masses_has_the_cycles_of_its_drive(unbiased):
    (mine,), (same,) = unbiased.cycles, linear_view(chain_of(SLOW), SpeedPI(4.0, 20.0)).cycles
    assert same.frequency == pytest.approx(mine.frequency, rel=1e-9)
    assert same.amplitude == pytest.approx(mine.amplitude, rel=1e-9)


def test_at_the_cycle_the_softened_loop_has_a_pole_on_the_circle(unbiased):
    """With the share n of stiffness and damping, and no gap: found by the view of that other drive."""
    on_the_circle(unbiased, share(unbiased.cycles[0].amplitude, 0.5 * SLOW.gap), unbiased.cycles[0], 1e-8)


def on_the_circle(view, n, cycle, within):
    softened = SLOW.replace(stiffness=n * SLOW.c, damping=n * SLOW.d, gap=0.0)
    found = linear_view(softened, view.controller, fitted_to=SLOW)
    z = cmath.exp(1j * cycle.frequency * view.loop.period)
    assert min(abs(mode.value - z) for mode in found.loop.modes) < within


def test_the_harmonic_balance_in_continuous_time():
    """1 + n M(jw) = 0, M = (c + jw d) G, by the controller's formula and one harmonic of the held demand."""
    kp, ki = 8.0, 5.0
    (cycle,) = linear_view(SLOW, SpeedPI(kp, ki)).cycles
    s = 1j * cycle.frequency
    z = cmath.exp(0.001 * s)
    held = (1.0 - 1.0 / z) / (0.001 * s) * cmath.exp(-s * SLOW.computing_delay) / (1.0 + s * SLOW.torque_lag)
    speed = (kp + 0.001 * ki * z / (z - 1.0)) * held  # motor torque over -w1
    w1, w2 = -1.0 / (SLOW.J1 * s + speed), 1.0 / (SLOW.J2 * s)  # over the shaft torque
    M = (SLOW.c + s * SLOW.d) * (w2 - w1) / s
    assert abs(1.0 + share(cycle.amplitude, 0.5 * SLOW.gap) * M) < 1e-4


def test_with_a_load_torque_the_cycle_is_biased_and_torque_limits_are_told():
    limited = SLOW.replace(load_torque=7.16, maximum_torque=100.0, minimum_torque=-100.0)
    view = linear_view(limited, SpeedPI(4.0, 20.0))
    assert [one.stable for one in view.cycles] == [False, True]
    assert view.cycles[1].beyond_limits
    for one in view.cycles:
        assert one.mean_torque == pytest.approx(7.16)
        assert one.bias > 0.0
        on_the_circle(view, n_at(one.amplitude, 0.25, SLOW.c, 7.16), one, 1e-7)
