"""The ranges of sliders and of the map, about the drive as it was loaded."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from softstart.controller.base import Controller
from softstart.drive import Drive
from softstart.tuning.ranges import ranges_of, tunable

STEPS = 600
DIGITS = 4
GAPS, INERTIAS = 25, 17  # of the map


def rounded(value: float, digits: int = DIGITS) -> float:
    """A value with so many significant digits, so that the field shows what is computed with.

    >>> rounded(0.123456), rounded(0.0)
    (0.1235, 0.0)
    """
    return float(f"{value:.{digits}g}")


@dataclass(frozen=True)
class Scale:
    """A slider from `low` to `high`, even in the value or in its logarithm.

    >>> scale = Scale(0.0, 2.0)
    >>> scale.value(150), scale.position(0.5)
    (0.5, 150)
    """

    low: float
    high: float
    logarithmic: bool = False

    def value(self, position: float) -> float:
        """The value at a position from 0 to STEPS."""
        share = min(max(position / STEPS, 0.0), 1.0)
        if share in (0.0, 1.0):
            return self.high if share else self.low
        if self.logarithmic:
            return rounded(self.low * (self.high / self.low) ** share)
        return rounded(self.low + (self.high - self.low) * share)

    def position(self, value: float) -> int:
        """The position nearest to a value; beyond the ends it is the end."""
        if self.logarithmic:
            share = math.log(value / self.low) / math.log(self.high / self.low) if value > 0.0 else 0.0
        else:
            share = (value - self.low) / (self.high - self.low)
        return round(STEPS * min(max(share, 0.0), 1.0))


def scales_about(origin: Drive) -> Mapping[str, Scale]:
    """The sliders of the main parameters, about the drive as it was loaded; by name of the parameter.

    >>> scales_about(Drive.load("crane-4amtkf"))["gap"]
    Scale(low=0.0, high=2.0, logarithmic=False)
    """
    J1, J2, c, d = float(origin.J1), float(origin.J2), float(origin.c), float(origin.d)
    Ms, Mc, gap = float(origin.Ms), float(origin.Mc), float(origin.gap)
    critical = 2.0 * math.sqrt(c * J1 * J2 / (J1 + J2))
    highest = float(origin.maximum_torque)
    weakest = rounded(min(max(1.1 * Mc, 0.1 * Ms), 0.9 * Ms), 2)

    def about(value: float) -> Scale:
        return Scale(rounded(value / 5.0), rounded(value * 5.0), logarithmic=True)

    target = float(origin.target_speed)
    return MappingProxyType(
        {
            "starting_torque": Scale(weakest, max(highest, Ms)),
            "motor_inertia": about(J1),
            "torque_lag": Scale(0.0, rounded(max(0.02, 4.0 * float(origin.torque_lag)), 2)),
            "stiffness": about(c),
            "damping": Scale(0.0, rounded(max(0.3 * critical, 2.0 * d), 2)),
            "gap": Scale(0.0, 4.0 * gap if gap > 0.0 else 0.1),
            "load_inertia": about(J2),
            "load_torque": Scale(min(0.0, 2.0 * Mc), rounded(0.95 * Ms, 3)),
            "target_speed": Scale(rounded(0.2 * target), rounded(2.0 * target)),
        }
    )


def scales_of(controller: Controller, origin: Drive) -> Mapping[str, Scale]:
    """Sliders of a strategy's parameters, as far as tuning would go, about the drive as it was loaded.

    >>> from softstart.controller import make_controller
    >>> scales_of(make_controller("s-curve"), Drive.load("crane-4amtkf"))["rounding"]
    Scale(low=0.0, high=1.0, logarithmic=False)
    """
    found = {}
    default = controller.defaults(origin.assumed)
    names = tunable(controller)
    for one in ranges_of(controller, names) if names else ():
        low, high = (rounded(float(end)) for end in one.ends(default.get(one.name, 1.0)))
        if low < high:
            found[one.name] = Scale(low, high, one.logarithmic and low > 0.0)
    return MappingProxyType(found)


@dataclass(frozen=True)
class Axes:
    """The gaps (rad) and load inertias (kg m2) of a map, ascending."""

    gaps: tuple[float, ...]
    inertias: tuple[float, ...]

    def nearest(self, gap: float, inertia: float) -> tuple[int, int]:
        """Indices of the cell in which a drive lies: the gap's scale is even, the inertia's logarithmic."""
        column = int(np.argmin(np.abs(np.array(self.gaps) - gap)))
        row = int(np.argmin(np.abs(np.log(np.array(self.inertias) / inertia))))
        return column, row


def axes_about(origin: Drive, gaps: int = GAPS, inertias: int = INERTIAS) -> Axes:
    """Gaps up to four times that of the drive as it was loaded, inertias from a fifth to five times its own.

    >>> axes = axes_about(Drive.load("crane-4amtkf"), 5, 3)
    >>> axes.gaps, axes.inertias
    ((0.0, 0.5, 1.0, 1.5, 2.0), (0.035, 0.175, 0.875))
    """
    gap, inertia = float(origin.gap), float(origin.load_inertia)
    widest = 4.0 * gap if gap > 0.0 else 0.1
    return Axes(
        tuple(rounded(v, 6) for v in np.linspace(0.0, widest, gaps)),
        tuple(rounded(v, 6) for v in np.geomspace(inertia / 5.0, inertia * 5.0, inertias)),
    )
