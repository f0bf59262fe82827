"""Which law engages the clutch of [C] with the least friction work, for a given peak of the shaft torque?

While the clutch slips everything is linear in the law M(t), 0 <= t <= tM, behind which the torque is MM.
With I = IM + Ic, kappa = Ic/I, B the elastic frequency, V the speed of both masses' centre, v = T'/cp:

    T(t)  = T0 (1 - cos B t) + kappa B int_0^t M(s) sin B(t - s) ds,     T0 = Mc IM/I
    I V'  = M - Mc,   wM = V + kappa v

From tM on the shaft swings about Tm = (MM Ic + Mc IM)/I. So the lag A = int_0^tM (w0 - V) dt and the state at
tM, a = T - Tm, b = T'/B, D = w0 - V, say all about the rest; all four are linear in the law. Slip ends s
later in the end (s, p, q): p = T - Tm and q = T'/B are (a, b) turned back by B s, and D = g s + kappa v with
g = (MM - Mc)/I, v = B q/cp. By energy the friction work [C] (3) is

    L = I w0^2/2 + Mc (A + g s^2/2 + kappa s v) - Ic v^2/2 - ((Tm + p - T0)^2 - T0^2)/(2 cp)

The least lag A for a given end, with T <= P, is a linear program (`Program`). Its multipliers y of (a, b, D)
and m of T(t_j) <= P prove, for laws of every shape and for every end, the cut

    A >= y . (a, b, D) - P sum(m) + k,   k = const + min over the class of laws of int_0^tM r(t) M(t) dt

where r is a sum of sines: the minimum is known. With a cut put in for A, L is *concave in (p, q)* for a given
s. Hence its least value over a convex cell of ends is at a corner of the cell, and a grid of cells over all
ends gives a lower bound of the work (`Search.bound`); between two s it is lower by what the second derivative
allows. Ends beyond |(p, q)| <= P - Tm, or before which the clutch side was faster than w0, are no ends.

Bound and linear program take turns: the end that looks best is where the next program looks for a law. Each
law is engaged on the exact clutch, and its figures are those of that run. What the bound rests on: the
formulas above, HiGHS's multipliers only as numbers (any would prove something), and rounding, which is not
enclosed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import product
from typing import Any, NamedTuple

import numpy as np

from softstart.arrays import Matrix, Vector
from softstart.clutch import Clutch, Engagement, engage
from softstart.errors import InputError, SimulationError
from softstart.quantities import show

STEPS = 160  # torques of a law
CHECKS = 4  # instants in each of them at which T <= P is asked
FINER = 16  # cells of a cut in each of them
CLOSE = 1.5e-4  # of the work: difference at which found and proved agree
TURNS = 25
OVER = 2e-4  # of its peak, by which a law may exceed it between the instants checked; the bound is for that
PRICE = 40.0  # of missing the end by its scale, in units of the lag's
ANGLES, SPANS = 180, 24  # corners of the outline, and times of slip, where branch and bound begins
ROUNDS, MOST_CELLS, TOLERANCE = 60, 60_000, 3e-5
CORNERS = np.array(list(product((0, 1), repeat=3)))
# by which share the ends that are tried keep off touching w0 before, and the next one where that fails
TOUCHES = (2e-3, 5e-3, 1e-2, 2e-2, 5e-2)


class Slip:
    """The constants of a clutch whose optimal law is sought; InputError where the optimum is not linear."""

    def __init__(self, clutch: Clutch) -> None:
        load = "active" if clutch.load_torque == 0.0 else clutch.load_kind
        known = (("gap", clutch.gap, 0.0), ("damping", clutch.damping, 0.0), ("load_kind", load, "active"))
        wrong = [
            f"{key} = {show(value)}: the optimal law is known for {show(usual)} only, as in [C]; set {key} = "
            f"{show(usual)} (engage simulates any other)."
            for key, value, usual in known
            if value != usual
        ]
        if wrong:
            raise InputError(wrong)
        self.IM, self.Ic, self.cp = clutch.clutch_inertia, clutch.load_inertia, clutch.stiffness
        self.MM, self.Mc, self.Tm = clutch.clutch_torque, clutch.load_torque, clutch.mean_torque
        self.w0, self.tM, self.B = clutch.drive_speed, clutch.engagement_time, clutch.B
        self.I = self.IM + self.Ic
        self.kappa, self.T0 = self.Ic / self.I, self.Mc * self.IM / self.I
        self.g = (self.MM - self.Mc) / self.I
        self.period = 2.0 * math.pi / self.B
        self.per_q = self.kappa * self.B / self.cp  # kappa v = per_q q
        rest = (self.w0 - self.g * self.tM) / self.g
        if rest < 1.5 * self.period:
            raise InputError(
                f"engagement_time = {self.tM:g}: with full torque the masses are at speed "
                f"{max(rest, 0.0):.3g} s after it; the optimal law is known where the clutch slips for 1.5 "
                f"elastic periods more ({1.5 * self.period:.3g} s), the hard case of [C]; give a shorter "
                "engagement_time."
            )

    def torques(self, t: Vector, edges: Vector) -> tuple[Matrix, Vector]:
        """(matrix, constants): T at the instants t of a law that is constant between the edges."""
        since = self.B * np.maximum(t[:, None] - edges, 0.0)
        return self.kappa * np.diff(np.cos(since)), self.T0 * (1.0 - np.cos(self.B * t))

    def at_tM(self, edges: Vector) -> tuple[Matrix, Vector]:
        """(matrix, constants): a, b, D and A of a law that is constant between the edges, as four rows."""
        left, tM = self.tM - edges, self.tM
        turn = self.B * left
        matrix = np.vstack([
            self.kappa * np.diff(np.cos(turn)), -self.kappa * np.diff(np.sin(turn)),
            np.diff(left) / self.I, np.diff(left**2) / (2.0 * self.I),
        ])  # fmt: skip
        a, b = self.T0 * (1.0 - math.cos(self.B * tM)) - self.Tm, self.T0 * math.sin(self.B * tM)
        lost = self.Mc * tM / self.I
        return matrix, np.array([a, b, self.w0 + lost, (self.w0 + 0.5 * lost) * tM])

    def state(self, s: Vector, p: Vector, q: Vector) -> Vector:
        """(a, b, D) at tM, in the first axis, of an engagement that ends at (s, p, q)."""
        cos, sin = np.cos(self.B * s), np.sin(self.B * s)
        D = self.g * s + self.per_q * q
        return np.stack(np.broadcast_arrays(p * cos - q * sin, p * sin + q * cos, D))

    def work(self, A: Vector, s: Vector, p: Vector, q: Vector) -> Vector:
        """Friction work L in J."""
        lag = A + (0.5 * self.g * s + self.per_q * q) * s
        swing = (self.Tm + p - self.T0) ** 2 - self.T0**2
        return np.asarray(
            0.5 * self.I * self.w0**2
            + self.Mc * lag
            - 0.5 * self.Ic * (self.B * q / self.cp) ** 2
            - swing / (2.0 * self.cp)
        )

    def outline(self, P: float, touch: float = 0.0) -> Matrix:
        """Corners (p, q), by angle, of a polygon about all ends that are possible with a peak of P (N m).

        With `touch` it leaves out ends before which the clutch side all but touches w0.
        """
        radius = P - self.Tm
        if radius <= 1e-9 * self.Tm:
            return np.zeros((1, 2))
        from scipy.spatial import HalfspaceIntersection

        angles = 2.0 * np.pi * np.arange(ANGLES) / ANGLES
        turn = angles[1:]  # before the end: w0 - wM = g t + per_q (q - p sin B t - q cos B t) >= 0
        normals = np.vstack([
            np.column_stack([np.cos(angles), np.sin(angles)]),
            np.column_stack([np.sin(turn), np.cos(turn) - 1.0]) / turn[:, None], [[1.0, 0.0]],
        ])  # fmt: skip
        slower = (1.0 - touch) * self.g / (self.B * self.per_q)
        limits = np.append(np.full(ANGLES, radius), np.full(turn.size + 1, slower))
        corners = HalfspaceIntersection(np.column_stack([normals, -limits]), np.zeros(2)).intersections
        return np.asarray(corners[np.argsort(np.arctan2(corners[:, 1], corners[:, 0]))])


class Cut(NamedTuple):
    """A >= y . (a, b, D) - P slope + k for every law of the class that keeps T <= P."""

    y: Vector
    slope: float
    k: float


class Program:
    """The linear program on a grid of `steps` constant torques."""

    def __init__(self, slip: Slip, monotone: bool, steps: int) -> None:
        self.slip, self.monotone = slip, monotone
        self.edges = np.linspace(0.0, slip.tM, steps + 1)
        self.instants = np.linspace(0.0, slip.tM, CHECKS * steps + 1)[1:]
        self.T, self.T_free = slip.torques(self.instants, self.edges)
        self.ends, self.free = slip.at_tM(self.edges)
        fine = np.linspace(0.0, slip.tM, FINER * steps + 1)
        self.fine_T, self.fine_ends = slip.torques(self.instants, fine)[0], slip.at_tM(fine)[0]

    def solve(self, end: Vector, P: float) -> tuple[Vector, Cut]:
        """The law with the least A that keeps T <= P and ends at (a, b, D), or nearby, and its cut."""
        from scipy import optimize

        slip, n = self.slip, self.T.shape[1]
        MM, size = slip.MM, slip.w0 * slip.tM
        scales = np.array([MM, MM, slip.w0])
        # variables: M/MM, then what is missed of each end upwards and downwards, in its scale
        cost = np.append(self.ends[3] * MM / size, np.full(6, PRICE))
        equal = np.hstack([self.ends[:3] * MM / scales[:, None], np.eye(3), -np.eye(3)])
        below, limits = self.T, (P - self.T_free) / MM
        if self.monotone:
            below = np.vstack([below, np.eye(n - 1, n) - np.eye(n - 1, n, 1)])
            limits = np.append(limits, np.zeros(n - 1))
        below = np.hstack([below, np.zeros((limits.size, 6))])
        bounds = [(0.0, 1.0)] * n + [(0.0, None)] * 6
        right = (end - self.free[:3]) / scales
        found = optimize.linprog(cost, below, limits, equal, right, bounds, method="highs")
        if found.status != 0:
            raise ArithmeticError(f"HiGHS: {found.message}")
        shares = np.clip(found.x[:n], 0.0, 1.0)
        shares[shares < 1e-9], shares[shares > 1.0 - 1e-9] = 0.0, 1.0
        mass = np.maximum(-found.ineqlin.marginals[: self.instants.size], 0.0) * size / MM
        return shares * MM, self._cut(found.eqlin.marginals * size / scales, mass)

    def _cut(self, y: Vector, mass: Vector) -> Cut:
        """What these multipliers prove: the least of int r M over the class, by the integrals of r in cells.

        Where r changes its sign within a cell of length h, |int r| <= |r'| h^2/2, and the least of int r M is
        lower than by the whole cell by |r'| h^2/8 at most.
        """
        slip = self.slip
        cells = self.fine_ends[3] - y @ self.fine_ends[:3] + mass @ self.fine_T
        h = slip.tM / cells.size
        bend = h**2 * (1.0 / slip.I + slip.kappa * slip.B**2 * (np.hypot(y[0], y[1]) + mass.sum()))
        if self.monotone:  # a nondecreasing law is a mixture of steps from 0 to MM
            least = min(0.0, float(np.cumsum(cells[::-1]).min())) - bend / 8.0
        else:
            least = float(np.minimum(cells, 0.0).sum()) - bend / 8.0 * np.sum(np.abs(cells) <= bend / 2.0)
        constant = float(self.free[3] - y @ self.free[:3] + mass @ self.T_free)
        return Cut(y, float(mass.sum()), constant + slip.MM * least)


@dataclass(frozen=True, eq=False)
class OptimalLaw:
    """A law with the least friction work at its peak torque; SI.

    `times`, `torques` are its table (steps are two points at one instant). `run` is its engagement, which
    `peak_torque` and `slip_work` are taken from. No law of the class has less work than `work_bound` at this
    peak.
    """

    times: list[float]
    torques: list[float]
    run: Engagement
    work_bound: float

    @property
    def peak_torque(self) -> float:
        """Largest shaft torque up to the lock-up, N m."""
        return self.run.slip_peak_torque

    @property
    def slip_work(self) -> float:
        """Friction work up to the lock-up, J."""
        return self.run.slip_work

    @property
    def optimality_gap_percent(self) -> float:
        """How far above the bound the work is, percent."""
        return 100.0 * (self.slip_work / self.work_bound - 1.0)

    def summary(self) -> dict[str, Any]:
        """Everything as plain data, for JSON."""
        return {
            "peak_torque": self.peak_torque,
            "slip_work": self.slip_work,
            "work_bound": self.work_bound,
            "gap_percent": self.optimality_gap_percent,
            "slip_time": self.run.slip_time,
            "locked_peak_torque": self.run.locked_peak_torque,
            "friction_work": self.run.friction_work,
            "times": self.times,
            "torques": self.torques,
        }


class Search:
    """Optima of one clutch in one class of laws; the cuts of one peak are used for the next.

    >>> search = Search(Clutch.load("paper-c"), "any", steps=60)
    >>> best = search.least_work(60 * 9.80665)
    >>> best.peak_torque <= 60 * 9.80665 * 1.0002, best.work_bound <= best.slip_work
    (True, True)
    >>> best.optimality_gap_percent < 0.1
    True
    """

    def __init__(self, clutch: Clutch, law_class: str = "any", steps: int = STEPS) -> None:
        self.clutch, self.slip = clutch, Slip(clutch)
        self.program = Program(self.slip, law_class == "nondecreasing", steps)
        middle = np.array([0.0, 0.0, self.slip.w0 - 0.8 * self.slip.g * self.slip.tM])
        self.cuts = [self.program.solve(middle, 1.2 * self.slip.Tm)[1]]

    def work_bound(self, P: float) -> float:
        """Lower bound in J on the work of all laws of the class with a peak of P (N m), as proved so far."""
        return self._least(P)[0]

    def _least(self, P: float, touch: float = 0.0) -> tuple[float, Vector]:
        """A lower bound of the work by branch and bound, and the end (s, p, q) that has least by the cuts.

        A cell of ends lies between two s, two places along the outline, and two shares of the way out to it;
        its bound is the least work at its eight corners by the cut that is best there.
        """
        slip, outline = self.slip, self.slip.outline(P, touch)
        around, radius = np.vstack([outline, outline[:1]]), float(np.hypot(*outline.T).max())
        longest, reach = self.program.free[2], slip.per_q * radius
        first = max((longest - slip.MM * slip.tM / slip.I - reach) / slip.g, slip.period)
        times = np.linspace(first, (longest + reach) / slip.g, SPANS + 1)
        s, edge = (grid.ravel() for grid in np.meshgrid(np.arange(SPANS), np.arange(len(outline))))
        nothing = np.zeros(s.size)
        cells = np.array([[times[s], edge, nothing], [times[s + 1], edge + 1, nothing + 1.0]])
        curvature = [slip.g + slip.B**2 * radius * math.hypot(cut.y[0], cut.y[1]) for cut in self.cuts]
        best, end, dropped = math.inf, np.zeros(3), math.inf
        for _ in range(ROUNDS):
            s, along, out = (cells[CORNERS[:, axis], axis] for axis in range(3))
            p, q = (out * np.interp(along, np.arange(len(around)), x) for x in around.T)
            state = slip.state(s, p, q)
            lags = [np.tensordot(cut.y, state, 1) + (cut.k - P * cut.slope) for cut in self.cuts]
            works = np.stack([slip.work(lag, s, p, q) for lag in lags])
            most = works.max(axis=0)
            if most.min() < best:
                at = np.unravel_index(most.argmin(), most.shape)
                best, end = float(most[at]), np.array([s[at], p[at], q[at]])
            bend = slip.Mc / 8.0 * np.multiply.outer(curvature, (cells[1, 0] - cells[0, 0]) ** 2)
            proved = works.min(axis=1) - bend
            lower, cut = proved.max(axis=0), proved.argmax(axis=0)
            keep = lower < best * (1.0 - TOLERANCE)
            dropped = min(dropped, float(lower[~keep].min(initial=math.inf)))
            if not 0 < keep.sum() <= MOST_CELLS:
                break
            corners = works[cut, :, np.arange(cut.size)][keep].reshape(-1, 2, 2, 2)
            cells = _halved(cells[:, :, keep], corners)
        return min(dropped, float(lower[keep].min(initial=math.inf))), end

    def least_work(self, P: float) -> OptimalLaw:
        """The law of the least work whose peak is P (N m) at most, by no more than `OVER` of it above.

        Raises SimulationError if none is found.
        """
        best: OptimalLaw | None = None
        before, level = -math.inf, 0
        for _ in range(TURNS):
            lower, end = self._least(P, TOUCHES[level])
            if best is not None and best.slip_work <= lower * (1.0 + CLOSE):
                break
            if lower <= before * (1.0 + 1e-7):  # nothing new from this end
                level += 1
                if level == len(TOUCHES):
                    break
            before = lower
            law, cut = self.program.solve(self.slip.state(*end), P)
            self.cuts.append(cut)
            times, torques = merged(self.program.edges, law, self.slip.MM)
            found = OptimalLaw(times, torques, engage(self.clutch.with_table(times, torques)), math.nan)
            late = found.run.slip_time - self.slip.tM >= self.slip.period
            allowed = late and found.peak_torque <= P * (1.0 + OVER)
            if allowed and (best is None or found.slip_work < best.slip_work):
                best = found
        if best is None:
            raise SimulationError(
                f"No law with a peak of {P:.6g} N m was found for {self.clutch.name}: the grid of "
                f"{self.program.edges.size - 1} steps is too coarse for it; ask for more steps or a higher "
                "peak."
            )
        bound = self.work_bound(max(best.peak_torque, self.slip.Tm))
        if best.slip_work < bound * (1.0 - 1e-9):
            raise SimulationError(
                f"A law with less work than proved possible ({bound:.9g} J): a mistake in softstart."
            )
        return replace(best, work_bound=bound)


def _halved(cells: Vector, works: Vector) -> Vector:
    """Each cell as two, along the axis over which the work at its corners changes most."""
    changes = [np.abs(np.diff(works, axis=axis)).max(axis=(1, 2, 3)) for axis in (1, 2, 3)]
    axis, number = np.argmax(changes, axis=0), np.arange(cells.shape[2])
    lower, upper = cells.copy(), cells.copy()
    lower[1, axis, number] = upper[0, axis, number] = cells[:, axis, number].mean(axis=0)
    return np.concatenate([lower, upper], axis=2)


def merged(edges: Vector, torques: Vector, MM: float) -> tuple[list[float], list[float]]:
    """A table of constant torques between edges, equal neighbours as one, with MM behind the last.

    >>> merged(np.array([0.0, 1.0, 2.0, 3.0]), np.array([5.0, 5.0, 0.0]), 9.0)
    ([0.0, 2.0, 2.0, 3.0, 3.0], [5.0, 5.0, 0.0, 0.0, 9.0])
    """
    levels = np.append(torques, MM)
    changes = np.flatnonzero(np.diff(levels))
    times = np.repeat(edges[changes + 1], 2).tolist()
    heights = np.column_stack([levels[changes], levels[changes + 1]]).ravel().tolist()
    last = [] if times and times[-1] == edges[-1] else [float(edges[-1])]
    return [0.0, *times, *last], [float(levels[0]), *heights, *([MM] * len(last))]
