"""What is shown of two machines side by side: one table and one figure of both."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from softstart.start.beside import SideBySide
from softstart.views.drawing import GREY, MARKERS, drawing, mark_points, new_figure, strategy_colours
from softstart.views.numbers import DataColumn, TextTable, titled, units_of
from softstart.views.sheet import Sheet, records_file
from softstart.views.starts import PEAK_COLUMNS, TIME_COLUMNS, machine_lines

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

LETTERS = "A", "B"
FIGURES = (PEAK_COLUMNS[0], PEAK_COLUMNS[3], TIME_COLUMNS[0])
LEGEND = (
    "A, B: the machines above; K_dyn of each refers to its own mean shaft torque under full starting torque."
)


def beside_table(both: SideBySide, title: str = "") -> TextTable:
    """The strategies, each figure for both machines."""
    rows = sorted(both.pairs, key=lambda pair: float(pair[0].run.k_dyn))
    columns = [DataColumn("strategy", _of(DataColumn("", lambda row: row.marked), 0))]
    first, second = (units_of(one.drive) for one in both.machines)
    seen = first, first._replace(gear=second.gear)  # two columns of one figure are in one unit
    alike = bool(first.gear) == bool(second.gear)
    for figure in FIGURES:
        for k, column in enumerate(map(figure.seen, seen)):
            name, line, unit = column.heading.partition("\n")
            heading = f"{name} {LETTERS[k]}{line}{unit}{'' if alike or not figure.si else seen[k].at}"
            columns.append(column._replace(heading=heading, of=_of(column, k), si=""))
    if any(row.against_limits for pair in both.pairs for row in pair):
        limits = DataColumn("limits", lambda row: row.against_limits)
        columns += [limits._replace(heading=f"limits {LETTERS[k]}", of=_of(limits, k)) for k in (0, 1)]
    return TextTable.of_data(titled(title, first) if alike else title, columns, rows)


def _of(column: DataColumn, k: int) -> Callable[[Any], Any]:
    return lambda pair: column.of(pair[k])


def beside_figure(both: SideBySide) -> Figure:
    """K_dyn against settled time: filled on A, hollow on B, a line from one to the other."""
    with drawing():
        figure, axes = new_figure(1, 1, (8.0, 4.6))
        draw_beside(axes, both)
    return figure


def draw_beside(axes: Axes, both: SideBySide) -> None:
    """The same on given axes."""
    pairs = [pair for pair in both.pairs if not any(math.isnan(row.run.settled_time) for row in pair)]
    points = [tuple((row.run.settled_time, row.run.k_dyn) for row in pair) for pair in pairs]
    names = [row.name for row, _ in pairs]
    mark_points(axes, [(name, *one) for name, (one, _) in zip(names, points, strict=True)], range(len(names)))
    colours = strategy_colours(names)
    for index, (name, (one, other)) in enumerate(zip(names, points, strict=True)):
        marker = MARKERS[index % len(MARKERS)]
        axes.plot(*zip(one, other, strict=True), color=GREY, lw=0.8, zorder=1)
        axes.plot(*other, marker, ms=8, mfc="none", mew=1.8, color=colours[name][0], zorder=3)
    axes.set_xlabel("settled time, s")
    axes.set_ylabel("K_dyn")
    axes.set_title("filled: A, hollow: B", loc="left")


def beside_sheet(both: SideBySide) -> Sheet:
    """What is shown of two machines side by side."""
    lines = list[str]()
    for letter, one in zip(LETTERS, both.machines, strict=True):
        title, *others = machine_lines(one.drive, one.fitted_to)
        lines += [f"{letter}: {title}", *others]
    records = [
        {"machine": letter, "name": one.drive.name, **row.summary()}
        for letter, one in zip(LETTERS, both.machines, strict=True)
        for row in one.rows
    ]
    keys = ("machine", "name", "controller", "k_dyn", "peak_torque", "start_time", "settled_time")
    records = [{key: record[key] for key in keys if key in record} for record in records]
    worn = "B is A after wear; strategies stay set up for A."
    return Sheet(
        f"{both.first.drive.name} beside {both.second.drive.name}",
        lines,
        tables=[beside_table(both)],
        conclusions=[
            one.recommendation.text.after(f"{letter}: ")
            for letter, one in zip(LETTERS, both.machines, strict=True)
        ],
        notes=[LEGEND, *([worn] if both.worn else [])],
        figures={"beside": lambda: beside_figure(both)},
        panel=lambda axes: draw_beside(axes, both),
        records=records,
        files={"beside.csv": records_file(records)},
        machine=both.first.drive,
    )
