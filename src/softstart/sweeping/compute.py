"""The starts of one chunk, computed anywhere; whether every drive and controller of a grid is possible."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cache
from itertools import islice, product
from typing import Any

import numpy as np

from softstart.chain.machines import Machine, varied
from softstart.controller.base import CompiledController
from softstart.controller.recipe import Recipe
from softstart.start.batch import named, prepared
from softstart.start.status import Status
from softstart.sweeping.grid import Axis, Column

Block = dict[str, Any]  # figure -> array of the chunk's shape
CODES = {status.name: code for code, status in enumerate(Status)}
MOST_CORNERS = 4096


@cache
def known_figures(shafts: tuple[str, ...] = ("",)) -> dict[str, tuple[str, str]]:
    """Names of the figures of a start, with unit and meaning; of several shafts each has its own.

    >>> known_figures()["start_time"]
    ('s', 'first instant at which the load has its target speed')
    >>> known_figures(("rotor - pinion", "pinion - wheel"))["k_dyn_2"]
    ('1', 'K_dyn of pinion - wheel')
    """
    return {name: (unit, meaning) for name, (_, unit, meaning) in named(shafts).items()}


@dataclass(frozen=True, eq=False)
class Question:
    """What is the same for all starts of a sweep. `until`, `fitted_to` as in `simulate`."""

    drive: Machine
    recipe: Recipe
    figures: tuple[str, ...]
    until: float | None = None
    fitted_to: Machine | None = None


@dataclass(frozen=True, eq=False)
class Task:
    """A chunk: the question and those values of the axes that are its own. Small, and sent to anyone."""

    index: tuple[int, ...]
    question: Question
    axes: tuple[Axis, ...]


def compute(task: Task) -> Block:
    """The figures of all starts of a chunk, the same bits wherever and beside whatever they are computed."""
    question, shape = task.question, tuple(axis.size for axis in task.axes)
    drive, more, name = _sorted(_spread(task.axes, shape))
    # the gap of every start, so that each chunk is a table
    gaps = np.full(math.prod(shape), question.drive.gap_and_inertia[0])
    machines = varied(question.drive, {"gap": gaps, **drive})
    fitted_to = None if question.fitted_to is None else question.fitted_to.design_drive
    found = prepared(machines).figures(
        question.recipe.make(more, name).set_ups(fitted_to or machines),
        machines.mean_torque,
        until=question.until,
    )
    block: Block = {
        name: np.ascontiguousarray(found[name][0], dtype=np.float64).reshape(shape)
        for name in question.figures
        if name != "status"
    }
    names, which = np.unique(found["status"][0], return_inverse=True)
    codes = np.array([CODES[name] for name in names.tolist()], dtype=np.int8)
    return block | {"status": codes[which].reshape(shape)}


def _spread(axes: tuple[Axis, ...], shape: tuple[int, ...]) -> Iterator[tuple[Column, Any]]:
    """Each column with its value for every start; the one text of a column of texts."""
    for number, axis in enumerate(axes):
        along = tuple(axis.size if i == number else 1 for i in range(len(shape)))
        for column in axis.columns:
            if column.numeric:
                yield column, np.broadcast_to(column.values.reshape(along), shape).ravel()
            else:
                yield column, column.values[0]


def _sorted(values: Iterable[tuple[Column, Any]]) -> tuple[dict[str, Any], dict[str, Any], str]:
    """Values of the machine, parameters of the controller, and its name if that is from an axis."""
    given: dict[str, dict[str, Any]] = {"drive": {}, "parameter": {}, "controller": {"": ""}}
    for column, value in values:
        given[column.owner][column.field] = value
    return given["drive"], given["parameter"], given["controller"][""]


def check_corners(question: Question, axes: tuple[Axis, ...]) -> None:
    """Raise the InputError of the first corner of the grid whose drive or controller is impossible."""
    for corner in islice(product(*map(_ends, axes)), MOST_CORNERS):
        drive, more, name = _sorted(pair for place in corner for pair in place)
        if any(isinstance(value, np.ndarray) for value in drive.values()):
            varied(question.drive, drive)
        else:
            question.drive.with_values(drive)
        question.recipe.make(more, name)


def _ends(axis: Axis) -> list[tuple[tuple[Column, Any], ...]]:
    """The places along an axis that stand for all others; samples are taken together, as a batch."""
    if axis.paired:
        return [tuple((column, column.values) for column in axis.columns)]
    (column,) = axis.columns
    ends = (float(column.values.min()), float(column.values.max())) if column.numeric else column.values
    return [((column, value),) for value in dict.fromkeys(ends)]


def first_start(question: Question, axes: tuple[Axis, ...]) -> bool:
    """Make the first start of the grid: compiles what is to be compiled, and finds controllers that fail.

    Returns whether all controllers are compiled, so that threads serve as well as processes.
    """
    compiled = True
    controllers = next((c.values for axis in axes for c in axis.columns if c.owner == "controller"), ("",))
    for name in controllers:
        first = tuple(Axis(axis.name, tuple(_one(c, name) for c in axis.columns)) for axis in axes)
        compute(Task((), question, first))
        design = (question.fitted_to or question.drive).design_drive
        compiled &= isinstance(question.recipe.make(name=name).set_up(design)[0], CompiledController)
    return compiled


def _one(column: Column, controller: str) -> Column:
    return replace(column, values=(controller,)) if column.owner == "controller" else column.part(slice(0, 1))
