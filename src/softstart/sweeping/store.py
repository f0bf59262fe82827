"""Where a sweep keeps its figures, and how it knows what is left to compute.

The figures are arrays in memory or, with a folder, a Zarr group that any tool opens, whose chunks are those
of the plan. A `PartStore` lists the inputs and each finished chunk with checksums of its values. A chunk that
is not in the list, or of which one value is not as it was written, is computed again. zarr writes a file
beside its place and renames it, so that a process may be killed at any instant.
"""

from __future__ import annotations

import filecmp
import hashlib
import math
import shutil
import warnings
import zlib
from collections.abc import Sequence
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from softstart import __version__
from softstart.controller.recipe import about_name
from softstart.drive.machine import Machine
from softstart.errors import InputError
from softstart.start.batch import figure_columns
from softstart.start.duty_batch import DutyPlan
from softstart.start.status import Status
from softstart.stopping import at_stop
from softstart.store import PartStore, Target, fresh_folder
from softstart.sweeping.compute import Block, SweepSettings
from softstart.sweeping.grid import ChunkGrid, Grid, axis_lengths

if TYPE_CHECKING:
    import xarray

STATUS = "status"
NOT_COMPUTED = -1  # in `status`, of a start that has not been computed yet
LIST = f"{STATUS}/softstart.sqlite"  # beside the chunks of `status`, where Zarr does not look
MOST_IN_MEMORY = 10_000_000  # starts


def columns_of(machine: Machine, plan: DutyPlan | None) -> dict[str, tuple[str, str]]:
    """Unit and meaning of all figures by name, of starts of a machine or of its duties."""
    if plan is not None:
        return plan.figure_columns(machine.shaft_names)
    columns = figure_columns(machine.shaft_names).items()
    return {name: (unit, meaning) for name, (_, unit, meaning) in columns}


def empty_results(plan: ChunkGrid, grid: Grid, settings: SweepSettings) -> xarray.Dataset:
    """The results before anything is computed; their figures take no memory, however large the grid."""
    import xarray

    sizes, machine = axis_lengths(grid), settings.drive
    known = columns_of(machine, settings.plan)
    data: dict[str, Any] = {
        name: (list(sizes), np.broadcast_to(np.nan, plan.shape), {"units": unit, "long_name": meaning})
        for name, (unit, meaning) in ((name, known[name]) for name in settings.figures)
    }
    data[STATUS] = list(sizes), np.broadcast_to(np.int8(NOT_COMPUTED), plan.shape), {
        "long_name": "how the start ended",
        "flag_values": [NOT_COMPUTED, *range(len(Status))],
        "flag_meanings": " ".join(["not_computed", *(status.name.lower() for status in Status)]),
    }  # fmt: skip
    numbers = {
        dim: (dim, np.arange(size, dtype=np.int64), {"units": "1", "long_name": "number of the sample"})
        for dim, size in sizes.items() if dim not in grid
    }  # fmt: skip
    shown, fitted_to = settings.recipe.label, settings.fitted_to
    attributes = {
        **({} if fitted_to is None else {"softstart_fitted_to": fitted_to.to_toml()}),
        "title": f"{machine.name}, {shown}" if shown else machine.name,
        "source": f"softstart {__version__}",
        "softstart_drive": machine.to_toml(),
        **({} if settings.plan is None else {"softstart_duty": settings.plan.words()}),
    }
    return xarray.Dataset(data, {**numbers, **grid}, attributes)


def sweep_inputs(plan: ChunkGrid, grid: Grid, settings: SweepSettings) -> dict[str, Any]:
    """Everything that the results follow from, as plain data; long rows of values as a fingerprint."""
    inputs: dict[str, Any] = {
        "drive": settings.drive.to_toml(),
        "controller": settings.recipe.about(),
        "order of the axes": list(axis_lengths(grid)),
        "figures": list(settings.figures),
        "until": settings.until,
        "fitted_to": settings.fitted_to and settings.fitted_to.to_toml(),
        "softstart": __version__,
        "chunk": math.prod(plan.chunk),
        **({} if settings.plan is None else settings.plan.inputs()),
    }
    for name, axis in grid.items():
        inputs[f"axis {name}"] = (
            [about_name(text) for text in axis.values.tolist()]
            if axis.dtype.kind == "U"
            else [axis.size, hashlib.sha256(axis.values.tobytes()).hexdigest()]
        )
    return inputs


