"""The options of `optimize` and `pareto`: bounds, terminal condition, start times as numbers or multiples."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import click

from softstart.cli.commands import did_you_mean
from softstart.cli.options import Decorator, Mistakes, as_option
from softstart.errors import InputError, SimulationError
from softstart.late import late
from softstart.optimal.problem import StartTime
from softstart.quantities import to_si, values_in, whole_number
from softstart.views.terminal import print_json

if TYPE_CHECKING:
    from softstart.optimal import result
else:  # no numba for a help, a wrong option or the Tab key
    result = late("softstart.optimal.result")

METHODS = ("auto", "closed-form", "collocation", "lp")


# the options ---------------------------------------------------------------------------------------------


def terminal_option(default: str) -> Decorator:
    """--terminal."""
    return click.option(
        "--terminal",
        metavar="synchronous|steady|reached",
        help="How the start ends: motor and load at the target speed; also with the shaft torque at that of "
        f"the load; or only the load at the target speed. By default {default}.",
    )


method_option = click.option(
    "--method",
    metavar="|".join(METHODS),
    help="By default auto: the cheapest one that is valid.",
)
torque_speed_option = click.option(
    "--torque-speed",
    metavar="SPEED:TORQUE,...",
    help="Limit of the motor's torque over its speed by its corners, as '0 rad/s:62 N*m,90 rad/s:40 N*m'.",
)
smoothness_option = click.option(
    "--smoothness",
    metavar="TIME",
    help="Weight of a smooth torque against a low K_dyn, as 0.001 (s). By default 0.",
)


# reading them --------------------------------------------------------------------------------------------


def read_choice(text: str, option: str, choices: Sequence[str]) -> Any:
    """One of the words.

    >>> read_choice("steedy", "--terminal", ("synchronous", "steady", "reached"))
    Traceback (most recent call last):
    softstart.errors.InputError: --terminal = "steedy": there is no such choice; did you mean steady?
    """
    if text not in choices:
        raise InputError(f'{option} = "{text}": there is no such choice; {did_you_mean(text, choices)}')
    return text


def read_positive(text: str, option: str, unit: str, meaning: str) -> float:
    """A finite quantity above 0."""
    value = float(to_si(text, unit, name=option))
    if not value > 0.0:
        raise InputError(f'{option} = "{text}": give {meaning}.')
    return value


def read_start_times(text: str) -> list[StartTime]:
    """Start times with commas between, or as from:to:count.

    >>> read_start_times("0.25, 1.2x")
    [StartTime(value=0.25, multiple=False), StartTime(value=1.2, multiple=True)]
    >>> [round(one.value, 3) for one in read_start_times("0.25:0.5:3")]
    [0.25, 0.375, 0.5]
    """
    option = "--start-times"
    if ":" not in text:
        return _each(text, option, lambda part: StartTime.of(part, option))
    parts = [part.strip() for part in text.split(":")]
    if len(parts) != 3:
        raise InputError(f'{option} = "{text}": a range is from:to:count, as 0.25:0.5:12 or 1.02x:1.6x:12.')
    mistakes = Mistakes()
    ends: list[StartTime] = []
    for part in parts[:2]:
        with mistakes.noted():
            ends.append(StartTime.of(part, option))
    count = 0
    with mistakes.noted():
        count = whole_number(parts[2], f'{option} = "{text}": the count', 2, 1000)
    mistakes.settle()
    first, last = ends
    if first.multiple != last.multiple:
        raise InputError(
            f'{option} = "{text}": give both ends as times, or both as multiples of direct (1.2x).'
        )
    step = (last.value - first.value) / (count - 1)
    return [StartTime(first.value + index * step, first.multiple) for index in range(count)]


def read_quantities(text: str | None, option: str, unit: str) -> list[float]:
    """Numbers or quantities with commas between; none if nothing was given.

    >>> read_quantities("0.25, 500 mrad", "--gaps", "rad")
    [0.25, 0.5]
    """
    if text is None:
        return []
    return _each(text, option, lambda part: float(to_si(part, unit, name=option)))


def read_corners(text: str | None) -> tuple[tuple[float, float], ...]:
    """Corners of a torque-speed curve, rad/s and N m.

    >>> read_corners("0:62, 900 rpm: 40 N*m")[1][1]
    40.0
    """
    if text is None:
        return ()

    def corner(part: str) -> tuple[float, float]:
        speed, colon, torque = part.partition(":")
        if not (colon and speed.strip() and torque.strip()):
            raise InputError(f'--torque-speed = "{part}": write each corner as speed:torque, as 90:40.')
        option = "--torque-speed"
        return float(to_si(speed, "rad/s", name=option)), float(to_si(torque, "N*m", name=option))

    return tuple(_each(text, "--torque-speed", corner))


def _each(text: str, option: str, read: Callable[[str], Any]) -> list[Any]:
    """Every part of a list with commas between, read; all mistakes at once."""
    mistakes = Mistakes()
    found = []
    for part in values_in(text, option):
        with mistakes.noted():
            found.append(read(part))
    mistakes.settle()
    return found


# what comes of them --------------------------------------------------------------------------------------


@contextmanager
def no_solution_reported(as_json: bool) -> Iterator[None]:
    """Where there is no optimum: its verdict as the JSON object, one sentence, and exit code 3."""
    try:
        yield
    except RuntimeError as error:
        if isinstance(error, SimulationError | RecursionError | NotImplementedError):
            raise
        if not isinstance(error, result.InfeasibleError | result.OptimumError | result.NotConverged):
            raise
        if as_json and isinstance(error, result.InfeasibleError):
            print_json(error.verdict.summary())
        raise SimulationError(as_option(str(error))) from error
