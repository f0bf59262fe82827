"""A start, span after span under a controller, and many of them."""

from __future__ import annotations

import math

import numpy as np
from numba import types

from softstart.arrays import Matrix, Vector
from softstart.kernel.events import (
    FAINT, LOST, crossing, deviation_bound, next_event, peak_within, rounding_of_twist, set_line, value,
)  # fmt: skip
from softstart.kernel.guard import bounded, check, follow
from softstart.kernel.jit import as_record, compiled_as, inner, separately_compiled
from softstart.kernel.modes import begin_modes, handle, path_closed, release
from softstart.kernel.motor import (
    NEW_STATE, STEP_SIGNATURE, begin_torque, move_demand, next_in_queue, note_excess, own_time,
    sample, take_answer,
)  # fmt: skip
from softstart.kernel.records import (
    ANSWER, ASK, AT_EVENTS, AT_MACHINE, AT_MASSES, AT_SHAFTS, AT_SHAFT_NOTES, BEYOND, BUFFER_FULL, CURVE,
    ENDED, EVENT_LIMIT, LOWER, MEASURED, MEASURED_TYPE, MOST_MASSES, MOST_NOTED, NOTES, NOT_FINITE,
    NOT_LOCATED, NO_BETTER, NO_EVENT,
    NO_FAULT, N_NOTES, OF_MASS, OF_SHAFT, OPEN, PRESSED, SEES_SHAFT_TORQUE, SETTLE, SPANS_PER_EVENT,
    S_BRAKED, S_END, S_MASSES, S_PHI, S_REF, S_SLOPE, S_STAGE, S_START, S_U, TONE, TOO_LONG,
    TOO_STIFF, UNSOLVED, UPPER, WELDED, WORK, WORK_TYPE, Record,
)  # fmt: skip
from softstart.kernel.series import REACH, apply_modes, expand, expand_tones, find_piece, orders

_A = types.Array(types.float64, 1, "C")
_M = types.Array(types.float64, 2, "C")
_T = types.Array(types.float64, 3, "C")
STEP = types.FunctionType(STEP_SIGNATURE)
ACROSS = 1.0 / 64.0  # of a span, in which the load does not slow down and speed up again


@inner
def set_machine(
    work: Vector, machine: Vector, masses: Matrix, shafts: Matrix, curves: Matrix, tones: Matrix
) -> None:
    """Put what is given into the work of a start."""
    s = as_record(work, WORK)
    for j in range(machine.shape[0]):
        work[AT_MACHINE + j] = machine[j]
    s.n = masses.shape[0]
    s.at_motor = int(s.motor)
    s.at_load = int(s.load)
    s.path = min(s.at_motor, s.at_load)
    s.path_end = max(s.at_motor, s.at_load)
    s.motor_shaft = s.at_motor if s.at_load > s.at_motor or s.at_motor == 0 else s.at_motor - 1
    for i in range(s.n):
        for j in range(masses.shape[1]):
            work[AT_MASSES + MOST_MASSES * j + i] = masses[i, j]
        s.has_friction[i] = 1.0 if s.Mc[i] > 0.0 or s.friction[i] > 0.0 else 0.0
        s.points[i] = 0
    for k in range(s.n - 1):
        for j in range(shafts.shape[1]):
            work[AT_SHAFTS + MOST_MASSES * j + k] = shafts[k, j]
        if s.eta[k] != 1.0:  # a gear with losses rubs on the mass that it sits at
            s.has_friction[k + int(s.gear[k])] = 1.0
    s.curves = 0.0
    for row in range(curves.shape[0]):
        curve = as_record(curves[row], CURVE)
        if curve.mass >= 0.0:
            i = int(curve.mass)
            s.curves += 1.0
            s.points[i] = int(curve.points)
            s.by_angle[i] = curve.by_angle
            for k in range(s.points[i]):
                s.at[i, k] = curve.at[k]
                s.torque_at[i, k] = curve.torque[k]
    s.tones = tones.shape[0]
    s.tone_rate = 0.0
    for row in range(tones.shape[0]):
        s.tone_rate = max(s.tone_rate, as_record(tones[row], TONE).omega)


