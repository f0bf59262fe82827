"""`softstart optimize --gaps ...`: one profile for several drives, and what a contact sensor is worth."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from softstart.cli.optimal_options import Asked, named_as_options, no_solution_told
from softstart.cli.options import command_line
from softstart.optimal.shortest import start_time_of_direct
from softstart.views.markdown import output_folder

if TYPE_CHECKING:
    from rich.console import Console

    from softstart.drive import Drive
    from softstart.optimal.robust.solving import RobustOptimum, SensorWorth


def optimize_for_all(
    drive: Drive, asked: Asked, varied: Mapping[str, Sequence[float]], as_json: bool, out: str | None
) -> None:
    """One profile for all combinations of the values given, blind and with a contact sensor."""
    with no_solution_told(as_json), output_folder(out) as folder:
        from softstart.cli.running import working

        with working("looking for the gentlest start of all drives ...") as status:
            from softstart.optimal.robust.solving import scenarios_of, worth_of_contact_sensor

            def progress(doing: str) -> None:
                if status is not None:
                    status.update(f"{doing} ...")

            with named_as_options():
                scenarios = scenarios_of(drive, **varied)
                direct = start_time_of_direct(drive) if asked.multiple else math.nan
                worth = worth_of_contact_sensor(scenarios, asked.seconds(direct), progress=progress)
        if folder is not None:
            from softstart.cli.optimal_report import write_worth

            with working("drawing the figure ..."):
                write_worth(worth, folder, command_line())

    from softstart.views.terminal import console, print_json

    if as_json:
        print_json(worth.summary())
    else:
        _show(console(), worth)
        if out is not None:
            print(f"\nWritten to {out}: report.md, both profiles, the figure and traces.")


def scenario_columns(worth: SensorWorth) -> dict[str, list[str]]:
    """The table: what is different in each drive, and its start without and with a sensor."""
    from softstart.views.numbers import column_of, number

    blind, reacting = worth.blind, worth.reacting
    drives = blind.scenarios
    return {
        "gap\nrad": column_of([float(d.gap) for d in drives]),
        "J2\nkg m2": column_of([float(d.J2) for d in drives]),
        "Mc\nN m": column_of([float(d.Mc) for d in drives]),
        "K_dyn\nblind": [number(k, 4) for k in blind.k_dyn_each],
        "start\ntime s": column_of(list(blind.start_times), 5),
        "K_dyn\nwith sensor": [number(k, 4) for k in reacting.k_dyn_each],
        "start \ntime s": column_of(list(reacting.start_times), 5),
    }


def conclusion(worth: SensorWorth) -> str:
    """What the sensor is worth."""
    blind, reacting = worth.blind, worth.reacting
    said = f"Largest K_dyn {blind.k_dyn:.3f} without a contact sensor, {reacting.k_dyn:.3f} with one"
    if worth.percent > 0.0:
        return f"{said}: the sensor lowers it by {worth.percent:.1f} %."
    return f"{said}: the sensor is worth nothing here."


def bound_sentence(optimum: RobustOptimum) -> str:
    """How much better any profile could be."""
    bound = optimum.lower_bound
    if bound.kind == "none":
        return "No lower bound is known here."
    return (
        f"No profile, reacting or not, brings all of them below K_dyn {bound.k_dyn:.4f} ({bound.kind} bound)."
    )


def _show(to: Console, worth: SensorWorth) -> None:
    from softstart.views.drives import drive_lines
    from softstart.views.numbers import Column
    from softstart.views.terminal import print_table, sentence

    blind = worth.blind
    for index, line in enumerate(drive_lines(blind.base)):
        sentence(to, line, "bold" if index == 0 else "")
    count = len(blind.scenarios)
    sentence(
        to,
        f"  asked  one profile for {count} drives, least largest K_dyn, start time at most "
        f"{blind.start_time:.6g} s, terminal reached",
    )
    to.print()
    columns = scenario_columns(worth)
    rows = [list(row) for row in zip(*columns.values(), strict=True)]
    print_table(to, [Column(name) for name in columns], rows, bold=[blind.worst])
    to.print()
    sentence(to, conclusion(worth), "bold")
    sentence(to, bound_sentence(blind), "dim")
    sentence(to, "K_dyn refers to the mean shaft torque of the first drive.", "dim")
