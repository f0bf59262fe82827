"""Measurement noise: a number that looks random but follows from the seed and the number of the sample."""

from __future__ import annotations

import math

import numpy as np

from softstart.plant.jit import compiled

# the mixer of SplitMix64 (Steele, Lea, Flood 2014, doi:10.1145/2660193.2660195)
_STEP = np.uint64(0x9E3779B97F4A7C15)
_FIRST = np.uint64(0xBF58476D1CE4E5B9)
_SECOND = np.uint64(0x94D049BB133111EB)
_30, _27, _31, _11, _2 = np.uint64(30), np.uint64(27), np.uint64(31), np.uint64(11), np.uint64(2)
_UNIT = 2.0**-53


@compiled
def _mixed(z: np.uint64) -> np.uint64:
    z = (z ^ (z >> _30)) * _FIRST
    z = (z ^ (z >> _27)) * _SECOND
    return z ^ (z >> _31)


@compiled
def gauss(seed: float, number: float) -> float:
    """The noise number `number` of the sequence `seed`: standard normal, by Box and Muller.

    No state is kept, so a start has the same noise alone, in a batch, and under a plain controller.

    >>> gauss(1.0, 5.0) == gauss(1.0, 5.0), gauss(1.0, 5.0) == gauss(2.0, 5.0)
    (True, False)
    """
    start = _mixed(np.uint64(seed) * _STEP + _STEP) + _2 * np.uint64(number) * _STEP
    a = _mixed(start + _STEP)
    b = _mixed(start + _2 * _STEP)
    radius = math.sqrt(-2.0 * math.log((float(a >> _11) + 0.5) * _UNIT))
    return radius * math.cos(2.0 * math.pi * float(b >> _11) * _UNIT)
