"""`sweep`: the starts of a whole grid, however large, and how far they are.

The grid is cut into chunks (grid.py). Chunks that the store (store.py) does not hold yet are computed
(compute.py) in threads, processes or on a cluster, and kept one by one.
"""

from __future__ import annotations

import math
import os
import time
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from numbers import Real
from pathlib import Path
from typing import TYPE_CHECKING, Any

from softstart.chain.machines import Machine
from softstart.chain.model import load_machine
from softstart.controller.base import Controller
from softstart.drive.records import is_machine
from softstart.errors import InputError, Mistakes
from softstart.parallel import Pool, checked_workers, why_not_sendable
from softstart.quantities import nearest, show
from softstart.start.batch import has_margin
from softstart.store import fresh_folder
from softstart.sweeping.compute import Question, Task, check_corners, compute, first_start, known_figures
from softstart.sweeping.grid import NO_CONTROLLER, Axis, Plan, checked_chunk, read_grid
from softstart.sweeping.maker import Maker, with_whole_path
from softstart.sweeping.store import Store

if TYPE_CHECKING:
    import xarray

FIGURES = ("k_dyn", "start_time", "peak_torque", "contacts")
OF_LIMITS = ("margin", "keeps_limits")  # figures of a drive with limits


def sweep(
    drive: Machine | str,
    controller: str | Controller | None,
    grid: Mapping[str, Any],
    *,
    parameters: Mapping[str, object] | None = None,
    until: float | None = None,
    fitted_to: Machine | None = None,
    base: Machine | None = None,
    to: str | os.PathLike[str] | None = None,
    netcdf: str | os.PathLike[str] | None = None,
    figures: tuple[str, ...] | list[str] | None = None,
    chunk: int | None = None,
    workers: int | None = None,
    scheduler: str | None = None,
    time_limit: float | None = None,
    progress: Told | None = None,
    allow_code: bool = False,
) -> xarray.Dataset:
    """Simulate every start of a grid; each figure is the same to the bit as that of `simulate`.

    Parameters
    ----------
    drive : Drive, Chain or str
        The drive or chain, or its name or file; it has what the grid does not vary.
    controller : str, Controller or None
        A name, `path/to/file.py:ClassName` or an object; None where controllers are an axis.
    grid : mapping
        The axes, in order: values by parameter. A parameter of the drive by name (`gap`) or as in a file
        (`shaft.gap`), one of the controller as `controller.NAME`, and `controller` itself with names. Values
        are numbers in SI, strings with units or texts (`load.kind`). A mapping instead of values is one axis
        of samples, whose parameters vary together: {"sample": {"gap": [...], "load.inertia": [...]}}. "2x" is
        twice the own value. Of a chain `gap` is the sum of all its gaps at the motor shaft, widened alike,
        and any mass or shaft may be named by number or name: `mass[2].inertia`, `shaft[rotor - pinion].gap`;
        the coordinate is then called `mass_2_inertia`.
    parameters : mapping, optional
        Parameters of the controller that are the same everywhere.
    until, time_limit : float, optional
        As in `simulate`, s.
    fitted_to, base : Drive or Chain, optional
        As in `simulate`.
    to : path, optional
        Zarr folder for the results. It is written chunk by chunk; the same call on it goes on where an
        earlier one ended, however that ended. Without it the results are kept in memory.
    netcdf : path, optional
        Also write the finished results into this netCDF file.
    figures : sequence of str, optional
        Those to keep, by name; the status always is. By default K_dyn, start time, peak torque and contacts;
        of a chain with K_dyn of each shaft (`k_dyn_1`) and no contacts;
        of a drive with limits also `margin`, the least share left of the limits of shaft torque and start
        time (below 0 where one is exceeded, NaN without a start), and `keeps_limits`, 1 or 0.
    chunk : int, optional
        Most starts of a chunk; memory and what an interruption loses go with it.
    workers : int, optional
        How many chunks are computed at once on this machine, by default one for each processor: by threads
        where the controllers are compiled, else by processes. 1 computes in this thread.
    scheduler : str, optional
        Address of a dask scheduler whose workers compute instead.
    progress : callable, optional
        Called with a `Progress` at the beginning and after each chunk.
    allow_code : bool
        Whether a file of tuned gains may name a Python file, which then runs.

    Returns
    -------
    xarray.Dataset
        With a dimension for each axis, called as the parameter is in Python (`load_inertia`,
        `controller_torque`). Figures of starts that could not be finished are NaN, `status` says why by code.
        With `to` nothing is read before it is looked at; `xarray.open_zarr(to)` opens it with dask.

    Raises
    ------
    InputError
        For bad input, an impossible drive anywhere on the grid, or a folder that holds something else.
    SimulationError
        For workers that cannot go on. As after a KeyboardInterrupt, finished chunks are kept.

    Examples
    --------
    >>> from softstart import Drive, sweep
    >>> found = sweep(Drive.load("crane-4amtkf"), "direct", {"gap": [0.5, 2], "load.inertia": [0.07, 0.175]})
    >>> found.k_dyn.sel(gap=2, load_inertia=0.175).item().__round__(4)
    4.8654

    References
    ----------
    docs/sweeps.md; each start: see `simulate`.
    """
    if isinstance(drive, str):
        drive = load_machine(drive)
    maker = _maker(controller, parameters, allow_code)
    axes = _checked(drive, maker, grid, until, time_limit, fitted_to, base, figures)
    question = Question(drive, maker, _figures_kept(drive, figures), until, fitted_to, base, time_limit)
    most, count = checked_chunk(chunk), checked_workers(workers, scheduler)
    if netcdf is not None:
        _check_netcdf(Path(netcdf))
    check_corners(question, axes)
    plan = Plan.of([axis.size for axis in axes], [not axis.numeric for axis in axes], most)
    threads = first_start(question, axes)
    if scheduler is not None or (min(count, plan.chunks) > 1 and not threads):
        if workers is None and scheduler is None and why_not_sendable(maker.given):
            count = 1
        else:
            maker.check_sendable()
    with Store(None if to is None else Path(to), plan, axes, question, most) as store:
        watch = Watch(plan.starts, store.finished_starts(), progress)
        tasks = (
            Task(index, question, tuple(map(Axis.part, axes, store.plan.place(index))))
            for index in (store.plan.indices() if watch.done < plan.starts else ())
            if not store.finished(index)
        )
        with Pool(
            min(count, store.plan.chunks), threads=threads, scheduler=scheduler, describe=_described,
            advice="take fewer workers or smaller chunks", kept="Finished chunks are kept.",
        ) as pool:  # fmt: skip
            for task, block in pool.results(compute, tasks):
                store.keep(task.index, block)
                watch.add(store.plan.size(task.index))
        results = store.results()
        if netcdf is not None:
            _write_netcdf(Path(netcdf), results)
    return results


