"""The options of `optimize` and `pareto`: bounds, terminal condition, start times as numbers or multiples."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import click

from softstart.cli.commands import Reading
from softstart.cli.options import Decorator, as_option, choice, quantity, read_each, read_range
from softstart.errors import InputError, SimulationError
from softstart.late import late
from softstart.optimal.problem import TERMINALS, StartTime
from softstart.quantities import to_si, values_in
from softstart.views.terminal import print_json

if TYPE_CHECKING:
    from softstart.optimal import result
else:  # no numba for a help, a wrong option or the Tab key
    result = late("softstart.optimal.result")


def read_start_times(text: str, option: str = "--start-times") -> list[StartTime]:
    """Start times with commas between, or as from:to:count.

    >>> read_start_times("0.25, 1.2x")
    [StartTime(value=0.25, multiple=False), StartTime(value=1.2, multiple=True)]
    >>> [round(one.value, 3) for one in read_start_times("0.25:0.5:3")]
    [0.25, 0.375, 0.5]
    """
    if ":" not in text:
        return _each(text, option, lambda part: StartTime.of(part, option))
    ends, values = read_range(text, option)
    first, last = read_each(ends, lambda part: StartTime.of(part, option))
    if first.multiple != last.multiple:
        raise InputError(
            f'{option} = "{text}": give both ends as times, or both as multiples of direct (1.2x).'
        )
    return [StartTime(value, first.multiple) for value in values(first.value, last.value)]


def quantities(unit: str) -> Reading:
    """The type of an option that is numbers or quantities with commas between.

    >>> quantities("rad").read("0.25, 500 mrad", "--gaps")
    [0.25, 0.5]
    """
    return Reading(
        lambda text, option: _each(text, option, lambda part: float(to_si(part, unit, name=option)))
    )


def _read_corners(text: str, option: str) -> tuple[tuple[float, float], ...]:
    """Corners of a torque-speed curve, rad/s and N m.

    >>> _read_corners("0:62, 900 rpm: 40 N*m", "--torque-speed")[1][1]
    40.0
    """

    def corner(part: str) -> tuple[float, float]:
        speed, colon, torque = part.partition(":")
        if not (colon and speed.strip() and torque.strip()):
            raise InputError(f'{option} = "{part}": write each corner as speed:torque, as 90:40.')
        return float(to_si(speed, "rad/s", name=option)), float(to_si(torque, "N*m", name=option))

    return tuple(_each(text, option, corner))


def _each(text: str, option: str, read: Callable[[str], Any]) -> list[Any]:
    """Every part of a list with commas between, read; all mistakes at once."""
    return read_each(values_in(text, option), read)


def terminal_option(usual: str, default: str | None = None) -> Decorator:
    """--terminal; `default` where it is not the drive that decides."""
    return click.option(
        "--terminal",
        metavar="|".join(TERMINALS),
        type=choice(*TERMINALS),
        default=default,
        help="Terminal condition: motor and load at the target speed (synchronous), with the shaft torque "
        "equal to the load torque as well (steady), or the load alone at the target speed (reached). "
        f"Default: {usual}.",
    )


torque_speed_option = click.option(
    "--torque-speed",
    metavar="SPEED:TORQUE,...",
    type=Reading(_read_corners),
    help="Corners of the torque-speed curve that limits the motor, for example '0 rad/s:62 N*m,90 rad/s:40 "
    "N*m'.",
)
smoothness_option = click.option(
    "--smoothness",
    metavar="TIME",
    type=quantity("s", "a weight in s, 0 or more", least=0.0),
    help="Weight of torque smoothness, for example 0.001 (s). Default: 0.",
)


@contextmanager
def no_solution_reported(as_json: bool) -> Iterator[None]:
    """Where there is no optimum: its verdict as the JSON object, one sentence, and exit code 3."""
    try:
        yield
    except RuntimeError as error:
        if not isinstance(error, result.InfeasibleError | result.OptimumError):
            raise
        if as_json and isinstance(error, result.InfeasibleError):
            print_json(error.verdict.summary())
        raise SimulationError(as_option(str(error))) from error
