"""`softstart drives` and `softstart controllers`."""

import json

import pytest

from softstart import Drive
from softstart.cli.options import controller_names, drive_names


def test_drives_are_listed_with_their_source(run):
    code, out, err = run("drives")
    assert (code, err) == (0, "")
    for name in drive_names():
        assert name in out
    assert "Gutman" in out
    told = json.loads(run("drives", "--json").out)
    assert [one["name"] for one in told["drives"]] == list(drive_names())
    assert all(one["source"] for one in told["drives"])


@pytest.mark.parametrize("name", drive_names())
def test_a_shipped_drive_is_the_beginning_of_an_own_one(run, place, name):
    code, out, err = run("drives", name)
    assert (code, err) == (0, "")
    (place / "mine.toml").write_text(out, encoding="utf-8")
    assert Drive.load(place / "mine.toml") == Drive.load(name)
    told = json.loads(run("drives", name, "--json").out, parse_constant=pytest.fail)
    assert told["drive"]["gap"] == Drive.load(name).gap


def test_controllers_are_listed(run):
    code, out, err = run("controllers")
    assert (code, err) == (0, "")
    for name in controller_names():
        assert name in out
    told = json.loads(run("controllers", "--json").out)
    assert {one["name"] for one in told["controllers"]} <= set(controller_names())


def test_the_player_of_profiles_tells_how_it_is_given_one(run):
    out = " ".join(run("controllers", "profile").out.split())
    assert "path of the profile" in out
    assert "--controller profile --param file=VALUE" in out


@pytest.mark.parametrize("name", ["direct", "ramp", "reduced-two-stage"])
def test_one_controller_tells_its_parameters(run, name):
    code, out, err = run("controllers", name)
    assert (code, err) == (0, "")
    told = json.loads(run("controllers", name, "--json").out)
    assert told["name"] == name
    assert told["parameters"]
    for parameter in told["parameters"]:
        assert parameter["name"] in out
        assert parameter["unit"] in out
        assert parameter["meaning"]


def test_a_controller_of_ones_own_tells_its_parameters(run):
    code, out, _ = run("controllers", "own.py:Needy")
    assert code == 0
    assert "share of the starting torque" in out
    assert "It has no parameters." in run("controllers", "own.py:Good").out
