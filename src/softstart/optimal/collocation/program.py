"""Which motions follow each other in a start with a single contact, and the drive in its own units.

The units are such that IPOPT sees numbers near 1 whatever the drive.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, Literal

import numpy as np

from softstart.arrays import Vector
from softstart.errors import InputError
from softstart.optimal.problem import Problem
from softstart.optimal.result import DemandShape

End = Literal["free", "contact", "load stops", "breakaway", "softer", "terminal", "lowest demand"]


@dataclass(frozen=True)
class Phase:
    """A motion under one set of equations, in `arcs` pieces of free duration.

    `load` is the sign of the friction that the load feels: 1 for an active load and one that moves forward,
    0 for a reactive load at rest. `stiff`: of `modelica`, while d z' > c z.
    """

    name: str
    contact: bool
    load: int
    arcs: int
    end: End
    stiff: bool = False


@dataclass(frozen=True)
class Program:
    """Everything that decides the shape of the nonlinear program; numbers go in as parameters."""

    phases: tuple[Phase, ...]
    terminal: str
    minimise: str
    demand: DemandShape
    lagged: bool
    rated: bool
    damped: bool
    reactive: bool
    law: str
    lines: int  # pieces of the torque-speed curve
    peak_counts: bool
    heat_bound: bool
    smooth: bool
    pressed_in: bool  # the contact is entered with T >= Mc: a reactive load moves at once
    gap: bool  # there is one: the far flank may be touched

    @property
    def arcs(self) -> tuple[Phase, ...]:
        """The phase of every arc."""
        return tuple(phase for phase in self.phases for _ in range(phase.arcs))

    @property
    def start_arcs(self) -> int:
        """How many arcs lie before t_f."""
        return sum(phase.arcs for phase in self.phases if phase.end != "lowest demand")

    @property
    def tail(self) -> str:
        """What happens after t_f: "coast", "hold", or "" where it cannot raise the peak."""
        if not self.peak_counts:
            return ""
        if self.terminal == "reached":
            return "coast"
        return "hold" if self.lagged else ""


def programs(problem: Problem) -> list[Program]:
    """The orders of phases that are worth trying, the likeliest first. Raises InputError."""
    drive: Any = problem.drive
    reactive = drive.load_kind == "reactive" and drive.Mc > 0.0
    half, v = 0.5 * drive.gap, drive.initial_motor_speed - drive.initial_load_speed
    touching = drive.theta0 > half or (drive.theta0 == half and v >= 0.0)
    if drive.gap == 0.0 and drive.theta0 == 0.0 and v < 0.0:
        raise InputError(
            f"initial_motor_speed = {drive.initial_motor_speed:g} rad/s: without a gap the shaft would be "
            "pulled backward at once; begin with the motor as fast as the load, or faster."
        )
    if drive.theta0 < -half or (drive.theta0 == -half and v < 0.0):
        raise InputError(
            f"start_position = {drive.theta0:g} rad: this start begins on the far flank, so "
            "there would be two contacts; begin within the gap."
        )
    if reactive and drive.initial_load_speed < 0.0 and touching:
        raise InputError(
            f"initial_load_speed = {drive.initial_load_speed:g} rad/s: a reactive load that runs backward in "
            "contact is of no class known here; begin with the load at rest."
        )
    if reactive and drive.contact_law == "modelica" and drive.d > 0.0:
        raise InputError(
            'contact_law = "modelica": with damping and a reactive load this law is of no class known here; '
            'use "no-pull" or "dead-zone", or an active load.'
        )
    found = []
    for before, pressed_in in _orders(problem, reactive, touching):
        phases = [*before, Phase("start", True, 1, 3, "terminal")]
        if problem.terminal == "reached" and math.isfinite(drive.torque_rate) and _peak_counts(problem):
            phases.append(Phase("release", True, 1, 1, "lowest demand"))
        found.append(replace(_plain(problem, reactive), phases=tuple(phases), pressed_in=pressed_in))
    return found


def _orders(problem: Problem, reactive: bool, touching: bool) -> list[tuple[list[Phase], bool]]:
    """The phases before the load is driven, and whether T >= Mc is asked for where the contact begins."""
    drive: Any = problem.drive
    w2, half = drive.initial_load_speed, 0.5 * drive.gap
    v = drive.initial_motor_speed - w2
    overlap = max(0.0, drive.theta0 - half)
    stuck = Phase("stuck in contact", True, 0, 1, "breakaway")
    moving = Phase("gap", False, 1, 2, "contact")
    resting = Phase("gap", False, 0, 2, "contact")
    if not reactive:
        before = [] if touching else [moving]
        if drive.contact_law == "modelica" and drive.d > 0.0 and drive.d * v >= drive.c * overlap:
            before.append(Phase("stiff contact", True, 1, 1, "softer", stiff=True))
        return [(before, False)]
    torque = drive.c * overlap + drive.d * v
    if touching:
        return [([stuck] if w2 == 0.0 and torque <= drive.Mc else [], False)]
    at_rest: list[tuple[list[Phase], bool]] = [([resting, stuck], False)]
    travel = max(0.0, half - drive.theta0)
    fastest = math.sqrt(2.0 * problem.highest_torque / drive.J1 * travel) + abs(drive.initial_motor_speed)
    if drive.d * fastest > drive.Mc:
        at_rest.append(([resting], True))
    if w2 == 0.0:
        return at_rest
    stopping = Phase("gap, load slows down", False, 1 if w2 > 0.0 else -1, 1, "load stops")
    stopped = [([stopping, *phases], pressed_in) for phases, pressed_in in at_rest]
    return [([moving], False), *stopped] if w2 > 0.0 else stopped


def _peak_counts(problem: Problem) -> bool:
    return problem.minimise == "k_dyn" or problem.k_dyn is not None


def _plain(problem: Problem, reactive: bool) -> Program:
    drive: Any = problem.drive
    rated = math.isfinite(drive.torque_rate)
    shape: DemandShape = "steps"
    if rated or problem.smoothness > 0.0:
        shape = "continuous"
    elif problem.torque_speed or problem.minimise == "heat":
        shape = "ramps"  # the best torque bends within an interval
    return Program(
        phases=(),
        terminal=problem.terminal,
        minimise=problem.minimise,
        demand=shape,
        lagged=drive.torque_lag > 0.0,
        rated=rated,
        damped=drive.d > 0.0,
        reactive=reactive,
        law=drive.contact_law,
        lines=max(0, len(problem.torque_speed) - 1),
        peak_counts=_peak_counts(problem),
        heat_bound=problem.heat is not None,
        smooth=problem.smoothness > 0.0,
        pressed_in=False,
        gap=drive.gap > 0.0,
    )


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
    """A problem in its own units: `values` under the names that the statement uses.

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


