"""What ends a mode, and which mode follows.

Each mode has functions that are negative while it lasts; the mode ends where one reaches zero:

    slips      wM - w0 (or w0 - wM)        the clutch side reaches the driving side
    locked     T - M and -T - M            holding takes more than the clutch can: it slips again
    contact    -side T                     the flank comes off (no pull); without a gap the shaft pulls as it
    pushes open       twist beyond either flank   the flank is reached
    turning    -load wc                    a reactive load stops
    standing   T - Mc and -T - Mc          a reactive load breaks away
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from softstart.clutch.model import Clutch
from softstart.clutch.motion import LOCKED, Mode, Motion, State

__all__ = ["EVENTS", "event_functions", "follow", "start_mode"]

Vector = NDArray[np.float64]

EVENTS = {
    "synchronous": "the clutch side reaches the driving speed",
    "locked": "slip ends",
    "slips again": "the clutch cannot hold: slip begins again",
    "overrun": "the clutch side turns faster than the driving side",
    "contact": "a flank is reached",
    "open": "the gap opens",
    "load moves": "the load breaks away",
    "load stops": "the load comes to rest",
}


def start_mode(clutch: Clutch) -> Mode:
    """At rest in mid-gap: the clutch slips, a reactive load stands (without torque it is free)."""
    free = clutch.load_kind == "active" or clutch.load_torque == 0.0
    return Mode(1, 0 if clutch.gap > 0.0 else 1, None if free else 0)


def _less(a: Vector, constant: float) -> Vector:
    out = a.copy()
    out[0] -= constant
    return out


def event_functions(clutch: Clutch, step: Motion) -> Iterator[tuple[str, Vector]]:
    """(name, Taylor coefficients) of all that may end this mode; each is negative while the mode lasts."""
    mode = step.mode
    if mode.slip != LOCKED:
        yield "synchronous", mode.slip * _less(step.wM, clutch.drive_speed)
    else:
        yield "slips+", step.T - step.M
        yield "slips-", -step.T - step.M
    if clutch.gap > 0.0:
        half = 0.5 * clutch.gap
        if mode.side != 0:
            yield "open", -mode.side * step.T
        else:
            if mode.pressed != 1:
                yield "contact+", _less(step.theta, half)
            if mode.pressed != -1:
                yield "contact-", _less(-step.theta, half)
            if mode.pressed != 0:
                pressed = mode.pressed * step.theta
                yield "free", -_less(pressed, half)
                tension = clutch.stiffness * _less(pressed, half)
                yield "pressed", tension + clutch.damping * mode.pressed * step.v
    if mode.load is not None:
        if mode.load != 0:
            yield "load stops", -mode.load * step.wc
        else:
            yield "load+", _less(step.T, clutch.load_torque)
            yield "load-", _less(-step.T, clutch.load_torque)


def follow(clutch: Clutch, name: str, state: State, mode: Mode, M: float) -> tuple[State, Mode, str]:
    """State, mode and the event's name (a key of EVENTS, or nothing to tell) behind an event function's zero.

    `M` is the friction torque that the clutch can have at this instant.
    """
    T = _shaft_torque(clutch, state, mode)
    slip, side, load, pressed = mode.slip, mode.side, mode.load, 0
    told = name
    if name == "synchronous":
        state = state.but(wM=clutch.drive_speed)
        holds = abs(T) <= M
        slip = LOCKED if holds else -mode.slip
        told = "locked" if holds else ("overrun" if slip < 0 else "slips again")
        pressed = mode.pressed
    elif name in ("slips+", "slips-"):
        slip = 1 if name == "slips+" else -1
        told = "slips again"
        pressed = mode.pressed
    elif name == "open":
        inside = mode.side * state.theta - 0.5 * clutch.gap
        # a damped flank comes off while still pressed in, an undamped one where it is reached
        pressed = mode.side if clutch.damping > 0.0 and inside > 1e-12 * clutch.gap else 0
        side = 0
    elif name in ("contact+", "contact-"):
        side = 1 if name == "contact+" else -1
        state = state.but(theta=0.5 * side * clutch.gap)
        told = "contact"
    elif name == "pressed":
        side, told = mode.pressed, "contact"
    elif name == "free":
        told = ""
    elif name == "load stops":
        state = state.but(wc=0.0, v=state.wM)
        load, pressed = 0, mode.pressed
    else:
        load = 1 if name == "load+" else -1
        told, pressed = "load moves", mode.pressed
    return state, Mode(slip, side, load, pressed), told


def _shaft_torque(clutch: Clutch, state: State, mode: Mode) -> float:
    if mode.side == 0:
        return 0.0
    return clutch.stiffness * (state.theta - 0.5 * mode.side * clutch.gap) + clutch.damping * state.v
