"""The certificate behind a torque lag, a rate limit, a torque-speed curve, braking and damped friction.

A lower bound on the peak of all starts whose gap closes once: over all their durations, cut into cells on
grids that become finer, each cell with the largest bound that any set of multipliers proves of it
(whole_dual.py). Linear programs only supply good multipliers, one set for the durations of one cell; the next
one is found in the middle of the cells that are still open.

A load at rest can wait with the motor at rest, so that such a start may be taken to end at start_time:
cells of (tau, w), the time in contact and that in which the shaft is wound up before. Else cells of
(tau, g), the time in contact and in the gap. After te the demand is free between its limits (in the swing to
the first zero of the answer of T to an impulse), so that the bound needs no assumption about what holds the
torque there.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.linalg import expm

from softstart.arrays import Matrix, Vector
from softstart.errors import InputError
from softstart.optimal.certificate import ENDINGS
from softstart.optimal.lp.rows import (
    Limits,
    RowList,
    Rows,
    Solution,
    Sparse,
    WarmStarts,
    below,
    no_linear_objective,
)
from softstart.optimal.lp.whole import ONE, SLOPE, STATES, W2, Kind, R, U, V, Z
from softstart.optimal.lp.whole_search import phase_orders
from softstart.optimal.problem import Problem
from softstart.optimal.result import LowerBound
from softstart.optimal.whole_dual import FINER, Dual, Multipliers, Start, rests, spans_of

ACROSS = 8.0  # steps of the first grid in a radian of the elastic oscillation
FEWEST, MOST, MOST_RESTING = 150, 1000, 300  # steps of the first grid in the start
RESTING = 200.0  # of them, in what momentum leaves of the start of a load at rest
LONGEST = 200.0  # radians of the elastic oscillation in the start
GRIDS = 6  # each grid has FINER times the steps of the one before
SUBSTEPS = 3  # of the torque in a span over which T is averaged
GAP_STEPS, WINDING_STEPS = 24, 16  # of the torque
SPANS = 60  # at least, and at least two a radian
# of missing an equation by as much as its unit, in units of the torque; the lowest that is enough is taken
PRICES = (4.0, 40.0, 400.0)
KICKED = 0.02  # of a price: for a kick where phases meet
PROGRAMS = 40  # on a grid
FAILURES = 5  # programs on a grid that may close few cells
APART, NEARBY = 2, 0.1  # cells away from them, and of the extent of all open ones, others are tried
KEPT = 8  # sets of multipliers that the next grid begins with
CLOSED_FORM = 6  # steps that take as long as the closed form of a gap
MOST_WORK, LITTLE_WORK = 5.6e8, 3e7  # numbers computed in all; a drive is judged alike on every machine
ROUNDING = 1e-9
GAINED = 1e-4  # relative: what is left of the goal that ends the work
CLOSED = 0.04  # of the open cells: a program that closes fewer is a failure
LEVELS = (0.95, 0.993, 1.0)  # of the goal, one after the other


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
    if rests(problem):
        if drive.initial_load_speed != 0.0 or drive.initial_motor_speed != 0.0:
            return "a reactive load that moves before the contact"
        if drive.theta0 > half or problem.first_torque != 0.0 or problem.first_demand != 0.0:
            return "the shaft is wound up against a load at rest"
    return ""


# cells ------------------------------------------------------------------------------------------------------


class _Cells:
    """Cells of two durations, on the first grid all, on a finer one those that a coarser one leaves open.

    The cell (i, k) has tau from i to i + 1 steps, and from k to k + 1 steps g where the load moves, w where
    it rests and is wound up across the gap; k = 0 where te or the rest is all that moves. With a load at rest
    that is moved by a damped contact at once (`winds` is false) T there is above Mc, not more. Cells are in
    the order of (i, k); `parent` is their place among the coarser ones. The bounds of all others are at least
    `outside`.
    """

    i: Any
    k: Any
    lowest: Vector  # bound of each, N m

    def __init__(
        self, start: Start, winds: bool, coarse: _Cells | None = None, goal: float = math.inf
    ) -> None:
        self.start, self.winds = start, winds
        s, n = start, start.n
        wide = s.open and (winds or not s.rests)  # two durations
        self.outside = math.inf
        if coarse is None:
            i, k = (one.ravel() for one in np.indices((n, n if wide else 1)))
            self.parent = i
        else:
            opened = coarse.lowest < goal
            self.outside = min(coarse.outside, float(np.min(coarse.lowest[~opened], initial=math.inf)))
            parts = FINER if wide else 1
            self.parent = np.repeat(np.flatnonzero(opened), FINER * parts)
            of_i, of_k = (np.tile(one.ravel(), opened.sum()) for one in np.indices((FINER, parts)))
            i, k = FINER * coarse.i[self.parent] + of_i, parts * coarse.k[self.parent] + of_k
        if s.rests:
            plain: Any = s.Mc + s.J2 * s.problem.target / (s.h * (i + 1.0))
            fits = i + k + (s.n0 + 1 if winds and s.open else s.n0 if s.open else 1) <= n
        else:
            missing = s.problem.target - s.first[W2]
            plain = (s.J2 * missing + s.Mc * s.h * (i + k)) / (s.h * (i + 1.0))
            fits = (i + k + 1 <= n) & (k >= s.n0) if s.open else i < n
        kept = np.lexsort((k, i))
        kept = kept[fits[kept]]
        self.i, self.k, self.parent, self.lowest = i[kept], k[kept], self.parent[kept], plain[kept]
        if coarse is not None:
            np.maximum(self.lowest, coarse.lowest[self.parent], out=self.lowest)

    @property
    def least(self) -> float:
        """The least bound of all cells, N m."""
        return min(self.outside, float(np.min(self.lowest, initial=math.inf)))

    def middle(self, goal: float, but: list[tuple[int, int]]) -> tuple[int, int] | None:
        """The cell in the middle of those below `goal`, not near any of `but`; None if there is none."""
        alive = np.flatnonzero(self.lowest < goal)
        if not alive.size:
            return None
        i, k = self.i[alive], self.k[alive]
        apart_i, apart_k = (max(APART, int(NEARBY * np.ptp(one))) for one in (i, k))
        left = np.ones(alive.size, dtype=bool)
        for at_i, at_k in but:
            left &= (np.abs(i - at_i) > apart_i) | (np.abs(k - at_k) > apart_k)
        i, k = i[left], k[left]
        if not i.size:
            return None
        row = int(i[(i.size - 1) // 2])
        columns = k[i == row]
        return row, int(columns[columns.size // 2])

    def count(self, goal: float) -> int:
        """How many cells are below `goal`."""
        return int(np.count_nonzero(self.lowest < goal))

    def instants(self, cell: tuple[int, int]) -> tuple[int, int, int]:
        """(steps in the gap, winding up, in contact) of a start in a cell."""
        (i, k), s, n = cell, self.start, self.start.n
        tau = max(i, 1)
        if not s.rests:
            return (k + 1, 0, i) if s.open and i else (k, 0, 1) if s.open else (0, 0, i + 1)
        if not s.open:
            return 0, n - tau, tau
        w = max(k, 1) if self.winds else 0
        return max(n - tau - w, 1), w, tau

    def near(self, known: tuple[float, float, float]) -> tuple[int, int, int] | None:
        """The same of a known start, by its instants of contact, breakaway and end in s."""
        s, (tc, tb, te) = self.start, known
        gap = max(math.ceil(tc / s.h - 1e-9), 1) if s.open else 0
        winding = 0
        if s.rests:
            te = s.end
            winding = max(round((tb - tc) / s.h), 1) if self.winds else 0
            if not s.open:
                winding = max(round(tb / s.h), 1)
        contact = math.floor(te / s.h + 1e-9) - gap - winding
        return (gap, winding, contact) if contact > 0 else None

    def raise_by(self, dual: Dual, goal: float) -> bool:
        """Take the larger one of what is known of the cells below `goal` and what a dual proves.

        True if the dual raised one of them.
        """
        below = np.flatnonzero(self.lowest < goal)
        if not below.size:
            return False
        known = self.lowest[below]
        proved = dual.cells(self.i[below], self.k[below], self.winds)
        self.lowest[below] = np.where(np.isfinite(proved), np.maximum(proved, known), known)
        return bool(np.any(self.lowest[below] > known))

    def take(self, finer: _Cells) -> None:
        """Take the least bound of the parts of each cell that a finer grid has, where it is larger."""
        least = np.full(self.lowest.size, math.inf)
        np.minimum.at(least, finer.parent, finer.lowest)
        parents = np.unique(finer.parent)
        self.lowest[parents] = np.maximum(self.lowest[parents], least[parents])

    def work(self, goal: float, walked: int) -> float:
        """How many numbers a set of multipliers takes, with so many steps in the gap (`Start.walked`)."""
        n, below = self.start.n, self.lowest < goal
        if not below.any():
            return 60.0 * n
        row, spans = spans_of(self.i[below], self.k[below])
        first, last = spans.T
        i = np.arange(first.size) + row
        steps = last + 1
        if self.start.rests:
            gap = np.minimum(np.maximum(n - i, 0), walked + CLOSED_FORM)
            steps = (last - first + 2) * gap + last if self.winds == self.start.open else n - i
        return 5.0 * float(np.sum(steps, where=last >= first)) + 60.0 * n


# the linear program ----------------------------------------------------------------------------------------


class _Program:
    """Good multipliers for given durations: T and the curve by means over spans and at their ends."""

    def __init__(self, start: Start, durations: tuple[int, int, int], warm: WarmStarts | None = None) -> None:
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

    def solve(self, goal: float) -> Multipliers | None:
        """Multipliers whose bound is above `goal` N m, or the largest; None where HiGHS finds none."""
        s = self.start
        steps = np.concatenate([np.diff(edges) for _, edges in self.parts]).round(9)  # in h
        kinds = [kind for kind, edges in self.parts for _ in range(edges.size - 1)]
        m = steps.size
        bent = s.rate < math.inf
        inner = self.parts[-2][1].size - 1  # steps in contact up to te
        after = m - inner - (self.parts[-1][1].size - 1)  # steps before the contact
        ends = np.cumsum([edges.size - 1 for _, edges in self.parts])
        begins = np.concatenate([np.arange(a, b, SUBSTEPS) for a, b in pairwise([0, *ends])])  # of spans
        # Columns: demands, kicks, T above the linear one where that may be below 0, states at the beginning
        # of each span (eliminated, they would fill all rows), slack of the equations, of T >= 0 and curve, P
        demands = m + 1 if bent else m
        sags = demands + 4 * (len(self.parts) - 2)
        known = sags + (m - after if s.below.any() else 0)
        free = known + STATES * begins.size
        units = s.most * np.array([1.0 / s.c, s.Omega / s.c, s.Omega / s.c, 1.0])
        sides = list(pairwise([*begins.tolist(), m]))
        spans = [_span(s, kinds[a], tuple(steps[a:b].tolist()), units) for a, b in sides]
        of = np.repeat(np.arange(begins.size), np.diff([*begins, m]))  # span of each step
        at = np.column_stack(
            [
                known + STATES * np.arange(begins.size)[:, None] + np.arange(STATES),
                begins[:, None] + np.arange(SUBSTEPS + 1),
                sags + begins[:, None] - after + np.arange(SUBSTEPS),
            ]
        )  # columns of each span

        def rows(values: Matrix, span: Any) -> Rows:
            row, place = np.nonzero(values[:, :-1])
            return Sparse(len(values), row, at[span][row, place], values[row, place]), values[:, -1]

        def means(values: Matrix, first: Any) -> Rows:
            times = np.add.reduceat(steps[: after + inner], first)[:, None] * s.h
            return rows(np.add.reduceat(values[: after + inner], first, axis=0) / times, of[first])

        def stacked(*some: Rows) -> Rows:
            return Sparse.stacked([one for one, _ in some]), np.concatenate([one for _, one in some])

        T_now, T_sum, z_now, w1_sum, u_sum = np.concatenate([one.rows for one in spans]).transpose(1, 0, 2)
        first = begins[(begins >= after) & (begins < after + inner)]
        last, tail = np.append(first[1:], after + inner) - 1, np.arange(after + inner, m)
        T_mean, T_last = means(T_sum, first), rows(T_now[last], of[last])
        kept = rows(z_now[last], of[last]) if s.pulls else stacked(T_mean, T_last)
        lines = []
        for slope, w, u in s.lines:
            below_it = means(u_sum - slope * w1_sum, np.append(np.arange(after), first))
            lines.append((below_it[0], below_it[1] - (u - slope * w) / s.most))
        equal: list[tuple[str, Rows]] = []
        links = RowList()
        for k, (_, end) in enumerate(sides[:-1]):
            state = spans[k].end
            X = state / units[:, None]
            link, constant = rows(X, np.full(STATES, k))
            next_one = known + STATES * (k + 1) + np.arange(STATES)
            link = link - Sparse.of(STATES, next_one, np.ones(STATES))
            if end == ends[-2]:
                equal.append(("speed", rows(state[[W2]] / s.problem.target, [k])))
                if s.problem.terminal != "reached":
                    equal.append(("rate", rows(X[[V]], [k])))
                if s.problem.terminal == "steady":
                    equal.append(("torque", rows(T_now[[end - 1]], [k])))
            elif end in ends[:-2]:
                name = "breakaway" if kinds[end - 1] == "stuck" else "contact"
                equal.append((name, rows(T_now[[end - 1]] if name == "breakaway" else X[[Z]], [k])))
                kicks = sags - 4 * len(equal) + np.arange(4)
                kicked = Sparse(STATES, np.array([Z, Z, V, V]), kicks, np.array([-1.0, 1.0, -1.0, 1.0]))
                link = link - kicked
            links.add(link, -constant)
        count = len(equal)
        columns = free + 2 * count + 2
        slack, P = (Sparse.single({columns - back: 1.0}) for back in (2, 1))
        blocks = [below(stacked(T_mean, T_last, rows(T_now[tail], of[tail])), P), below(kept, slack, -1.0)]
        blocks += [below(one, slack) for one in lines]
        if bent:
            moves, most = np.arange(m), s.rate * steps * s.h / s.most
            rise = Sparse.of(m, np.append(moves + 1, moves), np.repeat([1.0, -1.0], m))
            blocks += [(rise, most), (-1.0 * rise, most)]
        above, most_above = stacked(*blocks)
        targets = {"speed": 1.0, "torque": s.Mc / s.most, "breakaway": s.Mc / s.most}
        named = RowList()
        for k, (name, (row, constant)) in enumerate(equal):
            slacks = Sparse.single({free + 2 * k: -1.0, free + 2 * k + 1: 1.0})
            named.add(row - slacks, targets.get(name, 0.0) - constant)
        equations, exactly = stacked(named.all(), links.all())
        bounds = np.tile([0.0, np.inf], (columns, 1))
        bounds[:demands] = s.low / s.most, s.high / s.most
        bounds[known:free, 0] = -np.inf
        bounds[known : known + STATES] = (s.first[:STATES] / units)[:, None]
        if known > sags:  # by the steps that are left to the end of the swing
            left = np.cumsum(steps[after:][::-1])[::-1]
            bounds[sags:known, 1] = s.below[np.ceil(left).astype(int) - 1] / s.most
        priced = np.r_[demands:sags, free : columns - 1]
        if bent:
            bounds[0] = s.problem.first_demand / s.most
            if math.isfinite(s.held):
                bounds[after + inner] = s.held / s.most
        found: Solution | None = None
        for price in PRICES:
            cost = np.full(columns, price)
            cost[:demands] = 0.0
            cost[demands:sags] *= KICKED
            cost[sags:free] = 0.0
            cost[-1] = 1.0
            found = Limits(cost, above, most_above, equations, exactly).solved(bounds, self.warm)
            if found is None:
                return None
            self.P = found.cost * s.most
            if 1.02 * goal < self.P or np.all(found.x[priced] < 1e-9):
                break
        assert found is not None
        parts = np.split(
            np.maximum(-found.above, 0.0),
            np.cumsum([right.size for _, right in blocks])[:-1],
        )
        names = dict(zip([name for name, _ in equal], found.equal[:count], strict=True))
        return self._multipliers(parts, names, steps, first - after, last - after, inner, after)

    def _multipliers(self, parts: list[Vector], names: dict[str, float], steps: Any, first: Any,
                     at_ends: Any, inner: int, after: int) -> Multipliers | None:  # fmt: skip
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
        early: dict[str, Matrix] = {}
        none = np.zeros((len(s.lines), s.n))
        begun = 0
        for kind, at in (*self.parts[:-2], (None, None)):
            for k in range(len(s.lines)):
                weights = parts[2 + k][begun:]
                if at is None:
                    spread(curve[k], weights)
                else:  # over the time before the phase ends
                    gathered = np.append(0.0, np.cumsum(weights[: at.size - 1][::-1]))
                    name = "winding" if kind == "stuck" else "gap"
                    density = early.setdefault(name, np.zeros((len(s.lines), s.n)))
                    density[k] = np.diff(np.interp(np.arange(s.n + 1), at[-1] - at[::-1], gathered)) / s.h
            begun += 0 if at is None else at.size - 1
        units = {
            "speed": s.most / s.problem.target, "rate": s.c / s.Omega, "torque": 1.0, "contact": s.c,
            "breakaway": 1.0,
        }  # fmt: skip
        value = {name: names.get(name, 0.0) * unit / total for name, unit in units.items()}
        return Multipliers(
            torque, closed, curve, early.get("winding", none), early.get("gap", none), value["speed"],
            value["rate"], value["torque"], -value["contact"], -value["breakaway"], self.durations, s.end,
        )  # fmt: skip


def _even(steps: int, parts: int) -> Vector:
    return np.unique(np.round(np.linspace(0, steps, min(parts, steps) + 1)).astype(int))


@dataclass(frozen=True, eq=False)
class _Span:
    """How a few steps move the state: over states before in units, demands, T above the linear one, and 1."""

    rows: Any  # (steps, 5, places): T, the integral of T, c z, integrals of w1 and u, in units of the torque
    end: Matrix  # (STATES, places): the state afterwards


def _span(s: Start, kind: Kind, steps: tuple[float, ...], units: Vector) -> _Span:
    if (kind, steps) in s.spans:
        known: _Span = s.spans[kind, steps]
        return known
    states = [Z, V, W2, U, 7, 8, 9]
    X = np.zeros((len(states), STATES + 2 * SUBSTEPS + 2))
    X[np.arange(STATES), np.arange(STATES)] = units
    rows = np.zeros((len(steps), 5, X.shape[1]))
    for k, step in enumerate(steps):
        if (kind, step) not in s.spans:
            s.spans[kind, step] = _with_means(s, kind, step * s.h)
        F, dt, demand, sag = s.spans[kind, step], step * s.h, STATES + k, STATES + SUBSTEPS + 1 + k
        X = F[np.ix_(states, [Z, V, W2, U])] @ X[:STATES]
        on_r, on_slope = s.most * F[states, R], s.most * F[states, SLOPE] / dt
        X[:, demand] += on_r
        if s.limited:
            X[:, demand] -= on_slope
            X[:, demand + 1] += on_slope
        X[:, -1] += F[states, ONE]
        rows[k] = s.c * X[Z] + s.d * X[V], X[STATES], s.c * X[Z], X[STATES + 1], X[STATES + 2]
        if kind == "contact" and s.below.any():
            rows[k, :2, sag] += s.most * np.array([1.0, dt])
            X[V, sag] -= s.most * dt * (1.0 / s.J1 + 1.0 / s.J2)
            X[W2, sag] += s.most * dt / s.J2
    s.spans[kind, steps] = span = _Span(rows / s.most, X[:STATES])
    return span


def _with_means(start: Start, kind: Kind, dt: float) -> Matrix:
    """How the state and the integrals of T, w1 and u move in a step."""
    M = np.zeros((10, 10))
    M[:7, :7] = start.rates[kind]
    M[7, [Z, V]] = start.c, start.d
    M[8, [V, W2]] = 1.0
    M[9, U if start.lag > 0.0 else R] = 1.0
    return np.asarray(expm(M * dt))


def whole_bound(problem: Problem, k_dyn: float, near: tuple[float, float, float] | None = None,
                within: float = 1e-3, work: float = MOST_WORK,
                proof: Sequence[Any] = ()) -> LowerBound:  # fmt: skip
    """The largest lower bound found on K_dyn of a problem for which `not_certified` has nothing to say.

    `k_dyn` is what is to be judged: the work ends once the bound is within that share of it. `near`, the
    instants of contact, breakaway and end in s of the best start known, make it quicker, and so does the
    `proof` of another start time of the drive. `work` limits it.

    >>> from softstart import Drive
    >>> drive = Drive.load("crane-4amtkf").replace(target_speed=60.0, torque_lag=0.005)
    >>> bound = whole_bound(Problem(drive, 0.2883042), 0.92981, (0.02667, 0.02667, 0.2883042))
    >>> 0.928 < bound.k_dyn < 0.9299
    True
    """
    low, high = problem.lowest_torque, problem.highest_torque
    open_at_first = problem.drive.theta0 < 0.5 * problem.drive.gap
    closing = "whose gap closes once and stays closed" if open_at_first else "whose gap stays closed"
    moving = ", the load moving on once it moves," if rests(problem) else ""
    kept = problem.terminal == "steady" and math.isfinite(problem.drive.torque_rate)
    held = ", which the demand holds from then on," if kept else ""
    covers = (
        f"every torque demand from {low:g} to {high:g} N m over time, by whatever controller, "
        f"{closing}{moving} until {ENDINGS[problem.terminal]}{held} and half an elastic period longer"
    )
    goal = k_dyn * problem.base_torque * (1.0 - within)
    used = [one for one in proof if isinstance(one, Multipliers)]
    peak = certified_peak(problem, goal, near, work, used=used)
    k_dyn = peak * (1.0 - ROUNDING) / problem.base_torque
    return LowerBound(k_dyn, "certificate", covers, near=False, proof=tuple(used))


def dual_at(problem: Problem, instants: tuple[float, float, float], steps: int = 600) -> Dual:
    """What the multipliers of the program with given instants (contact, breakaway, end; s) prove.

    >>> from softstart import Drive
    >>> drive = Drive.load("crane-4amtkf").replace(target_speed=60.0, torque_lag=0.005)
    >>> dual = dual_at(Problem(drive, 0.2883042), (0.02667, 0.02667, 0.2883042))
    >>> gap, _, contact = dual.by.durations
    >>> bound = dual.nodes(np.array([contact]), np.array([gap]), False).item()  # N m, at these instants
    >>> round(bound / dual.start.problem.base_torque, 2)
    0.93
    """
    start = Start(problem, steps)
    durations = _Cells(start, start.rests).near(instants)
    by = None if durations is None else _Program(start, durations).solve(math.inf)
    if by is None:
        raise InputError(f"instants = {instants!r}: no start has these.")
    return Dual(start, by)


# the search -------------------------------------------------------------------------------------------------


def certified_peak(problem: Problem, goal: float, near: tuple[float, float, float] | None = None,
                   work: float = MOST_WORK, report: Any = None,
                   used: list[Multipliers] | None = None) -> float:  # fmt: skip
    """The least bound over all cells, N m; the search ends at `goal`.

    `near`, the instants of contact, breakaway and end in s of the best start known, make it quicker; so do
    the multipliers `used` for another start time; those that proved something here are in it afterwards.
    """
    used = [] if used is None else used
    start = Start(problem, first_steps(problem, goal))
    if start.earliest >= start.end:
        return math.inf
    known = list(used)
    used.clear()
    least = _least(start, goal, near, work, report, start.rests, known, used)
    if start.rests and start.open and len(list(phase_orders(problem))) > 1:
        least = min(least, _least(start, goal, near, work, report, False, known, used))
    return least


def first_steps(problem: Problem, goal: float = math.inf) -> int:
    """Steps of the first grid: the earliest contact is to be just after a node.

    A load at rest takes the cube of those left by momentum.
    """
    drive: Any = problem.drive
    end, most = float(problem.start_time or math.nan), float(MOST)
    if rests(problem):
        least = min(drive.J2 * problem.target / max(goal - drive.Mc, 1e-300) / end, 1.0)
        most = min(max(MOST_RESTING, RESTING / max(1.0 - least, 1e-3)), MOST)
    wanted = int(min(max(ACROSS * float(drive.Omega) * end, FEWEST), most))
    counts = np.arange(wanted, int(1.15 * wanted) + 2)
    earliest = min(order.tc for order in phase_orders(problem)) if drive.theta0 < 0.5 * drive.gap else 0.0
    after = FINER**2 * earliest / end * counts
    return int(counts[np.argmin(after - np.floor(after - 1e-9))])


def _least(start: Start, goal: float, near: tuple[float, float, float] | None, left: float, report: Any,
           winds: bool, known: list[Multipliers], proof: list[Multipliers]) -> float:  # fmt: skip
    """The least bound over the cells, each raised by multipliers found among them, on finer grids.

    The lowest cells decide: all are brought to one level, on grids as fine as it needs, before any is brought
    to the next. It begins with the multipliers `known`; of those that raised cells some are added to `proof`.
    """
    grids, used = [_Cells(start, winds)], [[by.on(start) for by in known]]
    failures: list[list[tuple[int, int]]] = [[] for _ in range(GRIDS)]
    levels = [share * goal for share in LEVELS[len(LEVELS) - 1 if known else 0 :]]
    for level in levels:
        for finer in range(GRIDS):
            if finer == len(used):
                used.append([])
            if finer:
                fine = grids[finer].start if finer < len(grids) else start.refined(finer)
                used[finer] += [by.on(fine) for by in used[finer - 1]]
                grids[finer:] = [_Cells(fine, winds, grids[finer - 1], level)]
            cells = grids[finer]
            instants = cells.near(near) if near and level == levels[0] else None
            left, used[finer] = _raise(
                cells, level, goal, instants, left, used[finer], failures[finer], report
            )
            walked = cells.start.walked(used[finer][-1]) if used[finer] else cells.start.n
            if cells.count(level) == 0 or left < 3.0 * FINER**2 * cells.work(level, walked):
                break
        reached = cells.count(level) == 0
        for coarse, its_parts in reversed(list(pairwise(grids))):
            coarse.take(its_parts)
        if not reached or grids[0].least >= goal * (1.0 - GAINED):
            break
    proof += [by.on(start) for some in used for by in some][-KEPT:]
    return grids[0].least


def _raise(cells: _Cells, level: float, goal: float, near: tuple[int, int, int] | None, left: float,
           used: list[Multipliers], failures: list[tuple[int, int]],
           report: Any) -> tuple[float, list[Multipliers]]:  # fmt: skip
    """On one grid, until all cells are at the level or programs close few: what is left of the work, and
    multipliers that raised cells, as far as they are kept.
    """
    start, warm = cells.start, WarmStarts()
    raised: list[Multipliers] = []
    for by in used[-KEPT:]:
        if cells.count(level) == 0:
            raised.append(by)
            continue
        left -= cells.work(level, start.walked(by))
        if cells.raise_by(Dual(start, by), level):
            raised.append(by)
    begun = len(failures)
    solved: list[tuple[int, int, int]] = []
    for _ in range(PROGRAMS):
        cell = cells.middle(level, failures)
        if cell is None or left < 0.0:
            break
        durations, open_before = near or cells.instants(cell), cells.count(level)
        if durations in solved:
            failures.append(cell)
            continue
        solved.append(durations)
        program = _Program(start, durations, warm)
        found = program.solve(goal)
        left -= 5.0 * float(sum(edges.size for _, edges in program.parts)) ** 2
        if found is not None:
            left -= cells.work(level, start.walked(found))
            cells.raise_by(Dual(start, found), level)
            raised.append(found)
        if report:
            report(start.n, level, durations, program.P, open_before, cells.count(level), cells.least, left)
        if near is None and cells.count(level) > (1.0 - CLOSED) * open_before:
            failures.append(cell)
            if len(failures) > begun + FAILURES:
                break
        near = None
    return left, raised[-KEPT:]
