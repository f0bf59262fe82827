"""A start of a chain, span after span under a controller; and its record, read back at any instant."""

from __future__ import annotations

import math

import numpy as np
from numba import types
from numpy.typing import NDArray

from softstart.arrays import Vector
from softstart.chain.kernel_events import next_event, peak_within, value
from softstart.chain.kernel_modes import begin_modes, handle, path_closed
from softstart.chain.kernel_records import (
    CONTACT,
    DOUBLED,
    JOINED,
    LOWER,
    NO_EVENT,
    ORDERS,
    PRESSED,
    SETTLE,
    START_TYPE,
    UNSOLVED,
    UPPER,
    WELDED,
    Record,
    Start,
)  # fmt: skip
from softstart.chain.kernel_series import (
    REACH,
    expand,
    fastest_rate,
    find_piece,
    join_bodies,
    orders,
    set_piece,
)
from softstart.plant.exchange import (
    NEW_STATE,
    SEES_SHAFT_TORQUE,
    STEP_SIGNATURE,
    next_in_queue,
    note_excess,
    sample,
    take_answer,
)  # fmt: skip
from softstart.plant.jit import compiled, compiled_as, inlined
from softstart.plant.layout import (
    ANSWER,
    ASK,
    BUFFER_FULL,
    ENDED,
    EVENT_LIMIT,
    MEASURED,
    MOTION,
    NOT_FINITE,
    NOT_LOCATED,
    PLANT,
    STATE,
    Motion,
    Plant,
    State,
)
from softstart.plant.span import lag_is_slow, torque_after, torque_course

_A = types.Array(types.float64, 1, "C")
_M = types.Array(types.float64, 2, "C")
_STEP = types.FunctionType(STEP_SIGNATURE)
_WORDS, _ROWS = types.Array(types.int64, 1, "C"), types.Array(types.int64, 2, "C")
_ADVANCE = types.int64(START_TYPE)


@compiled
def begin(start: Start, until: float) -> None:
    """The state at t = 0."""
    m = start.m.view(MOTION)[0]
    for i in range(start.x.shape[0]):
        start.x[i] = 0.0
    x = start.x.view(STATE)[0]
    m.pending = 0.0
    m.over = 0.0
    x.t_end = until
    x.start_time = math.nan
    begin_modes(start.masses, start.shafts)
    join_bodies(start.masses, start.shafts)
    motor = start.place.motor
    load = start.place.load
    for k in range(min(motor, load), max(motor, load)):  # the load mass begins at the angle 0
        theta = start.shafts[k].theta
        x.phi2 += theta if motor < load else -theta
    for i in range(start.masses.size):
        mass = start.masses[i]
        mass.angle = 0.0
        for k in range(min(i, load), max(i, load)):
            theta = start.shafts[k].theta
            mass.angle += theta if i < load else -theta
        find_piece(mass)
    x.u = start.masses[motor].motor_torque0
    x.ref = x.u
    x.demand = x.u
    x.stage = 2.0 if path_closed(start, -1) else 1.0


@inlined
def record(start: Start, h: float) -> None:
    """What is needed to evaluate any instant of this span again."""
    x, m = start.x.view(STATE)[0], start.m.view(MOTION)[0]
    row = int(x.n_segments)
    span = start.spans[row]
    span.start = x.time
    span.end = x.time + h
    span.ua = m.ua
    span.ub = m.ub
    span.ue = m.ue
    span.u = x.u
    span.ref = x.ref
    span.phi = x.phi2
    for i in range(start.masses.size):
        mass, kept = start.masses[i], start.span_masses[row, i]
        kept.w = mass.w
        kept.direction = mass.direction
        if mass.points > 0:
            kept.angle = mass.angle
            kept.piece = mass.piece
    for k in range(start.shafts.size):
        shaft, noted = start.shafts[k], start.span_shafts[row, k]
        noted.theta = shaft.theta
        noted.mode = shaft.mode
        noted.side = shaft.side
        noted.sign = shaft.sign
    x.n_segments += 1.0


@inlined
def move_masses(start: Start, n: int, s: float) -> None:
    """Speeds, twists and the motor's angle at s on [0, 1]."""
    x = start.x.view(STATE)[0]
    masses, shafts, phi = start.masses, start.shafts, start.phi
    angle = phi[n]
    for mass in masses:
        mass.w = mass.speed[n]
    for shaft in shafts:
        if shaft.mode not in (PRESSED, WELDED):
            shaft.theta = shaft.twist[n]
    for o in range(n - 1, -1, -1):  # all polynomials at once: each alone waits for its last step
        angle = angle * s + phi[o]
        for mass in masses:
            mass.w = mass.w * s + mass.speed[o]
        for shaft in shafts:
            if shaft.mode not in (PRESSED, WELDED):
                shaft.theta = shaft.theta * s + shaft.twist[o]
    x.phi2 = angle
    if masses[0].curves != 0:
        for mass in masses:
            mass.passed = 0
            if mass.by_angle != 0:
                mass.angle = value(mass.turned, n, s)


