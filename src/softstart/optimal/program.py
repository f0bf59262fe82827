"""A linear program that stays alive in HiGHS: rows are taken in and bounds moved, and the basis is kept.

HiGHS: Q. Huangfu, J. A. J. Hall, Math. Prog. Comp. 10 (2018) 119-142, doi 10.1007/s12532-017-0130-5.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import cache
from typing import Any

import numpy as np

from softstart.arrays import Matrix, Vector

ITERATIONS = 20  # for each column: a few programs never end
MOST_INTERIOR = 200  # iterations


@cache
def _solver() -> Any:
    import highspy

    class Quiet(highspy.Highs):
        def enableCallbacks(self) -> None:  # to enable them prints a line, and none is needed
            pass

    return Quiet, highspy.HighsModelStatus.kOptimal


class LinearProgram:
    """Minimise cost x over lower <= x <= upper and rows that are added.

    >>> program = LinearProgram(np.array([-1.0, -1.0]), np.zeros(2), np.full(2, 3.0))
    >>> program.add({0: np.array([[1.0, 2.0]])}, 4.0)
    >>> program.solved().tolist()
    [3.0, 0.5]
    >>> program.limit(np.zeros(2), np.full(2, 1.0))
    >>> program.solved().tolist()
    [1.0, 1.0]
    """

    def __init__(self, cost: Vector, lower: Vector, upper: Vector) -> None:
        made, self._optimal = _solver()
        self.size, self._highs = cost.size, made()
        self._columns = np.arange(cost.size, dtype=np.int32)
        for name, value in (
            ("output_flag", False), ("presolve", "off"), ("parallel", "off"), ("threads", 1),
            ("simplex_iteration_limit", ITERATIONS * cost.size),
        ):  # fmt: skip
            self._highs.setOptionValue(name, value)
        self._highs.addVars(cost.size, lower, upper)
        self._highs.changeColsCost(cost.size, self._columns, cost)

    def limit(self, lower: Vector, upper: Vector) -> None:
        """Other bounds of all columns."""
        self._highs.changeColsBounds(self.size, self._columns, lower, upper)

    def costs(self, cost: Vector) -> None:
        """Other costs of all columns."""
        self._highs.changeColsCost(self.size, self._columns, cost)

    def add(self, parts: Mapping[int, Matrix], most: Any, least: Any = -math.inf) -> None:
        """Rows least <= row x <= most by their parts: the first column of each, and a full matrix."""
        whole = np.hstack(list(parts.values()))
        columns = np.concatenate([np.arange(at, at + one.shape[1]) for at, one in parts.items()])
        used, count = whole != 0.0, whole.shape[0]
        begins = np.concatenate([[0], np.cumsum(used.sum(axis=1))]).astype(np.int32)
        places = np.broadcast_to(columns, whole.shape)[used].astype(np.int32)
        limits = [np.array(np.broadcast_to(one, (count,)), dtype=float) for one in (least, most)]
        self._highs.addRows(count, *limits, places.size, begins[:-1], places, whole[used])

    def interior(self) -> tuple[Vector, float] | None:
        """Duals of the rows in the middle of the best ones, and the least cost; None where none is found.

        >>> program = LinearProgram(np.array([1.0]), np.zeros(1), np.full(1, 9.0))
        >>> program.add({0: np.array([[1.0]])}, 9.0, 2.0)
        >>> [round(float(one), 6) for one in (*program.interior()[0], program.interior()[1])]
        [1.0, 2.0]
        """
        for name, value in (("run_crossover", "off"), ("ipm_iteration_limit", MOST_INTERIOR)):
            self._highs.setOptionValue(name, value)
        for way in ("ipx", "simplex"):  # the interior point ends without an answer now and then
            self._highs.setOptionValue("solver", way)
            if self.solved() is not None:
                duals = np.array(self._highs.getSolution().row_dual)
                return duals, float(self._highs.getInfo().objective_function_value)
        return None

    def solved(self) -> Vector | None:
        """The best x; None where none is found."""
        self._highs.run()
        if self._highs.getModelStatus() != self._optimal:
            return None
        return np.array(self._highs.getSolution().col_value)
