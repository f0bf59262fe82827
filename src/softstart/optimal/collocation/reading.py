"""A solution in SI: the demand as a profile, what it claims, and what the exact plant makes of it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softstart.optimal.collocation.ipopt import Solution
from softstart.optimal.problem import Problem
from softstart.optimal.replay import heat_of, replay
from softstart.profile import TorqueProfile

Vector = NDArray[np.float64]

LOOKS = 12  # per interval, at the re-simulated shaft torque


@dataclass(frozen=True)
class Claim:
    """What a solution says: profile up to t_f, edges of its intervals in s, its figure."""

    profile: TorqueProfile
    end_time: float
    edges: Vector  # of the intervals up to t_f, s
    levels: Vector  # demand before and after in each, N m
    peak: float  # N m
    value: float  # of what is minimised


@dataclass(frozen=True)
class Replayed:
    """The same on the exact plant."""

    value: float
    shortfall: float  # of the load speed at t_f, relative to the target
    landing: float  # largest error of the terminal conditions, relative to target and Ms
    parted: NDArray[np.bool_]  # intervals in which the flanks part before t_f
    overshoot: Vector  # largest T in each interval over the claimed peak, relative


def claim(problem: Problem, solution: Solution) -> Claim:
    """Read a solution."""
    program, units = solution.transcribed.program, solution.p.units
    durations, peak, heat, _, demands = solution.read()
    arcs = program.start_arcs
    mesh = solution.transcribed.mesh[:arcs]
    widths = np.concatenate([T * np.diff(edges) for T, edges in zip(durations, mesh, strict=False)])
    edges = np.concatenate([[0.0], np.cumsum(widths)]) * units.time
    levels = demands[: widths.size] * units.torque
    levels = np.clip(levels, problem.lowest_torque, problem.highest_torque)
    end = float(edges[-1])
    value = {
        "k_dyn": peak * units.torque / problem.base_torque,
        "heat": heat * units.time,
        "start_time": end,
    }[problem.minimise]
    return Claim(_profile(program.demand, edges, levels), end, edges, levels, peak * units.torque, value)


def _profile(shape: str, edges: Vector, levels: Vector) -> TorqueProfile:
    if shape == "steps":
        return TorqueProfile.steps(edges, levels[:, 0])
    if shape == "ramps":
        return TorqueProfile(np.repeat(edges, 2)[1:-1], levels.ravel()).simplified()
    return TorqueProfile(edges, np.concatenate([levels[:1, 0], levels[:, 1]])).simplified()


def replayed(problem: Problem, own: Claim) -> Replayed:
    """Run the claim on the exact plant, to the first peak after t_f where the motor coasts."""
    drive: Any = problem.drive
    profile, until = own.profile, own.end_time
    if problem.terminal == "reached":
        profile = profile.followed_by(own.end_time, TorqueProfile([0.0], [problem.lowest_torque]))
        until += math.pi / drive.Omega + 5.0 * drive.torque_lag
    run = replay(drive, profile, until, problem.base)
    width = np.diff(own.edges)
    looks = (np.arange(LOOKS) + 0.5) / LOOKS
    times = own.edges[:-1, None] + width[:, None] * looks
    T = np.abs(run.at(times.clip(0.0, run.end_time))["T"])
    overshoot = T.max(axis=1) / max(own.peak, 1e-300) - 1.0
    end = {name: float(values[0]) for name, values in run.at([own.end_time]).items()}
    shortfall = 1.0 - end["w2"] / problem.target
    errors = [shortfall]
    if problem.terminal != "reached":
        errors.append(end["v"] / problem.target)
    if problem.terminal == "steady":
        errors.append((end["T"] - drive.Mc) / drive.Ms)
    openings = [e.time for e in run.events if e.kind == "gap opened" and e.time < own.end_time]
    parted = np.histogram(openings, own.edges)[0] > 0
    heat = heat_of(run, own.end_time)
    value = {"k_dyn": run.k_dyn, "heat": heat, "start_time": own.end_time}[problem.minimise]
    return Replayed(float(value), shortfall, max(map(abs, errors)), parted, overshoot)
