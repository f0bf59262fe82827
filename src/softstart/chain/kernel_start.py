"""A start of a chain: span after span under a controller."""

from __future__ import annotations

import math

from numba import types

from softstart.chain import kernel_layout as at
from softstart.chain.kernel_events import next_event
from softstart.chain.kernel_layout import (
    CONTACT,
    DIRECTION,
    DOUBLED,
    JOINED,
    LOAD_MASS,
    MASK,
    MODE,
    MOTOR,
    MOTOR_SHAFT,
    PHI_LINE,
    PRESSED,
    SIDE,
    SPEED,
    THETA,
    TORQUE,
    TWIST,
    WELDED,
    Cube,
    Matrix,
    Vector,
    W,
)
from softstart.chain.kernel_modes import begin_modes, handle, path_closed
from softstart.chain.kernel_peaks import peak_within
from softstart.chain.kernel_roots import value
from softstart.chain.kernel_series import REACH, expand, fastest_rate, join_bodies, orders
from softstart.plant.advance import next_in_queue
from softstart.plant.jit import compiled, compiled_as
from softstart.plant.layout import (
    ASK,
    ASK_AT,
    ASK_ON_GAP,
    ASKED,
    BUFFER_FULL,
    DEMAND,
    DEMAND_SLOPE,
    ENDED,
    EVENT_CAP,
    EVENT_LIMIT,
    EVENTS,
    LAG,
    MOTION,
    N_EVENTS,
    N_SEGMENTS,
    NOT_FINITE,
    NOT_LOCATED,
    PENDING,
    PHI2,
    PLANT,
    Q_TIME,
    QUEUE,
    REF,
    SLEW_END,
    STAGE,
    START_TIME,
    STATE,
    STATUS,
    T_END,
    TIME,
    TIME_LIMIT,
    UA,
    UB,
    UE,
    W2,
    U,
    V,
)
from softstart.plant.layout import THETA as NO_THETA
from softstart.plant.span import torque_course
from softstart.plant.start import (
    ASK_AGAIN,
    M_SHAFT_TORQUE,
    NEW_STATE,
    SEES_SHAFT_TORQUE,
    SLOPE,
    STEP_SIGNATURE,
    measure,
    obey,
)
from softstart.plant.start import (
    TORQUE as DEMANDED,
)

_A = types.Array(types.float64, 1, "C")
_M = types.Array(types.float64, 2, "C")
_C = types.Array(types.float64, 3, "C")
_STEP = types.FunctionType(STEP_SIGNATURE)


@compiled
def begin(x: Vector, m: Vector, place: Vector, masses: Matrix, shafts: Matrix, mass: Matrix, shaft: Matrix,
          until: float) -> None:  # fmt: skip
    """The state at t = 0."""
    for i in range(x.shape[0]):
        x[i] = 0.0
    m[PENDING] = 0.0
    x[T_END] = until
    x[START_TIME] = math.nan
    begin_modes(masses, shafts, mass, shaft)
    join_bodies(masses, shafts, mass, shaft)
    motor = int(place[MOTOR])
    load = int(place[LOAD_MASS])
    for k in range(min(motor, load), max(motor, load)):  # the load mass begins at the angle 0
        x[PHI2] += shaft[k, THETA] if motor < load else -shaft[k, THETA]
    x[STAGE] = 2.0 if path_closed(place, shaft, -1) else 1.0


@compiled
def record(x: Vector, m: Vector, mass: Matrix, shaft: Matrix, h: float, segments: Matrix) -> None:
    """What is needed to evaluate any instant of this span again."""
    row = segments[int(x[N_SEGMENTS])]
    row[at.S_START] = x[TIME]
    row[at.S_END] = x[TIME] + h
    row[at.S_UA] = m[UA]
    row[at.S_UB] = m[UB]
    row[at.S_UE] = m[UE]
    row[at.S_PHI] = x[PHI2]
    j = at.S_MASS
    for i in range(mass.shape[0]):
        row[j] = mass[i, W]
        row[j + 1] = mass[i, DIRECTION]
        j += 2
    for k in range(shaft.shape[0]):
        row[j] = shaft[k, THETA]
        row[j + 1] = shaft[k, MODE]
        row[j + 2] = shaft[k, SIDE]
        row[j + 3] = shaft[k, at.SIGN]
        j += at.OF_SHAFT
    x[N_SEGMENTS] += 1.0


