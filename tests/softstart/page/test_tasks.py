"""What the page computes in the background, and what it shows of it; without processes, without a browser."""

from __future__ import annotations

import csv
import math
import re
import shlex
import xml.etree.ElementTree as ET
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.softstart.test_identification_chains import stiff_behind_the_gap

from softstart import (
    Chain,
    Drive,
    InputError,
    SimulationError,
    compare,
    fatigue,
    identify,
    optimize,
    simulate,
    tune,
)  # fmt: skip
from softstart.controller import make_controller
from softstart.identification.chains import chain_log, reduced_drive
from softstart.identification.planning import made_up_log
from softstart.optimal.result import OptimumError
from softstart.page import tasks
from softstart.page.curve_panel import StrategyPoint, against, csv_of, curve_svg
from softstart.page.downloads import command_text, file_name
from softstart.page.sentences import changed_since
from softstart.page.tasks import label_of, player_of
from softstart.page.tuning_panel import cell_table, controller_of, grid_of, tunable
from softstart.reporting import report
from softstart.views.numbers import units_of

CRANE = Drive.load("crane-4amtkf")


class Heard:
    """Takes what a work tells."""

    def __init__(self) -> None:
        self.shares: list[float | None] = []
        self.parts: list[Any] = []

    def __call__(self, share: float | None, message: str = "") -> None:
        self.shares.append(share)

    def part(self, value: Any) -> None:
        self.parts.append(value)


@pytest.mark.slow
def test_checks_are_those_of_compare_fatigue_and_optimize() -> None:
    """Each figure against the function that a reader can call: positions, margins, life, quickest start."""
    drive = CRANE.with_settings(["limits.shaft_torque=70", "shaft.damping=0.3"])
    controllers = {name: make_controller(name) for name in ("direct", "shaped", "ramp")}
    heard = Heard()
    found = tasks.checked(drive, controllers, progress=heard)  # type: ignore[arg-type]
    positions, limits, life, quickest = found.parts
    for label, *cells in positions.rows:
        unknown = simulate(drive.replace(start_position="unknown"), label)
        each = [unknown.positions[name].k_dyn for name in ("driving-flank", "mid-gap", "opposite-flank")]
        assert cells == [f"{k:.3f}" for k in (*each, unknown.k_dyn)]
    assert [float(row[-1]) for row in positions.rows] == sorted(float(row[-1]) for row in positions.rows)
    rows = {row.run.controller_name: row for row in compare(drive, list(controllers)).rows}
    assert limits.rows == [[name, rows[name].against_limits] for name in controllers]
    lives = {
        row.run.controller_name: row.relative for row in fatigue([one.run for one in rows.values()]).rows
    }
    assert [row[0] for row in life.rows] == sorted(lives, key=lambda name: -lives[name])
    best = optimize(drive, limits=True)
    assert found.quickest is not None
    assert found.quickest.end_time == best.end_time
    assert "forbids a quicker start" in quickest.sentences[0]
    shares = [share for share in heard.shares if share is not None]
    assert shares == sorted(shares)
    assert 0.0 <= shares[0] < shares[-1] <= 1.0


def test_checks_say_why_a_part_is_missing() -> None:
    chain = Chain.load("crane-4-mass")
    controllers = {name: make_controller(name) for name in ("direct", "take-up")}
    found = tasks.checked(chain, controllers, progress=Heard())  # type: ignore[arg-type]
    assert found.quickest is None
    positions, limits, life = found.parts
    run = simulate(replace(chain, position="unknown"), "take-up")
    assert positions.rows[0] == ["take-up", *(f"{one.k_dyn:.3f}" for one in (*run.positions.values(), run))]
    assert (limits.rows, life.rows) == ([], [])
    assert "permissible_torque" in limits.sentences[0]
    assert "damping is missing" in life.sentences[0]


