"""`softstart compare`, `simulate`, `fatigue` and `linear`: starts, lives and stability margins."""

from __future__ import annotations

import shlex
from dataclasses import asdict, replace
from typing import TYPE_CHECKING, Any

import click

import softstart
from softstart.cli import options
from softstart.cli.options import reading
from softstart.cli.running import Answer, answers, attributed, controllers_from_options, option_value, working
from softstart.quantities import whole_number

if TYPE_CHECKING:
    from softstart.drive import Drive
    from softstart.drive.machine import Machine
    from softstart.identification.result import Identification
    from softstart.start.comparison import Comparison

strategies_option = options.controller_option(
    "--controllers", "A,B,...",
    "Strategies, separated by commas. Default: all installed ones that need no parameter.",
)  # fmt: skip
params_option = options.param_option(
    "Set a parameter of a strategy, for example ramp.time='0.2 s'. May be repeated.", "CONTROLLER.KEY=VALUE"
)


@click.command("compare")
@strategies_option
@options.fitted_to_option
@params_option
@options.until_option
@click.option(
    "--worst-case", metavar="A,B,...",
    callback=reading(lambda text, option: () if text == "none" else options.read_list(text, option)),
    help="Changes of the drive under which its [limits] are checked too: gap x4, J2 x0.4, or none. "
    "Default: both.",
)  # fmt: skip
@click.option("--details", is_flag=True, help="Also show times, events, and what each column means.")
@options.of_drive(options.read_machine_or_identified)
@answers("Write figures (SVG, PNG), traces and table (CSV) and report.md into this folder.")
def compare_command(
    *, drive: Machine | Identification, controllers: list[str] | None, params: dict[str, str], details: bool,
    **asked: Any,
) -> Answer:  # fmt: skip
    """Compare strategies on a drive or a chain.

    DRIVE is a TOML file, the name of a shipped drive (see: softstart drives) or chain (crane-4-mass,
    tractor-like), or the folder of an identification, which adds confidence intervals; by default the crane
    drive of the literature. A strategy is a name (see: softstart controllers), path/to/file.py:Class, or a
    file of tuned gains.
    """
    with working("starting the drive ..."), attributed():
        found = softstart.compare(drive, controllers_from_options(controllers, params), **asked)
    from softstart.views.starts import comparison_sheet

    rows = sorted(found.rows, key=lambda row: row.run.k_dyn) if controllers is None else list(found.rows)
    sheet = comparison_sheet(found, rows, details or option_value("out") is not None)
    return found.summary, replace(sheet, commands=_next_steps(found))


def _next_steps(comparison: Comparison) -> list[tuple[str, str]]:
    """Commands for the same machine that lead on, each with what it gives."""
    from softstart.tuning.ranges import tunable_parameters

    machine = [
        options.typed_machine(),
        *(word for one in options.typed_settings() for word in ("--set", one)),
    ]
    chosen = comparison.recommendation
    best = chosen.recommended or (chosen.best[-1] if chosen.best else None)
    steps: list[tuple[str, list[str], str]] = []
    if not (chosen.recommended or comparison.rows[0].intervals):
        known = len(comparison.drive.positions) == 1
        steps.append(("optimize", [], "the lowest possible K_dyn" if known else "the best fixed profile"))
    if best is not None and best.name in options.controller_names() and tunable_parameters(best.controller):
        steps.append(("tune", ["--controller", best.name], "gains for other gaps and loads"))
    steps.append(("report", ["--out", "report.html"], "all results in one file"))
    return [(shlex.join(["softstart", name, *machine, *more]), gives) for name, more, gives in steps]


