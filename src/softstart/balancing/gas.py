"""The gas pressure in a cylinder over a four-stroke cycle, its work and the harmonics of its torque.

theta is the crank angle of one cylinder from its firing dead centre: expansion to pi, exhaust to 2 pi, intake
to 3 pi, compression to 4 pi. The pressure is that of a simple cycle in closed form (`SimpleCycle`), or was
measured (`MeasuredCycle`). It is given as `weights @ shapes(theta)`: whatever is linear in it (work, torque,
harmonics) is computed once for each shape, for all speeds and loads. Integrals over a cycle are exact to
rounding, since the pressure is smooth between known angles.
"""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from typing import ClassVar

import numpy as np
from numpy.polynomial import Chebyshev

from softstart.arrays import Complex, Vector
from softstart.balancing.parts import CYCLE_ANGLE, Cylinders
from softstart.errors import InputError
from softstart.input.columns import Wanted, read_columns
from softstart.input.files import text_of
from softstart.input.parameter_set import MaybeSeries, Number, ParameterSet, Series, parameter
from softstart.quantities import to_si

LONGEST = math.pi / 12.0  # rad, of a panel
MANY = 100  # breaks, as of a measured pressure, leave panels so short that few nodes suffice
BURNT = math.log(1000.0)  # Vibe's 6.908: 99.9 % at the end, here scaled to all
DEGREE = 40  # of the polynomials that hold the heat integral
GRADES = (0.0, 2**-16, 2**-13, 2**-10, 2**-7, 2**-5, 1 / 8, 1 / 4, 1 / 2, 3 / 4, 1.0)  # finer at the start
FEWEST = 24  # angles of a measurement
WIDEST = math.radians(30.0)  # between neighbouring angles
EXAMPLE = "angle [deg],pressure [bar]"


def nodes(breaks: Sequence[float]) -> tuple[Vector, Vector]:
    """Gauss-Legendre nodes in [0, 4 pi) and their weights, none across a break.

    >>> theta, weights = nodes((1.0, 2.0))
    >>> bool(abs(weights @ np.cos(theta) ** 2 - 2 * math.pi) < 1e-13)
    True
    """
    edges = [0.0, *(b for b in sorted(breaks) if 0.0 < b < CYCLE_ANGLE), CYCLE_ANGLE]
    x, w = np.polynomial.legendre.leggauss(10 if len(breaks) > MANY else 24)
    places, weights = [], []
    for low, high in pairwise(edges):
        count = max(1, math.ceil((high - low) / LONGEST))
        half = 0.5 * (high - low) / count
        places.append((low + half * (2.0 * np.arange(count)[:, None] + 1.0 + x)).ravel())
        weights.append(np.tile(half * w, count))
    return np.concatenate(places), np.concatenate(weights)


@lru_cache(maxsize=32)
def _torque_shapes(cycle: Gas, cylinders: Cylinders) -> tuple[Vector, Vector]:
    """The nodes, and weights times the torque on the crank of each shape of pressure."""
    theta, weights = nodes(cycle.breaks())
    per_pressure = -cylinders.area * cylinders.crank.slope(theta)
    return theta, cycle.shapes(cylinders, theta) * per_pressure * weights


@lru_cache(maxsize=64)
def shape_work(cycle: Gas, cylinders: Cylinders) -> Vector:
    """Work in J of one cycle of one cylinder for each shape."""
    work: Vector = _torque_shapes(cycle, cylinders)[1].sum(axis=1)
    work.setflags(write=False)
    return work


@lru_cache(maxsize=32)
def torque_harmonics(cycle: Gas, cylinders: Cylinders, highest: int) -> Complex:
    """C_j of the torque Re sum C_j exp(i j theta/2), j = 0 .. 2 highest, of one cylinder; a row per shape."""
    theta, torque = _torque_shapes(cycle, cylinders)
    turning = np.exp(-0.5j * np.outer(theta, np.arange(2 * highest + 1)))
    # einsum: threads of a BLAS cost more than such a small product where other processes work too
    found: Complex = np.einsum("sn,nj->sj", torque, turning) * (2.0 / CYCLE_ANGLE)
    found[:, 0] *= 0.5
    found.setflags(write=False)
    return found


