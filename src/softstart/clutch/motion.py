"""The motion of clutch and load within a mode, what ends the mode, and which mode follows.

Within a mode everything is linear with constant coefficients:

    IM wM' = sigma MM(t) - T   (slips, sigma the sign of w0 - wM)     or wM = w0 (locked)
    Ic wc' = T - R             (R the torque of the load)             or wc = 0  (a reactive load at rest)
    T = c (theta - side gap/2) + d (wM - wc) in contact, 0 in the gap;  theta' = wM - wc

so that the Taylor series follow from one another term by term, here to the 24th order. A step is at most 1.9
divided by the sum of the fastest rates; the truncation error is then below 1e-18 of the terms kept.

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
from numpy.polynomial.polynomial import polyroots

from softstart.arrays import Vector
from softstart.clutch.laws import Law
from softstart.clutch.model import Clutch

ORDER = 24
REACH = 1.9
POWERS = np.arange(ORDER + 1)
ROUNDING_SHARE = 1e-13  # a term below this share of the largest one is rounding
NEARLY_REAL = 1e-6  # imaginary part of a root that may be a real one


@dataclass(frozen=True)
class ClutchState:
    """State at the instant t (s): twist theta (rad), speeds wM and wc (rad/s)."""

    t: float = 0.0
    theta: float = 0.0
    wM: float = 0.0
    wc: float = 0.0


@dataclass(frozen=True)
class ClutchMode:
    """Which equations apply.

    `slip`: +1 the clutch side is slower than w0, -1 faster, 0 locked. `side`: +1 or -1 the flank, 0 inside of
    the gap. `presses`: whether that flank transmits torque; a damped one separates while still compressed.
    `load`: None an active load; +1 or -1 a reactive one that turns, 0 one at rest.
    """

    slip: int
    side: int
    presses: bool
    load: int | None

    @property
    def locked(self) -> bool:
        """Whether the clutch is locked."""
        return self.slip == 0

    def overlap(self, clutch: Clutch, theta: float) -> float:
        """Twist of the shaft beyond the flank, rad."""
        return theta - 0.5 * self.side * clutch.gap

    def elastic_energy(self, clutch: Clutch, theta: float) -> float:
        """Energy of the shaft in J; none where a flank is compressed without torque."""
        return 0.5 * clutch.stiffness * self.overlap(clutch, theta) ** 2 if self.presses else 0.0


@dataclass(frozen=True)
class TaylorStep:
    """Taylor coefficients over the share u from 0 to 1 of a step from `start` to `end` (s), in SI.

    M is the friction torque that the clutch can transmit, F the torque through the clutch, T that of the
    shaft; R is the torque of the load.
    """

    start: float
    end: float
    mode: ClutchMode
    M: Vector
    F: Vector
    T: Vector
    theta: Vector
    wM: Vector
    wc: Vector
    R: float

    @property
    def length(self) -> float:
        """Duration, s."""
        return self.end - self.start

    @property
    def v(self) -> Vector:
        """Speed of the twist, wM - wc."""
        return self.wM - self.wc

    def cut(self, share: float) -> TaylorStep:
        """The first part of it."""
        powers = share**POWERS
        series = {name: getattr(self, name) * powers for name in ("M", "F", "T", "theta", "wM", "wc")}
        return replace(self, end=self.start + share * self.length, **series)

    def after(self) -> ClutchState:
        """The state at the end."""
        return ClutchState(self.end, *(float(series.sum()) for series in (self.theta, self.wM, self.wc)))


def start_mode(clutch: Clutch) -> ClutchMode:
    """At rest in mid-gap: the clutch slips, a reactive load stands (without torque it is free)."""
    free = clutch.load_kind == "active" or clutch.load_torque == 0.0
    return ClutchMode(1, 0 if clutch.gap > 0.0 else 1, clutch.gap == 0.0, None if free else 0)


def step_from(clutch: Clutch, law: Law, state: ClutchState, mode: ClutchMode, last: float) -> TaylorStep:
    """The series of the mode from the state on: at most to `last` (s) and to the end of the law's piece."""
    IM, Ic, c, d = clutch.clutch_inertia, clutch.load_inertia, clutch.stiffness, clutch.damping
    piece, end = law.piece_at(state.t)
    end = min(end, last)
    # what is held by the drive or by friction has no acceleration
    per_M, per_c = 0.0 if mode.locked else 1.0 / IM, 0.0 if mode.load == 0 else 1.0 / Ic
    rate = abs(1.0 / piece.T) if piece.e else 0.0
    if mode.side:
        rate += math.sqrt(c * (per_M + per_c)) + d * (per_M + per_c)
    h = end - state.t
    if h * rate > REACH:
        h /= math.ceil(h * rate / REACH)
        end = state.t + h
    R = clutch.load_torque * (1 if mode.load is None else mode.load)  # opposes the motion if reactive
    M = np.array(piece.series(state.t, ORDER)) * h**POWERS
    friction, constant = (mode.slip * M).tolist(), [R] + [0.0] * ORDER
    T, z, wM, wc = ([0.0] * (ORDER + 1) for _ in range(4))
    z[0], wM[0], wc[0] = mode.overlap(clutch, state.theta), state.wM, state.wc
    for n in range(ORDER + 1):  # [C] (1), term by term: the n-th coefficients give the next ones
        v = wM[n] - wc[n]
        if mode.presses:
            T[n] = c * z[n] + d * v
        if n < ORDER:
            z[n + 1] = h * v / (n + 1)  # theta' = wM - wc
            wM[n + 1] = h * per_M * (friction[n] - T[n]) / (n + 1)  # IM wM' = sigma MM(t) - T
            wc[n + 1] = h * per_c * (T[n] - constant[n]) / (n + 1)  # Ic wc' = T - R
    z[0] = state.theta  # from the overlap of the flank back to the twist
    shaft = np.array(T)
    return TaylorStep(
        state.t, end, mode, M, shaft if mode.locked else mode.slip * M, shaft,
        np.array(z), np.array(wM), np.array(wc), R,
    )  # fmt: skip


