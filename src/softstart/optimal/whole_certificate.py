"""The certificate behind a torque lag, a rate limit, a torque-speed curve, braking and damped friction.

Weak duality in continuous time over the whole start. Let te be the end, tau the contact time (of a load at
rest: counted from its breakaway), w the time in which the shaft of a load at rest is wound up before, and
x = te - t. For any multipliers m(x) >= 0 with integral 1 (for T <= P), n(x) >= 0 (for T >= 0), rho(x) >= 0
(for the torque-speed curve) and free ones for the terminal equations, z = 0 at the contact (mu) and T = Mc at
the breakaway, and for any psi(x) that is 0 at the end (for |dr/dt| <= R), each start of the class has

    P >= L(te, tau, w; r) = constants + integral (q(x) - psi'(x)) r dx - R integral |psi| dx + psi(te) r(0)

with the adjoint state p' = p A + (m - n) T + ..., q = p b. The minimum over all demands r between their
limits takes q apart from r: phi(q) = min(q lowest, q highest). psi is the best for the program's own start:
psi' = q where the rate limit decides, so that nothing of q is left there, and psi = 0 elsewhere. Since the
multipliers are fixed in x, one pass gives the adjoint state of all contact times, and from each of them one
pass through the earlier phases.

From points to cells. The bound f is computed at the nodes of an even grid of two durations: (te, tau) where
the load is free to move at once, (w, tau) with te = start_time where it rests at first, since it can wait.
For a fixed demand r(x) - or, where te moves alone, for the least r - L has a second derivative of at most M
along each axis, and a function with f'' <= M is nowhere below the lesser of its ends minus M h^2/8. phi is
concave, so that trapezoids of phi(q) are too high by at most max|q''| h^3/12 times the largest torque.

Linear programs only supply good multipliers. After te the demand is free between its limits (in the swing to
the first zero of the answer of T to an impulse), so that the bound needs no assumption about what holds the
torque there. Left out, which can only lower the bound: the limits of twist and torque before the contact,
the torque-speed curve before it, and |T| <= P where the dead zone pulls.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.linalg import expm

from softstart.arrays import Matrix, Vector
from softstart.optimal.certificate import ENDINGS
from softstart.optimal.lp.motion import Contact
from softstart.optimal.lp.rows import Limits, Solution, Sparse, WarmStarts, no_linear_objective
from softstart.optimal.lp.whole import ONE, SLOPE, STATES, W2, Kind, R, U, V, Z, phase_rates
from softstart.optimal.lp.whole_search import phase_orders
from softstart.optimal.problem import Problem
from softstart.optimal.result import LowerBound
from softstart.plant.jit import compiled

ACROSS = 8.0  # steps of the first grid in a radian of the elastic oscillation
FEWEST, MOST, MOST_RESTING = 150, 1000, 300  # steps of the first grid in the start
RESTING = 200.0  # of them, in what momentum leaves of the start of a load at rest
LONGEST = 200.0  # radians of the elastic oscillation in the start
FINER, GRIDS = 3, 6  # each grid has so many times the steps of the one before
SUBSTEPS = 3  # of the torque in a span over which T is averaged
GAP_STEPS, WINDING_STEPS = 24, 16  # of the torque
SPANS = 60  # at least, and at least two a radian
PRICES = (4.0, 40.0, 400.0)  # of missing an equation by as much as its unit, in units of the torque
PROGRAMS = 12  # on a grid
FAILURES, APART = 3, 2  # programs on a grid that may raise nothing; others are tried so many cells away
KEPT = 8  # sets of multipliers that the next grid begins with
MOST_WORK, LITTLE_WORK = 1.2e8, 1.5e7  # numbers computed in all; a drive is judged alike on every machine
ROUNDING = 1e-9
GAINED = 1e-4  # relative: a program that raises the least bound by less is the last on its grid
CURVED = 1.1  # a rate is between nodes no greater than so many times that at the nodes


def not_certified(problem: Problem) -> str:
    """Why there is no certificate of this kind; empty if there is one."""
    drive: Any = problem.drive
    if problem.start_time is None:
        return "without a bound on the start time any peak above the load torque will do"
    if reason := no_linear_objective(problem):
        return reason
    if drive.Omega * problem.start_time > LONGEST:
        return "the start lasts so many elastic periods that momentum says as much"
    half = 0.5 * drive.gap
    if drive.contact_law == "modelica" and drive.d > 0.0:
        return "the damped modelica law is not linear in contact"
    if drive.theta0 < -half or drive.initial_motor_speed < drive.initial_load_speed:
        return "the gap may close on the other flank first"
    if not problem.lowest_torque <= 0.0 < problem.highest_torque:
        return "the motor cannot rest"
    if _rests(problem):
        if drive.initial_load_speed != 0.0 or drive.initial_motor_speed != 0.0:
            return "a reactive load that moves before the contact"
        if drive.theta0 > half or problem.first_torque != 0.0 or problem.first_demand != 0.0:
            return "the shaft is wound up against a load at rest"
    return ""


def _rests(problem: Problem) -> bool:
    return bool(problem.drive.load_kind == "reactive" and problem.drive.Mc > 0.0)


@dataclass(frozen=True, eq=False)
class _Multipliers:
    """On the steps of the grid, x from the end; `torque`, `closed` and `curve` are densities."""

    torque: Vector  # net of T <= P and T >= 0
    closed: Vector  # of c z >= 0 where the dead zone pulls
    curve: Matrix  # (lines, steps)
    speed: float
    rate: float
    end_torque: float
    contact: float  # of z = 0, beside what the contact makes of z
    breakaway: float
    durations: tuple[int, int, int]  # of the program: in the gap, winding up, in contact, in steps

    def finer(self, start: _Start) -> _Multipliers:
        """The same on a grid with FINER times the steps."""
        wide = start.tail + start.n - FINER * self.torque.size  # at the end of the swing

        def cut(values: Any) -> Any:
            fine = np.repeat(values, FINER, axis=-1)
            return np.concatenate([np.zeros((*fine.shape[:-1], wide)), fine], axis=-1)

        gap, winding, contact = (FINER * steps for steps in self.durations)
        return replace(
            self, torque=cut(self.torque), closed=cut(self.closed), curve=cut(self.curve),
            durations=(gap, winding, contact),
        )  # fmt: skip


class _Start:
    """The problem on an even grid of x = te - t: `n` steps of h s in the start, `tail` after its end."""

    def __init__(self, problem: Problem, steps: int = 0, goal: float = math.inf) -> None:
        assert problem.start_time is not None
        drive: Any = problem.drive
        self.problem, self.drive = problem, drive
        self.J1, self.J2, self.c, self.d, self.Mc = (
            float(value) for value in (drive.J1, drive.J2, drive.c, drive.d, drive.Mc)
        )
        self.end = float(problem.start_time)
        self.low, self.high = problem.lowest_torque, problem.highest_torque
        self.most = max(self.high, -self.low)
        self.rate = float(drive.torque_rate)
        self.rests = _rests(problem)
        self.open = bool(drive.theta0 < 0.5 * drive.gap)
        self.pulls = drive.contact_law == "dead-zone" and self.d > 0.0
        self.contact = Contact.of(drive)
        self.Omega = self.contact.Omega
        self.earliest = min(order.tc for order in phase_orders(problem)) if self.open else 0.0
        self.n = steps or self._steps(goal)
        self.h = self.end / self.n
        self.n0 = int(min(max(self.earliest / self.h - 1e-9, 0.0), self.n))
        if 0.0 < drive.torque_lag < 3.0 * self.h:
            self.drive = drive.replace(torque_lag=0.0)  # a quicker motor can do what a slower one can
        self.lag = float(self.drive.torque_lag)
        period = min(self.contact.half_period, math.pi / self.Omega)
        self.tail = max(1, int(period / self.h))
        rates = {kind: phase_rates(self.drive, kind) for kind in ("gap", "resting", "stuck", "contact")}
        self.rates: dict[Kind, Matrix] = rates  # type: ignore[assignment]
        self.A = rates["contact"][:STATES, :STATES]
        self.b = rates["contact"][:STATES, R]
        self.b0 = rates["contact"][:STATES, ONE]
        self.T = np.array([self.c, self.d, 0.0, 0.0])
        self.pull = 0.0 if self.rests else self.Mc / self.J2
        v0 = float(drive.initial_motor_speed - drive.initial_load_speed)
        self.first = np.array(
            [float(drive.theta0 - 0.5 * drive.gap), v0, float(drive.initial_load_speed), problem.first_torque]
        )
        if self.lag == 0.0:
            self.first[U] = 0.0
        self.lines = [
            ((u_b - u_a) / (w_b - w_a), w_a, u_a) for (w_a, u_a), (w_b, u_b) in pairwise(problem.torque_speed)
        ]

    def _steps(self, goal: float) -> int:
        """How many: the earliest contact is to be just after a node.

        A load at rest takes the cube of those left by momentum.
        """
        most: float = MOST
        if self.rests:
            least = min(self.J2 * self.problem.target / max(goal - self.Mc, 1e-300) / self.end, 1.0)
            most = min(max(MOST_RESTING, RESTING / max(1.0 - least, 1e-3)), MOST)
        wanted = int(min(max(ACROSS * self.Omega * self.end, FEWEST), most))
        counts = np.arange(wanted, int(1.15 * wanted) + 2)
        after = FINER**2 * self.earliest / self.end * counts
        return int(counts[np.argmin(after - np.floor(after - 1e-9))])

    def curve_sources(self) -> tuple[Matrix, Vector]:
        """For each line of the torque-speed curve, weights of the state and what they may be."""
        weights = np.zeros((len(self.lines), STATES))
        right = np.zeros(len(self.lines))
        for k, (slope, w, u) in enumerate(self.lines):
            weights[k, [V, W2]] = -slope
            weights[k, U] = 1.0 if self.lag > 0.0 else 0.0
            right[k] = u - slope * w
        return weights, right


def _around(values: Vector) -> Vector:
    """What |values| at the ends of a step and of its neighbours bound within it."""
    wide = np.concatenate([values[:1], values, values[-1:]])
    return np.asarray(CURVED * np.maximum(np.maximum(wide[:-2], wide[1:-1]), wide[2:]))


class _Dual:
    """One set of multipliers, and the bound of the starts with any two durations."""

    def __init__(self, start: _Start, by: _Multipliers) -> None:
        self.start, self.by = start, by
        self._contact()

    def phi(self, q: Any) -> Any:
        """The least of q r over the demands r."""
        return np.minimum(q * self.start.low, q * self.start.high)

    def _contact(self) -> None:
        """The adjoint state over the whole grid as if the contact began there, and what it has gathered."""
        s, by = self.start, self.by
        n, h = s.tail + s.n, s.h
        M = np.zeros((2 * STATES + 2, 2 * STATES + 2))
        M[:STATES, :STATES], M[:STATES, STATES] = s.A, s.b0
        M[STATES + 1 :, : STATES + 1] = 0.0
        size = STATES + 1
        E = expm(M[:size, :size] * h)
        block = np.zeros((2 * size, 2 * size))
        block[:size, :size] = M[:size, :size]
        block[:size, size:] = np.eye(size)
        G = expm(block * h)[:size, size:]  # integral of exp(M s) from 0 to h
        sources = np.zeros((n, size))
        sources[:, :STATES] = by.torque[:, None] * s.T
        sources[:, Z] -= s.c * by.closed
        weights, right = s.curve_sources()
        sources[:, :STATES] += by.curve.T @ weights
        sources[:, STATES] -= by.curve.T @ right
        added = sources @ G
        p = np.zeros((n + 1, size))
        _recursion(E, added, p, 0, s.tail)
        after_end = p[s.tail].copy()  # just after te
        p[s.tail, W2] -= by.speed
        p[s.tail, V] -= by.rate
        p[s.tail, :STATES] -= by.end_torque * s.T
        _recursion(E, added, p, s.tail, n)
        starts, ends = p[:-1].copy(), p[1:].copy()
        if s.tail:
            ends[s.tail - 1] = after_end
        direct = by.curve.sum(axis=0) if s.lag == 0.0 else np.zeros(n)
        q = [side[:, :STATES] @ s.b + direct for side in (starts, ends)]
        d1 = [side[:, :STATES] @ s.A + sources[:, :STATES] for side in (starts, ends)]
        d2 = [one @ s.A for one in d1]
        bend = _around(np.maximum(*(np.abs(one @ s.b) for one in d2)))
        self.p = p[s.tail :, :STATES]
        self.mu = by.contact + self._on_twist()
        self._pay_for_rate(q)
        area = 0.5 * h * (self.phi(q[0] - self.slope[0]) + self.phi(q[1] - self.slope[1]))
        area = area - s.most * bend * h**3 / 12.0 - self.by_rate
        total = np.concatenate([[0.0], np.cumsum(area)])
        self.gathered = p[s.tail :, STATES] + total[s.tail :]
        self.gathered += by.speed * s.problem.target + by.end_torque * s.Mc - by.breakaway * s.Mc
        here = slice(s.tail, None)
        self.d1_ends = d1[0][here], d1[1][here]
        self.d2 = _around(np.maximum(*(np.abs(one[here]) for one in d2)))
        self.d2_ends = d2[0][here], d2[1][here]
        self.K2 = _around(np.maximum(*(np.abs(one[here] @ s.b0) for one in d1)))
        self.q1 = _around(np.maximum(*(np.abs(one[here] @ s.b) for one in d1)))
        first = s.problem.first_demand if s.rate < math.inf else 0.0
        self.by_first = self.psi[here] * first
        slope = self.slope[:, here]
        turned = (s.most + abs(first)) * np.abs(slope[1] - slope[0]) / h
        self.by_te = (s.rate * np.abs(slope).max(axis=0) + turned) if s.rate < math.inf else np.zeros(s.n)

    def _pay_for_rate(self, q: list[Vector]) -> None:
        """Choose psi: best for the start of the program, with psi' = q where the rate limit decides."""
        s, n = self.start, self.start.tail + self.start.n
        self.psi, self.slope, self.by_rate = np.zeros(n + 1), np.zeros((2, n)), np.zeros(n)
        if s.rate == math.inf:
            return
        here = s.tail + sum(self.by.durations)
        on_demand = self._along_program(q)
        mean, first = 0.5 * on_demand.sum(axis=0), s.problem.first_demand
        self.psi[1 : here + 1] = s.h * _rate_multipliers(mean, s.rate * s.h, s.low, s.high, first)
        self.psi[here:] = self.psi[here]
        # q - psi' is constant in a step, 0 where neither limit of the torque holds
        self.slope[:, :here] = on_demand - mean + np.diff(self.psi[: here + 1]) / s.h
        bent = np.abs(self.slope[1] - self.slope[0]) / 6.0
        self.by_rate = s.rate * 0.5 * s.h * (np.abs(self.psi[:-1]) + np.abs(self.psi[1:]) + s.h * bent)

    def _along_program(self, q: list[Vector]) -> Matrix:
        """Q at both ends of the steps of the program's own start, from the end on."""
        s, (gap, winding, contact) = self.start, self.by.durations
        p = self.p[contact] + (self.by.breakaway * s.T if winding else 0.0)
        E = expm(s.rates["stuck"][:STATES, :STATES] * s.h)
        wound = [p @ s.b]
        for _ in range(winding):
            p = p @ E
            wound.append(p @ s.b)
        crossed, _ = self._in_gap(np.array([p[V]]), np.array([p[U]]), gap)
        parts = [
            np.array(q)[:, : s.tail + contact],
            np.array([wound[:-1], wound[1:]]),
            np.array([crossed[0, :-1], crossed[0, 1:]]),
        ]
        return np.concatenate(parts, axis=1)

    def _on_twist(self) -> float:
        """What the program's start makes of z at the contact, N m/rad."""
        s, (_, winding, contact) = self.start, self.by.durations
        p = self.p[contact] + (self.by.breakaway * s.T if winding else 0.0)
        if winding:
            p = p @ expm(s.rates["stuck"][:STATES, :STATES] * (winding * s.h))
        return float(p[Z])

    def gap(self, a_v: Vector, a_u: Vector, first: Any, steps: int) -> Matrix:
        """Integrals of phi over the gap, (lines, steps + 1), from below; lines begin at the nodes `first`."""
        s = self.start
        q, bend = self._in_gap(a_v, a_u, steps)
        low, high = q[:, :-1], q[:, 1:]
        if s.rate < math.inf:
            index = s.tail + np.minimum(np.asarray(first)[:, None] + np.arange(steps), s.n - 1)
            low, high = low - self.slope[0][index], high - self.slope[1][index]
        area = 0.5 * s.h * (self.phi(low) + self.phi(high)) - s.most * bend * s.h**3 / 12.0
        if s.rate < math.inf:
            area -= self.by_rate[index]
        out = np.zeros((a_v.size, steps + 1))
        np.cumsum(area, axis=1, out=out[:, 1:])
        return out

    def _in_gap(self, a_v: Vector, a_u: Vector, steps: int) -> tuple[Matrix, Matrix]:
        """Q at the nodes before the contact, (lines, steps + 1), and bounds of its |q''| in the steps."""
        s, mu = self.start, self.mu
        y = s.h * np.arange(steps + 1)
        if s.lag == 0.0:
            return ((a_v / s.J1)[:, None] + mu / s.J1 * y) + np.zeros((a_v.size, 1)), np.zeros((1, 1))
        E = np.exp(-y / s.lag)
        by_E = a_u / s.lag - a_v / s.J1 + mu * s.lag / s.J1
        q = (a_v / s.J1)[:, None] + mu / s.J1 * (y - s.lag) + by_E[:, None] * E
        return q, np.abs(by_E)[:, None] / s.lag**2 * E[:-1]


