"""`softstart sweep`: tables, JSON, files, and going on after an interruption."""

from __future__ import annotations

import csv
import json
import sqlite3
from contextlib import closing

import pytest
import xarray

from softstart import Drive, simulate

CRANE = Drive.load("crane-4amtkf")
SMALL = (
    "sweep", "--controller", "ramp", "--axis", "shaft.gap=0.5:2:4", "--axis", "controller.time=100 ms,0.2",
    "--workers", "1",
)  # fmt: skip


def test_json_is_the_summary(as_json):
    told = as_json(*SMALL, "--set", "load.inertia=0.1")
    assert told["starts"] == told["computed"] == 8
    assert told["axes"]["gap"] == {"count": 4, "unit": "rad", "from": 0.5, "to": 2.0}
    assert list(told["axes"]) == ["gap", "controller_time"]
    at = told["worst"]["at"]
    one = simulate(
        CRANE.replace(load_inertia=0.1, gap=at["gap"]), "ramp", parameters={"time": at["controller_time"]}
    )
    assert told["figures"]["k_dyn"]["max"] == one.k_dyn
    assert told["share_reached"] == 1.0
    assert told["status"] == {"REACHED": 8}


def test_the_tables_are_shown_and_fit(table):
    flat = table(*SMALL)
    for words in ("The grid", "controller_time", "Over all starts", "k_dyn", "Largest K_dyn", "8 starts;"):
        assert words in flat


FILES = {"sweep.zarr", "report.md", "sweep.csv", "cells.csv", "sweep.svg", "sweep.png", "drive.toml"}


def test_the_files_and_the_same_command_again(run, place, done):
    command = (*SMALL, "--out", "deep/grid", "--netcdf", "grid.nc", "--figures", "k_dyn,start_time")
    out = done(*command)
    assert out.splitlines()[-2].startswith("Written to deep/grid: ")
    folder = place / "deep" / "grid"
    assert {path.name for path in folder.iterdir()} == FILES
    assert [path.name for path in (place / "deep").iterdir()] == ["grid"]
    results = xarray.open_zarr(folder / "sweep.zarr")
    assert results.sizes == {"gap": 4, "controller_time": 2}
    with xarray.open_dataset(place / "grid.nc") as read:
        assert read.k_dyn.values.tolist() == results.k_dyn.values.tolist()
    report = (folder / "report.md").read_text("utf-8")
    assert "--controller ramp --axis shaft.gap=0.5:2:4" in report
    assert "| controller\\_time | 2 | 0.1 | 0.2 | s |" in report

    before = {path.name: path.read_bytes() for path in folder.iterdir() if path.is_file()}
    out = done(*command)
    assert "8 starts, of which 8 were finished before." in out
    assert {path.name: path.read_bytes() for path in folder.iterdir() if path.is_file()} == before

    code, out, err = run(*command, "--until", "0.1")
    assert (code, out) == (2, "")
    assert err.count("\n") == 1
    assert err.startswith("softstart: --out = deep/grid/sweep.zarr: it holds a sweep with another until;")


def test_controllers_as_an_axis(as_json):
    told = as_json(
        "sweep", "--axis", "controller=direct,ramp", "--axis", "load.kind=active,reactive", "--axis",
        "shaft.gap=0.1:4:5:log", "--workers", "1",
    )  # fmt: skip
    assert told["starts"] == 20
    assert told["axes"]["controller"]["values"] == ["direct", "ramp"]
    assert told["worst"]["at"]["controller"] == "direct"


