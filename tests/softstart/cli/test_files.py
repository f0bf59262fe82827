"""What commands write: whole folders or nothing, which other commands can use, and going on after a stop."""

from __future__ import annotations

import csv
import os
import shlex
import signal
import subprocess
import time

import pytest
import xarray
from tests.kept import parts_in

from softstart import Chain, Drive, InputError, TorqueProfile, simulate, tune
from softstart.cli.running import WRITTEN
from softstart.clutch import Clutch, engage
from softstart.views.markdown import file_stem, output_folder, write_table, write_text

SIXTY = ("--set", "start.target_speed=60 rad/s")
CRANE = Drive.load("crane-4amtkf")
CRANE_60 = CRANE.replace(target_speed=60.0)
ANCHOR = ("optimize", *SIXTY, "--start-time", "0.2883042")
GRID = ("--gaps", "0.5,2", "--inertias", "2J1,5J1")
QUICK = ("--restarts", "1", "--workers", "1", "--no-optimum")
RAMP = ("tune", "--controller", "ramp", *SIXTY, *GRID, *QUICK, "--free", "time")
START = "simulate crane-4amtkf --controller reduced-two-stage --until 0.3"


def rows_of(path):
    with path.open(newline="", encoding="utf-8") as stream:
        return list(csv.DictReader(stream))


def pictures(*stems):
    return {f"{stem}.{ending}" for stem in stems for ending in ("svg", "png")}


# ---- the folder of --out -----------------------------------------------------------------------------


def fill_and_fail(target):
    with output_folder(str(target)) as folder:
        write_text(folder / "x.txt", "x")
        raise RuntimeError


@pytest.mark.parametrize("there", [True, False])
def test_a_folder_appears_whole_with_the_usual_rights_or_not_at_all(tmp_path, there):
    target = tmp_path / "a" / "b"
    (tmp_path / "usual").mkdir()
    if there:
        target.mkdir(parents=True)
    with pytest.raises(RuntimeError):
        fill_and_fail(target)
    assert list(tmp_path.rglob("*.*")) == []
    assert (tmp_path / "a").exists() == there
    with output_folder(str(target)) as folder:
        write_text(folder / "x.txt", "x")
        assert not (target / "x.txt").is_file()
    assert target.stat().st_mode == (tmp_path / "usual").stat().st_mode
    assert (target / "x.txt").read_text() == "x"
    assert sorted(os.listdir(tmp_path)) == ["a", "usual"]


def test_a_folder_where_a_file_is_to_go_is_found_before_anything_is_moved(tmp_path):
    (tmp_path / "x.txt").mkdir()
    refused = pytest.raises(InputError, match=r"x\.txt in it is a folder")
    with refused, output_folder(str(tmp_path)) as folder:
        for name in ("a.txt", "x.txt"):
            write_text(folder / name, name)
    assert os.listdir(tmp_path) == ["x.txt"]


def test_a_failure_while_putting_in_place_takes_back_new_parents(tmp_path, monkeypatch):
    def full(self, target):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("pathlib.Path.rename", full)
    with pytest.raises(InputError, match="No space left"), output_folder(str(tmp_path / "a" / "b")):
        pass
    assert os.listdir(tmp_path) == []


def test_names_of_files_a_table_and_a_link_that_leads_nowhere(tmp_path):
    assert file_stem("../../etc/passwd") == "-..-etc-passwd"
    assert file_stem("...") == "start"
    assert file_stem("a", ["a", "a-2"]) == "a-3"
    write_table(tmp_path / "t.csv", ["a", "b, c"], [[0.1, None], ["x", 2]])
    assert (tmp_path / "t.csv").read_text() == 'a,"b, c"\n0.1,\nx,2\n'
    (tmp_path / "link").symlink_to(tmp_path / "gone")
    with pytest.raises(InputError, match="leads nowhere"), output_folder(str(tmp_path / "link")):
        pass


def test_the_same_command_replaces_older_files_by_the_same_and_leaves_others(run, place, refused):
    folder = place / "results"
    folder.mkdir()
    (folder / "notes.txt").write_text("mine")
    (folder / "report.md").write_text(f"old\n\n{WRITTEN}0.1")
    written = []
    for _ in range(2):
        assert run(*START.split(), "--out", "results", "--json").code == 0
        written.append({path.name: path.read_bytes() for path in folder.iterdir()})
    assert written[0] == written[1]
    assert written[0]["notes.txt"] == b"mine"
    assert written[0]["report.md"].startswith(b"# Crane")
    assert not [name for name in os.listdir(folder) if name.startswith(".")]
    (place / "report.md").write_text("# My measurements\n")
    refused(*START.split(), "--out", ".", says=["was not written by softstart"])
    assert (place / "report.md").read_text() == "# My measurements\n"


