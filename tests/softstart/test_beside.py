"""Two machines side by side: the figures are those of two comparisons, and no chain is beside a drive."""

from __future__ import annotations

import math

import pytest

from softstart import Chain, Drive, InputError, compare, report, side_by_side, simulate
from softstart.views.drawing import strategy_colours
from softstart.views.traces import comparison_figure

CRANE = Drive.load("crane-4amtkf")
NAMES = ["direct", "ramp", "s-curve"]


def test_each_machine_has_the_figures_of_its_own_comparison() -> None:
    both = side_by_side(CRANE, "conveyor-11kw", NAMES)
    for k, machine in enumerate((CRANE, "conveyor-11kw")):
        alone = {row.name: row.run for row in compare(machine, NAMES).rows}
        for pair in both.pairs:
            run = pair[k].run
            assert (run.k_dyn, run.settled_time) == (
                alone[run.controller_name].k_dyn,
                alone[run.controller_name].settled_time,
            )
    (table,) = both.tables
    assert [row[0] for row in table.rows] == ["s-curve", "ramp", "direct"]  # by K_dyn on the first
    for row in table.rows:
        pair = next(pair for pair in both.pairs if pair[0].name == row[0])
        assert [float(cell) for cell in row[1:3]] == [round(one.run.k_dyn, 3) for one in pair]
        assert [float(cell) for cell in row[3:5]] == pytest.approx(
            [one.run.peak_torque for one in pair], abs=0.05
        )
        assert [float(cell) for cell in row[5:7]] == pytest.approx(
            [one.run.settled_time for one in pair], abs=5e-5
        )


def test_after_wear_strategies_stay_set_up_for_the_new_machine() -> None:
    """The time from contact to the peak of stage 2, [G](14), follows from the gap: K_dyn tells which gap."""
    both = side_by_side(CRANE, None, [*NAMES, "reduced-two-stage"], worn_gap="2 rad")
    assert both.second.drive.gap == 2.0
    for new, worn in both.pairs:
        assert new.run.k_dyn == simulate(CRANE, new.name).k_dyn
        assert worn.run.k_dyn == simulate(CRANE.with_gap(2.0), new.name, fitted_to=CRANE).k_dyn
    k_dyn = {worn.name: worn.run.k_dyn for _, worn in both.pairs}
    assert k_dyn["reduced-two-stage"] > simulate(CRANE.with_gap(2.0), "reduced-two-stage").k_dyn + 0.01


def test_the_figure_shows_both() -> None:
    both = side_by_side(CRANE, "conveyor-11kw", NAMES)
    (draw,) = both.figures.values()
    (axes,) = draw().axes
    drawn = {tuple(map(float, line.get_xydata()[-1])) for line in axes.lines}
    assert {(row.run.settled_time, row.run.k_dyn) for pair in both.pairs for row in pair} <= drawn | {
        tuple(map(float, point)) for mark in axes.collections for point in mark.get_offsets()
    }


def test_a_strategy_has_one_colour_and_mark_in_all_figures() -> None:
    colours = {name: strategy_colours([name])[name][0] for name in NAMES}
    assert len(set(colours.values())) == len(NAMES)
    both = side_by_side(CRANE, "conveyor-11kw", NAMES)
    (axes,) = next(iter(both.figures.values()))().axes
    marks = {tuple(map(float, one.get_xydata()[0])): one for one in axes.lines if len(one.get_xydata()) == 1}
    for pair in both.pairs:
        new, other = (marks[row.run.settled_time, row.run.k_dyn] for row in pair)
        assert new.get_color() == other.get_color() == colours[pair[0].name]
        assert new.get_marker() == other.get_marker()
        assert other.get_markerfacecolor() == "none" != new.get_markerfacecolor()
    rows = both.first.rows
    panels = [*comparison_figure(rows).axes, *(row.run.plot().axes[0] for row in rows)]
    for row, panel in zip((*rows, *rows), panels, strict=True):
        lines = {line.get_label(): line.get_color() for line in panel.lines}
        assert lines["shaft torque T"] == colours[row.name]
        assert lines["motor torque u"] == "#000000"


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        ({"second": "crane-4-mass"}, "it is a chain and .* a drive; machines of one kind stand side by side"),
        ({}, "give another machine or the gap after wear"),
        ({"second": CRANE, "worn_gap": 1.0}, "one of the two"),
        ({"worn_gap": 0.4}, "wear widens the gap"),
        ({"second": 3}, "second: give one Drive or Chain"),
    ],
)
def test_what_cannot_stand_side_by_side_is_refused(arguments: dict[str, object], sentence: str) -> None:
    with pytest.raises(InputError, match=sentence):
        side_by_side(CRANE, controllers=["direct"], **arguments)


def test_a_report_has_a_section_on_both() -> None:
    made = report(CRANE, controllers=["ramp"], budget=0.0, beside="conveyor-11kw")
    assert made.summary()["beside"]["drive"] == Drive.load("conveyor-11kw").name
    page = made.to_html()
    assert "Two machines side by side" in page
    assert math.isfinite(made.beside.pairs[0][1].run.k_dyn)
    with pytest.raises(InputError, match="machines of one kind"):
        report(CRANE, controllers=["ramp"], budget=0.0, beside=Chain.load("crane-4-mass"))
