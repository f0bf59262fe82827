"""`softstart optimize`: the figures, the JSON, the files, and what is refused."""

import csv
import json
import math

import pytest

from softstart import Drive, simulate
from softstart.optimal.optimize import optimize
from softstart.profile import TorqueProfile

SIXTY = ("--set", "start.target_speed=60 rad/s")
ANCHOR = ("optimize", *SIXTY, "--start-time", "0.2883042")
CRANE = Drive.load("crane-4amtkf").replace(target_speed=60.0)


def test_an_unknown_position_is_named_with_what_a_sensor_is_worth(done):
    out = done("optimize", *SIXTY, "--set", "start.position=unknown", "--start-time", "1.3x")
    assert "K_dyn if known to start at opposite-flank" in out
    assert "With the position known" in " ".join(out.split())


LIMITED = ("optimize", *SIXTY, "--limits", "--set", "limits.shaft_torque=50 N*m")


def test_the_quickest_start_within_limits(done, as_json):
    out = done(*LIMITED, "--set", "limits.start_time=0.3")
    flat = " ".join(out.split())
    assert "asked least start time that keeps the limits (shaft torque 50 N m, start time 0.3 s)" in flat
    assert "Least start time that keeps the limits: 0.2" in flat
    assert "Shaft torque 50 N m of 50 N m (margin" in flat
    assert "The shaft torque forbids a quicker start. None takes less than" in flat
    told = as_json(*LIMITED)
    assert (told["minimise"], told["start_time_bound"]) == ("start_time", None)
    assert told["limits"]["kept"]
    assert told["limits"]["margins"][0]["permitted"] == 50.0
    assert told["limits"]["start_time_at_least"] <= told["start_time"]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("optimize", "--limits"), "--limits: Crane travel drive"),
        ((*LIMITED, "--start-time", "1.2x"), "--start-time: limits asks for the least start time"),
    ],
)
def test_what_limits_do_not_go_with_is_refused(arguments, said, refused):
    refused(*arguments, says=[said])


def test_json_is_the_summary_of_the_optimum(as_json):
    told = as_json(*ANCHOR)
    wanted = optimize(CRANE, 0.2883042).summary()
    assert told.keys() == {*wanted, "controllers"}
    assert told["k_dyn"] == pytest.approx(0.90924724, rel=1e-6)
    for key in wanted.keys() - {"seconds"}:
        assert told[key] == wanted[key]
    direct = next(one for one in told["controllers"] if one["controller"] == "direct")
    assert direct["k_dyn"] == simulate(CRANE, "direct").k_dyn


def test_a_multiple_is_of_the_start_time_of_direct(run):
    code, out, _ = run("optimize", *SIXTY, "--start-time", "1.2x", "--json")
    assert code == 0
    assert json.loads(out)["start_time_bound"] == pytest.approx(1.2 * simulate(CRANE, "direct").start_time)


def test_the_figures_are_shown_and_fit(table):
    flat = table(*ANCHOR)
    for words in (
        "least K_dyn, start time at most 0.288304 s, terminal synchronous", "method closed-form", "0.909247",
        "lower bound of K_dyn", "gap between them", "I2t heat", "contacts", "; direct has 3.",
        "shipped controller as quick", "The lower bound (", ") covers",
    ):  # fmt: skip
        assert words in flat


FILES = {
    "report.md", "profile.csv", "profile.toml", "profile.c", "optimum.svg", "optimum.png",
    "trace-optimum.csv", "drive.toml", "figures.csv",
}  # fmt: skip


def test_the_files_which_the_same_command_writes_again(run, place, done):
    out = done(*ANCHOR, "--out", "deep/best")
    assert out.endswith("Written to deep/best: report.md, figures and tables.\n")
    folder = place / "deep" / "best"
    assert {path.name for path in folder.iterdir()} == FILES
    assert [path.name for path in (place / "deep").iterdir()] == ["best"]
    assert (folder / "optimum.png").read_bytes().startswith(b"\x89PNG")
    assert "</svg>" in (folder / "optimum.svg").read_text("utf-8")
    with (folder / "figures.csv").open(encoding="utf-8") as stream:
        (row,) = csv.DictReader(stream)
    report = (folder / "report.md").read_text("utf-8")
    linked = {part.split(")")[0] for part in report.split("](")[1:]}
    assert linked <= FILES
    assert "softstart optimize --set 'start.target_speed=60 rad/s' --start-time 0.2883042" in report
    assert "double" in (folder / "profile.c").read_text("utf-8")
    for name in ("profile.csv", "profile.toml"):
        assert isinstance(TorqueProfile.load(folder / name), TorqueProfile)
        code, out, _ = run(
            "simulate", str(folder / "drive.toml"), "--controller", "profile",
            "--param", f"file={folder / name}", "--json",
        )  # fmt: skip
        assert code == 0
        assert json.loads(out)["k_dyn"] == pytest.approx(float(row["k_dyn"]), rel=1e-9)
    written = {path.name: path.read_bytes() for path in folder.iterdir()}
    assert run(*ANCHOR, "--out", "deep/best").code == 0
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == written


@pytest.mark.parametrize("output", [(), ("--json",), ("--out", "best")])
def test_too_short_a_start_time(run, nothing_left, output):
    code, out, err = run("optimize", *SIXTY, "--start-time", "0.2", *output)
    assert code == 3
    assert err.count("\n") == 1
    assert err.startswith("softstart: ")
    if output == ("--json",):
        told = json.loads(out)
        assert told["status"] == "INFEASIBLE"
        assert 0.2 < told["shortest_start_time"] < 0.26
        shortest = told["shortest_start_time"]
        again = run("optimize", *SIXTY, "--start-time", repr(1.001 * shortest), "--json")
        assert again.code == 0
    else:
        assert out == ""
    assert "0.2" in err
    nothing_left()


