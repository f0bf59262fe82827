"""The figures of a report: nothing is cut off, no name is taken for a formula, no label for its neighbour."""

import itertools
import re

import numpy as np
import pytest

from softstart import Drive, TorqueProfile, simulate
from softstart.controller import make_controller
from softstart.controller.tuned import RobustGains
from softstart.reporting import report
from softstart.reporting.document import templates
from softstart.reporting.figures import limit_figure, traces_figure
from softstart.reporting.limit import Limit
from softstart.views.numbers import units_of

from .conftest import Page

CRANE = Drive.load("crane-4amtkf").replace(target_speed=60.0)


def test_traces_of_a_braking_motor_are_in_the_frame_and_all_in_one_scale():
    drive = CRANE.replace(minimum_torque=-50.0)
    brakes = make_controller("profile", {"profile": TorqueProfile([0, 0.02, 0.02, 0.03, 0.03, 1.0],
                                                                  [62, 62, -50, -50, 62, 62])})  # fmt: skip
    runs = [simulate(drive, brakes), simulate(drive, "direct")]
    assert runs[0].u.min() == -50.0
    rows = report(drive, controllers=[brakes, "direct"], budget=0.0).comparison.rows
    figure = traces_figure(rows)
    panels = [axes for axes in figure.axes if axes.get_lines()]
    assert len(panels) == 2
    assert len({panel.get_ylim() for panel in panels}) == 1  # the caption says so
    for panel in panels:
        low, high = panel.get_ylim()
        for line in panel.get_lines():
            assert low <= np.min(line.get_ydata()) <= np.max(line.get_ydata()) <= high


def test_names_in_figures_are_taken_literally():
    labels = ["a$\\frac{$", "x$y$z", "\u96fb\u52d5\u6a5f", "so long a name " * 20]
    gains = [RobustGains(label, make_controller("ramp"), CRANE) for label in labels]
    made = report(CRANE, controllers=["direct", *gains], budget=0.0)
    page = made.to_html()  # warnings are errors here
    figure = traces_figure(made.comparison.rows[1:])
    for label, axes in zip(labels, figure.axes, strict=False):
        assert label in page
        shown = axes.get_title(loc="left").replace("\\$", "$").partition(":")[0]
        assert len(shown) <= 32
        assert f"ramp ({label})".startswith(shown.rstrip("\N{HORIZONTAL ELLIPSIS}"))


def test_a_single_strategy_has_a_limit_figure():
    choice = report(CRANE, controllers=["direct"], budget=0.0).choice
    left, right = limit_figure(choice.comparison.rows, [], Limit()).axes[0].get_xlim()
    assert left <= choice.chosen.run.start_time <= right


@pytest.mark.parametrize("drive", ["tiny", "huge", "crane-4amtkf", "servo-axis-small", "nordin-servo-60kw"])
def test_labels_of_the_scheme_are_inside_and_clear_of_each_other(drive):
    if drive == "tiny":
        made = CRANE.replace(
            motor_inertia=1.2345e-7, load_inertia=9.8765e-7, gap=0.00698132, damping=2.125e-6,
            stiffness=0.912345, load_torque=0.000812345, starting_torque=0.0112345,
            maximum_torque=0.0312345, load_kind="reactive",
        )  # fmt: skip
    elif drive == "huge":
        made = CRANE.replace(
            motor_inertia=48.25, load_inertia=390.125, stiffness=210500.0, damping=912.5,
            starting_torque=155250.0, maximum_torque=160125.0, load_torque=42125.0,
        )  # fmt: skip
    else:
        made = Drive.load(drive)
    picture = templates().get_template("scheme.svg.j2").render(drive=made, units=units_of(made))
    width = float(re.search(r'viewBox="0 0 (\d+) 300"', picture)[1])
    boxes = []
    pattern = r'<text x="([\d.]+)" y="([\d.]+)" text-anchor="(\w+)" font-size="(\d+)"[^>]*>([^<]*)<'
    for x, y, anchor, size, text in re.findall(pattern, picture):
        wide = 0.58 * float(size) * len(text)  # of digits in the widest font of the list
        left = float(x) - wide * {"start": 0.0, "middle": 0.5, "end": 1.0}[anchor]
        boxes.append((left, float(y) - float(size), left + wide, float(y), text))
    assert len(boxes) >= 12
    for left, top, right, bottom, text in boxes:
        assert 0.0 <= left <= right <= width, text
        assert 0.0 <= top <= bottom <= 300.0, text
    for one, other in itertools.combinations(boxes, 2):
        across = min(one[2], other[2]) - max(one[0], other[0])
        upward = min(one[3], other[3]) - max(one[1], other[1])
        assert across <= 0.0 or upward <= 0.0, (one[4], other[4])


def test_traces_that_are_cut_off_are_named():
    slow = make_controller("ramp", {"time": 5.0})
    made = report(CRANE, controllers=["direct", slow], budget=0.0)
    assert "The start of ramp goes on beyond the" in Page(made.to_html()).text
    made = report(CRANE, controllers=["direct", "ramp"], budget=0.0)
    assert "goes on beyond" not in Page(made.to_html()).text