def _rate_multipliers(q: Vector, rise: float, low: float, high: float, first: float) -> Vector:
    """Multipliers of |r_k+1 - r_k| <= rise, and last of |first - r_n-1| <= rise/2, where sum q r is least.

    V_k(r) = q_k r + min V_k-1(s) over |s - r| <= rise is convex and piecewise linear between low and high. It
    is known by its kinks left and right of the minimum, which each step moves apart by `rise`. The multiplier
    p_k is its slope at r_k: p_k-1 = p_k - q_k, kept between the slopes of the minimum over s at low and high.
    """
    p, n = np.empty(q.size), q.size
    _by_kinks(q, rise, low, high, first, np.empty((4, n + 1)), np.empty((2, n)), p)
    return p


@compiled
def _by_kinks(q: Any, rise: float, low: float, high: float, first: float, kinks: Any, limits: Any,
              p: Any) -> None:  # fmt: skip
    """Fill p by the recursion of `_rate_multipliers`; on both sides the kink next to the minimum is last."""
    left, by_left, right, by_right = kinks  # where + moved, where - moved, and by how much the slope changes
    l0 = l1 = r0 = r1 = 0  # those in use
    at_low = at_high = moved = 0.0
    n = q.size
    for k in range(n):
        more = q[k]  # to be taken from the kinks of one side: the minimum moves there
        while more > 0.0:
            at, change = (left[l1 - 1], by_left[l1 - 1]) if l1 > l0 else (low + moved, more)
            taken = min(change, more)
            right[r1], by_right[r1] = at - 2.0 * moved, taken
            r1 += 1
            if change > more:
                by_left[l1 - 1] = change - more
            elif l1 > l0:
                l1 -= 1
            more -= taken
        while more < 0.0:
            at, change = (right[r1 - 1], by_right[r1 - 1]) if r1 > r0 else (high - moved, -more)
            taken = min(change, -more)
            left[l1], by_left[l1] = at + 2.0 * moved, taken
            l1 += 1
            if change > -more:
                by_right[r1 - 1] = change + more
            elif r1 > r0:
                r1 -= 1
            more += taken
        at_low, at_high = min(at_low + q[k], 0.0), max(at_high + q[k], 0.0)
        moved += rise if k < n - 1 else 0.5 * rise
        while l1 > l0 and left[l0] - moved <= low:
            at_low = min(at_low + by_left[l0], 0.0)
            l0 += 1
        while r1 > r0 and right[r0] + moved >= high:
            at_high = max(at_high - by_right[r0], 0.0)
            r0 += 1
        limits[0, k], limits[1, k] = at_low, at_high
    p[n - 1] = 0.0
    for i in range(r0, r1):
        p[n - 1] += by_right[i] if right[i] + moved < first else 0.0
    for i in range(l0, l1):
        p[n - 1] -= by_left[i] if left[i] - moved > first else 0.0
    for k in range(n - 1, 0, -1):
        p[k - 1] = min(max(p[k] - q[k], limits[0, k - 1]), limits[1, k - 1])


