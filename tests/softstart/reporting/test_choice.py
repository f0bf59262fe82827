"""The recommendation follows its rule, and the map is what simulate says cell by cell."""

import math
import time
from dataclasses import replace

import numpy as np
import pytest

from softstart import Command, Drive, PlainController, simulate
from softstart.processes import Tell
from softstart.reporting import report
from softstart.reporting.choice import choice_section, choose
from softstart.reporting.document import answer
from softstart.reporting.limit import bound_at, limit, limit_section, optima
from softstart.reporting.markup import Figures
from softstart.reporting.robustness import robustness


class Lazy(PlainController):
    """Just enough torque to move, but never to the target speed in time."""

    name = "lazy"

    def step(self, measured, state):
        return Command(0.0)


def test_map_is_cell_by_cell_what_simulate_says():
    crane = Drive.load("crane-4amtkf").replace(target_speed=60.0)
    from softstart.controller import make_controller

    found = robustness(crane, make_controller("shaped"))
    for i, j in ((0, 0), (2, 3), (6, 4)):
        other = crane.replace(gap=found.gaps[i], load_inertia=found.inertias[j])
        run = simulate(other, "shaped", fitted_to=crane, base=crane)
        assert found.k_dyn[i, j] == run.k_dyn
        assert found.start_time[i, j] == run.start_time
    assert found.gaps[2] == crane.gap
    assert found.inertias[3] == crane.J2
    assert found.worst == found.k_dyn.max()
    i, j = np.argwhere(found.k_dyn == found.worst)[0]
    assert found.worst_at == (found.gaps[i], found.inertias[j])


def test_rule(hostile):
    choice = hostile.choice
    inside = [one for one in choice.candidates if not one.out]
    direct = choice.of("direct").row.run.start_time
    assert {one.name for one in choice.candidates} - {one.name for one in inside} == {"reduced-first-stage"}
    assert choice.of("reduced-first-stage").worst < choice.of("direct").worst  # out for its sensor alone
    for one in inside:
        assert one.row.run.start_time <= 1.15 * direct
        assert choice.recommended.worst <= one.worst
    assert choice.recommended.name == "shaped"
    assert choice.ordinary.name in ("ramp", "s-curve")
    assert choice.ordinary.worst == min(choice.of(name).worst for name in ("ramp", "s-curve"))
    maps = [one.map for one in choice.candidates]
    strict = choose(hostile.comparison.rows, maps, 0.01)
    assert strict.recommended.name == "direct"
    assert strict.too_slow
    assert strict.ordinary.name == choice.ordinary.name


def test_direct_start_is_not_praised_where_gentler_ones_are_only_too_slow(hostile):
    """With next to no time to lose the rule leaves direct start, which is not as good as the others."""
    maps = [one.map for one in hostile.choice.candidates]
    strict = replace(hostile, choice=choose(hostile.comparison.rows, maps, 0.0125))
    said = answer(strict)
    assert strict.choice.recommended.name == "direct"
    assert "brings nothing" not in said
    assert "shaped (K_dyn 1.004, 5.2 % slower)" in said
    more = "with --slower 6% the rule takes shaped, K_dyn 1.004 after 0.3928 s."
    assert said.partition(" On an")[0].endswith(f"A slower start is much gentler: {more}")
    assert more not in answer(hostile)
    assert choose(hostile.comparison.rows, maps, 0.06).recommended.name == "shaped"
    assert "s-curve is the best: K_dyn 1.879" in said
    assert "7.6\N{NO-BREAK SPACE}% slower than direct" in said
    assert "at most 1.25\N{NO-BREAK SPACE}% slower than direct" in choice_section(strict.choice)
    alone = replace(hostile, choice=choose(hostile.comparison.rows[:1], maps[:1]))
    assert answer(alone).startswith("Only direct start was examined")


def test_a_drive_for_which_nothing_can_be_recommended():
    crane = Drive.load("crane-4amtkf").replace(target_speed=60.0, gap=0.0)
    made = report(crane, controllers=[Lazy()], budget=0.0, slower=0.0)
    assert made.choice.recommended.name == "direct"  # the only one that gets there
    assert "A soft start brings nothing here." in answer(made)
    assert math.isnan(made.choice.of("lazy").worst)
    page = made.to_html()
    assert "No ramp was examined" in page
    assert "the drive has none, so the maps have one row" in page
    assert made.sheets[0].name == "direct"


def test_no_strategy_reaches_the_speed():
    from softstart.controller import make_controller

    crane = Drive.load("crane-4amtkf").replace(target_speed=60.0)
    weak = make_controller("direct", {"torque": "5 N*m"})
    made = report(crane, controllers=[weak], budget=0.0)
    assert made.choice.recommended is None
    assert made.sheets == ()
    assert "No strategy brings the load to its target speed." in answer(made)
    assert made.limit.refusal
    assert "no strategy is recommended" in made.to_html()
    assert made.summary()["recommended"] is None


def test_reactive_damped_lagging_drive_says_what_was_not_found():
    servo = Drive.load("servo-axis-small")
    made = report(servo, controllers=["ramp", "direct"], budget=0.0)
    assert made.limit.points == ()
    assert len(made.limit.missing) >= 6
    for row in made.comparison.rows:
        assert bound_at(servo, row.run.start_time) <= row.run.k_dyn
    assert "only a search by linear programs" in limit_section(made.drive, made.choice, made.limit, Figures())


def test_search_for_optima_ends_when_its_time_is_up():
    """At 1.005 times the shortest start time there is no formula, and the search takes seconds."""
    crane = Drive.load("crane-4amtkf").replace(target_speed=60.0)
    told = []
    began = time.monotonic()
    found = limit(crane, [0.251], math.nan, 0.3, lambda share, what: told.append(share))
    assert time.monotonic() - began < 60.0
    assert 0.251 in found.missing
    assert told
    assert told == sorted(told)
    assert [p.start_time_bound for p in found.found] == sorted(p.start_time_bound for p in found.found)
    assert all(p.k_dyn >= p.k_dyn_lower_bound * (1.0 - 1e-9) for p in found.found)


def test_the_process_sends_each_optimum():
    crane = Drive.load("crane-4amtkf").replace(target_speed=60.0)
    sent = []
    optima(crane, [0.2883042], tell=Tell(sent.append))
    ((kind, point),) = sent
    assert kind == "part"
    assert point.found
    assert point.k_dyn == pytest.approx(point.k_dyn_lower_bound, rel=1e-6)
