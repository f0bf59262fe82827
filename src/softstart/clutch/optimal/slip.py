"""The slipping clutch as the optimum sees it: everything is linear in the law M(t), 0 <= t <= tM.

With I = IM + Ic, kappa = Ic/I, B the elastic frequency, V the speed of both masses' centre and no gap:

    T(t)  = T0 (1 - cos B t) + kappa B int_0^t M(s) sin B(t - s) ds,     T0 = Mc IM/I
    I V'  = M - Mc,   wM = V + kappa v,   v = T'/cp

From tM on the torque is MM and the shaft swings about Tm = (MM Ic + Mc IM)/I. The end of the engagement is
known from three numbers, linear in the law: a = T(tM) - Tm, b = T'(tM)/B, D = w0 - V(tM). s seconds later

    p = T - Tm = a cos B s + b sin B s,   q = T'/B = b cos B s - a sin B s,   w0 - wM = D - g s - kappa B q/cp

with g = (MM - Mc)/I; slip ends where this is 0. With A = int_0^tM (w0 - V) dt, energy gives the friction work
[C] (3)

    L = I w0^2/2 + Mc (A + g s^2/2 + kappa s v1) - Ic v1^2/2 - ((Tm + p - T0)^2 - T0^2)/(2 cp),   v1 = B q/cp

so that a law matters through the angle A in which the centre lags behind, and through the end of the
oscillation.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import NDArray

from softstart.clutch.model import Clutch
from softstart.errors import InputError

__all__ = ["Slip"]

Vector = NDArray[np.float64]


@dataclass(frozen=True)
class Slip:
    """The constants of a clutch whose law is sought, SI."""

    IM: float
    Ic: float
    cp: float
    w0: float
    MM: float
    Mc: float
    tM: float

    @classmethod
    def of(cls, clutch: Clutch) -> Self:
        """Those of this clutch; raises InputError where the optimum is not linear in the law."""
        wrong = []
        if clutch.gap > 0.0:
            wrong.append(
                f"gap = {clutch.gap:g}: the optimal law is known for a shaft without a gap, as in [C]; set "
                f"gap = 0 "
                "(engage simulates a law with the gap)."
            )
        if clutch.damping > 0.0:
            wrong.append(
                f"damping = {clutch.damping:g}: the optimal law is known without damping; set damping = 0."
            )
        if clutch.load_kind != "active" and clutch.load_torque > 0.0:
            wrong.append(
                'load_kind = "reactive": the optimal law is known for a load that acts always; set '
                '"active", or load_torque = 0.'
            )
        if wrong:
            raise InputError(wrong)
        made = cls(
            clutch.clutch_inertia, clutch.load_inertia, clutch.stiffness, clutch.drive_speed,
            clutch.clutch_torque, clutch.load_torque, clutch.engagement_time,
        )  # fmt: skip
        rest = (made.w0 - made.g * made.tM) / made.g
        if rest < 1.5 * made.period:
            raise InputError(
                f"engagement_time = {made.tM:g}: with full torque the masses are at speed "
                f"{max(rest, 0.0):.3g} s after "
                f"it, and the optimal law is known where the clutch slips for 1.5 elastic periods more "
                f"({1.5 * made.period:.3g} s), the hard case of [C]; give a shorter engagement_time."
            )
        return made

    @cached_property
    def I(self) -> float:  # noqa: E743
        """Inertia of both, kg m^2."""
        return self.IM + self.Ic

    @cached_property
    def kappa(self) -> float:
        """Ic/I."""
        return self.Ic / self.I

    @cached_property
    def B(self) -> float:
        """Elastic frequency, rad/s."""
        return math.sqrt(self.cp * (1.0 / self.IM + 1.0 / self.Ic))

    @property
    def period(self) -> float:
        """Elastic period, s."""
        return 2.0 * math.pi / self.B

    @cached_property
    def T0(self) -> float:
        """Shaft torque without friction torque, N m."""
        return self.Mc * self.IM / self.I

    @cached_property
    def Tm(self) -> float:
        """Mean shaft torque under MM, N m. No law of the class has a lower peak: the mean over a period is
        Tm.
        """
        return (self.MM * self.Ic + self.Mc * self.IM) / self.I

    @cached_property
    def g(self) -> float:
        """Acceleration of the centre under MM, rad/s^2."""
        return (self.MM - self.Mc) / self.I

    # the law acts through these ----------------------------------------------------------------------

    def torque_without(self, t: Vector) -> Vector:
        """T at t with M = 0."""
        return self.T0 * (1.0 - np.cos(self.B * t))

    def torque_by(self, t: Vector, edges: Vector) -> Vector:
        """What M = 1 between two edges adds to T at t: rows t, columns steps."""
        return self._response(t, edges, lambda x: -np.cos(x))

    def rate_by(self, t: Vector, edges: Vector) -> Vector:
        """What M = 1 between two edges adds to T'/B at t."""
        return self._response(t, edges, np.sin)

    def _response(self, t: Vector, edges: Vector, primitive: object) -> Vector:
        assert callable(primitive)
        since = self.B * np.maximum(np.asarray(t)[:, None] - edges[None, :], 0.0)
        return self.kappa * np.asarray(primitive(since[:, :-1]) - primitive(since[:, 1:]))

    def ends_by(self, edges: Vector) -> tuple[Vector, Vector]:
        """(matrix, constants): a, b, D and A of a law that is constant between the edges, as four rows."""
        end = np.array([self.tM])
        steps, middles = np.diff(edges), 0.5 * (edges[1:] + edges[:-1])
        matrix = np.vstack(
            [
                self.torque_by(end, edges)[0],
                self.rate_by(end, edges)[0],
                -steps / self.I,
                -(self.tM - middles) * steps / self.I,
            ]
        )
        return matrix, self.ends_without

    @cached_property
    def ends_without(self) -> Vector:
        """a, b, D and A with M = 0."""
        angle, tM = self.B * self.tM, self.tM
        return np.array(
            [
                self.T0 * (1.0 - math.cos(angle)) - self.Tm,
                self.T0 * math.sin(angle),
                self.w0 + self.Mc * tM / self.I,
                self.w0 * tM + 0.5 * self.Mc * tM**2 / self.I,
            ]
        )

    # the end ------------------------------------------------------------------------------------------

    def start_of_end(self, s: Vector, p: Vector, q: Vector) -> tuple[Vector, Vector, Vector]:
        """(a, b, D) at tM of an engagement whose slip ends s later at (p, q)."""
        cos, sin = np.cos(self.B * s), np.sin(self.B * s)
        return p * cos - q * sin, p * sin + q * cos, self.g * s + self.kappa * self.B * q / self.cp

    def work(self, A: Vector, s: Vector, p: Vector, q: Vector) -> Vector:
        """Friction work L in J."""
        v1 = self.B * q / self.cp
        lag = A + 0.5 * self.g * s**2 + self.kappa * s * v1
        swing = (self.Tm + p - self.T0) ** 2 - self.T0**2
        return np.asarray(
            0.5 * self.I * self.w0**2 + self.Mc * lag - 0.5 * self.Ic * v1**2 - swing / (2.0 * self.cp)
        )