@compiled
def move_masses(
    x: Vector, mass: Matrix, shaft: Matrix, series: Cube, lines: Matrix, n: int, s: float
) -> None:
    """Speeds, twists and the motor's angle at s on [0, 1]."""
    for i in range(mass.shape[0]):
        mass[i, W] = value(series[SPEED, i], n, s)
    for k in range(shaft.shape[0]):
        if shaft[k, MODE] != PRESSED and shaft[k, MODE] != WELDED:
            shaft[k, THETA] = value(series[TWIST, k], n, s)
    x[PHI2] = value(lines[PHI_LINE], n, s)


@compiled
def move_motor(p: Vector, x: Vector, m: Vector, s: float) -> None:
    """Torque, slew limiter and demand after s seconds, as in the two-mass plant."""
    left = math.exp(-s / p[LAG]) if m[UE] != 0.0 else 0.0
    x[U] = m[UA] + m[UB] * s + m[UE] * left
    if x[DEMAND_SLOPE] != 0.0:
        x[DEMAND] += x[DEMAND_SLOPE] * s
    x[REF] = x[DEMAND] if s >= m[SLEW_END] else x[REF] + m[UB] * s


@compiled
def pressing(series: Cube, k: int, n: int, s: float, h: float, side: float) -> float:
    """The relative acceleration towards the flank `side` of shaft k, rad/s^2."""
    total = 0.0
    for o in range(n, 1, -1):
        total = total * s + o * (o - 1.0) * series[TWIST, k, o]
    return side * total / (h * h)


@compiled
def advance(p: Vector, x: Vector, m: Vector, place: Vector, masses: Matrix, shafts: Matrix, tones: Matrix,
            mass: Matrix, shaft: Matrix, series: Cube, lines: Matrix, segments: Matrix,
            events: Matrix) -> int:  # fmt: skip
    """Go on until the controller must be asked, the start has ended, or something stands in the way."""
    recording = segments.shape[0] > 0
    while True:
        if recording and (
            x[N_SEGMENTS] >= segments.shape[0] or x[N_EVENTS] + 2 * masses.shape[0] + 8 >= events.shape[0]
        ):
            return BUFFER_FULL
        t = x[TIME]
        stop = x[T_END]
        if math.isnan(x[START_TIME]) and stop == math.inf:
            stop = p[TIME_LIMIT]
        if t >= stop:
            return ENDED
        if m[PENDING] > 0.0 and t >= m[QUEUE + Q_TIME]:
            next_in_queue(x.view(STATE)[0], m.view(MOTION)[0])
            continue
        if t >= x[ASK_AT]:
            return ASK if x[ASKED] < p[EVENT_CAP] else EVENT_LIMIT
        torque_course(p.view(PLANT)[0], x.view(STATE)[0], m.view(MOTION)[0])
        until = min(x[ASK_AT], stop)
        if m[PENDING] > 0.0:
            until = min(until, m[QUEUE + Q_TIME])
        h = until - t
        cut = m[SLEW_END] < h
        if cut:
            h = m[SLEW_END]
        join_bodies(masses, shafts, mass, shaft)
        rate = fastest_rate(masses, shafts, tones, mass, shaft)
        if m[UE] != 0.0:
            rate = max(rate, 1.0 / p[LAG])
        if rate * h > REACH:
            cut = True
            h = REACH / rate
        n = orders(rate * h)
        expand(p, x, m, place, masses, shafts, tones, mass, shaft, series, lines, h, n)
        event, where, s = next_event(p, x, place, masses, shafts, mass, shaft, series, lines, h, n)
        if event == at.UNSOLVED:
            return NOT_LOCATED
        for k in range(shaft.shape[0]):
            carries = shaft[k, MODE] in (CONTACT, DOUBLED, JOINED, PRESSED, WELDED)
            if carries and not peak_within(shaft, series, lines, k, n, s, t, h):
                return NOT_LOCATED
        if s > 0.0:
            if recording:
                record(x, m, mass, shaft, s * h, segments)
            move_masses(x, mass, shaft, series, lines, n, s)
            move_motor(p, x, m, s * h)
            x[TIME] = t + s * h
            for k in range(shaft.shape[0]):
                shaft[k, MASK] = 0.0
        total = x[U]
        for i in range(mass.shape[0]):
            total += mass[i, W]
        if not math.isfinite(total):
            return NOT_FINITE
        if event == at.NO_EVENT:
            if not cut:
                x[TIME] = until
            continue
        press = 0.0
        rest = 0.0
        if event in (at.UPPER, at.LOWER):
            press = pressing(series, where, n, s, h, 1.0 if event == at.UPPER else -1.0)
        elif event == at.SETTLE:
            ratio = -series[TWIST, where, 1] / series[TWIST, where, 2]
            if shafts[where, at.RESTITUTION] < 1.0:
                rest = h * ratio / (1.0 - shafts[where, at.RESTITUTION])
        of_gap = handle(p, x, place, masses, shafts, mass, shaft, event, where, press, rest, h, events)
        if of_gap and x[ASK_ON_GAP] != 0.0:
            x[ASK_AT] = x[TIME]
        if x[EVENTS] > p[EVENT_CAP]:
            return EVENT_LIMIT


