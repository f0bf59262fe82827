"""From a first demand down to a local optimum: successive linear programs on the exact start.

The demand u(t) is linear between knots; two knots at one instant are a step. For torques u_q at the knots the
exact start of each machine gives the torques T_k(t) of all its shafts, the state x(t_f) at the end, and how
they answer to the knots, exactly and through all contacts (`softstart.kernel.sensitivity`). To first order in
a change v of the torques and h of the end t_f the problem is a linear program over v, h, the largest torque P
and what is missed, m >= 0:

    minimise    objective + penalty * sum of m + calm * sum of |u_(q+1) + v_(q+1) - u_q - v_q|
    peak        |T_k(t) + (dT_k/du + T_k' dt/du) v| <= P       for all machines, shafts, t <= t_f + period
    terminal    x(t_f) + dx/du v + x'(t_f) h = wanted, up to m    (reached: the load speed, >=)
    limits      lowest <= u_q + v_q <= highest,  |u_(q+1) + v_(q+1) - u_q - v_q| <= rate * (t_(q+1) - t_q)
    curve       r(t) + dr/du v <= a + b (w + dw/du v) + m         r the realised torque, w the motor speed
    heat        H + dH/du v + r(t_f)^2 h <= bound + m
    trust       |v_q| <= trust, |h| <= share of t_f,  t_f + h <= start_time

    objective   P (k_dyn), or H + dH/du v + v' G'G v (heat: a square, as the realised torque is linear in the
                demand); smoothness adds its square. A square lies above tangent planes, added until near

The instants of the peaks keep their place between the contacts and move with them, by dt/du v
(`DemandRun.along_contacts`): where a contact comes later, the torque after it does too. At fixed instants the
program would be wrong beside each contact, and descents stall.

CasADi hands the program to HiGHS. Of the rows of peaks and of the curve only those that matter are in it: it
begins with the instants near the peak, thinned, and takes in local maxima that its answer would let through.
The step is then run exactly; what counts is the merit of that start, its objective with its located peak plus
penalty times what it misses. The terminal condition is curved, and long steps along its tangent would all be
refused (Maratos effect): one that would be refused and misses it is corrected first, by the smallest changes
that lead to it (second-order correction; R. Fletcher, Practical Methods of Optimization, 1987, 14.4). The
trust region follows how far the program was right. Where the terminal condition stays missed, that costs
ten times as much, and so on.

Knots: even ones and those of the first demand; then intervals beside bends of the torque are halved, a few
times. Last, the smallest changes that meet the terminal condition to rounding (Newton).

Successive linear programming: R. Fletcher, E. Sainz de la Maza, Math. Prog. 43 (1989) 235-256.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softstart.arrays import Matrix, Vector
from softstart.errors import SimulationError
from softstart.optimal.problem import Problem
from softstart.optimal.starts import DemandRun, DemandSimulator, steady_shaft_torques, wanted
from softstart.profile import TorqueProfile

KNOTS = 14  # in an elastic period
MOST_KNOTS, MANY = 160, 150  # even ones; of a long start
APART = 0.4  # of their distance, which they keep from knots that are known, so that these do not add up
BEND = 1e-3  # of the largest torque: what is kept of the knots of an answer
INSTANTS = 32  # of the fastest period, at which torques are limited
PENALTY, DEAR, DEAREST = 20.0, 2e3, 1e5  # of what is missed, as shares, beside the objective as a share
FIRST_TRUST, MOST_TRUST, LEAST_TRUST = 0.1, 0.5, 1e-4  # of the highest torque
NEAR, THIN = 0.85, 3  # share of the peak from which rows are in a program; one of so many of them
ROUNDS, CUTS, LET_THROUGH = 12, 12, 0.1  # of taking in rows; by what share of the decrease
STEPS, INTO = 60, 16
GOOD, POOR, ACCEPTED = 0.7, 0.3, 0.05  # share of the promised decrease that came true
REFUSED = 0.3  # by what a step that is refused narrows the trust region
MISSED = 1e-5
CORRECTED = 2  # Newton steps towards the terminal condition, before a step that misses it is refused
NARROW = 3e-3  # trust from which on tangent planes are as good as their square
TASTE, HOPEFUL = 8, 1.03  # steps from a demand around, and the merit up to which it is followed on
STRETCH, BUMPS, HEIGHT = 0.15, 10, 0.15  # of time; their number; of the highest torque
CLOSE = 0.25  # of the highest torque below the torque-speed curve: looked at
BETWEEN = 5e-5  # of the highest torque: kept from the curve for what happens between the instants
CURVE_TOLERANCE = 1e-4  # of a step, by which the torque may lie beyond the curve in a program
IN_LAG = 0.04  # of a torque lag, between instants at which a curve limits the torque
FARTHEST = 0.2  # of t_f, that it moves in a step
CALM = 1e-5  # weight of the total variation of the torque, in highest torques
JUMP, HALVED = 0.04, 32  # bend of the torque, in highest torques, beside which intervals are halved; so many


@dataclass(frozen=True, eq=False)
class Candidate:
    """A demand, the exact starts under it, and how good they are."""

    torques: Vector
    end: float  # t_f, s; where only the load is to reach its speed the latest of `ends`
    ends: tuple[float, ...]  # t_f of each machine
    starts: tuple[DemandRun, ...]
    peak: float  # of all shafts, machines and instants, N m
    missing: Vector  # what the terminal quantities of all machines lack, as shares; below 0 a surplus
    lacking: Vector  # the same as far as it counts
    beyond: float  # above the torque-speed curve, as a share of the highest torque
    over: float  # above the bounds on K_dyn and heat, as a share of them
    heat: float  # s
    objective: float  # as a share of its scale
    merit: float

    @property
    def missed(self) -> float:
        """The largest share by which a condition is missed."""
        return max(float(self.lacking.max(initial=0.0)), self.beyond, 0.02 * self.over)


class Descent:
    """The descents of one problem; `time` are the knots in s, at which the torques of a demand stand."""

    def __init__(self, problem: Problem, players: Sequence[DemandSimulator] | None = None) -> None:
        assert problem.start_time is not None
        self.problem = problem
        self.players = tuple(players or map(DemandSimulator, problem.machines))
        self.latest = problem.start_time  # t_f at most
        self.period = max(player.period for player in self.players)
        self.until = self.latest + self.period
        self.fastest = min(player.fastest for player in self.players)
        self.low, self.high, self.base = problem.lowest_torque, problem.highest_torque, problem.base_torque
        machines = [player.rows.machine for player in self.players]
        self.rate = min(float(one.rate) for one in machines)
        self.initial = float(machines[0].initial_torque)
        self.step = min(self.fastest / INSTANTS, self.latest / 24)  # of instants at which T is limited
        lags = [float(one.lag) for one in machines if one.lag > 0.0]
        self.curve_step = max(min([0.15 * self.step, *(IN_LAG * lag for lag in lags)]), 2e-5 * self.latest)
        self.starts_at_initial = math.isfinite(self.rate) or problem.smoothness > 0.0
        stiff = self.players[0].mean_torque(self.latest) / problem.starting_torque
        self.scale = self.base if problem.minimise == "k_dyn" else stiff * stiff * self.latest
        self.penalty, self.fine = PENALTY, 1e-5
        self.apart = 1e-3  # of the distance of even knots, which keep so far from those of a demand
        count = min(max(math.ceil(KNOTS * self.until / self.period), 24), MOST_KNOTS)
        self.even = np.linspace(0.0, self.until, count + 1)
        self.time = self.even

    # demands -----------------------------------------------------------------------------------------------

    def onto(self, profile: TorqueProfile) -> Vector:
        """Take the knots of a demand, and even ones not near to them, as the grid; its torques there."""
        keep = profile.time < self.until
        when = profile.time[keep]
        far = np.abs(self.even[:, None] - when).min(axis=1, initial=math.inf) > self.apart * self.even[1]
        far[-1] = True
        far[0] = when.size == 0 or when[0] > 0.0
        new = self.even[far]
        if self.starts_at_initial:  # no steps
            self.time = np.unique(np.concatenate([new, when]))
            return self.allowed(profile.at(self.time))
        time = np.concatenate([when, new])
        torque = np.concatenate([profile.torque[keep], profile.at(new)])
        order = np.argsort(time, kind="stable")
        self.time = time[order]
        return self.allowed(torque[order])

    def averaged(self, time: Vector, torque: Vector) -> TorqueProfile:
        """A torque over rising times as a demand over the even knots: its mean around each of them."""
        area = np.concatenate([[0.0], np.cumsum(0.5 * (torque[1:] + torque[:-1]) * np.diff(time))])
        half = 0.5 * float(self.even[1])
        left = np.clip(self.even - half, 0.0, time[-1])
        right = np.clip(self.even + half, 0.0, time[-1])
        width = right - left
        means = np.diff([np.interp(left, time, area), np.interp(right, time, area)], axis=0)[0]
        u = np.where(width > 1e-3 * half, means / np.maximum(width, 1e-300), torque[-1])
        return TorqueProfile(self.even, np.clip(u, self.low, self.high))

    def allowed(self, torques: Vector) -> Vector:
        """The torques within the limits of torque and rate."""
        u = np.clip(torques, self.low, self.high)
        if self.starts_at_initial:
            u[0] = min(max(self.initial, self.low), self.high)
        if math.isfinite(self.rate):
            for i, rise in enumerate(self.rate * np.diff(self.time)):
                u[i + 1] = np.clip(u[i + 1], u[i] - rise, u[i] + rise)
        return u

    def play(self, torques: Vector, end: float) -> Candidate | None:
        """The exact starts under a demand whose start ends at `end`; None if one cannot be finished."""
        profile = TorqueProfile(self.time, torques)
        reached = self.problem.terminal == "reached"
        try:
            starts, ends = [], []
            for one in self.players:
                start = one.play(profile, (self.latest if reached else end) + one.period)
                at = start.reached(one.target, self.latest, one.load) if reached else end
                if reached and at + one.period < self.latest:
                    start = one.play(profile, at + one.period)
                starts.append(start)
                ends.append(at)
        except SimulationError:
            return None
        end = max(ends)
        problem = self.problem
        peak = max(one.peak for one in starts)
        missing = np.concatenate(
            [self._missing(*each) for each in zip(self.players, starts, ends, strict=True)]
        )
        beyond = (
            max(0.0, *(self._beyond(*pair) for pair in zip(self.players, starts, strict=True)))
            if problem.torque_speed
            else 0.0
        )
        heat = 0.0
        if problem.minimise == "heat" or problem.heat is not None:
            times, weights = starts[0].quadrature(end)
            u = starts[0].trajectory.at(times)["u"] / problem.starting_torque
            heat = float(weights @ (u * u))
        objective = (peak if problem.minimise == "k_dyn" else heat) / self.scale
        objective += self._roughness(torques)
        lacking = np.maximum(missing, 0.0) if problem.terminal == "reached" else np.abs(missing)
        over = max(peak / (problem.k_dyn * self.base) - 1.0, 0.0) if problem.k_dyn else 0.0
        over += max(heat / problem.heat - 1.0, 0.0) if problem.heat else 0.0
        cost = float(lacking.sum()) + beyond + over
        return Candidate(
            torques,
            end,
            tuple(ends),
            tuple(starts),
            peak,
            missing,
            lacking,
            beyond,
            over,
            heat,
            objective,
            objective + self.penalty * cost,
        )

    def _missing(self, player: DemandSimulator, start: DemandRun, end: float) -> Vector:
        state = start.trajectory.at([end])
        lacking: Vector = 1.0 - state["w"][0] / player.target
        if self.problem.terminal == "reached":
            return lacking[[player.load]]
        if self.problem.terminal == "steady":
            own = steady_shaft_torques(player.rows)
            T, aim = state["T"][0], wanted(own, self.base, player.motor)
            open_too = (T == 0.0) & (np.abs(own) < np.abs(aim))  # flanks apart carry nothing either
            lacking = np.concatenate([lacking, np.where(open_too, 0.0, aim - T) / self.base])
        return lacking

    def _beyond(self, player: DemandSimulator, start: DemandRun) -> float:
        """By how much the realised torque exceeds the curve at worst, as a share of the highest torque."""
        times = start.instants(self.curve_step)
        state = start.trajectory.at(times)
        return max(float(self.above(state["u"], state["w"][:, player.motor]).max()), 0.0)

    def above(self, u: Vector, w: Vector) -> Vector:
        """By how much motor torques lie above the curve at these speeds, as shares of the highest torque."""
        lines = self.lines()
        found: Vector = (u - (lines[:, :1] + lines[:, 1:] * w).min(axis=0)) / self.high + BETWEEN
        return found

    def lines(self) -> Matrix:
        """The torque-speed curve as straight lines a + b w: rows (a, b)."""
        corners = np.array(self.problem.torque_speed)
        slope = np.diff(corners[:, 1]) / np.diff(corners[:, 0])
        return np.column_stack([corners[:-1, 1] - slope * corners[:-1, 0], slope])

    def _roughness(self, torques: Vector) -> float:
        calm = CALM * float(np.abs(np.diff(torques)).sum()) / self.high
        if self.problem.smoothness == 0.0:
            return calm
        step = np.diff(torques) / self.problem.starting_torque
        return calm + self.problem.smoothness * float((step * step / np.diff(self.time)).sum())

    # descents ----------------------------------------------------------------------------------------------

    def down(
        self, profile: TorqueProfile, end: float, steps: int = STEPS, least: float = 1e-4
    ) -> Candidate | None:
        """Down from a first demand, until a program promises less than the share `least`.

        Where a condition is missed after all steps, missing it costs more: near the shortest start time.
        """
        found = self._down(self.onto(profile), end, steps, least)
        while found is not None and steps == STEPS and found.missed > MISSED and self.penalty < DEAREST:
            self.penalty *= 10.0
            found = self._down(found.torques, found.end, steps, least)
        self.penalty = PENALTY
        return found

    def into(self, profile: TorqueProfile, end: float) -> Candidate | None:
        """Down with missing a condition dear from the beginning: whether a start misses none."""
        self.penalty = DEAR
        found = self._down(self.onto(profile), end, INTO, 1e-3)
        self.penalty = PENALTY
        return found

    def refined(self, found: Candidate, times: int = 4, least: float = 3e-5) -> Candidate:
        """The same on finer grids, where the torque changes much between two knots."""
        for _ in range(times):
            width = np.diff(self.time)
            slope = np.diff(found.torques) / np.maximum(width, 1e-12 * self.until)
            bend = np.abs(np.diff(slope)) * np.maximum(width[1:], width[:-1])
            beside = np.maximum(np.append(bend, 0.0), np.append([0.0], bend))
            beside[width <= 1e-4 * self.period] = 0.0
            most = max(np.sort(beside)[-HALVED:][0], JUMP * self.high) if beside.size else math.inf
            halved = np.flatnonzero(beside >= most)
            if halved.size == 0:
                break
            middle = 0.5 * (self.time[halved] + self.time[halved + 1])
            mean = 0.5 * (found.torques[halved] + found.torques[halved + 1])
            time, torque = (
                np.insert(self.time, halved + 1, middle),
                np.insert(found.torques, halved + 1, mean),
            )
            self.time = time
            finer = self._down(torque, found.end, STEPS // 2, least)
            if finer is None:
                break
            gained, found = found.merit - finer.merit, finer
            if gained < least * found.merit:
                break
        return found

    def around(self, found: Candidate, tries: int) -> Candidate:
        """The best of local optima around one: its demand stretched in time, or with bumps, and down again.

        It begins at the best so far each time; the random numbers are the same each time.
        """
        rng = np.random.default_rng(1)
        min_knot_spacing = self.apart
        for number in range(tries):
            kept, many = self.time, self.even.size > MANY  # else the knots of a long start double each time
            self.apart = APART if many else min_knot_spacing
            known = TorqueProfile(self.time, found.torques).simplified(BEND if many else 1e-9)
            if number % 2 == 0:
                demand = TorqueProfile(known.time * rng.uniform(1.0 - STRETCH, 1.0 + STRETCH), known.torque)
            else:
                time = np.union1d(known.time, self.even)
                bumps = rng.normal(0.0, HEIGHT * self.high, BUMPS)
                torque = known.at(time) + np.interp(time, np.linspace(0.0, self.until, BUMPS), bumps)
                demand = TorqueProfile(time, np.clip(torque, self.low, self.high))
            down = self.down(demand, self.latest, TASTE, 1e-3)
            if down is not None and down.merit < HOPEFUL * found.merit:
                down = self._down(down.torques, down.end, STEPS, 1e-3)
            if down is not None and down.missed <= MISSED and down.merit < found.merit:
                found = down
            else:
                self.time = kept
        self.apart = min_knot_spacing
        return found

    def _down(self, torques: Vector, end: float, steps: int, least: float) -> Candidate | None:
        found = self.play(torques, end)
        trust, self.fine = FIRST_TRUST, LET_THROUGH * least
        for _ in range(steps):
            if found is None:
                return None
            model = Model.of(self, found)
            better = None
            while better is None:
                if trust < LEAST_TRUST:
                    return found
                step = model.step(trust)
                if step is None:
                    trust *= REFUSED
                    continue
                change, later, promised = step
                tried = self.play(self.allowed(found.torques + change), min(found.end + later, self.latest))
                gained = -math.inf if tried is None else found.merit - tried.merit
                if tried is not None and gained <= ACCEPTED * promised and tried.missed > MISSED:
                    nearer = self.finished(tried, rounds=CORRECTED)
                    if nearer is not None and nearer.merit < tried.merit:
                        tried, gained = nearer, found.merit - nearer.merit
                if promised < least * found.merit and not (model.squares and trust > NARROW):
                    return tried if tried is not None and gained > 0.0 else found
                if gained > ACCEPTED * promised:
                    better, share = tried, gained / promised
                    trust *= 2.0 if share > GOOD else 0.5 if share < POOR else 1.0
                else:
                    trust *= REFUSED
            found, trust = better, min(trust, MOST_TRUST)
        return found

    def finished(self, found: Candidate, reserve: float = 1e-8, rounds: int = 8) -> Candidate | None:
        """The same with the terminal condition met to rounding, by the smallest changes of the torques."""
        from scipy.optimize import lsq_linear

        reached = self.problem.terminal == "reached"
        for _ in range(rounds):
            if found.lacking.max() <= (0.0 if reached else 1e-10):
                return found
            rows, _ = terminal_rows(self, found)
            missing = np.where(found.lacking > 0.0, found.missing + (reserve if reached else 0.0), 0.0)
            low, high = self.low - found.torques, self.high - found.torques
            free = (high - low) > 0.0
            if self.starts_at_initial:
                free[0] = False
            count = int(free.sum())
            room = lsq_linear(
                np.vstack([1e4 * rows[:, free], 1e-6 * np.eye(count) / self.high]),
                np.concatenate([1e4 * missing, np.zeros(count)]),
                bounds=(np.minimum(low[free], -1e-12), np.maximum(high[free], 1e-12)),
                method="bvls",  # an interior method pushes torques off their limits before it begins
            )
            change = np.zeros(found.torques.size)
            change[free] = room.x
            again = self.play(self.allowed(found.torques + change), found.end)
            if again is None:
                return None
            found = again
        return found


def terminal_rows(search: Descent, found: Candidate) -> tuple[Matrix, Vector]:
    """By how much each terminal quantity rises, as a share, with each torque, and with t_f."""
    rows, rates = [], []
    for player, start, end in zip(search.players, found.starts, found.ends, strict=True):
        answer = start.state_by_demand([end])[0]
        joints, beside = player.joints, 1e-5 * player.period
        at = start.trajectory.at([end - beside, end, end + beside])
        w = answer[joints:-1] / player.target
        rate = (at["w"][2] - at["w"][0]) / (2.0 * beside * player.target)
        if search.problem.terminal == "reached":
            w, rate = w[[player.load]], rate[[player.load]]
        if search.problem.terminal == "steady":
            closed = (at["T"][1] != 0.0).astype(float)
            w = np.vstack([w, player.twisting(closed, answer) / search.base])
            rate = np.concatenate([rate, (at["T"][2] - at["T"][0]) / (2.0 * beside * search.base)])
        rows.append(w)
        rates.append(rate)
    return np.vstack(rows), np.concatenate(rates)


class Program:
    """A linear program: rows `least <= row x <= most`, as compressed rows one after the other."""

    def __init__(self, columns: int) -> None:
        self.columns = columns
        self.values: list[Vector] = []
        self.places: list[NDArray[np.int64]] = []
        self.lengths: list[NDArray[np.int64]] = []
        self.least: list[Vector] = []
        self.most: list[Vector] = []

    def add(self, parts: Mapping[int, Matrix], most: Any, least: Any = -math.inf) -> None:
        """Rows by their parts: the first column of each, and a full matrix."""
        blocks = list(parts.values())
        whole = np.hstack(blocks)
        columns = np.concatenate([np.arange(at, at + one.shape[1]) for at, one in parts.items()])
        used = whole != 0.0
        self.values.append(whole[used])
        self.places.append(np.broadcast_to(columns, whole.shape)[used])
        self.lengths.append(used.sum(axis=1))
        self.most.append(np.broadcast_to(most, whole.shape[:1]))
        self.least.append(np.broadcast_to(least, whole.shape[:1]))

    def drop(self, kept: int) -> None:
        """Leave out all but the first `kept` additions."""
        for one in (self.values, self.places, self.lengths, self.least, self.most):
            del one[kept:]

    def solved(self, cost: Vector, low: Vector, high: Vector) -> Vector | None:
        """The best x by HiGHS; None where it finds none."""
        import casadi as ca
        from scipy.sparse import csr_array

        ends = np.concatenate([[0], np.cumsum(np.concatenate(self.lengths))])
        rows = (np.concatenate(self.values), np.concatenate(self.places), ends)
        whole = csr_array(rows, shape=(ends.size - 1, self.columns)).tocsc()
        pattern = ca.Sparsity(*whole.shape, whole.indptr.tolist(), whole.indices.tolist())  # type: ignore[call-overload]
        most = 20 * self.columns  # of iterations: a few programs never end
        highs: Any = {"output_flag": False, "presolve": "off", "simplex_iteration_limit": most}
        solver = ca.conic(
            "step", "highs", {"a": pattern, "h": ca.Sparsity(self.columns, self.columns)},
            {"highs": highs, "error_on_fail": False},
        )  # fmt: skip
        lower, upper = np.concatenate(self.least), np.concatenate(self.most)
        try:
            out = solver(g=cost, a=ca.DM(pattern, whole.data), lba=lower, uba=upper, lbx=low, ubx=high)
        except RuntimeError:  # HiGHS gives up
            return None
        return np.array(out["x"]).ravel() if solver.stats()["success"] else None


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

    def cut(self, program: Program, change: Vector, h: int, at: int) -> None:
        """The tangent plane at a change: column `at` lies above it; h is in the column after `h`."""
        r = self.G @ change + self.g
        row = 2.0 * (self.G.T @ r)
        parts = {0: row[None], h + 1: np.full((1, 1), self.rate), at: -np.ones((1, 1))}
        program.add(parts, float(row @ change) - float(r @ r))


@dataclass(frozen=True, eq=False)
class Model:
    """The linear model of the starts under a demand."""

    search: Descent
    found: Candidate
    shafts: Watched  # |T| of all shafts and machines, as shares of the base torque
    curve: Watched  # realised torque above the torque-speed curve, as shares of the highest torque
    terminal: Matrix
    rates: Vector
    squares: tuple[Square, ...]
    cuts: list[Vector]  # where squares have tangent planes

    @classmethod
    def of(cls, search: Descent, found: Candidate) -> Model:
        """The model at a demand."""
        problem, count = search.problem, found.torques.size
        shafts, curve = [], []
        for player, start in zip(search.players, found.starts, strict=True):
            times = start.with_peaks(start.instants(search.step))
            state = start.trajectory.at(times)
            shafts.append(_of_shafts(search, start, times, state["T"]))
            if problem.torque_speed:
                times = start.instants(search.curve_step)
                state = start.trajectory.at(times)
                w = state["w"][:, player.motor]
                near = np.flatnonzero(search.above(state["u"], w) > -CLOSE)
                by = start.state_by_demand(times[near])
                for a, b in search.lines():
                    over = (state["u"] - a - b * w)[near] / search.high + BETWEEN
                    rows = by[:, -1] - b * by[:, player.joints + player.motor]
                    curve.append((rows, over, np.append([True], np.diff(near) != 1)[: near.size]))
        terminal, rates = terminal_rows(search, found)
        squares = []
        if problem.minimise == "heat" or problem.heat is not None:
            times, weights = found.starts[0].quadrature(found.end)
            share = np.sqrt(weights) / problem.starting_torque
            by = found.starts[0].state_by_demand(times)[:, -1] * (share * search.high)[:, None]
            u = found.starts[0].trajectory.at(times)["u"] * share
            last = float(found.starts[0].trajectory.at([found.end])["u"][0]) / problem.starting_torque
            cost = 1.0 / search.scale if problem.minimise == "heat" else 0.0
            squares.append(Square(by, u, last * last * found.end, cost, problem.heat))
        if problem.smoothness > 0.0:
            size = math.sqrt(problem.smoothness) * search.high / problem.starting_torque
            D = np.diff(np.eye(count), axis=0) * (size / np.sqrt(np.diff(search.time)))[:, None]
            squares.append(Square(D, D @ (found.torques / search.high), 0.0, 1.0, None))
        return cls(
            search, found, Watched.of(shafts, count), Watched.of(curve, count), terminal * search.high,
            rates * found.end, tuple(squares), [np.zeros(count)],
        )  # fmt: skip

    def step(self, trust: float) -> tuple[Vector, float, float] | None:
        """The change of the torques and of t_f in the trust region, and the decrease that it promises.

        The columns of the program: torques as shares of the highest, largest torque P as share of the base,
        h as share of t_f, what is missed (terminal, curve, k_dyn, heat), and the steps of the torque.
        """
        search, found, problem = self.search, self.found, self.search.problem
        count, misses = found.torques.size, self.terminal.shape[0]
        P, h, missed = count, count + 1, count + 2
        curve = missed + misses
        k_dyn, heat, steps = curve + 1, curve + 2, curve + 3
        size = steps + count - 1 + len(self.squares)
        u = found.torques / search.high
        lower, upper = np.zeros(size), np.full(size, np.inf)
        lower[:count] = np.maximum(-trust, search.low / search.high - u).clip(max=0.0)
        upper[:count] = np.minimum(trust, 1.0 - u).clip(min=0.0)
        if search.starts_at_initial:
            lower[0] = upper[0] = 0.0
        lower[h] = -min(trust, FARTHEST)
        upper[h] = max(min(-lower[h], search.latest / found.end - 1.0), 0.0)
        cost = np.concatenate([
            np.zeros(missed), np.full(misses + 3, search.penalty), np.full(count - 1, CALM),
            [one.cost for one in self.squares],
        ])  # fmt: skip
        program, one = Program(cost.size), np.ones((1, 1))
        ends = self.rates[:, None]
        program.add({0: -self.terminal, h: -ends, missed: -np.eye(misses)}, -found.missing)
        if problem.terminal != "reached":
            program.add({0: self.terminal, h: ends, missed: -np.eye(misses)}, found.missing)
        rise, now, single = np.diff(np.eye(count), axis=0), np.diff(u), np.eye(count - 1)
        program.add({0: rise, steps: -single}, -now)
        program.add({0: rise, steps: single}, math.inf, -now)
        if math.isfinite(search.rate):
            most = search.rate / search.high * np.diff(search.time)
            program.add({0: rise}, most - now, -most - now)
        for at, square in enumerate(self.squares, start=steps + count - 1):
            if square.most is not None:
                program.add({heat: -square.most * one, at: one}, square.most)
        cost[P] = float(problem.minimise == "k_dyn")
        if problem.k_dyn is not None:
            program.add({P: one, k_dyn: -problem.k_dyn * one}, problem.k_dyn)
        x = self._solved(program, cost, lower, upper, curve)
        if x is None:
            return None
        promised = self._value(self._now(cost.size), cost) - self._value(x, cost)
        return x[:count] * search.high, float(x[h]) * found.end, promised

    def _solved(
        self, program: Program, cost: Vector, lower: Vector, upper: Vector, curve: int
    ) -> Vector | None:
        """The answer, with the rows of peaks and of the curve that matter taken in as they show."""
        count, kept = self.found.torques.size, len(program.values)
        peak = self.found.peak / self.search.base
        limited = self.search.problem.minimise == "k_dyn" or self.search.problem.k_dyn is not None
        shafts = self.shafts.first(NEAR * peak if limited else math.inf)
        over = self.curve.first(-0.2 * CLOSE)
        x = self._now(cost.size)
        for _ in range(CUTS if self.squares else ROUNDS):
            program.drop(kept)
            if shafts.size:
                program.add(
                    {0: self.shafts.rows[shafts], count: -np.ones((shafts.size, 1))},
                    -self.shafts.values[shafts],
                )
            if over.size:
                program.add(
                    {0: self.curve.rows[over], curve: -np.ones((over.size, 1))}, -self.curve.values[over]
                )
            for at, square in enumerate(self.squares, start=cost.size - len(self.squares)):
                for change in self.cuts:
                    square.cut(program, change, count, at)
            solved = program.solved(cost, lower, upper)
            if solved is None:
                return None
            x = solved
            most = float(x[count]) + max(LET_THROUGH * (peak - float(x[count])), self.search.fine * peak)
            new = self.shafts.over(x[:count], most if limited else math.inf, shafts)
            # a long step is wrong by more than this anyway, and each round solves the whole program again
            close = max(1e-6, CURVE_TOLERANCE * float(np.abs(x[:count]).max()))
            beyond = self.curve.over(x[:count], float(x[curve]) + close, over)
            if new.size + beyond.size == 0 and not self._cut_short(x, cost):
                break
            self.cuts.append(x[:count])
            shafts, over = np.append(shafts, new), np.append(over, beyond)
        return x

    def _cut_short(self, x: Vector, cost: Vector) -> bool:
        """Whether the tangents of a square are still far below it."""
        if not self.squares:
            return False
        now, after = self._value(self._now(x.size), cost), self._value(x, cost)
        below = after - float(cost @ x)
        return below > max(0.3 * (now - float(cost @ x)), self.search.fine * now)

    def _now(self, size: int) -> Vector:
        """The columns of the program as it is now."""
        x, missing, found = np.zeros(size), self.found.lacking, self.found
        count, problem = found.torques.size, self.search.problem
        curve = count + 2 + missing.size
        x[count + 2 : curve], x[curve] = missing, found.beyond
        peak = found.peak / self.search.base
        x[curve + 1] = max(peak / problem.k_dyn - 1.0, 0.0) if problem.k_dyn else 0.0
        x[curve + 2] = max(found.heat / problem.heat - 1.0, 0.0) if problem.heat else 0.0
        x[curve + 3 : curve + 2 + count] = np.abs(np.diff(found.torques)) / self.search.high
        return x

    def _value(self, x: Vector, cost: Vector) -> float:
        """The merit as the model has it, but for what does not change."""
        x, count = x.copy(), self.found.torques.size
        x[count] = float((self.shafts.values + self.shafts.rows @ x[:count]).max(initial=0.0))
        for at, square in enumerate(self.squares, start=x.size - len(self.squares)):
            x[at] = square.value(x[:count], x[count + 1])
        return float(cost @ x)


def _of_shafts(
    search: Descent, start: DemandRun, times: Vector, T: Matrix
) -> tuple[Matrix, Vector, NDArray[np.bool_]]:
    """|T| of each shaft over time where it presses, as shares of the base torque, and its rows."""
    seen = np.flatnonzero(T.any(axis=1))
    moved, slope = start.along_contacts(times)
    answer = start.torques_by_demand(times[seen]) + slope[seen][:, :, None] * moved[seen][:, None, :]
    T = T[seen]
    j, k = np.nonzero(T)
    order = np.lexsort((j, k))
    j, k = j[order], k[order]
    rows = np.sign(T[j, k])[:, None] * answer[j, k] * (search.high / search.base)
    edges = np.append([True], (np.diff(k) != 0) | (np.diff(seen[j]) != 1))[: j.size]
    return rows, np.abs(T[j, k]) / search.base, edges
