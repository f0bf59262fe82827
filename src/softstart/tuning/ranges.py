"""Which parameters of a controller are tuned, and within what."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import Field, dataclass, fields
from typing import Any

import numpy as np

from softstart.arrays import Vector
from softstart.controller.base import Controller, label_of
from softstart.errors import InputError, Mistakes
from softstart.quantities import multiple, nearest, to_si

WIDE = 10.0  # ends of a named range from which on it is searched in the logarithm


@dataclass(frozen=True)
class Range:
    """A parameter with the values it may take, in `unit`: multiples of its default, or fixed ends, or both.

    A place in the range is a number from 0 to 1, evenly in the value or, if `logarithmic`, in its logarithm.

    >>> time = Range("time", "s", multiples=(0.1, 10.0), logarithmic=True)
    >>> round(float(time.value(0.5, 0.12)), 9), round(float(time.place(1.2, 0.12)), 9)
    (0.12, 1.0)
    """

    name: str
    unit: str
    multiples: tuple[float, float] | None = None
    between: tuple[float, float] | None = None
    logarithmic: bool = False
    named: bool = False  # the user's own range: nothing outside it is a candidate, not even the default

    def ends(self, default: Any) -> tuple[Vector, Vector]:
        """Lowest and highest value, where the derived default is this."""
        value = np.asarray(default, dtype=np.float64)
        if self.multiples is None:
            assert self.between is not None
            return np.full(value.shape, self.between[0]), np.full(value.shape, self.between[1])
        low, high = (np.asarray(multiple * value) for multiple in self.multiples)
        if self.between is not None:
            low, high = np.clip(low, *self.between), np.clip(high, *self.between)
        return low, high

    def value(self, place: Any, default: Any) -> Vector:
        """The value at a place."""
        low, high = self.ends(default)
        share = np.asarray(place, dtype=np.float64)
        straight = low + share * (high - low)
        if not self.logarithmic:
            return np.asarray(straight)
        positive = low > 0.0
        safe_low, safe_high = np.where(positive, low, 1.0), np.where(positive, high, 1.0)
        curved = np.exp((1.0 - share) * np.log(safe_low) + share * np.log(safe_high))
        inside = np.where(share == 0.0, low, np.where(share == 1.0, high, np.clip(curved, low, high)))
        return np.where(positive, inside, straight)

    def place(self, value: Any, default: Any) -> Vector:
        """The place of a value, within 0 and 1."""
        low, high = self.ends(default)
        given = np.clip(np.asarray(value, dtype=np.float64), low, high)
        if self.logarithmic:
            positive = low > 0.0
            low, high, given = (np.log(np.where(positive, x, 1.0)) + np.where(positive, 0.0, x)
                                for x in (low, high, given))  # fmt: skip
        width = high - low
        return np.where(width > 0.0, (given - low) / np.where(width > 0.0, width, 1.0), 0.5)

    def text(self) -> str:
        """The range in words."""
        unit = "" if self.unit in ("", "1") else f" {self.unit}"
        parts = []
        if self.multiples is not None:
            parts.append(f"{self.multiples[0]:g} to {self.multiples[1]:g} times its default")
        if self.between is not None:
            parts.append(f"{self.between[0]:g} to {self.between[1]:g}{unit}")
        return ", within ".join(parts)


Free = Iterable[str] | Mapping[str, Any] | None


def tunable(controller: Controller) -> tuple[str, ...]:
    """Names of the parameters that a controller says may be tuned.

    >>> from softstart.controller import make_controller
    >>> "time" in tunable(make_controller("ramp")), tunable(make_controller("direct"))
    (True, ())
    """
    return tuple(f.name for f in fields(controller) if _declared(f) is not None)


def ranges_of(controller: Controller, free: Free) -> tuple[Range, ...]:
    """The ranges of the parameters to tune: those asked for, or all that the controller says may be tuned.

    `free` maps a name to (low, high), each a number, a text with a unit, or a multiple of the default as
    "0.5x"; or to None for the controller's own range. Parameters given to the controller are left as given.
    Raises InputError with all mistakes.

    >>> from softstart.controller import make_controller
    >>> [one.text() for one in ranges_of(make_controller("ramp"), {"time": ("50 ms", "0.3 s")})]
    ['0.05 to 0.3 s']
    """
    what = label_of(controller)
    known = {f.name: f for f in fields(controller)}
    if free is None:
        given = {f.name for f in fields(controller) if getattr(controller, f.name) is not None}
        asked: dict[str, Any] = {name: None for name in tunable(controller) if name not in given}
        if not asked:
            raise InputError(
                f"controller = {what}: it has no parameter to tune by itself; {_example(known)}."
            )
    elif isinstance(free, str):
        asked = {free: None}
    else:
        asked = dict(free) if isinstance(free, Mapping) else dict.fromkeys(free)
    if not asked:
        raise InputError("free: it names no parameter; leave it out to tune all that the controller offers.")
    found: list[Range] = []
    wrong = Mistakes()
    for name, ends in asked.items():
        with wrong.noted():
            found.append(_range(what, name, ends, known))
    wrong.settle()
    return tuple(found)


def _example(known: Mapping[str, Field[Any]]) -> str:
    """How a range is named, with a parameter that there is."""
    names = [name for name, f in known.items() if f.metadata.get("kind", "quantity") == "quantity"]
    if not names:
        return "none of its parameters is a quantity, so take another controller"
    return f'name one with its range, as free={{"{names[0]}": ("0.5x", "2x")}}'


def _declared(field: Field[Any]) -> Range | None:
    """The range that a controller's own lines give a parameter."""
    multiples, between = field.metadata.get("multiples"), field.metadata.get("between")
    if multiples is None and between is None:
        return None
    unit = field.metadata.get("unit", "")
    return Range(field.name, unit, multiples, between, logarithmic=multiples is not None)