@compiled
def _recursion(E: Any, added: Any, p: Any, first: int, last: int) -> None:
    """p[i + 1] = p[i] E + added[i] for i from `first` to `last` - 1."""
    for i in range(first, last):
        for k in range(E.shape[0]):
            p[i + 1, k] = added[i, k]
            for j in range(E.shape[0]):
                p[i + 1, k] += p[i, j] * E[j, k]


# a load that is free to move at once -----------------------------------------------------------------------


class _Cells:
    """Cells of two durations, on the first grid all, on a finer one those that a coarser one leaves open.

    The cell [i, k] of `lowest` is the one that begins at node first[0] + i of one axis and first[1] + k of
    the other; the bounds of all others are at least `outside`.
    """

    def __init__(self, start: _Start, columns: int, coarse: Any, goal: float, before: int) -> None:
        self.start, self.columns = start, columns
        self.first, last, self.outside = (0, 0), (start.n, columns), math.inf
        if coarse is not None:
            alive = coarse.lowest < goal
            found = np.flatnonzero(alive.any(axis=1)), np.flatnonzero(alive.any(axis=0))
            begins = [int(at[0]) + first for at, first in zip(found, coarse.first, strict=True)]
            ends = [int(at[-1]) + 1 + first for at, first in zip(found, coarse.first, strict=True)]
            self.first = FINER * begins[0], max(FINER * begins[1] - before, 0)
            last = min(FINER * ends[0], start.n), min(FINER * ends[1], columns)
            box = np.zeros(alive.shape, dtype=bool)
            box[found[0][0] : found[0][-1] + 1, found[1][0] : found[1][-1] + 1] = True
            rest = coarse.lowest[~box]
            self.outside = min(coarse.outside, float(rest.min()) if rest.size else math.inf)
        self.tau = np.arange(self.first[0], last[0])
        self.other = np.arange(self.first[1], last[1])

    lowest: Matrix

    def take(self, coarse: Any, rows: Any, columns: Any) -> None:
        """What a coarser grid knows of the cells around ours, by its numbers there."""
        i, k = rows - coarse.first[0], columns - coarse.first[1]
        inside = (i >= 0) & (i < coarse.lowest.shape[0]) & (k >= 0) & (k < coarse.lowest.shape[1])
        top, right = coarse.lowest.shape[0] - 1, coarse.lowest.shape[1] - 1
        parent = coarse.lowest[np.clip(i, 0, top), np.clip(k, 0, right)]
        parent = np.where(inside, parent, coarse.outside)
        self.lowest = np.maximum(self.lowest, np.where(np.isfinite(parent), parent, -math.inf))

    @property
    def least(self) -> float:
        """The least bound of all cells, N m."""
        return min(self.outside, float(self.lowest.min()))

    def worst(self, but: list[tuple[int, int]]) -> tuple[int, int]:
        """The cell of ours with the least bound, not near any of `but`."""
        lowest = self.lowest.copy() if but else self.lowest
        for i, k in but:
            row, column = i - self.first[0], k - self.first[1]
            lowest[max(row - APART, 0) : row + APART + 1, max(column - APART, 0) : column + APART + 1] = (
                math.inf
            )
        row, column = divmod(int(np.argmin(lowest)), lowest.shape[1])
        return row + self.first[0], column + self.first[1]

    def at(self, cell: tuple[int, int]) -> float:
        """The bound of a cell, N m."""
        return float(self.lowest[cell[0] - self.first[0], cell[1] - self.first[1]])

    def open_box(self, goal: float) -> tuple[int, int, int, int] | None:
        """(First row, end of rows, first column, end of columns) of the cells below `goal`, if any."""
        alive = self.lowest < goal
        if not alive.any():
            return None
        rows, columns = np.flatnonzero(alive.any(axis=1)), np.flatnonzero(alive.any(axis=0))
        i, k = self.first
        return int(rows[0]) + i, int(rows[-1]) + 1 + i, int(columns[0]) + k, int(columns[-1]) + 1 + k

    def keep(self, rows: tuple[int, int], columns: tuple[int, int], found: Matrix) -> None:
        """Take the larger ones of what is known and what has been proved."""
        i, k = self.first
        known = self.lowest[rows[0] - i : rows[1] - i, columns[0] - k : columns[1] - k]
        np.maximum(known, np.where(np.isfinite(found), found, -math.inf), out=known)


