"""The HTML file: its numbers and figures are right, it loads nothing, and no text from outside gets out."""

import itertools
import re
from collections import Counter

import pytest

from softstart import Drive, compare, fatigue, optimize
from softstart.controller import make_controller
from softstart.controller.tuned import RobustGains
from softstart.reporting import report
from softstart.reporting.document import css_string, templates
from softstart.views.fatigue import factor
from softstart.views.numbers import json_ready, units_of
from softstart.views.traces import comparison_figure

from .conftest import COMMAND, HOSTILE, Page


def test_nothing_is_loaded_from_anywhere(read, page):
    assert not set(read.elements) & {"script", "img", "image", "link", "iframe", "object", "embed", "video",
                                     "base", "form", "foreignobject"}  # fmt: skip
    for element, key, value in read.attributes:
        assert not key.startswith("on"), (element, key)
        if key in ("href", "src", "xlink:href", "srcset", "data", "action"):
            assert value.startswith("#"), (element, key, value)
        for url in re.findall(r"url\(([^)]*)\)", value):
            assert url.startswith("#")
    css = re.search(r"<style>(.*?)</style>", page, re.DOTALL)[1]
    assert "url(" not in css
    assert "@import" not in css
    policies = [value for name, key, value in read.attributes if (name, key) == ("meta", "content")]
    assert "default-src 'none'; style-src 'unsafe-inline'" in policies


def test_ids_are_unique_and_every_reference_leads_to_one(read, page):
    assert [name for name, count in Counter(read.ids).items() if count > 1] == []
    wanted = {value[1:] for _, key, value in read.attributes if key.endswith("href")}
    wanted |= set(re.findall(r"url\(#([^)]+)\)", page))
    wanted |= {v for _, key, value in read.attributes if key == "aria-labelledby" for v in value.split()}
    assert len(wanted) > 20
    assert wanted <= set(read.ids)


def test_text_from_outside_stays_text(read, page):
    assert read.text.count(HOSTILE) >= 3  # title, heading, source
    assert COMMAND in read.text
    assert "<script" not in page.lower()
    assert "<img" not in page.lower()
    assert page.count("</style>") == page.count("</title>") - 1 == 1
    header = re.search(r"@top-left \{ content: (\"[^\"]*\");", page)[1]
    assert set(header) <= set('"\\ 0123456789abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ')
    decoded = re.sub(r"\\([0-9a-f]+) ", lambda m: chr(int(m[1], 16)), header[1:-1])
    assert HOSTILE.startswith(decoded[:-1])
    for text in ('"', "\\", "\n", "</style>", "}", "\u00e9\U0001f600", "\\a "):
        written = css_string(text)
        assert re.sub(r"\\([0-9a-f]+) ", lambda m: chr(int(m[1], 16)), written[1:-1]) == text
        assert not set(written[1:-1]) & set('"<>}\n')


def test_numbers_are_those_of_compare(read, hostile):
    names = [row.run.controller.name for row in hostile.comparison.rows]
    made = {row.run.controller.name: row for row in compare(hostile.drive, names).rows}
    table = read.rows("contacts")
    assert set(table) == set(names)
    for name, row in made.items():
        cells = table[name]
        assert cells["K_dyn"] == f"{row.run.k_dyn:.3f}"
        assert cells["K worn"] == f"{row.k_dyn_worn_gap:.3f}"
        assert cells["K light"] == f"{row.k_dyn_light_load:.3f}"
        assert float(cells["start time, s"]) == pytest.approx(row.run.start_time, rel=1e-3)
        assert float(cells["peak, N m"]) == pytest.approx(row.run.peak_torque, rel=1e-3)
        assert float(cells["settled, s"]) == pytest.approx(row.run.settled_time, rel=1e-3)
        later = float(cells["later, %"].replace("\N{MINUS SIGN}", "-"))
        share = row.settled_lost / (row.run.settled_time - row.settled_lost)
        assert later == pytest.approx(100.0 * share, abs=0.051)


def test_limit_is_that_of_optimize(read, hostile):
    table = read.rows("lowest known in that time")
    for row in hostile.comparison.rows:
        name, time = row.run.controller.name, row.run.start_time
        point = hostile.limit.optimum_at(time)
        if point is None:
            assert "optimum" not in table[name]["lowest known in that time"]
            assert time in hostile.limit.missing or name == "reduced-first-stage"  # not searched
            continue
        best = optimize(hostile.drive, time, terminal="reached")
        assert point.k_dyn == best.k_dyn
        assert hostile.lower_bound(row) <= best.k_dyn <= row.run.k_dyn
        assert table[name]["lowest known in that time"].startswith(f"{best.k_dyn:.3f}")
        assert table[name]["lower bound at that time"] == f"{hostile.lower_bound(row):.3f}"
    assert hostile.limit.optimum_at(hostile.choice.chosen.run.start_time) is not None


def test_life_of_the_shaft_line_where_it_is_asked_for(hostile):
    asked = Drive.load("crane-4amtkf").replace(fatigue_slope=6.6, fatigue_torque=90, fatigue_cycles=2e6)
    assert "Fatigue life of the shaft line" not in hostile.to_html()
    assert hostile.summary()["life"] is None
    made = report(asked.replace(damping=1.0), controllers=["ramp"], budget=0.0)
    page = Page(made.to_html())
    wanted = fatigue([row.run for row in made.comparison.rows])
    assert json_ready(made.summary()["life"]) == json_ready(wanted.summary())  # NaN as None
    (shown,) = [one for one in page.tables if "life over direct" in one[0]]
    column = shown[0].index("life over direct")
    assert {row[0]: row[column] for row in shown[1:]} == {
        row.run.controller_name: factor(row.relative) for row in wanted.rows
    }


CRANE = Drive.load("crane-4amtkf").replace(target_speed=60.0)


def test_names_in_figures_are_taken_literally():
    labels = ["a$\\frac{$", "x$y$z", "\u96fb\u52d5\u6a5f", "so long a name " * 20]
    gains = [RobustGains(label, make_controller("ramp"), CRANE) for label in labels]
    made = report(CRANE, controllers=["direct", *gains], budget=0.0)
    page = made.to_html()  # warnings are errors here
    figure = comparison_figure(made.comparison.rows[1:])
    for label, axes in zip(labels, figure.axes, strict=False):
        assert label in page
        shown = axes.get_title(loc="left").replace("\\$", "$").partition(":")[0]
        assert len(shown) <= 32
        assert f"ramp ({label})".startswith(shown.rstrip("\N{HORIZONTAL ELLIPSIS}"))


@pytest.mark.parametrize("drive", ["tiny", "servo-axis-small"])
def test_labels_of_the_scheme_are_inside_and_clear_of_each_other(drive):
    if drive == "tiny":
        made = CRANE.replace(
            motor_inertia=1.2345e-7, load_inertia=9.8765e-7, gap=0.00698132, damping=2.125e-6,
            stiffness=0.912345, load_torque=0.000812345, starting_torque=0.0112345,
            maximum_torque=0.0312345, load_kind="reactive",
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
