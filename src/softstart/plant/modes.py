"""What changes at an event: flanks meet and part, damping regimes switch, the load breaks away or stops."""

from __future__ import annotations

import math

from softstart.plant.exchange import shaft_torque
from softstart.plant.jit import inlined
from softstart.plant.layout import (
    BACK, BREAKAWAY, BROKE_AWAY, CLOSED, DEAD_ZONE, EXIT, GRAZE_LOWER, GRAZE_UPPER, LEFT_BEYOND,
    LEFT_LOWER, LEFT_UPPER, LOAD_STARTS, LOAD_STOPS, LOWER, MODELICA, MOTOR_BACKWARD, MOTOR_FORWARD,
    MOTOR_STARTS, MOTOR_STOP, MOTOR_STOPS, NOTHING, OPENED, REACHED, REJOIN,
    REJOINED, RELEASE, RELEASED, STOP, SWITCH, SWITCHED, TARGET_REACHED, UPPER, Matrix, Motion, Plant, State,
)  # fmt: skip
from softstart.plant.notes import end_stage, note_event, note_event_at


@inlined
def engage(p: Plant, x: State, events: Matrix) -> None:
    """Damping regime and, since damping makes the torque jump, breakaway at the start of a contact."""
    side = x.side
    z = side * x.theta - 0.5 * p.gap
    v = side * x.v
    x.doubled = 1.0 if p.law == MODELICA and p.d * v > p.c * z else 0.0
    torque = side * (2.0 * p.c * z if x.doubled != 0.0 else p.c * z + p.d * v)
    if x.load == 0.0 and abs(torque) > p.Mc:
        x.load = math.copysign(1.0, torque)
        note_event(x, events, LOAD_STARTS, x.load)


@inlined
def close_gap(p: Plant, x: State, side: float, events: Matrix, stages: Matrix) -> None:
    """The flank `side` comes into contact."""
    end_stage(x, stages)
    x.gap_events += 1.0
    x.contacts += 1.0
    speed = side * x.v
    if x.contacts == 1.0:
        x.first_contact = x.time
        x.impact_speed = speed
        x.contact_torque = x.u
    x.side = side
    note_event(x, events, CLOSED, side)
    engage(p, x, events)


@inlined
def reach_target(p: Plant, x: State, time: float, speed: float, events: Matrix) -> None:
    """The load has its target speed; without `until` the run ends one elastic period later."""
    x.start_time = time
    note_event_at(time, x, events, TARGET_REACHED, speed)
    if x.t_end == math.inf:
        x.t_end = time + p.period


@inlined
def start_motor(p: Plant, x: State, push: float, events: Matrix) -> None:
    """The motor, which stood still, moves against its friction in the direction of `push`."""
    x.held = 0.0
    x.motor = math.copysign(1.0, push)
    note_event(x, events, MOTOR_STARTS, x.motor)


@inlined
def release_motor(p: Plant, x: State, events: Matrix) -> None:
    """The brake lets the motor go; its friction may still hold it."""
    x.held = 2.0 if p.friction > 0.0 else 0.0
    x.release_time = x.time
    note_event(x, events, RELEASED, x.u)


@inlined
def handle(p: Plant, x: State, m: Motion, event: int, events: Matrix, stages: Matrix) -> bool:
    """Change of mode at an event; True if the gap closed or opened."""
    half = 0.5 * p.gap
    x.mask = NOTHING
    if event in (UPPER, LOWER):
        side = 1.0 if event == UPPER else -1.0
        x.theta = side * half
        close_gap(p, x, side, events, stages)
        return True
    if event == REJOIN:
        side = x.beyond
        x.beyond = 0.0
        close_gap(p, x, side, events, stages)
        if x.mask == NOTHING:
            x.mask = REJOINED
        return True
    if event == EXIT:
        side = x.side
        end_stage(x, stages)
        x.gap_events += 1.0
        x.side = 0.0
        note_event(x, events, OPENED, side)
        if p.law != DEAD_ZONE and p.d > 0.0 and side * x.theta > half:
            x.beyond = side
            x.mask = LEFT_BEYOND
        else:
            x.theta = side * half
            x.mask = LEFT_UPPER if side > 0.0 else LEFT_LOWER
        return True
    if event == BACK:
        x.theta = x.beyond * half
        x.mask = LEFT_UPPER if x.beyond > 0.0 else LEFT_LOWER
        x.beyond = 0.0
    elif event == GRAZE_UPPER:
        x.mask = LEFT_UPPER
    elif event == GRAZE_LOWER:
        x.mask = LEFT_LOWER
    elif event == SWITCH:
        x.doubled = 1.0 - x.doubled
        x.mask = SWITCHED
    elif event == BREAKAWAY:
        x.load = math.copysign(1.0, shaft_torque(p, x))
        x.mask = BROKE_AWAY
        note_event(x, events, LOAD_STARTS, x.load)
    elif event == STOP:
        x.v += x.w2
        x.w2 = 0.0
        torque = shaft_torque(p, x)
        note_event(x, events, LOAD_STOPS, x.load)
        if abs(torque) <= p.Mc:
            x.load = 0.0
        else:
            x.load = math.copysign(1.0, torque)
            note_event(x, events, LOAD_STARTS, x.load)
    elif event == RELEASE:
        release_motor(p, x, events)
    elif event in (MOTOR_FORWARD, MOTOR_BACKWARD):
        start_motor(p, x, 1.0 if event == MOTOR_FORWARD else -1.0, events)
    elif event == MOTOR_STOP:
        x.v = -x.w2
        push = x.u - shaft_torque(p, x)
        note_event(x, events, MOTOR_STOPS, x.motor)
        if abs(push) <= p.friction:
            x.held = 2.0
            x.motor = 0.0
        else:
            start_motor(p, x, push, events)
    elif event == REACHED:
        reach_target(p, x, x.time, x.w2, events)
    return False
