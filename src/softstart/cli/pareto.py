"""`softstart pareto`: the least K_dyn against the start time, and the controllers beside it."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from pathlib import Path
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
    read_start_times,
    terminal_option,
    torque_speed_option,
)
from softstart.cli.options import (
    DEFAULT_DRIVE,
    Mistakes,
    as_option,
    command_line,
    controller_option,
    drive_argument,
    json_option,
    named_as_options,
    out_option,
    read_count,
    read_machine,
    read_names,
    scheduler_option,
    set_option,
)
from softstart.cli.running import Attributed, make_controllers, working
from softstart.drive import Drive
from softstart.errors import SimulationError
from softstart.late import late
from softstart.optimal.problem import TERMINALS, Problem, StartTime
from softstart.views.markdown import kept_state, output_folder
from softstart.views.terminal import console, print_conclusion, print_json, print_lines, print_tables

if TYPE_CHECKING:
    from rich.console import Console

    from softstart.optimal import shortest
    from softstart.optimal.chains import problem as chains
    from softstart.views import optima as views
    from softstart.views import starts
else:  # no numba for a help, a wrong option or the Tab key
    chains, views = late("softstart.optimal.chains.problem"), late("softstart.views.optima")
    starts, shortest = late("softstart.views.starts"), late("softstart.optimal.shortest")

STATE = "pareto.jsonl"


@click.command(cls=Command)
@drive_argument(default=DEFAULT_DRIVE)
@click.option(
    "--start-times",
    metavar="TIME,...",
    help="Bounds on the start time, as 0.25,0.3 (s) or from:to:count, as 0.25:0.5:12; also as multiples of "
    "that of direct, 1.02x:1.6x:12. By default 12 from the shortest feasible one on.",
)
@terminal_option("reached")
@method_option
@torque_speed_option
@controller_option(
    "--controllers", "A,B,...", "Controllers to show beside the curve. By default all that need no parameter."
)
@click.option("--workers", metavar="N", help="Optima computed at once. By default 1.")
@scheduler_option
@set_option
@json_option
@out_option(
    "Write figure (SVG, PNG), table (CSV) and report.md into this folder, and each finished point at once: "
    "an interrupted command goes on from there."
)
def pareto(
    *,
    drive: str,
    start_times: str | None,
    terminal: str | None,
    method: str | None,
    torque_speed: str | None,
    controllers: str | None,
    workers: str | None,
    scheduler: str | None,
    settings: tuple[str, ...],
    as_json: bool,
    out: str | None,
) -> None:
    """Find the least K_dyn for many start times, and show how near the controllers come to it.

    DRIVE is a TOML file or the name of a shipped drive (see: softstart drives); without it, the crane drive
    of the literature is taken; or that of a chain (crane-4-mass). Each controller is judged by the optimum at
    its own start time.
    """
    mistakes = Mistakes()
    one: Drive | Chain | None = None
    names: Sequence[str] | None = None
    asked: list[StartTime] | None = None
    bounds: dict[str, Any] = {"scheduler": scheduler}
    with mistakes.noted():
        one = read_machine(drive, settings)
    with mistakes.noted():
        names = read_names(controllers)
    if start_times is not None:
        with mistakes.noted():
            asked = read_start_times(start_times)
    for name, text, option, choices in (
        ("terminal", terminal or "reached", "--terminal", TERMINALS),
        ("method", method or "auto", "--method", METHODS),
    ):
        with mistakes.noted():
            bounds[name] = read_choice(text, option, choices)
    with mistakes.noted():
        bounds["torque_speed"] = read_corners(torque_speed)
    with mistakes.noted():
        bounds["workers"] = read_count(workers, "--workers") or 1
    if one is not None and not mistakes.sentences:
        with mistakes.noted(), named_as_options():
            about: Any = chains.ChainProblem if isinstance(one, Chain) else Problem
            about(one, 1.0, bounds["terminal"], torque_speed=bounds["torque_speed"])
    mistakes.settle()
    assert one is not None

    with (
        no_solution_reported(as_json),
        output_folder(out) as folder,
        kept_state(out, STATE, "finished points") as state,
    ):
        found = _computed(one, asked, names, bounds, state)
        if folder is not None and any(point.found for point in found.points):
            with working("drawing the figure ..."):
                views.write_front(found, folder, command_line())

    if as_json:
        print_json(found.summary())
    if not any(point.found for point in found.points):
        raise SimulationError(as_option(found.points[-1].status_text))
    if not as_json:
        _show(console(), found)
        if out is not None:
            print(f"\nWritten to {out}: report.md, the figure, the table and the finished points.")


def _computed(
    drive: Drive | Chain,
    asked: Sequence[StartTime] | None,
    names: Sequence[str] | None,
    bounds: dict[str, Any],
    state: Path | None,
) -> softstart.Front:
    with working("starting the drive ...") as progress:
        made = make_controllers(names, {}, prefix=True)

        times = None
        if asked is not None:
            direct = cache(lambda: shortest.start_time_of_direct(drive))
            times = [one.seconds(direct) for one in asked]
        with Attributed(), named_as_options():
            return softstart.pareto(
                drive, times, controllers=made, save_to=state, progress=progress, **bounds
            )


def _show(to: Console, found: softstart.Front) -> None:
    print_lines(to, starts.machine_lines(found.drive))
    print_tables(to, views.front_tables(found))
    print_conclusion(to, [views.front_conclusion(found)], views.footnotes(found))
