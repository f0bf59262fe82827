"""What the page computes in the background, and what it shows of it; without processes, without a browser."""

from __future__ import annotations

import csv
import html
import pickle
import re
import shlex
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from softstart import (
    Chain,
    Drive,
    InputError,
    Log,
    SimulationError,
    compare,
    fatigue,
    identify,
    optimize,
    simulate,
    tune,
)  # fmt: skip
from softstart.controller import make_controller
from softstart.controller.finding import named
from softstart.identification.planning import simulated_log
from softstart.page import tasks
from softstart.page.downloads import command_text, file_name
from softstart.page.panels import grid_of, tunable_controllers
from softstart.page.sentences import changed_since, page_sentence
from softstart.project import Project

CRANE = Drive.load("crane-4amtkf")


def test_the_values_of_a_parameter_sheet_can_be_added() -> None:
    """Set for the limits and rounded: started again they have the K_dyn of the sheet, and keep the limit."""
    drive = CRANE.replace(permissible_torque=75.0)
    ramp = make_controller("speed-ramp")
    made = tasks.sheet_task(drive, ramp, "ramp.txt", progress=lambda *_: None)
    ((label, added),) = made.controllers.items()
    run = simulate(drive, added)
    assert label == "speed-ramp, sheet"
    worn = drive.scaled(gaps=4.0)
    as_it_is, as_added = (simulate(worn, one, fitted_to=drive).peak_torque for one in (ramp, added))
    assert as_added < 75.0 < as_it_is
    assert f"values of the sheet {run.k_dyn:.4f}" in " ".join(made.copy.split())
    again = tasks.sheet_task(drive, named(added, label), "ramp.txt", progress=lambda *_: None)
    assert list(again.controllers) == [label]
    assert tasks.sheet_task(drive, make_controller("direct"), "d.txt", progress=lambda *_: None).controllers


class Heard:
    """Takes what a work tells."""

    def __init__(self) -> None:
        self.shares: list[float | None] = []
        self.parts: list[Any] = []

    def __call__(self, share: float | None, message: str = "") -> None:
        self.shares.append(share)

    def part(self, value: Any) -> None:
        self.parts.append(value)


def done(task: Any, *args: Any, **keywords: Any) -> tuple[tasks.TaskResult, str, list[float]]:
    """The answer of a task that came through a pipe, its text without tags, and the shares that it told."""
    heard = Heard()
    found = pickle.loads(pickle.dumps(task(*args, progress=heard, **keywords)))
    shares = [share for share in heard.shares if share is not None]
    assert shares == sorted(shares)
    assert all(0.0 <= share <= 1.0 for share in shares)
    written = re.sub(r"<svg.*?</svg>", "", found.html, flags=re.S)
    assert not re.search(
        r"(?<![\w-])--[a-z]|softstart (?!exports)[a-z]|\[limits\]|\b(?!K_dyn)[a-z]+_[a-z]+\b(?!\.)", written
    )
    return found, html.unescape(re.sub(r"<[^>]+>", " ", written)), shares


def profile_of_file(found: tasks.TaskResult, suffix: str, folder: Path) -> Any:
    (name,) = [name for name in found.files if name.endswith(suffix)]
    (folder / name).write_text(found.files[name], encoding="utf-8")
    return make_controller("profile", {"file": str(folder / name)})


@pytest.mark.slow
def test_checks_are_those_of_compare_fatigue_and_optimize(tmp_path: Path) -> None:
    """Each figure against the function that a reader can call: positions, margins, life, quickest start."""
    drive = CRANE.with_settings(["limits.shaft_torque=70", "shaft.damping=0.3"])
    controllers = {name: make_controller(name) for name in ("direct", "shaped", "ramp")}
    found, text, _ = done(tasks.checked, drive, controllers)
    for label in controllers:
        unknown = simulate(drive.replace(start_position="unknown"), label)
        each = [unknown.positions[name].k_dyn for name in ("driving-flank", "mid-gap", "opposite-flank")]
        assert " ".join([label, *(f"{k:.3f}" for k in (*each, unknown.k_dyn))]) in " ".join(text.split())
    rows = compare(drive, list(controllers)).rows
    assert all(row.against_limits in text for row in rows)
    # what the tab promises comes first, and the table that the page has already does not come again
    promised = ("K_dyn by start position", "Margins to the limits", "life of the shaft line")
    places = [text.index(title) for title in promised]
    assert places == sorted(places)
    assert places[0] < 20
    assert "strategies compared" not in text
    lives = fatigue([row.run for row in rows])
    assert f"{float(f'{lives.ranked[0].relative:.3g}'):g}" in text  # three digits are shown
    best = optimize(drive, limits=True)
    set_for = [f"{row.name}, set" for row in rows if row.setting]
    assert list(found.controllers) == [*set_for, f"quickest {best.end_time:.4g} s"]
    assert simulate(drive, profile_of_file(found, ".csv", tmp_path)).k_dyn == best.k_dyn


