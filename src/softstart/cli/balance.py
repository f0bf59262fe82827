"""`softstart balance`: what an engine shakes its mounts with, and what a two-shaft balancer takes away."""

from __future__ import annotations

from collections.abc import Sequence

import click

from softstart.balancing import Engine
from softstart.balancing import balance as compute
from softstart.balancing.engine import LIBRARY, TABLES
from softstart.cli.commands import Command, Reading
from softstart.cli.options import file_options, json_option, out_option
from softstart.cli.running import answering
from softstart.errors import InputError
from softstart.input.parameters import bare
from softstart.quantities import to_si
from softstart.views import balances as views


def _read_speeds(texts: Sequence[str], option: str) -> list[float] | None:
    """The speeds in rad/s; None if none was given.

    >>> [round(speed, 3) for speed in _read_speeds(["4500rpm", "100 rad/s"], "--speed")]
    [471.239, 100.0]
    """
    found = [float(to_si(text, "rad/s", name=option)) for text in texts]
    for text, speed in zip(texts, found, strict=True):
        if not speed > 0.0:
            raise InputError(f'{option} = "{text}": a speed above 0, as 4500rpm.')
        if bare(text):
            both = f'write "{text} rpm" or, if rad/s is meant, "{text} rad/s"'
            raise InputError(f'{option} = "{text}": no unit; {both}.')
    return found or None


@click.command(cls=Command)
@file_options(Engine, "vaz-11113", LIBRARY, TABLES, "masses.reciprocating='0.6 kg' or operation.load=0.5")
@click.option(
    "--speed",
    "speeds",
    metavar="SPEED",
    multiple=True,
    type=Reading(_read_speeds),
    help="Speed to show, for example 4500rpm. May be repeated. Default: round values over the speed range.",
)
@json_option
@out_option("Write figures (SVG, PNG), tables (CSV) and report.md into this folder.")
def balance(*, engine: Engine, speeds: list[float] | None, as_json: bool, out: str | None) -> None:
    """Compute forces and moments of a piston engine by order, and design a balancer.

    ENGINE is a TOML file or the name of a shipped engine; by default the two-cylinder engine VAZ-11113 of the
    literature, some of whose parameters are assumed. The two-shaft balancer is tuned at one speed,
    balancer.tuning_speed; a first-order couple is balanced by a shaft with two opposite imbalances. The
    pressure ([cycle] or [indicator]) is only needed for the gas torque.
    """
    with answering(as_json, out) as answer:
        found = compute(engine, speeds)
        answer(found.summary, views.balance_sheet(found))
