"""Linear sampled systems: their response over frequency, their modes, their crossings.

python-control holds and plots such systems, but takes the margins of a sampled one from polynomials in z,
which lose their digits near z = 1.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from softstart.arrays import Complex, Matrix, Vector

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

    def connected(self) -> list[int]:
        """The states that the inputs reach and the outputs show, by the zeros of A, B and C.

        A sample counter, the number of a mode, a schedule depend on nothing measured: they are no feedback.

        >>> A, B = np.array([[0.5, 0.0], [0.0, 1.0]]), np.array([[1.0], [0.0]])
        >>> System(A, B, np.ones((1, 2)), np.zeros((1, 1))).connected()
        [0]
        """
        reached, shown = np.any(self.B != 0.0, axis=1), np.any(self.C != 0.0, axis=0)
        for _ in reached:
            reached = reached | np.any(self.A[:, reached] != 0.0, axis=1)
            shown = shown | np.any(self.A[shown] != 0.0, axis=0)
        return [int(index) for index in np.flatnonzero(reached & shown)]

    def part(self, kept: list[int]) -> System:
        """The system with these states only."""
        return System(self.A[np.ix_(kept, kept)], self.B[kept], self.C[:, kept], self.D)


def frequencies(period: float, system: System) -> Vector:
    """Frequencies in rad/s up to half the sample rate, close together near the system's poles."""
    highest = math.pi / period
    lowest = LOWEST * highest
    grid = [np.geomspace(lowest, highest * (1.0 - 1e-9), int(PER_DECADE * -math.log10(LOWEST)))]
    poles = np.linalg.eigvals(system.A)
    for pole in poles[poles != 0.0]:
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
        float(optimize.brentq(single, grid[i], grid[i + 1], xtol=1e-13 * grid[i + 1], rtol=1e-14))
        for i in np.flatnonzero(negative[:-1] != negative[1:])
    ]
    return [root for root in roots if abs(single(root)) < SMALL]


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
    modes_of_poles = map(Mode, *(column.tolist() for column in columns))
    return tuple(sorted(modes_of_poles, key=lambda mode: (mode.frequency, mode.imag)))
