"""Linear sampled systems: their minimal part, their response over frequency, their modes.

States that no input reaches, or no output shows, are left out in two steps. First by structure: a sample
counter, the number of a mode, a schedule depend on nothing measured, so they are no feedback whatever their
effect; exact zeros decide, and slopes that do not exist there do not matter. Then by numbers: an orthonormal
basis of the controllable subspace is grown direction by direction (the staircase algorithm in its Arnoldi
form: P. Van Dooren 1981, doi:10.1109/TAC.1981.1102559), and a direction shorter than TOLERANCE of the vector
it was computed from adds nothing. Only orthogonal transformations are used, no polynomial and no power of A.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from softstart.arrays import Complex, Matrix, Vector

TOLERANCE = 1e-8
LOWEST = 1e-5  # of the highest frequency
PER_DECADE = 200
NEAR_A_POLE = 30  # frequencies on either side of it
DEAD = 1e-5  # poles within this of 0 are dead after a few samples: delays


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
    from scipy import linalg

    n = scales.size
    A = system.A * scales[None, :] / scales[:, None]
    B = system.B * inputs[None, :] / scales[:, None]
    C = system.C * scales[None, :] / outputs[:, None]
    D = system.D * inputs[None, :] / outputs[:, None]
    if n:
        whole = np.block([[A, B], [C, np.zeros((C.shape[0], B.shape[1]))]])
        square = np.zeros((n + max(B.shape[1], C.shape[0]),) * 2)
        square[: whole.shape[0], : whole.shape[1]] = whole
        _, (factors, _) = linalg.matrix_balance(square, permute=False, separate=True)
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


def at_points(system: System, z: Complex) -> Complex:
    """C (z - A)^-1 B + D at every z, shape (points, outputs, inputs).

    >>> one = System(*(np.array([[value]]) for value in (0.5, 1.0, 1.0, 0.0)))
    >>> at_points(one, np.array([1.0 + 0j])).ravel().tolist()
    [(2+0j)]
    """
    points = np.atleast_1d(np.asarray(z, dtype=np.complex128))
    n = system.A.shape[0]
    shifted = points[:, None, None] * np.eye(n) - system.A
    inputs = np.broadcast_to(system.B, (points.size, *system.B.shape))
    return np.asarray(system.C @ np.linalg.solve(shifted, inputs) + system.D, dtype=np.complex128)


def poles(system: System) -> Complex:
    """The eigenvalues of A."""
    return np.asarray(np.linalg.eigvals(system.A), dtype=np.complex128)


def frequencies(period: float, near: Complex) -> Vector:
    """Frequencies in rad/s up to half the sample rate, close together near these poles."""
    highest = math.pi / period
    count = int(PER_DECADE * -math.log10(LOWEST))
    grid = [np.geomspace(LOWEST * highest, highest * (1.0 - 1e-9), count)]
    for pole in near:
        angle = abs(float(np.angle(pole))) / period
        if abs(pole) > 0.0 and LOWEST * highest < angle < highest:
            width = max(abs(math.log(abs(pole))) / period, 1e-7 * angle)
            away = (
                np.geomspace(0.1 * width, 0.5 * angle, NEAR_A_POLE)
                if 0.1 * width < 0.5 * angle
                else np.zeros(0)
            )
            grid += [angle - away, angle + away]
    whole = np.unique(np.concatenate(grid))
    return whole[(whole >= LOWEST * highest) & (whole < highest)]


def zeros_of(function: Callable[[Vector], Vector], grid: Vector, largest: float) -> list[float]:
    """All zeros between neighbours of the grid with different signs.

    A change of sign through infinity (a pole) does not count: at a zero the function is below `largest`.
    """
    from scipy import optimize

    values = function(grid)
    found = []
    for index in np.flatnonzero(np.signbit(values[:-1]) != np.signbit(values[1:])):
        left, right = grid[index], grid[index + 1]
        root = optimize.brentq(
            lambda w: float(function(np.array([w]))[0]), left, right, xtol=1e-13 * right, rtol=1e-14
        )
        there = abs(float(function(np.array([root]))[0]))
        if there <= min(abs(values[index]), abs(values[index + 1])) + 1e-9 and there < largest:
            found.append(float(root))
    return found


@dataclass(frozen=True)
class Mode:
    """A closed-loop pole z = exp(s h): its frequency |s| in rad/s and damping ratio -Re s/|s|.

    A negative real pole alternates from sample to sample; its s has the imaginary part pi/h.
    """

    value: complex  # z
    frequency: float
    damping_ratio: float


def modes(system: System, period: float, tolerance: float = TOLERANCE) -> tuple[Mode, ...]:
    """The modes that show in the outputs, by frequency, without delays.

    >>> A = np.array([[0.0, 1.0], [-0.81, 2 * 0.9 * math.cos(0.5)]])
    >>> found = modes(System(A, np.zeros((2, 0)), np.eye(2), np.zeros((2, 0))), 1.0)
    >>> [round(mode.frequency, 6) for mode in found], round(found[0].damping_ratio, 6)
    ([0.51098, 0.51098], 0.206193)
    """
    poles = np.linalg.eigvals(observable(system, tolerance).A)
    found = [mode_of(complex(z), period) for z in poles if abs(z) > DEAD]
    return tuple(sorted(found, key=lambda mode: (mode.frequency, mode.value.imag)))


def mode_of(z: complex, period: float) -> Mode:
    """The mode of a pole other than 0."""
    s = cmath.log(z) / period
    size = abs(s)
    return Mode(z, size, -s.real / size if size > 0.0 else math.nan)
