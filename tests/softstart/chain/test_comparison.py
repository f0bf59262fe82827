"""Chains go where drives go: positions in the gaps, limits, compare, batches."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from softstart import Drive, InputError, compare, simulate
from softstart.chain import Chain, Mass, Motor, Shaft
from softstart.views.starts import figure_rows, run_sheet
from softstart.views.traces import comparison_figure

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
    for word, share in (("driving-flank", 0.5), ("opposite-flank", -0.5)):
        at = replace(CHAIN, position=word).at_motor_shaft()
        np.testing.assert_allclose(at.theta0, share * at.gap, rtol=1e-14)
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


def test_a_permissible_torque_is_seen_wherever_the_start_is():
    """A chain of two masses; 20 kN m at the slow side of 57:1 are 350.877 N m at the motor."""
    truck = Chain(
        [Mass(0.625), Mass(6250.0, torque=1500.0, kind="reactive")],
        [Shaft(75e3, damping=1e3, gap="0.5 deg", ratio=57, side="after", permissible_torque="20 kN*m")],
        Motor(300.0), target_speed=114.0,
    )  # fmt: skip
    for chain in (truck, truck.brought_to("motor")):
        run = simulate(chain, "direct")
        used = 100.0 * run.peak_torque / (20e3 / 57)
        assert used == pytest.approx(125.3, abs=0.05)
        said = f"permissible torque {used:.4g} % of 100 % ({used - 100.0:.3g} % over)"
        assert dict(figure_rows(run))["limits"] == said
        (table,) = (one for one in run_sheet(run).tables if one.title == "Shafts")
        assert table.rows[0][-1] == f"{used:.1f}"
        assert said in run._repr_html_()
        assert said in compare(chain, ["direct"], worst_case=()).recommendation.text
        for figure in (run.plot(), comparison_figure(compare(chain, ["direct"]).rows)):
            lines = [float(line.get_ydata()[0]) for line in figure.axes[0].lines]
            assert run.permissible_torque in lines
        assert run.permissible_torque == pytest.approx(20e3 / 57, rel=1e-12)
    crane = simulate(CRANE.replace(permissible_torque=150.0, permissible_start_time=0.3), "direct")
    assert dict(figure_rows(crane))["limits"].startswith(
        "shaft torque 164.8 N m of 150 N m (9.87 % over); start"
    )


@pytest.mark.parametrize("controller", ["direct", "state-feedback"])
def test_a_batch_has_the_bits_of_single_starts(controller):
    """Undamped, damped, with a load that rests, with a loss; what cannot be finished has no figures."""
    bare, lossy, resting = {}, {**DAMPED, "shaft[2].efficiency": 0.95}, {**DAMPED, "mass[4].kind": "reactive"}
    chains = [Chain.load("crane-4-mass", also=also) for also in (bare, DAMPED, lossy, resting)]
    found = simulate(chains, controller, fitted_to=CRANE, workers=2)
    for i, chain in enumerate(chains):
        run, row = simulate(chain, controller, fitted_to=CRANE), found.isel(start=i)
        assert np.array_equal(row.peak_torques.values, run.peak_torques)
        assert np.array_equal(row.k_dyns.values, run.k_dyns)
        assert (row.start_time.item(), row.end_time.item()) == (run.start_time, run.end_time)
    given_up = simulate(chains, controller, fitted_to=CRANE, max_events=60)
    assert set(given_up.status.values) == {"TOO_MANY_EVENTS"}
    assert np.isnan(given_up.k_dyns.values).all()


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
