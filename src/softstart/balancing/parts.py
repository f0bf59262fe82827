"""What an engine is made of, each part checked by itself: cylinders, masses, counterweights, shafts."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any, ClassVar

import numpy as np

from softstart.arrays import Vector
from softstart.balancing.slider_crank import SliderCrank
from softstart.balancing.tables import BALANCER, COUNTERWEIGHTS, CYLINDERS, MASSES, OPERATION, SHAFT
from softstart.errors import InputError
from softstart.input.documents import Table, read_table
from softstart.quantities import show

__all__ = [
    "CYCLE_ANGLE",
    "BalancerShaft",
    "Counterweights",
    "Cylinders",
    "Layout",
    "Masses",
    "Operation",
    "Part",
    "Quantity",
]

Quantity = float | str  # a number in SI, or a string with a unit
TURN = 2.0 * math.pi
CYCLE_ANGLE = 2.0 * TURN  # a four-stroke cycle
SAME = 1e-6  # rad: angles nearer than this are one


class Part:
    """A part whose fields are those of a table: checked and brought to SI when it is made."""

    TABLE: ClassVar[Table]

    def __post_init__(self) -> None:
        known: Any = self
        given = {one.name: getattr(self, one.name) for one in fields(known)}
        for key, value in read_table(given, self.TABLE).items():
            object.__setattr__(self, key, tuple(value.tolist()) if isinstance(value, np.ndarray) else value)
        wrong = list(self.contradictions())
        if wrong:
            raise InputError(wrong)

    def contradictions(self) -> Sequence[str]:
        """Sentences on values that contradict one another."""
        return ()


@dataclass(frozen=True)
class Cylinders(Part):
    """Equal cylinders in one row. Lengths in m, angles in rad; strings with units are read.

    `firing_angles` are the crank angles at which each cylinder, counted along the row, is at its firing dead
    centre. They say both when it fires in the cycle of two turns and where its throw is: its throw is on top
    there. An evenly firing engine may be given by its `firing_order` instead.

    >>> four = Cylinders("80 mm", "80 mm", "130 mm", firing_order=(1, 3, 4, 2))
    >>> [round(math.degrees(angle)) for angle in four.firing_angles]
    [0, 540, 180, 360]
    >>> [round(math.degrees(angle)) for angle in four.throw_angles]
    [0, 180, 180, 0]
    """

    bore: float
    stroke: float
    rod_length: float
    spacing: float = 0.0
    firing_angles: tuple[float, ...] = None  # type: ignore[assignment]
    firing_order: tuple[float, ...] | None = None

    TABLE: ClassVar[Table] = CYLINDERS

    def contradictions(self) -> Sequence[str]:
        """The rod, and when the cylinders fire."""
        wrong = []
        if self.rod_length <= 0.5 * self.stroke:
            wrong.append(
                f"rod_length = {self.rod_length:g} m: the rod must be longer than the crank radius, half the "
                f"stroke: {0.5 * self.stroke:g} m."
            )
        if (self.firing_angles is None) == (self.firing_order is None):
            how = "both are" if self.firing_order is not None else "neither is"
            wrong.append(
                f"firing_angles, firing_order: one of the two says when the cylinders fire, and {how} given; "
                'write firing_angles = ["0 deg", "360 deg"] or firing_order = [1, 2].'
            )
        elif self.firing_order is not None:
            order = [int(number) for number in self.firing_order]
            count = len(order)
            if sorted(self.firing_order) != list(range(1, count + 1)):
                wrong.append(
                    f"firing_order = {show([f'{n:g}' for n in self.firing_order])}: each cylinder from 1 to "
                    f"{count} is named once, as [1, 3, 4, 2]."
                )
            else:
                angles = tuple(order.index(n) * CYCLE_ANGLE / count for n in range(1, count + 1))
                object.__setattr__(self, "firing_angles", angles)
                object.__setattr__(self, "firing_order", None)
        else:
            for i, angle in enumerate(self.firing_angles):
                if not 0.0 <= angle < CYCLE_ANGLE:
                    wrong.append(
                        f"firing_angles[{i}] = {math.degrees(angle):g} deg: an angle in the cycle is from 0 "
                        "to below 720 deg."
                    )
        return wrong

    @property
    def count(self) -> int:
        """How many cylinders."""
        return len(self.firing_angles)

    @property
    def crank(self) -> SliderCrank:
        """The crank drive of each."""
        return SliderCrank(0.5 * self.stroke, self.rod_length)

    @property
    def area(self) -> float:
        """Area of a piston in m^2."""
        return 0.25 * math.pi * self.bore**2

    @property
    def displacement(self) -> float:
        """Displacement of one cylinder in m^3."""
        return self.area * self.stroke

    @property
    def throw_angles(self) -> tuple[float, ...]:
        """Angle in rad, in the sense of rotation, of each throw at crank angle 0: 0 is on top."""
        ahead = np.mod(-np.array(self.firing_angles), TURN)
        return tuple(float(a) for a in np.where(TURN - ahead < SAME, 0.0, ahead))

    @property
    def places(self) -> tuple[float, ...]:
        """Place in m of each cylinder along the crank, from the middle."""
        return tuple((i - 0.5 * (self.count - 1)) * self.spacing for i in range(self.count))

    def stroke_volume(self, phi: Vector) -> Vector:
        """Volume in m^3 above the piston, without that at top dead centre; phi from TDC."""
        crank = self.crank
        return self.area * (crank.r + crank.rod - crank.height(phi))


@dataclass(frozen=True)
class Masses(Part):
    """Masses in kg of one cylinder; the rod is split between piston pin and crank pin.

    `inertia` in kg m^2 of crank and flywheel is only needed for the speed fluctuation.
    """

    reciprocating: float
    rotating: float = 0.0
    inertia: float | None = None

    TABLE: ClassVar[Table] = MASSES


@dataclass(frozen=True)
class Counterweights(Part):
    """Counterweights opposite to each throw, as shares of the masses they balance."""

    reciprocating_share: float = 0.0
    rotating_share: float = 1.0

    TABLE: ClassVar[Table] = COUNTERWEIGHTS


@dataclass(frozen=True)
class Operation(Part):
    """Speed range in rad/s, and load: 1 is full, 0 is idling."""

    lowest_speed: float
    highest_speed: float
    load: float = 1.0

    TABLE: ClassVar[Table] = OPERATION

    def contradictions(self) -> Sequence[str]:
        """The range."""
        if self.lowest_speed < self.highest_speed:
            return ()
        return (
            f"highest_speed = {self.highest_speed:g} rad/s: it must be above lowest_speed = "
            f"{self.lowest_speed:g} rad/s.",
        )


@dataclass(frozen=True)
class Layout(Part):
    """Given values of a two-shaft balancer to be designed: tuning speed in rad/s, shaft distance in m."""

    tuning_speed: float
    spacing: float = 0.0

    TABLE: ClassVar[Table] = BALANCER


@dataclass(frozen=True)
class BalancerShaft(Part):
    """One balancer shaft. At crank angle phi its mass points at the angle `ratio phi + phase` from the top.

    `imbalance` in kg m; `ratio` a whole number, negative if it turns against the crank; `height` in m above
    the crank axis, `offset` in m to the side to which the crank turns on top, `along` in m.

    >>> BalancerShaft("0.0227 kg*m", -1, phase="180 deg", height="30 mm").imbalance
    0.0227
    """

    imbalance: float
    ratio: float
    phase: float = 0.0
    height: float = 0.0
    offset: float = 0.0
    along: float = 0.0

    TABLE: ClassVar[Table] = SHAFT

    def contradictions(self) -> Sequence[str]:
        """The ratio."""
        if self.ratio and self.ratio == round(self.ratio):
            return ()
        return (
            f"ratio = {self.ratio:g}: a balancer shaft turns a whole number of times a turn of the crank, as "
            "-1 (opposite) or 2.",
        )

    @property
    def place(self) -> complex:
        """Height + i offset, in m."""
        return complex(self.height, self.offset)
