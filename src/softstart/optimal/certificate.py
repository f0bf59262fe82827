"""The certificate: no torque profile whose gap closes once has a smaller peak.

Weak duality, in continuous time. For any numbers m_j >= 0 with sum 1 (for T(s_j) <= P), n_j >= 0 (for
T(s_j) >= 0) and p_w, p_r, p_T (for the terminal equations), every start that enters moving contact at te with
speed v and goes on for tau under a torque u(s) from 0 to Ms has

    P >= sum m_j T(s_j) - sum n_j T(s_j) - p_w (w2(tau) - target) - p_r z'(tau) - p_T (T(tau) - Mc)
       = k(te, tau) + a(tau) v + integral q(s) u(s) ds
      >= k(te, tau) + min over v of a(tau) v + Ms integral min(q(s), 0) ds  =: D(te, tau),

with the kinks s_j at fixed shares of tau. A linear program gives good numbers for one (te, tau); D is then
a bound for all u at any (te, tau), and is bounded from below over whole cells. Those that prove too little
are split; where D itself is too low, a linear program there gives new numbers. Two plain bounds help:
momentum, J2 (target - w2(te)) <= (P - Mc) tau, where the contact comes too late, and the peak that coasting
from the least v brings where there is time in plenty. Cells, enclosures and rounding: docs/theory/optimum.md.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy import sparse
from scipy.linalg import solve_banded
from scipy.optimize import linprog

from softstart.arrays import Indices, Matrix, Vector
from softstart.optimal.contact_motion import Contact, Entries, cells_before, no_ideal
from softstart.optimal.problem import Problem
from softstart.optimal.result import LowerBound

ROUNDING = 1e-10  # of the absolute terms of D is taken off, and by so much the start time is stretched
MOST_CELLS = 3000  # of tau
NARROWEST = 1e-6  # cell of tau, as a share of the longest
MOST_STEPS = 160  # of the coarse program
TAIL = 120  # instants of coasting at which T is checked
FINE = 0.02  # radians of the elastic oscillation, at most, in a step of the integral of q
MOST_PROGRAMS = 60
CLOSE = 0.01  # share of the longest contact within which programs are finer each time, three at most

ENDINGS = {
    "synchronous": "both masses have the target speed",
    "steady": "both masses have the target speed and the shaft has the load torque",
    "reached": "the target speed is reached",
}


def not_certified(problem: Problem) -> str:
    """Why there is no certificate for a problem; empty if there is one.

    >>> from softstart import Drive
    >>> not_certified(Problem(Drive.load("crane-4amtkf"), 0.5))
    ''
    """
    no_end = "without a bound on the start time any peak above the load torque will do"
    return no_end if problem.start_time is None else no_ideal(problem)


def certified_bound(
    problem: Problem, k_dyn: float, *, entry_near: float | None = None, within: float = 5e-4,
) -> LowerBound:  # fmt: skip
    """The largest lower bound found on K_dyn of a problem for which `not_certified` has nothing to say.

    `k_dyn` is what is to be judged: the work ends once the bound is within that share of it. `entry_near` in
    s, when both masses begin to move in contact in the best start known, makes it quicker.

    >>> from softstart import Drive
    >>> drive = Drive.load("crane-4amtkf").replace(target_speed=60.0)
    >>> bound = certified_bound(Problem(drive, 0.2883042), 0.90924724)
    >>> 0.9085 < bound.k_dyn <= 0.90924724
    True
    """
    assert problem.start_time is not None
    cells = cells_before(problem, problem.start_time * (1.0 + ROUNDING), entry_near)
    goal = k_dyn * problem.base_torque * (1.0 - within)
    peak = _Search(problem, cells, goal, entry_near).least() if cells.te[0] < problem.start_time else math.inf
    closing = "whose gap closes once and stays closed" if cells.opens else "whose gap stays closed"
    moving = ", the load moving on once it moves," if cells.rests else ""
    covers = (
        f"every torque from {problem.lowest_torque:g} to {problem.highest_torque:g} N m over time, by "
        f"whatever controller, {closing}{moving} until {ENDINGS[problem.terminal]}"
    )
    return LowerBound(peak / problem.base_torque, "certificate", covers)


# what given multipliers prove -------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class _Multipliers:
    """The numbers of the sum above, as weights in it, for the terminal equations as p_w, p_r, p_T.

    `of_T` (m less n) and `of_z` (a dead zone, whose damper pulls, has T >= -P and c z >= 0) are those at the
    ends of even steps of the contact, `tail` those of T while coasting after t_f (terminal `reached`).
    """

    of_T: Vector
    of_z: Vector
    tail: Vector
    speed: float
    rate: float
    torque: float


class _Dual:
    """What one set of multipliers, best for one tau, proves at any tau: D without its part in te."""

    def __init__(self, problem: Problem, cells: Entries, by: _Multipliers, tau: float) -> None:
        self.by, self.tau, self.Ms = by, tau, problem.highest_torque
        self.contact = contact = Contact.of(problem.drive)
        self.momentum = by.speed / (contact.J1 + contact.J2)  # q is a free motion less this
        self.of_rate = contact.J1 * self.momentum - by.rate  # weight of z'(tau)
        self.rest = contact.c * contact.Mc / (contact.J2 * contact.Omega**2)  # T about which coasting swings
        self.z0 = cells.z0 - self.rest / contact.c  # first overlap, from there
        self.still, self.growing = self._bent(float(np.max(cells.fastest)))
        self.values: dict[float, tuple[float, float]] = {}

    def at(self, tau: float) -> tuple[float, float]:
        """(what does not depend on v and te, coefficient of v), N m and N m s/rad."""
        if tau in self.values:
            return self.values[tau]
        by, contact, Ms = self.by, self.contact, self.Ms
        twice, square = 2.0 * contact.zeta, contact.Omega**2
        y, rate = self.weights(tau)
        step = tau / y.size
        _, h, dh = (float(one) for one in contact.responses(step))
        first, first_rate = (dh + twice * h) * y + h * rate, dh * rate[0] - square * h * y[0]
        bent = np.hypot(twice * rate + square * y, contact.Omega * rate)  # bounds q'' in the step
        q = np.minimum(y - self.momentum, 0.0) + np.minimum(first - self.momentum, 0.0)
        terms = (
            self.rest * float(by.of_T.sum() + by.of_z.sum() + by.tail.sum()),
            by.torque * (contact.Mc - self.rest),
            self.momentum * contact.Mc * tau,
            self.z0 * contact.J1 * (first_rate + twice * float(first[0])),
            Ms * step * float(np.sum(0.5 * q - bent * (step * step / 12.0))),
        )
        rounded = sum(map(abs, terms)) + Ms * tau * float(np.abs(y).max() + abs(self.momentum))
        by_v = contact.J1 * (float(first[0]) - self.momentum)
        self.values[tau] = sum(terms) - ROUNDING * rounded, by_v
        return self.values[tau]

    def weights(self, tau: float) -> tuple[Vector, Vector]:
        """(y, y') at the end of each step: y = q but for a constant, y' its rate, both backward in time.

        Through the step y moves freely; before the next one it is kicked by what ends there.
        """
        by, contact = self.by, self.contact
        c, d, twice, square = contact.c, contact.d, 2.0 * contact.zeta, contact.Omega**2
        part = max(1, math.ceil(max(contact.Omega, contact.zeta) * tau / (FINE * by.of_T.size)))
        n = part * by.of_T.size
        kicks = np.zeros((n, 2))
        kicks[part - 1 :: part, 0] = d * by.of_T
        kicks[part - 1 :: part, 1] = (c - twice * d) * by.of_T + c * by.of_z
        kicks[-1] += self.of_rate - d * by.torque, -twice * self.of_rate - (c - twice * d) * by.torque
        _, x, y = (float(by.tail @ one) for one in contact.responses(_after(contact)))
        kicks[-1] += c * x + d * y, c * y - d * (twice * y + square * x)
        _, h, dh = (float(one) for one in contact.responses(tau / n))
        band = np.zeros((4, 2 * n))  # of y_k - (what y_k+1 leads to) = kick_k, from the last step on
        band[0, 1::2], band[1, 1::2], band[1, 0::2], band[2, 0::2] = -h, -dh, -dh - twice * h, square * h
        band[3] = 1.0
        states = solve_banded((0, 3), band, kicks.ravel() / contact.J1, check_finite=False)
        return states[0::2], states[1::2]

    def _bent(self, fastest: float) -> tuple[float, float]:
        """At a share x of the contact the second derivative of T, c z or z' is no more than

            x^2 (v |f_v''| + |z0 f_z''| + Ms |g'|) + tau x^3 Ms |g''|/3,    g = f_v/J1,

        with f_v and f_z its responses to a step of v and of z; the parts without and with tau, summed.
        """
        by, contact, push = self.by, self.contact, self.Ms / self.contact.J1
        c, d, twice, square = contact.c, contact.d, 2.0 * contact.zeta, contact.Omega**2
        x = np.arange(1, by.of_T.size + 1) / by.of_T.size
        still, growing = 0.0, 0.0
        for inner, outer, f_v, f_z in (  # weights at the shares and at the end, (f, f') at 0
            (by.of_T, float(by.tail.sum()) + abs(by.torque), (d, c - twice * d), (c, -d * square)),
            (by.of_z, 0.0, (0.0, c), (c, 0.0)),
            (0.0 * x, abs(self.of_rate), (1.0, -twice), (0.0, -square)),
        ):
            rate, bent = contact.swing(*f_v)
            moved = fastest * bent + abs(self.z0) * contact.swing(*f_z)[1] + push * rate
            still += float(np.abs(inner) @ x**2 + outer) * moved
            growing += float(np.abs(inner) @ x**3 + outer) * push * bent / 3.0
        return still, growing


def _after(contact: Contact) -> Vector:
    """Times from now on, at which no torque of 0 or more makes T lower than coasting does."""
    return np.linspace(0.0, min(contact.half_period, math.pi / contact.Omega), TAIL + 1)[1:]


# good multipliers: linear programs --------------------------------------------------------------------------


class _Program:
    """A contact of duration tau, entered in the cell k of te, with u constant in each of n even steps:

        minimise P   subject to   T(s_j) <= P, T(s_j) >= 0          (dead zone: -P <= T(s_j), z(s_j) >= 0)
                                  w2(tau) = target, and             (synchronous) z'(tau) = 0
                                                                    (steady) also T(tau) = Mc
                                                                    (reached) T of the coasting tail <= P
                                  slowest <= v <= fastest,  0 <= u <= Ms

    Variables without dimension: u/Ms, v c/(Omega Ms), P/Ms; s_j: the ends of `parts` equal parts of a step.
    """

    def __init__(self, problem: Problem, cells: Entries, k: int, tau: float, n: int, parts: int) -> None:
        self.n, self.reached = n, problem.terminal == "reached"
        contact, Ms, W = Contact.of(problem.drive), problem.highest_torque, problem.target
        c, Omega, twice, z0 = contact.c, contact.Omega, 2.0 * contact.zeta, cells.z0
        damped, scale, push = contact.d * Omega / c, Ms * Omega / c, contact.Mc / contact.J2
        s = tau / (n * parts) * np.arange(n * parts + 1)
        H, h, dh = contact.responses(s)
        lag = np.arange(1, s.size)[:, None] - parts * np.arange(n)[None, :]

        def rows(by_z: Vector, by_v: Vector, by_u: Vector) -> tuple[Matrix, Vector]:
            """(matrix of the variables, constant), from the responses to z0, to v and to a step of u/J1."""
            u = (by_u[np.maximum(lag, 0)] - by_u[np.maximum(lag - parts, 0)]) / contact.J1
            matrix = np.column_stack([u, by_v[1:] * scale / Ms, np.zeros(n * parts)])
            return matrix, (by_z[1:] * z0 + by_u[1:] * push) / Ms

        self.z = z = rows(c * (dh + twice * h), c * h, c * H)  # c z/Ms
        rate = rows(-c * Omega * h, c / Omega * dh, c / Omega * h)  # c z'/(Omega Ms)
        self.T = z[0] + damped * rate[0], z[1] + damped * rate[1]
        self.pulls = problem.drive.contact_law == "dead-zone" and contact.d > 0.0
        A, by_v, by_load, by_z = contact.torque(tau + _after(contact), np.linspace(0.0, tau, n + 1))
        self.tail = np.column_stack([A, by_v * scale / Ms, np.zeros(TAIL)]), (by_load + by_z * z0) / Ms
        # w2 by momentum: J1 w1 + J2 w2 is what the torques brought
        total, own = (contact.J1 + contact.J2) * W, contact.J1 * scale
        w2 = (np.append(np.full(n, Ms * tau / n), [own, 0.0]) - own * rate[0][-1]) / total
        rest = float(cells.load_speed[k + 1]) / W - (contact.Mc * tau + own * rate[1][-1]) / total
        equations = [
            (w2, 1.0 - rest, Ms / W),
            (rate[0][-1], -rate[1][-1], c / Omega),
            (self.T[0][-1], contact.Mc / Ms - self.T[1][-1], 1.0),
        ][: {"reached": 1, "synchronous": 2, "steady": 3}[problem.terminal]]
        self.equal, self.value, self.units = (np.array(one) for one in zip(*equations, strict=True))
        self.box = np.tile([0.0, 1.0], (n + 2, 1))
        self.box[n:] = np.sort([cells.slowest[k], cells.fastest[k]]) / scale, (0.0, np.inf)  # rounding

    def solve(self, spans: int = 1, kept: Indices | None = None) -> _Multipliers | None:
        """The best multipliers, of means of T over so many instants each, and of T at the instants `kept`.

        The equations may be missed, by the target speed for 40 Ms, so that there always is an answer.
        """
        each = np.eye(self.T[1].size // spans)
        R = sparse.kron(each, np.full((1, spans), 1.0 / spans), format="csr")
        if kept is not None:
            R = sparse.vstack([R, sparse.eye_array(self.T[1].size, format="csr")[kept]], format="csr")
        (T, T0), (z, z0) = ((R @ A, R @ b) for A, b in (self.T, self.z))
        P = np.append(np.zeros(self.n + 1), 1.0)
        limits = [(T - P, -T0), (-T - self.pulls * P, T0)]
        limits += [(-z, z0)] if self.pulls else []
        limits += [(self.tail[0] - P, -self.tail[1])] if self.reached else []
        A, b = (np.concatenate(one) for one in zip(*limits, strict=True))
        slack = np.eye(self.value.size)
        missed = np.zeros((b.size, 2 * self.value.size))
        found = linprog(
            np.append(P, np.full(missed.shape[1], 40.0)), np.hstack([A, missed]), b,
            np.hstack([self.equal, slack, -slack]), self.value,
            np.vstack([self.box, np.tile([0.0, np.inf], (missed.shape[1], 1))]), "highs",
            options={"presolve": False},
        )  # fmt: skip
        if found.status != 0:
            return None
        ends = np.cumsum([right.size for _, right in limits])[:-1]
        worth = np.split(np.maximum(-found.ineqlin.marginals, 0.0), ends)
        peak, low = R.T @ worth[0], R.T @ worth[1]
        of_z = -(R.T @ worth[2]) if self.pulls else np.zeros(low.size)
        tail = worth[-1] if self.reached else np.zeros(TAIL)
        total = float(peak.sum() + self.pulls * low.sum() + tail.sum())
        if not total > 0.0:
            return None
        numbers = np.append(found.eqlin.marginals * self.units / total, [0.0, 0.0])[:3]
        return _Multipliers((peak - low) / total, of_z / total, tail / total, *numbers.tolist())


# all entries and durations ----------------------------------------------------------------------------------


class _Search:
    """Cells of tau (splitting) times cells of te (fixed), and the sets of multipliers found so far."""

    def __init__(self, problem: Problem, cells: Entries, goal: float, near: float | None = None) -> None:
        self.problem, self.cells, self.goal = problem, cells, goal
        self.end = (problem.start_time or 0.0) * (1.0 + ROUNDING)
        self.longest = self.end - float(cells.te[0])
        self.near = float(cells.te[0]) + 0.1 * self.longest if near is None else near
        self.missing = problem.target - cells.load_speed
        self.contact = contact = Contact.of(problem.drive)
        # the peak that the entry alone brings: T is nowhere below that of coasting from the least v
        _, by_v, by_load, by_z = contact.torque(np.append(0.0, _after(contact)), np.zeros(2))
        self.coasting = np.max(np.outer(cells.slowest, by_v) + by_load + by_z * cells.z0, axis=1)
        self.duals: list[_Dual] = []
        self.low: list[tuple[float, float]] = []  # (te, tau) of programs that came no further than the goal
        # for each cell of tau: the bounds so far in the cells of te, the multipliers tried
        self.seen: dict[tuple[float, float], tuple[Vector, set[int]]] = {}

    def least(self) -> float:
        """The least bound over all cells, N m."""
        k = int(np.clip(np.searchsorted(self.cells.te, self.near) - 1, 0, self.cells.slowest.size - 1))
        self._program(k, self.end - self.near)
        edges = self.longest * (1.0 - np.linspace(1.0, 0.0, 25) ** 2)  # finer at the end
        heap = sorted((self._cell(a, b)[0], a, b) for a, b in pairwise(edges.tolist()))
        for _ in range(MOST_CELLS):
            value, a, b = heapq.heappop(heap)
            if value >= self.goal:
                return value
            value, k = self._cell(a, b)  # multipliers may have come since
            narrow = b - a <= NARROWEST * self.longest
            on_time = narrow or float(self.cells.te[k]) + b <= self.end * (1.0 + NARROWEST)
            if value < self.goal and on_time and self._best(self.duals, k, b) < self.goal:
                if self._program(k, b):
                    value, k = self._cell(a, b)
                else:  # as good as it gets here
                    self.goal = min(self.goal, self._best(self.duals, k, b) * (1.0 - 1e-4))
            if narrow:
                self.goal = min(self.goal, value)
            if value >= self.goal:
                heapq.heappush(heap, (value, a, b))
            else:
                for half in ((a, 0.5 * (a + b)), (0.5 * (a + b), b)):
                    heapq.heappush(heap, (self._cell(*half)[0], *half))
        return heap[0][0]

    def _best(self, duals: Sequence[_Dual], k: int, tau: float) -> float:
        """The most that some multipliers prove of the cell k of te with this very tau."""
        values = [float(self._proved(one, tau, tau, slice(k, k + 1))[0]) for one in duals]
        return max(values, default=-math.inf)

    def _cell(self, a: float, b: float) -> tuple[float, int]:
        """Bound over tau from a to b and all te that leave that much time; the te cell where it is least.

        Multipliers are tried, the nearest first, until the bound is enough.
        """
        count = max(int(np.searchsorted(self.cells.te[:-1], self.end - a, side="right")), 1)
        if (a, b) not in self.seen:
            need = np.minimum(self.missing[:-1], self.missing[1:])[:count]
            plain = self.contact.Mc + self.contact.J2 * need / b
            self.seen[a, b] = np.maximum(plain, self.coasting[:count]) * (1.0 - ROUNDING), set()
        best, tried = self.seen[a, b]
        left = [k for k in range(len(self.duals)) if k not in tried]
        for k in sorted(left, key=lambda k: abs(self.duals[k].tau - b)):
            if float(best.min()) >= self.goal:
                break
            best = np.maximum(best, self._proved(self.duals[k], a, b, slice(count)))
            tried.add(k)
        self.seen[a, b] = best, tried
        k = int(np.argmin(best))
        return float(best[k]), k

    def _proved(self, dual: _Dual, a: float, b: float, cells: slice) -> Vector:
        """The bound over tau from a to b of some of the cells of te, by one set of multipliers."""
        low, high = self.cells.slowest[cells], self.cells.fastest[cells]
        ends = [fixed + np.minimum(by_v * low, by_v * high) for fixed, by_v in (dual.at(a), dual.at(b))]
        by_te = np.minimum(dual.by.speed * self.missing[:-1][cells], dual.by.speed * self.missing[1:][cells])
        lowest: Vector = np.minimum(*ends) + by_te - (dual.still + dual.growing * b) * (b - a) ** 2 / 8.0
        return np.where(np.isfinite(lowest), lowest, -math.inf)  # numbers that overflow prove nothing

    def _program(self, k: int, tau: float) -> bool:
        """New multipliers by linear programs at the end of the cell k of te; False where there are no better.

        A coarse one shows at which instants the limits are worth much; a fine one, with means of T over its
        steps instead of T at instants elsewhere, gives multipliers without the ripple of the coarse grid.
        Where that is not enough the next one has more steps; for a damped shaft, as q jumps, more instants.
        """
        te = float(self.cells.te[k + 1])
        tau = min(tau, self.end - te)
        again = sum(abs(te - one) + abs(tau - other) < CLOSE * self.longest for one, other in self.low)
        n = max(80, int(0.75 * self.contact.Omega * tau))
        if tau <= 0.0 or n > MOST_STEPS or again >= 3 or len(self.duals) >= MOST_PROGRAMS:
            return False  # of so many elastic periods momentum alone is as good
        damped, finer = self.contact.d > 0.0, 4
        n, parts = min(int(n * (1.0 if damped else 1.5**again)), MOST_STEPS), 2 * (2**again if damped else 1)
        by = _Program(self.problem, self.cells, k, tau, n, 2).solve()
        if by is None:
            return False
        parted = np.maximum([by.of_T, -by.of_T, -by.of_z], 0.0)
        atoms = np.flatnonzero(np.any(parted > 0.03 * parted.sum(axis=1)[:, None], axis=0))
        part = finer * parts // 2  # instants of the fine program for each of the coarse one
        kept = np.unique(np.add.outer(part * atoms, np.arange(-part - 1, 3 * part)))
        kept = kept[(kept >= 0) & (kept < 2 * n * part)]
        fine = _Program(self.problem, self.cells, k, tau, finer * n, parts).solve(finer * parts, kept)
        self.duals.append(_Dual(self.problem, self.cells, fine or by, tau))
        if self._best(self.duals[-1:], k, tau) < (1.0 + CLOSE) * self.goal:
            self.low.append((te, tau))
        return True
