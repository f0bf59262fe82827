"""Multipliers for the starts of a box: a linear program for good ones, and what they prove, enclosed.

In every phase x' = A x + g + B p, with Omega t for t, torques over Ms, twists over Ms/c and speeds over
Ms Omega/c. The inequality, the phases and their proof: docs/theory/optimum.md, "Weak duality".
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from scipy.linalg import expm

from softstart.arrays import Indices, Matrix, Vector
from softstart.drive import Drive
from softstart.optimal.bounds import half_period
from softstart.optimal.problem import Problem
from softstart.optimal.program import LinearProgram

# z beyond the driving flank, speeds, torque u, demand r behind its rate limit, y (never below z); integrals
# over a cell of what has a limit at every instant there: of T or T+ and z, and of what is ramped
Z, W1, W2, U, R, Y, MEAN, RAMPED = range(8)
# demand or its rate, friction of the motor, T on the driving and on the other flank, what holds the load
DEMAND, RUB, PUSH, PULL, HOLD = range(5)
INTEGRALS = np.isin(np.arange(8), [MEAN, RAMPED])
STEPS, MOST_STEPS = 12, 400  # of a cell: integrals are enclosed in each
ROUNDING = 1e-10  # of the sum of the absolute terms is taken off
MISSED, BROKEN = 15.0, 75.0  # price of what a terminal row misses, and of what all rows without P do
QUICK = 0.01  # a lag below this is left out: a quicker torque can do all that a slower one does


class Phase(NamedTuple):
    """One cell. `most`: of T where the shaft enters contact.

    `joins`: the first free cell; y begins with z.
    """

    shaft: Literal["open", "enter", "contact", "free"]
    load: Literal["rests", "held", "moves"]
    length: float
    most: float = 0.0
    joins: bool = False


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
        self.x0 = np.eye(8)[Z] * self.z0 + np.eye(8)[Y] * max(self.z0, 0.0)  # y of starts in the free phase
        assert problem.start_time is not None
        self.end = problem.start_time * Omega * (1.0 + ROUNDING)
        self.lasts = self.shortest_contact(drive)
        self.steps = dict[Phase, Step]()

    def shortest_contact(self, drive: Drive) -> float:
        """No first contact is shorter: half a period, unless friction of the motor can hold the push back."""
        pull = 0.0 if self.sticks or (self.pulls and self.b2 > 0.0) else self.mc
        falling = math.exp(-self.mu2 * self.b2 * self.end)  # as the load falls viscous friction holds it back
        most = self.F + self.b1 * self.mu1 * self.hi * self.end
        if self.mu1 * most > self.mu2 * pull * falling:
            return 0.0
        return half_period(drive) * self.Omega * (0.5 if self.z0 > 0.0 else 1.0) * (1.0 - 1e-9)

    def matrices(self, phase: Phase) -> tuple[Matrix, Vector, Matrix]:
        """A, g, B."""
        A, g, B = np.zeros((8, 8)), np.zeros(8), np.zeros((8, 5))
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

    Inputs lie between `low` and `high`, those of a free shaft between the corners `shared`, times P.
    """

    def __init__(self, model: Model, phase: Phase) -> None:
        self.A, self.g, self.B = A, g, B = model.matrices(phase)
        motion = np.zeros((9 + B.shape[1],) * 2)  # of x, 1 and p
        motion[:8] = np.column_stack([A, g, B])
        whole = expm(motion * phase.length)[:8]
        self.E, self.fixed, self.G = whole[:, :8], whole[:, 8], whole[:, 9:]
        self.limits, unit = model.limits(phase), np.eye(5)
        self.low, self.high = np.array([self.limits.get(one, (0.0, 0.0)) for one in range(5)]).T
        self.shared = np.zeros((1, 5))
        self.inputs = list(self.limits)
        if phase.shaft == "free" and phase.load != "rests":
            one = unit[[PUSH, PULL]]
            self.shared = np.vstack([np.zeros(5), one, *([-one] if model.pulls else [])])
            self.inputs += [PUSH, PULL]
            self.signs = np.array(
                [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)][: 4 if model.pulls else 1]
            )
        if phase.joins:
            self.E[:, Z] += self.E[:, Y]
            self.E[:, Y] = 0.0
        slowest = [one for one in (model.lag, model.d * (phase.shaft == "free")) if one > 0.0]
        wanted = max([STEPS, *(math.ceil(phase.length / (0.35 * one)) for one in slowest)])
        self.parts = min(wanted, MOST_STEPS)
        self.length = h = phase.length / self.parts
        one, every = expm(motion[:9, :9] * h), [np.eye(9)]
        for _ in range(self.parts):
            every.append(one @ every[-1])
        self.every, self.drifts = np.array(every)[:, :8, :8], np.array(every)[:, :8, 8]
        off = np.abs(A) * h
        np.fill_diagonal(off, 0.0)
        self.grown = expm(off)  # |E(s)| is nowhere larger, as the diagonal of A only decays


