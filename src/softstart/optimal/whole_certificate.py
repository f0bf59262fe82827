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
from typing import Any

import numpy as np
from scipy.linalg import expm

from softstart.arrays import Matrix, Vector
from softstart.errors import InputError
from softstart.optimal.certificate import ENDINGS
from softstart.optimal.lp.rows import Limits, Solution, Sparse, WarmStarts, no_linear_objective
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
# of missing an equation by as much as its unit, in units of the torque; the lowest that is enough leaves
# multipliers that prove most of other cells
PRICES = (0.25, 0.5, 1.0, 2.0, 4.0, 40.0, 400.0)
KICKED = 0.02  # of a price: for a kick where phases meet
PROGRAMS = 24  # on a grid
FAILURES, APART = 3, 2  # programs on a grid that may close few cells; others are tried so many cells away
KEPT = 8  # sets of multipliers that the next grid begins with
CLOSED_FORM = 6  # steps that take as long as the closed form of a gap
MOST_WORK, LITTLE_WORK = 2.8e8, 3e7  # numbers computed in all; a drive is judged alike on every machine
ROUNDING = 1e-9
GAINED = 1e-4  # relative: what is left of the goal, or gained by a grid, that ends the work
CLOSED = 0.1  # of the open cells: a program that closes fewer is a failure
LEVELS = (0.95, 0.99, 1.0)  # of the goal, one after the other


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

    The cell [i, k] of `lowest` has tau from first[0] + i steps on, and from first[1] + k steps on g where the
    load moves, w where it rests and is wound up across the gap; one column where te or the rest is all that
    moves. With a load at rest that is moved by a damped contact at once (`winds` is false) T there is above
    Mc, not more. The bounds of all other cells are at least `outside`.
    """

    def __init__(
        self, start: Start, winds: bool, coarse: _Cells | None = None, goal: float = math.inf
    ) -> None:
        self.start, self.winds = start, winds
        s, n = start, start.n
        self.wide = s.open and (winds or not s.rests)  # two durations
        last, self.outside = (n, n if self.wide else 1), math.inf
        self.first = (0, 0)
        if coarse is not None:
            i0, i1, k0, k1 = coarse.open_box(goal) or (0, 1, 0, 1)
            self.first = FINER * i0, FINER * k0 if self.wide else 0
            last = min(FINER * i1, n), min(FINER * k1, n) if self.wide else 1
            rest = coarse.lowest.copy()
            above, left = coarse.first
            rest[i0 - above : i1 - above, k0 - left : k1 - left] = math.inf
            self.outside = min(coarse.outside, float(rest.min()))
        i: Any = np.arange(self.first[0], last[0])[:, None]
        k: Any = np.arange(self.first[1], last[1])
        if s.rests:
            plain = s.Mc + s.J2 * s.problem.target / (s.h * (i + 1.0))
            fits = i + k + (s.n0 + 1 if winds and s.open else s.n0 if s.open else 1) <= n
        else:
            missing = s.problem.target - s.first[W2]
            plain = (s.J2 * missing + s.Mc * s.h * (i + k)) / (s.h * (i + 1.0))
            fits = (i + k + 1 <= n) & (k >= s.n0) if s.open else i < n
        self.lowest = np.where(fits, plain, math.inf)
        if coarse is not None:
            parent = i // FINER - coarse.first[0], (k // FINER if self.wide else k) - coarse.first[1]
            known = coarse.lowest[parent]
            self.lowest = np.maximum(self.lowest, np.where(np.isfinite(known), known, -math.inf))

    lowest: Matrix

    @property
    def least(self) -> float:
        """The least bound of all cells, N m."""
        return min(self.outside, float(self.lowest.min()))

    def middle(self, goal: float, but: list[tuple[int, int]]) -> tuple[int, int] | None:
        """The cell in the middle of those below `goal`, not near any of `but`; None if there is none."""
        alive = self.lowest < goal
        for i, k in but:
            row, column = i - self.first[0], k - self.first[1]
            alive[max(row - APART, 0) : row + APART + 1, max(column - APART, 0) : column + APART + 1] = False
        counts = alive.sum(axis=1)
        if not counts.any():
            return None
        row = int(np.searchsorted(np.cumsum(counts), 0.5 * counts.sum()))
        columns = np.flatnonzero(alive[row])
        return row + self.first[0], int(columns[columns.size // 2]) + self.first[1]

    def count(self, goal: float) -> int:
        """How many cells are below `goal`."""
        return int(np.count_nonzero(self.lowest < goal))

    def open_box(self, goal: float) -> tuple[int, int, int, int] | None:
        """(First row, end of rows, first column, end of columns) of the cells below `goal`, if any."""
        alive = self.lowest < goal
        if not alive.any():
            return None
        rows, columns = np.flatnonzero(alive.any(axis=1)), np.flatnonzero(alive.any(axis=0))
        i, k = self.first
        return int(rows[0]) + i, int(rows[-1]) + 1 + i, int(columns[0]) + k, int(columns[-1]) + 1 + k

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
        box = self.open_box(goal)
        if box is None:
            return False
        i0, i1, k0, k1 = box
        i, k = self.first
        known = self.lowest[i0 - i : i1 - i, k0 - k : k1 - k]
        found = dual.cells((i0, i1), (k0, k1), self.winds, known < goal)
        proved = np.where(np.isfinite(found), found, -math.inf)
        raised = bool(np.any((proved > known) & (known < goal)))
        np.maximum(known, proved, out=known)
        return raised

    def work(self, goal: float, walked: int) -> float:
        """How many numbers a set of multipliers takes, with so many steps in the gap (`Start.walked`)."""
        first, last = spans_of(self.lowest < goal).T
        n, i = self.start.n, np.arange(first.size) + self.first[0]
        steps = last + self.first[1]
        if self.start.rests:
            gap = np.minimum(np.maximum(n - i, 0), walked + CLOSED_FORM)
            steps = (last - first + 1) * gap + last if self.winds == self.start.open else n - i
        return 5.0 * float(np.sum(steps, where=last >= first)) + 60.0 * n


# the linear program ----------------------------------------------------------------------------------------


class _Program:
    """Good multipliers for given durations: T and the curve by means over spans and at their ends."""

    def __init__(
        self, start: Start, durations: tuple[int, int, int], rough: bool = False,
        warm: WarmStarts | None = None,
    ) -> None:  # fmt: skip
        self.start, self.warm = start, warm or WarmStarts()
        gap, winding, contact = durations
        s = self.start
        spans = max(SPANS, int(2.0 * s.Omega * s.h * contact)) // (2 if rough else 1)
        self.prices = PRICES if rough else PRICES[-3:]
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
        scale_z, scale_v = s.c / s.most, s.c / (s.Omega * s.most)
        steps = np.concatenate([np.diff(edges) for _, edges in self.parts]).round(9)  # in h
        kinds = [kind for kind, edges in self.parts for _ in range(edges.size - 1)]
        m = steps.size
        bent = s.rate < math.inf
        demands = m + 1 if bent else m
        joints = len(self.parts) - 2
        sags = demands + 4 * joints  # T above the linear one, where that may be below 0
        begun = kinds.index("contact")
        X = np.zeros((STATES + 3, sags + (m - begun if s.below.any() else 0) + 1))
        X[:STATES, -1] = s.first[:STATES]
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
                if s.below.any():
                    sag = sags + k - begun
                    T_now[-1][sag] += 1.0
                    T_sum[-1][sag] += dt
                    X[V, sag] -= dt * (1.0 / s.J1 + 1.0 / s.J2)
                    X[W2, sag] += dt / s.J2
                z_now.append(s.c * X[Z])
            curve.append((X[STATES + 1].copy(), X[STATES + 2].copy()))
            if k + 1 == ends[-2]:
                equal.append(("speed", X[W2] / s.problem.target))
                if s.problem.terminal != "reached":
                    equal.append(("rate", X[V] * scale_v))
                if s.problem.terminal == "steady":
                    equal.append(("torque", T_now[-1] / s.most))
            elif k + 1 in ends[:-2]:
                if kinds[k] == "stuck":
                    equal.append(("breakaway", (s.c * X[Z] + s.d * X[V]) / s.most))
                else:
                    equal.append(("contact", X[Z] * scale_z))
                joints -= 1
                kick = demands + 4 * joints
                X[Z, kick : kick + 2] += np.array([1.0, -1.0]) / s.c
                X[V, kick + 2 : kick + 4] += np.array([1.0, -1.0]) * s.Omega / s.c
        return self._solved(steps, demands, T_now, T_sum, z_now, curve, equal, goal)

    def _solved(self, steps: Any, demands: int, T_now: Any, T_sum: Any, z_now: Any, curve: Any,
                equal: list[tuple[str, Vector]], goal: float) -> Multipliers | None:  # fmt: skip
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
        begins = np.concatenate([np.arange(after), after + first])  # of the means of the curve
        times = np.add.reduceat(steps[: after + inner], begins)[:, None] * s.h
        w1, uu = (
            np.add.reduceat(np.array(one)[: after + inner], begins, axis=0) / times / s.most
            for one in zip(*curve, strict=True)
        )
        for slope, w, u in s.lines:
            row = uu - slope * w1
            row[:, -1] -= (u - slope * w) / s.most
            lines.append(row)
        count = len(equal)
        sags = demands + 4 * (len(self.parts) - 2)
        free = peak.shape[1] - 1
        columns = free + 2 * count + 2  # demand, kicks, slack of the equations, of T >= 0 and curve, P
        unit = np.append(np.full(free, s.most), 1.0)
        blocks = [_rows(peak * unit, free, columns, {columns - 1: -1.0})]
        blocks.append(_rows(-kept * unit, free, columns, {columns - 2: -1.0}))
        blocks += [_rows(row * unit, free, columns, {columns - 2: -1.0}) for row in lines]
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
            eq[k, :free] = row[:free] * s.most
            eq[k, -1] = row[-1] - targets.get(name, 0.0)
            eq[k, free + 2 * k : free + 2 * k + 2] = 1.0, -1.0
        bounds = np.tile([0.0, np.inf], (columns, 1))
        bounds[:demands] = s.low / s.most, s.high / s.most
        if free > sags:  # by the steps that are left to the end of the swing
            left = np.cumsum(steps[: sags - free - 1 : -1])[::-1]
            bounds[sags:free, 1] = s.below[np.ceil(left).astype(int) - 1] / s.most
        priced = np.r_[demands:sags, free : columns - 1]
        if s.rate < math.inf:
            bounds[0] = s.problem.first_demand / s.most
            if math.isfinite(s.held):
                bounds[after + inner] = s.held / s.most
        above, equations = (Sparse.dense(rows[:, :-1]) for rows in (ub, eq))
        found: Solution | None = None
        for price in self.prices:
            cost = np.full(columns, price)
            cost[:demands] = 0.0
            cost[demands:sags] *= KICKED
            cost[sags:free] = 0.0
            cost[-1] = 1.0
            found = Limits(cost, above, -ub[:, -1], equations, -eq[:, -1]).solved(bounds, self.warm)
            if found is None:
                return None
            self.P = found.cost * s.most
            if 1.02 * goal < self.P or np.all(found.x[priced] < 1e-9):
                break
        assert found is not None
        parts = np.split(
            np.maximum(-found.above, 0.0),
            np.cumsum([len(one) for one in blocks])[:-1],
        )
        names = dict(zip([name for name, _ in equal], found.equal, strict=True))
        return self._multipliers(parts, names, steps, first, at_ends, inner, after)

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


def _rows(rows: Matrix, free: int, columns: int, extra: dict[int, float]) -> Matrix:
    """Rows over all variables and a constant, of rows over the demands in units and a constant."""
    out = np.zeros((rows.shape[0], columns + 1))
    out[:, :free] = rows[:, :free]
    out[:, -1] = rows[:, -1]
    for column, value in extra.items():
        out[:, column] = value
    return out


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
    >>> bound = float(dual.nodes((contact, contact), (gap, gap), False)[0, 0])  # N m, at these instants
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

    It begins with the multipliers `known`; those that raised cells on the last grid are added to `proof`.
    """
    cells, before = _Cells(start, winds), 0.0
    used = list(known)
    for finer in range(GRIDS):
        if finer:
            start = Start(start.problem, FINER * start.n)
            cells = _Cells(start, winds, cells, goal)
        used = [by.on(start) for by in used]
        instants = cells.near(near) if near else None
        failures: list[tuple[int, int]] = []
        for level in LEVELS[2 if known else 0 :]:
            left, used = _raise(cells, level * goal, goal, instants, left, used, failures, report)
            instants = None
        near_enough = cells.least >= goal * (1.0 - GAINED) or cells.least < before * (1.0 + GAINED)
        walked = start.walked(used[-1]) if used else start.n
        if near_enough or left < 3.0 * FINER**2 * cells.work(goal, walked):
            break
        before = cells.least if finer else 0.0
    proof += used
    return cells.least


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
        program = _Program(start, durations, level < goal, warm)
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
