"""`softstart optimize` and `pareto`: the lowest K_dyn for one start time, and over the start time."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, Any

import click

import softstart
from softstart.cli import options
from softstart.cli.options import command, option, quantity
from softstart.cli.running import Output, answers, attributed, controllers_from_options, option_value, working
from softstart.errors import InputError, SimulationError
from softstart.input.gear import BEHIND
from softstart.optimal.problem import OBJECTIVES, TERMINALS, StartTime
from softstart.quantities import to_si, values_in
from softstart.views.markdown import kept_state
from softstart.views.terminal import print_json

if TYPE_CHECKING:
    from softstart.drive.machine import Machine
    from softstart.optimal.result import Optimum
    from softstart.start.run import Run

STATE = "pareto.sqlite"


def read_start_times(text: str, option: str = "--start-times") -> list[StartTime]:
    """Start times with commas between, or as from:to:count.

    >>> read_start_times("0.25, 1.2x")
    [StartTime(value=0.25, multiple=False), StartTime(value=1.2, multiple=True)]
    >>> [round(one.value, 3) for one in read_start_times("0.25:0.5:3")]
    [0.25, 0.375, 0.5]
    """

    def read(part: str) -> tuple[float, bool]:
        start_time = StartTime.of(part, option)
        return start_time.value, start_time.multiple

    return [StartTime(*pair) for pair in options.read_value_list(text, option, read)]


def _each(unit: str) -> options.Reader:
    """Reads quantities with commas between; "... at output" is read later."""

    def read(text: str, option: str) -> list[float | str]:
        values = values_in(text, option)
        return [part if BEHIND.fullmatch(part) else float(to_si(part, unit, name=option)) for part in values]

    return read


def _corners(text: str, option: str) -> list[tuple[float, float]]:
    """Corners of a torque-speed curve, rad/s and N m.

    >>> _corners("0:62, 900 rpm: 40 N*m", "--torque-speed")[1][1]
    40.0
    """
    pairs = [part.partition(":") for part in values_in(text, option)]
    if wrong := next(("".join(pair) for pair in pairs if not (pair[0].strip() and pair[2].strip())), ""):
        raise InputError(f'{option} = "{wrong}": write each corner as speed:torque, as 90:40.')
    return [
        (float(to_si(speed, "rad/s", name=option)), float(to_si(torque, "N*m", name=option)))
        for speed, _, torque in pairs
    ]


@contextmanager
def _no_solution() -> Iterator[None]:
    """Where there is no optimum: its verdict as the JSON object, one sentence, and exit code 3."""
    from softstart.optimal.result import InfeasibleError

    try:
        yield
    except InfeasibleError as error:
        if option_value("as_json"):
            print_json(error.verdict.summary())
        raise


@command("optimize")
@option("--start-time", StartTime.of)
@option("--limits", is_flag=True)
@option("--terminal", type=click.Choice(TERMINALS))
@option("--minimise", type=click.Choice(OBJECTIVES))
@option("--max-k-dyn k_dyn", quantity("1", above=0.0))
@option("--max-heat heat", quantity("s", above=0.0))
@option("--torque-speed", _corners)
@option("--smoothness", quantity("s", least=0.0))
@option("--confirm", is_flag=True)
@option("--bounds", is_flag=True)
@option("--gaps", _each("rad"))
@option("--inertias", _each("kg*m^2"))
@option("--load-torques", _each("N*m"))
@options.at_option
@options.of_drive(options.read_machine)
@answers(out=True)
def optimize_command(
    *, drive: Machine, gaps: Sequence[float | str] | None, inertias: Sequence[float | str] | None,
    load_torques: Sequence[float | str] | None, **arguments: Any,
) -> Output:  # fmt: skip
    """Compute the torque profile with the lowest K_dyn for a start time, and a lower bound.

    DRIVE is a TOML file, also of a project, or the name of a shipped drive (see: softstart drives) or chain
    (crane-4-mass); by default the crane drive of the literature. With --gaps, --inertias or --load-torques,
    one profile is computed for all combinations. For a chain, the largest torque of all its shafts is
    minimised.

    Options
    -------
    --start-time TIME
        Upper bound of the start time: 0.3 (s), '300 ms', or 1.2x that of direct. Default: 1.2x.
    --limits
        Find the shortest start time that meets the [limits] of the drive instead.
    --terminal synchronous|steady|reached
        Terminal condition: motor and load at the target speed (synchronous), with the shaft torque equal
        to the load torque as well (steady), or the load alone at the target speed (reached). Default:
        synchronous for one drive at one position, else reached.
    --minimise k_dyn|heat|start_time
        Objective. Default: k_dyn.
    --max-k-dyn NUMBER
        Upper bound of K_dyn if another objective is minimised.
    --max-heat TIME
        Upper bound of the I2t heat, in s of starting torque.
    --smoothness TIME
        Weight of torque smoothness, for example 0.001 (s). Default: 0.
    --confirm
        Also solve the CasADi problem from its own initial guess, and show both results.
    --bounds
        Also compute tight lower bounds of K_dyn (some 10 s).
    --gaps GAP,...
        Compute one profile for the drive with each of these gaps.
    --inertias INERTIA,...
        Likewise for these load inertias.
    --load-torques TORQUE,...
        Likewise for these load torques.
    --out DIR
        Write profile (CSV, TOML, C), figure (SVG, PNG), traces (CSV) and report.md into this folder.
    """
    given = {name: value for name, value in arguments.items() if value is not None}
    varied = {"gaps": gaps or (), "inertias": inertias or (), "load_torques": load_torques or ()}
    with _no_solution(), working("optimizing the start ...") as progress:
        with options.named_as_options():
            others = softstart.scenarios_of(drive, **varied)[1:]
        best = softstart.optimize(drive, scenarios=others, progress=progress, **given)
    with working("simulating the shipped controllers ..."):
        beside = [] if others else _runs_beside(best)
    from softstart.views.optima import controller_summary, optimum_sheet

    data = lambda: {**best.summary(), "controllers": list(map(controller_summary, beside))}  # noqa: E731
    return data, optimum_sheet(best, beside)


def _runs_beside(best: Optimum) -> list[Run]:
    """The same drive under every controller that runs without being given a parameter, and does not fail."""
    from softstart.controller import ready_controller_names

    runs = []
    for name in ready_controller_names():
        with suppress(InputError, SimulationError), attributed(name):
            runs.append(softstart.simulate(best.problem.drive, name, base=best.problem.base))
    return runs


@command("pareto")
@option("--start-times", read_start_times)
@option("--terminal", type=click.Choice(TERMINALS), default="reached")
@option("--torque-speed", _corners)
@options.controller_option("--controllers", several=True)
@options.at_option
@options.of_drive(options.read_machine)
@answers(out=True)
def pareto_command(
    *, drive: Machine, start_times: list[StartTime] | None, controllers: list[str] | None, **arguments: Any
) -> Output:  # fmt: skip
    """Compute the lowest K_dyn over the start time, and compare the controllers with it.

    DRIVE is a TOML file, also of a project, or the name of a shipped drive (see: softstart drives) or chain
    (crane-4-mass); by default the crane drive of the literature. Each controller is compared with the optimum
    at its own start time.

    Options
    -------
    --start-times TIME,...
        Bounds of the start time: 0.25,0.3 (s), a range from:to:count such as 0.25:0.5:12, or multiples of
        that of direct, 1.02x:1.6x:12. Default: 12 bounds from the shortest feasible one on.
    --terminal synchronous|steady|reached
        Terminal condition: motor and load at the target speed (synchronous), with the shaft torque equal
        to the load torque as well (steady), or the load alone at the target speed (reached). Default:
        reached.
    --controllers A,B,...
        Controllers to compare with the curve. Default: all that need no parameter.
    --out DIR
        Write figure (SVG, PNG), table (CSV) and report.md into this folder. Finished points are saved at
        once, so that an interrupted command resumes.
    """
    arguments = {name: value for name, value in arguments.items() if value is not None}
    with (
        kept_state(option_value("out"), STATE, "finished points") as state,
        options.named_as_options(start_time="--start-times"),
        _no_solution(),
        working("starting the drive ...") as progress,
        attributed(),
    ):
        front = softstart.pareto(
            drive, start_times, controllers=controllers_from_options(controllers, {}), save_to=state,
            progress=progress, **arguments,
        )  # fmt: skip
    if not any(point.found for point in front.points):
        if option_value("as_json"):
            print_json(front.summary())
        raise SimulationError(front.points[-1].status_text)
    return front
