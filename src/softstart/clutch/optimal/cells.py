"""The least work over all ends, given what is proved of the lag A: branch and bound over (s, p, q).

The cuts bound A from below by the largest of several functions that are linear in (a, b, D); what remains of
the work is known in closed form. A box of ends is bounded by each cut's value in its middle less what its
slopes and bends allow, and by the corners where the work is concave. Boxes that cannot hold the least are
dropped, the others halved.

No end can be where the clutch side has been faster than w0 before, in the last elastic period: such boxes are
dropped.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from softstart.clutch.optimal.program import Cut
from softstart.clutch.optimal.slip import Slip

__all__ = ["Least", "least_over_ends"]

Vector = NDArray[np.float64]

BEFORE = 36  # instants in the last period at which slip is asked for
MOST = 60_000  # boxes at a time
ROUNDS = 60


@dataclass(frozen=True)
class Least:
    """No end has less work than `bound` (J), as far as the cuts know; at the end (s, p, q) they allow "
    "`value`.
    """

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
        """Each cut's bound on A + g s^2/2 + kappa s v1, and its slopes over s, p, q: rows boxes, columns
        cuts.
        """
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

    An end where the clutch side only just touches w0 may be missed by a law that leads almost there: none is
    proposed that is nearer to it than `touch` (N m). The bound is that of all ends.
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
    best, at = np.inf, middle[0]
    dropped = np.inf
    for _ in range(ROUNDS):
        bounds, values, share = _bounds(ends, middle, half)
        if np.isfinite(values).any() and values.min() < best:
            best, at = float(values.min()), middle[int(values.argmin())]
        keep = bounds < best - tolerance
        dropped = min(dropped, float(bounds[~keep].min(initial=np.inf)))
        middle, half, share, bounds = middle[keep], half[keep], share[keep], bounds[keep]
        if middle.size == 0:
            break
        if len(middle) > MOST:
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
    return Least(min(dropped, best), best, float(at[0]), float(at[1]), float(at[2]))


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
