"""What is shown of a tuning: sentences, tables, maps over gap and load inertia, and the files of --out."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from softstart.errors import InputError
from softstart.late import late
from softstart.views.drawing import drawing, entitle, new_figure, save_figure
from softstart.views.markdown import markdown, markdown_table, write_columns, write_drive_report
from softstart.views.numbers import Table, column_of, first_of, short
from softstart.views.printed import at_output
from softstart.views.starts import machine_lines
from softstart.views.terminal import fits, print_conclusion, print_lines, print_tables, sentence

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from rich.console import Console
    from xarray import Dataset

    from softstart.tuning import question as questions
    from softstart.tuning.outcome import Tuning
else:
    questions = late("softstart.tuning.question")

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
    """The metric with the defaults, tuned, and the start time."""
    return _beside_defaults(
        tuning, _schedule(tuning), "tuned for each cell", "tuned", "each cell tuned by itself"
    )


def robust_maps(tuning: Tuning) -> Any:
    """The metric of one set of gains, and of the defaults of the nominal drive."""
    table = tuning._robust().cells
    return _beside_defaults(tuning, table, "one set for all", "one set", "set up for the nominal drive")


def _beside_defaults(tuning: Tuning, table: Dataset, gains: str, short_name: str, title: str) -> Any:
    """The metric with the defaults and with these gains in one scale of colours, and the start time."""
    name, symbol = tuning.metric, _symbol(tuning)
    maps = [
        (f"{name}_default", f"{symbol}, defaults", ""),
        (name, f"{symbol}, {gains}", ""),
        ("start_time" if "start_time" in table else name, f"start time, {short_name}", "s"),
    ]
    return _maps(tuning, table, maps, title, together=2)


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
    gaps, inertias = (
        [f"{value:.3g}" for value in axis] for axis in (tuning.question.gaps, tuning.question.load_inertias)
    )
    rows, columns = len(gaps), len(inertias)
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
            timed = "in_time" in table and name in (tuning.metric, "start_time")
            late = ~np.asarray(table["in_time"], dtype=bool) if timed else None
            draw_cells(panel, values, _texts(values), limits, inertias, gaps, late)
            panel.set_title(
                heading + (f", {unit}" if unit not in ("", "1") else ""), loc="left", fontsize=SMALL
            )
        for index in range(len(maps), down * across):
            axes[index // across, index % across].set_axis_off()
        for panel in axes[:, 0]:
            panel.set_ylabel("gap, rad")
        for index in range(len(maps)):
            if index + across >= len(maps):
                axes[index // across, index % across].set_xlabel("load inertia J2, kg m2")
        entitle(figure, f"{tuning.drive.name}: {tuning.controller}, {title}")
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


def draw_cells(
    axes: Axes,
    values: Any,
    texts: Sequence[Sequence[str]],
    limits: tuple[float, float],
    columns: Sequence[str],
    rows: Sequence[str],
    late: Any = None,
) -> None:
    """A map, the first row at the bottom: each cell shows its text, and is struck out where it is `late`."""
    low, high = limits
    axes.grid(False)
    axes.imshow(values, cmap=MAP, vmin=low, vmax=high, origin="lower", aspect="auto")
    for (i, j), value in np.ndenumerate(values):
        share = (value - low) / (high - low) if math.isfinite(value) else 1.0
        colour = "#000000" if share > LIGHT else "#FFFFFF"
        axes.text(j, i, texts[i][j], ha="center", va="center", color=colour, fontsize=SMALL - 1.0)
        if late is not None and late[i, j]:
            axes.plot([j - 0.5, j + 0.5], [i - 0.5, i + 0.5], color="#D55E00", lw=1.2)
    axes.set_xticks(range(len(columns)), columns)
    axes.set_yticks(range(len(rows)), rows)
    axes.tick_params(length=0)
    for spine in axes.spines.values():
        spine.set_visible(False)


def _texts(values: Any) -> list[list[str]]:
    """Numbers with as many decimals as make three digits of the largest."""
    finite = np.abs(values[np.isfinite(values)])
    largest = float(finite.max()) if finite.size else 0.0
    decimals = 2 if largest <= 0.0 else min(max(2 - math.floor(math.log10(largest)), 0), 6)
    return [[f"{v:.{decimals}f}" if math.isfinite(v) else "-" for v in row] for row in values.tolist()]


SHOWN = 24  # cells shown; files and JSON hold all
NAMES = {
    "limit_share": "share of the limits",
    "k_dyn": "K_dyn",
    "k_dyn_first_contact": "K_dyn of the first contact",
}


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
        f"{tuning.controller}: {_metric(tuning)} made small, start time {q.bound.text()}, "
        f"{len(q.gaps)} gaps x {len(q.load_inertias)} load inertias{over}. Tuned: {ranges}."
    )


def _metric(tuning: Tuning) -> str:
    """The metric in words."""
    return NAMES.get(tuning.metric, tuning.metric)


def cell_table(tuning: Tuning) -> Table:
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
        f"{_metric(tuning)}\ndefault": column_of(_flat(table[f"{tuning.metric}_default"])),
        f"{_metric(tuning)}\ntuned": column_of(_flat(table[tuning.metric])),
        "start\ntime s": column_of(_flat(table["start_time" if "start_time" in table else tuning.metric])),
        "at most\ns": [one.replace("inf", "-") for one in column_of(_flat(table["start_time_bound"]))],
        "in\ntime": ["yes" if good else "no" for good in _flat(table["in_time"])],
        "searches\nagree": [f"{n} of {tuning.question.restarts}" for n in _flat(table["agreement"])],
    }
    return Table.of(f"Gains for each cell{first_of(len(tuning.question.cells), SHOWN)}", columns)


def set_table(tuning: Tuning) -> Table:
    """The robust set, one row a parameter."""
    found = tuning.robust
    assert found is not None
    units = {one.name: one.unit for one in tuning.question.ranges}
    columns = {
        "parameter": list(found.gains),
        "default": [short(found.defaults[name]) for name in found.gains],
        "robust": [short(value) for value in found.gains.values()],
        "unit": ["" if units[name] == "1" else units[name].replace("*", " ") for name in found.gains],
    }
    there = [at_output(tuning.drive, value, units[name]) for name, value in found.gains.items()]
    columns |= {"robust, at\nthe output": there} if any(there) else {}
    return Table.of("One set for all", columns, ("parameter", "unit"))


def map_table(tuning: Tuning, title: str, table: Any, name: str) -> Table:
    """A figure over the grid, one row a gap."""
    values = np.asarray(table[name], dtype=np.float64)
    columns = {"gap rad": [short(gap) for gap in tuning.question.gaps]}
    for j, inertia in enumerate(tuning.question.load_inertias):
        columns[f"J2 {inertia:.4g}"] = column_of(values[:, j].tolist())
    return Table.of(title, columns)


def _set_map(tuning: Tuning) -> Table:
    """The metric of the robust set over the grid."""
    assert tuning.robust is not None
    return map_table(tuning, f"{_metric(tuning)} with this set", tuning.robust.cells, tuning.metric)


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
    name, metric, found = tuning.metric, _metric(tuning), list[str]()
    if tuning.schedule is not None:
        table = tuning.schedule
        late = int((~table["in_time"]).sum())
        found.append(
            f"Gains for each cell: {metric} {_between(table[name])}, with the defaults "
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
        found.append(
            f"One set for all: {metric} {kind} {one.worst:.3f}, with the defaults of the nominal drive "
            f"{one.worst_default:.3f}; {late_text}; {one.agreement} of {one.restarts} searches agree."
        )
    found += _margins(tuning)
    price = tuning.price
    if price is not None and "robust_over_schedule" in price:
        found.append(
            f"One set over gains for each cell: {_between(price['robust_over_schedule'])} times the {metric}."
        )
    for side, words in (("schedule", "Gains for each cell"), ("robust", "One set")):
        if price is not None and f"{side}_over_optimum" in price:
            ratio = price[f"{side}_over_optimum"]
            missing = int(ratio.isnull().sum())
            found.append(
                f"{words} over the certified optimum within the same time: {_between(ratio)} times"
                + (f" ({missing} of {ratio.size} cells without an optimum)." if missing else ".")
            )
    return found


def _margins(tuning: Tuning) -> list[str]:
    """What is left of the limits in the worst start, tuned and with the defaults."""
    if tuning.question.metric != questions.MARGIN:
        return []
    name, found = tuning.metric, []
    if tuning.schedule is not None:
        most = [float(np.max(tuning.schedule[one])) for one in (name, f"{name}_default")]
        found.append(_margin("gains for each cell", *most))
    if tuning.robust is not None:
        found.append(_margin("one set for all", tuning.robust.worst, tuning.robust.worst_default))
    life = " The life is not part of it: see compare." if tuning.drive.limits.life is not None else ""
    return [f"Least margin to the limits: {'; '.join(found)}.{life}"]


def _margin(what: str, share: float, by_default: float) -> str:
    verdict = "kept" if share <= 1.0 else "not kept"
    left, before = (f"{100.0 * (1.0 - one):.3g} %" for one in (share, by_default))
    return f"{what} {left}, {verdict} (with the defaults {before})"


def notes(tuning: Tuning) -> list[str]:
    """What the columns mean, and how sure the search is."""
    found = []
    if tuning.schedule is not None:
        q, table = tuning.question, tuning.schedule
        sure = int((table["agreement"] == q.restarts).sum())
        found.append(
            f"Searches agree: within 1 % of the best; all {q.restarts} do in {sure} of {len(q.cells)} cells."
        )
        if bool(table["kept_default"].any()):
            found.append(f"In {int(table['kept_default'].sum())} cells the defaults were best.")
        if not bool(table["in_time"].all()):
            found.append("Cells that are not in time have the least delay that was found.")
        if tuning.between is not None:
            found.append(
                f"Half way between the cells, with interpolated gains: {_metric(tuning)} "
                f"{_between(tuning.between[tuning.metric])}, up to "
                f"{100 * float(tuning.between['excess'].max()):.1f} % beyond the bound on the start time."
            )
    if tuning.price is not None and any("optimum" in str(name) for name in tuning.price):
        found.append(
            "Optimum: the cell's drive, its motor without lag, dead time and noise; terminal reached."
        )
    drive, q = tuning.drive, tuning.question
    if drive.gear_ratio is not None:
        gaps, inertias = (
            " to ".join(dict.fromkeys(at_output(drive, one, unit) for one in (axis[0], axis[-1])))
            for axis, unit in ((q.gaps, "rad"), (q.load_inertias, "kg*m^2"))
        )
        found.append(
            f"At the output shaft, ratio {short(float(drive.gear_ratio))}, without losses: gaps {gaps} rad, "
            f"load inertias {inertias} kg m2; a torque there is the ratio times that at the motor."
        )
    found.append(f"{tuning.starts:,} starts.")
    return found


def show(to: Console, tuning: Tuning) -> None:
    """All of it on a terminal or in a pipe."""
    print_lines(to, machine_lines(tuning.drive))
    to.print()
    sentence(to, question(tuning))
    if tuning.schedule is not None:
        _print(to, cell_table(tuning))
    if tuning.robust is not None:
        _print(to, set_table(tuning))
        _print(to, _set_map(tuning))
    if tuning.price is not None and "robust_over_schedule" in tuning.price:
        title = "Price of robustness: one set over gains for each cell"
        _print(to, map_table(tuning, title, tuning.price, "robust_over_schedule"))
    print_conclusion(to, conclusions(tuning), notes(tuning))


def _print(to: Console, table: Table) -> None:
    """The first rows of a table, in two where there is no room for one."""
    title, columns, rows = table._replace(rows=table.rows[:SHOWN])
    if fits(to, table) or len(columns) < 6:
        print_tables(to, [Table(title, columns, rows)])
        return
    split = len(columns) - 6 if len(columns) > 8 else len(columns) // 2 + 1
    second = Table(
        f"{title}, continued",
        [*columns[:2], *columns[split:]],
        [[*row[:2], *row[split:]] for row in rows],
    )
    print_tables(to, [Table(title, columns[:split], [row[:split] for row in rows]), second])


def write_tuning(tuning: Tuning, folder: Path, command: str) -> None:
    """Everything about a tuning, but its saved state."""
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
            markdown_table(cell_table(tuning)),
            _play(tuning, "schedule.toml", "with the gap and load inertia that the drive declares")
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
            markdown_table(set_table(tuning)),
            markdown_table(_set_map(tuning)),
            _play(tuning, "robust.toml", "set up for the nominal drive, whatever drive starts")
            + "Each cell: [robust-cells.csv](robust-cells.csv).",
        ]
    if tuning.price is not None:
        _write_cells(folder / "price.csv", tuning.price)
        save_figure(tuning.plot("price"), folder, "price")
        parts += ["## The price of robustness", "![price](price.svg)", "Each cell: [price.csv](price.csv)."]
    parts += [
        "## Notes",
        *map(markdown, notes(tuning)),
        "Finished parts, from which the same command goes on: [tuning.sqlite](tuning.sqlite).",
    ]
    write_drive_report(folder, parts, tuning.drive, command)


def _play(tuning: Tuning, file: str, how: str) -> str:
    what = tuning.drive.WHAT.removeprefix("a ")
    return (
        f"[{file}]({file}) stands for a controller everywhere, {how}:\n\n```sh\n"
        f"softstart simulate {what}.toml --controller {file}\n```\n\n"
    )


def _write_cells(path: Path, table: Dataset) -> None:
    """One row a cell, all figures."""
    gaps, inertias = np.meshgrid(table["gap"], table["load_inertia"], indexing="ij")
    columns = {"gap": gaps, "load_inertia": inertias} | {str(name): one for name, one in table.items()}
    write_columns(path, {name: _flat(values) for name, values in columns.items()})
