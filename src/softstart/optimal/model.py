"""The linear model of the starts under a demand, and the program of the best step from it.

To first order in a change x of the unknowns of the demand and h of the end t_f the problem is a linear
program over x, h, the largest torque P and what is missed, m >= 0:

    minimise    objective + penalty * sum of m + calm * sum of |u_(q+1) + x_(q+1) - u_q - x_q|
    peak        |T_k(t) + (dT_k/dx + T_k' dt/dx) x| <= P       for all machines, shafts, t <= t_f + period
    terminal    y(t_f) + dy/dx x + y'(t_f) h = wanted, up to m    (reached: each load's speed, >=)
    limits      lowest <= u_q + x_q <= highest,  |u_(q+1) + x_(q+1) - u_q - x_q| <= rate * (t_(q+1) - t_q)
    curve       r(t) + dr/dx x <= a + b (w + dw/dx x) + m         r the realised torque, w the motor speed
    heat        H + dH/dx x + r(t_f)^2 h <= bound + m
    trust       |x_q| <= trust, |h| <= share of t_f,  t_f + h <= start_time

    objective   P (k_dyn), t_f + h (start_time), or H + dH/dx x + x' G'G x (heat: a square, as the realised
                torque is linear in the demand); smoothness adds its square. A square lies above tangent
                planes, added until near

The instants of the peaks keep their place between the contacts and move with them, by dt/dx x
(`DemandRun.along_contacts`): where a contact comes later, the torque after it does too. At fixed instants the
program would be wrong beside each contact, and descents stall.

Of the rows of peaks and of the curve only those that matter are in the program: it begins with the instants
near the peak, thinned, and takes in local maxima that its answer would let through. It stays alive meanwhile,
and where its trust region narrows.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softstart.arrays import Matrix, Vector
from softstart.optimal.program import LinearProgram
from softstart.optimal.search import BETWEEN, CALM, Found, Search
from softstart.optimal.starts import DemandRun

LOW = 0.6  # share of the peak from which rows are known at all
MOST_ROWS = 60_000  # rows of shaft torques: where there are more, those between the maxima are thinned
NEAR, THIN = 0.85, 3  # share of the peak from which rows are in a program; one of so many of them
ROUNDS, CUTS, LET_THROUGH = 12, 12, 0.1  # of taking in rows; by what share of the decrease
CLOSE = 0.25  # of the highest torque below the torque-speed curve: looked at
CURVE_TOLERANCE = 1e-4  # of a step, by which the torque may lie beyond the curve in a program
FARTHEST, TURNS = 1.0, 0.5  # of t_f and of the elastic period, that t_f moves for a unit of trust
STEP = 4.0  # units of time that a step may move for each unit of trust


@dataclass(frozen=True, eq=False)
class Watched:
    """Rows of one kind, by the torques as shares of the highest, in order of time: value + row v <= limit."""

    rows: Matrix
    values: Vector
    edges: NDArray[np.bool_]  # whether row i does not continue row i - 1; one more for the end

    @classmethod
    def of(cls, parts: Sequence[tuple[Matrix, Vector, NDArray[np.bool_]]], count: int) -> Watched:
        """All parts, one after the other."""
        rows, values, edges = zip(*parts, strict=True) if parts else ((), (), ())
        return cls(
            np.concatenate([*rows, np.zeros((0, count))]), np.concatenate([*values, np.zeros(0)]),
            np.concatenate([*edges, [True]]),
        )  # fmt: skip

    def peaks(self, values: Vector) -> NDArray[np.bool_]:
        """Which rows are local maxima over time."""
        left = np.where(self.edges[:-1], -np.inf, np.concatenate([[-np.inf], values[:-1]]))
        right = np.where(self.edges[1:], -np.inf, np.concatenate([values[1:], [-np.inf]]))
        return np.asarray((values >= left) & (values >= right))

    def first(self, least: float) -> NDArray[np.intp]:
        """The rows a program begins with, above `least`: maxima, and as many others as it has columns."""
        high = np.flatnonzero(self.values > least)
        maxima = high[self.peaks(self.values)[high]]
        return np.union1d(maxima, high[:: max(THIN, high.size // self.rows.shape[1])])

    def over(self, change: Vector, limit: float, known: NDArray[np.intp]) -> NDArray[np.intp]:
        """Maxima above a limit after a change of the torques, beside those that are known."""
        after = self.values + self.rows @ change
        return np.setdiff1d(np.flatnonzero((after > limit) & self.peaks(after)), known)


@dataclass(frozen=True, eq=False)
class Square:
    """A sum of squares |G v + g|^2 + rate h of the problem, above which a program puts tangent planes.

    It has a cost, or is to be `most`.
    """

    G: Matrix
    g: Vector
    rate: float
    cost: float
    most: float | None

    def value(self, change: Vector, h: float) -> float:
        """The sum after a change of the torques and of t_f."""
        r = self.G @ change + self.g
        return float(r @ r) + self.rate * h

    def cut(self, program: LinearProgram, change: Vector, h: int, at: int) -> None:
        """The tangent plane at a change: column `at` lies above it; h is in the column after `h`."""
        r = self.G @ change + self.g
        row = 2.0 * (self.G.T @ r)
        parts = {0: row[None], h + 1: np.full((1, 1), self.rate), at: -np.ones((1, 1))}
        program.add(parts, float(row @ change) - float(r @ r))


class Model:
    """The linear model of the starts under the demand of `found`."""

    def __init__(self, search: Search, found: Found) -> None:
        self.search, self.found = search, found
        problem, self.size = search.problem, found.demand.size
        shafts, curve, ends = [], [], []
        limited = search.objective == "k_dyn" or problem.k_dyn is not None
        for player, start in zip(search.players, found.starts, strict=True):
            least = LOW * found.peak if limited else math.inf
            shaft, end = _of_shafts(search, start, found.end, least)
            shafts.append(shaft)
            ends.append(end)
            if problem.torque_speed:
                curve.append(self._of_curve(start, player.motor, player.joints))
        # largest torques as shares of the base torque; above the curve, as shares of the highest torque
        self.shafts, self.curve = Watched.of(shafts, self.size), Watched.of(curve, self.size)
        self.terminal, rates = search.terminal_rows(found, ends)
        self.rates = rates * found.end
        self.squares = tuple(self._squares())
        self.cuts = [np.zeros(self.size)]  # where squares have tangent planes
        self.program: LinearProgram | None = None

    def _of_curve(
        self, start: DemandRun, motor: int, joints: int
    ) -> tuple[Matrix, Vector, NDArray[np.bool_]]:
        search = self.search
        times = start.instants(search.curve_step)
        state = start.trajectory.at(times)
        w = state["w"][:, motor]
        near = np.flatnonzero(search.above(state["u"], w) > -CLOSE)
        by = start.by_demand((), times[near])[1]
        parts = []
        for a, b in search.lines():
            over = (state["u"] - a - b * w)[near] / search.high + BETWEEN
            rows = (by[:, -1] - b * by[:, joints + motor]) / search.high
            parts.append((rows, over, np.append([True], np.diff(near) != 1)[: near.size]))
        rows, over, edges = (np.concatenate(each) for each in zip(*parts, strict=True))
        return rows, over, edges

    def _squares(self) -> list[Square]:
        problem, search, found = self.search.problem, self.search, self.found
        squares = []
        if search.heats:
            start, Ms = found.starts[0], problem.starting_torque
            times, weights = start.quadrature(found.end)
            share = np.sqrt(weights) / Ms
            by = start.by_demand((), times)[1][:, -1] * share[:, None]
            last = float(start.trajectory.at([found.end])["u"][0]) / Ms
            cost = 1.0 / search.scale if search.objective == "heat" else 0.0
            u = start.trajectory.at(times)["u"] * share
            squares.append(Square(by, u, last * last * found.end, cost, problem.heat))
        if problem.smoothness > 0.0:
            size = math.sqrt(problem.smoothness) * search.high / problem.starting_torque
            time, torque = found.demand.time, found.demand.torque
            D = np.diff(np.eye(self.size), axis=0) * (size / np.sqrt(np.diff(time)))[:, None]
            squares.append(Square(D, D @ (torque / search.high), 0.0, 1.0, None))
        return squares

    # the columns: unknowns, P as share of the base torque, h as share of t_f, what is missed (terminal,
    # curve, k_dyn, heat), the changes of the torque from knot to knot, the squares

    def _begin(self, penalty: float) -> LinearProgram:
        search, found, problem, n = self.search, self.found, self.search.problem, self.size
        knots, misses = found.demand.time.size, self.terminal.shape[0]
        P, h, missed = n, n + 1, n + 2
        self.curve_at = missed + misses
        k_dyn, heat, steps = self.curve_at + 1, self.curve_at + 2, self.curve_at + 3
        self.steps_at, self.squares_at = steps, steps + 2 * (knots - 1)
        size = self.squares_at + len(self.squares)
        cost = np.zeros(size)
        cost[missed:steps] = penalty
        cost[steps : self.squares_at] = CALM
        cost[self.squares_at :] = [one.cost for one in self.squares]
        if search.objective == "k_dyn":
            cost[P] = search.base / search.scale
        elif search.objective == "start_time":
            cost[h] = found.end / search.scale
        self.cost, one = cost, np.ones((1, 1))
        program = LinearProgram(cost, np.zeros(size), np.full(size, np.inf))
        ends, none = self.rates[:, None], -np.eye(misses)
        program.add({0: -self.terminal, h: -ends, missed: none}, -found.missing)
        if problem.terminal != "reached":
            program.add({0: self.terminal, h: ends, missed: none}, found.missing)
        rise = np.diff(np.eye(knots), axis=0)
        now, single = np.diff(found.demand.torque) / search.high, np.eye(knots - 1)
        program.add({0: rise, steps: np.hstack([-single, single])}, -now, -now)
        if math.isfinite(search.rate):
            most = search.rate / search.high * np.diff(found.demand.time)
            program.add({0: rise}, most - now, -most - now)
        for at, square in enumerate(self.squares, start=self.squares_at):
            if square.most is not None:
                program.add({heat: -square.most * one, at: one}, square.most)
        if problem.k_dyn is not None:
            program.add({P: one, k_dyn: -problem.k_dyn * one}, problem.k_dyn)
        peak = found.peak / search.base
        self.shafts_in = self.shafts.first(NEAR * peak)
        self.curve_in = self.curve.first(-0.2 * CLOSE)
        self._take_in(program, self.shafts_in, self.curve_in, self.cuts)
        return program

    def _take_in(self, program: LinearProgram, shafts: Any, over: Any, cuts: Sequence[Vector]) -> None:
        """Rows of peaks and of the curve, and tangent planes of the squares."""
        if shafts.size:
            rows = {0: self.shafts.rows[shafts], self.size: -np.ones((shafts.size, 1))}
            program.add(rows, -self.shafts.values[shafts])
        if over.size:
            rows = {0: self.curve.rows[over], self.curve_at: -np.ones((over.size, 1))}
            program.add(rows, -self.curve.values[over])
        for at, square in enumerate(self.squares, start=self.squares_at):
            for change in cuts:
                square.cut(program, change, self.size, at)

    def step(self, trust: float, penalty: float, fine: float) -> tuple[Vector, float, float] | None:
        """The change of the unknowns and of t_f, s, in the trust region, and the decrease that it promises.

        None where the program fails. `fine` is the share of the peak that matters.
        """
        search, found, n = self.search, self.found, self.size
        if self.program is None:
            self.program = self._begin(penalty)
        lower, upper = np.zeros(self.cost.size), np.full(self.cost.size, np.inf)
        knots = found.demand.time.size
        u = found.demand.torque / search.high
        lower[:knots] = np.maximum(-trust, search.low / search.high - u).clip(max=0.0)
        upper[:knots] = np.minimum(trust, 1.0 - u).clip(min=0.0)
        if search.starts_at_initial:
            lower[0] = upper[0] = 0.0
        if found.demand.steps.size:
            earlier, later = found.demand.room()
            lower[knots:n] = -np.minimum(earlier, STEP * trust)
            upper[knots:n] = np.minimum(later, STEP * trust)
        lower[n + 1] = -trust * min(FARTHEST, TURNS * search.period / found.end)
        upper[n + 1] = max(min(-lower[n + 1], search.latest / found.end - 1.0), 0.0)
        self.program.limit(lower, upper)
        x = self._solved(self.program, fine)
        if x is None:
            return None
        promised = self._value(self._now()) - self._value(x)
        return x[:n], float(x[n + 1]) * found.end, promised

    def _solved(self, program: LinearProgram, fine: float) -> Vector | None:
        """The answer, with the rows of peaks and of the curve that matter taken in as they show."""
        n, peak = self.size, self.found.peak / self.search.base
        x: Vector | None = None
        for _ in range(CUTS if self.squares else ROUNDS):
            x = program.solved()
            if x is None:
                return None
            most = float(x[n]) + max(LET_THROUGH * (peak - float(x[n])), fine * peak)
            new = self.shafts.over(x[:n], most, self.shafts_in)
            # a long step is wrong by more than this anyway, and each round solves the whole program again
            close = max(1e-6, CURVE_TOLERANCE * float(np.abs(x[:n]).max()))
            beyond = self.curve.over(x[:n], float(x[self.curve_at]) + close, self.curve_in)
            short = self._cut_short(x, fine)
            if new.size + beyond.size == 0 and not short:
                break
            cuts = [x[:n]] if self.squares else []
            self.cuts += cuts
            self._take_in(program, new, beyond, cuts)
            self.shafts_in = np.append(self.shafts_in, new)
            self.curve_in = np.append(self.curve_in, beyond)
        return x

    def _cut_short(self, x: Vector, fine: float) -> bool:
        """Whether the tangents of a square are still far below it."""
        if not self.squares:
            return False
        now, after = self._value(self._now()), self._value(x)
        return after - float(self.cost @ x) > max(0.3 * (now - float(self.cost @ x)), fine * now)

    def _now(self) -> Vector:
        """The columns of the program as it is now."""
        found, problem, n = self.found, self.search.problem, self.size
        x = np.zeros(self.cost.size)
        x[n + 2 : self.curve_at], x[self.curve_at] = found.lacking, found.beyond
        peak = found.peak / self.search.base
        x[self.curve_at + 1] = max(peak / problem.k_dyn - 1.0, 0.0) if problem.k_dyn else 0.0
        x[self.curve_at + 2] = max(found.heat / problem.heat - 1.0, 0.0) if problem.heat else 0.0
        rise = np.diff(found.demand.torque) / self.search.high
        x[self.steps_at : self.squares_at] = np.concatenate([rise, -rise]).clip(min=0.0)
        return x

    def _value(self, x: Vector) -> float:
        """The merit as the model has it, but for what does not change."""
        x, n = x.copy(), self.size
        x[n] = float((self.shafts.values + self.shafts.rows @ x[:n]).max(initial=0.0))
        for at, square in enumerate(self.squares, start=self.squares_at):
            x[at] = square.value(x[:n], x[n + 1])
        return float(self.cost @ x)


def _of_shafts(
    search: Search, start: DemandRun, t_f: float, least: float
) -> tuple[tuple[Matrix, Vector, NDArray[np.bool_]], Matrix]:
    """|T| of each shaft above `least` over time, as shares of the base torque, and its rows.

    Also the derivatives of the state at t_f.
    """
    seen, T, times = np.zeros(0, dtype=np.intp), np.zeros((0, start.trajectory.input.count - 1)), np.zeros(0)
    if math.isfinite(least):
        times = start.with_peaks(start.instants(search.step))
        T = start.trajectory.at(times)["T"]
        seen = np.flatnonzero((np.abs(T) > least).any(axis=1))
    passage = np.cumsum(np.diff(seen, prepend=-2) != 1)
    if (thin := seen.size * T.shape[1] // MOST_ROWS) > 1:
        here = np.abs(T[seen])
        before, after = np.roll(here, 1, axis=0), np.roll(here, -1, axis=0)
        maxima = ((here >= before) & (here >= after) & (here > least)).any(axis=1)
        kept = np.union1d(np.flatnonzero(maxima), np.arange(0, seen.size, thin))
        seen, passage = seen[kept], passage[kept]
    begin = start.contacts[0]
    marks = np.union1d(begin, [t_f])
    answer, states = start.by_demand(times[seen], marks)
    moved, slope = start.along_contacts(times[seen], states[np.searchsorted(marks, begin)])
    answer = answer + slope[:, :, None] * moved[:, None, :]
    T = T[seen]
    j, k = np.nonzero(np.abs(T) > least)
    order = np.lexsort((j, k))
    j, k = j[order], k[order]
    rows = np.sign(T[j, k])[:, None] * answer[j, k] / search.base
    apart = (np.diff(k) != 0) | (np.diff(j) != 1) | (np.diff(passage[j]) != 0)
    edges = np.append([True], apart)[: j.size]
    return (rows, np.abs(T[j, k]) / search.base, edges), states[np.searchsorted(marks, t_f)]