class _Free(_Cells):
    """Cells of (te, tau): `lowest[i, j]` bounds tau from i to i + 1 and te from i + j to i + j + 1 steps."""

    def __init__(self, start: _Start, coarse: _Free | None = None, goal: float = math.inf) -> None:
        super().__init__(start, start.n + 1 if start.open else 1, coarse, goal, FINER - 1)
        s = start
        te = s.h * (self.tau[:, None] + self.other)  # at the beginning of a cell
        missing = s.problem.target - s.first[W2]
        plain = (s.J2 * missing + s.Mc * te) / (s.h * (self.tau[:, None] + 1.0))
        self.lowest = np.where(self.inside(), plain, math.inf)
        if coarse is not None:
            i = self.tau[:, None] // FINER
            self.take(
                coarse, i + 0 * self.other, (self.tau[:, None] + self.other) // FINER - i if s.open else 0 * i
            )

    def inside(self) -> Any:
        """Which cells hold a start."""
        s, j = self.start, self.other
        if not s.open:
            return np.ones((self.tau.size, 1), dtype=bool)
        return (self.tau[:, None] + j + 1 <= s.n) & (j >= s.n0)

    def instants(self, cell: tuple[int, int]) -> tuple[int, int, int]:
        """(steps in the gap, winding up, in contact) of a start in a cell."""
        i, j = cell
        if not self.start.open:
            return 0, 0, i + 1
        return (j + 1, 0, i) if i else (j, 0, 1)

    def raise_by(self, dual: _Dual, goal: float) -> None:
        """Take the larger one of what is known and what a set of multipliers proves."""
        s, box = self.start, self.open_box(goal)
        if box is None:
            return
        i0, i1, j0, j1 = box
        if not s.open:
            f = dual.gathered + dual.p @ s.first + dual.by_first
            most = dual.K2 + s.most * dual.q1 + dual.d2 @ np.abs(s.first)
            if s.rate < math.inf:
                most = most + dual.by_te
            cell = np.minimum(f[:-1], f[1:]) - most * s.h**2 / 8.0
            self.keep((i0, i1), (0, 1), cell[i0:i1, None])
            return
        j1 = min(j1, s.n)
        nodes = np.arange(i0, i1 + 1)
        y = s.h * np.arange(j1 + 1)
        p = dual.p[nodes]
        f = dual.gap(p[:, V], p[:, U], nodes, j1)
        mu, b, (z0, v0, w2, u0) = dual.mu, s.pull, s.first
        f += dual.gathered[nodes][:, None]
        f += mu * (z0 + v0 * y + 0.5 * b * y * y)
        f += p[:, V][:, None] * (v0 + b * y) + p[:, W2][:, None] * (w2 - b * y)
        te = np.minimum(nodes[:, None] + np.arange(j1 + 1), s.n)
        f += dual.by_first[te]
        if s.lag > 0.0 and u0 != 0.0:
            E = np.exp(-y / s.lag)
            at_first = p[:, U][:, None] * E + (p[:, V] * s.lag / s.J1)[:, None] * (1.0 - E)
            f += u0 * (at_first + mu * s.lag / s.J1 * (y - s.lag * (1.0 - E)))
        late = y[1:]
        steps = np.arange(i0, i1)
        bent, turned = np.abs(dual.d2[steps][:, V]), np.zeros(steps.size)
        for ends in dual.d1_ends:
            turned = np.maximum(turned, np.abs(ends[steps][:, V] - mu))
        fall = np.zeros(steps.size)
        for ends in dual.d1_ends:
            one = ends[steps]
            fall = np.maximum(fall, np.abs(b * (mu - 2.0 * one[:, V] + 2.0 * one[:, W2])))
        along_tau = (dual.K2[steps] + _around(fall + s.most * turned / s.J1))[:, None]
        along_tau = along_tau + bent[:, None] * (abs(v0) + b * late + s.most * late / s.J1)
        along_tau = along_tau + (dual.d2[steps][:, W2] * abs(w2))[:, None]
        along_te = np.zeros((1, j1)) + abs(mu) * (b + s.most / s.J1)
        if s.lag > 0.0:
            by_E = np.abs(p[:-1, U] / s.lag - p[:-1, V] / s.J1 + mu * s.lag / s.J1)
            here = np.exp(-y[:-1] / s.lag)
            along_te = along_te + s.most * CURVED * by_E[:, None] * here / s.lag
            if u0 != 0.0:
                along_tau = along_tau + abs(u0) * (bent * s.lag + turned)[:, None] / s.J1
                along_te = along_te + abs(u0) * CURVED * by_E[:, None] * here / s.lag
        if s.rate < math.inf:
            index = np.minimum(steps[:, None] + np.arange(j1), s.n - 1)
            along_te = along_te + dual.by_te[index]
        left = np.full((steps.size, j1), math.inf)
        left[:, 1:] = f[1:, : j1 - 1]
        if s.rate == math.inf and s.n0 < j1:  # no contact before the earliest one: half of the cell
            left[:, : s.n0 + 1] = math.inf
            at = min(s.n0, j1 - 1)
            by_v = abs(v0) + b * late[at] + s.most * late[at] / s.J1
            diagonal = dual.K2 + s.most * (dual.q1 + dual.d2[:, U]) + dual.d2[:, V] * by_v
            along_tau[:, at] = np.maximum(along_tau[:, at], diagonal[steps] + dual.d2[steps][:, W2] * abs(w2))
        corners = np.minimum(np.minimum(f[:-1, :-1], f[:-1, 1:]), np.minimum(left, f[1:, :-1]))
        cell = corners - (along_tau + along_te) * s.h**2 / 8.0
        self.keep((i0, i1), (j0, j1), cell[:, j0:])


