"""`softstart clutch`: figures, JSON, files and refusals."""

from __future__ import annotations

import json
import os

import pytest

from softstart.clutch import Clutch, engage


def test_without_arguments_the_clutch_of_the_paper(done):
    out = done("clutch")
    for words in ("Friction clutch of [C]", "634.076", "266163", "The clutch has locked."):
        assert words in out


def test_json_is_the_engagement(as_json):
    found = as_json("clutch", "--law", "quadratic-convex", "--set", "clutch.lining_area=0.05 m^2")
    expected = engage(Clutch.load("paper-c").replace(law="quadratic-convex", lining_area=0.05))
    assert found["slip_work"] == expected.slip_work
    assert found["lining_heat"] == expected.friction_work / 0.05
    assert found["energy"]["residual"] < 1e-12
    assert [phase["kind"] for phase in found["phases"]] == ["slip", "locked", "slip", "locked"]


def test_a_law_from_a_file_and_all_that_is_written(run, place):
    (place / "law.csv").write_text("t [s],M [kgf*m]\n0,0\n1,60\n")
    code, out, _ = run("clutch", "--law", "law.csv", "--out", "made")
    assert code == 0
    assert "Written to made" in out
    assert sorted(os.listdir(place / "made")) == [
        "clutch.toml", "engagement.png", "engagement.svg", "events.csv", "phases.csv",
        "report.md", "traces.csv",
    ]  # fmt: skip
    linear, table = engage(Clutch.load("paper-c")), engage(Clutch.load(place / "made" / "clutch.toml"))
    assert table.slip_work == pytest.approx(linear.slip_work, rel=1e-13)
    # a clutch whose file has a table can be given another law
    code, out, _ = run("clutch", "made/clutch.toml", "--law", "linear", "--json")
    assert json.loads(out)["slip_work"] == linear.slip_work


def test_the_optimal_laws_and_their_files_can_be_played(run, place):
    code, out, _ = run("clutch", "--optimal", "--points", "1", "--out", "best", "--json")
    assert code == 0
    (point,) = json.loads(out)["points"]
    assert point["work_bound"] <= point["slip_work"]
    assert {"front.csv", "laws.csv", "law-1.csv", "report.md", "front.svg"} <= set(os.listdir(place / "best"))
    code, out, _ = run("clutch", "--law", "best/law-1.csv", "--json")
    assert json.loads(out)["slip_work"] == pytest.approx(point["slip_work"], rel=1e-13)


ONE_SENTENCE = {
    "clutch": (["paper-d"], ["no shipped clutch of this name", "did you mean paper-c?"]),
    "law": (["--law", "linaer"], ['--law = "linaer"', "did you mean linear?"]),
    "file of a law": (["--law", "none.csv"], ['"none.csv": there is no such file', "law (CSV)"]),
    "key": (["--set", "load.torqe=3"], ["did you mean load.torque?"]),
    "stiffness": (["--set", "shaft.stiffness=1e20"], ["stiffness = 1e+20", "must be between 1e-09 and"]),
    "soft": (["--set", "shaft.stiffness=1e-20"], ["stiffness = 1e-20", "1.11e-10 1/s"]),
    "until": (["--until", "-1"], ["--until", "above 0 s"]),
    "points alone": (["--points", "3"], ['--points = "3"', "add --optimal"]),
    "count": (["--optimal", "--points", "many"], ['--points = "many"', "from 1 to 200"]),
    "until of an optimum": (["--optimal", "--until", "3"], ["leave it out with --optimal"]),
    "gap of an optimum": (["--optimal", "--set", "shaft.gap=0.1"], ["gap = 0.1", "set gap = 0"]),
}


@pytest.mark.parametrize(("arguments", "says"), ONE_SENTENCE.values(), ids=ONE_SENTENCE)
def test_one_clear_sentence(arguments, says, refused):
    refused("clutch", *arguments, says=says)
