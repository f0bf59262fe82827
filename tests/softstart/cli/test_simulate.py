"""`softstart simulate`: one start."""

import csv
import math

import pytest

from softstart import Drive, simulate

START = ("simulate", "crane-4amtkf", "--controller", "reduced-two-stage", "--until", "0.3")


def test_json_has_summary_stages_and_events(as_json):
    told = as_json(*START, "--param", "torque=15.5")
    wanted = simulate(Drive.load("crane-4amtkf"), "reduced-two-stage", 0.3, parameters={"torque": 15.5})
    summary = wanted.summary()
    assert told.keys() == {*summary, "fitted_to", "stages", "events"}
    assert told["fitted_to"] is None
    assert told["k_dyn"] == wanted.k_dyn
    assert told["start_time"] is None
    assert math.isnan(wanted.start_time)
    assert [stage["peak_torque"] for stage in told["stages"]] == [s.peak_torque for s in wanted.stages]
    assert [(e["time"], e["kind"]) for e in told["events"]] == [(e.time, e.kind) for e in wanted.events]


def test_the_start_in_words(done):
    out = done(*START)
    for words in (
        "Crane travel drive", "under  reduced-two-stage (torque = 15.386",
        "The run ended at the time asked for",
        "peak shaft torque", "Stages", "closed, driving flank", "Events", "gap closed",
    ):  # fmt: skip
        assert words in out
    assert max(map(len, out.splitlines())) <= 100


def test_long_lists_are_cut_and_say_so(run):
    code, out, _ = run("simulate", "crane-4amtkf", "--controller", "direct", "--until", "1")
    assert code == 0
    assert "(the first 24 of " in out
    assert len(out.splitlines()) < 80


def test_the_files(place, done):
    out = done(*START, "--out", "results")
    folder = place / "results"
    assert {path.name for path in folder.iterdir()} == {
        "report.md", "drive.toml", "figures.csv", "stages.csv", "events.csv", "run-reduced-two-stage.svg",
        "run-reduced-two-stage.png", "trace-reduced-two-stage.csv",
    }  # fmt: skip
    run_ = simulate(Drive.load("crane-4amtkf"), "reduced-two-stage", 0.3)
    with (folder / "stages.csv").open(encoding="utf-8") as stream:
        stages = list(csv.DictReader(stream))
    assert [float(stage["duration s"]) for stage in stages] == [stage.duration for stage in run_.stages]
    with (folder / "events.csv").open(encoding="utf-8") as stream:
        assert len(list(csv.reader(stream))) == 1 + len(run_.events)
    report = (folder / "report.md").read_text("utf-8")
    assert "--controller reduced-two-stage --until 0.3 --out results" in report
    assert "Written to results" in out


@pytest.mark.parametrize("drive", ["servo-axis-small", "nordin-servo-60kw", "crane-4amtkf-worn"])
def test_shipped_drives_start(drive, done):
    out = done("simulate", drive, "--controller", "direct")
    assert "The load reached its target speed." in out