# a reactive load at rest ------------------------------------------------------------------------------------


class _Resting(_Cells):
    """Cells of (tau, w), te = start_time: `lowest[i, k]` bounds tau from i to i + 1, w from k to k + 1 steps.

    Without `winds` the damped contact moves the load at once: w = 0, and T there is above Mc, not more.
    """

    def __init__(
        self, start: _Start, winds: bool, coarse: _Resting | None = None, goal: float = math.inf
    ) -> None:
        super().__init__(start, start.n if winds and start.open else 1, coarse, goal, 0)
        self.winds = winds
        s = start
        plain = s.Mc + s.J2 * s.problem.target / (s.h * (self.tau + 1.0))
        left = s.n - self.tau[:, None] - self.other - 1  # steps before the contact, at most
        fits = left >= s.n0 if s.open else left >= 0
        if not winds:
            fits = left + 1 >= s.n0
        self.lowest = np.where(fits, plain[:, None], math.inf)
        if coarse is not None:
            self.take(
                coarse,
                self.tau[:, None] // FINER + 0 * self.other,
                self.other // FINER + 0 * self.tau[:, None],
            )

    def instants(self, cell: tuple[int, int]) -> tuple[int, int, int]:
        """(steps in the gap, winding up, in contact) of a start in a cell."""
        i, k = cell
        n = self.start.n
        tau = max(i, 1)
        if not self.start.open:
            return 0, n - tau, tau
        if not self.winds:
            return n - tau, 0, tau
        w = max(k, 1)
        return max(n - tau - w, 1), w, tau

    def raise_by(self, dual: _Dual, goal: float) -> None:
        """Take the larger one of what is known and what a set of multipliers proves."""
        s, by, box = self.start, dual.by, self.open_box(goal)
        if box is None:
            return
        i0, i1, k0, k1 = box
        pb = by.breakaway if self.winds else 0.0
        A = s.rates["stuck"][:STATES, :STATES]
        E = expm(A * s.h)
        nodes, steps = np.arange(i0, i1 + 1), np.arange(i0, i1)
        S = dual.p[nodes] + pb * s.T
        sides = []
        for side, d1, d2 in zip((S[:-1], S[1:]), dual.d1_ends, dual.d2_ends, strict=True):
            P1, P2 = d1[steps], d2[steps]
            sides.append([P1, P2, P1 - side @ A, P2 - 2.0 * P1 @ A + side @ A @ A, np.zeros(steps.size)])
        own = dual.K2[steps]
        at_first = _around(np.maximum(*(np.abs(one[2] @ s.b) for one in sides)))
        jump = abs(pb) * s.d / s.J1 * (s.high - s.low) * s.h if s.lag == 0.0 else 0.0
        base = dual.gathered[nodes] + (0.0 if self.winds else by.breakaway * s.Mc)
        base = base + (dual.mu * s.first[Z] if s.open else 0.0)
        wound, known = np.zeros(nodes.size), np.full(nodes.size, math.inf)
        before: tuple[Vector, Any] | None = None
        last = int(s.n - i0) if not s.open else k1 if self.winds else 0
        for k in range(last + 1):
            left = s.n - nodes - k
            if not s.open:  # the shaft is wound up all the time before
                known = np.where(left == 0, base + wound, known)
                if k == last:
                    bend = s.most * (at_first + np.maximum(*(one[4] for one in sides))) + own
                    found = np.minimum(known[:-1], known[1:]) - bend * s.h**2 / 8.0 - jump
                    self.keep((i0, i1), (0, 1), found[:, None])
                    return
            elif k >= k0:
                gap = dual.gap(S[:, V], S[:, U], nodes + k, max(int(left.max()), 0))
                value = base + wound + gap[np.arange(nodes.size), np.maximum(left, 0)]
                f = np.where(left >= 0, value, math.inf)
                bends = self._bends(dual.mu, S, sides, A, np.maximum(left, 0) * s.h)
                bends = [s.most * _around(one) for one in bends]
                bends[0] += s.most * at_first + own
                bends[2] += s.most * at_first + own
                if not self.winds:
                    found = np.minimum(f[:-1], f[1:]) - bends[0] * s.h**2 / 8.0
                    self.keep((i0, i1), (0, 1), found[:, None])
                    return
                if before is not None:
                    f_old, old = before
                    cut = left[1:] < s.n0  # no contact before the earliest one: half of the cell
                    corner = np.where(cut, math.inf, f[1:])
                    corners = np.minimum(np.minimum(f_old[:-1], f_old[1:]), np.minimum(f[:-1], corner))
                    along, w_most, diagonal = (np.maximum(*pair) for pair in zip(old, bends, strict=True))
                    along = np.where(cut, np.maximum(along, diagonal), along) + w_most
                    found = corners - along * s.h**2 / 8.0 - jump
                    self.keep((i0, i1), (k - 1, k), found[:, None])
                before = f, bends
            if k < last:
                wound, S, sides = self._wind(dual, wound, S, sides, A, E, nodes + k)

    def _wind(self, dual: _Dual, wound: Vector, S: Matrix, sides: Any, A: Matrix, E: Matrix,
              node: Any) -> tuple[Vector, Matrix, Any]:  # fmt: skip
        """One step further back along the winding up."""
        s = self.start
        index = np.minimum(node, s.n - 1)
        slope = dual.slope[:, s.tail + index]
        later = S @ E
        bend = np.maximum(np.abs(S @ A @ A @ s.b), np.abs(later @ A @ A @ s.b)) * CURVED
        area = 0.5 * s.h * (dual.phi(S @ s.b - slope[0]) + dual.phi(later @ s.b - slope[1]))
        area = area - s.most * bend * s.h**3 / 12.0
        if s.rate < math.inf:
            area = area - dual.by_rate[s.tail + index]
        moved = []
        for P1, P2, S1, S2, total in sides:
            S2_later = S2 @ E
            more = CURVED * s.h * np.maximum(np.abs(S2 @ s.b), np.abs(S2_later @ s.b))
            moved.append([P1 @ E, P2 @ E, S1 @ E, S2_later, total + more])
        return wound + area, later, moved

    def _bends(self, mu: float, S: Matrix, sides: Any, A: Matrix, tc: Vector) -> list[Vector]:
        """Bounds of the second derivatives along tau, along w, and along tau while tau + w stays.

        For a demand of 1, and without what the breakaway itself adds to the first and the last.
        """
        s = self.start
        late = tc[:-1]
        bends = [np.zeros(late.size) for _ in range(3)]
        for side, (P1, P2, S1, S2, total) in zip((S[:-1], S[1:]), sides, strict=True):
            turn = side @ A
            twice = turn @ A
            swing = np.abs(turn[:, V] - mu) / s.J1
            bent = np.abs(P2[:, V]) * late / s.J1
            rest = np.abs(S2[:, V]) * late / s.J1
            if s.lag > 0.0:
                on_u = (
                    P2[:, U] - P1[:, V] / s.J1 + P1[:, U] / s.lag - (P1[:, V] - mu) / s.J1 + S1[:, U] / s.lag
                )
                bent, rest = bent + np.abs(on_u), rest + np.abs(S2[:, U])
            else:
                bent = bent + swing
            here = total + bent, swing + late * np.abs(twice[:, V]) / s.J1, total + rest
            bends = [np.maximum(*pair) for pair in zip(bends, here, strict=True)]
        return bends


