"""The gas pressure in a cylinder over a four-stroke cycle, and the harmonics of its torque.

theta is the crank angle of one cylinder from its firing dead centre: expansion to pi, exhaust to 2 pi, intake
to 3 pi, compression to 4 pi. The pressure is given as `weights @ shapes(theta)`: the harmonics, the mean
among them, are computed once for each shape, for all speeds and loads. Integrals over a cycle are exact to
rounding, since the pressure is smooth between known angles.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from itertools import pairwise
from typing import ClassVar

import numpy as np
from numpy.polynomial import Chebyshev

from softstart.arrays import Complex, Vector
from softstart.balancing.parts import CYCLE_ANGLE, HIGHEST, Cylinders
from softstart.errors import InputError
from softstart.input.parameter_set import MaybeSeries, Number, ParameterSet, Series, parameter

LONGEST = math.pi / 12.0  # rad, of a panel
BURNT = math.log(1000.0)  # Vibe's 6.908: 99.9 % at the end, here scaled to all
DEGREE = 40  # of the polynomials that hold the heat integral
GRADES = (0.0, 2**-16, 2**-13, 2**-10, 2**-7, 2**-5, 1 / 8, 1 / 4, 1 / 2, 3 / 4, 1.0)  # finer at the start


def nodes(breaks: Sequence[float]) -> tuple[Vector, Vector]:
    """Gauss-Legendre nodes in [0, 4 pi) and their weights, none across a break.

    >>> theta, weights = nodes((1.0, 2.0))
    >>> bool(abs(weights @ np.cos(theta) ** 2 - 2 * math.pi) < 1e-13)
    True
    """
    edges = [0.0, *(b for b in sorted(breaks) if 0.0 < b < CYCLE_ANGLE), CYCLE_ANGLE]
    x, w = np.polynomial.legendre.leggauss(24)
    places, weights = [], []
    for low, high in pairwise(edges):
        count = max(1, math.ceil((high - low) / LONGEST))
        half = 0.5 * (high - low) / count
        places.append((low + half * (2.0 * np.arange(count)[:, None] + 1.0 + x)).ravel())
        weights.append(np.tile(half * w, count))
    return np.concatenate(places), np.concatenate(weights)


@lru_cache(maxsize=64)
def torque_harmonics(cycle: SimpleCycle, cylinders: Cylinders) -> Complex:
    """C_j of the torque Re sum C_j exp(i j theta/2), j = 0 .. 48, of one cylinder; a row per shape."""
    theta, weights = nodes(cycle.breaks())
    per_pressure = -cylinders.area * cylinders.crank.slope(theta)
    torque = cycle.shapes(cylinders, theta) * per_pressure * weights
    turning = np.exp(-0.5j * np.outer(theta, np.arange(2 * HIGHEST + 1)))
    # einsum: threads of a BLAS cost more than such a small product where other processes work too
    harmonics: Complex = np.einsum("sn,nj->sj", torque, turning) * (2.0 / CYCLE_ANGLE)
    harmonics[:, 0] *= 0.5
    harmonics.setflags(write=False)
    return harmonics


class SimpleCycle(ParameterSet, kw_only=False, what="a cycle"):
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
    >>> mean_torque = cycle.weights(one, 300.0, 1.0) @ torque_harmonics(cycle, one)[:, 0].real
    >>> round(float(CYCLE_ANGLE * mean_torque / one.displacement / 1e5), 9)
    10.0
    """

    USUAL: ClassVar[dict[str, str]] = {"speeds": "rpm"}

    compression_ratio: Number = parameter(
        "cycle.compression_ratio", "1", "compression ratio", "9.9", "above 0"
    )
    mean_indicated_pressure: Series = parameter(
        "cycle.mean_indicated_pressure", "Pa", "mean indicated pressure at full load, one or one a speed",
        '"10 bar"', "above 0", many=True,
    )  # fmt: skip
    speeds: MaybeSeries = parameter(
        "cycle.speeds", "rad/s", "speeds of these pressures", '["1000 rpm", "5600 rpm"]', "above 0",
        default=None, many=True,
    )  # fmt: skip
    intake_pressure: Number = parameter(
        "cycle.intake_pressure", "Pa", "pressure during intake at full load", '"0.9 bar"', "above 0",
        default=90000.0,
    )  # fmt: skip
    idle_pressure: Number = parameter(
        "cycle.idle_pressure", "Pa", "pressure during intake at load 0", '"0.3 bar"', "above 0",
        default=30000.0,
    )  # fmt: skip
    exhaust_pressure: Number = parameter(
        "cycle.exhaust_pressure", "Pa", "pressure during exhaust", '"1.1 bar"', "above 0", default=110000.0
    )
    crankcase_pressure: Number = parameter(
        "cycle.crankcase_pressure", "Pa", "pressure below the pistons", '"1 bar"', "above 0", default=100000.0
    )
    compression_exponent: Number = parameter(
        "cycle.compression_exponent", "1", "polytropic exponent of the compression", "1.32", default=1.32
    )
    expansion_exponent: Number = parameter(
        "cycle.expansion_exponent", "1", "polytropic exponent of the expansion", "1.27", default=1.27
    )
    combustion_start: Number = parameter(
        "cycle.combustion_start", "rad", "crank angle before dead centre at which combustion begins",
        '"15 deg"', "0 or more", default=math.radians(15.0),
    )  # fmt: skip
    combustion_duration: Number = parameter(
        "cycle.combustion_duration", "rad", "duration of the combustion", '"55 deg"', "above 0",
        default=math.radians(55.0),
    )  # fmt: skip
    vibe_exponent: Number = parameter(
        "cycle.vibe_exponent", "1", "shape exponent m of Vibe's law", "2", "above 0", default=2.0
    )
    exhaust_opening: Number = parameter(
        "cycle.exhaust_opening", "rad", "crank angle after dead centre at which the exhaust opens",
        '"130 deg"', "above 0", default=math.radians(130.0),
    )  # fmt: skip
    blowdown: Number = parameter(
        "cycle.blowdown", "rad", "duration of the fall to the exhaust pressure", '"70 deg"', "0 or more",
        default=math.radians(70.0),
    )  # fmt: skip

    def contradictions(self) -> Sequence[str]:
        """Sentences on values that contradict one another."""
        wrong = [
            f"{key} = {getattr(self, key):g}: it must be above 1."
            for key in ("compression_ratio", "compression_exponent", "expansion_exponent")
            if not getattr(self, key) > 1.0
        ]
        if self.idle_pressure > self.intake_pressure:
            wrong.append(
                f"idle_pressure = {self.idle_pressure:g} Pa: it must not be above intake_pressure = "
                f"{self.intake_pressure:g} Pa."
            )
        count, speeds = len(self.mean_indicated_pressure), self.speeds or (1.0,)
        if len(speeds) != count or np.any(np.diff(speeds) <= 0.0):
            wrong.append(
                f"speeds: {len(self.speeds or ())} for {count} in mean_indicated_pressure; give one pressure "
                "alone, or one for each of several rising speeds."
            )
        begin, length = self.combustion_start, self.combustion_duration
        angles = [-begin, length - begin, self.exhaust_opening, self.exhaust_opening + self.blowdown]
        limits = -math.pi < angles[0] and angles[2] <= math.pi and angles[3] <= 2.0 * math.pi
        if not (limits and angles[1] <= angles[2]):
            first, burnt, opening, last = (f"{math.degrees(angle):g}" for angle in angles)
            wrong.append(
                f"combustion_start, combustion_duration, exhaust_opening, blowdown: it burns from {first} to "
                f"{burnt} deg after dead centre, and the exhaust opens at {opening} deg, until {last} deg; "
                "burn from above -180 deg on and open the exhaust behind that, by 180 deg, until 360 deg."
            )
        return wrong

    def breaks(self) -> tuple[float, ...]:
        """Angles theta in rad at which the pressure changes its law."""
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
        shapes = np.zeros((4, theta.size))
        shapes[3] = 1.0
        psi = np.where(theta < 3.0 * math.pi, theta, theta - CYCLE_ANGLE)  # from firing dead centre
        end = self.exhaust_opening + self.blowdown
        closed = psi < end
        shapes[1, ~closed & (psi < 2.0 * math.pi)] = 1.0
        shapes[0, psi >= 2.0 * math.pi] = 1.0
        volume = self._volume(cylinders, psi[closed])
        full, start = (float(v) for v in self._volume(cylinders, np.array([math.pi, self.combustion_start])))
        n_c, n = self.compression_exponent, self.expansion_exponent
        compressed = (full / volume) ** n_c
        expanded = (full / start) ** n_c * (start / volume) ** n
        burning = psi[closed] >= -self.combustion_start
        shapes[0, closed] = np.where(burning, expanded, compressed)
        edges, pieces = _heat_pieces(self, cylinders)
        within = np.clip(psi[closed], edges[0], edges[-1])
        heat = np.piecewise(within, [within >= edge for edge in edges[:-1]], pieces)
        shapes[2, closed] = (n - 1.0) * heat / volume**n
        if self.blowdown > 0.0:
            with np.errstate(over="ignore"):  # a very short blowdown
                share = np.clip((psi[closed] - self.exhaust_opening) / self.blowdown, 0.0, 1.0)
            left = 0.5 * (1.0 + np.cos(math.pi * share))
            shapes[:3, closed] *= left
            shapes[1, closed] += 1.0 - left
        return shapes

    def weights(self, cylinders: Cylinders, speed: float, load: float) -> Vector:
        """Factors on `shapes` that give the pressure difference in Pa on the piston.

        `speed` in rad/s counts where `mean_indicated_pressure` is a table over speeds; outside of it the
        pressure at its end is kept.
        """
        intake = self.idle_pressure + load * (self.intake_pressure - self.idle_pressure)
        heat = self.heat(cylinders, speed) * intake / self.intake_pressure
        return np.array([intake, self.exhaust_pressure, heat, -self.crankcase_pressure])

    def heat(self, cylinders: Cylinders, speed: float) -> float:
        """Heat in J of one cycle of one cylinder at full load; raises InputError where it is negative."""
        pressure = float(np.interp(speed, self.speeds or (1.0,), self.mean_indicated_pressure))
        work = CYCLE_ANGLE * torque_harmonics(self, cylinders)[:, 0].real
        without = self.intake_pressure * work[0] + self.exhaust_pressure * work[1]
        heat = float((pressure * cylinders.displacement - without) / work[2])
        if heat < 0.0:
            raise InputError(
                f"mean_indicated_pressure = {pressure / 1e5:g} bar: the gas does more work without any heat; "
                "give a larger one."
            )
        return heat

    def _volume(self, cylinders: Cylinders, psi: Vector) -> Vector:
        clearance = cylinders.displacement / (self.compression_ratio - 1.0)
        return clearance + cylinders.stroke_volume(psi)

    def rate(self, cylinders: Cylinders, psi: Vector) -> Vector:
        """V^(n-1) dx/dpsi, x the share burnt."""
        tau = np.clip((psi + self.combustion_start) / self.combustion_duration, 0.0, 1.0)
        m = self.vibe_exponent
        burning = BURNT * (m + 1.0) * tau**m * np.exp(-BURNT * tau ** (m + 1.0))
        per_angle = burning / (-math.expm1(-BURNT) * self.combustion_duration)
        return np.asarray(self._volume(cylinders, psi) ** (self.expansion_exponent - 1.0) * per_angle)


@lru_cache(maxsize=16)
def _heat_pieces(cycle: SimpleCycle, cylinders: Cylinders) -> tuple[Vector, list[Chebyshev]]:
    """Edges of the pieces and, within each, the integral of V^(n-1) dx from the start of the combustion."""
    edges = cycle.combustion_duration * np.array(GRADES) - cycle.combustion_start
    pieces, before = [], 0.0
    for low, high in pairwise(edges):
        rate = Chebyshev.interpolate(lambda psi: cycle.rate(cylinders, psi), DEGREE, (low, high))
        pieces.append(rate.integ(lbnd=low, k=before))
        before = pieces[-1](high)
    return edges, pieces
