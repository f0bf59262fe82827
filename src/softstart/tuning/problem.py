"""What is to be tuned, over what, for what, and how thoroughly: read and checked once, then fixed."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import MISSING, dataclass, fields
from functools import cached_property
from numbers import Real
from typing import Any, NamedTuple

import numpy as np

from softstart import __version__
from softstart.arrays import Vector
from softstart.chain.machines import as_machine, listed_of, quantity_of, varied
from softstart.controller import Controller
from softstart.controller.recipe import Recipe
from softstart.controller.tuned import Tuned
from softstart.drive import Drive, Duty
from softstart.drive.machine import Machine
from softstart.drive.machine_table import MachineTable
from softstart.errors import InputError, Mistakes
from softstart.hints import nearest
from softstart.input.parameters import ParameterValue
from softstart.optimal.problem import StartTime
from softstart.quantities import check_whole, multiplied, to_si
from softstart.start.comparison import as_far_as_known
from softstart.start.demand import ControllerLike, as_recipe
from softstart.start.duty_batch import DutyPlan
from softstart.start.results import has_margin
from softstart.tuning.ranges import Free, Range, ranges_of
from softstart.tuning.search import latin

MARGIN = "margin"  # a metric that is made large


@dataclass(frozen=True, eq=False)
class TuningProblem:
    """Everything that the answer depends on. Cells go through the gaps, load inertias fastest."""

    drive: Machine
    recipe: Recipe
    gaps: tuple[float, ...]
    load_inertias: tuple[float, ...]
    ranges: tuple[Range, ...]
    scenarios: tuple[Scenario, ...]
    metric: str
    start_time: StartTime | None
    quantile: float
    seed: int
    restarts: int
    population: int
    generations: int
    plan: DutyPlan | None = None  # each start is a duty
    soft: Drive | None = None  # at the soft end of an unknown stiffness: the second half of the scenarios

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
        """Name of the figure that is made small; for the margin, which is made large, what is not left."""
        return "limit_share" if self.metric == MARGIN else self.metric

    @property
    def limited(self) -> bool:
        """Whether the permissible start time is part of the margin, and there is no other bound."""
        return self.start_time is None and self.metric == MARGIN and self.drive.limits.start_time is not None

    @cached_property
    def time(self) -> str:
        """The figure that the bound is on: the settled time of a strategy that holds the speed."""
        ready, own = self.recipe.make().set_up(self.drive.design_drive)
        return "start_time" if ready.regulation(own) is None else "settled_time"

    @property
    def time_name(self) -> str:
        """Its name in words."""
        return self.time.replace("_", " ")

    @property
    def bound(self) -> str:
        """The bound on the start time in words."""
        if (asked := self.start_time) is not None:
            unit = f"times the {self.time_name} of direct" if asked.multiple else "s"
            return f"at most {asked.value:g} {unit}"
        return "by the limits of the drive" if self.limited else "no slower than with the defaults"

    def drive_of(self, cell: int) -> Machine:
        """The drive or chain of a cell, as it is."""
        return self.drive.with_gap_and_inertia(*self.cells[cell])

    def declared(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Gaps and load inertias as the drives declare them for which controllers are set up."""
        rows = [self.drive.with_gap_and_inertia(gap, self.load_inertias[0]).design_drive for gap in self.gaps]
        columns = [
            self.drive.with_gap_and_inertia(self.gaps[0], one).design_drive for one in self.load_inertias
        ]
        return tuple(float(one.gap) for one in rows), tuple(float(one.load_inertia) for one in columns)

    def neighbours(self, cell: int) -> tuple[int, ...]:
        """The cells beside a cell on the grid."""
        width = len(self.load_inertias)
        row, column = divmod(cell, width)
        beside = ((row - 1, column), (row + 1, column), (row, column - 1), (row, column + 1))
        return tuple(r * width + c for r, c in beside if 0 <= r < len(self.gaps) and 0 <= c < width)

    def inputs(self) -> dict[str, Any]:
        """All of it as plain data: what saved parts belong to."""
        plain = (
            "gaps", "load_inertias", "metric", "quantile", "seed", "restarts", "population", "generations"
        )  # fmt: skip
        return {
            "version of softstart": __version__,
            "drive": self.drive.saved_as,
            "controller": self.recipe.about(),
            "free parameters": [repr(one) for one in self.ranges],
            "tolerances": [repr(sorted(one.items())) for one in self.scenarios],
            "start time": self.bound,
            **{name: getattr(self, name) for name in plain},
            **({} if self.plan is None else self.plan.inputs()),
        }


