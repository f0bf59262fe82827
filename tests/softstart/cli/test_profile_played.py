"""A torque profile on the command line: simulated, compared, listed."""

from __future__ import annotations

from softstart import TorqueProfile


def test_a_profile_from_a_file_is_simulated(place, as_json):
    TorqueProfile([0.0], [62.0]).to_csv(place / "full.csv")
    told = as_json("simulate", "crane-4amtkf", "--controller", "profile", "--param", "file=full.csv")
    assert told["parameters"] == {"file": "full.csv", "period": 0.0}
    direct = as_json("simulate", "crane-4amtkf", "--controller", "direct")
    assert told["k_dyn"] == direct["k_dyn"]


def test_without_a_profile_it_says_how_to_give_one(refused):
    refused("simulate", "crane-4amtkf", "--controller", "profile", says=["--param file=PATH"])


def test_compare_takes_it_in_where_it_is_given_a_file(place, as_json):
    TorqueProfile([0.0, 0.1], [20.0, 62.0]).to_toml(place / "ramp.toml", {"from": "a test"})
    names = [one["controller"] for one in as_json("compare")["strategies"]]
    assert "direct" in names
    assert "profile" not in names
    told = as_json("compare", "--param", "profile.file=ramp.toml")
    assert sorted([*names, "profile"]) == sorted(one["controller"] for one in told["strategies"])
