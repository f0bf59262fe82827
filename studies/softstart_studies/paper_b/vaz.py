"""The engine of [B] and what [B] prints of its balancer."""

from __future__ import annotations

import math

import numpy as np

from softstart.arrays import Vector
from softstart.balancing import Balance, Engine, balance

RPM = math.pi / 30.0  # rad/s
TUNING = 4500.0  # rpm
VAZ = Engine.load("vaz-11113")
FORCE = 4.98e-4  # N/rpm^2, (4)
MOMENTS = (("1e-5", 2.099e-5), ("1e-6", 2.099e-6))  # N m/rpm^2, (5) with either reading of its exponent
RADIUS = VAZ.cylinders.crank.r
SPEEDS: Vector = np.array([850.0, 1000.0, 2000.0, 3000.0, 3200.0, 4000.0, 4500.0, 5000.0, 5600.0])  # rpm
LOADS = (1.0, 0.5, 0.0)


def balanced(engine: Engine = VAZ, load: float | None = None) -> Balance:
    """The engine with its balancers at the speeds of the tables.

    >>> balanced().shown.size
    9
    """
    return balance(engine, [float(n) * RPM for n in SPEEDS], load=load, tuning_speed=TUNING * RPM)


def first_order(engine: Engine, rpm: float, load: float | None = None) -> tuple[float, float]:
    """Cosine and sine in N m of the first order of the torque of gas and inertia.

    >>> [round(part, 1) for part in first_order(VAZ, 4500.0)]
    [55.1, 139.0]
    """
    found = engine.torque_harmonics(rpm * RPM, load)[2]
    return float(found.real), float(-found.imag)


def changed(**values: object) -> Engine:
    """The engine with other values, each under its key with two underlines for the dot.

    >>> changed(masses__reciprocating=0.6).masses.reciprocating
    0.6
    """
    return Engine.load("vaz-11113", also={key.replace("__", "."): value for key, value in values.items()})
