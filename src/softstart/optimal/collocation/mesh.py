"""How finely an arc is cut, and where more finely."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np

from softstart.optimal.collocation.guess import Course
from softstart.optimal.collocation.phases import Program
from softstart.optimal.collocation.scaling import Numbers
from softstart.optimal.collocation.transcription import Mesh

STRIDE = 0.6  # rad of the elastic oscillation an interval may span at first
FEWEST, MOST = 6, 30  # intervals of an arc at first


def first_mesh(program: Program, p: Numbers, course: Course) -> Mesh:
    """Even cuts, fine enough for the elastic oscillation and the torque lag."""
    mesh = []
    for phase, arc in zip(program.arcs, course.arcs, strict=True):
        n = arc.duration * p.Omega / STRIDE if phase.contact else 0.0
        if program.lagged:
            n = max(n, arc.duration / (2.0 * p.lag))
        if program.demand != "steps":
            n = 1.5 * n
        if not phase.contact:
            n = max(n, 4) - 2
        mesh.append(_even(min(max(math.ceil(n), FEWEST if phase.contact else 4), MOST)))
    return tuple(mesh)


def _even(n: int) -> tuple[float, ...]:
    return tuple((np.arange(n + 1) / n).tolist())


def refined(mesh: Mesh, flagged: list[bool]) -> Mesh:
    """The mesh with flagged intervals halved."""
    marks = iter(flagged)
    finer = []
    for edges in mesh:
        kept = [edges[0]]
        for begin, end in pairwise(edges):
            if next(marks):
                kept.append(0.5 * (begin + end))
            kept.append(end)
        finer.append(tuple(kept))
    return tuple(finer)


def intervals(mesh: Mesh) -> int:
    """How many there are."""
    return sum(len(edges) - 1 for edges in mesh)
