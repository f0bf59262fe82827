"""The peer scipy: solve_ivp with LSODA, restarted at every located event (and at every sample).

Written by hand for these starts: a right-hand side in matrix form for each set of closed gaps; flanks and the
target speed are terminal events with a direction, and the peak is the event dT/dt = 0 in contact. solve_ivp
makes an interpolant only in a step that holds an event.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from softstart.arrays import Matrix, Vector
from softstart_studies.benchmarks.problem import Line, Problem, Solve

TOLERANCE = 1e-8
TIGHT = 1e-12
T_MAX = 100.0  # s, never reached


def restarted(problem: Problem, count: int) -> Solve:
    """solve_ivp LSODA, rtol 1e-8, located events, restarted at each of them and at each sample."""
    lines = [problem.line(one) for one in problem.machines(count)]
    return lambda: np.array([start(line)[0] for line in lines])


def tight(problem: Problem, count: int) -> Solve:
    """The same at rtol 1e-12, which shows whose the difference is."""
    lines = [problem.line(one) for one in problem.machines(count)]
    return lambda: np.array([start(line, TIGHT)[0] for line in lines])


def start(line: Line, tolerance: float = TOLERANCE) -> tuple[Vector, float]:
    """Largest |T| of each shaft in one start, N m, and the start time, s.

    States: twists, speeds, and behind a lag the motor torque.
    """
    n, half = line.J.size, 0.5 * line.gap
    y = np.concatenate([line.theta0, np.zeros(n), np.zeros(int(line.lag > 0.0))])
    side, peaks = np.zeros(n - 1), np.zeros(n - 1)
    t, end, start_time, stage = 0.0, T_MAX, math.nan, 1
    while t < end:
        demand, until = line.demand(t, stage)
        closed = ((side != 0.0) | (half == 0.0)).astype(float)
        A, b, torque, offset = _mode(line, side, closed, demand)
        events: list[Any] = []
        meaning: list[tuple[str, int]] = []
        for k in range(n - 1):
            twist = np.eye(1, y.size, k)[0]
            if not closed[k]:
                events += [_event(twist, -half[k], 1.0), _event(twist, half[k], -1.0)]
                meaning += [("upper", k), ("lower", k)]
                continue
            if half[k] > 0.0:
                events.append(_event(side[k] * torque[k], side[k] * offset[k], -1.0))
                meaning.append(("opens", k))
            events.append(_event(torque[k] @ A, torque[k] @ b, 0.0, terminal=False))
            meaning.append(("top", k))
        if math.isnan(start_time):
            events.append(_event(np.eye(1, y.size, 2 * n - 2)[0], -line.target, 1.0))
            meaning.append(("target", n - 1))

        def rates(_: float, y: Vector, A: Matrix = A, b: Vector = b) -> Any:
            return A @ y + b

        found = solve_ivp(
            rates, (t, min(until, end)), y, method="LSODA", events=events, rtol=tolerance, atol=tolerance
        )
        t, y = float(found.t[-1]), found.y[:, -1].copy()
        tops = [states for (kind, _), states in zip(meaning, found.y_events, strict=True) if kind == "top"]
        for state in (y, *(state for states in tops for state in states)):
            peaks = np.maximum(peaks, np.abs(torque @ state + offset))
        if found.status == 0:
            continue
        fired = next(i for i, when in enumerate(found.t_events) if meaning[i][0] != "top" and when.size)
        kind, k = meaning[fired]
        if kind == "target":
            start_time, end = t, t + line.tail
            continue
        stage += 1
        flank = side[k] if kind == "opens" else (1.0 if kind == "upper" else -1.0)
        if kind != "opens" or line.d[k] == 0.0:  # damped flanks part while they still overlap
            y[k] = flank * half[k]  # exactly on the flank: with its direction the event does not fire again
        side[k] = 0.0 if kind == "opens" else flank
    return peaks, start_time


def _mode(line: Line, side: Vector, closed: Vector, demand: float) -> tuple[Matrix, Vector, Matrix, Vector]:
    """Rates A y + b and shaft torques, a row a shaft and their offsets, while the same gaps are closed."""
    n = line.J.size
    size = 2 * n - 1 + int(line.lag > 0.0)
    speeds = np.arange(n - 1, 2 * n - 1)
    A, b = np.zeros((size, size)), np.zeros(size)
    A[: n - 1, speeds] = np.eye(n)[:-1] - np.eye(n)[1:]
    torque = (closed * line.d)[:, None] * A[: n - 1]
    torque[:, : n - 1] = np.diag(closed * line.c)
    offset = -closed * line.c * side * 0.5 * line.gap
    A[speeds[:-1]] -= torque / line.J[:-1, None]
    A[speeds[1:]] += torque / line.J[1:, None]
    b[speeds] = -line.Mc / line.J
    b[speeds[:-1]] -= offset / line.J[:-1]
    b[speeds[1:]] += offset / line.J[1:]
    if line.lag > 0.0:
        A[speeds[0], -1], A[-1, -1], b[-1] = 1.0 / line.J[0], -1.0 / line.lag, demand / line.lag
    else:
        b[speeds[0]] += demand / line.J[0]
    return A, b, torque, offset


def _event(row: Vector, offset: float, direction: float, terminal: bool = True) -> Any:
    def event(_: float, y: Vector) -> float:
        return float(row @ y) + offset

    event.terminal, event.direction = terminal, direction  # type: ignore[attr-defined]
    return event
