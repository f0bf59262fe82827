"""A sweep on disk: a Zarr group that any tool opens, written a chunk at a time, going on after any end.

Every chunk of the plan is one Zarr chunk of each variable, so that no two writers meet in a file. zarr writes
a file beside its place and renames it. The chunk of `status` is written last: where it is, the chunk is
finished. So there is no list of finished chunks that could be lost, torn or at odds with the data.
"""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import tempfile
import warnings
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from softstart import __version__
from softstart.errors import InputError
from softstart.late import late
from softstart.store import Target
from softstart.sweeping.grid import Axis, Plan
from softstart.sweeping.maker import about_name
from softstart.sweeping.results import STATUS, Variable, about, coordinate_variables, figure_variables
from softstart.sweeping.starts import Block, Question, Task, compute

if TYPE_CHECKING:
    import xarray
    import zarr
    from zarr import errors
else:
    errors = late("zarr.errors")
    xarray = late("xarray")
    zarr = late("zarr")

Axes = tuple[Axis, ...]
INPUTS = "softstart_inputs"


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
        inputs = inputs_of(question, axes)
        if self.path.is_dir() and any(self.path.iterdir()):
            self.plan = _resumed(target, inputs, plan, chunk)
            self.sweep_up()
        else:
            self.plan = plan
            _create(target, plan, axes, question, inputs)

    def finished(self, number: int) -> bool:
        """Whether a chunk is finished."""
        return self._marker(number).exists()

    def finished_starts(self) -> int:
        """How many starts are finished; what is there is counted, not what could be."""
        home = self.path / STATUS / "c"
        found = 0
        for root, _, names in os.walk(home):
            above = [int(part) for part in Path(root).relative_to(home).parts]
            for name in names:
                if name.isdigit():
                    found += self.plan.size_at((*above, int(name)))
        return found

    def _marker(self, number: int) -> Path:
        return self.path.joinpath(STATUS, "c", *map(str, self.plan.index(number)))

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
    """Write a finished chunk, its status last."""
    arrays = _arrays(path)
    for name in sorted(block, key=lambda one: one == STATUS):
        arrays[name][place] = block[name]


def open_folder(path: Path) -> xarray.Dataset:
    """The results in a folder, read when they are looked at; starts not yet computed are NaN, status -1.

    >>> open_folder(Path("nowhere.zarr"))
    Traceback (most recent call last):
    softstart.errors.InputError: to = nowhere.zarr: there is no sweep in this folder.
    """
    if not _is_sweep(path):
        raise InputError(f"to = {path}: there is no sweep in this folder.")
    figures = json.loads(_attributes(path)[INPUTS])["figures"]
    found = xarray.open_zarr(path, chunks=None)
    ordered: xarray.Dataset = found[[*(name for name in figures if name != STATUS), STATUS]]
    return ordered


@lru_cache(maxsize=4)
def _arrays(path: str) -> dict[str, Any]:

    return dict(zarr.open_group(path, mode="r+").arrays())


def _attributes(path: Path) -> Mapping[str, Any]:
    try:
        found = json.loads((path / "zarr.json").read_text("utf-8")).get("attributes", {})
    except (OSError, ValueError, AttributeError):
        return {}
    return found if isinstance(found, Mapping) else {}


def _is_sweep(path: Path) -> bool:
    return INPUTS in _attributes(path)


def target_of(path: Path) -> Target:
    """The folder of a sweep, as `to` names it."""
    return Target("to", path, "sweep", "folder")


def _resumed(target: Target, inputs: dict[str, Any], plan: Plan, chunk: int | None) -> Plan:
    """The plan of the sweep that is there, if it is this one."""
    attributes = _attributes(target.path)
    if INPUTS not in attributes:
        raise target.foreign()
    target.check_same(json.loads(attributes[INPUTS]), inputs)
    there = Plan(plan.shape, tuple(attributes["softstart_chunk"]))
    if chunk is not None and there != plan:
        raise InputError(
            f"chunk = {chunk}: the sweep in {target.path} was begun in chunks of "
            f"{' x '.join(map(str, there.chunk))} starts; leave chunk out to go on, or {target.other}."
        )
    return there


def _create(
    target: Target, plan: Plan, axes: tuple[Axis, ...], question: Question, inputs: dict[str, Any]
) -> None:
    """An empty sweep, put in place by one rename."""
    path = target.path
    try:
        fresh = Path(tempfile.mkdtemp(prefix=f".{path.name}.", suffix=".part", dir=path.parent))
        try:
            _fill(fresh, plan, axes, question, inputs)
            umask = os.umask(0)
            os.umask(umask)
            fresh.chmod(0o777 & ~umask)
            if path.is_dir():
                path.rmdir()  # an empty folder; rename onto one does not go everywhere
            fresh.rename(path)
        finally:
            shutil.rmtree(fresh, ignore_errors=True)
    except OSError as error:
        raise target.unwritable(error) from None


def _fill(
    fresh: Path, plan: Plan, axes: tuple[Axis, ...], question: Question, inputs: dict[str, Any]
) -> None:

    attributes = {**about(question, plan), INPUTS: json.dumps(inputs)}
    samples = [c.name for axis in axes if axis.paired for c in axis.columns]
    if samples:
        attributes["coordinates"] = " ".join(samples)  # how xarray tells coordinates from data
    group = zarr.create_group(fresh, attributes=attributes)
    for one in coordinate_variables(axes):
        _array(group, one, one.values.shape, one.values.shape)[...] = one.values
    for one in figure_variables(axes, question.figures):
        _array(group, one, plan.shape, plan.chunk)
    with warnings.catch_warnings():
        # All metadata in one file is a convention that Zarr 3 has not adopted; xarray asks for it.
        warnings.filterwarnings("ignore", "Consolidated metadata", errors.ZarrUserWarning)
        zarr.consolidate_metadata(fresh)


def _array(group: Any, one: Variable, shape: tuple[int, ...], chunks: tuple[int, ...]) -> Any:
    return group.create_array(
        one.name,
        shape=shape,
        chunks=chunks,
        dtype=str if one.dtype.kind == "O" else one.dtype,
        fill_value=one.fill,
        dimension_names=one.dims,
        attributes=one.attributes,
    )
