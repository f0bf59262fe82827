"""`softstart compare`, `simulate` and `fatigue`: strategies side by side, one start in detail, lives."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import click

import softstart
from softstart.cli.commands import Command
from softstart.cli.options import (
    DEFAULT_DRIVE,
    Mistakes,
    check_name,
    command_line,
    controller_names,
    controller_option,
    drive_argument,
    fitted_to_option,
    json_option,
    out_option,
    param_option,
    read_fitted_to,
    read_identified,
    read_machine,
    read_names,
    read_params,
    read_params_of,
    read_until,
    set_option,
    until_option,
)
from softstart.cli.running import Attributed, make_controllers, working
from softstart.drive import Drive
from softstart.errors import InputError
from softstart.late import late
from softstart.quantities import to_si, whole_number
from softstart.views.drives import drive_lines
from softstart.views.markdown import output_folder
from softstart.views.terminal import (
    console,
    fits,
    print_conclusion,
    print_figures,
    print_json,
    print_lines,
    print_table,
    sentence,
)

if TYPE_CHECKING:
    from rich.console import Console

    from softstart.chain import Chain
    from softstart.chain import fatigue as shaft_lives
    from softstart.controller.base import Controller
    from softstart.start import recommendation
    from softstart.start.comparison import Comparison
    from softstart.views import chains, starts
    from softstart.views import fatigue as lives
else:
    chains = late("softstart.views.chains")
    starts, lives = late("softstart.views.starts"), late("softstart.views.fatigue")
    shaft_lives = late("softstart.chain.fatigue")
    recommendation = late("softstart.start.recommendation")

SHOWN = 24  # rows of stages and events shown; files and JSON hold all


def several_strategies(command: Callable[..., Any]) -> Callable[..., Any]:
    """DRIVE, --controllers, --set, --fitted-to and --param."""
    names = "Controllers, with commas between. By default all installed ones that need no parameter."
    param = "Set a parameter of a controller, as ramp.time='0.2 s'. May be repeated."
    for option in (
        param_option("CONTROLLER.KEY=VALUE", param),
        fitted_to_option,
        set_option,
        controller_option("--controllers", "A,B,...", names),
        drive_argument(default=DEFAULT_DRIVE),
    ):
        command = option(command)
    return command


@click.command(cls=Command)
@several_strategies
@until_option
@click.option(
    "--worst-case",
    metavar="A,B,...",
    help="Changes under which the drive must keep its [limits] as well: gap x4, J2 x0.4, or none. By default "
    "both.",
)
@json_option
@out_option("Write figures (SVG, PNG), traces and table (CSV) and report.md into this folder.")
def compare(
    *,
    drive: str,
    controllers: str | None,
    settings: tuple[str, ...],
    fitted_to: str | None,
    params: tuple[str, ...],
    until: str | None,
    worst_case: str | None,
    as_json: bool,
    out: str | None,
) -> None:
    """Start a drive or a chain under several controllers and compare them.

    DRIVE is a TOML file or the name of a shipped drive (see: softstart drives) or chain (crane-4-mass,
    tractor-like), or the folder of an identification, whose figures have intervals; without it, the crane
    drive of the literature is taken. A controller is a name (see: softstart controllers),
    path/to/file.py:Class, or a file of tuned gains.
    """
    mistakes = Mistakes()
    names: Sequence[str] = controller_names()
    with mistakes.noted():
        one = read_identified(drive, settings) or read_machine(drive, settings)
    with mistakes.noted():
        names = read_names(controllers) or names
    with mistakes.noted():
        given = read_params_of(params, names)
    with mistakes.noted():
        nominal = read_fitted_to(fitted_to)
    with mistakes.noted():
        end = read_until(until)
    with mistakes.noted():
        cases = _cases(worst_case)
    mistakes.settle()

    with output_folder(out) as folder:
        with working("starting the drive ..."):
            made = make_controllers(names if controllers is not None else None, given, prefix=True)
            with Attributed():
                comparison = softstart.compare(one, made, until=end, fitted_to=nominal, worst_case=cases)
        if folder is not None:
            with working("drawing the figures ..."):
                starts.write_comparison(comparison, folder, command_line())

    if as_json:
        print_json(comparison.summary())
    else:
        _show_comparison(console(), comparison, by_peak=controllers is None)
        if out is not None:
            print(f"\nWritten to {out}: report.md, figures, traces and the table.")


def _cases(text: str | None) -> tuple[str, ...] | None:
    """The changes of a drive that count for its limits; None for all.

    >>> _cases("gap x4"), _cases("none")
    (('gap x4',), ())
    """
    if text is None:
        return None
    known = recommendation.CASES
    named = [" ".join(part.split()) for part in text.split(",") if part.strip()]
    wrong = [one for one in named if one not in (*known, "none")]
    if wrong or not named or ("none" in named and len(named) > 1):
        raise InputError(f'--worst-case = "{text}": write {", ".join(known)}, both with a comma, or none.')
    return tuple(case for case in known if case in named)


def _show_comparison(to: Console, comparison: Comparison, by_peak: bool) -> None:
    rows = list(comparison.rows)
    if by_peak:
        rows.sort(key=lambda row: row.run.k_dyn)
    best = [rows.index(row) for row in comparison.recommendation.shown]
    print_lines(to, starts.machine_lines(comparison.drive, comparison.fitted_to))
    to.print()
    gentle, quick, at_the_gap = starts.GENTLE, starts.QUICK, starts.details(comparison.drive)
    what = "What happens at the gap" if at_the_gap == starts.AT_THE_GAP else "What happens in the shafts"
    uncertain = starts.INTERVALS if rows[0].intervals else ()
    parts: list[tuple[str, tuple[starts.Figure, ...]]] = [("", (*gentle, *uncertain, *quick, *at_the_gap))]
    if not fits(to, starts.comparison_table(rows)):
        parts = [("How gentle, how quick", (*gentle, *quick)), (what, at_the_gap)]
        if not fits(to, starts.comparison_table(rows, parts[0][1])):
            parts[:1] = [("How gentle", gentle), ("How quick", quick)]
        if uncertain:
            parts.insert(1, ("Intervals of 95 %", uncertain))
    for index, (title, figures) in enumerate(parts):
        if index:
            to.print()
        print_table(to, starts.comparison_table(rows, figures, title), bold=best)
    print_conclusion(to, [comparison.recommendation.text], starts.notes(comparison))


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
    """Start a drive or a chain once under one controller.

    DRIVE is a TOML file or the name of a shipped drive (see: softstart drives) or chain (crane-4-mass,
    tractor-like).
    """
    mistakes = Mistakes()
    with mistakes.noted():
        one = read_machine(drive, settings)
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
        with working("starting the drive ..."):
            (made,) = make_controllers([controller], {controller: given}, prefix=False)
            with Attributed():
                run: Any = softstart.simulate(one, made, end, fitted_to=nominal)
                _ = run.settled_time  # it may ask the controller on
        if folder is not None:
            with working("drawing the figure ..."):
                starts.write_start(run, folder, command_line(), nominal)

    if as_json:
        named = nominal.name if nominal else None
        if isinstance(run.drive, Drive):
            stages = [{**asdict(stage), "duration": stage.duration} for stage in run.stages]
            more = {"stages": stages, "events": [asdict(event) for event in run.events]}
        else:
            more = {"events": [event._asdict() for event in run.events]}
        print_json({**run.summary(), "fitted_to": named, **more})
    else:
        _show_start(console(), run, nominal)
        if out is not None:
            print(f"\nWritten to {out}: report.md, figure, traces, stages and events.")


def _show_start(to: Console, run: Any, fitted_to: Drive | None) -> None:
    print_lines(to, starts.machine_lines(run.drive, fitted_to))
    values = ", ".join(f"{key} = {_value(value)}" for key, value in run.controller.parameters.items())
    sentence(to, f"  under  {run.controller_name}{' (' + values + ')' if values else ''}")
    to.print()
    sentence(to, run.status.value, "bold")
    if isinstance(run.drive, Drive):
        print_figures(to, starts.figure_rows(run))
        tables = [starts.stage_table(run, SHOWN), starts.event_table(run, SHOWN)]
    else:
        print_figures(to, chains.figure_rows(run))
        tables = [chains.shaft_table(run), chains.event_table(run, SHOWN)]
    for table in tables:
        to.print()
        print_table(to, table)
    if not isinstance(run.drive, Drive):
        print_conclusion(to, [], run.chain.warnings)


def _value(value: object) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)


@click.command(cls=Command)
@several_strategies
@click.option(
    "--slope",
    metavar="M",
    help="Slope of the S-N curve instead of limits.fatigue.slope. By default 6.6: pitting of hardened gears.",
)
@click.option(
    "--worn-gap",
    metavar="GAP",
    help="Gap at the end of limits.life, as '2 rad': it grows in proportion to time, and damage adds up.",
)
@click.option(
    "--estimate-damping",
    metavar="gears=N,couplings=N",
    help="For a drive without damping: a ratio of 1 % a pair of gears and 0.5 % a coupling, at most 6 %.",
)
@json_option
@out_option("Write the figure (SVG, PNG), cycles and turning points (CSV) and report.md into this folder.")
def fatigue(
    *,
    drive: str,
    controllers: str | None,
    settings: tuple[str, ...],
    fitted_to: str | None,
    params: tuple[str, ...],
    slope: str | None,
    worn_gap: str | None,
    estimate_damping: str | None,
    as_json: bool,
    out: str | None,
) -> None:
    """Find how long the shaft line lasts under each controller: rainflow cycles, life, impacts.

    DRIVE is a TOML file or the name of a shipped drive (see: softstart drives); without it, the crane drive
    of the literature is taken. Its tables [limits] and [limits.fatigue] give the S-N curve, the starts per
    hour and the life asked for; without them lives are compared with that of direct. A drive needs damping.
    Of a chain, whose shafts all need damping, each shaft is counted by itself.
    """
    mistakes = Mistakes()
    names: Sequence[str] = controller_names()
    with mistakes.noted():
        one = read_machine(drive, settings)
        if not isinstance(one, Drive) and (worn_gap or estimate_damping):
            option = "--worn-gap" if worn_gap else "--estimate-damping"
            raise InputError(
                f'{option}: "{drive}" is a chain, whose shafts have gaps and dampings of their own; leave it '
                "out, and give them with --set, as shaft[1].damping_ratio=0.02."
            )
    with mistakes.noted():
        names = read_names(controllers) or names
    with mistakes.noted():
        given = read_params_of(params, names)
    with mistakes.noted():
        nominal = read_fitted_to(fitted_to)
    with mistakes.noted():
        m = None if slope is None else float(to_si(slope, "1", name="--slope"))
    with mistakes.noted():
        estimate = None if estimate_damping is None else _read_numbers(estimate_damping)
    mistakes.settle()

    if not isinstance(one, Drive):
        asked = names if controllers is not None else None
        _fatigue_of_chain(one, lambda: make_controllers(asked, given, prefix=True), nominal, m, out, as_json)
        return
    with output_folder(out) as folder:
        with working("starting the drive ..."):
            made = make_controllers(names if controllers is not None else None, given, prefix=True)
            with Attributed():
                runs = [softstart.simulate(one, controller, fitted_to=nominal) for controller in made]
                found = softstart.fatigue(
                    runs, slope=m, worn_gap=worn_gap, estimate_damping=estimate, fitted_to=nominal
                )
        if folder is not None:
            with working("drawing the figure ..."):
                lives.write_fatigue(found, folder, command_line(), nominal)

    if as_json:
        print_json(found.summary())
        return
    to, rows = console(), list(found.rows)
    if controllers is None:
        rows.sort(key=lambda row: -row.relative)
    print_lines(to, drive_lines(found.drive, nominal))
    to.print()
    print_table(to, lives.fatigue_table(found, rows))
    print_conclusion(to, [lives.conclusion(found)], lives.notes(found))
    if out is not None:
        print(f"\nWritten to {out}: report.md, figure, cycles and turning points.")


def _fatigue_of_chain(
    chain: Chain, makes: Callable[[], Sequence[Controller]], nominal: Drive | None, slope: float | None,
    out: str | None, as_json: bool,
) -> None:  # fmt: skip
    """The same for each shaft of a chain."""
    with output_folder(out) as folder:
        with working("starting the chain ..."), Attributed():
            runs = [softstart.simulate_chain(chain, controller, fitted_to=nominal) for controller in makes()]
            found = shaft_lives.chain_fatigue(runs, slope=slope)
        if folder is not None:
            lives.write_chain_fatigue(found, folder, command_line())
    if as_json:
        print_json(found.summary())
        return
    to = console()
    print_lines(to, chains.chain_lines(chain))
    for table in lives.chain_tables(found):
        to.print()
        print_table(to, table)
    print_conclusion(to, [lives.chain_conclusion(found)], [*lives.chain_notes(found), *chain.warnings])
    if out is not None:
        print(f"\nWritten to {out}: report.md, fatigue.csv and turning points.")


def _read_numbers(text: str) -> dict[str, int]:
    """The `name=number` pairs of --estimate-damping.

    >>> _read_numbers("gears=3,couplings=2")
    {'gears': 3, 'couplings': 2}
    """
    pairs = [part.partition("=") for part in text.split(",")]
    if not all(name.strip() in {"gears", "couplings"} and number.strip() for name, _, number in pairs):
        raise InputError(f'--estimate-damping = "{text}": write gears=N,couplings=N, as gears=3,couplings=2.')
    return {name.strip(): whole_number(number.strip(), "--estimate-damping", 0) for name, _, number in pairs}