class MemoryStore:
    """The figures of a sweep in memory. Use it in a `with`; `finished` holds the chunks that are finished."""

    def __init__(self, plan: ChunkGrid, grid: Grid, settings: SweepSettings) -> None:
        self.plan, self.finished = plan, set[tuple[int, ...]]()
        self._empty = empty_results(plan, grid, settings)
        self._arrays: dict[str, Any] = {}

    def __enter__(self) -> Self:
        if self.plan.starts > MOST_IN_MEMORY:
            raise InputError(
                f"grid: {self.plan.starts:,} starts are too many to keep in memory ({MOST_IN_MEMORY:,} at "
                "most); give to=FOLDER (--out DIR), where a sweep may have any size."
            )
        self._arrays = {str(name): np.array(values) for name, values in self._empty.data_vars.items()}
        return self

    def __exit__(self, *error: object) -> None:
        pass

    def keep(self, index: Sequence[int], block: Block) -> None:
        """Take in a finished chunk."""
        place = self.plan.place(index)
        for name, values in block.items():
            self._arrays[name][place] = values.reshape([part.stop - part.start for part in place])

    def results(self) -> xarray.Dataset:
        """The results; those not yet computed are NaN."""
        return self._empty.assign({n: self._empty[n].copy(data=v) for n, v in self._arrays.items()})


class FolderStore(MemoryStore):
    """The figures of a sweep in a folder, new or with the same inputs.

    `finished` holds the chunks that are finished and as they were written.
    """

    def __init__(self, path: Path, plan: ChunkGrid, grid: Grid, settings: SweepSettings) -> None:
        super().__init__(plan, grid, settings)
        self.path, self._target = path, Target("to", path, "sweep", LIST)
        self._list = PartStore(self._target, sweep_inputs(plan, grid, settings), ["part"])
        self._exit = ExitStack()

    def __enter__(self) -> Self:
        with ExitStack() as stack:
            files = (path for path in self.path.rglob("*") if not path.is_dir())
            if not (self.path / LIST).exists() and any(files):
                raise self._target.foreign()
            stack.enter_context(self._list)
            stack.callback(self._clear)
            stack.callback(self._sweep_up)
            # a process that is ended at once runs no callbacks of the stack
            stack.enter_context(at_stop(self._sweep_up))
            with self._target.errors():
                self._open(self.path)
            self._exit = stack.pop_all()
        return self

    def __exit__(self, *error: object) -> None:
        self._exit.close()

    def _clear(self) -> None:
        """If no chunk is finished: as if it had not begun. A stopped process leaves all to the next one."""
        if not self._list.parts():
            (self.path / "zarr.json").unlink(missing_ok=True)
            for folder in (self.path / str(name) for name in self._empty.variables):
                shutil.rmtree(folder / "c", ignore_errors=True)
                (folder / "zarr.json").unlink(missing_ok=True)
                with suppress(OSError):  # that of the list is not empty
                    folder.rmdir()
            self._list.stay(False)

    def _check_place(self, name: Path) -> None:
        """Raise InputError if a file of the sweep is a folder that is not empty."""
        place = self.path / name
        if place.is_dir() and not place.is_symlink() and any(place.iterdir()):
            reason = "is a folder, where a file of the sweep is to go; move it away"
            raise self._target.error(f"{name.as_posix()} in it {reason}.")

    def _make_way(self, name: Path) -> None:
        """Remove what stands where a file of the sweep is to go and is none, as a link or an empty folder."""
        self._check_place(name)
        for parent in (self.path / one for one in [*name.parents][-2::-1]):  # not the folder itself
            if not parent.is_dir():
                parent.unlink(missing_ok=True)
        place = self.path / name
        if place.is_dir() and not place.is_symlink():
            place.rmdir()
        else:
            place.unlink(missing_ok=True)

    def keep(self, index: Sequence[int], block: Block) -> None:
        """Write a finished chunk and list it."""
        with self._target.errors():
            for name in block:  # Zarr reads a chunk at the edge before it writes it
                self._make_way(_file(name, index))
            super().keep(index, block)
        self._list.add({"part": list(index), "checksums": {name: zlib.crc32(v) for name, v in block.items()}})

    def results(self) -> xarray.Dataset:
        """The results; each is read from the folder when it is used."""
        import xarray

        return xarray.open_zarr(self.path, chunks=None)[list(self._arrays)]

    def _open(self, folder: Path) -> None:
        """The arrays to write to, and what is finished; what is damaged is reported, and recomputed."""
        import zarr

        self._sweep_up()
        with fresh_folder(folder.parent) as fresh:
            _describe(fresh, self._empty, self.plan)
            names = sorted(one.relative_to(fresh) for one in fresh.rglob("*") if one.is_file())
            # metadata and coordinates follow from the inputs: whatever differs was damaged
            damaged = [name for name in names if not _same_content(folder / name, fresh / name)]
            for name in damaged:
                self._check_place(name)
            self._list.stay(True)
            for name in damaged:
                self._make_way(name)
                (folder / name).parent.mkdir(parents=True, exist_ok=True)
                (fresh / name).replace(folder / name)
        # a chunk of NaN only is written too: a missing one counts as damaged
        with zarr.config.set({"array.write_empty_chunks": True}):
            opened = dict(zarr.open_group(folder, mode="r+").arrays())
        self._arrays = {str(name): opened[str(name)] for name in self._empty.data_vars}
        for record in self._list.parts():
            index = tuple(record["part"])
            if changed := self._changed(index, record["checksums"]):
                damaged.append(changed)
                for name in record["checksums"]:
                    self._check_place(_file(name, index))
            else:
                self.finished.add(index)
        if self._list.parts():
            self._list.damaged += [name.as_posix() for name in damaged]
        self._target.warn_of_damage(self._list.damaged)

    def _changed(self, index: tuple[int, ...], checksums: dict[str, int]) -> Path | None:
        """A file of a finished chunk that does not hold what was written."""
        for name, checksum in checksums.items():  # of the values: codecs may compress them differently
            file = _file(name, index)
            try:
                values = self._arrays[name][self.plan.place(index)] if (self.path / file).is_file() else b""
            except (ValueError, RuntimeError, OSError):  # what Zarr and its codecs say of a damaged file
                values = b""
            if zlib.crc32(bytes(values)) != checksum:
                return file
        return None

    def _sweep_up(self) -> None:
        """Remove what a process that was killed left beside the place it was writing to."""
        for file in self.path.rglob("*.partial"):
            file.unlink(missing_ok=True)


