"""Poles of a sampled loop as modes: frequency and damping ratio."""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass

import numpy as np

from softstart.linear.realisation import TOLERANCE, System, observable

DEAD = 1e-5  # poles within this of 0 are dead after a few samples: delays


@dataclass(frozen=True)
class Mode:
    """A closed-loop pole z = exp(s h): its frequency |s| in rad/s and damping ratio -Re s/|s|.

    A negative real pole alternates from sample to sample; its s has the imaginary part pi/h.
    """

    value: complex  # z
    frequency: float
    damping_ratio: float


def modes(system: System, period: float, tolerance: float = TOLERANCE) -> tuple[Mode, ...]:
    """The modes that the outputs show, by frequency; delays are left out.

    >>> import math
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
