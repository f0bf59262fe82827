"""`softstart plan`, `identify` and `wear`: experiments, the drive from its logs, the growth of its gap."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import click

import softstart
from softstart.cli import options
from softstart.cli.completion import one_of
from softstart.cli.options import reading
from softstart.cli.running import Answer, answers, working

if TYPE_CHECKING:
    from softstart.drive import Drive
    from softstart.drive.machine import Machine
    from softstart.identification.logs import TorqueIs

STRATEGIES = ["direct", "ramp", "s-curve", "reduced-two-stage", "shaped", "pulse-coast-hold"]

free_option = click.option("--free", metavar="NAME,...", callback=reading(options.read_list),
    help="Parameters to identify, for example gap,stiffness,position; +motor.friction adds one to the "
    "default set.")  # fmt: skip


@click.command("plan")
@free_option
@click.option("--log-period", metavar="TIME", default="4 ms", help="Sample period of the log. Default: 4 ms.")
@click.option("--ripple", metavar="TORQUE", help="Standard deviation of the torque error in each sample.")
@click.option("--standard", is_flag=True, help="Evaluate the standard experiments only.")
@click.option("--wanted", metavar="NAME,...", callback=reading(options.read_list),
    help="Parameters whose accuracy is optimised, for example gap. Default: all.")  # fmt: skip
@click.option(
    "--max-torque",
    metavar="TORQUE",
    help="Upper bound of the shaft torque; with a gear also '1.6 kN*m at output'.",
)
@click.option(
    "--max-travel",
    metavar="ANGLE",
    help="Upper bound of the travel of the load at the motor shaft, or '1 turn at output'.",
)
@options.of_drive(options.read_drive, needed=True)
@answers("Write torque profiles (CSV, TOML), simulated logs, figure and report into this folder.")
def plan_command(*, drive: Drive, standard: bool, **asked: Any) -> Answer:
    """Plan an experiment that identifies a drive accurately.

    DRIVE is your estimate, as a TOML file or the name of a shipped drive (see: softstart drives). The
    expected accuracy of standard experiments is computed, and of one that is designed for this drive.
    """
    with working("planning experiments ...") as progress:
        made = softstart.plan_experiments(drive, optimise=not standard, progress=progress, **asked)
    from softstart.views.identification import plan_sheet

    return made.summary, plan_sheet(made)


@click.command("identify")
@click.argument("logs", metavar="LOG...", nargs=-1, required=True)
@click.option(
    "--drive", metavar="GUESS", required=True, shell_complete=one_of(options.drive_names),
    callback=reading(lambda name, _: options.read_machine(name, options.typed_settings())),
    help="Initial guess: a drive, or a chain with one dominant gap, as a file or shipped name. Factors of "
    "3 are tolerated.",
)  # fmt: skip
@options.set_option
@click.option("--columns", metavar="SIGNAL=NAME,...",
    callback=reading(lambda text, option: options.read_params(text.split(","), option, "speed=n_act")),
    help="Names of the columns in the log, for example time=t,torque=1.2*iq[N*m],speed=-n_act[rpm]; a minus "
    "inverts the sign, a factor makes a torque of a current or an angle of counts (1/4096*pos[turn]), a "
    "unit in brackets replaces that of the log ([% of 35 N*m] for a torque in %).")  # fmt: skip
@click.option(
    "--torque-is", metavar="measured|demand", type=click.Choice(["measured", "demand"]), default="measured",
    help="Meaning of the torque in the log. Default: measured.",
)  # fmt: skip
@free_option
@click.option("--restarts", "searches", metavar="N", callback=options.count(), default="12",
    help="Largest number of independent searches. Default: 12.")  # fmt: skip
@click.option(
    "--controllers", metavar="NAME,...", callback=reading(options.read_names), default=",".join(STRATEGIES),
    help=f"Strategies to simulate. Default: {','.join(STRATEGIES)}.",
)  # fmt: skip
@answers("Write the identified drive (drive.toml), residuals, figure and report.md into this folder.")
def identify_command(
    *, logs: tuple[str, ...], drive: Machine, controllers: list[str], columns: dict[str, str],
    torque_is: TorqueIs, **asked: Any,
) -> Answer:  # fmt: skip
    """Identify the parameters of a drive, with confidence intervals, from inverter logs.

    LOG is a CSV file with the columns time, torque, and angle or speed of the motor, with names and units
    above the numbers, "time [ms];torque [N*m];speed [rpm]". It begins at standstill. Several logs of the same
    drive are fitted together.
    """
    read = [softstart.Log.load(one, columns=columns, torque_is=torque_is) for one in logs]
    with working("fitting the drive to the logs ...") as progress:
        found = softstart.identify(read, drive, progress=progress, **asked)
        compared = softstart.compare(found if found.stated else found.drive, controllers, worst_case=())
    none = (math.nan, math.nan)
    k_dyns = {row.name: (row.run.k_dyn, *row.intervals.get("k_dyn", none)) for row in compared.rows}
    from softstart.views.identification import identification_sheet

    of_each = {name: dict(zip(("value", "lower", "upper"), v, strict=True)) for name, v in k_dyns.items()}
    return lambda: found.summary() | {"k_dyn": of_each}, identification_sheet(found, k_dyns)


@click.command("wear")
@click.argument("folders", metavar="FOLDER...", nargs=-1, required=True)
@click.option("--dates", metavar="DATE,...", callback=reading(options.read_list), required=True,
    help="Dates of the logs, for example 2025-05-31,2026-05-31.")  # fmt: skip
@click.option("--worn-gap", "limit", metavar="GAP",
    help="Gap of a worn drive, for example '0.2 rad', with a gear also '9 arcmin at output': when it is "
    "reached.")  # fmt: skip
@answers("Write the gaps (CSV), the figure and report.md into this folder.")
def wear_command(*, folders: tuple[str, ...], **asked: Any) -> Answer:
    """Compute the growth of the gap from several identifications, and when it is worn.

    Each FOLDER is what softstart identify --out has written of the same drive, in another year.
    """
    found = softstart.follow_wear(folders, **asked)
    from softstart.views.identification import wear_sheet

    return found.summary, wear_sheet(found)