# ---- which files, and that the report leads to them --------------------------------------------------

FILES = {
    START: {"drive.toml", "figures.csv", "stages.csv", "events.csv", "trace-reduced-two-stage.csv",
            *pictures("run-reduced-two-stage")},
    "compare good.toml --controllers direct,own.py:Good --set gap=0.6": {
        "comparison.csv", "drive.toml", "trace-direct.csv", "trace-own.csv",
        *pictures("comparison", "trade-off", "run-direct", "run-own"),
    },
    "linear --controller current-limit-feedback": {"response.csv", "drive.toml", *pictures("linear")},
    "fatigue crane-4amtkf --controllers direct,s-curve --set shaft.damping=1 --slope 5": {
        "fatigue.csv", "drive.toml", *pictures("fatigue"),
        *(f"{kind}-{name}.csv" for kind in ("spectrum", "turning-points") for name in ("direct", "s-curve")),
    },
    "sweep --controller ramp --axis shaft.gap=0.5,2 --workers 1 --netcdf grid.nc": {
        "sweep.zarr", "sweep.csv", "cells.csv", "drive.toml", *pictures("sweep"),
    },
    "reduce --set shaft[3].gap=0.02 --no-starts": None,
    "balance": {"engine.toml", "orders.csv", "residuals.csv", "torque.csv",
                *pictures("torque", "residual", "forces")},
    "clutch --law law.csv": {"clutch.toml", "events.csv", "phases.csv", "traces.csv",
                             *pictures("engagement")},
}  # fmt: skip


@pytest.mark.parametrize("line", FILES)
def test_the_files_of_a_command(line, place, done):
    (place / "law.csv").write_text("t [s],M [kgf*m]\n0,0\n1,60\n")
    out = done(*shlex.split(line), "--out", "deep/results")
    assert "Written to deep/results: report.md, figures and tables.\n" in out
    folder = place / "deep" / "results"
    assert [path.name for path in (place / "deep").iterdir()] == ["results"]
    found = {path.name for path in folder.iterdir()}
    if FILES[line] is not None:
        assert found == {"report.md", *FILES[line]}
    for path in folder.glob("*.png"):
        assert path.read_bytes().startswith(b"\x89PNG")
    report = (folder / "report.md").read_text("utf-8")
    assert {part.split(")")[0] for part in report.split("](")[1:]} <= found
    assert f"softstart {line} --out deep/results" in report.replace("'", "")
    CHECKS.get(line.split()[0], lambda folder: None)(folder)


def of_a_comparison(folder):
    drive = Drive.load(folder / "drive.toml")
    assert (drive.gap, drive.name) == (0.6, "a drive of my own")
    rows = rows_of(folder / "comparison.csv")
    assert [row["controller"] for row in rows] == ["direct", "own"]
    assert float(rows[0]["k_dyn"]) == simulate(drive, "direct").k_dyn
    head = (folder / "trace-direct.csv").read_text("utf-8").splitlines()[0]
    assert head == "t [s],phi1 [rad],phi2 [rad],w1 [rad/s],w2 [rad/s],u [N*m],T [N*m]"
    assert "| shaft.gap | gap | 0.6 |" in (folder / "report.md").read_text("utf-8")


def of_a_sweep(folder):
    with xarray.open_dataset("grid.nc") as read:
        assert read.k_dyn.values.tolist() == xarray.open_zarr(folder / "sweep.zarr").k_dyn.values.tolist()
    found = [float(row["k_dyn"]) for row in rows_of(folder / "cells.csv")]
    assert found == [simulate(CRANE.replace(gap=gap), "ramp").k_dyn for gap in (0.5, 2.0)]


def of_a_reduction(folder):
    assert Drive.load(folder / "drive.toml").gap == pytest.approx(0.1 + 0.2 + 0.4)
    assert Chain.load(folder / "chain.toml") == Chain.load("crane-4-mass", also={"shaft[3].gap": 0.02})
    assert len(rows_of(folder / "shapes.csv")) == 4


