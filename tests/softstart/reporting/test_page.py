"""The HTML file: it holds the numbers, loads nothing, and no text from outside gets out of its place."""

import re
from collections import Counter
from html import unescape

import pytest

from softstart import Drive, compare, fatigue, optimize, report
from softstart.reporting.document import css_string
from softstart.reporting.figures import svg
from softstart.views.fatigue import factor
from softstart.views.numbers import plain

from .conftest import COMMAND, HOSTILE, Page, verbatim


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


@pytest.mark.parametrize("text", ['"', "\\", "\n", "</style>", "}", "\u00e9\U0001f600", "\\a "])
def test_css_strings_end_where_they_end(text):
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
        lost = float(cells["start later, s"].replace("\N{MINUS SIGN}", "-"))
        assert lost == pytest.approx(row.time_lost, abs=5e-4)


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


def test_figures_are_vector_named_and_the_same_each_time(read, page):
    assert read.elements["svg"] == read.elements["figure"] == read.elements["figcaption"] == 5
    assert page.count('role="img"') == 5
    assert "data:image" not in page

    def drawn():
        from softstart.views.drawing import new_figure

        figure, axes = new_figure()
        axes.plot([0, 1], [0, 1], "o")
        return svg(figure, "figure-9", "a < b")

    assert drawn() == drawn()
    assert "<metadata" not in drawn()
    assert 'aria-label="a &lt; b"' in drawn()


def test_provenance_holds_the_drive(page, hostile):
    assert Drive.from_toml(hostile.provenance["drive"]) == hostile.drive
    (file,) = verbatim(page)
    assert Drive.from_toml(unescape(file)) == hostile.drive


def test_life_of_the_shaft_line_where_it_is_asked_for(hostile):
    asked = Drive.load("crane-4amtkf").replace(fatigue_slope=6.6, fatigue_torque=90, fatigue_cycles=2e6)
    assert "How long the shaft line lasts" not in hostile.to_html()
    assert hostile.summary()["life"] is None
    made = report(asked.replace(damping=1.0), controllers=["ramp"], budget=0.0)
    page = Page(made.to_html())
    wanted = fatigue([row.run for row in made.comparison.rows])
    assert plain(made.summary()["life"]) == plain(wanted.summary())  # NaN as None
    (shown,) = [one for one in page.tables if "life over direct" in one[0]]
    column = shown[0].index("life over direct")
    assert {row[0]: row[column] for row in shown[1:]} == {
        row.run.controller_name: factor(row.relative) for row in wanted.rows
    }
    refused = report(asked, controllers=["ramp"], budget=0.0).to_html()
    assert "Lives cannot be given: damping is missing in motor - load: an undamped shaft rattles" in refused
