"""`softstart plan`, `identify` and `wear`: experiments, the drive from its logs, the growth of its gap."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import click

import softstart
from softstart.cli import options
from softstart.cli.completion import one_of
from softstart.cli.options import command, option
from softstart.cli.running import Output, answers, working
from softstart.drive import Drive

if TYPE_CHECKING:
    from softstart.drive.machine import Machine
    from softstart.identification.logs import TorqueIs

STRATEGIES = "direct,ramp,s-curve,reduced-two-stage,shaped,pulse-coast-hold"

free_option = option("--free", options.read_list)


@command("plan")
@free_option
@option("--log-period", default="4 ms")
@option("--ripple")
@option("--standard", is_flag=True)
@option("--wanted", options.read_list)
@option("--max-torque")
@option("--max-travel")
@options.at_option
@options.of_drive(options.read_drive)
@answers(out=True)
def plan_command(*, drive: Drive, standard: bool, **arguments: Any) -> Output:
    """Plan an experiment that identifies a drive accurately.

    DRIVE is your estimate, as a TOML file or the name of a shipped drive (see: softstart drives); by default
    the crane drive of the literature. The expected accuracy of standard experiments is computed, and of one
    that is designed for this drive.

    Options
    -------
    --free NAME,...
        Parameters to identify, for example gap,stiffness,position; +motor.friction adds one to the
        default set.
    --log-period TIME
        Sample period of the log. Default: 4 ms.
    --ripple TORQUE
        Standard deviation of the torque error in each sample.
    --standard
        Evaluate the standard experiments only.
    --wanted NAME,...
        Parameters whose accuracy is optimised, for example gap. Default: all.
    --max-torque TORQUE
        Upper bound of the shaft torque; with a gear also '1.6 kN*m at output'.
    --max-travel ANGLE
        Upper bound of the travel of the load at the motor shaft, or '1 turn at output'.
    --out DIR
        Write torque profiles (CSV, TOML), simulated logs, figure and report into this folder.
    """
    with working("planning experiments ...") as progress:
        return softstart.plan_experiments(drive, optimise=not standard, progress=progress, **arguments)


def _columns(text: str, option: str) -> dict[str, str]:
    return options.read_params(text.split(","), option, "speed=n_act")


@command("identify")
@click.argument("logs", metavar="LOG...", nargs=-1, required=True)
@option(
    "--drive",
    lambda name, _: options.seen(options.read_machine(name, options.typed_settings())),
    required=True,
    shell_complete=one_of(options.drive_names),
)
@options.set_option(Drive.TABLES)
@options.at_option
@option("--columns", _columns)
@option("--torque-is", type=click.Choice(["measured", "demand"]), default="measured")
@free_option
@option("--restarts searches", options.count(), default="12")
@option("--controllers", options.read_names, default=STRATEGIES)
@answers(out=True)
def identify_command(
    *, logs: tuple[str, ...], drive: Machine, controllers: list[str], columns: dict[str, str],
    torque_is: TorqueIs, **arguments: Any,
) -> Output:  # fmt: skip
    """Identify the parameters of a drive, with confidence intervals, from inverter logs.

    LOG is a CSV file with the columns time, torque, and angle or speed of the motor, with names and units
    above the numbers, "time [ms];torque [N*m];speed [rpm]". It begins at standstill. Several logs of the same
    drive are fitted together.

    Options
    -------
    --drive GUESS
        Initial guess: a drive, or a chain with one dominant gap, as a file or shipped name. Factors of 3
        are tolerated.
    --columns SIGNAL=NAME,...
        Names of the columns in the log, for example time=t,torque=1.2*iq[N*m],speed=-n_act[rpm]; a minus
        inverts the sign, a factor makes a torque of a current or an angle of counts (1/4096*pos[turn]), a
        unit in brackets replaces that of the log ([% of 35 N*m] for a torque in %).
    --torque-is measured|demand
        Meaning of the torque in the log. Default: measured.
    --free NAME,...
        Parameters to identify, for example gap,stiffness,position; +motor.friction adds one to the
        default set.
    --restarts N
        Largest number of independent searches. Default: 12.
    --controllers NAME,...
        Strategies to simulate. Default: direct,ramp,s-curve,reduced-two-stage,shaped,pulse-coast-hold.
    --out DIR
        Write the identified drive (drive.toml), residuals, figure and report.md into this folder.
    """
    read = [softstart.Log.load(path, columns=columns, torque_is=torque_is) for path in logs]
    with working("fitting the drive to the logs ...") as progress:
        identification = softstart.identify(read, drive, progress=progress, **arguments)
        known = identification if identification.stated else identification.drive
        comparison = softstart.compare(known, controllers, worst_case=())
    none = (math.nan, math.nan)
    k_dyns = {row.name: (row.run.k_dyn, *row.intervals.get("k_dyn", none)) for row in comparison.rows}
    from softstart.views.identification import identification_sheet

    of_each = {name: dict(zip(("value", "lower", "upper"), v, strict=True)) for name, v in k_dyns.items()}
    return lambda: identification.summary() | {"k_dyn": of_each}, identification_sheet(identification, k_dyns)


@command("wear")
@click.argument("folders", metavar="FOLDER...", nargs=-1, required=True)
@option("--dates", options.read_list, required=True)
@option("--worn-gap limit")
@options.at_option
@answers(out=True)
def wear_command(*, folders: tuple[str, ...], **arguments: Any) -> Output:
    """Compute the growth of the gap from several identifications, and when it is worn.

    Each FOLDER is what softstart identify --out has written of the same drive, in another year.

    Options
    -------
    --dates DATE,...
        Dates of the logs, for example 2025-05-31,2026-05-31.
    --worn-gap GAP
        Gap of a worn drive, for example '0.2 rad', with a gear also '9 arcmin at output': when it is
        reached.
    --out DIR
        Write the gaps (CSV), the figure and report.md into this folder.
    """
    wear = softstart.follow_wear(folders, **arguments)
    return replace(wear, found=tuple(map(options.seen, wear.found)))
