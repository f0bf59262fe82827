"""`softstart fatigue`: tables, JSON, files, and what it refuses."""

from __future__ import annotations

import csv
import json

import pytest

from softstart import Chain, Drive, fatigue, simulate

ASKED = ("fatigue", "crane-4amtkf", "--controllers", "direct,s-curve", "--set", "shaft.damping=1")
CRANE = Drive.load("crane-4amtkf").replace(damping=1.0)
RUNS = [simulate(CRANE, name) for name in ("direct", "s-curve")]
LIMITS = (
    "limits.starts_per_hour=60", "limits.life=20000 h", "limits.fatigue.slope=6.6",
    "limits.fatigue.torque=90", "limits.fatigue.cycles=2e6",
)  # fmt: skip


def test_json_is_the_summary(as_json):
    told = as_json(*ASKED)
    lives = fatigue(RUNS)
    assert [one["relative_life"] for one in told["strategies"]] == [row.relative for row in lives.rows]
    assert told["slope"] == 6.6
    assert not told["slope_given"]
    assert told["damping_ratio"] == lives.drive.damping_ratio
    assert told["strategies"][1]["spectrum"][0]["range"] == lives.rows[1].spectrum[0, 0]


@pytest.mark.parametrize("width", ["80", "140"])
def test_the_table_is_shown(monkeypatch, width, done):
    monkeypatch.setenv("COLUMNS", width)
    settings = [part for one in LIMITS for part in ("--set", one)]
    out = done(*ASKED, *settings, "--worn-gap", "2 rad")
    text = " ".join(out.split())
    assert "Longest life: s-curve" in text
    assert "years" in text
    assert "error of the sum at most" in text
    assert "Damping ratio of the shaft: 15 %" in text
    # 90 N m for 2e6 cycles at m = 6.6: 134.9 N m in each start of direct are 1.4e5, 67.0 of the s-curve 1.4e7
    assert "asked for, 1.2e+06 starts, is reached by:" in text
    assert "not by: direct" in text


def test_an_estimated_damping_is_marked(done):
    given = ("fatigue", "--controllers", "direct,s-curve", "--estimate-damping", "gears=3,couplings=2")
    out = done(*given)
    text = " ".join(out.split())
    assert "The damping is ESTIMATED: a ratio of 4 % from 3 gears and 2 couplings" in text
    assert "d = 0.26226 N m s/rad" in text


def test_files(place, done):
    done(*ASKED, "--slope", "5", "--out", "lives")
    folder = place / "lives"
    with (folder / "spectrum-direct.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    lives = fatigue(RUNS, slope=5.0)
    assert [float(row["range N m"]) for row in rows] == lives.rows[0].spectrum[:, 0].tolist()
    for name in ("fatigue.svg", "fatigue.png", "fatigue.csv", "turning-points-s-curve.csv", "drive.toml"):
        assert (folder / name).stat().st_size > 0
    text = (folder / "report.md").read_text()
    assert "Longest life: s-curve" in text
    assert "m = 5" in text


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ((), "damping is missing in motor - load: an undamped shaft rattles without end"),
        (("--estimate-damping", "teeth=3"), "give numbers of gears and couplings"),
        (("--estimate-damping", "gears=x"), "whole number"),
        (("--slope", "steep"), "--slope"),
        (("--set", "shaft.damping=1", "--worn-gap", "0.1"), "wear widens the gap"),
        (("--set", "shaft.damping=1", "--estimate-damping", "gears=3"), "a damping of its own"),
    ],
)
def test_bad_input_is_one_sentence(more, said, refused):
    refused("fatigue", "--controllers", "direct", *more, says=[said])


DAMPED = [f"shaft[{k}].damping_ratio=0.02" for k in (1, 2, 3)]


def test_each_shaft_of_a_chain_is_counted(tmp_path, done):
    settings = [part for one in DAMPED for part in ("--set", one)]
    more = ("--controllers", "direct,s-curve", "--json", "--out", str(tmp_path / "lives"))
    out = done("fatigue", "crane-4-mass", *settings, *more)
    lives = json.loads(out)["strategies"]
    assert [one["shaft"] for one in lives[:3]] == list(Chain.load("crane-4-mass").shaft_names)
    assert all(one["relative_life"] == 1.0 for one in lives[:3])
    assert all(one["relative_life"] > 10.0 for one in lives[3:])
    report = (tmp_path / "lives" / "report.md").read_text(encoding="utf-8")
    assert "times that of direct in the shaft that gains least" in report
    assert len(list((tmp_path / "lives").glob("turning-points-*.csv"))) == 6
    out = done("fatigue", "crane-4-mass", *settings, "--controllers", "direct,s-curve")
    assert "Life over that under direct" in out
    assert "Damping ratio of the first natural vibration:" in out


def test_a_chain_wears_and_its_damping_is_estimated_as_those_of_a_drive(done):
    given = ("--estimate-damping", "gears=3,couplings=2", "--worn-gap", "1 rad")
    text = " ".join(done("fatigue", "crane-4-mass", "--controllers", "direct,s-curve", *given).split())
    assert "The damping is ESTIMATED: a ratio of 4 % from 3 gears and 2 couplings" in text
    assert all(one in text for one in ("Life with half the damping", "worn", "from 0.5 to 1 rad over the"))


def test_a_chain_that_cannot_be_counted_is_refused(refused):
    refused("fatigue", "crane-4-mass", says=["damping is missing in rotor - pinion"])
