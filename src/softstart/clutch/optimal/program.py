"""The least lag A for a given end (a, b, D) and peak P: a linear program in the law, and what its duals
prove.

On a grid of constant torques the program is exact: no integration. Its multipliers y of (a, b, D) and lambda
of T(t_j) <= P give a bound for laws of every shape, not only those on the grid: for all laws of the class
with T <= P

    A >= y . (a, b, D) - P sum(lambda) + k,   k = const + min over the class of int_0^tM q(t) M(t) dt

where q is a sum of sines known in closed form. The minimum is MM int min(0, q) over all laws, and MM times
the least integral of q from some instant to tM over nondecreasing ones. Both are taken from straight lines
between the points of a fine grid, less what q'' allows q to leave them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linprog

from softstart.clutch.optimal.slip import Slip

__all__ = ["Answer", "Cut", "Program"]

Vector = NDArray[np.float64]

CHECKS = 4  # instants in each step at which T <= P is asked
FINER = 8  # points of the bound's grid in a step
ROUND = 1e-9  # shares of MM nearer than this to none or all of it are that
PRICE = 40.0  # of missing the end by its scale, in units of A's scale


@dataclass(frozen=True)
class Cut:
    """A >= y . (a, b, D) - P slope + k for every law of the class that keeps T <= P."""

    y: Vector
    slope: float
    k: float


@dataclass(frozen=True)
class Answer:
    """A law (torques between the edges), its lag A, by how much it misses the end asked for, and its cut."""

    torques: Vector
    A: float
    missed: float
    cut: Cut


class Program:
    """The linear program on a grid of `steps` constant torques."""

    def __init__(self, slip: Slip, monotone: bool, steps: int) -> None:
        self.slip, self.monotone = slip, monotone
        self.edges = np.linspace(0.0, slip.tM, steps + 1)
        self.at = np.linspace(0.0, slip.tM, CHECKS * steps + 1)[1:]
        self.T, self.T_free = slip.torque_by(self.at, self.edges), slip.torque_without(self.at)
        matrix, free = slip.ends_by(self.edges)
        self.ends, self.ends_free = matrix[:3], free[:3]
        self.lag, self.lag_free = matrix[3], float(free[3])
        self.scales = np.array([slip.MM, slip.MM, slip.w0])

    def solve(self, end: Vector, P: float) -> Answer:
        """The least A with T <= P that ends at `end` = (a, b, D), or as near as the price makes worth."""
        n, size = self.T.shape[1], self.slip.w0 * self.slip.tM
        MM = self.slip.MM
        # variables: M/MM, then what is missed of each end upwards and downwards, in its scale
        cost = np.concatenate([self.lag * MM / size, np.full(6, PRICE)])
        equal = np.hstack([self.ends * MM / self.scales[:, None], np.eye(3), -np.eye(3)])
        right = (end - self.ends_free) / self.scales
        below = np.hstack([self.T, np.zeros((self.at.size, 6))])
        limits = (P - self.T_free) / MM
        if self.monotone:
            rising = np.zeros((n - 1, n + 6))
            rows = np.arange(n - 1)
            rising[rows, rows], rising[rows, rows + 1] = 1.0, -1.0
            below, limits = np.vstack([below, rising]), np.concatenate([limits, np.zeros(n - 1)])
        bounds = [(0.0, 1.0)] * n + [(0.0, None)] * 6
        found = linprog(cost, below, limits, equal, right, bounds, method="highs")
        if found.status != 0:
            raise ArithmeticError(f"HiGHS: {found.message}")
        shares = np.clip(found.x[:n], 0.0, 1.0)
        shares[shares < ROUND] = 0.0
        shares[shares > 1.0 - ROUND] = 1.0
        weights = np.maximum(-found.ineqlin.marginals[: self.at.size], 0.0) * size / MM
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
        times, mass = self.at[used], weights[used]
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
