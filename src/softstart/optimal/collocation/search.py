"""`solve`: from several first guesses to the best solution, then finer until the exact plant agrees."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from softstart.optimal.collocation.failure import NotConverged
from softstart.optimal.collocation.guess import Course, from_solution, make_course, quickest_contact
from softstart.optimal.collocation.ipopt import Solution, Vector, run
from softstart.optimal.collocation.mesh import first_mesh, intervals, refined
from softstart.optimal.collocation.phases import Program, programs
from softstart.optimal.collocation.reading import Claim, Replayed, claim, replayed
from softstart.optimal.collocation.scaling import BEYOND, Numbers, numbers
from softstart.optimal.collocation.tail import tail_rows
from softstart.optimal.collocation.transcription import Mesh, parameter_vector, transcribe
from softstart.optimal.problem import Problem
from softstart.optimal.result import Candidate

ALWAYS = (1.15, 1.8)  # contact instants tried first, in units of the quickest one
OTHERWISE = (1.0, 1.4, 2.6, 4.0)  # tried where these fail
WARM_BARRIER = 1e-5
NEAR_BARRIER = 1e-4
WORSE = 1e-3  # relative: so much a finer mesh may cost
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
    how = "warm" if solution is not None else "cold"
    if solution is None:
        solution, cost = _best_start(problem, contact_guess)
        spent += cost
    return _refine(problem, solution, spent, how, tolerance, max_refinements)


def _from(problem: Problem, warm: Warm) -> Solution:
    transcribed = transcribe(warm.program, warm.mesh)
    p = numbers(problem)
    return run(transcribed, p, _parameters(warm.program, p), warm.x, (warm.lam_x, warm.lam_g), warm.barrier)


def _parameters(program: Program, p: Numbers) -> Vector:
    return parameter_vector(p, tail_rows(program, p))


# ---- first solutions -------------------------------------------------------------------------------------


def _best_start(problem: Problem, contact_guess: float | None) -> tuple[Solution, int]:
    """The best of several first guesses, and the iterations they took."""
    p = numbers(problem)
    quickest = quickest_contact(p)
    own = [] if contact_guess is None else [contact_guess / p.units.time]
    tried: list[Solution] = []
    meshes: dict[Program, Mesh] = {}  # one for all guesses, so that it is transcribed once
    for factors in (ALWAYS, OTHERWISE):
        contacts = [*(own if factors is ALWAYS else []), *(f * quickest for f in factors)]
        for program in programs(problem):
            for contact in contacts if quickest > 0.0 else contacts[:1]:
                course = _course(program, p, contact)
                mesh = meshes.setdefault(program, first_mesh(program, p, course))
                tried.append(_on(program, p, mesh, course))
        if any(s.found for s in tried):
            break
    found = [s for s in tried if s.found]
    if not found:
        nearest = min(tried, key=lambda s: s.violation)
        raise NotConverged(_told(nearest.reason), nearest.violation)
    return min(found, key=lambda s: s.value), sum(s.iterations for s in tried)


def _course(program: Program, p: Numbers, contact: float) -> Course:
    end = 1.0 if program.minimise != "start_time" else 1.3
    return make_course(program, p, min(contact, 0.6 * end), end)


def _on(program: Program, p: Numbers, mesh: Mesh, course: Course, mu: float = 0.0) -> Solution:
    transcribed = transcribe(program, mesh)
    return run(
        transcribed, p, _parameters(program, p), course.values(program, p, transcribed.slots), None, mu
    )


def _told(reason: str) -> str:
    return {
        "Infeasible_Problem_Detected": "IPOPT finds no start that meets all conditions",
        "Maximum_Iterations_Exceeded": "IPOPT came to its largest number of iterations",
        "Restoration_Failed": "IPOPT cannot reduce the violation of the conditions any further",
    }.get(reason, f"IPOPT stopped with {reason}")


# ---- finer meshes ----------------------------------------------------------------------------------------


def _refine(
    problem: Problem, solution: Solution, spent: int, how: str, tolerance: float, most: int
) -> Candidate:
    """Halve intervals until the claimed figure stands still and the exact plant agrees with it."""
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
    note = f"{refinements} refinements to {intervals(mesh)} intervals, {spent} iterations of IPOPT ({how})"
    if not settled:
        note += "; the mesh has not settled"
    warm = Warm(
        solution.transcribed.program, mesh, solution.x, solution.lam_x, solution.lam_g, WARM_BARRIER, spent
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
