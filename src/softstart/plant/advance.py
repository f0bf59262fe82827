"""The start, span by span, up to the next instant at which the controller must be asked."""

from __future__ import annotations

import math

from softstart.plant.crossing import RISING, first_crossing, load_speed
from softstart.plant.jit import inlined
from softstart.plant.layout import (
    ASK,
    ASK_AT,
    ASK_ON_GAP,
    BACK,
    BEYOND,
    BREAKAWAY,
    BROKE_AWAY,
    BUFFER_FULL,
    CLOSED,
    CONTACT_TORQUE,
    CONTACTS,
    DD,
    DEAD_ZONE,
    DEMAND,
    DOUBLED,
    E_KIND,
    E_TIME,
    E_VALUE,
    ENDED,
    EVENT_CAP,
    EVENT_LIMIT,
    EVENTS,
    EXIT,
    FIRST_CONTACT,
    FIRST_PEAK,
    G_END,
    G_NUMBER,
    G_PEAK,
    G_PEAK_TIME,
    G_SIDE,
    G_START,
    GAP,
    GAP_EVENTS,
    GRAZE_LOWER,
    GRAZE_UPPER,
    IMPACT_SPEED,
    INV_J,
    J1,
    LAMBDA,
    LAST_V,
    LAW,
    LEFT_BEYOND,
    LEFT_LOWER,
    LEFT_UPPER,
    LOAD,
    LOAD_STARTS,
    LOAD_STOPS,
    LOWER,
    MASK,
    MC,
    MODELICA,
    N_EVENTS,
    N_SEGMENTS,
    N_STAGES,
    NO_EVENT,
    NOT_FINITE,
    NOT_LOCATED,
    NOTHING,
    OPENED,
    P0,
    PEAK,
    PEAK_TIME,
    PERIOD,
    PHI2,
    REACHED,
    REF,
    REJOIN,
    S_DD,
    S_END,
    S_K,
    S_LOAD,
    S_PHI2,
    S_SIDE,
    S_STAGE,
    S_START,
    S_THETA,
    S_UA,
    S_UB,
    S_UE,
    S_V,
    S_W2,
    SIDE,
    SLEW_END,
    STAGE,
    STAGE_2_END,
    STAGE_PEAK,
    STAGE_PEAK_TIME,
    STAGE_START,
    START_TIME,
    STEADY,
    STOP,
    SWITCH,
    SWITCHED,
    T_END,
    TARGET_REACHED,
    THETA,
    TIME,
    TIME_LIMIT,
    UA,
    UB,
    UE,
    UNSOLVED,
    UPPER,
    V0,
    W0,
    W0SQ,
    W2,
    Y0,
    Z0,
    C,
    D,
    K,
    Septuple,
    U,
    V,
    Vector,
)  # fmt: skip
from softstart.plant.motion import derivatives, forcing_tail, motion
from softstart.plant.span import begin_span, next_event, torque_course

# A contact that lasts is solved this many elastic periods at a time: the search for events is bounded
LONGEST_SPAN = 16.0


@inlined
def keep_peak(x: Vector, torque: float, time: float) -> None:
    """Note a candidate for the largest |T| of the stage."""
    if abs(torque) > abs(x[STAGE_PEAK]):
        x[STAGE_PEAK] = torque
        x[STAGE_PEAK_TIME] = time


@inlined
def note_peak(x: Vector, m: Vector, load: Septuple, s: float) -> int:
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
            if m[Z0] == 0.0 and to_flank:
                at = 0.5 * s  # from flank to flank T is symmetric, [G](14)
            else:
                at = math.atan2(m[V0], w0 * m[Y0]) / w0
                if at < 0.0:
                    at += 2.0 * math.pi / w0
            if at < s:
                radius = math.sqrt(m[Y0] * m[Y0] + m[V0] * m[V0] / m[W0SQ])
                keep_peak(x, side * k * (m[P0] + radius), t + at)
        if not to_flank:
            z, _ = motion(m, s)
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
    keep_peak(x, side * (k * z + dd * v), t + s)
    return ASK


