"""The gas pressure of a four-stroke cycle, in closed form, from a few figures of the engine.

theta is the crank angle of one cylinder from its firing dead centre: expansion to pi, exhaust to 2 pi, intake
to 3 pi, compression to 4 pi.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from typing import ClassVar

import numpy as np
from numpy.polynomial import chebyshev

from softstart.balancing.parts import CYCLE_ANGLE, Cylinders, Part
from softstart.balancing.slider_crank import Vector
from softstart.balancing.tables import CYCLE
from softstart.balancing.work import shape_work
from softstart.input.documents import Table

__all__ = ["SimpleCycle"]

BURNT = math.log(1000.0)  # Vibe's 6.908: 99.9 % at the end, here scaled to all
DEGREE = 40  # of the polynomials that hold the heat integral
GRADES = (
    0.0,
    2**-16,
    2**-13,
    2**-10,
    2**-7,
    2**-5,
    1 / 8,
    1 / 4,
    1 / 2,
    3 / 4,
    1.0,
)  # finer where Vibe's law begins
RPM = math.pi / 30.0


@dataclass(frozen=True)
class SimpleCycle(Part):
    """Polytropic compression and expansion, heat by Vibe's law, constant pressures at intake and exhaust.

    - From 3 pi to the start of the combustion p V^n_c is constant.
    - From there to the opening of the exhaust d(p V^n) = (n - 1) V^(n-1) dQ with n the exponent of the
      expansion: the first law with n for the ratio of heat capacities. Burnt is the share
      (1 - exp(-6.908 tau^(m+1)))/0.999 at the share tau of the duration (I. I. Vibe).
    - In the blowdown the pressure goes over to that of the exhaust along half a cosine, then is constant to
      2 pi; from there to 3 pi it is that of the intake.

    At full load the heat Q is the one that gives the `mean_indicated_pressure` (net, gas exchange included),
    one or one for each of `speeds`, on straight lines between; at part load the intake pressure goes down
    in proportion to `idle_pressure` at load 0, and Q with it, as the charge does. Pressures in Pa, angles in
    rad, speeds in rad/s; strings with units are read. Not modelled: valve timing, waves, heat losses beyond
    the exponents, the spread between cycles.

    >>> cycle, one = SimpleCycle(9.9, "10 bar"), Cylinders(0.082, 0.071, 0.121, firing_angles=(0.0,))
    >>> round(float(cycle.weights(one, 300.0, 1.0) @ shape_work(cycle, one)) / one.displacement / 1e5, 9)
    10.0
    """

    compression_ratio: float
    mean_indicated_pressure: tuple[float, ...]
    speeds: tuple[float, ...] | None = None
    intake_pressure: float = 0.9e5
    idle_pressure: float = 0.3e5
    exhaust_pressure: float = 1.1e5
    crankcase_pressure: float = 1e5
    compression_exponent: float = 1.32
    expansion_exponent: float = 1.27
    combustion_start: float = math.radians(15.0)
    combustion_duration: float = math.radians(55.0)
    vibe_exponent: float = 2.0
    exhaust_opening: float = math.radians(130.0)
    blowdown: float = math.radians(70.0)

    TABLE: ClassVar[Table] = CYCLE

    def mistakes(self) -> Sequence[str]:
        """What the values say against one another."""
        wrong = []
        for key in ("compression_ratio", "compression_exponent", "expansion_exponent"):
            if not getattr(self, key) > 1.0:
                wrong.append(f"{key} = {getattr(self, key):g}: it must be above 1.")
        if self.idle_pressure > self.intake_pressure:
            wrong.append(
                f"idle_pressure = {self.idle_pressure:g} Pa: it must not be above intake_pressure = "
                f"{self.intake_pressure:g} Pa."
            )
        count = len(self.mean_indicated_pressure)
        if self.speeds is None and count > 1:
            wrong.append(f"mean_indicated_pressure: {count} pressures need as many speeds; give speeds too.")
        elif self.speeds is not None and len(self.speeds) != count:
            wrong.append(f"speeds: there are {len(self.speeds)} speeds for {count} mean indicated pressures.")
        elif self.speeds is not None and np.any(np.diff(self.speeds) <= 0.0):
            wrong.append("speeds: each speed must be above the one before it.")
        return [*wrong, *self._timing()]

    def _timing(self) -> Sequence[str]:
        def degrees(angle: float) -> str:
            return f"{math.degrees(angle):g} deg"

        wrong = []
        if self.combustion_start >= math.pi:
            wrong.append(
                f"combustion_start = {degrees(self.combustion_start)}: combustion begins in the compression, "
                "below 180 deg before dead centre."
            )
        end = self.combustion_duration - self.combustion_start
        if end > self.exhaust_opening:
            wrong.append(
                f"exhaust_opening = {degrees(self.exhaust_opening)}: the combustion lasts to {degrees(end)} "
                "after dead centre; open the exhaust later or burn faster."
            )
        if self.exhaust_opening > math.pi:
            wrong.append(
                f"exhaust_opening = {degrees(self.exhaust_opening)}: the exhaust opens at the latest when "
                "the expansion ends, 180 deg."
            )
        if self.exhaust_opening + self.blowdown > 2.0 * math.pi:
            wrong.append(
                f"blowdown = {degrees(self.blowdown)}: begun at exhaust_opening = "
                f"{degrees(self.exhaust_opening)} it ends after the exhaust stroke, 360 deg; make it shorter."
            )
        return wrong

    def breaks(self) -> tuple[float, ...]:
        """Angles theta in rad at which the course of the pressure changes its law."""
        closed = (
            *(self.combustion_duration * g - self.combustion_start for g in GRADES),
            self.exhaust_opening,
            self.exhaust_opening + self.blowdown,
        )
        ends = (*(a % CYCLE_ANGLE for a in closed), 2.0 * math.pi, 3.0 * math.pi)
        return tuple(sorted({float(a) for a in ends}))

    def shapes(self, cylinders: Cylinders, theta: Vector) -> Vector:
        """Pressures per Pa of intake, per Pa of exhaust, per J of heat, and 1; shape (4, n)."""
        theta = np.mod(np.asarray(theta, dtype=np.float64), CYCLE_ANGLE)
        found = np.zeros((4, theta.size))
        found[3] = 1.0
        psi = np.where(theta < 3.0 * math.pi, theta, theta - CYCLE_ANGLE)  # from firing dead centre
        end = self.exhaust_opening + self.blowdown
        closed = psi < end
        found[1, ~closed & (psi < 2.0 * math.pi)] = 1.0
        found[0, psi >= 2.0 * math.pi] = 1.0
        volume = self._volume(cylinders, psi[closed])
        full, start = (float(v) for v in self._volume(cylinders, np.array([math.pi, self.combustion_start])))
        n_c, n = self.compression_exponent, self.expansion_exponent
        compressed = (full / volume) ** n_c
        expanded = (full / start) ** n_c * (start / volume) ** n
        burning = psi[closed] >= -self.combustion_start
        found[0, closed] = np.where(burning, expanded, compressed)
        found[2, closed] = (n - 1.0) * heat_integral(self, cylinders, psi[closed]) / volume**n
        if self.blowdown > 0.0:
            with np.errstate(over="ignore"):  # a blowdown that is all but none
                share = np.clip((psi[closed] - self.exhaust_opening) / self.blowdown, 0.0, 1.0)
            left = 0.5 * (1.0 + np.cos(math.pi * share))
            found[:3, closed] *= left
            found[1, closed] += 1.0 - left
        return found

    def weights(self, cylinders: Cylinders, speed: float, load: float) -> Vector:
        """What to multiply `shapes` with for the pressure difference in Pa on the piston.

        `speed` in rad/s counts where `mean_indicated_pressure` is a table over speeds; outside of it the
        pressure at its end is kept.
        """
        intake = self.idle_pressure + load * (self.intake_pressure - self.idle_pressure)
        heat = self.heat(cylinders, speed) * intake / self.intake_pressure
        return np.array([intake, self.exhaust_pressure, heat, -self.crankcase_pressure])

    def heat(self, cylinders: Cylinders, speed: float) -> float:
        """Heat in J of one cycle of one cylinder at full load."""
        work = shape_work(self, cylinders)
        wanted = self._mean_pressure(speed) * cylinders.displacement
        return float((wanted - self.intake_pressure * work[0] - self.exhaust_pressure * work[1]) / work[2])

    def refuse(self, cylinders: Cylinders) -> Sequence[str]:
        """What cannot be with these cylinders."""
        speeds = self.speeds or (0.0,)
        for speed, pressure in zip(speeds, self.mean_indicated_pressure, strict=True):
            if self.heat(cylinders, speed) < 0.0:
                return (
                    f"mean_indicated_pressure = {pressure / 1e5:g} bar: the gas does more work without any "
                    "heat; give a larger one.",
                )
        return ()

    def _mean_pressure(self, speed: float) -> float:
        if self.speeds is None:
            return self.mean_indicated_pressure[0]
        return float(np.interp(speed, self.speeds, self.mean_indicated_pressure))

    def _volume(self, cylinders: Cylinders, psi: Vector) -> Vector:
        clearance = cylinders.displacement / (self.compression_ratio - 1.0)
        return clearance + cylinders.stroke_volume(psi)

    def _rate(self, cylinders: Cylinders, psi: Vector) -> Vector:
        """V^(n-1) dx/dpsi, x the share burnt."""
        tau = np.clip((psi + self.combustion_start) / self.combustion_duration, 0.0, 1.0)
        m = self.vibe_exponent
        burning = BURNT * (m + 1.0) * tau**m * np.exp(-BURNT * tau ** (m + 1.0))
        per_angle = burning / (-math.expm1(-BURNT) * self.combustion_duration)
        return np.asarray(self._volume(cylinders, psi) ** (self.expansion_exponent - 1.0) * per_angle)


def heat_integral(cycle: SimpleCycle, cylinders: Cylinders, psi: Vector) -> Vector:
    """Integral of V^(n-1) dx from the start of the combustion to psi."""
    edges, series, before = _heat_series(cycle, cylinders)
    found = np.zeros(psi.shape)
    for k, coefficients in enumerate(series):
        here = (psi >= edges[k]) & (psi < edges[k + 1])
        x = (2.0 * psi[here] - edges[k] - edges[k + 1]) / (edges[k + 1] - edges[k])
        found[here] = before[k] + chebyshev.chebval(x, coefficients)
    found[psi >= edges[-1]] = before[-1]
    return found


@lru_cache(maxsize=16)
def _heat_series(cycle: SimpleCycle, cylinders: Cylinders) -> tuple[Vector, list[Vector], list[float]]:
    """Edges of the pieces, Chebyshev series of the integral within each, and its value where each begins."""
    edges = cycle.combustion_duration * np.array(GRADES) - cycle.combustion_start
    x = chebyshev.chebpts1(DEGREE + 1)
    fit = chebyshev.chebvander(x, DEGREE).T * (2.0 / (DEGREE + 1))  # exact at the Chebyshev points
    fit[0] *= 0.5
    series: list[Vector] = []
    before = [0.0]
    for low, high in pairwise(edges.tolist()):
        half = 0.5 * (high - low)
        rate = fit @ cycle._rate(cylinders, low + half * (x + 1.0))
        series.append(np.asarray(chebyshev.chebint(rate * half, lbnd=-1), dtype=np.float64))
        before.append(before[-1] + float(chebyshev.chebval(1.0, series[-1])))
    return edges, series, before
