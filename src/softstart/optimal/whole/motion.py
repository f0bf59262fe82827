"""The variables of a whole start, and its motion as rows over them.

The state y = (z, z', w2, u) stands at the nodes of the grid, the demand r at the beginning and end of each
step. What holds anywhere within a step is a row of weights on both, exact by a matrix exponential.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.linalg import expm

from softstart.optimal.problem import Problem
from softstart.optimal.whole.answer import Grid, Instants, Kind, Matrix, Vector, demand_shape, phase_ends

Z, V, W2, U, R, SLOPE, ONE = range(7)
STATES = 4
TAIL_STEPS = 12
SETTLED = 8.0  # lags, after which the torque follows its demand to 0.03 %
Rows = tuple[Any, Vector]  # sparse matrix over the variables, constants


class Motion:
    """A whole start with given instants on a grid. Variables: y at each node, r in each step, P.

    All without dimension: torques in U, the largest motor torque, z in U/c, z' in Omega U/c, w2 in the target
    speed. With a rate limit and `reached`, a few steps follow after t_f, in which only T <= P is asked for.
    """

    def __init__(self, problem: Problem, at: Instants, grid: Grid, full_tail: bool = False) -> None:
        drive: Any = problem.drive
        self.problem, self.at, self.grid, self.full_tail = problem, at, grid, full_tail
        self.J1, self.J2, self.c, self.d, self.Mc = (
            float(value) for value in (drive.J1, drive.J2, drive.c, drive.d, drive.Mc)
        )
        self.lag, self.rate = float(drive.torque_lag), float(drive.torque_rate)
        self.Omega = float(drive.Omega)
        self.U = problem.highest_torque
        self.scale = np.array([self.U / self.c, self.Omega * self.U / self.c, problem.target, self.U])
        self.pulls = drive.contact_law == "dead-zone" and self.d > 0.0
        self.shape = demand_shape(problem)
        begins = phase_ends(grid, at)
        kinds: list[Kind] = []
        edges = [np.zeros(1)]
        for (kind, shares), begin, end in zip(grid, begins, begins[1:], strict=False):
            kinds += [kind] * (shares.size - 1)
            edges.append(begin + shares[1:] * (end - begin))
        self.steps = len(kinds)  # up to t_f
        self.releases = self.shape == "continuous" and problem.terminal == "reached"
        if self.releases:
            kinds += ["contact"] * TAIL_STEPS
            edges.append(at.end + self.tail_length() * np.arange(1, TAIL_STEPS + 1) / TAIL_STEPS)
        self.kinds = tuple(kinds)
        self.edges = np.concatenate(edges)
        self.length = np.diff(self.edges)
        self.n = len(kinds)
        self.first_r = STATES * (self.n + 1)
        self.first, self.second, demands = self._demand_columns()
        self.P = self.first_r + demands
        self.columns = self.P + 1

    def _demand_columns(self) -> tuple[NDArray[np.int64], NDArray[np.int64], int]:
        """Which variable is the demand at the beginning and end of each step, and how many there are."""
        k = self.first_r + np.arange(self.n)
        if self.shape == "steps":
            return k, k, self.n
        if self.shape == "ramps":
            return k + np.arange(self.n), k + np.arange(self.n) + 1, 2 * self.n
        return k, k + 1, self.n + 1

    def tail_length(self) -> float:
        """How long after t_f T is watched, s: to its peak where the motor coasts, else a whole period."""
        period = 2.0 * math.pi / self.Omega
        if self.problem.terminal != "reached":
            return period
        falling = (self.U - self.problem.lowest_torque) / self.rate if self.rate < math.inf else 0.0
        return min(0.5 * period + 5.0 * self.lag + falling, 1.5 * period + falling)

    # the motion ------------------------------------------------------------------------------------------

    def matrix(self, kind: Kind) -> Matrix:
        """Rates of (z, z', w2, u, r, r', 1) in a phase."""
        A = np.zeros((7, 7))
        A[Z, V] = 1.0
        A[R, SLOPE] = 1.0
        A[V, U if self.lag > 0.0 else R] = 1.0 / self.J1
        if self.lag > 0.0:
            A[U, U], A[U, R] = -1.0 / self.lag, 1.0 / self.lag
        if kind == "gap":
            A[V, ONE], A[W2, ONE] = self.Mc / self.J2, -self.Mc / self.J2
        elif kind == "stuck":
            A[V, [Z, V]] = -self.c / self.J1, -self.d / self.J1
        elif kind == "contact":
            inverse = 1.0 / self.J1 + 1.0 / self.J2
            A[V, [Z, V, ONE]] = -self.c * inverse, -self.d * inverse, self.Mc / self.J2
            A[W2, [Z, V, ONE]] = self.c / self.J2, self.d / self.J2, -self.Mc / self.J2
        return A

    def moved(self, step: NDArray[np.int64], s: Vector) -> Matrix:
        """How (z, z', w2, u, r, r', 1) moves within s of the given steps, shape (..., 7, 7)."""
        out = np.empty((step.size, 7, 7))
        kinds = np.array(self.kinds)[step]
        for kind in set(kinds.tolist()):
            here = kinds == kind
            # steps of one length are computed once
            shares, back = np.unique((s[here] / self.edges[-1]).round(14), return_inverse=True)
            out[here] = expm(self.matrix(kind)[None] * (shares * self.edges[-1])[:, None, None])[back]
        return out

    def rows(self, step: NDArray[np.int64], weights: Matrix) -> Rows:
        """Rows over the variables, and constants, of `weights` (m, 7) on (z, z', w2, u, r, r', 1) at the
        beginning of the given steps.
        """
        m = step.size
        each = self.length[step]
        on_slope = weights[:, SLOPE] / each
        values = [weights[:, i] * self.scale[i] for i in range(STATES)]
        columns = [STATES * step + i for i in range(STATES)]
        values += [(weights[:, R] - on_slope) * self.U, on_slope * self.U]
        columns += [self.first[step], self.second[step]]
        where = np.tile(np.arange(m), len(values)), np.concatenate(columns)
        matrix = sparse.csr_array((np.concatenate(values), where), shape=(m, self.columns))
        return matrix, weights[:, ONE]

    def single(self, node: int, weights: dict[int, float]) -> Any:
        """One row on the state at a node."""
        columns = np.array([STATES * node + i for i in weights])
        values = np.array([value * self.scale[i] for i, value in weights.items()])
        return sparse.csr_array(
            (values, (np.zeros(columns.size, dtype=np.int64), columns)), (1, self.columns)
        )

    @property
    def T(self) -> Vector:
        """Weights of T = c z + d z'."""
        return np.array([self.c, self.d, 0.0, 0.0, 0.0, 0.0, 0.0])

    def instants(self, fractions: tuple[float, ...]) -> tuple[NDArray[np.int64], Vector]:
        """Where limits are looked at: (step, time since its beginning), at these fractions of each step.

        A step longer than a sixth of an elastic period is looked at as often as short ones would be. In one
        that is longer than a period T swings about a mean, ever less, once the torque has come to rest: that
        long it is looked at, and at its end.
        """
        period = 2.0 * math.pi / self.Omega
        watched = period + SETTLED * self.lag

        def within(length: float) -> Vector:
            count = math.ceil(6 * len(fractions) * min(length, watched) / period)
            if count <= len(fractions):
                return np.array(fractions) * length
            looks = min(length, watched) * np.arange(fractions[0] != 0.0, count + 1) / count
            return np.append(looks, length) if length > watched else looks

        parts = [within(length) for length in self.length.tolist()]
        step = np.repeat(np.arange(self.n), [part.size for part in parts])
        return step, np.concatenate(parts)
