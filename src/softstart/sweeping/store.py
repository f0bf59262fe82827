"""A sweep on disk: a Zarr group that any tool opens, written a chunk at a time, going on after any end.

Every chunk of the plan is one Zarr chunk of each variable, so that no two writers meet in a file. zarr writes
a file beside its place and renames it. The seal of a chunk is written last: it holds the checksums of the
chunk's files and fits this sweep and this place alone. Where it is and fits, the chunk is finished. So there
is no list of finished chunks that could be lost, torn or at odds with the data. All other files are written
once; their checksums are in the manifest.
"""

from __future__ import annotations

import hashlib
import json
import os
import warnings
from collections.abc import Iterator, Sequence
from functools import lru_cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from softstart import __version__
from softstart.errors import InputError
from softstart.late import late
from softstart.store import Record, Target, fingerprint, sealed, unsealed, warn_of_damage
from softstart.sweeping.grid import Axis, Plan
from softstart.sweeping.maker import about_name
from softstart.sweeping.results import STATUS, Variable, about, coordinate_variables, figure_variables
from softstart.sweeping.starts import Block, Question, Task, compute

if TYPE_CHECKING:
    import xarray
    import zarr
    from zarr import codecs, errors
else:
    codecs, errors = late("zarr.codecs"), late("zarr.errors")
    xarray = late("xarray")
    zarr = late("zarr")

Make = partial[None]  # of `_fill`: the folder and the plan are missing


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
    """The Zarr group of a sweep: made anew, or found with the same inputs."""

    def __init__(
        self, target: Target, plan: Plan, axes: tuple[Axis, ...], question: Question, chunk: int | None
    ) -> None:
        self.path = target.path
        _opened.cache_clear()  # what stood at this path before may have been deleted
        make = partial(_fill, axes=axes, question=question, inputs=inputs_of(question, axes))
        if self.path.is_dir() and any(self.path.iterdir()):
            self.plan = _resumed(target, make, plan, chunk)
            self.sweep_up()
        else:
            self.plan = plan
            _create(target, make, plan)
        inputs = make.keywords["inputs"]
        self._key, self._names = _key({"inputs": inputs, "chunk": list(self.plan.chunk)}), _names(inputs)

    def finished(self, number: int) -> bool:
        """Whether a chunk is finished."""
        return self._seal(self.plan.index(number)).is_file()

    def finished_starts(self) -> int:
        """How many starts are finished and as they were written; the chunks that are not are given up."""
        found, damaged = 0, []
        for index in _sealed_chunks(self.path, self.plan):
            changed = _changed(self.path, index, self._key, self._names)
            if changed:
                damaged.append(changed)
                _free(self.path, self._seal(index))
            else:
                found += self.plan.size_at(index)
        warn_of_damage(self.path, damaged)
        return found

    def _seal(self, index: tuple[int, ...]) -> Path:
        return _chunk_file(self.path, STATUS, index, SEAL)

    def sweep_up(self) -> None:
        """Remove what a process that was killed left beside the place it was writing to."""
        for root, _, names in os.walk(self.path):
            for name in names:
                if name.endswith(".partial"):
                    Path(root, name).unlink(missing_ok=True)


def compute_and_keep(task: Task) -> Block | None:
    """Compute a chunk; write it if the task says where, return it otherwise."""
    block = compute(task)
    if not task.keep_in:
        return block
    write_block(task.keep_in, task.place, block)
    return None


