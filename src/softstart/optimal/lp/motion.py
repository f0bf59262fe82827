"""The motion in contact, and how a start enters it: linear in the motor torque.

`Contact` gives shaft torque, twist and speeds as linear maps of any motor torque. With any torque between the
limits at the motor's command (no lag, no rate limit), the gap part of a start whose gap closes once matters
only through the instant `te` at which both masses begin to move in contact and the relative speed `v` they
have then: an `Entry` gives which `v` is possible at which `te`.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq

from softstart.arrays import Indices, Vector
from softstart.drive import Drive
from softstart.optimal.problem import Problem

MARGIN = 2e-4  # of U, which T keeps above 0
Pieces = list[tuple[float, float]]  # (duration in s, torque in N m)


class Entry(ABC):
    """How the masses come into moving contact: at `te`, with overlap z0, relative speed v and load speed.

    `earliest` and `latest` bound te in s.
    """

    earliest: float
    latest: float
    z0: float

    @abstractmethod
    def slowest(self, te: Vector) -> Vector:
        """Least relative speed at te, rad/s; falls with te."""

    @abstractmethod
    def fastest(self, te: Vector) -> Vector:
        """Greatest relative speed at te, rad/s."""

    @abstractmethod
    def fastest_between(self, ta: Vector, tb: Vector) -> Vector:
        """An upper bound of `fastest` for all te from ta to tb."""

    @abstractmethod
    def load_speed(self, te: Vector) -> Vector:
        """Load speed at te, rad/s; linear in te."""

    @abstractmethod
    def pieces(self, te: float, v: float) -> Pieces:
        """Durations and torques of a gap part that arrives at te with v."""


@dataclass(frozen=True)
class FromContact(Entry):
    """The start is in contact, the load free to move: nothing to choose."""

    z0: float
    v0: float
    w2: float
    earliest: float = 0.0
    latest: float = 0.0

    def slowest(self, te: Vector) -> Vector:
        """v0."""
        return np.full(np.shape(te), self.v0)

    def fastest(self, te: Vector) -> Vector:
        """v0."""
        return np.full(np.shape(te), self.v0)

    def fastest_between(self, ta: Vector, tb: Vector) -> Vector:
        """v0."""
        return np.full(np.shape(ta), self.v0)

    def load_speed(self, te: Vector) -> Vector:
        """The initial one."""
        return np.full(np.shape(te), self.w2)

    def pieces(self, te: float, v: float) -> Pieces:
        """Nothing comes before."""
        return []


@dataclass(frozen=True)
class ThroughGap(Entry):
    """An active load: theta'' = u/J1 + Mc/J2 over the travel still open, u from 0 to Ms.

    The travel fixes the first moment of the torque about te, A = integral (te - s) u ds; of all torques with
    that moment the earliest pulse has the least impulse and the latest one the greatest.
    """

    travel: float
    v0: float
    w2: float
    J1: float
    J2: float
    Mc: float
    Ms: float
    z0: float = 0.0

    @property
    def pull(self) -> float:
        """Relative acceleration by the load alone, rad/s^2."""
        return self.Mc / self.J2

    @property
    def earliest(self) -> float:  # type: ignore[override]
        """At full torque."""
        return self._time(self.Ms / self.J1 + self.pull)

    @property
    def latest(self) -> float:  # type: ignore[override]
        """Without torque: the load comes back by itself."""
        return self._time(self.pull)

    def _time(self, a: float) -> float:
        arriving = self.v0 + math.sqrt(self.v0**2 + 2.0 * a * self.travel)
        return 2.0 * self.travel / arriving if arriving > 0.0 else math.inf

    def _moment(self, te: Vector) -> Vector:
        """A/Ms in s^2, clipped to what the torque can bring."""
        left = self.J1 * (self.travel - self.v0 * te - 0.5 * self.pull * te * te) / self.Ms
        return np.clip(left, 0.0, 0.5 * te * te)

    def slowest(self, te: Vector) -> Vector:
        """Pulse at once, then coast."""
        te = np.asarray(te, dtype=np.float64)
        A = self._moment(te)
        root = np.sqrt(np.maximum(te * te - 2.0 * A, 0.0))
        pulse = np.divide(2.0 * A, te + root, out=np.zeros_like(te), where=te + root > 0.0)
        return self.v0 + self.pull * te + self.Ms / self.J1 * pulse

    def fastest(self, te: Vector) -> Vector:
        """Coast, then pulse up to the contact."""
        te = np.asarray(te, dtype=np.float64)
        return self.v0 + self.pull * te + self.Ms / self.J1 * np.sqrt(2.0 * self._moment(te))

    def fastest_between(self, ta: Vector, tb: Vector) -> Vector:
        """The pulse is longest at ta, the pull of the load greatest at tb."""
        pulse = np.sqrt(2.0 * self._moment(np.asarray(ta, dtype=np.float64)))
        return self.v0 + self.pull * np.asarray(tb) + self.Ms / self.J1 * pulse

    def load_speed(self, te: Vector) -> Vector:
        """The load falls back: w2 - Mc te/J2."""
        return self.w2 - self.pull * np.asarray(te, dtype=np.float64)

    def pieces(self, te: float, v: float) -> Pieces:
        """A first pulse of length a and a last one of length L - a: impulse Ms L, moment A."""
        A = float(self._moment(np.array([te]))[0])
        low = self.Ms * te - math.sqrt(max(te * te - 2.0 * A, 0.0)) * self.Ms
        high = self.Ms * math.sqrt(2.0 * A)
        impulse = min(max(self.J1 * (v - self.v0 - self.pull * te), low), high)
        L = impulse / self.Ms
        first = (A - 0.5 * L * L) / (te - L) if te - L > 1e-12 * te else L
        first = min(max(first, 0.0), L)
        return [(first, self.Ms), (te - L, 0.0), (L - first, self.Ms)]


@dataclass(frozen=True)
class ThroughStandstill(Entry):
    """A reactive load at rest, undamped: the motor alone crosses the gap and winds the shaft up to T = Mc.

    te is the instant of the breakaway, z0 = Mc/c. An early pulse has the least speed there (its lead on any
    other torque with the same arrival is concave from the end of the pulse on); a late one the greatest, and
    waiting (where the shaft is wound up: holding it) costs nothing, so that one can be had at any te. Letting
    a wound shaft go first makes v greater still: `fastest_between`, for bounds, has that, `fastest` not.
    """

    travel: float  # rad still open
    J1: float
    c: float
    Mc: float
    Ms: float
    preload: float = 0.0  # overlap at the start, rad

    @property
    def z0(self) -> float:  # type: ignore[override]
        """Overlap at the breakaway, rad."""
        return self.Mc / self.c

    @property
    def ws(self) -> float:
        """Frequency of the motor on the held shaft, rad/s."""
        return math.sqrt(self.c / self.J1)

    @property
    def earliest(self) -> float:  # type: ignore[override]
        """At full torque."""
        return self.arrival(math.inf)[0]

    @property
    def latest(self) -> float:  # type: ignore[override]
        """A load at rest can be kept waiting."""
        return math.inf

    def arrival(self, pulse: float) -> tuple[float, float]:
        """(te, v) after a pulse of Ms of this duration from 0 on, then coasting; te = inf: it never comes."""
        a = self.Ms / self.J1
        crossing = math.sqrt(2.0 * self.travel / a)
        if pulse < crossing:
            v = a * pulse
            if v <= 0.0:
                return math.inf, 0.0
            return self._wound_up(pulse + (self.travel - 0.5 * a * pulse * pulse) / v, 0.0, v, 0.0)
        v = a * crossing
        full = self._wound_up(crossing, self.preload, v, self.Ms)
        if pulse >= full[0]:
            return full
        s, ws, mean = pulse - crossing, self.ws, self.Ms / self.c
        z = mean + (self.preload - mean) * math.cos(ws * s) + v / ws * math.sin(ws * s)
        rate = -(self.preload - mean) * ws * math.sin(ws * s) + v * math.cos(ws * s)
        return self._wound_up(pulse, z, rate, 0.0)

    def _wound_up(self, t: float, z: float, v: float, u: float) -> tuple[float, float]:
        """From (t, z, v) under constant u to z = Mc/c: when, and how fast."""
        ws, mean = self.ws, u / self.c
        # z - mean = R cos(ws s - angle), rising while ws s < angle
        radius = math.hypot(z - mean, v / ws)
        reach = self.z0 - mean
        if abs(reach) > radius:
            return math.inf, 0.0
        angle = math.atan2(v / ws, z - mean)
        s = (angle - math.acos(min(max(reach / radius, -1.0), 1.0))) / ws if radius > 0.0 else 0.0
        speed = ws * math.sqrt(max(radius * radius - reach * reach, 0.0))
        return t + max(s, 0.0), speed

    def _shortest_pulse(self) -> float:
        """The pulse whose coasting just comes to T = Mc."""
        work = 0.5 * self.c * (self.z0**2 - self.preload**2) / self.Ms  # Ms times the travel under torque
        if work <= self.travel:
            return math.sqrt(2.0 * work * self.J1 / self.Ms)
        a = self.Ms / self.J1
        crossing = math.sqrt(2.0 * self.travel / a)
        # in contact: the travel under torque is travel + (z - preload)
        z, mean, ws = self.preload + work - self.travel, self.Ms / self.c, self.ws
        v = a * crossing
        radius = math.hypot(self.preload - mean, v / ws)
        angle = math.atan2(v / ws, self.preload - mean)
        return crossing + (angle - math.acos(min(max((z - mean) / radius, -1.0), 1.0))) / ws

    def pulse_for(self, te: float) -> float:
        """The pulse that arrives at te, coasting; the shortest one where te is later than any arrival."""
        low = self._shortest_pulse() * (1.0 + 1e-12)
        high = self.earliest
        if self.arrival(low)[0] <= te:
            return low
        if te <= high:
            return high
        return float(brentq(lambda pulse: min(self.arrival(pulse)[0], 1e9) - te, low, high, xtol=1e-15))

    def slowest(self, te: Vector) -> Vector:
        """Pulse at once, then coast."""
        flat = np.atleast_1d(np.asarray(te, dtype=np.float64))
        stall = self.arrival(self._shortest_pulse() * (1.0 + 1e-12))[0]
        speeds = [0.0 if t >= stall else self.arrival(self.pulse_for(float(t)))[1] for t in flat.ravel()]
        return np.reshape(speeds, np.shape(te))

    def fastest(self, te: Vector) -> Vector:
        """Wait, then full torque: v^2 = 2/J1 (Ms travel - work on the shaft)."""
        return np.full(np.shape(te), self.arrival(math.inf)[1])

    def fastest_between(self, ta: Vector, tb: Vector) -> Vector:
        """At most from T = 0 in contact, or from the start where the gap is open."""
        return replace(self, preload=0.0).fastest(ta)

    def load_speed(self, te: Vector) -> Vector:
        """At rest."""
        return np.zeros(np.shape(te))

    def pieces(self, te: float, v: float) -> Pieces:
        """Wait, then the pulse that arrives, coasting, with v."""
        low, high = self._shortest_pulse() * (1.0 + 1e-12), self.earliest
        pulse = high
        if v <= self.arrival(low)[1]:
            pulse = low
        elif v < self.arrival(high)[1]:
            pulse = float(brentq(lambda x: self.arrival(x)[1] - v, low, high, xtol=1e-15))
        arrival = self.arrival(pulse)[0]
        pulse = min(pulse, arrival)
        held = self.c * self.preload
        return [(max(te - arrival, 0.0), held), (pulse, self.Ms), (arrival - pulse, 0.0)]


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
    position, half = float(drive.theta0), 0.5 * float(drive.gap)
    if abs(position) > half and (
        position < 0.0 or (reactive and float(drive.c) * _overlap(drive) > float(drive.Mc))
    ):
        return "the start is wound up against the load"
    return ""


def _overlap(drive: Drive) -> float:
    return float(max(drive.theta0 - 0.5 * drive.gap, 0.0))


def entry_of(problem: Problem) -> Entry:
    """The entry into moving contact of a problem for which `no_ideal` gives no reason."""
    drive = problem.drive
    travel = max(float(0.5 * drive.gap - drive.theta0), 0.0)
    J1, J2, c, Mc, w1, w2 = (
        float(value)
        for value in (
            drive.J1, drive.J2, drive.c, drive.Mc, drive.initial_motor_speed, drive.initial_load_speed,
        )
    )  # fmt: skip
    Ms = problem.highest_torque
    if drive.load_kind == "reactive" and Mc > 0.0:
        return ThroughStandstill(travel, J1, c, Mc, Ms, _overlap(drive))
    if travel == 0.0:
        return FromContact(_overlap(drive), w1 - w2, w2)
    return ThroughGap(travel, w1 - w2, w2, J1, J2, Mc, Ms)


@dataclass(frozen=True)
class Contact:
    """Both masses in contact: z'' + 2 zeta z' + Omega^2 z = u/J1 + Mc/J2, T = c z + d z'.

    h is the answer of z to a unit impulse of acceleration, dh its rate, H its integral; all are 0 before 0.

    >>> contact = Contact.of(Drive.load("crane-4amtkf"))
    >>> [round(float(f(0.01)), 6) for f in (contact.h, contact.dh, contact.H)]
    [0.008024, 0.432106, 4.5e-05]
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

    @cached_property
    def _exponents(self) -> tuple[complex, complex]:
        q2 = self.Omega**2 - self.zeta**2
        least = (1e-6 * self.Omega) ** 2  # critical damping: the error of moving apart is of order 1e-12
        if abs(q2) < least:
            q2 = least
        q = np.emath.sqrt(q2)
        return complex(-self.zeta + 1j * q), complex(-self.zeta - 1j * q)

    def _both(self, s: ArrayLike) -> tuple[Vector, Vector]:
        when = np.asarray(s, dtype=np.float64)
        r1, r2 = self._exponents
        late = np.maximum(when, 0.0)
        e1 = np.exp(r1 * late)
        e2 = np.conj(e1) if r2 == r1.conjugate() else np.exp(r2 * late)
        h = ((e1 - e2) / (r1 - r2)).real
        dh = ((r1 * e1 - r2 * e2) / (r1 - r2)).real
        return np.where(when >= 0.0, h, 0.0), np.where(when >= 0.0, dh, 0.0)

    def h(self, s: ArrayLike) -> Vector:
        """Twist after a unit step of its rate at 0."""
        return self._both(s)[0]

    def dh(self, s: ArrayLike) -> Vector:
        """Its rate after the same step."""
        return self._both(s)[1]

    def H(self, s: ArrayLike) -> Vector:
        """Twist after a unit step of its acceleration at 0."""
        h, dh = self._both(s)
        settled = (1.0 - dh - 2.0 * self.zeta * h) / self.Omega**2
        return np.where(np.asarray(s) >= 0.0, settled, 0.0)

    def sums(
        self, s: Vector, at: Vector, of_h: Vector, of_dh: Vector, first: tuple[Indices, Indices]
    ) -> tuple[Vector, Vector]:
        """Sum over j with at_j > s of of_h_j h(at_j - s) + of_dh_j dh(at_j - s), for rising s and rising at.

        `first` has for each s the first j with at_j > s, and with at_j >= s (`searchsorted`, right and left).

        It jumps at every at_j, as dh does at 0: the second answer counts at_j = s too, the limit from below.
        By running sums over the two exponentials of h, so that it costs no more than s.size + at.size.
        """
        r1, r2 = self._exponents
        after, before = first
        longest = float(max(at[-1], s[-1])) if at.size else 0.0
        if (
            max(abs(r1.real), abs(r2.real)) * longest > 300.0
        ):  # the sums would lose themselves in huge factors

            def dense(first: Indices) -> Vector:
                counted = np.arange(at.size)[None, :] >= first[:, None]
                lag = np.where(counted, at[None, :] - s[:, None], -1.0)
                total: Vector = self.h(lag) @ of_h + self.dh(lag) @ of_dh
                return total

            return dense(after), dense(before)
        pair = r2 == r1.conjugate()  # then the second sum is the first one's conjugate
        from_above, from_below = np.zeros(s.size), np.zeros(s.size)
        for r, sign in ((r1, 1.0), (r2, -1.0))[: 1 if pair else 2]:
            terms = (of_h + r * of_dh) * np.exp(r * at) * sign / (r1 - r2)
            left = np.concatenate([np.cumsum(terms[::-1])[::-1], [0.0]])
            decay = np.exp(-r * s)
            from_above += (left[after] * decay).real
            from_below += (left[before] * decay).real
        return (2.0 * from_above, 2.0 * from_below) if pair else (from_above, from_below)

    def coasting(self, s: Vector) -> tuple[tuple[Vector, Vector, Vector], tuple[Vector, Vector, Vector]]:
        """(a_v, a_0, a_z) of z(s) and of z'(s) without motor torque, as `twist` and `rate` have them."""
        h, dh = self._both(s)
        settled = (1.0 - dh - 2.0 * self.zeta * h) / self.Omega**2
        H = np.where(s >= 0.0, settled, 0.0)
        z = h, H * self.Mc / self.J2, dh + 2.0 * self.zeta * h
        return z, (dh, h * self.Mc / self.J2, -(self.Omega**2) * h)

    def twist(self, s: Vector, edges: Vector) -> tuple[Vector, Vector, Vector, Vector]:
        """z(s) = A u + a_v v + a_0 + a_z z0: (A, a_v, a_0, a_z) for u constant between the edges."""
        h, dh = self._both(s)
        lag = s[:, None] - edges[None, :]
        steps = self.H(lag)
        A = (steps[:, :-1] - steps[:, 1:]) / self.J1
        return A, h, self.H(s) * self.Mc / self.J2, dh + 2.0 * self.zeta * h

    def rate(self, s: Vector, edges: Vector) -> tuple[Vector, Vector, Vector, Vector]:
        """z'(s) in the same way."""
        h, dh = self._both(s)
        steps = self.h(s[:, None] - edges[None, :])
        A = (steps[:, :-1] - steps[:, 1:]) / self.J1
        return A, dh, h * self.Mc / self.J2, -(self.Omega**2) * h

    def torque(self, s: Vector, edges: Vector) -> tuple[Vector, Vector, Vector, Vector]:
        """T(s) = c z + d z' in the same way."""
        z, rate = self.twist(s, edges), self.rate(s, edges)
        A, a_v, a_0, a_z = (self.c * a + self.d * b for a, b in zip(z, rate, strict=True))
        return A, a_v, a_0, a_z

    def load_speed(self, s: Vector, edges: Vector) -> tuple[Vector, Vector, Vector, Vector]:
        """w2(s) - w2(0) in the same way, from J1 w1 + J2 w2: momentum is what the torques brought."""
        A, a_v, a_0, a_z = self.rate(s, edges)
        pushed = np.diff(np.minimum(edges[None, :], s[:, None]), axis=1)
        total = self.J1 + self.J2
        return (
            (pushed - self.J1 * A) / total,
            self.J1 * (1.0 - a_v) / total,
            (-self.Mc * s - self.J1 * a_0) / total,
            -self.J1 * a_z / total,
        )
