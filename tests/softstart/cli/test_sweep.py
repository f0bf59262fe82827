"""`softstart sweep`: tables, JSON, files, and going on after an interruption."""

from __future__ import annotations

import json
import signal
import subprocess
import time

import pytest
import xarray

from softstart import Drive, simulate

CRANE = Drive.load("crane-4amtkf")
SMALL = (
    "sweep", "--controller", "ramp", "--axis", "shaft.gap=0.5:2:4", "--axis", "controller.time=100 ms,0.2",
    "--workers", "1",
)  # fmt: skip


def test_json_is_the_summary(run):
    code, out, err = run(*SMALL, "--set", "load.inertia=0.1", "--json")
    assert (code, err) == (0, "")
    told = json.loads(out, parse_constant=pytest.fail)
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


@pytest.mark.parametrize("width", ["80", "120"])
def test_the_tables_are_shown_and_fit(run, monkeypatch, width):
    monkeypatch.setenv("COLUMNS", width)
    code, out, err = run(*SMALL)
    assert (code, err) == (0, "")
    lines = out.splitlines()
    assert max(map(len, lines)) <= int(width)
    assert not any(line != line.rstrip() for line in lines)
    for words in ("The grid", "controller_time", "Over all starts", "k_dyn", "Largest K_dyn", "8 starts;"):
        assert words in out


FILES = {"sweep.zarr", "report.md", "sweep.csv", "sweep.svg", "sweep.png", "drive.toml"}


def test_the_files_and_the_same_command_again(run, place):
    command = (*SMALL, "--out", "deep/grid", "--netcdf", "grid.nc", "--figures", "k_dyn,start_time")
    code, out, err = run(*command)
    assert (code, err) == (0, "")
    assert out.splitlines()[-1].startswith("Written to deep/grid: ")
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
    code, out, err = run(*command)
    assert (code, err) == (0, "")
    assert "8 starts, of which 8 were finished before." in out
    assert {path.name: path.read_bytes() for path in folder.iterdir() if path.is_file()} == before

    code, out, err = run(*command, "--until", "0.1")
    assert (code, out) == (2, "")
    assert err.count("\n") == 1
    assert err.startswith("softstart: --out: deep/grid/sweep.zarr: it holds a sweep with another until;")


def test_controllers_as_an_axis(run):
    code, out, err = run(
        "sweep", "--axis", "controller=direct,ramp", "--axis", "load.kind=active,reactive", "--axis",
        "shaft.gap=0.1:4:5:log", "--workers", "1", "--json",
    )  # fmt: skip
    assert (code, err) == (0, "")
    told = json.loads(out)
    assert told["starts"] == 20
    assert told["axes"]["controller"]["values"] == ["direct", "ramp"]
    assert told["worst"]["at"]["controller"] == "direct"


LONG = (
    "sweep", "--controller", "current-limit-feedback", "--axis", "shaft.gap=0.25:4:80", "--axis",
    "load.inertia=0.07:0.35:100", "--workers", "2", "--chunk", "100", "--out", "grid",
)  # fmt: skip


def test_an_interrupted_command_says_how_to_go_on(command, place, run):
    process = subprocess.Popen([*command, *LONG], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    status = place / "grid" / "sweep.zarr" / "status" / "c"
    deadline = time.monotonic() + 120
    while time.monotonic() < deadline and not status.exists():
        time.sleep(0.01)
    process.send_signal(signal.SIGINT)
    out, err = process.communicate()
    assert (process.returncode, out) == (130, "")
    assert "finished chunks are kept in grid/sweep.zarr; the same command goes on." in err
    assert "Traceback" not in err
    assert [path.name for path in (place / "grid").iterdir()] == ["sweep.zarr"]
    done = {path: path.stat().st_mtime_ns for path in status.rglob("*") if path.name.isdigit()}
    code, out, err = run(*LONG, "--json")
    assert (code, err) == (0, "")
    told = json.loads(out)
    assert told["starts"] == 8_000
    assert 0 < told["computed"] < 8_000
    assert {path: path.stat().st_mtime_ns for path in done} == done


GAP = ("--axis", "shaft.gap=0.5,1")
ONE_SENTENCE = {
    "no axis": (("--controller", "ramp"), ["--axis KEY=VALUES is missing"]),
    "no controller": (GAP, ["--controller is missing"]),
    "controller": ((*GAP, "--controller", "rmp"), ["--controller", "did you mean ramp?"]),
    "controller of the axis": (
        ("--axis", "controller=direct,rmp"), ["--axis controller", "did you mean ramp?"]
    ),
    "no values": (("--controller", "ramp", "--axis", "gap"), ['--axis "gap": write a parameter']),
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
    "impossible": (("--controller", "ramp", "--axis", "load.torque=5,70"), ["load_torque = 70 N*m"]),
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
    "drive": (("crane-4amtk", *GAP, "--controller", "ramp"), ["did you mean crane-4amtkf?"]),
}  # fmt: skip


@pytest.mark.parametrize("kind", ONE_SENTENCE)
def test_one_clear_sentence(kind, run, nothing_left):
    arguments, says = ONE_SENTENCE[kind]
    code, out, err = run("sweep", *arguments)
    assert (code, out) == (2, "")
    assert err.startswith("softstart: ")
    assert err.count("\n") == 1
    for words in says:
        assert words in err
    nothing_left()


def test_all_mistakes_are_told_at_once(run, nothing_left):
    code, out, err = run(
        "sweep", "wrong.toml", "--axis", "gapp=1", "--controller", "rmp", "--workers", "0", "--until", "soon"
    )
    assert (code, out) == (2, "")
    for words in ("starting_torque", "did you mean ramp?", "--workers", "--until"):
        assert words in err
    nothing_left()
