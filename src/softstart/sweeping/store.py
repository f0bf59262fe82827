"""A sweep on disk: a Zarr group that any tool opens, written a chunk at a time, going on after any end.

Every chunk of the plan is one Zarr chunk of each variable, so that no two writers meet in a file. zarr writes
a file beside its place and renames it. `Records` in the folder list the inputs, the finished chunks with the
checksums of their files, and those of all other files, which are written once. A chunk that is listed, and
whose files are as listed, is finished.
"""

from __future__ import annotations

import hashlib
import json
import os
import warnings
from contextlib import ExitStack
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from softstart import __version__
from softstart.errors import InputError
from softstart.stopping import at_stop
from softstart.store import Records, Target, fresh_folder, warn_of_damage
from softstart.sweeping.grid import Axis, Plan
from softstart.sweeping.maker import about_name
from softstart.sweeping.results import STATUS, Variable, about, coordinate_variables, figure_variables
from softstart.sweeping.starts import Block, Question, Task, compute

if TYPE_CHECKING:
    import xarray


def inputs_of(question: Question, axes: tuple[Axis, ...]) -> dict[str, Any]:
    """Everything that the results follow from, as plain data; long rows of values as a fingerprint."""
    found: dict[str, Any] = {
        "drive": question.drive.to_toml(),
        "controller": question.maker.about(),
        "order of the axes": [axis.name for axis in axes],
        "figures": list(question.figures),
        "until": question.until,
        "time_limit": question.time_limit,
        "fitted_to": None if question.fitted_to is None else question.fitted_to.to_toml(),
        "base": None if question.base is None else question.base.to_toml(),
        "softstart": __version__,
    }
    for axis in axes:
        for column in axis.columns:
            named = f"axis {column.name}"
            if column.numeric:
                found[named] = [column.size, hashlib.sha256(column.values.tobytes()).hexdigest()]
            else:
                found[named] = [about_name(text) for text in column.values]
    plain: dict[str, Any] = json.loads(json.dumps(found))
    return plain


class Folder:
    """The Zarr group of a sweep: made, or found with the same inputs. Use it in a `with`."""

    def __init__(
        self, path: Path, plan: Plan, axes: tuple[Axis, ...], question: Question, chunk: int | None
    ) -> None:
        self.path, self.plan, self._chunk = path, plan, chunk
        self.folder = str(path.resolve())
        self._target = Target("to", path, "sweep", LIST)
        self._asked = axes, question
        self._inputs = inputs_of(question, axes)
        self._names = [*(name for name in question.figures if name != STATUS), STATUS]

    def __enter__(self) -> Self:
        _opened.cache_clear()  # what stood at this path before may have been deleted
        if not (self.path.is_dir() and any(self.path.iterdir())):
            self._create()
        elif not (self.path / self._target.inside).exists():
            if not (self.path / "zarr.json").exists():
                raise self._target.foreign()
            raise self._target.error(
                "it has no list of finished chunks that this version of softstart reads (an earlier version "
                f"wrote another one); {self._target.other}, or delete this one to begin again."
            )
        with ExitStack() as stack:
            self._list = stack.enter_context(Records(self._target, self._inputs, ["part"]))
            self._resume()
            self.sweep_up()
            stack.callback(self.sweep_up)
            stack.enter_context(at_stop(self.sweep_up))
            self._open = stack.pop_all()
        return self

    def __exit__(self, *error: object) -> None:
        self._open.close()

    def finished(self, number: int) -> bool:
        """Whether a chunk is finished."""
        return self._list.find(self.plan.index(number)) is not None

    def keep(self, task: Task, found: Block) -> None:
        """List a chunk as finished, after writing it if that is not done."""
        sums = found if task.keep_in else write_block(self.folder, task.place, found)
        self._list.add({"part": list(self.plan.index(task.number)), "files": sums})

    def finished_starts(self) -> int:
        """How many starts are finished and as they were written; the chunks that are not are given up."""
        found, damaged = 0, []
        for record in self._list.parts():
            if isinstance(index := record["part"], list):
                if changed := self._changed(record["files"]):
                    damaged.append(changed[0])
                    self._list.forget(index)
                else:
                    found += self.plan.size_at(index)
        warn_of_damage(self.path, damaged)
        return found

    def results(self) -> xarray.Dataset:
        """The results, read when they are looked at; starts not yet computed are NaN, status -1."""
        import xarray

        found: xarray.Dataset = xarray.open_zarr(self.path, chunks=None)[self._names]
        return found

    def sweep_up(self) -> None:
        """Remove what a process that was killed left beside the place it was writing to."""
        for root, _, names in os.walk(self.path):
            for name in names:
                if name.endswith(".partial"):
                    Path(root, name).unlink(missing_ok=True)

    def _changed(self, files: dict[str, str | None]) -> list[str]:
        return [name for name, checksum in files.items() if _checksum(self.path / name) != checksum]

    def _create(self) -> None:
        """An empty sweep, put in place by one rename."""
        with self._target.errors():
            self.path.parent.mkdir(parents=True, exist_ok=True)
            with fresh_folder(self.path.parent) as fresh:
                _fill(fresh, self.plan, *self._asked)
                sums = {
                    file.relative_to(fresh).as_posix(): _checksum(file)
                    for file in fresh.rglob("*")
                    if file.is_file()
                }
                with Records(self._target._replace(path=fresh), self._inputs, ["part"]) as listed:
                    listed.add({"part": "chunk", "shape": list(self.plan.chunk)})
                    listed.add({"part": "other files", "files": sums})
                umask = os.umask(0)
                os.umask(umask)
                fresh.chmod(0o777 & ~umask)
                if self.path.is_dir():
                    self.path.rmdir()  # an empty folder; rename onto one does not go everywhere
                fresh.rename(self.path)

    def _resume(self) -> None:
        """The plan of the sweep that is there; its descriptions are mended."""
        chunk, other = self._list.find("chunk"), self._list.find("other files")
        if chunk is None or other is None:
            raise self._target.damaged()
        there = Plan(self.plan.shape, tuple(chunk["shape"]))
        if self._chunk is not None and there != self.plan:
            raise InputError(
                f"chunk = {self._chunk}: the sweep in {self.path} was begun in chunks of "
                f"{' x '.join(map(str, there.chunk))} starts; leave chunk out to go on, or "
                f"{self._target.other}."
            )
        self.plan = there
        damaged = self._changed(other["files"])
        warn_of_damage(self.path, damaged)
        if damaged:
            with self._target.errors(), fresh_folder(self.path.parent) as fresh:
                _fill(fresh, there, *self._asked)
                for file in damaged:
                    _free(self.path, self.path / file)
                    (self.path / file).parent.mkdir(parents=True, exist_ok=True)
                    (fresh / file).replace(self.path / file)


