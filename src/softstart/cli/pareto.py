"""`softstart pareto`: the least K_dyn against the start time, and the controllers beside it."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

import softstart
from softstart.chain.model import Chain
from softstart.cli.commands import Command, Reading
from softstart.cli.optimal_options import (
    no_solution_reported,
    read_start_times,
    terminal_option,
    torque_speed_option,
)
from softstart.cli.options import (
    as_option,
    controller_option,
    count,
    drive_argument,
    json_option,
    named_as_options,
    out_option,
    read_machine,
    scheduler_option,
    set_option,
)
from softstart.cli.running import Attributed, answering, make_controllers, working
from softstart.drive import Drive
from softstart.errors import SimulationError
from softstart.late import late
from softstart.optimal.problem import StartTime
from softstart.views.markdown import kept_state
from softstart.views.terminal import print_json

if TYPE_CHECKING:
    from softstart.optimal import optimize as optima
    from softstart.views import optima as views
else:  # no numba for a help, a wrong option or the Tab key
    views = late("softstart.views.optima")
    optima = late("softstart.optimal.optimize")

STATE = "pareto.sqlite"


@click.command(cls=Command)
@drive_argument(read_machine)
@click.option(
    "--start-times",
    metavar="TIME,...",
    type=Reading(read_start_times),
    help="Bounds of the start time: 0.25,0.3 (s), a range from:to:count such as 0.25:0.5:12, or multiples "
    "of that of direct, 1.02x:1.6x:12. Default: 12 bounds from the shortest feasible one on.",
)
@terminal_option("reached", "reached")
@torque_speed_option
@controller_option(
    "--controllers", "A,B,...", "Controllers to compare with the curve. Default: all that need no parameter."
)
@click.option(
    "--workers",
    metavar="N",
    type=count(),
    default="1",
    help="Number of optima computed in parallel. Default: 1.",
)
@scheduler_option
@set_option
@json_option
@out_option(
    "Write figure (SVG, PNG), table (CSV) and report.md into this folder. Finished points are saved at "
    "once, so that an interrupted command resumes."
)
def pareto(
    *,
    drive: Drive | Chain,
    start_times: list[StartTime] | None,
    controllers: list[str] | None,
    as_json: bool,
    out: str | None,
    **bounds: Any,
) -> None:
    """Compute the lowest K_dyn over the start time, and compare the controllers with it.

    DRIVE is a TOML file or the name of a shipped drive (see: softstart drives) or chain (crane-4-mass); by
    default the crane drive of the literature. Each controller is compared with the optimum at its own start
    time.
    """
    with (
        no_solution_reported(as_json),
        kept_state(out, STATE, "finished points") as state,
        answering(as_json, out) as answer,
    ):
        found = _computed(drive, start_times, controllers, bounds, state)
        if not any(point.found for point in found.points):
            if as_json:
                print_json(found.summary())
            raise SimulationError(as_option(found.points[-1].status_text))
        answer(found.summary, views.front_sheet(found))


def _computed(
    drive: Drive | Chain,
    asked: Sequence[StartTime] | None,
    names: Sequence[str] | None,
    bounds: dict[str, Any],
    state: Path | None,
) -> softstart.Front:
    given = {name: value for name, value in bounds.items() if value is not None}
    with working("starting the drive ...") as progress:
        made = make_controllers(names, {}, prefix=True)
        times = None
        if asked is not None:
            direct = cache(lambda: optima.start_time_of_direct(drive))
            times = [one.seconds(direct) for one in asked]
        with Attributed(), named_as_options():
            return softstart.pareto(drive, times, controllers=made, save_to=state, progress=progress, **given)
