"""`softstart balance`: what an engine shakes its mounts with, and what a two-shaft balancer takes away."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from softstart.balancing import Balance, Engine, MeasuredCycle
from softstart.balancing import balance as compute
from softstart.balancing.engine import INDICATOR_FILE, LIBRARY, TABLES
from softstart.cli.commands import Command, Reading
from softstart.cli.completion import table_keys
from softstart.cli.options import (
    changes_option,
    command_line,
    drive_argument,
    json_option,
    out_option,
    read_changes,
)
from softstart.errors import InputError, Mistakes
from softstart.input.parameters import bare
from softstart.quantities import to_si
from softstart.views import balances as views
from softstart.views.drawing import save_figure
from softstart.views.markdown import (
    markdown,
    output_folder,
    table_sections,
    write_report,
    write_rows,
    write_table,
    write_text,
)
from softstart.views.terminal import present, print_conclusion, print_lines, print_tables

if TYPE_CHECKING:
    from rich.console import Console


def _read_speeds(texts: Sequence[str], option: str) -> list[float] | None:
    """The speeds in rad/s; None if none was given.

    >>> [round(speed, 3) for speed in _read_speeds(["4500rpm", "100 rad/s"], "--speed")]
    [471.239, 100.0]
    """
    found = []
    mistakes = Mistakes()
    for text in texts:
        with mistakes.noted():
            speed = float(to_si(text, "rad/s", name=option))
            if not speed > 0.0:
                raise InputError(f'{option} = "{text}": a speed above 0, as 4500rpm.')
            if bare(text):
                both = f'write "{text} rpm" or, if rad/s is meant, "{text} rad/s"'
                raise InputError(f'{option} = "{text}": no unit; {both}.')
            found.append(speed)
    mistakes.settle()
    return found or None


@click.command(cls=Command)
@drive_argument(
    lambda name, settings: Engine.load(name, also=read_changes(settings)),
    name="engine",
    default="vaz-11113",
    names=LIBRARY.names,
)
@click.option(
    "--speed",
    "speeds",
    metavar="SPEED",
    multiple=True,
    type=Reading(_read_speeds),
    help="Speed to show, for example 4500rpm. May be repeated. Default: round values over the speed range.",
)
@changes_option(
    lambda: table_keys(TABLES),
    "Change a parameter of the engine, for example masses.reciprocating='0.6 kg' or operation.load=0.5.",
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
    with output_folder(out) as folder:
        found = compute(engine, speeds)
        if folder is not None:
            _write(found, folder, command_line())
    present(
        found.summary,
        lambda to: _show(to, found),
        as_json,
        out and f"{out}: report.md, the figures and the tables",
    )


def _show(to: Console, found: Balance) -> None:
    print_lines(to, views.engine_lines(found))
    print_tables(to, views.tables(found))
    print_conclusion(to, [views.conclusion(found)], views.footnotes(found))


def _write(found: Balance, folder: Path, command: str) -> None:
    """Figures, tables, the engine with all changes, and the report that ties them together."""
    engine, figures = found.engine, found.figures()
    for stem, figure in figures.items():
        save_figure(figure, folder, stem)
    write_text(folder / "engine.toml", engine.to_toml())
    if isinstance(engine.gas, MeasuredCycle):
        write_text(folder / INDICATOR_FILE, engine.gas.to_csv())
    residuals = [
        {"balancer": one.name, **one.row(i)} for one in found.residuals for i in range(one.speeds.size)
    ]
    write_rows(folder / "orders.csv", found.orders())
    write_rows(folder / "residuals.csv", residuals)
    numbers = "All numbers: [orders.csv](orders.csv), [residuals.csv](residuals.csv)"
    if engine.gas is not None:
        write_table(folder / "torque.csv", *views.torque_over_cycle(found))
        numbers += ", torque over the cycle at the tuning speed [torque.csv](torque.csv)"
    parts = [
        f"# {markdown(engine.name)}: forces, moments and balancers",
        "\n".join(f"- {markdown(line)}" for line in views.engine_lines(found)[1:]),
        markdown(views.conclusion(found)),
        *table_sections(views.tables(found)),
        *(f"![{stem}]({stem}.svg)" for stem in figures),
        *map(markdown, views.footnotes(found)),
        f"{numbers}.",
    ]
    about = "on the engine of [engine.toml](engine.toml), which holds all changes. "
    write_report(folder, parts, command, f"{about}Source: {markdown(engine.source) or 'none given'}.")
