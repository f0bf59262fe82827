"""A data sheet without any stiffness: both ends of what is usual, each against starts of its own."""

from __future__ import annotations

import math

import numpy as np
import pytest

from softstart import DataSheet, Drive, InputError, compare, simulate, tune
from softstart.controller import make_controller
from softstart.drive import library
from softstart.drive.data_sheet_words import BAND
from softstart.project import Project
from softstart.reporting import report
from softstart.start.comparison import SOFT_END
from softstart.views.starts import both_ends, comparison_sheet
from softstart.views.tuning import conclusions

SOFT, STIFF = BAND
TROLLEY = {
    "load.machine": "trolley", "load.mass": "6.5 t", "load.diameter": "315 mm", "motor.rated_power": "3 kW",
    "motor.rated_speed": "1410 rpm", "motor.inertia": "0.0062 kg*m^2", "motor.starting_ratio": 2.2,
    "gear.ratio": 38.1, "gear.backlash": "9 arcmin", "limits.output_torque": "2.185 kN*m",
}  # fmt: skip
NAMES = ["direct", "ramp", "shaped"]
OUTSIDE = {"hoist-15kw": "a hoist without its rope", "servo-axis-small": "no gear train of this kind"}


@pytest.fixture(scope="module")
def sheet() -> DataSheet:
    return DataSheet.from_settings(TROLLEY)


@pytest.fixture(scope="module")
def table(sheet):
    return compare(sheet, NAMES)


def test_the_ends_have_these_frequencies_and_nothing_else_differs(sheet):
    stiff, soft = sheet.drive, sheet.drive.soft
    assert [stiff.Omega, soft.Omega] == pytest.approx([math.tau * STIFF, math.tau * SOFT], rel=1e-12)
    assert stiff.damping_ratio == pytest.approx(soft.damping_ratio, rel=1e-12)
    same = {"stiffness": stiff.stiffness, "damping": stiff.damping}
    assert soft.replace(**same) == stiff.replace(soft_stiffness=None)
    assert f"elastic frequency {STIFF:g} Hz" in stiff.assumed
    known = DataSheet.from_settings(TROLLEY | {"gear.stiffness": 35e3})
    assert "elastic frequency" not in known.drive.assumed


@pytest.mark.parametrize("name", [name for name in library.names() if name not in OUTSIDE])
def test_shipped_drives_with_gears_lie_between_the_ends(name):
    assert SOFT <= Drive.load(name).Omega / math.tau <= STIFF


def test_each_end_is_what_its_own_starts_are(sheet, table):
    stiff, soft = sheet.drive, sheet.drive.soft
    for row, there in zip(table.rows, table.soft_end.rows, strict=True):
        assert row.run.k_dyn == simulate(stiff, make_controller(row.name, row.setting)).k_dyn
        assert there.run.k_dyn == simulate(soft, make_controller(row.name, there.setting)).k_dyn
        so_set_up = simulate(soft, row.controller, fitted_to=stiff).peak_torque / stiff.mean_torque
        assert row.cases[SOFT_END].k_dyn == pytest.approx(so_set_up, rel=1e-12)


def test_limits_must_be_kept_at_both_ends(sheet, table):
    """2.185 kN m at the output: shaped keeps it at each end if it is set up for it, and not from end to end.

    A ramp does, as it is set for both.
    """
    margins = {row.name: row.least_margin for row in table.rows}
    assert margins["shaped"].case == SOFT_END
    assert not margins["shaped"].kept
    ramp = table.recommendation.recommended
    assert (ramp.name, bool(ramp.setting)) == ("ramp", True)
    for end in (sheet.drive, sheet.drive.soft):
        peak = simulate(end, make_controller("ramp", ramp.setting), fitted_to=sheet.drive).peak_torque
        assert peak <= sheet.drive.limits.shaft_torque
    said = both_ends(table)[1]
    assert f"For both ends: recommended ramp (K_dyn {ramp.run.k_dyn:.3f})" in said
    choices = (table.recommendation, table.at_this_end, table.soft_end.recommendation)
    same = len({choice.recommended.name for choice in choices}) == 1
    assert f"The choice {'is the same in all cases' if same else 'depends on the stiffness'}" in said
    for end, choice in ((STIFF, table.at_this_end), (SOFT, table.soft_end.recommendation)):
        row = choice.recommended
        assert all(margin.kept for margin in row.margins(choice.limits) if margin.case != SOFT_END)
        so = "" if end == STIFF else ", and set up for it"
        assert f"at {end:g} Hz{so}: recommended {row.name} (K_dyn {row.run.k_dyn:.3f})" in said
    assert "K\nsoft" in [column.heading for column in comparison_sheet(table).tables[0].columns]


def test_a_known_stiffness_has_no_ends(sheet):
    known = DataSheet.from_settings(TROLLEY | {"shaft.elastic_frequency": "8 Hz"})
    assert (known.drive.soft, known.drive.soft_stiffness) == (None, None)
    table = compare(known, ["direct"])
    assert table.soft_end is None
    assert both_ends(table) == []
    assert table.rows[0].run.k_dyn == simulate(known.drive, "direct").k_dyn


