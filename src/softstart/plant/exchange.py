"""What passes between plant and controller at a control instant: what is measured, the answer, its queue.

Controllers and the kernels of chains are compiled from this file without the loop of starts.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import types

from softstart.plant.jit import compiled, inlined
from softstart.plant.layout import (
    ASK, BAD_COMMAND, MEASURED, MOST_PENDING, QUEUE_FULL, Motion, Plant, State, size,
)  # fmt: skip

# indices of `command`: torque demand, when to be asked again, slope of the demand until then; the new state
TORQUE, ASK_AGAIN, SLOPE, NEW_STATE = range(4)
# indices of `measured`
N_MEASURED = size(MEASURED)
(
    M_TIME, M_MOTOR_ANGLE, M_MOTOR_SPEED, M_MOTOR_TORQUE, M_STAGE, M_SHAFT_TORQUE, M_LOAD_SPEED,
) = range(N_MEASURED)  # fmt: skip
# what a controller may declare to see beyond time, motor angle, speed and torque
SEES_STAGE, SEES_SHAFT_TORQUE, SEES_LOAD_SPEED = 1, 2, 4
_A = types.Array(types.float64, 1, "C")
STEP_SIGNATURE = types.void(_A, _A, _A, _A)

LIMIT_ROUNDING = 1e-13  # a demand that is beyond a limit by so much of itself is one at the limit
SLOPE_ROUNDING = 1e-13  # a demand that goes on where a ramp has ended, but for so much, is no step

# the mixer of SplitMix64 (Steele, Lea, Flood 2014, doi:10.1145/2660193.2660195)
_INCREMENT = np.uint64(0x9E3779B97F4A7C15)
_FIRST = np.uint64(0xBF58476D1CE4E5B9)
_SECOND = np.uint64(0x94D049BB133111EB)
_30, _27, _31, _11, _2 = np.uint64(30), np.uint64(27), np.uint64(31), np.uint64(11), np.uint64(2)
_UNIT = 2.0**-53


@compiled
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
def shaft_torque(p: Plant, x: State) -> float:
    """T of the present state."""
    side = x.side
    if side == 0.0:
        return 0.0
    z = side * x.theta - 0.5 * p.gap
    if x.doubled != 0.0:
        return side * 2.0 * p.c * z
    return side * (p.c * z + p.d * side * x.v)


@inlined
def sample(p: Plant, x: State, sees: int, measured: Any) -> None:
    """What the controller sees now: the encoder rounds, and what it has not declared is NaN.

    The encoder counts edges from 0 on; the start lies `encoder_phase` of a count beyond the middle of two.
    """
    t = x.time
    angle = x.phi2 + x.theta
    speed = x.v + x.w2
    count = p.encoder
    if count > 0.0:
        edge = p.encoder_phase + 0.5
        angle = (math.floor(angle / count + edge) - math.floor(edge)) * count
        if x.asked != 0.0 and t > x.sample_time:
            speed = (angle - x.sample_angle) / (t - x.sample_time)
    x.sample_angle = angle
    x.sample_time = t
    measured.time = t
    measured.motor_angle = angle
    measured.motor_speed = speed
    measured.motor_torque = x.u
    if p.torque_noise > 0.0:
        measured.motor_torque += p.torque_noise * gauss(p.noise_seed, x.asked)
    measured.stage = x.stage if sees & SEES_STAGE else math.nan
    measured.shaft_torque = shaft_torque(p, x) if sees & SEES_SHAFT_TORQUE else math.nan
    measured.load_speed = x.w2 if sees & SEES_LOAD_SPEED else math.nan


@inlined
def take_answer(p: Plant, x: State, m: Motion, torque: float, ask_again: float, slope: float) -> int:
    """Take the controller's answer; returns ASK, or why it cannot be taken.

    An answer is none if it is not a number, names a past instant, or has a slope without end.
    The demand is the straight line from `torque` now to torque + slope (ask_again - now) then, cut off at the
    drive's limits, see `limits`. ask_again = -inf (NEVER) also ends the asking at gap events. With a
    dead time the answer waits in the queue until it takes effect; the asking does not.
    """
    if ask_again == -math.inf:
        x.ask_on_gap = 0.0
        ask_again = math.inf
    if math.isnan(torque) or not ask_again > x.time:
        return BAD_COMMAND
    end = torque if slope == 0.0 else torque + slope * (ask_again - x.time)
    if slope != 0.0 and not math.isfinite(end):
        return BAD_COMMAND
    note_excess(p, x, m)
    demand = min(max(torque, p.u_min), p.u_max)
    if demand == torque and min(max(end, p.u_min), p.u_max) == end:
        if not put(x, m, x.time + p.dead_time, demand, slope):
            return QUEUE_FULL
    elif not put_cut(p, x, m, torque, slope, end, ask_again):
        return QUEUE_FULL
    x.ask_at = ask_again
    x.asked += 1.0
    if x.contacts == 1.0 and math.isnan(x.contact_torque):  # the start is in contact
        immediate = p.lag == 0.0 and p.rate == math.inf and p.dead_time == 0.0
        x.contact_torque = demand if immediate else x.u
    return ASK
