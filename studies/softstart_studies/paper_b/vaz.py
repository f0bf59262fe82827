"""The engine of [B], what [B] prints of its balancer, and what follows from both."""

from __future__ import annotations

import itertools
import math
from functools import cache

from softstart.balancing import Balance, Engine, SimpleCycle, balance
from softstart.balancing.design import balancer_arm, two_shafts
from softstart.balancing.engine import shaking_of_shafts

RPM = math.pi / 30.0  # rad/s
TUNING = 4500.0  # rpm
VAZ = Engine.load("vaz-11113")
FORCE = 4.98e-4  # N/rpm^2, (4)
MOMENTS = (("1e-5", 2.099e-5), ("1e-6", 2.099e-6))  # N m/rpm^2, (5) with either reading of its exponent
RADIUS = VAZ.cylinders.crank.r
SPEEDS = (850.0, 1000.0, 2000.0, 3000.0, 3200.0, 4000.0, 4500.0, 5000.0, 5600.0)  # rpm
PRESSURE = "cycle.mean_indicated_pressure"


def pressures(factor: float) -> list[float]:
    """The assumed mean indicated pressures in Pa times a factor.

    >>> [round(p / 1e5, 1) for p in pressures(1.0)]
    [8.6, 10.0, 8.7]
    """
    assert isinstance(VAZ.gas, SimpleCycle)
    return [factor * one for one in VAZ.gas.mean_indicated_pressure]


# what the printed numbers and the torque are assumed to depend on, with two values each
VARIED: dict[str, tuple[str, object, object]] = {
    "reciprocating mass -20, +20 %": ("masses.reciprocating", 0.544, 0.816),
    "mean indicated pressure -20, +20 %": (PRESSURE, pressures(0.8), pressures(1.2)),
    "rod 115, 127 mm": ("cylinders.rod_length", "115 mm", "127 mm"),
    "compression ratio 8.5, 11": ("cycle.compression_ratio", 8.5, 11.0),
    "combustion from 30, 10 deg before": ("cycle.combustion_start", "30 deg", "10 deg"),
    "combustion lasts 45, 75 deg": ("cycle.combustion_duration", "45 deg", "75 deg"),
    "exhaust opens at 115, 150 deg": ("cycle.exhaust_opening", "115 deg", "150 deg"),
    "intake at 0.8, 1 bar": ("cycle.intake_pressure", "0.8 bar", "1 bar"),
    "expansion exponent 1.22, 1.35": ("cycle.expansion_exponent", 1.22, 1.35),
    "load 0.5, 0": ("operation.load", 0.5, 0.0),
}
CORNERS = [list(VARIED.values())[i] for i in (0, 1, 2, 4, 5)]  # mass, pressure, rod, start, duration


def balanced(engine: Engine = VAZ, load: float | None = None) -> Balance:
    """The engine with its balancers at the speeds of the tables.

    >>> balanced().shown.size
    9
    """
    return balance(engine, [n * RPM for n in SPEEDS], load=load, tuning_speed=TUNING * RPM)


def first_order(values: dict[str, object] | None = None) -> tuple[float, float, float]:
    """Cosine, sine and amplitude in N m of the first order of the torque at 4500 rpm, with other values.

    >>> [round(part, 1) for part in first_order()]
    [55.1, 139.0, 149.5]
    """
    engine = Engine.load("vaz-11113", also=values) if values else VAZ
    found = engine.torque_harmonics(TUNING * RPM)[2]
    return float(found.real), float(-found.imag), float(abs(found))


@cache
def sine_at_corners() -> tuple[float, float]:
    """Smallest and largest sine over all corners of `CORNERS`, at full load.

    >>> sine_at_corners()[0] < 139.0 < sine_at_corners()[1]
    True
    """
    choices = [[(key, value) for value in two] for key, *two in CORNERS]
    sines = [first_order(dict(corner))[1] for corner in itertools.product(*choices)]
    return min(sines), max(sines)


def pressure_needed(moment: float) -> float:
    """Mean indicated pressure in Pa at 4500 rpm with which the sine of the first order is this moment in N m.

    The torque is linear in it, so two points give it.

    >>> 0.9e6 < pressure_needed(139.0) < 0.95e6
    True
    """
    sines = [first_order({PRESSURE: pressures(factor)})[1] for factor in (1.0, 1.2)]
    factor = 1.0 + (moment - sines[0]) * 0.2 / (sines[1] - sines[0])
    return factor * VAZ.indicated_work(TUNING * RPM, 1.0) / VAZ.displacement


def left_at_load(load: float, rpm: float, *, sideways: bool = False) -> tuple[float, float]:
    """First-order moment in N m without shafts at a load, and what the arm for full load leaves of it.

    >>> [round(one, 9) for one in left_at_load(1.0, 4500.0, sideways=True)][1]
    0.0
    """
    w = rpm * RPM
    place = balancer_arm(VAZ, w, 1.0)
    place = place if sideways else complex(place.real)
    torque = VAZ.torque_harmonics(w, load)[2]
    balancing = w**2 * shaking_of_shafts(two_shafts(VAZ, place))[2][2]
    return float(abs(torque)), float(abs(balancing - torque))
