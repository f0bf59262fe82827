"""The files of --out for optima: profiles, figures, tables and a report."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from softstart.views.markdown import (
    drive_table,
    markdown,
    markdown_table,
    provenance,
    write_table,
    write_text,
)

if TYPE_CHECKING:
    from softstart.optimal.front import Front
    from softstart.optimal.result import Optimum
    from softstart.optimal.robust.solving import SensorWorth
    from softstart.start.run import Run

PLAY = "softstart simulate drive.toml --controller profile --param file=profile.csv"


def write_optimum(best: Optimum, others: Sequence[Run], folder: Path, command: str) -> None:
    """Everything about an optimal start."""
    from softstart.cli.optimum_text import bound_sentence, comparison, figure_rows, name_of, question
    from softstart.optimal.pictures import optimum_figure
    from softstart.views.drawing import save_figure
    from softstart.views.numbers import number

    drive = best.problem.drive
    save_figure(optimum_figure(best), folder, "optimum")
    best.profile.to_csv(folder / "profile.csv")
    best.profile.to_toml(folder / "profile.toml", about={"drive": drive.name, "k_dyn": best.k_dyn})
    best.profile.to_c(folder / "profile.c")
    best.run.to_csv(folder / "trace-optimum.csv")
    write_text(folder / "drive.toml", drive.to_toml())
    summary = {key: value for key, value in best.summary().items() if key not in ("profile", "seconds")}
    write_table(folder / "figures.csv", list(summary), [list(summary.values())])
    rows = figure_rows(best)[:-1]  # without the computing time: the same command writes the same report
    beside = [
        [
            name_of(run),
            number(run.k_dyn, 4),
            number(run.start_time, 5),
        ]
        for run in sorted(others, key=lambda run: run.k_dyn)
    ]
    parts = [
        f"# {markdown(drive.name)}: optimal start",
        f"Asked: {markdown(question(best))}. Method {best.method}: {markdown(best.why)}",
        markdown(comparison(best, others)),
        markdown_table(["figure", "value"], rows, numbers_from=1),
        markdown(bound_sentence(best)),
        "![optimum](optimum.svg)",
        "## The profile",
        "[profile.csv](profile.csv), [profile.toml](profile.toml) and, as an interpolating function in C, "
        f"[profile.c](profile.c). Played again it gives the same K\\_dyn:\n\n```sh\n{PLAY}\n```\n\n"
        "Traces of the start: [trace-optimum.csv](trace-optimum.csv).",
        "## The controllers on this drive",
        markdown_table(["strategy", "K_dyn", "start time s"], beside, numbers_from=1),
        "## The drive",
        drive_table(drive),
        provenance(drive, command),
    ]
    write_text(folder / "report.md", "\n\n".join(parts) + "\n")


def write_front(front: Front, folder: Path, command: str) -> None:
    """Everything about a curve over start times, but its saved state."""
    from softstart.cli.pareto import conclusion, controller_columns, footnotes, point_columns
    from softstart.views.drawing import save_figure

    save_figure(front.plot(), folder, "pareto")
    front.to_csv(folder / "pareto.csv")
    write_text(folder / "drive.toml", front.drive.to_toml())
    parts = [
        f"# {markdown(front.drive.name)}: least K\\_dyn against start time",
        f"Terminal {front.terminal}.",
        markdown(conclusion(front)),
        "![pareto](pareto.svg)",
    ]
    for title, columns in (
        ("The curve", point_columns(front)),
        ("The controllers", controller_columns(front)),
    ):
        headings = [" ".join(heading.split()) for heading in columns]
        cells = [list(row) for row in zip(*columns.values(), strict=True)]
        parts += [f"## {title}", markdown_table(headings, cells, numbers_from=1)] if cells else []
    parts += [
        *map(markdown, footnotes(front)),
        "All numbers with their digits: [pareto.csv](pareto.csv). Points with their torque profiles, from "
        "which the same command goes on: [pareto.jsonl](pareto.jsonl).",
        "## The drive",
        drive_table(front.drive),
        provenance(front.drive, command),
    ]
    write_text(folder / "report.md", "\n\n".join(parts) + "\n")


def write_worth(worth: SensorWorth, folder: Path, command: str) -> None:
    """Everything about one profile for several drives, without and with a contact sensor."""
    from softstart.cli.optimize_robust import bound_sentence, conclusion, scenario_columns
    from softstart.optimal.pictures import worth_figure
    from softstart.views.drawing import save_figure

    base = worth.blind.base
    save_figure(worth_figure(worth), folder, "contact-sensor")
    write_text(folder / "drive.toml", base.to_toml())
    for stem, best in (("blind", worth.blind), ("reacting", worth.reacting)):
        best.profile.to_toml(folder / f"profile-{stem}.toml", about={"drive": base.name, "k_dyn": best.k_dyn})
        for number, run in enumerate(best.runs, start=1):
            run.to_csv(folder / f"trace-{stem}-{number}.csv")
    worth.blind.profile.to_csv(folder / "profile-blind.csv")
    worth.blind.profile.to_c(folder / "profile-blind.c")
    columns = scenario_columns(worth)
    headings = [" ".join(heading.split()) for heading in columns]
    parts = [
        f"# {markdown(base.name)}: one profile for {len(worth.blind.scenarios)} drives",
        f"Start time at most {worth.blind.start_time:.6g} s, terminal reached. {markdown(conclusion(worth))}",
        markdown_table(headings, [list(row) for row in zip(*columns.values(), strict=True)], numbers_from=0),
        markdown(bound_sentence(worth.blind)),
        "![contact-sensor](contact-sensor.svg)",
        "Without a sensor: [profile-blind.toml](profile-blind.toml), [profile-blind.csv](profile-blind.csv), "
        "[profile-blind.c](profile-blind.c). With one, its second part from the contact on: "
        "[profile-reacting.toml](profile-reacting.toml). Traces of each drive, in the order of the table: "
        "trace-blind-1.csv and so on.",
        "## The drive",
        drive_table(base),
        provenance(base, command),
    ]
    write_text(folder / "report.md", "\n\n".join(parts) + "\n")
