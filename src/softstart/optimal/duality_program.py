"""Multipliers for the starts of a box: a linear program for good ones, and what they prove, enclosed.

In every phase x' = A x + g + B p, with Omega t for t, torques over Ms, twists over Ms/c and speeds over
Ms Omega/c. The inequality, the phases and their proof: docs/theory/optimum.md, "Weak duality".
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal, NamedTuple

import highspy
import numpy as np
from numpy.typing import ArrayLike
from scipy import sparse
from scipy.linalg import expm

from softstart.arrays import Indices, Matrix, Vector
from softstart.drive import Drive
from softstart.optimal.bounds import half_period
from softstart.optimal.problem import Problem

# z beyond the driving flank, speeds, torque u, demand r behind its rate limit, y (never below z); integrals
# over a cell of what has a limit at every instant there: of T or T+ and z, and of what is ramped
Z, W1, W2, U, R, Y, MEAN, RAMPED = range(8)
# demand or its rate, friction of the motor, T on the driving and on the other flank, what holds the load; y
# at the opening
DEMAND, RUB, PUSH, PULL, HOLD, BEGIN = range(6)
STEPS, MOST_STEPS = 12, 400  # of a cell: integrals are enclosed in each
ROUNDING = 1e-10  # of the sum of the absolute terms is taken off
MISSED, BROKEN = 15.0, 75.0  # price of what a terminal row misses, and of what all rows without P do
RIPPLE = 5e-4  # the program prefers means of T to T at instants, whose multipliers let q ripple
QUICK = 0.01  # a lag below this is left out: a quicker torque can do all that a slower one does


class Phase(NamedTuple):
    """One cell. `most`: of T where the shaft enters contact, as a share of P where it is free.

    `joins`: the first free cell; y begins with z, or within 0 and `begin`.
    """

    shaft: Literal["open", "enter", "contact", "free"]
    load: Literal["rests", "held", "moves"]
    length: float
    most: float = 0.0
    joins: bool = False
    begin: float = -1.0


class Row(NamedTuple):
    """G x <= g + P p at a node, the end of cell `node` - 1; with MEAN and RAMPED: throughout that cell."""

    node: int
    G: Vector
    g: float
    p: float = 0.0


class Model:
    """The drive without dimensions."""

    def __init__(self, problem: Problem, drive: Drive) -> None:
        J1, J2, Ms, Omega = (float(one) for one in (drive.J1, drive.J2, drive.Ms, drive.Omega))
        self.Omega, self.Ms, self.terminal = Omega, Ms, problem.terminal
        self.mu1, self.mu2 = J2 / (J1 + J2), J1 / (J1 + J2)
        friction, *viscous = (float(one) for one in drive.frictions)
        self.d, self.b1, self.b2 = (one * Omega / float(drive.c) for one in (float(drive.d), *viscous))
        self.mc, self.F, self.hi = float(drive.Mc) / Ms, friction / Ms, problem.highest_torque / Ms
        lag = float(drive.torque_lag) * Omega
        self.lag, self.rate = lag * (lag > QUICK), float(drive.torque_rate) / (Ms * Omega)
        self.W = problem.target * float(drive.c) / (Ms * Omega)
        half_gap = 0.5 * float(drive.gap)
        self.gap, self.z0 = (float(drive.c) / Ms * one for one in (2.0 * half_gap, drive.theta0 - half_gap))
        self.sticks, self.joined = drive.reactive_torque > 0.0, half_gap == 0.0
        self.pulls = self.joined or (self.d > 0.0 and drive.contact_law == "dead-zone")
        self.ramped = math.isfinite(self.rate)
        self.slow = self.ramped or self.lag > 0.0
        self.demand = R if self.lag > 0.0 and self.ramped else U
        self.T = np.array([1.0, self.d, -self.d, 0.0, 0.0, 0.0, 0.0, 0.0])  # of x, in contact
        self.x0 = np.eye(8)[Z] * self.z0
        self.half = half_period(drive) * Omega  # no push on the shaft lowers T sooner
        assert problem.start_time is not None
        self.end = problem.start_time * Omega * (1.0 + ROUNDING)
        self.least = self.mc + self.W / (self.mu2 * self.end)  # P, by momentum alone
        self.steps = dict[Phase, Step]()

    @cached_property
    def drag(self) -> float:
        """(Friction of the motor)/J1 - (load torque)/J2, if above 0: z'' is no lower by itself."""
        pull = 0.0 if self.sticks or (self.pulls and self.b2 > 0.0) else self.mc
        falling = math.exp(-self.mu2 * self.b2 * self.end)  # as the load falls viscous friction holds it back
        most = self.F + self.b1 * self.mu1 * self.hi * self.end
        return max(0.0, self.mu1 * most - self.mu2 * pull * falling)

    @cached_property
    def lasts(self) -> float:
        """No first contact is shorter."""
        return (self.drag == 0.0) * self.half * (0.5 if self.z0 > 0.0 else 1.0) * (1.0 - 1e-9)

    @cached_property
    def quickest(self) -> float:
        """No contact has a larger z' than so much times P, else T would exceed P."""
        step, x = expm(np.array([[0.0, 1.0], [-1.0, -self.d]]) * (self.half / 400)), np.array([0.0, 1.0])
        path = [x, *(x := step @ x for _ in range(400))]
        return 1.0 / max(float(z + self.d * v) for z, v in path) + 0.5 * self.half * self.drag / self.least

    def matrices(self, phase: Phase) -> tuple[Matrix, Vector, Matrix]:
        """A, g, B."""
        A, g, B = np.zeros((8, 8)), np.zeros(8), np.zeros((8, 6))
        moves, lag = phase.load != "rests", self.lag
        A[Z, W1], A[Z, W2] = 1.0, -1.0
        A[W1, W1], B[W1, RUB] = -self.b1 * self.mu1, -self.mu1
        # in the open gap the motor stands still or its friction is F: what is left of u is at most this share
        push = self.mu1 * (1.0 - self.F / self.hi * (phase.shaft == "open"))
        (A if self.slow else B)[W1, U if self.slow else DEMAND] = push
        if lag > 0.0:
            A[U, U] = -1.0 / lag
            (A if self.ramped else B)[U, R if self.ramped else DEMAND] = 1.0 / lag
        if self.ramped:
            B[self.demand, DEMAND], A[RAMPED, self.demand] = self.rate, 1.0
        if moves:
            A[W2, W2], g[W2], B[W2, HOLD] = -self.b2 * self.mu2, -self.mu2 * self.mc, self.mu2
        if phase.shaft == "contact":
            A[W1] -= self.mu1 * self.T
            A[W2] += self.mu2 * self.T * moves
            A[MEAN] = self.T
        elif phase.shaft != "open":
            B[W1, [PUSH, PULL]] = -self.mu1, self.mu1
            B[W2, [PUSH, PULL]] = self.mu2 * moves, -self.mu2 * moves
        if phase.shaft == "enter":  # T+ - z/2 - d z'
            A[MEAN], B[MEAN, PUSH] = [-0.5, -self.d, self.d, 0.0, 0.0, 0.0, 0.0, 0.0], 1.0
        elif phase.shaft == "free" and self.d > 0.0:
            B[Y, PUSH], A[Y, Y] = 1.0 / self.d, -1.0 / self.d
        elif phase.shaft == "free":  # z - T+
            A[MEAN, Z], B[MEAN, PUSH] = 1.0, -1.0
        return A, g, B

    def limits(self, phase: Phase) -> dict[int, tuple[float, float]]:
        """From where to where each input goes by itself."""
        found = {DEMAND: (-1.0, 1.0) if self.ramped else (0.0, self.hi)}
        if self.F > 0.0:
            found[RUB] = (-self.F * (phase.shaft != "open"), self.F)
        if phase.load == "held":
            found[HOLD] = (0.0, self.mc * (2.0 if self.pulls or phase.shaft == "free" else 1.0))
        if phase.shaft == "enter":
            most = min(phase.most, self.mc) if phase.load == "rests" else phase.most
            found[PUSH] = (-most * self.pulls, most)
        if phase.shaft == "free" and phase.load == "rests":
            found[PUSH] = found[PULL] = (-self.mc * self.pulls, self.mc)
        return found

    def step(self, phase: Phase) -> Step:
        """The phase over one cell, kept."""
        if phase not in self.steps:
            self.steps[phase] = Step(self, phase)
        return self.steps[phase]


