"""The recommendation follows its rule, the map is that of simulate, what is said of the limit is proved."""

import itertools
import math
import re
from dataclasses import replace
from types import SimpleNamespace

import pytest

from softstart import Command, Drive, Effort, PlainController, simulate
from softstart.controller import make_controller
from softstart.optimal.bounds import momentum_bound
from softstart.optimal.front import FrontPoint
from softstart.optimal.problem import Problem
from softstart.reporting import report
from softstart.reporting.choice import robustness
from softstart.reporting.document import text_answer
from softstart.reporting.limit import OptimumCurve, bound_at, limit
from softstart.start.recommendation import keeps
from softstart.start.settings import Setting

from .conftest import Page


class Lazy(PlainController):
    """Just enough torque to move, but never to the target speed in time."""

    name = "lazy"

    def step(self, measured, state):
        return Command(0.0)


def test_map_is_cell_by_cell_what_simulate_says():
    crane = Drive.load("crane-4amtkf").replace(target_speed=60.0)
    found = robustness(crane, make_controller("shaped"))
    for i, j in ((0, 0), (2, 3), (6, 4)):
        other = crane.replace(gap=found.gaps[i], load_inertia=found.inertias[j])
        run = simulate(other, "shaped", fitted_to=crane, base=crane)
        assert found.k_dyn[i, j] == run.k_dyn
        assert found.start_time[i, j] == run.start_time
    assert found.gaps[2] == crane.gap
    assert found.inertias[3] == crane.J2
    assert found.worst == found.k_dyn.max()


def test_verdicts_are_those_of_the_one_rule(hostile):
    choice = hostile.choice
    said = hostile.comparison.recommendation
    assert choice.recommendation is said
    verdicts = {one["controller"]: one["verdict"] for one in hostile.summary()["choice"]["candidates"]}
    assert choice.maps["reduced-first-stage"].worst < choice.maps["direct"].worst  # out for its sensor alone
    assert verdicts["reduced-first-stage"] == "a sensor that drives do not have"
    assert [name for name, verdict in verdicts.items() if verdict == "Pareto-optimal"] == ["direct", "shaped"]
    assert choice.chosen is said.best[-1]
    assert choice.role == "lowest K_dyn"
    assert choice.worst(choice.ordinary) == min(choice.maps[name].worst for name in ("ramp", "s-curve"))
    assert hostile.answer.startswith(said.text.fact)
    assert said.text.advice == "For a recommendation, give [limits] in the drive file."
    assert "[limits]" not in hostile.answer
    page = Page(hostile.to_html()).text
    assert "no limits, so the permissible peak is unknown" in page
    assert hostile.answer in page


def test_a_drive_on_which_only_direct_start_gets_there():
    crane = Drive.load("crane-4amtkf").replace(target_speed=60.0, gap=0.0)
    made = report(crane, controllers=[Lazy()], budget=0.0)
    assert made.choice.chosen.name == "direct"
    lazy = next(one for one in made.summary()["choice"]["candidates"] if one["controller"] == "lazy")
    assert math.isnan(lazy["worst_k_dyn"])
    assert lazy["verdict"] == "does not reach the target speed"
    page = Page(made.to_html()).text
    assert "the drive has none, so the maps have one row" in page
    assert made.sheets[0].name == "direct"


def test_no_strategy_reaches_the_speed():
    crane = Drive.load("crane-4amtkf").replace(target_speed=60.0)
    weak = make_controller("direct", {"torque": "5 N*m"})
    made = report(crane, controllers=[weak], budget=0.0)
    assert made.choice.chosen is None
    assert made.sheets == ()
    assert made.answer == "None is recommended: direct (does not reach the target speed)."
    assert made.limit.refusal
    assert "no strategy is recommended" in made.to_html()
    assert made.summary()["recommended"] is None


