"""The gaps and load inertias over which gains are tuned."""

from __future__ import annotations

from collections.abc import Iterable
from numbers import Real
from typing import Any

from softstart.drive import Drive
from softstart.errors import InputError
from softstart.quantities import to_si

GAP_MULTIPLES = (0.5, 1.0, 2.0, 4.0)  # of the drive's own gap
INERTIA_MULTIPLES = (0.4, 1.0, 2.0)  # of the drive's own load inertia


def gaps_of(drive: Drive, given: Iterable[Any] | Any | None, name: str = "gaps") -> tuple[float, ...]:
    """Gaps in rad, rising: numbers, texts with a unit, or multiples of the drive's own as "2x".

    >>> gaps_of(Drive.load("crane-4amtkf"), ["2x", 0.5, "30 deg"])
    (0.5, 0.5235987755982988, 1.0)
    """
    if given is None:
        if not drive.gap > 0.0:
            raise InputError(
                f"{name}: the drive has no gap of which multiples could be taken; name the gaps."
            )
        given = [f"{multiple}x" for multiple in GAP_MULTIPLES]
    return _axis(given, name, "rad", drive, {"x": float(drive.gap)})


def inertias_of(drive: Drive, given: Iterable[Any] | Any | None, name: str = "inertias") -> tuple[float, ...]:
    """Load inertias in kg m2, rising; also multiples of the drive's own ("2x") or of the motor's ("5 J1").

    >>> [round(inertia, 3) for inertia in inertias_of(Drive.load("crane-4amtkf"), ["2 J1", "1x", 0.1])]
    [0.07, 0.1, 0.175]
    """
    if given is None:
        given = [f"{multiple}x" for multiple in INERTIA_MULTIPLES]
    units = {"x": float(drive.load_inertia), "J1": float(drive.motor_inertia)}
    return _axis(given, name, "kg*m^2", drive, units)


def _axis(
    given: Iterable[Any] | Any, name: str, unit: str, drive: Drive, units: dict[str, float]
) -> tuple[float, ...]:
    """Values in SI, each once, rising."""
    listed = [given] if isinstance(given, str | Real) or not hasattr(given, "__iter__") else list(given)
    if not listed:
        raise InputError(f"{name}: the list is empty; give at least one value, or leave it out.")
    found: list[float] = []
    wrong: list[str] = []
    for value in listed:
        try:
            found.append(_value(value, name, unit, units))
        except InputError as error:
            wrong += error.sentences
    key = "gap" if unit == "rad" else "load_inertia"
    for value in found:
        try:
            changed: Any = {key: value}
            drive.replace(**changed)
        except InputError as error:
            wrong += [f"{name}: {sentence}" for sentence in error.sentences]
    if wrong:
        raise InputError(wrong)
    return tuple(sorted(set(found)))


def _value(value: Any, name: str, unit: str, units: dict[str, float]) -> float:
    if isinstance(value, str):
        for ending, one in units.items():
            if value.strip().endswith(ending):
                multiple = float(to_si(value.strip().removesuffix(ending), "1", name=name))
                return float(f"{multiple * one:.12g}")  # 5 x 0.035 is 0.175, whatever binary makes of it
    return float(to_si(value, unit, name=name))
