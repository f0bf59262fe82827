"""Between machine and controller: encoder, noise, queue and limits of the answers, the realised torque."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import types

from softstart.kernel.jit import separately_compiled, compiled, inner
from softstart.kernel.records import (
    ASK, BAD_COMMAND, MEASURED, MEASURED_TYPE, MOST_PENDING, QUEUE_FULL, SEES_LOAD_SPEED, SEES_STAGE,
    WORK_TYPE, Record, size,
)  # fmt: skip

# indices of `command`: torque demand, when to be asked again, slope of the demand until then; the new state
TORQUE, ASK_AGAIN, SLOPE, NEW_STATE = range(4)
# indices of `measured`
N_MEASURED = size(MEASURED)
(
    M_TIME, M_MOTOR_ANGLE, M_MOTOR_SPEED, M_MOTOR_TORQUE, M_STAGE, M_SHAFT_TORQUE, M_LOAD_SPEED, M_RUN,
    M_SET_SPEED, M_COMMAND_TIME,
) = range(N_MEASURED)  # fmt: skip
_A = types.Array(types.float64, 1, "C")
STEP_SIGNATURE = types.void(_A, _A, _A, _A)

LIMIT_ROUNDING = 1e-13  # a demand that is beyond a limit by so much of itself is one at the limit
SLOPE_ROUNDING = 1e-13  # a demand that goes on where a ramp has ended, but for so much, is no step
DIED_AWAY = 1e-16  # of the torque: what is left of the lag's exponential

# the mixer of SplitMix64 (Steele, Lea, Flood 2014, doi:10.1145/2660193.2660195)
_INCREMENT = np.uint64(0x9E3779B97F4A7C15)
_FIRST = np.uint64(0xBF58476D1CE4E5B9)
_SECOND = np.uint64(0x94D049BB133111EB)
_30, _27, _31, _11, _2 = np.uint64(30), np.uint64(27), np.uint64(31), np.uint64(11), np.uint64(2)
_UNIT = 2.0**-53


@inner
def _mixed(z: np.uint64) -> np.uint64:
    z = (z ^ (z >> _30)) * _FIRST
    z = (z ^ (z >> _27)) * _SECOND
    return z ^ (z >> _31)


@compiled
def gauss(seed: float, number: float) -> float:
    """The noise number `number` of the sequence `seed`: standard normal, by Box and Muller.

    No state is kept, so a start has the same noise alone, in a batch, and under a plain controller.

    >>> gauss(1.0, 5.0) == gauss(1.0, 5.0), gauss(1.0, 5.0) == gauss(2.0, 5.0)
    (True, False)
    """
    start = _mixed(np.uint64(seed) * _INCREMENT + _INCREMENT) + _2 * np.uint64(number) * _INCREMENT
    a = _mixed(start + _INCREMENT)
    b = _mixed(start + _2 * _INCREMENT)
    radius = math.sqrt(-2.0 * math.log((float(a >> _11) + 0.5) * _UNIT))
    return radius * math.cos(2.0 * math.pi * float(b >> _11) * _UNIT)


COUNTS_PER_LINE = 4  # quadrature


def encoder_count(lines: Any) -> Any:
    """Angle of one encoder count in rad: 2 pi/(4 lines); 0 for an ideal encoder.

    >>> round(encoder_count(4096) * 1e6, 2)
    383.5
    """
    if type(lines) is float:  # as tuning asks by the thousand
        return 2.0 * math.pi / (COUNTS_PER_LINE * max(lines, 1.0)) if lines > 0.0 else 0.0
    lines = np.asarray(lines, dtype=np.float64)
    count = np.where(lines > 0.0, 2.0 * math.pi / (COUNTS_PER_LINE * np.maximum(lines, 1.0)), 0.0)
    return count if count.ndim else float(count)


# the demand -----------------------------------------------------------------------------------------


@inner
def take_demand(s: Record, demand: float, slope: float) -> None:
    """From now on the demand is this line."""
    if s.demand_slope != 0.0 and s.u_ref == s.demand:
        rounding = SLOPE_ROUNDING * (abs(demand) + abs(s.demand_slope) * s.time)
        if abs(demand - s.u_ref) <= rounding:
            s.u_ref = demand
    s.demand = demand
    s.demand_slope = slope


@inner
def next_in_queue(s: Record) -> None:
    """The answer that has waited longest takes effect."""
    take_demand(s, s.due_demand[0], s.due_slope[0])
    s.pending -= 1.0
    for i in range(int(s.pending)):
        s.due_time[i] = s.due_time[i + 1]
        s.due_demand[i] = s.due_demand[i + 1]
        s.due_slope[i] = s.due_slope[i + 1]


@inner
def put(s: Record, at: float, demand: float, slope: float) -> bool:
    """A demand that takes effect at this instant, now or later; False if too many wait."""
    demand *= s.sense
    slope *= s.sense
    if at <= s.time:
        s.pending = 0.0
        take_demand(s, demand, slope)
        return True
    waiting = int(s.pending)
    while waiting > 0 and s.due_time[waiting - 1] > at:  # corners of a line that this answer replaces
        waiting -= 1
    if waiting == MOST_PENDING:
        return False
    s.due_time[waiting] = at
    s.due_demand[waiting] = demand
    s.due_slope[waiting] = slope
    s.pending = waiting + 1.0
    return True


@inner
def put_cut(s: Record, torque: float, slope: float, end: float, until: float) -> bool:
    """A demand beyond the torque limits: a line from `torque` to `end`, cut off at them; False as `put`.

    Up to three pieces: at the limit from which the line comes, along the line, at the limit to which it goes.
    """
    begin = s.time + s.dead_time
    length = until - s.time
    demand = min(max(torque, s.u_min), s.u_max)
    within = min(max(end, s.u_min), s.u_max)
    excess = max(abs(torque - demand), abs(end - within))
    if excess < math.inf and excess <= LIMIT_ROUNDING * max(abs(torque), abs(end)):
        return put(s, begin, demand, (within - demand) / length if slope != 0.0 else 0.0)
    s.beyond_limits = 1.0
    s.beyond_since = s.time
    s.beyond_torque = torque
    s.beyond_slope = slope
    if slope == 0.0:
        return put(s, begin, demand, 0.0)
    first, last = (s.u_min, s.u_max) if slope > 0.0 else (s.u_max, s.u_min)  # limits that the line crosses
    entry_time, exit_time = (first - torque) / slope, (last - torque) / slope
    if entry_time >= length or exit_time <= 0.0:
        return put(s, begin, demand, 0.0)
    room = put(s, begin, demand, slope if entry_time <= 0.0 else 0.0)
    if entry_time > 0.0:
        room = room and put(s, begin + entry_time, first, slope)
    if exit_time < length:
        room = room and put(s, begin + exit_time, last, 0.0)
    return room


@inner
def note_excess(s: Record) -> None:
    """Note how far and how long the last answer lay beyond the torque limits, up to now."""
    if s.beyond_limits == 0.0:
        return
    s.beyond_limits = 0.0
    length = s.time - s.beyond_since
    if length <= 0.0:
        return
    torque, slope = s.beyond_torque, s.beyond_slope
    end = torque if slope == 0.0 else torque + slope * length
    s.excess = max(s.excess, torque - s.u_max, s.u_min - torque, end - s.u_max, s.u_min - end)
    if slope != 0.0:
        one, other = (s.u_min - torque) / slope, (s.u_max - torque) / slope
        length -= max(0.0, min(length, max(one, other)) - max(0.0, min(one, other)))
    s.excess_time += length


@inner
def own_time(s: Record) -> float:
    """The time by the clock of the controller, which begins with it."""
    if s.begins_at == 0.0:
        return float(s.time)
    return float(s.ask_own if s.time == s.ask_at else s.time - s.begins_at)


@separately_compiled(types.void(WORK_TYPE, types.int64, MEASURED_TYPE))
def sample(s: Record, sees: int, measured: Record) -> None:
    """What the controller sees now: the encoder rounds, and what it has not declared is NaN.

    The encoder counts edges from 0 on; the start lies `encoder_phase` of a count beyond the middle of two.
    """
    angle = s.phi
    for k in range(s.path, s.path_end):
        angle += s.theta[k] if s.at_motor < s.at_load else -s.theta[k]
    angle *= s.sense
    speed = s.sense * s.w[s.at_motor]
    count = s.encoder
    if count > 0.0:
        edge = s.encoder_phase + 0.5
        angle = (math.floor(angle / count + edge) - math.floor(edge)) * count  # counted edges
        if s.asked != 0.0 and s.time > s.sample_time:
            speed = (angle - s.sample_angle) / (s.time - s.sample_time)
    s.sample_angle = angle
    s.sample_time = s.time
    measured.time = own_time(s)
    measured.motor_angle = angle
    measured.motor_speed = speed
    measured.motor_torque = s.sense * s.u
    if s.torque_noise > 0.0:
        measured.motor_torque += s.torque_noise * gauss(s.noise_seed, s.asked)
    measured.stage = s.stage if sees & SEES_STAGE else math.nan
    measured.shaft_torque = math.nan
    measured.load_speed = s.sense * s.w[s.at_load] if sees & SEES_LOAD_SPEED else math.nan
    measured.run = s.run
    measured.set_speed = s.set_speed
    measured.command_time = s.time - s.command_since


@separately_compiled(types.int64(WORK_TYPE, types.float64, types.float64, types.float64))
def take_answer(s: Record, torque: float, ask_again: float, slope: float) -> int:
    """Take the controller's answer; returns ASK, or why it cannot be taken.

    A reply is refused if it is not a number, names a past instant, or has a slope without an end.
    The demand is the straight line from `torque` now to torque + slope (ask_again - now) then, cut off at the
    machine's limits. ask_again = -inf (NEVER) also ends the asking at gap events. With a
    dead time the answer waits in the queue until it takes effect; the asking does not.
    """
    if ask_again == -math.inf:
        s.ask_on_gap = 0.0
        ask_again = math.inf
    own = own_time(s)
    if math.isnan(torque) or not ask_again > own:
        return BAD_COMMAND
    end = torque if slope == 0.0 else torque + slope * (ask_again - own)
    until = ask_again + s.begins_at
    if until <= s.time:  # by rounding
        until = np.nextafter(s.time, math.inf)
    if slope != 0.0 and not math.isfinite(end):
        return BAD_COMMAND
    note_excess(s)
    demand = min(max(torque, s.u_min), s.u_max)
    if demand == torque and min(max(end, s.u_min), s.u_max) == end:
        if not put(s, s.time + s.dead_time, demand, slope):
            return QUEUE_FULL
    elif not put_cut(s, torque, slope, end, until):
        return QUEUE_FULL
    s.ask_at, s.ask_own = until, ask_again
    s.asked += 1.0
    if s.contacts == 1.0 and math.isnan(s.contact_torque):  # the start is in contact
        immediate = s.lag == 0.0 and s.rate == math.inf and s.dead_time == 0.0
        s.contact_torque = s.sense * demand if immediate else s.u
    return ASK


# the realised torque --------------------------------------------------------------------------------


@inner
def along_line(s: Record) -> None:
    """Whether the realised torque is a line, and there the torque itself to the last digit."""
    s.on_line = 1.0
    if s.lag == 0.0:
        s.u = s.u_ref
        return
    line = s.u_ref - s.slope * s.lag  # what a first-order lag follows a ramp with
    if abs(s.u - line) > DIED_AWAY * (abs(line) + abs(s.u)):
        s.on_line = 0.0


@separately_compiled(types.void(WORK_TYPE))
def begin_torque(s: Record) -> None:
    """The torque from now on: ref' = slope up to `slew_end`, u' = (ref - u)/lag.

    The demand is a line. A slew limiter that is not on it runs towards it at its rate and meets it at
    `slew_end`; one that is on it follows, unless the line is too steep. Where the exponential of the lag has
    died away u is a line too, slope lag below the demand.
    """
    demand = s.demand
    slope = s.demand_slope
    s.slew_end = math.inf
    if s.u_ref != demand:
        if s.rate < math.inf:
            away = demand - s.u_ref
            line = slope
            slope = math.copysign(s.rate, away)
            if line == 0.0:  # a constant demand is met when the distance is covered
                s.slew_end = away / slope
            elif (slope - line) * away > 0.0:
                s.slew_end = away / (slope - line)
        else:
            s.u_ref = demand
    elif abs(slope) > s.rate:
        slope = math.copysign(s.rate, slope)
    s.slope = slope
    along_line(s)


@inner
def expand_torque(s: Record, h: float, n: int) -> None:
    """The Taylor coefficients of the motor torque."""
    u = s.torque_u
    u[0] = s.u
    if s.on_line != 0.0:
        u[1] = s.slope * h
        for o in range(2, n + 1):
            u[o] = 0.0
        return
    share = h / s.lag  # of u' = (u_ref - u)/lag, with u_ref a line
    term = (s.u_ref - s.u) * share
    u[1] = term
    term = 0.5 * (s.slope * h - term) * share
    u[2] = term
    for o in range(3, n + 1):
        term *= -share / o
        u[o] = term


@inner
def move_demand(s: Record, time: float) -> None:
    """Demand and slew limiter after so many seconds."""
    if s.demand_slope != 0.0:
        s.demand += s.demand_slope * time
    s.u_ref = s.demand if time >= s.slew_end else s.u_ref + s.slope * time