class Step:
    """One cell of a phase: its transition, and what encloses the integrals over its steps.

    `ends` are the corners of what the inputs can be, for each group of them; those of `shared`, the torques
    of a free shaft, are to be multiplied by P.
    """

    def __init__(self, model: Model, phase: Phase) -> None:
        self.A, self.g, self.B = A, g, B = model.matrices(phase)
        self.E, self.fixed, self.G = _over(A, g, B, phase.length)
        self.limits, unit = model.limits(phase), np.eye(6)
        self.ends = [np.outer(pair, unit[one]) for one, pair in self.limits.items()]
        self.shared: Matrix | None = None
        self.inputs = list(self.limits)
        if phase.shaft == "free" and phase.load != "rests":
            one = np.array([phase.most * unit[PUSH], unit[PULL]])
            self.shared = np.vstack([np.zeros(6), one, *([-one] if model.pulls else [])])
            self.inputs += [PUSH, PULL]
        if phase.joins and phase.begin >= 0.0:
            self.G[:, BEGIN], self.limits[BEGIN] = self.E[:, Y], (0.0, phase.begin)
            self.inputs.append(BEGIN)
        elif phase.joins:
            self.E[:, Z] += self.E[:, Y]
        if phase.joins:
            self.E[:, Y] = 0.0
        slowest = [one for one in (model.lag, model.d * (phase.shaft == "free")) if one > 0.0]
        wanted = max([STEPS, *(math.ceil(phase.length / (0.35 * one)) for one in slowest)])
        self.parts = min(wanted, MOST_STEPS)
        self.length = h = phase.length / self.parts
        one, drift, self.over = _over(A, g, np.eye(8), h)
        every, drifts = [np.eye(8)], [np.zeros(8)]
        for _ in range(self.parts):
            every.append(one @ every[-1])
            drifts.append(one @ drifts[-1] + drift)
        self.every, self.drifts = np.array(every), np.array(drifts)
        off = np.abs(A) * h
        np.fill_diagonal(off, 0.0)
        self.grown = expm(off)  # |E(s)| is nowhere larger, as the diagonal of A only decays


