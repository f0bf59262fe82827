"""The peer scipy as most would use it: one solve_ivp call with LSODA, the gap inside the right-hand side.

Contacts, partings and torque peaks are located events of that one call. It is restarted only where the torque
changes and at the target speed, after which it goes on for one elastic period.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from softstart.arrays import Vector
from softstart_studies.benchmarks.lsoda import T_MAX, TOLERANCE
from softstart_studies.benchmarks.problem import Line, Problem, Solve


def one_call(problem: Problem, count: int) -> Solve:
    """All starts, one after the other."""
    lines = problem.lines(count)
    return lambda: np.array([[peak_torque(line)] for line in lines])


def peak_torque(line: Line) -> float:
    """Largest |T| of one undamped start, N m; four states: phi1, w1, phi2, w2."""
    J1, J2, c, Mc = (float(value) for value in (*line.J, line.c[0], line.Mc[1]))
    half, target, torques = 0.5 * float(line.gap[0]), line.target, line.stages()

    def shaft(y: Any) -> float:
        theta = float(y[0]) - float(y[2])
        if theta > half:
            return c * (theta - half)
        return c * (theta + half) if theta < -half else 0.0

    def upper(t: float, y: Vector) -> float:
        return float(y[0] - y[2]) - half

    def lower(t: float, y: Vector) -> float:
        return float(y[0] - y[2]) + half

    def turns(t: float, y: Vector) -> float:
        return float(y[1] - y[3])

    def reached(t: float, y: Vector) -> float:
        return float(y[3]) - target

    def changes(t: float, y: Vector) -> float:
        return upper(t, y)

    reached.terminal, reached.direction = True, 1.0  # type: ignore[attr-defined]
    changes.terminal = True  # type: ignore[attr-defined]

    t, y, peak = 0.0, np.zeros(4), 0.0
    stage = 1
    while True:
        u = torques[stage - 1]
        rest = all(torque == u for torque in torques[stage - 1 :])
        events = [upper, lower, turns, reached] if rest else [changes, lower, turns, reached]
        if not rest:
            changes.direction = 1.0 if stage == 1 else -1.0  # type: ignore[attr-defined]

        def rates(t: float, y: Vector, u: float = u) -> tuple[float, float, float, float]:
            T = shaft(y)
            return float(y[1]), (u - T) / J1, float(y[3]), (T - Mc) / J2

        found = solve_ivp(rates, (t, T_MAX), y, method="LSODA", events=events, rtol=TOLERANCE, atol=TOLERANCE)
        peak = max([peak, *(abs(shaft(state)) for state in found.y_events[2])])
        t, y = float(found.t[-1]), found.y[:, -1]
        if len(found.t_events[3]):
            break
        # a hair beyond the flank: brentq inside solve_ivp may fail on a start with an event function of zero
        y[0] = y[2] + half + (1e-12 if stage == 1 else -1e-12)
        stage += 1
    end = t + line.tail
    found = solve_ivp(
        rates, (t, end), y, method="LSODA", events=[upper, lower, turns], rtol=TOLERANCE, atol=TOLERANCE
    )
    return max([peak, abs(shaft(found.y[:, -1])), *(abs(shaft(state)) for state in found.y_events[2])])
