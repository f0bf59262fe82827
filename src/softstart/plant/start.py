"""One start under a controller, and many of them."""

from __future__ import annotations

import math

import numpy as np
from numba import types

from softstart.plant.advance import advance, take_demand
from softstart.plant.jit import compiled, compiled_as
from softstart.plant.layout import (
    ASK, ASKED, ASK_AT, ASK_ON_GAP, BAD_COMMAND, BEYOND, C, CONTACTS, CONTACT_TORQUE, D, DEAD_ZONE,
    DEAD_TIME, ENCODER, ENCODER_PHASE, FIRST_CONTACT, GAP, IMPACT_SPEED, LAG, LAW, LOAD, MEMO_V, MOST_PENDING,
    NOISE_SEED, N_P, N_WAITING, N_X, PENDING, PHI2, QUEUE, QUEUE_FULL, Q_DEMAND, Q_SLOPE, Q_TIME, RATE,
    REACTIVE, SAMPLE_ANGLE, SAMPLE_TIME, SIDE, STAGE, STAGE_2_END, START_TIME, STATUS, THETA, THETA_0, TIME,
    TORQUE_NOISE, T_END, U, U_MAX, U_MIN, V, W1_0, W2, W2_0, Vector,
)  # fmt: skip
from softstart.plant.modes import engage, shaft_torque
from softstart.plant.noise import gauss

# what a controller is given: the indices of `measured`
N_MEASURED = 7
M_TIME, M_MOTOR_ANGLE, M_MOTOR_SPEED, M_MOTOR_TORQUE, M_STAGE, M_SHAFT_TORQUE, M_LOAD_SPEED = range(7)
# what it may declare to see beyond time, motor angle, speed and torque
SEES_STAGE, SEES_SHAFT_TORQUE, SEES_LOAD_SPEED = 1, 2, 4
# what it returns: torque demand, when to be asked again, the demand's slope until then; its new state follows
TORQUE, ASK_AGAIN, SLOPE, NEW_STATE = range(4)

_A = types.Array(types.float64, 1, "C")
STEP_SIGNATURE = types.void(_A, _A, _A, _A)
_STEP = types.FunctionType(STEP_SIGNATURE)
_M = types.Array(types.float64, 2, "C")


@compiled
def begin(p: Vector, x: Vector, until: float, events: Vector) -> None:
    """The state at t = 0; until = inf ends the start one elastic period after the target speed."""
    for i in range(x.shape[0]):
        x[i] = 0.0
    x[THETA] = p[THETA_0]
    x[V] = p[W1_0] - p[W2_0]
    x[W2] = p[W2_0]
    x[T_END] = until
    x[START_TIME] = math.nan
    x[FIRST_CONTACT] = math.nan
    x[STAGE_2_END] = math.nan
    x[IMPACT_SPEED] = math.nan
    x[CONTACT_TORQUE] = math.nan
    x[STAGE] = 1.0
    x[LOAD] = 1.0
    if p[REACTIVE] != 0.0:
        x[LOAD] = np.sign(p[W2_0])
    half = 0.5 * p[GAP]
    overlap = abs(p[THETA_0]) - half
    if overlap > 0.0:
        side = math.copysign(1.0, p[THETA_0])
        if p[LAW] != DEAD_ZONE and p[C] * overlap + p[D] * side * x[V] < 0.0:
            x[BEYOND] = side
        else:
            x[STAGE] = 2.0
            x[SIDE] = side
            x[CONTACTS] = 1.0
            x[FIRST_CONTACT] = 0.0
            x[IMPACT_SPEED] = side * x[V]
            engage(p, x, events)


@compiled
def measure(p: Vector, x: Vector, sees: int, measured: Vector) -> None:
    """What the controller sees now: the encoder rounds, and what it has not declared is NaN.

    The encoder counts edges from 0 on; the start lies `encoder_phase` of a count beyond the middle of two.
    """
    t = x[TIME]
    angle = x[PHI2] + x[THETA]
    speed = x[V] + x[W2]
    count = p[ENCODER]
    if count > 0.0:
        edge = p[ENCODER_PHASE] + 0.5
        angle = (math.floor(angle / count + edge) - math.floor(edge)) * count
        if x[ASKED] != 0.0 and t > x[SAMPLE_TIME]:
            speed = (angle - x[SAMPLE_ANGLE]) / (t - x[SAMPLE_TIME])
    x[SAMPLE_ANGLE] = angle
    x[SAMPLE_TIME] = t
    measured[M_TIME] = t
    measured[M_MOTOR_ANGLE] = angle
    measured[M_MOTOR_SPEED] = speed
    measured[M_MOTOR_TORQUE] = x[U]
    if p[TORQUE_NOISE] > 0.0:
        measured[M_MOTOR_TORQUE] += p[TORQUE_NOISE] * gauss(p[NOISE_SEED], x[ASKED])
    measured[M_STAGE] = x[STAGE] if sees & SEES_STAGE else math.nan
    measured[M_SHAFT_TORQUE] = shaft_torque(p, x) if sees & SEES_SHAFT_TORQUE else math.nan
    measured[M_LOAD_SPEED] = x[W2] if sees & SEES_LOAD_SPEED else math.nan