def _over(A: Matrix, g: Vector, B: Matrix, h: float) -> tuple[Matrix, Vector, Matrix]:
    """(E, fixed, G) of x(h) = E x(0) + fixed + G p, with p constant."""
    M = np.zeros((9 + B.shape[1],) * 2)
    M[:8] = np.column_stack([A, g, B]) * h
    whole = expm(M)[:8]
    return whole[:, :8], whole[:, 8], whole[:, 9:]


@dataclass(frozen=True, eq=False)
class Layout:
    """The cells of a box up to the end of the tail, its rows, terminal equations G x = e at node `end`."""

    cells: list[Phase]
    rows: list[Row]
    terminal: list[tuple[Vector, float]]
    end: int
    before: int  # so many cells lie before the start that the program is for

    def groups(self) -> Iterator[tuple[Phase, Indices]]:
        """Equal cells and where they are."""
        where = dict[Phase, list[int]]()
        for k, cell in enumerate(self.cells):
            where.setdefault(cell, []).append(k)
        return ((cell, np.array(places)) for cell, places in where.items())

    def after(self) -> Layout:
        """From the start of the program on."""
        k = self.before
        rows = [row._replace(node=row.node - k) for row in self.rows if row.node > k]
        return Layout(self.cells[k:], rows, self.terminal, self.end - k, 0)


class Multipliers(NamedTuple):
    """Of the rows, 0 or more, of the terminal equations; and what the program thinks the least P is."""

    rows: Vector
    terminal: Vector
    value: float


# good multipliers: a linear program -------------------------------------------------------------------------


class _Quiet(highspy.Highs):
    def enableCallbacks(self) -> None:  # to enable them prints a line, and none is needed
        pass


