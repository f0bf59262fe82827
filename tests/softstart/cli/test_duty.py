"""`softstart duty`: what it prints and writes, its keys, exit codes and refusals."""

from __future__ import annotations

import csv
import json
import shlex

import pytest
from tests.softstart.cli.conftest import CONTROLLERS

from softstart import Drive, compare_duty, run_duty
from softstart.views.duties import duty_data
from softstart.views.numbers import json_ready

CRANE = """
name = "Travel crane"
[motor]
inertia = 0.035
starting_torque = "62 N*m"
minimum_torque = "-62 N*m"
friction = 0.5
[shaft]
stiffness = 368.465
damping = 1.0
gap = 0.5
[load]
inertia = 0.175
torque = 7.16
kind = "reactive"
[start]
target_speed = "880 rpm"
position = "mid-gap"
[limits]
shaft_torque = "110 N*m"
[limits.fatigue]
slope = 6.6
torque = 150
cycles = 2e6
"""
CYCLE = """
[[duty]]
do = "start"
[[duty]]
do = "reverse"
[[duty]]
do = "stop"
[shift]
cycles_per_hour = 30
"""
RAMP = ("duty", "crane.toml", "--controller", "ramp")
TWO = ("duty", "crane.toml", "--controllers", "ramp,speed-ramp")


@pytest.fixture(autouse=True)
def files(place):
    """A crane with a duty, one without, and the duty alone."""
    (place / "crane.toml").write_text(CRANE + CYCLE)
    (place / "bare.toml").write_text(CRANE)
    (place / "cycle.toml").write_text(CYCLE)


def test_one_strategy(done, as_json):
    said = as_json(*RAMP)
    run = run_duty(Drive.load("crane.toml"), "ramp")
    assert said == json_ready(duty_data(run))
    assert {"k_dyn", "base_torque", "worst_step", "limits_kept", "steps", "life", "stop", "cycles"} <= set(
        said
    )
    step = said["steps"][said["worst_step"] - 1]
    assert step["do"] == "stop"
    assert (
        step["k_dyn"] == said["k_dyn"] == pytest.approx(step["peak_torque"] / said["base_torque"], rel=1e-15)
    )
    assert [one["kept"] for one in step["limits"]] == [False]
    (shaft,) = said["life"]["shafts"]
    assert shaft["hours"] == pytest.approx(shaft["cycles_to_failure"] / 30.0)
    out = done(*RAMP)
    assert f"Worst step: 3, stop, K_dyn {said['k_dyn']:.3f}" in out
    assert "its stops are by torque (default)" in " ".join(out.split())
    assert max(map(len, out.splitlines())) <= 100


def test_estimated_damping(done, as_json, place):
    (place / "undamped.toml").write_text((CRANE + CYCLE).replace("damping = 1.0", ""))
    words = ("duty", "undamped.toml", "--controller", "ramp")
    bare = as_json(*words)
    assert bare["life"] is None
    assert bare["no_life"].startswith("damping is missing in motor - load")
    said = as_json(*words, "--estimate-damping", "gears=3,couplings=2")
    assert said["damping_estimated_from"] == {"gears": 3, "couplings": 2}
    assert said["life"]["shafts"][0]["cycles_to_failure"] > 0.0
    shown = " ".join(done(*words, "--estimate-damping", "gears=3,couplings=2").split())
    assert "Damping is estimated (ratio 4 % from 3 gears and 2 couplings)." in shown


def test_what_next(done):
    """All strategies, and the other stops that this machine has; both commands run."""
    shown = done(*RAMP, "--param", "time=0.1 s", "--stop=torque", "--cycles", "1").splitlines()
    lines = [line.strip().split("   ")[0] for line in shown[shown.index("Next:") + 1 :]]
    assert lines == [
        "softstart duty crane.toml --stop=torque --cycles 1 --compare",
        "softstart duty crane.toml --controller ramp --param 'time=0.1 s' --cycles 1 --stop coast",
    ]
    assert "Next:" in done(*shlex.split(lines[1])[1:])
    assert "--stop" not in done("duty", "crane.toml", "--controller", "speed-ramp")


def test_options_reach_the_duty(as_json):
    coast = as_json(*RAMP, "--stop", "coast", "--cycles", "3", "--slope", "4", "--param", "time=0.3 s")
    assert (coast["stop"], coast["cycles"], coast["life"]["slope"]) == ("coast", 3, 4.0)
    assert coast["life"]["counted_cycles"] == 2
    assert coast["parameters"]["time"] == 0.3
    assert coast["steps"][2]["how"] == "coast"
    own = as_json("duty", "bare.toml", "--controller", "ramp", "--duty", "cycle.toml")
    assert own["steps"] == as_json(*RAMP)["steps"]


@pytest.mark.parametrize("place_of_duty", ["duty.toml", "own"])
def test_a_change_of_a_step_is_one_of_the_duty_in_use(place_of_duty, as_json, place):
    """Whether the steps are in the file of the machine or in their own; the gear is that of the machine."""
    steps = CYCLE.replace('do = "reverse"', 'do = "hold"\ntime = 1')
    (place / "duty.toml").write_text(steps)
    (place / "own.toml").write_text(CRANE + steps)
    machine = ["own.toml"] if place_of_duty == "own" else ["crane.toml", "--duty", place_of_duty]
    change = ("--set", "duty[2].time=0.7 s", "--set", "shift.hours=6", "--set", "load.inertia=0.2")
    said = as_json("duty", *machine, "--controller", "ramp", "--cycles", "1", *change)
    assert said["steps"][1]["time"] == pytest.approx(0.7)


