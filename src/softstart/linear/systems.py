"""Linear sampled systems: their response over frequency, their modes, their minimal part.

python-control holds and plots such systems, but needs Slycot to reduce one to its minimal part, and takes the
margins of a sampled one from polynomials in z, which lose their digits near z = 1. So those two stand here.

States that no input reaches, or no output shows, are left out in two steps. First by structure (`moved`): a
sample counter, the number of a mode, a schedule depend on nothing measured, so they are no feedback whatever
their effect; exact zeros decide. Then by numbers (`minimal`): an orthonormal basis of the controllable
subspace is grown direction by direction (the staircase algorithm in its Arnoldi form: P. Van Dooren 1981,
doi:10.1109/TAC.1981.1102559), and a direction shorter than TOLERANCE of the vector it was computed from adds
nothing.
"""

from __future__ import annotations

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
SMALL = 1e-6  # what a function is at its zeros
DEAD = 1e-5  # poles within this of 0 are dead after a few samples: delays


class System(NamedTuple):
    """x+ = A x + B y, output C x + D y."""

    A: Matrix
    B: Matrix
    C: Matrix
    D: Matrix

    def response(self, z: Complex) -> Complex:
        """C (z - A)^-1 B + D at every z, shape (points, outputs, inputs).

        >>> one = System(*(np.array([[value]]) for value in (0.5, 1.0, 1.0, 0.0)))
        >>> one.response(np.array([1.0 + 0j])).ravel().tolist()
        [(2+0j)]
        """
        shifted = z[:, None, None] * np.eye(self.A.shape[0]) - self.A
        inputs = np.broadcast_to(self.B, (z.size, *self.B.shape))
        return np.asarray(self.C @ np.linalg.solve(shifted, inputs) + self.D, dtype=np.complex128)

    def at(self, w: Vector, period: float) -> Complex:
        """The response of one output to one input at frequencies in rad/s, sampled with this period."""
        return np.asarray(self.response(np.exp(1j * w * period))[:, 0, 0])

    def dual(self) -> System:
        """Inputs and outputs exchanged."""
        return System(self.A.T, self.C.T, self.B.T, self.D.T)

    def part(self, kept: list[int]) -> System:
        """The system with these states only."""
        return System(self.A[np.ix_(kept, kept)], self.B[kept], self.C[:, kept], self.D)


def moved(system: System) -> list[int]:
    """The states that the inputs reach, by the pattern of A and B; of the dual, those that the outputs show.

    >>> A, B = np.array([[0.5, 0.0], [0.0, 1.0]]), np.array([[1.0], [0.0]])
    >>> moved(System(A, B, np.ones((1, 2)), np.zeros((1, 1))))
    [0]
    """
    reached = np.any(system.B != 0.0, axis=1)
    for _ in range(reached.size):
        reached = reached | np.any(system.A[:, reached] != 0.0, axis=1)
    return [int(index) for index in np.flatnonzero(reached)]


def minimal(system: System, tolerance: float = TOLERANCE) -> System:
    """The part that the inputs reach and the outputs show: the same response with the fewest states.

    >>> A, B, C = np.diag([0.5, 0.5, 0.9]), np.ones((3, 1)), np.array([[1.0, 1.0, 0.0]])
    >>> minimal(System(A, B, C, np.zeros((1, 1)))).A.round(12).tolist()
    [[0.5]]
    """
    balanced, inputs, outputs = _balanced(system)
    shown = _controllable(balanced.dual(), tolerance).dual()
    least = _controllable(shown, tolerance)
    return System(least.A, least.B / inputs, least.C * outputs[:, None], system.D)


def observable(system: System, tolerance: float = TOLERANCE) -> Matrix:
    """The transition matrix of the part that the outputs show."""
    return _controllable(_balanced(system)[0].dual(), tolerance).A.T


