"""How much the first-order reaction torque depends on what is assumed of the engine."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from functools import cache

from softstart.balancing import SimpleCycle
from softstart.study import Table
from softstart_studies.paper_b.vaz import MOMENTS, TUNING, VAZ, changed, first_order


def _cycle() -> SimpleCycle:
    assert isinstance(VAZ.gas, SimpleCycle)
    return VAZ.gas


def pressures(factor: float) -> list[float]:
    """The assumed mean indicated pressures in Pa times a factor.

    >>> [round(p / 1e5, 1) for p in pressures(1.0)]
    [8.6, 10.0, 8.7]
    """
    return [factor * one for one in _cycle().mean_indicated_pressure]


PRESSURE = "cycle__mean_indicated_pressure"
VARIED: tuple[tuple[str, str, object, object], ...] = (
    ("reciprocating mass -20, +20 %", "masses__reciprocating", 0.544, 0.816),
    ("mean indicated pressure -20, +20 %", PRESSURE, pressures(0.8), pressures(1.2)),
    ("rod 115, 127 mm", "cylinders__rod_length", "115 mm", "127 mm"),
    ("compression ratio 8.5, 11", "cycle__compression_ratio", 8.5, 11.0),
    ("combustion from 30, 10 deg before", "cycle__combustion_start", "30 deg", "10 deg"),
    ("combustion lasts 45, 75 deg", "cycle__combustion_duration", "45 deg", "75 deg"),
    ("exhaust opens at 115, 150 deg", "cycle__exhaust_opening", "115 deg", "150 deg"),
    ("intake at 0.8, 1 bar", "cycle__intake_pressure", "0.8 bar", "1 bar"),
    ("expansion exponent 1.22, 1.35", "cycle__expansion_exponent", 1.22, 1.35),
    ("load 0.5, 0", "operation__load", 0.5, 0.0),
)
CORNERS = (0, 1, 2, 4, 5)  # of them: mass, pressure, rod, start and duration of the combustion


@dataclass(frozen=True)
class Span:
    """Smallest and largest sine and amplitude in N m of the first order at the tuning speed."""

    sine: tuple[float, float]
    amplitude: tuple[float, float]


def row(values: dict[str, object]) -> tuple[float, float, float]:
    """Cosine, sine and amplitude in N m at the tuning speed.

    >>> [round(one, 1) for one in row({})]
    [55.1, 139.0, 149.5]
    """
    cosine, sine = first_order(changed(**values), TUNING)
    return cosine, sine, math.hypot(cosine, sine)


def table() -> Table:
    """One assumption changed at a time."""
    rows: list[tuple[object, ...]] = []
    base = row({})
    rows.append(("as assumed", *(round(one, 1) for one in base), *(round(one, 1) for one in base)))
    for what, key, first, second in VARIED:
        rows.append((what, *(round(one, 1) for value in (first, second) for one in row({key: value}))))
    columns = (
        "assumption, first and second value",
        "cosine, first",
        "sine, first",
        "amplitude, first",
        "cosine, second",
        "sine, second",
        "amplitude, second",
    )
    return Table("First-order reaction torque at 4500 rpm in N m", columns, rows)


@cache
def corners() -> Span:
    """All corners of mass, mean pressure, rod, start and duration of the combustion, at full load.

    >>> corners().sine[0] < 139.0 < corners().sine[1]
    True
    """
    choices = [[(VARIED[i][1], value) for value in VARIED[i][2:]] for i in CORNERS]
    found = [row(dict(corner)) for corner in itertools.product(*choices)]
    sines, amplitudes = [one[1] for one in found], [one[2] for one in found]
    return Span((min(sines), max(sines)), (min(amplitudes), max(amplitudes)))


def pressure_needed(moment: float) -> float:
    """Mean indicated pressure in Pa at 4500 rpm with which the sine of the first order is this moment in N m.

    The torque is linear in it, so two points give it.

    >>> 0.9e6 < pressure_needed(139.0) < 0.95e6
    True
    """
    factors = (1.0, 1.2)
    sines = [first_order(changed(**{PRESSURE: pressures(f)}), TUNING)[1] for f in factors]
    factor = factors[0] + (moment - sines[0]) * (factors[1] - factors[0]) / (sines[1] - sines[0])
    return factor * VAZ.indicated_work(TUNING * math.pi / 30.0, 1.0) / VAZ.displacement


def readings() -> list[tuple[str, float, float]]:
    """Each reading of (5): its moment in N m at 4500 rpm, and the mean pressure in bar it would need."""
    return [(name, one * TUNING**2, 1e-5 * pressure_needed(one * TUNING**2)) for name, one in MOMENTS]
