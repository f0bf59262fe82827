"""The starts of one chunk, computed anywhere; whether every drive and controller of a grid is possible."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import islice, product
from typing import Any

import numpy as np

from softstart.chain.machines import varied
from softstart.controller.base import CompiledController
from softstart.controller.recipe import Recipe
from softstart.drive.machine import Machine
from softstart.start.batch import prepared
from softstart.start.duty_batch import DutyBatch, DutyPlan
from softstart.start.status import Status
from softstart.sweeping.grid import PREFIX, Grid, axis_lengths, grid_values

Block = dict[str, Any]  # figure -> one value a start
CODES = {status.name: code for code, status in enumerate(Status)}
MOST_CORNERS = 4096


@dataclass(frozen=True, eq=False)
class SweepSettings:
    """What is the same for all starts of a sweep. `until`, `fitted_to` as in `simulate`.

    With a `plan` each start is a duty.
    """

    drive: Machine
    recipe: Recipe
    figures: tuple[str, ...]
    until: float | None = None
    fitted_to: Machine | None = None
    plan: DutyPlan | None = None


@dataclass(frozen=True, eq=False)
class ChunkTask:
    """A chunk: its place among the chunks, its number of starts, and what varies, see `grid_values`."""

    index: tuple[int, ...]
    settings: SweepSettings
    starts: int
    values: dict[str, Any]


def compute(task: ChunkTask) -> Block:
    """The figures of all starts of a chunk, the same bits wherever and beside whatever they are computed."""
    settings = task.settings
    drive, parameters, name = _by_owner(task.values)
    # the gap of every start, so that each chunk is a table
    gaps = np.full(task.starts, settings.drive.gap_and_inertia[0])
    machines = varied(settings.drive, {"gap": gaps, **drive})
    fitted_to = None if settings.fitted_to is None else settings.fitted_to.design_drive
    plan = settings.plan
    batch = prepared(machines) if plan is None else DutyBatch.of(machines, plan, settings.figures)
    results = batch.figures(
        settings.recipe.make(parameters, name).set_ups(fitted_to or machines),
        machines.mean_torque,
        until=settings.until,
        settled="settled_time" in settings.figures,
    )
    unknown = np.full(task.starts, np.nan)  # as the overshoot under a torque strategy
    each = {name: results[name][0] if name in results else unknown for name in settings.figures}
    figures = {name: np.ascontiguousarray(values, dtype=np.float64) for name, values in each.items()}
    return figures | {"status": np.array([CODES[one] for one in results["status"][0]], dtype=np.int8)}


def _by_owner(values: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, Any], str]:
    """Values of the machine, parameters of the controller, and its name if that is from an axis."""
    own = {name: one for name, one in values.items() if name.startswith(PREFIX)}
    controller = {name.removeprefix(f"{PREFIX}_"): one for name, one in own.items()}
    name = controller.pop(PREFIX, "")
    return {name: one for name, one in values.items() if not name.startswith(PREFIX)}, controller, name


def check_corners(settings: SweepSettings, grid: Grid) -> None:
    """Raise the InputError of the first corner of the grid whose drive or controller is impossible."""
    for corner in islice(product(*(_ends(grid, dim) for dim in axis_lengths(grid))), MOST_CORNERS):
        drive, parameters, name = _by_owner({name: one for end in corner for name, one in end.items()})
        machines: Iterable[Machine]
        if any(isinstance(value, np.ndarray) for value in drive.values()):
            machines = varied(settings.drive, drive).elements()
        else:
            machines = [settings.drive.with_values(drive)]
        controller = settings.recipe.make(parameters, name)
        if settings.plan is not None:
            machines = [*machines]
            designs = [settings.fitted_to] * len(machines) if settings.fitted_to else machines
            for machine, set_up in zip(machines, controller.set_ups(designs), strict=True):
                settings.plan.check(machine, *set_up)


def _ends(grid: Grid, dim: str) -> list[dict[str, Any]]:
    """The places along an axis that stand for all others; samples are taken together, as a batch."""
    if dim not in grid:
        return [{name: one.values for name, one in grid.items() if one.dims == (dim,)}]
    values = grid[dim].values.tolist()
    names = isinstance(values[0], str)
    return [{dim: end} for end in dict.fromkeys(values if names else [min(values), max(values)])]


def first_start(settings: SweepSettings, grid: Grid) -> bool:
    """Make the first start of the grid: compiles what is to be compiled, and finds controllers that fail.

    Returns whether all controllers are compiled, so that threads serve as well as processes.
    """
    compiled = settings.plan is None  # Python carries out the steps of a duty
    # one value of each axis; the figures are thrown away
    first = {name: one[:1] for name, one in grid.items()}
    for name in grid[PREFIX].values.tolist() if PREFIX in grid else [""]:
        compute(ChunkTask((), settings, 1, grid_values(first) | ({PREFIX: name} if name else {})))
        design = (settings.fitted_to or settings.drive).design_drive
        compiled &= isinstance(settings.recipe.make(name=name).set_up(design)[0], CompiledController)
    return compiled
