"""Optimal starts by direct collocation: from several first guesses to the best solution, then finer.

IPOPT solves the transcribed program, cold or from a full primal-dual solution; a solution is read in SI units
and replayed on the exact plant, and the mesh is refined until the two agree.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from softstart.arrays import Vector
from softstart.errors import InputError
from softstart.optimal.collocation.guess import (
    Trajectory,
    first_mesh,
    first_trajectory,
    from_solution,
    intervals,
    likely_contact,
    refined,
)
from softstart.optimal.collocation.program import BEYOND, Numbers, Program, numbers, programs
from softstart.optimal.collocation.transcription import (
    Mesh,
    Slot,
    Transcribed,
    parameter_vector,
    tail_rows,
    transcribe,
)
from softstart.optimal.exact import beyond_curve, replay
from softstart.optimal.problem import Problem
from softstart.optimal.result import Candidate, NotConverged, demanded, heat_of
from softstart.profile import TorqueProfile

QUIET = {"ipopt.print_level": 0, "ipopt.sb": "yes", "print_time": False, "error_on_fail": False}
ACCURACY = {
    "ipopt.tol": 1e-8,
    "ipopt.constr_viol_tol": 1e-9,
    "ipopt.acceptable_tol": 1e-7,
    "ipopt.acceptable_constr_viol_tol": 1e-9,
    "ipopt.acceptable_iter": 8,
    "ipopt.bound_relax_factor": 0.0,
    "ipopt.max_iter": 200,
    "ipopt.max_resto_iter": 30,
    "ipopt.mu_strategy": "monotone",
}
# s of computing time a variable: 200 iterations take half of it, only a search that is lost in restoration
# takes more.
PATIENCE = 2e-3
NEAR = {  # from a solution on a coarser mesh
    "ipopt.mu_strategy": "monotone",
    "ipopt.bound_push": 1e-4,
    "ipopt.bound_frac": 1e-4,
}
WARM = {
    "ipopt.warm_start_init_point": "yes",
    "ipopt.mu_strategy": "monotone",
    "ipopt.warm_start_bound_push": 1e-9,
    "ipopt.warm_start_bound_frac": 1e-9,
    "ipopt.warm_start_slack_bound_push": 1e-9,
    "ipopt.warm_start_slack_bound_frac": 1e-9,
    "ipopt.warm_start_mult_bound_push": 1e-9,
}
INTERRUPTED = ("User_Requested_Stop", "NonIpopt_Exception_Thrown")  # how CasADi tells of a Ctrl-C


@dataclass(frozen=True, eq=False)
class Solution:
    """Where IPOPT ended, with the multipliers of bounds and conditions."""

    transcribed: Transcribed
    p: Numbers
    parameters: Vector
    x: Vector
    lam_x: Vector
    lam_g: Vector
    value: float  # objective
    reason: str  # IPOPT's own status
    violation: float
    iterations: int

    @property
    def found(self) -> bool:
        return self.reason in ("Solve_Succeeded", "Solved_To_Acceptable_Level")

    def read(self) -> tuple[Vector, float, float, Vector, Vector]:
        """Durations, peak, heat, states (4 n, states), demands (n, 2), in the units of program.py."""
        durations, peak, heat, states, demands = self.transcribed.readout(self.x, self.parameters)
        return (
            np.array(durations).ravel(),
            float(peak),
            float(heat),
            np.array(states).T,
            np.array(demands).T,
        )


@lru_cache(maxsize=32)
def _solver(transcribed: Transcribed, mu: float, full: bool, adaptive: bool) -> Any:
    """The solver of a program; `mu` above 0: begun near, at barrier parameter; `full`: with multipliers."""
    options: dict[str, Any] = {**QUIET, **ACCURACY}
    options["ipopt.max_cpu_time"] = PATIENCE * max(1000, len(transcribed.slots))
    if adaptive:
        options["ipopt.mu_strategy"] = "adaptive"
    if mu > 0.0:
        options |= {**(WARM if full else NEAR), "ipopt.mu_init": mu}
    return ca.nlpsol("start", "ipopt", transcribed.nlp, options)


def run(
    transcribed: Transcribed,
    p: Numbers,
    parameters: Vector,
    x: Vector,
    multipliers: tuple[Vector, Vector] | None = None,
    mu: float = 0.0,
    adaptive: bool = False,
) -> Solution:
    """Solve from x, at barrier parameter `mu` where x is near (0: cold); with `multipliers`, a warm start.

    `adaptive` changes the barrier parameter in another manner, mostly slower, that may succeed where
    the usual one fails.
    """
    lbx, ubx, lbg, ubg = transcribed.limits(parameters)
    given: dict[str, Any] = {"x0": x, "p": parameters, "lbx": lbx, "ubx": ubx, "lbg": lbg, "ubg": ubg}
    if multipliers is not None:
        given |= {"lam_x0": multipliers[0], "lam_g0": multipliers[1]}
    solver = _solver(transcribed, mu, multipliers is not None, adaptive)
    try:
        out = solver(**given)
    except RuntimeError as error:
        if "KeyboardInterrupt" in str(error):
            raise KeyboardInterrupt from error
        raise
    stats = solver.stats()
    if stats["return_status"] in INTERRUPTED:
        raise KeyboardInterrupt
    g, low, high = (np.array(a).ravel() for a in (out["g"], lbg, ubg))
    violation = float(np.max(np.maximum(low - g, g - high), initial=0.0))
    return Solution(
        transcribed,
        p,
        parameters,
        np.array(out["x"]).ravel(),
        np.array(out["lam_x"]).ravel(),
        np.array(out["lam_g"]).ravel(),
        float(out["f"]),
        str(stats["return_status"]),
        violation,
        int(stats["iter_count"]),
    )


CHECKS = 12  # per interval, at the re-simulated shaft torque


@dataclass(frozen=True)
class Claim:
    """A solution in SI units: profile up to t_f, edges of its intervals in s, its figure."""

    profile: TorqueProfile
    end_time: float
    edges: Vector  # of the intervals up to t_f, s
    levels: Vector  # demand before and after in each, N m
    peak: float  # N m
    value: float  # of what is minimised


@dataclass(frozen=True)
class Replayed:
    """The same on the exact plant."""

    value: float
    shortfall: float  # of the load speed at t_f, relative to the target
    landing: float  # largest error of the terminal conditions, relative to target and Ms
    parted: NDArray[np.bool_]  # intervals in which the flanks part before t_f
    overshoot: Vector  # largest T in each interval over the claimed peak, relative
    excess: float  # of the motor torque over the torque-speed curve up to t_f, N m; 0 or more
    outside: float  # of K_dyn or heat over its bound where it is not minimised, relative


def claim(problem: Problem, solution: Solution) -> Claim:
    """Read a solution."""
    program, units = solution.transcribed.program, solution.p.units
    durations, peak, heat, _, demands = solution.read()
    arcs = program.start_arcs
    mesh = solution.transcribed.mesh[:arcs]
    widths = np.concatenate([T * np.diff(edges) for T, edges in zip(durations, mesh, strict=False)])
    edges = np.concatenate([[0.0], np.cumsum(widths)]) * units.time
    levels = demands[: widths.size] * units.torque
    levels = np.clip(levels, problem.lowest_torque, problem.highest_torque)
    end = float(edges[-1])
    value = {
        "k_dyn": peak * units.torque / problem.base_torque,
        "heat": heat * units.time,
        "start_time": end,
    }[problem.minimise]
    return Claim(demanded(program.demand, edges, levels), end, edges, levels, peak * units.torque, value)


def replayed(problem: Problem, own: Claim) -> Replayed:
    """Run the claim on the exact plant, to the first peak after t_f where the motor coasts."""
    drive: Any = problem.drive
    profile, until = own.profile, own.end_time
    if problem.terminal == "reached":
        profile = profile.followed_by(own.end_time, TorqueProfile([0.0], [problem.lowest_torque]))
        until += math.pi / drive.Omega + 5.0 * drive.torque_lag
    run = replay(drive, profile, until, problem.base)
    excess = max(beyond_curve(problem, run)[0], 0.0)
    width = np.diff(own.edges)
    checks = (np.arange(CHECKS) + 0.5) / CHECKS
    times = own.edges[:-1, None] + width[:, None] * checks
    T = np.abs(run.at(times.clip(0.0, run.end_time))["T"])
    overshoot = T.max(axis=1) / max(own.peak, 1e-300) - 1.0
    at_end = run.at([own.end_time])
    end = {name: float(at_end[name][0]) for name in ("w2", "v", "T")}
    shortfall = 1.0 - end["w2"] / problem.target
    errors = [shortfall]
    if problem.terminal != "reached":
        errors.append(end["v"] / problem.target)
    if problem.terminal == "steady":
        errors.append((end["T"] - drive.Mc) / drive.Ms)
    openings = [e.time for e in run.events if e.kind == "gap opened" and e.time < own.end_time]
    parted = np.histogram(openings, own.edges)[0] > 0
    heat = heat_of(run, own.end_time)
    value = {"k_dyn": run.k_dyn, "heat": heat, "start_time": own.end_time}[problem.minimise]
    bounded = ((run.k_dyn, problem.k_dyn), (heat, problem.heat))
    outside = max((found / most - 1.0 for found, most in bounded if most is not None), default=0.0)
    return Replayed(float(value), shortfall, max(map(abs, errors)), parted, overshoot, excess, outside)


OTHERWISE = (1.6, 0.7)  # contact instants tried where the likely one fails, in units of that
WIDE_BARRIER = 1e-2
WARM_BARRIER = 1e-5
NEAR_BARRIER = 1e-4
WORSE = 1e-3  # relative: so much a finer mesh may cost
CLEARLY = 1.02  # of the start time: a quickest start on the first mesh is known to about 1 %
SIMILAR = 0.02  # relative: within this the mesh of a warm start may stay as it is
BELOW_CURVE = 5e-7  # of the largest torque: how well the exact plant must keep the torque-speed curve
AIMS = 4  # tries to end inside all bounds
KEPT = 1e-6  # relative: how well the exact plant must keep bounds on what is not minimised
LANDING = 1e-6  # of target speed and Ms: how well the exact plant must meet the terminal conditions
CONTRADICTED = 2e-3  # relative: what the exact plant contradicts by more is no solution
STRIDE = 0.35  # rad of the elastic oscillation an interval may span where the landing is to be exact
JUMP = 0.02  # of the torque range: a larger one within an arc is a switch that has not been located


@dataclass(frozen=True, eq=False)
class Warm:
    """A full primal-dual solution: program, mesh, variables, multipliers; and what it cost."""

    program: Program
    mesh: Mesh
    x: Vector
    lam_x: Vector
    lam_g: Vector
    barrier: float
    iterations: int
    refined_value: float  # of what is minimised, when the mesh was last made finer


def solve(
    problem: Problem,
    *,
    warm: Any = None,
    contact_guess: float | None = None,
    tolerance: float = 1e-4,
    max_refinements: int = 5,
    until: float | None = None,
) -> Candidate:
    """The optimal start by direct collocation.

    Parameters
    ----------
    problem : any `Problem`; damping, reactive loads, torque lag and rate, torque-speed limits, smoothness.
    warm : `Candidate.warm` of a similar problem (other start time, gap, inertia): the search begins from its
        full primal-dual solution, on its mesh. Left aside where the phases of the two problems differ.
    contact_guess : instant in s of the first contact from which the search begins.
    tolerance : relative; the mesh is refined until the re-simulated figure moves by less than this and agrees
        with the claimed one to this.
    max_refinements : at most so many meshes after the first.
    until : instant of time.perf_counter after which no other guess and no finer mesh is begun.

    Raises InputError for a problem of no class known here, and NotConverged where IPOPT finds no solution or
    the mesh does not get fine enough: `NotConverged.violation` is the largest violated constraint.

    >>> from softstart import Drive
    >>> drive = Drive.load("crane-4amtkf").replace(target_speed=60)
    >>> round(solve(Problem(drive, start_time=0.2883042)).claimed, 3)
    0.909
    """
    solution = None
    spent = 0
    if isinstance(warm, Warm) and warm.program in programs(problem):
        solution = _from(problem, warm)
        spent = solution.iterations
        if not solution.found:
            solution = None
    if solution is not None:
        return _refine(problem, solution, spent, tolerance, max_refinements, warm.refined_value, until)
    failure: NotConverged | None = None
    for contact in _contacts(problem, contact_guess):
        try:
            solution, cost = _first(problem, contact)
            return _refine(problem, solution, spent + cost, tolerance, max_refinements, until=until)
        except NotConverged as stopped:
            failure = failure or stopped
            if stopped.final or _late(until):
                break
    assert failure is not None
    raise failure


def _from(problem: Problem, warm: Warm) -> Solution:
    transcribed = transcribe(warm.program, warm.mesh)
    p = numbers(problem)
    return run(transcribed, p, _parameters(warm.program, p), warm.x, (warm.lam_x, warm.lam_g), warm.barrier)


def _parameters(program: Program, p: Numbers) -> Vector:
    return parameter_vector(p, tail_rows(program, p))


@dataclass(frozen=True, eq=False)
class CasadiProblem:
    """The problem as one nonlinear program of CasADi, f least over x with lbx <= x <= ubx, lbg <= g <= ubg.

    `nlp` has the symbols x (n,), p, f and g (m,) for `casadi.nlpsol`; `x0` and `p` are the first guess and
    the numbers of the drive. Times are in units of the start time, torques of Ms, speeds of the target
    speed, and states besides of their size in the gap or in contact: x and g are of the order of 1. Ordered
    along the start: peak of T, then for each arc its duration, demands, and the states of each interval (its
    beginning and three Gauss points). dg/dx is banded with intervals, but for full columns of the peak and
    of the durations; the Hessian alike. `slots[i]` says what x[i] stands for.

    Made by `Problem.casadi`. The mesh is the first one, which the collocation method refines.
    """

    problem: Problem
    nlp: dict[str, Any]
    x0: Vector
    p: Vector
    lbx: Vector
    ubx: Vector
    lbg: Vector
    ubg: Vector
    slots: tuple[Slot, ...]
    _read: Callable[[Vector], tuple[TorqueProfile, float]]  # demand and peak torque, N m

    def _of(self, x: Any) -> tuple[TorqueProfile, float]:
        at = np.array(x, dtype=float).ravel()
        if at.shape != self.x0.shape:
            raise InputError(f"x: {at.size} numbers; give the {self.x0.size} of nlpsol's out['x'].")
        return self._read(at)

    def profile(self, x: Any) -> TorqueProfile:
        """The torque demand of a solution x (n,): N m over s, up to t_f."""
        return self._of(x)[0]

    def k_dyn(self, x: Any) -> float:
        """K_dyn of a solution x (n,) by its own collocation; `replay` of the profile is exact."""
        return self._of(x)[1] / self.problem.base_torque


def as_casadi(problem: Problem) -> CasadiProblem:
    """The likeliest order of phases on the first mesh; see `Problem.casadi`."""
    program, p = programs(problem)[0], numbers(problem)
    trajectory = _trajectory(program, p, likely_contact(problem, p))
    transcribed = transcribe(program, first_mesh(program, p, trajectory))
    parameters = _parameters(program, p)
    lbx, ubx, lbg, ubg = (np.array(one).ravel() for one in transcribed.limits(parameters))
    x0 = trajectory.values(program, p, transcribed.slots)
    none = np.zeros(0)

    def read(x: Vector) -> tuple[TorqueProfile, float]:
        end = Solution(transcribed, p, parameters, x, none, none, np.nan, "", np.nan, 0)
        own = claim(problem, end)
        return own.profile, own.peak

    return CasadiProblem(
        problem, transcribed.nlp, x0, parameters, lbx, ubx, lbg, ubg, transcribed.slots, read
    )


# ---- first solutions -------------------------------------------------------------------------------------


def _first(problem: Problem, contact: float) -> tuple[Solution, int]:
    """A first solution from an instant of contact, and the iterations it took.

    Where IPOPT finds none, it is asked for the quickest start on the same mesh, which always exists: that is
    the better first guess, or shows that there is no start to find.
    """
    p = numbers(problem)
    tried: list[Solution] = []
    quickest = np.inf
    for program in programs(problem):
        trajectory = _trajectory(program, p, contact)
        mesh = first_mesh(program, p, trajectory)
        tried.append(_on(program, p, mesh, trajectory))
        if tried[-1].found or program.minimise == "start_time":
            continue
        for adaptive in (False, True):
            quick = _quickest(program, p, mesh, trajectory, adaptive)
            if quick.found:
                break
        end = float(quick.read()[0][: program.start_arcs].sum()) if quick.found else np.inf
        quickest = min(quickest, end)
        if end <= 1.0:
            parameters = _parameters(program, p)
            tried.append(run(transcribe(program, mesh), p, parameters, quick.x, None, WIDE_BARRIER))
    found = [s for s in tried if s.found]
    if found:
        return min(found, key=lambda s: s.value), sum(s.iterations for s in tried)
    if 1.0 < quickest < np.inf:
        reason = f"IPOPT finds no start quicker than {quickest * p.units.time:.6g} s"
        raise NotConverged(reason, quickest - 1.0, final=quickest > CLEARLY)
    nearest = min(tried, key=lambda s: s.violation)
    # a mesh and guess that failed once mostly fail again, after a long search
    raise NotConverged(_reason_of(nearest.reason), nearest.violation, final=problem.start_time is not None)


def _contacts(problem: Problem, contact_guess: float | None) -> list[float]:
    """Instants of contact from which to begin, in units of the problem."""
    p = numbers(problem)
    likely = likely_contact(problem, p)
    if contact_guess is not None:
        return [contact_guess / p.units.time, likely]
    return [f * likely for f in (1.0, *OTHERWISE)] if likely > 0.0 else [0.0]


def _quickest(program: Program, p: Numbers, mesh: Mesh, trajectory: Trajectory, adaptive: bool) -> Solution:
    """The quickest start within all other bounds, with the same variables."""
    free = replace(p, values={**p.values, "latest": 100.0})
    return _on(replace(program, minimise="start_time", smooth=False), free, mesh, trajectory, 0.0, adaptive)


def _trajectory(program: Program, p: Numbers, contact: float) -> Trajectory:
    end = 1.0 if program.minimise != "start_time" else 1.3
    return first_trajectory(program, p, min(contact, 0.6 * end), end)


def _on(
    program: Program, p: Numbers, mesh: Mesh, trajectory: Trajectory, mu: float = 0.0, adaptive: bool = False
) -> Solution:
    transcribed = transcribe(program, mesh)
    x = trajectory.values(program, p, transcribed.slots)
    return run(transcribed, p, _parameters(program, p), x, None, mu, adaptive)


def _reason_of(reason: str) -> str:
    return {
        "Infeasible_Problem_Detected": "IPOPT finds no start that meets all conditions",
        "Maximum_Iterations_Exceeded": "IPOPT came to its largest number of iterations",
        "Maximum_CpuTime_Exceeded": "IPOPT came to its limit of computing time",
        "Restoration_Failed": "IPOPT cannot reduce the violation of the conditions any further",
    }.get(reason, f"IPOPT stopped with {reason}")


# ---- finer meshes ----------------------------------------------------------------------------------------


def _late(until: float | None) -> bool:
    return until is not None and time.perf_counter() > until


def _refine(
    problem: Problem,
    solution: Solution,
    spent: int,
    tolerance: float,
    most: int,
    known: float | None = None,
    until: float | None = None,
) -> Candidate:
    """Halve intervals until the claimed figure stands still and the exact plant agrees with it.

    `known` is the figure of the similar problem for which the mesh was last made finer: near it, the mesh is
    fine enough.
    """
    refinements = 0
    before = (np.inf, np.inf)
    settled = False
    best: tuple[float, Solution, Claim, Replayed] | None = None
    while True:
        own = claim(problem, solution)
        exact = replayed(problem, own)
        above = BELOW_CURVE * problem.highest_torque
        if (exact.shortfall > 0.0 and exact.landing <= LANDING) or exact.excess > above:
            solution, cost = _aimed_inside(problem, solution, exact)
            spent += cost
            own = claim(problem, solution)
            exact = replayed(problem, own)
        agrees = abs(exact.value - own.value) <= tolerance * abs(own.value)
        still = min(abs(exact.value - before[0]), abs(own.value - before[1])) <= tolerance * abs(own.value)
        lands = exact.landing <= LANDING and not exact.parted.any() and exact.excess <= above
        if known is not None and refinements == 0:
            still = abs(own.value - known) <= SIMILAR * abs(known)
        settled = agrees and still and lands
        # a finer mesh may end a little worse: what counts is the exact plant
        merit = exact.value * (1.0 if lands else 1.1)
        if best is None or merit < best[0]:
            best = (merit, solution, own, exact)
        if settled or refinements >= most or _late(until):
            break
        before = (exact.value, own.value)
        finer, cost = _finer(problem, solution, own, exact, tolerance)
        spent += cost
        refinements += 1
        if finer is None:
            break
        solution = finer
    _, solution, own, exact = best
    for _ in range(AIMS):  # bounds on what is not minimised, once the mesh is fine
        if exact.outside <= KEPT:
            break
        inside, cost = _aimed_inside(problem, solution, exact)
        spent += cost
        if (nearer := replayed(problem, claim(problem, inside))).outside >= exact.outside:
            break
        solution, own, exact = inside, claim(problem, inside), nearer
    off = max(abs(exact.value - own.value) / max(abs(own.value), 1e-300), exact.landing)
    if off > CONTRADICTED:
        raise NotConverged(f"the exact plant is off by {off:.2g} after {refinements} refinements", off)
    mesh = solution.transcribed.mesh
    how = "cold" if known is None else "warm"
    note = f"{refinements} refinements to {intervals(mesh)} intervals, {spent} iterations of IPOPT ({how})"
    if not settled:
        note += "; the mesh has not settled"
    last = known if known is not None and refinements == 0 else own.value
    warm = Warm(
        solution.transcribed.program,
        mesh,
        solution.x,
        solution.lam_x,
        solution.lam_g,
        WARM_BARRIER,
        spent,
        last,
    )
    return Candidate(own.profile, own.end_time, own.value, "collocation", note, warm)


def _aimed_inside(problem: Problem, solution: Solution, exact: Replayed) -> tuple[Solution, int]:
    """The exact start misses the target speed, the curve or a bound by the error of the collocation: aim that
    much beyond the target, below the curve and below the bound.
    """
    program, mesh = solution.transcribed.program, solution.transcribed.mesh
    beyond = solution.p.target - 1.0
    if exact.shortfall > 0.0:
        beyond = beyond + 2.0 * exact.shortfall + BEYOND
    below = solution.p.below * solution.p.units.torque + 1.5 * exact.excess
    p = numbers(problem, beyond, below, solution.p.inside + 1.5 * max(exact.outside, 0.0))
    multipliers = (solution.lam_x, solution.lam_g)
    better = run(transcribe(program, mesh), p, _parameters(program, p), solution.x, multipliers, 1e-8)
    return (better if better.found else solution), better.iterations


def _finer(
    problem: Problem, solution: Solution, own: Claim, exact: Replayed, tolerance: float
) -> tuple[Solution | None, int]:
    """The same problem on a mesh that is finer where it matters, and the iterations it took."""
    program, old = solution.transcribed.program, solution.transcribed.mesh
    mesh = refined(old, _flags(problem, solution, own, exact, tolerance))
    p = solution.p
    trajectory = from_solution(old, solution.read(), np.array([p.z_start, p.v_start, p.w2_start, 0.0]))
    tried = []
    for barrier in (NEAR_BARRIER, 0.0):  # from a finer mesh the search may fail: then from a wider barrier
        tried.append(_on(program, p, mesh, trajectory, barrier))
        if tried[-1].found and tried[-1].value <= solution.value + WORSE * abs(solution.value):
            break
    found = [s for s in tried if s.found]
    best = min(found, key=lambda s: s.value, default=None)
    if best is not None and best.value > 1.02 * solution.value:
        best = None
    return best, sum(s.iterations for s in tried)


def _flags(problem: Problem, solution: Solution, own: Claim, exact: Replayed, tolerance: float) -> list[bool]:
    """Intervals beside a jump of torque within an arc, and those where T passes its peak."""
    mesh = solution.transcribed.mesh
    n = intervals(mesh)
    flags = np.zeros(n, dtype=bool)
    own_n = own.levels.shape[0]
    flags[:own_n] = (exact.overshoot > 0.25 * tolerance) | exact.parted
    if exact.landing > LANDING:
        units = solution.p.units.time
        fine = STRIDE / solution.p.Omega
        if solution.transcribed.program.lagged:
            fine = min(fine, 0.5 * solution.p.lag)
        flags[:own_n] |= np.diff(own.edges) / units > fine
    jumps = np.abs(own.levels[1:, 0] - own.levels[:-1, 1])
    if solution.transcribed.program.demand != "steps":
        bends = np.abs(np.diff(np.diff(own.levels, axis=1).ravel()))
        jumps = np.maximum(jumps, 0.2 * bends)  # a bend is met to second order anyway
    large = jumps > JUMP * (problem.highest_torque - problem.lowest_torque)
    at = 0
    for edges in mesh[: solution.transcribed.program.start_arcs]:
        inside = slice(at, at + len(edges) - 2)
        flags[at : at + len(edges) - 2] |= large[inside]
        flags[at + 1 : at + len(edges) - 1] |= large[inside]
        at += len(edges) - 1
    if not flags.any():
        flags[:] = True
    return flags.tolist()
