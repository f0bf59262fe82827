"""Any instant of a recorded start, evaluated from its spans and not interpolated."""

from __future__ import annotations

from softstart.arrays import Matrix, Vector
import numpy as np
from numpy.typing import NDArray

from softstart.plant.advance import move
from softstart.plant.jit import compiled
from softstart.plant.layout import MOTION, PLANT, SEGMENT, STATE
from softstart.plant.modes import shaft_torque
from softstart.plant.span import begin_span

# columns of the evaluated states
PHI1_OUT, PHI2_OUT, W1_OUT, W2_OUT, U_OUT, T_OUT, THETA_OUT, V_OUT = range(8)
N_OUT = 8


@compiled
def states_at(
    drive: Vector, segments: Matrix, index: NDArray[np.int64], times: Vector, state: Vector, motion: Vector,
    out: Matrix,
) -> None:  # fmt: skip
    """Row i of out is the state at times[i], in the span segments[index[i]]; state and motion are scratch."""
    p = drive.view(PLANT)[0]
    x = state.view(STATE)[0]
    m = motion.view(MOTION)[0]
    for i in range(times.shape[0]):
        row = segments[index[i]].view(SEGMENT)[0]
        s = times[i] - row.start
        s = min(max(s, 0.0), row.end - row.start)
        x.side = row.side
        x.load = row.load
        x.held = row.held
        x.theta = row.theta
        x.v = row.v
        x.phi2 = row.phi2
        x.w2 = row.w2
        x.doubled = 1.0 if row.k > p.c or (p.d > 0.0 and row.side != 0.0 and row.dd == 0.0) else 0.0
        x.demand = 0.0
        x.demand_slope = 0.0
        m.ua = row.ua
        m.ub = row.ub
        m.ue = row.ue
        m.slew_end = np.inf
        load = begin_span(p, x, m)
        move(p, x, m, load, s)
        out[i, PHI1_OUT] = x.phi2 + x.theta
        out[i, PHI2_OUT] = x.phi2
        out[i, W1_OUT] = x.w2 + x.v
        out[i, W2_OUT] = x.w2
        out[i, U_OUT] = x.u
        out[i, T_OUT] = shaft_torque(p, x)
        out[i, THETA_OUT] = x.theta
        out[i, V_OUT] = x.v
