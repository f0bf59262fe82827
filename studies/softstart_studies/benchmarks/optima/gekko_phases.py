"""The peer GEKKO: both phases on one axis of unit lengths, each stretched by its own free duration; IPOPT.

A state fixed at a point (`fix_final`, Connection) has its rate set to zero there as well, which is another
problem, so the ends are inequalities with a parameter that is 1 at one point. Inputs and parameters hold from
their point to the next (seen from its own states: not what the manual says of results). An equality for the
contact at the phase boundary makes the problem unsolvable; the bounds of the two phases stand for it.
"""

from __future__ import annotations

from importlib import import_module

import numpy as np

from softstart_studies.benchmarks.optima.task import Answer, Task, steps


def solve(task: Task, open_intervals: int = 30, contact_intervals: int = 120, nodes: int = 3) -> Answer:
    """Least peak torque with two time-scaled phases; states scaled by half the gap and the target speed."""
    half, target, n = 0.5 * task.gap, task.target, open_intervals + contact_intervals
    m = import_module("gekko").GEKKO(remote=False)
    m.time = np.concatenate(
        [np.linspace(0, 1, open_intervals + 1)[:-1], np.linspace(1, 2, contact_intervals + 1)]
    )
    point = np.arange(n + 1)  # a value holds in the interval that begins at its point
    opened = m.Param((point < open_intervals).astype(float))
    closed = m.Param((point >= open_intervals).astype(float))
    last = m.Param((point == n).astype(float))
    first_share = m.FV(0.1, lb=1e-3, ub=1)
    second_share = m.FV(0.9, lb=0.1, ub=1)
    K_dyn = m.FV(1.0, lb=0, ub=10)
    u = m.MV(0.5, lb=0, ub=1)
    for free in (first_share, second_share, K_dyn, u):
        free.STATUS = 1
    m.free_initial(u)
    z = m.Var(np.interp(m.time, [0, 1, 1.2, 2], [0, 1, 1.5, 1.5]))
    a, b = (m.Var(np.interp(m.time, [0, 1, 2], [0, 0.1, 1])) for _ in range(2))
    stretch = m.Intermediate(task.start_time * (opened * first_share + closed * second_share))
    T = m.Intermediate(closed * (task.c * half) * (z - 1))
    m.Equation(z.dt() == stretch * (target / half) * (a - b))
    m.Equation(a.dt() == stretch / (task.J1 * target) * (u * task.Ms - T))
    m.Equation(b.dt() == stretch / (task.J2 * target) * (T - task.Mc))
    m.Equation(opened * (z - 1) <= 0)
    m.Equation(closed * (z - 1) >= 0)
    m.Equation(T / task.base <= K_dyn)
    m.Equation(first_share + second_share <= 1)
    for speed in (a, b):
        m.Equation(last * (speed - 1) >= 0)
        m.Equation(last * (speed - 1) <= 0)
    m.Minimize(K_dyn)
    m.options.IMODE, m.options.NODES, m.options.SOLVER, m.options.MAX_ITER = 6, nodes, 3, 1000
    m.solve(disp=False)
    durations = task.start_time * np.array([first_share.value[0], second_share.value[0]])
    edges = np.interp(m.time, [0, 1, 2], [0, durations[0], durations.sum()])
    return steps(K_dyn.value[0], edges, task.Ms * np.array(list(u.value))[:-1])
