"""Designed on the two masses, verified on the chain: both starts are what they would be alone."""

from __future__ import annotations

import json

import pytest

from softstart import Drive, InputError, simulate
from softstart.chain import Chain, Mass, reduce_chain, simulate_chain, verify_on_chain

CHAIN = Chain.load("crane-4-mass")
DRIVE = reduce_chain(CHAIN, to=2).to_drive()


@pytest.mark.parametrize("controller", ["direct", "current-limit-feedback"])
def test_both_sides_are_the_starts_themselves(controller):
    found = verify_on_chain(CHAIN, DRIVE, controller)
    alone = simulate(DRIVE, controller)
    assert found.drive.k_dyn == alone.k_dyn
    assert found.drive.start_time == alone.start_time
    whole = simulate_chain(CHAIN, controller, fitted_to=DRIVE)
    assert found.chain.peak_torque == whole.peak_torque
    assert found.error == pytest.approx(alone.k_dyn / whole.k_dyn - 1.0, rel=1e-14)
    assert found.worst_k_dyn >= found.chain.k_dyn


def test_a_chain_of_two_masses_verifies_itself():
    drive = Drive.load("crane-4amtkf").replace(gap=1.0)
    found = verify_on_chain(Chain.from_drive(drive), drive, "ramp", parameters={"time": "0.2 s"})
    assert found.error == pytest.approx(0.0, abs=1e-12)
    assert (found.worst_shaft, found.worst_place) == (0, "motor - load")
    assert found.worst_k_dyn == found.chain.k_dyn


def test_the_worst_shaft_is_between_motor_and_load():
    """A mass behind the load swings on a shaft that no start is judged by."""
    behind = Chain(
        [*CHAIN.brought_to("motor").masses, Mass(0.01, name="behind")],
        [*CHAIN.brought_to("motor").shafts, CHAIN.brought_to("motor").shafts[0]],
        CHAIN.motor,
        load_mass="crane",
    )
    assert verify_on_chain(behind, DRIVE, "direct").worst_shaft < 3


def test_the_summary_has_both_sides():
    told = json.loads(json.dumps(verify_on_chain(CHAIN, DRIVE, "direct").summary()))
    assert told["chain_k_dyn"] / told["k_dyn"] == pytest.approx(1 / (1 + told["k_dyn_error"]))
    assert told["chain"]["assumed"] == CHAIN.assumed


def test_a_batch_is_refused():
    with pytest.raises(InputError, match="give a single drive"):
        verify_on_chain(CHAIN, DRIVE.replace(gap=[0.1, 0.2]), "direct")
