"""`softstart balance`: what an engine shakes its mounts with, and what a two-shaft balancer takes away."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

import click

from softstart.cli.commands import Command
from softstart.cli.completing import Keys, names_or_files, table_keys
from softstart.cli.completing import settings as settings_of
from softstart.cli.options import Mistakes, command_line, json_option, out_option, read_changes
from softstart.errors import InputError
from softstart.views.markdown import output_folder

if TYPE_CHECKING:
    from softstart.balancing import Engine

DEFAULT_ENGINE = "vaz-11113"


def _engines() -> Iterable[str]:
    from softstart.balancing.tables import LIBRARY

    return LIBRARY.names()


def _keys() -> Keys:
    from softstart.balancing.tables import TABLES

    return table_keys(TABLES)


@click.command(cls=Command)
@click.argument(
    "engine", metavar="[ENGINE]", default=DEFAULT_ENGINE, shell_complete=names_or_files(_engines, ".toml")
)
@click.option(
    "--speed",
    "speeds",
    metavar="SPEED",
    multiple=True,
    help="A speed to show, as 4500rpm. May be repeated; by default round ones over the range.",
)
@click.option(
    "--set",
    "settings",
    metavar="KEY=VALUE",
    multiple=True,
    shell_complete=settings_of(_keys),
    help="Change a value of the engine, as masses.reciprocating='0.6 kg' or operation.load=0.5. May be "
    "repeated.",
)
@json_option
@out_option("Write figures (SVG, PNG), tables (CSV) and report.md into this folder.")
def balance(
    *, engine: str, speeds: tuple[str, ...], settings: tuple[str, ...], as_json: bool, out: str | None
) -> None:
    """Find the forces and moments of a piston engine by order, and design a two-shaft balancer.

    ENGINE is a TOML file or the name of a shipped engine; without it, the two-cylinder engine VAZ-11113 of
    the literature is taken, with values that are partly assumed. The balancer is tuned at one speed:
    balancer.tuning_speed.
    """
    mistakes = Mistakes()
    one: Engine | None = None
    asked: list[float] | None = None
    with mistakes.noted():
        one = read_engine(engine, settings)
    with mistakes.noted():
        asked = read_speeds(speeds)
    mistakes.settle()
    assert one is not None

    from softstart.balancing.result import balance as compute

    with output_folder(out) as folder:
        found = compute(one, asked)
        if folder is not None:
            from softstart.cli.balance_report import write_balance

            write_balance(found, folder, command_line())

    from softstart.cli.balance_text import show_balance
    from softstart.views.terminal import console, print_json

    if as_json:
        print_json(found.summary())
        return
    show_balance(console(), found)
    if out is not None:
        print(f"\nWritten to {out}: report.md, the figures and the tables.")


def read_engine(name: str, settings: Sequence[str]) -> Engine:
    """The engine asked for, with its changes."""
    from softstart.balancing import Engine

    mistakes = Mistakes()
    changes: dict[str, Any] = {}
    with mistakes.noted():
        changes = read_changes(settings)
    mistakes.settle()
    return Engine.load(name, also=changes)


def read_speeds(texts: Sequence[str]) -> list[float] | None:
    """The speeds in rad/s; None if none was given.

    >>> [round(speed, 3) for speed in read_speeds(["4500rpm", "100"])]
    [471.239, 100.0]
    """
    from softstart.quantities import to_si

    found = []
    mistakes = Mistakes()
    for text in texts:
        with mistakes.noted():
            speed = float(to_si(text, "rad/s", name="--speed"))
            if not speed > 0.0:
                raise InputError(f'--speed = "{text}": a speed above 0, as 4500rpm.')
            found.append(speed)
    mistakes.settle()
    return found or None
