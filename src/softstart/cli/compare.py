"""`softstart compare`: the strategies side by side on one drive."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import click

from softstart.cli.commands import Command
from softstart.cli.options import (
    DEFAULT_DRIVE,
    Mistakes,
    command_line,
    controller_names,
    controller_option,
    drive_argument,
    fitted_to_option,
    json_option,
    out_option,
    param_option,
    read_drive,
    read_fitted_to,
    read_names,
    read_params_of,
    read_until,
    set_option,
    until_option,
)
from softstart.views.markdown import output_folder

if TYPE_CHECKING:
    from rich.console import Console

    from softstart.start.comparison import Comparison, Row
    from softstart.views.numbers import Column


@click.command(cls=Command)
@drive_argument(default=DEFAULT_DRIVE)
@controller_option(
    "--controllers",
    "A,B,...",
    "Controllers, with commas between. By default all installed ones that need no parameter.",
)
@set_option
@fitted_to_option
@param_option(
    "CONTROLLER.KEY=VALUE", "Set a parameter of a controller, as ramp.time='0.2 s'. May be repeated."
)
@until_option
@json_option
@out_option("Write figures (SVG, PNG), traces and table (CSV) and report.md into this folder.")
def compare(
    *,
    drive: str,
    controllers: str | None,
    settings: tuple[str, ...],
    fitted_to: str | None,
    params: tuple[str, ...],
    until: str | None,
    as_json: bool,
    out: str | None,
) -> None:
    """Start a drive under several controllers and compare them.

    DRIVE is a TOML file or the name of a shipped drive (see: softstart drives); without it, the crane drive
    of the literature is taken. A controller is a name (see: softstart controllers), path/to/file.py:Class,
    or a file of tuned gains.
    """
    mistakes = Mistakes()
    names: Sequence[str] = controller_names()
    with mistakes.noted():
        one = read_drive(drive, settings)
    with mistakes.noted():
        names = read_names(controllers) or names
    with mistakes.noted():
        given = read_params_of(params, names)
    with mistakes.noted():
        nominal = read_fitted_to(fitted_to)
    with mistakes.noted():
        end = read_until(until)
    mistakes.settle()

    with output_folder(out) as folder:
        from softstart.cli.running import Attributed, make_controllers, working

        with working("starting the drive ..."):
            if controllers is None:
                from softstart.controller import ready_controller_names

                names = ready_controller_names(given)
            made = make_controllers(names, given, prefix=True)
            from softstart.start.comparison import compare as compare_controllers

            with Attributed():
                comparison = compare_controllers(one, made, until=end, fitted_to=nominal)
        if folder is not None:
            from softstart.cli.compare_report import write_comparison

            with working("drawing the figures ..."):
                write_comparison(comparison, folder, command_line())

    from softstart.views.terminal import console, print_json

    if as_json:
        print_json(comparison.summary())
    else:
        _show(console(), comparison, by_peak=controllers is None)
        if out is not None:
            print(f"\nWritten to {out}: report.md, figures, traces and the table.")


def name_of(row: Row) -> str:
    """The controller's name, or that of its class."""
    return row.run.controller.name or type(row.run.controller).__name__


def columns_and_rows(rows: Sequence[Row]) -> tuple[list[Column], list[list[str]]]:
    """The table: first the columns that judge, then those about what happens at the gap."""
    from softstart.views.numbers import Column, column_of, number

    runs = [row.run for row in rows]
    columns = {
        "strategy": [name_of(row) for row in rows],
        "K_dyn": [number(run.k_dyn, 3) for run in runs],
        "K\ngap x4": [number(row.k_dyn_worn_gap, 3) for row in rows],
        "K\nJ2 x0.4": [number(row.k_dyn_light_load, 3) for row in rows],
        "peak\nN m": column_of([run.peak_torque for run in runs]),
        "start\ntime s": column_of([run.start_time for run in runs]),
        "time\nlost s": column_of([row.time_lost for row in rows], digits=3),
        "time\nlost %": [number(share_lost(row), 1) for row in rows],
        "first\ncontact\ns": column_of([run.first_contact for run in runs], digits=3),
        "u at\ncontact\nN m": column_of([run.torque_at_contact for run in runs], digits=3),
        "stage 1\ns": column_of([run.stage_durations[0] for run in runs], digits=3),
        "stage 2\ns": column_of([run.stage_durations[1] for run in runs], digits=3),
        "K first\ncontact": [number(run.k_dyn_first_contact, 3) for run in runs],
        "contacts": [str(run.contacts) for run in runs],
    }
    headings = [Column("strategy", False), *(Column(heading) for heading in list(columns)[1:])]
    return headings, [list(row) for row in zip(*columns.values(), strict=True)]


