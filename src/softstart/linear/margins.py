"""Margins of a sampled loop, broken at the torque demand; all crossings, the smallest margins chosen.

L is the negative of the demand that the controller answers to a demand put into the plant, so 1 + L = 0 at a
closed-loop pole and -1 is the critical point.

    gain crossover  |L(e^jwh)| = 1;   phase margin: the angle by which L there misses -180 degrees
    phase crossover  L(e^jwh) < 0;    gain margin -1/L, above 1 or (a loop that needs its gain) below 1
    delay margin: the least further dead time between answer and torque that puts a closed-loop pole on the
        unit circle, of the exactly sampled loop with that dead time (no phase approximation)
    modulus margin: the least distance |1 + L| from -1, the inverse of the peak of the sensitivity
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from softstart.linear.delay_margin import delay_margin
from softstart.linear.realisation import System
from softstart.linear.response import Complex, Vector, at_points, frequencies, poles, zeros_of

LARGEST_LOOP = (
    1e6  # |L| beyond which a change of sign is a pole on the circle, and below whose inverse L is 0
)


@dataclass(frozen=True)
class Crossing:
    """A frequency in rad/s at which the loop crosses, and the margin there: rad, or a factor on the gain."""

    frequency: float
    margin: float


@dataclass(frozen=True)
class Margins:
    """What a loop stands. Angles in rad, delay in s, infinite where no change of that kind can do harm.

    `gain_margin` is the least factor above 1, `gain_reduction` the largest below 1 (0: none) that puts a
    closed-loop pole on the unit circle.
    """

    gain_margin: float
    gain_reduction: float
    phase_margin: float
    delay_margin: float
    delay_frequency: float
    modulus_margin: float
    modulus_frequency: float
    gain_crossovers: tuple[Crossing, ...]
    phase_crossovers: tuple[Crossing, ...]

    @property
    def sensitivity_peak(self) -> float:
        """The largest |1/(1 + L)|."""
        return 1.0 / self.modulus_margin if self.modulus_margin > 0.0 else math.inf


def margins(
    loop: System, period: float, delayed: Callable[[float], System] | None = None, jumping: bool = False
) -> Margins:
    """Margins of L (one input, one output); `delayed(s)` is L with that much more dead time.

    `jumping` is explained at `delay_margin`. Without `delayed` the delay margin is that of L e^(-jws).

    >>> integrator = System(*(np.array([[value]]) for value in (1.0, 1.0, 0.5, 0.0)))  # L = 0.5/(z - 1)
    >>> found = margins(integrator, 1.0)
    >>> round(found.gain_margin, 9), round(math.degrees(found.phase_margin), 3)
    (4.0, 75.522)
    """
    grid = frequencies(period, poles(loop))

    def L(w: Vector) -> Complex:
        return at_points(loop, np.exp(1j * np.asarray(w) * period))[:, 0, 0]

    at_one = zeros_of(lambda w: np.log(np.abs(L(w))), grid, largest=1e-6)
    gain_crossovers = tuple(Crossing(w, _from_minus_one(complex(L(np.array([w]))[0]))) for w in at_one)
    phase_crossovers = _phase_crossovers(L, grid, period)
    factors = [one.margin for one in phase_crossovers]
    if delayed is None:
        guesses = [(one.margin % (2.0 * math.pi) / one.frequency, one.frequency) for one in gain_crossovers]
        delay, frequency = min(guesses, default=(math.inf, math.nan))
    else:
        delay, frequency = delay_margin(period, delayed, jumping)
    modulus, where = _modulus(L, grid)
    return Margins(
        min((k for k in factors if k > 1.0), default=math.inf),
        max((k for k in factors if k <= 1.0), default=0.0),
        min((abs(one.margin) for one in gain_crossovers), default=math.inf),
        delay, frequency, modulus, where, gain_crossovers, phase_crossovers,
    )  # fmt: skip


def _from_minus_one(value: complex) -> float:
    """The angle from -1 to L, -pi to pi: positive where more lag brings L to -1."""
    return cmath.phase(-value)


def _phase_crossovers(L: Callable[[Vector], Complex], grid: Vector, period: float) -> tuple[Crossing, ...]:
    found = []
    for w in zeros_of(lambda v: np.sin(np.angle(L(v))), grid, largest=1e-6):
        value = complex(L(np.array([w]))[0])
        if -1.0 / LARGEST_LOOP > value.real > -LARGEST_LOOP:
            found.append(Crossing(w, -1.0 / value.real))
    # at half the sample rate L is real
    last = complex(L(np.array([math.pi / period]))[0])
    if -1.0 / LARGEST_LOOP > last.real > -LARGEST_LOOP:
        found.append(Crossing(math.pi / period, -1.0 / last.real))
    return tuple(found)


def _modulus(L: Callable[[Vector], Complex], grid: Vector) -> tuple[float, float]:
    from scipy.optimize import minimize_scalar

    distance = np.abs(1.0 + L(grid))
    index = int(np.argmin(distance))
    left, right = grid[max(index - 1, 0)], grid[min(index + 1, grid.size - 1)]
    refined = minimize_scalar(
        lambda w: float(abs(1.0 + L(np.array([w]))[0])), bounds=(left, right), method="bounded",
        options={"xatol": 1e-9 * right},
    )  # fmt: skip
    if refined.fun < distance[index]:
        return float(refined.fun), float(refined.x)
    return float(distance[index]), float(grid[index])
