"""`softstart pareto`: the least K_dyn against the start time, and the controllers beside it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from softstart.cli.commands import Command
from softstart.cli.optimal_options import (
    METHODS,
    Asked,
    as_option,
    method_option,
    named_as_options,
    no_solution_told,
    read_choice,
    read_corners,
    read_start_times,
    terminal_option,
    torque_speed_option,
)
from softstart.cli.options import (
    DEFAULT_DRIVE,
    Mistakes,
    command_line,
    controller_option,
    drive_argument,
    json_option,
    out_option,
    read_drive,
    read_names,
    set_option,
)
from softstart.errors import SimulationError
from softstart.optimal.shortest import start_time_of_direct
from softstart.views.markdown import kept_state, output_folder

if TYPE_CHECKING:
    from rich.console import Console

    from softstart.controller import Controller
    from softstart.drive import Drive
    from softstart.optimal.front import ControllerPoint, Front

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
    settings: tuple[str, ...],
    as_json: bool,
    out: str | None,
) -> None:
    """Find the least K_dyn for many start times, and show how near the controllers come to it.

    DRIVE is a TOML file or the name of a shipped drive (see: softstart drives); without it, the crane drive
    of the literature is taken. Each controller is judged by the optimum at its own start time.
    """
    from softstart.optimal.problem import TERMINALS, Problem

    mistakes = Mistakes()
    one: Drive | None = None
    names: Sequence[str] | None = None
    asked: list[Asked] | None = None
    bounds: dict[str, Any] = {}
    with mistakes.noted():
        one = read_drive(drive, settings)
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
    if one is not None and not mistakes.sentences:
        with mistakes.noted(), named_as_options():
            Problem(one, 1.0, bounds["terminal"], torque_speed=bounds["torque_speed"])
    mistakes.settle()
    assert one is not None

    with (
        no_solution_told(as_json),
        output_folder(out) as folder,
        kept_state(out, STATE, "finished points") as state,
    ):
        front = _computed(one, asked, names, bounds, state)
        if folder is not None and any(point.found for point in front.points):
            from softstart.cli.optimal_report import write_front
            from softstart.cli.running import working

            with working("drawing the figure ..."):
                write_front(front, folder, command_line())

    from softstart.views.terminal import console, print_json

    if as_json:
        print_json(front.summary())
    if not any(point.found for point in front.points):
        raise SimulationError(as_option(front.points[-1].status_text))
    if not as_json:
        _show(console(), front)
        if out is not None:
            print(f"\nWritten to {out}: report.md, the figure, the table and the finished points.")


def _computed(
    drive: Drive,
    asked: Sequence[Asked] | None,
    names: Sequence[str] | None,
    bounds: dict[str, Any],
    state: Path | None,
) -> Front:
    from softstart.cli.running import Attributed, make_controllers, working

    with working("starting the drive ...") as status:
        from softstart.controller import ready_controller_names
        from softstart.optimal.front import pareto as compute

        made: list[Controller] = make_controllers(names or ready_controller_names(), {}, prefix=True)

        def progress(doing: str) -> None:
            if status is not None:
                status.update(f"{doing} ...")

        times = None
        if asked is not None:
            multiples = any(one.multiple for one in asked)
            direct = start_time_of_direct(drive) if multiples else math.nan
            times = [one.seconds(direct) for one in asked]
        with Attributed(), named_as_options():
            return compute(drive, times, controllers=made, save_to=state, progress=progress, **bounds)


def point_columns(front: Front) -> dict[str, list[str]]:
    """The table of the curve."""
    from softstart.views.numbers import column_of, number

    points = front.points
    return {
        "start time\nallowed s": column_of([p.start_time_bound for p in points], 5),
        "K_dyn": [number(p.k_dyn, 4) for p in points],
        "lower\nbound": [number(p.k_dyn_lower_bound, 4) for p in points],
        "gap\n%": [number(p.gap_percent, 3) for p in points],
        "bound": [p.bound_kind if p.found else "-" for p in points],
        "heat\ns": column_of([p.heat for p in points]),
        "contacts": ["-" if p.contacts is None else str(p.contacts) for p in points],
        "method": [p.method if p.found else p.status.lower().replace("_", " ") for p in points],
    }


def controller_columns(front: Front) -> dict[str, list[str]]:
    """The table of the controllers, the one nearest to the limit first."""
    from softstart.views.numbers import column_of, number

    order = sorted(front.controllers, key=lambda one: one.ratio or math.inf)
    return {
        "strategy": [one.name for one in order],
        "K_dyn": [number(one.k_dyn, 4) for one in order],
        "start\ntime s": column_of([one.start_time for one in order], 5),
        "least K_dyn\nat that time": [number(one.optimum.k_dyn if one.optimum else None, 4) for one in order],
        "times\nthe least": [number(one.ratio, 3) for one in order],
    }


def conclusion(front: Front) -> str:
    """What the curve spans, and which controller comes nearest to it."""
    found = [point for point in front.points if point.found]
    if not found:
        return "None of these start times is feasible."
    first, last = found[0], found[-1]
    said = f"Least K_dyn {first.k_dyn:.3f} in {first.start_time_bound:.4g} s"
    if last is not first:
        said += f" to {last.k_dyn:.3f} in {last.start_time_bound:.4g} s"
    judged = [one for one in front.controllers if one.ratio is not None]
    if not judged:
        return said + "."
    best = min(judged, key=lambda one: one.ratio or math.inf)
    least = best.optimum.k_dyn if best.optimum is not None else math.nan
    return (
        f"{said}. Nearest to the limit: {best.name}, K_dyn {best.k_dyn:.3f} where {least:.3f} is the least "
        f"in its start time of {best.start_time:.4g} s."
    )


def footnotes(front: Front) -> list[str]:
    """What the bound covers, and why some points are missing."""
    covers = dict.fromkeys(
        f"Lower bound ({point.bound_kind}): {point.bound_covers}".rstrip(".") + "."
        for point in front.points
        if point.found and point.bound_covers
    )
    missing = dict.fromkeys(point.status_text for point in front.points if not point.found)
    apart = [f"{one.name}: {_why_apart(one)}" for one in front.controllers if one.ratio is None]
    below = [
        f"{one.name} lies below the lower bound of its start time: its start is not of the class covered."
        for one in front.controllers
        if one.optimum is not None and one.k_dyn < (one.optimum.k_dyn_lower_bound or 0.0)
    ]
    return [*covers, *below, *missing, *apart]


def _why_apart(one: ControllerPoint) -> str:
    """Why a controller has no optimum to be compared with."""
    best = one.optimum
    if best is None:
        return one.status_text
    if best.status == "INFEASIBLE" and best.shortest_start_time is not None:
        return (
            "quicker than any start whose gap closes only once, which takes "
            f"{best.shortest_start_time:.6g} s or more; there is no optimum to compare it with."
        )
    return best.status_text


def _show(to: Console, front: Front) -> None:
    from softstart.views.drives import drive_lines
    from softstart.views.numbers import Column
    from softstart.views.terminal import print_table, sentence

    for index, line in enumerate(drive_lines(front.drive)):
        sentence(to, line, "bold" if index == 0 else "")
    for title, columns, texts in (
        (f"Least K_dyn, terminal {front.terminal}", point_columns(front), ("bound", "method")),
        ("Controllers against the optimum at their own start time", controller_columns(front), ("strategy",)),
    ):
        rows = [list(row) for row in zip(*columns.values(), strict=True)]
        if rows:
            to.print()
            print_table(to, [Column(name, name not in texts) for name in columns], rows, title=title)
    to.print()
    sentence(to, conclusion(front), "bold")
    for note in footnotes(front):
        sentence(to, note, "dim")