@inlined
def move_motor(p: Plant, x: State, m: Motion, s: float) -> None:
    """Torque, slew limiter and demand after s seconds, as in the two-mass plant."""
    left = math.exp(-s / p.lag) if m.ue != 0.0 else 0.0
    x.u = torque_after(p, x, m, s, left)
    if x.demand_slope != 0.0:
        x.demand += x.demand_slope * s
    x.ref = x.demand if s >= m.slew_end else x.ref + m.ub * s


@inlined
def pressing(twist: Vector, n: int, s: float, h: float, side: float) -> float:
    """The relative acceleration towards the flank `side`, rad/s^2."""
    total = 0.0
    for o in range(n, 1, -1):
        total = total * s + o * (o - 1.0) * twist[o]
    return side * total / (h * h)


@inlined
def rate_of(start: Start) -> float:
    """An upper bound of all rates of the span, 1/s; the bodies are joined here."""
    p = start.p.view(PLANT)[0]
    m = start.m.view(MOTION)[0]
    join_bodies(start.masses, start.shafts)
    rate = fastest_rate(start)
    if m.ue != 0.0:
        rate = max(rate, 1.0 / p.lag)
    return rate


@compiled_as(_ADVANCE)
def advance(start: Start) -> int:
    """Go on until the controller must be asked, the start has ended, or something stands in the way."""
    p, x, m = start.p.view(PLANT)[0], start.x.view(STATE)[0], start.m.view(MOTION)[0]
    masses, shafts = start.masses, start.shafts
    recording = start.spans.size > 0
    while True:
        if recording and (
            x.n_segments >= start.spans.size or x.n_events + 2 * masses.size + 8 >= start.events.size
        ):
            return BUFFER_FULL
        t = x.time
        stop = x.t_end
        if math.isnan(x.start_time) and stop == math.inf:
            stop = p.time_limit
        if t >= stop:
            note_excess(p, x, m)
            return ENDED
        if m.pending > 0.0 and t >= m.due_time[0]:
            next_in_queue(x, m)
            continue
        if t >= x.ask_at:
            return ASK if x.asked < p.event_cap else EVENT_LIMIT
        torque_course(p, x, m)
        until = min(x.ask_at, stop)
        if m.pending > 0.0:
            until = min(until, m.due_time[0])
        h = until - t
        cut = m.slew_end < h
        if cut:
            h = m.slew_end
        if h > p.longest:
            cut = True
            h = p.longest
        rate = rate_of(start)
        if rate * h > REACH:
            cut = True
            h = REACH / rate
        n = orders(rate * h)
        expand(start, h, n)
        event, where, s = next_event(start, h, n)
        if event == UNSOLVED:
            return NOT_LOCATED
        for k in range(shafts.size):
            carries = shafts[k].mode in (CONTACT, DOUBLED, JOINED, PRESSED, WELDED)
            if carries and not peak_within(start, k, n, s, t, h):
                return NOT_LOCATED
        if s > 0.0:
            if recording:
                record(start, s * h)
            move_masses(start, n, s)
            move_motor(p, x, m, s * h)
            x.time = t + s * h
            for shaft in shafts:
                shaft.zeros = 0
        total = x.u
        for mass in masses:
            total += mass.w
        if not math.isfinite(total):
            return NOT_FINITE
        if event == NO_EVENT:
            if not cut:
                x.time = until
            continue
        press = 0.0
        rest = 0.0
        if event in (UPPER, LOWER):
            press = pressing(shafts[where].twist, n, s, h, 1.0 if event == UPPER else -1.0)
        elif event == SETTLE:
            struck = shafts[where]
            ratio = -struck.twist[1] / struck.twist[2]
            if struck.restitution < 1.0:
                rest = h * ratio / (1.0 - struck.restitution)
        of_gap = handle(start, event, where, press, rest, h)
        if of_gap and x.ask_on_gap != 0.0:
            x.ask_at = x.time
        if x.events > p.event_cap or x.n_segments > p.event_cap:
            return EVENT_LIMIT