class _Program:
    """minimise P over x at the nodes and inputs that are constant in each cell, rows and equations held.

    What terminal equations miss, and one common miss of all rows without P, have a price: there is always an
    answer. Columns: x by nodes, inputs by cells, P, misses.
    """

    def __init__(self, model: Model, at: Layout) -> None:
        free = model.d > 0.0 and any(cell.shaft == "free" for cell in at.cells)
        kept = [Z, W1, W2, *[U] * model.slow, *[R] * (model.demand == R), *[Y] * free]
        self.model, self.at, self.kept = model, at, kept
        self.n, N = len(kept), len(at.cells)
        self.parts = list[tuple[Any, ...]]()
        self.inputs, self.width = np.zeros(N, int), self.n * (N + 1)
        low, high = [np.full(self.width, -np.inf)], [np.full(self.width, np.inf)]
        low[0][: self.n] = high[0][: self.n] = model.x0[kept]
        for phase, ks in at.groups():
            step = model.step(phase)
            self.inputs[ks] = self.width + len(step.inputs) * np.arange(ks.size)
            self.width += len(step.inputs) * ks.size
            shared = (-np.inf if model.pulls else 0.0, np.inf)
            pairs = np.array([step.limits.get(one, shared) for one in step.inputs])
            low.append(np.tile(pairs[:, 0], ks.size))
            high.append(np.tile(pairs[:, 1], ks.size))
        K = len(at.terminal)
        self.cost = np.append(np.zeros(self.width), [1.0, *[MISSED] * 2 * K, BROKEN])
        low.append(np.zeros(2 + 2 * K))
        high.append(np.full(2 + 2 * K, np.inf))
        self.low, self.high = np.concatenate(low), np.concatenate(high)

    def put(self, rows: ArrayLike, columns: ArrayLike, values: ArrayLike) -> None:
        """Entries of the matrix."""
        many = np.broadcast_arrays(rows, columns, values)
        self.parts.append(tuple(one.ravel() for one in many))

    def motion(self) -> Vector:
        """States at the ends of cells less what they come to; the constants of that."""
        n, value = self.n, np.zeros(self.n * len(self.at.cells))
        every = np.arange(value.size)
        self.put(every, every + n, 1.0)
        for phase, ks in self.at.groups():
            step = self.model.step(phase)
            E, G = step.E[np.ix_(self.kept, self.kept)], step.G[np.ix_(self.kept, step.inputs)]
            for matrix, first in ((E, n * ks), (G, self.inputs[ks])):
                i, j = np.nonzero(np.abs(matrix) > 1e-13)
                self.put(n * ks[:, None] + i, first[:, None] + j, -matrix[i, j])
            value[(n * ks[:, None] + np.arange(n)).ravel()] = np.tile(step.fixed[self.kept], ks.size)
        return value

    def rows(self, count: int) -> Vector:
        """The rows; their right sides."""
        n, at = self.n, self.at
        node, p = np.array([row.node for row in at.rows]), np.array([row.p for row in at.rows])
        G, limit = np.array([row.G for row in at.rows]), np.array([row.g for row in at.rows])
        here, own = count + np.arange(node.size), np.arange(n)
        throughout = G[:, [MEAN, RAMPED]].any(axis=1)
        i, j = np.nonzero(G[:, self.kept])
        self.put(here[i], n * node[i] + j, G[:, self.kept][i, j])
        for phase, ks in at.groups():
            step = self.model.step(phase)
            these = np.flatnonzero(throughout & np.isin(node - 1, ks))
            k = node[these] - 1
            self.put(here[these, None], n * k[:, None] + own, (G[these] @ step.E)[:, self.kept])
            columns = self.inputs[k][:, None] + np.arange(len(step.inputs))
            self.put(here[these, None], columns, (G[these] @ step.G)[:, step.inputs])
            limit[these] -= G[these] @ step.fixed
        self.put(here, self.width, -p * np.where(throughout, 1.0, 1.0 + RIPPLE))
        self.put(here[p == 0.0], self.cost.size - 1, -1.0)
        for t, (by, _) in enumerate(at.terminal, count + node.size):
            self.put(t, n * at.end + own, by[self.kept])
            self.put(t, self.width + 1 + 2 * (t - count - node.size) + np.arange(2), np.array([1.0, -1.0]))
        return limit

    def shared(self, count: int) -> int:
        """|T| on both flanks of a free shaft in all no more than P; how many rows there are then."""
        signs = [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)][: 4 if self.model.pulls else 1]
        for phase, ks in self.at.groups():
            step = self.model.step(phase)
            if step.shared is None:
                continue
            for one, other in signs:
                here = count + np.arange(ks.size)
                first = self.inputs[ks] + step.inputs.index(PUSH)
                self.put(here, first, one / phase.most)
                self.put(here, first + 1, other)
                self.put(here, self.width, -1.0)
                count += ks.size
        return count

    def solve(self) -> Multipliers | None:
        """Duals and value; None where HiGHS finds no end."""
        value, at = self.motion(), self.at
        limit, e = self.rows(value.size), np.array([e for _, e in at.terminal])
        count = self.shared(first := value.size + limit.size + e.size)
        i, j, entries = (np.concatenate(one) for one in zip(*self.parts, strict=True))
        A = sparse.csr_matrix((entries, (i, j)), shape=(count, self.cost.size))
        program, solver = highspy.HighsLp(), _Quiet()  # type: ignore[no-untyped-call]
        program.num_row_, program.num_col_ = A.shape
        program.col_cost_, program.col_lower_, program.col_upper_ = self.cost, self.low, self.high
        rest = np.full(count - first, -np.inf)
        program.row_lower_ = np.concatenate([value, np.full(limit.size, -np.inf), e, rest])
        program.row_upper_ = np.concatenate([value, limit, e, np.zeros(count - first)])
        matrix = program.a_matrix_
        matrix.format_ = highspy.MatrixFormat.kRowwise
        matrix.start_, matrix.index_, matrix.value_ = A.indptr, A.indices, A.data
        for name, option in OPTIONS.items():
            solver.setOptionValue(name, option)
        solver.passModel(program)
        for way in ("ipx", "simplex"):  # the interior point ends without an answer now and then
            solver.setOptionValue("solver", way)
            solver.run()
            if solver.getModelStatus() == highspy.HighsModelStatus.kOptimal:
                break
        else:
            return None
        _, inner, terminal, _ = np.split(
            np.array(solver.getSolution().row_dual), [value.size, value.size + limit.size, first]
        )
        found = float(solver.getInfo().objective_function_value)
        return Multipliers(np.maximum(-inner, 0.0), terminal, found)


