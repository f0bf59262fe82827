"""A strategy with its guard as a block that is called once in each cycle: clock, commands, limits, faults.

What runs in `ControlBlock` and what is exported are these functions. The clock counts cycles from the begin
of the start, so that no rounding adds up, however long a machine runs.
"""

from __future__ import annotations

import math

from numba import types

from softstart.arrays import Vector
from softstart.kernel.guard import bounded, check, follow
from softstart.kernel.jit import OPTIONS, as_record, compiled_as, unfused, unfused_inner
from softstart.kernel.motor import STEP_SIGNATURE
from softstart.kernel.records import (
    ANSWER, GUARD_LIMITS, GUARD_STATE, MEASURED, NO_FAULT, SEES_LOAD_SPEED, SEES_SHAFT_TORQUE, SEES_STAGE,
    Double, GuardLimits, GuardState, Record, record,
)  # fmt: skip

SAME_SAMPLE = 1e-6  # of a period


class BlockInput:
    """What the drive gives in each cycle."""

    run: bool  # the drive is to run
    set_speed: float  # commanded speed with its sign, rad/s
    motor_angle: Double  # rad
    motor_speed: float  # rad/s, the difference of the angles over a cycle
    motor_torque: float  # realised torque, N m
    stage: float  # 1, 2, ...: odd with the gap open
    shaft_torque: float  # N m
    load_speed: float  # rad/s
    cycles: int  # since the last call: 1, or more after missed ones


class BlockOutput:
    """What the block answers."""

    torque: float  # demand until the next cycle, N m
    fault: int  # 0, or the code of a fault


class BlockLimits:
    """What is given of drive and strategy."""

    guard: GuardLimits
    period: Double  # of the cycles, s
    can_stop: bool
    can_reverse: bool
    forward: float  # sign of the target speed


class BlockState:
    """What a block keeps, beside the state of its strategy."""

    watch: GuardState
    called: bool
    runs: bool
    sample: int  # cycles since the begin of the start
    command_sample: int  # when the command last changed
    run: bool  # the last command
    set_speed: float
    begin_angle: Double  # of the motor, rad
    asked: Double  # when the strategy was last asked, s
    ask_at: Double  # when it is to be asked again
    torque: float  # what it answered: a line from `asked` on
    slope: float
    stage: float


BLOCK_INPUT, BLOCK_OUTPUT = record(BlockInput), record(BlockOutput)
BLOCK_LIMITS = record(BlockLimits, guard=GUARD_LIMITS)
BLOCK_STATE = record(BlockState, watch=GUARD_STATE)


@unfused_inner
def clear(row: Vector) -> None:
    """All numbers 0."""
    for j in range(row.shape[0]):
        row[j] = 0.0


@unfused_inner
def take_state(command: Vector, state: Vector) -> None:
    """The new state of the strategy becomes its state."""
    for j in range(state.shape[0]):
        state[j] = command[command.shape[0] - state.shape[0] + j]


@unfused
def begin_block(x: Record, angle: float) -> None:
    """A new start, here and now."""
    x.watch.fault = x.watch.begun = 0.0
    x.sample = x.command_sample = 0.0
    x.begin_angle = angle
    x.asked = x.ask_at = x.torque = x.slope = 0.0
    x.stage = math.nan


@unfused
def move_clock(x: Record, i: Record) -> None:
    """Count the cycles, and note when the command changed."""
    if x.called == 0.0:
        x.called = 1.0
    else:
        x.sample += i.cycles
        if i.run != x.run or i.set_speed != x.set_speed:
            x.command_sample = x.sample
    x.run, x.set_speed = i.run, i.set_speed


@unfused
def take_measured(p: Record, x: Record, i: Record, m: Record, sees: int) -> None:
    """What the strategy sees: time and angle from the begin of the start; what it has not declared is NaN."""
    m.time = x.sample * p.period
    m.motor_angle = i.motor_angle - x.begin_angle
    m.motor_speed = i.motor_speed
    m.motor_torque = i.motor_torque
    m.stage = i.stage if sees & SEES_STAGE else math.nan
    m.shaft_torque = i.shaft_torque if sees & SEES_SHAFT_TORQUE else math.nan
    m.load_speed = i.load_speed if sees & SEES_LOAD_SPEED else math.nan
    m.run = i.run
    m.set_speed = i.set_speed
    m.command_time = (x.sample - x.command_sample) * p.period


