"""A torque profile on the command line: simulated, compared, listed."""

from __future__ import annotations

import json

from softstart import TorqueProfile


def test_a_profile_from_a_file_is_simulated(run, place):
    TorqueProfile([0.0], [62.0]).to_csv(place / "full.csv")
    code, out, err = run(
        "simulate", "crane-4amtkf", "--controller", "profile", "--param", "file=full.csv", "--json"
    )
    assert (code, err) == (0, "")
    told = json.loads(out)
    assert told["parameters"] == {"file": "full.csv", "period": 0.0}
    direct = json.loads(run("simulate", "crane-4amtkf", "--controller", "direct", "--json").out)
    assert told["k_dyn"] == direct["k_dyn"]


def test_without_a_profile_it_says_how_to_give_one(run):
    code, _, err = run("simulate", "crane-4amtkf", "--controller", "profile")
    assert code == 2
    assert "--param file=PATH" in err


def test_compare_takes_it_in_where_it_is_given_a_file(run, place):
    TorqueProfile([0.0, 0.1], [20.0, 62.0]).to_toml(place / "ramp.toml", {"from": "a test"})
    names = [one["controller"] for one in json.loads(run("compare", "--json").out)["strategies"]]
    assert "direct" in names
    assert "profile" not in names
    told = json.loads(run("compare", "--param", "profile.file=ramp.toml", "--json").out)
    assert sorted([*names, "profile"]) == sorted(one["controller"] for one in told["strategies"])
