"""`softstart optimize`: the gentlest start within a given time, and how much better any start could be.

With --gaps, --inertias or --load-torques: one profile for several drives, and what a contact sensor is worth.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from typing import TYPE_CHECKING, Any

import click

import softstart
from softstart.chain.model import Chain
from softstart.cli.commands import Command
from softstart.cli.optimal_options import (
    METHODS,
    method_option,
    no_solution_reported,
    read_choice,
    read_corners,
    read_positive,
    read_quantities,
    smoothness_option,
    terminal_option,
    torque_speed_option,
)
from softstart.cli.options import (
    DEFAULT_DRIVE,
    Mistakes,
    as_option,
    command_line,
    drive_argument,
    json_option,
    named_as_options,
    out_option,
    read_machine,
    read_names,
    set_option,
)
from softstart.cli.running import Attributed, working
from softstart.drive import Drive
from softstart.errors import InputError, SimulationError
from softstart.late import late
from softstart.optimal.problem import OBJECTIVES, TERMINALS, USUAL, Problem, StartTime, usual_terminal
from softstart.quantities import to_si
from softstart.views.markdown import output_folder
from softstart.views.terminal import (
    console,
    print_conclusion,
    print_figures,
    print_json,
    print_lines,
    print_table,
    sentence,
)

if TYPE_CHECKING:
    from rich.console import Console

    from softstart import controller
    from softstart.optimal import robust, shortest, solving
    from softstart.optimal.chains import problem as chains
    from softstart.optimal.chains import solving as chain_search
    from softstart.optimal.result import Optimum, SensorWorth
    from softstart.start.run import Run
    from softstart.views import optima as views
    from softstart.views import starts
else:  # no numba for a help, a wrong option or the Tab key
    controller, robust = late("softstart.controller"), late("softstart.optimal.robust")
    shortest, views = late("softstart.optimal.shortest"), late("softstart.views.optima")
    solving, starts = late("softstart.optimal.solving"), late("softstart.views.starts")
    chains = late("softstart.optimal.chains.problem")
    chain_search = late("softstart.optimal.chains.solving")


SEARCH = ("method", "tolerance", "time_limit", "confirm", "limits", "seeds")  # how, not what


@click.command(cls=Command)
@drive_argument(default=DEFAULT_DRIVE)
@click.option(
    "--start-time",
    metavar="TIME",
    help="Longest start time, as 0.3 (s), '300 ms', or 1.2x that of direct. By default 1.2x.",
)
@click.option(
    "--limits", is_flag=True, help="Find the least start time that keeps the [limits] of the drive instead."
)
@terminal_option("synchronous")
@method_option
@click.option("--minimise", metavar="|".join(OBJECTIVES), help="By default k_dyn.")
@click.option("--max-k-dyn", metavar="NUMBER", help="Largest K_dyn allowed, if another figure is minimised.")
@click.option("--max-heat", metavar="TIME", help="Largest I2t heat allowed, in s of starting torque.")
@torque_speed_option
@smoothness_option
@click.option(
    "--tolerance", metavar="SHARE", help="Gap to the lower bound at which the search ends. By default 0.5 %."
)
@click.option(
    "--time-limit", metavar="TIME", help="No further search after this, as 20 (s); 0: the first answer."
)
@click.option(
    "--confirm", is_flag=True, help="Solve the CasADi problem too, from its own guess, and show both."
)
@click.option(
    "--seeds",
    metavar="A,B,...",
    help="Of a chain: strategies whose torque the search starts from; cma (cma2, cma3 ...) for a global "
    "search (package cma). By default all strategies that need no parameter.",
)
@click.option(
    "--gaps", metavar="GAP,...", help="One profile for these gaps, with a contact sensor and without."
)
@click.option("--inertias", metavar="INERTIA,...", help="... for these load inertias.")
@click.option("--load-torques", metavar="TORQUE,...", help="... for these load torques.")
@set_option
@json_option
@out_option("Write profile (CSV, TOML, C), figure (SVG, PNG), traces (CSV) and report.md into this folder.")
def optimize(
    *,
    drive: str,
    start_time: str | None,
    gaps: str | None,
    inertias: str | None,
    load_torques: str | None,
    settings: tuple[str, ...],
    confirm: bool,
    limits: bool,
    seeds: str | None,
    as_json: bool,
    out: str | None,
    **texts: str | None,
) -> None:
    """Find the torque profile with the least K_dyn for a start time, and prove how good it is.

    DRIVE is a TOML file or the name of a shipped drive (see: softstart drives); without it, the crane drive
    of the literature is taken. With --gaps, --inertias or --load-torques, one profile serves all of them.
    Of a chain (crane-4-mass) the largest torque of all its shafts is minimised.
    """
    mistakes = Mistakes()
    one: Drive | Chain | None = None
    asked: StartTime | None = None
    varied: dict[str, list[float]] = {}
    with mistakes.noted():
        one = read_machine(drive, settings)
    if start_time is not None:
        with mistakes.noted():
            asked = StartTime.of(start_time, "--start-time")
    flags = {"confirm": confirm, "limits": limits}
    bounds = bounds_of(texts, mistakes) | {name: True for name, given in flags.items() if given}
    lists = (("gaps", gaps, "rad"), ("inertias", inertias, "kg*m^2"), ("load_torques", load_torques, "N*m"))
    for name, text, unit in lists:
        with mistakes.noted():
            varied[name] = read_quantities(text, f"--{name.replace('_', '-')}", unit)
    if seeds is not None:
        with mistakes.noted():
            bounds["seeds"] = _read_seeds(seeds)
    several = any(text is not None for _, text, _ in lists)
    if several:
        mistakes.sentences += not_for_several(bounds)
    if isinstance(one, Chain):
        with mistakes.noted(), named_as_options():
            _check_chain(one, several, bounds)
    elif one is not None and not mistakes.sentences:
        with mistakes.noted(), named_as_options():
            Problem(
                one,
                None if bounds.get("minimise") == "start_time" and asked is None else 1.0,  # any above 0
                **{
                    "terminal": usual_terminal(one),
                    **{name: value for name, value in bounds.items() if name not in SEARCH},
                },
            )
    mistakes.settle()
    assert one is not None
    if several and isinstance(one, Drive):
        _optimize_for_all(one, asked or USUAL, varied, as_json, out)
    else:
        _optimize_one(one, start_time, bounds, as_json, out)


def _read_seeds(text: str) -> list[str]:
    """Names of controllers, and cma for the global search, which is none."""
    names = [name.strip() for name in text.split(",")]
    controllers = ",".join(name for name in names if not chain_search.is_global(name))
    globally = [name for name in names if chain_search.is_global(name)]
    return [*(read_names(controllers or None, "--seeds") or ()), *globally]


def _check_chain(chain: Chain, several: bool, bounds: Mapping[str, Any]) -> None:
    """What an optimum of a chain does not take."""
    if several:
        raise InputError(
            "--gaps, --inertias and --load-torques are for drives: on a chain one profile for several is not "
            "found; leave them out, or reduce the chain to a drive."
        )
    given = {"method": "auto", "confirm": False, "limits": False, **bounds}
    solving.refuse_for_chain(given["method"], given["confirm"], given["limits"])
    chains.ChainProblem(chain, 1.0, **{name: value for name, value in bounds.items() if name not in SEARCH})


def bounds_of(texts: Mapping[str, str | None], mistakes: Mistakes) -> dict[str, Any]:
    """The options that were given, read, under the names of the keywords of `softstart.optimize`."""
    readers: dict[str, tuple[str, Callable[[str], Any]]] = {
        "terminal": ("terminal", lambda text: read_choice(text, "--terminal", TERMINALS)),
        "method": ("method", lambda text: read_choice(text, "--method", METHODS)),
        "minimise": ("minimise", lambda text: read_choice(text, "--minimise", OBJECTIVES)),
        "max_k_dyn": ("k_dyn", lambda text: read_positive(text, "--max-k-dyn", "1", "a number above 0")),
        "max_heat": ("heat", lambda text: read_positive(text, "--max-heat", "s", "a time above 0 s")),
        "torque_speed": ("torque_speed", read_corners),
        "smoothness": ("smoothness", _weight),
        "tolerance": ("tolerance", lambda text: _from_zero(text, "--tolerance", "1", "a share, as 0.5 %")),
        "time_limit": ("time_limit", lambda text: _from_zero(text, "--time-limit", "s", "a time in s")),
    }
    found: dict[str, Any] = {}
    for name, text in texts.items():
        if text is not None:
            key, read = readers[name]
            with mistakes.noted():
                found[key] = read(text)
    return found


def not_for_several(bounds: Mapping[str, Any]) -> list[str]:
    """What cannot be asked of one profile for several drives."""
    fixed = {"terminal": "reached", "method": "auto", "minimise": "k_dyn"}
    return [
        as_option(f"{name}: one profile for several drives is judged by its largest K_dyn, with terminal ")
        + "reached; leave this option out."
        for name, value in bounds.items()
        if fixed.get(name) != value
    ]


def _weight(text: str) -> float:
    return _from_zero(text, "--smoothness", "s", "a weight in s")


def _from_zero(text: str, option: str, unit: str, what: str) -> float:
    value = float(to_si(text, unit, name=option))
    if not value >= 0.0:
        raise InputError(f'{option} = "{text}": {what}, 0 or more.')
    return value


def _optimize_one(
    drive: Drive | Chain, start_time: str | None, bounds: dict[str, Any], as_json: bool, out: str | None
) -> None:
    with no_solution_reported(as_json), output_folder(out) as folder:
        with working("looking for the gentlest start ..."), named_as_options():
            best = softstart.optimize(drive, start_time, **bounds)
        with working("starting the drive under the shipped controllers ..."):
            others = runs_beside(best)
        if folder is not None:
            with working("drawing the figure ..."):
                views.write_optimum(best, others, folder, command_line())

    if as_json:
        print_json({**best.summary(), "controllers": [views.controller_summary(run) for run in others]})
    else:
        _show(console(), best, others)
        if out is not None:
            print(f"\nWritten to {out}: report.md, the profile (CSV, TOML, C), figure and traces.")


def runs_beside(best: Optimum) -> list[Run]:
    """The same drive under every controller that runs without being given a parameter, and does not fail."""
    drive, base = best.problem.drive, best.problem.base
    runs = []
    for name in controller.ready_controller_names():
        with suppress(InputError, SimulationError), Attributed(name):
            runs.append(softstart.simulate(drive, name, base=base))
    return runs


def _show(to: Console, best: Optimum, others: Sequence[Run]) -> None:
    print_lines(to, starts.machine_lines(best.problem.drive))
    sentence(to, f"  asked  {views.question(best)}")
    sentence(to, f"  method {best.method}: {best.why}")
    to.print()
    print_figures(to, views.figure_rows(best))
    notes = [*views.position_sentences(best), views.bound_sentence(best)]
    print_conclusion(to, [views.comparison(best, others)], notes)


# one profile for several drives ---------------------------------------------------------------------------


def _optimize_for_all(
    drive: Drive, asked: StartTime, varied: Mapping[str, Sequence[float]], as_json: bool, out: str | None
) -> None:
    """One profile for all combinations of the values given, blind and with a contact sensor."""
    with no_solution_reported(as_json), output_folder(out) as folder:
        with working("looking for the gentlest start of all drives ...") as progress, named_as_options():
            scenarios = robust.scenarios_of(drive, **varied)
            seconds = asked.seconds(lambda: shortest.start_time_of_direct(drive))
            worth = robust.worth_of_contact_sensor(scenarios, seconds, progress=progress)
        if folder is not None:
            with working("drawing the figure ..."):
                views.write_worth(worth, folder, command_line())

    if as_json:
        print_json(worth.summary())
    else:
        _show_worth(console(), worth)
        if out is not None:
            print(f"\nWritten to {out}: report.md, both profiles, the figure and traces.")


def _show_worth(to: Console, worth: SensorWorth) -> None:
    blind = worth.blind
    print_lines(to, starts.machine_lines(blind.base))
    sentence(to, f"  asked  {views.robust_question(blind)}")
    to.print()
    print_table(to, views.scenario_table(worth), bold=[blind.worst])
    notes = [views.robust_bound_sentence(blind), "K_dyn refers to the mean shaft torque of the first drive."]
    print_conclusion(to, [views.worth_conclusion(worth)], notes)
