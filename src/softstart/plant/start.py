"""One start under a controller, and many of them."""

from __future__ import annotations

import math

import numpy as np
from numba import types

from softstart.plant.advance import advance as go_on
from softstart.plant.exchange import NEW_STATE, STEP_SIGNATURE, sample, take_answer
from softstart.plant.jit import compiled, compiled_as, inlined, merged
from softstart.plant.layout import (
    ANSWER, ASK, DEAD_ZONE, MEASURED, MOTION, N_P, N_X, PLANT,
    STATE, Matrix, Plant, State, Vector,
)  # fmt: skip
from softstart.plant.modes import engage

_A = types.Array(types.float64, 1, "C")
_M = types.Array(types.float64, 2, "C")
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


STARTS_SIGNATURE = types.int64(_STEP, _M, _M, types.int64, types.boolean, _A, _M, *[_A] * 7, _M, _M, _M)


@compiled_as(STARTS_SIGNATURE)
def starts(  # type: ignore[no-untyped-def]
    step, p, parameters, sees, on_gap, until, results, x, m, measured, state, command, drive, own, segments,
    events, stages,
):  # fmt: skip
    """As many starts as `results` has rows; without instants `until` one start, from where x stands."""
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
    starts(
        step, p, parameters, sees, on_gap, until, results, x, m, measured, state, command, drive, own,
        nothing, nothing, nothing,
    )  # fmt: skip


def run(step, p, parameters, sees, x, m, measured, state, command, segments, events, stages) -> int:  # type: ignore[no-untyped-def]
    """One start from where x stands to its end, or until a buffer is full: call again with larger ones."""
    row = x.reshape(1, -1)
    reason: int = starts(
        step, row, row, sees, False, NO_TIMES, row, x, m, measured, state, command, p, parameters,
        segments, events, stages,
    )  # fmt: skip
    return reason


# The same for a controller in Python, one control instant at a time, on vectors: with `advance_vectors`


@compiled
def begin(p: Vector, x: Vector, until: float, events: Matrix) -> None:
    """The state at t = 0; until = inf ends the start one elastic period after the target speed."""
    for i in range(N_X):
        x[i] = 0.0
    first_state(p.view(PLANT)[0], x.view(STATE)[0], until, events)


@compiled
def measure(p: Vector, x: Vector, sees: int, measured: Vector) -> None:
    """What the controller sees now."""
    sample(p.view(PLANT)[0], x.view(STATE)[0], sees, measured.view(MEASURED)[0])


@compiled
def obey(p: Vector, x: Vector, m: Vector, torque: float, ask_again: float, slope: float) -> int:
    """Take the controller's answer; returns ASK, or why it cannot be taken."""
    return take_answer(p.view(PLANT)[0], x.view(STATE)[0], m.view(MOTION)[0], torque, ask_again, slope)
