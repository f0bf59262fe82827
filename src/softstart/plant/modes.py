"""What changes at an event: flanks meet and part, damping regimes switch, the load breaks away or stops."""

from __future__ import annotations

import math

from softstart.plant.jit import inlined
from softstart.plant.layout import (
    BACK, BEYOND, BREAKAWAY, BROKE_AWAY, C, CLOSED, CONTACTS, CONTACT_TORQUE, D, DEAD_ZONE, DOUBLED,
    EXIT, FIRST_CONTACT, GAP, GAP_EVENTS, GRAZE_LOWER, GRAZE_UPPER, IMPACT_SPEED, LAW, LEFT_BEYOND,
    LEFT_LOWER, LEFT_UPPER, LOAD, LOAD_STARTS, LOAD_STOPS, LOWER, MASK, MC, MODELICA, NOTHING, OPENED,
    PERIOD, REACHED, REJOIN, SIDE, START_TIME, STOP, SWITCH, SWITCHED, TARGET_REACHED, THETA, TIME,
    T_END, U, UPPER, V, W2, Vector,
)  # fmt: skip
from softstart.plant.notes import end_stage, note_event, note_event_at


@inlined
def shaft_torque(p: Vector, x: Vector) -> float:
    """T of the present state."""
    side = x[SIDE]
    if side == 0.0:
        return 0.0
    z = side * x[THETA] - 0.5 * p[GAP]
    if x[DOUBLED] != 0.0:
        return side * 2.0 * p[C] * z
    return side * (p[C] * z + p[D] * side * x[V])


@inlined
def engage(p: Vector, x: Vector, events: Vector) -> None:
    """Damping regime and, since damping makes the torque jump, breakaway at the start of a contact."""
    side = x[SIDE]
    z = side * x[THETA] - 0.5 * p[GAP]
    v = side * x[V]
    x[DOUBLED] = 1.0 if p[LAW] == MODELICA and p[D] * v > p[C] * z else 0.0
    torque = side * (2.0 * p[C] * z if x[DOUBLED] != 0.0 else p[C] * z + p[D] * v)
    if x[LOAD] == 0.0 and abs(torque) > p[MC]:
        x[LOAD] = math.copysign(1.0, torque)
        note_event(x, events, LOAD_STARTS, x[LOAD])


@inlined
def close_gap(p: Vector, x: Vector, side: float, events: Vector, stages: Vector) -> None:
    """The flank `side` comes into contact."""
    end_stage(x, stages)
    x[GAP_EVENTS] += 1.0
    x[CONTACTS] += 1.0
    speed = side * x[V]
    if x[CONTACTS] == 1.0:
        x[FIRST_CONTACT] = x[TIME]
        x[IMPACT_SPEED] = speed
        x[CONTACT_TORQUE] = x[U]
    x[SIDE] = side
    note_event(x, events, CLOSED, side)
    engage(p, x, events)


@inlined
def reach_target(p: Vector, x: Vector, time: float, speed: float, events: Vector) -> None:
    """The load has its target speed; without `until` the run ends one elastic period later."""
    x[START_TIME] = time
    note_event_at(time, x, events, TARGET_REACHED, speed)
    if x[T_END] == math.inf:
        x[T_END] = time + p[PERIOD]


@inlined
def handle(p: Vector, x: Vector, m: Vector, event: int, events: Vector, stages: Vector) -> bool:
    """Change of mode at an event; True if the gap closed or opened."""
    half = 0.5 * p[GAP]
    x[MASK] = NOTHING
    if event in (UPPER, LOWER):
        side = 1.0 if event == UPPER else -1.0
        x[THETA] = side * half
        close_gap(p, x, side, events, stages)
        return True
    if event == REJOIN:
        side = x[BEYOND]
        x[BEYOND] = 0.0
        close_gap(p, x, side, events, stages)
        return True
    if event == EXIT:
        side = x[SIDE]
        end_stage(x, stages)
        x[GAP_EVENTS] += 1.0
        x[SIDE] = 0.0
        note_event(x, events, OPENED, side)
        if p[LAW] != DEAD_ZONE and p[D] > 0.0 and side * x[THETA] > half:
            x[BEYOND] = side
            x[MASK] = LEFT_BEYOND
        else:
            x[THETA] = side * half
            x[MASK] = LEFT_UPPER if side > 0.0 else LEFT_LOWER
        return True
    if event == BACK:
        x[THETA] = x[BEYOND] * half
        x[MASK] = LEFT_UPPER if x[BEYOND] > 0.0 else LEFT_LOWER
        x[BEYOND] = 0.0
    elif event == GRAZE_UPPER:
        x[MASK] = LEFT_UPPER
    elif event == GRAZE_LOWER:
        x[MASK] = LEFT_LOWER
    elif event == SWITCH:
        x[DOUBLED] = 1.0 - x[DOUBLED]
        x[MASK] = SWITCHED
    elif event == BREAKAWAY:
        x[LOAD] = math.copysign(1.0, shaft_torque(p, x))
        x[MASK] = BROKE_AWAY
        note_event(x, events, LOAD_STARTS, x[LOAD])
    elif event == STOP:
        x[V] += x[W2]
        x[W2] = 0.0
        torque = shaft_torque(p, x)
        note_event(x, events, LOAD_STOPS, x[LOAD])
        if abs(torque) <= p[MC]:
            x[LOAD] = 0.0
        else:
            x[LOAD] = math.copysign(1.0, torque)
            note_event(x, events, LOAD_STARTS, x[LOAD])
    elif event == REACHED:
        reach_target(p, x, x[TIME], x[W2], events)
    return False