DRAWN = 100  # drives that stand for an identification
SMALLEST_POPULATION, PLACES_A_PARAMETER = 20, 8
LEAST_OF_SEARCH = {"seed": 0, "restarts": 1, "generations": 1, "population": 5}


def tuning_problem(
    machine: Any,
    controller: ControllerLike,
    gaps: object,
    inertias: object,
    *,
    parameters: Mapping[str, object] | None,
    free: Free,
    metric: str,
    start_time: float | str | None,
    tolerances: Mapping[str, Any] | None,
    quantile: float,
    search: Mapping[str, Any],
    duty: Duty | str | bool | None,
    stop: str | None,
    cycles: int,
) -> TuningProblem:
    """The arguments of `tune`, read; InputError with all mistakes."""
    known, drawn, soft = as_far_as_known(machine, DRAWN)
    if drawn is not None:
        gaps = [known.gap] if gaps is None else gaps
        inertias = [known.load_inertia] if inertias is None else inertias
    drive, wrong = as_machine(known), Mistakes()
    search = {name: number for name, number in search.items() if number is not None}
    for name, number in search.items():
        with wrong.collect():
            check_whole(number, name, LEAST_OF_SEARCH[name])
    with wrong.collect():
        scenarios = tuning_scenarios(drive, tolerances, 0 if wrong.sentences else search["seed"])
        if others := drawn or soft:
            scenarios = scenarios_drawn(known, others, scenarios)
    with wrong.collect():
        recipe = recipe_of(controller, parameters)
        ranges = ranges_of(recipe.make(), free)
    with wrong.collect():
        rows = gaps_of(drive, gaps)
    with wrong.collect():
        columns = inertias_of(drive, inertias)
    with wrong.collect():
        bound = None if start_time is None else StartTime.of(start_time)
    if not isinstance(quantile, Real) or isinstance(quantile, bool) or not 0.0 < float(quantile) <= 1.0:
        wrong.sentences.append(f"quantile = {quantile!r}: give a share of the starts above 0, at most 1.")
    if not isinstance(metric, str):
        wrong.sentences.append(f"metric = {metric!r}: name a figure of a start, as k_dyn.")
    plan: DutyPlan | None = None
    with wrong.collect():
        plan = DutyPlan.of(drive, duty, stop, cycles)
    if metric == MARGIN and not has_margin(drive.limits):
        wrong.sentences.append(f"metric = margin: the {drive.KIND} has no limits; give {drive.LIMITS_GIVEN}.")
    wrong.raise_if_any()
    size = {"population": max(SMALLEST_POPULATION, PLACES_A_PARAMETER * len(ranges))}
    return TuningProblem(
        drive, recipe, rows, columns, ranges, scenarios, metric, bound, float(quantile), plan=plan, soft=soft,
        **(size | dict(search)),
    )  # fmt: skip


def recipe_of(controller: ControllerLike, parameters: Mapping[str, object] | None = None) -> Recipe:
    """The recipe of a controller; InputError for one whose gains are tuned already."""
    recipe = as_recipe(controller, parameters)
    if isinstance(strategy := recipe.make(), Tuned):
        raise InputError(
            f"controller = {strategy.name}: its gains are already tuned; tune the controller itself."
        )
    return recipe


def given_to(controller: Controller) -> dict[str, Any]:
    """The parameters that were given to a controller, those that differ from the defaults of its class."""
    return {
        f.name: value
        for f in fields(controller)
        if (value := getattr(controller, f.name)) is not None and (f.default is MISSING or value != f.default)
    }