# the linear program ----------------------------------------------------------------------------------------


class _Program:
    """Good multipliers for given durations: T and the curve by means over spans and at their ends."""

    def __init__(
        self, start: _Start, durations: tuple[int, int, int], warm: WarmStarts | None = None
    ) -> None:
        self.start, self.warm = start, warm or WarmStarts()
        gap, winding, contact = durations
        s = self.start
        spans = max(SPANS, int(2.0 * s.Omega * s.h * contact))
        inner = _even(contact, spans * SUBSTEPS)
        self.parts: list[tuple[Kind, Vector]] = []
        if gap:
            self.parts.append(("resting" if s.rests else "gap", np.linspace(0.0, gap, GAP_STEPS + 1)))
        if winding:
            self.parts.append(("stuck", np.linspace(0.0, winding, WINDING_STEPS + 1)))
        self.parts += [("contact", inner), ("contact", _even(s.tail, 12))]
        self.durations = durations
        self.P = math.nan

    def solve(self, goal: float) -> _Multipliers | None:
        """Multipliers whose bound is above `goal` N m, or the largest; None where HiGHS finds none."""
        s = self.start
        scale_z, scale_v = s.c / s.most, s.c / (s.Omega * s.most)
        steps = np.concatenate([np.diff(edges) for _, edges in self.parts]).round(9)  # in h
        kinds = [kind for kind, edges in self.parts for _ in range(edges.size - 1)]
        m = steps.size
        bent = s.rate < math.inf
        demands = m + 1 if bent else m
        X = np.zeros((STATES + 3, demands + 1))
        X[:STATES, -1] = s.first
        flows: dict[tuple[Kind, float], Matrix] = {}
        T_now, T_sum, z_now, curve = [], [], [], []
        equal: list[tuple[str, Vector]] = []
        ends = np.cumsum([edges.size - 1 for _, edges in self.parts])
        for k in range(m):
            key = (kinds[k], float(steps[k]))
            if key not in flows:
                flows[key] = _with_means(s, key[0], key[1] * s.h)
            F = flows[key]
            dt = steps[k] * s.h
            states = [Z, V, W2, U, 7, 8, 9]
            X[STATES:] = 0.0
            moved = F[np.ix_(states, [Z, V, W2, U])] @ X[:STATES]
            on_r, on_slope = F[states, R], F[states, SLOPE] / dt
            if bent:
                moved[:, k] += on_r - on_slope
                moved[:, k + 1] += on_slope
            else:
                moved[:, k] += on_r
            moved[:, -1] += F[states, ONE]
            X = moved
            if kinds[k] == "contact":
                T_now.append(s.c * X[Z] + s.d * X[V])
                T_sum.append(X[STATES].copy())
                z_now.append(s.c * X[Z])
                curve.append((X[STATES + 1].copy(), X[STATES + 2].copy()))
            if k + 1 == ends[-2]:
                equal.append(("speed", X[W2] / s.problem.target))
                if s.problem.terminal != "reached":
                    equal.append(("rate", X[V] * scale_v))
                if s.problem.terminal == "steady":
                    equal.append(("torque", (s.c * X[Z] + s.d * X[V]) / s.most))
            elif k + 1 in ends[:-2]:
                if kinds[k] == "stuck":
                    equal.append(("breakaway", (s.c * X[Z] + s.d * X[V]) / s.most))
                else:
                    equal.append(("contact", X[Z] * scale_z))
        return self._solved(steps, demands, T_now, T_sum, z_now, curve, equal, goal)

    def _solved(self, steps: Any, demands: int, T_now: Any, T_sum: Any, z_now: Any, curve: Any,
                equal: list[tuple[str, Vector]], goal: float) -> _Multipliers | None:  # fmt: skip
        s = self.start
        m = steps.size
        inner = self.parts[-2][1].size - 1  # steps in contact up to te
        after = m - inner - (self.parts[-1][1].size - 1)  # steps before the contact
        T_now, T_sum = np.array(T_now) / s.most, np.array(T_sum)
        first = np.arange(0, inner, SUBSTEPS)
        lengths = np.add.reduceat(steps[after : after + inner], first) * s.h
        means = np.add.reduceat(T_sum[:inner], first, axis=0) / lengths[:, None] / s.most
        at_ends = np.append(first[1:] - 1, inner - 1)
        peak = np.vstack([means, T_now[at_ends], T_now[inner:]])
        kept = np.array(z_now)[at_ends] / s.most if s.pulls else np.vstack([means, T_now[at_ends]])
        lines = []
        for slope, w, u in s.lines:
            w1 = np.add.reduceat(np.array([one for one, _ in curve])[:inner], first, axis=0)
            uu = np.add.reduceat(np.array([two for _, two in curve])[:inner], first, axis=0)
            row = (uu - slope * w1) / lengths[:, None] / s.most
            row[:, -1] -= (u - slope * w) / s.most
            lines.append(row)
        count = len(equal)
        columns = demands + 2 * count + 2  # demand, slack of the equations, of T >= 0 and curve, P
        unit = np.append(np.full(demands, s.most), 1.0)
        blocks = [_rows(peak * unit, demands, columns, {columns - 1: -1.0})]
        blocks.append(_rows(-kept * unit, demands, columns, {columns - 2: -1.0}))
        blocks += [_rows(row * unit, demands, columns, {columns - 2: -1.0}) for row in lines]
        if s.rate < math.inf:
            rise = np.zeros((m, columns + 1))
            rise[np.arange(m), np.arange(m)] = -1.0
            rise[np.arange(m), np.arange(m) + 1] = 1.0
            rise[:, -1] = -s.rate * steps * s.h / s.most
            fall = -rise
            fall[:, -1] = rise[:, -1]
            blocks += [rise, fall]
        ub = np.vstack(blocks)
        targets = {"speed": 1.0, "torque": s.Mc / s.most, "breakaway": s.Mc / s.most}
        eq = np.zeros((count, columns + 1))
        for k, (name, row) in enumerate(equal):
            eq[k, :demands] = row[:demands] * s.most
            eq[k, -1] = row[-1] - targets.get(name, 0.0)
            eq[k, demands + 2 * k : demands + 2 * k + 2] = 1.0, -1.0
        bounds = np.tile([0.0, np.inf], (columns, 1))
        bounds[:demands] = s.low / s.most, s.high / s.most
        if s.rate < math.inf:
            bounds[0] = s.problem.first_demand / s.most
        above, equations = (Sparse.dense(rows[:, :-1]) for rows in (ub, eq))
        found: Solution | None = None
        for price in PRICES:
            cost = np.full(columns, price)
            cost[:demands] = 0.0
            cost[-1] = 1.0
            found = Limits(cost, above, -ub[:, -1], equations, -eq[:, -1]).solved(bounds, self.warm)
            if found is None:
                return None
            self.P = found.cost * s.most
            if 1.02 * goal < self.P or np.all(found.x[demands:-1] < 1e-9):
                break
        assert found is not None
        parts = np.split(
            np.maximum(-found.above, 0.0),
            np.cumsum([len(one) for one in blocks])[:-1],
        )
        names = dict(zip([name for name, _ in equal], found.equal, strict=True))
        return self._multipliers(parts, names, steps, first, at_ends, inner, after)

    def _multipliers(self, parts: list[Vector], names: dict[str, float], steps: Any, first: Any,
                     at_ends: Any, inner: int, after: int) -> _Multipliers | None:  # fmt: skip
        """HiGHS's marginals as densities on the grid."""
        s = self.start
        total = float(parts[0].sum())
        if total <= 0.0:
            return None
        parts = [part / total for part in parts]
        n = s.tail + s.n
        # index on the grid of the node after each step of the program
        edges = np.concatenate([[0], np.cumsum(steps)]).round().astype(int)  # exact from the contact on
        node = s.tail + (self.durations[0] + self.durations[1] + self.durations[2]) - edges
        torque, closed = np.zeros(n), np.zeros(n)
        curve = np.zeros((len(s.lines), n))
        spans = len(first)
        begin = node[after + first]
        finish = node[after + at_ends + 1]

        def spread(into: Vector, weights: Vector) -> None:
            for a, b, weight in zip(finish, begin, weights, strict=True):
                into[a:b] += weight / ((b - a) * s.h)

        def instants(into: Vector, at: Any, weights: Vector) -> None:
            for one, weight in zip(at, weights, strict=True):
                if weight > 0.0:
                    lower, upper = (one, one + 1) if one in (0, s.tail) else (one - 1, one + 1)
                    into[lower:upper] += weight / ((upper - lower) * s.h)

        peak = parts[0]
        spread(torque, peak[:spans])
        instants(torque, finish, peak[spans : 2 * spans])
        instants(torque, node[after + inner + 1 :], peak[2 * spans :])
        kept = parts[1]
        if s.pulls:
            instants(closed, finish, kept)
        else:
            minus = np.zeros(n)
            spread(minus, kept[:spans])
            instants(minus, finish, kept[spans:])
            torque -= minus
        for k in range(len(s.lines)):
            spread(curve[k], parts[2 + k])
        units = {
            "speed": s.most / s.problem.target, "rate": s.c / s.Omega, "torque": 1.0, "contact": s.c,
            "breakaway": 1.0,
        }  # fmt: skip
        value = {name: names.get(name, 0.0) * unit / total for name, unit in units.items()}
        return _Multipliers(
            torque, closed, curve, value["speed"], value["rate"], value["torque"], -value["contact"],
            -value["breakaway"], self.durations,
        )  # fmt: skip