@inner
def begin_start(work: Vector, until: float, on_gap: bool) -> None:
    """The state at t = 0; until = inf ends the start one elastic period after the target speed."""
    s = as_record(work, WORK)
    for j in range(N_NOTES):
        work[j] = 0.0
    s.pending = 0.0
    s.beyond_limits = 0.0
    s.ask_at = s.command_since = s.begins_at
    s.ask_own = 0.0
    s.ask_on_gap = 1.0 if on_gap else 0.0
    s.demand_slope = 0.0
    s.sample_angle = 0.0
    s.sample_time = 0.0
    s.t_end = until if until == math.inf else min(until, s.longest)
    s.start_time = s.release_time = s.first_contact = s.impact_speed = math.nan
    s.contact_torque = s.stage_2_end = s.settled = s.overshoot = math.nan
    s.run = s.sense = s.toward = 1.0
    s.ends_at_target = s.still = 0.0
    s.slow = s.travel_end = math.nan
    s.watch.fault = s.watch.begun = 0.0
    s.highest_speed = s.w0[s.at_load]
    if s.regulated != 0.0 and s.band_low <= s.highest_speed <= s.band_high:
        s.settled = 0.0
    s.braked = 1.0 if s.release_at > 0.0 else 0.0
    s.noted = 0
    begin_modes(s)
    for i in range(s.n):  # the load mass begins at the angle 0
        s.angle[i] = 0.0
        for k in range(min(i, s.at_load), max(i, s.at_load)):
            s.angle[i] += s.theta[k] if i < s.at_load else -s.theta[k]
        s.passed[i] = 0
        s.offset[i] = 0.0
        s.incline[i] = 0.0
        find_piece(s, i)
    s.phi = 0.0
    s.u = s.u_ref = s.demand = s.initial_torque
    s.modes_changed = 1.0
    begin_stage(s)


@inner
def begin_stage(s: Record) -> None:
    """The first stage: a start in contact begins with stage 2."""
    s.stage = 1.0
    if path_closed(s, -1):
        s.stage = 2.0
        s.contacts = 1.0
        s.first_contact = 0.0
        s.impact_speed = 0.0
        # dw12 of [G](10), of the last shaft with a gap
        for k in range(s.path, s.path_end):
            if s.half_gap[k] > 0.0:
                s.impact_speed = s.side[k] * (s.w[k] - s.w[k + 1])


@inner
def begin_step(s: Record, begins: bool) -> None:
    """The next step of a duty, from the state that is left; the machine may have changed.

    Where a controller begins with it, time and angle of the load begin at 0.
    """
    for i in range(s.n):
        if s.has_friction[i] == 0.0:
            s.direction[i] = 1.0
        elif s.new_friction[i] != 0.0:
            s.direction[i] = np.sign(s.w[i])
    for k in range(s.n - 1):
        s.peak[k] = s.first_peak[k] = s.impulse[k] = 0.0
        s.peak_time[k] = s.time
    if begins:
        for i in range(int(s.pending)):
            s.due_time[i] -= s.time
        for k in range(s.n - 1):
            s.last_impact_time[k] -= s.time
            s.peak_time[k] = 0.0
        s.time = s.phi = s.sample_angle = s.sample_time = s.asked = s.ask_on_gap = s.ask_own = 0.0
        s.ask_at = s.command_since = s.begins_at
    s.start_time = s.release_time = s.first_contact = s.impact_speed = s.contact_torque = math.nan
    s.stage_2_end = s.settled = s.overshoot = s.slow = s.travel_end = math.nan
    s.excess = s.excess_time = s.gap_events = s.contacts = s.events = s.n_spans = s.n_events = 0.0
    s.reached = s.still = s.ends_at_target = s.beyond_limits = 0.0
    s.noted = 0
    s.modes_changed = 1.0
    if begins:
        begin_stage(s)
        s.contacts = 0.0


