"""`softstart simulate`: one start with its stages and events."""

from __future__ import annotations

import math
from dataclasses import asdict
from typing import TYPE_CHECKING

import click

from softstart.cli.commands import Command
from softstart.cli.options import (
    Mistakes,
    check_name,
    command_line,
    controller_option,
    drive_argument,
    fitted_to_option,
    json_option,
    out_option,
    param_option,
    read_drive,
    read_fitted_to,
    read_params,
    read_until,
    set_option,
    until_option,
)
from softstart.views.markdown import output_folder

if TYPE_CHECKING:
    from rich.console import Console

    from softstart.drive import Drive
    from softstart.start.run import Run

SHOWN = 24  # rows of stages and events shown; files and JSON hold all
STAGE_COLUMNS = ("stage", "gap", "start s", "duration s", "peak torque N m", "at s")
EVENT_COLUMNS = ("time s", "event", "value")
SIDES = {0: "open", 1: "closed, driving flank", -1: "closed, other flank"}


@click.command(cls=Command)
@drive_argument()
@controller_option(
    "--controller",
    "NAME",
    "A controller's name, path/to/file.py:ClassName, or a file of tuned gains (.toml, .csv).",
    required=True,
)
@param_option("KEY=VALUE", "Set a parameter of the controller, as time='200 ms'. May be repeated.")
@set_option
@fitted_to_option
@until_option
@json_option
@out_option("Write the figure (SVG, PNG), traces, stages and events (CSV) and report.md into this folder.")
def simulate(
    *,
    drive: str,
    controller: str,
    params: tuple[str, ...],
    settings: tuple[str, ...],
    fitted_to: str | None,
    until: str | None,
    as_json: bool,
    out: str | None,
) -> None:
    """Start a drive once under one controller.

    DRIVE is a TOML file or the name of a shipped drive (see: softstart drives).
    """
    mistakes = Mistakes()
    with mistakes.noted():
        one = read_drive(drive, settings)
    with mistakes.noted():
        check_name(controller, "--controller", "several are compared: softstart compare --controllers ")
    with mistakes.noted():
        given = read_params(params)
    with mistakes.noted():
        nominal = read_fitted_to(fitted_to)
    with mistakes.noted():
        end = read_until(until)
    mistakes.settle()

    with output_folder(out) as folder:
        from softstart.cli.running import Attributed, make_controllers, working

        with working("starting the drive ..."):
            (made,) = make_controllers([controller], {controller: given}, prefix=False)
            from softstart.start.simulation import simulate as simulate_start

            with Attributed():
                run = simulate_start(one, made, end, fitted_to=nominal)
        if folder is not None:
            from softstart.cli.compare_report import write_start

            with working("drawing the figure ..."):
                write_start(run, folder, command_line(), nominal)

    from softstart.views.terminal import console, print_json

    if as_json:
        stages = [{**asdict(stage), "duration": stage.duration} for stage in run.stages]
        named = nominal.name if nominal else None
        print_json(
            {
                **run.summary(),
                "fitted_to": named,
                "stages": stages,
                "events": [asdict(event) for event in run.events],
            }
        )
    else:
        _show(console(), run, nominal)
        if out is not None:
            print(f"\nWritten to {out}: report.md, figure, traces, stages and events.")


def figure_rows(run: Run) -> list[list[str]]:
    """The figures of the start, as words and numbers."""
    from softstart.views.numbers import number, short

    def with_unit(value: float, unit: str) -> str:
        return f"{short(value)} {unit}" if not math.isnan(value) else "-"

    first, second = run.stage_durations
    return [
        ["K_dyn", number(run.k_dyn, 6)],
        ["K_dyn of the first contact", number(run.k_dyn_first_contact, 6)],
        ["peak shaft torque", f"{with_unit(run.peak_torque, 'N m')} at {with_unit(run.peak_time, 's')}"],
        ["start time", with_unit(run.start_time, "s")],
        ["settled from", with_unit(run.settling_time(), "s")],
        ["first contact", with_unit(run.first_contact, "s")],
        ["speed of impact", with_unit(run.impact_speed, "rad/s")],
        ["motor torque at contact", with_unit(run.torque_at_contact, "N m")],
        ["stage 1, stage 2", f"{with_unit(first, 's')}, {with_unit(second, 's')}"],
        ["contacts", str(run.contacts)],
        ["end of the run", with_unit(run.end_time, "s")],
    ]


def stage_rows(run: Run) -> list[list[object]]:
    """The stages, full numbers."""
    return [
        [stage.number, SIDES[stage.side], stage.start, stage.duration, stage.peak_torque, stage.peak_time]
        for stage in run.stages
    ]


def event_rows(run: Run) -> list[list[object]]:
    """The events, full numbers."""
    return [[event.time, event.kind, event.value] for event in run.events]


def _show(to: Console, run: Run, fitted_to: Drive | None) -> None:
    from softstart.views.drives import drive_lines
    from softstart.views.numbers import Column, column_of
    from softstart.views.terminal import print_table, sentence

    for index, line in enumerate(drive_lines(run.drive, fitted_to)):
        sentence(to, line, "bold" if index == 0 else "")
    name = run.controller.name or type(run.controller).__name__
    values = ", ".join(f"{key} = {_value(value)}" for key, value in run.controller.parameters.items())
    sentence(to, f"  under  {name}{' (' + values + ')' if values else ''}")
    to.print()
    sentence(to, run.status.value, "bold")
    print_table(to, [Column("", False), Column("", False)], figure_rows(run), headings=False)

    stages = run.stages[:SHOWN]
    times = column_of([stage.start for stage in stages], 5)
    lengths = column_of([stage.duration for stage in stages])
    torques = column_of([stage.peak_torque for stage in stages], 5)
    when = column_of([stage.peak_time for stage in stages], 5)
    cells = [
        [str(stage.number), SIDES[stage.side], start, length, torque, peak]
        for stage, start, length, torque, peak in zip(stages, times, lengths, torques, when, strict=True)
    ]
    to.print()
    columns = [Column(heading, heading != "gap") for heading in STAGE_COLUMNS]
    print_table(to, columns, cells, title=f"Stages{_part(len(run.stages))}")

    events = run.events[:SHOWN]
    times = column_of([event.time for event in events], 6)
    rows = [[time, event.kind] for time, event in zip(times, events, strict=True)]
    to.print()
    title = f"Events{_part(len(run.events))}"
    print_table(to, [Column("time s"), Column("event", False)], rows, title=title)


def _part(count: int) -> str:
    return f" (the first {SHOWN} of {count}; --json and --out give all)" if count > SHOWN else ""


def _value(value: object) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)
