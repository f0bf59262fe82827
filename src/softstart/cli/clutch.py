"""`softstart clutch`: one engagement of a slipping clutch, or the best engagement laws there are."""

from __future__ import annotations

from typing import Any

import click

from softstart.cli.commands import Command, Reading, did_you_mean
from softstart.cli.completion import names_or_files
from softstart.cli.options import count, file_options, json_option, out_option, quantity
from softstart.cli.running import answering, working
from softstart.clutch import LAWS, Clutch, engage, optimize_engagement
from softstart.clutch.laws import read_law
from softstart.clutch.model import LIBRARY
from softstart.errors import InputError
from softstart.views import clutches as views

DEFAULT_POINTS = 8


def _read_law(text: str, option: str) -> dict[str, Any]:
    """The parameters of a clutch with this law: a name, or a file."""
    if text in LAWS:
        return {"law": text, "law_times": None, "law_torques": None}
    if "." not in text and "/" not in text:
        raise InputError(f'{option} = "{text}": there is no such law; {did_you_mean(text, LAWS)}')
    times, torques = read_law(text)
    return {"law": "table", "law_times": times, "law_torques": torques}


@click.command(cls=Command)
@file_options(
    Clutch, "paper-c", LIBRARY, Clutch.TABLES, "clutch.engagement_time='0.5 s' or shaft.gap='1 deg'"
)
@click.option(
    "--law",
    metavar="NAME|FILE",
    type=Reading(_read_law),
    shell_complete=names_or_files(lambda: LAWS, ".csv"),
    help="Engagement law: linear, quadratic-concave, quadratic-convex, exponential, or a CSV file of time "
    "and friction torque. Default: that of the clutch file.",
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
    law: dict[str, Any] | None,
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
    if optimal and until is not None:
        raise InputError("--until: optimal laws are followed to the lock-up; leave it out with --optimal.")
    if not optimal and (points is not None or nondecreasing):
        what = "--nondecreasing" if points is None else f'--points = "{points}"'
        raise InputError(f"{what}: this is for the optimal laws; add --optimal.")
    clutch = clutch.replace(**law) if law else clutch
    with answering(as_json, out) as answer:
        if optimal:
            with working("looking for the best laws ...") as progress:
                law_class, most = "nondecreasing" if nondecreasing else "any", points or DEFAULT_POINTS
                front = optimize_engagement(clutch, most, law_class=law_class, progress=progress)
            answer(front.summary, views.front_sheet(front))
        else:
            run = engage(clutch, until=until)
            answer(run.summary, views.engagement_sheet(run))