def compute_and_keep(task: Task) -> Block:
    """Compute a chunk; write it and return the checksums of its files if the task says where."""
    block = compute(task)
    return write_block(task.keep_in, task.place, block) if task.keep_in else block


def write_block(path: str, place: tuple[slice, ...], block: Block) -> dict[str, Any]:
    """Write a finished chunk; the checksums of its files."""
    home, arrays, sums = Path(path), _opened(path), {}
    index = [part.start // size for part, size in zip(place, arrays[STATUS].chunks, strict=True)]
    for name in sorted(block):
        file = Path(name, "c", *map(str, index))  # as Zarr names it
        _free(home, home / file)  # Zarr reads a chunk at the edge before it writes it
        arrays[name][place] = block[name]
        sums[file.as_posix()] = _checksum(home / file)
    return sums


LIST = f"{STATUS}/softstart.sqlite"  # beside the chunks of `status`, where Zarr does not look


def _checksum(file: Path) -> str | None:
    """Of the content of a file; None where there is none, as for a chunk whose values are all missing."""
    try:
        if file.is_file():
            return hashlib.sha256(file.read_bytes()).hexdigest()
        return "no file" if file.exists() else None
    except OSError as error:
        return error.strerror


@lru_cache(maxsize=4)
def _opened(path: str) -> dict[str, Any]:
    """The arrays of a sweep to write to."""
    import zarr

    return dict(zarr.open_group(path, mode="r+").arrays())


def _free(home: Path, file: Path) -> None:
    """Remove what stands at the place of a file of the sweep, or in the way to it."""
    for folder in reversed(file.relative_to(home).parents):
        if (home / folder).exists() and not (home / folder).is_dir():
            (home / folder).unlink()
    if file.is_dir() and not file.is_symlink():
        file.rmdir()
    else:
        file.unlink(missing_ok=True)


def _fill(fresh: Path, plan: Plan, axes: tuple[Axis, ...], question: Question) -> None:
    import zarr
    from zarr import errors

    attributes = about(question, plan)
    samples = [c.name for axis in axes if axis.paired for c in axis.columns]
    if samples:
        attributes["coordinates"] = " ".join(samples)  # how xarray tells coordinates from data
    group = zarr.create_group(fresh, attributes=attributes)
    for one in coordinate_variables(axes):
        _array(group, one, one.values.shape, one.values.shape)[...] = one.values
    for one in figure_variables(axes, question):
        _array(group, one, plan.shape, plan.chunk)
    with warnings.catch_warnings():
        # All metadata in one file is a convention that Zarr 3 has not adopted; xarray asks for it.
        warnings.filterwarnings("ignore", "Consolidated metadata", errors.ZarrUserWarning)
        zarr.consolidate_metadata(fresh)


def _array(group: Any, one: Variable, shape: tuple[int, ...], chunks: tuple[int, ...]) -> Any:
    from zarr import codecs

    return group.create_array(
        one.name,
        shape=shape,
        chunks=chunks,
        dtype=str if one.dtype.kind == "O" else one.dtype,
        fill_value=one.fill,
        dimension_names=one.dims,
        attributes=one.attributes,
        # whoever else reads the folder notices damage too
        compressors=(codecs.ZstdCodec(), codecs.Crc32cCodec()),
    )
