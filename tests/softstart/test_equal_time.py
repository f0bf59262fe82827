"""Strategies at equal time, and set for the limits of a drive."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest

from softstart import Command, Drive, InputError, PlainController, TorqueProfile, compare, optimize, simulate
from softstart.controller import Effort, make_controller
from softstart.controller.finding import ready_controller_names
from softstart.controller.parameters import declared_parameters
from softstart.drive import library
from softstart.start.batch import prepared
from softstart.start.comparison import equal_time
from softstart.start.recommendation import CASES, HIGHER
from softstart.start.setting import VALUES, over_time, rounded

CRANE = Drive.load("crane-4amtkf")
SET = ("ramp", "s-curve", "speed-ramp", "acceleration-delay", "pulse-coast-hold", "shaped")


def test_each_shipped_strategy_says_what_sets_its_time():
    """One parameter of its own, with a range, and two more at most; direct and a profile have none."""
    profile = make_controller("profile", {"profile": TorqueProfile([0.0, 1.0], [0.0, 62.0])})
    for one in [*map(make_controller, ready_controller_names()), profile]:
        declared = declared_parameters(one)
        assert (one.time_parameter == "") == (one.name in ("direct", "profile"))
        for name in filter(None, (one.time_parameter, *one.settings)):
            assert declared[name].multiples or declared[name].between, (one.name, name)
        assert len(one.settings) <= 2
        assert one.time_parameter not in one.settings


@pytest.mark.parametrize("name", SET)
def test_the_value_named_gives_the_row_to_the_bit(name):
    """As it is typed, in three digits; and no other of the 64 values is gentler and quick enough."""
    found = compare(CRANE, [name], at_time="1.3x")
    (row,) = found.rows
    ((parameter, _),) = row.setting.items()
    run = simulate(CRANE, make_controller(name, {parameter: row.set_to.removeprefix(parameter)}))
    assert run.controller.parameters == row.run.controller.parameters
    for figure in ("k_dyn", "settled_time", "peak_torque", "end_time", "start_time"):
        np.testing.assert_array_equal(getattr(run, figure), getattr(row.run, figure))
    tried = over_time(CRANE, make_controller(name), found.at_time / 1.3, found.at_time)
    assert VALUES - 4 <= tried.values.size <= VALUES
    for i in range(0, tried.values.size, 15):
        alone = simulate(CRANE, make_controller(name, {parameter: float(tried.values[i])}))
        if not math.isnan(tried.settled_time[i]):
            assert (alone.k_dyn, alone.settled_time) == (tried.k_dyn[i], tried.settled_time[i])
        assert not (alone.settled_time <= found.at_time and alone.k_dyn < row.run.k_dyn)


def check_more_time(drive, name, shares):
    direct = simulate(drive, "direct").settled_time
    before = math.inf
    for share in shares:
        tried = over_time(drive, make_controller(name), direct, share * direct)
        best = tried.best(share * direct)
        k_dyn = math.inf if best is None else tried.k_dyn[list(tried.values).index(best[tried.name])]
        assert k_dyn <= before, (drive.name, name, share)
        before = k_dyn
    assert before < math.inf


@pytest.mark.parametrize("name", ["s-curve", "speed-ramp", "acceleration-delay"])
def test_more_time_never_costs_k_dyn(name):
    """The values tried do not depend on the time, so the best of them can only get better."""
    check_more_time(CRANE, name, (1.0, 1.1, 1.3, 2.0))


@pytest.mark.slow
@pytest.mark.parametrize("name", SET)
def test_more_time_never_costs_k_dyn_on_other_drives(name):
    for drive in ("servo-axis-small", "hoist-15kw", "crane-4amtkf-worn"):
        check_more_time(Drive.load(drive), name, np.geomspace(1.0, 3.0, 12).tolist())


def test_what_is_too_slow_is_said_with_its_quickest_value():
    worn = Drive.load("crane-4amtkf-light-worn")
    found = compare(worn, ["direct", "shaped", "ramp"], at_time="1.3x")
    assert [row.name for row in found.rows] == ["direct", "ramp"]
    (slow,) = found.too_slow
    value = slow.set_to.removeprefix("full_torque ")
    quickest = simulate(worn, make_controller("shaped", {"full_torque": value}))
    assert quickest.settled_time == slow.settled_time > found.at_time
    sentence = "shaped: no value of full_torque settles within 0.1919 s; the quickest, full_torque "
    assert slow.within(found.at_time).startswith(sentence)
    refused = r"at_time = 0\.1: give a longer time\. direct settles in 0\.3735 s, not within 0\.1 s\."
    with pytest.raises(InputError, match=refused):
        compare(CRANE, "direct", at_time=0.1)


def test_a_time_of_its_own_counts_as_it_is():
    """A parameter that is given is kept; a strategy without one has its own time."""

    class Own(PlainController):
        name = "own"

        def step(self, measured, state):
            return Command(50.0)

    found = compare(CRANE, [Own(), make_controller("ramp", {"time": 0.1})], at_time="0.6 s")
    assert [row.setting for row in found.rows] == [{}, {}]
    assert found.rows[1].run.controller.time == 0.1


def test_times_are_read_and_refused():
    direct = simulate(CRANE, "direct")
    assert equal_time("500 ms", direct) == equal_time(0.5, direct) == 0.5
    assert equal_time("1.3x", direct) == 1.3 * direct.settled_time
    for wrong in ("0x", "-1x", "0 s", -0.5, "infx", "soon"):
        with pytest.raises(InputError, match="at_time"):
            equal_time(wrong, direct)


def test_values_of_three_digits_are_not_above_what_they_round():
    rng = np.random.default_rng(1)
    for value in (10.0 ** rng.uniform(-6.0, 6.0, 2000)).tolist():
        assert value * (1.0 - 0.0101) < rounded(value) <= value * (1.0 + 1e-9)
        assert rounded(float(f"{value:.3g}")) == float(f"{value:.3g}")


def passing_of_a_grid(drive, changed, name, count):
    """How many settings keep the limits, of a grid that the test alone makes."""
    strategy, limits = make_controller(name), drive.limits
    free = [one for one in (strategy.time_parameter, *strategy.settings) if one]
    if not free:
        runs = [simulate(one, strategy, fitted_to=drive) for one in (drive, *changed)]
        return all(run.peak_torque <= limits.shaft_torque for run in runs)
    ready, each, axes = strategy.fitted(drive), round(count ** (1.0 / len(free))), []
    for one in free:
        default, unit = getattr(ready, one), declared_parameters(strategy)[one].unit
        low, high = 0.3 * default, min(4.0 * default, drive.Ms if unit == "N*m" else math.inf)
        if one == strategy.time_parameter and unit == "s":
            low, high = 0.02 * limits.start_time, 1.2 * limits.start_time
        axes.append(np.geomspace(low, high, each))
    settings = list(itertools.product(*axes))
    set_up = [replace(strategy, **dict(zip(free, one, strict=True))).set_up(drive) for one in settings]
    sound = [not ready.doubts(own) for ready, own in set_up]  # others are not set for limits
    rows = np.array(list(itertools.compress(settings, sound)))
    for machine in (drive, *changed):
        if rows.size:  # those that have kept the limits so far
            set_ups = replace(strategy, **dict(zip(free, rows.T, strict=True))).set_ups(drive)
            where, longest = np.zeros(len(rows), np.int64), 3.0 * limits.start_time
            figures = prepared([machine]).figures(
                set_ups, drive.mean_torque, where, settled=True, time_limit=longest, workers=2
            )
            rows = rows[figures["margin"][0] >= 0.0]
    return len(rows)


def check_recommendation(drive, controllers, count, cases=()):
    found = compare(drive, controllers, worst_case=cases)
    changed = [drive.scaled(gaps=4.0), drive.scaled(load_inertia=0.4)] if cases else []
    chosen, names = found.recommendation.recommended, [row.name for row in found.rows]
    if chosen is None:
        lower = [one for one in names if make_controller(one).effort is not Effort.ENCODER]
    else:
        for one in (drive, *changed):
            alone = simulate(one, make_controller(chosen.name, chosen.setting), fitted_to=drive)
            assert alone.peak_torque <= drive.limits.shaft_torque
            assert alone.limited_time <= drive.limits.start_time
        k_dyn = simulate(drive, make_controller(chosen.name, chosen.setting)).k_dyn
        assert k_dyn <= HIGHER * simulate(drive, "direct").k_dyn
        assert all(f"{key} {value:g}" in found.recommendation.text for key, value in chosen.setting.items())
        lower = [row.name for row in found.rows if row.effort.order < chosen.effort.order]
    for one in lower:
        if make_controller(one).effort is not None:  # without a sensor that drives do not have
            assert passing_of_a_grid(drive, changed, one, count) == 0, (drive.name, one)


def test_the_setting_recommended_passes_and_no_simpler_one_does():
    drive = CRANE.replace(permissible_torque=51.5, permissible_start_time=0.4856)
    check_recommendation(drive, ["direct", "s-curve", "acceleration-delay"], 400)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "cases"),
    [*((name, ()) for name in library.names()), ("nordin-servo-60kw", CASES), ("crane-4amtkf", CASES)],
)
def test_on_each_shipped_drive_no_setting_of_less_effort_passes(name, cases):
    """Limits at 1.2 times the peak of the optimum in 1.3 times the time of direct; a grid of 4,000."""
    drive = Drive.load(name)
    longest = 1.3 * simulate(drive, "direct").settled_time
    peak = optimize(drive, start_time=longest).run.peak_torque
    limited = drive.replace(permissible_torque=1.2 * peak, permissible_start_time=longest)
    check_recommendation(limited, None, 4000, cases)
