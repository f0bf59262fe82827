"""Which parameters of a controller are tuned, and within what."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softstart.arrays import Vector
from softstart.controller.base import Controller, label_of
from softstart.controller.parameters import ControllerParameter, declared_parameters
from softstart.errors import InputError, Mistakes
from softstart.hints import nearest
from softstart.quantities import Units, number_in, read_multiple
from softstart.views.numbers import IN_SI

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

    def ends(self, default: ArrayLike) -> tuple[Vector, Vector]:
        """Lowest and highest value, where the derived default is this."""
        value = np.asarray(default, dtype=np.float64)
        fixed = self.between or (-np.inf, np.inf)
        if self.multiples is None:
            return np.full(value.shape, fixed[0]), np.full(value.shape, fixed[1])
        low, high = (np.clip(factor * value, *fixed) for factor in self.multiples)
        return low, high

    def value(self, place: ArrayLike, default: ArrayLike) -> Vector:
        """The value at a place."""
        low, high = self.ends(default)
        share = np.asarray(place, dtype=np.float64)
        even = (1.0 - share) * self._scaled(low, low) + share * self._scaled(high, low)
        curved = self._curved(low)
        values = np.clip(np.where(curved, np.exp(np.where(curved, even, 0.0)), even), low, high)
        return np.where(share == 0.0, low, np.where(share == 1.0, high, values))

    def place(self, value: ArrayLike, default: ArrayLike) -> Vector:
        """The place of a value, within 0 and 1."""
        low, high = self.ends(default)
        inside = np.clip(np.asarray(value, dtype=np.float64), low, high)
        first, last, scaled = (self._scaled(one, low) for one in (low, high, inside))
        return np.where(last > first, (scaled - first) / np.where(last > first, last - first, 1.0), 0.5)

    def _curved(self, low: Vector) -> NDArray[np.bool_]:
        return self.logarithmic & (low > 0.0)

    def _scaled(self, values: Vector, low: Vector) -> Vector:
        """What places are even in: the logarithm or, where a range reaches 0 or is not so, the value."""
        curved = self._curved(low)
        return np.where(curved, np.log(np.where(curved, values, 1.0)), values)

    def text(self, units: Units = IN_SI) -> str:
        """The range in words."""
        parts = []
        if self.multiples is not None:
            parts.append(f"{self.multiples[0]:g} to {self.multiples[1]:g} times its default")
        if self.between is not None:
            low, high = (units.shown(end, self.unit) for end in self.between)
            parts.append(f"{low:g} to {high:g} {units.label(self.unit)}".rstrip())
        return ", within ".join(parts)


Free = Iterable[str] | Mapping[str, Any] | None


def tunable_parameters(controller: Controller) -> tuple[str, ...]:
    """Names of the parameters that a controller says may be tuned.

    >>> from softstart.controller import make_controller
    >>> "time" in tunable_parameters(make_controller("ramp")), tunable_parameters(make_controller("direct"))
    (True, ())
    """
    return tuple(name for name, one in declared_parameters(controller).items() if _declared(one))


def ranges_of(controller: Controller, free: Free) -> tuple[Range, ...]:
    """The ranges of the parameters to tune: those asked for, or all that the controller says may be tuned.

    `free` maps a name to (low, high), each a number, a text with a unit, or a multiple of the default as
    "0.5x"; or to None for the controller's own range. Parameters given to the controller are left as given.
    Raises InputError with all mistakes.

    >>> from softstart.controller import make_controller
    >>> [one.text() for one in ranges_of(make_controller("ramp"), {"time": ("50 ms", "0.3 s")})]
    ['0.05 to 0.3 s']
    """
    known, what = declared_parameters(controller), f"the controller {label_of(controller)}"
    if free is None:
        free = [name for name in tunable_parameters(controller) if getattr(controller, name) is None]
    asked = (
        {free: None} if isinstance(free, str) else free if isinstance(free, Mapping) else dict.fromkeys(free)
    )
    if not asked:
        example = next((name for name, one in known.items() if one.kind == "quantity"), "NAME")
        raise InputError(
            f"free: {what} declares no tunable parameter; name one with its range, as "
            f'free={{"{example}": ("0.5x", "2x")}}.'
        )
    ranges, wrong = list[Range](), Mistakes()
    for name, ends in asked.items():
        with wrong.collect("free: "):
            if name not in known:
                near = nearest(name, known)
                hint = f"did you mean {near}?" if near else f"it has {', '.join(known) or 'none'}."
                raise InputError(f"{what} has no parameter {name}; {hint}")
            if known[name].kind != "quantity":
                raise InputError(f"{name} of {what} is not a quantity; it cannot be tuned.")
            declared = _declared(known[name]) if ends is None else _named(known[name], ends)
            if declared is None:
                raise InputError(
                    f'{what} gives no range for {name}; give one, as free={{"{name}": ("0.5x", "2x")}} or '
                    "with two values."
                )
            ranges.append(declared)
    wrong.raise_if_any()
    return tuple(ranges)


def _declared(p: ControllerParameter) -> Range | None:
    """The range that a controller declares for a parameter."""
    if p.multiples is None and p.between is None:
        return None
    return Range(p.name, p.unit, p.multiples, p.between, logarithmic=p.multiples is not None)


def _named(p: ControllerParameter, ends: object) -> Range:
    """The user's own range."""
    name, unit = p.name, p.unit
    both = [] if isinstance(ends, str) or not isinstance(ends, Iterable) else list(ends)
    multiples = [found[0] for end in both if (found := read_multiple(end, name))]
    values = multiples or [number_in(unit, end, name) for end in both]
    if len(both) != 2 or len(values) != 2 or not values[0] < values[1] or (multiples and values[0] <= 0.0):
        raise InputError(
            f"{name} = {ends!r}: give its lowest and highest value in this order, or both as multiples "
            "of the default above 0, as 0.5x and 2x."
        )
    low, high = values
    if multiples:
        return Range(name, unit, multiples=(low, high), logarithmic=True)
    return Range(name, unit, between=(low, high), logarithmic=0.0 < WIDE * low <= high)
