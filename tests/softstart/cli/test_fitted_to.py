"""`--fitted-to`: a controller set up for one drive, run on another."""

from __future__ import annotations

import pytest

from softstart import Drive, InputError, compare, simulate

BELIEVED = Drive(
    motor_inertia=0.035, starting_torque=62.0, rated_speed="880 rpm", stiffness=368.465, gap=0.5,
    load_inertia=0.175, load_torque=7.16, name="a drive of my own",
)  # fmt: skip
STIFF = BELIEVED.replace(stiffness=2.0 * BELIEVED.stiffness)
ASKED = ("good.toml", "--fitted-to", "good.toml", "--set", "shaft.stiffness=736.93")


def test_simulate_runs_the_one_and_sets_up_for_the_other(place, as_json):
    told = as_json("simulate", *ASKED, "--controller", "shaped", "--out", "one")
    wrong, right = simulate(STIFF, "shaped", fitted_to=BELIEVED), simulate(STIFF, "shaped")
    assert (told["k_dyn"], told["fitted_to"]) == (wrong.k_dyn, "a drive of my own")
    assert wrong.k_dyn > 1.5 * right.k_dyn
    report = (place / "one" / "report.md").read_text("utf-8")
    assert "shaft.stiffness 368.465 there, 736.93 here" in report
    assert "--fitted-to good.toml" in report
    assert Drive.load(place / "one" / "fitted-to.toml").stiffness == BELIEVED.stiffness
    assert Drive.load(place / "one" / "drive.toml").stiffness == STIFF.stiffness


def test_compare_does_the_same_for_each(run, place, as_json):
    names = ("shaped",)
    told = as_json("compare", *ASKED, "--controllers", ",".join(names), "--out", "both")
    assert told["fitted_to"] == "a drive of my own"
    for row, name in zip(told["strategies"], names, strict=True):
        assert row["k_dyn"] == simulate(STIFF, name, fitted_to=BELIEVED).k_dyn
        worn = simulate(STIFF.replace(gap=2.0), name, fitted_to=BELIEVED, base=STIFF)
        assert row["k_dyn_worn_gap"] == worn.k_dyn
    assert (place / "both" / "fitted-to.toml").exists()
    assert "shaft.stiffness 368.465 there, 736.93 here" in (place / "both" / "report.md").read_text("utf-8")
    shown = " ".join(run("compare", *ASKED, "--controllers", "direct").out.split())
    assert 'set up for "a drive of my own": shaft.stiffness 368.465 there, 736.93 here' in shown


def test_sweep_sets_up_for_one_drive_everywhere(place, as_json, refused):
    asked = ("--axis", "controller=shaped,ramp", "--axis", "shaft.stiffness=200,736.93", "--workers", "1")
    told = as_json("sweep", "good.toml", *asked, "--fitted-to", "good.toml", "--out", "grid")
    assert told["fitted_to"] == "a drive of my own"
    for cell in told["cells"]:
        there = BELIEVED.replace(stiffness=cell["stiffness"])
        assert cell["k_dyn"] == simulate(there, cell["controller"], fitted_to=BELIEVED).k_dyn
    assert Drive.load(place / "grid" / "fitted-to.toml") == BELIEVED
    refused("sweep", "good.toml", *asked, "--out", "grid", says=["it holds a sweep with another fitted_to"])


def test_the_same_drive_changes_no_bit():
    plain = compare(STIFF, ["shaped"])
    same = compare(STIFF, ["shaped"], fitted_to=STIFF)
    assert same.rows[0].summary() == plain.rows[0].summary()
    assert (plain.fitted_to, same.fitted_to) == (None, STIFF)


def test_what_is_no_drive_is_refused(refused):
    with pytest.raises(InputError, match="fitted_to: give the one Drive"):
        compare(STIFF, ["direct"], fitted_to="good.toml")
    for command in (("simulate", "good.toml", "--controller", "ramp"), ("compare", "good.toml")):
        said = refused(*command, "--fitted-to", "nowhere.toml")
        assert '"nowhere.toml": there is no such file' in said
