"""Read a quantity: a bare number in SI, or a string of a number and a unit; nothing doubtful is guessed.

Radians count as a dimension (see `unit_table`), so a frequency is no speed and a torque no stiffness: each is
refused with the text to write instead. pint is imported only when a string has a unit.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Iterable
from datetime import date, time
from decimal import Decimal
from numbers import Real
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softstart.errors import InputError
from softstart.unit_table import OTHER_NOUNS, QUANTITIES, Quantity, Unit, nearest, read_unit

__all__ = ["QUANTITIES", "RefusedError", "Value", "nearest", "parse", "show", "to_si"]

Value = float | NDArray[np.float64]

_NUMBER = re.compile(
    r"[+-]?(?:(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:e[+-]?[0-9]+)?|inf(?:inity)?(?![a-z])|nan(?![a-z]))",
    re.IGNORECASE,
)


class RefusedError(ValueError):
    """Why a value is refused: reason and remedy, without the name of the key, which the caller knows.

    `index` is the place of the bad element in an array (None for a single value), `value` that element.
    """

    def __init__(self, reason: str, value: object = None, index: tuple[int, ...] | None = None) -> None:
        super().__init__(reason)
        self.reason = reason
        self.value = value
        self.index = index


def to_si(value: object, unit: str, name: str = "value", *, infinite: bool = False) -> Value:
    """The quantity in the SI unit `unit`: a float, or a float64 array for a list or an array.

    `value`: a number (already in `unit`), a string of a number and a unit, a pint quantity, or a list or
    array of these. `unit`: a key of `QUANTITIES` (`"rad/s"`, `"N*m"`, ...) or another unit in SI. `infinite`:
    whether infinity is let through; NaN never is. Raises `InputError`: a sentence that begins with `name`.

    >>> to_si("880 rpm", "rad/s"), to_si("1 kgf*m/rad", "N*m/rad"), to_si(0.035, "kg*m^2")
    (92.1533845053006, 9.80665, 0.035)
    >>> to_si("50 Hz", "rad/s", name="target_speed")
    Traceback (most recent call last):
    softstart.errors.InputError: target_speed = "50 Hz": Hz is a frequency, which may count turns or radians;
    write "50 turn/s" or "50 rad/s".
    """
    try:
        return parse(value, unit, infinite=infinite)
    except RefusedError as refusal:
        place = "" if refusal.index is None else f"[{', '.join(map(str, refusal.index))}]"
        shown = value if refusal.index is None else refusal.value
        raise InputError(f"{name}{place} = {show(shown)}: {refusal.reason}.") from None


def parse(value: object, unit: str, *, infinite: bool = False) -> Value:
    """Like `to_si`, but raises `RefusedError`, for callers that word the sentence themselves.

    >>> parse(["0.5 rad", "2 rad"], "rad")
    array([0.5, 2. ])
    """
    if hasattr(value, "magnitude") and hasattr(value, "units"):  # a quantity of the user's own pint registry
        one = _text(f"1 {value.units}", unit, infinite)
        return _finished(parse(value.magnitude, unit, infinite=infinite) * one)
    if hasattr(value, "__array__") and not isinstance(value, np.generic):
        value = np.asarray(value)
    if isinstance(value, np.ndarray) and value.dtype.kind in "iuf":
        numbers = value.astype(np.float64)
        wrong = np.isnan(numbers) if infinite else ~np.isfinite(numbers)
        if np.any(wrong):
            index = tuple(int(i) for i in np.argwhere(wrong)[0])
            _at(index, float(numbers[index]), lambda number: _checked(number, unit, infinite))
        return _finished(numbers)
    if isinstance(value, list | tuple | np.ndarray):
        cells = _cells(value)
        numbers = np.empty(cells.shape)
        for index in np.ndindex(cells.shape):
            numbers[index] = _at(index, cells[index], lambda cell: _single(cell, unit, infinite))
        return _finished(numbers)
    return _single(value, unit, infinite)


def _cells(value: list[Any] | tuple[Any, ...] | NDArray[Any]) -> NDArray[np.object_]:
    try:
        return np.array(value, dtype=object)
    except ValueError:
        raise RefusedError("the rows of a list must all have the same length") from None


def _at(index: tuple[int, ...], cell: object, read: Callable[[Any], float]) -> float:
    try:
        return read(cell)
    except RefusedError as refusal:
        raise RefusedError(refusal.reason, cell, index or None) from None


def _finished(numbers: Value) -> Value:
    if np.size(numbers) == 0:
        raise RefusedError("an empty list holds no value; give at least one element")
    if np.ndim(numbers) == 0:
        return float(numbers)
    return numbers + 0.0  # a copy, in which -0.0 is 0.0


def _single(value: object, unit: str, infinite: bool) -> float:
    if isinstance(value, str):
        return _text(value, unit, infinite)
    if isinstance(value, bool | np.bool_):
        raise RefusedError(f"true and false are no quantities; {_remedy(unit)}")
    if value is None:
        raise RefusedError(f"there is no value; {_remedy(unit)}")
    if isinstance(value, list | tuple):
        raise RefusedError("the rows of a list must all have the same length")
    if not isinstance(value, Real | Decimal):
        raise RefusedError(f"{_a_type(value)} is no quantity; {_remedy(unit)}")
    try:
        number = float(value)
    except OverflowError:
        raise RefusedError(f"the number is too large; {_remedy(unit)}") from None
    return _checked(number, unit, infinite)


def _checked(number: float, unit: str, infinite: bool) -> float:
    if math.isnan(number):
        raise RefusedError(f"this is not a number; {_remedy(unit)}")
    if math.isinf(number) and not infinite:
        raise RefusedError(f"it must be finite; {_remedy(unit)}")
    return number + 0.0


def _text(text: str, unit: str, infinite: bool) -> float:
    stripped = text.strip().replace("\N{MINUS SIGN}", "-")
    match = _NUMBER.match(stripped)
    if match is None:
        raise RefusedError(f"this is no number with a unit; {_remedy(unit)}")
    written = stripped[match.end() :].strip()
    if written.startswith(","):
        raise RefusedError(f"a comma may divide decimals or thousands; use a decimal point: {_remedy(unit)}")
    number = _checked(float(match.group()), unit, infinite)
    if not written:
        return number
    factor = _factor(written, match.group(), unit)
    # Decimal units are applied by one correctly rounded operation: "9 ms" is 0.009, not a neighbour of it.
    divisor = round(1.0 / factor) if 1e-15 < factor < 1.0 else 0
    scaled = number / divisor if divisor and abs(divisor * factor - 1.0) < 1e-14 else number * factor
    if scaled == 0.0 != number:
        raise RefusedError(f"the number is too small; {_remedy(unit)}")
    return _checked(scaled, unit, infinite)


def _factor(written: str, number: str, unit: str) -> float:
    """How many `unit` one `written` is."""
    quantity = _quantity(unit)
    found = read_unit(written)
    if isinstance(found, str):
        raise RefusedError(f"{found}; {_remedy(unit)}")
    for form in (unit, *quantity.others):
        wanted = _known(form)
        if wanted.dimensions == found.dimensions:
            factor = found.size / wanted.size
            decimal = float(f"{factor:.12g}")  # 9.80665 stays 9.80665 whatever order pint multiplied in
            return decimal if abs(factor - decimal) <= 1e-15 * factor else factor
    raise RefusedError(_wrong_kind(written, number, found, quantity))


def _wrong_kind(written: str, number: str, found: Unit, quantity: Quantity) -> str:
    unit = quantity.unit
    other = next((noun for form, noun in _nouns() if _known(form).dimensions == found.dimensions), None)
    if other is None:
        return f"{written} is not a unit of {quantity.noun}; {_remedy(unit)}"
    is_what = f"{written} is {other}"
    if unit == "rad/s" and other == "a frequency":
        per_minute = "min" in written
        count, radian = ("rpm", "rad/min") if per_minute else ("turn/s", "rad/s")
        amount = number if per_minute else f"{float(number) * found.size:.12g}"
        return f'{is_what}, which may count turns or radians; write "{amount} {count}" or "{amount} {radian}"'
    if unit == "kg*m^2" and other == "a flywheel moment":
        return f"{is_what} (GD^2); divide it by 4 g and write the inertia in kg*m^2"
    if unit in ("N*m/rad", "N*m*s/rad") and other == _noun_of(unit.removesuffix("/rad")):
        per = f'"{number} {written}/rad" or "{number} {written}/deg"'
        return f"{is_what}, but {quantity.noun} is per angle; write {per}"
    if unit == "N*m" and other in ("a stiffness", "an energy"):
        return f'{is_what}, not a torque; write "{number} N*m" if that is meant'
    return f"{is_what}, not {quantity.noun}; {_remedy(unit)}"


def _nouns() -> Iterable[tuple[str, str]]:
    yield from ((q.unit, q.noun) for q in QUANTITIES.values())
    yield from OTHER_NOUNS.items()
    yield from ((form, q.noun) for q in QUANTITIES.values() for form in q.others)


def _noun_of(unit: str) -> str:
    return next(noun for form, noun in _nouns() if form == unit)


def _quantity(unit: str) -> Quantity:
    return QUANTITIES.get(unit) or Quantity(unit, f"a quantity in {unit}", f"1 {unit}")


def _known(unit: str) -> Unit:
    found = read_unit(unit)
    if isinstance(found, str):
        raise InputError(f'unit = "{unit}": {found}.')
    return found


def _remedy(unit: str) -> str:
    quantity = _quantity(unit)
    if unit == "1":
        return f"write a plain number such as {quantity.example}"
    return f'write {quantity.noun} as "{quantity.example}" or as a bare number in {unit}'


def _a_type(value: object) -> str:
    name = type(value).__name__
    return {"dict": "a table", "complex": "a complex number"}.get(
        name
    ) or f"{'an' if name[0] in 'aeiou' else 'a'} {name}"


def show(value: object, *, toml: bool = False) -> str:
    """A value as its writer wrote it, cut to a readable length; `toml` writes true, not True.

    >>> show("5 m"), show(True, toml=True), show([0.5, 2.0])
    ('"5 m"', 'true', '[0.5, 2.0]')
    """
    if isinstance(value, str):
        shown = json.dumps(value, ensure_ascii=False)
    elif toml and isinstance(value, list | dict):
        shown = json.dumps(value, ensure_ascii=False, default=str)
    elif toml and isinstance(value, date | time):
        shown = str(value)
    elif isinstance(value, bool | np.bool_):
        shown = str(bool(value)).lower() if toml else str(bool(value))
    elif isinstance(value, np.generic):
        shown = repr(value.item())
    elif isinstance(value, np.ndarray):
        shown = repr(value.tolist()) if value.size <= 8 else f"an array of shape {value.shape}"
    elif isinstance(value, int) and abs(value) > 10**30:
        shown = "an integer beyond 10^30" if value > 0 else "an integer below -10^30"
    else:
        shown = repr(value)
    return shown if len(shown) <= 70 else f"{shown[:60]}..."
