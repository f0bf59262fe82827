"""`softstart tune`: the tables, the JSON, the files that play, and going on after an interruption."""

import csv
import json
import os

import pytest
from tests.kept import parts_in

from softstart import Drive, tune

CRANE = Drive.load("crane-4amtkf").replace(target_speed=60.0)
SIXTY = ("--set", "start.target_speed=60 rad/s")
GRID = ("--gaps", "0.5,2", "--inertias", "2J1,5J1")
QUICK = ("--restarts", "1", "--workers", "1", "--no-optimum")
RAMP = ("tune", "--controller", "ramp", *SIXTY, *GRID, *QUICK, "--free", "time")


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """What the command above finds, and the file of its finished parts."""
    path = tmp_path_factory.mktemp("finished") / "tuning.sqlite"
    options = {"restarts": 1, "workers": 1, "certified": False, "free": {"time": None}, "parameters": {}}
    return tune(CRANE, "ramp", [0.5, 2.0], [0.07, 0.175], save_to=path, **options), path.read_bytes()


@pytest.fixture
def begun(place, finished):
    """A folder that holds these parts already."""
    (place / "tuned").mkdir()
    (place / "tuned" / "tuning.sqlite").write_bytes(finished[1])
    return "tuned"


def untimed(summary):
    return {key: value for key, value in summary.items() if key not in ("seconds", "starts")}


def test_json_is_the_summary_of_the_tuning(begun, finished, as_json):
    told = as_json(*RAMP, "--out", begun)
    assert told["starts"] == 0  # all of it was there
    assert untimed(told) == untimed(json.loads(json.dumps(finished[0].summary())))


def test_the_tables_are_shown_and_fit(table):
    flat = table(*RAMP, "--set", "gear.ratio=10")
    for words in (
        "Gains for each cell",
        "One set for all",
        "ratio 10, without losses: gaps 0.05000 to 0.2000 rad, load inertias 7.000 to 17.50 kg m2",
        "Price of robustness",
        "no slower than with the defaults",
        "all in time",
        "1 of 1 searches agree",
        "Half way between the cells",
    ):
        assert words in flat


PICTURES = {f"{name}.{end}" for name in ("gains", "metric", "robust", "price") for end in ("svg", "png")}
FILES = PICTURES | {
    "report.md", "schedule.toml", "schedule.csv", "robust.toml", "robust-cells.csv", "between.csv",
    "price.csv", "tuning.sqlite", "drive.toml",
}  # fmt: skip


def test_the_files_are_whole_and_play(run, place, begun, finished, done):
    out = done(*RAMP, "--out", begun)
    assert out.splitlines()[-1].startswith(f"Written to {begun}: ")
    folder = place / begun
    assert {path.name for path in folder.iterdir()} == FILES
    report = (folder / "report.md").read_text("utf-8")
    assert {part.split(")")[0] for part in report.split("](")[1:]} <= FILES
    assert "--gaps 0.5,2 --inertias 2J1,5J1" in report
    with (folder / "price.csv").open(encoding="utf-8") as stream:
        assert len(list(csv.DictReader(stream))) == 4
    tuned = finished[0]
    for file, table in (("schedule.toml", tuned.schedule), ("schedule.csv", tuned.schedule),
                        ("robust.toml", tuned.robust.cells)):  # fmt: skip
        cell = ("--set", "gap=2", "--set", "load.inertia=0.07", "--json")
        out = done("simulate", "crane-4amtkf", "--controller", f"{begun}/{file}", *SIXTY, *cell)
        assert json.loads(out)["k_dyn"] == float(table.k_dyn.sel(gap=2.0, load_inertia=0.07))
    out = done("compare", *SIXTY, "--controllers", f"ramp,{begun}/robust.toml,{begun}/schedule.csv", "--json")
    names = [row["controller"] for row in json.loads(out)["strategies"]]
    assert names == ["ramp", "ramp (robust)", "ramp (schedule)"]

    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    assert run(*RAMP, "--out", begun).code == 0
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == before


def test_one_question_only(as_json):
    told = as_json(*RAMP, "--only", "robust", "--tolerance", "stiffness=10%", "--quantile", "0.9")
    assert told["schedule"] is None
    assert (told["scenarios"], told["quantile"]) == (3, 0.9)
    assert told["robust"]["gains"].keys() == {"time"}


