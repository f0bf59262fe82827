"""Where a sweep keeps its figures, and how it knows what is left to compute.

The figures are arrays in memory or, with a folder, a Zarr group that any tool opens, whose chunks are those
of the plan. `Records` list the inputs and each finished chunk with checksums of its values. A chunk that is
not in the list, or of which one value is not as it was written, is left to compute. zarr writes a file beside
its place and renames it, so that a process may be killed at any instant.
"""

from __future__ import annotations

import filecmp
import hashlib
import json
import warnings
import zlib
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from softstart import __version__
from softstart.controller.recipe import about_name
from softstart.errors import InputError
from softstart.start.status import Status
from softstart.stopping import at_stop
from softstart.store import Records, Target, fresh_folder, warn_of_damage
from softstart.sweeping.compute import Block, Question, known_figures
from softstart.sweeping.grid import Axis, Plan

if TYPE_CHECKING:
    import xarray

STATUS = "status"
NOT_COMPUTED = -1  # in `status`, of a start that has not been computed yet
LIST = f"{STATUS}/softstart.sqlite"  # beside the chunks of `status`, where Zarr does not look
MOST_IN_MEMORY = 10_000_000  # starts


def empty_results(plan: Plan, axes: tuple[Axis, ...], question: Question) -> xarray.Dataset:
    """The results before anything is computed; their figures take no memory, however large the grid."""
    import xarray

    dims = tuple(axis.name for axis in axes)
    known = known_figures(question.drive.shaft_names)
    data: dict[str, Any] = {
        name: (
            dims,
            np.broadcast_to(np.nan, plan.shape),
            {"units": known[name][0], "long_name": known[name][1]},
        )
        for name in question.figures
        if name != STATUS
    }
    data[STATUS] = dims, np.broadcast_to(np.int8(NOT_COMPUTED), plan.shape), {
        "long_name": "how the start ended",
        "flag_values": [NOT_COMPUTED, *range(len(Status))],
        "flag_meanings": " ".join(["not_computed", *(status.name.lower() for status in Status)]),
    }  # fmt: skip
    coords: dict[str, Any] = {}
    for axis in axes:
        if axis.paired:
            about = {"units": "1", "long_name": "number of the sample"}
            coords[axis.name] = axis.name, np.arange(axis.size, dtype=np.int64), about
        for column in axis.columns:
            about = {"units": column.unit} if column.numeric else {}
            coords[column.name] = axis.name, np.array(column.values), about | {"long_name": column.meaning}
    shown, fitted_to = question.recipe.label, question.fitted_to
    attributes = {
        **({} if fitted_to is None else {"softstart_fitted_to": fitted_to.to_toml()}),
        "title": f"{question.drive.name}, {shown}" if shown else question.drive.name,
        "source": f"softstart {__version__}",
        "softstart_drive": question.drive.to_toml(),
        "softstart_chunk": list(plan.chunk),
    }
    return xarray.Dataset(data, coords, attributes)


def inputs_of(question: Question, axes: tuple[Axis, ...]) -> dict[str, Any]:
    """Everything that the results follow from, as plain data; long rows of values as a fingerprint."""
    found: dict[str, Any] = {
        "drive": question.drive.to_toml(),
        "controller": question.recipe.about(),
        "order of the axes": [axis.name for axis in axes],
        "figures": list(question.figures),
        "until": question.until,
        "fitted_to": question.fitted_to and question.fitted_to.to_toml(),
        "softstart": __version__,
    }
    for column in (column for axis in axes for column in axis.columns):
        found[f"axis {column.name}"] = (
            [column.size, hashlib.sha256(column.values.tobytes()).hexdigest()]
            if column.numeric
            else [about_name(text) for text in column.values]
        )
    plain: dict[str, Any] = json.loads(json.dumps(found))
    return plain


