"""The least friction work of a slipping clutch for a given peak of the shaft torque, with a proof.

While the clutch slips everything is linear in the law M(t), 0 <= t <= tM. With I = IM + Ic, kappa = Ic/I, B
the elastic frequency, V the speed of both masses' centre and no gap:

    T(t)  = T0 (1 - cos B t) + kappa B int_0^t M(s) sin B(t - s) ds,     T0 = Mc IM/I
    I V'  = M - Mc,   wM = V + kappa v,   v = T'/cp

From tM on the torque is MM and the shaft oscillates about Tm = (MM Ic + Mc IM)/I. The end of the engagement
follows from three numbers, linear in the law: a = T(tM) - Tm, b = T'(tM)/B, D = w0 - V(tM). s seconds later

    p = T - Tm = a cos B s + b sin B s,   q = T'/B = b cos B s - a sin B s,   w0 - wM = D - g s - kappa B q/cp

with g = (MM - Mc)/I; slip ends where this is 0. With A = int_0^tM (w0 - V) dt, energy gives the friction work
[C] (3)

    L = I w0^2/2 + Mc (A + g s^2/2 + kappa s v1) - Ic v1^2/2 - ((Tm + p - T0)^2 - T0^2)/(2 cp),   v1 = B q/cp

so that a law matters through the angle A by which the centre lags, and through the end of the oscillation.

*The least lag A for a given end (a, b, D) and peak P* is a linear program in the law (`Program`). On a grid
of constant torques it is exact: no integration. Its multipliers y of (a, b, D) and lambda of T(t_j) <= P give
a bound for laws of every shape, not only those on the grid: for all laws of the class with T <= P

    A >= y . (a, b, D) - P sum(lambda) + k,   k = const + min over the class of int_0^tM q(t) M(t) dt

where q is a sum of sines known in closed form. The minimum is MM int min(0, q) over all laws, and MM times
the least integral of q from some instant to tM over nondecreasing ones. Both are taken from straight lines
between the points of a fine grid, less what q'' allows q to deviate from them. Such a bound is a `Cut`.

*The least work over all ends* is found by branch and bound over (s, p, q) (`least_over_ends`). The cuts bound
A from below by the largest of several functions that are linear in (a, b, D); the rest of the work is known
in closed form. A box of ends is bounded by each cut's value in its centre less what its slopes and curvatures
allow, and by the corners where the work is concave. Boxes that cannot hold the least are dropped, the others
halved. No end can be where the clutch side has been faster than w0 before, in the last elastic period: such
boxes are dropped too.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import NDArray

from softstart.arrays import Vector
from softstart.clutch.model import Clutch
from softstart.errors import InputError

CHECKS = 4  # instants in each step at which T <= P is asked
FINER = 8  # points of the bound's grid in a step
ROUND = 1e-9  # shares of MM this near to 0 or 1 are rounded
PRICE = 40.0  # of missing the end by its scale, in units of A's scale
BEFORE = 36  # instants in the last period at which slip is asked for
MOST_BOXES = 60_000  # at a time
ROUNDS = 60


@dataclass(frozen=True)
class Slip:
    """The constants of a clutch whose optimal law is sought, SI."""

    IM: float
    Ic: float
    cp: float
    w0: float
    MM: float
    Mc: float
    tM: float

    @classmethod
    def of(cls, clutch: Clutch) -> Self:
        """The constants of this clutch; raises InputError where the optimum is not linear in the law."""
        wrong = []
        if clutch.gap > 0.0:
            wrong.append(
                f"gap = {clutch.gap:g}: the optimal law is known for a shaft without a gap, as in [C]; set "
                "gap = 0 (engage simulates a law with the gap)."
            )
        if clutch.damping > 0.0:
            wrong.append(
                f"damping = {clutch.damping:g}: the optimal law is known without damping; set damping = 0."
            )
        if clutch.load_kind != "active" and clutch.load_torque > 0.0:
            wrong.append(
                'load_kind = "reactive": the optimal law is known for a load that acts always; set '
                '"active", or load_torque = 0.'
            )
        if wrong:
            raise InputError(wrong)
        made = cls(
            clutch.clutch_inertia, clutch.load_inertia, clutch.stiffness, clutch.drive_speed,
            clutch.clutch_torque, clutch.load_torque, clutch.engagement_time,
        )  # fmt: skip
        rest = (made.w0 - made.g * made.tM) / made.g
        if rest < 1.5 * made.period:
            raise InputError(
                f"engagement_time = {made.tM:g}: with full torque the masses are at speed "
                f"{max(rest, 0.0):.3g} s after it; the optimal law is known where the clutch slips for 1.5 "
                f"elastic periods more ({1.5 * made.period:.3g} s), the hard case of [C]; give a shorter "
                "engagement_time."
            )
        return made

    @cached_property
    def I(self) -> float:  # noqa: E743
        """Inertia of both, kg m^2."""
        return self.IM + self.Ic

    @cached_property
    def kappa(self) -> float:
        """Ic/I."""
        return self.Ic / self.I

    @cached_property
    def B(self) -> float:
        """Elastic frequency, rad/s."""
        return math.sqrt(self.cp * (1.0 / self.IM + 1.0 / self.Ic))

    @property
    def period(self) -> float:
        """Elastic period, s."""
        return 2.0 * math.pi / self.B

    @cached_property
    def T0(self) -> float:
        """Shaft torque without friction torque, N m."""
        return self.Mc * self.IM / self.I

    @cached_property
    def Tm(self) -> float:
        """Mean shaft torque under MM, N m. No law has a lower peak: the mean over a period is Tm."""
        return (self.MM * self.Ic + self.Mc * self.IM) / self.I

    @cached_property
    def g(self) -> float:
        """Acceleration of the centre under MM, rad/s^2."""
        return (self.MM - self.Mc) / self.I

    def torque_without(self, t: Vector) -> Vector:
        """T at t with M = 0."""
        return self.T0 * (1.0 - np.cos(self.B * t))

    def torque_by(self, t: Vector, edges: Vector) -> Vector:
        """What M = 1 between two edges adds to T at t: rows t, columns steps."""
        return self._response(t, edges, lambda x: -np.cos(x))

    def rate_by(self, t: Vector, edges: Vector) -> Vector:
        """What M = 1 between two edges adds to T'/B at t."""
        return self._response(t, edges, np.sin)

    def _response(self, t: Vector, edges: Vector, primitive: Callable[[Vector], Vector]) -> Vector:
        since = self.B * np.maximum(np.asarray(t)[:, None] - edges[None, :], 0.0)
        return self.kappa * np.asarray(primitive(since[:, :-1]) - primitive(since[:, 1:]))

    def ends_by(self, edges: Vector) -> tuple[Vector, Vector]:
        """(matrix, constants): a, b, D and A of a law that is constant between the edges, as four rows."""
        end = np.array([self.tM])
        steps, middles = np.diff(edges), 0.5 * (edges[1:] + edges[:-1])
        matrix = np.vstack(
            [
                self.torque_by(end, edges)[0],
                self.rate_by(end, edges)[0],
                -steps / self.I,
                -(self.tM - middles) * steps / self.I,
            ]
        )
        return matrix, self.ends_without

    @cached_property
    def ends_without(self) -> Vector:
        """a, b, D and A with M = 0."""
        angle, tM = self.B * self.tM, self.tM
        return np.array(
            [
                self.T0 * (1.0 - math.cos(angle)) - self.Tm,
                self.T0 * math.sin(angle),
                self.w0 + self.Mc * tM / self.I,
                self.w0 * tM + 0.5 * self.Mc * tM**2 / self.I,
            ]
        )

    def start_of_end(self, s: Vector, p: Vector, q: Vector) -> tuple[Vector, Vector, Vector]:
        """(a, b, D) at tM of an engagement whose slip ends s later at (p, q)."""
        cos, sin = np.cos(self.B * s), np.sin(self.B * s)
        return p * cos - q * sin, p * sin + q * cos, self.g * s + self.kappa * self.B * q / self.cp

    def work(self, A: Vector, s: Vector, p: Vector, q: Vector) -> Vector:
        """Friction work L in J."""
        v1 = self.B * q / self.cp
        lag = A + 0.5 * self.g * s**2 + self.kappa * s * v1
        swing = (self.Tm + p - self.T0) ** 2 - self.T0**2
        return np.asarray(
            0.5 * self.I * self.w0**2 + self.Mc * lag - 0.5 * self.Ic * v1**2 - swing / (2.0 * self.cp)
        )