def test_nothing_in_time_is_no_solution(run):
    code, out, err = run(*RAMP, "--start-time", "0.05", "--json")
    assert code == 3
    assert err.startswith("softstart: No gains within these ranges start in time (at most 0.05 s)")
    told = json.loads(out)
    assert told["robust"]["feasible"] is False
    assert told["schedule"]["in_time"] == [[False, False], [False, False]]


def test_parts_of_another_drive_are_refused(place, begun, refused):
    before = {path.name: path.read_bytes() for path in (place / begun).iterdir()}
    said = refused(*RAMP, "--set", "damping=0.6", "--out", begun)
    for words in ("--out", "tuning.sqlite", "another drive", "give another folder"):
        assert words in said
    assert {path.name: path.read_bytes() for path in (place / begun).iterdir()} == before


def test_an_interrupted_command_keeps_its_parts_and_goes_on(interrupted, place):
    state = place / "tuned" / "tuning.sqlite"
    err = interrupted(
        "tune", "--controller", "ramp", *SIXTY, "--gaps", "0.5:2:6", "--inertias", "2J1:5J1:6",
        "--no-optimum", "--workers", "2", "--out", "tuned",
        begun=lambda: bool(parts_in(state)),
    )  # fmt: skip
    assert "finished parts are kept in tuned/tuning.sqlite" in err
    assert os.listdir(place / "tuned") == ["tuning.sqlite"]
    (kept,) = parts_in(state)
    assert kept["part"][0] == "schedule"
    assert 0 < kept["generation"] < 60


ONE_SENTENCE = {
    "no gap": (["--gaps", ""], ["--gaps", "empty"]),
    "half a range": (["--gaps", "0.5:2"], ["from:to:count"]),
    "count of one": (["--gaps", "0.5:2:1"], ["from 2 to 100"]),
    "mixed range": (["--inertias", "2J1:0.2:4"], ["--inertias", "both"]),
    "unit": (["--inertias", "2 N"], ["--inertias", "2 N"]),
    "negative": (["--gaps=-1"], ["--gaps", "gap = -1"]),
    "free": (["--free", "tme"], ["--free", "did you mean time?"]),
    "free range": (["--free", "time=3"], ["name=low:high"]),
    "free twice": (["--free", "time,time"], ["named twice"]),
    "metric": (["--metric", "k_dym"], ["--metric", "did you mean k_dyn?"]),
    "start time": (["--start-time", "soon"], ["--start-time", "1.2x"]),
    "tolerance": (["--tolerance", "stiffness"], ["as stiffness=10%"]),
    "tolerance key": (["--tolerance", "stifness=10%"], ["--tolerance", "did you mean stiffness?"]),
    "quantile": (["--quantile", "2"], ["--quantile"]),
    "only": (["--only", "schedul"], ["--only", "'schedule', 'robust'"]),
    "seed": (["--seed", "x"], ['--seed = "x"']),
    "restarts": (["--restarts", "0"], ["--restarts"]),
    "workers": (["--workers", "0"], ["--workers"]),
    "parameter": (["--param", "tim=3"], ["did you mean", "time"]),
    "controller": (["--controller", "rmp"], ["did you mean ramp?"]),
    "controllers": (["--controller", "ramp,shaped"], ["give one controller", "once for each"]),
    "gains": (["--controller", "good.toml"], ["no tuned gains"]),
    "missing gains": (["--controller", "not.toml"], ["there is no such file"]),
    "nothing to tune": (["--controller", "direct"], ["no parameter to tune", "as --free torque=0.5x:2x."]),
    "a free one without a range": (
        ["--controller", "direct", "--free", "torque"],
        ["give one, as --free torque=0.5x:2x"],
    ),
    "ends the wrong way": (["--free", "time=3:1"], ["time = 3:1: give its lowest"]),
}


@pytest.mark.parametrize(("arguments", "says"), ONE_SENTENCE.values(), ids=ONE_SENTENCE)
def test_one_clear_sentence(arguments, says, refused):
    refused("tune", "--controller", "ramp", *GRID, *QUICK, *arguments, says=says)
