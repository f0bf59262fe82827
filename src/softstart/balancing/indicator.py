"""A measured course of the cylinder pressure, from a CSV file of crank angle and pressure."""

from __future__ import annotations

import csv
import math
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from softstart.balancing.parts import CYCLE_ANGLE, Cylinders
from softstart.balancing.slider_crank import Vector
from softstart.errors import InputError
from softstart.quantities import RefusedError, parse, show, to_si

__all__ = ["MeasuredCycle"]

FEWEST = 24
WIDEST = math.radians(30.0)
EXAMPLE = "angle [deg],pressure [bar]"


@dataclass(frozen=True)
class MeasuredCycle:
    """Pressures in Pa at rising crank angles in rad, 0 at the firing dead centre; straight lines between.

    The angles cover one cycle of 4 pi, wherever it begins (-360 deg to 360 deg is usual). It is taken for all
    speeds and loads: what was measured at one point of operation says nothing of others.

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
            wrong += _mistakes(np.asarray(angles), np.asarray(pressures))
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
        try:
            with Path(path).open(encoding="utf-8-sig", newline="") as stream:
                rows = [row for row in csv.reader(stream) if any(cell.strip() for cell in row)]
        except FileNotFoundError:
            raise InputError(f"{place}: there is no such file; give a CSV file with {EXAMPLE}.") from None
        except (OSError, UnicodeDecodeError, csv.Error) as error:
            raise InputError(f"{place}: the file cannot be read as CSV ({error}).") from None
        units = _units(rows[0] if rows else [], place)
        columns: tuple[list[float], list[float]] = ([], [])
        for number, row in enumerate(rows[1:], start=2):
            try:
                if len(row) != 2:
                    raise RefusedError(f"there are {len(row)} values in it, and 2 are needed")
                for column, cell, written, unit in zip(columns, row, units, ("rad", "Pa"), strict=True):
                    column.append(float(parse(f"{cell.strip()} {written}", unit)))
            except RefusedError as refusal:
                line = show(",".join(row))
                raise InputError(f"{place}: row {number}, {line}: {refusal.reason}.") from None
        if not columns[0]:
            raise InputError(f"{place}: there are no values below the first line.")
        try:
            return cls(tuple(columns[0]), tuple(columns[1]), crankcase_pressure)
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
        """Nothing."""
        return ()


def _units(header: Sequence[str], place: str) -> list[str]:
    """The units of the two columns."""
    found = [cell.partition("[")[2].partition("]")[0].strip() for cell in header]
    names = [cell.partition("[")[0].strip() for cell in header]
    if len(header) != 2 or names != ["angle", "pressure"] or not all(found):
        line = show(",".join(header))
        raise InputError(f"{place}: the first line is {line}; it names both columns with units: {EXAMPLE}.")
    for written, unit in zip(found, ("rad", "Pa"), strict=True):
        to_si(f"1 {written}", unit, f"{place}: in the first line")
    return found


def _mistakes(angles: Vector, pressures: Vector) -> list[str]:
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
