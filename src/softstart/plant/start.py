"""One start under a controller, and many of them."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import types

from softstart.plant.advance import advance as go_on
from softstart.plant.advance import note_excess, put, put_cut
from softstart.plant.jit import compiled, compiled_as, inlined, merged
from softstart.plant.layout import (
    ANSWER, ASK, BAD_COMMAND, DEAD_ZONE, MEASURED, MOTION, N_P, N_X, PLANT,
    QUEUE_FULL, STATE, Matrix, Motion, Plant, State, Vector, size,
)  # fmt: skip
from softstart.plant.modes import engage, shaft_torque
from softstart.plant.noise import gauss

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
_M = types.Array(types.float64, 2, "C")
STEP_SIGNATURE = types.void(_A, _A, _A, _A)
_STEP = types.FunctionType(STEP_SIGNATURE)
NO_TIMES = np.zeros(0)


@inlined
def first_state(p: Plant, x: State, until: float, events: Matrix) -> None:
    """The state at t = 0, all zeros before."""
    x.theta = p.theta_0
    x.v = p.w1_0 - p.w2_0
    x.w2 = p.w2_0
    x.t_end = until if until == math.inf else min(until, p.longest)
    x.start_time = math.nan
    x.release_time = math.nan
    x.held = 1.0 if p.release_at > 0.0 else 0.0
    if p.friction > 0.0 and x.held == 0.0:
        x.motor = np.sign(p.w1_0)
        if p.w1_0 == 0.0:
            x.held = 2.0
    x.first_contact = math.nan
    x.stage_2_end = math.nan
    x.impact_speed = math.nan
    x.contact_torque = math.nan
    x.stage = 1.0
    x.load = 1.0
    if p.reactive != 0.0:
        x.load = np.sign(p.w2_0)
    half = 0.5 * p.gap
    overlap = abs(p.theta_0) - half
    if overlap > 0.0:
        side = math.copysign(1.0, p.theta_0)
        if p.law != DEAD_ZONE and p.c * overlap + p.d * side * x.v < 0.0:
            x.beyond = side
        else:
            x.stage = 2.0
            x.side = side
            x.contacts = 1.0
            x.first_contact = 0.0
            x.impact_speed = side * x.v
            engage(p, x, events)


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


@merged
def until_full(step, p, parameters, sees, x, m, measured, state, command, segments, events, stages):  # type: ignore[no-untyped-def]
    """One start to its end, or until a buffer is full: call again with larger ones."""
    answer = command[:NEW_STATE].view(ANSWER)[0]
    seen = measured.view(MEASURED)[0]
    while True:
        reason = go_on(p, x, m, segments, events, stages)
        if reason == ASK:
            sample(p, x, sees, seen)
            answer.slope = 0.0
            step(parameters, measured, state, command)
            reason = take_answer(p, x, m, answer.torque, answer.ask_again, answer.slope)
        if reason != ASK:
            x.status = reason
            return reason
        for i in range(state.shape[0]):
            state[i] = command[NEW_STATE + i]


@compiled_as(types.int64(_STEP, _M, _M, types.int64, types.boolean, _A, _M, *[_A] * 7, _M, _M, _M))
def _starts(  # type: ignore[no-untyped-def]
    step, p, parameters, sees, on_gap, until, results, x, m, measured, state, command, drive, own, segments,
    events, stages,
):  # fmt: skip
    now, motion, plant = x.view(STATE)[0], m.view(MOTION)[0], drive.view(PLANT)[0]
    reason = ASK
    for i in range(results.shape[0]):
        if until.shape[0] > 0:
            if i == 0 or p.shape[0] > 1:
                for j in range(N_P):
                    drive[j] = p[i, j]
            if i == 0 or parameters.shape[0] > 1:
                for j in range(own.shape[0]):
                    own[j] = parameters[i, j]
            for j in range(state.shape[0]):
                state[j] = 0.0
            for j in range(N_X):
                x[j] = 0.0
            motion.memo_v = math.nan
            motion.by_terms = 0.0
            motion.pending = 0.0
            motion.over = 0.0
            first_state(plant, now, until[i if until.shape[0] > 1 else 0], events)
            now.ask_on_gap = 1.0 if on_gap else 0.0
        reason = until_full(
            step, plant, own, sees, now, motion, measured, state, command, segments, events, stages
        )
        for j in range(N_X):
            results[i, j] = x[j]
    return reason


def run_many(  # type: ignore[no-untyped-def]
    step, p, parameters, sees, on_gap, until, results, x, m, measured, state, command, drive, own, nothing
) -> None:
    """Start i has row i of p, parameters and until (one row serves all); its x goes to results[i].

    The arrays from x on are scratch: the kernel itself allocates nothing.
    """
    _starts(
        step, p, parameters, sees, on_gap, until, results, x, m, measured, state, command, drive, own,
        nothing, nothing, nothing,
    )  # fmt: skip


def run(step, p, parameters, sees, x, m, measured, state, command, segments, events, stages) -> int:  # type: ignore[no-untyped-def]
    """One start from where x stands to its end, or until a buffer is full: call again with larger ones."""
    row = x.reshape(1, -1)
    reason: int = _starts(
        step, row, row, sees, False, NO_TIMES, row, x, m, measured, state, command, p, parameters,
        segments, events, stages,
    )  # fmt: skip
    return reason


# The same for a controller in Python and for other kernels, one control instant at a time, on float64 vectors


@compiled
def begin(p: Vector, x: Vector, until: float, events: Matrix) -> None:
    """The state at t = 0; until = inf ends the start one elastic period after the target speed."""
    for i in range(N_X):
        x[i] = 0.0
    first_state(p.view(PLANT)[0], x.view(STATE)[0], until, events)


@compiled
def advance(p: Vector, x: Vector, m: Vector, segments: Matrix, events: Matrix, stages: Matrix) -> int:
    """On to the next instant at which the controller must be asked, see `softstart.plant.advance`."""
    return go_on(p.view(PLANT)[0], x.view(STATE)[0], m.view(MOTION)[0], segments, events, stages)


@compiled
def run_native(step, p, parameters, sees, x, m, measured, state, command, segments, events, stages):  # type: ignore[no-untyped-def]
    """`run` for compiled functions; compiled when it is first used."""
    return until_full(
        step, p.view(PLANT)[0], parameters, sees, x.view(STATE)[0], m.view(MOTION)[0], measured, state,
        command, segments, events, stages,
    )  # fmt: skip


@compiled
def measure(p: Vector, x: Vector, sees: int, measured: Vector) -> None:
    """What the controller sees now."""
    sample(p.view(PLANT)[0], x.view(STATE)[0], sees, measured.view(MEASURED)[0])


@compiled
def obey(p: Vector, x: Vector, m: Vector, torque: float, ask_again: float, slope: float) -> int:
    """Take the controller's answer; returns ASK, or why it cannot be taken."""
    return take_answer(p.view(PLANT)[0], x.view(STATE)[0], m.view(MOTION)[0], torque, ask_again, slope)
