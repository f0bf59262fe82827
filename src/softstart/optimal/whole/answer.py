"""What a whole start is made of, and what comes out of its linear program."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from softstart.optimal.problem import Problem
from softstart.profile import TorqueProfile

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]
Kind = Literal["gap", "resting", "stuck", "contact"]  # resting: a gap with the load at rest; stuck: wound up
Shape = Literal["steps", "ramps", "continuous"]
Grid = tuple[tuple[Kind, Vector], ...]  # phases in order, each with the edges of its steps as shares of it


@dataclass(frozen=True)
class Instants:
    """When the gap closes, the load breaks away and the start ends, s; tb = tc where no load is at rest."""

    tc: float
    tb: float
    end: float


@dataclass(frozen=True, eq=False)
class WholeAnswer:
    """The optimum at fixed instants: peak P in N m, and the demand at the beginning and end of each step."""

    at: Instants
    P: float
    grid: Grid
    edges: Vector  # s, of all steps up to t_f
    demand: Matrix  # (steps, 2), N m
    broken: NDArray[np.bool_]  # steps in which T is not kept between the checks
    beyond: bool  # the torque that would hold T at t_f is more than the motor has
    x: Vector = field(repr=False)  # all variables of the program

    def profile(self, problem: Problem) -> TorqueProfile:
        """The demand up to t_f, exactly within the limits of the torque."""
        levels = np.clip(self.demand, problem.lowest_torque, problem.highest_torque)
        shape = demand_shape(problem)
        if shape == "steps":
            return TorqueProfile.steps(self.edges, levels[:, 0])
        if shape == "ramps":
            return TorqueProfile(np.repeat(self.edges, 2)[1:-1], levels.ravel()).simplified()
        return TorqueProfile(self.edges, np.concatenate([levels[:1, 0], levels[:, 1]])).simplified()


def demand_shape(problem: Problem) -> Shape:
    """Which demands the plant plays without bending them."""
    if math.isfinite(problem.drive.torque_rate):
        return "continuous"
    return "ramps" if problem.torque_speed else "steps"


def phase_ends(grid: Grid, at: Instants) -> list[float]:
    """When the phases of a grid begin and end, s."""
    ends = {"gap": at.tc, "resting": at.tc, "stuck": at.tb, "contact": at.end}
    return [0.0, *(ends[kind] for kind, _ in grid)]