def _even(steps: int, parts: int) -> Vector:
    return np.unique(np.round(np.linspace(0, steps, min(parts, steps) + 1)).astype(int))


def _rows(rows: Matrix, demands: int, columns: int, extra: dict[int, float]) -> Matrix:
    """Rows over all variables and a constant, of rows over the demands in units and a constant."""
    out = np.zeros((rows.shape[0], columns + 1))
    out[:, :demands] = rows[:, :demands]
    out[:, -1] = rows[:, -1]
    for column, value in extra.items():
        out[:, column] = value
    return out


def _with_means(start: _Start, kind: Kind, dt: float) -> Matrix:
    """How the state and the integrals of T, w1 and u move in a step."""
    M = np.zeros((10, 10))
    M[:7, :7] = start.rates[kind]
    M[7, [Z, V]] = start.c, start.d
    M[8, [V, W2]] = 1.0
    M[9, U if start.lag > 0.0 else R] = 1.0
    return np.asarray(expm(M * dt))


def whole_bound(problem: Problem, k_dyn: float, near: tuple[float, float, float] | None = None,
                within: float = 1e-3, work: float = MOST_WORK) -> LowerBound:  # fmt: skip
    """The largest lower bound found on K_dyn of a problem for which `not_certified` has nothing to say.

    `k_dyn` is what is to be judged: the work ends once the bound is within that share of it. `near`, the
    instants of contact, breakaway and end in s of the best start known, make it quicker. `work` limits it.

    >>> from softstart import Drive
    >>> drive = Drive.load("crane-4amtkf").replace(target_speed=60.0, torque_lag=0.005)
    >>> bound = whole_bound(Problem(drive, 0.2883042), 0.92981, (0.02667, 0.02667, 0.2883042))
    >>> 0.928 < bound.k_dyn < 0.9299
    True
    """
    low, high = problem.lowest_torque, problem.highest_torque
    open_at_first = problem.drive.theta0 < 0.5 * problem.drive.gap
    closing = "whose gap closes once and stays closed" if open_at_first else "whose gap stays closed"
    moving = ", the load moving on once it moves," if _rests(problem) else ""
    covers = (
        f"every torque demand from {low:g} to {high:g} N m over time, by whatever controller, "
        f"{closing}{moving} until {ENDINGS[problem.terminal]} and half an elastic period longer"
    )
    peak = certified_peak(problem, k_dyn * problem.base_torque * (1.0 - within), near, work)
    return LowerBound(peak * (1.0 - ROUNDING) / problem.base_torque, "certificate", covers, near=False)


