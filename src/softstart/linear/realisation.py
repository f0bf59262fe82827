"""Leaving out of a linear system what its inputs do not move, or what its outputs do not show.

First by structure: a sample counter, the number of a mode, a schedule depend on nothing measured, so whatever
their effect is, it is no feedback; exact zeros decide, and slopes that do not exist there do not matter. Then
by numbers: an orthonormal basis of the controllable subspace is grown direction by direction (the staircase
algorithm in its Arnoldi form: P. Van Dooren 1981, doi:10.1109/TAC.1981.1102559), and a direction that is
shorter than TOLERANCE of what it was made from counts as nothing new. Only orthogonal transformations are
used, no polynomial and no power of A.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Matrix = NDArray[np.float64]
TOLERANCE = 1e-8


class System(NamedTuple):
    """x+ = A x + B y, output C x + D y."""

    A: Matrix
    B: Matrix
    C: Matrix
    D: Matrix


def moved(system: System) -> list[int]:
    """The states that the inputs reach, by the pattern of A and B.

    >>> A, B = np.array([[0.5, 0.0], [0.0, 1.0]]), np.array([[1.0], [0.0]])
    >>> moved(System(A, B, np.ones((1, 2)), np.zeros((1, 1))))
    [0]
    """
    reached = np.any(system.B != 0.0, axis=1)
    for _ in range(reached.size):
        reached = reached | np.any(system.A[:, reached] != 0.0, axis=1)
    return [int(index) for index in np.flatnonzero(reached)]


def shown(system: System) -> list[int]:
    """The states that reach the outputs, by the pattern of A and C."""
    return moved(dual(system))


def part(system: System, kept: list[int]) -> System:
    """The system with these states only."""
    return System(system.A[np.ix_(kept, kept)], system.B[kept], system.C[:, kept], system.D)


def dual(system: System) -> System:
    """Inputs and outputs exchanged."""
    return System(system.A.T, system.C.T, system.B.T, system.D.T)


def controllable(system: System, tolerance: float = TOLERANCE) -> System:
    """The controllable part, in an orthonormal basis."""
    basis = _reached_from(system.A, system.B, tolerance)
    return System(basis.T @ system.A @ basis, basis.T @ system.B, system.C @ basis, system.D)


def observable(system: System, tolerance: float = TOLERANCE) -> System:
    """The observable part."""
    return dual(controllable(dual(system), tolerance))


def minimal(system: System, tolerance: float = TOLERANCE) -> System:
    """The part that is both: no other has the same transfer function and fewer states.

    >>> A, B, C = np.diag([0.5, 0.5, 0.9]), np.ones((3, 1)), np.array([[1.0, 1.0, 0.0]])
    >>> twice = System(A, B, C, np.zeros((1, 1)))
    >>> minimal(twice).A.round(12).tolist()
    [[0.5]]
    """
    return controllable(observable(system, tolerance), tolerance)


def scaled(system: System, scales: Matrix, inputs: Matrix, outputs: Matrix) -> System:
    """States, inputs and outputs in units of these sizes, then the states balanced."""
    from scipy.linalg import matrix_balance

    n = scales.size
    A = system.A * scales[None, :] / scales[:, None]
    B = system.B * inputs[None, :] / scales[:, None]
    C = system.C * scales[None, :] / outputs[:, None]
    D = system.D * inputs[None, :] / outputs[:, None]
    if n:
        whole = np.block([[A, B], [C, np.zeros((C.shape[0], B.shape[1]))]])
        square = np.zeros((n + max(B.shape[1], C.shape[0]),) * 2)
        square[: whole.shape[0], : whole.shape[1]] = whole
        _, (factors, _) = matrix_balance(square, permute=False, separate=True)
        f = factors[:n]
        A, B, C = A * f[None, :] / f[:, None], B / f[:, None], C * f[None, :]
    return System(A, B, C, D)


def unscaled(system: System, inputs: Matrix, outputs: Matrix) -> System:
    """Inputs and outputs in their own units again."""
    return System(
        system.A,
        system.B / inputs[None, :],
        system.C * outputs[:, None],
        system.D * outputs[:, None] / inputs[None, :],
    )


def _reached_from(A: Matrix, B: Matrix, tolerance: float) -> Matrix:
    """An orthonormal basis of the span of B, A B, A^2 B, ..."""
    n = A.shape[0]
    basis = np.zeros((n, 0))
    lengths = np.linalg.norm(B, axis=0)
    largest = float(lengths.max()) if lengths.size else 0.0
    fresh = B[:, lengths > tolerance * largest] if largest > 0.0 else np.zeros((n, 0))
    fresh = fresh / np.linalg.norm(fresh, axis=0)
    size = max(float(np.linalg.norm(A, 2)) if n else 0.0, np.finfo(float).tiny)
    scale = 1.0
    while fresh.shape[1] and basis.shape[1] < n:
        for _ in range(2):  # twice is enough for orthogonality
            fresh = fresh - basis @ (basis.T @ fresh)
        U, s, _ = np.linalg.svd(fresh, full_matrices=False)
        new = U[:, s > tolerance * scale]
        basis = np.hstack([basis, new])
        fresh = A @ new
        scale = size
    return basis
