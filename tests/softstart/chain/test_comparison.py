"""Chains go where drives go: positions in the gaps, simulate and compare, in Python and as commands."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from softstart import Command, Drive, InputError, PlainController, compare, simulate
from softstart.chain import Chain, Mass, Motor, Shaft
from softstart.chain.model import load_machine
from softstart.cli import main

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


@pytest.mark.parametrize("position", ["driving-flank", "opposite-flank", "hanging"])
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


@pytest.mark.parametrize(
    ("call", "reason"),
    [
        (lambda: Chain.load("crane-4-mass", also={"start.position": "hangin"}), 'did you mean "hanging"'),
        (lambda: compare(Chain([Mass(1.0), Mass(1.0)], [Shaft(5.0)]), "direct"), r"\[motor\] is missing"),
        (lambda: compare("crane-4-mas"), "did you mean crane-4-mass"),
        (lambda: simulate("crane-4-mas", "direct"), "did you mean crane-4-mass"),
        (lambda: simulate(CHAIN, "direct", fitted_to="x"), "give a Drive or a Chain"),
        (lambda: compare(CHAIN, "direct", worst_case="gap x5"), "worst_case"),
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


def test_the_commands_take_chains(tmp_path, capsys):
    out = tmp_path / "out"
    words = ["--set", "shaft[1].damping_ratio=0.02", "--json"]
    assert main(["compare", "crane-4-mass", "--controllers", "direct,ramp", "--out", str(out), *words]) == 0
    found = json.loads(capsys.readouterr().out)
    chain = Chain.load(out / "chain.toml")
    assert chain.shafts[0].damping_ratio == 0.02
    for row in found["strategies"]:
        assert row["k_dyn"] == simulate(chain, row["controller"]).k_dyn
    assert "K\\_dyn" in (out / "report.md").read_text(encoding="utf-8")
    assert main(["simulate", str(out / "chain.toml"), "--controller", "ramp", "--json"]) == 0
    alone = json.loads(capsys.readouterr().out)
    assert alone["k_dyns"] == found["strategies"][1]["k_dyns"]
    assert alone["events"][0]["kind"] == "gap closed"
    assert main(["linear", str(out / "chain.toml"), "--controller", "ramp"]) == 0
    assert "4 masses" in capsys.readouterr().out


def test_a_motor_torque_beyond_the_limits_is_named():
    """The table says which demand is cut off, by the limits of the chain's motor."""
    from softstart.views.starts import clipped_torque

    chain = Chain([Mass(0.03), Mass(0.2)], [Shaft(400.0, gap=0.2)], Motor(62.0), target_speed=90.0)

    class Beyond(PlainController):
        name = "beyond"

        def step(self, measured, state):
            return Command(70.0, np.inf)

    assert "up to 8 N m beyond the limits 0 and 62 N m" in clipped_torque(simulate(chain, Beyond()))
