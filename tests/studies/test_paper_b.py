"""`softstart study paper-b`: the tables, the verdicts, and the numbers that decide them."""

from __future__ import annotations

import pytest

from softstart import Engine
from softstart_studies.paper_b import PaperB, tables, vaz
from softstart_studies.paper_b.vaz import MOMENTS, RPM, TUNING, VAZ, first_order

VERDICTS = {
    "Two shafts against the crank": "confirmed",
    "(2):": "confirmed",
    "(3):": "confirmed",
    "(4):": "partly",
    "(5):": "refuted",
    "Inertia and balancing moments grow": "partly",
    "With h fixed": "partly",
    "Moved so that h = h(n)": "partly",
    "A balancer must be designed": "confirmed",
    "(Not in [B].)": "refuted",
}


def test_verdicts_and_the_engine_is_written_as_it_was_assumed(tmp_path):
    claims = PaperB().run(tmp_path, lambda doing: None).claims
    assert Engine.load(tmp_path / "vaz-11113.toml") == VAZ
    assert len(claims) == len(VERDICTS)
    for claim, (begin, verdict) in zip(claims, VERDICTS.items(), strict=True):
        assert claim.statement.startswith(begin)
        assert claim.verdict.value == verdict, claim.evidence
    # M_b equal in amplitude, |M| sin(phi): of A cos + B sin the part A cos + (B - |M|) sin stays
    first = VAZ.torque_harmonics(TUNING * RPM)[2]
    assert f"in amplitude instead, {abs(first + 1j * abs(first)):.1f})" in claims[6].evidence


def test_printed_and_model_stand_side_by_side():
    rows = tables.printed_and_model().rows
    forces = [row for row in rows if row[0] == "F_b at 4500 rpm"]
    assert [row[2] for row in forces] == pytest.approx([10084.5, 10084.5])
    whole = 2 * 0.68 * 0.0355 * (4500 * RPM) ** 2
    assert [row[3] for row in forces] == pytest.approx([whole, 0.5 * whole], abs=0.01)
    assert [row[2] for row in rows if row[0] == "m r"] == pytest.approx([0.0454, 0.0454], abs=5e-5)  # kg m
    arms = [row[2] for row in rows if row[0].startswith("h =")]
    assert arms == pytest.approx([42.149, 42.149, 4.215, 4.215], abs=1e-3)
    moments = [row for row in rows if row[0] == "M_b at 4500 rpm"]
    assert [row[2] for row in moments] == pytest.approx([425.048, 42.505], abs=1e-3)
    assert all(row[3] == pytest.approx(first_order()[1], abs=1e-3) for row in moments)


def test_neither_reading_of_5_lies_in_what_the_assumptions_allow():
    low, high = vaz.sine_at_corners()
    sine = first_order()[1]
    assert low < sine < high
    assert 2.0 * MOMENTS[1][1] * TUNING**2 < low
    assert high < 0.5 * MOMENTS[0][1] * TUNING**2
    # the pressure that would be needed gives that moment when it is put into the engine
    moment = MOMENTS[0][1] * TUNING**2
    factor = vaz.pressure_needed(moment) / (VAZ.indicated_work(TUNING * RPM, 1.0) / VAZ.displacement)
    there = first_order({vaz.PRESSURE: vaz.pressures(factor)})
    assert there[1] == pytest.approx(moment, rel=1e-9)
    assert vaz.pressure_needed(moment) > 40e5


def test_an_arm_for_full_load_is_wrong_at_others():
    for rpm in (850.0, 4500.0):
        assert vaz.left_at_load(1.0, rpm, sideways=True)[1] < 1e-10
        without, left = vaz.left_at_load(0.0, rpm, sideways=True)
        assert left > without