def test_checks_add_what_compare_sets_for_the_limits(monkeypatch: pytest.MonkeyPatch) -> None:
    """One answer of page and command line: what compare recommends can be had here, and set again."""

    def no_optimum(*_: object, **__: object) -> None:
        raise SimulationError("It is not asked for here.")

    monkeypatch.setattr("softstart.optimal.optimize.optimize", no_optimum)
    drive, label = CRANE.replace(permissible_torque=75.0), "speed-ramp, set"
    (row,) = compare(drive, ["speed-ramp"]).rows
    assert row.setting
    for name in ("speed-ramp", label):
        found, *_ = done(tasks.checked, drive, {name: make_controller("speed-ramp")})
        run = simulate(drive, found.controllers[label])
        assert run.peak_torque == row.run.peak_torque <= 75.0
    assert run.peak_torque < simulate(drive, "speed-ramp").peak_torque


def test_checks_say_why_a_part_is_missing() -> None:
    chain = Chain.load("crane-4-mass")
    found, text, _ = done(
        tasks.checked, chain, {name: make_controller(name) for name in ("direct", "take-up")}
    )
    run = simulate(replace(chain, position="unknown"), "take-up")
    assert " ".join(["take-up", *(f"{one.k_dyn:.3f}" for one in (*run.positions.values(), run))]) in " ".join(
        text.split()
    )
    assert "damping is missing" in text
    assert (dict(found.controllers), dict(found.files)) == ({}, {})


@pytest.mark.slow
def test_a_log_is_identified_as_the_command_does(tmp_path: Path) -> None:
    drive = CRANE.replace(load_kind="reactive", gap=0.08, damping=0.3, start_position="mid-gap")
    log = simulated_log(drive, "two levels, then reverse", log_period=4e-3, ripple=1.0)
    log.to_csv(tmp_path / "rig.csv")
    content = (tmp_path / "rig.csv").read_bytes()
    found, text, _ = done(tasks.identified, content, "rig.csv", drive, "demand", {})
    alone = identify(Log.load(tmp_path / "rig.csv", torque_is="demand"), drive)
    assert found.drive == alone.drive
    assert Drive.from_toml(found.files["identified-drive.toml"]).gap == found.drive.gap
    assert all(page_sentence(note) in text for note in alone.notes)


def test_columns_of_a_log_are_named() -> None:
    with pytest.raises(InputError, match=r"^log = rig.csv: there are the columns a, b; none is called time"):
        done(tasks.identified, b"a,b\n1,2\n", "rig.csv", CRANE, "demand", {})
    with pytest.raises(InputError, match="write signal=name"):
        tasks.columns_of("torque")


def test_the_gentlest_start_and_its_files(tmp_path: Path) -> None:
    found, text, _ = done(tasks.optimum_task, CRANE, "1.2x", "reached")
    best = optimize(CRANE, 1.2 * simulate(CRANE, "direct").start_time, terminal="reached")
    assert f"{best.k_dyn:.6f}" in text
    assert f"{best.bound.k_dyn:.6f}" in text
    ((label, player),) = found.controllers.items()
    assert label == player.name == f"optimum {best.end_time:.4g} s"
    assert simulate(CRANE, player).k_dyn == best.k_dyn
    for suffix in (".csv", ".toml"):
        assert simulate(CRANE, profile_of_file(found, suffix, tmp_path)).k_dyn == best.k_dyn
    assert any("double torque_profile(double time)" in one for one in found.files.values())
    with pytest.raises(SimulationError, match="No torque brings"):
        done(tasks.optimum_task, CRANE, "0.1", "reached")
    with pytest.raises(InputError, match="start_time"):
        done(tasks.optimum_task, CRANE, "-1", "reached")


