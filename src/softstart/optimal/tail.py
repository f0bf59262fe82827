"""What the motor does after t_f: a start is judged by its run to one elastic period beyond the start time.

Synchronous and steady: u_eq(T) = (T (J1 + J2) - Mc J1)/J2 holds the T of t_f. Reached: the motor coasts until
w1 = w2 (undamped, that is the peak of T; damped, just after it), then u_eq holds the T of then; no controller
whose torque is lowest_torque or more has a lower peak after t_f.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softstart.optimal.problem import Problem
from softstart.optimal.replay import replay
from softstart.profile import TorqueProfile
from softstart.start.run import Run

Vector = NDArray[np.float64]

LEVELS = (1.0, 0.9, 0.75, 0.5, 0.25, 0.0)  # shares of the holding torque that are tried where it lags
SAMPLES = 512  # instants at which the sign of w1 - w2 is looked at
EQUAL = 1e-9  # of the target speed: w1 and w2 that differ by less are equal
RISE = 1e-9  # a peak after t_f that is higher by no more than this share is none


def with_tail(problem: Problem, profile: TorqueProfile, end_time: float) -> TorqueProfile:
    """The demand of `profile` up to `end_time`, t_f in s, and what follows.

    Reached with T falling at t_f: its peak is over. Held at once, T would swing about T(t_f) and perhaps
    above its peak; some torque turns it back to rising without opening the gap, and at w1 = w2 it is held.
    With a lag or rate limit the realised torque comes late and T swings: a lower holding torque is taken
    where it keeps the peak of the run down. A torque-speed curve is kept to by holding less.

    >>> from softstart import Drive
    >>> problem = Problem(Drive.load("crane-4amtkf").replace(target_speed=60.0), 0.2883042)
    >>> pulse = TorqueProfile([0.0, 0.0075668, 0.0075668], [62.0, 62.0, 0.0])
    >>> held = with_tail(problem, pulse, 0.03591682)
    >>> held.torque.round(3).tolist()
    [62.0, 62.0, 0.0, 0.0, 56.243]
    """
    before = profile.followed_by(end_time, TorqueProfile([0.0], [problem.lowest_torque]))
    run = replay(problem.drive, before, end_time, problem.base)
    hold = _held(problem, run)
    if problem.terminal != "reached":
        return _joined(before, end_time, [(0.0, hold)])
    v = float(run.at(end_time)["v"])
    levels = [problem.lowest_torque]
    if v < -EQUAL * problem.target:
        levels = [hold, problem.highest_torque, problem.lowest_torque]
    last = end_time + float(problem.drive.elastic_period)
    tried = []
    for level in levels:
        for made, allowed in _held_after(problem, before, end_time, level, v):
            peak = replay(problem.drive, made, last, problem.base).peak_torque
            if peak <= allowed * (1.0 + RISE):
                return made
            tried.append((peak, made))
    return min(tried, key=lambda one: one[0])[1]


def _held_after(
    problem: Problem, before: TorqueProfile, end: float, level: float, v: float
) -> Iterator[tuple[TorqueProfile, float]]:
    """`level` from t_f until w1 = w2, then held: profiles, best first, with the peak of T until then."""
    turning = _turn(problem, before, end, level, v)
    going = _joined(before, end, [(0.0, level)])
    if not math.isfinite(turning):
        yield going, replay(problem.drive, before, end, problem.base).peak_torque
        return
    run = replay(problem.drive, going, turning, problem.base)
    hold, low = _held(problem, run), problem.lowest_torque
    late = problem.drive.torque_lag > 0.0 or math.isfinite(problem.drive.torque_rate)
    for share in LEVELS if late else LEVELS[:1]:
        steps = [(0.0, level), (turning - end, low + share * (hold - low))]
        yield _joined(before, end, steps), run.peak_torque


def _held(problem: Problem, run: Run) -> float:
    """u_eq(T) for T at the end of the run, within the limits, N m.

    Beyond a torque-speed curve it is what the curve leaves at the greatest speed of the period to come: the
    acceleration now, and a swing of all of T.
    """
    drive = problem.drive
    state = run.at(run.end_time)
    T, w1 = float(state["T"]), float(state["w1"])
    J = drive.J1 + drive.J2
    u = (T * J - drive.Mc * drive.J1) / drive.J2
    if problem.torque_speed and u > float(torque_allowed(problem, _fastest(problem, w1, T, 0.0))):
        u = float(torque_allowed(problem, _fastest(problem, w1, T, T)))
    return float(min(max(u, problem.lowest_torque), problem.highest_torque))


def _fastest(problem: Problem, w1: float, T: float, swing: float) -> float:
    """An upper bound of w1 over one elastic period in which T is at most what it is now, rad/s."""
    drive = problem.drive
    gained = max(T - drive.Mc, 0.0) / drive.J2 * drive.elastic_period
    swings = drive.J2 / (drive.J1 + drive.J2) * drive.Omega / drive.c * swing
    return float(w1 + gained + swings)


def torque_allowed(problem: Problem, w1: ArrayLike) -> Vector:
    """What the (concave) torque-speed curve allows at w1 in rad/s, N m: the least of its lines.

    >>> from softstart import Drive
    >>> limit = ((0.0, 62.0), (60.0, 62.0), (100.0, 22.0))
    >>> problem = Problem(Drive.load("crane-4amtkf"), 0.5, torque_speed=limit)
    >>> torque_allowed(problem, [10.0, 80.0]).tolist()
    [62.0, 42.0]
    """
    speed = np.asarray(w1, dtype=np.float64)
    lines = [
        u_a + (u_b - u_a) / (w_b - w_a) * (speed - w_a)
        for (w_a, u_a), (w_b, u_b) in pairwise(problem.torque_speed)
    ]
    return np.asarray(np.min(lines, axis=0))


def _joined(before: TorqueProfile, end: float, steps: list[tuple[float, float]]) -> TorqueProfile:
    """The profile up to `end`, then constant demands, each from so long after it on."""
    edges = [start for start, _ in steps]
    tail = TorqueProfile.steps([*edges, edges[-1] + 1.0], [level for _, level in steps])
    return before.followed_by(end, tail).simplified()


def _turn(problem: Problem, before: TorqueProfile, end: float, level: float, v: float) -> float:
    """First instant from `end` on in s at which w1 = w2 under a constant demand; inf if the gap opens before.

    Not T' = 0: where the shaft is damped, T' jumps with the torque, and only at w1 = w2 does u_eq hold T.
    """
    from scipy.optimize import brentq

    drive = problem.drive
    if abs(v) < EQUAL * problem.target:
        return end
    horizon = end + float(drive.elastic_period) + 5.0 * float(drive.torque_lag)
    run = replay(drive, _joined(before, end, [(0.0, level)]), horizon, problem.base)
    times = np.linspace(end, horizon, SAMPLES)
    state = run.at(times)
    turned = np.flatnonzero((state["v"] * v <= 0.0) | (state["T"] <= 0.0))
    if turned.size == 0 or state["T"][turned[0]] <= 0.0:
        return math.inf
    i = int(turned[0])
    return float(brentq(lambda t: float(run.at(t)["v"]), times[i - 1], times[i], xtol=1e-14))
