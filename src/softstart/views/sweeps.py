"""What is shown of a sweep: sentences, tables, maps and curves, and the files of --out."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from softstart.drive import PARAMETERS
from softstart.drive.model import LOAD
from softstart.start.status import Status
from softstart.sweeping.summary import SHARES, pieces, worst_place
from softstart.views import drawing as draw
from softstart.views.drives import controllers_set_up
from softstart.views.numbers import (
    NOTHING,
    Column,
    TextTable,
    column_of,
    label,
    number,
    plural,
    plural_of,
    seen_at,
    units_of,
)
from softstart.views.sheet import Sheet, Writer, columns_file, records_file
from softstart.views.starts import machine_lines

if TYPE_CHECKING:
    import xarray
    from matplotlib.figure import Figure
    from pandas import DataFrame

    from softstart.drive.machine import Machine
    from softstart.sweeping.entry import SweepProgress
    from softstart.sweeping.summary import Summary

MOST_PANELS, MOST_LINES = 6, 8
MOST_COUNT = 1e9
MOST_CELLS = 4_000_000  # of a map
MOST_SHOWN = 40  # starts in the table on the screen, in report.md and in JSON
MOST_WRITTEN = 100_000  # starts in the file
FILE, STATUS = "cells.csv", "status"
TWO_WAYS = "Everything is at the motor shaft, as the load drives the motor in a part of the grid only."

Part = tuple[str, NDArray[np.float64]]  # title, and the values along the axes drawn


def as_seen(results: xarray.Dataset, machine: Machine) -> xarray.Dataset:
    """The grid in the units and at the shaft of its machine.

    The axes are brought over; figures, which may fill a disk, stay as they are: their attribute `seen` is
    what they are multiplied by. At the motor shaft where the load drives the motor in a part of the grid.

    >>> from softstart import Drive, sweep
    >>> crane = Drive.load("crane-4amtkf").replace(gear_ratio=40.0, units="arcmin, at output")
    >>> found = as_seen(sweep(crane, "direct", {"gap": [0.5, 2.0]}, workers=1), crane)
    >>> found["gap"].values.round(2), found["gap"].units, found["peak_torque"].seen
    (array([ 42.97, 171.89]), 'arcmin', 40.0)
    """
    units, axes = units_of(machine), set(results.coords)
    if units.gear:
        loads = [results[one].values if one in axes else [getattr(machine, one)] for one in LOAD]
        ends = sum(map(np.min, loads)), sum(map(np.max, loads))
        alike = (ends[0] < 0.0) == (ends[1] < 0.0)
        units = units._replace(gear=units.gear._replace(load=ends[0]) if alike else None)
    found = results.copy()
    for name, one in results.variables.items():
        key, si = str(name), str(one.attrs.get("units", ""))
        seen_in = units.of_setting(key, si)
        if one.dtype.kind not in "fiu" or (seen_in.of(si) == si and not seen_in.is_at_output(si)):
            continue
        size, about = float(seen_in.shown(1.0, si)), {"units": seen_in.of(si)}
        if key in axes:
            found = found.assign_coords({key: (one.dims, one.values * size, one.attrs | about)})
        else:
            found[key].attrs.update(about, seen=size)
    found.attrs["at"] = units.at
    return found


def summary_as_seen(summary: Summary, seen: xarray.Dataset) -> Summary:
    """The same of a summary of the grid."""
    spreads = {
        name: {key: value if key == "count" else value * _size(seen, name) for key, value in one.items()}
        for name, one in summary.spreads.items()
    }
    return replace(summary, spreads=spreads, worst=worst_place(seen, summary.judged))


def _size(results: xarray.Dataset, name: str) -> float:
    return float(results[name].attrs.get("seen", 1.0))


def sweep_figure(results: xarray.Dataset, name: str = "k_dyn") -> Figure | None:
    """A figure of the starts over the grid, or None where nothing can be drawn.

    Two long axes of numbers make a map; further axes make panels, or, if these were too many, the map shows
    the largest value over them, of a margin the least. One axis of numbers makes curves.
    """
    across = _drawn(results, name)
    return _figure(results, name, across) if across else None


def _figure(results: xarray.Dataset, name: str, across: list[str]) -> Figure:
    """The figure over these axes."""
    rest = [str(dim) for dim in results[name].dims if results.sizes[dim] > 1 and dim not in across]
    drawn, most = (_curves, MOST_LINES) if len(across) == 1 else (_maps, MOST_PANELS)
    if math.prod(results.sizes[dim] for dim in rest) <= most:
        return drawn(results, name, across, _each(results, name, across, rest))
    end = "least" if name == "margin" else "largest"
    over = f"{end} over {', '.join(map(label, rest))}"
    return drawn(results, name, across, [(over, _worst(results, name, across))])


def _drawn(results: xarray.Dataset, name: str) -> list[str]:
    """The one or two long axes of numbers that are drawn; none where there is nothing to draw."""
    sizes = {str(dim): size for dim, size in results[name].sizes.items() if size > 1}
    numeric = [dim for dim in sizes if dim in results.coords and results[dim].dtype.kind in "fiu"]
    across = sorted(sorted(numeric, key=lambda dim: -sizes[dim])[:2], key=list(sizes).index)
    return across if math.prod(sizes[dim] for dim in across) <= MOST_CELLS else []


def _each(results: xarray.Dataset, name: str, across: list[str], rest: list[str]) -> list[Part]:
    """A part for every combination of the other axes."""
    parts = []
    for index in np.ndindex(*(results.sizes[dim] for dim in rest)):
        one = results[name].isel(dict(zip(rest, index, strict=True)))
        values = {dim: results[dim].values[i] for dim, i in zip(rest, index, strict=True)}
        words = [v if dim == "controller" else f"{label(dim)} {_text(v)}" for dim, v in values.items()]
        parts.append((", ".join(words), _size(results, name) * one.squeeze().transpose(*across).values))
    return parts


def _worst(results: xarray.Dataset, name: str, across: list[str]) -> NDArray[np.float64]:
    """The largest value over all axes that are not drawn, of a margin the least, read piece by piece."""
    worse = np.fmin if name == "margin" else np.fmax
    field = results[name]
    kept = [list(field.dims).index(dim) for dim in across]
    away = tuple(i for i in range(field.ndim) if i not in kept)
    found = np.full([field.shape[i] for i in kept], np.nan)
    for place, values in pieces(results, name):
        part = tuple(place[i] for i in kept)
        found[part] = worse(found[part], worse.reduce(values, axis=away))
    return _size(results, name) * found


def _maps(results: xarray.Dataset, name: str, across: list[str], parts: list[Part]) -> Figure:
    orders = [np.argsort(results[dim].values) for dim in across]
    y, x = (results[dim].values[order] for dim, order in zip(across, orders, strict=True))
    high, wide = (_axis(results, dim) for dim in across)
    scale = draw.colour_scale(*(values for _, values in parts))
    with draw.drawing():
        size = (3.8, 3.1) if len(parts) > 1 else (6.6, 4.5)
        figure, axes = draw.panels(len(parts), size, 2 if len(parts) == 4 else 3, wide, high)
        for panel, (title, values) in zip(axes, parts, strict=True):
            drawn = draw.heat_map(panel, x, y, values[np.ix_(*orders)], scale, margins=name == "margin")
            panel.set_title(title, loc="left", fontsize=draw.SMALL)
        bar = figure.colorbar(drawn, ax=axes, label=_axis(results, name))
        if bar.ax.get_yscale() == "log":
            draw.decade_ticks(bar.ax.yaxis)
        note = "   (grey: no figure)" if any(np.isnan(values).any() for _, values in parts) else ""
        draw.entitle(figure, f"{_title(results)}: {_axis(results, name)}{note}")
    return figure


def _curves(results: xarray.Dataset, name: str, across: list[str], parts: list[Part]) -> Figure:
    order = np.argsort(results[across[0]].values)
    x = results[across[0]].values[order]
    marker: dict[str, str | float] = {"marker": "o", "ms": 3.5} if len(x) < 30 else {}
    with draw.drawing():
        figure, axes = draw.new_figure(1, 1, (8.0, 4.8))
        for index, (title, values) in enumerate(parts):
            axes.plot(x, values[order], label=title or None, **draw.line_of(index, dashed=True), **marker)
        draw.fit_axis(axes, "x", x)
        if name in ("k_dyn", "margin"):
            axes.axhline(float(name == "k_dyn"), color=draw.GREY, lw=0.8, ls=":")
        if name != "margin":
            axes.set_ylim(bottom=0.0)
        draw.head(axes, _title(results), _axis(results, name), _axis(results, across[0]))
        if any(title for title, _ in parts):
            draw.legend_beside(axes)
    return figure


def _what(results: xarray.Dataset) -> str:
    """What is at each place of the grid: a start, or a duty."""
    return "duty" if "softstart_duty" in results.attrs else "start"


def _title(results: xarray.Dataset) -> str:
    return f"{results.attrs['title']}{_at(results)}"


def _at(results: xarray.Dataset) -> str:
    """What a title adds: the shaft, where it is not that of the motor."""
    return str(results.attrs.get("at", ""))


def _unit(results: xarray.Dataset, name: str) -> str:
    return str(results[name].attrs.get("units", ""))


def _axis(results: xarray.Dataset, name: str) -> str:
    """What an axis of the picture is called: words, symbol and unit."""
    symbol = PARAMETERS[name].symbol if name in PARAMETERS else ""
    return label(f"{name} {symbol}" if symbol not in ("", name) else name, _unit(results, name))


def _text(value: str | float, digits: int = 4) -> str:
    return value if isinstance(value, str) else f"{value:.{digits}g}"


def cells(results: xarray.Dataset) -> DataFrame:
    """Each start as a row of a pandas.DataFrame: its place on the axes, its figures, the name of its status.

    >>> from softstart import sweep
    >>> found = cells(sweep("crane-4amtkf", "direct", {"gap": [0.5, 2.0]}, workers=1))
    >>> list(found["gap"]), [round(k, 4) for k in found["k_dyn"]], list(found["status"])
    ([0.5, 2.0], [3.1179, 4.8654], ['REACHED', 'REACHED'])
    """
    frame = results.to_dataframe([str(dim) for dim in results[STATUS].dims]).reset_index()
    names = ["NOT_COMPUTED", *(one.name for one in Status)]
    frame[STATUS] = [names[1 + int(code)] for code in frame[STATUS]]
    return frame[[*results.coords, *(name for name in results.data_vars if name != STATUS), STATUS]]


def _write_cells(results: xarray.Dataset, path: Path) -> None:
    """The same as CSV, with the units as they are written in drive files."""
    units = {str(name): _unit(results, str(name)) for name in results.variables}
    columns = cells(results).to_dict("list").items()
    columns_file({f"{n} [{units[n]}]" if units[n] not in ("", "1") else n: c for n, c in columns})(path)


def start_table(results: xarray.Dataset) -> TextTable:
    """Each start or duty, with its status where not every one was successful."""
    columns = cells(results).to_dict("list")
    ended, axes = columns.pop(STATUS), len(results.coords)
    shown: list[tuple[str, list[str]]] = []
    for name, values in columns.items():
        if len(shown) < axes:
            texts = [_text(value, 6) for value in values]
        else:
            texts = _figures([_size(results, name) * value for value in values])
        shown.append((label(name, _unit(results, name), "\n"), texts))
    if not set(ended) <= {status.name for status in Status if status.success}:
        shown.insert(axes + 1, (STATUS, [name.lower().replace("_", " ") for name in ended]))
    words = [heading for heading, column in shown if any(one[:1].isalpha() for one in column)]
    return TextTable.of(f"Each {_what(results)}{_at(results)}", dict(shown), words, keys=axes)


def _figures(values: list[float]) -> list[str]:
    # every large float is whole, also that of a damage
    whole = all(math.isnan(value) or (value < MOST_COUNT and value == int(value)) for value in values)
    return [number(value, 0) for value in values] if whole else column_of(values, 5)


def axis_summary(results: xarray.Dataset) -> dict[str, dict[str, Any]]:
    """The axes as plain data: how many values, from where to where or which."""
    found: dict[str, dict[str, Any]] = {}
    for dim in results[STATUS].dims:
        values = results[dim].values
        found[str(dim)] = {"count": int(values.size), "unit": _unit(results, str(dim))} | (
            {"from": float(values.min()), "to": float(values.max())}
            if values.dtype.kind in "fiu"
            else {"values": [str(value) for value in values]}
        )
    return found


def _tables(results: xarray.Dataset, summary: Summary) -> list[TextTable]:
    """The grid, the figures over all starts, and the starts where they are few."""
    axes = [
        [name, f"{one['count']:,}", *(f"{one[end]:.6g}" if end in one else NOTHING for end in ("from", "to")),
         one["unit"].replace("*", " ") or ", ".join(one.get("values", ()))]
        for name, one in axis_summary(results).items()
    ]  # fmt: skip
    spreads = [
        [name, label("", _unit(results, name), ""),
         *column_of([spread[one] for one in ("min", *SHARES, "max")], 5)]
        for name, spread in summary.spreads.items()
    ]  # fmt: skip
    numbers = [Column(heading) for heading in ("values", "from", "to")]
    over = f"Over all {plural_of(_what(results))}{_at(results)}"
    ends = ("least", "5 %", "median", "95 %", "most")
    return [
        TextTable(f"The grid{_at(results)}", [Column("axis", False), *numbers, Column("unit", False)], axes),
        TextTable.of_rows(over, ("figure", "unit"), ends, spreads),
        *([start_table(results)] if summary.starts <= MOST_SHOWN else []),
    ]


def sweep_conclusion(results: xarray.Dataset, summary: Summary) -> str:
    """Where the worst case sits, and which shares came to their speed and keep the limits."""
    what = plural_of(_what(results))
    done = "were carried out" if _what(results) == "duty" else "reached the target speed"

    def of_the_starts(share: float) -> str:
        return f"All {what}" if share == 1.0 else f"{100.0 * share:.4g} % of the {what}"

    found = [f"{of_the_starts(summary.share_reached)} {done}."]
    if summary.worst:
        places = ", ".join(f"{name} {_text(value, 5)}" for name, value in summary.worst.items())
        most = f"{summary.spreads[summary.judged]['max']:.4g}"
        unit = label(most, _unit(results, summary.judged), " ")
        found.insert(0, f"Largest {label(summary.judged)} {unit} at {places}{_at(results)}.")
    if summary.share_kept is not None:
        least = summary.spreads.get("margin")
        margin = f", least margin {100.0 * least['min']:.3g} %" if least and least["count"] else ""
        kept = f"{of_the_starts(summary.share_kept)} keep the limits of shaft torque and start time"
        found.append(f"{kept}{margin}.")
    return " ".join(found)


def pace(last: SweepProgress) -> str:
    """How many starts were made, and how fast."""
    made, before = last.done - last.before, f", of which {last.before:,} were finished before"
    rate = f"; {made / last.seconds:,.0f} {last.what}/s in {last.seconds:.1f} s"
    speed = rate if made and last.seconds else ""
    noun = "duty" if last.what == "duties" else "start"
    return f"{plural(last.starts, noun)}{before if last.before else ''}{speed}."


def sweep_sheet(
    results: xarray.Dataset, summary: Summary, drive: Machine, fitted_to: Machine | None = None
) -> Sheet:
    """What is shown of a sweep."""
    seen = as_seen(results, drive)
    drawn = {"sweep": summary.judged, "margin": "margin"}
    spreads = summary.spreads.items()
    files: dict[str, str | Writer] = {}
    if spreads:
        records = [{"figure": one, "unit": _unit(results, one), **spread} for one, spread in spreads]
        files["sweep.csv"] = records_file(records)
    if summary.starts <= MOST_WRITTEN:
        files[FILE] = partial(_write_cells, results)
    return Sheet(
        f"{drive.name}: {plural(summary.starts, _what(results))}",
        [
            *machine_lines(drive if _at(seen) else seen_at(drive, "motor")),
            f"  Duty: {duty}" if (duty := results.attrs.get("softstart_duty")) else "",
            f"  {controllers_set_up(None, fitted_to)}" if fitted_to else "",
        ],
        tables=_tables(seen, summary_as_seen(summary, seen)),
        conclusions=[sweep_conclusion(seen, summary_as_seen(summary, seen))],
        notes=[
            *([TWO_WAYS] if units_of(drive).gear and not _at(seen) else []),
            *(
                f"{plural(count, _what(results))}: {Status[name].value}"
                for name, count in summary.statuses.items()
                if not Status[name].success
            ),
        ],
        figures={
            file: partial(_figure, seen, name, across)
            for file, name in drawn.items()
            if name in summary.spreads and summary.spreads[name]["count"]
            if (across := _drawn(seen, name))
        },
        files=files,
        machine=drive,
        fitted_to=fitted_to,
        varied=True,
        behind=[f'Every {_what(results)} is in the folder `sweep.zarr`: `xarray.open_zarr("sweep.zarr")`.'],
    )
