"""The files of --out beside the results of a sweep: figure, table and a report."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from softstart.views.markdown import (
    drive_table,
    markdown,
    markdown_table,
    provenance,
    write_fitted_to,
    write_table,
    write_text,
)

if TYPE_CHECKING:
    import xarray

    from softstart.drive import Drive
    from softstart.sweeping.summary import Summary

OPEN = """\
```python
import xarray

results = xarray.open_zarr("sweep.zarr")
```"""


def write_sweep(
    results: xarray.Dataset,
    summary: Summary,
    drive: Drive,
    folder: Path,
    command: str,
    fitted_to: Drive | None,
) -> None:
    """Everything that sums a sweep up."""
    from softstart.cli.sweep_cells import FILE, MOST_SHOWN, cell_table, write_cells
    from softstart.cli.sweep_text import axis_columns, conclusion, endings, figure_columns
    from softstart.sweeping.pictures import sweep_figure
    from softstart.views.drawing import save_figure

    picture = sweep_figure(results, summary.judged) if summary.judged else None
    if picture is not None:
        save_figure(picture, folder, "sweep")
    write_text(folder / "drive.toml", drive.to_toml())
    write_fitted_to(fitted_to, folder)
    rows = []
    for name, spread in summary.spreads.items():
        unit = results[name].attrs.get("units", "")
        rows.append([name, unit, *spread.summary().values()])
    headings = list(next(iter(summary.spreads.values())).summary()) if rows else []
    write_table(folder / "sweep.csv", ["figure", "unit", *headings], rows)
    parts = [
        f"# {markdown(drive.name)}: {summary.starts:,} starts",
        markdown(conclusion(results, summary)),
        *map(markdown, endings(summary)),
        *(["![sweep](sweep.svg)"] if picture is not None else []),
    ]
    for title, columns in (
        ("The grid", axis_columns(results)),
        ("Over all starts", figure_columns(results, summary)),
    ):
        cells = [list(row) for row in zip(*columns.values(), strict=True)]
        parts += [f"## {title}", markdown_table(list(columns), cells)] if cells else []
    if summary.starts <= MOST_SHOWN:
        headings, cells, axes = cell_table(results)
        headings = [" ".join(heading.split()) for heading in headings]
        parts += ["## Each start", markdown_table(headings, cells, numbers_from=axes)]
    written = f", each start in [{FILE}]({FILE})" if write_cells(results, folder) else ""
    parts += [
        f"All numbers with their digits: [sweep.csv](sweep.csv){written}. Every start is in the folder "
        "`sweep.zarr`:",
        OPEN,
        "## The drive",
        drive_table(drive),
        provenance(drive, command, fitted_to, one=False),
    ]
    write_text(folder / "report.md", "\n\n".join(parts) + "\n")
