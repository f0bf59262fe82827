"""The certificate: no torque profile whose gap closes once has a smaller peak.

Weak duality, in continuous time. For any numbers m_j >= 0 with sum 1 (for T(s_j) <= P), n_j >= 0 (for
T(s_j) >= 0) and p_w, p_r, p_T (for the terminal equations), every start that enters moving contact at te with
speed v and goes on for tau under a torque u(s) from 0 to Ms has

    P >= sum m_j T(s_j) - sum n_j T(s_j) - p_w (w2(tau) - target) - p_r z'(tau) - p_T (T(tau) - Mc)
       = k(te, tau) + a(tau) v + integral q(s) u(s) ds
      >= k(te, tau) + min over v of a(tau) v + Ms integral min(q(s), 0) ds  =: D(te, tau),

with the kinks s_j at fixed shares of tau. The linear program gives good numbers for one (te, tau); D is then
a bound for all u at any (te, tau), and is bounded from below over whole cells:

- over te: k is linear in te, the least v at te falls with te, so the ends of a cell decide;
- over tau: at fixed v and u(s/tau) the right side is a function of tau with |second derivative| <= M, so over
  a cell of width w it is nowhere less than the lesser of its ends, minus M w^2/8;
- the integral of min(q, 0) by trapezoids is too high by at most max|q''| h^2/8 per unit of length.

Cells whose bound is too low are split; where that does not help, a linear program there gives new numbers.
Two plain bounds help: momentum, J2 (target - w2(te)) <= (P - Mc) tau, where the contact comes too late, and
the peak that coasting from the least v brings where there is time in plenty.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from softstart.arrays import Indices, Vector
from softstart.optimal.lp.ideal import ContactProgram, Multipliers
from softstart.optimal.lp.motion import Contact, Entry, ThroughStandstill, entry_of, no_ideal
from softstart.optimal.lp.rows import HALVES
from softstart.optimal.problem import Problem
from softstart.optimal.result import LowerBound

ENTRY_CELLS = 3000
FIRST_CELLS = 24  # of tau
PROGRAM_STEPS = 80  # of the coarse program, at least, and at least three quarters a radian
MOST_STEPS = 160
ATOM = 0.03  # share of all multipliers from which an instant counts by itself
TRAPEZOIDS = 2000  # at least, and at least 150 a radian of the elastic oscillation
PRICE = 40.0  # of missing the terminal condition by as much as the target speed, in Ms
MOST_PROGRAMS = 60
FEW, LITTLE = 4, 1e-5  # the work ends when so many programs raise the bound by less than this share
MOST_CELLS = 3000
KEPT = 4  # sets of multipliers that another start time begins with
NARROWEST = 1e-6  # cell of tau, as a share of the longest


def not_certified(problem: Problem) -> str:
    """Why there is no certificate for a problem; empty if there is one.

    >>> from softstart import Drive
    >>> not_certified(Problem(Drive.load("crane-4amtkf"), 0.5))
    ''
    """
    if problem.start_time is None:
        return "without a bound on the start time any peak above the load torque will do"
    return no_ideal(problem)


ENDINGS = {
    "synchronous": "both masses have the target speed",
    "steady": "both masses have the target speed and the shaft has the load torque",
    "reached": "the target speed is reached",
}


def _covers(problem: Problem, entry: Entry) -> str:
    """The class of starts for which the bound is proved."""
    low, high = problem.lowest_torque, problem.highest_torque
    open_at_first = getattr(entry, "travel", 0.0) > 0.0
    closing = "whose gap closes once and stays closed" if open_at_first else "whose gap stays closed"
    moving = ", the load moving on once it moves," if isinstance(entry, ThroughStandstill) else ""
    return (
        f"every torque from {low:g} to {high:g} N m over time, by whatever controller, {closing}{moving} "
        f"until {ENDINGS[problem.terminal]}"
    )


def certified_bound(
    problem: Problem,
    k_dyn: float,
    *,
    entry_near: float | None = None,
    within: float = 5e-4,
    proof: Sequence[Any] = (),
) -> LowerBound:
    """The largest lower bound found on K_dyn of a problem for which `not_certified` has nothing to say.

    `k_dyn` is what is to be judged: the work ends once the bound is within that share of it. `entry_near` in
    s, the instant at which both masses begin to move in contact in the best start known, makes it quicker;
    so does the `proof` of another start time of the drive.

    >>> from softstart import Drive
    >>> drive = Drive.load("crane-4amtkf").replace(target_speed=60.0)
    >>> bound = certified_bound(Problem(drive, 0.2883042), 0.90924724)
    >>> 0.9085 < bound.k_dyn <= 0.90924724
    True
    """
    goal = k_dyn * problem.base_torque * (1.0 - within)
    search = _Search(problem, goal, entry_near)
    known = [one for one in proof if isinstance(one, tuple)]
    peak = search.bound(known)
    duals = sorted(search.duals, key=lambda dual: -dual.worth)[:KEPT]
    return LowerBound(
        peak / problem.base_torque,
        "certificate",
        _covers(problem, entry_of(problem)),
        proof=tuple((dual.by, dual.tau) for dual in duals),
    )


@dataclass
class _Envelope:
    """Largest absolute values over a contact of given length of the kernels and their derivatives."""

    contact: Contact
    longest: float
    kernels: dict[str, tuple[float, float, float]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        contact = self.contact
        J1, J2, c, d = contact.J1, contact.J2, contact.c, contact.d
        rate = max(contact.Omega, 2.0 * contact.zeta)
        first = np.geomspace(1e-3 / rate, self.longest, 2000)
        r = np.unique(np.concatenate([[0.0], first, np.linspace(0.0, self.longest, 4000)]))
        h, h1 = contact.h(r), contact.dh(r)
        h2 = -2.0 * contact.zeta * h1 - contact.Omega**2 * h
        h3 = -2.0 * contact.zeta * h2 - contact.Omega**2 * h1
        margin = 1.1  # between the samples, at most 1/150 of a radian apart for what matters

        def most(*values: Vector) -> tuple[float, float, float]:
            a, b, c_ = (margin * float(np.max(np.abs(v))) for v in values)
            return a, b, c_

        self.kernels = {
            "T": most((c * h + d * h1) / J1, (c * h1 + d * h2) / J1, (c * h2 + d * h3) / J1),
            "z": most(c * h / J1, c * h1 / J1, c * h2 / J1),
            "rate": most(h1 / J1, h2 / J1, h3 / J1),
            "w2": most((1.0 - h1) / (J1 + J2), h2 / (J1 + J2), h3 / (J1 + J2)),
        }
        push = contact.Mc / J2
        z0 = contact.Omega**2
        # second derivatives in time of what v, the load and the first overlap contribute
        self.by_v = {
            "T": margin * float(np.max(np.abs(c * h2 + d * h3))),
            "z": margin * float(np.max(np.abs(c * h2))),
            "rate": margin * float(np.max(np.abs(h3))),
            "w2": margin * float(np.max(np.abs(h3))) * J1 / (J1 + J2),
        }
        self.by_load = {
            "T": margin * push * float(np.max(np.abs(c * h1 + d * h2))),
            "z": margin * push * float(np.max(np.abs(c * h1))),
            "rate": margin * push * float(np.max(np.abs(h2))),
            "w2": margin * push * float(np.max(np.abs(h2))) * J1 / (J1 + J2),
        }
        self.by_overlap = {
            "T": margin * z0 * float(np.max(np.abs(c * h1 + d * h2))),
            "z": margin * z0 * float(np.max(np.abs(c * h1))),
            "rate": margin * z0 * float(np.max(np.abs(h2))),
            "w2": margin * z0 * float(np.max(np.abs(h2))) * J1 / (J1 + J2),
        }

    def curvature(self, kind: str, tau: float, Ms: float, v: float, z0: float) -> float:
        """Bound of |d^2/dtau^2| at any share of a contact of length <= tau, u(s/tau) fixed."""
        _, g1, g2 = self.kernels[kind]
        return (
            Ms * (g1 + tau * g2 / 3.0) + v * self.by_v[kind] + self.by_load[kind] + z0 * self.by_overlap[kind]
        )


class _Dual:
    """One set of multipliers: D without its part in te, at any tau; they are best for one."""

    def __init__(
        self, problem: Problem, entry: Entry, by: Multipliers, envelope: _Envelope, v: float, tau: float
    ) -> None:
        self.problem, self.entry, self.by, self.envelope = problem, entry, by, envelope
        self.tau = tau  # that they are best for
        self.worth = 0  # cells whose bound they raised
        self.contact = envelope.contact
        self.v = v
        self.pulls = problem.drive.contact_law == "dead-zone" and problem.drive.d > 0.0
        net = by.peak - by.trough - (0.0 if self.pulls else by.closed)
        used = (net != 0.0) | (by.closed != 0.0)
        self.share, self.net = by.share[used], net[used]
        self.open = by.closed[used] if self.pulls else np.zeros(self.share.size)
        self._weigh()
        self.grids: dict[int, tuple[Vector, Vector, tuple[Indices, Indices]]] = {}
        self.known: dict[float, tuple[float, float]] = {}
        self.bends: dict[float, float] = {}

    def at(self, tau: float) -> tuple[float, float]:
        """(what does not depend on v and te, coefficient of v), N m and N m s/rad."""
        if tau not in self.known:
            self.known[tau] = self._evaluate(tau)
        return self.known[tau]

    def _evaluate(self, tau: float) -> tuple[float, float]:
        by, contact, problem = self.by, self.contact, self.problem
        z0, c, d = self.entry.z0, contact.c, contact.d
        n = self.share.size
        # at the checked instants, while coasting afterwards, and at the end
        z, rate = contact.coasting(np.concatenate([self.share * tau, tau + by.tail_at, [tau]]))
        T_v, a_0, a_z = (c * one + d * other for one, other in zip(z, rate, strict=True))
        T_0 = a_0 + a_z * z0
        z_v, z_0, r_v, r_0 = z[0], z[1] + z[2] * z0, rate[0][-1], rate[1][-1] + rate[2][-1] * z0
        # momentum: J1 w1 + J2 w2 is what the torques brought
        total = contact.J1 + contact.J2
        w_v = contact.J1 * (1.0 - rate[0][-1]) / total
        w_0 = (-contact.Mc * tau - contact.J1 * rate[1][-1]) / total + -contact.J1 * rate[2][-1] / total * z0
        a_v = self.net @ T_v[:n] - c * (self.open @ z_v[:n]) + by.tail @ T_v[n:-1]
        a_v = a_v - by.speed * w_v - by.rate * r_v - by.torque * T_v[-1]
        fixed = self.net @ T_0[:n] - c * (self.open @ z_0[:n]) + by.tail @ T_0[n:-1]
        fixed = fixed - by.speed * w_0 - by.rate * r_0 - by.torque * (T_0[-1] - problem.drive.Mc)
        fixed += self._by_torque(tau)
        return float(fixed), float(a_v)

    def _by_torque(self, tau: float) -> float:
        """Ms times the integral of min(q, 0), from below."""
        if tau <= 0.0:
            return 0.0
        wanted = max(TRAPEZOIDS, int(150.0 * self.contact.Omega * tau))
        shares, widths, first = self._grid(wanted)
        Ms, step = self.problem.highest_torque, tau / wanted
        # q jumps at the kinks of a damped shaft, and at tau: each interval has its own values at its ends
        after, before = (np.minimum(q, 0.0) for q in self._weights(shares * tau, tau, first))
        area = 0.5 * tau * float(widths @ (after[:-1] + before[1:]))
        return Ms * (area - self._bend() * step * step / 8.0 * tau)

    def _grid(self, wanted: int) -> tuple[Vector, Vector, tuple[Indices, Indices]]:
        """Instants as shares of tau, even ones and the kinks; their distances; the first kinks there."""
        if wanted not in self.grids:
            shares = np.unique(np.concatenate([np.linspace(0.0, 1.0, wanted + 1), self.share]))
            self.grids[wanted] = shares, np.diff(shares), self._first(shares)
        return self.grids[wanted]

    def _first(self, shares: Vector) -> tuple[Indices, Indices]:
        """For each instant, a share of tau, the first kink after it, and not before it."""
        kinks = np.where(self.later > 0.0, np.inf, self.kinks)
        return np.searchsorted(kinks, shares, side="right"), np.searchsorted(kinks, shares)

    def _bend(self) -> float:
        """Bound of |q''| between the kinks."""
        by, k = self.by, self.envelope.kernels
        T = float(np.abs(self.net).sum() + by.tail.sum()) + abs(by.torque)
        return (
            T * k["T"][2]
            + float(self.open.sum()) * k["z"][2]
            + abs(by.rate) * k["rate"][2]
            + abs(by.speed) * k["w2"][2]
        )

    def _weigh(self) -> None:
        """q(s) as a sum over rising instants `kinks` tau + `later`: the weights of h and of h' there."""
        by, contact = self.by, self.contact
        J1, J2, c, d = contact.J1, contact.J2, contact.c, contact.d
        kinks = np.concatenate([self.share, np.ones(1 + by.tail_at.size)])
        later = np.concatenate([np.zeros(self.share.size + 1), by.tail_at])
        of_h = np.concatenate([c * (self.net - self.open), [-c * by.torque], c * by.tail]) / J1
        of_dh = np.concatenate([d * self.net, [-d * by.torque], d * by.tail]) / J1
        of_dh[self.share.size] += by.speed / (J1 + J2) - by.rate / J1
        order = np.lexsort((later, kinks))
        order = order[(of_h[order] != 0.0) | (of_dh[order] != 0.0)]
        self.kinks, self.later, self.of_h, self.of_dh = (one[order] for one in (kinks, later, of_h, of_dh))

    def _weights(self, s: Vector, tau: float, first: tuple[Indices, Indices]) -> tuple[Vector, Vector]:
        """q(s): what a torque impulse just after s, and just before it, adds."""
        after, before = self.contact.sums(s, self.kinks * tau + self.later, self.of_h, self.of_dh, first)
        end = self.by.speed / (self.contact.J1 + self.contact.J2)
        return after - end, before - end

    def curvature(self, tau: float) -> float:
        """M: bound of the second derivative in tau, for a contact of length <= tau."""
        if tau not in self.bends:
            self.bends[tau] = self._curvature(tau)
        return self.bends[tau]

    def _curvature(self, tau: float) -> float:
        by, e = self.by, self.envelope
        Ms, v, z0 = self.problem.highest_torque, self.v, self.entry.z0

        def of(kind: str) -> float:
            return e.curvature(kind, tau, Ms, v, z0)

        return (
            float(np.abs(self.net).sum() + by.tail.sum()) * of("T")
            + float(self.open.sum()) * of("z")
            + abs(by.speed) * of("w2")
            + abs(by.rate) * of("rate")
            + abs(by.torque) * of("T")
        )