@inlined
def move(p: Vector, x: Vector, m: Vector, load: Septuple, s: float) -> None:
    """Bring the state to the end of the span."""
    tail = 1.0 - math.exp(-m[LAMBDA] * s) if m[UE] != 0.0 else 0.0
    side = x[SIDE]
    if math.isnan(m[LAST_V]):
        z, v = motion(m, s)
    else:
        z = 0.0  # on a flank, to which `handle` sets the angle
        v = m[LAST_V]
    theta = z
    if side == 0.0:
        if x[LOAD] != 0.0:
            x[PHI2] += s * (x[W2] + 0.5 * s * load[6])
            x[W2] += s * load[6]
    else:
        theta = side * (z + 0.5 * p[GAP])
        if x[LOAD] != 0.0:
            share = p[J1] * p[INV_J]
            push = s * s * (0.5 * load[1] + s * load[2] / 6.0)
            if m[UE] != 0.0:
                rate = m[LAMBDA]
                push += load[3] * (s - tail / rate) / rate
            x[PHI2] += s * (x[W2] + share * x[V]) + push - share * (theta - x[THETA])
            x[W2] = load_speed(m, load, s, v)
        v *= side
    x[THETA] = theta
    x[V] = v
    x[U] = m[UA] + m[UB] * s + m[UE] * (1.0 - tail)
    x[REF] = x[DEMAND] if s >= m[SLEW_END] else x[REF] + m[UB] * s
    x[TIME] += s


@inlined
def note_event(x: Vector, events: Vector, kind: float, value: float) -> None:
    """One event of the start; `events` may have no rows, then it is only counted."""
    x[EVENTS] += 1.0
    if events.shape[0] > 0:
        row = events[int(x[N_EVENTS])]
        row[E_TIME] = x[TIME]
        row[E_KIND] = kind
        row[E_VALUE] = value
        x[N_EVENTS] += 1.0


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
def close_gap(p: Vector, x: Vector, side: float, events: Vector, stages: Vector) -> None:
    """The flank `side` comes into contact."""
    end_stage(x, stages)
    x[GAP_EVENTS] += 1.0
    x[CONTACTS] += 1.0
    speed = side * x[V]
    if x[CONTACTS] == 1.0:
        x[FIRST_CONTACT] = x[TIME]
        x[IMPACT_SPEED] = speed
        x[CONTACT_TORQUE] = x[U]
    x[SIDE] = side
    note_event(x, events, CLOSED, side)
    engage(p, x, events)


@inlined
def engage(p: Vector, x: Vector, events: Vector) -> None:
    """Damping regime and, since damping makes the torque jump, breakaway at the start of a contact."""
    side = x[SIDE]
    z = side * x[THETA] - 0.5 * p[GAP]
    v = side * x[V]
    x[DOUBLED] = 1.0 if p[LAW] == MODELICA and p[D] * v > p[C] * z else 0.0
    torque = side * (2.0 * p[C] * z if x[DOUBLED] != 0.0 else p[C] * z + p[D] * v)
    if x[LOAD] == 0.0 and abs(torque) > p[MC]:
        x[LOAD] = math.copysign(1.0, torque)
        note_event(x, events, LOAD_STARTS, x[LOAD])


