"""The grid of a sweep: the coordinates of its axes, and the chunks into which it is cut.

Chunks are never listed: the place of each follows from its indices.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from softstart.controller.parameters import ControllerParameter, declared_parameters
from softstart.controller.recipe import Recipe
from softstart.controller.tuned import Tuned
from softstart.drive import INFORMATIVE_TABLES, PARAMETERS
from softstart.drive.machine import Machine
from softstart.errors import InputError, Mistakes
from softstart.hints import nearest
from softstart.input.gear import alike
from softstart.input.parameters import Parameter, Wording, at_motor, meant_by, read_value
from softstart.quantities import RefusedError, multiplied, show

if TYPE_CHECKING:
    from xarray import DataArray, Variable

# By name: a field of the machine, `controller_NAME` for a parameter of the controller, `controller` for its
# name. Numbers are float64, with their unit as an attribute; several along one dimension are samples.
Grid = dict[str, "Variable"]
PREFIX = "controller"


def axis_lengths(grid: Grid) -> dict[str, int]:
    """The axes in order, with their lengths."""
    return {str(axis.dims[0]): axis.size for axis in grid.values()}


def grid_values(grid: Grid) -> dict[str, Any]:
    """Each coordinate with its value for every start of a grid; the one text of a coordinate of texts."""
    sizes = axis_lengths(grid)
    spread = {name: axis.set_dims(sizes) for name, axis in grid.items()}  # type: ignore[no-untyped-call]
    return {
        name: axis.values.ravel() if axis.dtype.kind == "f" else str(axis.values.flat[0])
        for name, axis in spread.items()
    }


@dataclass(frozen=True)
class Subject:
    """What the axes of a grid vary: a machine and its controller, or the `controllers` that are an axis.

    >>> from softstart.chain import Chain
    >>> crane = Subject(Chain.load("crane-4-mass"), Recipe("ramp"))
    >>> crane.coordinate("shaft[2].gap", ["0.5x", "2x"]).values.tolist()
    [0.1, 0.4]
    >>> crane.name_of("load.inertia"), crane.name_of("controller.time")
    ('load_inertia', 'controller_time')
    """

    machine: Machine
    recipe: Recipe
    controllers: tuple[str, ...] = ()

    @cached_property
    def parameters(self) -> Mapping[str, ControllerParameter]:
        """The parameters that all controllers have, alike in unit and kind."""
        wrong, tables = Mistakes(), list[Mapping[str, ControllerParameter]]()
        for name in self.controllers or ("",):
            with wrong.collect():
                cls = self.recipe.class_of(name) if name or self.recipe.given else Tuned
                # the fields of tuned gains are what stands in their file
                tables.append({} if issubclass(cls, Tuned) else declared_parameters(cls))
        wrong.raise_if_any()
        return {
            name: one
            for name, one in tables[0].items()
            if all(
                name in other and other[name].unit == one.unit and other[name].kind == one.kind
                for other in tables
            )
        }

    def name_of(self, key: str) -> str:
        """The coordinate that a key of the grid names; InputError for an unknown one."""
        if key == PREFIX or key.startswith((f"{PREFIX}.", f"{PREFIX}_")):
            return key.replace(".", "_", 1)
        if (parameter := self.machine.parameter_value(key)) is not None:
            return parameter.name
        of_controller = {name: f"{PREFIX}.{name}" for name in self.parameters}
        keys = (*self.machine.parameter_keys(), PREFIX, *of_controller.values())
        words = dict(zip(keys, keys, strict=True)) | of_controller
        like = meant_by(key, PARAMETERS.values()) if "[" not in key else []
        meant = (
            [of_controller[key]]
            if key in of_controller
            else [p.name for p in like if self.machine.parameter_value(p.name)]
        )
        if not meant and (close := nearest(key, words)):
            meant = [words[close]]
        other = f"take a parameter of the {self.machine.KIND} or {PREFIX}.NAME."
        hint = f"did you mean {' or '.join(meant)}?" if meant else other
        raise InputError(f"{key}: there is no such axis; {hint}")

    def coordinate(self, key: str, values: Any) -> DataArray:
        """The values of a parameter, read and checked; InputError in one sentence."""
        from xarray import DataArray

        name = self.name_of(key)
        if isinstance(values, str | bytes) or not (
            isinstance(values, Sequence) or hasattr(values, "__array__")
        ):
            raise InputError(f"{key} = {show(values)}: give the values of an axis as a list, [0.5, 1, 2].")
        unit, meaning = "", PREFIX
        if name == PREFIX:
            read: NDArray[np.float64] | tuple[str, ...] = _texts(key, values)
        else:
            parameter, multiples = self._varied(key, name)
            read, meaning = self._read(parameter, name, values, multiples), parameter.meaning or name
            unit = parameter.unit
        array = np.array(read)
        if array.ndim != 1:
            raise InputError(f"{key}: its values have shape {array.shape}; give them in one row.")
        about = {} if array.dtype.kind == "U" else {"units": unit}
        return DataArray(array, dims=name, name=name, attrs=about | {"long_name": meaning})

    def _varied(self, key: str, name: str) -> tuple[Parameter, dict[str, float]]:
        """The parameter that an axis varies, called by its key, and the value that is 1x."""
        if not name.startswith(f"{PREFIX}_"):
            current = self.machine.parameter_value(name)
            assert current is not None
            parameter, single = current.parameter, isinstance(current.value, float)
            if (not parameter.unit and not parameter.choices) or parameter.table in INFORMATIVE_TABLES:
                reason = f"the {parameter.meaning} changes no start; sweep another parameter"
                if parameter.table == "gear":
                    reason = (
                        "all cells have one gear; sweep another parameter, or set the gear and sweep again"
                    )
                raise InputError(f"{key}: {reason}.")
            multiples = {"x": float(current.value)} if single and not parameter.many else {}
            return replace(parameter, name=key), multiples
        name = name.removeprefix(f"{PREFIX}_")
        if name not in self.parameters:
            close, several = nearest(name, self.parameters), ", ".join(self.controllers)
            lacking = f"not all of {several} have this" if several else f"{self.recipe.label} has no such"
            hint = f"did you mean {PREFIX}.{close}?" if close else f"there are {', '.join(self.parameters)}."
            raise InputError(f"{key}: {lacking} parameter; {hint}")
        if name in self.recipe.values:
            raise InputError(f"{key}: the parameter {name} has one value already; leave one of the two out.")
        if self.parameters[name].python_only:
            raise InputError(f"{key}: an axis carries numbers or texts, and this parameter is an object.")
        return replace(self.parameters[name], name=key), {}

    def _read(
        self, parameter: Parameter, name: str, values: Sequence[object], multiples: Mapping[str, float]
    ) -> NDArray[np.float64] | tuple[str, ...]:
        """The values of an axis in SI, or its texts."""
        typed: object = values
        try:
            if not parameter.unit or any(isinstance(one, str) and one in parameter.choices for one in values):
                texts = _texts(parameter.name, values)
                for typed in texts if parameter.choices else ():
                    read_value(parameter, typed)
                return texts
            if isinstance(parameter, ControllerParameter):
                return np.asarray(parameter.read(list(values)), dtype=np.float64)
            alike(values)
            typed = numbers = [multiplied(value, parameter.name, multiples) for value in values]
            at_shaft = [at_motor(parameter, one, self.machine.gear_with(**{name: one})) for one in numbers]
            return np.asarray(read_value(parameter, at_shaft, batch=True), dtype=np.float64)
        except RefusedError as reason:
            raise InputError(Wording().refused(parameter, typed, reason)) from None


def _texts(key: str, values: Sequence[object]) -> tuple[str, ...]:
    bad = [value for value in values if not isinstance(value, str) or not value]
    if bad or not len(values):
        raise InputError(f"{key} = {show(bad[0] if bad else [])}: this axis takes names, in a list.")
    return tuple(str(value) for value in values)


def read_grid(axes: object, recipe: Recipe, machine: Machine) -> Grid:
    """The coordinates in the order of the grid, or one InputError for all that is wrong with them.

    >>> from softstart import Drive
    >>> given = {"load.inertia": ["700 kg*cm^2", 0.175], "gap": [0.5, 1, "4x"]}
    >>> grid = read_grid(given, Recipe("direct"), Drive.load("crane-4amtkf"))
    >>> {name: one.values.tolist() for name, one in grid.items()}
    {'load_inertia': [0.07, 0.175], 'gap': [0.5, 1.0, 2.0]}
    """
    from xarray import DataArray, Variable

    if not isinstance(axes, Mapping) or not axes:
        raise InputError(f'grid = {show(axes)}: give a mapping of axes to values, as {{"gap": [0.5, 1, 2]}}.')
    if (PREFIX in axes) == bool(recipe.given):
        raise InputError("controller: name one, or make several an axis of the grid; one of the two.")
    if PREFIX in axes and recipe.values:
        raise InputError(
            f"parameters = {show(dict(recipe.values))}: with several controllers give each parameter as "
            "an axis, of one value if need be."
        )
    names = axes.get(PREFIX, ())
    listed = () if isinstance(names, str) or not isinstance(names, Sequence) else names
    subject = Subject(machine, recipe, tuple(name for name in listed if isinstance(name, str)))
    _ = subject.parameters  # wrong controllers are reported first
    wrong, grid = Mistakes(), Grid()
    for key, values in axes.items():
        paired, read = isinstance(values, Mapping), list[DataArray]()
        for name, own in values.items() if paired else [(key, values)]:
            with wrong.collect():
                read.append(one := subject.coordinate(str(name), own))
                if one.name in grid:
                    wrong.sentences.append(f"{name}: {one.name} is an axis already; name each once.")
                grid[str(one.name)] = Variable(str(key) if paired else one.dims, one.values, one.attrs)
        wrong.sentences += _wrong_samples(str(key), read, len(values)) if paired else _repeated(read)
    wrong.raise_if_any()
    return grid


def _repeated(read: list[DataArray]) -> Iterator[str]:
    """An axis names each place once, so that results can be looked up by value."""
    for axis in read:
        distinct, counts = np.unique(axis.values, return_counts=True)
        if counts.max() > 1:
            twice = show(distinct[counts.argmax()].item())
            yield f"{axis.name} = {twice}: this value is given twice; give each once."


def _wrong_samples(name: str, columns: list[DataArray], count: int) -> Iterator[str]:
    """What is wrong with parameters that vary together."""
    if not name.isidentifier() or any(column.name == name for column in columns):
        yield f"{show(name)}: name the samples by one word that is none of their parameters, as sample."
    if not count:
        yield f"{name}: these samples have no parameter; give some, as {{'gap': [0.5, 0.6]}}."
    if len({column.size for column in columns}) > 1:
        sizes = ", ".join(f"{column.name} has {column.size}" for column in columns)
        yield f"{name}: all parameters of samples need equally many values; {sizes}."
    for column in columns:
        if column.dtype.kind == "U":
            yield f"{column.name}: samples are numbers; make an axis of its own of these names."


MOST = 16_384  # starts of a chunk: sampled ones take about a second
LEAST = 1_024
PARTS = 64  # into which a small grid is cut, so that all processes have work


@dataclass(frozen=True)
class ChunkGrid:
    """A grid of `shape` in chunks of shape `chunk`, the last index fastest; those at the edge are smaller.

    >>> plan = ChunkGrid((3, 5), (1, 2))
    >>> plan.counts, plan.place((1, 2))
    ((3, 3), (slice(1, 2, None), slice(4, 5, None)))
    """

    shape: tuple[int, ...]
    chunk: tuple[int, ...]

    @classmethod
    def of(cls, shape: Sequence[int], single: Sequence[bool], most: int | None = None) -> ChunkGrid:
        """Chunks of at most `most` starts, of one value along the axes that are `single`.

        Without `most` a chunk has a 64th of the grid, within 1,024 and 16,384 starts.

        >>> ChunkGrid.of((1000, 1000), (False, False)).chunk, ChunkGrid.of((2, 100), (True, False)).chunk
        ((15, 1000), (1, 100))
        """
        room = min(max(math.prod(shape) // PARTS, LEAST), MOST) if most is None else most
        chunk = list[int]()
        for size, alone in zip(reversed(shape), reversed(single), strict=True):  # the last index fastest
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

    def indices(self) -> Iterator[tuple[int, ...]]:
        """Where each chunk stands among the chunks of each axis, one after another."""
        return iter(np.ndindex(self.counts))

    def place(self, index: Sequence[int]) -> tuple[slice, ...]:
        """The part of the grid that is a chunk's."""
        axes = zip(index, self.chunk, self.shape, strict=True)
        return tuple(slice(i * step, min((i + 1) * step, size)) for i, step, size in axes)

    def size(self, index: Sequence[int]) -> int:
        """How many starts a chunk has."""
        return math.prod(part.stop - part.start for part in self.place(index))
