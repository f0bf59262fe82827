"""`softstart identify`: the drive from logs of its starts, and experiments that would tell it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, cast

import click
import numpy as np

import softstart
from softstart.cli.commands import Command
from softstart.cli.completion import names_or_files
from softstart.cli.options import (
    Mistakes,
    command_line,
    drive_names,
    json_option,
    named_as_options,
    out_option,
    read_count,
    read_drive,
    read_machine,
    read_names,
    read_params,
    set_option,
)
from softstart.cli.running import working
from softstart.errors import InputError
from softstart.late import late
from softstart.quantities import to_si
from softstart.views.drawing import save_figure
from softstart.views.markdown import (
    markdown,
    output_folder,
    table_sections,
    write_columns,
    write_drive_report,
    write_table,
)
from softstart.views.terminal import console, print_conclusion, print_json, print_lines, print_tables

if TYPE_CHECKING:
    from softstart.drive import Drive
    from softstart.identification import planning
    from softstart.identification.logs import TorqueIs
    from softstart.identification.planning import Plan
    from softstart.identification.result import Identification
    from softstart.views import identification as views
else:  # no numba for a help, a wrong option or the Tab key
    planning = late("softstart.identification.planning")
    views = late("softstart.views.identification")

SIMULATED = (
    "simulated by softstart, not measured: the torque demand, and the motor as its encoder would count it"
)
STRATEGIES = ("direct", "ramp", "s-curve", "reduced-two-stage", "shaped", "pulse-coast-hold")


@click.command(cls=Command)
@click.argument("logs", metavar="[LOG]...", nargs=-1)
@click.option(
    "--drive", metavar="GUESS", shell_complete=names_or_files(drive_names, ".toml"),
    help="The drive, or chain with one dominant gap, as it is thought to be, by a factor of 3 if need be: a "
    "file or shipped name.",
)  # fmt: skip
@set_option
@click.option(
    "--columns", metavar="SIGNAL=NAME,...",
    help="What the log calls them, as time=t,torque=-M_act,speed=n_act[rpm]; a minus turns the sign, a unit "
    "in brackets takes the place of that of the log.",
)  # fmt: skip
@click.option(
    "--torque-is", metavar="measured|demand", default="measured", help="What the torque of the log is."
)
@click.option(
    "--torque-constant", metavar="CONSTANT",
    help="The log has a current in place of the torque, of which this is the torque, as '1.2 N*m/A'.",
)  # fmt: skip
@click.option(
    "--free",
    metavar="NAME,...",
    help="What to find, as gap,stiffness,position. By default all that is usual; +motor.friction adds one.",
)
@click.option("--searches", metavar="N", help="At most so many searches for the best fit; 12 by default.")
@click.option(
    "--controllers",
    metavar="NAME,...",
    help=f"Strategies whose K_dyn is shown; {','.join(STRATEGIES)} by default.",
)
@click.option(
    "--plan", metavar="DRIVE", shell_complete=names_or_files(drive_names, ".toml"),
    help="No log yet: show what experiments with this drive would tell, and look for a better one.",
)  # fmt: skip
@click.option(
    "--standard", is_flag=True, help="With --plan: the standard experiments only, no search for a better one."
)
@click.option(
    "--log-period", metavar="TIME", help="Sample period of the log for --plan, as '4 ms' (the default)."
)
@click.option("--ripple", metavar="TORQUE", help="Torque error in each sample for --plan.")
@click.option(
    "--tell", "wanted", metavar="NAME,...", help="Parameters that a plan is to tell best; all by default."
)
@click.option(
    "--most-torque", metavar="TORQUE", help="Largest shaft torque that a planned experiment may have."
)
@click.option(
    "--most-travel", metavar="ANGLE", help="How far a planned experiment may move the load, at the motor."
)
@click.option(
    "--wear", is_flag=True,
    help="LOG are folders of identifications of one drive: how its gap grows, and when it reaches --limit.",
)  # fmt: skip
@click.option(
    "--dates", metavar="DATE,...",
    help="With --wear: when the logs were taken, as 2025-05-31,2026-05. By default by the folders' names.",
)  # fmt: skip
@click.option(
    "--limit", metavar="GAP", help="With --wear: the gap of a worn drive, as '0.2 rad'; strategies then."
)
@json_option
@out_option(
    "Write the drive found (drive.toml), figures and report.md, or the planned torques, into this folder."
)
def identify(
    *,
    logs: tuple[str, ...],
    drive: str | None,
    settings: tuple[str, ...],
    columns: str | None,
    torque_is: str,
    torque_constant: str | None,
    free: str | None,
    searches: str | None,
    controllers: str | None,
    plan: str | None,
    standard: bool,
    log_period: str | None,
    ripple: str | None,
    wanted: str | None,
    most_torque: str | None,
    most_travel: str | None,
    wear: bool,
    dates: str | None,
    limit: str | None,
    as_json: bool,
    out: str | None,
) -> None:
    """Find the parameters of a drive, with intervals, from what an inverter logged of its starts.

    LOG is a CSV file with the columns time, torque, and angle or speed of the motor, units in its first line
    as in "time [ms];torque [N*m];speed [rpm]", or a measurement file (MDF). It begins at standstill. Several
    logs are of one drive. With --plan DRIVE no log is read: it shows what each experiment would tell before
    it is run. With --wear the folders of identifications are compared over the years.
    """
    mistakes = Mistakes()
    with mistakes.noted():
        if plan is None and not logs:
            raise InputError(
                "LOG is missing: name the CSV file of a log, or plan an experiment with --plan DRIVE."
            )
        if plan is not None and logs:
            raise InputError(f'--plan = "{plan}": it reads no log; leave out {logs[0]}, or --plan.')
        if not wear and (dates or limit):
            raise InputError(
                f"{'--dates' if dates else '--limit'}: it goes with --wear; leave it out, or add --wear."
            )
        if wear and (plan is not None or drive is not None or settings):
            option = "--plan" if plan is not None else "--drive" if drive is not None else "--set"
            raise InputError(f"{option}: --wear reads folders of identifications alone; leave it out.")
        if plan is None and drive is None and not wear:
            raise InputError("--drive is missing: the search begins from a guess; softstart init writes one.")
    mistakes.settle()
    if wear:
        show_wear(logs, dates, limit, controllers, as_json, out)
        return
    with mistakes.noted():
        guess = read_drive(plan, settings) if plan is not None else read_machine(str(drive), settings)
    with mistakes.noted():
        if torque_is not in ("measured", "demand"):
            raise InputError(f'--torque-is = "{torque_is}": write measured or demand.')
    with mistakes.noted():
        constant = (
            None
            if torque_constant is None
            else float(to_si(torque_constant, "N*m/A", name="--torque-constant"))
        )
    with mistakes.noted():
        names = [name.strip() for name in free.split(",")] if free else None
    with mistakes.noted():
        most = read_count(searches, "--searches")
    with mistakes.noted():
        strategies = read_names(controllers)
    with mistakes.noted():
        texts = tuple(columns.split(",")) if columns else ()
        called = read_params(texts, "--columns", "speed=n_act")
    mistakes.settle()

    with output_folder(out) as folder:
        if plan is not None:
            with working("planning experiments ...") as tell, named_as_options():
                made = softstart.plan_experiments(
                    cast("Drive", guess), log_period=log_period or "4 ms", ripple=ripple, free=names,
                    most_torque=most_torque, most_travel=most_travel, optimise=not standard, tell=tell,
                    wanted=[name.strip() for name in wanted.split(",")] if wanted else (),
                )  # fmt: skip
                if folder is not None:
                    write_plan(made, folder, command_line())
            if as_json:
                print_json(made.summary())
            else:
                to = console()
                print_lines(to, views.plan_headline(made))
                print_tables(to, [views.plan_table(made)])
                print_conclusion(to, [views.plan_conclusion(made)], [])
        else:
            with working("fitting the drive to the logs ...") as tell, named_as_options():
                found = softstart.identify(
                    list(logs),
                    guess,
                    free=names,
                    torque_is=cast("TorqueIs", torque_is),
                    columns=called,
                    torque_constant=constant,
                    searches=most or 12,
                    tell=tell,
                )
                each = found.k_dyn(strategies or STRATEGIES)
                if folder is not None:
                    write_identification(found, each, folder, command_line())
            if as_json:
                print_json(
                    found.summary()
                    | {
                        "k_dyn": {
                            name: dict(zip(("value", "lower", "upper"), three, strict=True))
                            for name, three in each.items()
                        }
                    }
                )
            else:
                to = console()
                print_lines(to, views.headline(found))
                print_tables(to, [views.estimates_table(found), views.k_dyn_table(each)])
                print_conclusion(to, [], found.notes)
    if out is not None and not as_json:
        what = "torques and simulated logs, figure" if plan is not None else "drive.toml, residuals, figure"
        print(f"\nWritten to {out}: report.md, {what}.")


def show_wear(
    folders: Sequence[str], dates: str | None, limit: str | None, controllers: str | None, as_json: bool,
    out: str | None,
) -> None:  # fmt: skip
    """`--wear`: growth of the gap, when it is worn, and strategies then."""
    mistakes = Mistakes()
    with mistakes.noted():
        names = read_names(controllers)
    with mistakes.noted():
        worn = None if limit is None else float(to_si(limit, "rad", name="--limit"))
    mistakes.settle()
    days = None if dates is None else [one.strip() for one in dates.split(",")]
    with output_folder(out) as folder:
        with working("starting the worn drive ..."):
            found = softstart.follow_wear(folders, days, worn, controllers=names or list(STRATEGIES))
        said = views.wear_conclusion(found)
        tables = [views.wear_table(found), *([views.wear_strategies(found)] if found.then else [])]
        if folder is not None:
            save_figure(found.plot(), folder, "wear")
            table = tables[0]
            write_table(folder / "wear.csv", [column.heading for column in table.columns], table.rows)
            parts = [
                f"# {markdown(found.found[-1].drive.name)}: wear of the gap",
                *map(markdown, said),
                *table_sections(tables),
                "![the gap over time](wear.svg)",
                *map(markdown, found.notes),
            ]
            write_drive_report(folder, parts, found.found[-1].drive, command_line())
    if as_json:
        print_json(found.summary())
        return
    to = console()
    print_lines(to, [f"{found.found[-1].drive.name}: wear from {found.dates[0]} to {found.dates[-1]}"])
    print_tables(to, tables)
    print_conclusion(to, said, found.notes)
    if out is not None:
        print(f"\nWritten to {out}: report.md, wear.csv, figure.")


def write_identification(
    found: Identification, each: dict[str, tuple[float, float, float]], folder: Path, command: str
) -> None:
    """The files of --out."""
    found.save(folder)
    save_figure(found.plot(), folder, "logs")
    for number, (log, left) in enumerate(zip(found.logs, found.residuals, strict=True), 1):
        seen = np.isfinite(log.values)
        write_columns(
            folder / f"residuals-{number}.csv",
            {"time [s]": log.time[seen].tolist(), "drive - log": left.tolist()},
        )
    parts = [
        f"# {markdown(found.drive.name)}: identified from its logs",
        *map(markdown, views.headline(found)[1:]),
        *table_sections([views.estimates_table(found), views.k_dyn_table(each)]),
        "![the logs and the drive found](logs.svg)",
        *map(markdown, found.notes),
    ]
    write_drive_report(folder, parts, found.drive, command)


def write_plan(made: Plan, folder: Path, command: str) -> None:
    """The files of --out for a plan."""
    for one in made.experiments:
        stem = one.name.replace(", ", "-").replace(" ", "-")
        one.profile.to_csv(folder / f"{stem}.csv")
        one.profile.to_toml(folder / f"{stem}.toml")
        log = planning.made_up_log(made.drive, one, log_period=made.log_period, ripple=made.ripple)
        log.to_csv(folder / f"simulated-{stem}.csv", SIMULATED)
    save_figure(views.plan_figure(made), folder, "experiments")
    table = views.plan_table(made)
    write_table(
        folder / "plan.csv", [column.heading.replace("\n", " ") for column in table.columns], table.rows
    )
    parts = [
        f"# {markdown(made.drive.name)}: what an experiment would tell",
        *map(markdown, views.plan_headline(made)[1:]),
        *table_sections([table]),
        markdown(views.plan_conclusion(made)),
        "![torque of each experiment](experiments.svg)",
    ]
    write_drive_report(folder, parts, made.drive, command)
