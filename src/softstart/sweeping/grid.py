"""The grid of a sweep: its axes, and the chunks into which it is cut.

Chunks are never listed: a chunk is a number, and its place on the grid follows from it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from softstart.chain.machines import Machine
from softstart.controller.finding import quantity
from softstart.drive import INFORMATIVE_TABLES, PARAMETERS
from softstart.drive.model import BY_PATH
from softstart.errors import InputError, Mistakes
from softstart.input.parameters import Wording, meant_by, read_value
from softstart.quantities import RefusedError, nearest, show
from softstart.sweeping.maker import Maker, Parameters

Owner = Literal["drive", "parameter", "controller"]
PREFIX = "controller"
NO_CONTROLLER = "controller = None: name a controller, or make several an axis of the grid."


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


def read_grid(grid: object, maker: Maker, machine: Machine | None = None) -> tuple[Axis, ...]:
    """The axes in the order of the grid, or one InputError for all that is wrong with them.

    `machine` is the one that is varied, of whose values "2x" is a multiple; without it any drive.

    >>> axes = read_grid({"load.inertia": ["700 kg*cm^2", 0.175], "gap": [0.5, 1, 2]}, Maker("direct"))
    >>> [(axis.name, axis.columns[0].values.tolist()) for axis in axes]
    [('load_inertia', [0.07, 0.175]), ('gap', [0.5, 1.0, 2.0])]
    """
    if not isinstance(grid, Mapping) or not grid:
        raise InputError(
            f'grid = {show(grid)}: give the axes as a mapping of names to values, as {{"gap": [0.5, 1, 2]}}.'
        )
    wrong, axes, first = Mistakes(), list[Axis](), dict[str, str]()
    parameters = _parameters(grid, maker, wrong)
    for key, values in grid.items():
        paired, columns = isinstance(values, Mapping), list[Column]()
        for name, given in values.items() if paired else [(key, values)]:
            with wrong.noted():
                column = read_column(str(name), given, parameters, machine)
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
    wrong.sentences += [
        f"{axis.name}: a parameter among the samples has the name of this axis; give the axis another one."
        for axis in axes
        if axis.paired and axis.name in first
    ]
    wrong.settle()
    return tuple(axes)


def target_of(key: str, machine: Machine | None = None) -> tuple[Owner, str] | None:
    """Whose parameter a key of the grid names, and which; None for an unknown one.

    >>> target_of("load.inertia"), target_of("controller.torque"), target_of("controller")
    (('drive', 'load_inertia'), ('parameter', 'torque'), ('controller', ''))
    """
    if key == PREFIX:
        return "controller", ""
    if key.startswith((f"{PREFIX}.", f"{PREFIX}_")):
        return "parameter", key[len(PREFIX) + 1 :]
    if machine is not None:
        found = machine.knob(key)
        return None if found is None else ("drive", found.name)
    name = BY_PATH.get(key, key)
    return ("drive", name) if name in PARAMETERS else None


def read_column(
    key: str, values: object, parameters: Parameters | None, machine: Machine | None = None
) -> Column:
    """One column; `parameters` are those of the controllers, None where these are not known.

    >>> from softstart.chain import Chain
    >>> crane = Chain.load("crane-4-mass")
    >>> read_column("shaft[2].gap", ["0.5x", "2x"], None, crane).values.tolist()
    [0.1, 0.4]
    """
    target = target_of(key, machine)
    if target is None:
        raise InputError(_unknown(key, parameters, machine))
    owner, field = target
    if isinstance(values, str | bytes) or not (isinstance(values, Sequence) or hasattr(values, "__array__")):
        raise InputError(f"{key} = {show(values)}: give the values of this axis in a list, as [0.5, 1, 2].")
    if isinstance(values, range):
        values = list(values)
    if owner == "controller":
        return Column(PREFIX, owner, "", "", "controller", _texts(key, values))
    if owner == "drive":
        return _of_drive(key, field, values, machine)
    if parameters is None:  # the controllers themselves are wrong, which is told elsewhere
        raise InputError([])
    if field not in parameters:
        raise InputError(_no_such_parameter(key, field, parameters))
    if field in parameters.fixed:
        raise InputError(f"{key}: the parameter {field} has one value already; leave one of the two out.")
    known = parameters[field]
    if known.kind == "object":
        raise InputError(f"{key}: an axis carries numbers or texts, and this parameter is an object.")
    read = _texts(key, values) if known.kind == "text" else _flat(key, quantity(key, values, known.unit))
    return Column(f"{PREFIX}_{field}", owner, field, known.unit, known.meaning or field, read)


def _parameters(grid: Mapping[Any, Any], maker: Maker, wrong: Mistakes) -> Parameters | None:
    """The parameters that all controllers of the sweep have."""
    names = grid.get(PREFIX)
    if PREFIX in grid and maker.given:
        wrong.sentences.append(
            f"controller = {maker.shown}: the controllers are an axis too; leave one of the two out."
        )
    if PREFIX in grid and maker.values:
        wrong.sentences.append(
            f"parameters = {show(dict(maker.values))}: with several controllers give each parameter as "
            "an axis, of one value if need be."
        )
    listed = [] if isinstance(names, str | bytes) or not isinstance(names, Sequence) else list(names)
    with wrong.noted():
        return maker.parameters([n for n in listed if isinstance(n, str)] if PREFIX in grid else None)
    return None


def _of_drive(key: str, name: str, values: object, machine: Machine | None) -> Column:
    found = None if machine is None else machine.knob(name)
    parameter = PARAMETERS[name] if found is None else found.parameter
    if found is not None and parameter.unit and not parameter.many:
        values = [_multiple(value, found.value) for value in values]  # type: ignore[attr-defined]
    if (not parameter.unit and not parameter.choices) or parameter.table in INFORMATIVE_TABLES:
        raise InputError(f"{key}: the {parameter.meaning} changes no start; sweep another parameter.")
    wording = Wording(written={name: key})
    try:
        words = [value for value in list(values) if isinstance(value, str) and value in parameter.choices]  # type: ignore[call-overload]
        if parameter.choices and (words or not parameter.unit):
            texts = _texts(key, values)
            for text in texts:
                try:
                    read_value(parameter, text)
                except RefusedError as reason:
                    raise InputError(wording.refused(parameter, text, reason)) from None
            return Column(name, "drive", name, "", parameter.meaning, texts)
        read = read_value(parameter, values, batch=True)
    except RefusedError as reason:
        raise InputError(wording.refused(parameter, values, reason)) from None
    return Column(name, "drive", name, parameter.unit, parameter.meaning, _flat(key, read))


def _multiple(value: Any, own: Any) -> Any:
    """What "2x" of the machine's own value is; anything else as it is."""
    text = value.strip() if isinstance(value, str) else ""
    if not (text.endswith("x") and isinstance(own, float)):
        return value
    try:
        return float(f"{float(text[:-1]) * own:.12g}")
    except ValueError:
        return value  # which is refused with its sentence


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
    if not name.isidentifier():
        yield f"{show(name)}: the name of samples is one word of letters and digits, as sample."
    if not count:
        yield f"{name}: these samples have no parameter; give some, as {{'gap': [0.5, 0.6]}}."
    if len({column.size for column in columns}) > 1:
        sizes = ", ".join(f"{column.name} has {column.size}" for column in columns)
        yield f"{name}: all parameters of samples need equally many values; {sizes}."
    for column in columns:
        if not column.numeric:
            yield f"{column.name}: samples are numbers; make an axis of its own of these names."


