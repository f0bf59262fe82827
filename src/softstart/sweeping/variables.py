"""What the variables of a sweep are called, and their types and attributes, wherever they are written."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from softstart import __version__
from softstart.start.status import Status
from softstart.sweeping.axes import Axis
from softstart.sweeping.plan import Plan
from softstart.sweeping.starts import Question, known_figures

STATUS = "status"
NOT_COMPUTED = -1  # in `status`, of a start that has not been computed yet


@dataclass(frozen=True, eq=False)
class Variable:
    """One variable; coordinates bring their `values`."""

    name: str
    dims: tuple[str, ...]
    dtype: Any
    fill: Any
    attributes: dict[str, Any] = field(default_factory=dict)
    values: Any = None


def figure_variables(axes: tuple[Axis, ...], figures: tuple[str, ...]) -> list[Variable]:
    """The figures, and at the end the status, whose chunk in a folder says that all the others are there."""
    dims = tuple(axis.name for axis in axes)
    found = []
    for name in figures:
        if name != STATUS:
            unit, meaning = known_figures()[name]
            found.append(Variable(name, dims, np.dtype("f8"), np.nan, {"units": unit, "long_name": meaning}))
    attributes = {
        "long_name": "how the start ended",
        "flag_values": [NOT_COMPUTED, *range(len(Status))],
        "flag_meanings": " ".join(["not_computed", *(status.name.lower() for status in Status)]),
    }
    return [*found, Variable(STATUS, dims, np.dtype("i1"), NOT_COMPUTED, attributes)]


def coordinate_variables(axes: tuple[Axis, ...]) -> list[Variable]:
    """The values along the axes."""
    found = []
    for axis in axes:
        if axis.paired:
            numbers = np.arange(axis.size, dtype=np.int64)
            about = {"units": "1", "long_name": "number of the sample"}
            found.append(Variable(axis.name, (axis.name,), numbers.dtype, 0, about, numbers))
        for column in axis.columns:
            attributes = {"units": column.unit, "long_name": column.meaning}
            dims = (axis.name,)
            if column.numeric:
                found.append(Variable(column.name, dims, np.dtype("f8"), np.nan, attributes, column.values))
            else:
                del attributes["units"]
                texts = np.array(column.values, dtype=object)
                found.append(Variable(column.name, dims, texts.dtype, "", attributes, texts))
    return found


def about(question: Question, plan: Plan) -> dict[str, Any]:
    """Attributes of the whole."""
    shown, fitted_to = question.maker.shown, question.fitted_to
    other = {} if fitted_to is None else {"softstart_fitted_to": fitted_to.to_toml()}
    return other | {
        "title": f"{question.drive.name}, {shown}" if shown else question.drive.name,
        "source": f"softstart {__version__}",
        "softstart_drive": question.drive.to_toml(),
        "softstart_chunk": list(plan.chunk),
    }
