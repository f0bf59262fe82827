"""What the linear programs share: rows over variables, HiGHS, checked instants, refinement of a grid."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import Any, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.optimize import linprog

try:  # SciPy's own HiGHS: linprog takes no basis to start from
    from scipy.optimize._highspy import _core as highs
except ImportError:  # SciPy before 1.15
    highs = None

from softstart.arrays import Matrix, Vector
from softstart.optimal.lp.motion import Contact
from softstart.optimal.problem import Problem

Steps = NDArray[np.int64]
Marks = NDArray[np.bool_]

AIM = 1.0 + 1e-9  # a little above the target, so that the exact plant finds it reached
QUARTERS, HALVES = (0.25, 0.5, 0.75, 1.0), (0.5, 1.0)  # of a step, where T is checked
SIXTEENTHS = tuple((np.arange(16) + 1.0) / 16.0)  # where it is checked afterwards
FINE_ENDS = 30.0  # radians of the elastic oscillation at either end of a long contact
LONG_STEPS = 4  # between them
ROUNDS = 3  # of finer grids where the torque switches
FIRST_WIDTH = 4e-3  # of t_f: how far instants may move on the first finer grid
FEW_ITERATIONS = 2000  # of the simplex method, beside one for each variable and row
SWITCH = 0.02  # of the largest torque: a larger change between two steps is a switch


def no_linear_objective(problem: Problem) -> str:
    """Why a problem is no linear program whatever its drive; empty if it may be one."""
    if problem.minimise != "k_dyn":
        return f"what is asked for is the least {problem.minimise}, and only K_dyn is linear"
    return "a bound on the heat is not linear" if problem.heat is not None else ""


@dataclass(frozen=True, eq=False)
class Sparse:
    """Some rows over the variables: entries (row, column, value), of which those at one place add up.

    A program is built of thousands of small blocks: SciPy's sparse matrices would take longer to check
    their indices than HiGHS takes to solve it.

    >>> rows = Sparse.of(2, np.array([1, 2]), np.array([3.0, 4.0]))
    >>> (2.0 * (rows - Sparse.single({0: 1.0}).repeated(2))).csr(3).toarray().tolist()
    [[-2.0, 6.0, 0.0], [-2.0, 0.0, 8.0]]
    """

    count: int
    row: Steps
    column: Steps
    value: Vector

    @classmethod
    def of(cls, count: int, columns: Steps, values: Vector) -> Sparse:
        """An entry or more in each of `count` rows, all first entries before all second ones."""
        return cls(count, np.tile(np.arange(count), columns.size // max(count, 1)), columns, values)

    @classmethod
    def single(cls, weights: dict[int, float]) -> Sparse:
        """One row with the given weight in each of the given columns."""
        return cls(
            1,
            np.zeros(len(weights), dtype=np.int64),
            np.array(list(weights)),
            np.array(list(weights.values())),
        )

    @classmethod
    def dense(cls, rows: Matrix) -> Sparse:
        """The entries of a full matrix that are not 0."""
        row, column = np.nonzero(rows)
        return cls(rows.shape[0], row, column, rows[row, column])

    @classmethod
    def stacked(cls, blocks: Sequence[Sparse]) -> Sparse:
        """The rows of all blocks, one below the other."""
        first = np.cumsum([0, *(one.count for one in blocks)])
        if not blocks:
            return cls(0, np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64), np.zeros(0))
        return cls(
            int(first[-1]),
            np.concatenate([one.row + offset for one, offset in zip(blocks, first[:-1], strict=True)]),
            np.concatenate([one.column for one in blocks]),
            np.concatenate([one.value for one in blocks]),
        )

    def __rmul__(self, factor: float) -> Sparse:
        return Sparse(self.count, self.row, self.column, factor * self.value)

    def __sub__(self, other: Sparse) -> Sparse:
        return Sparse(
            self.count,
            np.concatenate([self.row, other.row]),
            np.concatenate([self.column, other.column]),
            np.concatenate([self.value, -other.value]),
        )

    def repeated(self, count: int) -> Sparse:
        """The same single row so many times."""
        each = self.value.size
        return Sparse(
            count, np.repeat(np.arange(count), each), np.tile(self.column, count), np.tile(self.value, count)
        )

    def csr(self, columns: int) -> Any:
        """As SciPy's matrix of compressed rows."""
        return sparse.csr_array((self.value, (self.row, self.column)), shape=(self.count, columns))


Rows = tuple[Sparse, Vector]  # rows over the variables, constants


class RowList:
    """Rows and their right sides, collected block by block."""

    def __init__(self) -> None:
        self.blocks: list[Sparse] = []
        self.rights: list[Vector] = []

    def add(self, rows: Sparse, right: Vector) -> None:
        self.blocks.append(rows)
        self.rights.append(np.broadcast_to(right, (rows.count,)))

    def all(self) -> Rows:
        return Sparse.stacked(self.blocks), np.concatenate(self.rights or [np.zeros(0)])


