"""The motion in contact, linear in the motor torque, and how a start enters it.

With any torque between the limits at the motor's command (no lag, no rate limit), the part before the contact
of a start whose gap closes once matters only through the instant te at which both masses begin to move in
contact and the relative speed v = w1 - w2 that they have then. `cells_before` bounds v in cells of te: of all
torques that close the gap at te an early pulse has the least v, a late one the greatest. A reactive load at
rest moves only when the shaft is wound up to T = Mc, at the overlap z0 = Mc/c (docs/theory/optimum.md).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from softstart.arrays import Vector
from softstart.drive import Drive
from softstart.optimal.problem import Problem
from softstart.optimal.pulse_coast_hold import (
    PulseCoastHoldStarts,
    fall_time,
    falls_back,
    falls_rubbing,
    first_true,
    reactive,
)

ENTRY_CELLS = 3000


@dataclass(frozen=True)
class Contact:
    """Both masses in contact: z'' + 2 zeta z' + Omega^2 z = u/J1 + Mc/J2, T = c z + d z'.

    >>> [round(float(f), 6) for f in Contact.of(Drive.load("crane-4amtkf")).responses(0.01)]
    [4.5e-05, 0.008024, 0.432106]
    """

    J1: float
    J2: float
    c: float
    d: float
    Mc: float

    @classmethod
    def of(cls, drive: Drive) -> Contact:
        """The contact of a drive."""
        return cls(*(float(value) for value in (drive.J1, drive.J2, drive.c, drive.d, drive.Mc)))

    @property
    def Omega(self) -> float:
        """Undamped elastic frequency, rad/s."""
        return math.sqrt(self.c * (1.0 / self.J1 + 1.0 / self.J2))

    @property
    def zeta(self) -> float:
        """Decay rate of a free oscillation, 1/s."""
        return 0.5 * self.d * (1.0 / self.J1 + 1.0 / self.J2)

    @property
    def half_period(self) -> float:
        """Instant in s up to which an impulse of torque cannot lower T: first zero of c h + d dh."""
        # c sin(qs)/q + d (cos(qs) - zeta/q sin(qs)) = 0; overdamped with sinh and cosh
        share = self.zeta / self.Omega
        q = self.Omega * math.sqrt(abs(1.0 - share * share))
        if q < 1e-6 * self.Omega:
            return 2.0 / self.Omega
        return 2.0 * (math.acos(share) if share < 1.0 else math.acosh(share)) / q

    def responses(self, s: ArrayLike) -> tuple[Vector, Vector, Vector]:
        """(H, h, dh) at instants s: z after a unit step of z'' and of z', and z' after that; 0 before 0."""
        when = np.asarray(s, dtype=np.float64)
        late, zeta, square = np.maximum(when, 0.0), self.zeta, self.Omega**2
        q = math.sqrt(abs(square - zeta**2))
        if zeta <= self.Omega:
            decay = np.exp(-zeta * late)
            h, mean = decay * late * np.sinc(q * late / np.pi), decay * np.cos(q * late)
        else:  # sums of two exponentials, written so that none of them grows
            slow = np.exp(-square / (zeta + q) * late)
            h = slow * -np.expm1(-2.0 * q * late) / (2.0 * q)
            mean = 0.5 * (slow + np.exp(-(zeta + q) * late))
        dh = np.where(when >= 0.0, mean - zeta * h, 0.0)
        return np.where(when >= 0.0, (1.0 - dh - 2.0 * zeta * h) / square, 0.0), h, dh

    def torque(self, s: Vector, edges: Vector) -> tuple[Vector, Vector, Vector, Vector]:
        """T(s) = A u + a_v v + a_0 + a_z z0: (A, a_v, a_0, a_z) for u constant between the edges."""
        H, h, dh = self.responses(s)
        later, shorter, _ = self.responses(s[:, None] - edges[None, :])
        steps = (self.c * later + self.d * shorter) / self.J1
        by_load = (self.c * H + self.d * h) * self.Mc / self.J2
        by_overlap = self.c * (dh + 2.0 * self.zeta * h) - self.d * self.Omega**2 * h
        return steps[:, :-1] - steps[:, 1:], self.c * h + self.d * dh, by_load, by_overlap

    def swing(self, y: float, rate: float) -> tuple[float, float]:
        """Bounds of |y'| and |y''| at all later times of any free motion y'' + 2 zeta y' + Omega^2 y = 0.

        The energy y'^2 + Omega^2 y^2 never rises, whatever the damping, and y' is a free motion too.

        >>> Contact(1.0, 1.0, 0.5, 0.0, 0.0).swing(3.0, 4.0)
        (5.0, 5.0)
        """
        Omega, bent = self.Omega, -2.0 * self.zeta * rate - self.Omega**2 * y
        return math.hypot(rate, Omega * y), math.hypot(bent, Omega * rate)


@dataclass(frozen=True, eq=False)
class Entries:
    """Which entries into moving contact are possible: cells between the instants `te`, s, rising.

    `slowest` and `fastest` bound v in each cell, rad/s; `load_speed` is w2 at each te, linear between; z0 is
    the overlap, rad; `opens` and `rests`: whether the gap is open at first, and the load at rest until te.
    """

    te: Vector
    slowest: Vector
    fastest: Vector
    load_speed: Vector
    z0: float
    opens: bool
    rests: bool


def no_ideal(problem: Problem) -> str:
    """Why the start is no linear problem from its contact on; empty if it is one."""
    drive, sticks, damped = problem.drive, reactive(problem.drive), problem.drive.d > 0.0
    little = drive.Mc < 2e-4 * problem.highest_torque  # so small a load torque at a steady end counts as none
    preload = drive.c * max(drive.theta0 - 0.5 * drive.gap, 0.0)
    return falls_back(problem) or first_true({
        "the damped modelica law is not linear in contact": drive.contact_law == "modelica" and damped,
        "a damped shaft ends without torque only after it did not push":
            problem.terminal == "steady" and damped and little,
        "friction stops the load between falling and rising": falls_rubbing(problem.drive),
        "a damped shaft moves a reactive load at an overlap that depends on the speed": sticks and damped,
        "a reactive load that moves before the contact":
            sticks and bool(drive.initial_load_speed or drive.initial_motor_speed),
        "the start is wound up against the load": sticks and preload > drive.Mc,
    })  # fmt: skip


def cells_before(problem: Problem, end: float, near: float | None = None) -> Entries:
    """The cells up to `end` of a problem for which `no_ideal` gives no reason, finest `near` an instant, s.

    >>> cells = cells_before(Problem(Drive.load("crane-4amtkf"), 0.5), 0.5)
    >>> round(float(cells.te[0]), 5), round(float(cells.fastest[0]), 2)
    (0.01661, 30.1)
    """
    return _through_standstill(problem, end) if reactive(problem.drive) else _through_gap(problem, end, near)


def _through_gap(problem: Problem, end: float, near: float | None) -> Entries:
    """An active load; the gap may be closed at first."""
    starts = PulseCoastHoldStarts.of(problem)
    v0, push, pull, travel, te = starts.v0, starts.push, starts.pull, starts.travel, np.zeros(2)
    if travel > 0.0:
        first, last = (fall_time(travel, v0, a) for a in (push + pull, pull))
        last, x = max(min(last, end), first), np.linspace(0.0, 1.0, ENTRY_CELLS + 1)
        te = first + (last - first) * x * x  # v is steepest at the first instant
        if near is not None and first < near < last:
            cubes = x[:-1] ** 3
            te = np.unique(np.concatenate([te, near + (last - near) * cubes, near - (near - first) * cubes]))
    A = np.clip((travel - v0 * te - 0.5 * pull * te * te) / push, 0.0, 0.5 * te * te)  # over Ms
    root = np.sqrt(te * te - 2.0 * A)
    pulse = np.divide(2.0 * A, te + root, out=np.zeros_like(te), where=te + root > 0.0)
    slowest = v0 + pull * te + push * pulse
    # within a cell the last pulse is longest at its beginning, the pull of the load greatest at its end
    fastest = v0 + pull * te[1:] + push * np.sqrt(2.0 * A[:-1])
    return Entries(te, slowest[1:], fastest, starts.w2 - pull * te, starts.preload, travel > 0.0, False)


def _through_standstill(problem: Problem, end: float) -> Entries:
    """A reactive load at rest: the cells are between the breakaways after first pulses of falling length."""
    starts = PulseCoastHoldStarts.of(problem)
    c, Ms, travel, preload, z0 = starts.c, starts.Ms, starts.travel, starts.preload, starts.Mc / starts.c
    ws, a, mean = math.sqrt(c / starts.J1), starts.push, Ms / c
    crossing = fall_time(travel, 0.0, a)
    radius = math.hypot(preload - mean, a * crossing / ws)  # about `mean`, under full torque
    angle = math.atan2(a * crossing / ws, preload - mean)

    def duration(way: float) -> float:
        """Of the first `way` rad under full torque: through the gap, then winding the shaft up."""
        wound = starts.winding_time(a * crossing, preload + way - travel)
        return fall_time(min(way, travel), 0.0, a) + wound

    # the shortest pulse brings no more than the work on the shaft; the longest lasts until the breakaway
    shortest = duration(0.5 * c * (z0**2 - preload**2) / Ms)
    longest = duration(travel + z0 - preload)
    x = np.linspace(0.0, 1.0, ENTRY_CELLS + 1)
    pulse = longest + (shortest - longest) * x * (2.0 - x)  # v is steep in the shortest ones
    v, te, short = a * np.minimum(pulse, crossing), np.maximum(pulse, crossing), pulse < crossing
    te[short] = pulse[short] + (travel - 0.5 * a * pulse[short] ** 2) / v[short]
    turned = angle - ws * np.maximum(pulse - crossing, 0.0)
    z = np.where(short, preload, mean + radius * np.cos(turned))
    v = np.where(short, v, radius * ws * np.sin(turned))
    swing = np.hypot(z, v / ws)  # coasting
    te += np.maximum(np.arctan2(v / ws, z) - np.arccos(np.minimum(z0 / swing, 1.0)), 0.0) / ws
    slowest = ws * np.sqrt(np.maximum(swing**2 - z0**2, 0.0))
    te, slowest = np.maximum.accumulate(te), np.minimum.accumulate(slowest)  # but for rounding they are so
    # v falls with te: after the last of these, and at `end`, it is at least that of the next one
    count = max(int(np.searchsorted(te, end)), 1)
    te, slowest = np.append(te[:count], max(end, te[0])), np.append(slowest, 0.0)[: count + 1]
    # letting a wound shaft go first makes v greater still: at most from T = 0, or from the open gap
    fastest = math.sqrt(2.0 / starts.J1 * (Ms * (travel + z0) - 0.5 * c * z0**2))
    return Entries(te, slowest[1:], np.full(te.size - 1, fastest), np.zeros(te.size), z0, travel > 0.0, True)
