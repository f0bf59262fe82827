"""What the report says of the limit: what is proved, against which starts, and what is only known."""

from dataclasses import replace

import pytest

from softstart import Drive, optimize, simulate
from softstart.optimal.front import FrontPoint
from softstart.processes import Progress
from softstart.reporting import report
from softstart.reporting.document import answer
from softstart.reporting.gentle_starts import gentle_starts
from softstart.reporting.limit import bound_at, limit_section, optima
from softstart.reporting.markup import Figures

from .test_page import Page, rows_of

LAGGING = Drive.load("crane-4amtkf").replace(target_speed=60.0, torque_lag=0.002)


@pytest.mark.parametrize(
    "change",
    [
        {},
        {"torque_lag": 0.003, "load_kind": "reactive", "damping": 0.5},
        {"minimum_torque": -62.0, "torque_rate": 2000.0},
        {"gap": 0.0, "load_torque": 0.0},
    ],
)
def test_gentle_starts_are_possible_and_near_the_bound(change):
    drive = Drive.load("crane-4amtkf").replace(target_speed=60.0, **change)
    direct = simulate(drive, "direct").start_time
    (found,) = gentle_starts(drive, [1.2 * direct], 60.0)
    assert found.start_time <= found.start_time_bound == 1.2 * direct
    bound = bound_at(drive, 1.2 * direct)
    assert bound <= found.k_dyn <= 1.15 * bound  # the bound knows nothing of lag and rate


def test_gentle_starts_are_repeatable_and_fall_with_the_start_time():
    drive = Drive.load("crane-4amtkf").replace(target_speed=60.0)
    found = gentle_starts(drive, [0.30, 0.29, 0.34], 60.0)
    assert [one.start_time_bound for one in found] == [0.29, 0.30, 0.34]
    assert [one.k_dyn for one in found] == sorted((one.k_dyn for one in found), reverse=True)
    assert gentle_starts(drive, [0.30, 0.29, 0.34], 60.0) == found
    assert gentle_starts(drive, [0.30], 0.0) == []


def test_where_no_optimum_is_found_the_report_says_between_what_it_lies(monkeypatch):
    monkeypatch.setattr("softstart.reporting.limit._in_own_process", lambda *_: [])
    monkeypatch.setattr("softstart.reporting.limit.SHARES", ())
    made = report(LAGGING, controllers=["direct", "shaped"], budget=30.0)
    best = made.choice.chosen
    bound, known, own = made.lower_bound(best.row), made.gentlest_known(best.row), best.row.run.k_dyn
    assert bound < known < own
    page = Page(limit_section(made.drive, made.choice, made.limit, Figures()))
    said = "".join(page.text)
    assert f"between {bound:.3f} (proved) and {known:.3f} (found): {best.name} with {own:.3f}" in said
    assert "not known to be the gentlest" in said
    assert "gentlest start known: possible, not proved best" in said  # the legend of the figure
    row = rows_of(page, "times the bound")[best.name]
    assert float(row["lowest known in that time"]) == pytest.approx(known, abs=5e-4)
    assert float(row["times the bound"]) == pytest.approx(own / bound, abs=5e-3)
    assert "--budget" not in said
    assert "; the gentlest start known has" in answer(made)
    assert made.summary()["k_dyn_gentlest_known"] == known
    assert [one["k_dyn"] for one in made.summary()["limit"]["known_starts"]]


def test_without_a_search_nothing_else_is_claimed():
    made = report(LAGGING, controllers=["direct", "shaped"], budget=0.0)
    said = limit_section(made.drive, made.choice, made.limit, Figures())
    assert "none was looked for" in said
    assert "the gentlest start known" in said
    assert made.limit.known == ()


def test_a_certificate_for_one_contact_is_not_told_as_one_for_every_start(hostile):
    """Direct start bounces: a bound that covers single contacts says nothing of it."""
    direct = hostile.row("direct").run
    single = FrontPoint(
        direct.start_time, "reached", "OPTIMAL", "", k_dyn=1.3363, k_dyn_lower_bound=1.3356,
        bound_kind="certificate",
    )  # fmt: skip
    points = (*hostile.limit.found, single)
    page = Page(
        limit_section(hostile.drive, hostile.choice, replace(hostile.limit, points=points), Figures())
    )
    said = "".join(page.text)
    assert f"{len(points) - 1} of {len(points)} optima are certified against every other start" in said
    assert "That at 0.3735 s is certified among starts whose gap closes only once" in said
    assert "is not ruled out" in said
    row = rows_of(page, "times the bound")["direct"]
    assert row["lowest known in that time"] == "1.336 (optimum)"
    assert float(row["times the bound"]) == pytest.approx(
        direct.k_dyn / bound_at(hostile.drive, direct.start_time), abs=5e-3
    )


def test_a_drive_of_no_class_that_is_solved_is_an_answer_not_a_crash():
    drive = LAGGING.replace(load_kind="reactive", contact_law="modelica", damping=1.0)
    sent = []
    optima(drive, [0.3, 0.4], progress=Progress(sent.append))
    points = [message.content for message in sent]
    assert [p.status for p in points] == ["NOT_FOUND", "NOT_FOUND"]
    assert "modelica" in points[0].status_text


def test_optima_of_a_report_are_looked_for_beside_the_nearest_known(monkeypatch):
    asked = []

    def noted(point):
        asked.append((point.start_time, point.warm))
        return FrontPoint.not_found(
            "", point.start_time, "reached"
        ) if point.start_time == 0.32 else OPTIMUM, (
            None if point.start_time == 0.32 else f"what {point.start_time} left"
        )

    OPTIMUM = FrontPoint.of_optimum(optimize(LAGGING.replace(torque_lag=0.0), 0.32, terminal="reached"), 0.32)
    monkeypatch.setattr("softstart.reporting.limit.computed", noted)
    optima(LAGGING, [0.3, 0.4, 0.31, 0.32, 0.35], progress=Progress(lambda message: None))
    assert asked == [
        (0.3, None),
        (0.31, "what 0.3 left"),
        (0.32, "what 0.31 left"),
        (0.35, "what 0.31 left"),
        (0.4, "what 0.35 left"),
    ]


def test_an_unknown_position_is_reported_with_where_it_is_worst():
    drive = LAGGING.replace(load_kind="reactive", start_position="unknown")
    made = report(drive, controllers=["direct", "s-curve"], budget=0.0)
    runs = {row.name: row.run for row in made.choice.rows}
    text = " ".join("".join(Page(made.to_html()).text).split())
    assert "the start position is unknown, and one torque for every position" in text
    for name, run in runs.items():
        assert f"{name} {run.position}" in text
        assert run.k_dyn == max(one.k_dyn for one in run.positions.values())
