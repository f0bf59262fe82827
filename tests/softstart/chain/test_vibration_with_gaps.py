"""Vibration of chains with open gaps, free and forced: against the exact start, closed forms and scipy."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from tests.softstart.kernel.pieces import Pieces

from softstart import Drive, InputError, simulate
from softstart.chain import Chain, Mass, Shaft, natural_vibration
from softstart_studies.paper_r.vibration_with_gaps import backbone, chain_backbone, forced_response


@pytest.mark.parametrize("amplitude", [0.003, 0.4, 3.0])
def test_the_period_is_that_of_the_exact_plant(amplitude: float) -> None:
    crane = Drive.load("crane-4amtkf")
    drive = crane.replace(
        load_torque=0.0, initial_motor_speed=float(crane.Omega) * amplitude, target_speed=1e6
    )
    w = float(backbone(float(drive.J1), float(drive.J2), float(drive.c), float(drive.gap), amplitude))
    run = simulate(drive, Pieces(), until=12.4 * math.pi / w)
    closed = [stage.start for stage in run.stages if stage.side == 1]
    assert len(closed) >= 5
    np.testing.assert_allclose(np.diff(closed), 2.0 * math.pi / w, rtol=1e-10)
    assert run.peak_torque == pytest.approx(drive.c * amplitude, rel=1e-10)


def test_without_a_gap_it_is_that_of_the_spring() -> None:
    crane = Drive.load("crane-4amtkf")
    given = (float(crane.J1), float(crane.J2), float(crane.c))
    assert np.all(np.asarray(backbone(*given, 0.0, np.geomspace(1e-6, 1e6, 50))) == crane.Omega)
    assert backbone(*given, 0.5, 1e6) == pytest.approx(float(crane.Omega), rel=1e-6)
    with pytest.raises(InputError, match="above 0"):
        backbone(*given, 0.5, 0.0)


def test_two_masses_as_a_chain_swing_at_the_frequency_of_the_formula() -> None:
    amplitude = 0.05
    chain = Chain([Mass(0.3), Mass(0.7 * 9)], [Shaft(50.0, gap=0.4, ratio=3.0)])
    found = chain_backbone(chain, 50.0 * amplitude)
    assert found.two_masses[0] == pytest.approx(float(backbone(0.3, 0.7, 50.0, 0.4, amplitude)), rel=1e-12)
    assert found.frequency[0] == pytest.approx(found.two_masses[0], rel=2e-5)


def test_without_gaps_the_chain_keeps_its_frequency() -> None:
    chain = Chain([Mass(1), Mass(0.4), Mass(2)], [Shaft(30), Shaft(50)])
    found = chain_backbone(chain, [0.1, 10.0])
    assert found.frequency == pytest.approx(natural_vibration(chain).Omega[1], rel=1e-5)


# forced ----------------------------------------------------------------------------------------------------

C, D, GAP = 200.0, 10.0, 0.01
TWO = Chain([Mass(1.0), Mass(2.0)], [Shaft(C, damping=D, gap=GAP)])


def geared(gap: float) -> Chain:
    """Three masses, a gear of 3 to 1 between the last two."""
    return Chain(
        [Mass(0.5), Mass(0.2), Mass(9.0)],
        [Shaft(80, damping=0.5, gap=gap), Shaft(50, damping=0.4, gap=gap, ratio=3.0)],
    )


def test_without_gaps_it_is_the_linear_response() -> None:
    found = forced_response(geared(0.0), [3.0, 11.0, 30.0], {1: 1.0, 2: 2.0})
    np.testing.assert_allclose(found.amplitude, found.without_gaps, rtol=1e-9)
    # two masses by hand: the twist is an oscillator of the reduced inertia 2/3
    w, m = 14.0, 2.0 / 3.0
    twist = 1.5 / 1.0 / (C / m - w * w + 1j * w * D / m)
    one = forced_response(Chain(TWO.masses, [Shaft(C, damping=D)]), w, {0: 1.5})
    assert one.amplitude[0] == pytest.approx([abs(twist) * 2 / 3, abs(twist) / 3], rel=1e-9)


def test_an_open_gap_against_scipy() -> None:
    """A twist that passes through the gap and back twice a period; scipy starts elsewhere."""
    w, size, locking = 12.0, 1.0, 0.3

    def motion(t: float, y: np.ndarray) -> list[float]:
        z, rate = y
        torque = 0.0
        for side in (1.0, -1.0):
            if side * z > GAP / 2:
                torque = side * max(0.0, C * (side * z - GAP / 2) + D * side * rate)
        return [rate, (size * np.cos(w * t) + locking - torque) / 1.0 - (torque - locking) / 2.0]

    period = 2.0 * np.pi / w
    settled, periods = 24, 4
    t = np.linspace(settled * period, (settled + periods) * period, 1024, endpoint=False)
    run = solve_ivp(motion, (0.0, t[-1]), [GAP, 0.0], t_eval=t, rtol=1e-8, atol=1e-11, max_step=period / 60)
    swing = np.sqrt(2.0 * np.var(run.y[0])) * np.array([2.0, 1.0]) / 3.0  # of the two about their mean
    found = forced_response(TWO, w, {0: size}, locking=locking)
    rest = forced_response(TWO, w, {0: size}, locking=locking, from_rest=True)
    np.testing.assert_allclose(rest.amplitude, found.amplitude, rtol=1e-5)
    assert found.spread[0] < 1e-5
    np.testing.assert_allclose(found.amplitude[0], swing, rtol=1e-5)
    assert found.amplitude[0, 0] > 2.0 * found.without_gaps[0, 0]


def test_what_does_not_settle_or_has_no_spring_is_refused() -> None:
    partly = Chain([Mass(1), Mass(2), Mass(1)], [Shaft(30), Shaft(30, damping=0.0)])
    with pytest.raises(InputError, match="never settles"):
        forced_response(partly, 1.0, {0: 1.0})
    with pytest.raises(InputError, match="a spring in every shaft"):
        forced_response(Chain([Mass(1, damping=1), Mass(2)], [Shaft("inf")]), 1.0, {0: 1.0}, settle=1.0)
