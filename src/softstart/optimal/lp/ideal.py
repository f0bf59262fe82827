"""The optimal start with an ideal torque: a linear program for a fixed entry, and the search for the entry.

With te and t_f fixed, T, z' and w2 at any instant are linear in the relative speed v at te and in the torque
u_1..u_n on a grid of the contact, and so are their limits. HiGHS solves

    minimise P   subject to   T(s_j) <= P, T(s_j) >= 0          (dead-zone: -P <= T(s_j), z(s_j) >= 0)
                              w2(tau) = target, and             (synchronous) z'(tau) = 0
                                                                (steady) also T(tau) = Mc
                                                                (reached) T of the coasting tail <= P
                              v_slowest(te) <= v <= v_fastest(te),  0 <= u <= Ms

where s_j are four instants in each step, tau = t_f - te. The answer is exact for its grid: nothing is
integrated. In a contact of many elastic periods most of the time is a few long steps.

P over te is smooth but for steep kinks where the least v becomes just enough: a scan brackets them and golden
sections narrow them down, first on a coarse grid, then on grids that are finer where the torque switches.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy import sparse
from scipy.optimize import minimize_scalar

from softstart.arrays import Vector
from softstart.errors import InputError
from softstart.optimal.lp.motion import MARGIN, Contact, Entry, entry_of, no_ideal
from softstart.optimal.lp.rows import (
    AIM,
    FINE_ENDS,
    QUARTERS,
    SIXTEENTHS,
    Limits,
    Marks,
    Refinement,
    RowList,
    Rows,
    Solution,
    Sparse,
    Steps,
    WarmStarts,
    below,
    checked_instants,
    contact_grid,
    no_linear_objective,
    refined,
    split,
)
from softstart.optimal.problem import Problem
from softstart.optimal.result import Candidate
from softstart.profile import TorqueProfile

TAIL_POINTS = 120
COARSE, MIDDLE = 40, 80  # steps of the grid: to find the entry, to refine it
REFINEMENT = Refinement(most=400, mending=3, narrowing=0.4)
ENDING = 0.05  # of U, at most, which T keeps above half an elastic period before it ends at 0
EXCESS = 1e-4  # relative: T above P between the checks by more counts
SCANNED, LOCAL_MINIMA = 20, 3
SOONER = (0.985, 0.95, 0.9, 0.83, 0.75, 0.66, 0.56, 0.46, 0.36, 0.27, 0.19, 0.13, 0.09, 0.06)  # of the end
LESS = 0.95  # of the time
MOST_INHERITED = 300  # edges of a grid that another start time begins with
FEW = 8  # entries that are tried near that of another start time
RISING, STEEP = 2, 1.03  # so many ends in a row with P so many times the least: no shorter one is tried
NEAR = (0.0, 0.3, 0.6, 0.8, 0.9, 0.97, 1.0, 1.03, 1.1, 1.25)  # of te of another end, from the earliest on
SHARES = (0.0, 0.002, 0.006, 0.012, 0.02, 0.035, 0.05, 0.08, 0.12, 0.2, 0.4, 0.7, 1.0)  # of te, a first scan


# the program for a fixed entry ----------------------------------------------------------------------------


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
    """The optimum at fixed (te, t_f): peak P in N m, entry speed v, torques `levels` between the `edges`."""

    te: float
    end_time: float
    P: float
    v: float
    edges: Vector
    levels: Vector
    x: Vector  # all variables of the program
    multipliers: Multipliers
    program: ContactProgram = field(repr=False)

    @cached_property
    def broken(self) -> Marks:
        """Steps in which T goes above P or comes off the flank between the checks."""
        return self.program.broken(self)

    def finer(self, wanted: Marks) -> Vector:
        """Its own grid with the wanted steps split in four, but for the few long ones and the finest."""
        grid = self.edges / self.edges[-1]
        steps = np.diff(grid)
        return split(grid, wanted & (steps < 5.0 * np.median(steps)) & (steps > 1e-6), 4)


class ContactProgram:
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
        warm: WarmStarts | None = None,
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
        checked, s = self._instants(checks)
        self.share = (self.edges[checked] + s) / tau
        self.T, self.kept = (self._mixed(rows, mix) for rows in self._limited(checked, s))
        self.mix = mix
        self.warm = warm or WarmStarts()
        # the exact plant must not part the flanks by rounding; at first T is 0
        self.least = np.where(np.arange(self.kept[1].size) < 2 * len(checks), 0.0, margin)
        if problem.terminal == "steady" and contact.Mc < margin * self.U:  # it ends with T = Mc
            left = (1.0 - self.share) * tau / contact.half_period
            self.least = np.minimum(self.least, ENDING * left**2)
        reach = min(contact.half_period, np.pi / contact.Omega)
        self.tail_at = reach * np.arange(1, TAIL_POINTS + 1) / TAIL_POINTS
        a, b = self._from_node(self.tail_at, np.full(TAIL_POINTS, self.n), None)
        self.tail = self._torque(a, b)
        self.T_end = Sparse.single({self.first_a + self.n: 1.0, self.first_b + self.n: damping})
        # a damped contact begins with T = d v; for the certificate's relaxation it need not count
        self.T_first: Rows = Sparse.single({self.first_a: 1.0, self.first_b: damping}), np.zeros(1)
        self.jumps = damping > 0.0 and mix is None and margin > 0.0

    # rows ------------------------------------------------------------------------------------------------

    def _instants(self, fractions: tuple[float, ...]) -> tuple[Steps, Vector]:
        """Where T is checked: (step, time since its beginning); at these fractions of each step.

        In a step longer than an elastic period T swings about a mean, ever less: its first period is checked,
        as finely as a step of one radian would be, and its end.
        """
        period = 2.0 * np.pi / self.contact.Omega
        first_period = period * np.arange(1, 6 * len(fractions) + 1) / (6 * len(fractions))
        shares = np.array(fractions)
        return checked_instants(
            np.diff(self.edges),
            lambda length: np.append(first_period, length) if length > period else shares * length,
        )

    def _from_node(self, s: Vector, node: Steps, step: Steps | None) -> tuple[Rows, Rows]:
        """(a, b) at s after the given nodes, under the torque of the given steps (None: coasting)."""
        contact, U = self.contact, self.U
        Omega, c = contact.Omega, contact.c
        h, dh, H = contact.h(s), contact.dh(s), contact.H(s)
        push = contact.Mc / (contact.J2 * U)
        weights = (
            (dh + 2.0 * contact.zeta * h, Omega * h, c * H / contact.J1, c * H * push),
            (-Omega * h, dh, c * h / (Omega * contact.J1), c * h * push / Omega),
        )
        columns = [self.first_a + node, self.first_b + node]
        if step is not None:
            columns.append(step)
        place = np.concatenate(columns)
        a, b = (
            (Sparse.of(s.size, place, np.concatenate(entries[: len(columns)])), entries[-1])
            for entries in weights
        )
        return a, b

    def _stepped(self, s: Vector) -> tuple[Rows, Rows]:
        """(a, b) at s_k after node k, under the torque of step k."""
        steps = np.arange(self.n)
        return self._from_node(s, steps, steps)

    def _dynamics(self, a: Rows, b: Rows) -> Rows:
        """Zero: the state at each node is what the step before it leads to."""
        rows = []
        for (matrix, constant), first in ((a, self.first_a), (b, self.first_b)):
            at = np.arange(self.n), first + 1 + np.arange(self.n)
            rows.append((matrix - Sparse(self.n, *at, np.ones(self.n)), constant))
        return Sparse.stacked([rows[0][0], rows[1][0]]), np.concatenate([rows[0][1], rows[1][1]])

    def _limited(self, step: Steps, s: Vector) -> tuple[Rows, Rows]:
        """T/U at s into each of the given steps, and what must not be negative there: T or c z/U."""
        a, b = self._from_node(s, step, step)
        T = self._torque(a, b)
        return T, a if self.pulls else T

    def _torque(self, a: Rows, b: Rows) -> Rows:
        """T/U = a + d Omega/c b, of rows with entries at the same places."""
        damping = self.contact.d * self.contact.Omega / self.contact.c
        return replace(a[0], value=a[0].value + damping * b[0].value), a[1] + damping * b[1]

    def broken(self, answer: Answer) -> Marks:
        """Steps in which T goes above P or comes off the flank between the checks, by a share of P."""
        step, s = self._instants(SIXTEENTHS)
        T, kept = self._limited(step, s)
        P = answer.P / self.U
        over, least = (rows.csr(self.columns) @ answer.x + constant for rows, constant in (T, kept))
        over = np.abs(over) if self.pulls else over
        bad = (over > P * (1.0 + EXCESS)) | (least < -1e-9)
        steps: Marks = np.bincount(step, weights=bad, minlength=self.n) > 0.0
        return steps

    def _mixed(self, rows: Rows, mix: Vector | None) -> Rows:
        if mix is None:
            return rows
        mixed = (sparse.csr_array(mix) @ rows[0].csr(self.columns)).tocoo()
        return Sparse(mix.shape[0], mixed.row, mixed.col, mixed.data), mix @ rows[1]

    def _speed(self) -> tuple[Sparse, float]:
        """(w2(tau) - w2(te))/W: momentum is what the torques brought."""
        contact, n = self.contact, self.n
        total = contact.J1 + contact.J2
        own = contact.J1 * contact.Omega * self.U / (contact.c * total * self.W)
        weights = dict(enumerate((np.diff(self.edges) * self.U / (total * self.W)).tolist()))
        weights[self.first_b] = own
        weights[self.first_b + n] = -own
        return Sparse.single(weights), -contact.Mc * self.tau / (total * self.W)

    def _terminal(self, te: float) -> list[tuple[Sparse, float]]:
        """Equations (row, right side) at tau; the speed comes first."""
        row, constant = self._speed()
        start = float(self.entry.load_speed(np.array([te]))[0])
        equations = [(row, (self.problem.target * AIM - start) / self.W - constant)]
        if self.problem.terminal != "reached":
            equations.append((Sparse.single({self.first_b + self.n: 1.0}), 0.0))
        if self.problem.terminal == "steady":
            equations.append((self.T_end, self.contact.Mc / self.U))
        return equations

    # solving ---------------------------------------------------------------------------------------------

    def solve(self, te: float, *, elastic: float = 0.0) -> Answer | None:
        """The least P; None where there is none.

        With `elastic` > 0 the terminal equations may be missed at that price (in U), so that there always is
        an answer; its multipliers say how far from feasible the problem is.
        """
        P = Sparse.single({self.P: 1.0})
        none: Rows = Sparse.stacked([]), np.zeros(0)
        blocks = [
            below(self.T, P),
            below(self.T, P, -1.0) if self.pulls else none,
            self._kept_closed(),
            below(self.tail, P) if self.problem.terminal == "reached" else none,
            below(self.T_first, P) if self.jumps else none,
        ]
        found = self._solved(te, self._cost(P), blocks, self._terminal(te), elastic)
        if found is None:
            return None
        return Answer(
            te,
            te + self.tau,
            float(found.x[self.P]) * self.U,
            float(found.x[self.first_b]) * self.contact.Omega * self.U / self.contact.c,
            self.edges,
            found.x[: self.n] * self.U,
            found.x[: self.columns],
            self._multipliers(found, [block[1].size for block in blocks]),
            self,
        )

    def greatest_speed(self, te: float) -> float | None:
        """The greatest w2(tau) whatever T, rad/s; None where the terminal cannot be met."""
        row, constant = self._speed()
        found = self._solved(te, -self._cost(row), [self._kept_closed()], self._terminal(te)[1:], 0.0)
        if found is None:
            return None
        start = float(self.entry.load_speed(np.array([te]))[0])
        return start + self.W * (constant - found.cost)

    def _cost(self, row: Sparse) -> Vector:
        cost = np.zeros(self.columns)
        cost[row.column] = row.value
        return cost

    def _kept_closed(self) -> Rows:
        return -1.0 * self.kept[0], self.kept[1] - self.least

    def _solved(
        self,
        te: float,
        cost: Vector,
        blocks: list[Rows],
        terminal: list[tuple[Sparse, float]],
        elastic: float,
    ) -> Solution | None:
        """The solution; with `elastic` there are slack variables of the terminal equations behind ours."""
        above, equal = RowList(), RowList()
        for rows, right in blocks:
            above.add(rows, right)
        equal.add(self.dynamics[0], -self.dynamics[1])
        for row, value in terminal:
            equal.add(row, np.array([value]))
        (A_ub, b_ub), (A_eq, b_eq) = above.all(), equal.all()
        bounds = self._bounds(te)
        if elastic > 0.0:
            missed = len(terminal)
            k = np.arange(2 * missed)
            slack = Sparse(
                b_eq.size, 2 * self.n + k % missed, self.columns + k, np.where(k < missed, -1.0, 1.0)
            )
            A_eq = A_eq - slack
            cost = np.concatenate([cost, np.full(2 * missed, elastic)])
            bounds = np.concatenate([bounds, np.tile([0.0, np.inf], (2 * missed, 1))])
        return Limits(cost, A_ub, b_ub, A_eq, b_eq).solved(bounds, self.warm)

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

    def _multipliers(self, found: Solution, sizes: list[int]) -> Multipliers:
        """HiGHS's marginals in N m per unit of each limit; signs so that a larger left side raises P."""
        least = np.maximum(-found.above, 0.0)
        parts = np.split(least, np.cumsum(sizes)[:-1])[:4]
        total = float(parts[0].sum() + parts[1].sum() + parts[3].sum()) or 1.0
        peak, trough, closed, tail = (part / total for part in parts)
        none = np.zeros(self.share.size)
        if self.mix is not None:
            peak, trough, closed = (part @ self.mix if part.size else part for part in (peak, trough, closed))
        equal = found.equal[2 * self.n :] / total
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


