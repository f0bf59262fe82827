"""`softstart optimize`: the gentlest start within a given time, and how much better any start could be.

With --gaps, --inertias or --load-torques: one profile for several drives, and what a contact sensor is worth.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import TYPE_CHECKING, Any

import click

import softstart
from softstart.chain.model import Chain
from softstart.cli.commands import Command, Reading, all_read, typed
from softstart.cli.optimal_options import (
    method_option,
    no_solution_reported,
    quantities,
    smoothness_option,
    terminal_option,
    torque_speed_option,
)
from softstart.cli.options import (
    as_option,
    choice,
    command_line,
    drive_argument,
    json_option,
    named_as_options,
    out_option,
    quantity,
    read_machine,
    read_names,
    set_option,
)
from softstart.cli.running import Attributed, working
from softstart.drive import Drive
from softstart.errors import InputError, SimulationError
from softstart.late import late
from softstart.optimal.problem import OBJECTIVES, USUAL, StartTime, problem_of
from softstart.views.markdown import output_folder
from softstart.views.terminal import (
    present,
    print_conclusion,
    print_figures,
    print_lines,
    print_table,
    sentence,
)

if TYPE_CHECKING:
    from rich.console import Console

    from softstart import controller
    from softstart.optimal import robust, shortest
    from softstart.optimal.chains import solving as chain_search
    from softstart.optimal.result import Optimum, SensorWorth
    from softstart.start.run import Run
    from softstart.views import optima as views
    from softstart.views import starts
else:  # no numba for a help, a wrong option or the Tab key
    controller, robust = late("softstart.controller"), late("softstart.optimal.robust")
    shortest, views = late("softstart.optimal.shortest"), late("softstart.views.optima")
    starts = late("softstart.views.starts")
    chain_search = late("softstart.optimal.chains.solving")


SEARCH = ("tolerance", "time_limit", "confirm", "seeds")  # how, not what
SEVERAL = ("gaps", "inertias", "load_torques")


def _read_seeds(text: str, option: str) -> list[str]:
    """Names of controllers, and cma for the global search, which is none."""
    names = [name.strip() for name in text.split(",")]
    controllers = ",".join(name for name in names if not chain_search.is_global(name))
    globally = [name for name in names if chain_search.is_global(name)]
    return [*(read_names(controllers, option) if controllers else ()), *globally]


def _bounds(given: Mapping[str, Any]) -> dict[str, Any]:
    """The keywords of `softstart.optimize` that were given, but for the start time."""
    others = ("drive", "start_time", "as_json", "out", *SEVERAL)
    return {
        name: value
        for name, value in given.items()
        if name not in others and value is not None and value is not False
    }


def _check_bounds(given: Mapping[str, Any]) -> None:
    """What an optimum of this drive or chain, or of several drives, does not take."""
    one, bounds = given["drive"], _bounds(given)
    if any(given[name] is not None for name in SEVERAL):
        if refused := not_for_several(bounds):
            raise InputError(refused)
    elif all_read(given):
        free = bounds.get("minimise") == "start_time" and given["start_time"] is None
        bounds = {name: value for name, value in bounds.items() if name not in SEARCH}
        with named_as_options():
            problem_of(one, None if free else 1.0, **bounds)  # any above 0


def not_for_several(bounds: Mapping[str, Any]) -> list[str]:
    """What cannot be asked of one profile for several drives."""
    fixed = {"terminal": "reached", "method": "auto", "minimise": "k_dyn"}
    return [
        as_option(f"{name}: one profile for several drives is judged by its largest K_dyn, with terminal ")
        + "reached; leave this option out."
        for name, value in bounds.items()
        if fixed.get(name) != value
    ]


@click.command(cls=Command, checks=[_check_bounds])
@drive_argument(read_machine)
@click.option(
    "--start-time",
    metavar="TIME",
    type=Reading(StartTime.of),
    help="Upper bound of the start time: 0.3 (s), '300 ms', or 1.2x that of direct. Default: 1.2x.",
)
@click.option(
    "--limits",
    is_flag=True,
    help="Find the shortest start time that meets the [limits] of the drive instead.",
)
@terminal_option("synchronous")
@method_option
@click.option(
    "--minimise", metavar="|".join(OBJECTIVES), type=choice(*OBJECTIVES), help="Objective. Default: k_dyn."
)
@click.option(
    "--max-k-dyn", "k_dyn", metavar="NUMBER", type=quantity("1", "give a number above 0", above=0.0),
    help="Upper bound of K_dyn if another objective is minimised.",
)  # fmt: skip
@click.option(
    "--max-heat", "heat", metavar="TIME", type=quantity("s", "give a time above 0 s", above=0.0),
    help="Upper bound of the I2t heat, in s of starting torque.",
)  # fmt: skip
@torque_speed_option
@smoothness_option
@click.option(
    "--tolerance", metavar="SHARE", type=quantity("1", "a share, as 0.5 %, 0 or more", least=0.0),
    help="Relative gap to the lower bound at which the search ends. Default: 0.5 %.",
)  # fmt: skip
@click.option(
    "--time-limit", metavar="TIME", type=quantity("s", "a time in s, 0 or more", least=0.0),
    help="Time after which no further search starts, for example 20 (s); 0: return the first solution.",
)  # fmt: skip
@click.option(
    "--confirm",
    is_flag=True,
    help="Also solve the CasADi problem from its own initial guess, and show both results.",
)
@click.option(
    "--seeds",
    metavar="A,B,...",
    type=Reading(_read_seeds),
    help="For a chain: strategies whose torque initialises the search; cma (cma2, cma3 ...) for a global "
    "search (package cma). Default: all strategies that need no parameter.",
)
@click.option(
    "--gaps", metavar="GAP,...", type=quantities("rad"),
    help="Compute one profile for these gaps, with and without a contact sensor.",
)  # fmt: skip
@click.option(
    "--inertias", metavar="INERTIA,...", type=quantities("kg*m^2"), help="Likewise for these load inertias."
)
@click.option(
    "--load-torques", metavar="TORQUE,...", type=quantities("N*m"), help="Likewise for these load torques."
)
@set_option
@json_option
@out_option("Write profile (CSV, TOML, C), figure (SVG, PNG), traces (CSV) and report.md into this folder.")
def optimize(
    *, drive: Drive | Chain, start_time: StartTime | None, as_json: bool, out: str | None, **given: Any
) -> None:
    """Compute the torque profile with the lowest K_dyn for a start time, and a lower bound.

    DRIVE is a TOML file or the name of a shipped drive (see: softstart drives) or chain (crane-4-mass); by
    default the crane drive of the literature. With --gaps, --inertias or --load-torques, one profile is
    computed for all combinations. For a chain, the largest torque of all its shafts is minimised.
    """
    varied = {name: given[name] or [] for name in SEVERAL}
    if any(given[name] is not None for name in SEVERAL):
        _optimize_for_all(drive, start_time or USUAL, varied, as_json, out)
    else:
        _optimize_one(drive, typed("start_time"), _bounds(given), as_json, out)


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

    present(
        lambda: {**best.summary(), "controllers": [views.controller_summary(run) for run in others]},
        lambda to: _show(to, best, others),
        as_json,
        out and f"{out}: report.md, the profile (CSV, TOML, C), figure and traces",
    )


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
    drive: Any, asked: StartTime, varied: Mapping[str, Sequence[float]], as_json: bool, out: str | None
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

    present(
        worth.summary,
        lambda to: _show_worth(to, worth),
        as_json,
        out and f"{out}: report.md, both profiles, the figure and traces",
    )


def _show_worth(to: Console, worth: SensorWorth) -> None:
    blind = worth.blind
    print_lines(to, starts.machine_lines(blind.base))
    sentence(to, f"  asked  {views.robust_question(blind)}")
    to.print()
    print_table(to, views.scenario_table(worth), bold=[blind.worst])
    notes = [views.robust_bound_sentence(blind), "K_dyn refers to the mean shaft torque of the first drive."]
    print_conclusion(to, [views.worth_conclusion(worth)], notes)
