"""Any instant of a recorded start, its work, stages and turning points, from its spans: no samples."""

from __future__ import annotations

import math

import numpy as np
from numba import types
from numpy.typing import NDArray

from softstart.arrays import Matrix, Vector
from softstart.kernel.events import crossing, peak_within, set_line, value
from softstart.kernel.jit import compiled_as, inner, as_record
from softstart.kernel.motor import along_line
from softstart.kernel.records import (
    BEYOND, BUFFER_FULL, CONTACT, DOUBLED, ENDED, JOINED, NOT_LOCATED, OF_MASS, OF_SHAFT, OPEN, ORDERS,
    S_BRAKED, S_END, S_MASSES, S_PHI, S_REF, S_SLOPE, S_STAGE, S_START, S_U, WORK, Record,
)  # fmt: skip
from softstart.kernel.series import orders, set_piece
from softstart.kernel.start import STEP, begin, expand_all, rate_of, run_start

_A = types.Array(types.float64, 1, "C")
_I = types.Array(types.int64, 1, "C")
_M = types.Array(types.float64, 2, "C")
_T = types.Array(types.float64, 3, "C")


@inner
def restore(s: Record, tones: Matrix, spans: Matrix, row: int) -> int:
    """The state at the start of a recorded span, and its series; returns how many coefficients."""
    span = spans[row]
    s.time = span[S_START]
    s.u = span[S_U]
    s.u_ref = span[S_REF]
    s.slope = span[S_SLOPE]
    s.phi = span[S_PHI]
    s.braked = span[S_BRAKED]
    s.stage = span[S_STAGE]
    for i in range(s.n):
        at = S_MASSES + OF_MASS * i
        s.w[i] = span[at]
        s.direction[i] = span[at + 1]
        s.angle[i] = span[at + 2]
        if s.points[i] > 0:
            set_piece(s, i, int(span[at + 3]))
    for k in range(s.n - 1):
        at = S_MASSES + OF_MASS * s.n + OF_SHAFT * k
        s.theta[k] = span[at]
        s.mode[k] = int(span[at + 1])
        s.side[k] = span[at + 2]
        s.sign[k] = span[at + 3]
    s.modes_changed = 1.0
    along_line(s)
    h = span[S_END] - span[S_START]
    n = min(orders(rate_of(s) * h), ORDERS - 2)
    expand_all(s, tones, h, n)
    return n


@compiled_as(types.void(_A, _M, _M, _I, _A, _M, _M, _M, _M))
def states_at(
    work: Vector, tones: Matrix, spans: Matrix, index: NDArray[np.int64], times: Vector,
    motor: Matrix, w: Matrix, twist: Matrix, T: Matrix,
) -> None:  # fmt: skip
    """The states at times[j] within span index[j]: load angle, motor torque, speeds, twists, torques."""
    s = as_record(work, WORK)
    last = -1
    n = 0
    for j in range(times.shape[0]):
        if index[j] != last:
            last = index[j]
            n = restore(s, tones, spans, last)
        start, end = spans[last, S_START], spans[last, S_END]
        x = min(max((times[j] - start) / (end - start), 0.0), 1.0)
        motor[j, 0] = value(s.angle_u, n, x)
        motor[j, 1] = value(s.torque_u, n, x)
        for i in range(s.n):
            w[j, i] = value(s.speed[i], n, x)
        for k in range(s.n - 1):
            twist[j, k] = value(s.twist[k], n, x)
            T[j, k] = value(s.torque[k], n, x)


