"""Whether every drive and every controller of a grid can be: its corners tell.

Each rule that a drive's parameters obey together (starting torque above load torque, ...) is broken, if
anywhere on a grid, at a corner of it too: at the smallest or largest value of each axis. So a few drives
stand for all of them. A sweep with an impossible drive is refused as a whole: a hole in a table would look
like an answer, and the ends of an axis are quickly changed.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from itertools import islice, product
from typing import Any

from softstart.controller.base import CompiledController
from softstart.errors import InputError
from softstart.sweeping.axes import Axis, Column
from softstart.sweeping.starts import Question, Task, compute

MOST_CORNERS = 4096
TOLD = 5  # combinations in one refusal


def check_corners(question: Question, axes: tuple[Axis, ...]) -> None:
    """Raise one InputError if a drive or a controller of the grid is impossible."""
    told: dict[str, str] = {}
    for corner in islice(product(*map(_ends, axes)), MOST_CORNERS):
        values = [pair for place in corner for pair in place]
        try:
            _make(question, values)
        except InputError as error:
            for sentence in error.sentences:
                rule = re.sub(r"= (\"[^\"]*\"|\S+)", "", sentence)  # the same mistake with other numbers
                told.setdefault(rule, sentence)
    if told:
        raise InputError(list(told.values())[:TOLD])


def first_start(question: Question, axes: tuple[Axis, ...]) -> bool:
    """Make the first start of the grid: compiles what is to be compiled, and finds controllers that fail.

    Returns whether all controllers are compiled, so that threads serve as well as processes.
    """
    compiled = True
    controllers = next((c.values for axis in axes for c in axis.columns if c.owner == "controller"), ("",))
    for controller in controllers:
        first = tuple(
            Axis(axis.name, tuple(_one(column, controller) for column in axis.columns)) for axis in axes
        )
        compute(Task(0, question, first, tuple(slice(0, 1) for _ in axes)))
        ready, _ = question.maker.make({}, controller).set_up(question.fitted_to or question.drive)
        compiled = compiled and isinstance(ready, CompiledController)
    return compiled


def _one(column: Column, controller: str) -> Column:
    return replace(column, values=(controller,)) if column.owner == "controller" else column.part(slice(0, 1))


def _ends(axis: Axis) -> list[tuple[tuple[Column, Any], ...]]:
    """The places along an axis that stand for all others; samples are taken together, as a batch."""
    if axis.paired:
        return [tuple((column, column.values) for column in axis.columns)]
    (column,) = axis.columns
    if not column.numeric:
        return [((column, text),) for text in dict.fromkeys(column.values)]
    low, high = float(column.values.min()), float(column.values.max())
    return [((column, value),) for value in dict.fromkeys((low, high))]


def _make(question: Question, values: list[tuple[Column, Any]]) -> None:
    drive: dict[str, Any] = {c.field: value for c, value in values if c.owner == "drive"}
    parameters = {c.field: value for c, value in values if c.owner == "parameter"}
    controller = next((value for c, value in values if c.owner == "controller"), "")
    sentences: list[str] = []
    attempts: tuple[Callable[[], object], ...] = (
        lambda: question.drive.replace(**drive),
        lambda: question.maker.make(parameters, controller),
    )
    for attempt in attempts:
        try:
            attempt()
        except InputError as error:
            sentences += error.sentences
    if sentences:
        raise InputError(sentences)
