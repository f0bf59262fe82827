"""What is safe: a torque within its limits, and a fault that stays, whatever a sampled controller measures.

`check` looks at what is measured before the step of the controller, `follow` at what it demands after it.
Both stand in the subset of Python that is compiled, and know what a drive can know. After a fault the step is
not called any more and the demand is 0, or the limit nearest to it.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import types

from softstart.arrays import Vector
from softstart.kernel.jit import OPTIONS, as_record, compiled_as, unfused, unfused_inner
from softstart.kernel.records import (
    ENCODER_JUMPED, ENCODER_STUCK, GUARD_LIMITS, GUARD_STATE, MEASURED, NOT_FINITE_MEASURED,
    NO_DEMAND, NO_FAULT, SAMPLE_LATE, SEES_LOAD_SPEED,
    SEES_SHAFT_TORQUE, SEES_STAGE, TORQUE_OFF, Record,
)  # fmt: skip

# in the order of their codes
FAULTS = (
    "", "measured value not finite", "sample late", "encoder jumped", "encoder stuck",
    "torque does not follow", "demand not a number",
)  # fmt: skip

LATE = 0.5  # of a period
SAME_PERIOD = 1e-9  # of a period: rounding of sample instants
SAMPLES_OFF = 3.0  # so many in a row have a torque that does not follow
# A motor has at most twice its largest speed so far, or this many times the target speed. A light motor that
# a load strikes without loss leaves with twice the speed of the load, which may have twice that of the motor
FASTER, SPEED_ROOM = 2.0, 4.0
COUNTS = 2.0  # of the encoder, which rounds at both ends
TORQUE_ROOM = 0.2  # of the starting torque
NOISE_ROOM = 18.0  # standard deviations; the largest that `gauss` gives are 8.7, in each of two samples
STILL_COUNTS, STILL_WINDUPS = 10.0, 2.0  # a motor on a wound shaft stands still for so long


@unfused
def bounded(torque: float, low: float, high: float) -> float:
    """The torque within its limits; what is not a number is 0 within them."""
    return min(max(0.0 if math.isnan(torque) else torque, low), high)


@unfused_inner
def check(p: Record, x: Record, m: Record, sees: int) -> float:
    """The code of the fault that has been found, now or before; 0 without."""
    if x.fault != NO_FAULT:
        return float(x.fault)
    total = m.time + m.motor_angle + m.motor_speed + m.motor_torque
    if sees != 0:
        total += m.stage if sees & SEES_STAGE else 0.0
        total += m.shaft_torque if sees & SEES_SHAFT_TORQUE else 0.0
        total += m.load_speed if sees & SEES_LOAD_SPEED else 0.0
    if p.commanded != 0.0:
        total += m.run + m.set_speed + m.command_time
    if not math.isfinite(total):
        x.fault = NOT_FINITE_MEASURED
        return float(x.fault)
    if x.begun == 0.0:
        x.begun = 1.0
        x.fastest = x.moved = x.still_speed = x.still_way = x.off = 0.0
        x.high = bounded(m.motor_torque, p.low, p.high)
        x.low = x.recent_high = x.recent_low = x.older_high = x.older_low = x.ref_high = x.ref_low = x.high
        x.window = m.time
    elif m.time < x.time or m.time > x.due + LATE * p.period:
        x.fault = SAMPLE_LATE
    else:
        check_encoder(p, x, m, m.time - x.time)
        if p.immediate == 0.0:
            move_bounds(p, x, m.time - x.time)
        check_torque(p, x, m)
    x.time, x.angle, x.torque = m.time, m.motor_angle, m.motor_torque
    return float(x.fault)


@unfused_inner
def check_encoder(p: Record, x: Record, m: Record, dt: float) -> None:
    """A jump is beyond all speeds; a stuck encoder stands still where the torque would have moved it."""
    way = m.motor_angle - x.angle
    room = (FASTER * x.fastest + p.speed + p.acceleration * dt) * dt + COUNTS * p.count
    if abs(way) > room or abs(m.motor_speed) * dt > room:
        x.fault = ENCODER_JUMPED
        return
    if 2.0 * dt >= p.period:
        x.fastest = max(x.fastest, abs(m.motor_speed))
    if way != 0.0:
        x.moved = 1.0
    if way != 0.0 or m.motor_torque * x.torque < 0.0:
        x.still_speed = x.still_way = 0.0
        return
    if x.moved != 0.0 or p.brake == 0.0:  # before the first motion a brake may hold it
        x.still_speed = max(x.still_speed + (abs(m.motor_torque) - p.hold) / p.inertia * dt, 0.0)
        x.still_way += x.still_speed * dt
        if x.still_way > p.slack:
            x.fault = ENCODER_STUCK


@unfused_inner
def move_bounds(p: Record, x: Record, dt: float) -> None:
    """Two models of slew limiter and lag, under the highest and the lowest demand of the dead time.

    Both keep order: the torque under a demand between two others lies between the torques under those.
    """
    reach = p.rate * dt
    decay = p.decay
    if abs(dt - p.period) > SAME_PERIOD * p.period:
        decay = math.exp(-dt / p.lag) if p.lag > 0.0 else 0.0
    ref = x.ref_high
    x.ref_high += min(max(max(x.recent_high, x.older_high) - ref, -reach), reach)
    ref = max(ref, x.ref_high)
    x.high = ref + (x.high - ref) * decay
    ref = x.ref_low
    x.ref_low += min(max(min(x.recent_low, x.older_low) - ref, -reach), reach)
    ref = min(ref, x.ref_low)
    x.low = ref + (x.low - ref) * decay


@unfused_inner
def check_torque(p: Record, x: Record, m: Record) -> None:
    """The realised torque lies between its bounds."""
    if x.low - p.tolerance <= m.motor_torque <= x.high + p.tolerance:
        x.off = 0.0
        return
    x.off += 1.0
    if x.off >= SAMPLES_OFF and x.fault == NO_FAULT:
        x.fault = TORQUE_OFF


@unfused_inner
def follow(p: Record, x: Record, torque: float, ask_again: float, slope: float) -> None:
    """Note the demand, a line from now until the next sample, and when that is due."""
    if math.isnan(torque):
        x.fault = NO_DEMAND
    x.due = ask_again if ask_again > x.time else math.inf
    high = low = bounded(torque, p.low, p.high)
    if slope != 0.0:
        last = bounded(torque + slope * (ask_again - x.time), p.low, p.high)
        high, low = max(high, last), min(low, last)
    if p.immediate != 0.0:
        x.high, x.low = high, low
        return
    if p.dead_time == 0.0:
        x.older_high, x.older_low = high, low
    elif x.time - x.window < p.dead_time:
        x.recent_high, x.recent_low = max(x.recent_high, high), min(x.recent_low, low)
        return
    else:  # all demands of the dead time lie in two windows
        x.older_high, x.older_low = x.recent_high, x.recent_low
    x.recent_high, x.recent_low, x.window = high, low, x.time


_A = types.Array(types.float64, 1, "C")


@compiled_as(types.float64(_A, _A, _A, types.int64), options=OPTIONS)
def check_row(limits: Vector, state: Vector, measured: Vector, sees: int) -> float:
    """`check`, for Python."""
    return check(
        as_record(limits, GUARD_LIMITS), as_record(state, GUARD_STATE), as_record(measured, MEASURED), sees
    )


@compiled_as(types.void(_A, _A, types.float64, types.float64, types.float64), options=OPTIONS)
def follow_row(limits: Vector, state: Vector, torque: float, ask_again: float, slope: float) -> None:
    """`follow`, for Python."""
    follow(as_record(limits, GUARD_LIMITS), as_record(state, GUARD_STATE), torque, ask_again, slope)


def guard_limits(
    limits: Any, motor: Any, motor_inertia: Any, inertia: Any, hold: Any, compliance: Any, speed: Any
) -> None:
    """Fill the `GuardLimits` of a machine, or of many in columns; `motor` is its `MachineRecord`.

    Parameters
    ----------
    motor_inertia, inertia : of the motor, and of the whole machine, kg m2.
    hold : load torques and frictions that may hold it, N m.
    compliance : of all shafts in series, rad/(N m).
    speed : the largest of target and initial speeds, and of what a wound shaft throws the motor at, rad/s.
    """
    noise = 0.5 * NOISE_ROOM * motor["torque_noise"]
    torque = np.maximum(np.abs(motor["u_min"]), np.abs(motor["u_max"]))
    limits["low"], limits["high"] = motor["u_min"], motor["u_max"]
    limits["lag"], limits["rate"], limits["dead_time"] = motor["lag"], motor["rate"], motor["dead_time"]
    without_path = (motor["lag"] == 0.0) & (motor["rate"] == math.inf) & (motor["dead_time"] == 0.0)
    limits["immediate"] = without_path
    limits["count"], limits["brake"] = motor["encoder"], motor["release_at"] > 0.0
    limits["tolerance"] = TORQUE_ROOM * torque + 2.0 * noise
    limits["speed"], limits["acceleration"] = SPEED_ROOM * speed, SPEED_ROOM * torque / motor_inertia
    limits["hold"], limits["inertia"] = hold + noise, inertia
    limits["slack"] = STILL_COUNTS * motor["encoder"] + STILL_WINDUPS * torque * compliance


def guard_samples(limits: Any, period: Any) -> None:
    """Guard a controller with this sample period, s; 0 does not."""
    lag = np.maximum(limits["lag"], 1e-300)
    limits["period"], limits["decay"] = period, np.where(limits["lag"] > 0.0, np.exp(-period / lag), 0.0)
