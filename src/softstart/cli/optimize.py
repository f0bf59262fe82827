"""`softstart optimize`: the gentlest start within a given time, and how much better any start could be."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from typing import TYPE_CHECKING, Any

import click

import softstart
from softstart.chain.model import Chain
from softstart.cli.commands import Command, Reading, typed
from softstart.cli.optimal_options import (
    no_solution_reported,
    quantities,
    smoothness_option,
    terminal_option,
    torque_speed_option,
)
from softstart.cli.options import (
    choice,
    drive_argument,
    json_option,
    named_as_options,
    out_option,
    quantity,
    read_machine,
    set_option,
)
from softstart.cli.running import Attributed, answering, working
from softstart.drive import Drive
from softstart.errors import InputError, SimulationError
from softstart.late import late
from softstart.optimal.problem import OBJECTIVES, StartTime

if TYPE_CHECKING:
    from softstart import controller
    from softstart.optimal.result import Optimum
    from softstart.start.run import Run
    from softstart.views import optima as views
else:  # no numba for a help, a wrong option or the Tab key
    controller, views = late("softstart.controller"), late("softstart.views.optima")


@click.command(cls=Command)
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
@terminal_option("synchronous for one drive at one position, else reached")
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
    "--confirm",
    is_flag=True,
    help="Also solve the CasADi problem from its own initial guess, and show both results.",
)
@click.option(
    "--gaps", metavar="GAP,...", type=quantities("rad"),
    help="Compute one profile for the drive with each of these gaps.",
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
    *,
    drive: Drive | Chain,
    gaps: Sequence[float] | None,
    inertias: Sequence[float] | None,
    load_torques: Sequence[float] | None,
    as_json: bool,
    out: str | None,
    **given: Any,
) -> None:
    """Compute the torque profile with the lowest K_dyn for a start time, and a lower bound.

    DRIVE is a TOML file or the name of a shipped drive (see: softstart drives) or chain (crane-4-mass); by
    default the crane drive of the literature. With --gaps, --inertias or --load-torques, one profile is
    computed for all combinations. For a chain, the largest torque of all its shafts is minimised.
    """
    bounds = {name: value for name, value in given.items() if value is not None}
    bounds["start_time"] = typed("start_time")
    varied = {"gaps": gaps or (), "inertias": inertias or (), "load_torques": load_torques or ()}
    with no_solution_reported(as_json), answering(as_json, out) as answer:
        with working("looking for the gentlest start ..."), named_as_options():
            others = softstart.scenarios_of(drive, **varied)[1:]
            best = softstart.optimize(drive, scenarios=others, **bounds)
        with working("starting the drive under the shipped controllers ..."):
            beside = [] if others else runs_beside(best)
        answer(
            lambda: {**best.summary(), "controllers": [views.controller_summary(run) for run in beside]},
            views.optimum_sheet(best, beside),
        )


def runs_beside(best: Optimum) -> list[Run]:
    """The same drive under every controller that runs without being given a parameter, and does not fail."""
    drive, base = best.problem.drive, best.problem.base
    runs = []
    for name in controller.ready_controller_names():
        with suppress(InputError, SimulationError), Attributed(name):
            runs.append(softstart.simulate(drive, name, base=base))
    return runs
