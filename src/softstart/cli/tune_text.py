"""What `tune` says: tables, a conclusion, and notes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from rich.console import Console

    from softstart.tuning.outcome import Tuning

SHOWN = 24  # cells shown; files and JSON hold all
NAMES = {"k_dyn": "K_dyn", "k_dyn_first_contact": "K_dyn of the first contact"}


def any_in_time(tuning: Tuning) -> bool:
    """Whether anything that was found keeps its bound on the start time."""
    scheduled = tuning.schedule is not None and bool(tuning.schedule["in_time"].any())
    return scheduled or (tuning.robust is not None and tuning.robust.feasible)


def question(tuning: Tuning) -> str:
    """What was asked, in a sentence."""
    q = tuning.question
    ranges = "; ".join(f"{one.name} {one.text()}" for one in q.ranges)
    by = "worst case" if q.quantile == 1.0 else f"quantile {q.quantile:g}"
    over = f", {by} of {len(q.scenarios)} scenarios a cell" if len(q.scenarios) > 1 else ""
    return (
        f"{tuning.controller}: {_said(tuning)} made small, start time {q.bound.text()}, {len(q.gaps)} gaps x "
        f"{len(q.load_inertias)} load inertias{over}. Tuned: {ranges}."
    )


def _said(tuning: Tuning) -> str:
    return NAMES.get(tuning.metric, tuning.metric)


def cell_columns(tuning: Tuning) -> dict[str, list[str]]:
    """The schedule, one row a cell."""
    from softstart.views.numbers import column_of

    table = tuning.schedule
    assert table is not None
    gaps, inertias = np.meshgrid(table["gap"], table["load_inertia"], indexing="ij")
    columns = {
        "gap\nrad": column_of(gaps.ravel().tolist()),
        "J2\nkg m2": column_of(inertias.ravel().tolist()),
    }
    for one in tuning.question.ranges:
        unit = f"\n{one.unit.replace('*', ' ')}" if one.unit not in ("", "1") else ""
        columns[one.name.replace("_", " ") + unit] = column_of(_flat(table[one.name]))
    columns |= {
        f"{_said(tuning)}\ndefault": column_of(_flat(table[f"{tuning.metric}_default"])),
        f"{_said(tuning)}\ntuned": column_of(_flat(table[tuning.metric])),
        "start\ntime s": column_of(_flat(table["start_time" if "start_time" in table else tuning.metric])),
        "at most\ns": column_of(_flat(table["start_time_bound"])),
        "in\ntime": ["yes" if good else "no" for good in _flat(table["in_time"])],
        "searches\nagree": [f"{n} of {tuning.question.restarts}" for n in _flat(table["agreement"])],
    }
    return columns


def set_columns(tuning: Tuning) -> dict[str, list[str]]:
    """The robust set, one row a parameter."""
    from softstart.views.numbers import short

    found = tuning.robust
    assert found is not None
    units = {one.name: one.unit for one in tuning.question.ranges}
    return {
        "parameter": list(found.gains),
        "default": [short(found.defaults[name]) for name in found.gains],
        "robust": [short(value) for value in found.gains.values()],
        "unit": ["" if units[name] == "1" else units[name].replace("*", " ") for name in found.gains],
    }


def map_columns(tuning: Tuning, table: Any, name: str) -> dict[str, list[str]]:
    """A figure over the grid, one row a gap."""
    from softstart.views.numbers import column_of, short

    values = np.asarray(table[name], dtype=np.float64)
    columns = {"gap rad": [short(gap) for gap in tuning.question.gaps]}
    for j, inertia in enumerate(tuning.question.load_inertias):
        columns[f"J2 {inertia:.4g}"] = column_of(values[:, j].tolist())
    return columns


def _flat(values: Any) -> list[Any]:
    flat: list[Any] = np.asarray(values).ravel().tolist()
    return flat


def _between(values: Any, digits: int = 3) -> str:
    """Least to largest value."""
    numbers = np.asarray(values, dtype=np.float64)
    if not np.any(np.isfinite(numbers)):
        return "none"
    low, high = float(np.nanmin(numbers)), float(np.nanmax(numbers))
    return (
        f"{low:.{digits}f} to {high:.{digits}f}"
        if f"{low:.{digits}f}" != f"{high:.{digits}f}"
        else f"{low:.{digits}f}"
    )


def conclusions(tuning: Tuning) -> list[str]:
    """What tuning for each cell brings, what one set does, and what robustness costs."""
    name, said, told = tuning.metric, _said(tuning), []
    if tuning.schedule is not None:
        table = tuning.schedule
        late = int((~table["in_time"]).sum())
        told.append(
            f"Gains for each cell: {said} {_between(table[name])}, with the defaults "
            f"{_between(table[f'{name}_default'])}"
            + (
                f"; {late} of {table['in_time'].size} cells start later than allowed."
                if late
                else "; all in time."
            )
        )
    if tuning.robust is not None:
        one = tuning.robust
        kind = "at most" if tuning.question.quantile == 1.0 else f"quantile {tuning.question.quantile:g}"
        late_text = "all in time" if one.feasible else f"{100 * one.excess:.1f} % later than allowed"
        told.append(
            f"One set for all: {said} {kind} {one.worst:.3f}, with the defaults of the nominal drive "
            f"{one.worst_default:.3f}; {late_text}; {one.agreement} of {one.restarts} searches agree."
        )
    price = tuning.price
    if price is not None and "robust_over_schedule" in price:
        told.append(
            f"One set over gains for each cell: {_between(price['robust_over_schedule'])} times the {said}."
        )
    for side, words in (("schedule", "Gains for each cell"), ("robust", "One set")):
        if price is not None and f"{side}_over_optimum" in price:
            ratio = price[f"{side}_over_optimum"]
            missing = int(ratio.isnull().sum())
            told.append(
                f"{words} over the certified optimum within the same time: {_between(ratio)} times"
                + (f" ({missing} of {ratio.size} cells without an optimum)." if missing else ".")
            )
    return told


def notes(tuning: Tuning) -> list[str]:
    """What the columns mean, and how sure the search is."""
    told = []
    if tuning.schedule is not None:
        q, table = tuning.question, tuning.schedule
        sure = int((table["agreement"] == q.restarts).sum())
        told.append(
            f"Searches agree: within 1 % of the best; all {q.restarts} do in {sure} of {len(q.cells)} cells."
        )
        if bool(table["kept_default"].any()):
            told.append(f"In {int(table['kept_default'].sum())} cells the defaults were best.")
        if not bool(table["in_time"].all()):
            told.append("Cells that are not in time have the least delay that was found.")
        if tuning.between is not None:
            told.append(
                f"Half way between the cells, with interpolated gains: {_said(tuning)} "
                f"{_between(tuning.between[tuning.metric])}, up to "
                f"{100 * float(tuning.between['excess'].max()):.1f} % beyond the bound on the start time."
            )
    if tuning.price is not None and any("optimum" in str(name) for name in tuning.price):
        told.append(
            "Optimum: the cell's drive, its motor without lag, dead time and noise; terminal reached."
        )
    told.append(f"{tuning.starts:,} starts.")
    return told


def show(to: Console, tuning: Tuning) -> None:
    """All of it on a terminal or in a pipe."""
    from softstart.views.drives import drive_lines
    from softstart.views.terminal import sentence

    for index, line in enumerate(drive_lines(tuning.drive)):
        sentence(to, line, "bold" if index == 0 else "")
    to.print()
    sentence(to, question(tuning))
    if tuning.schedule is not None:
        columns = cell_columns(tuning)
        count = len(tuning.question.cells)
        part = f" (the first {SHOWN} of {count}; --json and --out give all)" if count > SHOWN else ""
        _table(to, f"Gains for each cell{part}", columns)
    if tuning.robust is not None:
        _table(to, "One set for all", set_columns(tuning), texts=("parameter", "unit"))
        _table(to, f"{_said(tuning)} with this set", map_columns(tuning, tuning.robust.cells, tuning.metric))
    if tuning.price is not None and "robust_over_schedule" in tuning.price:
        _table(to, "Price of robustness: one set over gains for each cell",
               map_columns(tuning, tuning.price, "robust_over_schedule"))  # fmt: skip
    to.print()
    for told in conclusions(tuning):
        sentence(to, told, "bold")
    for note in notes(tuning):
        sentence(to, note, "dim")


def _table(to: Console, title: str, columns: dict[str, list[str]], texts: Sequence[str] = ()) -> None:
    """A table, in two where there is no room for one."""
    from softstart.views.numbers import Column
    from softstart.views.terminal import fits, print_table

    headings = [Column(name, name not in texts) for name in columns]
    rows = [list(row)[: len(headings)] for row in zip(*columns.values(), strict=True)][:SHOWN]
    to.print()
    if fits(to, headings, rows) or len(headings) < 6:
        print_table(to, headings, rows, title=title)
        return
    split = len(headings) - 6 if len(headings) > 8 else len(headings) // 2 + 1
    print_table(to, headings[:split], [row[:split] for row in rows], title=title)
    to.print()
    second = [*headings[:2], *headings[split:]]
    print_table(to, second, [[*row[:2], *row[split:]] for row in rows], title=f"{title}, continued")