@pytest.mark.parametrize(("over", "proved"), [(0.99, True), (1.01, False)])
def test_an_optimum_within_1_percent_of_its_bound_is_proved(hostile, over, proved):
    """Against every start by the momentum bound; by that of starts whose gap closes once among these."""
    time = 1.2 * hostile.choice.direct.run.start_time
    bound = bound_at(hostile.drive, time)
    near = FrontPoint(time, "reached", "OPTIMAL", "", k_dyn=bound * (1.0 + 0.01 * over))
    far = replace(near, k_dyn=1.2 * bound)
    every, single, loose = OptimumCurve(points=(near,)).proofs(hostile.drive)
    assert (every or loose) == pytest.approx([over], rel=1e-9)
    assert bool(every) == proved
    for once, certain in ((1.2 * bound / (1.0 + 0.01 * over), proved), (None, False)):
        point = replace(far, k_dyn_lower_bound_once=once)
        every, single, loose = OptimumCurve(points=(point,)).proofs(hostile.drive)
        assert (every, single) == ([], [(time, pytest.approx(over, rel=1e-9))] if certain else [])
        assert loose == ([] if certain else [pytest.approx(20.0)])


def test_the_lowest_known_takes_no_longer(hostile):
    time, rows = hostile.choice.chosen.run.start_time, hostile.comparison.rows
    quick, slow = (FrontPoint(share * time, "reached", "OPTIMAL", "", k_dyn=share) for share in (0.9, 1.1))
    both = OptimumCurve(points=(slow, quick))
    assert [both.lowest_known(at * time, ()) for at in (0.8, 1.0, 1.2)] == [None, 0.9, 0.9]
    assert both.lowest_known(0.8 * time, rows) is None
    as_quick = [row.run.k_dyn for row in rows if row.run.start_time <= time]
    assert OptimumCurve().lowest_known(time, rows) == min(as_quick)


def test_what_an_answer_adds_is_worth_half_a_percent_and_rounding_5_percent(hostile):
    best = hostile.choice.chosen
    (sheet,) = [one for one in hostile.sheets if one.name == best.name]
    time, k = sheet.exact.start_time, sheet.exact.k_dyn

    def said(words, *, known=1.0, **changes):
        point = FrontPoint(best.run.start_time, "reached", "OPTIMAL", "", k_dyn=known * best.run.k_dyn)
        made = replace(hostile, limit=OptimumCurve(points=(point,)), sheets=(replace(sheet, **changes),))
        return words in re.split(r" In that of ", text_answer(made))[0]  # what follows is of the ramp

    calm = {"rounded": SimpleNamespace(k_dyn=k, limited_time=time), "worst_k_dyn": k, "slowest": time}
    for share, told in ((1.049, False), (1.051, True)):
        for harm in (SimpleNamespace(k_dyn=share * k, limited_time=time),
                     SimpleNamespace(k_dyn=k, limited_time=share * time)):  # fmt: skip
            assert said("But these are exact values", **calm | {"rounded": harm}) == told
        for harm in ({"worst_k_dyn": share * k}, {"slowest": share * time}):
            assert said("With values half a step off", **calm | harm) == told
    for share, told in ((0.9951, False), (0.9949, True)):
        assert said("the lowest K_dyn known is", known=share, **calm) == told
    for step, coarse in ((0.099, False), (0.101, True)):
        assert Setting("time", "", "s", 1.0, 1.0, step).coarse == coarse


def test_each_bound_is_that_of_the_start_beside_which_it_stands(hostile, read):
    """The answer has two starts of different times, each with the bound of its own; so has each row."""
    made = hostile
    pattern = r"(?:time|In that) of (\S+), ([\d.]+) s, (?:with a K_dyn|none is) below (\d+\.\d+)"
    said = re.findall(pattern, made.answer)
    assert {name for name, *_ in said} == {made.choice.chosen.name, made.choice.ordinary.name}
    assert len({time for _, time, _ in said}) == 2
    own = read.rows("lower bound at that time")
    for row in made.comparison.rows:
        time = row.run.start_time
        bound = momentum_bound(Problem(made.drive, time, "reached")).k_dyn
        assert float(own[row.name]["lower bound at that time"]) == pytest.approx(bound, abs=5e-4)
        for _, told, below in (one for one in said if one[0] == row.name):
            assert float(told) == pytest.approx(time, rel=1e-3)
            assert 0.0 <= bound - float(below) <= 1e-3  # rounded to the safe side


