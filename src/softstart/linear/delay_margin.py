"""The least dead time that a sampled loop does not stand, exactly: a delay is no mere turn of phase.

A controller that measures the torque it made sees a delay too, and between samples a held demand is shared
out anew, so L under a delay is not L e^(-jws). But whole samples are: with s = n h + f, 0 <= f < h,

    L_s(z) = z^-n L_f(z)

since everything measured comes n samples later. A pole passes the unit circle where L_s(e^jwh) = -1, hence
where |L_f| = 1. So for some fractions f the frequencies of |L_f| = 1 are found; from the number n that the
phase asks for, made whole, Newton finds (s, w). The least s of all is the margin. A measured torque changes
quickest where a demand takes effect just before or after a sample, so the fractions crowd there.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable

import numpy as np

from softstart.linear.realisation import System
from softstart.linear.response import Complex, Vector, at_points, frequencies, poles, zeros_of

FRACTIONS = 14  # of a sample
NEAR = 0.5  # of a sample: how far from a whole number a guess may be
TURNS = 2
SEARCHED = 60  # samples
FREE_TURNING = 1e-3  # poles this near to 1 are the drive's turning as a whole
CLOSE = 1e-9  # |log(-L)| at a crossing


def delay_margin(
    period: float, delayed: Callable[[float], System], jumping: bool = False
) -> tuple[float, float]:
    """The margin in s and the frequency in rad/s at which the pole passes; `delayed(s)` is L_s.

    Infinite if no dead time does harm. A torque without lag that is measured just before a sample is another
    one as soon as the delay is a whole sample: L is `jumping` there, and a pole can be outside at once. Up to
    SEARCHED samples those delays are tried too.
    """
    best = (math.inf, math.nan)
    for index in range(FRACTIONS):
        fraction = 0.5 - 0.5 * math.cos(math.pi * index / FRACTIONS)
        for samples, w in _guesses(delayed(fraction * period), period):
            if samples + fraction < best[0] / period + NEAR:
                found = _crossing((samples + fraction) * period, w, period, delayed)
                best = min(best, found)
    if jumping:
        for count in range(1, min(SEARCHED, math.ceil(min(best[0] / period, SEARCHED)))):
            loop = delayed(count * period)
            found_poles = np.linalg.eigvals(loop.A - loop.B @ loop.C)
            outside = found_poles[(np.abs(found_poles) > 1.0) & (np.abs(found_poles - 1.0) > FREE_TURNING)]
            if outside.size:
                pole = outside[np.argmax(np.abs(outside))]
                return count * period, abs(float(np.angle(pole))) / period
    return best


def _guesses(loop: System, period: float) -> list[tuple[float, float]]:
    """Whole samples and the frequency near which z^-n L = -1."""
    grid = frequencies(period, poles(loop))

    def log_size(w: Vector) -> Vector:
        return np.log(np.abs(at_points(loop, np.exp(1j * w * period))[:, 0, 0]))

    found = []
    for w in zeros_of(log_size, grid, largest=1e-6):
        value = complex(at_points(loop, np.array([cmath.exp(1j * w * period)]))[0, 0, 0])
        for turn in range(TURNS):
            samples = (cmath.phase(-value) % (2.0 * math.pi) + 2.0 * math.pi * turn) / (w * period)
            found.append((float(round(samples)), w))
    return found


def _crossing(
    delay: float, frequency: float, period: float, delayed: Callable[[float], System]
) -> tuple[float, float]:
    """Where L_s(e^jwh) = -1, near a guess; infinite if there is none."""
    from scipy.optimize import root

    def at(shares: Vector) -> tuple[float, float]:
        return delay + (shares[0] - 1.0) * period, shares[1] * frequency

    def miss(shares: Vector) -> list[float]:
        s, w = at(shares)
        value = turned(s, w, period, delayed)
        logarithm = cmath.log(-value) if value else complex(1e3, 1e3)
        return [logarithm.real, logarithm.imag]

    solved = root(miss, [1.0, 1.0], method="hybr", options={"xtol": 1e-14})
    s, w = (float(one) for one in at(solved.x))
    near = abs(solved.x[0] - 1.0) < 2.0 and 0.5 < solved.x[1] < 2.0
    if max(map(abs, miss(solved.x))) > CLOSE or not near or s <= 0.0:
        return math.inf, math.nan
    return s, w


def turned(delay: float, frequency: float, period: float, delayed: Callable[[float], System]) -> complex:
    """L_s(e^jwh) for any delay s >= 0 (below 0 as at 0)."""
    whole, fraction = divmod(max(delay, 0.0), period)
    z = cmath.exp(1j * frequency * period)
    value: Complex = at_points(delayed(fraction), np.array([z]))[:, 0, 0]
    return complex(value[0]) * z ** (-whole)
