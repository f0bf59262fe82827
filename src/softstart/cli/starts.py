"""`softstart compare`, `simulate` and `fatigue`: strategies side by side, one start in detail, lives."""

from __future__ import annotations

import shlex
from dataclasses import asdict, replace
from typing import TYPE_CHECKING, Any

import click

import softstart
from softstart.chain.model import Chain
from softstart.cli.commands import Command, Reading, typed
from softstart.cli.options import (
    check_name,
    controller_names,
    controller_option,
    drive_argument,
    fitted_to_option,
    json_option,
    out_option,
    param_option,
    quantity,
    read_machine,
    read_machine_or_identified,
    set_option,
    until_option,
)
from softstart.cli.running import Attributed, answering, make_controllers, working
from softstart.drive import Drive
from softstart.errors import InputError
from softstart.late import late
from softstart.quantities import whole_number

if TYPE_CHECKING:
    from softstart.identification.result import Identification
    from softstart.start import recommendation
    from softstart.start.comparison import Comparison
    from softstart.views import fatigue as lives
    from softstart.views import starts
else:
    starts, lives = late("softstart.views.starts"), late("softstart.views.fatigue")
    recommendation = late("softstart.start.recommendation")

strategies_option = controller_option(
    "--controllers", "A,B,...",
    "Strategies, separated by commas. Default: all installed ones that need no parameter.",
)  # fmt: skip
params_option = param_option(
    "Set a parameter of a strategy, for example ramp.time='0.2 s'. May be repeated.", "controllers"
)


def _cases(text: str, option: str) -> tuple[str, ...]:
    """The changes of a drive that count for its limits.

    >>> _cases("gap x4", "--worst-case"), _cases("none", "--worst-case")
    (('gap x4',), ())
    """
    known = recommendation.CASES
    named = [" ".join(part.split()) for part in text.split(",") if part.strip()]
    wrong = [one for one in named if one not in (*known, "none")]
    if wrong or not named or ("none" in named and len(named) > 1):
        raise InputError(f'{option} = "{text}": write {", ".join(known)}, both with a comma, or none.')
    return tuple(case for case in known if case in named)


@click.command(cls=Command)
@drive_argument(read_machine_or_identified)
@strategies_option
@set_option
@fitted_to_option
@params_option
@until_option
@click.option(
    "--worst-case",
    metavar="A,B,...",
    type=Reading(_cases),
    help="Changes of the drive under which its [limits] are checked too: gap x4, J2 x0.4, or none. "
    "Default: both.",
)
@click.option("--details", is_flag=True, help="Also show times, events, and what each column means.")
@json_option
@out_option("Write figures (SVG, PNG), traces and table (CSV) and report.md into this folder.")
def compare(
    *,
    drive: Drive | Chain | Identification,
    controllers: list[str] | None,
    fitted_to: Drive | None,
    params: dict[str, dict[str, str]],
    until: float | None,
    worst_case: tuple[str, ...] | None,
    details: bool,
    as_json: bool,
    out: str | None,
) -> None:
    """Compare strategies on a drive or a chain.

    DRIVE is a TOML file, the name of a shipped drive (see: softstart drives) or chain (crane-4-mass,
    tractor-like), or the folder of an identification, which adds confidence intervals; by default the crane
    drive of the literature. A strategy is a name (see: softstart controllers), path/to/file.py:Class, or a
    file of tuned gains.
    """
    with answering(as_json, out) as answer:
        with working("starting the drive ..."):
            made = make_controllers(controllers, params, prefix=True)
            with Attributed():
                found = softstart.compare(
                    drive, made, until=until, fitted_to=fitted_to, worst_case=worst_case
                )
        rows = sorted(found.rows, key=lambda row: row.run.k_dyn) if controllers is None else list(found.rows)
        sheet = starts.comparison_sheet(found, rows, details or out is not None)
        answer(found.summary, replace(sheet, commands=_next_steps(found)))


def _next_steps(comparison: Comparison) -> list[tuple[str, str]]:
    """Commands for the same machine that lead on, each with what it gives."""
    from softstart.tuning.ranges import tunable

    machine = [typed("drive"), *(word for one in typed("settings") for word in ("--set", one))]
    chosen = comparison.recommendation
    best = chosen.recommended or (chosen.best[-1] if chosen.best else None)
    steps: list[tuple[str, list[str], str]] = []
    if not (chosen.recommended or comparison.rows[0].intervals):
        known = len(comparison.drive.positions) == 1
        steps.append(("optimize", [], "the lowest possible K_dyn" if known else "the best fixed profile"))
    if best is not None and best.name in controller_names() and tunable(best.run.controller):
        steps.append(("tune", ["--controller", best.name], "gains for other gaps and loads"))
    steps.append(("report", ["--out", "report.html"], "all results in one file"))
    return [(shlex.join(["softstart", name, *machine, *options]), gives) for name, options, gives in steps]


