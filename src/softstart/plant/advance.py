"""The start, span by span, up to the next instant at which the controller must be asked."""

from __future__ import annotations

import math

from softstart.plant.coupled import coupled_travel
from softstart.plant.crossing import load_speed
from softstart.plant.exchange import next_in_queue, note_excess, shaft_torque
from softstart.plant.jit import compiled, inlined, merged
from softstart.plant.layout import (
    ASK, BUFFER_FULL, ENDED, EVENT_LIMIT, EXIT, MOTION, NOTHING, NOT_FINITE, NOT_LOCATED, NO_EVENT, PLANT,
    STATE, TOO_LONG, UNSOLVED, Matrix, Motion, Plant, Septuple, State, Vector,
)  # fmt: skip
from softstart.plant.modes import handle, reach_target, release_motor, start_motor
from softstart.plant.motion import COUPLED, SERIES, motion, remainders
from softstart.plant.notes import end_stage, note_peak, note_segment
from softstart.plant.span import (
    begin_span, next_event, torque_after, torque_course,
)  # fmt: skip
from softstart.plant.steady import bounce, repeats

# A contact that lasts is solved this many elastic periods at a time: the search for events is bounded
LONGEST_SPAN = 16.0


@inlined
def move(p: Plant, x: State, m: Motion, load: Septuple, s: float) -> None:
    """Bring the state to the end of the span."""
    tail = 1.0 - math.exp(-m.rate * s) if m.ue != 0.0 else 0.0
    side = x.side
    if m.end_known != 0.0:
        z, v = m.end_z, m.end_v
    elif math.isnan(m.last_v):
        z, v = motion(m, s)
    else:
        z = 0.0  # on a flank, to which `handle` sets the angle
        v = m.last_v
    theta = z
    if m.form == COUPLED:
        x.phi2 += coupled_travel(m, s)
        x.w2 = load_speed(m, load, s, v)
        if side != 0.0:
            theta = side * (z + 0.5 * p.gap)
            v *= side
    elif side == 0.0:
        if x.load != 0.0:
            x.phi2 += s * (x.w2 + 0.5 * s * load[6])
            x.w2 += s * load[6]
    else:
        theta = side * (z + 0.5 * p.gap)
        if x.load != 0.0:
            share = p.J1 * p.inv_J if x.held == 0.0 else 1.0
            push = s * s * (0.5 * load[1] + s * load[2] / 6.0)
            if m.slow_lag != 0.0:
                push += load[3] * (remainders(m.rate * s)[2] / m.rate) / m.rate
            elif m.ue != 0.0:
                rate = m.rate
                push += load[3] * (s - tail / rate) / rate
            x.phi2 += s * (x.w2 + share * x.v) + push - share * (theta - x.theta)
            x.w2 = load_speed(m, load, s, v)
        v *= side
    x.theta = theta
    x.v = v if x.held == 0.0 else -x.w2
    x.u = torque_after(p, x, m, s, 1.0 - tail)
    if x.demand_slope != 0.0:
        x.demand += x.demand_slope * s
    x.ref = x.demand if s >= m.slew_end else x.ref + m.ub * s
    x.time += s


@merged
def advance(p: Plant, x: State, m: Motion, segments: Matrix, events: Matrix, stages: Matrix) -> int:
    """Go on until the controller must be asked, the start has ended, or something stands in the way.

    `segments`, `events` and `stages` are filled row by row; with no rows nothing is recorded.
    """
    recording = segments.shape[0] > 0
    while True:
        if recording and (
            x.n_segments >= segments.shape[0]
            or x.n_events + 4 >= events.shape[0]
            or x.n_stages + 2 >= stages.shape[0]
        ):
            return BUFFER_FULL
        t = x.time
        stop = x.t_end
        if math.isnan(x.start_time) and stop == math.inf:
            stop = p.time_limit
        if t >= stop:
            note_excess(p, x, m)
            end_stage(x, stages)
            return ENDED if t < p.longest else TOO_LONG
        if m.pending > 0.0 and t >= m.due_time[0]:
            next_in_queue(x, m)
            continue
        if t >= x.ask_at:
            return ASK if x.asked < p.event_cap else EVENT_LIMIT
        torque_course(p, x, m)
        if x.held == 1.0 and (t >= p.release_at or (p.release_at == math.inf and x.u >= shaft_torque(p, x))):
            release_motor(p, x, events)
        if x.held == 2.0 and abs(x.u - shaft_torque(p, x)) > p.friction:
            start_motor(p, x, x.u - shaft_torque(p, x), events)
        until = min(x.ask_at, stop)
        if x.held == 1.0:
            until = min(until, p.release_at)
        if m.pending > 0.0:
            until = min(until, m.due_time[0])
        horizon = until - t
        cut = m.slew_end < horizon
        if cut:
            horizon = m.slew_end
        load = begin_span(p, x, m, horizon)
        if not recording and repeats(p, x, m) and bounce(p, x, m, load, until) > 0:
            if x.events > p.event_cap:
                return EVENT_LIMIT
            continue
        if m.form == SERIES and m.ue != 0.0 and horizon > p.lag:
            cut = True
            horizon = p.lag
        if m.form == COUPLED and horizon > m.length:
            cut = True
            horizon = m.length
        if x.side != 0.0 and horizon > LONGEST_SPAN * p.period:
            cut = True
            horizon = LONGEST_SPAN * p.period
        event, s = next_event(p, x, m, load, horizon)
        if event == EXIT and m.steady != 0.0 and m.z0 == 0.0:
            m.memo_done = 1.0
            if not math.isnan(m.passing):
                reach_target(p, x, t + m.passing, p.target, events)
        if event == UNSOLVED:
            return NOT_LOCATED
        if x.side != 0.0 and note_peak(p, x, m, load, s) == NOT_LOCATED:
            return NOT_LOCATED
        if recording:
            note_segment(x, m, s, segments)
        move(p, x, m, load, s)
        if not math.isfinite(x.theta + x.v + x.w2 + x.u):
            return NOT_FINITE
        if event == NO_EVENT:
            if not cut:
                x.time = until
            if s > 0.0:
                x.mask = NOTHING
        elif handle(p, x, m, event, events, stages) and x.ask_on_gap != 0.0:
            x.ask_at = x.time
        if x.events > p.event_cap:
            return EVENT_LIMIT


@compiled
def advance_vectors(p: Vector, x: Vector, m: Vector, segments: Matrix, events: Matrix, stages: Matrix) -> int:
    """`advance` on float64 vectors, for a controller in Python."""
    return advance(p.view(PLANT)[0], x.view(STATE)[0], m.view(MOTION)[0], segments, events, stages)
