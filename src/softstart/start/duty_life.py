"""How long the shafts of a machine last that repeats a duty: cycles of the whole trace, damage, shifts."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softstart.arrays import Matrix, Vector
from softstart.drive import Limits, Machine, Shift, SNCurve
from softstart.results import OneLine
from softstart.start.fatigue import check_shafts, curve_of, indexed_cycles, miner
from softstart.start.recommendation import Margin

SECONDS_PER_HOUR = 3600.0


@dataclass(frozen=True, eq=False, repr=False)
class ShaftLife(OneLine):
    """What one cycle of a duty does to one shaft, and how often it can be repeated.

    Attributes
    ----------
    shaft : str
        The shaft by the masses that it joins.
    spectrum : array of shape (k, 3)
        Range and mean, N m at the motor shaft, and number of the rainflow cycles in one cycle of the duty.
    damage : float
        Miner's sum of one cycle of the duty; without points of the S-N curve beside cycles of 1 N m.
    equivalent_torque : float
        Damage-equivalent torque, N m: one cycle of it from 0 and back in each cycle of the duty does the same
        damage.
    cycles : float
        Cycles of the duty to failure; NaN without points of the S-N curve.
    hours, shifts, years : float
        Time of operation to failure; NaN where the S-N curve has no points or the duty no shift.
    shares : array
        The share of each step of the file in the damage: a rainflow cycle counts for the step in which its
        end with the larger |T| is.
    """

    shaft: str
    spectrum: Matrix
    damage: float
    equivalent_torque: float
    cycles: float
    hours: float
    shifts: float
    years: float
    shares: Vector

    def summary(self) -> dict[str, object]:
        """The figures under the names used everywhere."""
        return {
            "shaft": self.shaft,
            "equivalent_torque": self.equivalent_torque,
            "damage": math.nan if math.isnan(self.cycles) else self.damage,
            "cycles_to_failure": self.cycles,
            "hours": self.hours,
            "shifts": self.shifts,
            "years": self.years,
            "damage_shares": self.shares.tolist(),
        }


@dataclass(frozen=True, eq=False, repr=False)
class DutyLife(OneLine):
    """Lives of the shafts of a machine that repeats a duty. It is returned by `DutyRun.life`.

    Attributes
    ----------
    curve : SNCurve
        The S-N curve of all shafts: slope m, and points if there are any.
    slope_given : bool
        Whether the S-N curve is the user's; else the slope is that of case-hardened gears.
    counted : int
        The number of cycles of the duty over which the torque is counted.
    shift : Shift or None
        How often the duty is repeated.
    shafts : tuple of ShaftLife
        One for each shaft.
    """

    curve: SNCurve
    slope_given: bool
    counted: int
    shift: Shift | None
    shafts: tuple[ShaftLife, ...]

    @property
    def worst(self) -> ShaftLife:
        """The shaft that takes most damage."""
        return max(self.shafts, key=lambda one: one.damage)

    def margin(self, limits: Limits) -> Margin | None:
        """The margin to a required life, limits.life; None without one, or where the life is not known."""
        hours = self.worst.hours
        limit = next((one for one in limits.each if one.figure == "used_life"), None)
        if limit is None or math.isnan(hours):
            return None
        required = float(limits.life or 0.0) / SECONDS_PER_HOUR
        return Margin(limit, 100.0 * required / hours, "")

    def summary(self) -> dict[str, object]:
        """Everything as plain data, for JSON."""
        return {
            "slope": self.curve.slope,
            "points": [list(point) for point in self.curve.points],
            "slope_given": self.slope_given,
            "counted_cycles": self.counted,
            "shafts": [shaft.summary() for shaft in self.shafts],
        }


@dataclass(frozen=True, eq=False)
class Counted:
    """The rainflow cycles of a shaft over some cycles of a duty, and the step to which each belongs."""

    cycles: Matrix  # range, mean, count
    steps: NDArray[np.intp]  # from 0, of the end with the larger |T|


def count_cycles(points: Matrix, begins: Vector, steps: Sequence[int]) -> Counted:
    """The cycles of a shaft from the turning points (time, torque) of a trace that repeats itself.

    `begins` are the instants at which the `steps`, numbers from 0 of the file, begin.
    """
    cycles = indexed_cycles(points[:, 1].tolist(), repeated=True)
    places = np.searchsorted(begins, points[:, 0], side="right").clip(1) - 1
    owners = np.asarray(steps, dtype=np.intp)[places]
    ends = cycles[:, 3:].astype(np.intp)
    larger = np.abs(points[:, 1])[ends].argmax(axis=1)
    return Counted(cycles[:, :3], owners[np.take_along_axis(ends, larger[:, None], axis=1)[:, 0]])


def life_of(
    machine: Machine, each: Sequence[Counted], cycles: int, shift: Shift | None, steps: int, slope: Any = None
) -> DutyLife:
    """The life of each shaft from what is counted over so many cycles of a duty of `steps` steps.

    Raises
    ------
    InputError
        For a slope that is none, a shaft without damping, or a rigid gap.
    """
    check_shafts(machine)
    curve, given = curve_of(machine, slope)
    rows = zip(machine.shaft_names, each, strict=True)
    lives = tuple(_life(str(name), counted, curve, cycles, shift, steps) for name, counted in rows)
    return DutyLife(curve, given, cycles, shift, lives)


def _life(
    name: str, counted: Counted, curve: SNCurve, cycles: int, shift: Shift | None, steps: int
) -> ShaftLife:
    spectrum = counted.cycles / [1.0, 1.0, float(cycles)]
    damage, shares = miner(spectrum, curve), np.zeros(steps)
    if damage > 0.0:
        np.add.at(shares, counted.steps, spectrum[:, 2] / curve.cycles(spectrum[:, 0]) / damage)
    torque = float(curve.torque(1.0 / damage)) if damage > 0.0 else 0.0
    number = (1.0 / damage if damage > 0.0 else math.inf) if curve.points else math.nan
    hours = number / shift.cycles_per_hour if shift is not None else math.nan
    shifts = hours / shift.hours if shift is not None else math.nan
    years = shifts / shift.shifts_per_year if shift is not None else math.nan
    return ShaftLife(name, spectrum, damage, torque, number, hours, shifts, years, shares)
