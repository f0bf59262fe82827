"""The grid of a sweep: its axes, and the chunks into which it is cut.

Chunks are never listed: a chunk is a number, and its place on the grid follows from it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import Field, dataclass, fields, replace
from functools import cached_property
from typing import Any, Literal

import numpy as np

from softstart.chain.machines import Machine
from softstart.controller.finding import quantity
from softstart.controller.recipe import Recipe
from softstart.controller.tuned import Tuned
from softstart.drive import INFORMATIVE_TABLES, PARAMETERS
from softstart.errors import InputError, Mistakes
from softstart.input.parameters import Wording, meant_by, read_value
from softstart.quantities import RefusedError, multiplied, nearest, show

Owner = Literal["drive", "parameter", "controller"]
PREFIX = "controller"
ONE_OF_TWO = "controller: name one, or make several an axis of the grid; one of the two."


@dataclass(frozen=True, eq=False)
class Column:
    """The values that one parameter takes: float64 numbers in `unit`, or texts.

    `owner` "drive": the field `field` of the drive; "parameter": a parameter of the controller;
    "controller": the controller itself, by name.
    """

    name: str
    owner: Owner
    field: str
    unit: str
    meaning: str
    values: Any

    @property
    def numeric(self) -> bool:
        """Whether the values are numbers."""
        return isinstance(self.values, np.ndarray)

    @property
    def size(self) -> int:
        """How many values there are."""
        return len(self.values)

    def part(self, place: slice) -> Column:
        """The column with some of its values."""
        return replace(self, values=self.values[place])


@dataclass(frozen=True, eq=False)
class Axis:
    """A dimension of the grid: one column, or several whose values belong together (samples)."""

    name: str
    columns: tuple[Column, ...]

    @property
    def size(self) -> int:
        """Length of the axis."""
        return self.columns[0].size

    def part(self, place: slice) -> Axis:
        """A piece of the axis."""
        return Axis(self.name, tuple(column.part(place) for column in self.columns))

    @property
    def paired(self) -> bool:
        """Whether the axis numbers samples of several parameters."""
        return any(column.name != self.name for column in self.columns)

    @property
    def numeric(self) -> bool:
        """Whether all values along it are numbers."""
        return all(column.numeric for column in self.columns)


@dataclass(frozen=True)
class Subject:
    """What the axes of a grid vary: a machine and its controller, or the `controllers` that are an axis.

    >>> from softstart.chain import Chain
    >>> crane = Subject(Chain.load("crane-4-mass"), Recipe("ramp"))
    >>> crane.column("shaft[2].gap", ["0.5x", "2x"]).values.tolist()
    [0.1, 0.4]
    >>> crane.target("load.inertia"), crane.target("controller.time"), crane.target("controller")
    (('drive', 'load_inertia'), ('parameter', 'time'), ('controller', ''))
    """

    machine: Machine
    recipe: Recipe
    controllers: tuple[str, ...] = ()

    @cached_property
    def parameters(self) -> dict[str, Field[Any]]:
        """The parameters that all controllers have, alike in unit and kind."""
        wrong, tables = Mistakes(), list[dict[str, Field[Any]]]()
        for name in self.controllers or ("",):
            with wrong.noted():
                found = self.recipe.class_of(name) if name or self.recipe.given else Tuned
                # the fields of tuned gains are what stands in their file
                tables.append({} if issubclass(found, Tuned) else {f.name: f for f in fields(found)})
        wrong.settle()
        return {
            name: one
            for name, one in tables[0].items()
            if all(name in other and _kind(other[name]) == _kind(one) for other in tables)
        }

    def target(self, key: str) -> tuple[Owner, str]:
        """Whose parameter a key of the grid names, and which; InputError for an unknown one."""
        if key == PREFIX:
            return "controller", ""
        if key.startswith((f"{PREFIX}.", f"{PREFIX}_")):
            return "parameter", key[len(PREFIX) + 1 :]
        if (found := self.machine.knob(key)) is not None:
            return "drive", found.name
        own = {name: f"{PREFIX}.{name}" for name in self.parameters}
        words = {word: word for word in (*self.machine.knobs(), PREFIX, *own.values())} | own
        like = meant_by(key, PARAMETERS.values()) if "[" not in key else []
        meant = [own[key]] if key in own else [p.name for p in like if self.machine.knob(p.name)]
        if not meant and (close := nearest(key, words)):
            meant = [words[close]]
        other = f"take a parameter of the {self.machine.KIND} or {PREFIX}.NAME."
        hint = f"did you mean {' or '.join(meant)}?" if meant else other
        raise InputError(f"{key}: there is no such axis; {hint}")

    def column(self, key: str, values: Any) -> Column:
        """The values of a parameter, read and checked; InputError in one sentence."""
        owner, name = self.target(key)
        if isinstance(values, str | bytes) or not (
            isinstance(values, Sequence) or hasattr(values, "__array__")
        ):
            raise InputError(
                f"{key} = {show(values)}: give the values of this axis in a list, as [0.5, 1, 2]."
            )
        if owner == "controller":
            return Column(PREFIX, owner, "", "", "controller", _texts(key, values))
        if owner == "drive":
            return self._of_machine(key, name, values)
        if name not in self.parameters:
            close, several = nearest(name, self.parameters), ", ".join(self.controllers)
            lacking = f"not all of {several} have this" if several else f"{self.recipe.label} has no such"
            hint = f"did you mean {PREFIX}.{close}?" if close else f"there are {', '.join(self.parameters)}."
            raise InputError(f"{key}: {lacking} parameter; {hint}")
        if name in self.recipe.values:
            raise InputError(f"{key}: the parameter {name} has one value already; leave one of the two out.")
        unit, kind = _kind(self.parameters[name])
        if kind == "object":
            raise InputError(f"{key}: an axis carries numbers or texts, and this parameter is an object.")
        meaning = self.parameters[name].metadata.get("meaning") or name
        listed = list(values)
        read = _texts(key, listed) if kind == "text" else _flat(key, quantity(key, listed, unit))
        return Column(f"{PREFIX}_{name}", owner, name, unit, meaning, read)

    def _of_machine(self, key: str, name: str, values: Any) -> Column:
        found = self.machine.knob(name)
        assert found is not None
        parameter, wording = found.parameter, Wording(written={name: key})
        if (not parameter.unit and not parameter.choices) or parameter.table in INFORMATIVE_TABLES:
            raise InputError(f"{key}: the {parameter.meaning} changes no start; sweep another parameter.")
        words = any(isinstance(value, str) and value in parameter.choices for value in values)
        given: Any = values
        try:
            if words or not parameter.unit:
                texts = _texts(key, values)
                for given in texts:
                    read_value(parameter, given)
                return Column(name, "drive", name, "", parameter.meaning, texts)
            own = {"x": found.value} if isinstance(found.value, float) and not parameter.many else {}
            given = [multiplied(value, key, own) for value in values]
            read = read_value(parameter, given, batch=True)
        except RefusedError as reason:
            raise InputError(wording.refused(parameter, given, reason)) from None
        return Column(name, "drive", name, parameter.unit, parameter.meaning, _flat(key, read))


def _kind(field: Field[Any]) -> tuple[str, str]:
    return field.metadata.get("unit", ""), field.metadata.get("kind", "quantity")


def read_grid(grid: object, recipe: Recipe, machine: Machine) -> tuple[Axis, ...]:
    """The axes in the order of the grid, or one InputError for all that is wrong with them.

    >>> from softstart import Drive
    >>> grid = {"load.inertia": ["700 kg*cm^2", 0.175], "gap": [0.5, 1, "4x"]}
    >>> axes = read_grid(grid, Recipe("direct"), Drive.load("crane-4amtkf"))
    >>> [(axis.name, axis.columns[0].values.tolist()) for axis in axes]
    [('load_inertia', [0.07, 0.175]), ('gap', [0.5, 1.0, 2.0])]
    """
    if not isinstance(grid, Mapping) or not grid:
        raise InputError(
            f'grid = {show(grid)}: give the axes as a mapping of names to values, as {{"gap": [0.5, 1, 2]}}.'
        )
    wrong, axes, first = Mistakes(), list[Axis](), dict[str, str]()
    if (PREFIX in grid) == bool(recipe.given):
        wrong.sentences.append(ONE_OF_TWO)
    if PREFIX in grid and recipe.values:
        wrong.sentences.append(
            f"parameters = {show(dict(recipe.values))}: with several controllers give each parameter as "
            "an axis, of one value if need be."
        )
    wrong.settle()
    names = grid.get(PREFIX, ())
    listed = () if isinstance(names, str) or not isinstance(names, Sequence) else names
    subject = Subject(machine, recipe, tuple(name for name in listed if isinstance(name, str)))
    _ = subject.parameters  # wrong controllers are told first
    for key, values in grid.items():
        paired, columns = isinstance(values, Mapping), list[Column]()
        for name, given in values.items() if paired else [(key, values)]:
            with wrong.noted():
                column = subject.column(str(name), given)
                columns.append(column)
                if column.name in first:
                    same = first[column.name]
                    wrong.sentences.append(f"{name}: this is the same as {same}; name each parameter once.")
                first[column.name] = str(name)
        if paired:
            wrong.sentences += _wrong_samples(str(key), columns, len(values))
        elif columns:
            wrong.sentences += _repeated(columns[0])
        if columns:
            axes.append(Axis(str(key) if paired else columns[0].name, tuple(columns)))
    wrong.settle()
    return tuple(axes)


def _flat(key: str, values: object) -> Any:
    found = np.array(values, dtype=np.float64)
    if found.ndim != 1:
        raise InputError(f"{key}: its values have shape {found.shape}; give them in one row.")
    return found


def _texts(key: str, values: Any) -> tuple[str, ...]:
    listed = tuple(values)
    bad = [value for value in listed if not isinstance(value, str) or not value]
    if bad or not listed:
        raise InputError(f"{key} = {show(bad[0] if bad else [])}: this axis takes names, in a list.")
    return listed


def _repeated(column: Column) -> list[str]:
    """An axis names each place once, so that results can be looked up by value."""
    if not column.numeric:
        twice = [value for index, value in enumerate(column.values) if value in column.values[:index]]
    else:
        ordered = np.sort(column.values)
        twice = ordered[1:][ordered[1:] == ordered[:-1]].tolist()
    return [f"{column.name} = {show(twice[0])}: this value is given twice; give each once."] if twice else []


def _wrong_samples(name: str, columns: list[Column], count: int) -> Iterator[str]:
    """What is wrong with parameters that vary together."""
    if not name.isidentifier() or any(column.name == name for column in columns):
        yield f"{show(name)}: name the samples by one word that is none of their parameters, as sample."
    if not count:
        yield f"{name}: these samples have no parameter; give some, as {{'gap': [0.5, 0.6]}}."
    if len({column.size for column in columns}) > 1:
        sizes = ", ".join(f"{column.name} has {column.size}" for column in columns)
        yield f"{name}: all parameters of samples need equally many values; {sizes}."
    for column in columns:
        if not column.numeric:
            yield f"{column.name}: samples are numbers; make an axis of its own of these names."


MOST = 16_384  # starts of a chunk: sampled ones take about a second
LEAST = 1_024
PARTS = 64  # into which a small grid is cut, so that all processes have work


@dataclass(frozen=True)
class Plan:
    """A grid of `shape` in chunks of shape `chunk`, the last index fastest; those at the edge are smaller.

    >>> plan = Plan((3, 5), (1, 2))
    >>> plan.chunks, plan.index(5), plan.place((1, 2)), plan.size((1, 2))
    (9, (1, 2), (slice(1, 2, None), slice(4, 5, None)), 1)
    """

    shape: tuple[int, ...]
    chunk: tuple[int, ...]

    @classmethod
    def of(cls, shape: Sequence[int], single: Sequence[bool], most: int | None = None) -> Plan:
        """Chunks of at most `most` starts, of one value along the axes that are `single`.

        Without `most` a chunk has a 64th of the grid, within 1,024 and 16,384 starts.

        >>> Plan.of((1000, 1000), (False, False)).chunk, Plan.of((2, 100), (True, False)).chunk
        ((15, 1000), (1, 100))
        """
        room = min(max(math.prod(shape) // PARTS, LEAST), MOST) if most is None else most
        chunk = list[int]()
        for size, alone in zip(reversed(shape), reversed(single), strict=True):
            step = 1 if alone else max(1, min(size, room))
            room //= step
            chunk.insert(0, step)
        return cls(tuple(shape), tuple(chunk))

    @property
    def starts(self) -> int:
        """How many starts the grid has."""
        return math.prod(self.shape)

    @property
    def counts(self) -> tuple[int, ...]:
        """How many chunks there are along each axis."""
        return tuple(-(-size // step) for size, step in zip(self.shape, self.chunk, strict=True))

    @property
    def chunks(self) -> int:
        """How many chunks there are."""
        return math.prod(self.counts)

    def index(self, number: int) -> tuple[int, ...]:
        """Where a chunk stands among the chunks of each axis."""
        return tuple(map(int, np.unravel_index(number, self.counts)))

    def place(self, index: Sequence[int]) -> tuple[slice, ...]:
        """The part of the grid that is a chunk's."""
        each = zip(index, self.chunk, self.shape, strict=True)
        return tuple(slice(i * step, min((i + 1) * step, size)) for i, step, size in each)

    def size(self, index: Sequence[int]) -> int:
        """How many starts a chunk has."""
        return math.prod(part.stop - part.start for part in self.place(index))

    def indices(self) -> Iterator[tuple[int, ...]]:
        """Where each chunk stands, one after another."""
        return map(self.index, range(self.chunks))