def test_the_limit_holds_the_strategies(monkeypatch: pytest.MonkeyPatch) -> None:
    usual = [0.36, 0.4, 0.5]
    monkeypatch.setattr("softstart.optimal.front._usual_times", lambda path, drive: usual)
    runs = {name: simulate(CRANE, name) for name in ("current-limit-feedback", "ramp")}
    found, text, shares = done(tasks.curve, CRANE, [make_controller(name) for name in runs], "reached")
    (table,) = found.files.values()
    lines = list(csv.DictReader(table.splitlines()))
    assert {*usual} <= {float(line["start_time_bound"]) for line in lines if line["start_time_bound"]}
    assert len(shares) >= len(usual)
    for name, run in runs.items():
        ratio = run.k_dyn / optimize(CRANE, run.start_time, terminal="reached").k_dyn
        assert re.search(rf"{name}\s+{run.k_dyn:.4f}.*?{ratio:.3f}", text, re.S)


def test_tuned_gains_come_as_files_and_as_controllers(tmp_path: Path) -> None:
    name, grid = "reduced-first-stage", grid_of(CRANE, "1x", "1x")
    found, _, _ = done(tasks.tuning, CRANE, name, *grid, certified=False, restarts=1)
    same = tune(CRANE, name, *grid, certified=False, restarts=1, workers=1)
    assert same.robust is not None
    for what, controller in (("robust", same.robust.controller), ("schedule", same.scheduled)):
        expected = simulate(CRANE, controller).k_dyn
        assert simulate(CRANE, found.controllers[f"{name} ({what})"]).k_dyn == expected
        path = tmp_path / f"{name}-{what}.toml"
        path.write_text(found.files[path.name], encoding="utf-8")
        assert simulate(CRANE, make_controller(str(path))).k_dyn == expected
    assert name in tunable_controllers()


@given(st.text(max_size=80), st.sampled_from([".csv", ".toml", ".c", ".html"]))
def test_file_names_are_safe_whatever_a_drive_is_called(text: str, suffix: str) -> None:
    name = file_name(text, suffix=suffix)
    stem = name.removesuffix(suffix)
    assert stem
    assert set(stem) <= set("abcdefghijklmnopqrstuvwxyz0123456789-.")
    assert not stem.startswith((".", "-"))
    assert not stem.endswith((".", "-"))
    assert ".." not in name
    assert Path(name).name == name
    assert len(name) <= 70


def test_the_command_line_starts_the_same_drive() -> None:
    changed = CRANE.replace(gap=0.7, load_kind="reactive", target_speed=60.0)
    words = shlex.split(command_text(changed, {"ramp": make_controller("ramp")}))
    assert words[:3] == ["softstart", "compare", "crane-4amtkf"]
    settings = [after for word, after in pairwise(words) if word == "--set"]
    assert Drive.load(words[2]).with_settings(settings) == changed
    assert words[-2:] == ["--controllers", "ramp"]
    own = CRANE.replace(name="My own; rm -rf")
    assert shlex.split(command_text(own, {}))[2] == "my-own-rm-rf.toml"


def test_drift_names_what_was_and_what_is_another_drive() -> None:
    assert changed_since(CRANE, CRANE.replace(gap=CRANE.gap)) == ""
    assert changed_since(CRANE, CRANE.replace(starting_torque=60.0)).startswith(
        "For motor starting torque 62 N m;"
    )
    other = Drive.load("servo-axis-small")
    assert changed_since(CRANE, other) == f"For {CRANE.name}; another drive is loaded now."


def test_the_report_has_customer_and_another_machine(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SOFTSTART_BUDGET", "0.001")
    project, other = (
        Project(customer="Harbour & Co", decimal="comma"),
        CRANE.replace(name="the worn one", gap=1.0),
    )
    ramp = make_controller("ramp")
    found, _, _ = done(tasks.report_task, CRANE, [ramp], "softstart report", "r.html", project, other)
    page = str(found.files["r.html"])
    assert "Harbour &amp; Co" in page
    assert "B is the worn one" in page
    assert f"{simulate(other, ramp).k_dyn:.3f}".replace(".", ",") in page
    monkeypatch.setenv("SOFTSTART_CHROMIUM", "no-such-browser")
    with pytest.raises(InputError) as refused:
        done(tasks.report_task, CRANE, [ramp], "softstart report", "r.pdf", project, None)
    (sentence,) = refused.value.sentences
    assert page_sentence(sentence).endswith("Save the report as HTML, and print that file in your browser.")
