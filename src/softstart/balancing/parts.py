"""What an engine is made of, each part checked by itself: cylinders, masses, counterweights, shafts."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import ClassVar

import numpy as np

from softstart.arrays import Vector
from softstart.balancing.slider_crank import SliderCrank
from softstart.input.parameter_set import MaybeNumber, MaybeSeries, Number, ParameterSet, Series, parameter
from softstart.quantities import show

TURN = 2.0 * math.pi
CYCLE_ANGLE = 2.0 * TURN  # a four-stroke cycle
SAME = 1e-6  # rad: angles nearer than this are one
HIGHEST = 24  # order of the crank speed


class Cylinders(ParameterSet, kw_only=False, what="a row of cylinders"):
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

    bore: Number = parameter("cylinders.bore", "m", "bore", '"82 mm"', "above 0")
    stroke: Number = parameter("cylinders.stroke", "m", "stroke", '"71 mm"', "above 0")
    rod_length: Number = parameter(
        "cylinders.rod_length", "m", "length of the connecting rod", '"121 mm"', "above 0"
    )
    spacing: Number = parameter(
        "cylinders.spacing", "m", "distance between neighbouring cylinders", '"89 mm"', "0 or more",
        default=0.0,
    )  # fmt: skip
    firing_angles: Series = parameter(
        "cylinders.firing_angles", "rad", "crank angles of the firing dead centres, cylinder by cylinder",
        '["0 deg", "360 deg"]', default=None, many=True,
    )  # fmt: skip
    firing_order: MaybeSeries = parameter(
        "cylinders.firing_order", "1", "order in which the cylinders fire, evenly over two turns",
        "[1, 3, 4, 2]", default=None, many=True,
    )  # fmt: skip

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
                self._derive(firing_angles=angles, firing_order=None)
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
    def couples_known(self) -> bool:
        """Whether their spacing is given, or there is one."""
        return self.spacing > 0.0 or self.count == 1

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


class Masses(ParameterSet, kw_only=False, what="a set of masses"):
    """Masses in kg of one cylinder; the rod is split between piston pin and crank pin.

    `inertia` in kg m^2 of crank and flywheel is only needed for the speed fluctuation.
    """

    reciprocating: Number = parameter(
        "masses.reciprocating", "kg", "reciprocating mass of one cylinder", '"0.68 kg"', "above 0"
    )
    rotating: Number = parameter(
        "masses.rotating", "kg", "rotating mass of one throw, at the crank pin", '"0.5 kg"', "0 or more",
        default=0.0,
    )  # fmt: skip
    inertia: MaybeNumber = parameter(
        "masses.inertia", "kg*m^2", "inertia of crank and flywheel", '"0.12 kg*m^2"', "above 0", default=None
    )


class Counterweights(ParameterSet, kw_only=False, what="a set of counterweights"):
    """Counterweights opposite to each throw, as shares of the masses they balance."""

    reciprocating_share: Number = parameter(
        "counterweights.reciprocating_share", "1",
        "share of the reciprocating masses balanced on the crank", "0.5", "from 0 to 1", default=0.0,
    )  # fmt: skip
    rotating_share: Number = parameter(
        "counterweights.rotating_share", "1", "share of the rotating masses balanced on the crank", "1",
        "from 0 to 1", default=1.0,
    )  # fmt: skip


class Operation(ParameterSet, kw_only=False, what="an operation"):
    """Speed range in rad/s, load (1 is full, 0 is idling), and the speed at which a balancer is tuned."""

    USUAL: ClassVar[dict[str, str]] = dict.fromkeys(("lowest_speed", "highest_speed", "tuning_speed"), "rpm")

    lowest_speed: Number = parameter(
        "operation.lowest_speed", "rad/s", "lowest speed", '"850 rpm"', "above 0"
    )
    highest_speed: Number = parameter(
        "operation.highest_speed", "rad/s", "highest speed", '"5600 rpm"', "above 0"
    )
    load: Number = parameter("operation.load", "1", "load", "1", "from 0 to 1", default=1.0)
    tuning_speed: MaybeNumber = parameter(
        "balancer.tuning_speed", "rad/s", "tuning speed, by default the highest", '"4500 rpm"', "above 0",
        default=None,
    )  # fmt: skip

    def contradictions(self) -> Sequence[str]:
        """The range."""
        if self.lowest_speed < self.highest_speed:
            return ()
        return (
            f"highest_speed = {self.highest_speed:g} rad/s: it must be above lowest_speed = "
            f"{self.lowest_speed:g} rad/s.",
        )


class BalancerShaft(ParameterSet, kw_only=False, what="a balancer shaft"):
    """One balancer shaft. At crank angle phi its mass points at the angle `ratio phi + phase` from the top.

    `imbalance` in kg m; `ratio` a whole number, negative if it turns against the crank; `height` in m above
    the crank axis, `offset` in m to the side to which the crank turns on top, `along` in m.

    >>> BalancerShaft("0.0227 kg*m", -1, phase="180 deg", height="30 mm").imbalance
    0.0227
    """

    imbalance: Number = parameter(
        "shaft.imbalance", "kg*m", "imbalance, mass times radius", '"0.02 kg*m"', "above 0"
    )
    ratio: Number = parameter("shaft.ratio", "1", "speed over that of the crank, negative if opposite", "-1")
    phase: Number = parameter(
        "shaft.phase", "rad", "angle of its mass at crank angle 0", '"180 deg"', default=0.0
    )
    height: Number = parameter(
        "shaft.height", "m", "height of the shaft above the crank", '"30 mm"', default=0.0
    )
    offset: Number = parameter(
        "shaft.offset", "m", "sideways offset of the shaft from the crank", '"80 mm"', default=0.0
    )
    along: Number = parameter(
        "shaft.along", "m", "place of its mass along the crank, from the middle", '"0 mm"', default=0.0
    )

    def contradictions(self) -> Sequence[str]:
        """The ratio."""
        if self.ratio == round(self.ratio) and 1 <= abs(self.ratio) <= HIGHEST:
            return ()
        return (
            f"ratio = {self.ratio:g}: a balancer shaft turns a whole number of times a turn of the crank, as "
            f"-1 (opposite) or 2, at most {HIGHEST}.",
        )

    @property
    def place(self) -> complex:
        """Height + i offset, in m."""
        return complex(self.height, self.offset)
