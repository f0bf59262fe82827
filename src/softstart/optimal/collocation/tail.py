"""The shaft torque after t_f, while the motor coasts or holds, as a linear function of the state at t_f.

No variables are spent on it: in contact the drive is linear, so T at fixed instants after t_f is a fixed
combination of the state, of the demand from then on, and of 1.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from softstart.optimal.collocation.phases import Program
from softstart.optimal.collocation.scaling import Numbers

Matrix = NDArray[np.float64]

TAIL_POINTS = 128


def tail_rows(program: Program, p: Numbers) -> Matrix:
    """Rows (z, v, w2[, u], demand, 1) that give T at `TAIL_POINTS` instants after t_f.

    Coasting, the first peak comes within half an elastic period; a lag delays it. Holding is watched for a
    whole one.
    """
    if not program.tail:
        return np.zeros((0, (4 if program.lagged else 3) + 2))
    period = 2.0 * math.pi / p.Omega
    length = period if program.tail == "hold" else 0.5 * period + 5.0 * p.lag
    length = min(length, 1.5 * period)
    # y = (z, v, u, demand, 1), y' = A y
    inverse = 1.0 / p.J1 + 1.0 / p.J2
    drive_by_demand = not program.lagged
    A = np.zeros((5, 5))
    A[0, 1] = 1.0
    A[1] = [-p.c * inverse, -p.d * inverse, 1.0 / p.J1, 0.0, p.Mc / p.J2]
    if drive_by_demand:
        A[1, 2], A[1, 3] = 0.0, 1.0 / p.J1
    else:
        A[2, 2], A[2, 3] = -1.0 / p.lag, 1.0 / p.lag
    step = _exponential(A * (length / TAIL_POINTS))
    torque = np.array([p.c, p.d, 0.0, 0.0, 0.0])
    rows = np.empty((TAIL_POINTS, 5))
    for i in range(TAIL_POINTS):
        torque = torque @ step
        rows[i] = torque
    z, v, u, demand, one = rows.T
    w2 = np.zeros(TAIL_POINTS)
    return np.column_stack([z, v, w2, u, demand, one] if program.lagged else [z, v, w2, demand, one])


def _exponential(A: Matrix) -> Matrix:
    """exp(A) by scaling and squaring a Taylor series."""
    halvings = max(0, math.ceil(math.log2(max(1e-300, float(np.abs(A).sum(axis=1).max())) / 0.25)))
    small = A / 2.0**halvings
    term = total = np.eye(A.shape[0])
    for k in range(1, 14):
        term = term @ small / k
        total = total + term
    for _ in range(halvings):
        total = total @ total
    return total