# the search for the entry ----------------------------------------------------------------------------------


def solve(problem: Problem, near: Any = None, loose: bool = False) -> Candidate | None:
    """The optimum of a problem with an ideal torque; None where no torque meets the terms.

    With `near`, what the answer of another start time leaves, it is looked for near that one on its grid, and
    if no bound will tell whether it is as good (`loose`), on a grid of its own.

    Raises InputError where the problem is not linear from the contact on (see `no_ideal`).
    """
    reason = not_linear(problem)
    if reason:
        raise InputError(f"method = lp: {reason}; use method = collocation.")
    best = search(problem) if near is None else _beside(problem, near, loose)
    if best is None:
        return None
    assert problem.start_time is not None
    slope, latest = 0.0, float(problem.start_time)
    if isinstance(near, _Known) and latest != near.latest:
        slope = (best.te - near.te) / (latest - near.latest)
    known = _Known(best.te, best.end_time, best.edges / best.edges[-1], latest, slope)
    return Candidate(
        assemble(problem, best), best.end_time, best.P / problem.base_torque, "lp",
        f"{best.levels.size} steps", known,
    )  # fmt: skip


@dataclass(frozen=True, eq=False)
class _Known:
    """An answer from which that of another start time is found: its entry, end, start time (s), grid."""

    te: float
    end: float
    grid: Vector
    latest: float
    slope: float  # of the entry over the start time