@click.command("simulate")
@options.controller_option(
    "--controller", "NAME",
    "A strategy: its name, path/to/file.py:ClassName, or a file of tuned gains (.toml).", required=True,
)  # fmt: skip
@options.param_option("Set a parameter of the strategy, for example time='200 ms'. May be repeated.")
@options.fitted_to_option
@options.until_option
@options.of_drive(options.read_machine, needed=True)
@answers("Write the figure (SVG, PNG), traces, stages and events (CSV) and report.md into this folder.")
def simulate_command(
    *, drive: Machine, controller: str, params: dict[str, str], fitted_to: Drive | None, until: float | None
) -> Answer:  # fmt: skip
    """Simulate one start of a drive or a chain.

    DRIVE is a TOML file or the name of a shipped drive (see: softstart drives) or chain (crane-4-mass,
    tractor-like). For a motor torque over speed (DOL, star-delta) see
    docs/howto/motor-torque-over-speed.md.
    """
    with working("starting the drive ..."), attributed():
        (made,) = controllers_from_options([controller], params, several=False)
        run: Any = softstart.simulate(drive, made, until, fitted_to=fitted_to)
        _ = run.settled_time  # it may ask the controller on
    from softstart.start.recommendation import margins_of
    from softstart.views.starts import run_sheet

    data = {
        **run.summary(),
        "fitted_to": fitted_to.name if fitted_to else None,
        "limits": [one.summary() for one in margins_of(run)],
        "stages": [{**asdict(stage), "duration": stage.duration} for stage in run.stages],
        "events": [event._asdict() for event in run.events],
    }
    return lambda: data, run_sheet(run, fitted_to)


def _numbers(text: str, option: str) -> dict[str, int]:
    """The `name=number` pairs of --estimate-damping."""
    pairs = options.read_params(text.split(","), option, "gears=3,couplings=2")
    return {name: whole_number(number, option, 0) for name, number in pairs.items()}


@click.command("fatigue")
@strategies_option
@options.fitted_to_option
@params_option
@click.option(
    "--slope", metavar="M", callback=options.quantity_callback("1"),
    help="Slope of the S-N curve, instead of limits.fatigue.slope. Default: 6.6, pitting of case-hardened "
    "gears.",
)  # fmt: skip
@click.option(
    "--worn-gap", metavar="GAP",
    help="Gap at the end of limits.life, for example '2 rad'; it grows in proportion to time, and damage "
    "accumulates. Of a chain: all gaps together at the motor shaft.",
)  # fmt: skip
@click.option(
    "--estimate-damping", metavar="gears=N,couplings=N", callback=reading(_numbers),
    help="For shafts without damping: a damping ratio of 1 % per pair of gears and 0.5 % per coupling, at "
    "most 6 %.",
)  # fmt: skip
@options.of_drive(options.read_machine)
@answers("Write the figure (SVG, PNG), cycles and turning points (CSV) and report.md into this folder.")
def fatigue_command(
    *, drive: Machine, controllers: list[str] | None, fitted_to: Drive | None, params: dict[str, str],
    **asked: Any,
) -> Answer:  # fmt: skip
    """Estimate the fatigue life of the shaft line under each strategy.

    DRIVE is a TOML file or the name of a shipped drive (see: softstart drives) or chain; by default the crane
    drive of the literature. Cycles are counted by the rainflow method. The tables [limits] and
    [limits.fatigue] of the file give the S-N curve, the starts per hour and the required life; without them
    lives are relative to that of direct. Every shaft needs damping; those of a chain are evaluated
    separately.
    """
    with working("starting the machine ..."), attributed():
        made = controllers_from_options(controllers, params)
        found = softstart.fatigue(
            [softstart.simulate(drive, one, fitted_to=fitted_to) for one in made], **asked
        )
    from softstart.views.fatigue import fatigue_sheet

    return found.summary, fatigue_sheet(found, found.ranked if controllers is None else found.rows, fitted_to)


@click.command("linear")
@options.controller_option(
    "--controller", "NAME", "A controller's name, or path/to/file.py:ClassName.", required=True
)
@options.param_option("Set a parameter of the controller, for example period='0.5 ms'. May be repeated.")
@options.of_drive(options.read_machine)
@answers("Write the Bode and Nyquist diagrams (SVG, PNG), the response (CSV) and report.md into this folder.")
def linear_command(*, drive: Machine, controller: str, params: dict[str, str]) -> Answer:
    """Linearise the control loop: stability margins, modes, limit cycles.

    DRIVE is a TOML file or the name of a shipped drive or chain (see: softstart drives); by default the crane
    drive of the literature. The controller's step function is linearised at an instant of its start at which
    all gaps are closed; the loop is broken at the torque demand. Limit cycles through the gap of a drive are
    predicted by the describing function.
    """
    with working("running and linearising the start ..."), attributed():
        (made,) = controllers_from_options([controller], params, several=False)
        view = softstart.linear_view(drive, made)
    from softstart.views.linear import linear_sheet

    return view.summary, linear_sheet(view)
