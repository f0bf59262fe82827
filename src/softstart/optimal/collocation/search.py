"""`solve`: from several first guesses to the best solution, then finer until the exact plant agrees."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from softstart.optimal.collocation.failure import NotConverged
from softstart.optimal.collocation.guess import (
    Course,
    from_solution,
    likely_contact,
    make_course,
)
from softstart.optimal.collocation.interval import parameter_vector
from softstart.optimal.collocation.ipopt import Solution, Vector, run
from softstart.optimal.collocation.mesh import first_mesh, intervals, refined
from softstart.optimal.collocation.phases import Program, programs
from softstart.optimal.collocation.reading import Claim, Replayed, claim, replayed
from softstart.optimal.collocation.scaling import BEYOND, Numbers, numbers
from softstart.optimal.collocation.tail import tail_rows
from softstart.optimal.collocation.transcription import Mesh, transcribe
from softstart.optimal.problem import Problem
from softstart.optimal.result import Candidate

OTHERWISE = (1.6, 0.7)  # contact instants tried where the likely one fails, in units of that
WIDE_BARRIER = 1e-2
WARM_BARRIER = 1e-5
NEAR_BARRIER = 1e-4
WORSE = 1e-3  # relative: so much a finer mesh may cost
CLEARLY = 1.02  # of the start time: a quickest start on the first mesh is known to about 1 %
SIMILAR = 0.02  # relative: within this the mesh of a warm start may stay as it is
LANDING = 1e-6  # of target speed and Ms: how well the exact plant must meet the terminal conditions
ASTRAY = 2e-3  # relative: what the exact plant contradicts by more is no solution
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
    problem: Problem, warm: Any, contact_guess: float | None, tolerance: float, max_refinements: int
) -> Candidate:
    """See the package."""
    solution = None
    spent = 0
    if isinstance(warm, Warm) and warm.program in programs(problem):
        solution = _from(problem, warm)
        spent = solution.iterations
        if not solution.found:
            solution = None
    if solution is not None:
        return _refine(problem, solution, spent, tolerance, max_refinements, warm.refined_value)
    failure: NotConverged | None = None
    for contact in _contacts(problem, contact_guess):
        try:
            solution, cost = _first(problem, contact)
            return _refine(problem, solution, spent + cost, tolerance, max_refinements)
        except NotConverged as astray:
            failure = failure or astray
            if astray.final:
                break
    assert failure is not None
    raise failure


def _from(problem: Problem, warm: Warm) -> Solution:
    transcribed = transcribe(warm.program, warm.mesh)
    p = numbers(problem)
    return run(transcribed, p, _parameters(warm.program, p), warm.x, (warm.lam_x, warm.lam_g), warm.barrier)


def _parameters(program: Program, p: Numbers) -> Vector:
    return parameter_vector(p, tail_rows(program, p))


# ---- first solutions -------------------------------------------------------------------------------------


def _first(problem: Problem, contact: float) -> tuple[Solution, int]:
    """A first solution from an instant of contact, and the iterations it took.

    Where IPOPT finds none, it is asked for the quickest start on the same mesh, which always exists: that is
    the better first guess, or says that there is nothing to find.
    """
    p = numbers(problem)
    tried: list[Solution] = []
    quickest = np.inf
    for program in programs(problem):
        course = _course(program, p, contact)
        mesh = first_mesh(program, p, course)
        tried.append(_on(program, p, mesh, course))
        if tried[-1].found or program.minimise == "start_time":
            continue
        for adaptive in (False, True):
            quick = _quickest(program, p, mesh, course, adaptive)
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
        told = f"IPOPT finds no start quicker than {quickest * p.units.time:.6g} s"
        raise NotConverged(told, quickest - 1.0, final=quickest > CLEARLY)
    nearest = min(tried, key=lambda s: s.violation)
    # a mesh and guess that led astray once mostly do so again, at length
    raise NotConverged(_told(nearest.reason), nearest.violation, final=problem.start_time is not None)


def _contacts(problem: Problem, contact_guess: float | None) -> list[float]:
    """Instants of contact from which to begin, in units of the problem."""
    p = numbers(problem)
    likely = likely_contact(problem, p)
    if contact_guess is not None:
        return [contact_guess / p.units.time, likely]
    return [f * likely for f in (1.0, *OTHERWISE)] if likely > 0.0 else [0.0]


def _quickest(program: Program, p: Numbers, mesh: Mesh, course: Course, adaptive: bool) -> Solution:
    """The quickest start within all other bounds, with the same variables."""
    free = replace(p, values={**p.values, "latest": 100.0})
    return _on(replace(program, minimise="start_time", smooth=False), free, mesh, course, 0.0, adaptive)


def _course(program: Program, p: Numbers, contact: float) -> Course:
    end = 1.0 if program.minimise != "start_time" else 1.3
    return make_course(program, p, min(contact, 0.6 * end), end)


def _on(
    program: Program, p: Numbers, mesh: Mesh, course: Course, mu: float = 0.0, adaptive: bool = False
) -> Solution:
    transcribed = transcribe(program, mesh)
    x = course.values(program, p, transcribed.slots)
    return run(transcribed, p, _parameters(program, p), x, None, mu, adaptive)


def _told(reason: str) -> str:
    return {
        "Infeasible_Problem_Detected": "IPOPT finds no start that meets all conditions",
        "Maximum_Iterations_Exceeded": "IPOPT came to its largest number of iterations",
        "Maximum_CpuTime_Exceeded": "IPOPT lost its way",
        "Restoration_Failed": "IPOPT cannot reduce the violation of the conditions any further",
    }.get(reason, f"IPOPT stopped with {reason}")


# ---- finer meshes ----------------------------------------------------------------------------------------


def _refine(
    problem: Problem, solution: Solution, spent: int, tolerance: float, most: int, known: float | None = None
) -> Candidate:
    """Halve intervals until the claimed figure stands still and the exact plant agrees with it.

    `known` is the figure of the similar problem for which the mesh was last made finer: near it, it will do.
    """
    refinements = 0
    before = (np.inf, np.inf)
    settled = False
    best: tuple[float, Solution, Claim, Replayed] | None = None
    while True:
        own = claim(problem, solution)
        exact = replayed(problem, own)
        if exact.shortfall > 0.0 and exact.landing <= LANDING:
            solution, cost = _aimed_higher(problem, solution, exact)
            spent += cost
            own = claim(problem, solution)
            exact = replayed(problem, own)
        agrees = abs(exact.value - own.value) <= tolerance * abs(own.value)
        still = min(abs(exact.value - before[0]), abs(own.value - before[1])) <= tolerance * abs(own.value)
        lands = exact.landing <= LANDING and not exact.parted.any()
        if known is not None and refinements == 0:
            still = abs(own.value - known) <= SIMILAR * abs(known)
        settled = agrees and still and lands
        # a finer mesh may end a little worse: what counts is the exact plant
        merit = exact.value * (1.0 if lands else 1.1)
        if best is None or merit < best[0]:
            best = (merit, solution, own, exact)
        if settled or refinements >= most:
            break
        before = (exact.value, own.value)
        finer, cost = _finer(problem, solution, own, exact, tolerance)
        spent += cost
        refinements += 1
        if finer is None:
            break
        solution = finer
    _, solution, own, exact = best
    off = max(abs(exact.value - own.value) / max(abs(own.value), 1e-300), exact.landing)
    if off > ASTRAY:
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


def _aimed_higher(problem: Problem, solution: Solution, exact: Replayed) -> tuple[Solution, int]:
    """The load missed its target speed by the error of the collocation: aim that much beyond it."""
    program, mesh = solution.transcribed.program, solution.transcribed.mesh
    p = numbers(problem, solution.p.target - 1.0 + 2.0 * exact.shortfall + BEYOND)
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
    course = from_solution(old, solution.read(), np.array([p.z_start, p.v_start, p.w2_start, 0.0]))
    tried = []
    for barrier in (NEAR_BARRIER, 0.0):  # a finer mesh can lead the search astray: then from a wider barrier
        tried.append(_on(program, p, mesh, course, barrier))
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