def of_a_clutch(folder):
    linear, table = engage(Clutch.load("paper-c")), engage(Clutch.load(folder / "clutch.toml"))
    assert table.slip_work == pytest.approx(linear.slip_work, rel=1e-13)


CHECKS = {
    "compare": of_a_comparison, "sweep": of_a_sweep, "reduce": of_a_reduction,
    "clutch": of_a_clutch,
}  # fmt: skip


# ---- files that other commands take ------------------------------------------------------------------


def test_a_profile_of_an_optimum_is_played_to_the_same_k_dyn(place, done, as_json):
    out = done(*ANCHOR, "--out", "best")
    assert out.endswith("Written to best: report.md, figures and tables.\n")
    folder = place / "best"
    assert {path.name for path in folder.iterdir()} == {
        "report.md", "profile.csv", "profile.toml", "profile.c", "trace-optimum.csv", "drive.toml",
        "figures.csv", *pictures("optimum"),
    }  # fmt: skip
    (row,) = rows_of(folder / "figures.csv")
    assert "double" in (folder / "profile.c").read_text("utf-8")
    for name in ("profile.csv", "profile.toml"):
        assert isinstance(TorqueProfile.load(folder / name), TorqueProfile)
        played = as_json(
            "simulate", "best/drive.toml", "--controller", "profile", "--param", f"file=best/{name}"
        )
        assert played["k_dyn"] == pytest.approx(float(row["k_dyn"]), rel=1e-9)
    compared = as_json("compare", "best/drive.toml", "--controllers", "direct,best/profile.csv")
    assert {one["controller"]: one["k_dyn"] for one in compared["strategies"]}["profile"] == played["k_dyn"]


def test_tuned_gains_play(place, as_json):
    options = {"restarts": 1, "workers": 1, "certified": False, "free": {"time": None}, "parameters": {}}
    state = place / "tuned" / "tuning.sqlite"
    found = tune(CRANE_60, "ramp", [0.5, 2.0], [0.07, 0.175], save_to=state, **options)
    assert as_json(*RAMP, "--out", "tuned")["starts"] == 0  # all of it was there
    assert {path.name for path in state.parent.iterdir()} == {
        "report.md", "schedule.toml", "schedule.csv", "robust.toml", "robust-cells.csv", "between.csv",
        "price.csv", "tuning.sqlite", "drive.toml", *pictures("gains", "metric", "robust", "price"),
    }  # fmt: skip
    cell = ("--set", "gap=2", "--set", "load.inertia=0.07")
    for file, table in (("schedule.toml", found.schedule), ("robust.toml", found.robust.cells)):
        told = as_json("simulate", "crane-4amtkf", "--controller", f"tuned/{file}", *SIXTY, *cell)
        assert told["k_dyn"] == float(table.k_dyn.sel(gap=2.0, load_inertia=0.07))
    told = as_json("compare", *SIXTY, "--controllers", "ramp,tuned/robust.toml,tuned/schedule.toml")
    names = [row["controller"] for row in told["strategies"]]
    assert names == ["ramp", "ramp (robust)", "ramp (schedule)"]


@pytest.mark.slow
def test_optimal_laws_of_a_clutch_can_be_played(as_json, place):
    (point,) = as_json("clutch", "--optimal", "--points", "1", "--out", "best")["points"]
    assert point["work_bound"] <= point["slip_work"]
    assert {"front.csv", "laws.csv", "law-1.csv", "report.md", "front.svg"} <= set(os.listdir(place / "best"))
    played = as_json("clutch", "--law", "best/law-1.csv")
    assert played["slip_work"] == pytest.approx(point["slip_work"], rel=1e-13)


# ---- a controller set up for one drive, run on another -----------------------------------------------

BELIEVED = Drive(
    motor_inertia=0.035, starting_torque=62.0, rated_speed="880 rpm", stiffness=368.465, gap=0.5,
    load_inertia=0.175, load_torque=7.16, name="a drive of my own",
)  # fmt: skip
STIFF = BELIEVED.replace(stiffness=2.0 * BELIEVED.stiffness)
FITTED = ("good.toml", "--fitted-to", "good.toml", "--set", "shaft.stiffness=736.93")


