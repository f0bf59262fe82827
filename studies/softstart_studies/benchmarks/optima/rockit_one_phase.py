"""rockit without phases: the contact is a kink in the right-hand side, max(0, .), or that kink rounded off.

The shortest way to write the problem down, and the one that is a trap: what comes out depends on the guess.
"""

from __future__ import annotations

from importlib import import_module

from softstart_studies.benchmarks.optima.rockit_phases import IPOPT
from softstart_studies.benchmarks.optima.task import Answer, Task, steps


def solve(task: Task, rounding: float = 0.0, guess: float = 0.5, intervals: int = 100) -> Answer:
    """Least peak torque; `rounding` of the kink in rad, `guess` of the torque as a share of Ms."""
    rockit, casadi = import_module("rockit"), import_module("casadi")
    ocp = rockit.Ocp(T=task.start_time)
    K_dyn = ocp.variable()
    theta, w1, w2, u = ocp.state(), ocp.state(), ocp.state(), ocp.control()
    z = theta - 0.5 * task.gap
    depth = 0.5 * (z + casadi.sqrt(z**2 + rounding**2)) if rounding else casadi.fmax(0, z)
    T = task.c * depth
    ocp.set_der(theta, w1 - w2)
    ocp.set_der(w1, (u - T) / task.J1)
    ocp.set_der(w2, (T - task.Mc) / task.J2)
    for state in (theta, w1, w2):
        ocp.subject_to(ocp.at_t0(state) == 0)
    for speed in (w1, w2):
        ocp.subject_to(ocp.at_tf(speed) == task.target)
        ocp.set_initial(speed, task.target * ocp.t / task.start_time)
    ocp.subject_to(0 <= (u <= task.Ms))  # noqa: SIM300
    ocp.subject_to(T <= K_dyn * task.base)  # noqa: SIM300
    ocp.set_initial(u, guess * task.Ms)
    ocp.set_initial(K_dyn, 1.0)
    ocp.add_objective(K_dyn)
    ocp.solver("ipopt", {**IPOPT, "ipopt.max_iter": 1000})
    ocp.method(rockit.MultipleShooting(N=intervals, M=1, intg="rk"))
    found = ocp.solve()
    edges, levels = found.sample(u, grid="control")
    return steps(found.value(K_dyn), edges, levels[:-1])