def test_search_for_optima_ends_when_its_time_is_up():
    """At 1.005 times the shortest start time there is no formula, and the search takes seconds."""
    crane = Drive.load("crane-4amtkf").replace(target_speed=60.0)
    told = []
    found = limit(crane, [0.251], [], 0.2403, 0.3, lambda share, what: told.append(share))
    assert 0.251 in found.missing
    assert told
    assert told == sorted(told)
    assert [p.start_time_bound for p in found.found] == sorted(p.start_time_bound for p in found.found)
    assert all(p.k_dyn >= p.k_dyn_lower_bound * (1.0 - 1e-9) for p in found.found)


LAGGING = Drive.load("crane-4amtkf").replace(target_speed=60.0, torque_lag=0.002)


@pytest.mark.slow
def test_an_optimum_that_is_found_stands_between_bound_and_strategy(monkeypatch):
    monkeypatch.setattr("softstart.reporting.limit.SHARES", ())
    made = report(LAGGING, controllers=["direct", "shaped"], budget=60.0)
    best = made.choice.chosen
    bound, known, own = made.lower_bound(best), made.lowest_known(best), best.run.k_dyn
    assert bound <= known == made.limit.optimum_at(best.run.start_time).k_dyn < own
    row = Page(made.to_html()).rows("times the bound")[best.name]
    assert row["lowest known in that time"] == f"{known:.3f} (optimum)"
    assert float(row["times the bound"]) == pytest.approx(own / bound, abs=5e-3)
    assert "; the lowest K_dyn known is" in made.answer
    assert made.summary()["k_dyn_lowest_known"] == known


def test_a_bound_for_one_contact_is_not_told_as_one_for_every_start(hostile):
    """Direct start bounces: a bound that covers single contacts says nothing of it."""
    direct = hostile.row("direct").run
    single = FrontPoint(
        direct.start_time, "reached", "OPTIMAL", "", k_dyn=1.3363, k_dyn_lower_bound_once=1.3356,
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


def test_more_effort_is_listed_only_where_it_buys_a_lower_peak():
    crane = Drive.load("crane-4amtkf")
    for permitted in (None, 170.0):
        made = report(crane.replace(permissible_torque=permitted), budget=0.0)
        rows, limits = made.choice.more_effort, made.choice.recommendation.limits
        assert rows[0].name == "direct"
        assert rows[-1].effort is Effort.ENCODER
        assert made.choice.chosen in rows
        k_dyn = [row.run.k_dyn for row in rows]
        assert all(after < 0.995 * before for before, after in itertools.pairwise(k_dyn))
        assert all(keeps(row, limits) for row in rows[1:])
        table = Page(made.to_html()).rows("less than direct")
        assert list(table) == [row.name for row in rows]
        assert ("limits" in table["direct"]) == (permitted is not None)


def test_each_figure_of_a_start_says_where_it_begins_and_at_which_shaft():
    crane = Drive.load("crane-4amtkf").replace(gear_ratio=38.0)
    for changes, where, shaft in (
        ({}, "Start in the middle of the gap", "motor"),
        ({"units": "kN m, at output"}, "Start in the middle of the gap", "output"),
        ({"start_position": "unknown"}, "Start position unknown: direct on the ", "motor"),
    ):
        page = report(crane.replace(**changes), controllers=["ramp"], budget=0.0).to_html()
        captions = [
            " ".join(one.split()) for one in re.findall(r"<figcaption>(.*?)</figcaption>", page, re.DOTALL)
        ]
        of_starts = [one for one in captions if "The drive, everything" not in one]
        assert len(of_starts) == 4
        assert where in of_starts[0]
        assert all(one.endswith(f"; torques and speeds at the {shaft} shaft.") for one in of_starts)
