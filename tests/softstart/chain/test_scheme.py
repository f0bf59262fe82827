"""The scheme: an SVG that can be read, to the scales it states."""

from __future__ import annotations

import re
from itertools import pairwise
from xml.etree import ElementTree

import pytest

from softstart.chain import Chain, Mass, Shaft
from softstart.chain.elements import LIBRARY
from softstart.views.chain_schemes import scheme_svg

SVG = "{http://www.w3.org/2000/svg}"


def discs(text: str) -> list[ElementTree.Element]:
    return [one for one in ElementTree.fromstring(text).iter(f"{SVG}rect") if one.get("rx")]


@pytest.mark.parametrize("name", LIBRARY.names())
def test_everything_is_named_and_inside(name: str) -> None:
    chain = Chain.load(name)
    text = scheme_svg(chain)
    root = ElementTree.fromstring(text)
    said = [one.text for one in root.iter(f"{SVG}text")]
    assert all(mass.name in said for mass in chain.masses)
    assert f"assumed: {chain.assumed}" in said
    assert "node" in said
    width = float(root.attrib["width"])
    for one in root.iter(f"{SVG}rect"):
        if one.get("x"):
            assert 0.0 <= float(one.attrib["x"]) <= width
    assert len(discs(text)) == len(chain.masses)


def test_discs_go_with_the_fourth_root_of_inertia() -> None:
    heights = [float(d.attrib["height"]) for d in discs(scheme_svg(Chain([Mass(16), Mass(1)], [Shaft(1)])))]
    assert heights[0] / heights[1] == pytest.approx(2.0, rel=1e-2)


def test_gaps_are_to_scale() -> None:
    """The opening between the stops less the claw and the least opening."""
    chain = Chain([Mass(1)] * 3, [Shaft(1, gap=0.1), Shaft(1, gap=0.3)])
    stops = re.findall(r'<polyline points="([^"]*)" fill="none" stroke="#c2403a"', scheme_svg(chain))
    openings = []
    for points in stops:
        xs = [float(point.split(",")[0]) for point in points.split()]
        openings.append(max(xs) - min(xs) - 5.0 - 3.0)
    assert openings[1] / openings[0] == pytest.approx(3.0, rel=1e-2)


def test_names_cannot_break_the_file() -> None:
    chain = Chain([Mass(1, name="<a & b>"), Mass(1)], [Shaft("inf")])
    with pytest.raises(ValueError, match="nothing vibrates"):
        scheme_svg(chain)
    chain = Chain([Mass(1, name="<a & b>"), Mass(1)], [Shaft(1)], name="x < y")
    assert "<a & b>" in [one.text for one in ElementTree.fromstring(scheme_svg(chain)).iter(f"{SVG}text")]


def test_long_names_stay_on_the_page_and_apart() -> None:
    """At the letters' width of the drawing: no name leaves the page, none runs into its neighbour."""
    names = [
        "crank nose + cylinders 1 to 6 + flywheel of the engine",
        "clutch and gear box",
        "steering + track",
    ]
    chain = Chain([Mass(3.0, name=names[0]), *(Mass(0.1, name=one) for one in names[1:])], [Shaft(1e3)] * 2)
    root = ElementTree.fromstring(scheme_svg(chain))
    spans: dict[str, list[float]] = {}
    for one in root.iter(f"{SVG}text"):
        title = one.find(f"{SVG}title")
        name = one.text if title is None else title.text
        if name in names:
            half = 3.3 * len(one.text or "")
            x = float(one.attrib["x"])
            assert one.attrib["text-anchor"] == "middle"
            spans.setdefault(name, []).extend([x - half, x + half])
    assert list(spans) == names
    row = [(min(span), max(span)) for span in spans.values()]
    assert row[0][0] > 0.0
    assert row[-1][1] < float(root.attrib["width"])
    assert all(before[1] < after[0] for before, after in pairwise(row))


def test_names_that_would_meet_are_slanted() -> None:
    masses = [
        Mass(1, name="the first of the long names"),
        Mass(1, name="the second of the long names"),
        Mass(1),
    ]
    text = scheme_svg(Chain(masses, [Shaft(1000), Shaft(1)]))
    assert text.count("rotate(-35") == 3
