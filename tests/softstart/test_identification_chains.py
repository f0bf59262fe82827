"""A chain identified through its reduction: the whole chain under a log, fitted by two masses."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from softstart import Chain, Drive, InputError, Log, identify, natural_vibration, simulate
from softstart.controller import make_controller
from softstart.identification.model import knots_of, without_limits
from softstart.identification.planning import simulated_log
from softstart.identification.solving import reduced_drive
from softstart.profile import TorqueProfile
from softstart_studies.paper_r.lever import lever

REVERSE = "two levels, then reverse"


def stiff_behind_the_gap(**changes: object) -> Chain:
    """Four masses whose dominant gap is beside the motor, and whose other shafts are stiff."""
    also = {f"shaft[{k}].damping_ratio": 0.05 for k in (1, 2, 3)} | {
        "mass[4].kind": "reactive", "start.position": "mid-gap", "shaft[1].stiffness": 400.0,
        "shaft[2].stiffness": 12000.0, "shaft[3].stiffness": 3.3e6, "shaft[1].gap": "0.08 rad",
        "shaft[2].gap": 0.0, "shaft[3].gap": 0.0,
    }  # fmt: skip
    return Chain.load("crane-4-mass", also=also | changes)


def logged(chain: Chain, drive: Drive) -> Log:
    """A reversal planned for a drive, played on the whole chain with a torque error of 1 N m."""
    plan = simulated_log(drive, REVERSE, log_period=4e-3)
    error = np.random.default_rng(5).standard_normal(plan.time.size)
    knots, owners = knots_of(plan)
    profile = TorqueProfile(knots, (plan.torque + error)[owners])
    whole = replace(chain, motor=replace(chain.motor, **without_limits(plan)))
    run = simulate(whole, make_controller("profile", {"profile": profile}), until=float(plan.time[-1]))
    phi = run.at(plan.time)["phi"][:, chain.motor_index]
    count = 2.0 * np.pi / (4.0 * 4096.0)
    angle = np.floor((phi - phi[0]) / count + 0.3) * count
    return Log(plan.time, plan.torque, angle=angle, torque_is="demand", name="rig")


def test_a_chain_is_found_through_its_reduction() -> None:
    chain = stiff_behind_the_gap()
    drive = reduced_drive(chain)
    found = identify(logged(chain, drive), chain, searches=1)
    (note,) = [note for note in found.notes if "has 4 masses" in note]
    first, second = natural_vibration(chain).Omega[1:3] / (2.0 * np.pi)
    assert f"first natural frequency, {first:.4g} Hz. Modes from {second:.4g} Hz on are neglected" in note
    errors = {"motor_inertia": -0.012, "stiffness": -0.01, "damping": 0.03}  # the pinion flies with the load
    for one in found.shared:
        # what the reduction says, moved by its error on this chain, is in twice the interval
        expected = float(getattr(drive, one.name)) * (1.0 + errors.get(one.name, 0.0))
        assert abs(one.value - expected) < one.upper - one.lower, one.name
    assert found.drive.name.endswith("reduced to two masses")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("second", "light"),  # a quarter and a half of the rotor
    [(0.005, 0.016), (0.02, 0.008), (0.04, 0.008), (0.02, 0.016)],
)
def test_a_second_gap_at_a_middle_mass_is_noticed_or_does_no_harm_at_the_motor(
    second: float, light: float
) -> None:
    """Shafts behind a second gap that is not noticed have peaks up to 15 % larger.

    Plan and guess are the two masses of the lever rule. With those of the modal reduction 0.04 rad at 0.008
    kg m2 are told as friction or cogging instead, without intervals.
    """
    plain = stiff_behind_the_gap(**{"mass[2].inertia": light})
    chain = stiff_behind_the_gap(**{"mass[2].inertia": light, "shaft[2].gap": second})
    two = lever(plain.at_motor_shaft().J, plain.at_motor_shaft().c)
    J1, J2, c = (*two.J.tolist(), *two.c.tolist())
    drive = reduced_drive(plain).replace(motor_inertia=J1, load_inertia=J2, stiffness=c)
    found = identify(logged(chain, drive), drive, searches=1)
    named = any("a torque error of" in note for note in found.notes)
    assert named == (second * light > 2e-4)
    for strategy in ("direct", "s-curve") if not named else ():
        own = float(simulate(found.drive.design_drive, strategy).k_dyn)
        each = simulate(chain, strategy).k_dyns
        assert float(each[0]) == pytest.approx(own, rel=0.02)
        assert max(map(float, each)) < 1.15 * own


@pytest.mark.slow
def test_a_second_gap_between_heavy_masses_is_noticed() -> None:
    drive = reduced_drive(stiff_behind_the_gap())
    notes = identify(logged(stiff_behind_the_gap(**{"shaft[3].gap": 0.04}), drive), drive, searches=1).notes
    assert any("a torque error of" in note for note in notes)


def test_a_chain_without_a_dominant_gap_is_refused() -> None:
    with pytest.raises(InputError, match="its widest gap is 50 % of all"):
        reduced_drive(stiff_behind_the_gap(**{"shaft[2].gap": 0.08}))
    assert reduced_drive(stiff_behind_the_gap(**{"shaft[2].gap": 0.02})).gap == pytest.approx(0.1)
