"""Wear: the line through dated gaps, and when it reaches a limit."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from datetime import date
from pathlib import Path

import numpy as np
import pytest
from tests.softstart.test_identification import TRUTH as UNKNOWN

from softstart import Identification, InputError, follow_wear, identify
from softstart.identification.planning import simulated_log
from softstart.identification.wear import Line

TRUTH = UNKNOWN.replace(start_position="mid-gap")


@pytest.fixture(scope="module")
def new() -> Identification:
    log = simulated_log(TRUTH, "two levels, then reverse", log_period=4e-3, ripple=1.0, seed=3)
    return identify(log, TRUTH, searches=1)


DATES = ["2025-07-01", "2026-07-01"]


def with_value(found: Identification, name: str, value: float, half: float) -> Identification:
    """The same identification with another value of a parameter, and a symmetric interval."""
    estimates = tuple(
        replace(one, value=value, lower=value - half, upper=value + half) if one.name == name else one
        for one in found.estimates
    )
    return replace(found, drive=found.drive.replace(**{name: value}), estimates=estimates)


# ---- the line -------------------------------------------------------------------------------------------


def test_the_line_is_that_of_weighted_least_squares() -> None:
    t, s = np.array([0.0, 0.7, 1.5, 3.0]), np.array([1e-3, 3e-3, 1e-3, 2e-3])
    y = 0.08 + 0.004 * t + np.array([4e-4, -1e-3, -3e-4, 5e-4])
    line = Line.through(t, y, s)
    (slope, start), covariance = np.polyfit(t, y, 1, w=1.0 / s, cov="unscaled")
    assert (line.start, line.slope) == pytest.approx((start, slope), rel=1e-12)
    assert line.covariance == pytest.approx(covariance[::-1, ::-1], rel=1e-10)
    assert 0.5 < line.chance < 1.0
    scattered = Line.through(t, y + 10.0 * (y - 0.08 - 0.004 * t), s)
    assert scattered.chance < 0.01
    assert np.all(np.diag(scattered.covariance) > 5.0 * np.diag(covariance)[::-1])


def test_the_interval_of_three_gaps_that_scatter_is_that_of_student() -> None:
    """By hand: b is the second difference; its squares are b^2/6, and t of 95 % and one degree is 12.706."""
    b = 0.006
    line = Line.through(np.arange(3.0), np.array([0.08, 0.09, 0.1 + b]), np.full(3, 1e-3))
    growth, lower, upper = line.growth
    assert growth == pytest.approx(0.01 + b / 2, rel=1e-12)
    assert [upper - growth, growth - lower] == pytest.approx([12.7062 * b / math.sqrt(12.0)] * 2, rel=1e-5)
    assert line.chance == pytest.approx(math.erfc(b / 1e-3 / math.sqrt(12.0)), rel=1e-9)


@pytest.mark.parametrize("slope", [0.004, 0.0015])
def test_intervals_hold_growth_and_date_in_95_of_100_lives(slope: float) -> None:
    generator, t, s = np.random.default_rng(2), np.array([0.0, 1.0, 2.5]), np.array([1e-3, 1.5e-3, 1e-3])
    truth = (0.12 - 0.08) / slope
    growth = when = 0
    for _ in range(2000):
        line = Line.through(t, 0.08 + slope * t + s * generator.standard_normal(3), s)
        _, lower, upper = line.growth
        growth += lower <= slope <= upper
        _, earliest, latest = line.reaches(0.12)
        when += earliest <= truth <= latest
    assert 0.945 < growth / 2000 < 0.98
    assert 0.945 < when / 2000 < 0.98


def test_growth_that_may_be_none_has_no_latest_date_and_a_shrinking_gap_no_date() -> None:
    t = np.array([0.0, 1.0])
    middle, earliest, latest = Line.through(t, np.array([0.08, 0.081]), np.array([1e-3, 1e-3])).reaches(0.12)
    assert middle == pytest.approx(40.0)
    assert 1.0 < earliest < middle
    assert math.isinf(latest)
    never = Line.through(t, np.array([0.08, 0.07]), np.array([1e-3, 1e-3])).reaches(0.12)
    assert math.isnan(never[0])
    assert never[1:] == (math.inf, math.inf)


# ---- a life ---------------------------------------------------------------------------------------------


def test_a_life_has_dates(new: Identification) -> None:
    older, newer = (with_value(new, "gap", gap, 0.001) for gap in (0.08, 0.09))
    wear = follow_wear([newer, older], ["2026-01-01", date(2025, 1, 1)], "0.2 rad")
    assert wear.dates == (date(2025, 1, 1), date(2026, 1, 1))
    assert [one.value for one in wear.gaps] == [0.08, 0.09]
    years = 365.0 / 365.25
    assert wear.line.slope == pytest.approx(0.01 / years, rel=1e-12)
    assert wear.worn[0] == date.fromordinal(date(2025, 1, 1).toordinal() + 12 * 365)
    worn, earliest, latest = wear.worn
    assert earliest < worn < latest
    assert json.loads(json.dumps(wear.summary()))["worn"] == "2036-12-29"


def test_what_else_has_changed_is_named(new: Identification) -> None:
    one = new["stiffness"]
    softer = with_value(
        with_value(new, "gap", 0.1, 0.001), "stiffness", 0.8 * one.value, 0.5 * (one.upper - one.lower)
    )
    wear = follow_wear([new, softer], DATES)
    assert [note.split()[0] for note in wear.notes] == ["stiffness"]
    inertia = new["motor_inertia"]
    lighter = with_value(new, "motor_inertia", 0.9 * inertia.value, 0.5 * (inertia.upper - inertia.lower))
    notes = follow_wear([new, lighter], DATES).notes
    assert any("another scale of the torque signal" in note for note in notes)
    each = [with_value(new, "gap", value, 0.001) for value in (0.08, 0.12, 0.09)]
    assert any("do not lie on a line" in note for note in follow_wear(each, ["2024-07-01", *DATES]).notes)


def test_deviations_and_thresholds_by_hand(new: Identification) -> None:
    """Half an interval is 1.96 deviations: of the growth of two gaps sqrt(2) of it over the time between."""
    older, newer = (with_value(new, "gap", gap, 0.001) for gap in (0.08, 0.09))
    growth, lower, upper = follow_wear([older, newer], DATES).line.growth
    years = 365.0 / 365.25
    assert [growth, upper - growth, growth - lower] == pytest.approx(
        [0.01 / years, *[math.sqrt(2.0) * 0.001 / years] * 2], rel=1e-9
    )
    # 3 deviations of the difference of two values, each 2 % / 1.96
    soft, share = new["stiffness"].value, math.sqrt(2.0) * 0.02 / 1.959964
    before = with_value(older, "stiffness", soft, 0.02 * soft)
    for times, named in ((2.95, 0), (3.05, 1)):
        after = with_value(newer, "stiffness", soft * (1.0 + times * share), 0.02 * soft)
        assert len(follow_wear([before, after], DATES).notes) == named
    # the chance of b/sqrt(6) deviations is 1 % at 2.5758 (normal, both sides)
    for deviations, named in ((2.55, 0), (2.6, 1)):
        b = math.sqrt(6.0) * deviations * 0.001 / 1.959964
        each = [with_value(new, "gap", gap, 0.001) for gap in (0.08, 0.09, 0.1 + b)]
        assert len(follow_wear(each, ["2025-07-01", "2026-07-01", "2027-07-01"]).notes) == named


def test_what_cannot_be_followed_is_refused(new: Identification, tmp_path: Path) -> None:
    unknown = replace(
        new, estimates=tuple(replace(one, known=False, reason="no reversal") for one in new.estimates)
    )
    free = replace(new, estimates=tuple(one for one in new.estimates if one.name != "gap"))
    for found, dates, limit, sentence in (
        ([new], ["2025"], None, "one identification shows no growth"),
        ([new, new], ["2025"], None, "there are 1 for 2 identifications"),
        ([new, new], 2 * ["2025-07-01"], None, "growth takes two dates"),
        ([new, new], ["2025-07-01", "31.5.2026"], None, "is no date; write one as 2026-05-31"),
        ([new, unknown], DATES, None, "gap unknown in log 2: no reversal"),
        ([new, free], DATES, None, "it was not free"),
        ([new, new], DATES, "-1 rad", "is above 0"),
        ([new, new], DATES, "1 mm", "limit = "),
        ([str(tmp_path / "2025"), str(tmp_path / "2026")], DATES, None, "there is no such file"),
    ):
        with pytest.raises(InputError, match=sentence):
            follow_wear(found, dates, limit)  # type: ignore[arg-type]


@pytest.mark.parametrize("efficiency", [1.0, 0.8])
def test_a_worn_gap_at_the_output_is_that_times_the_ratio_at_the_motor(
    new: Identification, efficiency: float
) -> None:
    """An angle: losses do not count. Without a gear it is refused, not taken at the motor."""
    each = [with_value(new, "gap", gap, 0.001) for gap in (0.08, 0.09)]
    with pytest.raises(InputError, match=r'limit = "0\.005 rad at output": without gear\.ratio'):
        follow_wear(each, DATES, "0.005 rad at output")
    gear = {"gear_ratio": 40.0, "gear_efficiency": efficiency}
    geared = [replace(one, drive=one.drive.replace(**gear)) for one in each]
    wear = follow_wear(geared, DATES, "0.005 rad at output")
    assert wear.limit == pytest.approx(0.2, rel=1e-14)
    assert wear.worn == follow_wear(each, DATES, "0.2 rad").worn


def test_the_command_reads_folders_and_writes_a_report(
    new: Identification, done, as_json, refused, place
) -> None:  # type: ignore[no-untyped-def]
    for year, gap in (("2024", 0.08), ("2026", 0.1)):
        with_value(new, "gap", gap, 0.001).save(place / year)
    line = ["wear", "2024", "2026", "--dates", "2024-07-01,2026-07-01"]
    out = done(*line, "--worn-gap", "0.2 rad", "--out", "worn")
    assert "Growth of the gap: 0.01 rad a year" in out
    assert "It reaches 0.2 rad on 2036-0" in " ".join(out.split())
    assert {"report.md", "wear.csv", "wear.svg"} <= {path.name for path in (place / "worn").iterdir()}
    assert [one["gap"] for one in as_json(*line)["gaps"]] == [0.08, 0.1]
    for year, gap in (("2024", 0.08), ("2026", 0.1)):
        geared = new.drive.replace(gear_ratio=40.0)
        with_value(replace(new, drive=geared), "gap", gap, 0.001).save(place / f"{year} geared")
    there = as_json("wear", "2024 geared", "2026 geared", *line[3:], "--worn-gap", "0.005 rad at output")
    assert there["limit"] == pytest.approx(0.2, rel=1e-14)
    assert "--worn-gap" in refused(*line, "--worn-gap", "0.005 rad at output")
