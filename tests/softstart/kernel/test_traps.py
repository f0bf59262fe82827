"""What has bitten others on this very problem, each once."""

from __future__ import annotations

import math

import numpy as np
import pytest
from tests.softstart.kernel.pieces import Pieces

from softstart import Drive, Status, simulate

CRANE = Drive.load("crane-4amtkf")


def test_the_far_flank_is_grazed_not_hit() -> None:
    """From theta = -gap/2 every rebound comes back to that flank with speed zero, to rounding."""
    for gap in (0.01, 7.3):
        run = simulate(CRANE.replace(gap=gap, start_position=-gap / 2), "direct", until=1.0)
        assert {stage.side for stage in run.stages} == {0, 1}
        assert float(np.min(run.theta)) == pytest.approx(-gap / 2, abs=1e-9 * gap)


@pytest.mark.parametrize(("share", "touched"), [(0.9e-9, 0), (1.1e-9, 1)])
def test_a_billionth_of_the_gap_is_a_graze(share: float, touched: int) -> None:
    """The motor flies against its own brake, a = 20/J1: it would overlap the flank by v^2/2a - gap/2."""
    a = 20.0 / 0.035
    v = math.sqrt(2.0 * a * (0.25 + share * 0.5))
    drive = CRANE.replace(load_torque=0.0, minimum_torque=-62.0, initial_motor_speed=v)
    run = simulate(drive, Pieces(pieces=((0.0, -20.0),)), until=1.5 * v / a)
    assert run.contacts == touched
    assert run.peak_torque == pytest.approx(touched * 368.465 * share * 0.5, rel=1e-3)


@pytest.mark.parametrize("speeds", [(0.0, 0.0), (3.0, 0.0), (0.0, 3.0)])
def test_a_start_on_the_flank(speeds: tuple[float, float]) -> None:
    """v = 0 on the flank is 0/0 in the textbook root."""
    w1, w2 = speeds
    flank = CRANE.replace(start_position=0.25, target_speed=50.0)
    run = simulate(flank.replace(initial_motor_speed=w1, initial_load_speed=w2), "direct")
    assert run.status is Status.REACHED
    assert (run.first_contact == 0.0) == (w1 >= w2)
    assert w1 != w2 or run.contacts == 1  # T comes back to zero once a period: rounding parts no flanks
    if w1 >= w2:
        expected = 1.0 + math.sqrt(
            1.0 + (368.465 * (w1 - w2) / (flank.Omega * run.peak_torque / run.k_dyn)) ** 2
        )
        assert run.k_dyn_first_contact == pytest.approx(expected, rel=1e-12)


def test_a_minute_of_impacts() -> None:
    """Undamped constant torque repeats exactly: after 859 contacts the twist is that of the first cycle."""
    run = simulate(CRANE, "direct", until=60.0)
    assert run.contacts > 850
    first, second, third = run.stages[:3]
    cycle = second.duration + third.duration
    for stage in run.stages[1:-1]:
        assert stage.duration == pytest.approx((second if stage.side else third).duration, rel=1e-12)
    at = run.at([60.0, first.duration + math.fmod(60.0 - first.duration, cycle)])["theta"]
    assert at[0] == pytest.approx(at[1], abs=1e-9)
    assert abs(run.energy.residual) < 1e-11 * run.energy.motor