@inner
def watch_from_here(s: Record) -> None:
    """Whether load and masses are in their bands as a step begins."""
    s.highest_speed = s.toward * s.w[s.at_load]
    if s.band_low <= s.w[s.at_load] <= s.band_high:
        s.settled = s.time
    for i in range(s.n):
        s.still_since[i] = s.time if abs(s.w[i]) <= s.still else math.nan


@separately_compiled(types.float64(WORK_TYPE, *[types.int64] * 2, *[types.float64] * 4))
def leaves_band(s: Record, i: int, n: int, low: float, high: float, begin: float, end: float) -> float:
    """The first share of the span from `begin` on at which the speed of mass i leaves a band; -1 without."""
    speed = s.speed[i]
    set_line(s.f, speed, n, -low, 1.0)
    below = crossing(s, 0, n, begin, end)
    if high == math.inf:
        return below
    set_line(s.f, speed, n, high, -1.0)
    above = crossing(s, 0, n, begin, end)
    return above if below < 0.0 or 0.0 <= above < below else below


@separately_compiled(types.float64(WORK_TYPE, *[types.int64] * 2, *[types.float64] * 5))
def watch_band(
    s: Record, i: int, n: int, low: float, high: float, since: float, end: float, h: float
) -> float:
    """Since when the speed of mass i is in a band, up to a share of the span, if it was `since` before.

    NaN where it is not, LOST if an instant is not located. The span is not cut: what is watched keeps its
    bits.
    """
    speed = s.speed[i]
    deviation = deviation_bound(speed, n)
    if speed[0] < low or speed[0] > high:
        since = math.nan
    elif math.isnan(since):
        since = s.time  # after an impact the speed has jumped
    if low + deviation < speed[0] < high - deviation:
        return since
    x = 0.0
    while True:
        if math.isnan(since):
            if value(speed, n, x) < 0.5 * (low + high):
                set_line(s.f, speed, n, low, -1.0)
            else:
                set_line(s.f, speed, n, -high, 1.0)
            x = crossing(s, 0, n, x, end)
        else:
            x = leaves_band(s, i, n, low, high, x, end)
        if x < 0.0:
            return LOST if x == LOST else since
        since = s.time + x * h if math.isnan(since) else math.nan


@inner
def rest_since(s: Record) -> float:
    """Since when all masses are in the band of rest; NaN where one is not."""
    since = 0.0
    for i in range(s.n):
        if math.isnan(s.still_since[i]):
            return math.nan
        since = max(since, s.still_since[i])
    return since


@inner
def note_highest_speed(s: Record, n: int, end: float) -> bool:
    """Note the largest speed of the load up to the share `end` of the span; False if it is not located."""
    speed = s.speed[s.at_load]
    s.highest_speed = max(s.highest_speed, s.toward * value(speed, n, end))
    for o in range(n):
        s.f[o] = s.toward * (o + 1.0) * speed[o + 1]  # the acceleration
    x = 0.0
    while x < end:
        if value(s.f, n - 1, x) <= 0.0:  # it slows down: on to where it speeds up again
            x += ACROSS * end
            continue
        x = crossing(s, 0, n - 1, x, end)
        if x < 0.0:
            return x != LOST
        s.highest_speed = max(s.highest_speed, s.toward * value(speed, n, x))
        x += ACROSS * end
    return True


@separately_compiled(types.int64(WORK_TYPE, types.int64, types.float64, types.float64))
def watch_speed(s: Record, n: int, end: float, h: float) -> int:
    """Note since when the load speed is in its band, and its largest value, up to a share of the span.

    Of a stop, since when each mass is in the band of rest. 0 if an instant is not located, else 1.
    """
    load, located = s.at_load, True
    if s.still > 0.0:
        for i in range(s.n):
            s.still_since[i] = watch_band(s, i, n, -s.still, s.still, s.still_since[i], end, h)
            located = located and s.still_since[i] != LOST
    if math.isnan(s.band_low) or (s.regulated == 0.0 and math.isnan(s.start_time)):
        return 1 if located else 0
    highest = s.toward * s.speed[load, 0] + deviation_bound(s.speed[load], n)
    if s.regulated != 0.0 and highest > s.highest_speed:
        located = note_highest_speed(s, n, end) and located
    s.settled = watch_band(s, load, n, s.band_low, s.band_high, s.settled, end, h)
    return 1 if located and s.settled != LOST else 0


