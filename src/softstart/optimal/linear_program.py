"""The optimum for a fixed entry into the contact: a linear program, and the search over the instant of entry.

With te and t_f fixed, T, z' and w2 at any instant are linear in the relative speed v at te and in the torque
u_1..u_n on a grid of the contact, and so are their limits. HiGHS solves

    minimise P   subject to   T(s_j) <= P, T(s_j) >= 0          (dead-zone: -P <= T(s_j), z(s_j) >= 0)
                              w2(tau) = target, and             (synchronous) z'(tau) = 0
                                                                (steady) also T(tau) = Mc
                                                                (reached) T of the coasting tail <= P
                              v_slowest(te) <= v <= v_fastest(te),  0 <= u <= Ms

where s_j are four instants in each step, tau = t_f - te. What is found is exact for this grid:
no integration. In a contact of many elastic periods most of the time is a few long steps.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from softstart.optimal.contact import Contact
from softstart.optimal.ideal import entry_of
from softstart.optimal.problem import Problem

Vector = NDArray[np.float64]
Rows = tuple[Any, Vector]

AIM = 1.0 + 1e-9  # a little above the target, so that the exact plant finds it reached
TAIL_POINTS = 120
QUARTERS, HALVES = (0.25, 0.5, 0.75, 1.0), (0.5, 1.0)  # of a step, where T is checked
SIXTEENTHS = tuple((np.arange(16) + 1.0) / 16.0)  # where it is looked at afterwards
MARGIN = 2e-4  # of U, which T keeps above 0
FINE_ENDS = 30.0  # radians of the elastic oscillation at either end of a long contact
LONG_STEPS = 4  # between them


@dataclass(frozen=True, eq=False)
class Multipliers:
    """What each limit is worth, for the certificate: P >= sum of these times the limits' left sides.

    `peak` (>= 0) belong to T(share tau) <= P, `trough` to T >= -P (dead-zone), `closed` to T >= 0 or z >= 0,
    `tail` to the coasting T at instants `tail_at` after t_f; `speed`, `rate`, `torque` to the terminal
    equations w2, z', T. Peak, trough and tail sum to 1.
    """

    share: Vector
    peak: Vector
    trough: Vector
    closed: Vector
    tail_at: Vector
    tail: Vector
    speed: float
    rate: float
    torque: float


@dataclass(frozen=True, eq=False)
class Answer:
    """The optimum at fixed (te, t_f): peak P in N m, entry speed v, torques u between the `edges`."""

    te: float
    end_time: float
    P: float
    v: float
    edges: Vector
    u: Vector
    x: Vector  # all variables of the program
    multipliers: Multipliers


def first_grid(contact: Contact, tau: float, steps: int) -> Vector:
    """Even steps; in a contact of many elastic periods fine ones at both ends and a few long ones between."""
    angle = contact.Omega * tau
    if angle <= 2.0 * FINE_ENDS:
        return np.linspace(0.0, 1.0, max(steps, int(0.8 * angle)) + 1)
    end = FINE_ENDS / angle
    return np.concatenate(
        [
            np.linspace(0.0, end, steps + 1)[:-1],
            np.linspace(end, 1.0 - end, LONG_STEPS + 1)[:-1],
            np.linspace(1.0 - end, 1.0, 3 * steps // 4 + 1),
        ]
    )


def check_instants(
    contact: Contact, edges: Vector, fractions: tuple[float, ...]
) -> tuple[NDArray[np.int64], Vector]:
    """Where T is checked: (step, time since its beginning); at these fractions of each step.

    In a step longer than an elastic period T swings about a mean, ever less: its first period is checked,
    as finely as a step of one radian would be, and its end.
    """
    period = 2.0 * np.pi / contact.Omega
    within = period * np.arange(1, 6 * len(fractions) + 1) / (6 * len(fractions))
    steps, instants = [], []
    for k, length in enumerate(np.diff(edges).tolist()):
        at = np.append(within, length) if length > period else np.array(fractions) * length
        steps.append(np.full(at.size, k))
        instants.append(at)
    return np.concatenate(steps), np.concatenate(instants)


class LinearProgram:
    """The limits of a contact of duration tau on a grid: a number of even steps, or edges as shares of tau.

    Variables, all without dimension: u_k/U, then at each node a = c z/U and b = c z'/(Omega U), and P/U, with
    U the largest motor torque. The steps between the nodes are exact. `mix` (rows of weights over the checked
    instants, each summing to 1) replaces T(s_j) by its means: a relaxation, whose multipliers belong to spans
    instead of instants.
    """

    def __init__(
        self,
        problem: Problem,
        tau: float,
        grid: int | Vector,
        mix: Vector | None = None,
        checks: tuple[float, ...] = QUARTERS,
        margin: float = MARGIN,
    ) -> None:
        drive = problem.drive
        grid = np.linspace(0.0, 1.0, grid + 1) if isinstance(grid, int) else grid
        self.problem, self.tau, self.n = problem, tau, grid.size - 1
        self.contact = contact = Contact.of(drive)
        self.entry = entry_of(problem)
        self.edges = grid * tau
        self.U, self.W = problem.highest_torque, problem.target
        self.pulls = drive.contact_law == "dead-zone" and contact.d > 0.0
        self.columns = 3 * self.n + 3
        self.first_a, self.first_b, self.P = self.n, 2 * self.n + 1, 3 * self.n + 2
        damping = contact.d * contact.Omega / contact.c
        steps = np.diff(self.edges)
        self.dynamics = self._dynamics(*self._stepped(steps))
        checked, at = check_instants(contact, self.edges, checks)
        self.share = (self.edges[checked] + at) / tau
        self.T, self.kept = (self._mixed(rows, mix) for rows in self._limited(checked, at))
        self.mix = mix
        # the exact plant must not part the flanks by rounding; at first T is 0
        self.least = np.where(np.arange(self.kept[1].size) < 2 * len(checks), 0.0, margin)
        reach = min(contact.half_period, np.pi / contact.Omega)
        self.tail_at = reach * np.arange(1, TAIL_POINTS + 1) / TAIL_POINTS
        a, b = self._from_node(self.tail_at, np.full(TAIL_POINTS, self.n), None)
        self.tail = a[0] + damping * b[0], a[1] + damping * b[1]
        self.T_end = self._single({self.first_a + self.n: 1.0, self.first_b + self.n: damping})
        # a damped contact begins with T = d v; for the certificate's relaxation it need not count
        self.T_first: Rows = self._single({self.first_a: 1.0, self.first_b: damping}), np.zeros(1)
        self.jumps = damping > 0.0 and mix is None and margin > 0.0

    # rows: pairs (sparse matrix over the variables, constant) --------------------------------------------

    def _from_node(
        self, s: Vector, node: NDArray[np.int64], step: NDArray[np.int64] | None
    ) -> tuple[Rows, Rows]:
        """(a, b) at s after the given nodes, under the torque of the given steps (None: coasting)."""
        contact, U = self.contact, self.U
        Omega, c = contact.Omega, contact.c
        h, dh, H = contact.h(s), contact.dh(s), contact.H(s)
        push = contact.Mc / (contact.J2 * U)
        weights = (
            (dh + 2.0 * contact.zeta * h, Omega * h, c * H / contact.J1, c * H * push),
            (-Omega * h, dh, c * h / (Omega * contact.J1), c * h * push / Omega),
        )
        row = np.arange(s.size)
        out = []
        for by_a, by_b, by_u, constant in weights:
            entries = [(by_a, self.first_a + node), (by_b, self.first_b + node)]
            if step is not None:
                entries.append((by_u, step))
            values = np.concatenate([value for value, _ in entries])
            columns = np.concatenate([column for _, column in entries])
            where = np.tile(row, len(entries)), columns
            out.append((sparse.csr_array((values, where), shape=(s.size, self.columns)), constant))
        return out[0], out[1]

    def _stepped(self, s: Vector) -> tuple[Rows, Rows]:
        """(a, b) at s_k after node k, under the torque of step k."""
        steps = np.arange(self.n)
        return self._from_node(s, steps, steps)

    def _dynamics(self, a: Rows, b: Rows) -> Rows:
        """Zero: the state at each node is what the step before it leads to."""
        rows = []
        for (matrix, constant), first in ((a, self.first_a), (b, self.first_b)):
            at = np.arange(self.n), first + 1 + np.arange(self.n)
            node = sparse.csr_array((np.ones(self.n), at), shape=(self.n, self.columns))
            rows.append((matrix - node, constant))
        return sparse.vstack([rows[0][0], rows[1][0]]), np.concatenate([rows[0][1], rows[1][1]])

    def _limited(self, step: NDArray[np.int64], s: Vector) -> tuple[Rows, Rows]:
        """T/U at s into each of the given steps, and what must not be negative there: T or c z/U."""
        damping = self.contact.d * self.contact.Omega / self.contact.c
        a, b = self._from_node(s, step, step)
        T = a[0] + damping * b[0], a[1] + damping * b[1]
        return T, a if self.pulls else T

    def broken(self, answer: Answer, allowed: float) -> NDArray[np.bool_]:
        """Steps in which T goes above P or comes off the flank between the checks, by a share of P."""
        step, s = check_instants(self.contact, self.edges, SIXTEENTHS)
        T, kept = self._limited(step, s)
        P = answer.P / self.U
        over = np.abs(T[0] @ answer.x + T[1]) if self.pulls else T[0] @ answer.x + T[1]
        bad = (over > P * (1.0 + allowed)) | (kept[0] @ answer.x + kept[1] < -1e-9)
        steps: NDArray[np.bool_] = np.bincount(step, weights=bad, minlength=self.n) > 0.0
        return steps

    def _mixed(self, rows: Rows, mix: Vector | None) -> Rows:
        if mix is None:
            return rows
        return sparse.csr_array(mix) @ rows[0], mix @ rows[1]

    def _single(self, weights: dict[int, float]) -> Any:
        columns = np.array(list(weights))
        where = np.zeros(columns.size, dtype=np.int64), columns
        return sparse.csr_array((np.array(list(weights.values())), where), shape=(1, self.columns))

    def _speed(self) -> tuple[Any, float]:
        """(w2(tau) - w2(te))/W: momentum is what the torques brought."""
        contact, n = self.contact, self.n
        total = contact.J1 + contact.J2
        own = contact.J1 * contact.Omega * self.U / (contact.c * total * self.W)
        weights = dict(enumerate((np.diff(self.edges) * self.U / (total * self.W)).tolist()))
        weights[self.first_b] = own
        weights[self.first_b + n] = -own
        return self._single(weights), -contact.Mc * self.tau / (total * self.W)

    def _terminal(self, te: float) -> list[tuple[Any, float]]:
        """Equations (row, right side) at tau; the speed comes first."""
        row, constant = self._speed()
        start = float(self.entry.load_speed(np.array([te]))[0])
        equations = [(row, (self.problem.target * AIM - start) / self.W - constant)]
        if self.problem.terminal != "reached":
            equations.append((self._single({self.first_b + self.n: 1.0}), 0.0))
        if self.problem.terminal == "steady":
            equations.append((self.T_end, self.contact.Mc / self.U))
        return equations

    # solving ---------------------------------------------------------------------------------------------

    def solve(
        self, te: float, *, greatest_speed: bool = False, elastic: float = 0.0
    ) -> Answer | float | None:
        """The least P, or with `greatest_speed` the greatest w2(tau); None where there is none.

        With `elastic` > 0 the terminal equations may be missed at that price (in U), so that there always is
        an answer; its multipliers say how far from feasible the problem is.
        """
        from scipy.optimize import linprog

        terminal = self._terminal(te)
        if greatest_speed:
            terminal = terminal[1:]
        P = self._single({self.P: 1.0})

        def below_P(rows: Rows, sign: float = 1.0) -> Rows:
            ones = sparse.csr_array(np.ones((rows[1].size, 1)))
            return sign * rows[0] - ones @ P, -sign * rows[1]

        none: Rows = (sparse.csr_array((0, self.columns)), np.zeros(0))
        coasting = self.problem.terminal == "reached"
        blocks = [
            none if greatest_speed else below_P(self.T),
            below_P(self.T, -1.0) if self.pulls and not greatest_speed else none,
            (-1.0 * self.kept[0], self.kept[1] - self.least),
            below_P(self.tail) if coasting and not greatest_speed else none,
            below_P(self.T_first) if self.jumps and not greatest_speed else none,
        ]
        equations = terminal
        A_eq = sparse.vstack([self.dynamics[0], *(row for row, _ in equations)])
        b_eq = np.concatenate([-self.dynamics[1], [right for _, right in equations]])
        A_ub = sparse.vstack([block[0] for block in blocks])
        b_ub = np.concatenate([block[1] for block in blocks])
        cost = -self._speed()[0].toarray()[0] if greatest_speed else P.toarray()[0]
        bounds = self._bounds(te)
        if elastic > 0.0:
            missed = len(terminal)
            slack = np.zeros((b_eq.size, 2 * missed))
            slack[2 * self.n : 2 * self.n + missed] = np.hstack([np.eye(missed), -np.eye(missed)])
            A_eq = sparse.hstack([A_eq, sparse.csr_array(slack)])
            A_ub = sparse.hstack([A_ub, sparse.csr_array((b_ub.size, 2 * missed))])
            cost = np.concatenate([cost, np.full(2 * missed, elastic)])
            bounds = np.concatenate([bounds, np.tile([0.0, np.inf], (2 * missed, 1))])
        found = linprog(cost, A_ub, b_ub, A_eq.tocsr(), b_eq, bounds, method="highs")
        if found.status != 0:
            return None
        if greatest_speed:
            start = float(self.entry.load_speed(np.array([te]))[0])
            return start + self.W * (self._speed()[1] - float(found.fun))
        return Answer(
            te,
            te + self.tau,
            float(found.x[self.P]) * self.U,
            float(found.x[self.first_b]) * self.contact.Omega * self.U / self.contact.c,
            self.edges,
            found.x[: self.n] * self.U,
            found.x[: self.columns],
            self._multipliers(found, [block[1].size for block in blocks]),
        )

    def _bounds(self, te: float) -> Vector:
        """Limits of each variable, shape (columns, 2): torques 0 to 1, and the entry."""
        at, scale = np.array([te]), self.contact.c / (self.contact.Omega * self.U)
        bounds = np.tile([-np.inf, np.inf], (self.columns, 1))
        bounds[: self.n] = 0.0, 1.0
        bounds[self.first_a] = self.contact.c * self.entry.z0 / self.U
        bounds[self.first_b] = (
            scale * float(self.entry.slowest(at)[0]),
            scale * float(self.entry.fastest(at)[0]),
        )
        bounds[self.P] = 0.0, np.inf
        return bounds

    def _multipliers(self, found: Any, sizes: list[int]) -> Multipliers:
        """HiGHS's marginals in N m per unit of each limit; signs so that a larger left side raises P."""
        least = np.maximum(-np.asarray(found.ineqlin.marginals), 0.0)
        parts = np.split(least, np.cumsum(sizes)[:-1])[:4]
        total = float(parts[0].sum() + parts[1].sum() + parts[3].sum()) or 1.0
        peak, trough, closed, tail = (part / total for part in parts)
        none = np.zeros(self.share.size)
        if self.mix is not None:
            peak, trough, closed = (part @ self.mix if part.size else part for part in (peak, trough, closed))
        equal = np.asarray(found.eqlin.marginals)[2 * self.n :] / total
        terminal = self.problem.terminal
        return Multipliers(
            self.share,
            peak,
            trough if trough.size else none,
            closed,
            self.tail_at,
            tail if tail.size else np.zeros(self.tail_at.size),
            speed=float(equal[0]) * self.U / self.W,
            rate=float(equal[1]) * self.contact.c / self.contact.Omega if terminal != "reached" else 0.0,
            torque=float(equal[2]) if terminal == "steady" else 0.0,
        )