def _beside(problem: Problem, near: Any, loose: bool) -> Answer | None:
    """The answer for another start time, from the entry known and on its grid."""
    assert problem.start_time is not None
    if not isinstance(near, _Known) or near.grid.size > MOST_INHERITED:
        return None
    entry, end = entry_of(problem), min(near.end, problem.start_time)
    if near.end > near.latest * (1.0 - 1e-9):
        end = float(problem.start_time)
    shift = near.slope * (problem.start_time - near.latest)
    te = min(max(near.te + shift, entry.earliest), entry.latest, 0.999 * end)
    answers: dict[float, Answer | None] = {}
    warm = WarmStarts()

    def peak_at(te: float) -> float:
        if te not in answers:
            answers[te] = ContactProgram(problem, end - te, near.grid, warm=warm).solve(te)
        return min(_peak(answers[te]), 1e300)

    peak_at(te)
    for width, few in (
        (0.2 * abs(shift) + 2e-4 * end, FEW),
        (0.02 * end, 2 * FEW),
    ):
        low, high = max(te - width, entry.earliest), min(te + width, entry.latest, 0.999 * end)
        if high > low:
            options = {"xatol": 2e-3 * (high - low), "maxiter": few}
            minimize_scalar(peak_at, bounds=(low, high), method="bounded", options=options)
            peak_at(low)
            te = min(answers, key=lambda te: _peak(answers[te]))
        if not high > low or min(te - low, high - te) > 0.02 * (high - low) or te == entry.earliest:
            break
    best = answers[min(answers, key=lambda te: _peak(answers[te]))]
    if best is None:
        return None
    if loose:
        return min(_refined(problem, entry, best), best, key=_peak)
    if best.broken.any():
        best = _moved(problem, entry, best, best.finer(best.broken), 1e-5 * end, 2e-6 * end)
    return best


