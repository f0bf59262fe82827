"""What the report says of the limit: what is proved, and against which starts."""

from dataclasses import replace

import pytest

from softstart import Drive, optimize
from softstart.optimal.front import FrontPoint
from softstart.parallel import Progress
from softstart.reporting import report
from softstart.reporting.document import answer
from softstart.reporting.limit import bound_at, limit_section, optima
from softstart.reporting.markup import Figures

from .test_page import Page, rows_of

LAGGING = Drive.load("crane-4amtkf").replace(target_speed=60.0, torque_lag=0.002)


def test_an_optimum_that_is_found_stands_between_bound_and_strategy(monkeypatch):
    monkeypatch.setattr("softstart.reporting.limit.SHARES", ())
    made = report(LAGGING, controllers=["direct", "shaped"], budget=60.0)
    best = made.choice.chosen
    bound, known, own = made.lower_bound(best.row), made.lowest_known(best.row), best.row.run.k_dyn
    assert bound <= known == made.limit.optimum_at(best.row.run.start_time).k_dyn < own
    row = rows_of(Page(section(made)), "times the bound")[best.name]
    assert row["lowest known in that time"] == f"{known:.3f} (optimum)"
    assert float(row["times the bound"]) == pytest.approx(own / bound, abs=5e-3)
    assert "; the gentlest start known has" in answer(made)
    assert made.summary()["k_dyn_gentlest_known"] == known


def section(made):
    return limit_section(made.drive, made.choice, made.limit, Figures())


def test_without_a_search_nothing_else_is_claimed():
    made = report(LAGGING, controllers=["direct", "shaped"], budget=0.0)
    said, best = "".join(Page(section(made)).text), made.choice.chosen
    assert "none was looked for" in said
    assert "the motor torque lags behind its demand" in said
    assert made.limit.points == ()
    bound, own = made.lower_bound(best.row), best.row.run.k_dyn
    assert f"between {bound:.3f} (proved) and {own:.3f} (that of {best.name} itself)" in said


def test_a_certificate_for_one_contact_is_not_told_as_one_for_every_start(hostile):
    """Direct start bounces: a bound that covers single contacts says nothing of it."""
    direct = hostile.row("direct").run
    single = FrontPoint(
        direct.start_time, "reached", "OPTIMAL", "", k_dyn=1.3363, k_dyn_lower_bound=1.3356,
        bound_kind="certificate",
    )  # fmt: skip
    points = (*hostile.limit.found, single)
    page = Page(section(replace(hostile, limit=replace(hostile.limit, points=points))))
    said = "".join(page.text)
    assert f"{len(points) - 1} of {len(points)} optima are proved against every other start" in said
    assert "among starts whose gap closes only once: the optimum at 0.3735 s" in said
    assert "is not ruled out" in said
    row = rows_of(page, "times the bound")["direct"]
    assert row["lowest known in that time"] == "1.336 (optimum)"
    assert float(row["times the bound"]) == pytest.approx(
        direct.k_dyn / bound_at(hostile.drive, direct.start_time), abs=5e-3
    )


def test_optima_of_a_report_begin_with_the_nearest_that_is_known(monkeypatch):
    asked = []

    def noted(stretch):
        (start_time,) = stretch.start_times
        asked.append((start_time, stretch.near and stretch.near.time[-1]))
        if start_time == 0.32:
            return [FrontPoint.not_found("", start_time, "reached")]
        return [replace(OPTIMUM, time=(0.0, start_time), torque=(1.0, 1.0))]

    OPTIMUM = FrontPoint.of_optimum(optimize(LAGGING.replace(torque_lag=0.0), 0.32, terminal="reached"), 0.32)
    monkeypatch.setattr("softstart.reporting.limit.computed", noted)
    optima(LAGGING, [0.3, 0.4, 0.31, 0.32, 0.35], progress=Progress(lambda message: None))
    assert asked == [(0.3, None), (0.31, 0.3), (0.32, 0.31), (0.35, 0.31), (0.4, 0.35)]


def test_an_unknown_position_is_reported_with_where_it_is_worst():
    drive = LAGGING.replace(load_kind="reactive", start_position="unknown")
    made = report(drive, controllers=["direct", "s-curve"], budget=0.0)
    runs = {row.name: row.run for row in made.choice.rows}
    text = " ".join("".join(Page(made.to_html()).text).split())
    assert "there is no formula (one torque serves several starts)" in text
    for name, run in runs.items():
        assert f"{name} {run.position}" in text
        assert run.k_dyn == max(one.k_dyn for one in run.positions.values())
