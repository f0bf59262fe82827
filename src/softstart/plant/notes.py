"""What is noted of a start: peaks, events, stages, spans.

Peaks are located where T' = 0, never read off a grid.
"""

from __future__ import annotations

import math

from softstart.plant.crossing import RISING, first_crossing
from softstart.plant.jit import inlined
from softstart.plant.layout import (
    ASK, D, DD, END_KNOWN, END_V, END_Z, EVENTS, E_KIND, E_TIME, E_VALUE, FIRST_PEAK, G_END, G_NUMBER,
    G_PEAK, G_PEAK_TIME, G_SIDE, K, LAST_V, LOAD, MEMO_S, NOT_LOCATED, N_EVENTS, N_SEGMENTS, N_STAGES,
    G_START, P0, PEAK, PEAK_TIME, PHI2, SIDE, STAGE, STAGE_2_END, STAGE_PEAK, STAGE_PEAK_TIME, STAGE_START,
    STEADY, S_DD, S_END, S_K, S_LOAD, S_PHI2, S_SIDE, S_STAGE, S_START, S_THETA, S_UA, S_UB, S_UE, S_V,
    S_W2, THETA, TIME, UA, UB, UE, V, V0, W0, W0SQ, W2, Y0, Z0, Septuple, Vector,
)  # fmt: skip
from softstart.plant.motion import derivatives, forcing_tail, motion


@inlined
def keep_peak(x: Vector, torque: float, time: float) -> None:
    """Note a candidate for the largest |T| of the stage."""
    if abs(torque) > abs(x[STAGE_PEAK]):
        x[STAGE_PEAK] = torque
        x[STAGE_PEAK_TIME] = time


@inlined
def note_peak(p: Vector, x: Vector, m: Vector, load: Septuple, s: float) -> int:
    """Locate the extremes of T within the span that ends at s; nothing is read off a grid."""
    side = x[SIDE]
    t = x[TIME]
    k = m[K]
    dd = m[DD]
    keep_peak(x, side * (k * m[Z0] + dd * m[V0]), t)
    if m[STEADY] != 0.0:
        w0 = m[W0]
        to_flank = not math.isnan(m[LAST_V])
        if m[V0] > 0.0 or w0 * s > math.pi:
            if m[Z0] == 0.0 and m[V0] > 0.0 and p[D] == 0.0:
                at = 0.5 * m[MEMO_S]  # from flank to flank, which takes MEMO_S, T is symmetric, [G](14)
            else:
                at = math.atan2(m[V0], w0 * m[Y0]) / w0
                if at < 0.0:
                    at += 2.0 * math.pi / w0
            if at < s:
                radius = math.sqrt(m[Y0] * m[Y0] + m[V0] * m[V0] / m[W0SQ])
                keep_peak(x, side * k * (m[P0] + radius), t + at)
        if not to_flank:
            z, v = motion(m, s)
            m[END_KNOWN], m[END_Z], m[END_V] = 1.0, z, v
            keep_peak(x, side * k * z, t + s)
        return ASK
    begin = 0.0
    z, v = m[Z0], m[V0]
    while True:
        a, jerk, _ = derivatives(m, begin, z, v, forcing_tail(m, begin))
        slope = k * v + dd * a
        if begin > 0.0:  # an extreme: T' changes sign here
            slope = k * a + dd * jerk
        sign = 1.0 if slope > 0.0 or (slope == 0.0 and k * a + dd * jerk > 0.0) else -1.0
        start = RISING if begin > 0.0 else 0
        at = first_crossing(m, 0.0, 0.0, sign * k, sign * dd, 0.0, load, start, begin, s)
        if at < -1.0:
            return NOT_LOCATED
        if at < 0.0 or at <= begin:
            break
        z, v = motion(m, at)
        keep_peak(x, side * (k * z + dd * v), t + at)
        begin = at
    z, v = motion(m, s)
    m[END_KNOWN], m[END_Z], m[END_V] = 1.0, z, v
    keep_peak(x, side * (k * z + dd * v), t + s)
    return ASK


@inlined
def note_event_at(time: float, x: Vector, events: Vector, kind: float, value: float) -> None:
    """One event of the start; `events` may have no rows, then it is only counted."""
    x[EVENTS] += 1.0
    if events.shape[0] > 0:
        row = events[int(x[N_EVENTS])]
        row[E_TIME] = time
        row[E_KIND] = kind
        row[E_VALUE] = value
        x[N_EVENTS] += 1.0


@inlined
def note_event(x: Vector, events: Vector, kind: float, value: float) -> None:
    """One event that happens now."""
    note_event_at(x[TIME], x, events, kind, value)


@inlined
def end_stage(x: Vector, stages: Vector) -> None:
    """Close the books of the stage that ends now."""
    if abs(x[STAGE_PEAK]) > abs(x[PEAK]):
        x[PEAK] = x[STAGE_PEAK]
        x[PEAK_TIME] = x[STAGE_PEAK_TIME]
    if x[STAGE] == 2.0:
        x[FIRST_PEAK] = x[STAGE_PEAK]
        x[STAGE_2_END] = x[TIME]
    if stages.shape[0] > 0:
        row = stages[int(x[N_STAGES])]
        row[G_NUMBER] = x[STAGE]
        row[G_START] = x[STAGE_START]
        row[G_END] = x[TIME]
        row[G_SIDE] = x[SIDE]
        row[G_PEAK] = x[STAGE_PEAK]
        row[G_PEAK_TIME] = x[STAGE_PEAK_TIME]
        x[N_STAGES] += 1.0
    x[STAGE] += 1.0
    x[STAGE_START] = x[TIME]
    x[STAGE_PEAK] = 0.0
    x[STAGE_PEAK_TIME] = x[TIME]


@inlined
def note_segment(x: Vector, m: Vector, s: float, segments: Vector) -> None:
    """Record what is needed to evaluate any instant of this span exactly."""
    row = segments[int(x[N_SEGMENTS])]
    row[S_START] = x[TIME]
    row[S_END] = x[TIME] + s
    row[S_STAGE] = x[STAGE]
    row[S_SIDE] = x[SIDE]
    row[S_LOAD] = x[LOAD]
    row[S_THETA] = x[THETA]
    row[S_V] = x[V]
    row[S_PHI2] = x[PHI2]
    row[S_W2] = x[W2]
    row[S_UA] = m[UA]
    row[S_UB] = m[UB]
    row[S_UE] = m[UE]
    row[S_K] = m[K]
    row[S_DD] = m[DD]
    x[N_SEGMENTS] += 1.0
