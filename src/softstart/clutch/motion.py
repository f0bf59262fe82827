"""The motion of clutch and load within a mode, what ends the mode, and which mode follows.

Within a mode everything is linear with constant coefficients:

    IM wM' = sigma MM(t) - T   (slips, sigma the sign of w0 - wM)     or wM = w0 (locked)
    Ic wc' = T - R             (R the torque of the load)             or wc = 0  (a reactive load at rest)
    T = c (theta - side gap/2) + d v in contact, 0 in the gap;  theta' = v = wM - wc

so that the Taylor series follow from one another term by term, here to the 24th order. A step is 1.9 divided
by the sum of the fastest rates; the truncation error is then below 1e-18 of the terms kept, below rounding.

Each mode has functions that are negative while it lasts; the mode ends where one reaches zero:

    slips      wM - w0 (or w0 - wM)        the clutch side reaches the driving side
    locked     T - M and -T - M            the clutch cannot hold: it slips again
    contact    -side T                     the flank separates (no pull); without a gap the shaft pulls too
    open       twist beyond either flank   the flank is reached
    turning    -load wc                    a reactive load stops
    standing   T - Mc and -T - Mc          a reactive load breaks away
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from softstart.arrays import Vector
from softstart.clutch.laws import Piece
from softstart.clutch.model import Clutch

ORDER = 24
REACH = 1.9
LOCKED = 0
POWERS = np.arange(ORDER + 1)
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


@dataclass(frozen=True)
class State:
    """State at the instant t (s): twist theta, angle phiM (rad), speeds wM, wc and v = wM - wc (rad/s)."""

    t: float = 0.0
    theta: float = 0.0
    v: float = 0.0
    wM: float = 0.0
    wc: float = 0.0
    phiM: float = 0.0


@dataclass(frozen=True)
class Mode:
    """Which equations apply.

    `slip`: +1 the clutch side is slower than w0, -1 faster, 0 locked. `side`: +1 or -1 the flank in contact,
    0 the gap is open. `pressed`: the flank of a damped contact that has separated while still compressed.
    `load`: None an active load; +1 or -1 a reactive one that turns, 0 one at rest.
    """

    slip: int
    side: int
    load: int | None
    pressed: int = 0

    @property
    def load_at_rest(self) -> bool:
        """Whether a reactive load is at rest."""
        return self.load == 0


@dataclass(frozen=True)
class Motion:
    """A step: Taylor coefficients about `state.t`, valid for `h` seconds up to the instant `end`, in SI."""

    state: State
    mode: Mode
    h: float
    end: float
    M: Vector  # friction torque that the clutch can transmit
    F: Vector  # torque through the clutch
    T: Vector  # shaft torque
    theta: Vector
    v: Vector
    wM: Vector
    wc: Vector
    R: float  # torque of the load

    def shorter(self, h: float) -> Motion:
        """The same motion, with an earlier end."""
        return replace(self, h=h, end=self.state.t + h)

    def after(self) -> State:
        """The state at the end."""
        powers = self.h**POWERS
        return State(
            self.end,
            float(self.theta @ powers),
            float(self.v @ powers),
            float(self.wM @ powers),
            float(self.wc @ powers),
            self.state.phiM + float((self.wM / (POWERS + 1)) @ powers) * self.h,
        )


def step_of(clutch: Clutch, mode: Mode, piece: Piece) -> float:
    """Longest step in s for which the series are exact to rounding."""
    rate = 0.0 if piece.e == 0.0 else abs(1.0 / piece.T)
    if mode.side != 0 or mode.pressed != 0:
        free = (0.0 if mode.slip == LOCKED else 1.0 / clutch.clutch_inertia) + (
            0.0 if mode.load_at_rest else 1.0 / clutch.load_inertia
        )
        rate += math.sqrt(clutch.stiffness * free) + clutch.damping * free
    return REACH / rate if rate > 0.0 else math.inf


def motion(clutch: Clutch, state: State, mode: Mode, piece: Piece, h: float, end: float) -> Motion:
    """The series of the mode from the state on, for a step of h seconds that ends at the instant `end`."""
    IM, Ic, c, d = clutch.clutch_inertia, clutch.load_inertia, clutch.stiffness, clutch.damping
    moves_M, moves_c = mode.slip != LOCKED, not mode.load_at_rest
    R = 0.0 if not moves_c else clutch.load_torque * (1 if mode.load is None else mode.load)
    M = piece.series(state.t, ORDER)
    z = [state.theta - 0.5 * mode.side * clutch.gap] + [0.0] * ORDER
    v, wM, wc = ([one] + [0.0] * ORDER for one in (state.v, state.wM, state.wc))
    T = [0.0] * (ORDER + 1)
    touches = mode.side != 0
    for n in range(ORDER + 1):
        if touches:
            T[n] = c * z[n] + d * v[n]
        if n == ORDER:
            break
        aM = (mode.slip * M[n] - T[n]) / IM if moves_M else 0.0
        ac = (T[n] - (R if n == 0 else 0.0)) / Ic if moves_c else 0.0
        z[n + 1] = v[n] / (n + 1)
        v[n + 1] = (aM - ac) / (n + 1)
        wM[n + 1] = aM / (n + 1)
        wc[n + 1] = ac / (n + 1)
    z[0] = state.theta
    friction, shaft = np.array(M), np.array(T)
    return Motion(
        state, mode, h, end, friction, mode.slip * friction if moves_M else shaft, shaft,
        np.array(z), np.array(v), np.array(wM), np.array(wc), R,
    )  # fmt: skip


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
    """State, mode and event (a key of EVENTS, or empty) after the zero of the event function `name`.

    `M` is the friction torque that the clutch can transmit at this instant.
    """
    T = _shaft_torque(clutch, state, mode)
    slip, side, load, pressed = mode.slip, mode.side, mode.load, 0
    event = name
    if name == "synchronous":
        state = replace(state, wM=clutch.drive_speed)
        holds = abs(T) <= M
        slip = LOCKED if holds else -mode.slip
        event = "locked" if holds else ("overrun" if slip < 0 else "slips again")
        pressed = mode.pressed
    elif name in ("slips+", "slips-"):
        slip = 1 if name == "slips+" else -1
        event = "slips again"
        pressed = mode.pressed
    elif name == "open":
        inside = mode.side * state.theta - 0.5 * clutch.gap
        # a damped flank separates while still compressed, an undamped one where it was reached
        pressed = mode.side if clutch.damping > 0.0 and inside > 1e-12 * clutch.gap else 0
        side = 0
    elif name in ("contact+", "contact-"):
        side = 1 if name == "contact+" else -1
        state = replace(state, theta=0.5 * side * clutch.gap)
        event = "contact"
    elif name == "pressed":
        side, event = mode.pressed, "contact"
    elif name == "free":
        event = ""
    elif name == "load stops":
        state = replace(state, wc=0.0, v=state.wM)
        load, pressed = 0, mode.pressed
    else:
        load = 1 if name == "load+" else -1
        event, pressed = "load moves", mode.pressed
    return state, Mode(slip, side, load, pressed), event


def _shaft_torque(clutch: Clutch, state: State, mode: Mode) -> float:
    if mode.side == 0:
        return 0.0
    return clutch.stiffness * (state.theta - 0.5 * mode.side * clutch.gap) + clutch.damping * state.v
