"""The variables of a sweep, its results in memory, and a finished sweep as one netCDF file."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from softstart import __version__
from softstart.errors import InputError
from softstart.start.status import Status
from softstart.store import fresh_folder
from softstart.sweeping.grid import Axis, Plan
from softstart.sweeping.starts import Block, Question, Task, known_figures

if TYPE_CHECKING:
    import xarray

STATUS = "status"
NOT_COMPUTED = -1  # in `status`, of a start that has not been computed yet


@dataclass(frozen=True, eq=False)
class Variable:
    """One variable; coordinates bring their `values`."""

    name: str
    dims: tuple[str, ...]
    dtype: Any
    fill: Any
    attributes: dict[str, Any] = field(default_factory=dict)
    values: Any = None


def figure_variables(axes: tuple[Axis, ...], question: Question) -> list[Variable]:
    """The figures, and at the end the status, whose chunk in a folder says that all the others are there."""
    dims = tuple(axis.name for axis in axes)
    found = []
    known = known_figures(question.drive.shaft_names)
    for name in question.figures:
        if name != STATUS:
            unit, meaning = known[name]
            found.append(Variable(name, dims, np.dtype("f8"), np.nan, {"units": unit, "long_name": meaning}))
    attributes = {
        "long_name": "how the start ended",
        "flag_values": [NOT_COMPUTED, *range(len(Status))],
        "flag_meanings": " ".join(["not_computed", *(status.name.lower() for status in Status)]),
    }
    return [*found, Variable(STATUS, dims, np.dtype("i1"), NOT_COMPUTED, attributes)]


def coordinate_variables(axes: tuple[Axis, ...]) -> list[Variable]:
    """The values along the axes."""
    found = []
    for axis in axes:
        if axis.paired:
            numbers = np.arange(axis.size, dtype=np.int64)
            about = {"units": "1", "long_name": "number of the sample"}
            found.append(Variable(axis.name, (axis.name,), numbers.dtype, 0, about, numbers))
        for column in axis.columns:
            attributes = {"units": column.unit, "long_name": column.meaning}
            dims = (axis.name,)
            if column.numeric:
                found.append(Variable(column.name, dims, np.dtype("f8"), np.nan, attributes, column.values))
            else:
                del attributes["units"]
                texts = np.array(column.values, dtype=object)
                found.append(Variable(column.name, dims, texts.dtype, "", attributes, texts))
    return found


def about(question: Question, plan: Plan) -> dict[str, Any]:
    """Attributes of the whole."""
    shown, fitted_to = question.maker.shown, question.fitted_to
    other = {} if fitted_to is None else {"softstart_fitted_to": fitted_to.to_toml()}
    return other | {
        "title": f"{question.drive.name}, {shown}" if shown else question.drive.name,
        "source": f"softstart {__version__}",
        "softstart_drive": question.drive.to_toml(),
        "softstart_chunk": list(plan.chunk),
    }


MOST = 10_000_000  # starts


class Memory:
    """Arrays that are filled chunk by chunk; used as a Folder of a sweep is."""

    folder = ""

    def __init__(self, plan: Plan, axes: tuple[Axis, ...], question: Question) -> None:
        if plan.starts > MOST:
            raise InputError(
                f"grid: {plan.starts:,} starts are too many to keep in memory ({MOST:,} at most); give "
                "to=FOLDER (--out DIR), where a sweep may have any size."
            )
        self.plan, self.axes, self.question = plan, axes, question
        self.arrays = {
            one.name: np.full(plan.shape, one.fill, dtype=one.dtype)
            for one in figure_variables(axes, question)
        }

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        """Nothing is open."""

    def finished(self, number: int) -> bool:
        """Nothing is finished before."""
        return False

    def finished_starts(self) -> int:
        """Nothing is finished before."""
        return 0

    def keep(self, task: Task, block: Block) -> None:
        """Take in a finished chunk."""
        for name, values in block.items():
            self.arrays[name][task.place] = values

    def results(self) -> xarray.Dataset:
        """The results."""
        import xarray

        return xarray.Dataset(
            {
                one.name: (one.dims, self.arrays[one.name], one.attributes)
                for one in figure_variables(self.axes, self.question)
            },
            coords={
                one.name: (
                    one.dims,
                    one.values.astype(str) if one.dtype.kind == "O" else one.values,
                    one.attributes,
                )
                for one in coordinate_variables(self.axes)
            },
            attrs=about(self.question, self.plan),
        )


def check_netcdf(path: Path) -> None:
    """Raise InputError if the file cannot be written, before anything is computed."""
    if path.is_dir():
        raise InputError(f"netcdf = {path}: this is a folder; give the name of a file.")
    if not path.parent.is_dir():
        raise InputError(f"netcdf = {path}: there is no folder {path.parent}; make it, or give another file.")
    if not os.access(path if path.exists() else path.parent, os.W_OK):
        raise InputError(f"netcdf = {path}: you may not write there; give another file.")


def write_netcdf(
    path: Path, results: xarray.Dataset, plan: Plan, axes: tuple[Axis, ...], question: Question
) -> None:
    """Write the results; the memory needed is that of one chunk of one variable."""
    try:
        with fresh_folder(path.parent) as stage:
            _write(stage / path.name, results, plan, axes, question)
            (stage / path.name).replace(path)
    except OSError as error:
        raise InputError(
            f"netcdf = {path}: the file could not be written ({error.strerror or error}); give another one."
        ) from None


def _write(
    path: Path, results: xarray.Dataset, plan: Plan, axes: tuple[Axis, ...], question: Question
) -> None:

    import h5netcdf

    samples = [column.name for axis in axes if axis.paired for column in axis.columns]
    with h5netcdf.File(path, "w") as file:
        file.dimensions = {axis.name: axis.size for axis in axes}
        file.attrs.update({key: results.attrs[key] for key in ("title", "source") if key in results.attrs})
        if samples:
            file.attrs["coordinates"] = " ".join(samples)
        for one in coordinate_variables(axes):
            _variable(file, one, None)[...] = one.values
        for one in figure_variables(axes, question):
            variable = _variable(file, one, plan.chunk)
            for number in range(plan.chunks):
                place = plan.place(number)
                variable[place] = results[one.name][place].values


def _variable(file: Any, one: Variable, chunks: tuple[int, ...] | None) -> Any:

    import h5py

    if one.dtype.kind == "O":
        made = file.create_variable(one.name, one.dims, h5py.string_dtype())
    elif chunks is None:
        made = file.create_variable(one.name, one.dims, one.dtype)
    else:
        made = file.create_variable(
            one.name, one.dims, one.dtype, chunks=chunks, compression="gzip", compression_opts=1, shuffle=True
        )
    for key, value in one.attributes.items():
        made.attrs[key] = np.array(value, dtype=one.dtype) if isinstance(value, list) else value
    return made