def not_linear(problem: Problem) -> str:
    """Why this is no linear program; empty if it is one."""
    if not problem.ideal_torque:
        return "the motor torque cannot jump freely (lag, rate, torque-speed curve or smoothness)"
    return no_linear_objective(problem) or no_ideal(problem)


def search(problem: Problem) -> Answer | None:
    """The best entry te and end t_f, and the answer there on a grid refined where the torque switches."""
    assert problem.start_time is not None
    entry = entry_of(problem)
    latest = float(problem.start_time)
    best = _best_entry(problem, entry, latest, COARSE)
    if best is None:
        speed, te = greatest_speed(problem, entry, latest, MIDDLE, math.nan)
        if speed >= problem.target:  # hardly enough time: the torque has no room for a coarse grid
            best = _best_entry(problem, entry, latest, MIDDLE)
        elif greatest_speed(problem, entry, LESS * latest, MIDDLE, te)[0] < speed:
            return None  # time is short; else a start that ends sooner keeps the gap closed more easily
    best = _sooner(problem, entry, latest, best)
    return None if best is None else _refined(problem, entry, best)


def _sooner(problem: Problem, entry: Entry, latest: float, best: Answer | None) -> Answer | None:
    """The best start that ends at `latest` or before: a hard contact may leave no use for more time.

    Ends are tried from `latest` on downward, each with entries near the one of the end before, until time
    is so short that P only rises.
    """
    found: dict[float, Answer | None] = {latest: best}
    near, shorter = best, 0

    def peak_at(end: float) -> float:
        if end not in found:
            found[end] = (
                _near_entry(problem, entry, end, near) if near else _best_entry(problem, entry, end, COARSE)
            )
        return _peak(found[end])

    least = _peak(best)
    for share in SOONER:
        if shorter == RISING:
            break
        P = peak_at(share * latest)
        near = found[share * latest] or near
        shorter = shorter + 1 if math.isfinite(least) and least * STEEP < P else 0
        least = min(least, P)
    if not math.isfinite(least):
        return None
    ends = sorted(found)
    i = min(range(len(ends)), key=lambda k: _peak(found[ends[k]]))
    if ends[i] < latest:
        near = found[ends[i]]
        golden(peak_at, ends[max(i - 1, 0)], ends[min(i + 1, len(ends) - 1)], 1e-3 * latest)
    return found[min(found, key=lambda end: _peak(found[end]))]