@compiled
def torque_now(shafts: Matrix, mass: Matrix, shaft: Matrix, series: Cube, k: int) -> float:
    """The torque of shaft k in the present state; of rigid joints as the last series has it."""
    mode = shaft[k, MODE]
    if mode in (PRESSED, WELDED):
        return series[TORQUE, k, 0]
    if mode not in (CONTACT, DOUBLED, JOINED):
        return 0.0
    z = shaft[k, THETA] - shaft[k, SIDE] * shafts[k, at.HALF]
    if mode == DOUBLED:
        return 2.0 * shafts[k, at.C] * z
    return shafts[k, at.C] * z + shafts[k, at.D] * (mass[k, W] - mass[k + 1, W])


@compiled
def look(p: Vector, x: Vector, m: Vector, sees: int, place: Vector, masses: Matrix, shafts: Matrix,
         tones: Matrix, mass: Matrix, shaft: Matrix, series: Cube, lines: Matrix,
         measured: Vector) -> None:  # fmt: skip
    """What the controller sees now, by the sensors of the two-mass plant."""
    motor = int(place[MOTOR])
    load = int(place[LOAD_MASS])
    x[NO_THETA] = 0.0
    x[W2] = mass[load, W]
    x[V] = mass[motor, W] - mass[load, W]
    measure(p, x, sees, measured)
    if sees & SEES_SHAFT_TORQUE:
        k = int(place[MOTOR_SHAFT])
        if (
            shaft[k, MODE] == PRESSED or shaft[k, MODE] == WELDED
        ):  # what the joint carries: of a span of no length
            torque_course(p.view(PLANT)[0], x.view(STATE)[0], m.view(MOTION)[0])
            join_bodies(masses, shafts, mass, shaft)
            expand(p, x, m, place, masses, shafts, tones, mass, shaft, series, lines, 0.0, 0)
        sign = 1.0 if motor <= k else -1.0
        measured[M_SHAFT_TORQUE] = sign * torque_now(shafts, mass, shaft, series, k)


@compiled_as(
    types.int64(_STEP, _A, _A, types.int64, _A, _A, _A, _A, _A, _A, _M, _M, _M, _M, _M, _C, _M, _M, _M)
)
def run(  # type: ignore[no-untyped-def]
    step, p, parameters, sees, x, m, measured, state, command, place, masses, shafts, tones, mass, shaft,
    series, lines, segments, events,
):  # fmt: skip
    """One start to its end, or until a buffer is full: call again with larger ones."""
    while True:
        reason = advance(p, x, m, place, masses, shafts, tones, mass, shaft, series, lines, segments, events)
        if reason != ASK:
            x[STATUS] = reason
            return reason
        look(p, x, m, sees, place, masses, shafts, tones, mass, shaft, series, lines, measured)
        command[SLOPE] = 0.0
        step(parameters, measured, state, command)
        taken = obey(p, x, m, command[DEMANDED], command[ASK_AGAIN], command[SLOPE])
        if taken != ASK:
            x[STATUS] = taken
            return taken
        for i in range(state.shape[0]):
            state[i] = command[NEW_STATE + i]
