"""The peer python-control: `input_output_response` of the drive's nonlinear system on a grid of times."""

from __future__ import annotations

from typing import Any

import control
import numpy as np

from softstart import simulate
from softstart.drive.control_systems import initial_state
from softstart_studies.benchmarks.problem import Problem, Solve

WITH_CARE = {"rtol": 1e-8, "atol": 1e-8, "max_step": 1e-3}


def default(problem: Problem, count: int) -> Solve:
    """As it comes: RK45 at its default tolerances, outputs every millisecond, the peak read off them."""
    return _responses(problem, count, 1e-3)


def tight(problem: Problem, count: int) -> Solve:
    """With care: LSODA at 1e-8, no step over 1 ms, outputs every 0.1 ms."""
    return _responses(problem, count, 1e-4, solve_ivp_method="LSODA", solve_ivp_kwargs=WITH_CARE)


def _responses(problem: Problem, count: int, step: float, **options: Any) -> Solve:
    """Where the run ends is told it: finding the target speed is not a thing the function does."""
    if problem.strategy != "direct":
        raise ValueError(f"{problem.strategy}: an input given over time cannot follow the gap.")
    work = []
    for drive in problem.machines(count):
        end = simulate(drive, "direct").end_time
        times = np.linspace(0.0, end, round(end / step) + 1)
        work.append((drive.to_control(nonlinear=True), times, float(drive.Ms), initial_state(drive)))

    def solve() -> Any:
        responses = [control.input_output_response(*one, **options) for one in work]
        return np.array([[np.abs(one.outputs[one.output_labels.index("T")]).max()] for one in responses])

    return solve
