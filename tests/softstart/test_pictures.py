"""What is drawn and what a notebook shows: the data behind it, well-formed, and never a script."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from itertools import combinations

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.text import Text
from tests.twin import chain_of

from softstart import Comparison, Drive, Run, compare, fatigue, optimize, side_by_side, simulate
from softstart.optimal.check import replayed
from softstart.optimal.front import ControllerPoint, Front, FrontPoint
from softstart.optimal.problem import Problem
from softstart.optimal.result import LowerBound, Optimum
from softstart.page.tasks import COLUMN
from softstart.profile import TorqueProfile
from softstart.views.drawing import narrowed
from softstart.views.optima import front_figure, optimum_figure
from softstart.views.traces import run_figure

CRANE = Drive.load("crane-4amtkf").replace(target_speed=60.0)


def optimum(**options) -> Optimum:
    """A start that is no optimum, but has all that is drawn."""
    problem = Problem(CRANE, 0.28, **options)
    profile = TorqueProfile.steps([0.0, 0.0184, 0.0333, 0.34], [62.0, 0.0, 55.0])
    runs = replayed(problem, profile, 0.28)
    bound = LowerBound(0.9, "duality", "all")
    return Optimum(problem, profile, runs, bound, "descent", "why", 1.0, 0.28, 0.1)


def lines(axes):
    return {line.get_label(): line for line in axes.get_lines()}


def test_an_optimum_is_drawn_from_its_run():
    best = optimum()
    motor, shaft, speed, twist = optimum_figure(best).axes
    run = best.run
    assert np.array_equal(lines(shaft)["shaft torque T"].get_xydata(), np.column_stack([run.t, run.T]))
    assert [run.peak_time, run.peak_torque] in [line.get_xydata()[0].tolist() for line in shaft.get_lines()]
    assert lines(shaft)["bound"].get_ydata()[0] == 0.9 * best.problem.base_torque
    assert np.array_equal(lines(motor)["realised u"].get_ydata(), run.u)
    assert lines(motor)["demand"].get_xydata().tolist() == [
        [0, 62], [0.0184, 62], [0.0184, 0], [0.0333, 0], [0.0333, 55], [run.end_time, 55],
    ]  # fmt: skip
    assert np.array_equal(lines(speed)["load w2"].get_ydata(), run.w2)
    assert np.array_equal(twist.get_lines()[0].get_ydata(), run.theta)


def test_one_profile_for_several_machines_is_drawn_from_all_runs():
    several = (CRANE.replace(gap=0.4), CRANE.with_gap(1.0, load_inertia=0.1))
    best = optimum(terminal="reached", scenarios=several)
    drawn = [line.get_xydata() for line in optimum_figure(best).axes[1].get_lines()]
    for run in best.runs:
        assert any(np.array_equal(one, np.column_stack([run.t, run.T])) for one in drawn)
    worst = max(best.runs, key=lambda run: run.peak_torque)
    assert [worst.peak_time, worst.peak_torque] in [one[0].tolist() for one in drawn]


CROWDED = [("direct", 0.2402, 3.1), ("ramp", 0.262, 2.1), ("s-curve", 0.262, 1.9)]


def front() -> Front:
    points = [FrontPoint(0.22, "reached", "INFEASIBLE", "too short", shortest_start_time=0.235)]
    for time, k_dyn in ((0.24, 2.0), (0.3, 1.6)):
        points.append(FrontPoint(time, "reached", "OPTIMAL", "", k_dyn=k_dyn, k_dyn_lower_bound=k_dyn - 0.01))
    optimal = FrontPoint(0.3, "reached", "OPTIMAL", "", k_dyn=1.0)
    placed = [ControllerPoint(name, k, time, "", optimal) for name, time, k in CROWDED]
    return Front(CRANE, "reached", tuple(points), tuple(placed))


def test_a_front_is_drawn_from_its_points():
    drawn = lines(front_figure(front()).axes[0])
    assert drawn["optimum"].get_xydata().tolist() == [[0.24, 2.0], [0.3, 1.6]]
    assert drawn["lower bound"].get_ydata().tolist() == [1.99, 1.59]
    assert drawn["no optimum"].get_xdata().tolist() == [0.22]
    for name, time, k in CROWDED:
        assert drawn[f"{name}, x{k:.2f}"].get_xydata().tolist() == [[time, k]]


@pytest.mark.parametrize(
    "make",
    [
        lambda drive: simulate(drive, "ramp"),
        lambda drive: simulate(chain_of(drive), "ramp"),
        lambda drive: compare(drive, ["direct", "ramp", "shaped"]),
        lambda drive: fatigue([simulate(drive, "direct"), simulate(drive, "ramp")]),
        lambda drive: optimize(drive.replace(damping=0.0), 0.45),
    ],
)
def test_a_cell_is_well_formed_and_shows_the_figures(make):
    drive = CRANE.replace(name="<script>alert(1)</script> & co", damping=1.0)
    made = make(drive)
    text = made._repr_html_()
    assert "<script" not in text
    assert "&lt;script&gt;alert(1)&lt;/script&gt; &amp; co" in text
    assert text.count("<svg") == 1
    page = ET.fromstring(f"<div>{text.replace('<br>', '<br/>')}</div>")
    cells = ["".join(cell.itertext()) for cell in page.iter("td")]
    assert len(cells) >= 6
    if isinstance(made, Run | Comparison):
        run = made if isinstance(made, Run) else made.rows[1].run
        assert any(cell.startswith(f"{run.k_dyn:.3f}") for cell in cells)


STRATEGIES = ["direct", "ramp", "s-curve", "shaped", "take-up"]
ANSWERS = {
    "optimum": lambda: optimum_figure(optimum()),
    "front": lambda: front_figure(front()),
    "run": lambda: run_figure(simulate(CRANE, "ramp")),
    "beside": lambda: drawn(side_by_side(CRANE, "hoist-15kw", STRATEGIES), "beside"),
    "trade-off": lambda: drawn(compare(CRANE, STRATEGIES), "trade-off"),
}


def drawn(result, stem):
    return result.sheet.figures[stem]()


@pytest.mark.parametrize("draw", ANSWERS.values(), ids=ANSWERS)
def test_a_figure_in_a_column_of_the_page_can_be_read(draw):
    wide, figure = draw(), narrowed(draw())
    FigureCanvasAgg(figure).draw()
    frame = figure.get_window_extent()
    texts = [one for one in figure.findobj(Text) if one.get_text().strip() and one.get_visible()]
    points = COLUMN / frame.width * figure.dpi / 72.0  # pixels of a point in the column
    assert min(one.get_fontsize() for one in texts) * points > 8.0
    titles = [one for one in texts if one in {axes._left_title for axes in figure.axes}]
    boxes = [one.get_window_extent() for one in (*titles, *legends_of(figure))]
    assert not any(one.overlaps(other) for one, other in combinations(boxes, 2))
    names = [axes.xaxis.label for axes in figure.axes if axes.get_xlabel()]
    boxes += [one.get_window_extent() for one in (*names, *figure.texts)]
    outside = frame.padded(3.0)
    assert all(outside.contains(box.x0, box.y0) and outside.contains(box.x1, box.y1) for box in boxes)
    for old, new in zip(wide.axes, figure.axes, strict=True):  # the same is drawn
        pairs = zip(old.get_lines(), new.get_lines(), strict=True)
        assert all(np.array_equal(*(line.get_xydata() for line in pair)) for pair in pairs)
    said = [text.get_text() for legend in legends_of(wide) for text in legend.get_texts()]
    assert [text.get_text() for legend in legends_of(figure) for text in legend.get_texts()] == said


def legends_of(figure):
    return [*(legend for one in figure.axes if (legend := one.get_legend())), *figure.legends]


def test_panels_side_by_side_keep_their_width():
    damped = CRANE.replace(damping=0.5)
    figure = next(iter(fatigue([simulate(damped, "ramp")]).sheet.figures.values()))()
    before = figure.get_size_inches().tolist()
    assert narrowed(figure).get_size_inches().tolist() == before
