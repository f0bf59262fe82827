"""softstart itself, as it is used: the bare kernel, a batch with labelled results, a Run for each start."""

from __future__ import annotations

from typing import Any, cast

import numpy as np

from softstart import records, simulate
from softstart.controller import CompiledController, Sensor
from softstart.formulas import DirectStarts
from softstart.kernel import records as at
from softstart.kernel import start
from softstart.kernel.motor import N_MEASURED, NEW_STATE
from softstart.start.batch import prepared
from softstart.start.run import Run
from softstart_studies.benchmarks.problem import Problem, Solve, gaps


def kernel(problem: Problem, count: int) -> Solve:
    """The compiled kernel over a batch: arrays of parameters in, one row of located figures a start out."""
    machines, controller = problem.machines(count), cast(CompiledController, problem.controller())
    own = np.atleast_2d(np.array(controller.vector(machines[0].design_drive), dtype=np.float64))
    size, rows = controller.state_size, prepared(machines).rows
    shafts = np.zeros((count, rows.count - 1, at.size(at.SHAFT_NOTES)))
    work = (
        type(controller).kernel, own, int(controller.sensors), bool(controller.sensors & Sensor.STAGE),
        np.inf, rows.machines, rows.masses, rows.shafts, rows.curves, np.zeros((count, at.N_NOTES)), shafts,
        np.zeros(at.N_WORK), np.zeros(N_MEASURED), np.zeros(size), np.zeros(NEW_STATE + size),
    )  # fmt: skip

    def solve() -> Any:
        start.run_many(*work)
        return np.abs(shafts.view(at.SHAFT_NOTES)[:, :, 0]["peak"])

    return solve


def formula(problem: Problem, count: int) -> Solve:
    """The closed forms of [G] over arrays: direct starts of undamped drives, with all their figures."""
    (one,), gap = problem.machines(), gaps(count)
    torque = problem.line().stages()[0]
    return lambda: np.broadcast_to(
        DirectStarts(
            J1=one.J1, J2=one.J2, c=one.c, Ms=torque, Mc=one.Mc, target_speed=one.target_speed, gap=gap
        ).peak,
        gap.shape,
    )[:, None]


def batch(problem: Problem, count: int) -> Solve:
    """`simulate` of records: the same kernel, and its figures as an xarray.Dataset."""
    controller, (drive,) = problem.controller(), problem.machines()
    many = records(drive, gap=gaps(count))
    return lambda: cast(Any, simulate(many, controller)).peak_torque.values[:, None]


def run(problem: Problem, count: int) -> Solve:
    """One `simulate` call a start, with figures, events and stages of its Run."""
    return _runs(problem, count, lambda run: bool(run.events and run.stages and run.start_time > 0.0))


def run_with_traces(problem: Problem, count: int) -> Solve:
    """The same, and the 1500 and more instants of every trace, which are evaluated together."""
    return _runs(problem, count, lambda run: bool(run.events and run.stages and run.T.shape == run.t.shape))


def _runs(problem: Problem, count: int, looked_at: Any) -> Solve:
    """`looked_at` makes the lazy parts of the Run."""
    machines, controller = problem.machines(count), problem.controller()
    told = machines[0].design_drive

    def peaks(run: Run) -> Any:
        if not looked_at(run):
            raise ValueError("a start without events is no start.")
        return np.atleast_1d(run.peak_torque if problem.on_drive else run.peak_torques)

    return lambda: np.array([peaks(cast(Run, simulate(one, controller, fitted_to=told))) for one in machines])
