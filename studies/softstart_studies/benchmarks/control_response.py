"""The peer python-control: `input_output_response` of the drive's nonlinear system on a grid of times."""

from __future__ import annotations

from typing import Any, ClassVar

import control
import numpy as np

from softstart import simulate
from softstart.arrays import Vector
from softstart.drive.control_systems import initial_state
from softstart_studies.benchmarks.problem import Problem, crane

Work = list[tuple[Any, Vector, Vector, float]]


class ControlDefault:
    """As it comes: RK45 at its default tolerances, outputs every millisecond, the peak read off them."""

    step = 1e-3  # s, of the grid of times
    options: ClassVar[dict[str, Any]] = {}

    def __init__(self, problem: Problem) -> None:
        if problem.strategy != "direct":
            raise ValueError(f"{problem.strategy}: an input given over time cannot follow the gap.")

    def ready(self, gaps: Vector) -> Work:
        """System, times, initial state and torque of each start.

        Where the run ends is told it: finding the target speed is not a thing the function does.
        """
        work = []
        for gap in gaps:
            drive = crane(float(gap))
            end = simulate(drive, "direct").end_time
            times = np.linspace(0.0, end, round(end / self.step) + 1)
            work.append((drive.to_control(nonlinear=True), times, initial_state(drive), float(drive.Ms)))
        return work

    def solve(self, work: Work) -> Vector:
        """Peak torques, N m."""
        peaks = []
        for system, times, state, torque in work:
            response = control.input_output_response(system, times, torque, state, **self.options)
            row = response.output_labels.index("T")
            peaks.append(float(np.abs(response.outputs[row]).max()))
        return np.array(peaks)


class ControlTight(ControlDefault):
    """With care: LSODA at 1e-8, no step over 1 ms, outputs every 0.1 ms."""

    step = 1e-4
    options: ClassVar[dict[str, Any]] = {
        "solve_ivp_method": "LSODA",
        "solve_ivp_kwargs": {"rtol": 1e-8, "atol": 1e-8, "max_step": 1e-3},
    }