OPTIONS: dict[str, bool | int | str] = {  # with presolve many of these programs fail
    "output_flag": False, "presolve": "off", "run_crossover": "off", "threads": 1,
    "ipm_iteration_limit": 200, "simplex_iteration_limit": 10_000,
}  # fmt: skip


def good_multipliers(model: Model, at: Layout) -> Multipliers | None:
    """Those of the linear program, for all rows of the box; None where it has no answer."""
    by = _Program(model, at.after()).solve()
    if by is None:
        return None
    rows = np.zeros(len(at.rows))
    rows[[row.node > at.before for row in at.rows]] = by.rows
    return by._replace(rows=rows)


# their worth ------------------------------------------------------------------------------------------------


def proved(model: Model, at: Layout, by: Multipliers) -> tuple[Vector, Vector]:
    """What the multipliers prove of the starts that begin within each step of the cells.

    Returns (time of the edges of the steps before the end, rising; least P in each step, in Ms).
    """
    N = len(at.cells)
    jump, inside = np.zeros((N + 1, 8)), np.zeros((N, 8))
    node, within = np.zeros((N + 1, 2)), np.zeros((N, 2))  # (what is added to the sum, factor of P)
    for m, row in zip(by.rows, at.rows, strict=True):
        throughout = bool(row.G[[MEAN, RAMPED]].any())
        (inside if throughout else jump)[row.node - throughout] += m * row.G
        (within if throughout else node)[row.node - throughout] += -m * row.g, m * row.p
    for m, (G, e) in zip(by.terminal, at.terminal, strict=True):
        jump[at.end] -= m * G
        node[at.end, 0] += m * e
    lam, right, begun = np.zeros(8), np.empty((N, 8)), np.zeros(N)
    for k in range(N - 1, -1, -1):
        right[k] = lam + jump[k + 1] + inside[k]
        step, cell = model.step(at.cells[k]), at.cells[k]
        lam = right[k] @ step.E
        if cell.begin >= 0.0:
            begun[k] = min(0.0, float(right[k] @ step.G[:, BEGIN]) * cell.begin)
        lam[[MEAN, RAMPED]] = 0.0
    found: list[tuple[Matrix, Vector, Vector]] = [(np.empty(0),) * 3] * N
    for phase, ks in at.groups():
        step = model.step(phase)
        s = np.linspace(0.0, 1.0, step.parts + 1)[:, None]
        every = np.einsum("ki,sij->ksj", right[ks], step.every)
        sums, bend = _inputs(step, every)
        sums += within[ks][:, None] * s
        sums[:, :, 0] += right[ks] @ step.drifts.T
        sums[:, -1, 0] += begun[ks]
        large = np.abs(every[:, :-1]) @ step.grown
        bend += large @ (np.abs(step.A @ step.A @ model.x0) + np.abs(step.A @ step.g))
        for k, *one in zip(ks.tolist(), sums, every @ model.x0, bend, strict=True):
            found[k] = one[0], one[1], one[2]
    return _from_the_end(model, at, found, node)