def _unknown(key: str, parameters: Parameters | None, machine: Machine | None = None) -> str:
    like = meant_by(key, PARAMETERS.values()) if "[" not in key else []
    of_drive = [p.name for p in like if machine is None or machine.knob(p.name)]
    meant = [f"{PREFIX}.{key}"] if key in (parameters or ()) else of_drive
    if not meant:
        own = [f"{PREFIX}.{name}" for name in parameters or ()]
        words = BY_PATH if machine is None else machine.knobs()
        close = nearest(key, [*words, *own, *(parameters or ()), PREFIX])
        meant = [f"{PREFIX}.{close}" if close in (parameters or ()) else close] if close else []
    what = "drive" if machine is None else machine.KIND
    hint = (
        f"did you mean {' or '.join(meant)}?"
        if meant
        else f"take a parameter of the {what} or controller.NAME."
    )
    return f"{key}: there is no such axis; {hint}"


def _no_such_parameter(key: str, name: str, parameters: Parameters) -> str:
    close = nearest(name, list(parameters))
    there = ", ".join(parameters) or "none"
    hint = f"did you mean {PREFIX}.{close}?" if close else f"there are {there}."
    return f"{key}: {parameters.lacking}; {hint}"


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


def checked_chunk(value: object) -> int | None:
    """The number of starts of a chunk, or None."""
    if value is None or (isinstance(value, int) and not isinstance(value, bool) and value >= 1):
        return value
    raise InputError(f"chunk = {value!r}: the starts of a chunk are a whole number of 1 or more.")