def event_functions(clutch: Clutch, step: TaylorStep) -> Iterator[tuple[str, Vector]]:
    """(name, Taylor coefficients) of all that may end this mode; each is negative while the mode lasts."""
    mode, half = step.mode, 0.5 * clutch.gap
    if mode.locked:
        yield "slips+", step.T - step.M
        yield "slips-", -step.T - step.M
    else:
        yield "synchronous", mode.slip * _less(step.wM, clutch.drive_speed)
    if half and mode.presses:
        yield "open", -mode.side * step.T
    elif half and not mode.side:
        yield "contact+", _less(step.theta, half)
        yield "contact-", _less(-step.theta, half)
    elif half:  # the way to the other flank leads through "free"
        inside = _less(mode.side * step.theta, half)
        yield "free", -inside
        yield "pressed", clutch.stiffness * inside + clutch.damping * mode.side * step.v
    if mode.load:
        yield "load stops", -mode.load * step.wc
    elif mode.load == 0:
        yield "load+", _less(step.T, clutch.load_torque)
        yield "load-", _less(-step.T, clutch.load_torque)


def _less(a: Vector, constant: float) -> Vector:
    return np.append(a[0] - constant, a[1:])


def next_mode(
    clutch: Clutch, name: str, state: ClutchState, mode: ClutchMode, M: float
) -> tuple[ClutchState, ClutchMode, str]:
    """State, mode and what happened (empty: nothing of interest) after the zero of an event function.

    `M` is the friction torque that the clutch can transmit at this instant.
    """
    sign = -1 if name.endswith("-") else 1
    if name == "synchronous":
        z, v = mode.overlap(clutch, state.theta), state.wM - state.wc
        holds = not mode.presses or abs(clutch.stiffness * z + clutch.damping * v) <= M
        event = "locked" if holds else ("overrun" if mode.slip > 0 else "slips again")
        state = replace(state, wM=clutch.drive_speed)
        return state, replace(mode, slip=0 if holds else -mode.slip), event
    if name.startswith("slips"):
        return state, replace(mode, slip=sign), "slips again"
    if name == "open":
        # a damped flank separates while still compressed, an undamped one where it was reached
        inside = mode.side * mode.overlap(clutch, state.theta)
        compressed = clutch.damping > 0.0 and inside > 1e-12 * clutch.gap
        return state, replace(mode, side=mode.side if compressed else 0, presses=False), "open"
    if name == "free":
        return state, replace(mode, side=0), ""
    if name == "pressed":
        return state, replace(mode, presses=True), "contact"
    if name.startswith("contact"):
        state = replace(state, theta=0.5 * sign * clutch.gap)
        return state, replace(mode, side=sign, presses=True), "contact"
    if name == "load stops":
        return replace(state, wc=0.0), replace(mode, load=0), name
    return state, replace(mode, load=sign), "load moves"


