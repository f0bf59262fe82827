"""Gears with losses: against an independent integration, closed forms at rest and in motion, energy."""

from __future__ import annotations

import numpy as np
import pytest

from softstart import simulate
from softstart.chain import Chain, Mass, Shaft


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
