"""What a drive may be off by: scenarios that tuned gains have to stand beside each cell's own drive."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from numbers import Real
from typing import Any, NamedTuple

import numpy as np

from softstart.drive import PARAMETERS, Drive
from softstart.errors import InputError
from softstart.quantities import nearest, to_si

MOST = 16  # scenarios beside the drive as it is; more combinations are sampled


class Level(NamedTuple):
    """A changed value: factor * value + offset."""

    factor: float
    offset: float

    def of(self, value: Any) -> Any:
        """The value changed."""
        return self.factor * value + self.offset


Scenario = dict[str, Level]


def scenarios_of(
    drive: Drive, tolerances: Mapping[str, Any] | None, seed: int = 0, most: int = MOST
) -> tuple[Scenario, ...]:
    """The drive as it is, and its parameters off by their tolerances in all combinations.

    A tolerance is a share as "10 %" (the value 10 % lower and higher), a quantity as 0.5 or "0.2 ms" (so much
    lower and higher), or a list of the values to be met. Where there are more than `most` combinations, a
    Latin hypercube of `most` within the tolerances stands for them, drawn with `seed`. Raises InputError.

    >>> crane = Drive.load("crane-4amtkf")
    >>> scenarios_of(crane, {"stiffness": "10 %"})
    ({}, {'stiffness': Level(factor=0.9, offset=0.0)}, {'stiffness': Level(factor=1.1, offset=0.0)})
    >>> len(scenarios_of(crane, {"stiffness": "10 %", "load_torque": "20 %", "torque_lag": [0, "2 ms"]}))
    9
    """
    levels: dict[str, list[Level]] = {}
    wrong: list[str] = []
    for name, given in (tolerances or {}).items():
        try:
            levels[name] = _levels(name, given)
            for level in levels[name]:
                changed: Any = {name: level.of(getattr(drive, name))}
                drive.replace(**changed)
        except InputError as error:
            wrong += [s if s.startswith("tolerances") else f"tolerances: {s}" for s in error.sentences]
    if wrong:
        raise InputError(wrong)
    if not levels:
        return ({},)
    if math.prod(map(len, levels.values())) <= most:
        combined = [dict(zip(levels, one, strict=True)) for one in itertools.product(*levels.values())]
    else:
        combined = _sampled(levels, seed, most)
    return ({}, *combined)


def _levels(name: str, given: Any) -> list[Level]:
    parameter = PARAMETERS.get(name)
    if parameter is None or not parameter.unit:
        near = nearest(name, [p.name for p in PARAMETERS.values() if p.unit])
        hint = f"did you mean {near}?" if near else "name a field of a Drive, as stiffness."
        raise InputError(f"tolerances: {name} is no quantity of a drive; {hint}")
    if isinstance(given, list | tuple | np.ndarray):
        values = np.atleast_1d(to_si(list(given), parameter.unit, name=f"tolerances {name}"))
        return [Level(0.0, float(value)) for value in values]
    if isinstance(given, str) and given.strip().endswith("%"):
        share = 0.01 * float(to_si(given.strip()[:-1], "1", name=f"tolerances {name}"))
        if not 0.0 < share < 1.0:
            raise InputError(f'tolerances: {name} = "{given}": give a share above 0 % and below 100 %.')
        return [Level(1.0 - share, 0.0), Level(1.0 + share, 0.0)]
    if isinstance(given, bool) or not isinstance(given, str | Real):
        raise InputError(
            f'tolerances: {name} = {given!r}: give a share as "10 %", a quantity, or a list of values.'
        )
    spread = float(to_si(given, parameter.unit, name=f"tolerances {name}"))
    if not spread > 0.0:
        raise InputError(f"tolerances: {name} = {given}: give how far it may be off, above 0.")
    return [Level(1.0, -spread), Level(1.0, spread)]


def _sampled(levels: dict[str, list[Level]], seed: int, count: int) -> list[Scenario]:
    """A Latin hypercube between the levels of each parameter; lists of values are drawn from."""
    rng = np.random.default_rng([seed, 1])
    strata = rng.permuted(np.tile(np.arange(count), (len(levels), 1)), axis=1).T
    points = (strata + rng.random(strata.shape)) / count
    found = []
    for point in points:
        scenario = {}
        for (name, ends), share in zip(levels.items(), point, strict=True):
            if ends[0].factor == 0.0:
                scenario[name] = ends[int(share * len(ends))]
            else:
                low, high = ends
                scenario[name] = Level(
                    low.factor + share * (high.factor - low.factor),
                    low.offset + share * (high.offset - low.offset),
                )
        found.append(scenario)
    return found