def _file(name: str, index: Sequence[int]) -> Path:
    """The file of a chunk, as Zarr names it."""
    return Path(name, "c", *map(str, index))


def _same_content(file: Path, other: Path) -> bool:
    return file.is_file() and filecmp.cmp(file, other, shallow=False)


def _describe(folder: Path, empty: xarray.Dataset, plan: ChunkGrid) -> None:
    """A Zarr group with the coordinates, and with the arrays of the figures without their values."""
    import zarr
    from zarr import codecs, errors

    attributes = dict(empty.attrs)
    if samples := [str(name) for name in empty.coords if name not in empty.dims]:
        attributes["coordinates"] = " ".join(samples)  # how xarray tells coordinates from data
    group = zarr.create_group(folder, attributes=attributes)
    for name, variable in empty.variables.items():
        figure = name in empty.data_vars
        text = variable.dtype.kind == "U"
        array = group.create_array(
            str(name),
            shape=variable.shape,
            chunks=plan.chunk if figure else variable.shape,
            dtype=str if text else variable.dtype,
            fill_value=variable.values.flat[0] if figure else "" if text else 0,
            dimension_names=[str(dim) for dim in variable.dims],
            attributes=variable.attrs,
            # whoever else reads the folder notices damage too
            compressors=(codecs.ZstdCodec(), codecs.Crc32cCodec()),
            config={"write_empty_chunks": True},
        )
        if not figure:
            array[...] = variable.values.astype(object) if text else variable.values
    with warnings.catch_warnings():
        # All metadata in one file is a convention that Zarr 3 has not adopted; xarray asks for it.
        warnings.filterwarnings("ignore", "Consolidated metadata", errors.ZarrUserWarning)
        zarr.consolidate_metadata(folder)