def test_a_wrong_step_names_its_file(refused, place):
    (place / "fast.toml").write_text('[[duty]]\ndo = "start"\nset_speed = 880\n[[duty]]\ndo = "stop"\n')
    says = ["fast.toml: [duty] 1, set_speed = 880 rad/s", 'did you mean "880 rpm"?']
    refused(*RAMP, "--duty", "fast.toml", says=says)
    refused(*RAMP, "--stop", "brake", says=['crane.toml: [duty] 3, do = "stop" by brake'])


def test_several_strategies(done, as_json):
    said = as_json(*TWO)
    table = compare_duty(Drive.load("crane.toml"), ["ramp", "speed-ramp"])
    assert said == json_ready(table.summary())
    assert [one["controller"] for one in said["strategies"]] == ["ramp", "speed-ramp"]
    assert said["strategies"][0]["relative_life"] > 1.0
    out = " ".join(done(*TWO).split())
    assert "Lowest K_dyn of the worst step: speed-ramp" in out


def test_compare_ranks_all(done, place):
    """By the K_dyn of the worst step; a plain controller of one's own may be among them."""
    out = done("duty", "crane.toml", "--controllers", "direct,own.py:Good,speed-ramp", "--json")
    assert [one["controller"] for one in json.loads(out)["strategies"]] == ["direct", "own", "speed-ramp"]
    rows = [
        line.split()[0] for line in done("duty", "crane.toml", "--compare").splitlines() if line[:1] > " "
    ]
    assert {"direct", "ramp", "speed-ramp"} <= set(rows)
    assert rows.index("speed-ramp") < rows.index("direct")


@pytest.mark.slow
def test_files(done, place):
    done(*RAMP, "--out", "results")
    names = {path.name for path in (place / "results").iterdir()}
    assert names == {
        "report.md", "drive.toml", "duty.toml", "trace-ramp.csv", "steps.csv", "spectrum.csv",
        "duty-ramp.svg", "duty-ramp.png", "worst-step-ramp.svg", "worst-step-ramp.png",
    }  # fmt: skip
    report = (place / "results" / "report.md").read_text()
    assert all(f"({name})" in report for name in names - {"report.md"} if not name.endswith(".png"))
    with (place / "results" / "steps.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [(row["step"], row["cycle"]) for row in rows] == [(s, c) for c in "12" for s in "123"]
    again = done("duty", "bare.toml", "--controller", "ramp", "--duty", "results/duty.toml", "--json")
    assert json.loads(again)["steps"] == json.loads(done(*RAMP, "--json"))["steps"]
    done(*TWO, "--out", "compared")
    names = {path.name for path in (place / "compared").iterdir()}
    assert {"comparison.csv", "duty.svg", "duty-speed-ramp.png", "trace-speed-ramp.csv"} <= names


REFUSED = {
    "duty crane.toml": ["--controller: give one strategy"],
    "duty crane.toml --controller ramp --compare": ["--controller: give one strategy"],
    "duty crane.toml --compare --controllers ramp": ["--controller: give one strategy"],
    "duty bare.toml --controller ramp": ["duty is missing: Travel crane has no [[duty]]"],
    "duty crane.toml --controller ramp --stop brake": ["has no brake; add [brake] torque"],
    "duty crane.toml --controller ramp --stop strategy": ["ramp cannot stop a machine"],
    "duty crane.toml --controller ramp --slope 0": ["--slope = 0.0: the slope m of an S-N curve"],
    "duty crane.toml --controller ramp --estimate-damping gears=2": ["a damping of its own"],
    "duty crane.toml --controller ramp --duty nowhere.toml": ["nowhere.toml"],
    "duty crane.toml --controller ramp --cycles 0": ["--cycles"],
    "duty bare.toml --controller ramp --set duty[2].time=1": ["the drive has no duty; add [[duty]]"],
    "duty bare.toml --controller ramp --duty cycle.toml --set duty[9].time=1": ["duty[N].time with N from"],
    "duty bare.toml --controller ramp --duty crane.toml": ["this is the file of a machine; give it as DRIVE"],
}


@pytest.mark.parametrize("line", REFUSED)
def test_refusals(line, refused):
    refused(*line.split(), says=REFUSED[line])


def test_a_way_to_stop_that_there_is_not(run):
    code, out, err = run(*RAMP, "--stop", "wall")
    assert (code, out) == (2, "")
    assert "'wall' is not one of 'strategy', 'torque', 'coast', 'brake'" in err


def test_a_step_that_never_ends_exits_with_3(run, place):
    """Under a torque below that of the load nothing moves; among several it is one row with the sentence."""
    weak = CONTROLLERS.replace("31.0 if measured.time < 0.1 else 62.0, measured.time + 0.01", "3.0")
    (place / "own.py").write_text(weak)
    code, out, err = run("duty", "crane.toml", "--controller", "own.py:Good")
    assert (code, out) == (3, "")
    assert '[duty] 1, do = "start": the load does not reach its set speed' in err
    code, out, err = run("duty", "crane.toml", "--controllers", "own.py:Good,own.py:Raises,ramp")
    assert (code, err) == (0, "")
    assert "own: [duty] 1" in out
    assert "the controller Raises failed at t = 0 s in" in " ".join(out.split())