def _near_entry(problem: Problem, entry: Entry, end: float, near: Answer) -> Answer | None:
    """The best start to `end` with an entry near that of another end."""
    contact = Contact.of(problem.drive)
    answers: dict[float, Answer | None] = {}
    warm = WarmStarts()

    def peak_at(te: float) -> float:
        if te not in answers:
            tau = end - te
            grid = contact_grid(contact, tau, COARSE) if tau > 0.0 else None
            answers[te] = None if grid is None else ContactProgram(problem, tau, grid, warm=warm).solve(te)
        return _peak(answers[te])

    last = min(entry.latest, end)
    if not entry.earliest < last:
        peak_at(entry.earliest)
    else:
        around = entry.earliest + (near.te - entry.earliest) * np.array(NEAR)
        tried = np.unique(np.clip(around, entry.earliest, last))
        i = int(np.argmin([peak_at(te) for te in tried.tolist()]))
        if math.isfinite(peak_at(float(tried[i]))):
            low, high = float(tried[max(i - 1, 0)]), float(tried[min(i + 1, tried.size - 1)])
            golden(peak_at, low, high, 0.05 * (high - low))
    return answers[min(answers, key=lambda te: _peak(answers[te]))]


def _peak(answer: Answer | None) -> float:
    return math.inf if answer is None else answer.P


