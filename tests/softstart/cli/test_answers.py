"""What commands tell: `--json` is the summary of what Python computes, and tables fit the terminal."""

from __future__ import annotations

import json
import math
import re
import shlex

import pytest
from tests.softstart.test_identification import TRUTH

from softstart import (
    Chain,
    Drive,
    Engine,
    TorqueProfile,
    balance,
    compare,
    fatigue,
    linear_view,
    optimize,
    reduce_chain,
    simulate,
    tune,
)
from softstart.chain import Mass, Shaft
from softstart.cli.options import drive_names, read_value_list
from softstart.clutch import Clutch, engage
from softstart.identification.planning import simulated_log
from softstart.optimal.front import pareto
from softstart.plugins import controller_names
from softstart.quantities import to_si
from softstart.views.starts import share_lost

SIXTY = ("--set", "start.target_speed=60 rad/s")
CRANE = Drive.load("crane-4amtkf")
CRANE_60 = CRANE.replace(target_speed=60.0)
DAMPED = CRANE.replace(damping=1.0)
ANCHOR = "optimize --set start.target_speed=60rad/s --start-time 0.2883042"
QUICK_TUNE = (
    "tune --controller ramp --set start.target_speed=60rad/s --gaps 0.5,2 --inertias 2J1,5J1 "
    "--restarts 1 --workers 1 --no-optimum --free time"
)
LIVES = "fatigue crane-4amtkf --controllers direct,s-curve --set shaft.damping=1"
LIMITED_TO = ["direct", "s-curve"]
LIMITED = "compare hoist-15kw --set limits.shaft_torque=170 --worst-case none --controllers direct,s-curve"
LOOP = "linear --controller current-limit-feedback"
THREE = ("direct", "reduced-first-stage", "reduced-two-stage")


def as_python() -> dict:
    """Commands, and the summary that Python gives for the same question."""
    options = {"restarts": 1, "workers": 1, "certified": False, "free": {"time": None}, "parameters": {}}
    return {
        "compare --controllers " + ",".join(THREE): lambda: compare("crane-4amtkf", THREE).summary(),
        "compare crane-4-mass --controllers direct,ramp": lambda: compare(
            "crane-4-mass", ["direct", "ramp"]
        ).summary(),
        LIMITED: lambda: compare(
            Drive.load("hoist-15kw").replace(permissible_torque=170.0), LIMITED_TO, worst_case=()
        ).summary(),
        LIVES: lambda: fatigue([simulate(DAMPED, name) for name in ("direct", "s-curve")]).summary(),
        LOOP: lambda: linear_view(CRANE, "current-limit-feedback").summary(),
        ANCHOR: lambda: optimize(CRANE_60, 0.2883042).summary(),
        "pareto --set start.target_speed=60rad/s --start-times 0.2523,0.3 --controllers ramp": lambda: pareto(
            CRANE_60, [0.2523, 0.3], controllers=["ramp"]
        ).summary(),
        QUICK_TUNE: lambda: tune(CRANE_60, "ramp", [0.5, 2.0], [0.07, 0.175], **options).summary(),
        "reduce --no-starts": lambda: reduce_chain(Chain.load("crane-4-mass")).summary(),
        "balance --speed 4500rpm": lambda: balance(Engine.load("vaz-11113"), ["4500 rpm"]).summary(),
        "clutch --law quadratic-convex --set clutch.lining_area=0.05m^2": lambda: engage(
            Clutch.load("paper-c").replace(law="quadratic-convex", lining_area=0.05)
        ).summary(),
    }