@inlined
def handle(p: Vector, x: Vector, m: Vector, event: int, events: Vector, stages: Vector) -> bool:
    """Change of mode at an event; True if the gap closed or opened."""
    half = 0.5 * p[GAP]
    x[MASK] = NOTHING
    if event in (UPPER, LOWER):
        side = 1.0 if event == UPPER else -1.0
        x[THETA] = side * half
        close_gap(p, x, side, events, stages)
        return True
    if event == REJOIN:
        side = x[BEYOND]
        x[BEYOND] = 0.0
        close_gap(p, x, side, events, stages)
        return True
    if event == EXIT:
        side = x[SIDE]
        end_stage(x, stages)
        x[GAP_EVENTS] += 1.0
        x[SIDE] = 0.0
        note_event(x, events, OPENED, side)
        if p[LAW] != DEAD_ZONE and p[D] > 0.0 and side * x[THETA] > half:
            x[BEYOND] = side
            x[MASK] = LEFT_BEYOND
        else:
            x[THETA] = side * half
            x[MASK] = LEFT_UPPER if side > 0.0 else LEFT_LOWER
        return True
    if event == BACK:
        x[THETA] = x[BEYOND] * half
        x[MASK] = LEFT_UPPER if x[BEYOND] > 0.0 else LEFT_LOWER
        x[BEYOND] = 0.0
    elif event == GRAZE_UPPER:
        x[MASK] = LEFT_UPPER
    elif event == GRAZE_LOWER:
        x[MASK] = LEFT_LOWER
    elif event == SWITCH:
        x[DOUBLED] = 1.0 - x[DOUBLED]
        x[MASK] = SWITCHED
    elif event == BREAKAWAY:
        x[LOAD] = math.copysign(1.0, shaft_torque(p, x))
        x[MASK] = BROKE_AWAY
        note_event(x, events, LOAD_STARTS, x[LOAD])
    elif event == STOP:
        x[V] += x[W2]
        x[W2] = 0.0
        torque = shaft_torque(p, x)
        note_event(x, events, LOAD_STOPS, x[LOAD])
        if abs(torque) <= p[MC]:
            x[LOAD] = 0.0
        else:
            x[LOAD] = math.copysign(1.0, torque)
            note_event(x, events, LOAD_STARTS, x[LOAD])
    elif event == REACHED:
        x[START_TIME] = x[TIME]
        note_event(x, events, TARGET_REACHED, x[W2])
        if x[T_END] == math.inf:
            x[T_END] = x[TIME] + p[PERIOD]
    return False


@inlined
def shaft_torque(p: Vector, x: Vector) -> float:
    """T of the present state."""
    side = x[SIDE]
    if side == 0.0:
        return 0.0
    z = side * x[THETA] - 0.5 * p[GAP]
    if x[DOUBLED] != 0.0:
        return side * 2.0 * p[C] * z
    return side * (p[C] * z + p[D] * side * x[V])


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


@inlined
def advance(p: Vector, x: Vector, m: Vector, segments: Vector, events: Vector, stages: Vector) -> int:
    """Go on until the controller must be asked, the start has ended, or something stands in the way.

    `segments`, `events` and `stages` are filled row by row; with no rows nothing is recorded.
    """
    recording = segments.shape[0] > 0
    while True:
        if recording and (
            x[N_SEGMENTS] >= segments.shape[0]
            or x[N_EVENTS] + 4 >= events.shape[0]
            or x[N_STAGES] + 2 >= stages.shape[0]
        ):
            return BUFFER_FULL
        t = x[TIME]
        stop = x[T_END]
        if math.isnan(x[START_TIME]) and stop == math.inf:
            stop = p[TIME_LIMIT]
        if t >= stop:
            end_stage(x, stages)
            return ENDED
        if t >= x[ASK_AT]:
            return ASK
        torque_course(p, x, m)
        load = begin_span(p, x, m)
        until = min(x[ASK_AT], stop)
        horizon = until - t
        cut = m[SLEW_END] < horizon
        if cut:
            horizon = m[SLEW_END]
        if x[SIDE] != 0.0 and horizon > LONGEST_SPAN * p[PERIOD]:
            cut = True
            horizon = LONGEST_SPAN * p[PERIOD]
        event, s = next_event(p, x, m, load, horizon)
        if event == UNSOLVED:
            return NOT_LOCATED
        if x[SIDE] != 0.0 and note_peak(x, m, load, s) == NOT_LOCATED:
            return NOT_LOCATED
        if recording:
            note_segment(x, m, s, segments)
        move(p, x, m, load, s)
        if not math.isfinite(x[THETA] + x[V] + x[W2] + x[U]):
            return NOT_FINITE
        if event == NO_EVENT:
            if not cut:
                x[TIME] = until
            if s > 0.0:
                x[MASK] = NOTHING
        elif handle(p, x, m, event, events, stages) and x[ASK_ON_GAP] != 0.0:
            x[ASK_AT] = x[TIME]
        if x[EVENTS] > p[EVENT_CAP]:
            return EVENT_LIMIT
