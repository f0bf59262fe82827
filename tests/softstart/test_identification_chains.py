"""A chain identified through its reduction: the whole chain under a log, and the error of two masses."""

from __future__ import annotations

import re

import numpy as np
import pytest
from tests.twin import chain_of

from softstart import Chain, Drive, InputError, Log, identify, natural_vibration, simulate
from softstart.identification.chains import chain_log, reduced_drive, reduction_notes
from softstart.identification.model import LogModel
from softstart.identification.planning import made_up_log
from softstart_studies.paper_r.lever import lever

REVERSE = "two levels, then reverse"


def stiff_behind_the_gap(widest: str = "0.08 rad", others: float = 0.0, light: float = 0.002) -> Chain:
    """Four masses whose dominant gap is beside the motor, and whose other shafts are stiff."""
    also = {f"shaft[{k}].damping_ratio": 0.05 for k in (1, 2, 3)} | {
        "mass[4].kind": "reactive", "start.position": "mid-gap", "shaft[1].stiffness": 400.0,
        "shaft[2].stiffness": 12000.0, "shaft[3].stiffness": 3.3e6, "shaft[1].gap": widest,
        "shaft[2].gap": others, "shaft[3].gap": 0.0, "mass[2].inertia": light,
    }  # fmt: skip
    return Chain.load("crane-4-mass", also=also)


def logged(chain: Chain, drive: Drive) -> Log:
    """A reversal planned for a drive, played on the whole chain with a torque error of 1 N m."""
    plan = made_up_log(drive, REVERSE, log_period=4e-3)
    error = np.random.default_rng(5).standard_normal(plan.time.size)
    played = Log(plan.time, plan.torque + error, angle=plan.values, torque_is="demand")
    real = chain_log(chain, played, 4096.0)
    return Log(plan.time, plan.torque, angle=real.values, torque_is="demand", name="rig")


def moved_by(note: str) -> dict[str, str]:
    """The predicted errors of a note, in %."""
    return dict(re.findall(r"(\w+) ([+-][\d.e+]+) %", note.split("this torque: ")[1]))


@pytest.mark.parametrize("torque_is", ["demand", "measured"])
@pytest.mark.parametrize("signal", ["angle", "speed"])
def test_a_chain_of_two_masses_logs_what_its_drive_does(torque_is: str, signal: str) -> None:
    drive = Drive.load("crane-4amtkf").replace(
        damping=0.3,
        torque_lag=0.004,
        load_kind="reactive",
        gap=0.08,
        start_position="mid-gap",
        encoder_lines=0,
    )
    log = made_up_log(drive, REVERSE, log_period=2e-3, torque_is=torque_is, signal=signal)  # type: ignore[arg-type]
    whole = chain_log(chain_of(drive), log, 0.0)
    assert whole.values == pytest.approx(LogModel.of(log, drive).signals([{}])[0], abs=1e-11)


def test_a_chain_is_found_through_its_reduction_and_the_error_is_named() -> None:
    chain = stiff_behind_the_gap()
    drive = reduced_drive(chain)
    found = identify(logged(chain, drive), chain, searches=1)
    (note,) = [note for note in found.notes if "has 4 masses" in note]
    first, second = natural_vibration(chain).Omega[1:3] / (2.0 * np.pi)
    assert f"first natural frequency, {first:.4g} Hz. Those from {second:.4g} Hz on are left out" in note
    moved = moved_by(note)
    assert set(moved) == {one.name for one in found.shared}
    assert float(moved["motor_inertia"]) == pytest.approx(-1.2, abs=0.3)  # the pinion flies with the load
    for one in found.shared:
        # what the reduction says, moved by the predicted error, is in twice the interval
        expected = float(getattr(drive, one.name)) * (1.0 + 0.01 * float(moved[one.name]))
        assert abs(one.value - expected) < one.upper - one.lower, one.name
    assert found.drive.name.endswith("reduced to two masses")


@pytest.mark.parametrize("second", [0.005, 0.02, 0.04])
def test_a_second_gap_at_a_light_mass_adds_to_the_first_and_does_no_harm_at_the_motor(second: float) -> None:
    """Shafts behind the second gap have peaks of their own, up to 8 % larger."""
    chain, drive = stiff_behind_the_gap(others=second), reduced_drive(stiff_behind_the_gap())
    found = identify(logged(chain, drive), drive, searches=1)
    assert found["gap"].value == pytest.approx(0.08 + second, rel=0.04)
    for strategy in ("direct", "s-curve"):
        of_motor = float(simulate(chain, strategy).k_dyns[0])
        assert float(simulate(found.drive.design_drive, strategy).k_dyn) == pytest.approx(of_motor, rel=0.02)


