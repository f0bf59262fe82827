"""Weak duality over the whole start: what one set of multipliers proves of starts with any durations.

Let te be the end, tau the time in contact (of a load at rest: from its breakaway on), w the time in which the
shaft of a load at rest is wound up before, g the time in the gap, and x = te - t. Multipliers are m(x) >= 0
with integral 1 (for T <= P), n(x) >= 0 (for T >= 0), rho >= 0 (for the torque-speed curve: over x in contact,
over the time before the breakaway and before the contact earlier) and free ones for the terminal equations,
for z = 0 at the contact (mu) and for T = Mc at the breakaway. For each demand r of a start of the class

    P >= L(tau, w, g; r) = constants + integral q r dx,    p' = p A + (m - n) T + ..., q = p b

with the adjoint state p, which runs backward through the phases. F is the least L over all demands between
their limits: the integral of phi(q), the lesser of q lowest and q highest; with a limited rate the exact
minimum over all that rise and fall no faster, by a recursion over the steps (`_take`).

From nodes to cells. F is computed at the nodes of an even grid of two durations. A function with f'' <= M is
nowhere below the lesser of its ends minus M h^2/8. Without a limited rate F itself has such an M along each
axis: phi is concave, its slopes are demands. With one, L has it for each demand, held over x where the end
stays, over t where it moves; a jump of q that moves then counts with the rate. M is made of bounds of p' and
p'' over the whole cell: exact at nodes, carried on by exponentials of |A|, or by the energy that a swing of
the wound shaft does not gain. Trapezoids of phi(q) are too high by at most max|q''| h^3/12 times the largest
torque, means of q times means of r by max|q'| h^3/12 times the rate.

Without load torque a damped shaft is steady only after c z + d z' was a little below 0, where T is 0: T may
be up to `below` above the linear one there, at its price. Behind a limited rate the demand at a steady end is
the load torque, as in the statement: V becomes steep on both sides of it.

Where a load rests, each cell has a gap of its own. There q is a constant, a multiple of x and, behind a lag,
one of exp(-x/lag) together: the integral of phi(q) is known in closed form (`_freely`), unless the rate is
limited or the curve has multipliers there.

Left out, which can only lower the bound: the limits of twist and torque before the contact, and |T| <= P
where the dead zone pulls.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.linalg import expm

from softstart.arrays import Matrix, Vector
from softstart.kernel.jit import compiled
from softstart.optimal.lp.motion import MARGIN, Contact
from softstart.optimal.lp.whole import ONE, STATES, W2, Kind, R, U, V, Z, phase_rates
from softstart.optimal.lp.whole_search import phase_orders
from softstart.optimal.problem import Problem

FINER = 3  # each grid has so many times the steps of the one before
STEEP = 1e4  # N m of P for each N m by which the demand misses the one that holds a steady end
LAST = STATES  # place of what is gathered, beside the adjoint state


@dataclass(frozen=True, eq=False)
class Multipliers:
    """On the steps of the grid; densities over x, of `winding` and `gap` before their end."""

    torque: Vector  # net of T <= P and T >= 0
    closed: Vector  # of c z >= 0 where the dead zone pulls
    curve: Matrix  # (lines, steps), in contact
    winding: Matrix  # of the curve too
    gap: Matrix
    speed: float
    rate: float
    end_torque: float
    contact: float  # of z = 0, beside what the contact makes of z
    breakaway: float
    durations: tuple[int, int, int]  # of the program: in the gap, winding up, in contact, in steps
    end: float  # start time, s

    def on(self, start: Start) -> Multipliers:
        """The same on the grid of a start of this drive; in another start time stretched in the contact.

        Any multipliers prove something. What of them is beyond the grid is moved to its ends, so that those
        of T <= P still have the integral 1; none passes te, up to which T >= 0.
        """
        steps = self.gap.shape[1]
        stretch = 1.0 if math.isclose(self.end, start.end, rel_tol=1e-12) else self._stretch(start.end)
        h = self.end / steps

        def cut(values: Any, tail: int, wide: int, by: float) -> Any:
            """Densities over `tail` steps before and all after 0 on `wide` + n steps."""
            rows = np.atleast_2d(values)
            edges = by * h * (np.arange(values.shape[-1] + 1) - tail)
            new = start.h * (np.arange(wide + start.n + 1) - wide)
            found = np.zeros((rows.shape[0], new.size))
            for row, into in zip(np.cumsum(rows, axis=1), found, strict=True):
                into[:] = np.interp(new, edges, np.append(0.0, row))
                into[0], into[-1] = 0.0, row[-1]
            moved = np.diff(found, axis=1) * (h / start.h)
            return moved.reshape(*values.shape[:-1], new.size - 1)

        tail = self.torque.size - steps
        durations = (round(one * h / start.h) for one in self.durations)
        gap, winding, contact = durations
        return replace(
            self, end=start.end, torque=cut(self.torque, tail, start.tail, stretch),
            closed=cut(self.closed, tail, start.tail, stretch),
            curve=cut(self.curve, tail, start.tail, stretch),
            winding=cut(self.winding, 0, 0, 1.0), gap=cut(self.gap, 0, 0, 1.0),
            durations=(gap, winding, max(round(contact * stretch), 1)),
        )  # fmt: skip

    def _stretch(self, end: float) -> float:
        """By how much longer the contact is where the time before it is the same."""
        before = (self.durations[0] + self.durations[1]) * self.end / self.gap.shape[1]
        return max((end - before) / max(self.end - before, 1e-300), 0.1)


class Phase:
    """Rates of (p, what is gathered) as a row in a phase, how they move in h s, and bounds of that."""

    def __init__(self, rates: Matrix, h: float) -> None:
        self.A = np.zeros((LAST + 1, LAST + 1))
        self.A[:STATES, :STATES], self.A[:STATES, LAST] = rates[:STATES, :STATES], rates[:STATES, ONE]
        self.b = np.append(rates[:STATES, R], 0.0)
        wide = np.zeros((2 * LAST + 2, 2 * LAST + 2))
        wide[: LAST + 1, : LAST + 1], wide[: LAST + 1, LAST + 1 :] = self.A, np.eye(LAST + 1)
        moved = expm(wide * h)
        self.E, self.sources = moved[: LAST + 1, : LAST + 1].copy(), moved[: LAST + 1, LAST + 1 :]
        self.spread = expm(np.abs(self.A) * h)  # |p| within a step is at most |p| spread
        self.weight = self.spread @ np.abs(self.b)


class Start:
    """The problem on an even grid of x = te - t: `n` steps of h s in the start, `tail` after its end."""

    def __init__(self, problem: Problem, n: int) -> None:
        assert problem.start_time is not None
        drive: Any = problem.drive
        self.problem = problem
        self.J1, self.J2, self.c, self.d, self.Mc = (
            float(value) for value in (drive.J1, drive.J2, drive.c, drive.d, drive.Mc)
        )
        self.end = float(problem.start_time)
        self.low, self.high = problem.lowest_torque, problem.highest_torque
        self.most = max(self.high, -self.low)
        self.rate = float(drive.torque_rate)
        self.limited = self.rate < math.inf
        # a demand of limited rate is at te what holds the steady state from then on
        self.held = self.Mc if self.limited and problem.terminal == "steady" else math.nan
        self.rests = rests(problem)
        self.open = bool(drive.theta0 < 0.5 * drive.gap)
        self.pulls = drive.contact_law == "dead-zone" and self.d > 0.0
        self.contact = Contact.of(drive)
        self.Omega = self.contact.Omega
        self.earliest = min(order.tc for order in phase_orders(problem)) if self.open else 0.0
        self.n = n
        self.h = self.end / self.n
        self.n0 = int(min(max(self.earliest / self.h - 1e-9, 0.0), self.n))
        if 0.0 < drive.torque_lag < 3.0 * self.h:
            drive = drive.replace(torque_lag=0.0)  # a quicker motor can do what a slower one can
        self.lag = float(drive.torque_lag)
        self.tail = max(1, int(min(self.contact.half_period, math.pi / self.Omega) / self.h))
        kinds: tuple[Kind, ...] = ("gap", "resting", "stuck", "contact")
        self.rates = {kind: phase_rates(drive, kind) for kind in kinds}
        self.phases = {kind: Phase(self.rates[kind], self.h) for kind in kinds}
        self.T = np.array([self.c, self.d, 0.0, 0.0, 0.0])
        self.spans: dict[Any, Any] = {}  # of linear programs on this grid (whole_certificate.py)
        self.pull = 0.0 if self.rests else self.Mc / self.J2
        v0 = float(drive.initial_motor_speed - drive.initial_load_speed)
        z0 = float(drive.theta0 - 0.5 * drive.gap)
        u0 = problem.first_torque if self.lag > 0.0 else 0.0
        self.first = np.array([z0, v0, float(drive.initial_load_speed), u0, 1.0])
        self.lines = [
            ((u_b - u_a) / (w_b - w_a), w_a, u_a) for (w_a, u_a), (w_b, u_b) in pairwise(problem.torque_speed)
        ]
        self.below = np.zeros(self.tail + self.n)  # by how much T may be below 0 in a step, N m
        if problem.terminal == "steady" and self.Mc < MARGIN * self.high and self.d > 0.0:
            half = math.pi / self.Omega
            last = max(half, -math.log(MARGIN) * self.d / self.c)
            self.below[: self.tail + math.ceil(last / self.h)] = MARGIN * self.high * half / last

    def refined(self, times: int) -> Start:
        """The same on a grid that is finer so many times."""
        return Start(self.problem, FINER**times * self.n)

    def walked(self, by: Multipliers) -> int:
        """Steps in the gap, back from the contact, that are computed one by one; the rest is in closed form.

        Where the load rests, the rate is not limited and the curve has no multipliers (`_freely`).
        """
        if not self.rests or self.limited:
            return self.n
        some = np.flatnonzero(by.gap.any(axis=0))
        return int(some[-1]) + 1 if some.size else 0

    def curve_sources(self, density: Matrix) -> Matrix:
        """What a density (lines, steps) over the lines of the curve adds to the adjoint state."""
        weights = np.zeros((len(self.lines), LAST + 1))
        for k, (slope, w, u) in enumerate(self.lines):
            weights[k, [V, W2]] = -slope
            weights[k, U] = 1.0 if self.lag > 0.0 else 0.0
            weights[k, LAST] = slope * w - u
        return np.asarray(density.T @ weights)


def rests(problem: Problem) -> bool:
    """Whether the load stands still until its breakaway."""
    return bool(problem.drive.load_kind == "reactive" and problem.drive.Mc > 0.0)


class _Early:
    """The curve in a phase before the contact: sources of the adjoint state and of q, and their changes."""

    def __init__(self, start: Start, density: Matrix, phase: Phase) -> None:
        self.phase = phase
        self.sources = start.curve_sources(density)
        self.added = self.sources @ phase.sources
        self.direct = density.sum(axis=0) if start.lag == 0.0 else np.zeros(start.n)
        steps = np.abs(np.diff(self.sources, axis=0, append=0.0)).sum(axis=0)
        self.on_V, self.on_U = float(steps[V]), float(steps[U])  # total changes after the first step
        self.on_q = float(np.abs(np.diff(self.direct, prepend=0.0, append=0.0)).sum())
        self.most_U = float(np.abs(self.sources[:, U]).max())


class Dual:
    """One set of multipliers, and the bound of the starts with any two durations."""

    def __init__(self, start: Start, by: Multipliers) -> None:
        self.start, self.by = start, by
        self.gap = _Early(start, by.gap, start.phases["resting" if start.rests else "gap"])
        self.winding = _Early(start, by.winding, start.phases["stuck"])
        self._contact()
        _, winding, contact = by.durations
        at = self.p[contact] + (by.breakaway * start.T if winding else 0.0)
        for k in range(winding):
            at = at @ self.winding.phase.E + self.winding.added[k]
        self.mu = by.contact + float(at[Z])  # what the program's start makes of z at the contact
        self.max_V = float(np.abs(self.mu + self.gap.sources[:, V]).max())

    def _contact(self) -> None:
        """The adjoint state over the whole grid as if the contact began there, and bounds of its rates."""
        s, by, phase = self.start, self.by, self.start.phases["contact"]
        n, h = s.tail + s.n, s.h
        sources = by.torque[:, None] * s.T + s.curve_sources(by.curve)
        sources[:, Z] -= s.c * by.closed
        added = sources @ phase.sources
        p = np.zeros((n + 1, LAST + 1))
        _recursion(phase.E, added, p, 0, s.tail)
        after_end = p[s.tail].copy()  # just after te
        end = np.zeros(LAST + 1)
        end[[W2, V, LAST]] = -by.speed, -by.rate, by.speed * s.problem.target + by.end_torque * s.Mc
        end -= by.end_torque * s.T
        p[s.tail] += end
        _recursion(phase.E, added, p, s.tail, n)
        starts, ends = p[:-1], p[1:].copy()
        ends[s.tail - 1] = after_end
        direct = by.curve.sum(axis=0) if s.lag == 0.0 else np.zeros(n)
        self.q = starts @ phase.b + direct, ends @ phase.b + direct
        d1 = starts @ phase.A + sources
        d2 = d1 @ phase.A
        a1, a2 = np.abs(d1) @ phase.spread, np.abs(d2) @ phase.spread
        slope, bend = a1 @ np.abs(phase.b), a2 @ np.abs(phase.b)
        self.lost = (s.most * bend + (s.rate if s.limited else 0.0) * slope) * h**3 / 12.0
        if s.below.any():  # T = max(0, c z + d z') may lie above the linear one by so much, not below it
            on_T = np.array([0.0, -1.0 / s.J1 - 1.0 / s.J2, 1.0 / s.J2, 0.0, 0.0])
            worth = np.minimum(starts @ on_T, ends @ on_T) - a2 @ np.abs(on_T) * (h**2 / 8.0)
            self.lost += s.below * h * np.maximum(-by.torque - worth, 0.0)
            self.lost[s.tail] += s.below[s.tail] * max(by.end_torque, 0.0)
        jumps = np.abs(np.diff(direct, prepend=0.0))
        jumps[s.tail] += abs(end @ phase.b)
        here = slice(s.tail, None)
        self.p, self.sources, self.direct = p[s.tail :], sources[here], direct[here]
        self.d1, self.d2, self.a1, self.a2 = d1[here], d2[here], a1[here], a2[here]
        self.turns = np.cumsum(h * slope + jumps)[here]  # of q, up to the end of each step

    def weights(self, durations: tuple[int, int, int]) -> tuple[Vector, Vector]:
        """Instants in s and q, the weight of the demand there, of a start with these durations in steps.

        (In the gap, winding up, in contact), as in `Multipliers.durations`; to the end of the swing after te.
        """
        s, (open_steps, winding, contact) = self.start, durations
        q = [*self.q[0][: s.tail + contact]]
        at = self.p[contact].copy()
        if winding:
            at += self.by.breakaway * s.T
        for early, steps in ((self.winding, winding), (self.gap, open_steps)):
            if early is self.gap and s.open:
                at[Z] = self.mu
            for k in range(steps):
                q.append(float(at @ early.phase.b) + early.direct[k])
                at = at @ early.phase.E + early.added[k]
        return np.asarray(s.h * (sum(durations) + s.tail - np.arange(len(q)))), np.array(q)

    # bounds at the nodes ---------------------------------------------------------------------------------

    def nodes(self, i: Any, k: Any, winds: bool) -> Vector:
        """F at nodes, each of tau = i steps, and k steps of w or g where there are two durations."""
        s = self.start
        first, spans = spans_of(i, k)
        before = np.cumsum(np.append(0, np.maximum(spans[:, 1] - spans[:, 0] + 1, 0)))
        joint = np.zeros(LAST + 1)
        if winds:
            joint = self.by.breakaway * s.T
            joint[LAST] = -self.by.breakaway * s.Mc
        steps = s.tail + 2 * s.n + 4
        kinks, counted = np.empty((3, 4, 2 * steps)), np.zeros((3, 4), dtype=np.int64)
        early = [
            np.vstack([one.phase.E, one.phase.A, one.phase.b[None], one.phase.weight[None]])
            for one in (self.winding, self.gap)
        ]
        out = np.full(before[-1], -math.inf)
        _walk(
            first, spans, before, s.n, s.tail, s.rests, s.open, winds, self.p, joint, self.mu,
            np.array(self.q), self.lost,
            early[0], self.winding.added, self.winding.sources, self.winding.direct,
            early[1], self.gap.added, self.gap.sources, self.gap.direct,
            s.walked(self.by), s.J1, s.lag,
            s.first, s.problem.first_demand, s.held, s.h, s.low, s.high, s.rate if s.limited else -1.0,
            kinks, counted, np.zeros((3, 2)), np.empty((4, LAST + 1)), out,
        )  # fmt: skip
        row = np.asarray(i) - first
        return np.asarray(out[before[row] + k - spans[row, 0]])

    # bounds of cells -------------------------------------------------------------------------------------

    def cells(self, i: Any, k: Any, winds: bool) -> Vector:
        """What is proved of cells: tau from i to i + 1 steps, and from k to k + 1 steps

        w with a load at rest that is wound up across the gap, g with a load that moves; else k = 0, and te
        moves with tau, or stays where the load rests.
        """
        s = self.start
        loss = s.h**2 / 8.0
        if not s.open or (s.rests and not winds):
            f = self.nodes(np.append(i, i + 1), np.append(k, k), winds).reshape(2, -1)
            if not s.rests:
                M = self._touching(i)
            elif winds:
                M = self._along_winding(i, s.h * (s.n - i), 0.0)[2]
            else:
                M = self._along_gap(i, s.h * (s.n - i))[2]
            return np.asarray(f.min(axis=0) - M * loss)
        corners = (
            np.tile(i, 4) + np.repeat([0, 1, 0, 1], i.size),
            np.tile(k, 4) + np.repeat([0, 0, 1, 1], i.size),
        )
        f = self.nodes(*corners, winds).reshape(4, -1)
        if s.rests:
            g = s.h * np.maximum(s.n - i - k, 0)
            M_tau, M_other, M_diagonal = self._along_winding(i, s.h * (k + 1.0), g)
        else:
            M_tau, M_other, M_diagonal = self._along_gap(i, s.h * (k + 1.0))
        whole = i + k + 2 <= s.n
        f[3, ~whole] = math.inf
        # of a cell cut by the last end, or by the beginning, the triangle below its diagonal
        across = np.where(whole, M_other, np.maximum(M_other, M_diagonal))
        return np.asarray(f.min(axis=0) - (M_tau + across) * loss)

    def _touching(self, i: Any) -> Vector:
        """M where the contact lasts from the beginning: along te = tau."""
        s, phase = self.start, self.start.phases["contact"]
        by_demand = abs(s.problem.first_demand) if s.limited else s.most
        M = by_demand * (self.a1[i] @ np.abs(phase.b)) + self.a2[i] @ np.abs(s.first)
        return np.asarray(M + (s.rate * self.turns[i] if s.limited else 0.0))

    def _along_gap(self, i: Any, g: Any) -> tuple[Vector, Vector, Vector]:
        """M along tau, along g, and along tau while te stays, of cells with a gap of up to g s."""
        s, gap, phase = self.start, self.gap, self.start.phases["contact"]
        most, J1, lag, h = s.most, s.J1, s.lag, s.h
        a1, a2 = self.a1[i], self.a2[i]
        _, v0, w0, u0, _ = np.abs(s.first)
        (V1, U1, L1), (V2, U2, L2) = ([a[:, one] for one in (V, U, W2)] for a in (a1, a2))
        max_V = self.max_V
        by_W2 = float(np.abs(gap.sources[:, W2]).max())
        if lag > 0.0:
            p = self.p[i]
            at_first = np.abs(p[:, V] / J1 - p[:, U] / lag + gap.sources[0, U])  # of p_U'
            at_first = at_first + h * (U1 / lag + V1 / J1)
            begun = np.exp(-np.maximum(g - h, 0.0) / lag)
            q1 = (at_first * begun + lag * max_V / J1 + gap.on_U) / lag
            turned = at_first + gap.on_U + g * max_V / J1
            swept, on_q = U2 + g * V2 / J1, U1 * begun / lag + V1 / J1
            beside = U2 + 2.0 * (U1 / lag + V1 / J1) + (at_first + gap.on_U) / lag + (max_V + g * V2) / J1
            joint = np.abs(gap.sources[0, U] - self.sources[i, U]) / lag
            u_now = u0 * (q1 + max_V / J1)
        else:
            q1 = max_V / J1 + 0.0 * V1 * g
            turned = g * max_V / J1 + gap.on_q + self.direct[i]
            swept, on_q = g * V2 / J1, V1 / J1
            beside = g * V2 / J1 + gap.on_V / J1
            joint = (np.abs(self.mu + gap.sources[0, V] - self.d1[i, V]) + h * V2) / J1
            u_now = 0.0
        slope = a1 @ np.abs(phase.b)
        fixed_tau = a1 @ np.abs(phase.A[:, LAST]) + g * s.pull * (V2 + L2)
        fixed_tau = fixed_tau + V2 * v0 + L2 * w0 + (U2 + lag * V2 / J1) * u0
        fixed_g = s.pull * (max_V + by_W2) + u_now
        crossed = s.pull * (V1 + L1) + u0 * (U1 / lag + 2.0 * V1 / J1 if lag > 0.0 else 0.0)
        if not s.limited:
            along_tau, along_g = most * (slope + swept) + fixed_tau, most * q1 + fixed_g
            return along_tau, along_g, along_tau + along_g + 2.0 * (most * on_q + crossed)
        turns = self.turns[i]
        along_tau = most * (slope + swept) + fixed_tau + s.rate * turns
        along_g = abs(s.problem.first_demand) * q1 + fixed_g + s.rate * (turns + turned)
        jump = gap.on_q + self.direct[i]
        diagonal = most * (joint + beside) + fixed_tau + fixed_g + 2.0 * crossed + s.rate * jump
        return along_tau, along_g, diagonal

    def _along_winding(self, i: Any, w: Any, g: Any) -> tuple[Vector, Vector, Vector]:
        """M along tau, along w, and along tau while tau + w stays, of cells with up to w and g s."""
        s, gap, winding, by = self.start, self.gap, self.winding, self.by
        most, J1, lag, h, contact = s.most, s.J1, s.lag, s.h, s.phases["contact"]
        A = winding.phase.A
        wide, b = np.abs(A), np.abs(winding.phase.b)
        a1, a2 = self.a1[i], self.a2[i]
        S1 = (self.p[i] + by.breakaway * s.T) @ A + winding.sources[0]
        jumps = np.zeros(LAST + 1)
        jumps[V], jumps[U] = winding.on_V, winding.on_U
        e1 = np.abs(S1) + h * (a1 @ wide)
        e2 = np.abs(S1 @ A) + h * (a1 @ wide @ wide) + jumps @ wide
        e1 = e1 + jumps

        def swing(X: Any) -> Any:
            """The most that |p_V| becomes while the shaft is wound up."""
            return np.sqrt(X[..., V] ** 2 + X[..., Z] ** 2 * J1 / s.c)

        def size(X: Any) -> Any:
            return swing(X) / J1 + (X[..., U] / lag if lag > 0.0 else 0.0)

        def swept(X: Any, time: Any) -> Any:
            return time * swing(X) / J1 + (X[..., U] if lag > 0.0 else 0.0)

        def late(X: Any) -> Any:
            """p_U at the contact."""
            return X[..., U] + lag * swing(X) / J1

        def in_gap(X: Any) -> Any:
            return g * swing(X) / J1 + (late(X) if lag > 0.0 else 0.0)

        slope, own = a1 @ np.abs(contact.b), a1 @ np.abs(contact.A[:, LAST])
        mixed = a2 + 2.0 * (a1 @ wide) + e2
        if lag > 0.0:
            at_first = late(e1) + winding.most_U + abs(gap.sources[0, U])
            begun = np.exp(-np.maximum(g - 2.0 * h, 0.0) / lag)
            q1 = (at_first * begun + lag * self.max_V / J1 + gap.on_U) / lag
        else:
            at_first, begun, q1 = 0.0, 0.0, self.max_V / J1

        def on_q(X: Any) -> Any:
            return swing(X) / J1 + (late(X) * begun / lag if lag > 0.0 else 0.0)

        if not s.limited:
            along_tau = most * (slope + swept(a2, w) + in_gap(a2) + q1 + 2.0 * on_q(a1)) + own
            along_w = most * (size(e1) + in_gap(e2) + q1 + 2.0 * on_q(e1))
            diagonal = most * (slope + size(e1) + 2.0 * size(a1) + swept(a2, w) + in_gap(mixed)) + own
            return along_tau, along_w, diagonal
        S2 = np.abs(self.d2[i] - 2.0 * self.d1[i] @ A + S1 @ A)
        S2 = S2 + h * (a2 @ np.abs(contact.A) + 2.0 * (a2 @ wide) + a1 @ wide @ wide)
        K1 = np.abs((S1 - self.d1[i]) @ winding.phase.b) + h * ((a1 @ wide + a2) @ b)
        broken = abs(by.breakaway) * s.d / J1 if lag == 0.0 else 0.0
        jump = s.rate * (winding.on_q + self.direct[i] + broken)
        if lag > 0.0:
            K2 = (winding.most_U + abs(gap.sources[0, U])) / lag
            wound, crossed = winding.on_U / lag, gap.on_U / lag

            def beside(X2: Any, X1: Any) -> Any:
                return late(X2) + 2.0 * (late(X1) / lag + swing(X1) / J1) + at_first / lag + self.max_V / J1
        else:
            K2 = (swing(e1) + self.max_V) / J1
            wound, crossed = winding.on_V / J1, gap.on_V / J1

            def beside(X2: Any, X1: Any) -> Any:
                return 0.0

        in_stuck = K1 + swept(S2, w) + wound
        along_tau = most * (in_stuck + K2 + beside(a2, a1) + g * swing(a2) / J1 + crossed)
        along_tau = along_tau + own + jump + s.rate * gap.on_q
        along_w = most * (K2 + beside(e2, e1) + g * swing(e2) / J1 + crossed)
        along_w = along_w + s.rate * (gap.on_q + winding.on_q)
        return along_tau, along_w, most * (in_stuck + in_gap(mixed)) + own + jump


def spans_of(i: Any, k: Any) -> tuple[int, Any]:
    """The least i, and least and largest k in each row from it on; (0, -1): none.

    >>> spans_of(np.array([3, 3, 5]), np.array([4, 7, 1]))[1].tolist()
    [[4, 7], [0, -1], [1, 1]]
    """
    first = int(np.min(i))
    spans = np.tile([np.iinfo(np.int64).max, -1], (int(np.max(i)) - first + 1, 1))
    np.minimum.at(spans[:, 0], i - first, k)
    np.maximum.at(spans[:, 1], i - first, k)
    spans[spans[:, 1] < 0, 0] = 0
    return first, spans


# compiled ---------------------------------------------------------------------------------------------------


@compiled
def _recursion(E: Any, added: Any, p: Any, first: int, last: int) -> None:
    """p[i + 1] = p[i] E + added[i] for i from `first` to `last` - 1."""
    for i in range(first, last):
        for k in range(E.shape[0]):
            p[i + 1, k] = added[i, k]
            for j in range(E.shape[0]):
                p[i + 1, k] += p[i, j] * E[j, k]


@compiled
def _take(q: float, rise: float, low: float, high: float, kinks: Any, count: Any, least: Any) -> None:
    """V(r) = q r + min of the old V(s) over |s - r| <= rise, convex and piecewise linear from low to high.

    It is known by its least value (least[1]) and its kinks left and right of where that is, with the change
    of the slope at each; all move apart by `rise` in a step, by least[0] up to now. The one next to the
    minimum is last.
    """
    left, by_left, right, by_right = kinks
    least[0] += rise
    moved = least[0]
    while count[1] > count[0] and left[count[0]] - moved <= low:
        count[0] += 1
    while count[3] > count[2] and right[count[2]] + moved >= high:
        count[2] += 1
    more = q  # to be taken from the kinks of one side: the minimum moves there
    if more > 0.0:
        at = left[count[1] - 1] - moved if count[1] > count[0] else low
        least[1] += more * at
        while more > 0.0:
            inside = count[1] > count[0]
            change = by_left[count[1] - 1] if inside else more
            taken = min(change, more)
            right[count[3]], by_right[count[3]] = at - moved, taken
            count[3] += 1
            if change > more:
                by_left[count[1] - 1] = change - more
            elif inside:
                count[1] -= 1
            more -= taken
            after = left[count[1] - 1] - moved if count[1] > count[0] else low
            if more > 0.0:
                least[1] -= more * (at - after)
            at = after
    elif more < 0.0:
        at = right[count[3] - 1] + moved if count[3] > count[2] else high
        least[1] += more * at
        while more < 0.0:
            inside = count[3] > count[2]
            change = by_right[count[3] - 1] if inside else -more
            taken = min(change, -more)
            left[count[1]], by_left[count[1]] = at + moved, taken
            count[1] += 1
            if change > -more:
                by_right[count[3] - 1] = change + more
            elif inside:
                count[3] -= 1
            more += taken
            after = right[count[3] - 1] + moved if count[3] > count[2] else high
            if more < 0.0:
                least[1] += more * (after - at)
            at = after


@compiled
def _value(r: float, rise: float, kinks: Any, count: Any, least: Any) -> float:
    """The least over demands that end within `rise` of r."""
    moved, total = least[0] + rise, least[1]
    for k in range(count[0], count[1]):
        if kinks[0, k] - moved > r:
            total += kinks[1, k] * (kinks[0, k] - moved - r)
    for k in range(count[2], count[3]):
        if kinks[2, k] + moved < r:
            total += kinks[3, k] * (r - kinks[2, k] - moved)
    return total


@compiled
def _fixed(at: float, half: float, kinks: Any, count: Any, least: Any) -> None:
    """The demand is `at` between two steps: whatever it was after that, and steep on both sides before."""
    least[1] = _value(at, half, kinks, count, least)
    count[0], count[1], count[2], count[3] = 0, 1, 0, 1
    kinks[0, 0], kinks[1, 0] = at + half + least[0], STEEP
    kinks[2, 0], kinks[3, 0] = at - half - least[0], STEEP


@compiled
def _added(q0: float, q1: float, lost: float, h: float, low: float, high: float, rate: float, kinks: Any,
           count: Any, least: Any) -> None:  # fmt: skip
    """A step of h s with q at its ends; `rate` below 0: without limit."""
    if rate < 0.0:
        least[1] += 0.5 * h * (min(q0 * low, q0 * high) + min(q1 * low, q1 * high)) - lost
    else:
        _take(0.5 * h * (q0 + q1), rate * h, low, high, kinks, count, least)
        least[1] -= lost


@compiled
def _copied(kinks: Any, count: Any, least: Any, source: int, target: int) -> None:
    least[target, 0], least[target, 1] = least[source, 0], least[source, 1]
    for k in range(4):
        count[target, k] = count[source, k]
    for k in range(count[source, 0], count[source, 1]):
        kinks[target, 0, k], kinks[target, 1, k] = kinks[source, 0, k], kinks[source, 1, k]
    for k in range(count[source, 2], count[source, 3]):
        kinks[target, 2, k], kinks[target, 3, k] = kinks[source, 2, k], kinks[source, 3, k]


@compiled
def _back(X: Any, flow: Any, added: Any, sources: Any, direct: float, h: float, low: float, high: float,
          rate: float, kinks: Any, count: Any, least: Any, rates: Any) -> None:  # fmt: skip
    """One step back through an early phase: X moves, and what q allows is added."""
    size = X.size
    q0 = q1 = direct
    bent = turned = 0.0
    for k in range(size):
        rates[0, k], rates[1, k] = sources[k], added[k]
        for j in range(size):
            rates[0, k] += X[j] * flow[size + j, k]
            rates[1, k] += X[j] * flow[j, k]
    for k in range(size):
        q0 += X[k] * flow[2 * size, k]
        q1 += rates[1, k] * flow[2 * size, k]
        second = 0.0
        for j in range(size):
            second += rates[0, j] * flow[size + j, k]
        bent += abs(second) * flow[2 * size + 1, k]
        turned += abs(rates[0, k]) * flow[2 * size + 1, k]
    for k in range(size):
        X[k] = rates[1, k]
    lost = (max(high, -low) * bent + max(rate, 0.0) * turned) * h**3 / 12.0
    _added(q0, q1, lost, h, low, high, rate, kinks, count, least)


@compiled
def _freely(X: Any, g: float, J1: float, lag: float, low: float, high: float) -> float:
    """The integral of phi(q) over g s in the gap, the load at rest and nothing added; X moves.

    q = a + b x + e exp(-x/lag), the last part behind a lag only, has at most one turn and two zeros.
    """
    a, b, e = (X[1] - lag * X[0]) / J1, X[0] / J1, 0.0
    turn = g
    if lag > 0.0:
        e = X[3] / lag - a
        if 0.0 < b * lag < e or e < b * lag < 0.0:
            turn = min(lag * math.log(e / (b * lag)), g)
    total = 0.0
    begin = 0.0
    for end in (turn, g):
        q0, q1 = _swept(begin, a, b, e, lag), _swept(end, a, b, e, lag)
        lower, upper = begin, end
        if q0 * q1 < 0.0:
            while upper - lower > 1e-12 * g:
                middle = 0.5 * (lower + upper)
                if (_swept(middle, a, b, e, lag) < 0.0) == (q0 < 0.0):
                    lower = middle
                else:
                    upper = middle
        else:
            lower = end
        for first, last in ((begin, lower), (lower, end)):
            area = (a + 0.5 * b * (first + last)) * (last - first)
            if lag > 0.0:
                area += e * lag * (math.exp(-first / lag) - math.exp(-last / lag))
            total += min(area * low, area * high)
        begin = end
    X[1] += X[0] * g
    if lag > 0.0:
        X[3] = lag * _swept(g, a, b, e, lag)
    return total


@compiled
def _swept(x: float, a: float, b: float, e: float, lag: float) -> float:
    return a + b * x + (e * math.exp(-x / lag) if lag > 0.0 else 0.0)


@compiled
def _walk(i0: int, spans: Any, before: Any, n: int, tail: int, rests: bool,
          opened: bool, winds: bool, p: Any, joint: Any, mu: float, q: Any, lost: Any,
          stuck: Any, stuck_added: Any, stuck_sources: Any, stuck_direct: Any,
          gap: Any, gap_added: Any, gap_sources: Any, gap_direct: Any, walked: int, J1: float, lag: float,
          first: Any, first_demand: float, held: float, h: float, low: float, high: float, rate: float,
          kinks: Any, count: Any, least: Any, work: Any, out: Any) -> None:  # fmt: skip
    """Fill `out` with F at the nodes within `spans`, row by row; see `Dual.nodes`. Of what is known of the
    demand up to now, copy 0 is in contact, 1 winding up, 2 in the gap.
    """
    size = first.size
    S, G, rates = work[0], work[1], work[2:4]
    half = 0.5 * rate * h
    for index in range(tail + i0):
        if index == tail and math.isfinite(held):
            _fixed(held, half, kinks[0], count[0], least[0])
        _added(q[0, index], q[1, index], lost[index], h, low, high, rate, kinks[0], count[0], least[0])
    if i0 == 0 and math.isfinite(held):
        _fixed(held, half, kinks[0], count[0], least[0])
    for row in range(spans.shape[0]):
        i, begin, end = i0 + row, spans[row, 0], spans[row, 1]
        last = -1 if end < begin else n - i if winds and not opened else end if winds else 0
        _copied(kinks, count, least, 0, 1)
        for a in range(size):
            S[a] = p[i, a] + joint[a]
        for k in range(last + 1):
            if k == last if not opened else k >= begin or not winds:
                _copied(kinks, count, least, 1, 2)
                for a in range(size):
                    G[a] = S[a]
                if opened:
                    G[0] = mu
                beyond = 0 if not opened else n - i - k if rests else end
                until = min(beyond, walked) if rests else beyond
                for j in range(until + 1):
                    if j == until or (j >= begin and not rests):
                        total = least[2, 1]
                        if beyond > until:
                            total += _freely(G, (beyond - until) * h, J1, lag, low, high)
                        if rate >= 0.0:
                            total = _value(first_demand, half, kinks[2], count[2], least[2])
                        for a in range(size):
                            total += G[a] * first[a]
                        column = 0 if not opened else j - begin if not rests else k - begin if winds else 0
                        out[before[row] + column] = total
                    if j < until:
                        _back(G, gap, gap_added[j], gap_sources[j], gap_direct[j], h, low, high, rate,
                              kinks[2], count[2], least[2], rates)  # fmt: skip
                if beyond < 0:
                    out[before[row] + k - begin] = np.inf
            if k < last:
                _back(S, stuck, stuck_added[k], stuck_sources[k], stuck_direct[k], h, low, high, rate,
                      kinks[1], count[1], least[1], rates)  # fmt: skip
        index = tail + i
        if row + 1 < spans.shape[0]:
            _added(q[0, index], q[1, index], lost[index], h, low, high, rate, kinks[0], count[0], least[0])
