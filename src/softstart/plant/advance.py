"""The start, span by span, up to the next instant at which the controller must be asked."""

from __future__ import annotations

import math

from softstart.plant.coupled import coupled_travel
from softstart.plant.crossing import load_speed
from softstart.plant.jit import compiled, inlined, merged
from softstart.plant.layout import (
    ASK, BUFFER_FULL, ENDED, EVENT_LIMIT, EXIT, MOST_PENDING, NOTHING, NOT_FINITE, NOT_LOCATED, NO_EVENT,
    TOO_LONG, UNSOLVED, Matrix, Motion, Plant, Septuple, State,
)  # fmt: skip
from softstart.plant.modes import handle, reach_target, release_motor, shaft_torque, start_motor
from softstart.plant.motion import COUPLED, SERIES, motion, remainders
from softstart.plant.notes import end_stage, note_peak, note_segment
from softstart.plant.span import (
    begin_span, next_event, torque_after, torque_course,
)  # fmt: skip
from softstart.plant.steady import bounce, repeats

# A contact that lasts is solved this many elastic periods at a time: the search for events is bounded
LONGEST_SPAN = 16.0
LIMIT_ROUNDING = 1e-13  # a demand that is beyond a limit by so much of itself is one at the limit
SLOPE_ROUNDING = 1e-13  # a demand that goes on where a ramp has ended, but for so much, is no step


@inlined
def take_demand(x: State, demand: float, slope: float) -> None:
    """From now on the demand is this line."""
    if x.demand_slope != 0.0 and x.ref == x.demand:
        rounding = SLOPE_ROUNDING * (abs(demand) + abs(x.demand_slope) * x.time)
        if abs(demand - x.ref) <= rounding:
            x.ref = demand
    x.demand = demand
    x.demand_slope = slope


@inlined
def next_in_queue(x: State, m: Motion) -> None:
    """The answer that has waited longest takes effect."""
    take_demand(x, m.due_demand[0], m.due_slope[0])
    m.pending -= 1.0
    for i in range(int(m.pending)):
        m.due_time[i] = m.due_time[i + 1]
        m.due_demand[i] = m.due_demand[i + 1]
        m.due_slope[i] = m.due_slope[i + 1]


@inlined
def put(x: State, m: Motion, at: float, demand: float, slope: float) -> bool:
    """A demand that takes effect at this instant, now or later; False if too many wait."""
    if at <= x.time:
        m.pending = 0.0
        take_demand(x, demand, slope)
        return True
    waiting = int(m.pending)
    while waiting > 0 and m.due_time[waiting - 1] > at:  # corners of a line that this answer replaces
        waiting -= 1
    if waiting == MOST_PENDING:
        return False
    m.due_time[waiting] = at
    m.due_demand[waiting] = demand
    m.due_slope[waiting] = slope
    m.pending = waiting + 1.0
    return True


@compiled
def put_cut(p: Plant, x: State, m: Motion, torque: float, slope: float, end: float, until: float) -> bool:
    """A demand beyond the torque limits: a line from `torque` to `end`, cut off at them; False as `put`.

    Up to three pieces: at the limit from which the line comes, along the line, at the limit to which it goes.
    """
    begin = x.time + p.dead_time
    length = until - x.time
    demand = min(max(torque, p.u_min), p.u_max)
    within = min(max(end, p.u_min), p.u_max)
    excess = max(abs(torque - demand), abs(end - within))
    if excess < math.inf and excess <= LIMIT_ROUNDING * max(abs(torque), abs(end)):
        return put(x, m, begin, demand, (within - demand) / length if slope != 0.0 else 0.0)
    m.over = 1.0
    m.over_since = x.time
    m.over_torque = torque
    m.over_slope = slope
    if slope == 0.0:
        return put(x, m, begin, demand, 0.0)
    near, far = (p.u_min, p.u_max) if slope > 0.0 else (p.u_max, p.u_min)
    enters, leaves = (near - torque) / slope, (far - torque) / slope
    if enters >= length or leaves <= 0.0:
        return put(x, m, begin, demand, 0.0)
    room = put(x, m, begin, demand, slope if enters <= 0.0 else 0.0)
    if enters > 0.0:
        room = room and put(x, m, begin + enters, near, slope)
    if leaves < length:
        room = room and put(x, m, begin + leaves, far, 0.0)
    return room


@inlined
def note_excess(p: Plant, x: State, m: Motion) -> None:
    """Note how far and how long the last answer lay beyond the torque limits, up to now."""
    if m.over == 0.0:
        return
    m.over = 0.0
    length = x.time - m.over_since
    if length <= 0.0:
        return
    torque, slope = m.over_torque, m.over_slope
    end = torque if slope == 0.0 else torque + slope * length
    x.excess = max(x.excess, torque - p.u_max, p.u_min - torque, end - p.u_max, p.u_min - end)
    if slope != 0.0:
        one, other = (p.u_min - torque) / slope, (p.u_max - torque) / slope
        length -= max(0.0, min(length, max(one, other)) - max(0.0, min(one, other)))
    x.excess_time += length


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
