"""The folder of `softstart clutch --out`: figures, traces, laws and a report."""

from __future__ import annotations

import platform
from pathlib import Path
from typing import TYPE_CHECKING

from softstart import __version__
from softstart.cli.clutch_text import (
    STATUS,
    conclusion,
    figure_rows,
    law_columns,
    point_columns,
)
from softstart.views.drawing import save_figure
from softstart.views.markdown import markdown, markdown_table, write_table, write_text

if TYPE_CHECKING:
    from softstart.clutch import Clutch, Engagement, EngagementFront

TRACES = {"t": "t [s]", "M": "M [N*m]", "F": "F [N*m]", "T": "T [N*m]", "theta": "theta [rad]",
          "wM": "wM [rad/s]", "wc": "wc [rad/s]"}  # fmt: skip
LAW = ("t [s]", "M [N*m]")


def write_engagement(run: Engagement, folder: Path, command: str) -> None:
    """Everything about one engagement."""
    save_figure(run.plot(), folder, "engagement")
    traces = {"t": run.t, **run.at(run.t)}
    write_table(
        folder / "traces.csv",
        list(TRACES.values()),
        [list(row) for row in zip(*(traces[name].tolist() for name in TRACES), strict=True)],
    )
    write_table(folder / "events.csv", ("time [s]", "event"), [(event.t, event.name) for event in run.events])
    write_table(
        folder / "phases.csv",
        ("phase", "start [s]", "end [s]", "peak torque [N*m]", "at [s]", "friction work [J]"),
        [list(vars(phase).values()) for phase in run.phases],
    )
    write_text(folder / "clutch.toml", run.clutch.to_toml())
    parts = [
        f"# {markdown(run.clutch.name)}: {markdown(run.law.label)}",
        STATUS[run.status],
        markdown_table(["figure", "value", "unit", "meaning"], figure_rows(run)),
        "![engagement](engagement.svg)",
        "Traces: [traces.csv](traces.csv). Events: [events.csv](events.csv). Phases: "
        "[phases.csv](phases.csv).",
        _provenance(run.clutch, command),
    ]
    write_text(folder / "report.md", "\n\n".join(parts) + "\n")


def write_front(front: EngagementFront, folder: Path, command: str) -> None:
    """The front, each of its laws as a table that --law reads, and the report."""
    save_figure(front.plot(), folder, "front")
    for index, point in enumerate(front.points, start=1):
        write_table(folder / f"law-{index}.csv", LAW, list(zip(point.times, point.torques, strict=True)))
    summaries = [
        {k: v for k, v in p.summary().items() if k not in ("times", "torques")} for p in front.points
    ]
    write_table(folder / "front.csv", list(summaries[0]), [list(one.values()) for one in summaries])
    if front.laws:
        beside = [law.summary() for law in front.laws]
        write_table(folder / "laws.csv", list(beside[0]), [list(one.values()) for one in beside])
    write_text(folder / "clutch.toml", front.clutch.to_toml())
    parts = [f"# {markdown(front.clutch.name)}: optimal laws, {front.law_class}", conclusion(front)]
    for columns in (point_columns(front), law_columns(front)):
        rows = [list(row) for row in zip(*columns.values(), strict=True)]
        if rows:
            parts.append(markdown_table([name.replace("\n", " ") for name in columns], rows))
    parts += [
        f"The bounds cover {front.covers}.",
        "![front](front.svg)",
        "Points: [front.csv](front.csv). The laws: law-1.csv, ..., to be played with --law.",
        _provenance(front.clutch, command),
    ]
    write_text(folder / "report.md", "\n\n".join(parts) + "\n")


def _provenance(clutch: Clutch, command: str) -> str:
    return (
        "## Where this comes from\n\n"
        f"softstart {__version__}, Python {platform.python_version()}, with the "
        f"command\n\n```sh\n{command}\n```\n\n"
        f"on the clutch of [clutch.toml](clutch.toml), which holds all changes. Source: "
        f"{markdown(clutch.source)}"
    )
