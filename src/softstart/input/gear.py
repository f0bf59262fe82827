"""The output of a gear: one rule that brings its values to the motor shaft and back, and "... at output"."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from softstart.quantities import RefusedError

BEHIND = re.compile(r"(.*\S)\s+at\s+(?:the\s+)?output(?:\s+shaft)?\s*", re.IGNORECASE)  # "9 arcmin at output"
_MULTIPLE = re.compile(r".*(x|J1)\s*", re.IGNORECASE)
NO_GEAR = 'without gear.ratio nothing is "at output"; give it, or write the value at the motor shaft'
OWN_SIDE = (
    'a shaft of a chain has its values on the side of its gear that `side` names; leave out "at output", '
    'and write side = "before" or "after"'
)
NO_OUTPUT = (
    'the gears of a chain are in its shafts, so that it has no one output; leave out "at output", and write '
    "the value at the motor shaft, or that of one shaft at its own side, as shaft[2].gap"
)
# exponents of the ratio i and of the efficiency eta in what a value at the output is over that at the motor
POWERS = {
    **dict.fromkeys(("N*m", "N*m/s"), (1, 1)),
    **dict.fromkeys(("kg*m^2", "N*m/rad", "N*m*s/rad"), (2, 1)),
    **dict.fromkeys(("rad", "rad/s"), (-1, 0)),
}


class Gear(NamedTuple):
    """What lies between motor shaft and output: the ratio i (turns of the motor for one of the output), eta.

    A torque M at the output is M/(i eta) at the motor shaft; an inertia, a stiffness and a damping are
    divided by i^2 eta, an angle and a speed multiplied by i. A load below 0 drives the motor: it is
    M eta/i there. Power flows one way: all torques of a machine, of motor and shaft, parts of its load and
    limits, go as its whole `load`, so that ratios among them are the same at both shafts. Without one a
    torque goes by its own sign.

    >>> gear = Gear(40.0, 0.8)
    >>> gear.to_motor(1600.0, "N*m"), gear.to_motor(0.01, "rad"), gear.to_output(25.0, "N*m/rad")
    (50.0, 0.4, 32000.0)
    >>> gear.to_motor(-1600.0, "N*m"), gear.to_output(-32.0, "N*m")
    (-32.0, -1600.0)
    >>> [Gear(40.0, 0.8, load=-1500.0).to_motor(part, "N*m") for part in (-1600.0, 100.0)]
    [-32.0, 2.0]
    """

    ratio: float
    efficiency: float = 1.0
    load: Any = None

    def factor(self, unit: str) -> Any:
        """What a value of this SI unit at the output is over the same at the motor shaft; None: no such."""
        of_ratio, of_efficiency = POWERS.get(unit, (0, 0))
        return self.ratio**of_ratio * self.efficiency**of_efficiency if of_ratio else None

    def like(self, other: Gear) -> bool:
        """Whether all values go through the other as through this one: the same ratio, and factor of torques.

        >>> lifted = Gear(40.0, 0.8, load=5.0)
        >>> lifted.like(Gear(40.0, 0.8, load=7.0)), lifted.like(Gear(40.0, 0.8, load=-5.0))
        (True, False)
        """
        both = zip((*self[:2], self.of_torques), (*other[:2], other.of_torques), strict=True)
        return all(np.array_equal(mine, its) for mine, its in both)

    def to_motor(self, value: Any, unit: str) -> Any:
        """A value at the output, in its SI unit, at the motor shaft."""
        turns = POWERS[unit] == (-1, 0)
        return value * self.ratio if turns else value / self._factor(value, unit)

    def to_output(self, value: Any, unit: str) -> Any:
        """A value at the motor shaft, in its SI unit, at the output."""
        turns = POWERS[unit] == (-1, 0)
        return value / self.ratio if turns else value * self._factor(value, unit)

    def _factor(self, value: Any, unit: str) -> Any:
        """The factor of a value, which of a torque goes with the sign of the load, or with its own."""
        drives = np.asarray(value if self.load is None else self.load) < 0.0
        if POWERS[unit] != (1, 1) or not np.any(drives):
            return self.factor(unit)
        if np.all(drives):
            return self.ratio / self.efficiency
        either = np.where(drives, self.ratio / self.efficiency, self.factor(unit))
        return either

    @property
    def of_torques(self) -> Any:
        """What a torque at the output is over the same at the motor shaft, whatever its sign.

        >>> Gear(40.0, 0.8, load=5.0).of_torques, Gear(40.0, 0.8, load=-5.0).of_torques
        (32.0, 50.0)
        """
        return self.to_output(1.0, "N*m")


def behind(value: object) -> bool:
    """Whether "at output" stands behind a value, or behind one of a list.

    >>> behind("9 arcmin at output"), behind(["80 N*m at output"]), behind(0.5)
    (True, True, False)
    """
    each = value if isinstance(value, list | tuple) else [value]
    return any(isinstance(one, str) and BEHIND.fullmatch(one) for one in each)


def alike(values: Sequence[object]) -> None:
    """Raise `RefusedError` where "at output" stands behind some values of a list alone.

    0 and multiples, as "2x", are the same at both shafts.

    >>> alike(["1x", "9 arcmin at output", 0])
    >>> alike(["4.5 arcmin", "9 arcmin at output"])
    Traceback (most recent call last):
    softstart.quantities.RefusedError: "at output" stands behind some of the values only; write it behind ...
    """
    either = [one for one in map(str, values) if re.search(r"[1-9]", one) and not _MULTIPLE.fullmatch(one)]
    if len({BEHIND.fullmatch(one) is not None for one in either}) > 1:
        raise RefusedError(
            '"at output" stands behind some of the values only; write it behind each that is there, and '
            "bring the others there too"
        )