def test_a_log_is_identified_as_the_command_does(tmp_path: Path) -> None:
    drive = CRANE.replace(load_kind="reactive", gap=0.08, damping=0.3, start_position="mid-gap")
    log = made_up_log(drive, "two levels, then reverse", log_period=4e-3, ripple=1.0)
    log.to_csv(tmp_path / "rig.csv")
    heard = Heard()
    content = (tmp_path / "rig.csv").read_bytes()
    found = tasks.identified(content, "rig.csv", drive, "demand", {}, progress=heard)  # type: ignore[arg-type]
    alone = identify(tmp_path / "rig.csv", drive, torque_is="demand")
    assert {name: getattr(found.drive, name) for name in ("gap", "stiffness", "J1", "J2")} == {
        name: getattr(alone.rounded().drive, name) for name in ("gap", "stiffness", "J1", "J2")
    }
    assert found.headings == ["parameter", "found", "from", "to"]
    assert [row[0] for row in found.rows][:2] == ["motor.inertia, kg m²", "load.inertia, kg m²"]
    assert tuple(found.notes) == alone.notes
    assert len(heard.shares) > 2
    with pytest.raises(InputError, match=r"^log = rig.csv: there are the columns a, b; none has a name"):
        tasks.identified(b"a,b\n1,2\n", "rig.csv", drive, "demand", {}, progress=heard)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="write signal=name"):
        tasks.columns_of("torque")


def test_a_log_of_a_chain_gives_the_two_masses_that_stand_for_it(tmp_path: Path) -> None:
    chain = replace(stiff_behind_the_gap(), units="deg, rpm")
    played = made_up_log(reduced_drive(chain), "two levels, then reverse", log_period=4e-3, ripple=1.0)
    chain_log(chain, played, 4096.0).to_csv(tmp_path / "rig.csv")
    content = (tmp_path / "rig.csv").read_bytes()
    found = tasks.identified(content, "rig.csv", chain, "demand", {}, progress=Heard())  # type: ignore[arg-type]
    alone = identify(tmp_path / "rig.csv", chain, torque_is="demand")
    written = alone.rounded().drive
    assert (found.drive.gap, found.drive.stiffness) == (written.gap, written.stiffness)
    assert found.drive.units == chain.units
    assert tuple(found.notes) == alone.notes
    (gap,) = [row for row in found.rows if row[0] == "shaft.gap, deg"]
    assert float(gap[1]) == pytest.approx(math.degrees(alone.drive.gap), rel=1e-3)


def test_the_gentlest_start_and_its_files(tmp_path: Path) -> None:
    found = tasks.gentlest(CRANE, "1.2x", "reached", progress=Heard())  # type: ignore[arg-type]
    best = optimize(CRANE, 1.2 * simulate(CRANE, "direct").start_time, terminal="reached")
    assert found.best.k_dyn == best.k_dyn
    assert best.bound.covers.rstrip(".") in found.bound
    assert simulate(CRANE, player_of(found.best)).k_dyn == best.k_dyn
    assert player_of(found.best).name == label_of(best) == f"optimum {best.end_time:.4g} s"
    for suffix in (".csv", ".toml"):
        path = tmp_path / f"profile{suffix}"
        path.write_text(found.files[suffix], encoding="utf-8")
        assert simulate(CRANE, "profile", parameters={"file": str(path)}).k_dyn == best.k_dyn
    with pytest.raises(SimulationError, match="no way"), tasks.no_solution_as_sentence():
        raise OptimumError("no way")
    with pytest.raises(InputError, match="start_time"):
        tasks.gentlest(CRANE, "-1", "reached", progress=Heard())  # type: ignore[arg-type]