def _described(task: Task) -> str:
    return f"chunk {', '.join(map(str, task.index))} of the sweep"


def _check_netcdf(path: Path) -> None:
    """Raise InputError if the file cannot be written, before anything is computed."""
    if path.is_dir():
        raise InputError(f"netcdf = {path}: this is a folder; give the name of a file.")
    if not path.parent.is_dir():
        raise InputError(f"netcdf = {path}: there is no folder {path.parent}; make it, or give another file.")
    if not os.access(path if path.exists() else path.parent, os.W_OK):
        raise InputError(f"netcdf = {path}: you may not write there; give another file.")


def _write_netcdf(path: Path, results: xarray.Dataset) -> None:
    """Write the results; with dask in the memory of some chunks, else in that of one figure."""
    import importlib.util

    chunks = tuple(results.attrs["softstart_chunk"])
    packed = {"zlib": True, "complevel": 1, "shuffle": True, "chunksizes": chunks}
    if importlib.util.find_spec("dask") is not None:
        results = results.chunk(dict(zip(results["status"].dims, chunks, strict=True)))
    try:
        with fresh_folder(path.parent) as stage:
            encoding = dict.fromkeys(results.data_vars, packed)
            results.to_netcdf(stage / path.name, engine="h5netcdf", encoding=encoding)
            (stage / path.name).replace(path)
    except OSError as error:
        raise InputError(
            f"netcdf = {path}: the file could not be written ({error.strerror or error}); give another one."
        ) from None


def _maker(controller: object, parameters: Mapping[str, object] | None, allow_code: bool) -> Maker:
    given = dict(parameters or {})
    if controller is None:
        return Maker("", given, allow_code)
    if isinstance(controller, Controller):
        if given:
            raise InputError(
                f"parameters {sorted(given)} were given beside a finished controller; give them to it itself."
            )
        return Maker(controller)
    if not isinstance(controller, str) or not controller:
        raise InputError(
            f"controller = {controller!r}: a controller is a name, path/to/file.py:ClassName, or a "
            "Controller object."
        )
    return Maker(with_whole_path(controller), given, allow_code)


