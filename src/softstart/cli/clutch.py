"""`softstart clutch`: one engagement of a slipping clutch, or the best engagement laws there are."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from softstart.cli.commands import Command, Reading, did_you_mean, typed
from softstart.cli.completion import names_or_files, table_keys
from softstart.cli.options import (
    changes_option,
    command_line,
    count,
    json_option,
    out_option,
    quantity,
    read_changes,
)
from softstart.cli.running import working
from softstart.clutch import (
    LAWS,
    Clutch,
    Engagement,
    EngagementFront,
    engage,
    optimize_engagement,
)
from softstart.clutch.laws import read_law
from softstart.clutch.model import LIBRARY
from softstart.errors import InputError, Mistakes
from softstart.views import clutches as views
from softstart.views.drawing import save_figure
from softstart.views.markdown import (
    markdown,
    markdown_table,
    output_folder,
    write_report,
    write_rows,
    write_table,
    write_text,
)
from softstart.views.terminal import present, print_conclusion, print_lines, print_tables

if TYPE_CHECKING:
    from rich.console import Console

DEFAULT_POINTS = 8


TRACES = {"t": "t [s]", "M": "M [N*m]", "F": "F [N*m]", "T": "T [N*m]", "theta": "theta [rad]",
          "wM": "wM [rad/s]", "wc": "wc [rad/s]"}  # fmt: skip
LAW = ("t [s]", "M [N*m]")
PHASES = ("phase", "start [s]", "end [s]", "peak torque [N*m]", "at [s]", "friction work [J]")


def _read_clutch(name: str, option: str, settings: Sequence[str], law: str | None) -> Clutch:
    """The clutch asked for, with its changes and its law; all mistakes at once."""
    mistakes = Mistakes()
    changes: dict[str, Any] = {}
    table: tuple[list[float], list[float]] | None = None
    with mistakes.noted():
        changes = read_changes(settings)
    if law is not None and law not in LAWS:
        with mistakes.noted():
            if "." not in law and "/" not in law:
                raise InputError(f'--law = "{law}": there is no such law; {did_you_mean(law, LAWS)}')
            table = read_law(law)
    mistakes.settle()
    if law in LAWS:
        changes |= {"law.kind": law, "law.times": None, "law.torques": None}
    elif table is not None:
        changes |= {"law.kind": "table", "law.times": table[0], "law.torques": table[1]}
    return Clutch.load(name, also=changes)


def _check_optimal(given: Mapping[str, Any]) -> None:
    if given["optimal"] and typed("until") is not None:
        raise InputError(
            f'--until = "{typed("until")}": optimal laws are followed to the lock-up; leave it out with '
            "--optimal."
        )
    if not given["optimal"] and (given["points"] is not None or given["nondecreasing"]):
        what = "--nondecreasing" if given["points"] is None else f'--points = "{typed("points")}"'
        raise InputError(f"{what}: this is for the optimal laws; add --optimal.")


@click.command(cls=Command, checks=[_check_optimal])
@click.argument(
    "clutch",
    metavar="[CLUTCH]",
    default="paper-c",
    type=Reading(_read_clutch, "settings", "law"),
    shell_complete=names_or_files(LIBRARY.names, ".toml"),
)
@click.option(
    "--law",
    metavar="NAME|FILE",
    shell_complete=names_or_files(lambda: LAWS, ".csv"),
    help="Engagement law: linear, quadratic-concave, quadratic-convex, exponential, or a CSV file of time "
    "and friction torque. Default: that of the clutch file.",
)
@changes_option(
    lambda: table_keys(Clutch.TABLES),
    "Change a parameter of the clutch, for example clutch.engagement_time='0.5 s' or shaft.gap='1 deg'.",
)
@click.option(
    "--until",
    metavar="TIME",
    type=quantity("s", 'the end of the run is a time above 0 s, as 5 or "500 ms"', above=0.0),
    help="End of the simulation, for example 5 (s). Default: one period after the lock-up.",
)
@click.option(
    "--optimal",
    is_flag=True,
    help="Compute the laws with the lowest friction work for a given peak shaft torque, with bounds.",
)
@click.option(
    "--points",
    metavar="N",
    type=count(1, 200),
    help=f"With --optimal: number of peak torques. Default: {DEFAULT_POINTS}.",
)
@click.option(
    "--nondecreasing", is_flag=True, help="With --optimal: only laws whose friction torque never decreases."
)
@json_option
@out_option("Write figures (SVG, PNG), tables and traces (CSV) and report.md into this folder.")
def clutch(
    *,
    clutch: Clutch,
    until: float | None,
    optimal: bool,
    points: int | None,
    nondecreasing: bool,
    as_json: bool,
    out: str | None,
) -> None:
    """Simulate a clutch engagement: peak shaft torque, friction work, slip time.

    CLUTCH is a TOML file or the name of a shipped clutch; by default that of the literature. The driving side
    turns at constant speed. With --optimal, the optimal engagement laws for its engagement time are computed.
    """
    found: Engagement | EngagementFront
    with output_folder(out) as folder:
        found = (
            _optimize(clutch, points or DEFAULT_POINTS, nondecreasing)
            if optimal
            else engage(clutch, until=until)
        )
        if folder is not None:
            _write(found, folder, command_line())
    present(
        found.summary,
        lambda to: _show(to, found),
        as_json,
        out and f"{out}: report.md, the figure, the tables and the laws",
    )


def _optimize(one: Clutch, points: int, nondecreasing: bool) -> EngagementFront:
    with working("looking for the best laws ...") as progress:
        law_class = "nondecreasing" if nondecreasing else "any"
        return optimize_engagement(one, points, law_class=law_class, progress=progress)


def _show(to: Console, found: Engagement | EngagementFront) -> None:
    print_lines(to, views.clutch_lines(found.clutch))
    if isinstance(found, Engagement):
        print_tables(to, [views.figures_table(found)])
        headline, note = views.status(found), views.events(found)
    else:
        print_tables(to, [views.point_table(found), views.law_table(found)])
        headline, note = views.conclusion(found), f"The bounds cover {found.covers}."
    print_conclusion(to, [headline], [note])


def _write(found: Engagement | EngagementFront, folder: Path, command: str) -> None:
    parts = _engagement_files(found, folder) if isinstance(found, Engagement) else _front_files(found, folder)
    write_text(folder / "clutch.toml", found.clutch.to_toml())
    about = "on the clutch of [clutch.toml](clutch.toml), which holds all changes. "
    write_report(folder, parts, command, f"{about}Source: {markdown(found.clutch.source)}")


def _engagement_files(run: Engagement, folder: Path) -> list[str]:
    save_figure(run.plot(), folder, "engagement")
    traces = {"t": run.t, **run.at(run.t)}
    rows = zip(*(traces[name].tolist() for name in TRACES), strict=True)
    write_table(folder / "traces.csv", list(TRACES.values()), list(rows))
    write_table(folder / "events.csv", ("time [s]", "event"), [(event.t, event.name) for event in run.events])
    write_table(folder / "phases.csv", PHASES, [list(vars(phase).values()) for phase in run.phases])
    return [
        f"# {markdown(run.clutch.name)}: {markdown(run.law.label)}",
        views.STATUS[run.status],
        markdown_table(views.figures_table(run)),
        "![engagement](engagement.svg)",
        "Traces: [traces.csv](traces.csv). Events: [events.csv](events.csv). Phases: "
        "[phases.csv](phases.csv).",
    ]


def _front_files(front: EngagementFront, folder: Path) -> list[str]:
    """Each law of the front is a table that --law reads."""
    save_figure(front.plot(), folder, "front")
    for index, point in enumerate(front.points, start=1):
        write_table(folder / f"law-{index}.csv", LAW, list(zip(point.times, point.torques, strict=True)))
    summaries = [
        {k: v for k, v in p.summary().items() if k not in ("times", "torques")} for p in front.points
    ]
    write_rows(folder / "front.csv", summaries)
    write_rows(folder / "laws.csv", [law.summary() for law in front.laws])
    return [
        f"# {markdown(front.clutch.name)}: optimal laws, {front.law_class}",
        views.conclusion(front),
        *(markdown_table(one) for one in (views.point_table(front), views.law_table(front)) if one.rows),
        f"The bounds cover {front.covers}.",
        "![front](front.svg)",
        "Points: [front.csv](front.csv). The laws: law-1.csv, ..., each readable by --law.",
    ]
