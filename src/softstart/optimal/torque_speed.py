"""A motor torque that is limited over the speed: whether it carries the load, and the time of a rigid drive.

As one body the masses obey J w' = u - M(w), with u the torque limit g(w) = min(Ms, the curve at w), and M all
that the load takes. Between corners of both the right side is linear in w, a + b w, and

    t = J/b ln((a + b w_1)/(a + b w_0)),    J (w_1 - w_0)/a for b = 0.

A shaft lets the masses swing about this motion: the time is a yardstick, no bound.
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import numpy as np

from softstart.arrays import Vector
from softstart.kernel.records import CURVE, MASS
from softstart.optimal.problem import Problem
from softstart.optimal.result import Infeasibility, InfeasibleError
from softstart.profile import TorqueProfile
from softstart.start.kernel_input import kernel_input

FINE = 60  # speeds at which a torque over time has knots
Corners = tuple[tuple[float, float], ...]


class RigidStart:
    """The start of a machine as one body under the largest torque; speeds in rad/s at the motor shaft.

    >>> from softstart import Drive
    >>> crane = Drive.load("crane-4amtkf")
    >>> round(RigidStart(crane, ((0.0, 62.0), (90.0, 40.0))).time, 4)
    0.4544
    """

    def __init__(self, machine: Any, corners: Corners) -> None:
        given = kernel_input(next(iter(machine.positions.values())))
        masses = given.masses[0].view(MASS)[:, 0]
        self.corners = corners
        self.most = float(min(machine.motor.starting_torque, machine.motor.maximum_torque))
        self.drag = float(masses["ground"].sum())
        self.constant = float((masses["Mc"] + masses["active"] + masses["friction"]).sum())
        self.curves = [one for one in given.curves[0].view(CURVE)[:, 0] if one["mass"] >= 0.0]
        self.J, w = float(masses["J"].sum()), masses["w0"]
        self.begin = float(masses["J"] @ w) / self.J if math.isfinite(self.J) else 0.0
        self.end = float(given.machine.target)

    def motor(self, w: Vector) -> Vector:
        """The largest torque of the motor, N m; the first and the last piece of the curve go on."""
        pieces = [
            a[1] + (b[1] - a[1]) / (b[0] - a[0]) * (w - a[0]) for a, b in pairwise(self.corners)
        ]  # concave: the lowest of its lines
        return np.minimum.reduce([np.full(w.shape, self.most), *pieces])

    def load(self, w: Vector) -> Vector:
        """What all loads take while they move, N m."""
        taken = self.constant + self.drag * w
        for one in self.curves:
            count = int(one["points"])
            taken = taken + np.interp(w, one["at"][:count], one["torque"][:count])
        return np.asarray(taken)

    @property
    def speeds(self) -> Vector:
        """Begin, end, and all speeds between them at which one of the torques bends."""
        lines = [
            ((b[1] - a[1]) / (b[0] - a[0]), a[1] - (b[1] - a[1]) / (b[0] - a[0]) * a[0])
            for a, b in pairwise(self.corners)
        ]
        bends = [speed for speed, _ in self.corners]
        bends += [(self.most - offset) / slope for slope, offset in lines if slope != 0.0]  # where it limits
        for one in self.curves:
            bends += one["at"][: int(one["points"])].tolist()
        within = [w for w in bends if self.begin < w < self.end]
        return np.unique([self.begin, *within, self.end])

    @property
    def weakest(self) -> float:
        """The speed at which the least torque is left to accelerate."""
        speeds = self.speeds
        return float(speeds[np.argmin(self.motor(speeds) - self.load(speeds))])

    @property
    def time(self) -> float:
        """How long it takes, s; infinite where the load takes all torque at some speed."""
        return float(self._instants(self.speeds)[-1])

    def _instants(self, speeds: Vector) -> Vector:
        """When it has these speeds, which rise from that at the beginning, s."""
        left = self.motor(speeds) - self.load(speeds)
        if not (left > 0.0).all() or not math.isfinite(self.J):
            return np.append(0.0, np.full(speeds.size - 1, math.inf))
        ratio, rise = np.diff(np.log(left)), np.diff(left)
        even = np.abs(rise) <= 1e-9 * left[1:]  # then the logarithm is lost in rounding
        one_over_mean = np.where(even, 2.0 / (left[1:] + left[:-1]), ratio / np.where(even, 1.0, rise))
        return np.append(0.0, np.cumsum(self.J * np.diff(speeds) * one_over_mean))

    @property
    def torque(self) -> TorqueProfile | None:
        """The largest torque over time; None where it does not come to its speed.

        >>> from softstart import Drive
        >>> start = RigidStart(Drive.load("crane-4amtkf"), ((0.0, 62.0), (92.153, 10.0)))
        >>> start.torque.at([0.0, start.time]).round(1).tolist()
        [62.0, 10.0]
        """
        speeds = np.union1d(self.speeds, np.linspace(self.begin, self.end, FINE))
        when = self._instants(speeds)
        return TorqueProfile(when, self.motor(speeds)) if math.isfinite(when[-1]) else None


def rigid_start_time(problem: Problem) -> float:
    """The longest time that one of the machines takes as one body, s; 0 without a torque-speed curve."""
    if not problem.torque_speed:
        return 0.0
    return max(RigidStart(machine, problem.torque_speed).time for machine in problem.machines)


def refuse_weak_curve(problem: Problem) -> None:
    """Raise InfeasibleError where the load takes all torque of the curve before it has its speed."""
    for machine in problem.machines if problem.torque_speed else ():
        start = RigidStart(machine, problem.torque_speed)
        w = np.array([start.weakest])
        motor, load = float(start.motor(w)[0]), float(start.load(w)[0])
        if motor <= load:
            raise InfeasibleError(
                Infeasibility(
                    problem,
                    f"torque_speed: at {w[0]:.4g} rad/s the motor has {motor:.4g} N m and the load takes "
                    f"{load:.4g} N m, so {machine.name} does not come to {start.end:.4g} rad/s; give a curve "
                    "that lies above the load up to this speed.",
                )
            )  # fmt: skip