@compiled_as(
    types.int64(
        STEP, _M, types.int64, types.boolean, types.float64, _A, _M, _M, _M, _M, _A, _M, _M, _A, _I, _M,
        _T, _M, _T, _A, _A, _A,
    )
)  # fmt: skip
def states_of_each(  # type: ignore[no-untyped-def]
    step, parameters, sees, on_gap, until, machine, masses, shafts, curves, tones, work, spans, events,
    times, index, motor, w, twist, T, measured, state, command,
) -> int:  # fmt: skip
    """Speeds and shaft torques of one machine at rising times, under each row of a controller's parameters.

    Returns ENDED, or BUFFER_FULL: call again with larger buffers.
    """
    s = as_record(work, WORK)
    for r in range(parameters.shape[0]):
        state[:] = 0.0
        begin(work, machine, masses, shafts, curves, tones, until, on_gap)
        reason = run_start(step, parameters[r], sees, work, tones, spans, events, measured, state, command)
        if reason == BUFFER_FULL:
            return BUFFER_FULL
        row, last = 0, int(s.n_spans) - 1
        for j in range(times.shape[0]):
            while row < last and spans[row + 1, S_START] <= times[j]:
                row += 1
            index[j] = row
        states_at(work, tones, spans, index, times, motor, w[r], twist, T[r])
    return ENDED


INVERSE = 1.0 / np.arange(1.0, 2.0 * ORDERS + 2.0)  # of n at n - 1


@inner
def product(f: Vector, g: Vector, n: int, scratch: Vector) -> float:
    """The integral of f g over [0, 1]."""
    last = n
    while last > 0 and f[last] == 0.0:  # a torque on a line has two coefficients
        last -= 1
    for i in range(last + 1):
        scratch[i] = 0.0
    for j in range(n + 1):
        for i in range(last + 1):
            scratch[i] += g[j] * INVERSE[i + j]
    total = 0.0
    for i in range(last + 1):
        total += f[i] * scratch[i]
    return total


@inner
def spring_energy(s: Record) -> float:
    """What the springs that act hold, J."""
    total = 0.0
    for k in range(s.n - 1):
        if s.mode[k] == CONTACT or s.mode[k] == DOUBLED or s.mode[k] == JOINED:
            z = s.theta[k] - s.side[k] * s.half_gap[k]
            total += 0.5 * s.c[k] * z * z
    return total


@compiled_as(types.void(_A, _M, _M, _A))
def work_of(work: Vector, tones: Matrix, spans: Matrix, into: Vector) -> None:
    """Work over all recorded spans but the last, by exact quadrature of their series, and what is stored.

    The last span has no length: it is the state at the end. Into motor, exciting
    torques, loads, friction and damping to the ground, shafts, gears, and change of the
    elastic energy. Flanks may part while the spring is still loaded, and meet again: that energy goes, or
    comes, and is counted with the shafts.
    """
    s = as_record(work, WORK)
    rows = spans.shape[0] - 1
    restore(s, tones, spans, rows)
    stored = spring_energy(s)  # at the end
    f, g, scratch = s.f, s.net_torque[0], s.net_torque[1]
    after = stored
    elastic = stored
    for row in range(rows - 1, -1, -1):
        n = restore(s, tones, spans, row)
        h = spans[row, S_END] - spans[row, S_START]
        into[0] += h * product(s.torque_u, s.speed[s.at_motor], n, scratch)
        for i in range(s.n):
            speed = s.speed[i]
            turned = speed[0]
            for o in range(1, n + 1):
                turned += speed[o] / (o + 1.0)
            if s.tones != 0.0:
                into[1] += h * product(s.exciting_torque[i], speed, n, scratch)
            into[1] += h * s.mean[i] * turned
            into[2] += h * (s.direction[i] * s.Mc[i] + s.active[i]) * turned
            if s.points[i] > 0:
                series = s.rotation[i] if s.by_angle[i] != 0.0 else speed
                into[2] += h * (s.offset[i] * turned + s.incline[i] * product(series, speed, n, scratch))
            into[3] += h * s.direction[i] * s.friction[i] * turned
            if s.ground[i] != 0.0:
                into[3] += h * s.ground[i] * product(speed, speed, n, scratch)
        begin = spring_energy(s)
        for k in range(s.n - 1):
            if s.mode[k] != CONTACT and s.mode[k] != DOUBLED and s.mode[k] != JOINED:
                continue
            for o in range(n + 1):
                f[o] = s.torque[k, o] - s.c[k] * s.twist[k, o]
                g[o] = s.speed[k, o] - s.speed[k + 1, o]
            f[0] += s.c[k] * s.spring_zero[k]
            into[4] += h * product(f, g, n, scratch)
            if s.share_before[k] != 1.0:
                into[5] += h * (s.share_before[k] - 1.0) * product(s.torque[k], s.speed[k], n, scratch)
            if s.share_after[k] != 1.0:
                into[5] += h * (1.0 - s.share_after[k]) * product(s.torque[k], s.speed[k + 1], n, scratch)
            s.theta[k] = value(s.twist[k], n, 1.0)
        into[4] += spring_energy(s) - after  # of the springs that act in this span, beside the next one
        after = begin
        elastic = begin
    into[6] = stored - elastic


