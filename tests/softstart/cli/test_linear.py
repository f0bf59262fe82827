"""`softstart linear`: tables, JSON, files, and what it refuses."""

from __future__ import annotations

import csv
import json

import pytest

from softstart import Drive, linear_view

LOOP = ("linear", "--controller", "current-limit-feedback")


def test_json_is_the_summary(as_json):
    told = as_json(*LOOP)
    view = linear_view(Drive.load("crane-4amtkf"), "current-limit-feedback")
    assert told["phase_margin"] == view.loop.margins.phase_margin
    assert told["delay_margin"] == view.loop.margins.delay_margin
    assert told["elastic_damping_ratio"] == view.elastic_mode.damping_ratio
    assert [one["name"] for one in told["variations"]] == [one.name for one in view.variations]
    assert told["kind"] == "loop"


def test_the_tables_are_shown(table):
    flat = table(*LOOP, "--set", "motor.torque_lag=2 ms", "--param", "damping_ratio=0.5")
    for words in ("phase margin", "delay margin", "elastic mode", "J2 x 2.5", "c x 0.9", "No limit cycle"):
        assert words in flat


def test_files(place, done):
    done(*LOOP, "--out", "loop")
    files = {path.name for path in (place / "loop").iterdir()}
    assert files == {"report.md", "linear.svg", "linear.png", "response.csv", "drive.toml"}
    with (place / "loop" / "response.csv").open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    # the crossings are among the frequencies: |L| passes through 1 exactly there
    at_one = [row for row in rows if abs(float(row["|L|"]) - 1.0) < 1e-9]
    assert len(at_one) == 2
    assert "phase margin" in (place / "loop" / "report.md").read_text()


def test_open_loop_is_a_sentence(place, done):
    out = done("linear", "good.toml", "--controller", "ramp", "--out", "open")
    assert "ramp acts open loop" in " ".join(out.split())
    assert {path.name for path in (place / "open").iterdir()} == {"report.md", "drive.toml"}


def test_a_controller_of_ones_own(run):
    code, out, _ = run("linear", "--controller", "own.py:Good", "--json")
    assert code == 0
    assert json.loads(out)["kind"] == "open loop"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("linear", "--controller", "rampp"), "did you mean ramp?"),
        (("linear",), "Missing option '--controller'"),
        (("linear", "list.toml", "--controller", "ramp"), "a drive has one value"),
        ((*LOOP, "--param", "dampng=1"), "no such parameter"),
        (("linear", "--param", "x", "--controller", "ramp"), "write a key"),
        (("linear", "--controller", "own.py:Raises"), "failed"),
    ],
)
def test_what_is_refused(run, nothing_left, arguments, words):
    code, out, err = run(*arguments, "--json", "--out", "never") if len(arguments) > 1 else run(*arguments)
    assert code in (2, 3)
    assert out == ""
    assert words in " ".join(err.split())
    assert "Traceback" not in err
    nothing_left()
