"""`sweep`: the starts of a whole grid, however large, and how far they are.

The grid is cut into chunks (grid.py). Chunks that the store (store.py) does not hold yet are computed
(compute.py) in threads, processes or on a cluster, and kept one by one.
"""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from datetime import timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Any

from softstart.chain.machines import MachineLike, as_machine
from softstart.controller.recipe import Recipe, with_whole_path
from softstart.drive.duty import Duty
from softstart.drive.machine import Machine
from softstart.errors import InputError, Mistakes
from softstart.hints import nearest
from softstart.parallel import Pool, checked_workers, usable_workers
from softstart.quantities import check_whole, show
from softstart.start.demand import ControllerLike, as_recipe
from softstart.start.duty_batch import DutyPlan
from softstart.start.engine import check_limits
from softstart.start.results import has_margin
from softstart.sweeping.compute import ChunkTask, SweepSettings, check_corners, compute, first_start
from softstart.sweeping.grid import ChunkGrid, Grid, axis_lengths, grid_values, read_grid
from softstart.sweeping.store import STATUS, FolderStore, MemoryStore, columns_of

if TYPE_CHECKING:
    import xarray

FIGURES = ("k_dyn", "start_time", "peak_torque", "contacts")
OF_LIMITS = ("margin", "keeps_limits")  # figures of a drive with limits
CHUNK_OF_DUTIES = 64  # each takes some milliseconds


def sweep(
    drive: MachineLike,
    controller: ControllerLike | None,
    grid: Mapping[str, Any],
    *,
    parameters: Mapping[str, object] | None = None,
    until: float | str | None = None,
    fitted_to: MachineLike | None = None,
    duty: Duty | str | bool | None = None,
    stop: str | None = None,
    cycles: int = 2,
    to: str | os.PathLike[str] | None = None,
    figures: tuple[str, ...] | list[str] | None = None,
    chunk: int | None = None,
    workers: int | None = None,
    scheduler: str | None = None,
    progress: Callable[[SweepProgress], object] | None = None,
    allow_code: bool = False,
) -> xarray.Dataset:
    """Simulate every start of a grid; each figure is the same to the bit as that of `simulate`.

    With a `duty` every machine of the grid is carried through it, as by `run_duty`.

    Parameters
    ----------
    drive : Drive, Chain, str or path
        The drive or chain, or its name or file; it has what the grid does not vary.
    controller : str, Controller, torque over time or None
        As in `simulate`; None where controllers are an axis.
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
    until : float or str, optional
        As in `simulate`.
    fitted_to : Drive or Chain, optional
        As in `simulate`.
    duty : Duty, path or bool, optional
        A duty instead of a start, itself, its file or, if True, that of the machine.
    stop, cycles : optional
        As in `run_duty`.
    to : path, optional
        Zarr folder for the results. It is written chunk by chunk; the same call on it goes on where an
        earlier one ended, however that ended. Without it the results are kept in memory.
    figures : sequence of str, optional
        Those to keep, by name; the status always is. By default K_dyn, start time, peak torque and contacts;
        of a chain with K_dyn of each shaft (`k_dyn_1`) and no contacts;
        of a drive with limits also `margin`, the least share left of the limits of shaft torque and start
        time (below 0 where one is exceeded, NaN without a start), and `keeps_limits`, 1 or 0.
        Of a duty K_dyn is the largest of all steps, `k_dyn_step_1`, ... that of a step of its file,
        `start_time` the longest of all starts and reversals; `cycle_time` and contacts are of the last cycle.
        `impact_energy` and `damage` (of a cycle, see `DutyRun.life`) are computed if they are named.
    chunk : int, optional
        Most starts of a chunk; memory and what an interruption loses go with it.
    workers : int, optional
        How many chunks are computed at once on this machine, by default one for each processor: by threads
        where the controllers are compiled, else by processes. 1 computes in this thread.
    scheduler : str, optional
        Address of a dask scheduler whose workers compute instead.
    progress : callable, optional
        Called with a `SweepProgress` at the beginning and after each chunk.
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
    """
    settings, axes = _settings(
        drive, controller, grid, parameters, until, fitted_to, figures, allow_code=allow_code,
        duty=duty, stop=stop, cycles=cycles,
    )  # fmt: skip
    if chunk is not None:
        check_whole(chunk, "chunk")
    checked_workers(workers, scheduler)
    check_corners(settings, axes)
    shape = tuple(axis_lengths(axes).values())
    texts = [dim in axes and axes[dim].dtype.kind == "U" for dim in axis_lengths(axes)]
    plan = ChunkGrid.of(shape, texts, chunk or (CHUNK_OF_DUTIES if settings.plan else None))
    threads = first_start(settings, axes)  # compiled steps release the GIL
    count = usable_workers(settings.recipe.given, "the controller", workers, scheduler, threads)
    chunks = MemoryStore(plan, axes, settings) if to is None else FolderStore(Path(to), plan, axes, settings)
    with chunks as store:
        begin, before = time.monotonic(), sum(map(plan.size, store.finished))
        done = before

        def tell() -> None:
            if progress is not None:
                what = "starts" if settings.plan is None else "duties"
                progress(SweepProgress(done, plan.starts, before, time.monotonic() - begin, what))

        def task(index: tuple[int, ...]) -> ChunkTask:
            place = dict(zip(axis_lengths(axes), plan.place(index), strict=True))
            part = {name: one.isel({one.dims[0]: place[str(one.dims[0])]}) for name, one in axes.items()}
            return ChunkTask(index, settings, plan.size(index), grid_values(part))

        tell()
        left = plan.indices() if done < plan.starts else iter(())
        with Pool(
            min(count, math.prod(plan.counts)), threads=threads, scheduler=scheduler, describe=_described,
            advice="take fewer workers or smaller chunks", kept="Finished chunks are kept.",
        ) as pool:  # fmt: skip
            tasks = (task(index) for index in left if index not in store.finished)
            for one, block in pool.results(compute, tasks):
                store.keep(one.index, block)
                done += one.starts
                tell()
        return store.results()


