"""`softstart compare`, `simulate`, `fatigue` and `linear`: starts, lives and stability margins."""

from __future__ import annotations

import shlex
from dataclasses import asdict, replace
from typing import TYPE_CHECKING, Any

import click

import softstart
from softstart.cli import options
from softstart.cli.completion import one_of
from softstart.cli.options import command, controller_option, option
from softstart.cli.running import Output, answers, attributed, controllers_from_options, option_value, working
from softstart.errors import InputError
from softstart.plugins import controller_names
from softstart.quantities import whole_number

if TYPE_CHECKING:
    from softstart.controller import Controller
    from softstart.drive import Drive
    from softstart.drive.machine import Machine
    from softstart.identification.result import Identification
    from softstart.start.comparison import Comparison


@command("compare")
@controller_option("--controllers", several=True)
@options.fitted_to_option
@options.param_option
@options.until_option
@option("--worst-case", lambda text, name: () if text == "none" else options.read_list(text, name))
@option("--at-time", is_flag=False, flag_value="1.3x")
@option("--details", is_flag=True)
@option("--worn-gap")
@options.at_option
@options.of_drive(options.read_machine_or_identified)
@click.argument("beside", required=False, shell_complete=one_of(options.drive_names))
@answers(out=True)
def compare_command(
    *, drive: Machine | Identification, beside: str | None, worn_gap: str | None,
    controllers: list[str] | None, params: dict[str, str], details: bool, **arguments: Any,
) -> Output:  # fmt: skip
    """Compare strategies on a drive or a chain, or on two of them side by side.

    DRIVE is a TOML file, also of a project, the name of a shipped drive (see: softstart drives) or chain
    (crane-4-mass, tractor-like), or the folder of an identification, which adds confidence intervals; by
    default the crane drive of the literature. A strategy is a name (see: softstart controllers),
    path/to/file.py:Class, a file of tuned gains, or a torque profile (.csv). BESIDE is another machine of the
    same kind: one table and one figure show both.

    Options
    -------
    --worn-gap GAP
        Side by side with DRIVE as it is when worn: with this gap, for example '2 rad', under strategies set
        up for DRIVE. Of a chain all gaps together at the motor shaft.
    --worst-case A,B,...
        Changes of the drive under which its [limits] are checked too: gap x4, J2 x0.4, or none. Default:
        both.
    --at-time TIME
        Compare at equal time: each strategy with the value of its time parameter that has the lowest K_dyn of
        64 values whose load has settled within this time, for example 0.5 (s), '500 ms' or 1.3x, times the
        settled time of direct. Without TIME: 1.3x.
    --details
        Also show times, events, and what each column means.
    --out DIR
        Write figures (SVG, PNG), traces and table (CSV) and report.md into this folder.
    """
    if beside is not None or worn_gap is not None:
        return _side_by_side(
            drive, beside, controllers_from_options(controllers, params), worn_gap, arguments
        )
    with working("starting the drive ..."), attributed():
        comparison = softstart.compare(drive, controllers_from_options(controllers, params), **arguments)
    from softstart.project.parts import refuse_longer
    from softstart.views.starts import comparison_sheet

    rows = list(comparison.rows)
    for row in rows:
        refuse_longer(row.run, f'strategy "{row.name}"')
    if controllers is None:
        rows.sort(key=lambda row: row.run.k_dyn)
    sheet = comparison_sheet(comparison, rows, details or option_value("out") is not None)
    return comparison.summary, replace(sheet, commands=_next_steps(comparison))


def _side_by_side(
    drive: Machine | Identification, beside: str | None, strategies: list[Controller], worn_gap: str | None,
    arguments: dict[str, Any],
) -> Output:  # fmt: skip
    if arguments.pop("fitted_to") is not None:
        raise InputError("--fitted-to: side by side strategies are set up for their machines; leave it out.")
    other = None if beside is None else options.seen(options.read_machine_or_identified(beside, ()))
    with working("starting both machines ..."), attributed(), options.named_as_options(second="BESIDE"):
        return softstart.side_by_side(drive, other, strategies, worn_gap=worn_gap, **arguments)


def _next_steps(comparison: Comparison) -> list[tuple[str, str]]:
    """Commands for the same machine that lead on, each with what it gives."""
    from softstart.tuning.ranges import tunable_parameters

    settings = [word for setting in options.typed_settings() for word in ("--set", setting)]
    settings += options.typed_shaft()
    chosen = comparison.recommendation
    best = chosen.recommended or (chosen.best[-1] if chosen.best else None)
    steps: list[tuple[str, list[str], str]] = []
    if not (chosen.recommended or comparison.rows[0].intervals):
        known = len(comparison.drive.positions) == 1
        steps.append(("optimize", [], "the lowest possible K_dyn" if known else "the best fixed profile"))
    if best is not None and best.name in controller_names() and tunable_parameters(best.controller):
        steps.append(("tune", ["--controller", best.name], "gains for other gaps and loads"))
    steps.append(("report", ["--out", "report.html"], "all results in one file"))
    machine = [options.typed_machine(), *settings]
    return [(shlex.join(["softstart", name, *machine, *more]), gives) for name, more, gives in steps]


