"""The motion of clutch and load within a mode, as Taylor series of the 24th order.

Within a mode everything is linear with constant coefficients:

    IM wM' = sigma MM(t) - T   (slips, sigma the sign of w0 - wM)     or wM = w0 (locked)
    Ic wc' = T - R             (R the torque of the load)             or wc = 0  (a reactive load that stands)
    T = c (theta - side gap/2) + d v in contact, 0 in the gap;  theta' = v = wM - wc

so that the series follow from one another term by term. A step is 1.9 divided by the sum of the fastest
rates; what the series leave out is then below 1e-18 of what they hold, less than rounding.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from softstart.clutch.laws import Piece
from softstart.clutch.model import Clutch

__all__ = ["LOCKED", "ORDER", "Mode", "Motion", "State", "motion", "step_of"]

Vector = NDArray[np.float64]

ORDER = 24
REACH = 1.9
LOCKED = 0
POWERS = np.arange(ORDER + 1)


@dataclass(frozen=True)
class State:
    """Where both masses are at the instant t (s): twist theta, angle phiM (rad), speeds wM, wc, and v = wM "
    "- wc.
    """

    t: float = 0.0
    theta: float = 0.0
    v: float = 0.0
    wM: float = 0.0
    wc: float = 0.0
    phiM: float = 0.0

    def but(self, **changes: float) -> State:
        """The state with some values put right."""
        return replace(self, **changes)


@dataclass(frozen=True)
class Mode:
    """Which laws act.

    `slip`: +1 the clutch side is slower than w0, -1 faster, 0 locked. `side`: +1 or -1 the flank in contact,
    0 the gap is open. `pressed`: the flank of a damped contact that has come off while still pressed in.
    `load`: None an active load; +1 or -1 a reactive one that turns, 0 one that stands.
    """

    slip: int
    side: int
    load: int | None
    pressed: int = 0

    @property
    def stands(self) -> bool:
        """Whether a reactive load is at rest."""
        return self.load == 0


@dataclass(frozen=True)
class Motion:
    """A step: Taylor coefficients about `state.t`, valid for `h` seconds up to the instant `end`, in SI."""

    state: State
    mode: Mode
    h: float
    end: float
    M: Vector  # friction torque that the clutch can have
    F: Vector  # torque through the clutch
    T: Vector  # shaft torque
    theta: Vector
    v: Vector
    wM: Vector
    wc: Vector
    R: float  # torque of the load

    def shorter(self, h: float) -> Motion:
        """The same motion, ended sooner."""
        return replace(self, h=h, end=self.state.t + h)

    def after(self) -> State:
        """The state at the end."""
        at = self.h**POWERS
        return State(
            self.end,
            float(self.theta @ at),
            float(self.v @ at),
            float(self.wM @ at),
            float(self.wc @ at),
            self.state.phiM + float((self.wM / (POWERS + 1)) @ at) * self.h,
        )


def step_of(clutch: Clutch, mode: Mode, piece: Piece) -> float:
    """Longest step in s for which the series are exact to rounding."""
    rate = 0.0 if piece.e == 0.0 else abs(1.0 / piece.T)
    if mode.side != 0 or mode.pressed != 0:
        free = (0.0 if mode.slip == LOCKED else 1.0 / clutch.clutch_inertia) + (
            0.0 if mode.stands else 1.0 / clutch.load_inertia
        )
        rate += math.sqrt(clutch.stiffness * free) + clutch.damping * free
    return REACH / rate if rate > 0.0 else math.inf


def motion(clutch: Clutch, state: State, mode: Mode, piece: Piece, h: float, end: float) -> Motion:
    """The series of the mode from the state on, for a step of h seconds that ends at the instant `end`."""
    IM, Ic, c, d = clutch.clutch_inertia, clutch.load_inertia, clutch.stiffness, clutch.damping
    moves_M, moves_c = mode.slip != LOCKED, not mode.stands
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
