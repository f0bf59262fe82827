"""Any instant of a recorded start, and the turning points of its shaft torque, from its spans: no samples."""

from __future__ import annotations

from softstart.arrays import Matrix, Vector
import numpy as np
from numpy.typing import NDArray

from softstart.plant.advance import move
from softstart.plant.jit import compiled, inlined
from softstart.plant.layout import MOTION, PLANT, SEGMENT, STATE, Motion, Plant, Segment, Septuple, State
from softstart.plant.exchange import shaft_torque
from softstart.plant.motion import motion as motion_at
from softstart.plant.notes import next_extreme
from softstart.plant.span import begin_span, lag_is_slow

# columns of the evaluated states
PHI1_OUT, PHI2_OUT, W1_OUT, W2_OUT, U_OUT, T_OUT, THETA_OUT, V_OUT = range(8)
N_OUT = 8


# of `turning_points`: no room for all, and an extreme that could not be located
NO_ROOM, NOT_LOCATED = -1, -2


@inlined
def begin_again(p: Plant, x: State, m: Motion, row: Segment) -> Septuple:
    """The state at the start of a recorded span, and the coefficients of its motion."""
    x.side = row.side
    x.load = row.load
    x.held = row.held
    x.motor = row.motor
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
    x.u = row.u
    x.ref = row.ref
    m.slew_end = np.inf
    m.slow_lag = 1.0 if lag_is_slow(p, m) else 0.0
    return begin_span(p, x, m, row.end - row.start)


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
        load = begin_again(p, x, m, row)
        move(p, x, m, load, s)
        out[i, PHI1_OUT] = x.phi2 + x.theta
        out[i, PHI2_OUT] = x.phi2
        out[i, W1_OUT] = x.w2 + x.v
        out[i, W2_OUT] = x.w2
        out[i, U_OUT] = x.u
        out[i, T_OUT] = shaft_torque(p, x)
        out[i, THETA_OUT] = x.theta
        out[i, V_OUT] = x.v


@compiled
def turn(kept: Vector, points: Matrix, time: float, torque: float, still: float) -> None:
    """The next value of T; kept = (number of points, direction, time and torque of what may be the next)."""
    n = int(kept[0])
    if n >= points.shape[0]:
        return
    away = torque - kept[3]
    if kept[1] == 0.0:
        if n == 0:
            kept[2], kept[3] = time, torque
            points[0, 0], points[0, 1] = time, torque
            kept[0] = 1.0
        elif abs(away) > still:
            kept[1] = 1.0 if away > 0.0 else -1.0
            kept[2], kept[3] = time, torque
    elif away * kept[1] > 0.0:
        kept[2], kept[3] = time, torque
    elif abs(away) > still:
        points[n, 0], points[n, 1] = kept[2], kept[3]
        kept[0] = n + 1.0
        kept[1] = -kept[1]
        kept[2], kept[3] = time, torque


@compiled
def turning_points(
    drive: Vector, segments: Matrix, still: float, state: Vector, motion: Vector, kept: Vector, points: Matrix
) -> int:
    """Times and values of T at its first instant, at all its reversals, and at its last; returns how many.

    Extremes within a span are roots of T', located as peaks are; T may jump between spans. Reversals by no
    more than `still` are passed over: they are rounding. State, motion and `kept` (four zeros) are scratch.
    """
    p = drive.view(PLANT)[0]
    x = state.view(STATE)[0]
    m = motion.view(MOTION)[0]
    for i in range(segments.shape[0]):
        row = segments[i].view(SEGMENT)[0]
        side = row.side
        if row.end == row.start:  # without a gap the flanks change in no time
            continue
        if side == 0.0:
            turn(kept, points, row.start, 0.0, still)
            continue
        load = begin_again(p, x, m, row)
        length = row.end - row.start
        turn(kept, points, row.start, side * (m.k * m.z0 + m.dd * m.v0), still)
        begin, z, v = 0.0, m.z0, m.v0
        while True:
            at = next_extreme(m, load, begin, z, v, length)
            if at < -1.0:
                return NOT_LOCATED
            if at < 0.0 or at <= begin:
                break
            z, v = motion_at(m, at)
            turn(kept, points, row.start + at, side * (m.k * z + m.dd * v), still)
            begin = at
        if i + 1 == segments.shape[0] or segments[i + 1].view(SEGMENT)[0].side != side:
            z, v = motion_at(m, length)  # elsewhere T goes on as the next span begins
            turn(kept, points, row.end, side * (m.k * z + m.dd * v), still)
    n = int(kept[0])
    if n >= points.shape[0]:
        return NO_ROOM
    if kept[1] != 0.0:
        points[n, 0], points[n, 1] = kept[2], kept[3]
        n += 1
    return n
