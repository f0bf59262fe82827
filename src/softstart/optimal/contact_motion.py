"""The motion in contact, linear in the motor torque, and how a start enters it.

With any torque between the limits at the motor's command (no lag, no rate limit), the part before the contact
of a start whose gap closes once matters only through the instant te at which both masses begin to move in
contact and the relative speed v = w1 - w2 that they have then. `entries` bounds v in cells of te:

- an active load: theta'' = u/J1 + Mc/J2 over the travel still open fixes the first moment of the torque
  about te, A = integral (te - s) u ds. Of all torques from 0 to Ms with that moment the earliest pulse has
  the least impulse, the latest one the greatest. The load falls back meanwhile: w2 = w2(0) - Mc te/J2;
- a reactive load at rest, undamped: the motor alone crosses the gap and winds the shaft up to T = Mc, where
  the load breaks away (te, overlap z0 = Mc/c). An early pulse has the least v (its lead on any other torque
  with the same te is concave from the end of the pulse on), and v falls with te; a load at rest can be kept
  waiting, so that any later te has v >= 0. The work of Ms over the whole travel bounds v from above.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from softstart.arrays import Vector
from softstart.drive import Drive
from softstart.optimal.problem import Problem

ENTRY_CELLS = 3000
MARGIN = 2e-4  # of the largest torque: a smaller load torque at a steady end counts as none


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
    drive = problem.drive
    v0 = float(drive.initial_motor_speed - drive.initial_load_speed)
    reactive = drive.load_kind == "reactive" and float(drive.Mc) > 0.0
    if problem.lowest_torque < 0.0:
        return "the motor may brake, so the gap part is not one pulse at either end"
    if drive.contact_law == "modelica" and drive.d > 0.0:
        return "the damped modelica law is not linear in contact"
    if problem.terminal == "steady" and drive.d > 0.0 and drive.Mc < MARGIN * problem.highest_torque:
        return "a damped shaft ends without torque only after it did not push"
    if v0 < 0.0:
        return "the load runs away from the motor at first"
    if reactive and drive.d > 0.0:
        return "a damped shaft moves a reactive load at an overlap that depends on the speed"
    if reactive and (drive.initial_load_speed != 0.0 or drive.initial_motor_speed != 0.0):
        return "a reactive load that moves before the contact"
    wound = abs(float(drive.theta0)) - 0.5 * float(drive.gap)
    if wound > 0.0 and (drive.theta0 < 0.0 or (reactive and float(drive.c) * wound > float(drive.Mc))):
        return "the start is wound up against the load"
    return ""


def entries(problem: Problem, end: float, near: float | None = None) -> Entries:
    """The cells up to `end` of a problem for which `no_ideal` gives no reason, finest `near` an instant, s.

    >>> cells = entries(Problem(Drive.load("crane-4amtkf"), 0.5), 0.5)
    >>> round(float(cells.te[0]), 5), round(float(cells.fastest[0]), 2)
    (0.01661, 30.1)
    """
    if problem.drive.load_kind == "reactive" and problem.drive.Mc > 0.0:
        return _through_standstill(problem, end)
    return _through_gap(problem, end, near)


def _through_gap(problem: Problem, end: float, near: float | None) -> Entries:
    """An active load; the gap may be closed at first."""
    drive, Ms = problem.drive, problem.highest_torque
    J1, pull, w2 = float(drive.J1), float(drive.Mc / drive.J2), float(drive.initial_load_speed)
    v0, overlap = float(drive.initial_motor_speed) - w2, float(drive.theta0 - 0.5 * drive.gap)
    travel, te = max(0.0, -overlap), np.zeros(2)
    if travel > 0.0:
        arriving = (v0 + math.sqrt(v0**2 + 2.0 * a * travel) for a in (Ms / J1 + pull, pull))
        first, last = (2.0 * travel / speed if speed > 0.0 else math.inf for speed in arriving)
        last, x = max(min(last, end), first), np.linspace(0.0, 1.0, ENTRY_CELLS + 1)
        te = first + (last - first) * x * x  # v is steepest at the first instant
        if near is not None and first < near < last:
            cubes = x[:-1] ** 3
            te = np.unique(np.concatenate([te, near + (last - near) * cubes, near - (near - first) * cubes]))
    A = np.clip(J1 * (travel - v0 * te - 0.5 * pull * te * te) / Ms, 0.0, 0.5 * te * te)  # over Ms
    root = np.sqrt(te * te - 2.0 * A)
    pulse = np.divide(2.0 * A, te + root, out=np.zeros_like(te), where=te + root > 0.0)
    slowest = v0 + pull * te + Ms / J1 * pulse
    # within a cell the last pulse is longest at its beginning, the pull of the load greatest at its end
    fastest = v0 + pull * te[1:] + Ms / J1 * np.sqrt(2.0 * A[:-1])
    return Entries(te, slowest[1:], fastest, w2 - pull * te, max(overlap, 0.0), travel > 0.0, False)


def _through_standstill(problem: Problem, end: float) -> Entries:
    """A reactive load at rest: the cells are between the breakaways after first pulses of falling length."""
    drive, Ms = problem.drive, problem.highest_torque
    J1, c, overlap = float(drive.J1), float(drive.c), float(drive.theta0 - 0.5 * drive.gap)
    travel, preload, z0 = max(0.0, -overlap), max(0.0, overlap), float(drive.Mc) / c
    ws, a, mean = math.sqrt(c / J1), Ms / J1, Ms / c
    crossing = math.sqrt(2.0 * travel / a)
    radius = math.hypot(preload - mean, a * crossing / ws)  # about `mean`, under full torque
    angle = math.atan2(a * crossing / ws, preload - mean)

    def duration(way: float) -> float:
        """Of the first `way` rad under full torque: through the gap, then winding the shaft up."""
        if way <= travel:
            return math.sqrt(2.0 * way / a)
        cosine = (preload + way - travel - mean) / radius
        return crossing + (angle - math.acos(min(max(cosine, -1.0), 1.0))) / ws

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
    fastest = math.sqrt(2.0 / J1 * (Ms * (travel + z0) - 0.5 * c * z0**2))
    return Entries(te, slowest[1:], np.full(te.size - 1, fastest), np.zeros(te.size), z0, travel > 0.0, True)