@compiled_as(types.int64(_A, _M, _M, _M))
def stage_peaks(work: Vector, tones: Matrix, spans: Matrix, into: Matrix) -> int:
    """A row for each stage: its number, start, end, then largest torque and its instant for each shaft.

    Returns ENDED, or why it cannot be computed. Stages that take no time have no row.
    """
    s = as_record(work, WORK)
    at = -1
    for row in range(spans.shape[0]):
        if row == 0 or spans[row, S_STAGE] != spans[row - 1, S_STAGE]:
            at += 1
            if at >= into.shape[0]:
                return BUFFER_FULL
            into[at, 0] = spans[row, S_STAGE]
            into[at, 1] = spans[row, S_START]
            for k in range(s.n - 1):
                s.peak[k] = 0.0
                s.peak_time[k] = spans[row, S_START]
        n = restore(s, tones, spans, row)
        h = spans[row, S_END] - spans[row, S_START]
        into[at, 2] = spans[row, S_END]
        for k in range(s.n - 1):
            if s.mode[k] != OPEN and s.mode[k] != BEYOND and peak_within(s, k, n, 1.0, h) == 0:
                return NOT_LOCATED
            into[at, 3 + 2 * k] = s.peak[k]
            into[at, 4 + 2 * k] = s.peak_time[k]
    return ENDED


@compiled_as(types.float64(_A, _M, _M, types.float64, types.float64))
def load_settles(work: Vector, tones: Matrix, spans: Matrix, begin: float, floor: float) -> float:
    """From when on, not before `begin`, the load speed is not below `floor`; NaN if it is at the end."""
    s = as_record(work, WORK)
    settled, above = begin, True
    for row in range(spans.shape[0]):
        start, end = spans[row, S_START], spans[row, S_END]
        if end <= begin:
            continue
        n = restore(s, tones, spans, row)
        x = max(0.0, (begin - start) / (end - start))
        speed = s.speed[s.at_load]
        while True:
            set_line(s.f, speed, n, -floor if above else floor, 1.0 if above else -1.0)
            x = crossing(s, 0, n, x, 1.0)
            if x < 0.0:
                break
            above = not above
            settled = start + x * (end - start)
    return settled if above else math.nan


