"""Reading --axis: a parameter and its values, listed or as a range."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from softstart.cli.options import Mistakes, check_name
from softstart.errors import InputError

if TYPE_CHECKING:
    from softstart.sweeping.maker import Maker, Parameters

MOST_VALUES = 1_000_000  # of a range


def read_axes(texts: Sequence[str], maker: Maker) -> dict[str, Any]:
    """The grid of several --axis; all mistakes at once.

    >>> from softstart.sweeping.maker import Maker
    >>> grid = read_axes(["shaft.gap=0.5:2:4", "load.inertia=700 kg*cm^2, 0.175"], Maker("direct"))
    >>> grid["gap"].tolist(), grid["load_inertia"].tolist()
    ([0.5, 1.0, 1.5, 2.0], [0.07, 0.175])
    """
    mistakes = Mistakes()
    split: dict[str, str] = {}
    for text in texts:
        key, equals, values = (part.strip() for part in text.partition("="))
        with mistakes.noted():
            if not (key and equals and values):
                raise InputError(
                    f'--axis "{text}": write a parameter, an equals sign and values, as shaft.gap=0.25:4:100 '
                    "or load.inertia=0.07,0.175."
                )
            if key in split:
                raise InputError(f'--axis "{text}": {key} is an axis already; name it once.')
            split[key] = values
    parameters = _parameters(split, maker, mistakes)
    grid: dict[str, Any] = {}
    for key, values in split.items():
        with mistakes.noted():
            try:
                name, read = _read(key, values, parameters)
            except InputError as error:
                raise InputError([f"--axis {sentence}" for sentence in error.sentences]) from error
            if name in grid:
                raise InputError(f"--axis {key}: this parameter is an axis already, by its other name.")
            grid[name] = read
    mistakes.settle()
    return grid


def _parameters(split: dict[str, str], maker: Maker, mistakes: Mistakes) -> Parameters | None:
    """Those that the controllers have, None if these are wrong."""
    found: Parameters | None = None
    with mistakes.noted():
        if "controller" in split:
            names = _listed(split["controller"])
            for name in names:
                check_name(name, "--axis controller")
            found = maker.common_parameters(names)
        elif maker.given:
            found = maker.parameters()
    return found


def _read(key: str, text: str, parameters: Parameters | None) -> tuple[str, Any]:
    from softstart.sweeping.axes import read_column

    parts = [part.strip() for part in text.split(":")]
    is_range = len(parts) in (3, 4) and key != "controller" and not any(".py" in part for part in parts)
    if not is_range:
        column = read_column(key, _listed(text), parameters)
        return column.name, column.values
    column = read_column(key, parts[:2], parameters)
    if not column.numeric:
        raise InputError(f'{key} = "{text}": these values are names; write them with commas between.')
    return column.name, _spaced(key, text, parts, *column.values.tolist())


def _spaced(key: str, text: str, parts: Sequence[str], first: float, last: float) -> Any:
    import numpy as np

    count = int(parts[2]) if parts[2].isascii() and parts[2].isdigit() else 0
    if not 2 <= count <= MOST_VALUES:
        raise InputError(f'{key} = "{text}": the count is a whole number from 2 to {MOST_VALUES:,}.')
    if first == last:
        raise InputError(f'{key} = "{text}": both ends are the same; write the one value.')
    if len(parts) == 3:
        return np.linspace(first, last, count)
    if parts[3] != "log":
        raise InputError(f'{key} = "{text}": a range is from:to:count, or from:to:count:log.')
    if not (first > 0.0 and last > 0.0):
        raise InputError(f'{key} = "{text}": the ends of a range in equal ratios (log) are above 0.')
    return np.geomspace(first, last, count)


def _listed(text: str) -> list[str]:
    parts = [part.strip() for part in text.split(",")]
    if not all(parts):
        raise InputError(f'"{text}": a place in the list is empty; write values with commas between.')
    return parts