def _best_entry(problem: Problem, entry: Entry, end: float, steps: int) -> Answer | None:
    """Scan te, then narrow down around the best ones: P over te has kinks, and may have several minima.

    An entry so late that momentum alone asks for more than the best P known is not tried.
    """
    last = min(entry.latest, end)
    contact = Contact.of(problem.drive)
    if entry.earliest >= end:
        return None
    answers: dict[float, Answer | None] = {}
    warm = WarmStarts()

    def peak_at(te: float) -> float:
        if te not in answers:
            tau = end - te
            grid = contact_grid(contact, tau, steps)
            answers[te] = ContactProgram(problem, tau, grid, warm=warm).solve(te)
        return _peak(answers[te])

    def latest_for(P: float) -> float:
        """Momentum: J2 (target - w2(te)) <= (P - Mc)(end - te), by bisection."""
        low, high = entry.earliest, last
        for _ in range(40):
            te = 0.5 * (low + high)
            missing = problem.target - float(entry.load_speed(np.array([te]))[0])
            if contact.J2 * missing <= (P - contact.Mc) * (end - te):
                low = te
            else:
                high = te
        return high

    if last <= entry.earliest:
        peak_at(entry.earliest)
    else:
        lowest, limit = math.inf, last
        shares = np.linspace(0.0, 1.0, SCANNED, endpoint=False)
        for te in (entry.earliest + (last - entry.earliest) * shares**2.5).tolist():
            if te > limit:
                break
            if peak_at(te) < lowest:
                lowest = peak_at(te)
                limit = latest_for(lowest)
        if not math.isfinite(lowest):  # little time: a narrow window of te is left, if any
            speed, te = greatest_speed(problem, entry, end, steps, math.nan)
            if not speed >= problem.target:
                return None
            lowest = peak_at(te)
            if not math.isfinite(lowest):
                return None
            limit = latest_for(lowest)
        for share in np.linspace(0.0, 1.0, SCANNED)[1:] ** 1.5:
            peak_at(entry.earliest + (limit - entry.earliest) * float(share))
        tried = sorted(answers)
        for k in _minima([_peak(answers[te]) for te in tried]):
            low, high = tried[max(k - 1, 0)], tried[min(k + 1, len(tried) - 1)]
            golden(peak_at, low, high, max(1e-5 * end, 0.02 * (high - low)))
    return answers[min(answers, key=lambda te: _peak(answers[te]))]


def _minima(values: list[float]) -> list[int]:
    """The lowest few local minima, lowest first."""
    padded = [math.inf, *values, math.inf]
    local = [
        i
        for i, value in enumerate(values)
        if math.isfinite(value) and padded[i] >= value and value <= padded[i + 2]
    ]
    return sorted(local, key=lambda i: values[i])[:LOCAL_MINIMA]