def write_block(path: str, place: tuple[slice, ...], block: Block) -> None:
    """Write a finished chunk, and then its seal: the checksums of its files, valid at this place only."""
    home, (arrays, key) = Path(path), _opened(path)
    step = arrays[STATUS].chunks
    index = tuple(part.start // size for part, size in zip(place, step, strict=True))
    sums = {}
    for name in sorted(block):
        file = _chunk_file(home, name, index)
        _free(home, file)  # Zarr reads a chunk at the edge before it writes it
        arrays[name][place] = block[name]
        sums[name] = _checksum(file)
    seal = _chunk_file(home, STATUS, index, SEAL)
    _free(home, seal)
    fresh = seal.with_name(f"{seal.name}.partial")
    fresh.parent.mkdir(parents=True, exist_ok=True)
    fresh.write_text(sealed(sums, _key_at(key, index)), encoding="utf-8")
    fresh.replace(seal)


def open_folder(path: Path) -> xarray.Dataset:
    """The results in a folder, read when they are looked at; starts not yet computed are NaN, status -1.

    >>> open_folder(Path("nowhere.zarr"))
    Traceback (most recent call last):
    softstart.errors.InputError: to = nowhere.zarr: there is no sweep in this folder.
    """
    manifest = _manifest(path)
    if manifest is None:
        raise InputError(f"to = {path}: there is no sweep in this folder.")
    ordered: xarray.Dataset = xarray.open_zarr(path, chunks=None)[_names(manifest["inputs"])]
    return ordered


def target_of(path: Path) -> Target:
    """The folder of a sweep, as `to` names it."""
    return Target("to", path, "sweep", "folder")


# what is there ------------------------------------------------------------------------------------------

# beside the chunks of `status`, where Zarr does not look: the seal of each chunk, and the manifest
SEAL, MANIFEST = ".sha256", Path(STATUS, "softstart.json")


def _chunk_file(home: Path, name: str, index: Sequence[int], ending: str = "") -> Path:
    """The file of a chunk of a variable, as Zarr names it."""
    return home.joinpath(name, "c", *map(str, index[:-1]), f"{index[-1]}{ending}")


def _checksum(file: Path) -> str | None:
    """Of the content of a file; None where there is none, as for a chunk whose values are all missing."""
    try:
        if file.is_file():
            return hashlib.sha256(file.read_bytes()).hexdigest()
        return "no file" if file.exists() else None
    except OSError as error:
        return error.strerror


def _manifest(home: Path) -> Record | None:
    """The inputs, the shape of the chunks, and checksums of all that is not a chunk of results."""
    return unsealed(_text(home / MANIFEST), "sweep")


def _text(file: Path) -> str:
    """What a file holds, "" if that cannot be read."""
    try:
        return file.read_text("utf-8") if file.is_file() else ""
    except (OSError, UnicodeDecodeError):
        return ""


def _names(inputs: Record) -> list[str]:
    """The variables with results, the status last."""
    return [*(name for name in inputs["figures"] if name != STATUS), STATUS]


def _key(manifest: Record) -> str:
    """What the seals of a sweep's chunks have in common."""
    return fingerprint({name: manifest[name] for name in ("inputs", "chunk")})


def _key_at(key: str, index: Sequence[int]) -> str:
    return f"{key} {list(index)}"


@lru_cache(maxsize=4)
def _opened(path: str) -> tuple[dict[str, Any], str]:
    """The arrays of a sweep to write to, and the key of its seals."""
    manifest = _manifest(Path(path))
    assert manifest is not None
    return dict(zarr.open_group(path, mode="r+").arrays()), _key(manifest)


def _changed(home: Path, index: tuple[int, ...], key: str, names: Sequence[str]) -> str:
    """A file of a sealed chunk that is not as it was written; "" if all are."""
    seal = _chunk_file(home, STATUS, index, SEAL)
    sums = unsealed(_text(seal), _key_at(key, index))
    if sums is None or set(sums) != set(names):
        return seal.relative_to(home).as_posix()
    files = {name: _chunk_file(home, name, index) for name in names}
    return next((files[n].relative_to(home).as_posix() for n in names if _checksum(files[n]) != sums[n]), "")


def _sealed_chunks(home: Path, plan: Plan) -> Iterator[tuple[int, ...]]:
    """Where the chunks stand that have a seal; what is there is listed, not what could be."""
    top = home / STATUS / "c"
    for root, _, names in os.walk(top):
        above = Path(root).relative_to(top).parts
        for name in names:
            parts = (*above, name.removesuffix(SEAL))
            if name.endswith(SEAL) and len(parts) == len(plan.shape) and all(map(str.isdecimal, parts)):
                index = tuple(map(int, parts))
                if all(i < count for i, count in zip(index, plan.counts, strict=True)):
                    yield index


def _free(home: Path, file: Path) -> None:
    """Remove what stands at the place of a file of the sweep, or in the way to it."""
    for folder in reversed(file.relative_to(home).parents):
        if (home / folder).exists() and not (home / folder).is_dir():
            (home / folder).unlink()
    if file.is_dir() and not file.is_symlink():
        file.rmdir()
    else:
        file.unlink(missing_ok=True)


def _resumed(target: Target, make: Make, plan: Plan, chunk: int | None) -> Plan:
    """The plan of the sweep that is there, if it is this one; its descriptions are mended."""
    home, inputs = target.path, make.keywords["inputs"]
    manifest = _manifest(home)
    if manifest is None:  # the sweep is this one if a seal fits
        manifest = {"inputs": inputs, "chunk": list(plan.chunk), "files": {}}
        names = _names(inputs)
        if all(_changed(home, index, _key(manifest), names) for index in _sealed_chunks(home, plan)):
            raise target.older() if (home / STATUS).exists() else target.foreign()
    target.check_same(manifest["inputs"], inputs)
    there = Plan(plan.shape, tuple(manifest["chunk"]))
    if chunk is not None and there != plan:
        raise InputError(
            f"chunk = {chunk}: the sweep in {target.path} was begun in chunks of "
            f"{' x '.join(map(str, there.chunk))} starts; leave chunk out to go on, or {target.other}."
        )
    files = manifest["files"]
    damaged = (
        [name for name in files if _checksum(home / name) != files[name]] if files else [MANIFEST.as_posix()]
    )
    if damaged:
        warn_of_damage(home, damaged)
        with target.fresh_folder() as fresh:
            make(fresh, there)
            for file in _files_in(fresh):
                _free(home, home / file)
                (home / file).parent.mkdir(parents=True, exist_ok=True)
                (fresh / file).replace(home / file)
    return there


def _create(target: Target, make: Make, plan: Plan) -> None:
    """An empty sweep, put in place by one rename."""
    path = target.path
    with target.fresh_folder() as fresh:
        make(fresh, plan)
        umask = os.umask(0)
        os.umask(umask)
        fresh.chmod(0o777 & ~umask)
        if path.is_dir():
            path.rmdir()  # an empty folder; rename onto one does not go everywhere
        fresh.rename(path)


def _fill(
    fresh: Path, plan: Plan, *, axes: tuple[Axis, ...], question: Question, inputs: dict[str, Any]
) -> None:
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
    files = {file.as_posix(): _checksum(fresh / file) for file in _files_in(fresh)}
    manifest = {"inputs": inputs, "chunk": list(plan.chunk), "files": files}
    (fresh / MANIFEST).write_text(sealed(manifest, "sweep"), encoding="utf-8")


def _files_in(home: Path) -> list[Path]:
    """All files below, the manifest last."""
    found = (path.relative_to(home) for path in home.rglob("*") if path.is_file())
    return sorted(found, key=lambda file: (file == MANIFEST, file))


def _array(group: Any, one: Variable, shape: tuple[int, ...], chunks: tuple[int, ...]) -> Any:
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
