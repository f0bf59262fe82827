"""What is shown of a sweep: sentences, tables, maps and curves, and the files of --out."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from softstart.drive import PARAMETERS
from softstart.late import late
from softstart.start.status import Status
from softstart.sweeping.summary import plan_of
from softstart.views.drawing import (
    COLOURS,
    DASHES,
    GREY,
    SMALL,
    drawing,
    entitle,
    new_figure,
    plain_ticks,
    save_figure,
)
from softstart.views.drives import controllers_set_up
from softstart.views.markdown import (
    markdown,
    table_sections,
    write_columns,
    write_drive_report,
    write_table,
)
from softstart.views.numbers import Table, column_of, number
from softstart.views.starts import machine_lines
from softstart.views.terminal import (
    fits,
    print_conclusion,
    print_lines,
    print_tables,
    sentence,
)

if TYPE_CHECKING:
    import xarray
    from matplotlib import colors, patheffects, ticker
    from matplotlib.axes import Axes
    from rich.console import Console

    from softstart.chain.machines import Machine
    from softstart.sweeping.entry import Progress
    from softstart.sweeping.summary import Summary
else:
    colors = late("matplotlib.colors")
    patheffects = late("matplotlib.patheffects")
    ticker = late("matplotlib.ticker")

MOST_PANELS = 6
MOST_LINES = 8
MOST_CELLS = 4_000_000  # of a map
COLOUR_MAP = "cividis"  # for colour-blind readers, and even in grey
WIDE = 10.0  # largest over smallest value from which on colours are logarithmic
MISSING = "#D0D0D0"
FINEST_CONTOUR = 50  # points along each side


def sweep_figure(results: xarray.Dataset, name: str = "k_dyn") -> Any:
    """A figure of the starts over the grid, or None where nothing can be drawn.

    Two long axes of numbers make a map; further axes make panels, or, if these were too many, the map shows
    the largest value over them, of a margin the least. One axis of numbers makes curves.
    """
    field = results[name]
    long = [str(dim) for dim in field.dims if field.sizes[dim] > 1]
    numeric = [dim for dim in long if dim in results.coords and results[dim].dtype.kind in "fiu"]
    across = sorted(sorted(numeric, key=lambda dim: -field.sizes[dim])[:2], key=long.index)
    rest = [dim for dim in long if dim not in across]
    if not across or math.prod(field.sizes[dim] for dim in across) > MOST_CELLS:
        return None
    combinations = math.prod(field.sizes[dim] for dim in rest)
    if len(across) == 1:
        if combinations > MOST_LINES:
            return _curves(
                results, name, across[0], [(f"{_end(name)} over the rest", _largest(results, name, across))]
            )
        return _curves(results, name, across[0], _each(results, name, across, rest))
    if combinations > MOST_PANELS:
        others = ", ".join(_shown(dim) for dim in rest)
        return _maps(
            results, name, across, [(f"{_end(name)} over {others}", _largest(results, name, across))]
        )
    return _maps(results, name, across, _each(results, name, across, rest))


Part = tuple[str, Any]  # title, and the values along the axes drawn


def _each(results: xarray.Dataset, name: str, across: list[str], rest: list[str]) -> list[Part]:
    """A part for every combination of the other axes."""
    parts = []
    for index in np.ndindex(*(results.sizes[dim] for dim in rest)):
        one = results[name].isel(dict(zip(rest, index, strict=True)))
        values = [(dim, results[dim].values[i]) for dim, i in zip(rest, index, strict=True)]
        labels = [
            str(value) if dim == "controller" else f"{_shown(dim)} {_text(value)}" for dim, value in values
        ]
        parts.append((", ".join(labels), one.squeeze().transpose(*across).values))
    return parts


def _largest(results: xarray.Dataset, name: str, across: list[str]) -> Any:
    """The largest value over all axes that are not drawn, of a margin the least, read piece by piece."""
    worse = np.fmin if name == "margin" else np.fmax
    field, plan = results[name], plan_of(results)
    kept = [list(field.dims).index(dim) for dim in across]
    away = tuple(i for i in range(field.ndim) if i not in kept)
    found = np.full([plan.shape[i] for i in kept], np.nan)
    for chunk in range(plan.chunks):
        place = plan.place(chunk)
        part = tuple(place[i] for i in kept)
        values = field[place].values
        found[part] = worse(found[part], worse.reduce(values, axis=away) if away else values)
    return found


def _end(name: str) -> str:
    return "least" if name == "margin" else "largest"


def _maps(results: xarray.Dataset, name: str, across: list[str], parts: list[Part]) -> Any:

    high, wide = across
    orders = [np.argsort(results[dim].values) for dim in across]
    y, x = (results[dim].values[order] for dim, order in zip(across, orders, strict=True))
    finite = np.concatenate([values[np.isfinite(values)] for _, values in parts])
    if not finite.size:
        return None
    low, top = float(finite.min()), float(finite.max())
    logarithmic = low > 0.0 and top > WIDE * low
    scale = (
        colors.LogNorm(low, top) if logarithmic else colors.Normalize(low, top if top > low else low + 1.0)
    )
    columns = 2 if len(parts) == 4 else min(len(parts), 3)
    rows = -(-len(parts) // columns)
    with drawing():
        size = (2.2 + 3.6 * columns, 0.9 + 3.1 * rows) if len(parts) > 1 else (7.6, 5.2)
        figure, axes = new_figure(rows, columns, size, sharex=True, sharey=True, squeeze=False)
        for panel in axes.flat[len(parts) :]:
            panel.set_visible(False)
        for panel, (title, values) in zip(axes.flat, parts, strict=False):
            drawn = _map(panel, x, y, values[np.ix_(*orders)], scale, name == "margin")
            panel.set_title(title, loc="left", fontsize=SMALL)
            for axis, values_of, set_scale in (("x", x, panel.set_xscale), ("y", y, panel.set_yscale)):
                if _geometric(values_of):
                    set_scale("log")
                    _plain_ticks(getattr(panel, f"{axis}axis"))
        for panel in axes.flat[max(0, len(parts) - columns) : len(parts)]:  # the lowest of each column
            panel.tick_params(labelbottom=True)
            panel.set_xlabel(_label(results, wide))
        for panel in axes[:, 0]:
            panel.set_ylabel(_label(results, high))
        bar = figure.colorbar(drawn, ax=axes, label=_label(results, name))
        if logarithmic:
            _plain_ticks(bar.ax.yaxis)
        note = "   (grey: no figure)" if any(np.isnan(values).any() for _, values in parts) else ""
        entitle(figure, f"{_title(results)}: {_label(results, name)}{note}")
    return figure


def _map(panel: Axes, x: Any, y: Any, values: Any, scale: Any, margin: bool) -> Any:
    panel.set_facecolor(MISSING)
    panel.grid(visible=False)
    drawn = panel.pcolormesh(x, y, values, norm=scale, cmap=COLOUR_MAP, shading="nearest", rasterized=True)
    if min(values.shape) > 2 and np.isfinite(values).all() and float(np.ptp(values)) > 0.0:
        around: list[Any] = [patheffects.withStroke(linewidth=2.0, foreground="#333333")]
        levels = [0.0] if margin else 6  # where the limits are just kept
        lines = panel.contour(*_coarse(x, y, values), levels=levels, colors="white", linewidths=0.9)
        for text in panel.clabel(lines, fontsize=8, fmt="%.3g"):
            text.set_path_effects(around)
        lines.set_path_effects(around)
    if np.isfinite(values).any():
        worst = np.nanargmin(values) if margin else np.nanargmax(values)
        i, j = np.unravel_index(int(worst), values.shape)
        panel.plot([x[j]], [y[i]], "X", ms=8, color=COLOURS[1], mec="white", clip_on=False)
        panel.annotate(
            f"{values[i, j]:.3g}", (x[j], y[i]), xytext=(-7 if j > len(x) / 2 else 7, -4), color="white",
            textcoords="offset points", ha="right" if j > len(x) / 2 else "left",
            va="top" if i > len(y) / 2 else "bottom", fontsize=8.5,
            bbox={"fc": "#333333", "ec": "none", "pad": 1.5}, zorder=6,
        )  # fmt: skip
    return drawn


def _coarse(x: Any, y: Any, values: Any) -> tuple[Any, Any, Any]:
    """Means over small blocks: contour lines of a fine grid are smooth where their values ripple."""
    for axis in (0, 1):
        step = -(-values.shape[axis] // FINEST_CONTOUR)
        whole = values.shape[axis] // step * step
        values = np.moveaxis(values, axis, 0)[:whole]
        values = np.moveaxis(values.reshape(-1, step, values.shape[1]).mean(axis=1), 0, axis)
        if axis == 0:
            y = y[:whole].reshape(-1, step).mean(axis=1)
        else:
            x = x[:whole].reshape(-1, step).mean(axis=1)
    return x, y, values


def _curves(results: xarray.Dataset, name: str, along: str, parts: list[Part]) -> Any:
    order = np.argsort(results[along].values)
    x = results[along].values[order]
    with drawing():
        figure, axes = new_figure(1, 1, (8.0, 4.8))
        for index, (label, values) in enumerate(parts):
            axes.plot(x, values[order], color=COLOURS[index % 8], ls=DASHES[index % 8], label=label or None,
                      marker="o" if len(x) < 30 else None, ms=3.5)  # fmt: skip
        if _geometric(x):
            axes.set_xscale("log")
            _plain_ticks(axes.xaxis)
        if name == "k_dyn":
            axes.axhline(1.0, color=GREY, lw=0.8, ls=":")
        if name == "margin":
            axes.axhline(0.0, color=COLOURS[3], lw=1.0, ls=DASHES[1])
        else:
            axes.set_ylim(bottom=0.0)
        axes.set_xlabel(_label(results, along))
        axes.set_ylabel(_label(results, name))
        axes.set_title(_title(results), loc="left")
        if any(label for label, _ in parts):
            axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
    return figure


def _geometric(values: Any) -> bool:
    """Whether values in order rise by a constant factor, over at least half a decade."""
    if len(values) < 3 or values[0] <= 0.0 or values[-1] < 3.0 * values[0]:
        return False
    steps = np.diff(np.log(values))
    return bool(np.ptp(steps) < 1e-6 * steps.mean())


def _plain_ticks(axis: Any) -> None:
    """Numbers as they are, at 1, 2 and 5 of each decade."""
    plain_ticks(axis, ticker.LogLocator(subs=(1.0, 2.0, 5.0)))


def _title(results: xarray.Dataset) -> str:
    return str(results.attrs.get("title", "sweep"))


def _shown(name: str) -> str:
    return name.removeprefix("controller_").replace("_", " ")


def _label(results: xarray.Dataset, name: str) -> str:
    """What an axis of the picture is called: symbol or words, and the unit."""
    if name == "k_dyn":
        return "K_dyn"
    unit = str(results[name].attrs.get("units", ""))
    symbol = PARAMETERS[name].symbol if name in PARAMETERS else ""
    words = f"{_shown(name)} {symbol}" if symbol and symbol != name else _shown(name)
    return f"{words}, {unit.replace('*', ' ').replace('^', '')}" if unit not in ("", "1") else words


def _text(value: Any) -> str:
    return value if isinstance(value, str) else f"{value:.4g}"


MOST_SHOWN = 40  # starts in the table on the screen, in report.md and in JSON
MOST_WRITTEN = 100_000  # starts in the file
FILE = "cells.csv"
STATUS = "status"


def cell_columns(results: xarray.Dataset) -> dict[str, list[Any]]:
    """What each start has: its place on the axes, its figures, and the name of its status.

    >>> from softstart import sweep
    >>> found = cell_columns(sweep("crane-4amtkf", "direct", {"gap": [0.5, 2.0]}, workers=1))
    >>> found["gap"], [round(k, 4) for k in found["k_dyn"]], found["status"]
    ([0.5, 2.0], [3.1179, 4.8654], ['REACHED', 'REACHED'])
    """
    status = results[STATUS]
    dims = status.dims
    columns: dict[str, list[Any]] = {}
    for name in [*results.coords, *(name for name in results.data_vars if name != STATUS)]:
        one = results[name]
        along = [status.sizes[dim] if dim in one.dims else 1 for dim in dims]
        columns[str(name)] = np.broadcast_to(one.values.reshape(along), status.shape).ravel().tolist()
    names = ["NOT_COMPUTED", *(one.name for one in Status)]
    columns[STATUS] = [names[1 + int(code)] for code in status.values.ravel()]
    return columns


def cell_rows(results: xarray.Dataset) -> Iterator[dict[str, Any]]:
    """The starts one by one, in the order of the axes, the last one changing fastest."""
    columns = cell_columns(results)
    for row in zip(*columns.values(), strict=True):
        yield dict(zip(columns, row, strict=True))


def cell_table(results: xarray.Dataset, to: Console | None = None) -> Table:
    """Each start; headings with units.

    Figures without a place on the screen are left out from the right. The status is among them only where
    not every start reached its target speed.
    """
    columns = cell_columns(results)
    ended = columns.pop(STATUS)
    axes = len(results.coords)
    cells = [
        [f"{value:.6g}" if isinstance(value, float) else str(value) for value in values]
        if index < axes
        else _figures(name, [float(value) for value in values])
        for index, (name, values) in enumerate(columns.items())
    ]
    headings = [_with_unit(results, name, "\n") for name in columns]
    if any(name != Status.REACHED.name for name in ended):
        headings.insert(axes + 1, STATUS)
        cells.insert(axes + 1, [name.lower().replace("_", " ") for name in ended])
    texts = [
        name for name, column in zip(headings, cells, strict=True) if any(c[:1].isalpha() for c in column)
    ]
    while True:
        table = Table.of("Each start", dict(zip(headings, cells, strict=False)), texts)
        if to is None or len(headings) <= axes + 2 or fits(to, table):
            return table
        headings.pop()


def write_cells(results: xarray.Dataset, folder: Path) -> bool:
    """All starts as CSV, with all digits; nothing for a grid that is too large for it."""
    if results[STATUS].size > MOST_WRITTEN:
        return False
    columns = cell_columns(results)
    write_columns(folder / FILE, {_with_unit(results, key, " [", "]"): c for key, c in columns.items()})
    return True


def _figures(name: str, values: list[float]) -> list[str]:
    if name == "keeps_limits":
        return ["yes" if value == 1.0 else "no" for value in values]
    whole = all(math.isnan(value) or value.is_integer() for value in values)
    return [number(value, 0) for value in values] if whole else column_of(values, 5)


def _with_unit(results: xarray.Dataset, name: str, before: str, after: str = "") -> str:
    unit = str(results[name].attrs.get("units", "1"))
    shown = name
    if before == "\n":
        shown = "K_dyn" if name == "k_dyn" else name.replace("_", " ")
    return shown if unit in ("", "1") else f"{shown}{before}{unit}{after}"


def axis_summary(results: xarray.Dataset) -> dict[str, dict[str, Any]]:
    """The axes as plain data: how many values, from where to where or which."""
    found: dict[str, dict[str, Any]] = {}
    for dim in results.k_dyn.dims if "k_dyn" in results else results.status.dims:
        values = results[dim].values
        about: dict[str, Any] = {"count": int(values.size), "unit": results[dim].attrs.get("units", "")}
        if values.dtype.kind in "fiu":
            about |= {"from": float(values.min()), "to": float(values.max())}
        else:
            about["values"] = [str(value) for value in values]
        found[str(dim)] = about
    return found


def axis_table(results: xarray.Dataset) -> Table:
    """The axes."""
    columns: dict[str, list[str]] = {"axis": [], "values": [], "from": [], "to": [], "unit": []}
    for name, about in axis_summary(results).items():
        ends = [f"{about[end]:.6g}" if end in about else "-" for end in ("from", "to")]
        unit = about["unit"] or ", ".join(about.get("values", ()))
        for column, cell in zip(columns.values(), (name, f"{about['count']:,}", *ends, unit), strict=True):
            column.append(cell)
    return Table.of("The grid", columns, ("axis", "unit"))


def figures_table(results: xarray.Dataset, summary: Summary) -> Table:
    """The figures over all starts."""
    names = list(summary.spreads)
    rows = [
        column_of([spread.least, *spread.quantiles.values(), spread.most], 5)
        for spread in summary.spreads.values()
    ]
    headings = ["least", "5 %", "median", "95 %", "most"]
    cells = zip(*rows, strict=True)
    units = [str(results[name].attrs.get("units", "")) for name in names]
    columns = {
        "figure": names,
        "unit": ["" if unit == "1" else unit for unit in units],
        **dict(zip(headings, cells, strict=False)),
    }
    return Table.of("Over all starts", columns, ("figure", "unit"))


def conclusion(results: xarray.Dataset, summary: Summary) -> str:
    """Where the worst case sits, and what share came to its speed."""
    share = f"{summary.share_reached:.4g}" if summary.share_reached < 1.0 else "1"
    reached = (
        "All starts reached the target speed."
        if summary.share_reached == 1.0
        else f"A share of {share} of the starts reached the target speed."
    )
    if summary.share_kept is not None:
        reached += _limits_kept(summary, summary.share_kept)
    if not summary.worst:
        return reached
    most = summary.spreads[summary.judged].most
    unit = results[summary.judged].attrs.get("units", "1")
    places = ", ".join(
        f"{name} {value if isinstance(value, str) else format(value, '.5g')}"
        for name, value in summary.worst.items()
    )
    name = "K_dyn" if summary.judged == "k_dyn" else summary.judged.replace("_", " ")
    return f"Largest {name} {most:.4g}{'' if unit == '1' else ' ' + unit} at {places}. {reached}"


def _limits_kept(summary: Summary, share: float) -> str:
    """How many starts keep the limits, and the least margin."""
    kept = "All" if share == 1.0 else "None" if share == 0.0 else f"A share of {share:.4g}"
    text = (
        f" {kept} of the starts keep{'' if share == 1.0 else 's'} the limits of shaft torque and start time"
    )
    least = summary.spreads.get("margin")
    return (
        f"{text}, least margin {100.0 * least.least:.3g} %."
        if least is not None and least.count
        else f"{text}."
    )


def endings(summary: Summary) -> list[str]:
    """How the starts ended, where not all reached their target speed."""
    if set(summary.statuses) == {Status.REACHED.name}:
        return []
    return [f"{count:,} starts: {Status[name].value}" for name, count in summary.statuses.items()]


def pace(last: Progress | None) -> str:
    """How many starts were made, and how fast."""
    if last is None:
        return ""
    made = last.done - last.before
    said = f"{last.starts:,} starts"
    if last.before:
        said += f", of which {last.before:,} were finished before"
    if made and last.seconds > 0.0:
        said += f"; {made / last.seconds:,.0f} starts/s in {last.seconds:.1f} s"
    return said + "."


def show(
    to: Console,
    drive: Machine,
    fitted_to: Machine | None,
    results: xarray.Dataset,
    summary: Summary,
    last: Progress | None,
) -> None:
    """Print everything."""
    print_lines(to, machine_lines(drive))
    if fitted_to is not None:
        sentence(to, f"  {controllers_set_up(None, fitted_to)}")
    print_tables(to, _tables(results, summary, to))
    notes = (*endings(summary), pace(last))
    print_conclusion(to, [conclusion(results, summary)], [note for note in notes if note])


def _tables(results: xarray.Dataset, summary: Summary, to: Console | None = None) -> list[Table]:
    """The grid, the figures over all starts, and the starts where they are few."""
    each = [cell_table(results, to)] if summary.starts <= MOST_SHOWN else []
    return [axis_table(results), figures_table(results, summary), *each]


OPEN = """\
```python
import xarray

results = xarray.open_zarr("sweep.zarr")
```"""


def write_sweep(
    results: xarray.Dataset,
    summary: Summary,
    drive: Machine,
    folder: Path,
    command: str,
    fitted_to: Machine | None,
) -> None:
    """Everything that sums a sweep up."""
    drawn = {"sweep": summary.judged, "margin": "margin" if "margin" in results else ""}
    pictures = {file: sweep_figure(results, name) for file, name in drawn.items() if name}
    pictures = {file: picture for file, picture in pictures.items() if picture is not None}
    for file, picture in pictures.items():
        save_figure(picture, folder, file)
    rows = [
        [name, results[name].attrs.get("units", ""), *spread.summary().values()]
        for name, spread in summary.spreads.items()
    ]
    headings = list(next(iter(summary.spreads.values())).summary()) if rows else []
    write_table(folder / "sweep.csv", ["figure", "unit", *headings], rows)
    parts = [
        f"# {markdown(drive.name)}: {summary.starts:,} starts",
        markdown(conclusion(results, summary)),
        *map(markdown, endings(summary)),
        *[f"![{file}]({file}.svg)" for file in pictures],
        *table_sections(_tables(results, summary)),
    ]
    written = f", each start in [{FILE}]({FILE})" if write_cells(results, folder) else ""
    parts += [
        f"All numbers with their digits: [sweep.csv](sweep.csv){written}. Every start is in the folder "
        "`sweep.zarr`:",
        OPEN,
    ]
    write_drive_report(folder, parts, drive, command, fitted_to, one=False)
