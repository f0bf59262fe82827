"""Any instant of a recorded start, evaluated from its spans and not interpolated."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from softstart.plant.advance import move
from softstart.plant.jit import compiled
from softstart.plant.layout import (
    C, D, DEMAND, DEMAND_SLOPE, DOUBLED, LOAD, PHI2, SIDE, SLEW_END, S_DD, S_END, S_K, S_LOAD, S_PHI2, S_SIDE,
    S_START, S_THETA, S_UA, S_UB, S_UE, S_V, S_W2, THETA, U, UA, UB, UE, V, W2, Matrix, Vector,
)  # fmt: skip
from softstart.plant.modes import shaft_torque
from softstart.plant.span import begin_span

# columns of the evaluated states
PHI1_OUT, PHI2_OUT, W1_OUT, W2_OUT, U_OUT, T_OUT, THETA_OUT, V_OUT = range(8)
N_OUT = 8


@compiled
def states_at(
    p: Vector, segments: Matrix, index: NDArray[np.int64], times: Vector, x: Vector, m: Vector, out: Matrix
) -> None:
    """Row i of out is the state at times[i], which lies in the span segments[index[i]]; x, m are scratch."""
    for i in range(times.shape[0]):
        row = segments[index[i]]
        s = times[i] - row[S_START]
        s = min(max(s, 0.0), row[S_END] - row[S_START])
        x[SIDE] = row[S_SIDE]
        x[LOAD] = row[S_LOAD]
        x[THETA] = row[S_THETA]
        x[V] = row[S_V]
        x[PHI2] = row[S_PHI2]
        x[W2] = row[S_W2]
        x[DOUBLED] = (
            1.0 if row[S_K] > p[C] or (p[D] > 0.0 and row[S_SIDE] != 0.0 and row[S_DD] == 0.0) else 0.0
        )
        x[DEMAND] = 0.0
        x[DEMAND_SLOPE] = 0.0
        m[UA] = row[S_UA]
        m[UB] = row[S_UB]
        m[UE] = row[S_UE]
        m[SLEW_END] = np.inf
        load = begin_span(p, x, m)
        move(p, x, m, load, s)
        out[i, PHI1_OUT] = x[PHI2] + x[THETA]
        out[i, PHI2_OUT] = x[PHI2]
        out[i, W1_OUT] = x[W2] + x[V]
        out[i, W2_OUT] = x[W2]
        out[i, U_OUT] = x[U]
        out[i, T_OUT] = shaft_torque(p, x)
        out[i, THETA_OUT] = x[THETA]
        out[i, V_OUT] = x[V]
