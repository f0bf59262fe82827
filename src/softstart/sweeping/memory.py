"""A sweep in memory, for grids that have room there."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from softstart.errors import InputError
from softstart.sweeping.axes import Axis
from softstart.sweeping.plan import Plan
from softstart.sweeping.starts import Block, Question
from softstart.sweeping.variables import about, coordinate_variables, figure_variables

if TYPE_CHECKING:
    import xarray

MOST = 10_000_000  # starts


class Memory:
    """Arrays that are filled chunk by chunk."""

    def __init__(self, plan: Plan, axes: tuple[Axis, ...], question: Question) -> None:
        if plan.starts > MOST:
            raise InputError(
                f"grid: {plan.starts:,} starts are too many to keep in memory ({MOST:,} at most); give "
                "to=FOLDER (--out DIR), where a sweep may have any size."
            )
        self.plan, self.axes, self.question = plan, axes, question
        self.arrays = {
            one.name: np.full(plan.shape, one.fill, dtype=one.dtype)
            for one in figure_variables(axes, question.figures)
        }

    def keep(self, place: tuple[slice, ...], block: Block) -> None:
        """Take in a finished chunk."""
        for name, values in block.items():
            self.arrays[name][place] = values

    def dataset(self) -> xarray.Dataset:
        """The results."""
        import xarray

        return xarray.Dataset(
            {
                one.name: (one.dims, self.arrays[one.name], one.attributes)
                for one in figure_variables(self.axes, self.question.figures)
            },
            coords={
                one.name: (
                    one.dims,
                    one.values.astype(str) if one.dtype.kind == "O" else one.values,
                    one.attributes,
                )
                for one in coordinate_variables(self.axes)
            },
            attrs=about(self.question, self.plan),
        )