GAP_MULTIPLES = (0.5, 1.0, 2.0, 4.0)  # of the drive's own gap
INERTIA_MULTIPLES = (0.4, 1.0, 2.0)  # of the drive's own load inertia


def gaps_of(drive: Machine, given: object = None, name: str = "gaps") -> tuple[float, ...]:
    """Gaps in rad, rising: numbers, texts with a unit, or multiples of the drive's own as "2x".

    Those of a chain are the sum of all its gaps at the motor shaft, widened alike. Of a drive with a gear
    also "9 arcmin at output".

    >>> gaps_of(Drive.load("crane-4amtkf"), ["2x", 0.5, "30 deg"])
    (0.5, 0.5235987755982988, 1.0)
    """
    gap, inertia = drive.gap_and_inertia
    if given is None:
        if not gap > 0.0:
            raise InputError(f"{name}: the drive has no gap; give the gaps in rad.")
        given = [f"{factor}x" for factor in GAP_MULTIPLES]
    return _axis(drive, "gap", given, name, {"x": gap}, lambda gap: drive.with_gap_and_inertia(gap, inertia))


def inertias_of(drive: Machine, given: object = None, name: str = "inertias") -> tuple[float, ...]:
    """Load inertias in kg m2, rising; also multiples of the drive's own ("2x") or of the motor's ("5 J1").

    >>> [round(inertia, 3) for inertia in inertias_of(Drive.load("crane-4amtkf"), ["2 J1", "1x", 0.1])]
    [0.07, 0.1, 0.175]
    """
    gap, inertia = drive.gap_and_inertia
    given = [f"{factor}x" for factor in INERTIA_MULTIPLES] if given is None else given
    units = {"x": inertia, "J1": drive.motor_inertia_at_load}
    return _axis(
        drive, "load_inertia", given, name, units, lambda inertia: drive.with_gap_and_inertia(gap, inertia)
    )


def _axis(
    drive: Machine,
    key: str,
    given: object,
    name: str,
    units: dict[str, float],
    check: Callable[[float], object],
) -> tuple[float, ...]:
    """Values of a parameter in SI, each once, rising."""
    listed = listed_of(given, name)
    if not listed:
        raise InputError(f"{name}: the list is empty; give at least one value, or leave it out.")
    values, wrong = set[float](), Mistakes()
    for text in listed:
        with wrong.collect():
            values.add(value := quantity_of(drive, key, multiplied(text, name, units), name))
            with wrong.collect(f"{name}: "):
                check(value)
    wrong.raise_if_any()
    return tuple(sorted(values))


MOST = 16  # scenarios beside the drive as it is; more combinations are sampled


class Level(NamedTuple):
    """A changed value: factor * value + offset."""

    factor: float
    offset: float

    def of(self, value: Vector) -> Vector:
        """The value changed."""
        return self.factor * value + self.offset


Scenario = dict[str, Level]


def tuning_scenarios(
    drive: Machine, tolerances: Mapping[str, Any] | None, seed: int = 0, most: int = MOST
) -> tuple[Scenario, ...]:
    """The drive as it is, and its parameters off by their tolerances in all combinations.

    A tolerance is a share as "10 %" (the value 10 % lower and higher), a quantity as 0.5 or "0.2 ms" (so much
    lower and higher), or a list of the values to be met. Where there are more than `most` combinations, a
    Latin hypercube of `most` within the tolerances stands for them, drawn with `seed`. Of a chain also one
    mass or shaft may be named, as "shaft[2].gap". Raises InputError.

    >>> crane = Drive.load("crane-4amtkf")
    >>> tuning_scenarios(crane, {"stiffness": "10 %"})
    ({}, {'stiffness': Level(factor=0.9, offset=0.0)}, {'stiffness': Level(factor=1.1, offset=0.0)})
    >>> len(tuning_scenarios(crane, {"stiffness": "10 %", "load_torque": "20 %", "torque_lag": [0, "2 ms"]}))
    9
    """
    levels, wrong = dict[str, list[Level]](), Mistakes()
    for name, given in (tolerances or {}).items():
        with wrong.collect("tolerances: "):
            knob = _knob(drive, name)
            levels[knob.name] = _levels(drive, knob, given)
            for level in levels[knob.name]:
                drive.with_values({knob.name: level.of(knob.value)})
    wrong.raise_if_any()
    if not levels:
        return ({},)
    if math.prod(map(len, levels.values())) <= most:
        combined = list(itertools.product(*levels.values()))
    else:
        places = latin(np.random.default_rng([seed, 1]), most, len(levels))
        combined = [tuple(map(_within, levels.values(), place)) for place in places]
    return ({}, *(dict(zip(levels, one, strict=True)) for one in combined))