def test_a_drive_file_keeps_both_ends(sheet, table, tmp_path):
    """Written, read by any name, and in a project: the figures are the same to the digits of the file."""
    (tmp_path / "mine.toml").write_text(sheet.drive.to_toml())
    again = compare(tmp_path / "mine.toml", NAMES)
    for row, other in ((table, again), (table.soft_end, again.soft_end)):
        assert [one.run.k_dyn for one in row.rows] == [one.run.k_dyn for one in other.rows]
    assert again.recommendation.text == table.recommendation.text
    (tmp_path / "short.toml").write_text(sheet.drive_toml())  # five digits
    drive = Drive.load(tmp_path / "short.toml")
    assert drive.soft.stiffness == pytest.approx(sheet.drive.soft.stiffness, rel=5e-5)
    project = Project.new(drive.replace(name="trolley"))
    assert Project.read(project.to_toml()).single() == drive.replace(name="trolley")


def test_a_stiffness_that_is_set_has_no_soft_end(sheet):
    drive = sheet.drive
    for known in (drive.replace(stiffness=40.0), drive.with_settings(["shaft.stiffness=40"])):
        assert (known.stiffness, known.soft) == (40.0, None)
        assert "soft_stiffness" not in known.to_toml()
    both = drive.with_settings(["stiffness=40", "shaft.soft_stiffness=10"])
    assert (both.stiffness, both.soft.stiffness) == (40.0, 10.0)
    with pytest.raises(InputError, match="the soft end must be below stiffness = 40 N"):
        both.replace(soft_stiffness=40.0)


SEARCH = {"certified": False, "workers": 1, "restarts": 1, "generations": 10, "population": 10}


def test_gains_are_tuned_for_both_ends(sheet):
    """Each candidate counts by its worse end: no ramp of a scan in time at both is better by 1 %."""
    stiff, soft = sheet.drive, sheet.drive.soft

    def started(values, **refer):
        values = {"parameters": values, "fitted_to": stiff}
        return [simulate(end, "ramp", **values, **refer) for end in (stiff, soft)]

    tuned = tune(sheet, "ramp", ["1x"], ["1x"], free=["time"], start_time="1.3x", schedule=False, **SEARCH)
    k_dyn = [run.k_dyn for run in started(tuned.robust.parameters, base=stiff)]
    assert tuned.robust.ends == pytest.approx(k_dyn, rel=1e-12)
    assert tuned.robust.worst == max(tuned.robust.ends)
    allowed = [1.3 * simulate(end, "direct").start_time for end in (stiff, soft)]
    best = math.inf
    for time in [tuned.robust.gains["time"], *np.linspace(0.1, 0.4, 25)]:
        runs = started({"time": time}, base=stiff)
        if all(run.start_time <= most for run, most in zip(runs, allowed, strict=True)):
            best = min(best, max(run.k_dyn for run in runs))
    assert tuned.robust.worst < 1.01 * best
    assert k_dyn[0] < k_dyn[1]
    assert "The soft end is critical" in " ".join(conclusions(tuned))


def test_tolerances_count_at_either_end(sheet):
    stiff = sheet.drive
    asked = {"free": ["time"], "schedule": False, **SEARCH, "generations": 1}
    tuning = tune(sheet, "ramp", ["1x"], ["1x"], tolerances={"load_torque": [1.0, 2.0]}, **asked)
    met = [stiff.replace(**{name: level.of(getattr(stiff, name)) for name, level in one.items()})
           for one in tuning.problem.scenarios]  # fmt: skip
    frequencies = [one.Omega / math.tau for one in met]
    assert frequencies == pytest.approx([STIFF] * 3 + [SOFT] * 3, rel=1e-12)
    assert [one.damping_ratio for one in met] == pytest.approx([stiff.damping_ratio] * 6, rel=1e-12)
    assert [one.load_torque for one in met] == pytest.approx([stiff.load_torque, 1.0, 2.0] * 2, rel=1e-15)
    with pytest.raises(InputError, match="stiffness has an interval of its own already"):
        tune(sheet, "ramp", tolerances={"stiffness": "10 %"}, **asked)


def test_rounded_values_keep_the_limit_at_the_soft_end():
    """A ramp in 135 ms keeps 2.61 kN m in every case; in 120 ms, the nearest step, not at the soft end."""
    sheet = DataSheet.from_settings(TROLLEY | {"limits.output_torque": "2.61 kN*m"})
    stiff, known = sheet.drive, sheet.drive.replace(soft_stiffness=None)

    def broken(time):
        ramp = make_controller("ramp", {"time": time})
        (margin,) = compare(sheet, [ramp], fitted_to=stiff).rows[0].margins(stiff.limits)
        (at_stiff,) = compare(known, [ramp]).rows[0].margins(stiff.limits)
        return not margin.kept, not at_stiff.kept

    assert [broken(time) for time in (0.135, 0.12, 0.18)] == [(False, False), (True, False), (False, False)]
    ramp = {"parameters": {"ramp": {"time": 0.135}}, "resolution": "time=60ms", "budget": 0.0}
    (rounded,) = report(sheet, controllers=["ramp"], **ramp).sheets
    assert (rounded.name, rounded.moved, rounded.value("time")) == ("ramp", ("time",), pytest.approx(0.18))
    (rounded,) = report(known, controllers=["ramp"], **ramp).sheets  # if it is known to be stiff
    assert (rounded.moved, rounded.value("time")) == ((), pytest.approx(0.12))
