"""The peer scipy: solve_ivp with LSODA, restarted at every located event of the gap (and at every sample)."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from softstart.arrays import Vector
from softstart_studies.benchmarks.problem import Problem

TOLERANCE = 1e-8
T_MAX = 10.0  # s, never reached
NEVER_ASKED = math.inf

# motor torque now, and the instant at which it changes at the latest, from time and stage
Plan = Callable[[float, int], tuple[float, float]]


def stage_plan(problem: Problem) -> Plan:
    """A torque for each stage; it changes at the events of the gap only."""
    torques = problem.stage_torques
    if torques is None:
        raise ValueError(f"{problem.strategy} has no torque of its own for each stage.")
    return lambda t, stage: (torques[min(stage, 3) - 1], NEVER_ASKED)


def sampled_plan(problem: Problem) -> Plan:
    """A ramp, held between samples; after it the torque is constant and nothing is sampled any more."""
    if problem.stage_torques is not None:
        raise ValueError(f"{problem.strategy} is not sampled.")
    initial, full, time, period = problem.initial, problem.full, problem.time, problem.period

    def plan(t: float, stage: int) -> tuple[float, float]:
        k = math.floor(t / period + 1e-6)
        if k * period >= time:
            return full, NEVER_ASKED
        return initial + (full - initial) * (k * period / time), (k + 1) * period

    return plan


def peak_torque(problem: Problem, plan: Plan, gap: float) -> float:
    """Largest |T| of one start, N m.

    States: twist theta = phi1 - phi2, its rate v, load speed w2, and behind a lag the motor torque u. Gap
    and contact have right-hand sides of their own; leaving a mode, and the target speed, are terminal events
    with a direction, and the peak is the event dT/dt = 0 in contact. solve_ivp makes an interpolant only in a
    step that holds an event.
    """
    half, target, lag = 0.5 * gap, problem.target, problem.lag

    def upper(t: float, y: Vector) -> float:
        return float(y[0]) - half

    def lower(t: float, y: Vector) -> float:
        return float(y[0]) + half

    def reached(t: float, y: Vector) -> float:
        return float(y[2]) - target

    for event, direction in ((upper, 1.0), (lower, -1.0), (reached, 1.0)):
        event.terminal, event.direction = True, direction  # type: ignore[attr-defined]

    t, y, peak = 0.0, np.zeros(4 if lag > 0.0 else 3), 0.0
    side, stage, end, running = 0, 1, T_MAX, True
    while running:
        u, until = plan(t, stage)
        if side == 0:
            rates, events = _gap_open(problem, u), [upper, lower]
        else:
            rates, torque, events = _in_contact(problem, u, side, half)
        if end == T_MAX:
            events = [*events, reached]
        stop = min(until, end)
        found = solve_ivp(rates, (t, stop), y, method="LSODA", events=events, rtol=TOLERANCE, atol=TOLERANCE)
        if side != 0:
            peak = max(peak, *(abs(torque(state)) for state in (*found.y_events[1], found.y[:, -1])))
        t, y = float(found.t[-1]), found.y[:, -1]
        if found.status == 0:
            running = stop < end
        elif end == T_MAX and len(found.t_events[2]):
            end = t + problem.elastic_period
        else:
            stage += 1
            met = side or (1 if len(found.t_events[0]) else -1)
            if side == 0 or problem.d == 0.0:  # damped flanks part while they still overlap
                y[0] = met * half  # exactly on the flank: with its direction the event does not fire again
            side = 0 if side != 0 else met
    return peak


def _gap_open(problem: Problem, ref: float) -> Any:
    J1, lag, a2 = problem.J1, problem.lag, -problem.Mc / problem.J2
    if lag > 0.0:
        return lambda t, y: (y[1], y[3] / J1 - a2, a2, (ref - y[3]) / lag)
    a = ref / J1 - a2
    return lambda t, y: (y[1], a, a2)


def _in_contact(problem: Problem, ref: float, side: int, half: float) -> Any:
    """Rates, the torque of a state, and the events "gap opens" (terminal) and "torque is largest"."""
    J1, J2, c, d, Mc, lag = problem.J1, problem.J2, problem.c, problem.d, problem.Mc, problem.lag
    flank = side * half

    def torque(y: Vector) -> float:
        return c * (float(y[0]) - flank) + d * float(y[1])

    def rates(t: float, y: Vector) -> tuple[float, ...]:
        theta, v, _, *more = y.tolist()
        T = c * (theta - flank) + d * v
        u = more[0] if more else ref
        a2 = (T - Mc) / J2
        found = (v, (u - T) / J1 - a2, a2)
        return (*found, (ref - u) / lag) if more else found

    def opens(t: float, y: Vector) -> float:
        return side * torque(y)

    def top(t: float, y: Vector) -> float:
        return side * (c * float(y[1]) + d * rates(t, y)[1])

    opens.terminal, opens.direction = True, -1.0  # type: ignore[attr-defined]
    top.direction = -1.0  # type: ignore[attr-defined]
    return rates, torque, [opens, top]


class Lsoda:
    """All starts, one after the other."""

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        self.plan = sampled_plan(problem) if problem.stage_torques is None else stage_plan(problem)

    def ready(self, gaps: Vector) -> list[float]:
        """The gaps as plain floats."""
        return [float(gap) for gap in gaps]

    def solve(self, work: list[float]) -> Vector:
        """Peak torques, N m."""
        return np.array([peak_torque(self.problem, self.plan, gap) for gap in work])
