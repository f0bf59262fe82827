"""Friction of the motor and viscous friction: closed forms, balances, and the limits in which they vanish."""

from __future__ import annotations

import math

import numpy as np
import pytest
from tests.softstart.kernel.pieces import Pieces

from softstart import Drive, InputError, Run, simulate

CRANE = Drive.load("crane-4amtkf")


def steady(drive: Drive, torque: float, until: float) -> Run:
    """A start under one torque."""
    return simulate(drive, Pieces(pieces=((0.0, torque),)), until=until)


def test_a_motor_that_coasts_to_rest() -> None:
    """In an open gap: w1 = (w0 + F/b) exp(-b t/J1) - F/b until it is zero at (J1/b) ln(1 + b w0/F)."""
    w0, F, b = 30.0, 4.0, 0.2
    drive = CRANE.replace(
        gap=200.0, load_torque=0.0, motor_friction=F, motor_viscous_friction=b, initial_motor_speed=w0
    )
    J1 = float(drive.J1)
    run = steady(drive, 0.0, 1.0)
    stop = J1 / b * math.log1p(b * w0 / F)
    (event,) = run.events
    assert (event.kind, event.time) == ("motor stops", pytest.approx(stop, rel=1e-13))
    t = np.linspace(0.0, stop, 9)
    w1 = (w0 + F / b) * np.exp(-b * t / J1) - F / b
    np.testing.assert_allclose(run.at(t)["w1"], w1, rtol=1e-12, atol=1e-12)
    turned = J1 / b * (w0 - F / b * math.log1p(b * w0 / F))
    assert run.at(1.0)["phi1"] == pytest.approx(turned, rel=1e-12)
    assert run.at(1.0)["w1"] == 0.0
    assert run.energy.dissipated == pytest.approx(0.5 * J1 * w0**2, rel=1e-12)


def test_the_speed_at_which_viscous_friction_takes_all() -> None:
    """Behind it w1 = w2 = (u - F - Mc)/(b1 + b2) and T = Mc + b2 w2; that is settled, too."""
    frictions = {"motor_friction": 2.0, "motor_viscous_friction": 0.3, "load_viscous_friction": 0.2}
    drive = CRANE.replace(damping=1.5, target_speed=60.0, **frictions)
    run = steady(drive, 40.0, 8.0)
    speed = (40.0 - 2.0 - float(drive.Mc)) / 0.5
    end = run.at(8.0)
    assert [end["w1"], end["w2"]] == pytest.approx([speed, speed], rel=1e-7)
    assert end["T"] == pytest.approx(drive.Mc + 0.2 * speed, rel=1e-7)
    assert 0.0 < run.settling_time(0.02) < 2.0
    assert drive.mean_torque == CRANE.replace(starting_torque=60.0, maximum_torque=62.0).mean_torque


def test_friction_that_no_start_can_have() -> None:
    with pytest.raises(InputError, match="with this friction starting_torque = 62 N"):
        CRANE.replace(motor_friction=55.0)
    with pytest.raises(InputError, match=r"92[.]1534 rad/s this takes more torque than the motor"):
        CRANE.replace(load_viscous_friction=0.8)


@pytest.mark.parametrize("friction", [1e-12, 7.5e-7])
def test_a_friction_of_next_to_nothing_behind_a_lag_ends_no_start(friction: float) -> None:
    """The torque passes it within 1e-9 s, where what it lacks is lost in the rounding of the time."""
    drive = CRANE.replace(torque_lag=0.004)
    smooth, run = simulate(drive, "direct"), simulate(drive.replace(motor_friction=friction), "direct")
    assert run.k_dyn == pytest.approx(smooth.k_dyn, rel=1e-6)