@dataclass(frozen=True, eq=False)
class Solution:
    """The best x, its cost, and the marginals of the inequalities and of the equations."""

    x: Vector
    cost: float
    above: Vector
    equal: Vector


Size = tuple[int, int, int]  # of a program: variables, inequalities, equations


@dataclass
class WarmStarts:
    """The last basis of programs of each size: the next one of that size starts from it.

    Neighbouring programs - another instant of contact, the same grid - share nearly all of it, and take a few
    iterations of the simplex method instead of thousands.
    """

    bases: dict[Size, Any] = field(default_factory=dict)

    def begin(self, size: Size) -> Any:
        """A basis for a program of this size, or of a smaller one with variables and inequalities added."""
        if size in self.bases:
            return self.bases[size]
        inside = [one for one in self.bases if one[0] < size[0] and one[1] < size[1] and one[2] == size[2]]
        if not inside:
            return None
        smaller = max(inside)
        known, basis = self.bases[smaller], highs.HighsBasis()
        status = highs.HighsBasisStatus
        rows = list(known.row_status)
        basis.col_status = list(known.col_status) + [status.kLower] * (size[0] - smaller[0])
        more = [status.kBasic] * (size[1] - smaller[1])
        basis.row_status = rows[: smaller[1]] + more + rows[smaller[1] :]
        basis.valid = True
        return basis


@dataclass(frozen=True, eq=False)
class Limits:
    """Minimise cost @ x subject to A_ub x <= b_ub, A_eq x = b_eq."""

    cost: Vector
    A_ub: Sparse
    b_ub: Vector
    A_eq: Sparse
    b_eq: Vector

    def solved(
        self, bounds: Matrix, warm: WarmStarts | None = None, presolve: bool = True, interior: bool = False
    ) -> Solution | None:
        """The best x within the bounds (columns, 2); None where there is none.

        By the dual simplex method, from the last basis of `warm`; again without scaling where its answer is
        within the tolerance only in the scale of the solver; where that fails or takes far longer than usual,
        by the interior point method. `interior` takes that one at once and stays in the middle of all best x,
        where the simplex method goes to a corner.
        """
        if highs is None:
            A_ub, A_eq = (one.csr(self.cost.size) for one in (self.A_ub, self.A_eq))
            options = {"presolve": presolve}
            found = linprog(
                self.cost, A_ub, self.b_ub, A_eq, self.b_eq, bounds, "highs-ipm" if interior else "highs-ds",
                options=options,
            )  # fmt: skip
            if found.status != 0:
                return None
            above, equal = np.asarray(found.ineqlin.marginals), np.asarray(found.eqlin.marginals)
            return Solution(np.asarray(found.x), float(found.fun), above, equal)
        size = self.cost.size, self.b_ub.size, self.b_eq.size
        basis = None if warm is None else warm.begin(size)
        attempts = ("simplex", basis, True), ("simplex", None, False), ("ipm", None, True)
        status = highs.HighsModelStatus.kNotset
        for solver, start, scaled in attempts[2 * interior :]:
            if not scaled and status != highs.HighsModelStatus.kUnknown:
                continue
            engine = highs._Highs()
            engine.setOptionValue("output_flag", False)
            engine.setOptionValue("solver", solver)
            if not scaled:  # what is within the tolerance in its own scale may not be so in that of the rows
                engine.setOptionValue("simplex_scale_strategy", 0)
            if not (presolve and scaled):
                engine.setOptionValue("presolve", "off")
            if interior:
                engine.setOptionValue("run_crossover", "off")
            engine.setOptionValue("simplex_iteration_limit", int(FEW_ITERATIONS + sum(size)))
            self._passed_to(engine, bounds)
            if start is not None:
                engine.setBasis(start)
            engine.run()
            status = engine.getModelStatus()
            if status == highs.HighsModelStatus.kOptimal:
                basis = engine.getBasis()
                if warm is not None:
                    warm.bases[size] = basis
                solution = engine.getSolution()
                marginals = np.array(solution.row_dual)
                cost = float(engine.getInfo().objective_function_value)
                return Solution(
                    np.array(solution.col_value), cost, marginals[: size[1]], marginals[size[1] :]
                )
            if status == highs.HighsModelStatus.kInfeasible:
                return None
        return None

    def _passed_to(self, engine: Any, bounds: Matrix) -> None:
        """Give HiGHS the program as arrays: what is set on its `HighsLp` is copied number by number."""
        A = Sparse.stacked([self.A_ub, self.A_eq]).csr(self.cost.size).tocsc()
        rows, columns = A.shape
        below = np.concatenate([np.full(self.b_ub.size, -np.inf), self.b_eq])
        above = np.concatenate([self.b_ub, self.b_eq])
        engine.passModel(
            columns, rows, A.nnz, int(highs.MatrixFormat.kColwise), int(highs.ObjSense.kMinimize), 0.0,
            self.cost, bounds[:, 0].copy(), bounds[:, 1].copy(), below, above,
            A.indptr, A.indices, A.data, np.zeros(columns, dtype=np.int32),
        )  # fmt: skip


