"""The files of --out for a tuning: gains, figures, tables and a report."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from softstart.views.markdown import (
    drive_table,
    markdown,
    markdown_table,
    provenance,
    write_table,
    write_text,
)

if TYPE_CHECKING:
    from xarray import Dataset

    from softstart.tuning.outcome import Tuning


def write_tuning(tuning: Tuning, folder: Path, command: str) -> None:
    """Everything about a tuning, but its saved state."""
    from softstart.cli.tune_text import cell_columns, conclusions, map_columns, notes, question, set_columns
    from softstart.views.drawing import save_figure

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