def _settings(
    given: MachineLike, controller: ControllerLike | None, grid: Mapping[str, Any],
    parameters: Mapping[str, object] | None, until: object, fitted_to: MachineLike | None, figures: object,
    *, allow_code: bool, duty: Duty | str | bool | None, stop: str | None, cycles: int,
) -> tuple[SweepSettings, Grid]:  # fmt: skip
    """What is the same for all starts, and the axes; or one InputError for all that is wrong with them."""
    drive, recipe, axes, kept, wrong = as_machine(given), Recipe(), Grid(), tuple[str, ...](), Mistakes()
    fitted: Machine | None = None
    end: float | None = None
    plan: DutyPlan | None = None
    with wrong.collect():
        plan = DutyPlan.of(drive, duty, stop, cycles)
        if plan is not None and until is not None:
            raise InputError(f"until = {show(until)}: the steps of a duty say when it ends; leave it out.")
    with wrong.collect():
        fitted = None if fitted_to is None else as_machine(fitted_to, "fitted_to")
    with wrong.collect():
        end, *_ = check_limits(until, None, 1, drive.KIND)
    with wrong.collect():
        controller = with_whole_path(controller) if isinstance(controller, str) else controller
        recipe = as_recipe("" if controller is None else controller, parameters, allow_code)
        axes = read_grid(grid, recipe, drive)
    with wrong.collect():
        kept = _figures(drive, figures, plan)
    wrong.raise_if_any()
    return SweepSettings(drive, recipe, kept, end, fitted, plan), axes


def _described(task: ChunkTask) -> str:
    return f"chunk {', '.join(map(str, task.index))} of the sweep"


def _figures(drive: Machine, figures: object, plan: DutyPlan | None) -> tuple[str, ...]:
    """The figures asked for, or the usual ones; InputError for those that starts of this machine lack."""
    limited, known = has_margin(drive.limits), list(columns_of(drive, plan))
    if figures is None:
        usual: tuple[str, ...] = FIGURES
        if plan is not None:
            steps = (f"k_dyn_step_{k + 1}" for k in range(len(plan.duty.steps)))
            usual = ("k_dyn", *steps, "start_time", "peak_torque", "cycle_time", "contacts")
        elif (count := len(drive.shaft_names)) > 1:
            usual = (*FIGURES[:3], *(f"k_dyn_{k + 1}" for k in range(count)))
        return usual + OF_LIMITS if limited else usual
    if not isinstance(figures, tuple | list) or not figures:
        raise InputError(f"figures = {show(figures)}: name figures in a list, as ['k_dyn', 'start_time'].")
    for name in figures:
        if name not in known:
            near = nearest(name, known) if isinstance(name, str) else None
            hint = f"did you mean {near}?" if near else f"there are {', '.join(known)}."
            raise InputError(f"figures = {show(name)}: there is no such figure; {hint}")
        if name in OF_LIMITS and not limited:
            raise InputError(
                f"figures = {name}: the {drive.KIND} has no limits that it could refer to; give "
                f"{drive.LIMITS_GIVEN}."
            )
    return tuple(name for name in dict.fromkeys(figures) if name != STATUS)


@dataclass(frozen=True)
class SweepProgress:
    """Starts, or duties, finished of all, and of these by an earlier run; seconds of this run.

    >>> print(SweepProgress(1500, 4000, 500, 2.0))
    1,500 of 4,000 starts (37 %), 500 starts/s, 0:00:05 left
    """

    done: int
    starts: int
    before: int
    seconds: float
    what: str = "starts"

    def __str__(self) -> str:
        share = f"{self.done:,} of {self.starts:,} {self.what} ({100 * self.done // self.starts:.0f} %)"
        if self.done == self.before:
            return share
        rate = (self.done - self.before) / self.seconds
        left = timedelta(seconds=math.ceil((self.starts - self.done) / rate))
        return f"{share}, {rate:,.0f} {self.what}/s, {left} left"