def _inputs(step: Step, every: Matrix) -> tuple[Matrix, Vector]:
    """(sum, factor of P) up to each step: integrals of max -q p over what the inputs can be; bend of the sum.

    Where one corner is best throughout a step the integral is exact; elsewhere the trapezoid, and what
    the curvature of q can add to it.
    """
    h, A, B = step.length, step.A, step.B
    large = np.abs(every[:, :-1]) @ step.grown  # bounds |lambda| in each step
    q, bent = every @ B, np.abs(every @ (A @ A @ B))
    curved = np.maximum(bent[:, :-1], bent[:, 1:]) + 0.5 * h * (large @ np.abs(A @ A @ A @ B))
    slope, whole = large @ np.abs(A @ B), every[:, :-1] @ step.over @ B
    sums, bend = np.zeros((*every.shape[:2], 2)), np.zeros(slope.shape[:2])
    shared = [] if step.shared is None else [step.shared]
    for number, ends in enumerate([*step.ends, *shared]):
        f, most = -(q @ ends.T), np.abs(ends).max(axis=0)
        best = f.argmax(axis=2)
        top, next_best = f.max(axis=2), np.sort(f, axis=2)[:, :, -2]
        off = curved @ most * (h * h / 8.0)
        lead = np.minimum((top - next_best)[:, :-1], (top - next_best)[:, 1:])
        clear = (best[:, :-1] == best[:, 1:]) & (lead > 2.0 * off)
        exact = np.take_along_axis(-(whole @ ends.T), best[:, 1:, None], 2)[:, :, 0]
        rough = 0.5 * h * (top[:, :-1] + top[:, 1:]) + (2.0 / 3.0) * h * off
        worth = np.cumsum(np.where(clear, exact, rough), axis=1)
        if number < len(step.ends):
            sums[:, 1:, 0] -= worth
        else:
            sums[:, 1:, 1] += worth
        bend += slope @ most
    return sums, bend


def _from_the_end(
    model: Model, at: Layout, found: list[tuple[Matrix, Vector, Vector]], node: Matrix
) -> tuple[Vector, Vector]:
    """The sums over all cells, from the end of the tail back to each step."""
    N, edges, bounds = len(at.cells), list[Vector](), list[Vector]()
    total, size = node[N].copy(), float(np.abs(node[N, 0]))
    now = -sum(cell.length for cell in at.cells[at.end :])
    for k in range(N - 1, -1, -1):
        step, (sums, x, bend) = model.step(at.cells[k]), found[k]
        size += float(np.abs(np.diff(sums[:, 0])).sum())
        F = total[0] + sums[:, 0] + x
        # between the edges the sum is above its chord less this
        least = np.minimum(F[:-1], F[1:]) - bend * (step.length**2 / 8.0)
        least -= ROUNDING * (size + float(np.abs(x).max()))
        factor = total[1] + sums[1:, 1]
        P = np.divide(least, factor, out=np.full(least.size, math.inf), where=factor > 0.0)
        bounds.append(np.where(least > 0.0, P, 0.0))
        edges.append(now + step.length * np.arange(step.parts, dtype=np.float64))
        now += at.cells[k].length
        total += sums[-1] + node[k]
        size += float(np.abs(node[k, 0]))
    return np.append(np.concatenate(edges), now), np.concatenate(bounds)