def greatest_speed(
    problem: Problem, entry: Entry, end: float, steps: int, near: float
) -> tuple[float, float]:
    """The greatest load speed at `end`, rad/s, and the te it needs; -inf where the terminal cannot be met."""
    contact = Contact.of(problem.drive)
    known: dict[float, float] = {}
    warm = WarmStarts()

    def short_by(te: float) -> float:
        te = min(max(te, entry.earliest), entry.latest)
        if te not in known:
            found = None
            if end > te:
                grid = contact_grid(contact, end - te, steps)
                program = ContactProgram(problem, end - te, grid, warm=warm)
                found = program.greatest_speed(te)
            known[te] = math.inf if found is None else -found
        return known[te]

    last = min(entry.latest, end)
    if last > entry.earliest:
        tried = []
        if not math.isnan(near):
            spread = 0.1 * (near - entry.earliest) + 1e-3 * end
            tried = [max(near - spread, entry.earliest), near, near + spread]
        if not tried or not short_by(near) <= min(short_by(tried[0]), short_by(tried[2])) < math.inf:
            tried += [entry.earliest + (last - entry.earliest) * share for share in SHARES]
            tried.sort()
        i = min(range(len(tried)), key=lambda k: short_by(tried[k]))
        if math.isfinite(short_by(tried[i])):
            low, high = tried[max(i - 1, 0)], tried[min(i + 1, len(tried) - 1)]
            golden(short_by, low, high, max(0.02 * (high - low), 1e-5 * end))
    else:
        short_by(entry.earliest)
    te = min(known, key=lambda t: known[t])
    return -known[te], te


def golden(value: Callable[[float], float], low: float, high: float, width: float) -> None:
    """Golden-section search; `value` keeps the values it has computed."""
    ratio = 0.5 * (math.sqrt(5.0) - 1.0)
    a, b = high - ratio * (high - low), low + ratio * (high - low)
    at_a, at_b = value(a), value(b)
    while high - low > width:
        if at_a <= at_b:
            high, b, at_b = b, a, at_a
            a = high - ratio * (high - low)
            at_a = value(a)
        else:
            low, a, at_a = a, b, at_b
            b = low + ratio * (high - low)
            at_b = value(b)


def _refined(problem: Problem, entry: Entry, best: Answer) -> Answer:
    """The same entry, moved a little, on a grid that is finer where the torque switches or T exceeds P.

    P may have a steep kink in te (the least slow entry), so that te itself is found to 2e-7 of t_f at last.
    """
    contact = Contact.of(problem.drive)
    tau = float(best.edges[-1])
    grid = contact_grid(contact, tau, max(MIDDLE, int(1.6 * min(contact.Omega * tau, 2.0 * FINE_ENDS))))

    def moved(best: Answer, grid: Vector, width: float, mending: bool) -> Answer:
        return _moved(problem, entry, best, grid, width, 2e-7 * best.end_time if mending else 0.1 * width)

    return refined(best, grid, REFINEMENT, problem.highest_torque, moved)


def _moved(problem: Problem, entry: Entry, best: Answer, grid: Vector, width: float, within: float) -> Answer:
    """The best entry within `width` of the one known, on another grid."""
    answers: dict[float, Answer | None] = {}
    warm = WarmStarts()
    end = best.end_time

    def peak_at(te: float) -> float:
        te = min(max(te, entry.earliest), entry.latest, end)
        if te not in answers:
            answers[te] = ContactProgram(problem, end - te, grid, warm=warm).solve(te)
        return _peak(answers[te])

    peak_at(best.te)
    if entry.latest > entry.earliest:
        golden(peak_at, best.te - width, best.te + width, within)
    return answers[min(answers, key=lambda te: _peak(answers[te]))] or best


def assemble(problem: Problem, answer: Answer) -> TorqueProfile:
    """The gap part that arrives with v, and the contact part, as one profile up to t_f.

    HiGHS keeps the limits of the torque to its own tolerance only; the profile keeps them exactly.
    """
    pieces = entry_of(problem).pieces(answer.te, answer.v)
    lengths = [max(duration, 0.0) for duration, _ in pieces] + np.diff(answer.edges).tolist()
    levels = [torque for _, torque in pieces] + np.clip(
        answer.levels, problem.lowest_torque, problem.highest_torque
    ).tolist()
    times = np.concatenate([[0.0], np.cumsum(lengths)])
    return TorqueProfile.steps(times, levels)