def _balanced(system: System) -> tuple[System, Vector, Vector]:
    """States, inputs and outputs in units in which their effects are of one size; those of the last two."""
    from scipy import linalg

    n, (p, m) = system.A.shape[0], system.D.shape
    whole = np.zeros((n + max(m, p),) * 2)
    whole[:n, :n], whole[:n, n : n + m], whole[n : n + p, :n] = system.A, system.B, system.C
    whole, (units, _) = linalg.matrix_balance(whole, permute=False, separate=True)
    return (
        System(whole[:n, :n], whole[:n, n : n + m], whole[n : n + p, :n], system.D),
        units[n : n + m], units[n : n + p],
    )  # fmt: skip


def _controllable(system: System, tolerance: float) -> System:
    """The controllable part, in an orthonormal basis of the span of B, A B, A^2 B, ..."""
    A, fresh = system.A, system.B
    basis = np.zeros((A.shape[0], 0))
    scale = float(np.linalg.norm(fresh)) or 1.0
    while fresh.shape[1] and basis.shape[1] < A.shape[0]:
        for _ in range(2):  # twice is enough for orthogonality
            fresh = fresh - basis @ (basis.T @ fresh)
        directions, lengths, _ = np.linalg.svd(fresh, full_matrices=False)
        new = directions[:, lengths > tolerance * scale]
        basis, fresh = np.hstack([basis, new]), A @ new
        scale = float(np.linalg.norm(A, 2)) or 1.0
    return System(basis.T @ A @ basis, basis.T @ system.B, system.C @ basis, system.D)


def frequencies(period: float, system: System) -> Vector:
    """Frequencies in rad/s up to half the sample rate, close together near the system's poles."""
    near = np.linalg.eigvals(system.A)
    highest = math.pi / period
    lowest = LOWEST * highest
    grid = [np.geomspace(lowest, highest * (1.0 - 1e-9), int(PER_DECADE * -math.log10(LOWEST)))]
    for pole in near[near != 0.0]:
        angle = abs(float(np.angle(pole))) / period
        width = 0.1 * max(abs(math.log(abs(pole))) / period, 1e-7 * angle)
        if lowest < angle < highest and width < 0.5 * angle:
            away = np.geomspace(width, 0.5 * angle, NEAR_A_POLE)
            grid += [angle - away, angle + away]
    whole = np.unique(np.concatenate(grid))
    return whole[(whole >= lowest) & (whole < highest)]


def zeros_of(function: Callable[[Vector], Vector], grid: Vector) -> list[float]:
    """All zeros between neighbours of the grid with different signs.

    A jump, or a change of sign through infinity, does not count: at a zero the function is small.
    """
    from scipy import optimize

    def single(w: float) -> float:
        return float(function(np.array([w]))[0])

    negative = np.signbit(function(grid))
    roots = [
        optimize.brentq(single, grid[i], grid[i + 1], xtol=1e-13 * grid[i + 1], rtol=1e-14)
        for i in np.flatnonzero(negative[:-1] != negative[1:])
    ]
    return [float(root) for root in roots if abs(single(root)) < SMALL]


@dataclass(frozen=True)
class Mode:
    """A closed-loop pole z = exp(s h): its frequency |s| in rad/s and damping ratio -Re s/|s|.

    A negative real pole alternates from sample to sample; its s has the imaginary part pi/h.
    """

    frequency: float
    damping_ratio: float
    real: float
    imag: float

    @property
    def value(self) -> complex:
        """The pole z."""
        return complex(self.real, self.imag)


def modes(transition: Matrix, period: float) -> tuple[Mode, ...]:
    """The modes of a transition matrix by frequency, without delays.

    >>> found = modes(np.array([[0.0, 1.0], [-0.81, 2 * 0.9 * math.cos(0.5)]]), 1.0)
    >>> [round(mode.frequency, 6) for mode in found], round(found[0].damping_ratio, 6)
    ([0.51098, 0.51098], 0.206193)
    """
    poles = np.linalg.eigvals(transition)
    poles = poles[np.abs(poles) > DEAD].astype(complex)
    s = np.log(poles) / period
    with np.errstate(invalid="ignore"):
        columns = (abs(s), -s.real / abs(s), poles.real, poles.imag)
    found = map(Mode, *(column.tolist() for column in columns))
    return tuple(sorted(found, key=lambda mode: (mode.frequency, mode.imag)))