def below(rows: Rows, variable: Sparse, sign: float = 1.0) -> Rows:
    """Rows and right sides of sign * rows <= variable, which is itself a row."""
    return sign * rows[0] - variable.repeated(rows[1].size), -sign * rows[1]


# grids ----------------------------------------------------------------------------------------------------


def contact_grid(contact: Contact, tau: float, steps: int) -> Vector:
    """Even steps; in a contact of many elastic periods fine ones at both ends and a few long ones between."""
    angle = contact.Omega * tau
    if angle <= 2.0 * FINE_ENDS:
        return np.linspace(0.0, 1.0, max(steps, int(0.8 * angle)) + 1)
    end = FINE_ENDS / angle
    return np.concatenate(
        [
            np.linspace(0.0, end, steps + 1)[:-1],
            np.linspace(end, 1.0 - end, LONG_STEPS + 1)[:-1],
            np.linspace(1.0 - end, 1.0, 3 * steps // 4 + 1),
        ]
    )


def checked_instants(lengths: Vector, within: Callable[[float], Vector]) -> tuple[Steps, Vector]:
    """(step, time since its beginning) of all checks; `within` gives those of a step by its length in s."""
    once = cache(within)
    parts = [once(length) for length in lengths.tolist()]
    return np.repeat(np.arange(lengths.size), [part.size for part in parts]), np.concatenate(parts)


def split(edges: Vector, chosen: Marks, parts: int) -> Vector:
    """The edges of a grid with each chosen step split into so many equal parts.

    >>> split(np.array([0.0, 0.5, 1.0]), np.array([False, True]), 2).tolist()
    [0.0, 0.5, 0.75, 1.0]
    """
    each = zip(edges[:-1], edges[1:], chosen, strict=True)
    pieces = [np.linspace(a, b, parts + 1)[1:] if finer else [b] for a, b, finer in each]
    return np.concatenate([[0.0], *pieces])


class OnGrid(Protocol):
    """The answer of a linear program on a grid."""

    @property
    def P(self) -> float: ...  # peak torque, N m
    @property
    def end_time(self) -> float: ...  # t_f, s
    @property
    def edges(self) -> Vector: ...  # of all steps, s
    @property
    def levels(self) -> Vector: ...  # mean torque of each step, N m
    @property
    def broken(self) -> Marks: ...  # steps that exceed a limit between the checks
    def finer(self, wanted: Marks) -> Any:
        """Its own grid with the wanted steps split.

        Its own: where a finer grid had no answer, the last answer stands, on the grid it was found on.
        """
        ...


A = TypeVar("A", bound=OnGrid)


@dataclass(frozen=True)
class Refinement:
    """How long grids are refined: first where the torque switches, then where a limit is exceeded."""

    most: int  # edges from which on the switches are not refined any further
    mending: int  # rounds over the steps that exceed a limit
    narrowing: float = 1.0  # of the width, where `most` is passed
    settled: float = 0.0  # relative: a round that changes P by less, and keeps all limits, is the last


def refined(
    best: A, grid: Any, rule: Refinement, highest: float, moved: Callable[[A, Any, float, bool], A]
) -> A:
    """The best answer with its instants moved a little, on finer and finer grids.

    `moved(best, grid, width, mending)` is the best answer on a grid with instants within `width` s of those
    known; `highest` is the largest torque in N m.
    """
    width = FIRST_WIDTH * best.end_time
    for _ in range(ROUNDS):
        before = best.P
        best = moved(best, grid, width, False)
        if best.edges.size > rule.most:
            width *= rule.narrowing
            break
        if rule.settled and not best.broken.any() and abs(before - best.P) < rule.settled * best.P:
            return best
        grid = best.finer(_switching(best.levels, highest) | best.broken)
        width *= 0.4
    for _ in range(rule.mending):
        best = moved(best, grid, width, True)
        if not best.broken.any():
            break
        grid = best.finer(best.broken)
        width *= 0.3
    return best


def _switching(levels: Vector, highest: float) -> Marks:
    """Steps beside which the torque changes by more than 2 % of its largest."""
    jump = np.abs(np.diff(levels)) > SWITCH * highest
    near = np.zeros(levels.size, dtype=bool)
    near[:-1] |= jump
    near[1:] |= jump
    return near