@compiled
def obey(p: Vector, x: Vector, m: Vector, torque: float, ask_again: float, slope: float) -> int:
    """Take the controller's answer; returns ASK, or why it cannot be taken.

    An answer is none if it is not a number, names a past instant, or has a slope without end.
    The demand is the straight line from `torque` now to torque + slope (ask_again - now) then, both ends
    clipped to the drive's limits. ask_again = -inf (NEVER) also ends the asking at gap events. With a
    dead time the answer waits in the queue until it takes effect; the asking does not.
    """
    if ask_again == -math.inf:
        x[ASK_ON_GAP] = 0.0
        ask_again = math.inf
    if math.isnan(torque) or not ask_again > x[TIME]:
        return BAD_COMMAND
    demand = min(max(torque, p[U_MIN]), p[U_MAX])
    if slope != 0.0:
        length = ask_again - x[TIME]
        end = torque + slope * length
        if not math.isfinite(end):
            return BAD_COMMAND
        within = min(max(end, p[U_MIN]), p[U_MAX])
        if demand != torque or within != end:
            slope = (within - demand) / length
    if p[DEAD_TIME] > 0.0:
        waiting = int(m[PENDING])
        if waiting == MOST_PENDING:
            return QUEUE_FULL
        place = QUEUE + N_WAITING * waiting
        m[place + Q_TIME] = x[TIME] + p[DEAD_TIME]
        m[place + Q_DEMAND] = demand
        m[place + Q_SLOPE] = slope
        m[PENDING] += 1.0
    else:
        take_demand(x, demand, slope)
    x[ASK_AT] = ask_again
    x[ASKED] += 1.0
    if x[CONTACTS] == 1.0 and math.isnan(x[CONTACT_TORQUE]):  # the start is in contact
        immediate = p[LAG] == 0.0 and p[RATE] == math.inf and p[DEAD_TIME] == 0.0
        x[CONTACT_TORQUE] = demand if immediate else x[U]
    return ASK


@compiled
def _run(step, p, parameters, sees, x, m, measured, state, command, segments, events, stages):  # type: ignore[no-untyped-def]
    while True:
        reason = advance(p, x, m, segments, events, stages)
        if reason != ASK:
            x[STATUS] = reason
            return reason
        measure(p, x, sees, measured)
        command[SLOPE] = 0.0
        step(parameters, measured, state, command)
        taken = obey(p, x, m, command[TORQUE], command[ASK_AGAIN], command[SLOPE])
        if taken != ASK:
            x[STATUS] = taken
            return taken
        for i in range(state.shape[0]):
            state[i] = command[NEW_STATE + i]


@compiled_as(types.int64(_STEP, _A, _A, types.int64, _A, _A, _A, _A, _A, _M, _M, _M))
def run(step, p, parameters, sees, x, m, measured, state, command, segments, events, stages):  # type: ignore[no-untyped-def]
    """One start to its end, or until a buffer is full: call again with larger ones."""
    return _run(step, p, parameters, sees, x, m, measured, state, command, segments, events, stages)


@compiled_as(types.void(_STEP, _M, _M, types.int64, types.boolean, _A, _M, _A, _A, _A, _A, _A, _A, _A, _M))
def run_many(  # type: ignore[no-untyped-def]
    step, p, parameters, sees, on_gap, until, results, x, m, measured, state, command, drive, own, nothing
):
    """Start i has row i of p, parameters and until (one row serves all); its x goes to results[i].

    The arrays from x on are scratch: the kernel itself allocates nothing.
    """
    for i in range(results.shape[0]):
        if i == 0 or p.shape[0] > 1:
            for j in range(N_P):
                drive[j] = p[i, j]
        if i == 0 or parameters.shape[0] > 1:
            for j in range(own.shape[0]):
                own[j] = parameters[i, j]
        for j in range(state.shape[0]):
            state[j] = 0.0
        m[MEMO_V] = math.nan
        m[PENDING] = 0.0
        begin(drive, x, until[i if until.shape[0] > 1 else 0], nothing)
        x[ASK_ON_GAP] = 1.0 if on_gap else 0.0
        _run(step, drive, own, sees, x, m, measured, state, command, nothing, nothing, nothing)
        for j in range(N_X):
            results[i, j] = x[j]
