"""`softstart duty`: stops, reversals, jogs and load changes, and the life of a shift."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING

import click

import softstart
from softstart.cli import options
from softstart.cli.completion import one_of
from softstart.cli.options import command, controller_option, option
from softstart.cli.running import Output, answers, attributed, controllers_from_options, working
from softstart.cli.starts import read_part_counts
from softstart.drive import Duty
from softstart.errors import InputError
from softstart.plugins import controller_names

if TYPE_CHECKING:
    from softstart.drive import Drive
    from softstart.drive.machine import Machine
    from softstart.start.duty import DutyRun


@command("duty")
@controller_option("--controller")
@option("--controllers", options.read_names, shell_complete=one_of(controller_names))
@option("--compare", is_flag=True)
@options.param_option
@options.fitted_to_option
@options.duty_file_option
@options.stop_option
@option("--cycles", options.count(1, 100_000), default="2")
@option("--slope", options.quantity("1"))
@option("--estimate-damping", read_part_counts)
@options.at_option
@options.of_drive(options.read_machine)
@answers(out=True)
def duty_command(
    *, drive: Machine, controller: str | None, controllers: list[str] | None, compare: bool,
    params: dict[str, str], fitted_to: Drive | None, stop: str | None, cycles: int, slope: float | None,
    estimate_damping: dict[str, int] | None,
) -> Output:  # fmt: skip
    """Run a machine through a duty: starts, stops, reversals, jogs, load changes, and the life of a shift.

    DRIVE is a TOML file, also of a project, or the name of a shipped drive (see: softstart drives) or chain;
    by default the crane drive of the literature. The steps of one cycle are the tables [[duty]] of its file
    or of a file of their own, [shift] says how often the cycle is repeated (see
    docs/reference/drive-file.md). Each step begins in the state that the last one leaves. The [limits] are
    checked in every step, in both directions; damage is counted from the second cycle on, by rainflow of the
    whole trace.

    Options
    -------
    --controller NAME
        A strategy: its name, path/to/file.py:ClassName, a file of tuned gains (.toml), or a torque
        profile (.csv).
    --controllers A,B,...
        Compare these strategies instead, separated by commas.
    --compare
        Compare all installed strategies that need no parameter.
    --param KEY=VALUE
        Set a parameter of the strategy, for example time='200 ms'; of several CONTROLLER.KEY=VALUE. May be
        repeated.
    --duty FILE
        The file, or the name of a shipped duty, instead of the [[duty]] of DRIVE.
    --cycles N
        Number of cycles. Default: 2.
    --slope M
        Slope of the S-N curve, instead of limits.fatigue.slope. Default: 6.6, pitting of case-hardened
        gears.
    --estimate-damping gears=N,couplings=N
        For shafts without damping: a damping ratio of 1 % per pair of gears and 0.5 % per coupling, at
        most 6 %.
    --out DIR
        Write the figures (SVG, PNG), trace, steps and spectra (CSV) and report.md into this folder.
    """
    several = compare or controllers is not None
    if (controller is not None) == several or (compare and controllers is not None):
        raise InputError(
            "--controller: give one strategy with --controller, several with --controllers, or --compare for "
            "all of them."
        )
    typed = options.typed_duty(drive)
    duty = typed if isinstance(typed, Duty) else None  # that of the machine
    with working("running the duty ...") as progress, attributed():
        asked = controllers if controller is None else [controller]
        strategies = controllers_from_options(asked, params, several=several)
        if several:
            compared = softstart.compare_duty(
                drive, strategies, duty, stop=stop, cycles=cycles, fitted_to=fitted_to, slope=slope,
                estimate_damping=estimate_damping, progress=progress,
            )  # fmt: skip
        else:
            from softstart.start.fatigue import curve_of, with_estimated_damping

            machine = with_estimated_damping(drive, estimate_damping) if estimate_damping else drive
            curve_of(machine, slope)  # a wrong slope is told before anything is computed
            run = softstart.run_duty(
                machine, strategies[0], duty, stop=stop, cycles=cycles, fitted_to=fitted_to,
                progress=lambda one: progress(f"cycle {one.cycle} of {cycles}, step {one.number}"),
            )  # fmt: skip
    from softstart.views import duties

    if several:
        rows = compared.ranked if controllers is None else compared.rows
        return compared.summary, duties.duty_comparison_sheet(compared, rows, fitted_to)
    sheet = duties.duty_sheet(run, slope, fitted_to, estimate_damping)
    return lambda: duties.duty_data(run, slope, estimate_damping), replace(sheet, commands=_next_steps(run))


WAYS = {
    "coast": "stops by coasting",
    "torque": "stops by the torque of the motor",
    "brake": "stops by the brake",
}


def _next_steps(run: DutyRun) -> list[tuple[str, str]]:
    """The same command for all strategies, and with another stop where none of the steps says how."""
    from softstart.start.duty import checked_stop

    typed = list(click.get_current_context().obj or ())
    found = [([*_without(typed, "controller", "param", "out"), "--compare"], "all strategies side by side")]
    for way, gives in WAYS.items() if run.uses_configured_stop else ():
        with suppress(InputError):
            checked_stop(run.drive, run.controller, run.drive.design_drive, run.duty, way)
            if way != run.stop:
                found.append(([*_without(typed, "stop", "out"), "--stop", way], gives))
    return [(shlex.join(["softstart", *words]), gives) for words, gives in found]


def _without(words: Sequence[str], *names: str) -> Iterator[str]:
    """The words of a command without these options and their values."""
    value = False
    for word in words:
        name, equals, _ = word.removeprefix("--").partition("=")
        if value or (word.startswith("--") and name in names):
            value = not value and not equals
        else:
            yield word
