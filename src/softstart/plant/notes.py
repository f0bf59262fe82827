"""What is noted of a start: peaks, events, stages, spans.

Peaks are located where T' = 0, never read off a grid.
"""

from __future__ import annotations

import math

from numba import from_dtype, types

from softstart.plant.crossing import RISING, WATCH, first_crossing
from softstart.plant.jit import apart, inlined
from softstart.plant.layout import (
    ASK, EVENT, MOTION, NOT_LOCATED, SEGMENT, STAGE_ROW, Matrix, Motion, Plant, Septuple, State,
)  # fmt: skip
from softstart.plant.motion import SERIES, derivatives, forcing_tail, motion
from softstart.plant.terms import ROUNDING, terms


@inlined
def keep_peak(x: State, torque: float, time: float) -> None:
    """Note a candidate for the largest |T| of the stage."""
    if abs(torque) > abs(x.stage_peak):
        x.stage_peak = torque
        x.stage_peak_time = time


@apart(types.float64(from_dtype(MOTION), types.float64, types.float64))
def slope_by_terms(m: Motion, begin: float, s: float) -> float:
    """T' at `begin`, or T'' where it is zero."""
    no_load = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    f, bend, _, _, _, size, _ = terms(m, 0.0, 0.0, m.k, m.dd, 0.0, no_load, begin, s)
    return bend if begin > 0.0 or abs(f) <= ROUNDING * size else f


@inlined
def next_extreme(m: Motion, load: Septuple, begin: float, z: float, v: float, s: float) -> float:
    """The first extreme of T in (begin, s) of a contact; z, v are those at `begin`, 0 or an extreme.

    Negative without one, below -1 if it cannot be located.
    """
    k = m.k
    dd = m.dd
    at = 0.0
    turned = 1.0
    for _ in range(3):  # once more, with its signs, if the search by terms takes over within this one
        by_terms = m.by_terms
        if by_terms != 0.0 and m.form < SERIES:  # k v and dd a may cancel to their last digits
            slope = slope_by_terms(m, begin, s)
            bend = slope
        else:
            a, jerk, _ = derivatives(m, begin, z, v, forcing_tail(m, begin))
            slope = k * v + dd * a
            bend = k * a + dd * jerk
            if begin > 0.0:  # an extreme: T' changes sign here
                slope = bend
        sign = 1.0 if slope > 0.0 or (slope == 0.0 and bend > 0.0) else -1.0
        start = RISING if begin > 0.0 else WATCH
        sign *= turned
        at = first_crossing(m, 0.0, 0.0, sign * k, sign * dd, 0.0, load, start, begin, s)
        if begin == 0.0 and at == 0.0 and turned > 0.0:
            turned = -1.0  # T', T'' begin at zero: T goes the other way at once
        elif m.by_terms == by_terms:
            break
    return at


@inlined
def note_peak(p: Plant, x: State, m: Motion, load: Septuple, s: float) -> int:
    """Locate the extremes of T within the span that ends at s; nothing is read off a grid."""
    side = x.side
    t = x.time
    k = m.k
    dd = m.dd
    keep_peak(x, side * (k * m.z0 + dd * m.v0), t)
    if m.steady != 0.0:
        w0 = m.w0
        to_flank = not math.isnan(m.last_v)
        if m.v0 > 0.0 or w0 * s > math.pi:
            if m.z0 == 0.0 and m.v0 > 0.0 and p.d == 0.0:
                at = 0.5 * m.memo_s  # from flank to flank, which takes memo_s, T is symmetric, [G](14)
            else:
                at = math.atan2(m.v0, w0 * m.y0) / w0
                if at < 0.0:
                    at += 2.0 * math.pi / w0
            if at < s:
                radius = math.sqrt(m.y0 * m.y0 + m.v0 * m.v0 / m.w0sq)
                keep_peak(x, side * k * (m.p0 + radius), t + at)
        if not to_flank:
            z, v = motion(m, s)
            m.end_known, m.end_z, m.end_v = 1.0, z, v
            keep_peak(x, side * k * z, t + s)
        return ASK
    begin = 0.0
    z, v = m.z0, m.v0
    while True:
        at = next_extreme(m, load, begin, z, v, s)
        if at < -1.0:
            return NOT_LOCATED
        if at < 0.0 or at <= begin:
            break
        z, v = motion(m, at)
        keep_peak(x, side * (k * z + dd * v), t + at)
        begin = at
    z, v = motion(m, s)
    m.end_known, m.end_z, m.end_v = 1.0, z, v
    keep_peak(x, side * (k * z + dd * v), t + s)
    return ASK


@inlined
def note_event_at(time: float, x: State, events: Matrix, kind: float, value: float) -> None:
    """One event of the start; `events` may have no rows, then it is only counted."""
    x.events += 1.0
    if events.shape[0] > 0:
        row = events[int(x.n_events)].view(EVENT)[0]
        row.time = time
        row.kind = kind
        row.value = value
        x.n_events += 1.0


@inlined
def note_event(x: State, events: Matrix, kind: float, value: float) -> None:
    """One event that happens now."""
    note_event_at(x.time, x, events, kind, value)


@inlined
def end_stage(x: State, stages: Matrix) -> None:
    """Close the books of the stage that ends now."""
    if abs(x.stage_peak) > abs(x.peak):
        x.peak = x.stage_peak
        x.peak_time = x.stage_peak_time
    if x.stage == 2.0:
        x.first_peak = x.stage_peak
        x.stage_2_end = x.time
    if stages.shape[0] > 0:
        row = stages[int(x.n_stages)].view(STAGE_ROW)[0]
        row.number = x.stage
        row.start = x.stage_start
        row.end = x.time
        row.side = x.side
        row.peak = x.stage_peak
        row.peak_time = x.stage_peak_time
        x.n_stages += 1.0
    x.stage += 1.0
    x.stage_start = x.time
    x.stage_peak = 0.0
    x.stage_peak_time = x.time


@inlined
def note_segment(x: State, m: Motion, s: float, segments: Matrix) -> None:
    """Record what is needed to evaluate any instant of this span exactly."""
    row = segments[int(x.n_segments)].view(SEGMENT)[0]
    row.start = x.time
    row.end = x.time + s
    row.stage = x.stage
    row.side = x.side
    row.load = x.load
    row.theta = x.theta
    row.v = x.v
    row.phi2 = x.phi2
    row.w2 = x.w2
    row.ua = m.ua
    row.ub = m.ub
    row.ue = m.ue
    row.k = m.k
    row.dd = m.dd
    row.held = x.held
    row.motor = x.motor
    row.u = x.u
    row.ref = x.ref
    x.n_segments += 1.0