class Store:
    """The figures of a sweep, in memory or in a folder, new or with the same inputs. Use it in a `with`.

    A folder keeps the chunks that it was begun with.
    """

    def __init__(self, path: Path | None, plan: Plan, axes: tuple[Axis, ...], question: Question) -> None:
        self.path, self.plan, self._axes, self._question = path, plan, axes, question
        self._target = None if path is None else Target("to", path, "sweep", LIST)

    def __enter__(self) -> Self:
        if self.path is None and self.plan.starts > MOST_IN_MEMORY:
            raise InputError(
                f"grid: {self.plan.starts:,} starts are too many to keep in memory ({MOST_IN_MEMORY:,} at "
                "most); give to=FOLDER (--out DIR), where a sweep may have any size."
            )
        with ExitStack() as stack:
            if self._target is not None:
                others = (one for one in self._target.path.rglob("*") if not one.is_dir())
                if not (self._target.path / LIST).exists() and any(others):
                    raise self._target.foreign()
            inputs = inputs_of(self._question, self._axes)
            self._list = stack.enter_context(Records(self._target, inputs, ["part"]))
            if self._target is None:
                self._empty = empty_results(self.plan, self._axes, self._question)
                self._arrays: Any = {name: np.array(one) for name, one in self._empty.data_vars.items()}
            else:
                self._open_folder(self._target)
                self._sweep_up()
                stack.callback(self._sweep_up)
                stack.enter_context(at_stop(self._sweep_up))
            self._exit = stack.pop_all()
        return self

    def __exit__(self, *error: object) -> None:
        self._exit.close()

    def finished(self, index: Sequence[int]) -> bool:
        """Whether a chunk is finished."""
        return self._list.find(index) is not None

    def finished_starts(self) -> int:
        """How many starts are finished and as they were written; the chunks that are not are given up."""
        found, damaged = 0, list[str]()
        for record in self._list.parts():
            if (index := record["part"]) != "chunk":
                if changed := self._changed(index, record["checksums"]):
                    damaged += changed[:1]
                    self._list.forget(index)
                else:
                    found += self.plan.size(index)
        if self.path is not None:
            warn_of_damage(self.path, damaged)
        return found

    def keep(self, index: Sequence[int], block: Block) -> None:
        """Take in a finished chunk and list it."""
        place = self.plan.place(index)
        with ExitStack() as stack:
            if self._target is not None:
                stack.enter_context(self._target.errors())
            for name, values in block.items():
                if self.path is not None:
                    _free(
                        self.path, self._file(name, index)
                    )  # Zarr reads a chunk at the edge before it writes it
                self._arrays[name][place] = values
        self._list.add({"part": list(index), "checksums": {name: zlib.crc32(v) for name, v in block.items()}})

    def results(self) -> xarray.Dataset:
        """The results; those in a folder are read when they are looked at, not yet computed ones are NaN."""
        import xarray

        if self.path is None:
            return self._empty.assign({n: self._empty[n].copy(data=v) for n, v in self._arrays.items()})
        found: xarray.Dataset = xarray.open_zarr(self.path, chunks=None)[list(self._arrays)]
        return found

    def _file(self, name: str, index: Sequence[int]) -> Path:
        """The file of a chunk, as Zarr names it."""
        return Path(name, "c", *map(str, index))

    def _changed(self, index: Sequence[int], checksums: dict[str, int]) -> list[str]:
        """The files of a finished chunk that do not hold what was written."""
        assert self.path is not None
        found = []
        for name, checksum in checksums.items():
            file = self._file(name, index)
            try:
                values = self._arrays[name][self.plan.place(index)] if (self.path / file).is_file() else b""
            except (ValueError, RuntimeError, OSError):  # what Zarr and its codecs say of a damaged file
                values = b""
            if zlib.crc32(bytes(values)) != checksum:
                found.append(file.as_posix())
        return found

    def _open_folder(self, target: Target) -> None:
        """The arrays to write to; descriptions that are missing or damaged are written again."""
        import zarr

        begun = self._list.find("chunk")
        if begun is not None:
            self.plan = Plan(self.plan.shape, tuple(begun["shape"]))
        with target.errors(), fresh_folder(target.path.parent) as fresh:
            _describe(fresh, empty_results(self.plan, self._axes, self._question), self.plan)
            names = sorted(one.relative_to(fresh) for one in fresh.rglob("*") if one.is_file())
            damaged = [name for name in names if not _same(target.path / name, fresh / name)]
            for name in damaged:
                _free(target.path, name)
                (target.path / name).parent.mkdir(parents=True, exist_ok=True)
                (fresh / name).replace(target.path / name)
            self._arrays = dict(zarr.open_group(target.path, mode="r+").arrays())
        if begun is None:
            self._list.add({"part": "chunk", "shape": list(self.plan.chunk)})
        else:
            warn_of_damage(target.path, [name.as_posix() for name in damaged])
        self._arrays = {name: self._arrays[name] for name in (*self._question.figures, STATUS)}

    def _sweep_up(self) -> None:
        """Remove what a process that was killed left beside the place it was writing to."""
        assert self.path is not None
        for file in self.path.rglob("*.partial"):
            file.unlink(missing_ok=True)


def _same(file: Path, other: Path) -> bool:
    return file.is_file() and filecmp.cmp(file, other, shallow=False)


def _free(home: Path, file: Path) -> None:
    """Remove what stands at the place of a file of the sweep, or in the way to it."""
    for folder in reversed(file.parents):
        if not (home / folder).is_dir():
            (home / folder).unlink(missing_ok=True)
    if (home / file).is_dir() and not (home / file).is_symlink():
        (home / file).rmdir()
    else:
        (home / file).unlink(missing_ok=True)


def _describe(folder: Path, empty: xarray.Dataset, plan: Plan) -> None:
    """A Zarr group with the coordinates, and with the arrays of the figures without their values."""
    import zarr
    from zarr import codecs, errors

    attributes = dict(empty.attrs)
    if samples := [str(name) for name in empty.coords if name not in empty.dims]:
        attributes["coordinates"] = " ".join(samples)  # how xarray tells coordinates from data
    group = zarr.create_group(folder, attributes=attributes)
    for name, one in empty.variables.items():
        figure = name in empty.data_vars
        text = one.dtype.kind == "U"
        array = group.create_array(
            str(name),
            shape=one.shape,
            chunks=plan.chunk if figure else one.shape,
            dtype=str if text else one.dtype,
            fill_value=one.values.flat[0] if figure else "" if text else 0,
            dimension_names=[str(dim) for dim in one.dims],
            attributes=one.attrs,
            # whoever else reads the folder notices damage too
            compressors=(codecs.ZstdCodec(), codecs.Crc32cCodec()),
            config={"write_empty_chunks": True},
        )
        if not figure:
            array[...] = one.values.astype(object) if text else one.values
    with warnings.catch_warnings():
        # All metadata in one file is a convention that Zarr 3 has not adopted; xarray asks for it.
        warnings.filterwarnings("ignore", "Consolidated metadata", errors.ZarrUserWarning)
        zarr.consolidate_metadata(folder)
