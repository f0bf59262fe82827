"""The peer scipy: a chain by solve_ivp with LSODA, restarted at every located event (and at every sample)."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from softstart.arrays import Vector
from softstart.chain import Chain

__all__ = ["Outcome", "Problem", "lsoda_start"]


TOLERANCE = 1e-8
T_MAX = 100.0  # s, never reached


@dataclass(frozen=True)
class Problem:
    """A chain from rest at mid-gap, undamped, with active loads; motor on the first mass, load on the last.

    `torque` is what the motor makes; below `ramp` s it is `torque t/ramp`, held for each `sample` s.
    """

    chain: Chain
    torque: float
    tail: float
    ramp: float = 0.0
    sample: float = 1e-3

    def demand(self, t: float) -> tuple[float, float]:
        """The torque now, and the instant at which it changes."""
        k = math.floor(t / self.sample + 1e-6)
        if k * self.sample >= self.ramp:
            return self.torque, math.inf
        return self.torque * (k * self.sample / self.ramp), (k + 1) * self.sample


@dataclass(frozen=True)
class Outcome:
    """Peaks of the shaft torques in N m and the start time in s."""

    peaks: Vector
    start_time: float


def lsoda_start(problem: Problem, tolerance: float = TOLERANCE) -> Outcome:
    """One start.

    States: twists and speeds. Each set of closed gaps has a right-hand side of its own in matrix form; flanks
    and the target speed are terminal events with a direction, extremes of torques are events v = 0.
    """
    arrays = problem.chain.at_motor_shaft()
    n = arrays.J.size
    half, target = 0.5 * arrays.gap, float(problem.chain.target_speed or math.inf)
    y = np.concatenate([arrays.theta0, arrays.w0])
    side = np.zeros(n - 1)
    peaks = np.zeros(n - 1)
    t, end, start_time = 0.0, T_MAX, math.nan
    while t < end:
        torque, until = problem.demand(t)
        closed = (side != 0.0) | (half == 0.0)
        matrix, constant = _mode(arrays, side, closed, torque)
        events, meaning = _events(n, half, side, closed, target if math.isnan(start_time) else math.inf)
        stop = min(until, end)

        def rates(_: float, y: Vector, matrix: Vector = matrix, constant: Vector = constant) -> Any:
            return matrix @ y + constant

        found = solve_ivp(rates, (t, stop), y, method="LSODA", events=events, rtol=tolerance, atol=tolerance)
        for (kind, k), tops in zip(meaning, found.y_events, strict=True):
            if kind == "top":
                for state in tops:
                    peaks[k] = max(peaks[k], abs(arrays.c[k] * (state[k] - side[k] * half[k])))
        t, y = float(found.t[-1]), found.y[:, -1].copy()
        for k in range(n - 1):
            if closed[k]:
                peaks[k] = max(peaks[k], abs(arrays.c[k] * (y[k] - side[k] * half[k])))
        if found.status == 0:
            continue
        fired = next(i for i, when in enumerate(found.t_events) if meaning[i][0] != "top" and when.size)
        kind, k = meaning[fired]
        if kind == "target":
            start_time, end = t, t + problem.tail
        else:
            flank = side[k] if kind == "opens" else (1.0 if kind == "upper" else -1.0)
            y[k] = flank * half[k]  # exactly on the flank: with its direction the event does not fire again
            side[k] = 0.0 if kind == "opens" else flank
    return Outcome(peaks, start_time)


def _mode(arrays: Any, side: Vector, closed: NDArray[np.bool_], torque: float) -> tuple[Vector, Vector]:
    """Y' = matrix y + constant."""
    n = arrays.J.size
    matrix, constant = np.zeros((2 * n - 1, 2 * n - 1)), np.zeros(2 * n - 1)
    constant[n - 1 :] = -arrays.Mc / arrays.J
    constant[n - 1] += torque / arrays.J[0]
    for k in range(n - 1):
        matrix[k, n - 1 + k], matrix[k, n + k] = 1.0, -1.0
        if closed[k]:
            for i, sign in ((k, -1.0), (k + 1, 1.0)):
                matrix[n - 1 + i, k] += sign * arrays.c[k] / arrays.J[i]
                constant[n - 1 + i] -= sign * arrays.c[k] * side[k] * 0.5 * arrays.gap[k] / arrays.J[i]
    return matrix, constant


def _events(
    n: int, half: Vector, side: Vector, closed: NDArray[np.bool_], target: float
) -> tuple[list[Callable[[float, Vector], float]], list[tuple[str, int]]]:
    events: list[Any] = []
    meaning = []

    def add(kind: str, k: int, function: Any, terminal: bool, direction: float) -> None:
        function.terminal, function.direction = terminal, direction
        events.append(function)
        meaning.append((kind, k))

    for k in range(n - 1):
        flank = float(half[k])
        if not closed[k]:
            add("upper", k, lambda t, y, k=k, flank=flank: y[k] - flank, True, 1.0)
            add("lower", k, lambda t, y, k=k, flank=flank: y[k] + flank, True, -1.0)
            continue
        if side[k] != 0.0:
            on = float(side[k])
            add("opens", k, lambda t, y, k=k, on=on, flank=flank: on * y[k] - flank, True, -1.0)
        add("top", k, lambda t, y, k=k: y[n - 1 + k] - y[n + k], False, 0.0)
    if target < math.inf:
        add("target", n - 1, lambda t, y: y[2 * n - 2] - target, True, 1.0)
    return events, meaning