def test_each_start_of_a_small_grid_is_told(place, done, as_json):
    command = ("sweep", "--axis", "controller=direct,ramp", "--axis", "shaft.gap=0.5,2", "--workers", "1")
    out = done(*command, "--out", "few")
    lines = [line.split() for line in out.partition("Each start")[2].splitlines()]
    with (place / "few" / "cells.csv").open(encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    assert [(row["controller"], float(row["gap [rad]"])) for row in rows] == [
        ("direct", 0.5), ("direct", 2.0), ("ramp", 0.5), ("ramp", 2.0)
    ]  # fmt: skip
    told = as_json(*command)["cells"]
    report = (place / "few" / "report.md").read_text("utf-8")
    for row, cell in zip(rows, told, strict=True):
        one = simulate(CRANE.replace(gap=float(row["gap [rad]"])), row["controller"])
        figures = (one.k_dyn, one.start_time, one.peak_torque)
        assert tuple(float(row[key]) for key in ("k_dyn", "start_time [s]", "peak_torque [N*m]")) == figures
        assert (cell["k_dyn"], cell["gap"], row["status"]) == (one.k_dyn, one.drive.gap, "REACHED")
        assert [row["controller"], f"{one.drive.gap:g}", f"{one.k_dyn:.4f}"] in [line[:3] for line in lines]
        assert f"| {row['controller']} | {one.drive.gap:g} | {one.k_dyn:.4f} |" in report


def test_a_start_that_went_wrong_stands_out_and_a_large_grid_is_not_listed(run, monkeypatch, as_json):
    few = ("sweep", "--controller", "direct", "--workers", "1", "--until", "0.36", "--axis")
    out = run(*few, "shaft.gap=0.5,1.5").out
    (late,) = [line for line in out.splitlines() if "stopped early" in line]
    assert late.split()[0] == "0.5"
    assert ["1.5", "4.3847", "reached"] in [line.split()[:3] for line in out.splitlines()]
    out = run(*few, "shaft.gap=0.5:1.5:41").out
    assert "Each start" not in out
    assert as_json(*few, "shaft.gap=0.5:1.5:41")["cells"] is None


def test_a_grid_too_large_for_a_table_writes_no_cells(monkeypatch):
    from softstart import sweep
    from softstart.sweeping.summary import summarise
    from softstart.views import sweeps

    results = sweep(CRANE, "direct", {"gap": [0.5, 1.0, 2.0]}, workers=1)
    for most, there in ((2, False), (3, True)):
        monkeypatch.setattr(sweeps, "MOST_WRITTEN", most)
        assert (sweeps.FILE in sweeps.sweep_sheet(results, summarise(results), CRANE).files) == there


LONG = (
    "sweep", "--controller", "current-limit-feedback", "--axis", "shaft.gap=0.25:4:80", "--axis",
    "load.inertia=0.07:0.35:100", "--workers", "2", "--chunk", "100", "--out", "grid",
)  # fmt: skip


def test_an_interrupted_command_says_how_to_go_on(interrupted, place, as_json):
    home = place / "grid" / "sweep.zarr"
    listed = home / "status" / "softstart.sqlite"
    err = interrupted(*LONG, begun=lambda: listed.exists() and b'{"part": [' in listed.read_bytes())
    assert "finished chunks are kept in grid/sweep.zarr; run the same command to continue." in err
    assert [path.name for path in (place / "grid").iterdir()] == ["sweep.zarr"]
    with closing(sqlite3.connect(listed)) as base:
        records = [json.loads(text) for (text,) in base.execute("SELECT record FROM parts WHERE key > ''")]
    chunks = ["/".join(map(str, one["part"])) for one in records]
    files = [home / name / "c" / chunk for chunk in chunks for name in ("k_dyn", "status")]
    done = {path: path.stat().st_mtime_ns for path in files}
    assert done
    told = as_json(*LONG)
    assert told["starts"] == 8_000
    assert 0 < told["computed"] < 8_000
    assert {path: path.stat().st_mtime_ns for path in done} == done


GAP = ("--axis", "shaft.gap=0.5,1")
ONE_SENTENCE = {
    "no axis": (("--controller", "ramp"), ["Missing option '--axis'"]),
    "no controller": (GAP, ["--controller = None: name a"]),
    "controller": ((*GAP, "--controller", "rmp"), ["--controller", "did you mean ramp?"]),
    "controller of the axis": (
        ("--axis", "controller=direct,rmp"), ["--axis controller", "did you mean ramp?"]
    ),
    "no values": (("--controller", "ramp", "--axis", "gap"), ['--axis "gap": write a key']),
    "unknown": (
        ("--controller", "ramp", "--axis", "gapp=1,2"), ["--axis gapp: there is no such axis", "gap?"]
    ),
    "unit": (("--controller", "ramp", "--axis", "gap=1 N:2:3"), ['--axis gap[0] = "1 N"']),
    "count": (("--controller", "ramp", "--axis", "gap=1:2:many"), ["--axis gap", "from 2 to 1,000,000"]),
    "ends": (("--controller", "ramp", "--axis", "gap=1:1:3"), ["both ends are the same"]),
    "log": (("--controller", "ramp", "--axis", "gap=0:1:3:log"), ["above 0"]),
    "spacing": (("--controller", "ramp", "--axis", "gap=0:1:3:lin"), ["from:to:count:log"]),
    "hole": (("--controller", "ramp", "--axis", "gap=1,,2"), ["a place in the list is empty"]),
    "range of names": (("--controller", "ramp", "--axis", "load.kind=active:reactive:2"), ["commas between"]),
    "twice": (("--controller", "ramp", *GAP, "--axis", "gap=2"), ["by its other name"]),
    "impossible": (("--controller", "ramp", "--axis", "load.torque=5, 70"), ["load_torque = 70 N*m"]),
    "param": ((*GAP, "--controller", "ramp", "--param", "tme=1"), ["tme", "did you mean"]),
    "workers": ((*GAP, "--controller", "ramp", "--workers", "two"), ['--workers = "two"']),
    "chunk": ((*GAP, "--controller", "ramp", "--chunk", "0"), ['--chunk = "0"']),
    "both": (
        (*GAP, "--controller", "ramp", "--workers", "2", "--scheduler", "tcp://x:1"), ["--workers", "one of"]
    ),
    "figures": ((*GAP, "--controller", "ramp", "--figures", "k_dym"), ["--figures", "did you mean k_dyn?"]),
    "netcdf": ((*GAP, "--controller", "ramp", "--netcdf", "no/where.nc"), ["--netcdf = no/where.nc"]),
    "too many": (
        ("--controller", "ramp", "--axis", "gap=0:1:1000000", "--axis", "damping=0:1:1000"),
        ["--axis: 1,000,000,000 starts", "--out DIR"],
    ),
    "several": (
        (*GAP, "--controller", "direct, ramp"), ["compare and sweep take several"]
    ),
    "fitted to": ((*GAP, "--controller", "ramp", "--fitted-to", "crane"), ["crane", "shipped drive"]),
}  # fmt: skip


@pytest.mark.parametrize(("arguments", "says"), ONE_SENTENCE.values(), ids=ONE_SENTENCE)
def test_one_clear_sentence(arguments, says, refused):
    refused("sweep", *arguments, says=says)