def certified_peak(problem: Problem, goal: float, near: tuple[float, float, float] | None = None,
                   work: float = MOST_WORK, report: Any = None) -> float:  # fmt: skip
    """The least bound over all cells, N m; the search ends at `goal`.

    `near`, the instants of contact, breakaway and end in s of the best start known, make it quicker.
    """
    start = _Start(problem, goal=goal)
    if start.earliest >= start.end:
        return math.inf
    if not start.rests:
        return _least(start, goal, near, work, report, _Free)
    least = _least(start, goal, near, work, report, lambda *at: _Resting(at[0], True, *at[1:]))
    if start.open and len(list(phase_orders(problem))) > 1:
        at_once = _least(start, goal, near, work, report, lambda *at: _Resting(at[0], False, *at[1:]))
        least = min(least, at_once)
    return least


def _least(
    start: _Start, goal: float, near: tuple[float, float, float] | None, left: float, report: Any, kind: Any
) -> float:
    """The least bound over the cells, each raised by multipliers found where it is least, on finer grids."""
    cells: _Free | _Resting = kind(start)
    used: list[_Multipliers] = []
    for finer in range(GRIDS):
        if finer:
            start = _Start(start.problem, FINER * start.n)
            cells = kind(start, cells, goal)
            used = [by.finer(start) for by in used[-KEPT:]]
            for by in used:
                left -= _work(cells, goal)
                cells.raise_by(_Dual(start, by), goal)
        left = _raise(cells, goal, near, left, used, report)
        if cells.least >= goal or left < 3.0 * FINER**2 * _work(cells, goal):
            break
    return cells.least


def _work(cells: Any, goal: float) -> float:
    """How many numbers a set of multipliers takes."""
    found = cells.open_box(goal)
    if found is None:
        return 0.0
    box = float((found[1] - found[0]) * found[3])
    return box if isinstance(cells, _Free) else box * float(cells.start.n - found[0])


def _raise(
    cells: Any, goal: float, near: tuple[float, float, float] | None, left: float, used: list[_Multipliers],
    report: Any,
) -> float:  # fmt: skip
    """On one grid, until the least bound is at the goal or stays; what is left of the work."""
    start = cells.start
    known = None if near is None else _durations(cells, near)
    warm = WarmStarts()
    failures: list[tuple[int, int]] = []
    for _ in range(PROGRAMS):
        cell = cells.worst(failures)
        value = cells.at(cell)
        left -= _work(cells, goal)
        if value >= goal or left < 0.0:
            break
        program = _Program(start, known or cells.instants(cell), warm)
        by = program.solve(goal)
        left -= 20.0 * float(sum(edges.size for _, edges in program.parts)) ** 2
        if by is not None:
            cells.raise_by(_Dual(start, by), goal)
            used.append(by)
        if report:
            now = cells.at(cell)
            report(start.n, cell, known, value, now, program.P, cells.least)
        if known is None and (by is None or cells.at(cell) <= value * (1.0 + GAINED)):
            failures.append(cell)
            if len(failures) > FAILURES:
                break
        known = None
    return left


def _durations(cells: Any, near: tuple[float, float, float]) -> tuple[int, int, int] | None:
    """Those of a known start on the grid."""
    s = cells.start
    tc, tb, te = near
    gap = max(math.ceil(tc / s.h - 1e-9), 1) if s.open else 0
    winding = round((tb - tc) / s.h) if s.rests else 0
    if s.rests and isinstance(cells, _Resting):
        te = s.end
        winding = max(winding, 1) if cells.winds else 0
        if not s.open:
            winding = max(round(tb / s.h), 1)
    contact = math.floor(te / s.h + 1e-9) - gap - winding
    return (gap, winding, contact) if contact > 0 else None