@unfused
def is_due(p: Record, x: Record, m: Record, sees: int) -> bool:
    """Whether the strategy is to be asked; it has answered -inf when never again."""
    changed = False
    if sees & SEES_STAGE:
        changed = m.stage != x.stage
        x.stage = m.stage
    return x.ask_at != -math.inf and (changed or m.time >= x.ask_at - SAME_SAMPLE * p.period)


@unfused
def begins(p: Record, x: Record, i: Record) -> bool:
    """Whether a new start begins; notes whether the drive runs.

    After a fault each `run` from 0 to 1 is one, and each of a strategy that cannot stop.
    """
    runs = i.run != 0.0 and not (p.can_reverse == 0.0 and i.set_speed * p.forward < 0.0)
    begin = runs and x.runs == 0.0 and (x.watch.fault != NO_FAULT or p.can_stop == 0.0)
    x.runs = 1.0 if runs else 0.0
    return begin


@unfused
def answered(p: Record, x: Record, m: Record) -> float:
    """The demand of the strategy now, 0 while it does not run; notes what the guard must know of it."""
    torque = 0.0
    if x.watch.fault == NO_FAULT:
        if x.runs != 0.0 or p.can_stop != 0.0:
            torque = x.torque
            if x.slope != 0.0:
                torque += x.slope * (m.time - x.asked)
        follow(p.guard, x.watch, torque, m.time + p.period, 0.0)
    return torque


@unfused_inner
def before_step(
    limits: Vector, block: Vector, state: Vector, measured: Vector, given: Vector, sees: int
) -> bool:
    """Take the input of a cycle; whether the strategy is to be asked."""
    p, x = as_record(limits, BLOCK_LIMITS), as_record(block, BLOCK_STATE)
    i, m = as_record(given, BLOCK_INPUT), as_record(measured, MEASURED)
    move_clock(x, i)
    if begins(p, x, i):
        begin_block(x, i.motor_angle)
        clear(state)
    take_measured(p, x, i, m, sees)
    fault = check(p.guard, x.watch, m, sees)
    return fault == NO_FAULT and (x.runs != 0.0 or p.can_stop != 0.0) and is_due(p, x, m, sees)


@unfused_inner
def after_step(
    limits: Vector, block: Vector, measured: Vector, command: Vector, asked: bool, output: Vector
) -> None:
    """Give the output of a cycle, in which the strategy was asked or not."""
    p, x = as_record(limits, BLOCK_LIMITS), as_record(block, BLOCK_STATE)
    m, y, o = as_record(measured, MEASURED), as_record(command, ANSWER), as_record(output, BLOCK_OUTPUT)
    if asked:
        x.asked, x.ask_at = m.time, y.ask_again
        x.torque, x.slope = y.torque, y.slope
    torque = answered(p, x, m)
    o.torque = bounded(torque if x.watch.fault == NO_FAULT else 0.0, p.guard.low, p.guard.high)
    o.fault = x.watch.fault


_A = types.Array(types.float64, 1, "C")
STEP = types.FunctionType(STEP_SIGNATURE)


@compiled_as(types.boolean(_A, _A, _A, _A, _A, types.int64), options=OPTIONS)
def before_plain_step(
    limits: Vector, block: Vector, state: Vector, measured: Vector, given: Vector, sees: int
) -> bool:
    """`before_step`, for a strategy in plain Python."""
    return before_step(limits, block, state, measured, given, sees)


@compiled_as(types.void(_A, _A, _A, _A, types.boolean, _A), options=OPTIONS)
def after_plain_step(
    limits: Vector, block: Vector, measured: Vector, command: Vector, asked: bool, output: Vector
) -> None:
    """`after_step`, for a strategy in plain Python."""
    after_step(limits, block, measured, command, asked, output)


@compiled_as(types.void(STEP, types.int64, *[_A] * 8), options=OPTIONS)
def run_block(  # type: ignore[no-untyped-def]
    step, sees, limits, parameters, block, state, command, measured, given, output
) -> None:
    """One cycle."""
    asked = before_step(limits, block, state, measured, given, sees)
    if asked:
        as_record(command, ANSWER).slope = 0.0
        step(parameters, measured, state, command)
        take_state(command, state)
    after_step(limits, block, measured, command, asked, output)