@click.command(cls=Command)
@drive_argument(read_machine, needed=True)
@controller_option(
    "--controller",
    "NAME",
    "A strategy: its name, path/to/file.py:ClassName, or a file of tuned gains (.toml, .csv).",
    required=True,
    read=lambda name, option: check_name(
        name, option, "several are compared: softstart compare --controllers "
    ),
)
@param_option("Set a parameter of the strategy, for example time='200 ms'. May be repeated.")
@set_option
@fitted_to_option
@until_option
@json_option
@out_option("Write the figure (SVG, PNG), traces, stages and events (CSV) and report.md into this folder.")
def simulate(
    *,
    drive: Drive | Chain,
    controller: str,
    params: dict[str, str],
    fitted_to: Drive | None,
    until: float | None,
    as_json: bool,
    out: str | None,
) -> None:
    """Simulate one start of a drive or a chain.

    DRIVE is a TOML file or the name of a shipped drive (see: softstart drives) or chain (crane-4-mass,
    tractor-like).
    """
    with answering(as_json, out) as answer:
        with working("starting the drive ..."):
            (made,) = make_controllers([controller], {controller: params}, prefix=False)
            with Attributed():
                run: Any = softstart.simulate(drive, made, until, fitted_to=fitted_to)
                _ = run.settled_time  # it may ask the controller on
        answer(lambda: _start_data(run, fitted_to), starts.run_sheet(run, fitted_to))


def _start_data(run: Any, fitted_to: Drive | None) -> dict[str, Any]:
    return {
        **run.summary(),
        "fitted_to": fitted_to.name if fitted_to else None,
        "stages": [{**asdict(stage), "duration": stage.duration} for stage in run.stages],
        "events": [event._asdict() for event in run.events],
    }


def _gears_and_couplings(text: str, option: str) -> dict[str, int]:
    """The `name=number` pairs of --estimate-damping.

    >>> _gears_and_couplings("gears=3,couplings=2", "--estimate-damping")
    {'gears': 3, 'couplings': 2}
    """
    pairs = [part.partition("=") for part in text.split(",")]
    if not all(name.strip() in {"gears", "couplings"} and number.strip() for name, _, number in pairs):
        raise InputError(f'{option} = "{text}": write gears=N,couplings=N, as gears=3,couplings=2.')
    return {name.strip(): whole_number(number.strip(), option, 0) for name, _, number in pairs}


@click.command(cls=Command)
@drive_argument(read_machine)
@strategies_option
@set_option
@fitted_to_option
@params_option
@click.option(
    "--slope",
    metavar="M",
    type=quantity("1"),
    help="Slope of the S-N curve, instead of limits.fatigue.slope. Default: 6.6, pitting of case-hardened "
    "gears.",
)
@click.option(
    "--worn-gap",
    metavar="GAP",
    help="Gap at the end of limits.life, for example '2 rad'; it grows in proportion to time, and damage "
    "accumulates. Of a chain: all gaps together at the motor shaft.",
)
@click.option(
    "--estimate-damping",
    metavar="gears=N,couplings=N",
    type=Reading(_gears_and_couplings),
    help="For shafts without damping: a damping ratio of 1 % per pair of gears and 0.5 % per coupling, at "
    "most 6 %.",
)
@json_option
@out_option("Write the figure (SVG, PNG), cycles and turning points (CSV) and report.md into this folder.")
def fatigue(
    *,
    drive: Drive | Chain,
    controllers: list[str] | None,
    fitted_to: Drive | None,
    params: dict[str, dict[str, str]],
    slope: float | None,
    worn_gap: str | None,
    estimate_damping: dict[str, int] | None,
    as_json: bool,
    out: str | None,
) -> None:
    """Estimate the fatigue life of the shaft line under each strategy.

    DRIVE is a TOML file or the name of a shipped drive (see: softstart drives) or chain; by default the crane
    drive of the literature. Cycles are counted by the rainflow method. The tables [limits] and
    [limits.fatigue] of the file give the S-N curve, the starts per hour and the required life; without them
    lives are relative to that of direct. Every shaft needs damping; those of a chain are evaluated
    separately.
    """
    with answering(as_json, out) as answer:
        with working("starting the machine ..."):
            made = make_controllers(controllers, params, prefix=True)
            with Attributed():
                runs = [softstart.simulate(drive, controller, fitted_to=fitted_to) for controller in made]
                found = softstart.fatigue(
                    runs, slope=slope, worn_gap=worn_gap, estimate_damping=estimate_damping
                )
        rows = found.ranked if controllers is None else found.rows
        answer(found.summary, lives.fatigue_sheet(found, rows, fitted_to))
