"""The contenders, each a function from the task to an answer; dymos, which takes more, has its own file.

closed_form, descent, collocation: softstart. rockit: a stage with the gap open, a stage in contact, both of
free duration, direct multiple shooting, CasADi and IPOPT; the torque is constant in each of its intervals and
bounds hold at the grid points. rockit_one_phase: the contact as a kink in the right-hand side, max(0, .), or
that kink rounded off; the shortest way to write the problem down, and a trap: what comes out depends on the
guess. gekko: both phases on one axis of unit lengths, each stretched by its own free duration, IPOPT.

In GEKKO a state fixed at a point (`fix_final`, Connection) has its rate set to zero there as well, which is
another problem, so the ends are inequalities with a parameter that is 1 at one point. Inputs and parameters
hold from their point to the next (seen from its own states: not what the manual says of results). An equality
for the contact at the phase boundary makes the problem unsolvable; the bounds of the two phases stand for it.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np

from softstart_studies.benchmarks.optima.task import Answer, Task, crane, steps

if TYPE_CHECKING:
    from softstart.profile import TorqueProfile

IPOPT = {"expand": True, "print_time": False, "ipopt.print_level": 0, "ipopt.sb": "yes"}


def closed_form(task: Task) -> Answer:
    """Pulse, coast, hold."""
    from softstart.optimal.problem import Problem
    from softstart.optimal.pulse_coast_hold import solve

    profile, end, claimed = solve(Problem(crane(), task.start_time))
    return _answer(claimed, profile, end)


def descent(task: Task) -> Answer:
    """The descent of `optimize`."""
    from softstart.optimal.optimize import searched
    from softstart.optimal.problem import Problem

    problem = Problem(crane(), task.start_time)
    found = searched(problem)
    if found is None:
        raise RuntimeError("no start was found.")
    _, best, profile = found
    return _answer(best.peak / problem.base_torque, profile, best.end)


def collocation(task: Task) -> Answer:
    """The CasADi statement, with the order of contacts of pulse, coast, hold: one."""
    from softstart import simulate
    from softstart.optimal.problem import Problem
    from softstart.optimal.statement import solve

    drive = crane()
    run = simulate(drive, "pulse-coast-hold", task.start_time + float(drive.elastic_period))
    claim = solve(Problem(drive, task.start_time), run, straight=True)
    return _answer(claim.value, claim.profile, claim.end_time)


def _answer(claimed: float, profile: TorqueProfile, end: float) -> Answer:
    return Answer(claimed, tuple(profile.time.tolist()), tuple(profile.torque.tolist()), end)


def rockit(task: Task, open_intervals: int = 25, contact_intervals: int = 75) -> Answer:
    """Least peak torque with two stages."""
    rk = import_module("rockit")
    J1, J2, c, half, Mc, Ms = task.J1, task.J2, task.c, 0.5 * task.gap, task.Mc, task.Ms
    brief, rest = 0.1 * task.start_time, 0.9 * task.start_time  # guessed durations

    ocp = rk.Ocp()
    K_dyn = ocp.variable()
    ocp.set_initial(K_dyn, 1.0)
    ocp.add_objective(K_dyn)
    ocp.solver("ipopt", IPOPT)

    def stage(begin: Any, duration: float, intervals: int, closed: bool) -> tuple[Any, ...]:
        phase = ocp.stage(t0=begin, T=rk.FreeTime(duration))
        theta, w1, w2, u = phase.state(), phase.state(), phase.state(), phase.control()
        T = c * (theta - half) if closed else 0
        phase.set_der(theta, w1 - w2)
        phase.set_der(w1, (u - T) / J1)
        phase.set_der(w2, (T - Mc) / J2)
        phase.subject_to(0 <= (u <= Ms))  # noqa: SIM300
        phase.set_initial(u, Ms / 2)
        phase.method(rk.MultipleShooting(N=intervals, M=4, intg="rk"))
        return phase, (theta, w1, w2), u, T

    gap, at_first, u_first, _ = stage(0, brief, open_intervals, closed=False)
    for state in at_first:
        gap.subject_to(gap.at_t0(state) == 0)
    gap.subject_to(gap.at_tf(at_first[0]) == half)
    gap.subject_to(at_first[0] <= half)

    contact, states, u, T = stage(rk.FreeTime(brief), rest, contact_intervals, closed=True)
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


def rockit_one_phase(task: Task, rounding: float = 0.0, guess: float = 0.5, intervals: int = 100) -> Answer:
    """Least peak torque; `rounding` of the kink in rad, `guess` of the torque as a share of Ms."""
    rk, casadi = import_module("rockit"), import_module("casadi")
    ocp = rk.Ocp(T=task.start_time)
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
    ocp.method(rk.MultipleShooting(N=intervals, M=1, intg="rk"))
    found = ocp.solve()
    edges, levels = found.sample(u, grid="control")
    return steps(found.value(K_dyn), edges, levels[:-1])


def gekko(task: Task, open_intervals: int = 30, contact_intervals: int = 120, nodes: int = 3) -> Answer:
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
