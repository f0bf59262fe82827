"""Both masses in contact under any motor torque, as linear maps."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softstart.drive import Drive

Vector = NDArray[np.float64]


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
        e1, e2 = np.exp(r1 * late), np.exp(r2 * late)
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

    def sums(self, s: Vector, at: Vector, of_h: Vector, of_dh: Vector) -> tuple[Vector, Vector]:
        """Sum over j with at_j > s of of_h_j h(at_j - s) + of_dh_j dh(at_j - s), for rising s.

        It jumps at every at_j, as dh does at 0: the second answer counts at_j = s too, the limit from below.
        By running sums over the two exponentials of h, so that it costs no more than s.size + at.size.
        """
        r1, r2 = self._exponents
        order = np.argsort(at)
        at, of_h, of_dh = at[order], of_h[order], of_dh[order]
        after, before = (np.searchsorted(at, s, side=side) for side in ("right", "left"))
        longest = float(max(at[-1], s[-1])) if at.size else 0.0
        if (
            max(abs(r1.real), abs(r2.real)) * longest > 300.0
        ):  # the sums would lose themselves in huge factors

            def dense(first: NDArray[np.int64]) -> Vector:
                counted = np.arange(at.size)[None, :] >= first[:, None]
                lag = np.where(counted, at[None, :] - s[:, None], -1.0)
                total: Vector = self.h(lag) @ of_h + self.dh(lag) @ of_dh
                return total

            return dense(after), dense(before)
        from_above, from_below = np.zeros(s.size, dtype=complex), np.zeros(s.size, dtype=complex)
        for r, sign in ((r1, 1.0), (r2, -1.0)):
            terms = (of_h + r * of_dh) * np.exp(r * at) * sign / (r1 - r2)
            left = np.concatenate([np.cumsum(terms[::-1])[::-1], [0.0]])
            decay = np.exp(-r * s)
            from_above += left[after] * decay
            from_below += left[before] * decay
        return from_above.real, from_below.real

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