@pytest.mark.parametrize("light", [0.008, 0.016])  # a quarter and a half of the rotor
@pytest.mark.parametrize("second", [0.005, 0.02, 0.04])
def test_a_second_gap_at_a_middle_mass_is_noticed_or_does_no_harm_at_the_motor(
    second: float, light: float
) -> None:
    """Shafts behind a second gap that is not noticed have peaks up to 15 % larger.

    Plan and guess are the two masses of the lever rule. With those of the modal reduction 0.04 rad at 0.008
    kg m2 are told as friction or cogging instead, without intervals.
    """
    chain, plain = stiff_behind_the_gap(others=second, light=light), stiff_behind_the_gap(light=light)
    two = lever(plain.at_motor_shaft().J, plain.at_motor_shaft().c)
    J1, J2, c = (*two.J.tolist(), *two.c.tolist())
    drive = reduced_drive(plain).replace(motor_inertia=J1, load_inertia=J2, stiffness=c)
    found = identify(logged(chain, drive), drive, searches=1)
    named = any("something else moves this drive (a second gap" in note for note in found.notes)
    assert named == (second * light > 2e-4)
    for strategy in ("direct", "s-curve") if not named else ():
        own, each = (
            float(simulate(found.drive.design_drive, strategy).k_dyn),
            simulate(chain, strategy).k_dyns,
        )
        assert float(each[0]) == pytest.approx(own, rel=0.02)
        assert max(map(float, each)) < 1.15 * own


@pytest.mark.slow
def test_a_second_gap_between_heavy_masses_is_noticed() -> None:
    also = {
        "mass[4].kind": "reactive", "start.position": "mid-gap", "shaft[1].stiffness": 400.0,
        "shaft[2].stiffness": 12000.0, "shaft[3].stiffness": 3.3e6, "shaft[1].gap": 0.08, "shaft[2].gap": 0.0,
        "shaft[3].gap": 0.04,
    } | {f"shaft[{k}].damping_ratio": 0.05 for k in (1, 2, 3)}  # fmt: skip
    drive = reduced_drive(stiff_behind_the_gap())
    notes = identify(logged(Chain.load("crane-4-mass", also=also), drive), drive, searches=1).notes
    assert any("something else moves this drive (a second gap" in note for note in notes)


@pytest.mark.slow
def test_where_two_masses_are_the_wrong_model_the_prediction_says_so() -> None:
    """The page's second example: the pinion, a fifteenth of the rotor, rattles between soft shafts."""
    also = {f"shaft[{k}].damping_ratio": 0.02 for k in (1, 2, 3)} | {
        "mass[4].kind": "reactive", "start.position": "mid-gap", "shaft[1].gap": 0.08, "shaft[2].gap": 0.002,
        "shaft[3].gap": 1e-4,
    }  # fmt: skip
    chain = Chain.load("crane-4-mass", also=also)
    drive = reduced_drive(chain)
    plan = made_up_log(drive, REVERSE, log_period=4e-3)
    fitted = {
        one.name: one.value
        for one in identify(chain_log(chain, plan, float(drive.encoder_lines)), drive, searches=1).shared
    }
    (note,) = reduction_notes(chain, drive, plan, lambda _: fitted)
    moved = {name: float(text) for name, text in moved_by(note).items()}
    assert -7.0 < moved["motor_inertia"] < -4.0
    assert -40.0 < moved["gap"] < -20.0


def test_chains_without_a_dominant_gap_and_without_a_motor_are_refused() -> None:
    with pytest.raises(InputError, match="its widest gap is 40 % of all"):
        identify(made_up_log(Drive.load("crane-4amtkf"), "start"), "crane-4-mass")
    with pytest.raises(InputError, match="its widest gap is 50 % of all"):
        reduced_drive(stiff_behind_the_gap("0.08 rad", 0.08))
    assert reduced_drive(stiff_behind_the_gap("0.08 rad", 0.02)).gap == pytest.approx(0.1)
