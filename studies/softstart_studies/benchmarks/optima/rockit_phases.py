"""The peer rockit: a stage with the gap open, a stage in contact, both of free duration, CasADi and IPOPT.

Direct multiple shooting; the torque is constant in each of its intervals. Bounds hold at the grid points.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

import numpy as np

from softstart_studies.benchmarks.optima.task import Answer, Task, steps

IPOPT = {"expand": True, "print_time": False, "ipopt.print_level": 0, "ipopt.sb": "yes"}


def solve(task: Task, open_intervals: int = 25, contact_intervals: int = 75) -> Answer:
    """Least peak torque with two stages."""
    rockit = import_module("rockit")
    J1, J2, c, half, Mc, Ms = task.J1, task.J2, task.c, 0.5 * task.gap, task.Mc, task.Ms
    brief, rest = 0.1 * task.start_time, 0.9 * task.start_time  # guessed durations

    ocp = rockit.Ocp()
    K_dyn = ocp.variable()
    ocp.set_initial(K_dyn, 1.0)
    ocp.add_objective(K_dyn)
    ocp.solver("ipopt", IPOPT)

    def stage(begin: Any, duration: float, intervals: int, closed: bool) -> tuple[Any, ...]:
        phase = ocp.stage(t0=begin, T=rockit.FreeTime(duration))
        theta, w1, w2, u = phase.state(), phase.state(), phase.state(), phase.control()
        T = c * (theta - half) if closed else 0
        phase.set_der(theta, w1 - w2)
        phase.set_der(w1, (u - T) / J1)
        phase.set_der(w2, (T - Mc) / J2)
        phase.subject_to(0 <= (u <= Ms))  # noqa: SIM300
        phase.set_initial(u, Ms / 2)
        phase.method(rockit.MultipleShooting(N=intervals, M=4, intg="rk"))
        return phase, (theta, w1, w2), u, T

    gap, at_first, u_first, _ = stage(0, brief, open_intervals, closed=False)
    for state in at_first:
        gap.subject_to(gap.at_t0(state) == 0)
    gap.subject_to(gap.at_tf(at_first[0]) == half)
    gap.subject_to(at_first[0] <= half)

    contact, states, u, T = stage(rockit.FreeTime(brief), rest, contact_intervals, closed=True)
    ocp.subject_to(contact.t0 == gap.tf)
    for before, after in zip(at_first, states, strict=True):
        ocp.subject_to(gap.at_tf(before) == contact.at_t0(after))
    contact.subject_to(T >= 0)
    contact.subject_to(T <= K_dyn * task.base)  # noqa: SIM300
    for speed in states[1:]:
        contact.subject_to(contact.at_tf(speed) == task.target)
        contact.set_initial(speed, task.target * (contact.t - contact.t0) / rest)
    contact.set_initial(states[0], half + 0.5 * task.base / c)
    ocp.subject_to(contact.tf <= task.start_time)

    found = ocp.solve()
    t_gap, u_gap = found(gap).sample(u_first, grid="control")
    t_contact, u_contact = found(contact).sample(u, grid="control")
    edges = np.concatenate([t_gap[:-1], t_contact])
    return steps(found.value(K_dyn), edges, np.concatenate([u_gap[:-1], u_contact[:-1]]))
