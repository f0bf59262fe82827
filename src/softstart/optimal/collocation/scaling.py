"""The drive in units of its own, so that IPOPT sees numbers near 1 whatever the drive."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softstart.optimal.problem import Problem

Vector = NDArray[np.float64]

# Beyond the target by about the error of a fine mesh, so that the re-simulated load does reach it.
BEYOND = 2e-7


@dataclass(frozen=True)
class Units:
    """Size of the units in SI: time s, torque N m, speed rad/s, angle rad."""

    time: float
    torque: float
    speed: float

    @property
    def angle(self) -> float:
        """One unit of speed for one unit of time."""
        return self.speed * self.time


def time_unit(problem: Problem) -> float:
    """The start time, or where it is sought the one of a stiff drive under full torque, s."""
    if problem.start_time is not None:
        return problem.start_time
    drive: Any = problem.drive
    push = problem.highest_torque - drive.Mc
    rise = problem.target - min(0.0, drive.initial_load_speed)
    crossing = math.sqrt(max(0.0, drive.gap) * drive.J1 / problem.highest_torque)
    ramp = 0.0 if math.isinf(drive.torque_rate) else problem.highest_torque / drive.torque_rate
    return float((drive.J1 + drive.J2) * rise / push + crossing + drive.torque_lag + 0.5 * ramp)


@dataclass(frozen=True)
class Numbers:
    """A problem in units of its own: `values` under the names that the statement uses.

    `gap_scale` and `contact_scale` are the sizes of the states (z, v, w2, u) in the two kinds of phases.
    """

    units: Units
    values: Mapping[str, float]
    lines: tuple[tuple[float, float], ...]  # u <= intercept + slope w1
    gap_scale: Vector
    contact_scale: Vector

    def __getattr__(self, name: str) -> float:
        try:
            return self.values[name]
        except KeyError:
            raise AttributeError(name) from None

    @property
    def Omega(self) -> float:
        """Elastic frequency in contact, undamped."""
        return math.sqrt(self.c / self.J1 + self.c / self.J2)


def numbers(problem: Problem, beyond: float = BEYOND) -> Numbers:
    """The problem in units of Ms, of its target speed, and of its start time."""
    drive: Any = problem.drive
    units = Units(time_unit(problem), float(drive.Ms), problem.target)
    inertia = units.torque * units.time / units.speed
    z0 = drive.start_position - 0.5 * drive.gap
    values = {
        "J1": drive.J1 / inertia,
        "J2": drive.J2 / inertia,
        "c": drive.c / (units.torque / units.angle),
        "d": drive.d / (units.torque / units.speed),
        "gap": drive.gap / units.angle,
        "Mc": drive.Mc / units.torque,
        "lag": drive.torque_lag / units.time,
        "rate": min(drive.torque_rate, 1e30) / (units.torque / units.time),
        "lowest": problem.lowest_torque / units.torque,
        "highest": problem.highest_torque / units.torque,
        "target": problem.target * (1.0 + beyond) / units.speed,
        "base": problem.base_torque / units.torque,
        "smoothness": problem.smoothness / units.time,
        "latest": (problem.start_time or 100.0 * units.time) / units.time,
        "largest_peak": min(1e3, (problem.k_dyn or math.inf) * problem.base_torque / units.torque),
        "most_heat": (problem.heat or 1e9 * units.time) / units.time,
        "z_start": z0 / units.angle,
        "v_start": (drive.initial_motor_speed - drive.initial_load_speed) / units.speed,
        "w2_start": drive.initial_load_speed / units.speed,
    }
    lines = []
    for (w_a, u_a), (w_b, u_b) in pairwise(problem.torque_speed):
        slope = (u_b - u_a) / (w_b - w_a)
        lines.append(((u_a - slope * w_a) / units.torque, slope * units.speed / units.torque))
    twist = 1.0 / values["c"]
    Omega = math.sqrt(values["c"] / values["J1"] + values["c"] / values["J2"])
    way = max(abs(values["z_start"]), 1e-3 * twist)
    gap_scale = np.array([way, min(1.0, math.sqrt(2.0 * way / values["J1"])), 1.0, 1.0])
    contact_scale = np.array([twist, min(1.0, Omega * twist), 1.0, 1.0])
    return Numbers(units, values, tuple(lines), gap_scale, contact_scale)