def test_the_curve_comes_in_parts_and_holds_the_strategies(monkeypatch: pytest.MonkeyPatch) -> None:
    usual = [0.36, 0.4, 0.5]
    monkeypatch.setattr("softstart.optimal.front.default_start_times", lambda drive, terminal: usual)
    runs = {name: simulate(CRANE, name) for name in ("current-limit-feedback", "ramp")}
    heard = Heard()
    points = tasks.curve(CRANE, [run.start_time for run in runs.values()], progress=heard)  # type: ignore[arg-type]
    assert {p.start_time_bound for p in heard.parts} == {p.start_time_bound for p in points} >= {*usual}
    times = [p.start_time_bound for p in points]
    assert times == sorted(times)
    least = [p.k_dyn for p in points if p.k_dyn is not None]
    assert least == sorted(least, reverse=True)  # more time never costs torque
    shares = [share for share in heard.shares if share is not None]
    assert shares == sorted(shares)
    assert 0.0 <= shares[0] <= shares[-1] <= 1.0

    marks = [StrategyPoint(name, run.start_time, run.k_dyn) for name, run in runs.items()]
    rows = against(points, marks)
    assert [row[0] for row in rows] == ["current-limit-feedback", "ramp"]
    for row in rows:
        run = runs[row[0]]
        assert row[4] == f"{run.k_dyn / optimize(CRANE, run.start_time, terminal='reached').k_dyn:.3f}"
    table = list(csv.DictReader(csv_of(points).splitlines()))
    assert [float(line["k_dyn"]) for line in table] == least

    drawn = ET.fromstring(
        curve_svg(points, [*marks, StrategyPoint("<b>&", 0.5, 2.0), StrategyPoint("never", math.nan, 1.0)])
    )
    names = [e.text for e in drawn.iter("text") if e.get("class") == "curve-name"]
    assert sorted(str(name) for name in names) == ["<b>&", "current-limit-feedback", "ramp"]
    assert sum(e.get("class") == "curve-point" for e in drawn.iter("circle")) == len(points)
    assert curve_svg([], []) == ""


def test_in_a_crowd_of_strategies_no_name_stands_on_another() -> None:
    marks = [
        StrategyPoint(f"optimum {0.60 + 0.002 * k:.3f} s", 0.60 + 0.002 * k, 0.7 - 0.001 * k)
        for k in range(40)
    ]
    drawn = ET.fromstring(curve_svg([], marks))
    assert sum(e.get("class") == "curve-mark" for e in drawn.iter("rect")) == 40
    places = [
        (float(e.get("x", "")), float(e.get("y", "")), 5.0 * len(e.text or ""))
        for e in drawn.iter("text")
        if e.get("class") == "curve-name"
    ]
    assert len(places) > 10
    for k, (x, y, wide) in enumerate(places):
        assert not any(abs(y - v) < 11.4 and x < u + w and u < x + wide for u, v, w in places[k + 1 :])


@pytest.mark.parametrize(
    "machine",
    [CRANE, pytest.param(Chain.load("crane-4-mass"), marks=pytest.mark.slow)],
    ids=["drive", "chain"],
)
def test_tuned_gains_come_as_files(machine: Drive | Chain) -> None:
    heard = Heard()
    grid = grid_of(machine, "1x", "1x")
    found = tasks.tuning(machine, "reduced-first-stage", *grid, certified=False, restarts=1, progress=heard)  # type: ignore[arg-type]
    same = tune(machine, "reduced-first-stage", *grid, certified=False, restarts=1, workers=1)
    assert same.robust is not None
    assert found.summary["robust"]["gains"] == same.robust.gains
    for file, controller in (("robust.toml", same.robust.controller), ("schedule.csv", same.scheduled)):
        assert (
            simulate(machine, controller_of(found.files[file], file)).k_dyn
            == simulate(machine, controller).k_dyn
        )
    shares = [share for share in heard.shares if share is not None]
    assert shares == sorted(shares)
    assert "reduced-first-stage" in tunable()
    assert "by cell" in cell_table(found, units_of(machine))


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


def test_units_of_the_user_are_kept_in_the_file_the_command_and_the_report() -> None:
    changed = CRANE.replace(gap="10 deg", units="deg, rpm")
    assert 'units = "deg, rpm"' in changed.to_toml()
    assert 'gap = "10 deg"' in changed.to_toml()
    assert Drive.from_toml(changed.to_toml()) == changed
    words = shlex.split(command_text(changed, {}))
    assert {"units=deg, rpm", "shaft.gap=10deg"} <= set(words)
    text = re.sub(r"<[^>]+>|\s", " ", report(changed, controllers=["direct"], budget=0.0).to_html())
    assert "gap 10.00 deg" in text
    assert not re.search(r"[\d.]{14,}", text.replace(changed.to_toml(), ""))


def test_drift_names_what_was_and_what_is_another_drive() -> None:
    assert changed_since(CRANE, CRANE.replace(gap=CRANE.gap)) == ""
    assert changed_since(CRANE, CRANE.replace(starting_torque=60.0)).startswith(
        "For motor.starting_torque 62 N m;"
    )
    other = Drive.load("servo-axis-small")
    assert changed_since(CRANE, other) == f"For {CRANE.name}; another drive is loaded now."
