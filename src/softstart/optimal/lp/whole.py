"""The whole start as a linear program, for fixed instants of contact, breakaway and end.

Where the motor torque lags behind its demand, is limited in rate or by a torque-speed curve, may brake, or
turns a damped shaft against a load at rest, the gap part no longer reduces to two numbers. But with the
instants fixed at which the gap closes (tc), the load breaks away (tb, reactive loads alone) and the start
ends (t_f), every phase is linear with known coefficients, so that the state y = (z, z', w2, u) anywhere is
linear in the demand r on a grid, and so are its limits. HiGHS solves

    minimise P   subject to   the steps of y, exact on the grid
        in the gap            -gap <= z <= 0,               z(tc) = 0
        load at rest          0 <= T <= Mc,                 T(tb) = Mc
        in contact            0 <= T <= P                   (dead-zone: |T| <= P, z >= 0; reactive: w2 >= 0)
        at t_f                w2 = target and               (synchronous) z' = 0, (steady) also T = Mc
        after t_f             T <= P while the torque is held or (reached) the motor coasts
        everywhere            lowest <= r <= highest, |dr/dt| <= rate, u <= torque_speed(w1)

with limits checked at four instants of each step or more. The answer is exact for its grid: nothing is
integrated. whole_search.py looks for the best instants.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from typing import Any, Literal

import numpy as np
from scipy.linalg import expm

from softstart.arrays import Matrix, Vector
from softstart.drive import Drive
from softstart.optimal.lp.motion import MARGIN
from softstart.optimal.lp.rows import (
    AIM,
    QUARTERS,
    SIXTEENTHS,
    Limits,
    Marks,
    RowList,
    Rows,
    Sparse,
    Steps,
    WarmStarts,
    below,
    checked_instants,
    split,
)
from softstart.optimal.problem import Problem
from softstart.optimal.result import DemandShape, demanded
from softstart.profile import TorqueProfile

Z, V, W2, U, R, SLOPE, ONE = range(7)
STATES = 4
TAIL_STEPS, TAIL_POINTS = 12, 96  # after t_f: steps while the demand falls, checks of T
SETTLED = 8.0  # lags, after which the torque follows its demand to 0.03 %
YIELDING, YIELDING_POINTS = 0.1, 16  # of the time in which U falls to 0, in which the curve is kept after t_f
BELOW_CURVE = 3e-5  # of U, by which the torque stays below its curve where it is checked
EXCESS = 1e-4  # relative: T above P between the checks by more counts
BROKEN = 2e-7  # of U: T off the flank by more counts; HiGHS itself keeps its rows to 1e-7

Kind = Literal["gap", "resting", "stuck", "contact"]  # resting: a gap with the load at rest; stuck: wound up
Grid = tuple[tuple[Kind, Vector], ...]  # phases in order, each with the edges of its steps as shares of it


@dataclass(frozen=True)
class Instants:
    """When the gap closes, the load breaks away and the start ends, s; tb = tc where no load is at rest."""

    tc: float
    tb: float
    end: float


@dataclass(frozen=True, eq=False)
class WholeAnswer:
    """The optimum at fixed instants: peak P in N m, and the demand at the beginning and end of each step."""

    at: Instants
    P: float
    grid: Grid
    edges: Vector  # s, of all steps up to t_f
    demand: Matrix  # (steps, 2), N m
    broken: Marks  # steps in which T is not kept between the checks
    beyond: bool  # the torque that would hold T at t_f is more than the motor has
    x: Vector = field(repr=False)  # all variables of the program

    @property
    def end_time(self) -> float:
        """t_f, s."""
        return self.at.end

    @property
    def levels(self) -> Vector:
        """Mean demand of each step, N m."""
        mean: Vector = self.demand.mean(axis=1)
        return mean

    def finer(self, wanted: Marks) -> Grid:
        """Its own grid, the wanted steps split in three, but for the finest and long unbroken ones."""
        grid: list[tuple[Kind, Vector]] = []
        first = 0
        for kind, edges in self.grid:
            steps = np.diff(edges)
            here = slice(first, first + steps.size)
            short = (steps < 5.0 * np.median(steps)) | self.broken[here]
            grid.append((kind, split(edges, wanted[here] & short & (steps > 1e-4), 3)))
            first += steps.size
        return tuple(grid)

    def profile(self, problem: Problem) -> TorqueProfile:
        """The demand up to t_f, exactly within the limits of the torque."""
        levels = np.clip(self.demand, problem.lowest_torque, problem.highest_torque)
        return demanded(demand_shape(problem), self.edges, levels)


def demand_shape(problem: Problem) -> DemandShape:
    """Which demands the plant follows exactly."""
    if math.isfinite(problem.drive.torque_rate):
        return "continuous"
    return "ramps" if problem.torque_speed else "steps"


def phase_ends(grid: Grid, at: Instants) -> list[float]:
    """When the phases of a grid begin and end, s."""
    ends = {"gap": at.tc, "resting": at.tc, "stuck": at.tb, "contact": at.end}
    return [0.0, *(ends[kind] for kind, _ in grid)]


def phase_rates(drive: Drive, kind: Kind) -> Matrix:
    """Rates of (z, z', w2, u, r, r', 1) of a drive in a phase."""
    J1, J2, c, d, Mc, lag = (
        float(value) for value in (drive.J1, drive.J2, drive.c, drive.d, drive.Mc, drive.torque_lag)
    )
    A = np.zeros((7, 7))
    A[Z, V] = 1.0
    A[R, SLOPE] = 1.0
    A[V, U if lag > 0.0 else R] = 1.0 / J1
    if lag > 0.0:
        A[U, U], A[U, R] = -1.0 / lag, 1.0 / lag
    if kind == "gap":
        A[V, ONE], A[W2, ONE] = Mc / J2, -Mc / J2
    elif kind == "stuck":
        A[V, [Z, V]] = -c / J1, -d / J1
    elif kind == "contact":
        inverse = 1.0 / J1 + 1.0 / J2
        A[V, [Z, V, ONE]] = -c * inverse, -d * inverse, Mc / J2
        A[W2, [Z, V, ONE]] = c / J2, d / J2, -Mc / J2
    return A


class WholeProgram:
    """The least P, or the greatest speed, of a whole start with given instants on a grid.

    Variables: the state y = (z, z', w2, u) at each node, the demand r at the beginning and end of each
    step, P.

    All without dimension: torques in U, the largest motor torque, z in U/c, z' in Omega U/c, w2 in the target
    speed. With a rate limit and `reached`, a few steps follow after t_f, in which only T <= P is asked for.
    """

    def __init__(
        self, problem: Problem, at: Instants, grid: Grid, full_tail: bool = False,
        warm: tuple[WarmStarts, WarmStarts] | None = None,
    ) -> None:  # fmt: skip
        drive: Any = problem.drive
        self.problem, self.at, self.grid, self.full_tail = problem, at, grid, full_tail
        self.warm = warm or (WarmStarts(), WarmStarts())  # of the least P, of the greatest speed
        self.J1, self.J2, self.c, self.d, self.Mc = (
            float(value) for value in (drive.J1, drive.J2, drive.c, drive.d, drive.Mc)
        )
        self.lag, self.rate = float(drive.torque_lag), float(drive.torque_rate)
        self.Omega = float(drive.Omega)
        self.U = problem.highest_torque
        self.scale = np.array([self.U / self.c, self.Omega * self.U / self.c, problem.target, self.U])
        self.pulls = drive.contact_law == "dead-zone" and self.d > 0.0
        self.shape = demand_shape(problem)
        begins = phase_ends(grid, at)
        kinds: list[Kind] = []
        edges = [np.zeros(1)]
        for (kind, shares), begin, end in zip(grid, begins, begins[1:], strict=False):
            kinds += [kind] * (shares.size - 1)
            edges.append(begin + shares[1:] * (end - begin))
        self.steps = len(kinds)  # up to t_f
        curved = self.shape == "continuous" and bool(problem.torque_speed)
        self.yields = curved and problem.terminal == "synchronous"  # the curve may leave less than holds T
        self.releases = self.shape == "continuous" and problem.terminal == "reached"
        if self.releases:
            kinds += ["contact"] * TAIL_STEPS
            edges.append(at.end + self.tail_length() * np.arange(1, TAIL_STEPS + 1) / TAIL_STEPS)
        self.kinds = tuple(kinds)
        self.edges = np.concatenate(edges)
        self.length = np.diff(self.edges)
        self.n = len(kinds)
        self.first_r = STATES * (self.n + 1)
        self.first, self.second, demands = self._demand_columns()
        self.P = self.first_r + demands
        self.columns = self.P + 1

    def _demand_columns(self) -> tuple[Steps, Steps, int]:
        """Which variable is the demand at the beginning and end of each step, and how many there are."""
        k = self.first_r + np.arange(self.n)
        if self.shape == "steps":
            return k, k, self.n
        if self.shape == "ramps":
            return k + np.arange(self.n), k + np.arange(self.n) + 1, 2 * self.n
        return k, k + 1, self.n + 1

    def tail_length(self) -> float:
        """How long after t_f T is watched, s: to its peak where the motor coasts, else a whole period."""
        period = 2.0 * math.pi / self.Omega
        if self.problem.terminal != "reached":
            return period
        falling = (self.U - self.problem.lowest_torque) / self.rate if self.rate < math.inf else 0.0
        return min(0.5 * period + 5.0 * self.lag + falling, 1.5 * period + falling)

    # the motion ------------------------------------------------------------------------------------------

    def matrix(self, kind: Kind) -> Matrix:
        """Rates of (z, z', w2, u, r, r', 1) in a phase."""
        return phase_rates(self.problem.drive, kind)

    def moved(self, step: Steps, s: Vector) -> Matrix:
        """How (z, z', w2, u, r, r', 1) moves within s of the given steps, shape (..., 7, 7)."""
        out = np.empty((step.size, 7, 7))
        kinds = np.array(self.kinds)[step]
        for kind in set(kinds.tolist()):
            here = kinds == kind
            # steps of one length are computed once
            shares, back = np.unique((s[here] / self.edges[-1]).round(14), return_inverse=True)
            out[here] = expm(self.matrix(kind)[None] * (shares * self.edges[-1])[:, None, None])[back]
        return out

    def rows(self, step: Steps, weights: Matrix) -> Rows:
        """Rows over the variables, and constants, of `weights` (m, 7) on (z, z', w2, u, r, r', 1) at the
        beginning of the given steps.
        """
        m = step.size
        each = self.length[step]
        on_slope = weights[:, SLOPE] / each
        values = [weights[:, i] * self.scale[i] for i in range(STATES)]
        columns = [STATES * step + i for i in range(STATES)]
        demand = [(weights[:, R] - on_slope) * self.U, on_slope * self.U]
        values += [demand[0] + demand[1]] if self.shape == "steps" else demand
        columns += [self.first[step], self.second[step]][: 1 if self.shape == "steps" else 2]
        return Sparse.of(m, np.concatenate(columns), np.concatenate(values)), weights[:, ONE]

    def single(self, node: int, weights: dict[int, float]) -> Sparse:
        """One row on the state at a node."""
        return Sparse.single(
            {STATES * node + i: value * float(self.scale[i]) for i, value in weights.items()}
        )

    @property
    def T(self) -> Vector:
        """Weights of T = c z + d z'."""
        return np.array([self.c, self.d, 0.0, 0.0, 0.0, 0.0, 0.0])

    def instants(self, fractions: tuple[float, ...]) -> tuple[Steps, Vector]:
        """Where limits are checked: (step, time since its beginning), at these fractions of each step.

        A step longer than a sixth of an elastic period is checked as often as short ones would be. In one
        that is longer than a period T swings about a mean, ever less, once the torque has come to rest: it is
        checked that long, and at its end.
        """
        period = 2.0 * math.pi / self.Omega
        watched = period + SETTLED * self.lag

        def within(length: float) -> Vector:
            count = math.ceil(6 * len(fractions) * min(length, watched) / period)
            if count <= len(fractions):
                return np.array(fractions) * length
            checks = min(length, watched) * np.arange(fractions[0] != 0.0, count + 1) / count
            return np.append(checks, length) if length > watched else checks

        return checked_instants(self.length, within)

    # what must hold --------------------------------------------------------------------------------------

    @cached_property
    def _on_P(self) -> Sparse:
        return Sparse.single({self.P: 1.0})

    def _below_P(self, torque: Rows, sign: float = 1.0) -> Rows:
        return below(((1.0 / self.U) * torque[0], torque[1] / self.U), self._on_P, sign)

    def _equations(self) -> RowList:
        """The motion, the joints of the phases, the end; the load speed at t_f comes last."""
        equal = RowList()
        all_steps = np.arange(self.n)
        moved = self.moved(all_steps, self.length)
        for i in range(STATES):
            rows, constant = self.rows(all_steps, moved[:, i, :] / self.scale[i])
            node = Sparse.of(self.n, STATES * (all_steps + 1) + i, np.ones(self.n))
            equal.add(rows - node, -constant)
        at = 0
        T = {Z: self.c / self.U, V: self.d / self.U}
        for kind, shares in self.grid:
            at += shares.size - 1
            if kind in ("gap", "resting"):
                equal.add(self.single(at, {Z: 1.0 / self.scale[Z]}), np.zeros(1))
            elif kind == "stuck":
                equal.add(self.single(at, T), np.array([self.Mc / self.U]))
        terminal = self.problem.terminal
        if terminal != "reached":
            equal.add(self.single(self.steps, {V: 1.0 / self.scale[V]}), np.zeros(1))
            if self.shape == "continuous" and not self.yields:
                equal.add(*self._beyond_held())
        if terminal == "steady":
            equal.add(self.single(self.steps, T), np.array([self.Mc / self.U]))
        equal.add(self.single(self.steps, {W2: 1.0 / self.problem.target}), np.array([AIM]))
        return equal

    def _beyond_held(self) -> Rows:
        """By how much the torque that holds T at t_f is above the demand there: equal where T is held."""
        total = (self.J1 + self.J2) / self.J2
        T = {Z: self.c / self.U * total, V: self.d / self.U * total}
        demand = Sparse.single({int(self.second[self.steps - 1]): 1.0})
        return self.single(self.steps, T) - demand, np.array([self.Mc * self.J1 / self.J2 / self.U])

    def _limits(self, with_P: bool) -> RowList:
        """Everything that is an inequality."""
        limits = RowList()
        drive: Any = self.problem.drive
        step, s = self.instants(QUARTERS)
        moved = self.moved(step, s)
        kinds = np.array(self.kinds)[step]
        before = step < self.steps
        T = self.T @ moved
        z = moved[:, Z]

        open_ = (kinds == "gap") | (kinds == "resting")
        if open_.any():
            rows, constant = self.rows(step[open_], z[open_] / self.scale[Z])
            limits.add(rows, -constant)
            limits.add(-1.0 * rows, constant + float(drive.gap) / self.scale[Z])
        stuck = kinds == "stuck"
        if stuck.any():
            rows, constant = self.rows(step[stuck], T[stuck] / self.U)
            limits.add(rows, self.Mc / self.U - constant)
            limits.add(-1.0 * rows, constant)
        driven = (kinds == "contact") & before
        kept = self.c * z if self.pulls else T
        rows, constant = self.rows(step[driven], kept[driven] / self.U)
        limits.add(-1.0 * rows, constant - self._least_torque(step[driven], s[driven]))
        if drive.load_kind == "reactive":
            rows, constant = self.rows(step[driven], moved[driven, W2] / self.problem.target)
            limits.add(-1.0 * rows, constant)
        if with_P:
            pressed = kinds == "contact"
            limits.add(*self._below_P(self.rows(step[pressed], T[pressed])))
            if self.pulls:
                limits.add(*self._below_P(self.rows(step[driven], T[driven]), -1.0))
            if not self.releases:
                limits.add(*self._below_P(self._tail()))
        self._add_landing(limits, with_P)
        self._add_demand_limits(limits)
        return limits

    def _least_torque(self, step: Steps, s: Vector) -> Vector:
        """What T keeps above at instants in contact, over U: MARGIN, 0 where the contact begins.

        With a load torque of 0 `steady` ends at T = 0 and z = 0. Behind a damped shaft that pushes all the
        time, z' >= -(c/d) z, that takes forever: at the end T may lie so much below 0, where the exact plant
        has T = 0.
        """
        least = np.where(np.arange(step.size) < 2 * len(QUARTERS), 0.0, MARGIN)
        if self.problem.terminal == "steady" and self.Mc < MARGIN * self.U:
            half = math.pi / self.Omega
            last = max(half, -math.log(MARGIN) * self.d / self.c)
            least[self.at.end - self.edges[step] - s < last] = -MARGIN * half / last
        return least

    def _add_landing(self, limits: RowList, with_P: bool) -> None:
        """A damped contact begins with T = d z'; without a wound-up shaft it must move the load at once."""
        begins = [kind for kind, _ in self.grid]
        if begins[0] == "contact" or self.d == 0.0 or "stuck" in begins:
            return
        node = self.grid[0][1].size - 1
        jump = self.single(node, {V: self.d / self.U})
        if with_P:
            limits.add(jump - self._on_P, np.zeros(1))
        if begins[0] == "resting":
            limits.add(-1.0 * jump, np.array([-self.Mc / self.U]))

    def _add_demand_limits(self, limits: RowList) -> None:
        if self.rate < math.inf:
            ones = np.ones(self.n)
            rise = Sparse.of(self.n, self.second, ones) - Sparse.of(self.n, self.first, ones)
            limits.add(rise, self.rate * self.length / self.U)
            limits.add(-1.0 * rise, self.rate * self.length / self.U)
        # also at the beginning of each step, where the demand may jump
        for rows, right in self._under_curve((0.0, *QUARTERS)):
            limits.add(rows, right - BELOW_CURVE)
        if self.yields:
            rows, right = self._beyond_held()
            limits.add(-1.0 * rows, -right)
        if self.shape == "continuous":
            for rows, right in self._under_curve_later():
                limits.add(rows, right - BELOW_CURVE)

    def _under_curve(self, fractions: tuple[float, ...]) -> Iterator[Rows]:
        """For each line of the torque-speed curve, rows of u - slope w1 and what they may be, over U."""
        if not self.problem.torque_speed:
            return
        step, s = self.instants(fractions)
        step, s = step[step < self.steps], s[step < self.steps]
        for weights, most in self._excess(self.moved(step, s)):
            rows, constant = self.rows(step, weights / self.U)
            yield rows, most / self.U - constant

    def _excess(self, moved: Matrix) -> Iterator[tuple[Matrix, float]]:
        """For each line of the curve, u - slope w1 after the motions (m, 7, 7), and what it may be, N m."""
        u = moved[:, U if self.lag > 0.0 else R]
        for (w_a, u_a), (w_b, u_b) in pairwise(self.problem.torque_speed):
            slope = (u_b - u_a) / (w_b - w_a)
            yield u - slope * (moved[:, W2] + moved[:, V]), u_a - slope * w_a

    def _under_curve_later(self) -> Iterator[Rows]:
        """The same after t_f, while the demand falls as fast as it may and the torque comes after it."""
        length = 3.0 * self.lag + YIELDING * self.U / self.rate
        times = length * np.arange(1, YIELDING_POINTS + 1) / YIELDING_POINTS
        moved = expm(self.matrix("contact")[None] * times[:, None, None])
        for weights, most in self._excess(moved):
            values = (weights[:, :STATES] * self.scale).T.ravel() / self.U
            states = np.repeat(STATES * self.steps + np.arange(STATES), times.size)
            demand = np.full(times.size, self.second[self.steps - 1])
            rows = Sparse.of(times.size, np.append(states, demand), np.append(values, weights[:, R]))
            yield rows, (most - weights[:, ONE] + self.rate * weights[:, SLOPE]) / self.U

    def _tail(self) -> Rows:
        """T after t_f, from the state there: the torque is held, or the motor coasts.

        With `full_tail` the largest torque stands for one beyond it that would hold T.
        """
        node = self.steps
        length = self.tail_length()
        times = length * np.arange(1, TAIL_POINTS + 1) / TAIL_POINTS
        weights = self.T @ expm(self.matrix("contact")[None] * times[:, None, None])
        if self.problem.terminal == "reached":
            constant = weights[:, ONE] + weights[:, R] * self.problem.lowest_torque
        elif self.full_tail:
            constant = weights[:, ONE] + weights[:, R] * self.U
        else:
            total = (self.J1 + self.J2) / self.J2
            weights = weights.copy()
            weights[:, Z] += weights[:, R] * total * self.c
            weights[:, V] += weights[:, R] * total * self.d
            constant = weights[:, ONE] - weights[:, R] * self.Mc * self.J1 / self.J2
        columns = np.repeat(STATES * node + np.arange(STATES), TAIL_POINTS)
        return Sparse.of(TAIL_POINTS, columns, (weights[:, :STATES] * self.scale).T.ravel()), constant

    def _bounds(self) -> Matrix:
        drive: Any = self.problem.drive
        bounds = np.tile([-np.inf, np.inf], (self.columns, 1))
        start = [
            drive.theta0 - 0.5 * drive.gap,
            drive.initial_motor_speed - drive.initial_load_speed,
            drive.initial_load_speed,
            self.problem.first_torque,
        ]
        bounds[:STATES] = (np.array(start, dtype=np.float64) / self.scale)[:, None]
        bounds[self.first_r : self.P] = (
            self.problem.lowest_torque / self.U,
            self.problem.highest_torque / self.U,
        )
        if self.shape == "continuous":
            bounds[self.first_r] = self.problem.first_demand / self.U
        bounds[self.P] = 0.0, np.inf
        return bounds

    # solving ---------------------------------------------------------------------------------------------

    def solve(self) -> WholeAnswer | None:
        """The least P; None where there is no start with these instants."""
        found = self._solved(self.least_P, self.warm[0])
        if found is None:
            return None
        demand = np.column_stack([found[self.first], found[self.second]])[: self.steps] * self.U
        z, v = found[STATES * self.steps : STATES * self.steps + 2] * self.scale[:2]
        held = ((self.c * z + self.d * v) * (self.J1 + self.J2) - self.Mc * self.J1) / self.J2
        P = float(found[self.P])
        return WholeAnswer(
            self.at, P * self.U, self.grid, self.edges[: self.steps + 1], demand, self._broken(found, P),
            bool(held > self.U), found,
        )  # fmt: skip

    def greatest_speed(self) -> tuple[float, Vector | None]:
        """The greatest w2(t_f) whatever T, rad/s, and the variables; -inf and None where no start fits."""
        found = self._solved(self.most_speed, self.warm[1])
        if found is None:
            return -math.inf, None
        return float(found[STATES * self.steps + W2]) * self.problem.target, found

    @cached_property
    def least_P(self) -> Limits:
        """The program that looks for the least P."""
        cost = np.zeros(self.columns)
        cost[self.P] = 1.0
        return Limits(cost, *self._limits(with_P=True).all(), *self._equations().all())

    @cached_property
    def most_speed(self) -> Limits:
        """The program that looks for the greatest speed."""
        cost = np.zeros(self.columns)
        cost[STATES * self.steps + W2] = -1.0
        equations = self._equations()
        equations.blocks.pop(), equations.rights.pop()
        return Limits(cost, *self._limits(with_P=False).all(), *equations.all())

    def _solved(self, limits: Limits, warm: WarmStarts) -> Vector | None:
        found = limits.solved(self._bounds(), warm)
        return None if found is None else found.x

    def shifted(self, fast: bool, found: Vector, near: list[WholeProgram], by: Vector, ends: Matrix,
                order: tuple[Vector, float]) -> Vector | None:  # fmt: skip
        """By how much to shift the instants for the best, with the limits linearised in them here.

        `found` are the variables here; `near` are programs with one instant shifted each, by `by` s; `ends`
        (instants, 2) say how far each may go, and weights @ shift >= least with `order` = (weights, least).
        None where the two programs cannot be compared, or there is no better shift.
        """
        own = self.most_speed if fast else self.least_P
        others = [one.most_speed if fast else one.least_P for one in near]
        if any(one.b_ub.size != own.b_ub.size for one in others):
            return None
        ub, eq = own.A_ub.csr(self.columns) @ found, own.A_eq.csr(self.columns) @ found
        slopes = [
            ((one.A_ub.csr(self.columns) @ found - one.b_ub - ub + own.b_ub) / by[i],
             (one.A_eq.csr(self.columns) @ found - one.b_eq - eq + own.b_eq) / by[i])
            for i, one in enumerate(others)
        ]  # fmt: skip
        size = np.maximum(np.abs(ends).max(axis=1), 1e-300)  # a unit in which the shift is about 1
        shifts = self.columns + np.arange(by.size)

        def joined(rows: Sparse, values: list[Vector]) -> Sparse:
            """The rows with what the shifts change in them."""
            more = -(np.array(values) * size[:, None]).ravel()
            return rows - Sparse.of(rows.count, np.repeat(shifts, rows.count), more)

        limits = Limits(
            np.concatenate([own.cost, np.zeros(by.size)]),
            Sparse.stacked(
                [joined(own.A_ub, [ub for ub, _ in slopes]), Sparse.of(1, shifts, -order[0] * size)]
            ),
            np.append(own.b_ub, -order[1]),
            joined(own.A_eq, [eq for _, eq in slopes]),
            own.b_eq,
        )
        best = limits.solved(np.vstack([self._bounds(), ends / size[:, None]]), self.warm[fast])
        return None if best is None else best.x[self.columns :] * size

    def _broken(self, found: Vector, P: float) -> Marks:
        """Steps between whose checks T goes above P or off the flank, or the torque above its curve."""
        step, s = self.instants(SIXTEENTHS)
        moved = self.moved(step, s)
        rows, constant = self.rows(step, self.T @ moved / self.U)
        T = rows.csr(self.columns) @ found + constant
        rows, constant = self.rows(step, self.c * moved[:, Z] / self.U)
        kept = rows.csr(self.columns) @ found + constant if self.pulls else T
        contact = np.array(self.kinds)[step] == "contact"
        over = np.abs(T) if self.pulls else T
        least = np.minimum(self._least_torque(step, s), 0.0) - BROKEN
        bad = contact & ((over > P * (1.0 + EXCESS)) | ((kept < least) & (step < self.steps)))
        for rows, right in self._under_curve(SIXTEENTHS):
            bad[step < self.steps] |= rows.csr(self.columns) @ found > right
        broken: Marks = np.bincount(step, weights=bad, minlength=self.n)[: self.steps] > 0.0
        return broken
