"""`softstart study real-starts`: a small version against single starts, optima and lives."""

from __future__ import annotations

import math

import pytest

from softstart import fatigue, simulate
from softstart.study import Verdict
from softstart_studies.real_starts import Extent, Findings, claims, concordance, drives, find

NAMES = ("direct", "s-curve", "shaped", "pulse-coast-hold")
PART = Extent(drives=("crane", "hoist"), strategies=NAMES, optima=(), unknown=())


@pytest.fixture(scope="module")
def found() -> Findings:
    return find(PART, lambda text: None)


def test_each_case_is_a_start_of_that_drive_from_there(found):
    assert list(found.of("hoist")) == ["mid-gap", "driving-flank", "opposite-flank", "hanging"]
    for (name, where), case in found.cases.items():
        drive = drives()[name].replace(start_position=where, brake="none")
        runs = [simulate(drive, one) for one in NAMES]
        assert [run.k_dyn for run in case.runs.values()] == [run.k_dyn for run in runs]
        assert [case.life(one) for one in NAMES] == [row.relative for row in fatigue(runs).rows]


def test_order_of_life_and_of_k_dyn(found):
    for case in found.cases.values():
        same, pairs = concordance(case)
        assert 0 <= same <= pairs <= math.comb(len(NAMES), 2)
    hanging = found.cases["hoist", "hanging"]
    assert hanging.runs["pulse-coast-hold"].k_dyn < hanging.direct.k_dyn  # gentler by its peak,
    assert hanging.life("pulse-coast-hold") < 1.0  # and harder by its range
    claim = next(one for one in claims(found) if "same order" in one.statement)
    assert claim.verdict is Verdict.PARTLY
    assert "pulse-coast-hold on the hoist from hanging" in claim.evidence
