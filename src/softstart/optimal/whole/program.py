"""The optimum for fixed instants of contact and breakaway, over the whole start: a linear program.

Where the motor torque lags behind its demand, is limited in rate or by a torque-speed curve, may brake, or
turns a damped shaft against a load at rest, the gap part no longer shrinks to two numbers. But with the
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

with limits looked at in four instants of each step or more. What is found is exact for this grid: nothing is
integrated.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.linalg import expm

from softstart.optimal.linear_program import AIM, MARGIN, QUARTERS, SIXTEENTHS
from softstart.optimal.whole.answer import Matrix, Vector, WholeAnswer
from softstart.optimal.whole.limits import Gathered, Limits
from softstart.optimal.whole.motion import ONE, STATES, W2, Motion, R, Rows, U, V, Z

TAIL_POINTS = 96
BELOW_CURVE = 3e-5  # of U, by which the torque stays below its curve where it is looked at


class WholeProgram(Motion):
    """The least P, or the greatest speed, of a whole start with given instants on a grid."""

    # what must hold --------------------------------------------------------------------------------------

    @cached_property
    def _on_P(self) -> Any:
        return sparse.csr_array((np.ones(1), (np.zeros(1, dtype=np.int64), [self.P])), (1, self.columns))

    def _below_P(self, limits: Gathered, rows: Rows, sign: float = 1.0) -> None:
        ones = sparse.csr_array(np.ones((rows[1].size, 1)))
        limits.add(sign * rows[0] / self.U - ones @ self._on_P, -sign * rows[1] / self.U)

    def _equations(self) -> Gathered:
        """The motion, the joints of the phases, the end; the load speed at t_f comes last."""
        equal = Gathered()
        all_steps = np.arange(self.n)
        moved = self.moved(all_steps, self.length)
        for i in range(STATES):
            rows, constant = self.rows(all_steps, moved[:, i, :] / self.scale[i])
            node = sparse.csr_array((np.ones(self.n), (all_steps, STATES * (all_steps + 1) + i)), rows.shape)
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
            if self.shape == "continuous":  # what holds T is demanded already
                total = (self.J1 + self.J2) / self.J2
                row = self.single(self.steps, {i: value * total for i, value in T.items()})
                held = sparse.csr_array((np.ones(1), ([0], [self.second[self.steps - 1]])), row.shape)
                equal.add(row - held, np.array([self.Mc * self.J1 / self.J2 / self.U]))
        if terminal == "steady":
            equal.add(self.single(self.steps, T), np.array([self.Mc / self.U]))
        equal.add(self.single(self.steps, {W2: 1.0 / self.problem.target}), np.array([AIM]))
        return equal

    def _limits(self, with_P: bool) -> Gathered:
        """Everything that is an inequality."""
        limits = Gathered()
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
        least = np.where(np.arange(constant.size) < 2 * len(QUARTERS), 0.0, MARGIN)
        limits.add(-1.0 * rows, constant - least)
        if drive.load_kind == "reactive":
            rows, constant = self.rows(step[driven], moved[driven, W2] / self.problem.target)
            limits.add(-1.0 * rows, constant)
        if with_P:
            pressed = kinds == "contact"
            self._below_P(limits, self.rows(step[pressed], T[pressed]))
            if self.pulls:
                self._below_P(limits, self.rows(step[driven], T[driven]), -1.0)
            if not self.releases:
                self._below_P(limits, self._tail())
        self._add_landing(limits, with_P)
        self._add_demand_limits(limits)
        return limits

    def _add_landing(self, limits: Gathered, with_P: bool) -> None:
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

    def _add_demand_limits(self, limits: Gathered) -> None:
        if self.rate < math.inf:
            k = np.arange(self.n)
            ones = np.ones(self.n)
            rise = sparse.csr_array(
                (np.concatenate([ones, -ones]), (np.tile(k, 2), np.concatenate([self.second, self.first]))),
                (self.n, self.columns),
            )
            limits.add(rise, self.rate * self.length / self.U)
            limits.add(-1.0 * rise, self.rate * self.length / self.U)
        # also at the beginning of each step, where the demand may jump
        for rows, right in self._under_curve((0.0, *QUARTERS)):
            limits.add(rows, right - BELOW_CURVE)

    def _under_curve(self, fractions: tuple[float, ...]) -> Iterator[Rows]:
        """For each line of the torque-speed curve, rows of u - slope w1 and what they may be, over U."""
        corners = self.problem.torque_speed
        if not corners:
            return
        step, s = self.instants(fractions)
        step, s = step[step < self.steps], s[step < self.steps]
        moved = self.moved(step, s)
        u = moved[:, U if self.lag > 0.0 else R]
        for (w_a, u_a), (w_b, u_b) in pairwise(corners):
            slope = (u_b - u_a) / (w_b - w_a)
            rows, constant = self.rows(step, (u - slope * (moved[:, W2] + moved[:, V])) / self.U)
            yield rows, (u_a - slope * w_a - constant) / self.U

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
        columns = np.tile(STATES * node + np.arange(STATES), (TAIL_POINTS, 1))
        where = np.repeat(np.arange(TAIL_POINTS), STATES), columns.ravel()
        values = (weights[:, :STATES] * self.scale).ravel()
        return sparse.csr_array((values, where), (TAIL_POINTS, self.columns)), constant

    def _bounds(self) -> Matrix:
        drive: Any = self.problem.drive
        bounds = np.tile([-np.inf, np.inf], (self.columns, 1))
        start = [
            drive.start_position - 0.5 * drive.gap,
            drive.initial_motor_speed - drive.initial_load_speed,
            drive.initial_load_speed,
            0.0,
        ]
        bounds[:STATES] = (np.array(start, dtype=np.float64) / self.scale)[:, None]
        bounds[self.first_r : self.P] = (
            self.problem.lowest_torque / self.U,
            self.problem.highest_torque / self.U,
        )
        if self.shape == "continuous":
            bounds[self.first_r] = 0.0
        bounds[self.P] = 0.0, np.inf
        return bounds

    # solving ---------------------------------------------------------------------------------------------

    def solve(self) -> WholeAnswer | None:
        """The least P; None where there is no start with these instants."""
        found = self._solved(self.least_P)
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
        found = self._solved(self.most_speed)
        if found is None:
            return -math.inf, None
        return float(found[STATES * self.steps + W2]) * self.problem.target, found

    @cached_property
    def least_P(self) -> Limits:
        """The program that looks for the least P."""
        cost = np.zeros(self.columns)
        cost[self.P] = 1.0
        A_eq, b_eq = self._equations().all(self.columns)
        return Limits(cost, *self._limits(with_P=True).all(self.columns), A_eq, b_eq)

    @cached_property
    def most_speed(self) -> Limits:
        """The program that looks for the greatest speed."""
        cost = np.zeros(self.columns)
        cost[STATES * self.steps + W2] = -1.0
        A_eq, b_eq = self._equations().all(self.columns)
        return Limits(cost, *self._limits(with_P=False).all(self.columns), A_eq[:-1], b_eq[:-1])

    def _solved(self, limits: Limits) -> Vector | None:
        return limits.solved(self._bounds())

    def shifted(self, fast: bool, found: Vector, near: list[WholeProgram], by: Vector, ends: Matrix,
                order: tuple[Vector, float]) -> Vector | None:  # fmt: skip
        """By how much to shift the instants for the best, judged from here: the limits made linear in them.

        `found` are the variables here; `near` are programs with one instant shifted each, by `by` s; `ends`
        (instants, 2) say how far each may go, and weights @ shift >= least with `order` = (weights, least).
        None where nothing can be said.
        """
        own = self.most_speed if fast else self.least_P
        others = [one.most_speed if fast else one.least_P for one in near]
        if any(one.b_ub.size != own.b_ub.size for one in others):
            return None
        slopes = [
            ((one.A_ub @ found - one.b_ub - own.A_ub @ found + own.b_ub) / by[i],
             (one.A_eq @ found - one.b_eq - own.A_eq @ found + own.b_eq) / by[i])
            for i, one in enumerate(others)
        ]  # fmt: skip
        size = np.maximum(np.abs(ends).max(axis=1), 1e-300)  # a unit in which the shift is about 1
        limits = Limits(
            np.concatenate([own.cost, np.zeros(by.size)]),
            sparse.vstack([
                sparse.hstack([own.A_ub, sparse.csr_array(np.column_stack([ub for ub, _ in slopes]) * size)]),
                sparse.csr_array(np.concatenate([np.zeros(self.columns), -order[0] * size])[None, :]),
            ]).tocsr(),
            np.append(own.b_ub, -order[1]),
            sparse.hstack(
                [own.A_eq, sparse.csr_array(np.column_stack([eq for _, eq in slopes]) * size)]
            ).tocsr(),
            own.b_eq,
        )  # fmt: skip
        best = limits.solved(np.vstack([self._bounds(), ends / size[:, None]]))
        return None if best is None else best[self.columns :] * size

    def _broken(self, found: Vector, P: float, allowed: float = 1e-4) -> NDArray[np.bool_]:
        """Steps between whose checks T goes above P or off the flank, or the torque above its curve."""
        step, s = self.instants(SIXTEENTHS)
        moved = self.moved(step, s)
        rows, constant = self.rows(step, self.T @ moved / self.U)
        T = rows @ found + constant
        rows, constant = self.rows(step, self.c * moved[:, Z] / self.U)
        kept = rows @ found + constant if self.pulls else T
        contact = np.array(self.kinds)[step] == "contact"
        over = np.abs(T) if self.pulls else T
        bad = contact & ((over > P * (1.0 + allowed)) | ((kept < -1e-9) & (step < self.steps)))
        for rows, right in self._under_curve(SIXTEENTHS):
            bad[step < self.steps] |= rows @ found > right
        broken: NDArray[np.bool_] = np.bincount(step, weights=bad, minlength=self.n)[: self.steps] > 0.0
        return broken