@command("simulate")
@controller_option("--controller", required=True)
@options.param_option
@options.fitted_to_option
@options.until_option
@options.at_option
@options.of_drive(options.read_machine)
@answers(out=True)
def simulate_command(
    *, drive: Machine, controller: str, params: dict[str, str], fitted_to: Drive | None, until: float | None
) -> Output:  # fmt: skip
    """Simulate one start of a drive or a chain.

    DRIVE is a TOML file, also of a project, or the name of a shipped drive (see: softstart drives) or chain
    (crane-4-mass, tractor-like); by default the crane drive of the literature. For a motor torque over speed
    (DOL, star-delta) see docs/howto/motor-torque-over-speed.md.

    Options
    -------
    --out DIR
        Write the figure (SVG, PNG), traces, stages and events (CSV) and report.md into this folder.
    """
    with working("starting the drive ..."), attributed():
        (strategy,) = controllers_from_options([controller], params, several=False)
        run = softstart.simulate(drive, strategy, until, fitted_to=fitted_to)
        _ = run.settled_time  # it may ask the controller on
    from softstart.project.parts import refuse_longer
    from softstart.start.recommendation import margins_of
    from softstart.views.starts import run_sheet

    if until is None:
        refuse_longer(run, f"--controller {controller}")

    data = {
        **run.summary(),
        "fitted_to": fitted_to.name if fitted_to else None,
        "limits": [margin.summary() for margin in margins_of(run)],
        "stages": [{**asdict(stage), "duration": stage.duration} for stage in run.stages],
        "events": [event._asdict() for event in run.events],
    }
    return lambda: data, run_sheet(run, fitted_to)


def read_part_counts(text: str, option: str) -> dict[str, int]:
    """The `name=number` pairs of --estimate-damping."""
    pairs = options.read_params(text.split(","), option, "gears=3,couplings=2")
    return {name: whole_number(number, option, 0) for name, number in pairs.items()}


@command("fatigue")
@controller_option("--controllers", several=True)
@options.fitted_to_option
@options.param_option
@option("--slope", options.quantity("1"))
@option("--worn-gap")
@option("--estimate-damping", read_part_counts)
@options.at_option
@options.of_drive(options.read_machine)
@answers(out=True)
def fatigue_command(
    *, drive: Machine, controllers: list[str] | None, fitted_to: Drive | None, params: dict[str, str],
    **arguments: Any,
) -> Output:  # fmt: skip
    """Estimate the fatigue life of the shaft line under each strategy.

    DRIVE is a TOML file, also of a project, or the name of a shipped drive (see: softstart drives) or chain;
    by default the crane drive of the literature. Cycles are counted by the rainflow method. The tables
    [limits] and [limits.fatigue] of the file give the S-N curve, the starts per hour and the required life;
    without them lives are relative to that of direct. Every shaft needs damping; those of a chain are
    evaluated separately.

    Options
    -------
    --slope M
        Slope of the S-N curve, instead of limits.fatigue.slope. Default: 6.6, pitting of case-hardened
        gears.
    --worn-gap GAP
        Gap at the end of limits.life, for example '2 rad'; it grows in proportion to time, and damage
        accumulates. Of a chain: all gaps together at the motor shaft.
    --estimate-damping gears=N,couplings=N
        For shafts without damping: a damping ratio of 1 % per pair of gears and 0.5 % per coupling, at
        most 6 %.
    --out DIR
        Write the figure (SVG, PNG), cycles and turning points (CSV) and report.md into this folder.
    """
    with working("starting the machine ..."), attributed():
        strategies = controllers_from_options(controllers, params)
        result = softstart.fatigue(
            [softstart.simulate(drive, strategy, fitted_to=fitted_to) for strategy in strategies], **arguments
        )
    from softstart.views.fatigue import fatigue_sheet

    rows = result.ranked if controllers is None else result.rows
    return result.summary, fatigue_sheet(result, rows, fitted_to)


@command("linear")
@controller_option("--controller", required=True)
@options.param_option
@options.at_option
@options.of_drive(options.read_machine)
@answers(out=True)
def linear_command(*, drive: Machine, controller: str, params: dict[str, str]) -> Output:
    """Linearise the control loop: stability margins, modes, limit cycles.

    DRIVE is a TOML file, also of a project, or the name of a shipped drive or chain (see: softstart drives);
    by default the crane drive of the literature. The controller's step function is linearised at an instant
    of its start at which all gaps are closed; the loop is broken at the torque demand. Limit cycles through
    the gap of a drive are predicted by the describing function.

    Options
    -------
    --out DIR
        Write the Bode and Nyquist diagrams (SVG, PNG), the response (CSV) and report.md into this folder.
    """
    with working("running and linearising the start ..."), attributed():
        (strategy,) = controllers_from_options([controller], params, several=False)
        return softstart.linear_view(drive, strategy)