def scenarios_drawn(
    drive: Drive, drawn: MachineTable | Drive, scenarios: Sequence[Scenario]
) -> tuple[Scenario, ...]:
    """The drive as it is, and drives that are left possible, each under the next one of the tolerances.

    A single one, that of the soft end of an unknown stiffness, is under each of them, as the drive itself is.

    >>> crane = Drive.load("crane-4amtkf")
    >>> from softstart import machine_table
    >>> scenarios_drawn(crane, machine_table(crane, gap=[0.4, 0.6]), ({},))
    ({}, {'gap': Level(factor=0.8, offset=0.0)}, {'gap': Level(factor=1.2, offset=0.0)})
    """
    nominal = drive.values()
    combined: list[Scenario] = [{}]
    if isinstance(drawn, Drive):
        combined = [*scenarios]
        soft_end = {name: np.full(len(scenarios), getattr(drawn, name)) for name in ("stiffness", "damping")}
        drawn = varied(drive, soft_end)
    varying = {name: values for name, values in drawn.fields.items() if np.any(values != nominal[name])}
    if both := sorted(set(varying) & {name for one in scenarios for name in one}):
        raise InputError(f"tolerances: {both[0]} has an interval of its own already; leave it out.")
    for k in range(len(drawn)):
        levels = {
            name: Level(float(values[k]) / float(nominal[name]), 0.0) for name, values in varying.items()
        }
        combined.append({**scenarios[k % len(scenarios)], **levels})
    return tuple(combined)


def _knob(drive: Machine, name: str) -> ParameterValue:
    """The quantity of a drive or chain that has a tolerance."""
    quantity = drive.parameter_value(name)
    if quantity is not None and quantity.parameter.unit:
        return quantity
    known = {
        path: one
        for path in drive.parameter_keys()
        if (one := drive.parameter_value(path)) and one.parameter.unit
    }
    near = nearest(name, [*known, *(one.name for one in known.values())])
    hint = f"did you mean {near}?" if near else f"name one of its file, as {next(iter(known))}."
    raise InputError(f"{name} is not a quantity of a {drive.KIND}; {hint}")


def _levels(drive: Machine, knob: ParameterValue, given: object) -> list[Level]:
    name = knob.name
    if isinstance(given, list | tuple | np.ndarray):
        each = listed_of(given, name)
        return [Level(0.0, quantity_of(drive, name, one, name)) for one in each]
    if isinstance(given, str) and given.strip().endswith("%"):
        share = 0.01 * float(to_si(given.strip()[:-1], "1", name=name))
        if not 0.0 < share < 1.0:
            raise InputError(f'{name} = "{given}": give a share above 0 % and below 100 %.')
        return [Level(1.0 - share, 0.0), Level(1.0 + share, 0.0)]
    spread = quantity_of(drive, name, given, name)
    if not spread > 0.0:
        raise InputError(f"{name} = {given}: give how far it may be off, above 0.")
    return [Level(1.0, -spread), Level(1.0, spread)]


def _within(levels: list[Level], share: float) -> Level:
    """A level between two, or one of a list of values."""
    low, high = levels[0], levels[-1]
    if low.factor == 0.0:
        return levels[int(share * len(levels))]
    return Level(*(one + share * (other - one) for one, other in zip(low, high, strict=True)))