def test_a_controller_fitted_to_another_drive(place, as_json):
    told = as_json("simulate", *FITTED, "--controller", "shaped", "--out", "one")
    wrong, right = simulate(STIFF, "shaped", fitted_to=BELIEVED), simulate(STIFF, "shaped")
    assert (told["k_dyn"], told["fitted_to"]) == (wrong.k_dyn, "a drive of my own")
    assert wrong.k_dyn > 1.5 * right.k_dyn
    assert "shaft.stiffness 368.465 there, 736.93 here" in (place / "one" / "report.md").read_text("utf-8")
    assert Drive.load(place / "one" / "fitted-to.toml").stiffness == BELIEVED.stiffness
    assert Drive.load(place / "one" / "drive.toml").stiffness == STIFF.stiffness
    (row,) = as_json("compare", *FITTED, "--controllers", "shaped")["strategies"]
    worn = simulate(STIFF.replace(gap=2.0), "shaped", fitted_to=BELIEVED, base=STIFF)
    assert (row["k_dyn"], row["k_dyn_worn_gap"]) == (wrong.k_dyn, worn.k_dyn)
    axes = ("--axis", "controller=shaped,ramp", "--axis", "shaft.stiffness=200,736.93", "--workers", "1")
    for cell in as_json("sweep", "good.toml", *axes, "--fitted-to", "good.toml")["cells"]:
        there = BELIEVED.replace(stiffness=cell["stiffness"])
        assert cell["k_dyn"] == simulate(there, cell["controller"], fitted_to=BELIEVED).k_dyn


# ---- going on ----------------------------------------------------------------------------------------


def test_a_front_goes_on_where_it_was_interrupted(command, place, as_json):
    state, deadline = place / "front" / "pareto.sqlite", time.monotonic() + 300
    line = ("pareto", *SIXTY, "--start-times", "0.245:0.4:40", "--controllers", "direct", "--out", "front")
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    process = subprocess.Popen([*command, *line], start_new_session=True, **pipes)
    while time.monotonic() < deadline and len(parts_in(state)) < 2:
        time.sleep(0.005)
    os.killpg(process.pid, signal.SIGINT)  # as a terminal does it: to the workers too
    out, err = process.communicate(timeout=300)
    assert (process.returncode, out, "Traceback" in err) == (130, "", False), err
    assert "finished points are kept in front/pareto.sqlite" in err
    assert os.listdir(place / "front") == ["pareto.sqlite"]
    kept = parts_in(state)
    few = ",".join(repr(one["start_time_bound"]) for one in kept[:2])
    told = as_json("pareto", *SIXTY, "--start-times", few, "--controllers", "ramp", "--out", "front")
    seconds = {point["start_time_bound"]: point["seconds"] for point in told["points"]}
    assert seconds == {one["start_time_bound"]: one["seconds"] for one in kept[:2]}  # not computed again
    assert {"pareto.csv", "pareto.svg"} <= {path.name for path in (place / "front").iterdir()}
    assert rows_of(place / "front" / "pareto.csv")[-1]["what"] == "ramp"


# ---- reports -----------------------------------------------------------------------------------------

CHEAP = ("--controllers", "direct,ramp", "--budget", "0")


def test_a_report_is_written_and_summed_up(place, as_json):
    made = as_json("report", "good.toml", *CHEAP, "--out", "r.html", "--resolution", "time=5ms")
    page = (place / "r.html").read_text(encoding="utf-8")
    assert page.startswith("<!DOCTYPE html>")
    assert (made["recommended"], made["chosen"]) == (None, "ramp")  # the file has no limits
    assert f"{made['k_dyn']:.3f}" in page
    assert "softstart report good.toml" in page
    (time,) = [one for one in made["sheets"][0]["settings"] if one["name"] == "time"]
    assert 1e3 * time["rounded"] % 5 == 0.0
    assert not list(place.rglob("*.part"))


def test_an_interrupted_report_leaves_the_old_file(run, place, monkeypatch, refused):
    (place / "r.html").write_text("old")

    def stop(report):
        raise KeyboardInterrupt

    monkeypatch.setattr("softstart.reporting.result.Report.to_html", stop)
    code, out, err = run("report", "good.toml", *CHEAP, "--out", "r.html")
    assert (code, out) == (130, "")
    assert "interrupted" in err
    assert (place / "r.html").read_text() == "old"
    assert not list(place.rglob("*.part"))
    os.mkfifo(place / "pipe")
    refused("report", "good.toml", *CHEAP, "--out", "pipe", says=["no ordinary file"])