def _entry_cells(first: float, last: float, near: float | None) -> Vector:
    """Edges of the cells of te: finest at the first instant, where the least v falls steepest, and `near`."""
    if last <= first:
        return np.array([first, first])
    x = np.linspace(0.0, 1.0, ENTRY_CELLS + 1)
    edges = [first + (last - first) * x * x]
    if near is not None and first < near < last:
        edges += [near + (last - near) * x**3, near - (near - first) * x**3]
    return np.unique(np.concatenate(edges))


class _Search:
    """Cells of tau (splitting) times cells of te (fixed), and the sets of multipliers found so far."""

    def __init__(self, problem: Problem, goal: float, entry_near: float | None = None) -> None:
        assert problem.start_time is not None
        self.problem, self.goal, self.end = problem, goal, float(problem.start_time)
        self.near = entry_near
        self.entry = entry_of(problem)
        self.first = self.entry.earliest
        last = min(self.entry.latest, self.end)
        self.edges = _entry_cells(self.first, last, entry_near)
        starts, ends = self.edges[:-1], self.edges[1:]
        self.low = self.entry.slowest(ends)
        self.high = self.entry.fastest_between(starts, ends)
        self.missing = problem.target - self.entry.load_speed(self.edges)
        self.fastest = float(np.max(self.high))
        contact = Contact.of(problem.drive)
        coasting = min(contact.half_period, math.pi / contact.Omega)  # after t_f
        self.envelope = _Envelope(contact, self.end + coasting)
        self.impact = self._impact()
        self.duals: list[_Dual] = []
        # of each cell the bounds so far, and the sets of multipliers that they are from
        self.seen: dict[tuple[float, float], tuple[Vector, set[int]]] = {}

    def _impact(self) -> Vector:
        """The peak that the entry alone brings, N m: T is nowhere below that of coasting from the least v."""
        contact = self.envelope.contact
        s = np.linspace(0.0, min(contact.half_period, math.pi / contact.Omega), 201)
        _, a_v, a_0, a_z = contact.torque(s, np.array([0.0, 1.0]))
        rest = a_0 + a_z * self.entry.z0
        worst = np.max(self.low[:, None] * a_v[None, :] + rest[None, :], axis=1)
        return np.asarray(worst)

    def bound(self, known: Sequence[tuple[Multipliers, float]] = ()) -> float:
        """The least bound over all cells, N m; it begins with `known` multipliers, with their contacts."""
        if self.first >= self.end:
            return math.inf
        longest = self.end - self.first
        near = self.near if self.near is not None else self.first + 0.1 * longest
        self.duals = [
            _Dual(self.problem, self.entry, by, self.envelope, self.fastest, tau) for by, tau in known
        ]
        if not known:
            self._program(near, self.end - near)
        heap: list[tuple[float, float, float]] = []
        for a, b in zip(*self._cells(longest), strict=True):
            self._push(heap, a, b)
        done = math.inf
        splits, before = 0, list[float]()
        while splits < MOST_CELLS:
            value, a, b = heapq.heappop(heap)
            if value >= done:
                return done
            if value >= self.goal:  # enough; as much as all multipliers prove is said
                most = self._cell(a, b, all_of_them=True)[0]
                if most == value:
                    return value
                heapq.heappush(heap, (most, a, b))
                continue
            splits += 1
            value, k = self._cell(a, b)  # multipliers may have come since
            if value < self.goal and not self._loose(a, b, k) and len(self.duals) < MOST_PROGRAMS:
                if len(before) >= FEW and value - before[-FEW] < LITTLE * self.goal:
                    return min(value, done, *(lowest for lowest, _, _ in heap[:1]))
                before.append(value)
                self._program(float(self.edges[k + 1]), b)
                value, k = self._cell(a, b)
            if value >= self.goal:
                heapq.heappush(heap, (value, a, b))
            elif b - a > NARROWEST * longest:
                middle = 0.5 * (a + b)
                self._push(heap, a, middle)
                self._push(heap, middle, b)
            else:
                done = min(done, value)  # as good as it gets here
            if not heap:
                return done
        return min(done, heap[0][0])

    def _cells(self, longest: float) -> tuple[list[float], list[float]]:
        """First cells of tau, finer towards the longest."""
        edges = longest * (1.0 - (1.0 - np.linspace(0.0, 1.0, FIRST_CELLS + 1)) ** 2)
        return edges[:-1].tolist(), edges[1:].tolist()

    def _push(self, heap: list[tuple[float, float, float]], a: float, b: float) -> None:
        heapq.heappush(heap, (self._cell(a, b)[0], a, b))

    def _loose(self, a: float, b: float, k: int) -> bool:
        """Whether the cell's width costs too much: by curvature, or by reaching past the start time."""
        if b - a <= NARROWEST * self.end:
            return False
        if float(self.edges[k]) + b > self.end + 1e-6 * self.end:
            return True
        bend = min((dual.curvature(b) for dual in self.duals), default=0.0)
        return bend * (b - a) ** 2 / 8.0 > 1e-4 * self.goal

    def _cell(self, a: float, b: float, all_of_them: bool = False) -> tuple[float, int]:
        """Bound over tau from a to b and all te that leave that much time; the te cell where it is least.

        Multipliers are tried, the nearest first, until the bound is enough, or `all_of_them`.
        """
        count = int(np.searchsorted(self.edges[:-1], self.end - a, side="right"))
        count = max(min(count, self.low.size), 1)
        if (a, b) not in self.seen:
            need = np.minimum(self.missing[:-1], self.missing[1:])[:count]
            plain = self.problem.drive.Mc + self.problem.drive.J2 * need / b
            self.seen[a, b] = np.maximum(plain, self.impact[:count]), set()
        best, tried = self.seen[a, b]
        if tried or float(best.min()) < self.goal:  # else no multipliers are needed here
            left = [k for k in range(len(self.duals)) if k not in tried]
            for k in sorted(left, key=lambda k: abs(self.duals[k].tau - b)):
                if not all_of_them and float(best.min()) >= self.goal:
                    break
                found = self._dual(self.duals[k], a, b, count)
                self.duals[k].worth += bool(np.any(found > best))
                best = np.maximum(best, found)
                tried.add(k)
        self.seen[a, b] = best, tried
        k = int(np.argmin(best))
        return float(best[k]), k

    def _dual(self, dual: _Dual, a: float, b: float, count: int) -> Vector:
        speed = dual.by.speed
        by_te = np.minimum(speed * self.missing[:-1], speed * self.missing[1:])[:count]
        ends = []
        for tau in (a, b):
            fixed, a_v = dual.at(tau)
            by_v = np.minimum(a_v * self.low[:count], a_v * self.high[:count])
            ends.append(fixed + by_v)
        lowest: Vector = np.minimum(*ends) + by_te - dual.curvature(b) * (b - a) ** 2 / 8.0
        return np.where(np.isfinite(lowest), lowest, -math.inf)  # numbers that overflow prove nothing

    def _program(self, te: float, tau: float) -> None:
        """New multipliers from linear programs at (te, tau).

        A coarse one shows at which instants the limits are worth much; a fine one, with means of T over
        spans instead of T at instants elsewhere, gives multipliers without the ripple of the coarse grid.
        """
        tau = min(tau, self.end - te)
        if tau <= 0.0:
            return
        coarse = max(PROGRAM_STEPS, int(0.75 * self.envelope.contact.Omega * tau))
        if coarse > MOST_STEPS:
            return  # so many elastic periods that momentum alone is as good
        answer = ContactProgram(self.problem, tau, coarse, None, HALVES, 0.0).solve(te, elastic=PRICE)
        if answer is None:
            return
        by = answer.multipliers
        grid = np.linspace(0.0, 1.0, 4 * coarse + 1)
        shares = (grid[:-1, None] + np.diff(grid)[:, None] * np.array(HALVES)).ravel()
        spans = np.kron(np.eye(coarse), np.full((1, shares.size // coarse), coarse / shares.size))
        kept = np.zeros(shares.size, dtype=bool)
        for worth in (by.peak, by.trough, by.closed):
            if worth.sum() > 0.0:
                for share in by.share[worth > ATOM * worth.sum()]:
                    kept |= np.abs(shares - share) < 1.01 / coarse
        mix = np.vstack([spans, np.eye(shares.size)[kept]])
        fine = ContactProgram(self.problem, tau, grid, mix, HALVES, 0.0).solve(te, elastic=PRICE)
        if fine is not None:
            by = fine.multipliers
        if math.isclose(float(by.peak.sum() + by.trough.sum() + by.tail.sum()), 1.0, rel_tol=1e-9):
            self.duals.append(_Dual(self.problem, self.entry, by, self.envelope, self.fastest, tau))
