"""Gears with losses: against an independent integration, closed forms at rest and in motion, energy."""

from __future__ import annotations

import numpy as np
import pytest
from tests.softstart.chain.oracle_starts import ANY_DRIVE
from tests.softstart.kernel.pieces import Pieces

from softstart import simulate
from softstart.chain import Chain, Mass, Motor, Shaft, reduce_chain, verify_on_chain


def driven(efficiency: float, J2: float, Mc: float, side: str = "before") -> Chain:
    return Chain(
        [Mass(0.5), Mass(J2, torque=Mc, initial_speed=1.0)],
        [Shaft(60.0, damping=4.0, efficiency=efficiency, start_position=0.2, side=side)],
        Motor(20.0),
        target_speed=1e3,
    )


def test_driven_forward_a_load_behind_a_gear_is_heavier_by_its_efficiency():
    """eta T - Mc = J2 w2' is T - Mc/eta = (J2/eta) w2', as long as power flows forward."""
    push = Pieces(pieces=((0.0, 20.0),))
    lossy = simulate(driven(0.8, 2.0, 8.0), push, 3.0, fitted_to=ANY_DRIVE)
    heavier = simulate(driven(1.0, 2.5, 10.0), push, 3.0, fitted_to=ANY_DRIVE)
    times = np.linspace(0.0, 3.0, 60)
    assert np.all(lossy.at(times)["T"] > 0.0)
    assert lossy.at(times)["w"] == pytest.approx(heavier.at(times)["w"], rel=1e-12)
    assert lossy.peak_torque == pytest.approx(heavier.peak_torque, rel=1e-13)


def held(torque: float, efficiency: float = 0.6, load: float = 10.0) -> Chain:
    """A wall, a spring twisted to `torque`, a gear, and a load that pulls back."""
    c = 50.0
    shaft = Shaft(c, efficiency=efficiency, start_position=torque / c)
    return Chain([Mass(1e15), Mass(1.0, torque=load)], [shaft])


@pytest.mark.parametrize("torque", [10.0 / 0.6 * (1 - 1e-9), 10.0, 10.0 * 0.6 * (1 + 1e-9)])
def test_a_gear_holds_at_rest_what_lies_between_driving_and_being_driven(torque):
    """eta T <= Mc <= T/eta: the load neither rises nor sinks."""
    run = simulate(held(torque), None, 1.0)
    assert np.all(run.w[:, 1] == 0.0)
    assert run.events == ()


@pytest.mark.parametrize(("torque", "way"), [(10.0 / 0.6 * (1 + 1e-9), 1.0), (6.0 * (1 - 1e-9), -1.0)])
def test_beyond_that_it_lets_go_at_once(torque, way):
    run = simulate(held(torque), None, 0.01)
    assert [(e.kind, e.time, e.value) for e in run.events][:1] == [("gear lets go", 0.0, way)]
    assert np.sign(run.w[5:-1, 1]).tolist() == [way] * (run.w.shape[0] - 6)


def test_free_vibration_dies_in_a_gear_by_half_waves():
    """Against a wall without load: quarter waves with the stiffnesses eta c and c/eta, in turn.

    From the turning point A the mass is driven to T = 0 with eta c, then drives the spring with c/eta: the
    energy eta c A^2/2 becomes (c/eta) B^2/2, so B = eta A.
    """
    eta, c = 0.7, 50.0
    chain = Chain([Mass(1e15), Mass(1.0)], [Shaft(c, efficiency=eta, start_position=0.4)])
    quarter = 0.5 * np.pi * (1 / np.sqrt(eta * c) + np.sqrt(eta / c))
    run = simulate(chain, None, 4.5 * quarter)
    turned = [e.time for e in run.events if e.kind == "gear holds"]
    assert turned == pytest.approx([n * quarter for n in range(1, 5)], rel=1e-12)
    assert np.abs(run.at(turned)["torques"][:, 0]) == pytest.approx(
        [20.0 * eta**n for n in range(1, 5)], rel=1e-12
    )


def test_the_gear_stays_at_its_mass_when_the_chain_is_brought_to_one_shaft():
    chain = Chain(
        [Mass(0.3), Mass(4.0, torque=15.0, initial_speed=2.0), Mass(1.0)],
        [Shaft(80.0, ratio=3.0, efficiency=0.8, side="after", gap=0.1), Shaft(200.0, efficiency=0.9)],
        Motor(20.0),
        target_speed=30.0,
    )
    push = Pieces(pieces=((0.0, 20.0),))
    a, b = (simulate(one, push, 2.0, fitted_to=ANY_DRIVE) for one in (chain, chain.brought_to("motor")))
    assert a.energy.gears == pytest.approx(b.energy.gears, rel=1e-10)
    assert a.energy.gears > 0.0
    assert a.peak_torques == pytest.approx(b.peak_torques, rel=1e-10)


def test_a_start_on_a_chain_with_losses_is_verified_with_them():
    whole = Chain.load("crane-4-mass", also={"shaft[2].efficiency": "0.9"})
    found = reduce_chain(whole)
    assert any("0.9) are left out of the drive" in note for note in found.notes)
    lossy = verify_on_chain(whole, found.to_drive(), "ramp")
    assert lossy.summary()["gear_losses"] == lossy.chain.energy.gears > 0.0
    assert lossy.chain.start_time > verify_on_chain("crane-4-mass", found.to_drive(), "ramp").chain.start_time
