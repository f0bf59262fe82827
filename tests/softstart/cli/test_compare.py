"""`softstart compare`: the table, the JSON, the files."""

import csv
import json
import math
import os
import shlex
import tomllib

import pytest

from softstart import Drive, compare, simulate
from softstart.cli.running import WRITTEN
from softstart.views.starts import comparison_figure, share_lost

THREE = ("--controllers", "direct,reduced-first-stage,reduced-two-stage")


def test_json_is_the_summary_of_the_comparison(done):
    out = done("compare", *THREE, "--json")
    assert out.startswith("{")
    told = json.loads(out, parse_constant=pytest.fail)  # no NaN, no Infinity
    expected = compare("crane-4amtkf", THREE[1].split(",")).summary()
    assert told.keys() == expected.keys()
    for row, wanted in zip(told["strategies"], expected["strategies"], strict=True):
        assert row.keys() == wanted.keys()
        for key, value in wanted.items():
            if isinstance(value, float) and math.isnan(value):
                assert row[key] is None
            elif key != "parameters":
                assert row[key] == value


def test_settings_parameters_and_end_reach_the_start(run):
    arguments = ("--set", "shaft.gap=2 rad", "--set", "load.inertia=0.07", "--until", "500 ms")
    parameters = ("--param", "reduced-first-stage.torque=15.5 N*m")
    code, out, _ = run("compare", "good.toml", *THREE, *arguments, *parameters, "--json")
    assert code == 0
    row = json.loads(out)["strategies"][1]
    drive = Drive.load("good.toml").replace(gap=2.0, load_inertia=0.07)
    wanted = simulate(drive, "reduced-first-stage", 0.5, parameters={"torque": 15.5})
    assert row["k_dyn"] == wanted.k_dyn
    assert row["end_time"] == 0.5


def test_loose_controller_takes_parameters(done):
    out = done(
        "compare", "good.toml", "--controllers", "direct,own.py:Needy",
        "--param", "own.py:Needy.share=0.25", "--json",
    )  # fmt: skip
    assert json.loads(out)["strategies"][1]["parameters"] == {"share": 0.25}


@pytest.mark.parametrize("width", ["80", "100", "140"])
def test_table_says_all_and_fits(run, monkeypatch, width):
    """One table of six columns; times, events and definitions with --details."""
    monkeypatch.setenv("COLUMNS", width)
    few = run("compare", *THREE).out
    headings = [line.split() for line in few.splitlines() if line.endswith(("settled  later", " s      %"))]
    assert headings == [
        ["K", "K", "peak", "settled", "later"], ["strategy", "K_dyn", "worn", "light", "N", "m", "s", "%"]
    ]  # fmt: skip
    assert few.count("\ndirect ") == 1
    code, out, err = run("compare", *THREE, "--details")
    assert out.count("\ndirect ") == 3
    assert set(few.split()) - {"More:", "--details."} <= set(out.split())
    assert (code, err) == (0, "")
    lines = out.splitlines()
    assert max(map(len, lines)) <= int(width)
    assert not any(line != line.rstrip() for line in lines)
    assert "\x1b" not in out
    assert not set("─│┃━") & set(out)
    for words in (
        "Crane travel drive", "J1 = 0.035 kg m2", "gap = 0.5 rad", "no-pull", "active", "strategy", "K_dyn",
        "gap x4", "J2 x0.4", "stage 1", "stage 2", "contacts", "time", "later s",
        "52.86 N m",
    ):  # fmt: skip
        assert words in out
    found = compare("crane-4amtkf", THREE[1].split(","))
    assert " ".join(found.recommendation.text.split()) in " ".join(out.split())
    for row in found.rows:
        shown = " ".join(line for line in lines if line.startswith(row.run.controller.name))
        for value in (row.run.k_dyn, row.run.k_dyn_first_contact, row.k_dyn_worn_gap, row.k_dyn_light_load):
            assert f"{value:.3f}" in shown
        assert f"{row.run.peak_torque:.1f}" in shown
        assert f"{row.run.start_time:.4f}" in shown
        assert f"{row.run.first_contact:.4f}" in shown


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
def test_it_ends_with_commands_for_this_machine_that_run(run, machine, more, wanted):
    out = run("compare", machine, *more, "--controllers", "direct,ramp").out
    commands = [shlex.split(line.partition("   ")[0]) for line in out.rpartition("Next:\n")[2].splitlines()]
    assert [words[1] for words in commands] == wanted
    for words in commands:
        assert words[2:5] == [machine, *more]
        if machine == "good.toml" and words[1] in QUICKLY:
            assert run(*words[1:], *QUICKLY[words[1]]).code == 0, words


def test_time_lost_is_that_of_direct():
    direct, other = compare("crane-4amtkf", ["direct", "s-curve"]).rows
    assert share_lost(direct) == 0.0
    lost = 100 * (other.run.settled_time / direct.run.settled_time - 1)
    assert math.isclose(share_lost(other), lost, rel_tol=1e-9)


def test_starts_cut_short_are_told(run):
    code, out, _ = run("compare", "--controllers", "direct", "--until", "0.05")
    assert code == 0
    assert "direct (does not reach the target speed)" in out
    assert "direct: The run ended at the time asked for" in out


def test_a_controller_may_print(run):
    code, out, err = run("compare", "good.toml", "--controllers", "own.py:Chatty", "--json")
    assert code == 0
    json.loads(out)
    assert "this belongs to standard error" in err