def _range(controller: str, name: str, ends: Any, known: Mapping[str, Field[Any]]) -> Range:
    if name not in known:
        near = nearest(name, known)
        hint = f"did you mean {near}?" if near else f"it has {', '.join(known) or 'none'}."
        raise InputError(f"free: the controller {controller} has no parameter {name}; {hint}")
    field = known[name]
    if field.metadata.get("kind", "quantity") != "quantity":
        raise InputError(
            f"free: {name} of the controller {controller} is not a quantity; it cannot be tuned."
        )
    declared = _declared(field)
    if ends is None:
        if declared is None:
            raise InputError(
                f"free: the controller {controller} gives no range for {name}; give one, "
                f'as free={{"{name}": ("0.5x", "2x")}} or with two values.'
            )
        return declared
    return _named(name, ends, field.metadata.get("unit", ""))


def _named(name: str, ends: Any, unit: str) -> Range:
    """The user's own range."""
    both = [] if isinstance(ends, str) or not isinstance(ends, Iterable) else list(ends)
    multiples = [multiple(end, f"free {name}") for end in both]
    if None not in multiples:
        values = [found[0] for found in multiples if found]
    elif any(multiples):
        values = []
    else:
        values = [float(to_si(end, unit or "1", name=f"free {name}")) for end in both]
    if len(values) != 2 or not values[0] < values[1] or (any(multiples) and values[0] <= 0.0):
        raise InputError(
            f"free: {name} = {ends!r}: give its lowest and highest value in this order, or both as multiples "
            "of the default above 0, as 0.5x and 2x."
        )
    low, high = values
    if any(multiples):
        return Range(name, unit, multiples=(low, high), logarithmic=True, named=True)
    return Range(name, unit, between=(low, high), logarithmic=0.0 < WIDE * low <= high, named=True)


def inside(ranges: Iterable[Range], values: Mapping[str, Any], defaults: Mapping[str, Any]) -> Any:
    """Whether the values respect every range that the user has named; elsewhere anything goes."""
    good = np.True_
    for one in ranges:
        if one.named:
            low, high = one.ends(defaults[one.name])
            slack = 1e-9 * np.maximum(np.abs(low), np.abs(high))
            good = good & (values[one.name] >= low - slack) & (values[one.name] <= high + slack)
    return good