@compiled_as(types.float64(_A, _M, _M, types.int64, types.float64, types.float64))
def torque_settles(
    work: Vector, tones: Matrix, spans: Matrix, k: int, begin: float, limit: float
) -> float:  # fmt: skip
    """From when on the torque of shaft k stays within `limit` of its mean; NaN if it is not at the end.

    The mean is what it carries while all masses speed up alike under the torques of the instant.
    """
    s = as_record(work, WORK)
    J = 0.0
    for i in range(s.n):
        J += s.J[i]
    settled, within, sign = begin, True, 1.0
    away = s.net_torque[0]
    for row in range(spans.shape[0]):
        start, end = spans[row, S_START], spans[row, S_END]
        if end <= begin:
            continue
        n = restore(s, tones, spans, row)
        share = 0.0
        for i in range(k + 1):
            share += s.J[i] / J
        for o in range(n + 1):
            before, every = 0.0, 0.0
            for i in range(s.n):
                q = -s.ground[i] * s.speed[i, o] + (s.constant_torque[i] if o == 0 else 0.0)
                q += s.torque_u[o] if i == s.at_motor else 0.0
                q += s.exciting_torque[i, o] if s.tones != 0.0 else 0.0
                every += q
                before += q if i <= k else 0.0
            s.f[o] = s.torque[k, o] - (before - share * every)
        for o in range(n + 1):
            away[o] = s.f[o]
        x = max(0.0, (begin - start) / (end - start))
        offset = value(away, n, x)
        if within and abs(offset) > limit:
            within, sign = False, math.copysign(1.0, offset)
        while True:
            if within:
                set_line(s.f, away, n, limit, -1.0)
                upper = crossing(s, 0, n, x, 1.0)
                set_line(s.f, away, n, limit, 1.0)
                lower = crossing(s, 0, n, x, 1.0)
                sign = -1.0 if upper < 0.0 or 0.0 <= lower < upper else 1.0
                x = lower if sign < 0.0 else upper
            else:
                set_line(s.f, away, n, -limit, sign)
                x = crossing(s, 0, n, x, 1.0)
            if x < 0.0:
                break
            within = not within
            settled = start + x * (end - start)
    return settled if within else math.nan


@inner
def add_turning_point(kept: Vector, points: Matrix, time: float, torque: float, still: float) -> None:
    """The next value of T; kept = (number of points, direction, time and torque of what may be the next)."""
    n = int(kept[0])
    if n >= points.shape[0]:
        return
    away = torque - kept[3]
    if kept[1] == 0.0:
        if n == 0:
            kept[2], kept[3] = time, torque
            points[0, 0], points[0, 1] = time, torque
            kept[0] = 1.0
        elif abs(away) > still:
            kept[1] = 1.0 if away > 0.0 else -1.0
            kept[2], kept[3] = time, torque
    elif away * kept[1] > 0.0:
        kept[2], kept[3] = time, torque
    elif abs(away) > still:
        points[n, 0], points[n, 1] = kept[2], kept[3]
        kept[0] = n + 1.0
        kept[1] = -kept[1]
        kept[2], kept[3] = time, torque


@compiled_as(types.int64(_A, _M, _M, types.int64, types.float64, _A, _M))
def turning_points(
    work: Vector, tones: Matrix, spans: Matrix, k: int, still: float, kept: Vector,
    points: Matrix,
) -> int:  # fmt: skip
    """Times and values of the torque of shaft k at its first instant, at all its reversals, and at its last.

    Returns how many, -1 without room for all, -2 if an extreme could not be located. Extremes within a span
    are roots of T'; T may jump between spans. Reversals by no more than `still` are passed over: they are
    rounding. `kept` (four zeros) is scratch.
    """
    s = as_record(work, WORK)
    f = s.f
    for row in range(spans.shape[0]):
        n = restore(s, tones, spans, row)
        start = spans[row, S_START]
        h = spans[row, S_END] - start
        T = s.torque[k]
        add_turning_point(kept, points, start, T[0], still)
        sign, low = 0.0, 0  # far from the motor T begins with a high power of time
        for o in range(1, n + 1):
            if sign == 0.0 and T[o] != 0.0:
                sign, low = math.copysign(1.0, T[o]), o - 1
        x = 0.0
        while sign != 0.0:
            for o in range(n):
                f[o] = sign * (o + 1.0) * T[o + 1]
            begin = x
            x = crossing(s, low if begin == 0.0 else 0, n - 1, begin, 1.0)
            if x < -1.0:
                return -2
            if x < 0.0:
                break
            if x > begin or begin == 0.0:
                add_turning_point(kept, points, start + x * h, value(T, n, x), still)
            else:
                break
            sign = -sign
        add_turning_point(kept, points, start + h, value(T, n, 1.0), still)
    count = int(kept[0])
    if count >= points.shape[0]:
        return -1
    if kept[1] != 0.0:
        points[count, 0], points[count, 1] = kept[2], kept[3]
        count += 1
    return count