@inner
def note_span(s: Record, row: Vector) -> None:
    """What is needed to evaluate any instant of this span again, but for its end."""
    row[S_START] = s.time
    row[S_U] = s.u
    row[S_REF] = s.u_ref
    row[S_SLOPE] = s.slope
    row[S_PHI] = s.phi
    row[S_BRAKED] = s.braked
    row[S_STAGE] = s.stage
    for i in range(s.n):
        at = S_MASSES + OF_MASS * i
        row[at] = s.w[i]
        row[at + 1] = s.direction[i]
        row[at + 2] = s.angle[i]
        row[at + 3] = s.piece[i]
    for k in range(s.n - 1):
        at = S_MASSES + OF_MASS * s.n + OF_SHAFT * k
        row[at] = s.theta[k]
        row[at + 1] = s.mode[k]
        row[at + 2] = s.side[k]
        row[at + 3] = s.sign[k]


@separately_compiled(types.void(WORK_TYPE, types.int64, types.float64, types.float64))
def advance_state(s: Record, n: int, x: float, time: float) -> None:
    """The state after the share x of the span, `time` seconds later."""
    for i in range(s.n):
        s.w[i] = value(s.speed[i], n, x)
        if s.points[i] > 0:
            s.passed[i] = 0
            s.angle[i] = value(s.rotation[i], n, x)
    for k in range(s.n - 1):
        s.leading_zeros[k] = 0
        if s.mode[k] != PRESSED and s.mode[k] != WELDED:
            s.theta[k] = value(s.twist[k], n, x)
    s.phi = value(s.angle_u, n, x)
    s.u = value(s.torque_u, 1 if s.on_line != 0.0 else n, x)
    move_demand(s, time)
    s.time += time


@separately_compiled(types.float64(WORK_TYPE, types.int64, types.int64, *[types.float64] * 3))
def approach_acceleration(s: Record, k: int, n: int, x: float, h: float, side: float) -> float:
    """The relative acceleration of the masses beside shaft k towards the flank `side`, rad/s^2.

    Where it is lost in rounding the flank is reached because of what follows it in the series: it is 0 then.
    """
    twist = s.twist[k]
    noise = rounding_of_twist(s, k, h)
    if x == 0.0:
        noise = max(noise, FAINT * (deviation_bound(twist, n) - abs(twist[1]) - abs(twist[2])))
    total = 0.0
    for o in range(n, 1, -1):  # Horner's scheme for the second derivative at x
        total = total * x + o * (o - 1.0) * twist[o]
    return side * total / (h * h) if abs(total) > 2.0 * noise else 0.0


@inner
def note_events(work: Vector, events: Matrix) -> None:
    """Record what has been noted since the last span."""
    s = as_record(work, WORK)
    if events.shape[0] > 0:
        for i in range(s.noted):
            for j in range(events.shape[1]):
                events[int(s.n_events), j] = work[AT_EVENTS + MOST_NOTED * j + i]
            s.n_events += 1.0
    s.noted = 0


@inner
def expand_all(s: Record, tones: Matrix, h: float, n: int) -> None:
    """All coefficients of the span, those of exciting torques first."""
    if s.tones != 0.0:
        expand_tones(s, tones, h, n)
    expand(s, h, n)


@inner
def rate_of(s: Record) -> float:
    """An upper bound of all rates of the span, 1/s."""
    if s.modes_changed != 0.0:
        apply_modes(s)
    rate = max(s.rate_bound, s.tone_rate)
    return rate if s.on_line != 0.0 else max(rate, 1.0 / s.lag)


@inner
def last_instant(s: Record) -> float:
    """When the start ends, or is given up because its target speed is not reached."""
    if s.still > 0.0:
        since = rest_since(s)
        return s.t_end if math.isnan(since) else min(since + s.dwell, s.t_end)
    if s.regulated != 0.0 and s.t_end == math.inf:
        settled = max(s.settled, s.command_end) + s.dwell
        return s.time_limit if math.isnan(s.settled) else settled
    return s.time_limit if math.isnan(s.start_time) and s.t_end == math.inf else s.t_end