def share_lost(row: Row) -> float:
    """Time lost in per cent of the start time of `direct`."""
    direct = row.run.start_time - row.time_lost
    return 100.0 * row.time_lost / direct if direct > 0.0 else math.nan


def conclusion(comparison: Comparison) -> str:
    """Which strategy is the gentlest, and what it costs in time."""
    from softstart.views.numbers import column_of

    best = comparison.gentlest
    others = [row for row in comparison.rows if row is not best]
    k, name = best.run.k_dyn, name_of(best)
    if math.isnan(best.run.start_time):
        return f"None reaches the target speed within the run; the gentlest so far is {name}, K_dyn {k:.3f}."
    said = f"Gentlest: {name}, K_dyn {k:.3f}"
    direct = next((row for row in others if name_of(row) == "direct"), None)
    if direct is not None:
        said += f" against {direct.run.k_dyn:.3f} of direct"
    lost = best.time_lost
    if math.isnan(lost):
        return said + "; direct does not reach the target speed within the run."
    share = abs(share_lost(best))
    all_lost = [row.time_lost for row in comparison.rows]
    seconds = column_of(all_lost, digits=3)[comparison.rows.index(best)].lstrip("-")
    if abs(lost) < 1e-6 * best.run.start_time:
        return said + "; it takes no more time than direct."
    if lost < 0.0:
        return said + f"; it is even {seconds} s ({share:.1f} %) quicker than direct."
    return said + f"; it costs {seconds} s of start time, {share:.1f} % more than direct."


def footnotes(comparison: Comparison) -> list[str]:
    """What the columns mean, and which starts did not end as they should."""
    run = comparison.rows[0].run
    base = run.peak_torque / run.k_dyn if run.k_dyn > 0.0 else math.nan
    own = "this drive" if comparison.fitted_to is None else f'"{comparison.fitted_to.name}"'
    notes = [
        f"K_dyn = peak shaft torque / {base:.4g} N m, the mean shaft torque under full starting torque. "
        f"K gap x4, K J2 x0.4: the controller set up for {own}, when the gap is 4 times as wide or "
        "the load inertia 0.4 times as large."
    ]
    notes += [
        f"{name_of(row)}: {row.run.status.value}" for row in comparison.rows if math.isnan(row.run.start_time)
    ]
    return notes


def _show(to: Console, comparison: Comparison, by_peak: bool) -> None:
    from softstart.views.drives import drive_lines
    from softstart.views.terminal import fits, print_table, sentence

    rows = list(comparison.rows)
    if by_peak:
        rows.sort(key=lambda row: row.run.k_dyn)
    best = [rows.index(comparison.gentlest)]
    for index, line in enumerate(drive_lines(comparison.drive, comparison.fitted_to)):
        sentence(to, line, "bold" if index == 0 else "")
    to.print()
    columns, cells = columns_and_rows(rows)
    if fits(to, columns, cells):
        print_table(to, columns, cells, bold=best)
    else:
        print_table(to, columns[:8], [row[:8] for row in cells], title="How gentle, how quick", bold=best)
        to.print()
        second = [columns[0], *columns[8:]]
        print_table(
            to, second, [[row[0], *row[8:]] for row in cells], title="What happens at the gap", bold=best
        )
    to.print()
    sentence(to, conclusion(comparison), "bold")
    for note in footnotes(comparison):
        sentence(to, note, "dim")
