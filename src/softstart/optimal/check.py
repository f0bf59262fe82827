"""Whether an answer holds on the exact machine: its demand is run again, and every claim and bound compared.

Nothing is read off the grid of a method: the demand is judged over all of its straight lines, the realised
torque over every span of the run, the peak is located, the terminal condition is that of the run.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from softstart.arrays import Vector
from softstart.controller import make_controller
from softstart.kernel import records as rec
from softstart.optimal.problem import Problem
from softstart.optimal.result import LowerBound, OptimumError, largest_heat
from softstart.optimal.starts import DemandRun, steady_shaft_torques, wanted
from softstart.profile import TorqueProfile
from softstart.start.run import Run
from softstart.start.simulation import simulate

ROUNDING = 1e-9  # of limits and times
SAME = 1e-3  # a claim and its exact replay differ by no more than this share
BEYOND = 1e-4  # of the highest torque, above a torque-speed curve


def replayed(problem: Problem, profile: TorqueProfile, end: float) -> tuple[Run, ...]:
    """The runs of the machine and of each scenario to one elastic period after their ends.

    >>> from softstart import Drive
    >>> problem = Problem(Drive.load("crane-4amtkf"), 0.5, "reached")
    >>> round(replayed(problem, TorqueProfile([0.0], [62.0]), 0.5)[0].k_dyn, 4)
    3.1179
    """
    player = make_controller("profile", {"profile": profile})
    return tuple(
        simulate(one, player, end + float(one.elastic_period), base=problem.base or problem.drive)
        for one in (problem.drive, *problem.scenarios)
    )


def check(
    problem: Problem, profile: TorqueProfile, runs: tuple[Run, ...], end: float, claimed: float,
    bound: LowerBound,
) -> None:  # fmt: skip
    """OptimumError with a sentence, both numbers in it, for each thing that does not hold.

    >>> from softstart import Drive
    >>> problem = Problem(Drive.load("crane-4amtkf").replace(target_speed=60.0), 0.2883042)
    >>> profile = TorqueProfile([0.0], [62.0])
    >>> runs = replayed(problem, profile, 0.2402535)
    >>> check(problem, profile, runs, 0.2402535, 0.9, LowerBound(0.909, "momentum", "every torque"))
    Traceback (most recent call last):
    softstart.optimal.result.OptimumError: ...K_dyn is 3.1... in the exact re-simulation, 0.9 was claimed...
    """
    wrong = [*_beyond(problem, "demand", profile.time, profile.torque)]  # straight lines
    for run in runs:
        for one in run.each:
            wrong += [*_realised(problem, one), *_torque_speed(problem, profile, one)]
            wrong += _terminal(problem, one, end)
    if wrong := [*wrong, *_figures(problem, runs, end, claimed, bound)]:
        raise OptimumError(" ".join(wrong))


def _realised(problem: Problem, run: Run) -> Iterator[str]:
    """In each span lag u' = ref + slope s - u: u is extreme at its ends or where u' = 0."""
    lag = float(run.trajectory.input.machine.lag)
    columns = (rec.S_START, rec.S_END, rec.S_U, rec.S_REF, rec.S_SLOPE)
    start, end, first, ref, ub = (run.trajectory.spans[:, column] for column in columns)
    length, ua = end - start, ref - lag * ub  # u(s) = ua + ub s + ue exp(-s/lag)
    ue = first - ua
    turns = np.zeros_like(length)
    if lag > 0.0:
        bent = (ub != 0.0) & (ue / np.where(ub != 0.0, ub * lag, 1.0) > 0.0)
        turns[bent] = lag * np.log(ue[bent] / (ub[bent] * lag))
    s = np.stack([np.zeros_like(length), length, np.clip(turns, 0.0, length)])
    u = ua + ub * s + (ue * np.exp(-s / lag) if lag > 0.0 else 0.0)
    yield from _beyond(problem, "motor torque", (start + s).ravel(), u.ravel())


def _beyond(problem: Problem, name: str, times: Vector, torques: Vector) -> Iterator[str]:
    """Where torques exceed the limits of the motor."""
    low, high = problem.lowest_torque, problem.highest_torque
    for i, limit, sign in ((np.argmax(torques), high, 1.0), (np.argmin(torques), low, -1.0)):
        if sign * (float(torques[i]) - limit) > ROUNDING * max(abs(low), abs(high)):
            at_peak = f"The {name} is {torques[i]:.6g} N m at {times[i]:.6g} s"
            yield f"{at_peak}, beyond the {limit:.6g} N m allowed."


def torque_allowed(problem: Problem, w1: ArrayLike) -> Vector:
    """What the (concave) torque-speed curve allows at w1 in rad/s, N m: the least of its lines.

    >>> from softstart import Drive
    >>> limit = ((0.0, 62.0), (60.0, 62.0), (100.0, 22.0))
    >>> problem = Problem(Drive.load("crane-4amtkf"), 0.5, torque_speed=limit)
    >>> torque_allowed(problem, [10.0, 80.0]).tolist()
    [62.0, 42.0]
    """
    speed = np.asarray(w1, dtype=np.float64)
    lines = [a[1] + (b[1] - a[1]) / (b[0] - a[0]) * (speed - a[0]) for a, b in pairwise(problem.torque_speed)]
    return np.asarray(np.min(lines, axis=0))


def _torque_speed(problem: Problem, profile: TorqueProfile, run: Run) -> Iterator[str]:
    if not problem.torque_speed:
        return
    times = DemandRun(profile, run.trajectory).instants(run.elastic_period / 64)
    state = run.trajectory.at(times)
    over = state["u"] - torque_allowed(problem, state["w"][:, run.drive.motor_index])
    i = int(np.argmax(over))
    if over[i] > BEYOND * problem.highest_torque:
        above = f"{over[i]:.6g} N m above the torque-speed curve"
        yield f"The motor torque is {state['u'][i]:.6g} N m at {times[i]:.6g} s, {above}."


def _terminal(problem: Problem, run: Run, end: float) -> Iterator[str]:
    state, target = run.trajectory.at([end]), problem.target
    if problem.terminal == "reached":
        speed = float(state["w"][0, run.drive.load_index])
        if not speed >= target * (1.0 - ROUNDING):
            yield f"The load has {speed:.9g} rad/s at {end:.9g} s, less than its target of {target:.9g}."
        return
    off = float(np.abs(state["w"][0] / target - 1.0).max())
    if off > 1e-6:
        yield f"The speeds at {end:.6g} s are off their target of {target:.9g} rad/s by a share of {off:.3g}."
    if problem.terminal == "steady":
        aim = wanted(steady_shaft_torques(run.trajectory.input), problem.base_torque, run.drive.motor_index)
        off = float(np.abs(state["T"][0] - aim).max())
        if off > SAME * problem.base_torque:
            yield f"The shaft torques at {end:.6g} s are off the load torques behind them by {off:.6g} N m."


def _figures(
    problem: Problem, runs: tuple[Run, ...], end: float, claimed: float, bound: LowerBound
) -> Iterator[str]:
    """What was claimed, and the bounds of the problem on what is not minimised."""
    k_dyn = max(run.peak_torque for run in runs) / problem.base_torque
    heat = largest_heat(runs, end)
    value, name = {
        "k_dyn": (k_dyn, "K_dyn"),
        "heat": (heat, "The heat in s"),
        "start_time": (end, "The start time in s"),
    }[problem.minimise]
    if not abs(value - claimed) <= SAME * abs(value):
        yield f"{name} is {value:.8g} in the exact re-simulation, {claimed:.8g} was claimed."
    for said, value, most, unit, beyond in (
        (f"The start takes {end:.9g} s, longer than the start time", end, problem.start_time, " s", ROUNDING),
        (f"K_dyn is {k_dyn:.8g}, above its bound", k_dyn, problem.k_dyn, "", SAME),
        (f"The heat is {heat:.8g} s, above its bound", heat, problem.heat, " s", SAME),
    ):
        if most is not None and value > most * (1.0 + beyond):
            yield f"{said} of {most:.9g}{unit}."
    if k_dyn < bound.k_dyn * (1.0 - 1e-5):  # what a speed that may be missed by 1e-6 is worth
        yield f"K_dyn is {k_dyn:.8g}, below its lower bound of {bound.k_dyn:.8g} ({bound.kind})."