@inlined
def torque_now(start: Start, k: int) -> float:
    """The torque of shaft k in the present state; of rigid joints as the last series has it."""
    shaft = start.shafts[k]
    if shaft.mode in (PRESSED, WELDED):
        return shaft.torque[0]
    if shaft.mode not in (CONTACT, DOUBLED, JOINED):
        return 0.0
    z = shaft.theta - shaft.side * shaft.half
    if shaft.mode == DOUBLED:
        return 2.0 * shaft.c * z
    return shaft.c * z + shaft.d * (start.masses[k].w - start.masses[k + 1].w)


@compiled
def measure_chain(start: Start, sees: int, measured: Vector) -> None:
    """What the controller sees now, by the sensors of the two-mass plant."""
    x = start.x.view(STATE)[0]
    motor = start.place.motor
    w_load = start.masses[start.place.load].w
    x.theta = 0.0
    x.w2 = w_load
    x.v = start.masses[motor].w - w_load
    seen = measured.view(MEASURED)[0]
    sample(start.p.view(PLANT)[0], x, sees, seen)
    if sees & SEES_SHAFT_TORQUE:
        k = start.place.motor_shaft
        if start.shafts[k].mode in (PRESSED, WELDED):  # what the joint carries: of a span of no length
            torque_course(start.p.view(PLANT)[0], x, start.m.view(MOTION)[0])
            join_bodies(start.masses, start.shafts)
            expand(start, 0.0, 0)
        sign = 1.0 if motor <= k else -1.0
        seen.shaft_torque = sign * torque_now(start, k)


@compiled_as(
    types.int64(
        types.FunctionType(_ADVANCE), _STEP, _M, _ROWS, _ROWS, _M, types.int64, types.boolean, types.float64,
        _M, _ROWS, START_TYPE, _WORDS, _WORDS, _A, _A, _A,
    )
)  # fmt: skip
def _starts(  # type: ignore[no-untyped-def]
    go_on, step, p, masses, shafts, parameters, sees, on_gap, until, results, ends, start, own_masses,
    own_shafts, measured, state, command,
):  # fmt: skip
    plant, x, m = start.p.view(PLANT)[0], start.x.view(STATE)[0], start.m.view(MOTION)[0]
    answer = command[:NEW_STATE].view(ANSWER)[0]
    own = parameters[0]
    reason = ASK
    for i in range(results.shape[0]):
        if p.shape[0] > 0:
            if parameters.shape[0] > 1:
                own = parameters[i]
            for j in range(start.p.shape[0]):
                start.p[j] = p[i, j]
            for j in range(start.m.shape[0]):
                start.m[j] = 0.0
            for j in range(own_masses.shape[0]):
                own_masses[j] = masses[i, j]
            for j in range(own_shafts.shape[0]):
                own_shafts[j] = shafts[i, j]
            for j in range(state.shape[0]):
                state[j] = 0.0
            begin(start, until)
            x.ask_on_gap = 1.0 if on_gap else 0.0
        while True:
            reason = go_on(start)
            if reason == ASK:
                measure_chain(start, sees, measured)
                answer.slope = 0.0
                step(own, measured, state, command)
                reason = take_answer(plant, x, m, answer.torque, answer.ask_again, answer.slope)
            if reason != ASK:
                x.status = reason
                break
            for j in range(state.shape[0]):
                state[j] = command[NEW_STATE + j]
        for j in range(start.x.shape[0]):
            results[i, j] = start.x[j]
        for j in range(ends.shape[1]):
            ends[i, j] = own_shafts[j]
    return reason


def run_many(  # type: ignore[no-untyped-def]
    step, p, masses, shafts, parameters, sees, on_gap, until, results, ends, start, measured, state, command
) -> int:
    """Start i has row i of p, masses, shafts and parameters (one row serves all); its x goes to results[i].

    Its shafts as they are at the end go to ends[i]. `start` and the arrays behind it are scratch. Without
    rows of p, `start` goes on from where it stands.
    """
    # records as words of 8 bytes: copying a record compiles to a line for each of its numbers; `advance` by
    # its address: else it would be compiled here a second time
    reason: int = _starts(
        advance, step, p, masses.view(np.int64), shafts.view(np.int64), parameters, sees, on_gap, until,
        results, ends.view(np.int64), start, start.masses.view(np.int64), start.shafts.view(np.int64),
        measured, state, command,
    )  # fmt: skip
    return reason