class SimpleCycle(ParameterSet, kw_only=False):
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

    WHAT: ClassVar[str] = "a cycle"

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
        edges, pieces = _heat_pieces(self, cylinders)
        within = np.clip(psi[closed], edges[0], edges[-1])
        heat = np.piecewise(within, [within >= edge for edge in edges[:-1]], pieces)
        found[2, closed] = (n - 1.0) * heat / volume**n
        if self.blowdown > 0.0:
            with np.errstate(over="ignore"):  # a very short blowdown
                share = np.clip((psi[closed] - self.exhaust_opening) / self.blowdown, 0.0, 1.0)
            left = 0.5 * (1.0 + np.cos(math.pi * share))
            found[:3, closed] *= left
            found[1, closed] += 1.0 - left
        return found

    def weights(self, cylinders: Cylinders, speed: float, load: float) -> Vector:
        """Factors on `shapes` that give the pressure difference in Pa on the piston.

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
        """Sentences on what is impossible with these cylinders."""
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


@dataclass(frozen=True)
class MeasuredCycle:
    """Pressures in Pa at rising crank angles in rad, 0 at the firing dead centre; straight lines between.

    The angles cover one cycle of 4 pi, wherever it begins (-360 deg to 360 deg is usual). It is used for all
    speeds and loads: a measurement at one operating point says nothing about others.

    >>> angles = np.radians(np.arange(-360.0, 360.0, 10.0))
    >>> MeasuredCycle(tuple(angles), tuple(1e5 + 0 * angles)).refuse(None)
    ()
    """

    angles: tuple[float, ...]
    pressures: tuple[float, ...]
    crankcase_pressure: float = 1e5

    def __post_init__(self) -> None:
        wrong = []
        angles = to_si(list(self.angles), "rad", "angles")
        pressures = to_si(list(self.pressures), "Pa", "pressures")
        if np.size(angles) != np.size(pressures):
            wrong.append(f"pressures: there are {np.size(pressures)} pressures for {np.size(angles)} angles.")
        else:
            wrong += _errors(np.asarray(angles), np.asarray(pressures))
        if wrong:
            raise InputError(wrong)
        object.__setattr__(self, "angles", tuple(np.asarray(angles).tolist()))
        object.__setattr__(self, "pressures", tuple(np.asarray(pressures).tolist()))
        object.__setattr__(
            self, "crankcase_pressure", to_si(self.crankcase_pressure, "Pa", "crankcase_pressure")
        )

    @classmethod
    def from_csv(cls, path: str | os.PathLike[str], crankcase_pressure: float = 1e5) -> MeasuredCycle:
        """From a CSV file whose first line names two columns with their units: angle [deg],pressure [bar].

        Raises InputError with the line.
        """
        place = f'"{path}"'
        wanted = (Wanted(("angle",), "rad"), Wanted(("pressure",), "Pa"))
        text = text_of(path, f"a table with {EXAMPLE}", "CSV")
        angles, pressures = read_columns(text, place, wanted, headed="units").values
        try:
            return cls(tuple(angles.tolist()), tuple(pressures.tolist()), crankcase_pressure)
        except InputError as error:
            raise InputError(f"{place}: {sentence}" for sentence in error.sentences) from None

    def to_csv(self) -> str:
        """The pressure as the CSV text that it is read from."""
        rows = zip(self.angles, self.pressures, strict=True)
        return "angle [rad],pressure [Pa]\n" + "".join(f"{phi!r},{p!r}\n" for phi, p in rows)

    def breaks(self) -> tuple[float, ...]:
        """The angles measured."""
        return tuple(sorted({float(a) for a in np.mod(self.angles, CYCLE_ANGLE)}))

    def shapes(self, cylinders: Cylinders, theta: Vector) -> Vector:
        """The pressure, and 1."""
        found = np.interp(theta, self.angles, self.pressures, period=CYCLE_ANGLE)
        return np.stack([found, np.ones_like(found)])

    def weights(self, cylinders: Cylinders, speed: float, load: float) -> Vector:
        """The pressure less that below the piston, whatever speed and load are."""
        return np.array([1.0, -self.crankcase_pressure])

    def refuse(self, cylinders: Cylinders | None) -> Sequence[str]:
        """No sentences: a measured pressure fits any cylinders."""
        return ()


def _errors(angles: Vector, pressures: Vector) -> list[str]:
    wrong = []
    if angles.size < FEWEST:
        return [f"there are {angles.size} angles, and a cycle needs at least {FEWEST}."]
    steps = np.diff(angles)
    if np.any(steps <= 0.0):
        i = int(np.argmax(steps <= 0.0)) + 1
        wrong.append(
            f"angle {i + 1} = {math.degrees(angles[i]):g} deg: each must be above the one before it."
        )
    span = angles[-1] - angles[0]
    if span > CYCLE_ANGLE + 1e-9:
        wrong.append(f"the angles span {math.degrees(span):g} deg, and a cycle has 720 deg; give one cycle.")
    elif not wrong:
        widest = max(float(steps.max()), CYCLE_ANGLE - span)
        if widest > WIDEST:
            wrong.append(
                f"there is nothing over {math.degrees(widest):g} deg; give the whole cycle of 720 deg in "
                f"steps of at most {math.degrees(WIDEST):g} deg."
            )
        if span > CYCLE_ANGLE - 1e-9 and pressures[0] != pressures[-1]:
            wrong.append("the first and last angle are 720 deg apart, and their pressures differ; drop one.")
    if np.any(pressures <= 0.0):
        i = int(np.argmax(pressures <= 0.0))
        wrong.append(f"pressure {i + 1} = {pressures[i]:g} Pa: an absolute pressure is above 0.")
    return wrong


Gas = SimpleCycle | MeasuredCycle  # where the pressure comes from
