"""The peer dymos: a trajectory of two linked phases, Gauss-Lobatto collocation of order 3, SLSQP of scipy.

In each segment the torque is the parabola through its three nodes, free to jump to the next segment; its
bounds hold at the nodes. It is read off a timeseries of 20 points a segment and taken as linear in between.
IPOPT would need pyoptsparse, of which there was no wheel to be had.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

import numpy as np

from softstart_studies.benchmarks.optima.task import Answer, Task

POINTS = 20  # a segment, of the timeseries that the torque is read off
PHASES = ("open", "contact")


def rates(task: Task, closed: bool) -> Any:
    """The right-hand side of a phase as a class of OpenMDAO; its derivatives are constants."""
    om = import_module("openmdao.api")
    k, half = (task.c if closed else 0.0), 0.5 * task.gap
    slopes = {
        ("v", "w1"): 1.0, ("v", "w2"): -1.0, ("a1", "u"): 1 / task.J1, ("a1", "theta"): -k / task.J1,
        ("a2", "theta"): k / task.J2, ("T", "theta"): k, ("room", "P"): 1.0, ("room", "theta"): -k,
    }  # fmt: skip

    class Rates(om.ExplicitComponent):  # type: ignore[name-defined, misc]
        def initialize(self) -> None:
            self.options.declare("num_nodes", types=int)

        def setup(self) -> None:
            count = self.options["num_nodes"]
            for name in ("theta", "w1", "w2", "u", "P"):
                self.add_input(name, shape=(count,))
            for name in ("v", "a1", "a2", "T", "room"):
                self.add_output(name, shape=(count,))
            diagonal = np.arange(count)
            for (of, wrt), slope in slopes.items():
                if slope:
                    self.declare_partials(of, wrt, rows=diagonal, cols=diagonal, val=slope)

        def compute(self, inputs: Any, outputs: Any) -> None:
            T = k * (inputs["theta"] - half)
            outputs["v"] = inputs["w1"] - inputs["w2"]
            outputs["a1"] = (inputs["u"] - T) / task.J1
            outputs["a2"] = (T - task.Mc) / task.J2
            outputs["T"] = T
            outputs["room"] = inputs["P"] - T

    return Rates


def solve(task: Task, open_segments: int = 15, contact_segments: int = 45) -> Answer:
    """Least peak torque with two linked phases."""
    om, dm = import_module("openmdao.api"), import_module("dymos")
    half, limit, target = 0.5 * task.gap, task.start_time, task.target
    problem = om.Problem(reports=False)
    problem.driver = om.ScipyOptimizeDriver(optimizer="SLSQP", maxiter=300, tol=1e-8, disp=False)
    problem.driver.declare_coloring(show_summary=False)
    trajectory = problem.model.add_subsystem("traj", dm.Trajectory())
    phases = {}
    for name, segments in zip(PHASES, (open_segments, contact_segments), strict=True):
        closed = name == "contact"
        mesh = dm.GaussLobatto(num_segments=segments, order=3)
        phase = dm.Phase(ode_class=rates(task, closed), transcription=mesh)
        phases[name] = trajectory.add_phase(name, phase)
        phase.add_state("theta", rate_source="v", fix_initial=not closed)
        for speed, rate in (("w1", "a1"), ("w2", "a2")):
            phase.add_state(speed, rate_source=rate, fix_initial=not closed, fix_final=closed, ref=target)
        phase.add_control("u", lower=0.0, upper=task.Ms, ref=task.Ms, continuity=False, rate_continuity=False)
        begin = {"initial_bounds": (0.0, limit)} if closed else {"fix_initial": True}
        phase.set_time_options(duration_bounds=(1e-3, limit), duration_ref=limit, **begin)
        phase.add_timeseries("fine", dm.Radau(num_segments=segments, order=POINTS - 1))
        phase.add_timeseries_output("u", timeseries="fine")
    trajectory.add_parameter(
        "P", opt=True, lower=0.0, ref=task.base, static_target=False, targets={key: ["P"] for key in PHASES}
    )
    opening, contact = phases["open"], phases["contact"]
    opening.add_boundary_constraint("theta", loc="final", equals=half)
    opening.add_path_constraint("theta", upper=half)
    contact.add_path_constraint("T", lower=0.0, ref=task.base)
    contact.add_path_constraint("room", lower=0.0, ref=task.base)
    contact.add_boundary_constraint("time", loc="final", upper=limit, ref=limit)
    trajectory.link_phases(PHASES, ["time", "theta", "w1", "w2"])
    problem.model.add_objective("traj.parameter_vals:P", ref=task.base)
    problem.setup()

    problem.set_val("traj.parameter_vals:P", task.base)
    opening.set_time_val(0.0, 0.1 * limit)
    contact.set_time_val(0.1 * limit, 0.9 * limit)
    guesses = {
        "open": {"theta": (0.0, half), "w1": (0.0, 0.1 * target), "w2": (0.0, 0.0)},
        "contact": {
            "theta": (half, half + task.base / task.c),
            "w1": (0.1 * target, target),
            "w2": (0, target),
        },
    }
    for name, phase in phases.items():
        phase.set_control_val("u", (0.5 * task.Ms, 0.5 * task.Ms))
        for state, ends in guesses[name].items():
            phase.set_state_val(state, ends)
    if not dm.run_problem(problem, run_driver=True, simulate=False, make_plots=False).success:
        raise RuntimeError("SLSQP did not converge.")
    time, torque = (
        np.concatenate([problem.get_val(f"traj.{name}.fine.{what}").ravel() for name in PHASES])
        for what in ("time", "u")
    )
    end = float(time[-1])
    claimed = problem.get_val("traj.parameter_vals:P").item() / task.base
    return Answer(float(claimed), tuple(time.tolist()), tuple(torque.tolist()), end)