def run(step, parameters, sees, start, measured, state, command) -> int:  # type: ignore[no-untyped-def]
    """One start from where it stands to its end, or until a buffer is full: call again with larger ones."""
    row, masses, shafts = start.x.reshape(1, -1), start.masses[None, :0], start.shafts[None, :0]
    return run_many(
        step, row[:0], masses, shafts, parameters[None], sees, False, math.inf, row, shafts, start, measured,
        state, command,
    )  # fmt: skip


# the record -----------------------------------------------------------------------------------------


@compiled
def restore(start: Start, row: int) -> int:
    """The state at the start of a recorded span, and its series; returns how many coefficients."""
    x, m = start.x.view(STATE)[0], start.m.view(MOTION)[0]
    span = start.spans[row]
    x.time = span.start
    m.ua = span.ua
    m.ub = span.ub
    m.ue = span.ue
    m.slow_lag = 1.0 if lag_is_slow(start.p.view(PLANT)[0], m) else 0.0
    x.u = span.u
    x.ref = span.ref
    x.phi2 = span.phi
    for i in range(start.masses.size):
        mass, kept = start.masses[i], start.span_masses[row, i]
        mass.w = kept.w
        mass.direction = kept.direction
        if mass.points > 0:
            mass.angle = kept.angle
            set_piece(mass, kept.piece)
    for k in range(start.shafts.size):
        shaft, noted = start.shafts[k], start.span_shafts[row, k]
        shaft.theta = noted.theta
        shaft.mode = noted.mode
        shaft.side = noted.side
        shaft.sign = noted.sign
    h = span.end - span.start
    n = min(orders(rate_of(start) * h), ORDERS - 2)
    expand(start, h, n)
    return n


@compiled
def states_at(
    start: Start, index: NDArray[np.int64], times: Vector, motor: Record, w: Record, twist: Record, T: Record
) -> None:
    """The states at times[j] within span index[j]: angle and torque of the motor, speeds, twists, torques."""
    last = -1
    n = 0
    for j in range(times.shape[0]):
        if index[j] != last:
            last = index[j]
            n = restore(start, last)
        span = start.spans[last]
        s = min(max((times[j] - span.start) / (span.end - span.start), 0.0), 1.0)
        motor[j].phi = value(start.phi, n, s)
        motor[j].u = value(start.u, n, s)
        for i in range(start.masses.size):
            w[j, i] = value(start.masses[i].speed, n, s)
        for k in range(start.shafts.size):
            twist[j, k] = value(start.shafts[k].twist, n, s)
            T[j, k] = value(start.shafts[k].torque, n, s)


@compiled
def product(f: Vector, g: Vector, n: int) -> float:
    """The integral of f g over [0, 1]."""
    total = 0.0
    for i in range(n + 1):
        inner = 0.0
        for j in range(n + 1):
            inner += g[j] / (i + j + 1.0)
        total += f[i] * inner
    return total


@compiled
def work_of(start: Start, works: Record) -> None:
    """Work over all recorded spans, by exact quadrature of their series, into `works`, an array of one."""
    work = works[0]
    f, g = start.f, start.g
    for row in range(start.spans.size):
        n = restore(start, row)
        span = start.spans[row]
        h = span.end - span.start
        of_motor = h * product(start.u, start.masses[start.place.motor].speed, n)
        work.motor += of_motor
        exciting = -of_motor
        for mass in start.masses:
            speed = mass.speed
            ground = 0.0
            if mass.ground != 0.0:
                ground = h * mass.ground * product(speed, speed, n)
            turned = speed[0]
            for o in range(1, n + 1):
                turned += speed[o] / (o + 1.0)
            load = h * mass.direction * mass.Mc * turned + h * mass.active * turned
            if mass.points > 0:
                course = mass.turned if mass.by_angle != 0 else speed
                load += h * (mass.offset * turned + mass.slope * product(course, speed, n))
            work.ground += ground
            work.load += load
            exciting += h * product(mass.outside, speed, n) + ground + load
        work.exciting += exciting
        for k in range(start.shafts.size):
            shaft = start.shafts[k]
            if shaft.mode not in (CONTACT, DOUBLED, JOINED):
                continue
            before, after = start.masses[k].speed, start.masses[k + 1].speed
            for o in range(n + 1):
                f[o] = shaft.torque[o] - shaft.c * shaft.twist[o]
                g[o] = before[o] - after[o]
            f[0] += shaft.c * shaft.side * shaft.half
            work.shafts += h * product(f, g, n)
            if shaft.eta != 1.0:
                if shaft.before != 1.0:
                    work.gears += h * (shaft.before - 1.0) * product(shaft.torque, before, n)
                if shaft.after != 1.0:
                    work.gears += h * (1.0 - shaft.after) * product(shaft.torque, after, n)