FILES = {
    "report.md", "comparison.csv", "drive.toml", "comparison.svg", "comparison.png", "trade-off.svg",
    "trade-off.png", "run-direct.svg", "run-direct.png", "trace-direct.csv", "run-own.svg", "run-own.png",
    "trace-own.csv",
}  # fmt: skip


def test_the_files(place, done):
    asked = ("--controllers", "direct,own.py:Good", "--set", "gap=0.6", "--out", "deep/results")
    out = done("compare", "good.toml", *asked)
    assert out.endswith("Written to deep/results: report.md, figures and tables.\n")
    folder = place / "deep" / "results"
    assert {path.name for path in folder.iterdir()} == FILES
    assert [path.name for path in (place / "deep").iterdir()] == ["results"]
    for path in folder.glob("*.png"):
        assert path.read_bytes().startswith(b"\x89PNG")
    for path in folder.glob("*.svg"):
        assert "</svg>" in path.read_text("utf-8")

    drive = Drive.load(folder / "drive.toml")
    assert drive.gap == 0.6
    assert tomllib.loads((folder / "drive.toml").read_text("utf-8"))["name"] == "a drive of my own"
    with (folder / "comparison.csv").open(encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    assert [row["controller"] for row in rows] == ["direct", "own"]
    assert float(rows[0]["k_dyn"]) == simulate(drive, "direct").k_dyn
    trace = (folder / "trace-direct.csv").read_text("utf-8").splitlines()
    assert trace[0] == "t [s],phi1 [rad],phi2 [rad],w1 [rad/s],w2 [rad/s],u [N*m],T [N*m]"

    report = (folder / "report.md").read_text("utf-8")
    for words in (
        "# a drive of my own", "No other strategy beats", "| direct | 3.", "![comparison](comparison.svg)",
        "| shaft.gap | gap | 0.6 |",
        "softstart compare good.toml --controllers direct,own.py:Good --set gap=0.6 --out deep/results",
    ):  # fmt: skip
        assert words in report
    linked = {part.split(")")[0] for part in report.split("](")[1:]}
    assert linked <= FILES


def test_the_same_command_replaces_older_files_by_the_same_and_leaves_others(run, place):
    folder = place / "results"
    folder.mkdir()
    (folder / "notes.txt").write_text("mine")
    (folder / "report.md").write_text(f"old\n\n{WRITTEN}0.1")
    written = []
    for _ in range(2):
        assert run("compare", "--controllers", "direct", "--out", "results", "--json").code == 0
        written.append({path.name: path.read_bytes() for path in folder.iterdir()})
    assert written[0] == written[1]
    assert (folder / "notes.txt").read_text() == "mine"
    assert (folder / "report.md").read_text("utf-8").startswith("# Crane")
    assert not [name for name in os.listdir(folder) if name.startswith(".")]
    mode = (folder / "report.md").stat().st_mode & 0o777
    (place / "usual").touch()
    assert mode == (place / "usual").stat().st_mode & 0o777


def test_a_report_of_ones_own_is_not_replaced(place, refused):
    (place / "report.md").write_text("# My measurements\n")
    refused("compare", "--controllers", "direct", "--out", ".", says=["was not written by softstart"])
    assert (place / "report.md").read_text() == "# My measurements\n"


SWINGING = """
from softstart import Command, PlainController

class Swinging(PlainController):
    name = "swinging"

    def step(self, measured, state):
        n = round(measured.time / 0.0122)
        return Command(250.0 if n % 2 == 0 else 100.0, 0.0122 * (n + 1))
"""


def test_compare_tells_limits_and_flags(run, refused, place):
    (place / "swinging.py").write_text(SWINGING)
    code, out, err = run("compare", "hoist-15kw", "--set", "limits.shaft_torque=170", "--controllers",
                         "direct,shaped,s-curve", "--worst-case", "none", "--json")  # fmt: skip
    assert (code, err) == (0, "")
    found = json.loads(out)
    assert found["recommendation"]["recommended"] == "s-curve"
    direct = next(one for one in found["strategies"] if one["controller"] == "direct")
    (margin,) = direct["limits"]
    assert margin["permitted"] == 170.0
    assert not margin["kept"]
    assert margin["margin"] == pytest.approx(1.0 - direct["peak_torque"] / 170.0)
    code, out, err = run("compare", "hoist-15kw", "--set", "limits.shaft_torque=170", "--controllers",
                         "direct,swinging.py:Swinging,s-curve")  # fmt: skip
    assert (code, err) == (0, "")
    assert "exceeded" in out
    assert "harder x" in out
    refused("compare", "--worst-case", "gap", says=["--worst-case", 'there are "gap x4" and "J2 x0.4"'])


@pytest.mark.parametrize("machine", ["crane-4amtkf", "crane-4-mass"])
def test_the_legend_of_the_picture_hides_no_title(machine):
    found = compare(machine, ["direct", "reduced-first-stage"])
    figure = comparison_figure(found.rows, "a title")
    figure.canvas.draw()
    legends = [*figure.legends, *(axes.get_legend() for axes in figure.axes if axes.get_legend())]
    assert len(legends) == 1
    space = legends[0].get_window_extent()
    for axes in figure.axes:
        assert not space.overlaps(axes._left_title.get_window_extent())
        assert not space.overlaps(axes.xaxis.label.get_window_extent()) or not axes.get_xlabel()