@pytest.mark.slow
def test_other_aims_and_bounds(run, as_json):
    told = as_json("optimize", *SIXTY, "--minimise", "start_time", "--max-k-dyn", "1.2")
    assert told["k_dyn"] <= 1.2
    tighter = json.loads(
        run("optimize", *SIXTY, "--start-time", repr(0.99 * told["start_time"]), "--json").out
    )
    assert tighter["k_dyn"] > 1.2


def test_without_a_start_time_it_is_a_multiple_of_direct_and_says_so(as_json):
    """The same in Python, which takes the same words for a start time."""
    summary = as_json("optimize", *SIXTY)
    direct = simulate(CRANE, "direct").start_time
    assert summary["start_time_bound"] == 1.2 * direct
    assert summary["why"].endswith("no start time given: 1.2x that of direct")
    best = optimize(CRANE)
    assert (best.k_dyn, best.why) == (summary["k_dyn"], summary["why"])
    assert optimize(CRANE, "1.2x").k_dyn == best.k_dyn
    assert "given" not in optimize(CRANE, "1.2x").why
    assert optimize(CRANE, "300 ms").problem.start_time == 0.3


ONE_SENTENCE = {
    "zero": (["--start-time", "0"], ['--start-time = "0"', "above 0 s"]),
    "a speed": (["--start-time", "5 rad/s"], ["not a time"]),
    "a multiple of nothing": (["--start-time", "x"], ['--start-time = "x"', "a multiple"]),
    "a negative multiple": (["--start-time=-2x"], ['"-2x"', "a multiple"]),
    "terminal": (["--terminal", "steedy"], ["--terminal", "'synchronous', 'steady', 'reached'"]),
    "minimise": (["--start-time", "1.2x", "--minimise", "kdyn"], ["--minimise", "'k_dyn', "]),
    "K_dyn twice": (["--start-time", "1.2x", "--max-k-dyn", "1"], ["--max-k-dyn", "is what is minimised"]),
    "time twice": (["--minimise", "start_time", "--start-time", "1"], ["--start-time", "what is minimised"]),
    "no K_dyn": (["--minimise", "start_time", "--max-k-dyn", "0"], ["--max-k-dyn", "above 0"]),
    "no heat": (["--start-time", "1.2x", "--max-heat", "-1"], ["--max-heat", "above 0"]),
    "one corner": (["--start-time", "1x", "--torque-speed", "0:62"], ["--torque-speed", "two corners"]),
    "no corner": (["--start-time", "1x", "--torque-speed", "62"], ["--torque-speed", "speed:torque"]),
    "convex": (["--start-time", "1x", "--torque-speed", "0:62,10:20,90:10"], ["--torque-speed", "bends"]),
    "unit of a corner": (["--start-time", "1x", "--torque-speed", "0 N:62,9:1"], ["--torque-speed", "speed"]),
    "smoothness": (["--start-time", "1x", "--smoothness", "-1"], ["--smoothness", "0 or more"]),
    "gaps": (["--start-time", "1.2x", "--gaps", "0.5,,1"], ["--gaps", "empty"]),
    "unit of a gap": (["--start-time", "1.2x", "--gaps", "0.5 m"], ["--gaps", "not an angle"]),
    "a gap that no drive has": (["--start-time", "1.2x", "--gaps=-0.5"], ["gap"]),
    "terminal of several": (["--start-time", "1.2x", "--gaps", "1", "--terminal", "steady"], ["--terminal"]),
}  # fmt: skip


@pytest.mark.parametrize(("arguments", "says"), ONE_SENTENCE.values(), ids=ONE_SENTENCE)
def test_one_clear_sentence(arguments, says, refused):
    refused("optimize", *arguments, says=says)


def test_best_controllers_are_named_rightly(run, as_json):
    told = as_json(*ANCHOR)
    quick = [
        one for one in told["controllers"]
        if one["start_time"] <= told["start_time"] and one["controller"] != "direct"
    ]  # fmt: skip
    best = min(quick, key=lambda one: one["k_dyn"])
    said = " ".join(run(*ANCHOR).out.split())
    assert f"as quick, {best['controller']}, has {best['k_dyn']:.3f}" in said
    assert not any(math.isnan(one["k_dyn"]) for one in told["controllers"])


@pytest.mark.slow
def test_one_profile_for_two_gaps(run, place):
    code, out, err = run(
        "optimize", *SIXTY, "--start-time", "0.3", "--gaps", "0.4 rad", "--json", "--out", "both"
    )
    assert code == 0
    assert all(line.startswith("softstart: ") for line in err.splitlines())
    told = json.loads(out, parse_constant=pytest.fail)
    assert told["k_dyn"] == max(told["k_dyn_each"]) == told["k_dyn_each"][told["worst"]]
    assert told["k_dyn_lower_bound"] <= max(told["k_dyn_if_position_known"].values()) <= told["k_dyn"]
    assert max(told["start_times"]) <= 0.3 + 1e-12
    files = {path.name for path in (place / "both").iterdir()}
    report = (place / "both" / "report.md").read_text("utf-8")
    assert {part.split(")")[0] for part in report.split("](")[1:]} <= files
    played = (
        "simulate",
        "both/drive.toml",
        "--controller",
        "profile",
        "--param",
        "file=both/profile.csv",
        "--json",
    )
    for gap, wanted in zip(("0.5", "0.4"), told["k_dyn_each"], strict=True):
        peak = json.loads(run(*played, "--set", f"gap={gap}").out)["peak_torque"]
        assert peak / told["peak_torque"] == pytest.approx(wanted / told["k_dyn"], rel=1e-9)
