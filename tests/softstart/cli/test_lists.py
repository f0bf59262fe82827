"""`softstart drives` and `softstart controllers`."""

import pytest

from softstart import Drive
from softstart.cli.options import controller_names, drive_names


def test_drives_are_listed_with_their_source(done, as_json):
    out = done("drives")
    for name in drive_names():
        assert name in out
    assert "Gutman" in out
    told = as_json("drives")
    assert [one["name"] for one in told["drives"]] == list(drive_names())
    assert all(one["source"] for one in told["drives"])


@pytest.mark.parametrize("name", drive_names())
def test_a_shipped_drive_is_the_beginning_of_an_own_one(place, name, done, as_json):
    out = done("drives", name)
    (place / "mine.toml").write_text(out, encoding="utf-8")
    assert Drive.load(place / "mine.toml") == Drive.load(name)
    told = as_json("drives", name)
    assert told["drive"]["gap"] == Drive.load(name).gap


def test_controllers_are_listed(done, as_json):
    out = done("controllers")
    for name in controller_names():
        assert name in out
    told = as_json("controllers")
    assert {one["name"] for one in told["controllers"]} <= set(controller_names())


def test_the_player_of_profiles_tells_how_it_is_given_one(run):
    out = " ".join(run("controllers", "profile").out.split())
    assert "path of the profile" in out
    assert "--controller profile --param file=VALUE" in out


@pytest.mark.parametrize("name", ["direct", "ramp", "reduced-two-stage"])
def test_one_controller_tells_its_parameters(name, done, as_json):
    out = done("controllers", name)
    told = as_json("controllers", name)
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