@dataclass(frozen=True, eq=False)
class Layout:
    """The cells of a box up to the end, its rows by nodes, terminal equations G x = e at the end."""

    cells: list[Phase]
    rows: list[Row]
    terminal: list[tuple[Vector, float]]
    before: int  # so many cells lie before the start that the program is for

    def groups(self) -> Iterator[tuple[Phase, Indices]]:
        """Equal cells and where they are."""
        where = dict[Phase, list[int]]()
        for k, cell in enumerate(self.cells):
            where.setdefault(cell, []).append(k)
        return ((cell, np.array(places)) for cell, places in where.items())


class Multipliers(NamedTuple):
    """Of the rows, 0 or more, of the terminal equations; and what the program thinks the least P is."""

    rows: Vector
    terminal: Vector
    value: float


# good multipliers: a linear program -------------------------------------------------------------------------


def good_multipliers(model: Model, at: Layout) -> Multipliers | None:
    """Those of a linear program from the start of the layout on; None where it has no answer.

    minimise P over x at the nodes and inputs constant in each cell, rows and equations held. What terminal
    equations miss, and one common miss of all rows without P, have a price: there always is an answer.
    Columns: x by nodes, inputs by cells, P, misses; rows: motion by cells, those of the layout, equations.
    """
    rows = [row._replace(node=row.node - at.before) for row in at.rows if row.node > at.before]
    steps = [model.step(cell) for cell in at.cells[at.before :]]
    free = model.d > 0.0 and any(cell.shaft == "free" for cell in at.cells)
    kept = [Z, W1, W2, *[U] * model.slow, *[R] * (model.demand == R), *[Y] * free]
    n = len(kept)
    ends = n * (len(steps) + 1) + np.cumsum([0, *(len(step.inputs) for step in steps)])
    P, broken = int(ends[-1]), int(ends[-1]) + 1 + 2 * len(at.terminal)
    low, high, cost = np.full(broken + 1, -np.inf), np.full(broken + 1, np.inf), np.zeros(broken + 1)
    low[:n] = high[:n] = model.x0[kept]
    low[P:], cost[P], cost[P + 1 : broken], cost[broken] = 0.0, 1.0, MISSED, BROKEN
    shared = (-np.inf if model.pulls else 0.0, np.inf)
    for step, a, b in zip(steps, ends[:-1], ends[1:], strict=True):
        low[a:b], high[a:b] = np.array([step.limits.get(one, shared) for one in step.inputs]).T
    program = LinearProgram(cost, low, high)
    for k, step in enumerate(steps):
        E, G = step.E[np.ix_(kept, kept)], step.G[np.ix_(kept, step.inputs)]
        moved = {n * k: -E, int(ends[k]): -G, n * (k + 1): np.eye(n)}
        program.add(moved, step.fixed[kept], step.fixed[kept])
    for node, group in itertools.groupby(rows, lambda row: row.node):
        these, step = list(group), steps[node - 1]
        G, p = np.array([row.G for row in these]), np.array([[row.p] for row in these])
        inside = np.where(INTEGRALS, G, 0.0)
        limit = np.array([row.g for row in these]) - inside @ step.fixed
        parts = {n * node: G[:, kept], P: -p, broken: -1.0 * (p == 0.0)}
        parts |= {
            n * (node - 1): (inside @ step.E)[:, kept],
            int(ends[node - 1]): (inside @ step.G)[:, step.inputs],
        }
        program.add(parts, limit)
    for t, (by, e) in enumerate(at.terminal):
        program.add({n * len(steps): by[None, kept], P + 1 + 2 * t: np.array([[1.0, -1.0]])}, e, e)
    for k, step in enumerate(steps):
        if step.shared.any():  # |T| on both flanks in all is no more than P
            first = int(ends[k]) + step.inputs.index(PUSH)
            program.add({first: step.signs, P: np.full((len(step.signs), 1), -1.0)}, 0.0)
    if (found := program.interior()) is None:
        return None
    duals, value = found
    _, inner, terminal, _ = np.split(duals, n * len(steps) + np.cumsum([0, len(rows), len(at.terminal)]))
    inner = np.append(np.zeros(len(at.rows) - len(rows)), np.maximum(-inner, 0.0))
    return Multipliers(inner, terminal, value)


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
        jump[N] -= m * G
        node[N, 0] += m * e
    lam, right = np.zeros(8), np.empty((N, 8))
    for k in range(N - 1, -1, -1):
        right[k] = lam + jump[k + 1] + inside[k]
        lam = right[k] @ model.step(at.cells[k]).E
        lam[[MEAN, RAMPED]] = 0.0
    found: list[tuple[Matrix, Vector, Vector]] = [(np.empty(0),) * 3] * N
    for phase, ks in at.groups():
        step = model.step(phase)
        s = np.linspace(0.0, 1.0, step.parts + 1)[:, None]
        every = np.einsum("ki,sij->ksj", right[ks], step.every)
        sums, bend = _inputs(step, every)
        sums += within[ks][:, None] * s
        sums[:, :, 0] += right[ks] @ step.drifts.T
        large = np.abs(every[:, :-1]) @ step.grown
        bend += large @ (np.abs(step.A @ step.A @ model.x0) + np.abs(step.A @ step.g))
        for k, *one in zip(ks.tolist(), sums, every @ model.x0, bend, strict=True):
            found[k] = one[0], one[1], one[2]
    return _from_the_end(model, at, found, node)


