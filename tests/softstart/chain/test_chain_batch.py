"""Many starts of chains in one call: the same bits as one at a time, whatever computes them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.twin import plain

from softstart import Drive, InputError, simulate
from softstart.chain import Chain, Mass, Motor, Shaft
from softstart.controller import make_controller

DAMPED = {f"shaft[{k}].damping_ratio": 0.02 for k in (1, 2, 3)}
CHAIN = Chain.load("crane-4-mass", also=DAMPED)
CRANE = Drive.load("crane-4amtkf")


def various(count: int = 40) -> list[Chain]:
    """The crane with other gaps, loads, dampings and frictions, some of it undamped, some reactive."""
    rng = np.random.default_rng(16)
    found = []
    for i in range(count):
        one = CHAIN.changed(gaps=float(rng.uniform(0.2, 3.0)), load_inertia=float(rng.uniform(0.3, 1.5)))
        shafts = [shaft.replace(damping_ratio=float(rng.uniform(0.0, 0.05))) for shaft in one.shafts]
        if i % 4 == 0:
            shafts = [shaft.replace(damping_ratio=None) for shaft in one.shafts]
        masses = list(one.masses)
        if i % 3 == 0:
            masses[3] = masses[3].replace(kind="reactive")
        if i % 5 == 0:
            shafts[1] = shafts[1].replace(efficiency=0.95)
        found.append(replace(one, masses=tuple(masses), shafts=tuple(shafts)))
    return found


@pytest.mark.parametrize("controller", ["direct", "ramp", "pulse-coast-hold", "state-feedback"])
def test_a_batch_has_the_bits_of_single_starts(controller):
    chains = various()
    found = simulate(chains, controller, fitted_to=CRANE, workers=2)
    alone = simulate(chains, controller, fitted_to=CRANE, workers=1)
    for i, chain in enumerate(chains):
        run = simulate(chain, controller, fitted_to=CRANE)
        row = found.isel(start=i)
        assert np.array_equal(row.peak_torques.values, run.peak_torques)
        assert np.array_equal(row.k_dyns.values, run.k_dyns)
        assert row.k_dyn.item() == run.k_dyn
        assert row.start_time.item() == run.start_time
        assert row.end_time.item() == run.end_time
        assert row.status.item() == run.status.name
    for name in found.data_vars:
        assert np.array_equal(found[name].values, alone[name].values), name


def test_each_chain_has_its_own_controller_unless_one_is_given():
    chains = [CHAIN, CHAIN.changed(gaps=2.0)]
    found = simulate(chains, "pulse-coast-hold")
    for i, chain in enumerate(chains):
        assert found.k_dyn.values[i] == simulate(chain, "pulse-coast-hold").k_dyn


def test_plain_controllers_have_the_same_bits():
    chains = various(3)
    made = plain(make_controller("ramp", {"time": 0.1}), CRANE)
    found = simulate(chains, made, fitted_to=CRANE)
    assert found.k_dyn.values.tolist() == [simulate(c, made, fitted_to=CRANE).k_dyn for c in chains]


def test_the_worst_of_an_unknown_position():
    unknown = replace(CHAIN, position="unknown")
    found = simulate([CHAIN, unknown], "ramp")
    run = simulate(unknown, "ramp")
    assert np.array_equal(found.k_dyns.values[1], run.k_dyns)
    assert found.k_dyn.values[1] == run.k_dyn
    assert found.start_time.values[1] == run.start_time
    assert found.peak_time.values[1] == run.peak_time


def test_what_cannot_be_finished_has_a_status_and_no_figures():
    found = simulate(various(4), "direct", fitted_to=CRANE, max_events=60)
    failed = found.status.values == "TOO_MANY_EVENTS"
    assert failed.any()
    assert np.isnan(found.k_dyn.values[failed]).all()
    assert np.isnan(found.k_dyns.values[failed]).all()


@pytest.mark.parametrize(
    ("call", "reason"),
    [
        (lambda: simulate([], "direct"), "not empty"),
        (lambda: simulate([CHAIN], "direct", workers=0), "whole number of 1 or more"),
        (lambda: simulate([CHAIN, CRANE], "direct"), "same number of masses"),
        (
            lambda: simulate(
                [CHAIN, Chain([Mass(1.0), Mass(1.0)], [Shaft(5.0)], Motor(5.0), target_speed=1.0)], "direct"
            ),
            "same number of masses",
        ),
        (lambda: simulate([Chain([Mass(1.0), Mass(1.0)], [Shaft(5.0)])], "direct"), "motor"),
    ],
)
def test_what_is_refused(call, reason):
    with pytest.raises(InputError, match=reason):
        call()
