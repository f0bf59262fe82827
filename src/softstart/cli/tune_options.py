"""The options of `tune`: grids, free parameters and tolerances as typed at a command line."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from softstart.cli.options import Mistakes
from softstart.errors import InputError

OPTIONS = ("gaps", "inertias", "metric", "start_time", "quantile", "seed", "restarts", "workers", "free")
LARGEST_GRID = 100  # values of one axis
ENDINGS = ("x", "J1")  # of multiples: of the drive's own value, of the motor's inertia


def read_grid(text: str | None, option: str, unit: str) -> list[Any] | None:
    """Values with commas between, or from:to:count; quantities, or multiples as 2x or 5J1.

    >>> read_grid("0.5, 2x", "--gaps", "rad"), read_grid("0.5:2:4", "--gaps", "rad")
    ([0.5, '2.0x'], [0.5, 1.0, 1.5, 2.0])
    >>> read_grid("2J1:5J1:3", "--inertias", "kg*m^2")
    ['2.0J1', '3.5J1', '5.0J1']
    """
    if text is None:
        return None
    if ":" not in text:
        parts = [part.strip() for part in text.split(",")]
        if not all(parts):
            raise InputError(f'{option} = "{text}": a place in the list is empty; write values with commas.')
        ends = _all(parts, option, unit)
        return [value if not ending else f"{value!r}{ending}" for value, ending in ends]
    parts = [part.strip() for part in text.split(":")]
    if len(parts) != 3:
        raise InputError(f'{option} = "{text}": a range is from:to:count, as 0.5:2:7 or 1x:4x:7.')
    (first, ending), (last, other) = _all(parts[:2], option, unit)
    if ending != other:
        raise InputError(f'{option} = "{text}": give both ends as quantities, or both as the same multiples.')
    count = int(parts[2]) if parts[2].isascii() and parts[2].isdigit() else 0
    if not 1 < count <= LARGEST_GRID:
        raise InputError(f'{option} = "{text}": the count is a whole number from 2 to {LARGEST_GRID}.')
    values = [float(f"{first + (last - first) * k / (count - 1):.12g}") for k in range(count)]
    return [value if not ending else f"{value!r}{ending}" for value in values]


def _all(parts: Sequence[str], option: str, unit: str) -> list[tuple[float, str]]:
    """Each part as a number and the ending of its multiple, if it is one."""
    from softstart.quantities import to_si

    mistakes = Mistakes()
    found = []
    for part in parts:
        with mistakes.noted():
            ending = next((one for one in ENDINGS if part.endswith(one)), "")
            value = part.removesuffix(ending) if ending else part
            found.append((float(to_si(value, "1" if ending else unit, name=option)), ending))
    mistakes.settle()
    return found


def read_free(text: str | None) -> dict[str, tuple[str, str] | None] | None:
    """Names with commas between, each with a range if one is given.

    >>> read_free("torque,delay=5 ms:20 ms,time=0.5x:2x")
    {'torque': None, 'delay': ('5 ms', '20 ms'), 'time': ('0.5x', '2x')}
    """
    if text is None:
        return None
    found: dict[str, tuple[str, str] | None] = {}
    mistakes = Mistakes()
    for part in text.split(","):
        name, equals, ends = (piece.strip() for piece in part.partition("="))
        low, colon, high = (piece.strip() for piece in ends.partition(":"))
        with mistakes.noted():
            if not name or (equals and not (low and colon and high)):
                raise InputError(
                    f'--free "{part.strip()}": write a name, or name=low:high, as time=0.1:0.5 or '
                    "time=0.5x:2x."
                )
            if name in found:
                raise InputError(f'--free = "{text}": {name} is named twice; name it once.')
            found[name] = (low, high) if equals else None
    mistakes.settle()
    return found


def read_tolerances(texts: Sequence[str]) -> dict[str, str | list[str]]:
    """`key=spread` texts by field of the drive; several values with commas are those to be met.

    >>> read_tolerances(["shaft.stiffness=10 %", "encoder_phase=0,0.5"])
    {'stiffness': '10 %', 'encoder_phase': ['0', '0.5']}
    """
    from softstart.drive import PARAMETERS

    names = {parameter.path: parameter.name for parameter in PARAMETERS.values()}
    found: dict[str, str | list[str]] = {}
    mistakes = Mistakes()
    for text in texts:
        key, equals, value = (piece.strip() for piece in text.partition("="))
        with mistakes.noted():
            if not (key and equals and value):
                raise InputError(f'--tolerance "{text}": write KEY=SPREAD, as stiffness=10%.')
            name = names.get(key, key)
            if name in found:
                raise InputError(f'--tolerance "{text}": {key} is given twice; keep one of the two.')
            found[name] = [part.strip() for part in value.split(",")] if "," in value else value
    mistakes.settle()
    return found


@contextmanager
def named_as_options() -> Iterator[None]:
    """Sentences about keywords of `tune`, as sentences about the options."""
    try:
        yield
    except InputError as error:
        raise InputError([as_option(sentence) for sentence in error.sentences]) from error


def as_option(sentence: str) -> str:
    """The sentence with the option's name where the keyword's was.

    >>> as_option("start_time = 'soon': give a time."), as_option("tolerances: gap is off.")
    ("--start-time = 'soon': give a time.", '--tolerance: gap is off.')
    >>> as_option('controller = mine: name one with its range, as free={"rise": ("0.5x", "2x")}.')
    'controller = mine: name one with its range, as --free rise=0.5x:2x.'
    """
    sentence = re.sub(r'free=\{"(\w+)": \("([^"]+)", "([^"]+)"\)\}', r"--free \1=\2:\3", sentence)
    sentence = re.sub(r"^(free: \w+ = )\('([^']+)', '([^']+)'\)", r"\1\2:\3", sentence)
    found = re.match(r"(\w+)(?= |:)", sentence)
    if found is None:
        return sentence
    if found[1] == "tolerances":
        return "--tolerance" + sentence[found.end() :]
    if found[1] in OPTIONS:
        return f"--{found[1].replace('_', '-')}" + sentence[found.end() :]
    return sentence
