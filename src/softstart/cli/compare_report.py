"""The files of --out: figures, traces, tables and a report that ties them together."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from softstart.views.markdown import (
    drive_table,
    file_stem,
    markdown,
    markdown_table,
    provenance,
    write_fitted_to,
    write_table,
    write_text,
)

if TYPE_CHECKING:
    from softstart.drive import Drive
    from softstart.start.comparison import Comparison
    from softstart.start.run import Run


def write_comparison(comparison: Comparison, folder: Path, command: str) -> None:
    """Everything about a comparison."""
    from softstart.cli.compare import columns_and_rows, conclusion, footnotes, name_of
    from softstart.views.drawing import save_figure
    from softstart.views.starts import comparison_figure, trade_off_figure

    rows = comparison.rows
    runs = [row.run for row in rows]
    name = comparison.drive.name
    pictures = {"comparison": comparison_figure(runs, name)}
    points = [
        (name_of(r), r.run.start_time, r.run.k_dyn) for r in rows if r.run.start_time == r.run.start_time
    ]
    if points:
        pictures["trade-off"] = trade_off_figure(points, name)
    for stem, figure in pictures.items():
        save_figure(figure, folder, stem)
    stems: list[str] = []
    for row in rows:
        stems.append(file_stem(name_of(row), stems))
        _write_run(row.run, folder, stems[-1])

    summaries = [row.summary() for row in rows]
    keys = [key for key in summaries[0] if key not in ("parameters", "status_text")]
    write_text(folder / "drive.toml", comparison.drive.to_toml())
    write_fitted_to(comparison.fitted_to, folder)
    write_table(folder / "comparison.csv", keys, [[one[key] for key in keys] for one in summaries])

    columns, cells = columns_and_rows(rows)
    headings = [" ".join(column.heading.split()) for column in columns]
    parts = [
        f"# {markdown(name)}: soft-start strategies compared",
        conclusion(comparison),
        markdown_table(headings, cells, numbers_from=1),
        *footnotes(comparison),
        *(f"![{stem}]({stem}.svg)" for stem in pictures),
        "## The drive",
        drive_table(comparison.drive),
        "## The strategies",
        *(_strategy(run, stem) for run, stem in zip(runs, stems, strict=True)),
        provenance(comparison.drive, command, comparison.fitted_to),
    ]
    write_text(folder / "report.md", "\n\n".join(parts) + "\n")


def write_start(run: Run, folder: Path, command: str, fitted_to: Drive | None) -> None:
    """Everything about one start; `fitted_to` is the drive for which the controller is set up, if another."""
    from softstart.cli.simulate import EVENT_COLUMNS, STAGE_COLUMNS, event_rows, figure_rows, stage_rows

    stem = file_stem(run.controller.name or type(run.controller).__name__)
    _write_run(run, folder, stem)
    write_text(folder / "drive.toml", run.drive.to_toml())
    write_fitted_to(fitted_to, folder)
    write_table(folder / "stages.csv", STAGE_COLUMNS, stage_rows(run))
    write_table(folder / "events.csv", EVENT_COLUMNS, event_rows(run))
    summary = {key: value for key, value in run.summary().items() if key != "parameters"}
    write_table(folder / "figures.csv", list(summary), [list(summary.values())])
    parts = [
        f"# {markdown(run.drive.name)}: start under {markdown(stem)}",
        run.status.value,
        markdown_table(["figure", "value"], figure_rows(run), numbers_from=1),
        _strategy(run, stem),
        "Stages: [stages.csv](stages.csv). Events: [events.csv](events.csv).",
        "## The drive",
        drive_table(run.drive),
        provenance(run.drive, command, fitted_to),
    ]
    write_text(folder / "report.md", "\n\n".join(parts) + "\n")


def _write_run(run: Run, folder: Path, stem: str) -> None:
    from softstart.views.drawing import save_figure

    save_figure(run.plot(), folder, f"run-{stem}")
    run.to_csv(folder / f"trace-{stem}.csv")


def _strategy(run: Run, stem: str) -> str:
    cls = type(run.controller)
    values = ", ".join(f"{key} = {value}" for key, value in run.controller.parameters.items())
    summary = f": {markdown(cls.summary)}" if cls.summary else ""
    return (
        f"### {markdown(stem)}\n\n{markdown(cls.__name__)}{summary}.\n\nParameters: {values or 'none'}.\n\n"
        f"![{stem}](run-{stem}.svg)\n\nTraces: [trace-{stem}.csv](trace-{stem}.csv)"
    )
