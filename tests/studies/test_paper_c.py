"""`softstart study paper-c`: printed beside recomputed, the search, the claims and the fronts."""

from __future__ import annotations

import pytest

from softstart.study import Verdict
from softstart_studies.paper_c import PaperC, printed, readings


class Short(PaperC):
    points = 2


@pytest.fixture(scope="module")
def study():
    return Short().run(None, lambda doing: None)


def table(study, title):
    return next(one for one in study.tables if one.title == title)


def test_printed_and_recomputed_side_by_side(study):
    rows = table(study, "Table of [C], printed and recomputed").rows
    assert [(row[1], row[2], row[3], row[5], row[6]) for row in rows] == [
        ("linear", 28729, 27141, 64.6, 64.66),
        ("quadratic-concave", 25082, 25880, 66.5, 65.58),
        ("quadratic-convex", 25082, 28243, 66.5, 68.02),
        ("exponential", 27217, 27709, 75.7, 66.89),
    ]


def test_no_reading_gives_the_printed_table(study):
    rows = table(study, "Which reading gives the printed numbers").rows
    met = {(row[0], row[1]): row[-1] for row in rows}
    assert met.pop(("linear", "Md")) > 0
    assert set(met.values()) == {0}


def test_the_search_knows_the_paper_as_it_stands():
    for row in printed.PRINTED:
        for law in row.readings:
            (ours,) = [one for one in readings.readings(law) if one.choices == readings.USUAL]
            run = printed.engagements()[law]
            assert run.slip_work / printed.KGF == pytest.approx(ours.L, rel=1e-6)
            assert run.slip_peak_torque / printed.KGF == pytest.approx(ours.Md, rel=1e-5)


def test_a_print_is_rounded_or_cut():
    assert all(readings.meets(*one) for one in ((64.66, 64.6), (64.55, 64.6), (28729.9, 28729)))
    assert not any(readings.meets(*one) for one in ((64.7, 64.6), (28728.4, 28729)))


def test_verdicts(study):
    found = {claim.statement.split(" ")[1]: claim for claim in study.claims}
    assert [Verdict(claim.verdict).value for claim in study.claims] == [
        "refuted", "refuted", "confirmed", "confirmed", "partly",
    ]  # fmt: skip
    assert "costs 568 kgf m more; printed: 1512 less" in found["exponential"].evidence
