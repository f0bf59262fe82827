"""A chain that no two masses stand for: what needs none of their values starts it."""

from __future__ import annotations

import copy
import pickle

import numpy as np
import pytest

from softstart import Chain, InputError, TorqueProfile, compare, simulate, sweep
from softstart.chain.elements import Mass, Motor, Shaft
from softstart.controller import make_controller

# the node of its first mode lies beyond the load: motor and table swing against the flywheel
CHAIN = Chain(
    [Mass(0.035, name="motor"), Mass(0.05, torque=1.0, name="table"), Mass(0.5, name="flywheel")],
    [Shaft(4000.0, damping_ratio=0.03, gap=0.02), Shaft(200.0, damping_ratio=0.03)],
    Motor(62.0), load_mass="table", target_speed=92.0,
)  # fmt: skip
PROFILE = TorqueProfile([0.0, 0.3], [20.0, 62.0])


def test_direct_is_a_profile_of_the_starting_torque() -> None:
    flat = make_controller("profile", {"profile": TorqueProfile([0.0], [62.0])})
    direct, played = simulate(CHAIN, "direct"), simulate(CHAIN, flat)
    assert direct.start_time == played.start_time
    np.testing.assert_array_equal(direct.peak_torques, played.peak_torques)
    np.testing.assert_array_equal(simulate([CHAIN], "direct").peak_torque.values, [direct.peak_torque])


def test_momentum_tells_the_torque_of_a_profile() -> None:
    """The impulse of the motor less that of the load is the momentum of all masses."""
    run = simulate(CHAIN, make_controller("profile", {"profile": PROFILE}), until=0.25)
    w = run.trajectory.at([0.25])["w"][0]
    impulse = 20.0 * 0.25 + 0.5 * 42.0 / 0.3 * 0.25**2 - 1.0 * 0.25
    assert w @ [0.035, 0.05, 0.5] == pytest.approx(impulse, rel=1e-6)


@pytest.mark.parametrize("name", ["ramp", "s-curve"])
def test_a_ramp_takes_two_periods_of_the_chain_itself(name: str) -> None:
    run = simulate(CHAIN, name)
    w = np.sqrt(np.linalg.eigvals(  # with all gaps closed
        np.array([[4000.0, -4000.0, 0.0], [-4000.0, 4200.0, -200.0], [0.0, -200.0, 200.0]])
        / np.array([[0.035], [0.05], [0.5]])
    ).real.clip(0.0))  # fmt: skip
    assert run.controller.parameters["time"] == pytest.approx(4.0 * np.pi / np.sort(w)[1])


@pytest.mark.parametrize("name", ["reduced-two-stage", "state-feedback"])
def test_what_needs_two_masses_is_refused_in_one_sentence(name: str) -> None:
    with pytest.raises(InputError) as caught:
        simulate(CHAIN, name)
    (sentence,) = caught.value.sentences
    assert "the node of the first elastic mode" in sentence
    assert sentence.endswith("or name the drive for which the controller is set up (fitted_to).")
    other = Chain.load("crane-4-mass").two_masses
    assert simulate(CHAIN, name, fitted_to=other).status.finished


def test_every_door_starts_it() -> None:
    k_dyn = simulate(CHAIN, "direct").k_dyn
    assert compare(CHAIN, ["direct"]).rows[0].run.k_dyn == k_dyn
    found = sweep(CHAIN, "direct", {"shaft[1].gap": [0.02, 0.04]}, workers=1)
    assert found.k_dyn.values[0] == k_dyn
    for one in (pickle.loads(pickle.dumps(CHAIN.design_drive)), copy.deepcopy(CHAIN.design_drive)):
        assert (one.Ms, one.Mc, one.target_speed) == (62.0, 1.0, 92.0)