@dataclass(frozen=True)
class Cut:
    """A >= y . (a, b, D) - P slope + k for every law of the class that keeps T <= P."""

    y: Vector
    slope: float
    k: float


@dataclass(frozen=True)
class Answer:
    """A law (torques between the edges), its lag A, by how much it misses the given end, and its cut."""

    torques: Vector
    A: float
    missed: float
    cut: Cut


class Program:
    """The linear program on a grid of `steps` constant torques."""

    def __init__(self, slip: Slip, monotone: bool, steps: int) -> None:
        self.slip, self.monotone = slip, monotone
        self.edges = np.linspace(0.0, slip.tM, steps + 1)
        self.instants = np.linspace(0.0, slip.tM, CHECKS * steps + 1)[1:]
        self.T, self.T_free = slip.torque_by(self.instants, self.edges), slip.torque_without(self.instants)
        matrix, free = slip.ends_by(self.edges)
        self.ends, self.ends_free = matrix[:3], free[:3]
        self.lag, self.lag_free = matrix[3], float(free[3])
        self.scales = np.array([slip.MM, slip.MM, slip.w0])

    def solve(self, end: Vector, P: float) -> Answer:
        """The least A with T <= P that ends at `end` = (a, b, D), or as near to it as PRICE allows."""
        from scipy import optimize

        n, size = self.T.shape[1], self.slip.w0 * self.slip.tM
        MM = self.slip.MM
        # variables: M/MM, then what is missed of each end upwards and downwards, in its scale
        cost = np.concatenate([self.lag * MM / size, np.full(6, PRICE)])
        equal = np.hstack([self.ends * MM / self.scales[:, None], np.eye(3), -np.eye(3)])
        right = (end - self.ends_free) / self.scales
        below = np.hstack([self.T, np.zeros((self.instants.size, 6))])
        limits = (P - self.T_free) / MM
        if self.monotone:
            rising = np.zeros((n - 1, n + 6))
            rows = np.arange(n - 1)
            rising[rows, rows], rising[rows, rows + 1] = 1.0, -1.0
            below, limits = np.vstack([below, rising]), np.concatenate([limits, np.zeros(n - 1)])
        bounds = [(0.0, 1.0)] * n + [(0.0, None)] * 6
        found = optimize.linprog(cost, below, limits, equal, right, bounds, method="highs")
        if found.status != 0:
            raise ArithmeticError(f"HiGHS: {found.message}")
        shares = np.clip(found.x[:n], 0.0, 1.0)
        shares[shares < ROUND] = 0.0
        shares[shares > 1.0 - ROUND] = 1.0
        weights = np.maximum(-found.ineqlin.marginals[: self.instants.size], 0.0) * size / MM
        y = found.eqlin.marginals * size / self.scales
        return Answer(
            shares * MM,
            float(self.lag @ shares) * MM + self.lag_free,
            float(found.x[n:].sum()),
            self._cut(y, weights),
        )

    def _cut(self, y: Vector, weights: Vector) -> Cut:
        """What these multipliers prove."""
        slip, B = self.slip, self.slip.B
        fine = np.linspace(0.0, slip.tM, CHECKS * FINER // 2 * (self.edges.size - 1) + 1)
        used = weights > 0.0
        times, mass = self.instants[used], weights[used]
        back = B * (slip.tM - fine)
        q = -(slip.tM - fine) / slip.I + y[2] / slip.I
        q -= slip.kappa * B * (y[0] * np.sin(back) + y[1] * np.cos(back))
        since = B * np.maximum(times[None, :] - fine[:, None], 0.0)
        q += slip.kappa * B * np.sin(since) @ mass
        step = fine[1] - fine[0]
        bend = slip.kappa * B**3 * (abs(y[0]) + abs(y[1]) + float(mass.sum()))
        left_out = bend * step**2 / 8.0
        least = _least_nondecreasing(q, step) if self.monotone else _least(q, step)
        constant = self.lag_free - float(y @ self.ends_free) + float(mass @ slip.torque_without(times))
        return Cut(y, float(mass.sum()), constant + slip.MM * (least - left_out * slip.tM))


def _least(q: Vector, step: float) -> float:
    """Integral of min(0, q), q straight between its points.

    >>> _least(np.array([-1.0, 1.0]), 1.0)
    -0.25
    """
    left, right = q[:-1], q[1:]
    low, high = np.minimum(left, right), np.maximum(left, right)
    span = np.where(high > low, high - low, 1.0)
    crossing = np.where((low < 0.0) & (high > 0.0), 0.5 * low * (-low / span), 0.0)
    below = np.where(high <= 0.0, 0.5 * (low + high), 0.0)
    return float((crossing + below).sum() * step)


def _least_nondecreasing(q: Vector, step: float) -> float:
    """The least of 0 and the integrals of q from some instant to the end, q straight between its points.

    >>> _least_nondecreasing(np.array([1.0, -1.0]), 1.0), _least_nondecreasing(np.array([1.0, 1.0]), 1.0)
    (-0.25, 0.0)
    """
    left, right = q[:-1], q[1:]
    tail = np.concatenate([np.cumsum((0.5 * (left + right))[::-1])[::-1], [0.0]])
    crosses = (left > 0.0) & (right < 0.0)  # the least begins where q turns negative, within a step
    span = np.where(crosses, left - right, 1.0)
    within = np.where(crosses, -0.5 * right**2 / span + tail[1:], 0.0)
    return float(min(0.0, tail.min(), within.min())) * step


@dataclass(frozen=True)
class Least:
    """By the cuts no end has less work than `bound` (J); at the end (s, p, q) they allow `value`."""

    bound: float
    value: float
    s: float
    p: float
    q: float


class _Ends:
    """Work over ends, with the cuts."""

    def __init__(self, slip: Slip, cuts: Sequence[Cut], P: float, touch: float) -> None:
        self.slip, self.touch = slip, touch
        self.y = np.array([cut.y for cut in cuts])
        self.k = np.array([cut.k - P * cut.slope for cut in cuts])
        self.size = np.hypot(self.y[:, 0], self.y[:, 1])
        self.radius = max(P - slip.Tm, 0.0)
        before = slip.period * np.arange(1, BEFORE + 1) / BEFORE
        self.fall, self.turn = slip.g * before, slip.B * before

    def lag(self, s: Vector, p: Vector, q: Vector) -> tuple[Vector, Vector, Vector, Vector]:
        """Each cut's bound on A + g s^2/2 + kappa s v1 and its slopes over s, p, q: (boxes, cuts)."""
        slip, y = self.slip, self.y
        a, b, D = slip.start_of_end(s, p, q)
        cos, sin = np.cos(slip.B * s)[:, None], np.sin(slip.B * s)[:, None]
        per_q = slip.kappa * slip.B / slip.cp
        value = a[:, None] * y[:, 0] + b[:, None] * y[:, 1] + D[:, None] * y[:, 2] + self.k
        value += (0.5 * slip.g * s**2 + per_q * s * q)[:, None]
        by_s = slip.B * (-b[:, None] * y[:, 0] + a[:, None] * y[:, 1]) + slip.g * y[:, 2]
        by_s += (slip.g * s + per_q * q)[:, None]
        by_p = cos * y[:, 0] + sin * y[:, 1]
        by_q = -sin * y[:, 0] + cos * y[:, 1] + per_q * y[:, 2] + per_q * s[:, None]
        return value, by_s, by_p, by_q

    def slips_before(self, p: Vector, q: Vector, margin: Vector) -> NDArray[np.bool_]:
        """Whether the clutch side may have been slower than w0 all through the last period."""
        slip = self.slip
        per_q = slip.kappa * slip.B / slip.cp
        earlier = p[:, None] * np.sin(self.turn) + q[:, None] * np.cos(self.turn)
        slower = self.fall + per_q * (q[:, None] - earlier) + margin[:, None] * 3.0 * per_q
        ok: NDArray[np.bool_] = slower.min(axis=1) >= 0.0
        return ok & (p - margin <= slip.MM - slip.Tm)


def least_over_ends(slip: Slip, cuts: Sequence[Cut], P: float, tolerance: float, touch: float = 0.0) -> Least:
    """The least work in J that the cuts allow at peak P, to `tolerance` (J).

    An end where the clutch side only just touches w0 may be missed by a law that leads almost there: no end
    nearer to it than `touch` (N m) is proposed. The bound holds for all ends.
    """
    ends = _Ends(slip, cuts, P, touch)
    R = ends.radius
    per_q = slip.kappa * slip.B / slip.cp
    free = slip.ends_without[2]
    low = max((free - slip.MM * slip.tM / slip.I - per_q * R) / slip.g, slip.period)
    high = (free + per_q * R) / slip.g
    pieces = max(int(slip.B * (high - low) / 0.8), 4)
    grid = np.linspace(low, high, pieces + 1)
    middle = np.zeros((pieces, 3))
    middle[:, 0] = 0.5 * (grid[:-1] + grid[1:])
    half = np.array([[0.5 * (high - low) / pieces, R, R]] * pieces)
    best, end = np.inf, middle[0]
    dropped = np.inf
    for _ in range(ROUNDS):
        bounds, values, share = _bounds(ends, middle, half)
        if np.isfinite(values).any() and values.min() < best:
            best, end = float(values.min()), middle[int(values.argmin())]
        keep = bounds < best - tolerance
        dropped = min(dropped, float(bounds[~keep].min(initial=np.inf)))
        middle, half, share, bounds = middle[keep], half[keep], share[keep], bounds[keep]
        if middle.size == 0:
            break
        if len(middle) > MOST_BOXES:
            dropped = min(dropped, float(bounds.min()))
            break
        axis = share.argmax(axis=1)
        rows = np.arange(len(middle))
        half[rows, axis] *= 0.5
        shift = np.zeros_like(middle)
        shift[rows, axis] = half[rows, axis]
        middle, half = np.vstack([middle - shift, middle + shift]), np.vstack([half, half])
    else:
        dropped = min(dropped, float(bounds.min(initial=np.inf)))
    return Least(min(dropped, best), best, float(end[0]), float(end[1]), float(end[2]))


def _bounds(ends: _Ends, middle: Vector, half: Vector) -> tuple[Vector, Vector, Vector]:
    """For each box: a lower bound of the work, the work in the middle, and what each side costs the bound."""
    slip = ends.slip
    s, p, q = middle.T
    hs, hp, hq = half.T
    value, by_s, by_p, by_q = ends.lag(s, p, q)
    radius = np.hypot(np.abs(p) + hp, np.abs(q) + hq)
    per_q = slip.kappa * slip.B / slip.cp
    bend = 0.5 * slip.B**2 * ends.size * (radius * hs**2)[:, None]
    bend += slip.B * ends.size * (hs * (hp + hq))[:, None] + (per_q * hs * hq)[:, None]
    costs = np.stack([np.abs(by_s) * hs[:, None], np.abs(by_p) * hp[:, None], np.abs(by_q) * hq[:, None]])
    lower = value - costs.sum(axis=0) - bend
    best = lower.argmax(axis=1)
    rows = np.arange(s.size)
    inner = np.zeros(s.size)
    offset = slip.Tm - slip.T0  # the work falls with |offset + p| and with |q|
    most_p = p + np.where(offset + p >= 0.0, hp, -hp)
    most_q = np.abs(q) + hq
    bound = slip.work(lower[rows, best], inner, most_p, inner)
    v1 = slip.B * most_q / slip.cp
    bound = bound - 0.5 * slip.Ic * v1**2
    tops = value.max(axis=1)
    v_middle = slip.B * q / slip.cp
    centre = slip.work(tops, inner, p, inner) - 0.5 * slip.Ic * v_middle**2
    R = ends.radius
    nearest = np.hypot(np.maximum(np.abs(p) - hp, 0.0), np.maximum(np.abs(q) - hq, 0.0))
    possible = (nearest <= R * (1.0 + 1e-12)) & ends.slips_before(p, q, np.hypot(hp, hq))
    bound = np.where(possible, bound, np.inf)
    allowed = (np.hypot(p, q) <= R * (1.0 + 1e-12)) & ends.slips_before(p, q, np.full(s.size, -ends.touch))
    centre = np.where(allowed, centre, np.inf)
    share = slip.Mc * costs[:, rows, best].T + slip.Mc * np.stack(
        [bend[rows, best], 0.5 * bend[rows, best], 0.5 * bend[rows, best]], axis=1
    )
    share[:, 1] += np.abs(offset + most_p) * hp / slip.cp
    share[:, 2] += slip.Ic * v1 * slip.B / slip.cp * hq
    return bound, centre, share