def without_times(value):
    """NaN as None; without seconds of this machine."""
    if isinstance(value, dict):
        timed = ("seconds", "starts_per_second")
        return {key: without_times(one) for key, one in value.items() if key not in timed}
    if isinstance(value, list | tuple):
        return [without_times(one) for one in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


@pytest.mark.parametrize("line", as_python())
def test_json_is_the_summary(line, as_json):
    told = as_json(*shlex.split(line))
    wanted = json.loads(json.dumps(without_times(as_python()[line]())))
    assert {key: value for key, value in without_times(told).items() if key in wanted} == wanted


def test_json_of_a_start_has_summary_stages_and_events(as_json):
    start = ("simulate", "crane-4amtkf", "--controller", "reduced-two-stage", "--until", "0.3")
    told = as_json(*start, "--param", "torque=15.5")
    wanted = simulate(CRANE, "reduced-two-stage", 0.3, parameters={"torque": 15.5})
    assert told.keys() == {*wanted.summary(), "fitted_to", "limits", "stages", "events"}
    assert (told["k_dyn"], told["start_time"], told["fitted_to"]) == (wanted.k_dyn, None, None)
    assert [stage["peak_torque"] for stage in told["stages"]] == [s.peak_torque for s in wanted.stages]
    assert [(e["time"], e["kind"]) for e in told["events"]] == [(e.time, e.kind) for e in wanted.events]


# ---- options reach the computation -------------------------------------------------------------------


def test_settings_parameters_and_end_reach_the_start(as_json):
    settings = ("--set", "shaft.gap=2 rad", "--set", "load.inertia=0.07", "--until", "500 ms")
    parameters = ("--param", "reduced-first-stage.torque=15.5 N*m", "--param", "own.py:Needy.share=0.25")
    names = "direct,reduced-first-stage,own.py:Needy"
    rows = as_json("compare", "good.toml", "--controllers", names, *settings, *parameters)["strategies"]
    drive = Drive.load("good.toml").replace(gap=2.0, load_inertia=0.07)
    wanted = simulate(drive, "reduced-first-stage", 0.5, parameters={"torque": 15.5})
    assert (rows[1]["k_dyn"], rows[1]["end_time"]) == (wanted.k_dyn, 0.5)
    assert rows[2]["parameters"] == {"share": 0.25}


def test_strategies_at_equal_time_as_in_python(as_json):
    """Without a value the time is 1.3 times that of direct."""
    wanted = compare(CRANE, ["direct", "ramp"], at_time="1.3x")
    for given in (("--at-time",), ("--at-time", "1.3x"), ("--at-time", f"{wanted.at_time!r} s")):
        told = as_json("compare", "--controllers", "direct,ramp", *given)
        assert told["at_time"] == wanted.at_time
        assert [row["set_to"] for row in told["strategies"]] == [row.setting for row in wanted.rows]
        assert [row["k_dyn"] for row in told["strategies"]] == [row.run.k_dyn for row in wanted.rows]


def test_a_profile_is_compared_where_its_file_is_given(place, as_json):
    TorqueProfile([0.0], [62.0]).to_csv(place / "full.csv")
    names = [one["controller"] for one in as_json("compare")["strategies"]]
    rows = as_json("compare", "--param", "profile.file=full.csv")["strategies"]
    assert sorted([*names, "profile"]) == sorted(one["controller"] for one in rows)
    (profile,) = [one for one in rows if one["controller"] == "profile"]
    assert (profile["k_dyn"], profile["parameters"]["file"]) == (simulate(CRANE, "direct").k_dyn, "full.csv")


def test_time_lost_is_a_share_of_that_of_direct():
    direct, other = compare("crane-4amtkf", ["direct", "s-curve"]).rows
    assert share_lost(direct) == 0.0
    lost = 100 * (other.run.settled_time / direct.run.settled_time - 1)
    assert math.isclose(share_lost(other), lost, rel_tol=1e-9)


def test_a_controller_may_print(run):
    code, out, err = run("compare", "good.toml", "--controllers", "own.py:Chatty", "--json")
    assert code == 0
    json.loads(out)
    assert "this belongs to standard error" in err


def test_no_gains_in_time_is_no_solution(run):
    code, out, err = run(*QUICK_TUNE.split(), "--start-time", "0.05", "--json")
    assert code == 3
    assert err.startswith("softstart: No gains within these ranges start in time (at most 0.05 s)")
    told = json.loads(out)
    assert told["robust"]["feasible"] is False
    assert told["schedule"]["in_time"] == [[False, False], [False, False]]


# ---- sweeps ------------------------------------------------------------------------------------------


def test_each_start_of_a_grid_is_that_of_simulate(as_json):
    axes = ("--axis", "shaft.gap=0.5:2:4", "--axis", "controller.time=100 ms,0.2", "--workers", "1")
    told = as_json("sweep", "--controller", "ramp", *axes, "--set", "load.inertia=0.1")
    assert told["starts"] == told["computed"] == 8
    assert told["axes"]["gap"] == {"count": 4, "unit": "rad", "from": 0.5, "to": 2.0}
    for cell in told["cells"]:
        there = CRANE.replace(load_inertia=0.1, gap=cell["gap"])
        one = simulate(there, "ramp", parameters={"time": cell["controller_time"]})
        assert (cell["k_dyn"], cell["start_time"]) == (one.k_dyn, one.start_time)


def test_what_went_wrong_in_a_grid_stands_out(as_json, done):
    few = ("sweep", "--controller", "direct", "--workers", "1", "--until", "0.36", "--axis")
    out = done(*few, "shaft.gap=0.5,1.5")
    (late,) = [line for line in out.splitlines() if "stopped early" in line]
    assert late.split()[0] == "0.5"
    assert ["1.5", "4.3847", "reached"] in [line.split()[:3] for line in out.splitlines()]
    assert as_json(*few, "shaft.gap=0.5:1.5:41")["cells"] is None  # too large to list


# ---- tables ------------------------------------------------------------------------------------------

SHOWN = {
    "compare --details --controllers " + ",".join(THREE): ["K_dyn", "gap x4", "J2 x0.4", "stage 1"],
    "simulate crane-4amtkf --controller reduced-two-stage --until 0.3": [
        "under reduced-two-stage (torque = 15.386", "The run ended at the time", "closed, driving flank",
    ],
    "simulate crane-4amtkf --controller direct --until 1": ["reached its target", "(the first 24 of "],
    "compare --controllers direct,ramp --until 0.05": ["direct (does not reach the target speed)"],
    LIVES + " --worn-gap 2rad": ["Longest life: s-curve", "Damping ratio of the shaft: 15 %"],
    "fatigue crane-4-mass --estimate-damping gears=3,couplings=2 --controllers direct,s-curve": [
        "Damping is estimated (ratio 4 % from 3 gears and 2 couplings)",
        "Life over that under direct",
    ],
    ANCHOR: ["method closed-form", "0.909247", "above the bound"],
    QUICK_TUNE + " --set gear.ratio=10": [
        "Gaps at the output: 0.05000 to 0.2000 rad, load inertias there: 7.000 to 17.50 kg m2",
    ],
    "sweep --controller ramp --axis shaft.gap=0.5,2 --workers 1": ["Over all starts", "2 starts;"],
    "balance --speed 4500rpm": ["VAZ-11113", "bore 82 mm", "Assumed: cylinders.bore", "fixed-h-e"],
    "clutch": ["634.076", "266163", "The clutch has locked."],
}  # fmt: skip


@pytest.mark.parametrize("line", SHOWN)
def test_tables_are_shown_and_fit(line, done, monkeypatch):
    columns = 120 if "fatigue" in line else 80
    monkeypatch.setenv("COLUMNS", str(columns))
    lines = done(*shlex.split(line)).splitlines()
    assert max(map(len, lines)) <= columns
    assert not any(line != line.rstrip() or "\x1b" in line for line in lines)
    flat = " ".join(" ".join(lines).split())
    for words in SHOWN[line]:
        assert words in flat


QUICKLY = {
    "optimize": (),
    "tune": ("--gaps", "1x", "--inertias", "1x", "--restarts", "1", "--workers", "1", "--no-optimum"),
}


@pytest.mark.parametrize(
    ("machine", "more", "wanted"),
    [
        ("good.toml", ("--set", "name=my drive"), ["optimize", "tune", "report"]),
        ("good.toml", ("--set", "limits.shaft_torque=200"), ["tune", "report"]),
        ("crane-4-mass", ("--set", "shaft[1].damping_ratio=0.02"), ["optimize", "tune", "report"]),
    ],
)
def test_a_comparison_ends_with_commands_for_this_machine_that_run(run, machine, more, wanted):
    out = run("compare", machine, *more, "--controllers", "direct,ramp").out
    commands = [shlex.split(line.partition("   ")[0]) for line in out.rpartition("Next:\n")[2].splitlines()]
    assert [words[1] for words in commands] == wanted
    for words in commands:
        assert words[2:5] == [machine, *more]
        if machine == "good.toml" and words[1] in QUICKLY:
            assert run(*words[1:], *QUICKLY[words[1]]).code == 0, words


# ---- lists -------------------------------------------------------------------------------------------


def test_drives_and_controllers_are_listed_and_a_shipped_drive_is_the_beginning_of_an_own_one(
    place, done, as_json
):
    told = as_json("drives")["drives"]
    assert [one["name"] for one in told] == list(drive_names())
    assert all(one["source"] for one in told)
    assert {one["name"] for one in as_json("controllers")["controllers"]} <= set(controller_names())
    for name in drive_names():
        (place / "mine.toml").write_text(done("drives", name), encoding="utf-8")
        assert Drive.load(place / "mine.toml") == Drive.load(name)
    for name in ("direct", "reduced-two-stage"):
        out, parameters = done("controllers", name), as_json("controllers", name)["parameters"]
        assert parameters
        assert all(one["name"] in out and one["unit"] in out and one["meaning"] for one in parameters)


# ---- chains ------------------------------------------------------------------------------------------


def test_natural_frequencies_come_first_whatever_cannot_be_reduced(run, place, nothing_left):
    """Five masses; the published frequencies."""
    masses = [Mass(J) for J in (3.5e-3, 3.5e-3, 3.5e-3, 0.15, 0.05)]
    (place / "good.toml").write_text(Chain(masses, [Shaft(c) for c in (12e3, 12e3, 14e3, 10e3)]).to_toml())
    code, out, err = run("reduce", "good.toml")
    assert (code, err.count("\n")) == (2, 1)
    found = [line.split()[-1] for line in out.splitlines() if re.match(r"[\d., -]+$", line)]
    assert found == ["0.00", "81.21", "141.21", "378.95", "536.36"]
    held = Chain([Mass(5.0), Mass(11.0), Mass("inf")], [Shaft(0.1e6), Shaft(0.2e6)])
    (place / "good.toml").write_text(held.to_toml())
    for line in (("reduce", "good.toml"), ("reduce", "good.toml", "--force", "--no-starts")):
        code, out, _ = run(*line)
        assert code == (0 if "--force" in line else 2)
        assert re.findall(r"^[\d., ]+ (\d+\.\d{3})  ", out, re.MULTILINE) == ["98.339", "193.913"], "by hand"
    refused = ("reduce", "tractor-like", "--factor", "20")
    assert run(*refused, "--out", "found").code == 2
    nothing_left()
    assert run(*refused, "--force", "--json", "--no-starts").code == 0


def test_a_verification_says_where_the_order_is_another_one(run, place):
    line = ("reduce", "--verify", "pulse-coast-hold,ramp", "--param", "ramp.time=0.1 s", "--out", "found")
    verdict = json.loads(run(*line, "--json").out)["verdict"]
    assert verdict["order_on_chain"] == ["ramp", "pulse-coast-hold"] == verdict["order_on_drive"][::-1]
    assert "ranks ramp and pulse-coast-hold in the opposite order." in verdict["conclusion"]
    report = (place / "found" / "report.md").read_text().replace("\\_", "_").replace("\n\n", " ")
    assert verdict["conclusion"] in report


def test_commands_go_on_with_the_chain_itself(run, as_json):
    asked = ("crane-4-mass", "--controller", "s-curve")
    axes = ("--axis", "shaft[2].gap=0.5x:2x:3", "--axis", "start.position=unknown")
    cells = as_json("sweep", *asked, *axes)["cells"]
    assert [cell["shaft_2_gap"] for cell in cells] == [0.1, 0.25, 0.4]
    assert {"k_dyn_1", "k_dyn_2", "k_dyn_3"} <= set(cells[0])
    few = ("--gaps", "1x", "--inertias", "1x", "--free", "time", "--restarts", "1", "--only", "robust")
    found = as_json("tune", *asked, *few, "--out", "tuned")["robust"]
    assert found["worst"] <= found["worst_default"]
    told = as_json("simulate", "tuned/chain.toml", "--controller", "tuned/robust.toml")
    assert told["k_dyn"] == pytest.approx(found["worst"], rel=1e-9)


# ---- identification ----------------------------------------------------------------------------------


@pytest.mark.slow
def test_a_log_becomes_a_drive_file(run, tmp_path):
    log = simulated_log(TRUTH, "two levels, then reverse", log_period=4e-3, ripple=1.0, seed=3)
    log.to_csv(tmp_path / "a.csv")
    guess = TRUTH.replace(gap=0.2, stiffness=200, load_inertia=0.4, damping=0.9)
    (tmp_path / "guess.toml").write_text(guess.to_toml(), encoding="utf-8")
    result = run("identify", "a.csv", "--drive", "guess.toml", "--torque-is", "demand", "--restarts", "3",
                 "--out", "found")  # fmt: skip
    assert result.code == 0, result.err
    assert "7 of 7 parameters are identifiable" in result.out
    drive = Drive.load(tmp_path / "found" / "drive.toml")
    assert drive.gap == pytest.approx(0.08, rel=0.03)
    assert drive.source.startswith("identified from a.csv")
    kept = json.loads((tmp_path / "found" / "identification.json").read_text(encoding="utf-8"))
    assert {one["name"] for one in kept["estimates"]} >= {"gap", "stiffness", "load_inertia"}


def test_a_range_is_even_or_with_log_in_equal_ratios() -> None:
    for text, wanted in (("0.25:4:3", [0.25, 2.125, 4.0]), ("0.25 rad:4 rad:3:log", [0.25, 1.0, 4.0])):
        assert read_value_list(text, "--gaps", lambda part: (to_si(part, "rad"), "")) == [
            (pytest.approx(value, rel=1e-12), "") for value in wanted
        ]
