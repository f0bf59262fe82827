"""Successive linear programs on the exact start of a chain: from a first demand down to a local optimum.

The demand is linear between knots. Its torques u move by du within a trust region; along the exact
sensitivities through all contacts the peak torque, the torques at many instants and the terminal condition
are linear in du, so that each step is a linear program (HiGHS):

    minimise    P + penalty * miss  over du, P, miss
    subject to  |T_k(t) + dT_k(t)/du du| <= P,  terminal condition up to `miss`
                lowest <= u + du <= highest,  |du| <= trust,  the demand no steeper than the rate limit

Of the rows only those that matter are in the program: it begins with the instants near the peak, thinned, and
takes in local maxima that its answer would let through. The step is then played exactly; what counts is the
located peak of that start. The trust region follows how far the program was right.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from softstart.arrays import Matrix, Vector
from softstart.errors import SimulationError
from softstart.optimal.chains.problem import ChainProblem, carried_loads, terminal_miss
from softstart.optimal.chains.starts import Answer, Played, Player
from softstart.optimal.lp.rows import Limits, Sparse
from softstart.profile import TorqueProfile

KNOTS_PER_PERIOD = 14
INSTANTS = 32  # of the fastest period, at which shaft torques are limited
PENALTY = 20.0  # of a miss, in mean torques for the whole of the target
FIRST_TRUST, MOST_TRUST, LEAST_TRUST = 0.1, 0.5, 1e-4  # of the highest torque
NEAR, LOW = 0.85, 0.5  # of the peak: rows that a program begins with; torques that are looked at
THIN = 64
ROUNDS = 6
LET_THROUGH = 1e-3  # of P
MOST_STEPS = 60
MISSED, DEAREST = 1e-5, 1e4
GOOD, POOR, ACCEPTED = 0.7, 0.3, 0.05  # share of the promised decrease that came true
NEWTON_STEPS = 6
TASTE = 6  # programs after which the best of several first demands are chosen
STRETCH, BUMPS, HEIGHT = 0.07, 8, 0.12  # of time; their number; of the highest torque
PROMISE = 0.1  # of the tolerance: a program that promises less ends the search
IN_VAIN = 0.06  # over the tolerance: searches in turn, each without a decrease by a fifth of it
HOPEFUL = 1.03  # merit over the best up to which a search is carried on


@dataclass(frozen=True, eq=False)
class Found:
    """A demand and its start: largest shaft torque, N m, and by how much the terminal condition is missed."""

    torques: Vector
    played: Played
    miss: Vector
    merit: float


class Search:
    """The search for one problem, on one grid of knots."""

    def __init__(self, problem: ChainProblem, player: Player, finer: int = 1) -> None:
        assert problem.start_time is not None
        self.problem, self.player = problem, player
        self.end = problem.start_time
        machine = player.rows.machine
        self.period = float(machine.period)
        self.until = self.end + self.period
        count = math.ceil(KNOTS_PER_PERIOD * finer * self.until / self.period)
        self.knots = np.linspace(0.0, self.until, max(count, 2) + 1)
        arrays = problem.drive.at_motor_shaft()
        stiff = arrays.c * (1.0 / arrays.J[:-1] + 1.0 / arrays.J[1:])
        self.step = min(2.0 * math.pi / math.sqrt(float(stiff.max())) / INSTANTS, float(self.knots[1]))
        self.low, self.high = problem.lowest_torque, problem.highest_torque
        self.rate = float(machine.rate)
        self.initial = float(machine.initial_torque)
        self.load = problem.drive.load_index
        self.penalty = PENALTY

    # demands -----------------------------------------------------------------------------------------------

    def sampled(self, time: Vector, torque: Vector) -> Vector:
        """A torque over rising times as torques at the knots: its mean around each knot."""
        area = np.concatenate([[0.0], np.cumsum(0.5 * (torque[1:] + torque[:-1]) * np.diff(time))])
        half = 0.5 * float(self.knots[1])
        left = np.clip(self.knots - half, 0.0, time[-1])
        right = np.clip(self.knots + half, 0.0, time[-1])
        width = right - left
        means = np.diff([np.interp(left, time, area), np.interp(right, time, area)], axis=0)[0]
        u = np.where(width > 1e-3 * half, means / np.maximum(width, 1e-300), torque[-1])
        return self.allowed(u)

    def allowed(self, torques: Vector) -> Vector:
        """The torques within the limits of torque and rate."""
        u = np.clip(torques, self.low, self.high)
        if math.isfinite(self.rate):
            most = self.rate * np.diff(self.knots)
            u[0] = self.initial
            for i, rise in enumerate(most):
                u[i + 1] = np.clip(u[i + 1], u[i] - rise, u[i] + rise)
        return u

    def profile(self, torques: Vector) -> TorqueProfile:
        """The demand with these torques at the knots."""
        return TorqueProfile(self.knots, torques)

    def play(self, torques: Vector) -> Found | None:
        """The exact start; None if it cannot be finished."""
        try:
            played = self.player.play(self.profile(torques), self.until)
        except SimulationError:
            return None
        state = played.recorded.at([self.end])
        miss = terminal_miss(self.problem, state["w"][0], state["T"][0])
        merit = played.peak + self.penalty * self.problem.base_torque * float(miss.sum())
        return Found(torques, played, miss, merit)

    # one program -------------------------------------------------------------------------------------------

    def descended(self, torques: Vector, steps: int = MOST_STEPS, least: float = 1e-3) -> Found | None:
        """Down from a first demand, until a program promises a smaller decrease than the share `least`.

        Where the terminal condition is missed at last, missing it costs more: near the shortest start time.
        """
        found = self._down(torques, steps, least)
        while found is not None and steps == MOST_STEPS and self.penalty < DEAREST:
            if found.miss.max() <= MISSED:
                break
            self.penalty *= 10.0
            found = self._down(found.torques, steps, least)
        self.penalty = PENALTY
        return found

    def _down(self, torques: Vector, steps: int, least: float) -> Found | None:
        found = self.play(torques)
        trust = FIRST_TRUST * self.high
        for _ in range(steps):
            if found is None:
                return None
            model = _Model.of(self, found)
            while True:
                step = model.step(trust)
                if step is None:
                    return found
                change, promised = step
                if promised < least * found.merit and trust > LEAST_TRUST * self.high:
                    wider = self.play(self.allowed(found.torques + change))
                    return wider if wider is not None and wider.merit < found.merit else found
                tried = self.play(self.allowed(found.torques + change))
                came = -1.0 if tried is None else (found.merit - tried.merit) / promised
                if tried is not None and came > ACCEPTED:
                    found = tried
                    factor = 2.0 if came > GOOD else 0.5 if came < POOR else 1.0
                    trust = min(factor * trust, MOST_TRUST * self.high)
                    break
                trust *= 0.3
                if trust < LEAST_TRUST * self.high:
                    return found
        return found

    def beyond(self, found: Found, tolerance: float, until: float) -> Found:
        """Local optima around one: its demand stretched in time, or with bumps, and down from there.

        It begins at the best so far each time, and ends when several in turn were no better, 12 for a
        tolerance of 0.5 %, or at `until` (`time.perf_counter`).
        """
        least = PROMISE * tolerance
        rng, vain, stretched = np.random.default_rng(1), 0, True
        while vain < IN_VAIN / tolerance and time.perf_counter() < until:
            if stretched:
                far = self.knots * rng.uniform(1.0 - STRETCH, 1.0 + STRETCH)
                torques = np.interp(far, self.knots, found.torques)
            else:
                bumps = rng.normal(0.0, HEIGHT * self.high, BUMPS)
                even = np.linspace(0.0, self.until, BUMPS)
                torques = found.torques + np.interp(self.knots, even, bumps)
            stretched = not stretched
            down = self.descended(self.allowed(torques), TASTE, least)
            if down is not None and down.merit < HOPEFUL * found.merit:
                down = self.descended(down.torques, least=least)
                down = None if down is None else self.finished(down)
            vain += 1
            if down is not None and down.miss.max() <= MISSED and down.merit < found.merit:
                vain = 0 if down.merit < (1.0 - 0.2 * tolerance) * found.merit else vain
                found = down
        return found

    def finished(self, found: Found, reserve: float = 1e-9) -> Found | None:
        """The same with the terminal condition met to rounding: smallest changes of the torques that do."""
        for _ in range(NEWTON_STEPS):
            wanted = np.maximum(found.miss, 0.0)
            if wanted.max() <= (0.0 if self.problem.terminal == "reached" else 1e-10):
                return found
            answer = found.played.answer([], [self.end])
            rows, missing = self.terminal_rows(found.played, answer)
            if self.problem.terminal == "reached":
                missing = missing + reserve
            low, high = self.low - found.torques, self.high - found.torques
            free = (high - low) > 0.0
            if math.isfinite(self.rate):
                free[0] = False
            room = lsq_linear(
                np.vstack([1e4 * rows[:, free], 1e-6 * np.eye(int(free.sum())) / self.high]),
                np.concatenate([1e4 * missing, np.zeros(int(free.sum()))]),
                bounds=(np.minimum(low[free], -1e-12), np.maximum(high[free], 1e-12)),
                method="bvls",  # an interior method pushes torques off their limits before it begins
            )
            change = np.zeros(found.torques.size)
            change[free] = room.x
            again = self.play(self.allowed(found.torques + change))
            if again is None:
                return None
            found = again
        return found

    def terminal_rows(self, played: Played, answer: Answer) -> tuple[Matrix, Vector]:
        """Rows of what must rise by how much at t_f, in shares of the target and of the mean torque."""
        target = self.problem.target
        state = played.recorded.at([self.end])
        w, T = state["w"], state["T"]
        if self.problem.terminal == "reached":
            return answer.speeds[0, [self.load]] / target, 1.0 - w[0, [self.load]] / target
        rows, missing = answer.speeds[0] / target, 1.0 - w[0] / target
        if self.problem.terminal == "steady":
            base = self.problem.base_torque
            arrays = self.problem.drive.at_motor_shaft()
            closed = (T[0] != 0.0).astype(float)[:, None]
            twisting = closed * arrays.c[:, None] * answer.twists[0]
            twisting += closed * arrays.d[:, None] * -np.diff(answer.speeds[0], axis=0)
            rows = np.vstack([rows, twisting / base])
            missing = np.concatenate([missing, (carried_loads(self.problem) - T[0]) / base])
        return rows, missing


@dataclass(frozen=True, eq=False)
class _Model:
    """The linear model of a start: rows of |T| over instants in order, shaft after shaft."""

    search: Search
    found: Found
    rows: Matrix
    torques: Vector
    edges: Vector  # whether row i does not continue row i - 1; one more for the end
    terminal: Matrix
    missing: Vector

    @classmethod
    def of(cls, search: Search, found: Found) -> _Model:
        """The model at a start."""
        times = found.played.instants(search.step)
        T = found.played.recorded.at(times)["T"]
        seen = np.flatnonzero(np.abs(T).max(axis=1) > LOW * found.played.peak)
        answer = found.played.answer(times[seen], [search.end])
        T = T[seen]
        j, k = np.nonzero(T)
        order = np.lexsort((j, k))
        j, k = j[order], k[order]
        apart = (np.diff(k) != 0) | (np.diff(seen[j]) != 1)
        edges = np.concatenate([[True], apart, [True]])
        rows = np.sign(T[j, k])[:, None] * answer.torques[j, k]
        terminal, missing = search.terminal_rows(found.played, answer)
        return cls(search, found, rows, np.abs(T[j, k]), edges, terminal, missing)

    def peaks(self, values: Vector) -> NDArray[np.bool_]:
        """Which rows are local maxima over time."""
        left = np.where(self.edges[:-1], -np.inf, np.concatenate([[-np.inf], values[:-1]]))
        right = np.where(self.edges[1:], -np.inf, np.concatenate([values[1:], [-np.inf]]))
        return np.asarray((values >= left) & (values >= right))

    def step(self, trust: float) -> tuple[Vector, float] | None:
        """The change of the torques within the trust region, and the decrease that it promises."""
        search, found = self.search, self.found
        base, count = search.problem.base_torque, found.torques.size
        both = search.problem.terminal != "reached"
        misses = self.missing.size
        low = np.maximum(-trust, search.low - found.torques).clip(max=0.0)
        high = np.minimum(trust, search.high - found.torques).clip(min=0.0)
        if math.isfinite(search.rate):
            low[0] = high[0] = 0.0
        miss = np.eye(misses)
        fixed, limits = [np.hstack([-self.terminal, np.zeros((misses, 1)), -miss])], [-self.missing]
        if both:
            fixed.append(np.hstack([self.terminal, np.zeros((misses, 1)), -miss]))
            limits.append(self.missing)
        rows = [Sparse.dense(one) for one in fixed]
        if math.isfinite(search.rate):
            k, ones = np.arange(count - 1), np.ones(count - 1)
            rise = Sparse.of(count - 1, np.concatenate([k, k + 1]), np.concatenate([-ones, ones]))
            most, now = search.rate * np.diff(search.knots), np.diff(found.torques)
            rows += [rise, -1.0 * rise]
            limits += [most - now, most + now]
        cost = np.concatenate([np.zeros(count), [1.0], np.full(misses, search.penalty * base)])
        bounds = np.column_stack([
            np.concatenate([low, np.zeros(1 + misses)]), np.concatenate([high, np.full(1 + misses, np.inf)]),
        ])  # fmt: skip
        every = np.arange(0, self.torques.size, THIN)
        looked_at = np.union1d(np.flatnonzero(self.peaks(self.torques)), every)
        active = looked_at[self.torques[looked_at] > NEAR * found.played.peak]
        for _ in range(ROUNDS):
            shafts = Sparse.dense(np.hstack([self.rows[active], -np.ones((active.size, 1))]))
            solved = Limits(
                cost, Sparse.stacked([shafts, *rows]), np.concatenate([-self.torques[active], *limits]),
                Sparse.stacked([]), np.zeros(0),
            ).solved(bounds, interior=True)  # fmt: skip
            if solved is None:
                return None
            change, P, promised = solved.x[:count], float(solved.x[count]), found.merit - solved.cost
            after = self.torques + self.rows @ change
            over = np.flatnonzero((after > P * (1.0 + LET_THROUGH)) & self.peaks(after))
            new = np.setdiff1d(over, active, assume_unique=True)
            if new.size == 0:
                break
            active = np.append(active, new)
        return change, promised
