"""What the report says of the limit: what is proved, and against which starts."""

from dataclasses import replace

import pytest

from softstart import Drive
from softstart.optimal.front import FrontPoint
from softstart.reporting import report
from softstart.reporting.limit import bound_at

from .conftest import Page

LAGGING = Drive.load("crane-4amtkf").replace(target_speed=60.0, torque_lag=0.002)


def test_an_optimum_that_is_found_stands_between_bound_and_strategy(monkeypatch):
    monkeypatch.setattr("softstart.reporting.limit.SHARES", ())
    made = report(LAGGING, controllers=["direct", "shaped"], budget=60.0)
    best = made.choice.chosen
    bound, known, own = made.lower_bound(best), made.lowest_known(best), best.run.k_dyn
    assert bound <= known == made.limit.optimum_at(best.run.start_time).k_dyn < own
    row = Page(made.to_html()).rows("times the bound")[best.name]
    assert row["lowest known in that time"] == f"{known:.3f} (optimum)"
    assert float(row["times the bound"]) == pytest.approx(own / bound, abs=5e-3)
    assert "; the gentlest start known has" in made.answer
    assert made.summary()["k_dyn_gentlest_known"] == known


def test_without_a_search_nothing_else_is_claimed():
    made = report(LAGGING, controllers=["direct", "shaped"], budget=0.0)
    said, best = Page(made.to_html()).text, made.choice.chosen
    assert "none was looked for" in said
    assert "the motor torque lags behind its demand" in said
    assert made.limit.points == ()
    bound, own = made.lower_bound(best), best.run.k_dyn
    assert f"between {bound:.3f} (proved) and {own:.3f} (that of {best.name} itself)" in said


def test_a_certificate_for_one_contact_is_not_told_as_one_for_every_start(hostile):
    """Direct start bounces: a bound that covers single contacts says nothing of it."""
    direct = hostile.row("direct").run
    single = FrontPoint(
        direct.start_time, "reached", "OPTIMAL", "", k_dyn=1.3363, k_dyn_lower_bound=1.3356,
        bound_kind="certificate",
    )  # fmt: skip
    points = (*hostile.limit.found, single)
    page = Page(replace(hostile, limit=replace(hostile.limit, points=points)).to_html())
    said = page.text
    assert f"{len(points) - 1} of {len(points)} optima are proved against every other start" in said
    assert "among starts whose gap closes only once: the optimum at 0.3735 s" in said
    assert "is not ruled out" in said
    row = page.rows("times the bound")["direct"]
    assert row["lowest known in that time"] == "1.336 (optimum)"
    assert float(row["times the bound"]) == pytest.approx(
        direct.k_dyn / bound_at(hostile.drive, direct.start_time), abs=5e-3
    )


def test_an_unknown_position_is_reported_with_where_it_is_worst():
    drive = LAGGING.replace(load_kind="reactive", start_position="unknown")
    made = report(drive, controllers=["direct", "s-curve"], budget=0.0)
    runs = {row.name: row.run for row in made.comparison.rows}
    text = Page(made.to_html()).text
    assert "there is no formula (one torque serves several starts)" in text
    for name, run in runs.items():
        assert f"{name} {run.position}" in text
        assert run.k_dyn == max(one.k_dyn for one in run.positions.values())