def _checked(
    drive: object,
    maker: Maker,
    grid: Mapping[str, Any],
    until: object,
    time_limit: object,
    fitted_to: object,
    base: object,
    figures: object,
) -> tuple[Axis, ...]:
    """The axes, if all input is right in itself; all mistakes at once."""
    wrong, axes = Mistakes(), tuple[Axis, ...]()
    for name, other in (("drive", drive), ("fitted_to", fitted_to), ("base", base)):
        if not is_machine(other) and not (other is None and name != "drive"):
            sentence = f"{name} = {show(other)}: give one Drive or Chain; what varies goes into the grid."
            wrong.sentences.append(sentence)
    for name, value in (("until", until), ("time_limit", time_limit)):
        if value is not None and not (
            isinstance(value, Real) and not isinstance(value, bool) and 0.0 < float(value) < math.inf
        ):
            sentence = f"{name} = {show(value)}: give a time above 0 s as a number, or leave it out."
            wrong.sentences.append(sentence)
    machine: Any = drive if is_machine(drive) else None
    wrong.sentences += _figure_mistakes(figures, machine)
    if not maker.given and not (isinstance(grid, Mapping) and "controller" in grid):
        wrong.sentences.append(NO_CONTROLLER)
    else:
        with wrong.noted():
            axes = read_grid(grid, maker, machine)
    wrong.settle()
    return axes


def _figures_kept(drive: Machine, figures: tuple[str, ...] | list[str] | None) -> tuple[str, ...]:
    """The figures asked for, or the usual ones; InputError for a margin where there are no limits."""
    limited = has_margin(drive.limits)
    if figures is None:
        usual: tuple[str, ...] = FIGURES
        if (count := len(drive.shaft_names)) > 1:
            usual = (*FIGURES[:3], *(f"k_dyn_{k + 1}" for k in range(count)))
        return usual + OF_LIMITS if limited else usual
    wrong = [name for name in figures if name in OF_LIMITS and not limited]
    if wrong:
        raise InputError(
            f"figures = {wrong[0]}: the drive has no limits that it could refer to; give "
            'limits.shaft_torque, as "175 N*m", or limits.start_time in its file.'
        )
    return tuple(dict.fromkeys(figures))


def _figure_mistakes(figures: object, machine: Machine | None) -> list[str]:
    if figures is None:
        return []
    if isinstance(figures, str) or not isinstance(figures, tuple | list) or not figures:
        return [f"figures = {show(figures)}: name figures in a list, as ['k_dyn', 'start_time']."]
    known = list(known_figures(("",) if machine is None else machine.shaft_names))
    wrong = []
    for name in figures:
        if name not in known:
            near = nearest(name, known) if isinstance(name, str) else None
            hint = f"did you mean {near}?" if near else f"there are {', '.join(known)}."
            wrong.append(f"figures = {show(name)}: there is no such figure; {hint}")
    return wrong


RECENT = 30.0  # s, over which the rate is taken


@dataclass(frozen=True)
class Progress:
    """Starts finished of all, and of these by an earlier run; seconds of this run, and starts a second.

    >>> print(Progress(1500, 4000, 500, 2.0, 500.0))
    1,500 of 4,000 starts (37 %), 500 starts/s, 5 s left
    """

    done: int
    starts: int
    before: int
    seconds: float
    rate: float

    @property
    def left(self) -> float:
        """Seconds that are left at this rate, NaN as long as there is none."""
        return (self.starts - self.done) / self.rate if self.rate > 0.0 else math.nan

    def __str__(self) -> str:
        share = f"{self.done:,} of {self.starts:,} starts ({100 * self.done // self.starts:.0f} %)"
        if not self.rate > 0.0:
            return share
        return f"{share}, {self.rate:,.0f} starts/s, {_duration(self.left)} left"


Told = Callable[[Progress], object]


class Watch:
    """Counts finished starts and tells how far the sweep is; the rate is that of the last half minute."""

    def __init__(self, starts: int, before: int, told: Told | None) -> None:
        self.starts, self.before, self.told = starts, before, told
        self.done = before
        self.begin = time.monotonic()
        self.marks = deque([(self.begin, before)])
        self._tell(self.begin)

    def add(self, starts: int) -> None:
        """So many more are finished."""
        self.done += starts
        now = time.monotonic()
        self.marks.append((now, self.done))
        while len(self.marks) > 2 and now - self.marks[1][0] > RECENT:
            self.marks.popleft()
        self._tell(now)

    def _tell(self, now: float) -> None:
        if self.told is None:
            return
        since, done = self.marks[0]
        rate = (self.done - done) / (now - since) if now > since else 0.0
        self.told(Progress(self.done, self.starts, self.before, now - self.begin, rate))


def _duration(seconds: float) -> str:
    """A duration in words.

    >>> _duration(59), _duration(125), _duration(7300)
    ('59 s', '2 min 5 s', '2 h 1 min')
    """
    whole = math.ceil(seconds)
    if whole < 60:
        return f"{whole} s"
    if whole < 3600:
        return f"{whole // 60} min {whole % 60} s"
    return f"{whole // 3600} h {whole % 3600 // 60} min"
