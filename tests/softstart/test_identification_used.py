"""What an identification is used for: kept on disk, compared, tuned, each with its intervals."""

from __future__ import annotations

import json
import math
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.softstart.test_identification import REVERSE
from tests.softstart.test_identification import TRUTH as UNKNOWN

from softstart import (
    Drive,
    Identification,
    InputError,
    compare,
    identify,
    machine_table,
    plan_experiments,
    simulate,
    tune,
)
from softstart.identification.planning import simulated_log
from softstart.start.comparison import LEFT_POSSIBLE, intervals
from softstart.tuning.problem import scenarios_drawn, tuning_scenarios

TRUTH = UNKNOWN.replace(start_position="mid-gap")


@pytest.fixture(scope="module")
def found() -> Identification:
    log = simulated_log(TRUTH, REVERSE, log_period=4e-3, ripple=1.0, seed=3)
    return identify(log, TRUTH, searches=1)


@pytest.fixture(scope="module")
def folder(found: Identification, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("found")
    found.save(path)
    return path


def test_each_interval_has_the_truth(found: Identification) -> None:
    for one in found.shared:
        off = abs(math.log(one.value / float(getattr(TRUTH, one.name))))
        assert off < math.log(one.upper / one.lower), one.name  # twice the interval


@pytest.mark.slow
def test_a_plan_tells_the_intervals_that_a_fit_then_has(found: Identification) -> None:
    plan = plan_experiments(TRUTH, log_period="4 ms", ripple=1.0, optimise=False)
    for one in found.shared:
        assert plan[REVERSE].widths[one.name] == pytest.approx(one.half_width, rel=0.35)
    assert math.isinf(plan["start"].widths["gap"])
    assert plan["shaking"].travel < 0.1 * plan["start"].travel


# ---- drives that are left possible ----------------------------------------------------------------------


@pytest.mark.parametrize("late", [2, 3])
def test_an_interval_holds_the_value_itself_and_is_known_for_nine_of_ten_drives(late: int) -> None:
    """Of 20 drives with wider gaps, all with a larger K_dyn, some do not reach their speed by 0.5 s."""
    crane = Drive.load("crane-4amtkf")
    inertias = np.append(np.linspace(0.16, 0.2, 20 - late), np.ones(late))
    drawn, run = (
        machine_table(crane, load_inertia=inertias, gap=np.linspace(0.6, 0.8, 20)),
        simulate(crane, "direct"),
    )
    found = intervals(run, drawn, "direct", until=0.5)
    starts = [simulate(one, "direct", 0.5) for one in drawn.elements()]
    k_dyn, times = ([getattr(one, name) for one in starts] for name in ("k_dyn", "start_time"))
    assert min(k_dyn) > run.k_dyn
    assert found["k_dyn"] == (run.k_dyn, pytest.approx(np.quantile(k_dyn, 0.975), rel=1e-12))
    ends = np.nanquantile(times, [0.025, 0.975]) if late == 2 else [math.nan, math.nan]
    assert found["start_time"] == pytest.approx(tuple(ends), rel=1e-12, nan_ok=True)


def test_draws_have_the_intervals_and_the_correlations_that_are_shown(found: Identification) -> None:
    drawn = found.draws(40_000, seed=1)
    logs = []
    for one in found.shared:
        values = drawn.fields[one.name]
        ends = np.quantile(values, [0.025, 0.975])
        width = one.upper - one.lower
        assert ends == pytest.approx([one.lower, one.upper], abs=0.02 * width), one.name
        assert np.median(values) == pytest.approx(one.value, abs=0.01 * width)
        logs.append(np.log(values))
    assert np.corrcoef(logs) == pytest.approx(found.correlations[: len(logs), : len(logs)], abs=0.03)


# ---- on disk --------------------------------------------------------------------------------------------


def test_what_was_saved_is_loaded_to_the_bit(found: Identification, folder: Path) -> None:
    read = Identification.load(folder)
    for name in ("drive", "guess", "estimates", "ripple", "searches", "agreed", "notes"):
        assert getattr(read, name) == getattr(found, name), name
    assert np.array_equal(read.correlations, found.correlations)
    assert read.logs == ()
    with pytest.raises(InputError, match="loaded has none"):
        read.plot()
    assert "estimate" in read._repr_html_()


def test_a_file_that_was_changed_is_refused(folder: Path, tmp_path: Path) -> None:
    shutil.copytree(folder, tmp_path, dirs_exist_ok=True)
    kept = json.loads((folder / "identification.json").read_text(encoding="utf-8"))
    for change, sentence in (
        ({"format": 7}, "ValueError: it is not of the format"),
        ({"guess": "[motor]\ninertia = -1"}, "guess"),
    ):
        (tmp_path / "identification.json").write_text(json.dumps(kept | change), encoding="utf-8")
        with pytest.raises(InputError, match=sentence):
            Identification.load(tmp_path)


def test_the_drive_may_get_limits_and_no_other_gap(folder: Path, tmp_path: Path) -> None:
    shutil.copytree(folder, tmp_path, dirs_exist_ok=True)
    text = (tmp_path / "drive.toml").read_text(encoding="utf-8")
    (tmp_path / "drive.toml").write_text(text + '\n[limits]\nshaft_torque = "150 N*m"\n', encoding="utf-8")
    assert Identification.load(tmp_path).drive.limits.shaft_torque == 150.0
    wider = Drive.from_toml(text).replace(gap=0.1)
    (tmp_path / "drive.toml").write_text(wider.to_toml(), encoding="utf-8")
    with pytest.raises(InputError, match=r"drive.toml: shaft.gap = 0.1, but it was identified as 0.0"):
        Identification.load(tmp_path)
    assert Identification.load(folder).with_settings(["start.target_speed=60"]).drive.target_speed == 60.0
    with pytest.raises(InputError, match=r"--set shaft.gap=0.3: shaft.gap = 0.3, but it was identified as"):
        Identification.load(folder).with_settings(["shaft.gap=0.3"])


# ---- compare --------------------------------------------------------------------------------------------


def test_compare_has_the_intervals_of_single_starts(found: Identification) -> None:
    table = compare(found, ["s-curve"], worst_case=())
    drives = list(found.draws().elements())
    for row in table.rows:
        assert row.run.drive == found.drive
        runs = [simulate(one, row.run.controller_name, fitted_to=found.drive) for one in drives]
        for name in ("k_dyn", "peak_torque", "start_time"):
            each = [float(getattr(run, name)) for run in runs]
            ends = np.quantile(each, [0.025, 0.975])
            middle = float(getattr(row.run, name))
            assert row.intervals[name] == pytest.approx(
                (min(ends[0], middle), max(ends[1], middle)), rel=1e-12
            )
        assert row.summary()["k_dyn_upper"] == row.intervals["k_dyn"][1]
    for row in compare(found.drive, ["s-curve"], worst_case=()).rows:
        assert row.intervals == {}
        assert "k_dyn_upper" not in row.summary()


def test_limits_are_kept_at_the_upper_end_or_not_at_all(found: Identification) -> None:
    row = compare(found, ["direct"], worst_case=()).rows[0]
    between = 0.5 * (row.run.peak_torque + row.intervals["peak_torque"][1])
    limited = found.with_settings([f"limits.shaft_torque={between!r}"])
    known = compare(limited.drive, ["direct"], worst_case=()).rows[0]
    assert [one.kept for one in known.margins(limited.drive.limits)] == [True]
    table = compare(limited, ["direct"], worst_case=())
    (margin,) = table.rows[0].margins(limited.drive.limits)
    assert not margin.kept
    assert margin.case == LEFT_POSSIBLE
    assert margin.value == row.intervals["peak_torque"][1]
    assert LEFT_POSSIBLE in table.recommendation.text


# ---- tune -----------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_gains_are_tuned_over_the_drives_that_are_left(
    found: Identification, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("softstart.tuning.problem.DRAWN", 20)
    quick: Any = {"certified": False, "workers": 1, "schedule": False, "restarts": 1, "generations": 2}
    tuned = tune(found, "ramp", free=["time"], start_time="1.6x", **quick)
    assert len(tuned.problem.scenarios) == 21
    assert tuned.problem.cells == ((found.drive.gap, found.drive.load_inertia),)
    assert tuned.robust is not None
    # K_dyn over the mean torque of the drive found, as tolerances have it
    gains: Any = {"parameters": tuned.robust.parameters, "fitted_to": found.drive, "base": found.drive}
    runs = [simulate(one, "ramp", **gains) for one in (found.drive, *found.draws(20).elements())]
    assert max(run.k_dyn for run in runs) == pytest.approx(tuned.robust.worst, rel=1e-12)


def test_tolerances_go_with_an_identification_but_not_of_what_it_knows(found: Identification) -> None:
    drawn = found.draws(6)
    with pytest.raises(InputError, match="stiffness has an interval of its own already"):
        scenarios_drawn(found.drive, drawn, tuning_scenarios(found.drive, {"stiffness": "10 %"}))
    torques = tuning_scenarios(found.drive, {"starting_torque": [60.0, 62.0]})
    mixed = scenarios_drawn(found.drive, drawn, torques)
    levels = [one["starting_torque"].offset for one in mixed if "starting_torque" in one]
    assert sorted(levels) == [60.0, 60.0, 62.0, 62.0]  # every third drive has the torque of the file
