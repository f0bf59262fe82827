"""The start, span by span, up to the next instant at which the controller must be asked."""

from __future__ import annotations

import math

from softstart.plant.crossing import load_speed
from softstart.plant.jit import inlined
from softstart.plant.layout import (
    ASK, ASKED, ASK_AT, ASK_ON_GAP, BUFFER_FULL, DEMAND, DEMAND_SLOPE, ENDED, END_KNOWN, END_V, END_Z,
    EVENTS, EVENT_CAP, EVENT_LIMIT, EXIT, GAP, INV_J, J1, LAMBDA, LAST_V, LOAD, MASK, MEMO_DONE, NOTHING,
    NOT_FINITE, NOT_LOCATED, NO_EVENT, N_EVENTS, N_SEGMENTS, N_STAGES, N_WAITING, PASSING, PENDING, PERIOD,
    PHI2, QUEUE, Q_DEMAND, Q_SLOPE, Q_TIME, REF, SIDE, SLEW_END, START_TIME, STEADY, TARGET, THETA, TIME,
    TIME_LIMIT, T_END, U, UA, UB, UE, UNSOLVED, V, W2, Z0, Septuple, Vector,
)  # fmt: skip
from softstart.plant.modes import handle, reach_target
from softstart.plant.motion import motion
from softstart.plant.notes import end_stage, note_peak, note_segment
from softstart.plant.span import begin_span, next_event, torque_course
from softstart.plant.steady import bounce, repeats

# A contact that lasts is solved this many elastic periods at a time: the search for events is bounded
LONGEST_SPAN = 16.0
SLOPE_ROUNDING = 1e-13  # a demand that goes on where a ramp has ended, but for so much, is no step


@inlined
def take_demand(x: Vector, demand: float, slope: float) -> None:
    """From now on the demand is this line."""
    if x[DEMAND_SLOPE] != 0.0 and x[REF] == x[DEMAND]:
        rounding = SLOPE_ROUNDING * (abs(demand) + abs(x[DEMAND_SLOPE]) * x[TIME])
        if abs(demand - x[REF]) <= rounding:
            x[REF] = demand
    x[DEMAND] = demand
    x[DEMAND_SLOPE] = slope


@inlined
def next_in_queue(x: Vector, m: Vector) -> None:
    """The answer that has waited longest takes effect."""
    take_demand(x, m[QUEUE + Q_DEMAND], m[QUEUE + Q_SLOPE])
    m[PENDING] -= 1.0
    for i in range(QUEUE, QUEUE + N_WAITING * int(m[PENDING])):
        m[i] = m[i + N_WAITING]


@inlined
def move(p: Vector, x: Vector, m: Vector, load: Septuple, s: float) -> None:
    """Bring the state to the end of the span."""
    tail = 1.0 - math.exp(-m[LAMBDA] * s) if m[UE] != 0.0 else 0.0
    side = x[SIDE]
    if m[END_KNOWN] != 0.0:
        z, v = m[END_Z], m[END_V]
    elif math.isnan(m[LAST_V]):
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
    if x[DEMAND_SLOPE] != 0.0:
        x[DEMAND] += x[DEMAND_SLOPE] * s
    x[REF] = x[DEMAND] if s >= m[SLEW_END] else x[REF] + m[UB] * s
    x[TIME] += s


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
        if m[PENDING] > 0.0 and t >= m[QUEUE + Q_TIME]:
            next_in_queue(x, m)
            continue
        if t >= x[ASK_AT]:
            return ASK if x[ASKED] < p[EVENT_CAP] else EVENT_LIMIT
        torque_course(p, x, m)
        load = begin_span(p, x, m)
        until = min(x[ASK_AT], stop)
        if m[PENDING] > 0.0:
            until = min(until, m[QUEUE + Q_TIME])
        if not recording and repeats(p, x, m) and bounce(p, x, m, load, until) > 0:
            if x[EVENTS] > p[EVENT_CAP]:
                return EVENT_LIMIT
            continue
        horizon = until - t
        cut = m[SLEW_END] < horizon
        if cut:
            horizon = m[SLEW_END]
        if x[SIDE] != 0.0 and horizon > LONGEST_SPAN * p[PERIOD]:
            cut = True
            horizon = LONGEST_SPAN * p[PERIOD]
        event, s = next_event(p, x, m, load, horizon)
        if event == EXIT and m[STEADY] != 0.0 and m[Z0] == 0.0:
            m[MEMO_DONE] = 1.0
            if not math.isnan(m[PASSING]):
                reach_target(p, x, t + m[PASSING], p[TARGET], events)
        if event == UNSOLVED:
            return NOT_LOCATED
        if x[SIDE] != 0.0 and note_peak(p, x, m, load, s) == NOT_LOCATED:
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