# values and roots of the series ------------------------------------------------------------------------


def values(a: Vector, u: Vector) -> Vector:
    """The polynomial sum of a_n u^n at some u.

    >>> values(np.array([1.0, 2.0, 3.0]), np.array([0.0, 2.0])).tolist()
    [1.0, 17.0]
    """
    return np.asarray(np.power.outer(u, np.arange(a.size)) @ a)


def roots(a: Vector) -> Vector:
    """Real roots in (0, 1] of the polynomial sum of a_n u^n, in order; a double root may be missing.

    >>> roots(np.array([0.08, -0.6, 1.0])).round(12).tolist()
    [0.2, 0.4]
    """
    sizes = np.abs(a)
    if 2.0 * sizes[0] > sizes.sum() or not sizes.any():  # a_0 outweighs all other terms: no root
        return np.empty(0)
    a = a[: np.flatnonzero(sizes > 1e-18 * sizes.max())[-1] + 1]
    candidates = polyroots(a)
    u = candidates.real[np.abs(candidates.imag) < NEARLY_REAL]
    u = u[(u > -NEARLY_REAL) & (u < 1.0 + NEARLY_REAL)]
    slopes = a[1:] * np.arange(1, a.size)
    for _ in range(3):  # eigenvalues of the companion matrix, improved by Newton
        slope = values(slopes, u)
        u = u - np.divide(values(a, u), slope, out=np.zeros_like(u), where=slope != 0.0)
    return np.unique(u[(u > 0.0) & (u <= 1.0)])


def first_crossing(a: Vector, jitter: float = 0.0) -> float | None:
    """First u in [0, 1] from which on the polynomial is positive; None if it stays negative.

    Leading terms that are mere rounding count as zero: an event that was just handled is not found again.
    `jitter` is what rounding may move the beginning by, as a share of the step: a term that such a shift
    can make is none.

    >>> first_crossing(np.array([-1.0, 4.0])), first_crossing(np.array([-1.0, 0.5]))
    (0.25, None)
    >>> first_crossing(np.array([1e-19, 1.0, -2.0])), first_crossing(np.array([1e-9, -2.0]), 1e-9)
    (0.0, None)
    """
    sizes = np.abs(a)
    noise = ROUNDING_SHARE * sizes.max() + jitter * np.append(np.arange(1, a.size) * sizes[1:], 0.0)
    counts = sizes > noise
    if not counts.any():
        return None
    a = a[int(np.argmax(counts)) :]
    if a[0] > 0.0:
        return 0.0
    zeros = roots(a)
    after = np.append(0.5 * (zeros[:-1] + zeros[1:]), 0.5 * (zeros[-1:] + 1.0))
    rises = values(a, after) > 0.0
    return float(zeros[np.argmax(rises)]) if rises.any() else None