@inner
def stop_reason(s: Record, spans: Matrix, events: Matrix) -> int:
    """Why the start does not go on: ENDED, ASK, ...; -1 if it does. Answers that are due take effect."""
    if spans.shape[0] > 0 and (s.n_spans >= spans.shape[0] or s.n_events + MOST_NOTED >= events.shape[0]):
        return BUFFER_FULL
    if s.n_spans > SPANS_PER_EVENT * s.event_cap:  # recorded or not: each takes time
        return TOO_STIFF
    if s.time >= last_instant(s):
        note_excess(s)
        s.final_speed = s.w[s.at_load]
        s.overshoot = max(s.highest_speed / s.target - 1.0, 0.0) if s.regulated != 0.0 else math.nan
        s.reached = 0.0 if math.isnan(s.settled if s.regulated != 0.0 else s.start_time) else 1.0
        if s.stage == 2.0:
            s.stage_2_end = s.time
        if s.stage <= 2.0:
            for k in range(s.n - 1):
                s.first_peak[k] = s.peak[k]
        return ENDED if s.time < s.longest else TOO_LONG
    if s.give_up_time > 0.0 and math.isnan(s.settled if s.regulated != 0.0 else s.start_time):
        highest = s.w[s.at_load] + s.fastest_rise * (s.give_up_time - s.time)
        if highest < (s.band_low if s.regulated != 0.0 else s.target):
            return NO_BETTER
    while s.pending > 0.0 and s.time >= s.due_time[0]:
        next_in_queue(s)
    if s.time >= s.ask_at:
        return ASK if s.asked < s.event_cap else EVENT_LIMIT
    return -1


@inner
def horizon(s: Record) -> float:
    """The instant up to which nothing changes from outside."""
    until = min(s.ask_at, last_instant(s))
    if s.pending > 0.0:
        until = min(until, s.due_time[0])
    if s.braked != 0.0:
        until = min(until, s.release_at)
    return until


@compiled_as(types.int64(_A, _M, _M, _M))
def advance(work: Vector, tones: Matrix, spans: Matrix, events: Matrix) -> int:
    """Go on until the controller must be asked, the start has ended, or something stands in the way.

    `spans` and `events` are filled row by row; with no rows nothing is recorded.
    """
    s = as_record(work, WORK)
    while True:
        reason = stop_reason(s, spans, events)
        if reason >= 0:
            return reason
        begin_torque(s)
        if s.braked != 0.0 and s.time >= s.release_at:
            release(s)
            note_events(work, events)
        until = horizon(s)
        h = until - s.time
        cut = s.slew_end < h
        if cut:
            h = s.slew_end
        # no span is longer: in free flight it would reach to the time limit, and rounding depended on that
        if s.period > 0.0 and h > s.period:
            cut = True
            h = s.period
        # beyond three over the fastest rate the series would need more coefficients than there is room for
        rate = rate_of(s)
        if rate * h > REACH:
            cut = True
            h = REACH / rate
        n = orders(rate * h)
        expand_all(s, tones, h, n)
        event = next_event(s, h, n)
        where, x = s.event_place, s.event_share
        if event == UNSOLVED:
            return NOT_LOCATED
        for k in range(s.n - 1):
            if s.mode[k] != OPEN and s.mode[k] != BEYOND and peak_within(s, k, n, x, h) == 0:
                return NOT_LOCATED
            if 0.0 < s.give_up_torque < abs(s.peak[k]):
                return NO_BETTER
        if x > 0.0:
            if spans.shape[0] > 0:
                note_span(s, spans[int(s.n_spans)])
            watched = s.still > 0.0 or not math.isnan(s.band_low)
            if watched and watch_speed(s, n, x, h) == 0:
                return NOT_LOCATED
            advance_state(s, n, x, x * h)
            if spans.shape[0] > 0:
                spans[int(s.n_spans), S_END] = s.time
            s.n_spans += 1.0
        total = s.u  # one sum tells whether any state is no longer finite
        for i in range(s.n):
            total += s.w[i]
        if not math.isfinite(total):
            return NOT_FINITE
        if event == NO_EVENT:
            if not cut:  # exactly, not time + h
                s.time = until
            continue
        press = 0.0
        rest = 0.0
        if event in (UPPER, LOWER):
            press = approach_acceleration(s, where, n, x, h, 1.0 if event == UPPER else -1.0)
        elif event == SETTLE and s.restitution[where] < 1.0:
            # impacts at shrinking intervals: their sum is a geometric series in the restitution, as in [R]
            ratio = -s.twist[where, 1] / s.twist[where, 2]
            rest = h * ratio / (1.0 - s.restitution[where])
        gap = handle(s, event, where, press, rest, h) != 0
        if gap and s.ask_on_gap != 0.0 and s.time >= s.begins_at:
            s.ask_at, s.ask_own = s.time, s.time - s.begins_at
        note_events(work, events)
        if s.events > s.event_cap:
            return EVENT_LIMIT


