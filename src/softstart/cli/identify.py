"""`softstart identify`: the drive from logs of its starts, and experiments that would tell it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import numpy as np

import softstart
from softstart.cli.commands import Command, Reading, typed
from softstart.cli.completion import names_or_files
from softstart.cli.options import (
    choice,
    command_line,
    count,
    drive_names,
    json_option,
    named_as_options,
    out_option,
    quantity,
    read_drive,
    read_list,
    read_machine,
    read_names,
    read_params,
    set_option,
)
from softstart.cli.running import working
from softstart.errors import InputError
from softstart.late import late
from softstart.views.drawing import save_figure
from softstart.views.markdown import (
    markdown,
    output_folder,
    table_sections,
    write_columns,
    write_drive_report,
    write_table,
)
from softstart.views.terminal import present, print_conclusion, print_lines, print_tables

if TYPE_CHECKING:
    from rich.console import Console

    from softstart.drive import Drive
    from softstart.identification import planning
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


def _check_question(given: Mapping[str, Any]) -> None:
    logs, plan, drive, wear = given["logs"], typed("plan"), typed("drive"), given["wear"]
    if plan is None and not logs:
        raise InputError(
            "LOG is missing: name the CSV file of a log, or plan an experiment with --plan DRIVE."
        )
    if plan is not None and logs:
        raise InputError(f'--plan = "{plan}": it reads no log; leave out {logs[0]}, or --plan.')
    if not wear and (typed("dates") or typed("limit")):
        raise InputError(
            f"{'--dates' if typed('dates') else '--limit'}: it goes with --wear; leave it out, or add --wear."
        )
    if wear and (plan is not None or drive is not None or typed("settings")):
        option = "--plan" if plan is not None else "--drive" if drive is not None else "--set"
        raise InputError(f"{option}: --wear reads folders of identifications alone; leave it out.")
    if plan is None and drive is None and not wear:
        raise InputError("--drive is missing: the search begins from a guess; softstart init writes one.")


@click.command(cls=Command, checks=[_check_question])
@click.argument("logs", metavar="[LOG]...", nargs=-1)
@click.option(
    "--drive", metavar="GUESS",
    type=Reading(lambda name, _, settings: read_machine(name, settings), "settings"),
    shell_complete=names_or_files(drive_names, ".toml"),
    help="Initial guess: a drive, or a chain with one dominant gap, as a file or shipped name. Factors of "
    "3 are tolerated.",
)  # fmt: skip
@set_option
@click.option(
    "--columns", metavar="SIGNAL=NAME,...",
    type=Reading(lambda text, option: read_params(text.split(","), option, "speed=n_act")),
    help="Names of the columns in the log, for example time=t,torque=-M_act,speed=n_act[rpm]; a minus "
    "inverts the sign, a unit in brackets replaces that of the log.",
)  # fmt: skip
@click.option(
    "--torque-is", metavar="measured|demand", type=choice("measured", "demand"), default="measured",
    help="Meaning of the torque in the log. Default: measured.",
)  # fmt: skip
@click.option(
    "--torque-constant", metavar="CONSTANT", type=quantity("N*m/A"),
    help="Torque constant, for example '1.2 N*m/A', if the log has the current instead of the torque.",
)  # fmt: skip
@click.option(
    "--rated-torque", metavar="TORQUE", type=quantity("N*m"),
    help="Torque at 100 %, for example '12 N*m', if the log has the torque in %. Default: that of the drive.",
)  # fmt: skip
@click.option(
    "--free",
    metavar="NAME,...",
    type=Reading(read_list),
    help="Parameters to identify, for example gap,stiffness,position; +motor.friction adds one to the "
    "default set.",
)
@click.option(
    "--searches", metavar="N", type=count(), default="12",
    help="Largest number of searches for the best fit. Default: 12.",
)  # fmt: skip
@click.option(
    "--time-limit", metavar="TIME", type=quantity("s", "a time in s, 0 or more", least=0.0), default="120 s",
    help="Time after which the best fit so far is the answer, without intervals. Default: 120 s.",
)  # fmt: skip
@click.option(
    "--controllers",
    metavar="NAME,...",
    type=Reading(read_names),
    help=f"Strategies whose K_dyn is shown. Default: {','.join(STRATEGIES)}.",
)
@click.option(
    "--plan", metavar="DRIVE", type=Reading(lambda name, _, settings: read_drive(name, settings), "settings"),
    shell_complete=names_or_files(drive_names, ".toml"),
    help="Compute the expected accuracy of experiments with this drive, and design a better one; no log is "
    "needed.",
)  # fmt: skip
@click.option("--standard", is_flag=True, help="With --plan: evaluate the standard experiments only.")
@click.option("--log-period", metavar="TIME", help="With --plan: sample period of the log. Default: 4 ms.")
@click.option(
    "--ripple", metavar="TORQUE", help="With --plan: standard deviation of the torque error in each sample."
)
@click.option(
    "--tell",
    "wanted",
    metavar="NAME,...",
    type=Reading(read_list),
    help="With --plan: parameters whose accuracy is optimised. Default: all.",
)
@click.option("--most-torque", metavar="TORQUE", help="With --plan: upper bound of the shaft torque.")
@click.option(
    "--most-travel",
    metavar="ANGLE",
    help="With --plan: upper bound of the travel of the load, referred to the motor.",
)
@click.option(
    "--wear", is_flag=True,
    help="LOG are folders of identifications of one drive: compute the growth of its gap, and when it "
    "reaches --limit.",
)  # fmt: skip
@click.option(
    "--dates", metavar="DATE,...", type=Reading(read_list),
    help="With --wear: dates of the logs, for example 2025-05-31,2026-05. Default: from the folder names.",
)  # fmt: skip
@click.option(
    "--limit",
    metavar="GAP",
    type=quantity("rad"),
    help="With --wear: gap of a worn drive, for example '0.2 rad', at which the strategies are evaluated.",
)
@json_option
@out_option(
    "Write the identified drive (drive.toml), figures and report.md, or the planned torque profiles, into "
    "this folder."
)
def identify(
    *,
    logs: tuple[str, ...],
    plan: Drive | None,
    controllers: list[str] | None,
    wear: bool,
    as_json: bool,
    out: str | None,
    **given: Any,
) -> None:
    """Identify the parameters of a drive, with confidence intervals, from inverter logs.

    LOG is a CSV file with the columns time, torque, and angle or speed of the motor, with units in the first
    line, "time [ms];torque [N*m];speed [rpm]", or a measurement file (MDF). It begins at standstill. Several
    logs of the same drive are fitted together. With --plan DRIVE no log is read: the expected accuracy of
    each experiment is computed beforehand. With --wear identifications of several years are compared.
    """
    if wear:
        show_wear(logs, given["dates"], given["limit"], controllers, as_json, out)
    elif plan is not None:
        show_plan(plan, given, as_json, out)
    else:
        show_fit(logs, controllers or STRATEGIES, given, as_json, out)


def show_plan(drive: Drive, given: Mapping[str, Any], as_json: bool, out: str | None) -> None:
    """`--plan`: what standard experiments and a planned one tell."""
    with output_folder(out) as folder, working("planning experiments ...") as progress, named_as_options():
        made = softstart.plan_experiments(
            drive, log_period=given["log_period"] or "4 ms", ripple=given["ripple"], free=given["free"],
            most_torque=given["most_torque"], most_travel=given["most_travel"],
            optimise=not given["standard"], progress=progress, wanted=given["wanted"] or (),
        )  # fmt: skip
        if folder is not None:
            write_plan(made, folder, command_line())

    def show(to: Console) -> None:
        print_lines(to, views.plan_headline(made))
        print_tables(to, [views.plan_table(made)])
        print_conclusion(to, [views.plan_conclusion(made)], [])

    present(made.summary, show, as_json, out and f"{out}: report.md, torques and simulated logs, figure")


def show_fit(
    logs: Sequence[str], strategies: Sequence[str], given: Mapping[str, Any], as_json: bool, out: str | None
) -> None:
    """The drive that the logs are of."""
    with (
        output_folder(out) as folder,
        working("fitting the drive to the logs ...") as progress,
        named_as_options(),
    ):
        found = softstart.identify(
            list(logs), given["drive"], free=given["free"], torque_is=given["torque_is"],
            columns=given["columns"] or {}, torque_constant=given["torque_constant"],
            rated_torque=given["rated_torque"], searches=given["searches"], time_limit=given["time_limit"],
            progress=progress,
        )  # fmt: skip
        each = found.k_dyn(strategies)
        if folder is not None:
            write_identification(found, each, folder, command_line())

    def show(to: Console) -> None:
        print_lines(to, views.headline(found))
        print_tables(to, [views.estimates_table(found), views.k_dyn_table(each)])
        print_conclusion(to, [], found.notes)

    names = ("value", "lower", "upper")
    present(
        lambda: (
            found.summary()
            | {"k_dyn": {name: dict(zip(names, three, strict=True)) for name, three in each.items()}}
        ),
        show,
        as_json,
        out and f"{out}: report.md, drive.toml, residuals, figure",
    )


def show_wear(
    folders: Sequence[str], days: list[str] | None, worn: float | None, controllers: list[str] | None,
    as_json: bool, out: str | None,
) -> None:  # fmt: skip
    """`--wear`: growth of the gap, when it is worn, and strategies then."""
    with output_folder(out) as folder:
        with working("starting the worn drive ..."):
            found = softstart.follow_wear(folders, days, worn, controllers=controllers or list(STRATEGIES))
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

    def show(to: Console) -> None:
        print_lines(to, [f"{found.found[-1].drive.name}: wear from {found.dates[0]} to {found.dates[-1]}"])
        print_tables(to, tables)
        print_conclusion(to, said, found.notes)

    present(found.summary, show, as_json, out and f"{out}: report.md, wear.csv, figure")


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
    write_drive_report(folder, parts, found.rounded().drive, command)


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