def _inputs(step: Step, every: Matrix) -> tuple[Matrix, Vector]:
    """(sum, factor of P) up to each step: integrals of max -q p over what the inputs can be; bend of the sum.

    The trapezoid, of a convex function too high at worst, and what the curvature of q can add to it.
    """
    h, A, B = step.length, step.A, step.B
    large = np.abs(every[:, :-1]) @ step.grown  # bounds |lambda| in each step
    q, bent = every @ B, np.abs(every @ (A @ A @ B))
    curved = np.maximum(bent[:, :-1], bent[:, 1:]) + 0.5 * h * (large @ np.abs(A @ A @ A @ B))
    own = np.maximum(-q * step.low, -q * step.high).sum(axis=2)
    shared = (-(q @ step.shared.T)).max(axis=2)
    sums, bend = np.zeros((*every.shape[:2], 2)), np.zeros((len(every), step.parts))
    for column, sign, worth, ends in ((0, -1.0, own, [step.low, step.high]), (1, 1.0, shared, step.shared)):
        most = np.abs(ends).max(axis=0)
        rough = 0.5 * h * (worth[:, :-1] + worth[:, 1:]) + h**3 / 12.0 * (curved @ most)
        sums[:, 1:, column] = sign * np.cumsum(rough, axis=1)
        bend += large @ np.abs(A @ B) @ most
    return sums, bend


def _from_the_end(
    model: Model, at: Layout, found: list[tuple[Matrix, Vector, Vector]], node: Matrix
) -> tuple[Vector, Vector]:
    """The sums over all cells, from the end back to each step."""
    N, edges, bounds = len(at.cells), list[Vector](), list[Vector]()
    total, now = node[N].copy(), 0.0
    size = np.abs(node[:, 0]).sum() + sum(np.abs(sums[:, 0]).sum() + np.abs(x).max() for sums, x, _ in found)
    for k in range(N - 1, -1, -1):
        step, (sums, x, bend) = model.step(at.cells[k]), found[k]
        F = total[0] + sums[:, 0] + x
        # between the edges the sum is above its chord less this
        least = np.minimum(F[:-1], F[1:]) - bend * (step.length**2 / 8.0) - ROUNDING * size
        factor = total[1] + sums[1:, 1]
        P = np.divide(least, factor, out=np.full(least.size, math.inf), where=factor > 0.0)
        bounds.append(np.where(least > 0.0, P, 0.0))
        edges.append(now + step.length * np.arange(step.parts, dtype=np.float64))
        now += at.cells[k].length
        total += sums[-1] + node[k]
    return np.append(np.concatenate(edges), now), np.concatenate(bounds)
