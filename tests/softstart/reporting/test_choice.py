"""The recommendation follows its rule, and the map is what simulate says cell by cell."""

import math
import time

import numpy as np
import pytest

from softstart import Command, Drive, PlainController, simulate
from softstart.parallel import Progress
from softstart.reporting import report
from softstart.reporting.choice import choice_section
from softstart.reporting.document import answer
from softstart.reporting.first_page import for_customer
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


def test_verdicts_are_those_of_the_one_rule(hostile):
    choice = hostile.choice
    said = hostile.comparison.recommendation
    assert choice.recommendation is said
    assert choice.of("reduced-first-stage").worst < choice.of("direct").worst  # out for its sensor alone
    assert choice.of("reduced-first-stage").verdict == "a sensor that drives do not have"
    assert [one.name for one in choice.candidates if one.verdict == "unbeaten"] == ["direct", "shaped"]
    assert choice.chosen.row is said.best[-1]
    assert choice.role == "gentlest unbeaten"
    assert choice.ordinary.worst == min(choice.of(name).worst for name in ("ramp", "s-curve"))
    assert answer(hostile).startswith(for_customer(said.text))
    assert said.text.endswith(": give [limits] in the drive file.")  # which is for the author
    assert "[limits]" not in answer(hostile)
    section = choice_section(choice, answer(hostile))
    assert "no limits, so nothing says which peak is low enough" in section


def test_with_limits_the_report_is_about_the_recommended_strategy():
    crane = Drive.load("crane-4amtkf").replace(permissible_torque=130.0)
    made = report(crane, controllers=["ramp", "shaped"], budget=0.0)
    assert made.choice.chosen.name == made.summary()["recommended"] == "shaped"
    assert [sheet.name for sheet in made.sheets] == ["shaped"]
    assert "the simplest strategy that keeps the limits of the drive" in choice_section(
        made.choice, answer(made)
    )
    assert "On an ordinary inverter" not in answer(made)
    none = report(crane.replace(permissible_torque=20.0), controllers=["ramp"], budget=0.0)
    assert none.choice.chosen is None
    assert "no strategy is recommended" in none.to_html()


def test_a_drive_on_which_only_direct_start_gets_there():
    crane = Drive.load("crane-4amtkf").replace(target_speed=60.0, gap=0.0)
    made = report(crane, controllers=[Lazy()], budget=0.0)
    assert made.choice.chosen.name == "direct"
    assert math.isnan(made.choice.of("lazy").worst)
    assert made.choice.of("lazy").verdict == "does not reach the target speed"
    page = made.to_html()
    assert "the drive has none, so the maps have one row" in page
    assert made.sheets[0].name == "direct"


def test_no_strategy_reaches_the_speed():
    from softstart.controller import make_controller

    crane = Drive.load("crane-4amtkf").replace(target_speed=60.0)
    weak = make_controller("direct", {"torque": "5 N*m"})
    made = report(crane, controllers=[weak], budget=0.0)
    assert made.choice.chosen is None
    assert made.sheets == ()
    assert answer(made) == "None is recommended: direct (does not reach the target speed)."
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
    said = limit_section(made.drive, made.choice, made.limit, Figures())
    assert "there is no formula (the load is reactive)" in said


def test_search_for_optima_ends_when_its_time_is_up():
    """At 1.005 times the shortest start time there is no formula, and the search takes seconds."""
    crane = Drive.load("crane-4amtkf").replace(target_speed=60.0)
    told = []
    began = time.monotonic()
    found = limit(crane, [0.251], [], 0.2403, 0.3, lambda share, what: told.append(share))
    assert time.monotonic() - began < 60.0
    assert 0.251 in found.missing
    assert told
    assert told == sorted(told)
    assert [p.start_time_bound for p in found.found] == sorted(p.start_time_bound for p in found.found)
    assert all(p.k_dyn >= p.k_dyn_lower_bound * (1.0 - 1e-9) for p in found.found)


def test_the_process_sends_each_optimum():
    crane = Drive.load("crane-4amtkf").replace(target_speed=60.0)
    sent = []
    optima(crane, [0.2883042], progress=Progress(sent.append))
    ((kind, point),) = sent
    assert kind == "part"
    assert point.found
    assert point.k_dyn == pytest.approx(point.k_dyn_lower_bound, rel=1e-6)
