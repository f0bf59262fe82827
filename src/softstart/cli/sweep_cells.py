"""The starts of a sweep one by one: a table on the screen for a few, a file for many."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from softstart.start.status import Status

if TYPE_CHECKING:
    import xarray
    from rich.console import Console

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
    import numpy as np

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


def cell_table(results: xarray.Dataset, to: Console | None = None) -> tuple[list[str], list[list[str]], int]:
    """Headings with units, rows, and how many columns from the left are axes.

    Figures without a place on the screen are left out from the right. The status is among them only where
    not every start reached its target speed.
    """
    from softstart.views.numbers import Column
    from softstart.views.terminal import fits

    columns = cell_columns(results)
    ended = columns.pop(STATUS)
    axes = len(results.coords)
    cells = [
        [f"{value:.6g}" if isinstance(value, float) else str(value) for value in values]
        if index < axes
        else _figures([float(value) for value in values])
        for index, values in enumerate(columns.values())
    ]
    headings = [_with_unit(results, name, "\n") for name in columns]
    if any(name != Status.REACHED.name for name in ended):
        headings.insert(axes + 1, STATUS)
        cells.insert(axes + 1, [name.lower().replace("_", " ") for name in ended])
    while to is not None and len(cells) > axes + 2:
        rows = [list(row) for row in zip(*cells, strict=True)]
        if fits(to, [Column(heading) for heading in headings], rows):
            break
        headings.pop()
        cells.pop()
    return headings, [list(row) for row in zip(*cells, strict=True)], axes


def write_cells(results: xarray.Dataset, folder: Path) -> bool:
    """All starts as CSV, with all digits; nothing for a grid that is too large for it."""
    from softstart.views.markdown import write_table

    if results[STATUS].size > MOST_WRITTEN:
        return False
    columns = cell_columns(results)
    headings = [_with_unit(results, name, " [", "]") for name in columns]
    rows = zip(*columns.values(), strict=True)
    write_table(folder / FILE, headings, [[_cell(value) for value in row] for row in rows])
    return True


def _figures(values: list[float]) -> list[str]:
    from softstart.views.numbers import column_of, number

    whole = all(math.isnan(value) or value.is_integer() for value in values)
    return [number(value, 0) for value in values] if whole else column_of(values, 5)


def _with_unit(results: xarray.Dataset, name: str, before: str, after: str = "") -> str:
    unit = str(results[name].attrs.get("units", "1"))
    shown = name
    if before == "\n":
        shown = "K_dyn" if name == "k_dyn" else name.replace("_", " ")
    return shown if unit in ("", "1") else f"{shown}{before}{unit}{after}"


def _cell(value: Any) -> Any:
    """A figure that a start does not have is an empty cell."""
    return None if isinstance(value, float) and math.isnan(value) else value
