"""The machine as a block that is moved on step by step: what an exported drive executes."""

from __future__ import annotations

import math

from numba import types

from softstart.arrays import Matrix, Vector
from softstart.kernel.jit import as_record, compiled_as, inner
from softstart.kernel.motor import sample, take_answer
from softstart.kernel.records import (
    ASK, MEASURED, OPEN, SEES_LOAD_SPEED, WORK, Record, record,
)  # fmt: skip
from softstart.kernel.start import advance, torque_now


class PlantInput:
    """What drives the machine."""

    torque: float  # torque demand, held until the next step, N m


class PlantOutput:
    """What is measured at the end of a step, at the motor shaft."""

    motor_angle: float  # rad, by the encoder of the drive if it has one
    motor_speed: float  # rad/s, by the encoder
    motor_torque: float  # realised torque, with the noise of its measurement, N m
    shaft_torque: float  # of the shaft at the motor, N m
    load_speed: float  # rad/s
    stage: float  # as strategies see it, 1, 2, ...: odd with the gap open
    gap: float  # free motion left to the driving flank of that shaft, rad; 0 in contact
    peak_shaft_torque: float  # the largest |torque| of all shafts so far, N m
    reached: bool  # the load has had its target speed
    status: int  # 0, or why the motion could not be continued


PLANT_INPUT, PLANT_OUTPUT = record(PlantInput), record(PlantOutput)
_A = types.Array(types.float64, 1, "C")
_M = types.Array(types.float64, 2, "C")


@inner
def give_output(s: Record, m: Record, o: Record, tones: Matrix) -> None:
    """The output in the present state."""
    k = s.motor_shaft
    sign = 1.0 if s.at_motor <= k else -1.0
    o.motor_angle, o.motor_speed, o.motor_torque = m.motor_angle, m.motor_speed, m.motor_torque
    o.load_speed = m.load_speed
    o.shaft_torque = sign * torque_now(s, k, tones)
    o.stage, o.gap = s.stage, 0.0
    if s.mode[k] == OPEN:
        o.gap = max(s.half_gap[k] - sign * s.theta[k], 0.0)
    o.peak_shaft_torque = 0.0
    for j in range(s.n - 1):
        o.peak_shaft_torque = max(o.peak_shaft_torque, abs(s.peak[j]))
    o.reached = 0.0 if math.isnan(s.start_time) else 1.0
    o.status = s.status


@compiled_as(types.void(_A, _M, _M, _A, _A, _A, types.float64))
def move_machine(
    work: Vector, tones: Matrix, nothing: Matrix, measured: Vector, given: Vector, output: Vector, step: float
) -> None:
    """Hold the demand for so many seconds; one of 0 s tells the output.

    `nothing` is a matrix without rows: no events are recorded.
    """
    s, m = as_record(work, WORK), as_record(measured, MEASURED)
    i, o = as_record(given, PLANT_INPUT), as_record(output, PLANT_OUTPUT)
    reason = ASK
    if step > 0.0 and s.status == ASK:
        demand = 0.0 if math.isnan(i.torque) else i.torque
        reason = take_answer(s, demand, s.time + step, 0.0)
        if reason == ASK:
            reason = advance(work, tones, nothing, nothing)
        s.status = reason
        if reason == ASK:
            sample(s, SEES_LOAD_SPEED, m)
    elif s.asked == 0.0 and s.status == ASK:
        sample(s, SEES_LOAD_SPEED, m)
    give_output(s, m, o, tones)