def numbers(problem: Problem, beyond: float = BEYOND, below: float = 0.0, inside: float = 0.0) -> Numbers:
    """The problem in units of Ms, of its target speed, and of its start time.

    The target is higher by the share `beyond`, the torque-speed curve lower by `below` N m, the bounds on
    K_dyn and heat are lower by the share `inside`.
    """
    drive: Any = problem.drive
    units = Units(time_unit(problem), float(drive.Ms), problem.target)
    inertia = units.torque * units.time / units.speed
    z0 = drive.theta0 - 0.5 * drive.gap
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
        "below": below / units.torque,
        "smoothness": problem.smoothness / units.time,
        "latest": (problem.start_time or 100.0 * units.time) / units.time,
        "inside": inside,
        "largest_peak": min(
            1e3, (1.0 - inside) * (problem.k_dyn or math.inf) * problem.base_torque / units.torque
        ),
        "most_heat": (1.0 - inside) * (problem.heat or 1e9 * units.time) / units.time,
        "z_start": z0 / units.angle,
        "v_start": (drive.initial_motor_speed - drive.initial_load_speed) / units.speed,
        "w2_start": drive.initial_load_speed / units.speed,
    }
    lines = []
    for (w_a, u_a), (w_b, u_b) in pairwise(problem.torque_speed):
        slope = (u_b - u_a) / (w_b - w_a)
        lines.append(((u_a - below - slope * w_a) / units.torque, slope * units.speed / units.torque))
    twist = 1.0 / values["c"]
    Omega = math.sqrt(values["c"] / values["J1"] + values["c"] / values["J2"])
    travel = max(abs(values["z_start"]), 1e-3 * twist)
    gap_scale = np.array([travel, min(1.0, math.sqrt(2.0 * travel / values["J1"])), 1.0, 1.0])
    contact_scale = np.array([twist, min(1.0, Omega * twist), 1.0, 1.0])
    return Numbers(units, values, tuple(lines), gap_scale, contact_scale)