@separately_compiled(types.float64(WORK_TYPE, types.int64))
def spring_torque(s: Record, k: int) -> float:
    """The torque of a shaft whose spring acts."""
    return float(s.stiff[k] * (s.theta[k] - s.spring_zero[k]) + s.damp[k] * (s.w[k] - s.w[k + 1]))


@inner
def torque_now(s: Record, k: int, tones: Matrix) -> float:
    """The torque of shaft k in the present state; of rigid joints as a span of no length has it."""
    mode = s.mode[k]
    if mode in (OPEN, BEYOND):
        return 0.0
    if s.modes_changed != 0.0:
        apply_modes(s)
    if mode in (PRESSED, WELDED):
        begin_torque(s)
        expand_all(s, tones, 0.0, orders(0.0))
        return float(s.torque[k, 0])
    return float(spring_torque(s, k))


@separately_compiled(types.float64(WORK_TYPE, MEASURED_TYPE, types.int64))
def check_sample(s: Record, m: Record, sees: int) -> float:
    """The fault that has been found in what is measured, 0 without."""
    return float(check(s.guard, s.watch, m, sees))


@separately_compiled(types.int64(WORK_TYPE, types.float64, types.float64, types.float64))
def follow_answer(s: Record, torque: float, ask_again: float, slope: float) -> int:
    """Take the answer of a guarded controller, or after a fault no torque."""
    if s.fault != NO_FAULT:
        ask_again = own_time(s) + s.guard.period
        return int(take_answer(s, bounded(0.0, s.u_min, s.u_max), ask_again, 0.0))
    follow(s.guard, s.watch, torque, ask_again, slope)
    return int(take_answer(s, torque, ask_again, slope))


@compiled_as(types.float64(_A, types.int64, _M, _A))
def measure(work: Vector, sees: int, tones: Matrix, measured: Vector) -> float:
    """What the controller sees now; returns the fault that has been found, 0 without."""
    s = as_record(work, WORK)
    seen = as_record(measured, MEASURED)
    sample(s, sees, seen)
    if sees & SEES_SHAFT_TORQUE:
        sign = 1.0 if s.at_motor <= s.motor_shaft else -1.0
        seen.shaft_torque = s.sense * sign * torque_now(s, s.motor_shaft, tones)
    if s.guard.period > 0.0:
        s.fault = check_sample(s, seen, sees)
    return float(s.fault)


@inner
def guarded_answer(s: Record, torque: float, ask_again: float, slope: float) -> int:
    """Take the controller's answer, or after a fault no torque; returns as `take_answer`."""
    if s.guard.period > 0.0:
        return int(follow_answer(s, torque, ask_again, slope))
    return int(take_answer(s, torque, ask_again, slope))


@compiled_as(types.int64(_A, types.float64, types.float64, types.float64))
def take_reply(work: Vector, torque: float, ask_again: float, slope: float) -> int:
    """Take the controller's answer; returns ASK, or why it cannot be taken."""
    return guarded_answer(as_record(work, WORK), torque, ask_again, slope)


