"""What is shown of a tuning: sentences, tables, maps over gap and load inertia, and the files of --out."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from softstart.errors import InputError
from softstart.views.drawing import drawing, new_figure, save_figure
from softstart.views.drives import drive_lines
from softstart.views.markdown import (
    drive_table,
    markdown,
    markdown_table,
    provenance,
    write_table,
    write_text,
)
from softstart.views.numbers import Column, column_of, short
from softstart.views.terminal import fits, print_table, sentence

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from rich.console import Console
    from xarray import Dataset

    from softstart.tuning.outcome import Tuning

MAP = "cividis"  # even in lightness for colour-blind and grey readers alike
SMALL = 9.0
CELL, ROW = 0.62, 0.42  # inches a cell
FEWEST = 3.2, 1.6  # inches of a map, at the least
ACROSS = 3  # maps side by side
LIGHT = 0.55  # of the map from which on numbers are dark


def figure_of(tuning: Tuning, what: str | None) -> Any:
    """The figure asked for; InputError where there is nothing to draw."""
    if what is None:
        what = "price" if tuning.price is not None else "metric" if tuning.schedule is not None else "robust"
    made = {"gains": gain_maps, "metric": metric_maps, "robust": robust_maps, "price": price_maps}
    if what not in made:
        raise InputError(f"what = {what!r}: choose one of {', '.join(made)}.")
    return made[what](tuning)


def gain_maps(tuning: Tuning) -> Any:
    """Each tuned parameter over the grid."""
    table = _schedule(tuning)
    maps = [(one.name, one.name, one.unit) for one in tuning.question.ranges]
    return _maps(tuning, table, maps, "gains of each cell")


def metric_maps(tuning: Tuning) -> Any:
    """The metric with the defaults, tuned, and how many searches agree."""
    table, name, said = _schedule(tuning), tuning.metric, _symbol(tuning)
    maps = [
        (f"{name}_default", f"{said}, defaults", ""),
        (name, f"{said}, tuned for each cell", ""),
        ("start_time" if "start_time" in table else name, "start time, tuned", "s"),
    ]
    return _maps(tuning, table, maps, "each cell tuned by itself", together=2)


def robust_maps(tuning: Tuning) -> Any:
    """The metric of one set of gains, and of the defaults of the nominal drive."""
    table, name, said = tuning._robust().cells, tuning.metric, _symbol(tuning)
    maps = [
        (f"{name}_default", f"{said}, defaults", ""),
        (name, f"{said}, one set for all", ""),
        ("start_time" if "start_time" in table else name, "start time, one set", "s"),
    ]
    return _maps(tuning, table, maps, "set up for the nominal drive", together=2)


def price_maps(tuning: Tuning) -> Any:
    """What one set costs against gains for each cell, and both against the optimum."""
    table = tuning.price
    if table is None:
        raise InputError("price: it needs the schedule and the robust set, or the certified optima.")
    titles = {
        "robust_over_schedule": "one set / each cell tuned",
        "schedule_over_optimum": "each cell tuned / optimum",
        "robust_over_optimum": "one set / optimum",
    }
    maps = [(name, title, "") for name, title in titles.items() if name in table]
    return _maps(tuning, table, maps, f"price of robustness, ratios of {_symbol(tuning)}", together=3)


def _symbol(tuning: Tuning) -> str:
    """The metric as the papers write it."""
    return tuning.metric.replace("k_dyn", "K_dyn")


def _schedule(tuning: Tuning) -> Dataset:
    if tuning.schedule is None:
        raise InputError("schedule: no schedule was tuned; call tune with schedule=True.")
    return tuning.schedule


def _maps(
    tuning: Tuning, table: Dataset, maps: list[tuple[str, str, str]], title: str, together: int = 0
) -> Any:
    """Maps side by side; the first `together` share one scale of colours."""
    rows, columns = len(tuning.question.gaps), len(tuning.question.load_inertias)
    across = min(ACROSS, len(maps))
    down = math.ceil(len(maps) / across)
    width, height = max(FEWEST[0], 1.2 + CELL * columns), max(FEWEST[1], 0.9 + ROW * rows)
    shared = [np.asarray(table[name], dtype=np.float64) for name, _, _ in maps[:together]]
    with drawing():
        figure, axes = new_figure(down, across, (width * across, 0.5 + height * down), squeeze=False)
        for index, (name, heading, unit) in enumerate(maps):
            values = np.asarray(table[name], dtype=np.float64)
            limits = _limits(shared if index < together else [values])
            panel = axes[index // across, index % across]
            _map(panel, tuning, values, limits)
            panel.set_title(
                heading + (f", {unit}" if unit not in ("", "1") else ""), loc="left", fontsize=SMALL
            )
            if "in_time" in table and name in (tuning.metric, "start_time"):
                _cross_out(panel, ~np.asarray(table["in_time"], dtype=bool))
        for index in range(len(maps), down * across):
            axes[index // across, index % across].set_axis_off()
        for panel in axes[:, 0]:
            panel.set_ylabel("gap, rad")
        for index in range(len(maps)):
            if index + across >= len(maps):
                axes[index // across, index % across].set_xlabel("load inertia J2, kg m2")
        figure.suptitle(f"{tuning.drive.name}: {tuning.controller}, {title}", x=0.01, ha="left", fontsize=11)
    return figure


def _limits(values: list[Any]) -> tuple[float, float]:
    """Ends of the colours, from the finite values."""
    finite = np.concatenate([v[np.isfinite(v)] for v in values]) if values else np.zeros(0)
    if finite.size == 0:
        return 0.0, 1.0
    low, high = float(finite.min()), float(finite.max())
    return (
        (low, high)
        if high > low * (1.0 + 1e-9)
        else (low - 0.5 * abs(low) - 0.5, high + 0.5 * abs(high) + 0.5)
    )


def _map(axes: Axes, tuning: Tuning, values: Any, limits: tuple[float, float]) -> None:
    """One map, wide gaps at the top; every cell says its number."""
    low, high = limits
    axes.grid(False)
    axes.imshow(values, cmap=MAP, vmin=low, vmax=high, origin="lower", aspect="auto")
    texts = _texts(values)
    for (i, j), value in np.ndenumerate(values):
        share = (value - low) / (high - low) if math.isfinite(value) else 1.0
        colour = "#000000" if share > LIGHT else "#FFFFFF"
        axes.text(j, i, texts[i][j], ha="center", va="center", color=colour, fontsize=SMALL - 1.0)
    question = tuning.question
    axes.set_xticks(range(len(question.load_inertias)), [f"{v:.3g}" for v in question.load_inertias])
    axes.set_yticks(range(len(question.gaps)), [f"{v:.3g}" for v in question.gaps])
    axes.tick_params(length=0)
    for spine in axes.spines.values():
        spine.set_visible(False)


def _texts(values: Any) -> list[list[str]]:
    """Numbers with as many decimals as make three digits of the largest."""
    finite = np.abs(values[np.isfinite(values)])
    largest = float(finite.max()) if finite.size else 0.0
    decimals = 2 if largest <= 0.0 else min(max(2 - math.floor(math.log10(largest)), 0), 6)
    return [[f"{v:.{decimals}f}" if math.isfinite(v) else "-" for v in row] for row in values.tolist()]


def _cross_out(axes: Axes, late: Any) -> None:
    """A line through the cells whose start time is beyond its bound."""
    for i, j in np.argwhere(late):
        axes.plot([j - 0.5, j + 0.5], [i - 0.5, i + 0.5], color="#D55E00", lw=1.2)


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


def write_tuning(tuning: Tuning, folder: Path, command: str) -> None:
    """Everything about a tuning, but its saved state."""
    write_text(folder / "drive.toml", tuning.drive.to_toml())
    parts = [
        f"# {markdown(tuning.drive.name)}: {markdown(tuning.controller)} tuned",
        markdown(question(tuning)),
        *map(markdown, conclusions(tuning)),
    ]
    if tuning.schedule is not None:
        tuning.to_toml(folder / "schedule.toml", "schedule")
        tuning.to_csv(folder / "schedule.csv")
        save_figure(tuning.plot("gains"), folder, "gains")
        save_figure(tuning.plot("metric"), folder, "metric")
        parts += [
            "## Gains for each cell",
            "![gains](gains.svg)\n\n![metric](metric.svg)",
            _markdown(cell_columns(tuning)),
            _play("schedule.toml", "with the gap and load inertia that the drive declares")
            + "The same gains, with all figures of each cell: [schedule.csv](schedule.csv).",
        ]
        if tuning.between is not None:
            _write_cells(folder / "between.csv", tuning.between)
            parts.append("Half way between the cells, with interpolated gains: [between.csv](between.csv).")
    if tuning.robust is not None:
        tuning.to_toml(folder / "robust.toml", "robust")
        _write_cells(folder / "robust-cells.csv", tuning.robust.cells)
        save_figure(tuning.plot("robust"), folder, "robust")
        parts += [
            "## One set for all",
            "![robust](robust.svg)",
            _markdown(set_columns(tuning)),
            _markdown(map_columns(tuning, tuning.robust.cells, tuning.metric)),
            _play("robust.toml", "set up for the nominal drive, whatever drive starts")
            + "Each cell: [robust-cells.csv](robust-cells.csv).",
        ]
    if tuning.price is not None:
        _write_cells(folder / "price.csv", tuning.price)
        save_figure(tuning.plot("price"), folder, "price")
        parts += ["## The price of robustness", "![price](price.svg)", "Each cell: [price.csv](price.csv)."]
    parts += [
        "## Notes",
        *map(markdown, notes(tuning)),
        "Finished parts, from which the same command goes on: [tuning.jsonl](tuning.jsonl).",
        "## The drive",
        drive_table(tuning.drive),
        provenance(tuning.drive, command),
    ]
    write_text(folder / "report.md", "\n\n".join(parts) + "\n")


def _play(file: str, how: str) -> str:
    return (
        f"[{file}]({file}) stands for a controller everywhere, {how}:\n\n```sh\n"
        f"softstart simulate drive.toml --controller {file}\n```\n\n"
    )


def _markdown(columns: dict[str, list[str]]) -> str:
    headings = [" ".join(heading.split()) for heading in columns]
    return markdown_table(
        headings, [list(row) for row in zip(*columns.values(), strict=True)], numbers_from=1
    )


def _write_cells(path: Path, table: Dataset) -> None:
    """One row a cell, all figures."""
    gaps, inertias = np.meshgrid(table["gap"], table["load_inertia"], indexing="ij")
    columns: dict[str, Any] = {"gap": gaps.ravel(), "load_inertia": inertias.ravel()}
    columns |= {str(name): np.asarray(values).ravel() for name, values in table.items()}
    rows = zip(*(column.tolist() for column in columns.values()), strict=True)
    write_table(path, list(columns), [[_cell(value) for value in row] for row in rows])


def _cell(value: Any) -> Any:
    return None if isinstance(value, float) and math.isnan(value) else value
