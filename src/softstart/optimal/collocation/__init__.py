"""Optimal starts by direct collocation: CasADi, phases of free duration, IPOPT.

Read in this order: phases.py (which motions follow each other), statement.py (the mathematics: dynamics, path
constraints, boundary conditions, objective), interval.py and transcription.py (the same as a nonlinear
program), guess.py (where the search begins), search.py (`solve`: starts, retries, refinement), reading.py (a
solution in SI).
"""

from __future__ import annotations

from typing import Any

from softstart.optimal.collocation.failure import NotConverged
from softstart.optimal.problem import Problem
from softstart.optimal.result import Candidate

__all__ = ["NotConverged", "solve"]


def solve(
    problem: Problem,
    *,
    warm: Any = None,
    contact_guess: float | None = None,
    tolerance: float = 1e-4,
    max_refinements: int = 5,
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

    Raises InputError for a problem of no class known here, and NotConverged where IPOPT finds no solution or
    the mesh does not get fine enough: `NotConverged.violation` is the largest violated constraint.

    >>> from softstart import Drive
    >>> drive = Drive.load("crane-4amtkf").replace(target_speed=60)
    >>> round(solve(Problem(drive, start_time=0.2883042)).claimed, 3)
    0.909
    """
    from softstart.optimal.collocation import search  # imports casadi: only when asked

    return search.solve(problem, warm, contact_guess, tolerance, max_refinements)
