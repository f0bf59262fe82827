"""softstart itself, as it is used: the bare kernel, a batch with labelled results, a Run for each start."""

from __future__ import annotations

from typing import Any, cast

import numpy as np

from softstart import records, simulate
from softstart.arrays import Vector
from softstart.controller import CompiledController, Sensor
from softstart.drive import Drive
from softstart.drive.records import Records
from softstart.formulas import DirectStarts
from softstart.kernel import records as at
from softstart.kernel import start as kernel
from softstart.kernel.motor import N_MEASURED, NEW_STATE
from softstart.start.batch import prepared
from softstart.start.run import Run
from softstart_studies.benchmarks.problem import GAPS, Problem, controller_of, crane


class Kernel:
    """The compiled kernel over a batch: arrays of parameters in, one row of located figures a start out."""

    def __init__(self, problem: Problem) -> None:
        self.problem = problem

    def ready(self, gaps: Vector) -> tuple[Any, ...]:
        """All arguments of the kernel; those after the results are its scratch."""
        drive, count = crane(GAPS[0], self.problem.strategy), len(gaps)
        controller = cast(CompiledController, controller_of(self.problem.strategy, drive))
        own = np.atleast_2d(np.ascontiguousarray(controller.vector(drive), dtype=np.float64))
        size, rows = controller.state_size, prepared(records(drive, gap=gaps)).rows
        return (
            type(controller).kernel, own, int(controller.sensors), bool(controller.sensors & Sensor.STAGE),
            np.inf, rows.machines, rows.masses, rows.shafts, rows.curves, np.zeros((count, at.N_NOTES)),
            np.zeros((count, 1, at.size(at.SHAFT_NOTES))), np.zeros(at.N_WORK), np.zeros(N_MEASURED),
            np.zeros(size), np.zeros(NEW_STATE + size),
        )  # fmt: skip

    def solve(self, work: tuple[Any, ...]) -> Vector:
        """Peak torques, N m."""
        kernel.run_many(*work)
        peaks: Vector = np.abs(work[10].view(at.SHAFT_NOTES)[:, 0, 0]["peak"])
        return peaks


class Formula:
    """The closed forms of [G] over arrays: direct starts of undamped drives."""

    def __init__(self, problem: Problem) -> None:
        self.problem = problem

    def ready(self, gaps: Vector) -> Vector:
        """The gaps."""
        return gaps

    def solve(self, work: Vector) -> Vector:
        """Peak torques, N m, with all other figures of each start."""
        one = self.problem
        torque = cast(tuple[float, ...], one.stage_torques)[0]
        starts = DirectStarts(
            J1=one.J1, J2=one.J2, c=one.c, Ms=torque, Mc=one.Mc, target_speed=one.target, gap=work
        )
        return np.broadcast_to(starts.peak, work.shape)


class Batch:
    """`simulate` of records: the same kernel, and its figures as an xarray.Dataset."""

    def __init__(self, problem: Problem) -> None:
        self.problem = problem

    def ready(self, gaps: Vector) -> tuple[Records, Any]:
        """The batch and its controller."""
        drive = crane(GAPS[0], self.problem.strategy)
        return records(drive, gap=gaps), controller_of(self.problem.strategy, drive)

    def solve(self, work: tuple[Records, Any]) -> Vector:
        """Peak torques, N m."""
        labelled = cast(Any, simulate(*work))  # an xarray.Dataset, of many drives
        peaks: Vector = labelled.peak_torque.values
        return peaks


class EachRun:
    """One `simulate` call a start, with figures, events and stages of its Run."""

    def __init__(self, problem: Problem) -> None:
        self.problem = problem

    def ready(self, gaps: Vector) -> list[tuple[Drive, Any]]:
        """Drives and controllers."""
        drives = [crane(float(gap), self.problem.strategy) for gap in gaps]
        return [(drive, controller_of(self.problem.strategy, drive)) for drive in drives]

    def solve(self, work: list[tuple[Drive, Any]]) -> Vector:
        """Peak torques, N m."""
        return np.array([self.asked(simulate(drive, controller)) for drive, controller in work])

    def asked(self, run: Run) -> float:
        """Peak torque, N m, after the lazy parts of the Run have been made."""
        if not (run.events and run.stages and run.start_time > 0.0):
            raise ValueError("a start without events is no start.")
        return run.peak_torque


class EachRunWithTraces(EachRun):
    """The same, and the 1500 and more instants of every trace."""

    def asked(self, run: Run) -> float:
        """Peak torque, N m, after all traces have been made: they are evaluated together."""
        if run.T.shape != run.t.shape:
            raise ValueError("a trace without its instants is no trace.")
        return super().asked(run)
