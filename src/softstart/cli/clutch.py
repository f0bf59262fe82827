"""`softstart clutch`: one engagement of a slipping clutch, or the best engagement laws there are."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

import click

from softstart.cli.commands import Command, did_you_mean
from softstart.cli.completing import Keys, names_or_files, table_keys
from softstart.cli.completing import settings as settings_of
from softstart.cli.options import Mistakes, command_line, json_option, out_option, read_changes
from softstart.errors import InputError
from softstart.views.markdown import output_folder

if TYPE_CHECKING:
    from softstart.clutch import Clutch

DEFAULT_CLUTCH = "paper-c"
DEFAULT_POINTS = 8


def _clutches() -> Iterable[str]:
    from softstart.clutch.parameters import LIBRARY

    return LIBRARY.names()


def _laws() -> Iterable[str]:
    from softstart.clutch.laws import LAWS

    return LAWS


def _keys() -> Keys:
    from softstart.clutch.parameters import TABLES

    return table_keys(TABLES)


@click.command(cls=Command)
@click.argument(
    "clutch", metavar="[CLUTCH]", default=DEFAULT_CLUTCH, shell_complete=names_or_files(_clutches, ".toml")
)
@click.option(
    "--law",
    metavar="NAME|FILE",
    shell_complete=names_or_files(_laws, ".csv"),
    help="Engagement law: linear, quadratic-concave, quadratic-convex, exponential, or a CSV file of time "
    "and friction torque. By default that of the clutch file.",
)
@click.option(
    "--set",
    "settings",
    metavar="KEY=VALUE",
    multiple=True,
    shell_complete=settings_of(_keys),
    help="Change a value of the clutch, as clutch.engagement_time='0.5 s' or shaft.gap='1 deg'. May be "
    "repeated.",
)
@click.option(
    "--until", metavar="TIME", help="End of the run, as 5 (s). By default a period after the lock-up."
)
@click.option(
    "--optimal",
    is_flag=True,
    help="Find the laws with the least friction work for a given peak of the shaft torque, with bounds.",
)
@click.option("--points", metavar="N", help=f"With --optimal: number of peaks. By default {DEFAULT_POINTS}.")
@click.option(
    "--nondecreasing", is_flag=True, help="With --optimal: only laws whose friction torque never falls."
)
@json_option
@out_option("Write figures (SVG, PNG), tables and traces (CSV) and report.md into this folder.")
def clutch(
    *,
    clutch: str,
    law: str | None,
    settings: tuple[str, ...],
    until: str | None,
    optimal: bool,
    points: str | None,
    nondecreasing: bool,
    as_json: bool,
    out: str | None,
) -> None:
    """Engage a slipping clutch: peak of the shaft torque, friction work, slip time.

    CLUTCH is a TOML file or the name of a shipped clutch; without it, the clutch of the literature is taken.
    Its driving side turns at constant speed. With --optimal, the best engagement laws for its engagement time
    are found.
    """
    mistakes = Mistakes()
    one: Clutch | None = None
    count: int | None = DEFAULT_POINTS
    with mistakes.noted():
        one = read_clutch(clutch, settings, law)
    with mistakes.noted():
        end = read_end(until)
    with mistakes.noted():
        count = _points(points, optimal, nondecreasing, until)
    mistakes.settle()
    assert one is not None

    from softstart.views.terminal import console, print_json

    if optimal:
        from softstart.cli.clutch_report import write_front
        from softstart.cli.clutch_text import show_front
        from softstart.cli.running import working
        from softstart.clutch.front import optimize_engagement

        with output_folder(out) as folder, working("looking for the best laws ...") as status:

            def progress(doing: str) -> None:
                if status is not None:
                    status.update(f"{doing} ...")

            front = optimize_engagement(
                one,
                count or DEFAULT_POINTS,
                law_class="nondecreasing" if nondecreasing else "any",
                progress=progress,
            )
            if folder is not None:
                write_front(front, folder, command_line())
        if as_json:
            print_json(front.summary())
            return
        show_front(console(), front)
    else:
        from softstart.cli.clutch_report import write_engagement
        from softstart.cli.clutch_text import show_engagement
        from softstart.clutch.engagement import engage

        with output_folder(out) as folder:
            run = engage(one, until=end)
            if folder is not None:
                write_engagement(run, folder, command_line())
        if as_json:
            print_json(run.summary())
            return
        show_engagement(console(), run)
    if out is not None:
        print(f"\nWritten to {out}: report.md, the figure, the tables and the laws.")


def read_clutch(name: str, settings: Sequence[str], law: str | None) -> Clutch:
    """The clutch asked for, with its changes and its law; all mistakes at once."""
    from softstart.clutch import Clutch
    from softstart.clutch.law_files import read_law
    from softstart.clutch.laws import LAWS

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


def read_end(text: str | None) -> float | None:
    """The end of the run in s.

    >>> read_end("500 ms")
    0.5
    """
    if text is None:
        return None
    from softstart.quantities import to_si

    value = float(to_si(text, "s", name="--until"))
    if not value > 0.0:
        raise InputError(f'--until = "{text}": the end of the run is a time above 0 s, as 5 or "500 ms".')
    return value


def _points(text: str | None, optimal: bool, nondecreasing: bool, until: str | None) -> int | None:
    if optimal and until is not None:
        raise InputError(
            f'--until = "{until}": optimal laws are followed to the lock-up; leave it out with --optimal.'
        )
    if not optimal and (text is not None or nondecreasing):
        what = f'--points = "{text}"' if text is not None else "--nondecreasing"
        raise InputError(f"{what}: this is for the optimal laws; add --optimal.")
    if text is None:
        return None
    if not (text.isascii() and text.isdigit() and 1 <= int(text) <= 200):
        raise InputError(f'--points = "{text}": give a whole number of points from 1 to 200.')
    return int(text)
