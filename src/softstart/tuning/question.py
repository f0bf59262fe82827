"""What is to be tuned, for what, and how thoroughly: read and checked once, then fixed."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

from softstart import __version__
from softstart.drive import Drive
from softstart.errors import InputError
from softstart.quantities import to_si
from softstart.tuning.ranges import Range, check_number
from softstart.tuning.recipe import Recipe
from softstart.tuning.tolerances import Scenario

Metric = str | Callable[[Mapping[str, Any]], Any]


class Bound(NamedTuple):
    """The bound on the start time: that of the defaults, a multiple of that of `direct`, or seconds."""

    kind: Literal["defaults", "direct", "seconds"]
    value: float = 1.0

    def text(self) -> str:
        """The bound in words."""
        if self.kind == "defaults":
            return "no slower than with the defaults"
        if self.kind == "direct":
            return f"at most {self.value:g} times the start time of direct"
        return f"at most {self.value:g} s"


def bound_of(start_time: object) -> Bound:
    """The bound asked for: None, seconds, or "1.2x" as a multiple of the start time of `direct`.

    >>> bound_of(None).kind, bound_of("1.2x"), bound_of("300 ms")
    ('defaults', Bound(kind='direct', value=1.2), Bound(kind='seconds', value=0.3))
    """
    if start_time is None:
        return Bound("defaults")
    meaning = 'a time above 0 s, as 0.3 or "300 ms", or a multiple of the start time of direct, as "1.2x"'
    kind: Literal["direct", "seconds"] = "seconds"
    value: object = start_time
    if isinstance(start_time, str):
        multiple = re.fullmatch(r"\s*(.*?)\s*[xX]\s*", start_time)
        kind = "direct" if multiple else "seconds"
        text = multiple[1] if multiple else start_time
        try:
            value = to_si(text, "1" if multiple else "s", name="start_time")
        except InputError:
            raise InputError(f'start_time = "{start_time}": give {meaning}.') from None
        if not float(value) > 0.0:
            raise InputError(f'start_time = "{start_time}": give {meaning}.')
    return Bound(kind, check_number("start_time", value, 0.0, math.inf, meaning))


@dataclass(frozen=True, eq=False)
class Question:
    """Everything that the answer depends on. Cells go through the gaps, load inertias fastest."""

    drive: Drive
    recipe: Recipe
    gaps: tuple[float, ...]
    load_inertias: tuple[float, ...]
    ranges: tuple[Range, ...]
    scenarios: tuple[Scenario, ...]
    metric: Metric
    bound: Bound
    quantile: float
    base: Drive | None
    seed: int
    restarts: int
    population: int
    generations: int

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters that are tuned."""
        return tuple(one.name for one in self.ranges)

    @property
    def cells(self) -> tuple[tuple[float, float], ...]:
        """Gap and load inertia of each cell."""
        return tuple((gap, inertia) for gap in self.gaps for inertia in self.load_inertias)

    @property
    def metric_name(self) -> str:
        """Name of the figure that is made small."""
        return self.metric if isinstance(self.metric, str) else getattr(self.metric, "__name__", "metric")

    def drive_of(self, cell: int) -> Drive:
        """The drive of a cell, as it is."""
        gap, inertia = self.cells[cell]
        return self.drive.replace(gap=gap, load_inertia=inertia)

    def neighbours(self, cell: int) -> tuple[int, ...]:
        """The cells beside a cell on the grid."""
        width = len(self.load_inertias)
        row, column = divmod(cell, width)
        beside = ((row - 1, column), (row + 1, column), (row, column - 1), (row, column + 1))
        return tuple(r * width + c for r, c in beside if 0 <= r < len(self.gaps) and 0 <= c < width)

    def inputs(self) -> dict[str, Any]:
        """All of it as plain data: what saved parts belong to."""
        return {
            "version of softstart": __version__,
            "drive": self.drive.to_toml(),
            "controller": [
                self.recipe.name or repr(self.recipe.object),
                repr(sorted(self.recipe.given.items())),
            ],
            "gaps": list(self.gaps),
            "inertias": list(self.load_inertias),
            "free parameters": [repr(one) for one in self.ranges],
            "tolerances": [repr(sorted(one.items())) for one in self.scenarios],
            "metric": self.metric if isinstance(self.metric, str) else _code_of(self.metric),
            "start time": list(self.bound),
            "quantile": self.quantile,
            "base drive": self.base.to_toml() if self.base else "",
            "seed": self.seed,
            "restarts": self.restarts,
            "population": self.population,
            "generations": self.generations,
        }


def _code_of(metric: Callable[..., Any]) -> str:
    """A function's name and what it does, so that another one of the same name is told apart."""
    code = getattr(metric, "__code__", None)
    told = "" if code is None else f" {code.co_code.hex()} {code.co_consts!r} {code.co_names!r}"
    return f"{getattr(metric, '__module__', '')}.{getattr(metric, '__qualname__', repr(metric))}{told}"
