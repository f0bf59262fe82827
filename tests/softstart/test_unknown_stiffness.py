"""A data sheet without any stiffness: both ends of what is usual, each against starts of its own."""

from __future__ import annotations

import math

import pytest

from softstart import DataSheet, Drive, compare, simulate
from softstart.drive import library
from softstart.drive.data_sheet import BAND, UnknownStiffness
from softstart.start.comparison import SOFT_END
from softstart.views.starts import both_ends, comparison_sheet

SOFT, STIFF = BAND
TROLLEY = {
    "load.machine": "trolley", "load.mass": "6.5 t", "load.diameter": "315 mm", "motor.rated_power": "3 kW",
    "motor.rated_speed": "1410 rpm", "motor.inertia": "0.0062 kg*m^2", "motor.starting_ratio": 2.2,
    "gear.ratio": 38.1, "gear.backlash": "9 arcmin", "limits.output_torque": "2.3 kN*m",
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
    stiff, soft = sheet.possible
    assert [stiff.Omega, soft.Omega] == pytest.approx([math.tau * STIFF, math.tau * SOFT], rel=1e-12)
    assert stiff.damping_ratio == pytest.approx(soft.damping_ratio, rel=1e-12)
    same = {"stiffness": stiff.stiffness, "damping": stiff.damping}
    assert soft.replace(**same) == stiff == sheet.drive
    assert f"elastic frequency {STIFF:g} Hz" in stiff.assumed
    known = DataSheet.from_settings(TROLLEY | {"gear.stiffness": 35e3})
    assert "elastic frequency" not in known.drive.assumed


@pytest.mark.parametrize("name", [name for name in library.names() if name not in OUTSIDE])
def test_shipped_drives_with_gears_lie_between_the_ends(name):
    assert SOFT <= Drive.load(name).Omega / math.tau <= STIFF


def test_each_end_is_what_its_own_starts_are(sheet, table):
    stiff, soft = sheet.possible
    for row, there in zip(table.rows, table.soft_end.rows, strict=True):
        assert row.run.k_dyn == simulate(stiff, row.name).k_dyn
        assert there.run.k_dyn == simulate(soft, row.name).k_dyn
        so_set_up = simulate(soft, row.name, fitted_to=stiff).peak_torque / stiff.mean_torque
        assert row.cases[SOFT_END].k_dyn == pytest.approx(so_set_up, rel=1e-12)


def test_limits_must_be_kept_at_both_ends(table):
    """2.3 kN m at the output: shaped keeps it at each end if it is set up for it, and not from end to end."""
    margins = {row.name: row.least_margin for row in table.rows}
    assert margins["shaped"].case == SOFT_END
    assert not margins["shaped"].kept
    assert table.recommendation.recommended is None
    said = both_ends(table)[1]
    for end, choice in ((STIFF, table.at_this_end), (SOFT, table.soft_end.recommendation)):
        row = choice.recommended
        assert all(margin.kept for margin in row.margins(choice.limits) if margin.case != SOFT_END)
        so = "" if end == STIFF else ", and set up for it"
        assert f"it is {end:g} Hz{so}: recommended {row.name} (K_dyn {row.run.k_dyn:.3f})" in said
    assert f"K\n{SOFT:g} Hz" in [column.heading for column in comparison_sheet(table).tables[0].columns]


def test_a_known_stiffness_has_no_ends(sheet):
    known = DataSheet.from_settings(TROLLEY | {"shaft.elastic_frequency": "8 Hz"})
    assert isinstance(sheet.possible, UnknownStiffness)
    assert known.possible == known.drive
    table = compare(known, ["direct"])
    assert table.soft_end is None
    assert both_ends(table) == []
    assert table.rows[0].run.k_dyn == simulate(known.drive, "direct").k_dyn
