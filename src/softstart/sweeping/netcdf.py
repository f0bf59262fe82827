"""A finished sweep as one netCDF-4 file, written a chunk at a time."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from softstart.errors import InputError
from softstart.sweeping.axes import Axis
from softstart.sweeping.plan import Plan
from softstart.sweeping.starts import Question
from softstart.sweeping.variables import Variable, coordinate_variables, figure_variables

if TYPE_CHECKING:
    import xarray


def check_place(path: Path) -> None:
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
    beside = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        _write(beside, results, plan, axes, question)
        beside.replace(path)
    except OSError as error:
        raise InputError(
            f"netcdf = {path}: the file could not be written ({error.strerror or error}); give another one."
        ) from None
    finally:
        beside.unlink(missing_ok=True)


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
        for one in figure_variables(axes, question.figures):
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
