"""Chains go where drives go: positions in the gaps, limits, compare, batches."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from softstart import Drive, InputError, compare, simulate
from softstart.chain import Chain, Mass, Shaft
from softstart.chain.model import load_machine

DAMPED = {f"shaft[{k}].damping_ratio": 0.02 for k in (1, 2, 3)}
CHAIN = Chain.load("crane-4-mass", also=DAMPED)
CRANE = Drive.load("crane-4amtkf")


def test_the_settled_time_is_when_the_load_stays_above_its_band():
    run = simulate(CHAIN, "shaped")
    whole = simulate(CHAIN, "shaped", run.settling_end)
    speed = whole.at(np.linspace(run.settled_time, run.settling_end, 20_000))["w"][:, 3]
    assert run.settled_time == whole.settled_time
    assert run.settled_time >= run.start_time
    assert speed.min() >= 0.999 * CHAIN.target_speed * (1 - 1e-12)


def test_positions_are_those_of_the_flanks():
    """Hanging, each shaft carries the load at rest; an angle of a shaft overrides the word."""
    at = {
        word: replace(CHAIN, position=word).at_motor_shaft() for word in ("driving-flank", "opposite-flank")
    }
    np.testing.assert_allclose(at["driving-flank"].theta0, 0.5 * CHAIN.at_motor_shaft().gap, rtol=1e-14)
    np.testing.assert_allclose(at["opposite-flank"].theta0, -0.5 * CHAIN.at_motor_shaft().gap, rtol=1e-14)
    hanging = replace(CHAIN, position="hanging")
    np.testing.assert_allclose(simulate(hanging, "ramp").at(0.0)["T"], 7.16, rtol=1e-12)
    own = replace(hanging, shafts=(CHAIN.shafts[0].replace(start_position=0.01), *CHAIN.shafts[1:]))
    assert own.at_motor_shaft().theta0[0] == 0.01
    assert own.at_motor_shaft().theta0[1] == hanging.at_motor_shaft().theta0[1]
    for chain in (hanging, own, replace(CHAIN, position="unknown")):
        assert Chain.from_toml(chain.to_toml()) == chain
        np.testing.assert_allclose(
            chain.brought_to("motor").at_motor_shaft().theta0, chain.at_motor_shaft().theta0, rtol=1e-14
        )


@pytest.mark.parametrize("position", ["mid-gap", "opposite-flank", "hanging"])
def test_a_position_does_not_depend_on_the_end_at_which_the_motor_sits(position):
    plain = replace(CHAIN.brought_to("motor"), position=position)
    turned = Chain(
        reversed(plain.masses), reversed(plain.shafts), plain.motor,
        load_mass=plain.load_mass, position=position,
    )  # fmt: skip
    there, back = simulate(plain, "direct"), simulate(turned, "direct")
    assert back.k_dyns[::-1] == pytest.approx(there.k_dyns, rel=1e-9)
    assert back.start_time == pytest.approx(there.start_time, rel=1e-9)


def test_of_an_unknown_position_every_figure_is_the_worst():
    unknown = replace(CHAIN, position="unknown")
    run = simulate(unknown, "ramp")
    each = {word: simulate(replace(CHAIN, position=word), "ramp", fitted_to=CHAIN) for word in run.positions}
    assert set(each) == {"driving-flank", "mid-gap", "opposite-flank"}
    assert run.k_dyn == max(one.k_dyn for one in each.values())
    assert run.position == max(each, key=lambda word: each[word].k_dyn)
    assert run.start_time == max(one.start_time for one in each.values())
    np.testing.assert_array_equal(run.k_dyns, np.max([one.k_dyns for one in each.values()], axis=0))
    assert run.summary()["positions"]["worst"] == run.position


def test_permissible_torques_are_limits():
    """A strategy passes if no shaft exceeds its own, also with worn gaps and a light load."""
    most = {"shaft[1].permissible_torque": 350.0, "shaft[3].permissible_torque": "8 kN*m"}
    table = compare(Chain.load("crane-4-mass", also={**DAMPED, **most}), ["direct", "s-curve"])
    for row in table.rows:
        cases = [row.run.used_torque, *(case.used_torque for case in row.cases.values())]
        (margin,) = row.margins(table.drive.limits)
        assert margin.value == max(cases)
        assert margin.kept == (max(cases) <= 100.0)
    assert table.recommendation.recommended is table.rows[1]


def various(count: int = 16) -> list[Chain]:
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


@pytest.mark.parametrize("controller", ["direct", "state-feedback"])
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


def test_what_cannot_be_finished_has_a_status_and_no_figures():
    found = simulate(various(4), "direct", fitted_to=CRANE, max_events=60)
    failed = found.status.values == "TOO_MANY_EVENTS"
    assert failed.any()
    assert np.isnan(found.k_dyn.values[failed]).all()
    assert np.isnan(found.k_dyns.values[failed]).all()


@pytest.mark.parametrize(
    ("call", "reason"),
    [
        (lambda: Chain.load("crane-4-mass", also={"start.position": "hangin"}), 'did you mean "hanging"'),
        (lambda: simulate([], "direct"), "not empty"),
        (lambda: simulate([CHAIN, CRANE], "direct"), "same number of masses"),
        (lambda: simulate([Chain([Mass(1.0), Mass(1.0)], [Shaft(5.0)])], "direct"), r"\[motor\] is missing"),
        (lambda: simulate("crane-4-mas", "direct"), "did you mean crane-4-mass"),
    ],
)
def test_what_is_refused(call, reason):
    with pytest.raises(InputError, match=reason):
        call()


def test_a_name_is_that_of_a_drive_or_of_a_chain(tmp_path):
    mine = tmp_path / "mine.toml"
    mine.write_text(CHAIN.to_toml(), encoding="utf-8")
    assert load_machine(mine) == CHAIN
    assert load_machine(str(mine)) == CHAIN
    assert isinstance(load_machine("crane-4amtkf"), Drive)
    assert simulate(str(mine), "direct").k_dyn == simulate(CHAIN, "direct").k_dyn
