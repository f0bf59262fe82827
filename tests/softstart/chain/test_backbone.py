"""The backbone of two masses against the free vibration of the exact plant."""

from __future__ import annotations

import math

import numpy as np
import pytest

from softstart import Command, Drive, InputError, Measured, PlainController, simulate
from softstart.chain import Chain, Mass, Shaft, natural_vibration
from softstart_studies.paper_r.vibration_with_gaps import backbone, chain_backbone


class Off(PlainController):
    """A motor that is switched off."""

    name = "off"

    def step(self, measured: Measured, state: tuple[float, ...]) -> Command:
        return Command(0.0)


@pytest.mark.parametrize("amplitude", [0.003, 0.05, 0.4, 3.0])
def test_the_period_is_that_of_the_exact_plant(amplitude: float) -> None:
    crane = Drive.load("crane-4amtkf")
    drive = crane.replace(
        load_torque=0.0, initial_motor_speed=float(crane.Omega) * amplitude, target_speed=1e6
    )
    w = float(backbone(float(drive.J1), float(drive.J2), float(drive.c), float(drive.gap), amplitude))
    run = simulate(drive, Off(), until=12.4 * math.pi / w)
    closed = [stage.start for stage in run.stages if stage.side == 1]
    assert len(closed) >= 5
    np.testing.assert_allclose(np.diff(closed), 2.0 * math.pi / w, rtol=1e-10)
    assert run.peak_torque == pytest.approx(drive.c * amplitude, rel=1e-10)


def test_limits_and_order() -> None:
    drive = Drive.load("crane-4amtkf")
    J1, J2, c = (float(x) for x in (drive.J1, drive.J2, drive.c))
    amplitudes = np.geomspace(1e-6, 1e6, 50)
    w = np.asarray(backbone(J1, J2, c, 0.5, amplitudes))
    assert np.all(np.diff(w) > 0.0)
    assert w[-1] == pytest.approx(float(drive.Omega), rel=1e-6)
    assert w[0] == pytest.approx(float(drive.Omega) * math.pi * amplitudes[0] / 0.5, rel=1e-4)
    assert np.all(np.asarray(backbone(J1, J2, c, 0.0, amplitudes)) == drive.Omega)
    with pytest.raises(InputError, match="above 0"):
        backbone(J1, J2, c, 0.5, 0.0)


@pytest.mark.parametrize("amplitude", [0.05, 0.4])
def test_two_masses_as_a_chain_swing_at_the_frequency_of_the_formula(amplitude: float) -> None:
    chain = Chain([Mass(0.3), Mass(0.7 * 9)], [Shaft(50.0, gap=0.4, ratio=3.0)])
    found = chain_backbone(chain, 50.0 * amplitude)
    assert found.two_masses[0] == pytest.approx(float(backbone(0.3, 0.7, 50.0, 0.4, amplitude)), rel=1e-12)
    assert found.frequency[0] == pytest.approx(found.two_masses[0], rel=2e-5)


def test_without_gaps_the_chain_keeps_its_frequency() -> None:
    chain = Chain([Mass(1), Mass(0.4), Mass(2)], [Shaft(30), Shaft(50)])
    found = chain_backbone(chain, [0.1, 10.0])
    assert found.frequency == pytest.approx(natural_vibration(chain).Omega[1], rel=1e-5)


def test_a_rigid_shaft_is_refused() -> None:
    with pytest.raises(InputError, match="a spring in every shaft"):
        chain_backbone(Chain([Mass(1), Mass(2), Mass(1)], [Shaft(30, gap=0.1), Shaft("inf")]), 1.0)