@compiled_as(types.void(_A, _A))
def note_state(work: Vector, row: Vector) -> None:
    """The present state, as a span of no length."""
    s = as_record(work, WORK)
    note_span(s, row)
    row[S_END] = s.time


@compiled_as(types.void(_A, _A, _M, _M, _M, _M, types.float64, types.boolean))
def begin(
    work: Vector, machine: Vector, masses: Matrix, shafts: Matrix, curves: Matrix, tones: Matrix,
    until: float, on_gap: bool,
) -> None:  # fmt: skip
    """A start of this machine, at t = 0."""
    set_machine(work, machine, masses, shafts, curves, tones)
    begin_start(work, until, on_gap)


@compiled_as(types.void(_A, _A, _M, _M, _M, _M, types.boolean))
def go_on(
    work: Vector, machine: Vector, masses: Matrix, shafts: Matrix, curves: Matrix, tones: Matrix, begins: bool
) -> None:
    """The next step of a duty of this machine, changed or not; where a controller `begins`, at t = 0."""
    s = as_record(work, WORK)
    for i in range(s.n):
        s.new_friction[i] = 1.0 - s.has_friction[i]
    set_machine(work, machine, masses, shafts, curves, tones)
    begin_step(s, begins)


@compiled_as(types.void(_A))
def watch_step(work: Vector) -> None:
    """Begin to watch the bands that have been set for a step."""
    watch_from_here(as_record(work, WORK))


@compiled_as(types.int64(STEP, _A, types.int64, _A, _M, _M, _M, _A, _A, _A))
def run_start(  # type: ignore[no-untyped-def]
    step, parameters, sees, work, tones, spans, events, measured, state, command
) -> int:
    """One start from where it stands to its end, or until a buffer is full: call again with larger ones."""
    s = as_record(work, WORK)
    reply = as_record(command, ANSWER)
    while True:
        reason = advance(work, tones, spans, events)
        if reason == ASK:
            fault = measure(work, sees, tones, measured)
            reply.slope = 0.0
            if fault == NO_FAULT:
                step(parameters, measured, state, command)
            reason = guarded_answer(s, reply.torque, reply.ask_again, reply.slope)
        if reason != ASK:
            s.status = reason
            return reason
        for j in range(state.shape[0]):
            state[j] = command[NEW_STATE + j]


@compiled_as(
    types.void(
        STEP, _M, types.int64, types.boolean, types.float64, _M, _T, _T, _T, _M, _T, _A, _A, _A, _A,
    )
)  # fmt: skip
def run_many(  # type: ignore[no-untyped-def]
    step, parameters, sees, on_gap, until, machines, masses, shafts, curves, notes, shaft_notes, work,
    measured, state, command,
) -> None:  # fmt: skip
    """Start i has row i of machines, masses, shafts, curves and parameters (one row serves all).

    What is noted goes to notes[i] and shaft_notes[i]. The arrays from `work` on are scratch: the kernel
    allocates nothing.
    """
    s = as_record(work, WORK)
    nothing = curves[0, :0]
    for i in range(notes.shape[0]):
        for j in range(state.shape[0]):
            state[j] = 0.0
        begin(work, machines[i], masses[i], shafts[i], curves[i], nothing, until, on_gap)
        numbers = parameters[i if parameters.shape[0] > 1 else 0]
        run_start(step, numbers, sees, work, nothing, nothing, nothing, measured, state, command)
        for j in range(notes.shape[1]):
            notes[i, j] = work[j]
        for k in range(s.n - 1):
            for j in range(shaft_notes.shape[2]):
                shaft_notes[i, k, j] = work[AT_SHAFT_NOTES + MOST_MASSES * j + k]
        # the torque of a start goes on: whether the load keeps its speed is judged beyond the figures' end
        if not math.isnan(s.band_low) and s.regulated == 0.0 and s.status == ENDED and s.reached != 0.0:
            s.t_end = s.start_time + s.dwell
            if s.t_end > s.time:
                run_start(step, numbers, sees, work, nothing, nothing, nothing, measured, state, command)
                if s.status == ENDED:
                    as_record(notes[i], NOTES).settled = s.settled
