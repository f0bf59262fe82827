"""`softstart study paper-g`: the data behind the pictures, the table, and the numbers of the verdicts."""

from __future__ import annotations

import re

import numpy as np
import pytest

from softstart.study import Verdict
from softstart_studies.crane import CRANE
from softstart_studies.paper_g import PaperG, curves, from_flank, set_up_once
from softstart_studies.paper_g.crane import RATIOS

# figures 2, 3, 4 ---------------------------------------------------------------------------------------


def test_curves_go_through_the_simulated_points():
    drawn = curves.figures()
    assert [len(one) for one in drawn.values()] == [4, 4, 6]
    on_axis = [int(np.argmin(np.abs(RATIOS - r))) for r in curves.POINTS]
    for curve in (curve for one in drawn.values() for curve in one):
        assert curve.disagreement < 1e-9
        # exact holds the curve's own values: the points lie on the axis of the curve
        assert curve.values[on_axis] == pytest.approx(curve.exact, rel=1e-12)


def test_table_of_reference_to_all_printed_digits():
    rows = curves.worked_table().rows
    assert len(rows) == 20
    for *_, printed, form, plant, note in rows:
        assert form == pytest.approx(plant, abs=5e-7)
        if note == "all digits":
            assert f"{form:.4f}" == printed
        else:
            # the check table adds rounded durations: one digit off, and the note shows the sum
            assert re.fullmatch(r"print adds rounded terms: 0\.\d{4} \+ 0\.\d{4}", note)
            assert abs(form - float(printed)) < 1.0e-4
    assert [row[:4] for row in rows if row[-1] != "all digits"] == [
        (5, 0.5, 0.25, "t1 + t2 method 1, s"),
        (2, 0.5, 1.0, "t1 + t2 method 1, s"),
    ]


# verdicts ----------------------------------------------------------------------------------------------

VERDICTS = {  # by the beginning of the statement, with the number that decides
    "Method 1 damps": ("confirmed", "2.0386 as M1 -> 0"),
    "Method 2 can bring": ("confirmed", "M1/Ms < 0.5236"),
    "Method 2 is to be preferred": ("refuted", "first contact 1.2677, second 2.3894"),
    "(Not in [G]) Raised at the peak": ("confirmed", "1.2677 at 0.5 rad and 2.2144 at 2 rad"),
    "A wider gap": ("confirmed", "+56 %"),
    "A smaller J2": ("partly", "3.1179 to 2.7157"),
    "The least K_dyn": ("refuted", "0.856"),
    "Stage 2 lasts almost": ("partly", "6 %, 14 %, 29 %"),
    "The total time": ("confirmed", "2.8 times"),
    "Stage 1 lasts the same": ("partly", "-17.6 %"),
    "Switching by time": ("partly", "to 3.1279"),
    "Torque held reduced": ("partly", "2.3948 to 3.2654"),
    "The delay fits": ("partly", "1.9730 instead of 1.1383"),
    "Regulators acting": ("partly", "1.2564 where the direct start has 5.2106"),
    "(Not in [G]) The conclusions hold": ("partly", "1.4661"),
}


def test_each_conclusion_has_its_verdict_and_its_number():
    study = PaperG().run(None, lambda doing: None)
    for claim, (beginning, (verdict, number)) in zip(study.claims, VERDICTS.items(), strict=True):
        assert claim.statement.startswith(beginning)
        assert (claim.verdict, number in claim.evidence) == (Verdict(verdict), True), claim


def test_the_delay_fits_within_10_percent_and_breaks_before_20():
    by_load, by_shaft = set_up_once.detuned("load inertia"), set_up_once.detuned("stiffness")
    for found in (by_load, by_shaft):
        Omega = np.sqrt(found.c / CRANE.J1 + found.c / found.J2)
        assert Omega / CRANE.Omega - 1 == pytest.approx(found.x, abs=1e-12)
        assert not np.any(np.isnan(list(found.whole.values())))
    assert by_load.first["delay (15)"] == pytest.approx(by_load.promised, rel=0.02)
    over, near = by_shaft.first["delay (15)"] / by_shaft.promised, by_shaft.within(0.10)
    assert over[near] == pytest.approx(1.0, rel=0.02)
    assert np.max(over[by_shaft.within(0.20)]) > 1.5


# from the flanks ---------------------------------------------------------------------------------------


def test_the_conclusions_from_a_flank():
    """From mid-gap the figures of [G]; on the driving flank the closed forms of a drive without a gap."""
    rows = {row[0]: row[3:] for row in from_flank.table().rows}
    assert sorted(rows) == list(range(1, 15))
    middle = [rows[number][0] for number in (1, 2, 3, 4, 12)]
    assert middle == pytest.approx([2.3894, 1.2677, 2.3894, 1.2677, 3.2453], abs=5e-5)
    light, heavy = ((62.0 * r + 7.16) / (1.0 + r) for r in (2.0, 5.0))  # mean torques
    reduced = (15.5 * 5.0 + 7.16) / 6.0
    flank = {number: cells[1] for number, cells in rows.items()}
    assert (flank[1], flank[3]) == pytest.approx(
        (2.0, 2.0), rel=1e-9
    )  # a step of torque from rest in contact
    assert flank[2] == pytest.approx(2.0 * reduced / heavy, abs=5e-5)
    assert flank[4] == pytest.approx(2.0 - 2.0 * reduced / heavy, abs=5e-5)
    assert flank[5] == pytest.approx(1.0, rel=1e-9)
    assert (flank[6], flank[7]) == pytest.approx((light / heavy,) * 2, abs=5e-5)
    assert flank[8] is flank[10] is None
    assert flank[9] == 0.0
    assert from_flank.claim().verdict is Verdict.PARTLY
    assert f"lowers it to {2.0 - 7.16 / heavy:.4f}" in from_flank.claim().evidence
