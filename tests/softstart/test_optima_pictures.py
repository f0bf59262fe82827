"""Figures of optima: the data behind them."""

import numpy as np
import pytest

from softstart import Drive
from softstart.optimal.check import replayed
from softstart.optimal.front import ControllerPoint, Front, FrontPoint
from softstart.optimal.problem import Problem
from softstart.optimal.result import LowerBound, Optimum
from softstart.profile import TorqueProfile
from softstart.views.drawing import save_figure
from softstart.views.optima import front_figure, optimum_figure, scenario_table

CRANE = Drive.load("crane-4amtkf").replace(target_speed=60.0)


def optimum(kind="certificate", **options) -> Optimum:
    """A start that is no optimum, but has all that is drawn."""
    problem = Problem(CRANE, 0.28, **options)
    profile = TorqueProfile.steps([0.0, 0.0184, 0.0333, 0.34], [62.0, 0.0, 55.0])
    runs = replayed(problem, profile, 0.28)
    return Optimum(problem, profile, runs, LowerBound(0.9, kind, "all"), "descent", "why", 1.0, 0.28, 0.1)


def lines(axes):
    return {line.get_label(): line for line in axes.get_lines()}


def test_an_optimum_is_drawn_from_its_run():
    best = optimum()
    motor, shaft, speed, twist = optimum_figure(best).axes
    run = best.run
    assert np.array_equal(lines(shaft)["shaft torque T"].get_xydata(), np.column_stack([run.t, run.T]))
    assert [run.peak_time, run.peak_torque] in [line.get_xydata()[0].tolist() for line in shaft.get_lines()]
    assert lines(shaft)["bound"].get_ydata()[0] == 0.9 * best.problem.base_torque
    assert lines(shaft)["K_dyn = 1"].get_ydata()[0] == best.problem.base_torque
    assert np.array_equal(lines(motor)["realised u"].get_ydata(), run.u)
    demand = lines(motor)["demand"].get_xydata()
    assert demand.tolist() == [
        [0, 62],
        [0.0184, 62],
        [0.0184, 0],
        [0.0333, 0],
        [0.0333, 55],
        [run.end_time, 55],
    ]
    assert np.array_equal(lines(speed)["load w2"].get_ydata(), run.w2)
    assert lines(speed)["allowed"].get_xdata()[0] == 0.28
    assert np.array_equal(twist.get_lines()[0].get_ydata(), run.theta)
    assert twist.get_title(loc="left").endswith(f"{run.contacts} contacts")


def test_no_bound_no_line():
    shaft = optimum_figure(optimum(kind="none")).axes[1]
    assert "bound" not in lines(shaft)
    assert "at least" not in shaft.get_title(loc="left")


@pytest.mark.parametrize("options", [{}, {"torque_speed": ((0.0, 62.0), (60.0, 55.0))}])
def test_titles_and_legends_keep_apart(options):
    figure = optimum_figure(optimum(**options))
    figure.draw_without_rendering()
    for axes in figure.axes:
        if axes.get_legend() is not None:
            assert axes._left_title.get_window_extent().x1 < axes.get_legend().get_window_extent().x0


def point(time, k, low=None):
    return FrontPoint(time, "reached", "OPTIMAL", "", k_dyn=k, k_dyn_lower_bound=low)


def front(controllers):
    points = [
        FrontPoint(0.22, "reached", "INFEASIBLE", "too short", shortest_start_time=0.235),
        *(point(t, 0.6 + 0.2 / (t - 0.1), 0.59 + 0.2 / (t - 0.1)) for t in np.linspace(0.24, 0.5, 9)),
    ]
    placed = [ControllerPoint(name, k, time, "", point(time, 1.0)) for name, time, k in controllers]
    return Front(CRANE, "reached", tuple(points), tuple(placed))


CROWDED = [
    ("direct", 0.2402, 3.1), ("ramp", 0.262, 2.1), ("s-curve", 0.262, 1.9), ("own", 0.2634, 1.95),
    ("reduced-first-stage", 0.236, 2.39),
    ("reduced-two-stage", 0.2632, 2.39), ("acceleration-delay", 0.2633, 2.387),
    ("current-limit-feedback", 0.27, 1.3), ("pulse-coast-hold", 0.28, 1.45),
]  # fmt: skip


def test_the_front_is_drawn_from_its_points():
    one = front(CROWDED)
    axes = front_figure(one).axes[0]
    found = [p for p in one.points if p.found]
    drawn = lines(axes)
    assert drawn["optimum"].get_xydata().tolist() == [[p.start_time_bound, p.k_dyn] for p in found]
    assert drawn["lower bound"].get_ydata().tolist() == [p.k_dyn_lower_bound for p in found]
    assert drawn["no optimum"].get_xdata().tolist() == [0.22]
    assert drawn["shortest found, 0.2350 s"].get_xdata()[0] == 0.235
    for name, time, k in CROWDED:
        assert drawn[f"{name}, x{k:.2f}"].get_xydata().tolist() == [[time, k]]


def test_a_tall_front_has_a_logarithmic_axis_a_flat_one_begins_at_zero():
    assert front_figure(front([("direct", 0.24, 9.0)])).axes[0].get_yscale() == "log"
    flat = front_figure(front([])).axes[0]
    assert (flat.get_yscale(), flat.get_ylim()[0]) == ("linear", 0.0)


def test_pictures_are_files(tmp_path):
    for stem, figure in (("a", optimum_figure(optimum())), ("b", front_figure(front(CROWDED)))):
        save_figure(figure, tmp_path, stem)
        assert (tmp_path / f"{stem}.png").read_bytes().startswith(b"\x89PNG")
        assert "</svg>" in (tmp_path / f"{stem}.svg").read_text("utf-8")


def test_one_profile_for_several_machines_is_drawn_from_all_runs():
    best = optimum(
        terminal="reached", scenarios=(CRANE.replace(gap=0.4), CRANE.with_gap(1.0, load_inertia=0.1))
    )
    shaft = optimum_figure(best).axes[1]
    drawn = [line.get_xydata() for line in shaft.get_lines()]
    for run in best.runs:
        assert any(np.array_equal(one, np.column_stack([run.t, run.T])) for one in drawn)
    worst = max(best.runs, key=lambda run: run.peak_torque)
    assert [worst.peak_time, worst.peak_torque] in [one[0].tolist() for one in drawn]
    rows = scenario_table(best).rows
    assert [row[:3] for row in rows] == [
        ["1", "0.500", "0.1750"], ["2", "0.400", "0.1750"], ["3", "1.000", "0.1000"],
    ]  # fmt: skip
    assert [float(row[4]) for row in rows] == pytest.approx(best.k_dyn_each, abs=1e-4)


def test_a_front_without_any_optimum_is_drawn():
    refused = FrontPoint(0.2, "reached", "INFEASIBLE", "too short", shortest_start_time=0.235)
    assert front_figure(Front(CRANE, "reached", (refused,), ())).axes[0].get_legend() is not None
