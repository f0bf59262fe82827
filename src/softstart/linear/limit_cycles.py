"""Limit cycles through the gap, predicted by its describing function.

"Where does the describing function of backlash come from?" From the first harmonic of a dead zone, as here.
The describing function treats the shaft as a spring that is softer the less the twist leaves the gap. For a
twist B + A sin(wt) the dead zone of half width h = gap/2 transmits the torque

    T = T0 + n A (c sin wt + d w cos wt) + higher harmonics,     n = n(A, B, h), 0 <= n <= 1

with (dead-zone law: spring and damper act while the flank is touched)

    n = 1 - (f((h - B)/A) + f((h + B)/A))/2,   f(x) = (2/pi)(asin x + x sqrt(1 - x^2)), +-1 beyond +-1
    T0 = c (B - (A/2)(g((h + B)/A) - g((h - B)/A))),   g(x) = (2/pi)(x asin x + sqrt(1 - x^2)), |x| beyond

For B = 0 and A > h this is N(A) = c n = c (1 - (2/pi)(asin(h/A) + (h/A) sqrt(1 - (h/A)^2))), as in M. Nordin
and P.-O. Gutman, Controlling mechanical systems with backlash: a survey, Automatica 38 (2002) 1633-1649,
doi:10.1016/S0005-1098(02)00047-X. For B = 0 it is the sinusoidal, otherwise the dual-input (bias and
sinusoid) describing function (A. Gelb, W. E. Vander Velde, Multiple-Input Describing Functions, 1968).
The functions are exact for mean and first harmonic; that the others do not matter is the assumption.

So a vibration twist = B + A sin wt sustains itself where the sampled loop (`loop`), with the shaft as
n (c + jw d), has a pole on the unit circle at e^(jwh): the poles are followed over n from 1 to nearly 0, the
open gap. This is the harmonic balance of the exactly sampled loop. The bias B is that at
which the mean shaft torque is `mean_torque`, since the load must neither gain nor lose speed against the
motor in the mean; with zero mean torque the cycle is unbiased and n(A) that of Nordin and Gutman. With a mean
torque there can be two amplitudes: n falls from 1 as the vibration begins to leave the flank, and rises to 1
again for large ones. A cycle is stable if the pole goes inside as the amplitude grows (Loeb's criterion).

Assumed: the controller keeps in the gap the linear law it has in contact, no torque limit is reached, and the
twist is nearly a sinusoid. `simulate` shows what the exact plant does.
"""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise

import numpy as np

from softstart.arrays import Complex, Matrix, Vector
from softstart.kernel.motor import M_MOTOR_SPEED
from softstart.linear.law import SampledRun
from softstart.linear.loop import ROUNDING, Loop
from softstart.linear.systems import SMALL, zeros_of

SHARES = np.geomspace(1e-4, 1.0, 200)  # n, of the grid
LARGEST = 100.0  # amplitude, in half gaps and mean windups
AMPLITUDES = 1500  # of the grid


def share(amplitude: float, half_gap: float, bias: float = 0.0) -> float:
    """n: the first harmonic of the shaft torque over that of a shaft without gap, 0 to 1.

    >>> share(1.0, 2.0), share(1.0, 0.0), round(share(2.0, 1.0), 6)
    (0.0, 1.0, 0.391002)
    """
    return 1.0 - 0.5 * (_f((half_gap - bias) / amplitude) + _f((half_gap + bias) / amplitude))


def mean_twist_beyond(amplitude: float, half_gap: float, bias: float) -> float:
    """T0/c in rad: the mean twist of the shaft itself.

    >>> mean_twist_beyond(0.1, 0.5, 1.0), mean_twist_beyond(3.0, 0.5, 0.0)
    (0.5, 0.0)
    """
    above, below = (half_gap + bias) / amplitude, (half_gap - bias) / amplitude
    return bias - 0.5 * amplitude * (_g(above) - _g(below))


def bias_for(mean_torque: float, amplitude: float, half_gap: float, stiffness: float) -> float:
    """The bias B in rad at which the mean shaft torque is `mean_torque`: unique, as the torque grows with it.

    >>> bias_for(0.0, 2.0, 1.0, 5.0), round(bias_for(3.0, 0.1, 1.0, 5.0), 12)
    (0.0, 1.6)
    """
    from scipy import optimize

    if mean_torque == 0.0:
        return 0.0
    wound = mean_torque / stiffness
    if amplitude <= abs(wound):  # never leaves the flank
        return math.copysign(half_gap, wound) + wound
    reach = half_gap + abs(wound)
    bias = optimize.brentq(
        lambda bias: mean_twist_beyond(amplitude, half_gap, bias) - wound, -reach, reach,
        xtol=1e-15 * (reach + amplitude), rtol=1e-14,
    )  # fmt: skip
    return float(bias)


def n_at(amplitude: float, half: float, c: float, mean_torque: float) -> float:
    """The share n of a vibration of this amplitude about the bias that the mean torque asks for."""
    return share(amplitude, half, bias_for(mean_torque, amplitude, half, c))


def _f(x: float) -> float:
    if abs(x) >= 1.0:
        return math.copysign(1.0, x)
    return 2.0 / math.pi * (math.asin(x) + x * math.sqrt(1.0 - x * x))


def _g(x: float) -> float:
    if abs(x) >= 1.0:
        return abs(x)
    return 2.0 / math.pi * (x * math.asin(x) + math.sqrt(1.0 - x * x))


@dataclass(frozen=True)
class Cycle:
    """A predicted limit cycle.

    `share` is n. Frequency in rad/s, twist amplitude and bias in rad, torques in N m. `beyond_limits` is true
    if its demand exceeds what the motor can deliver.
    """

    share: float
    frequency: float
    amplitude: float
    bias: float
    mean_torque: float
    demand_amplitude: float
    stable: bool
    beyond_limits: bool


def limit_cycles(loop: Loop, run: SampledRun) -> tuple[Cycle, ...]:
    """All limit cycles of the harmonic balance in order of frequency and amplitude.

    A loop that holds its speed carries the load torque in the mean, another one the torque of its start.
    """
    drive = loop.machine.design_drive
    if not drive.gap:
        return ()
    back = max(1, round(float(drive.elastic_period) / run.period))
    if loop.holds_speed:
        w = float(np.mean([one.measured[M_MOTOR_SPEED] for one in run.samples[-1 - back :]]))
        mean = float(drive.Mc + drive.load_viscous_friction * w)
        demand = mean + float(drive.motor_friction + drive.motor_viscous_friction * w)
    else:
        recent = [run.samples[index] for index in run.contact[-1 - back :]]
        mean, demand = np.mean([(one.shaft_torque, one.demand) for one in recent], axis=0).tolist()
    room = min(float(drive.maximum_torque) - demand, demand - float(drive.minimum_torque))
    half, c = 0.5 * float(drive.gap), float(drive.c)
    wound = abs(mean) / c
    amplitudes = (wound or half) + np.geomspace(1e-9, LARGEST, AMPLITUDES) * (half + wound)

    def excess(n: float, amplitudes: Vector) -> Vector:
        return np.array([n_at(float(one), half, c, mean) for one in amplitudes]) - n

    cycles = []
    for n in crossings(loop):
        pole, vector, read = _on_the_circle(loop, n)
        w = cmath.phase(pole) / loop.period
        lower, upper = (abs(_on_the_circle(loop, n * by, pole)[0]) for by in (1.0 - 1e-5, 1.0 + 1e-5))
        for amplitude in zeros_of(partial(excess, n), amplitudes):
            less, more = excess(n, amplitude * np.array([1.0 - 1e-5, 1.0 + 1e-5]))
            swing = amplitude * abs(complex(read[1] @ vector))
            bias = bias_for(mean, amplitude, half, c)
            stable = bool((upper - lower) * (more - less) < 0.0)
            cycles.append(Cycle(n, w, amplitude, bias, mean, swing, stable, swing > room))
    return tuple(sorted(cycles, key=lambda one: (one.frequency, one.amplitude)))


def oscillating(loop: Loop, n: float) -> tuple[Complex, Complex, Matrix]:
    """Of the loop with the share n of the shaft: the poles that oscillate, the outermost first, their
    vectors, and what is read of a state.
    """
    whole, _, read = replace(loop, share=n).closed()
    poles, vectors = np.linalg.eig(whole)
    order = np.argsort(-np.abs(poles))
    order = order[(poles[order].imag > 0.0) & (np.abs(poles[order] - 1.0) > loop.rotation)]
    return poles[order], vectors[:, order], read


def crossings(loop: Loop) -> list[float]:
    """All n at which a pole crosses the unit circle."""
    from scipy import optimize

    def outside(n: float) -> Vector:
        return np.asarray(np.abs(oscillating(loop, n)[0]) - 1.0 - ROUNDING)

    def excess(n: float, rank: int) -> float:
        return float([*outside(n), *[-1.0] * rank, -1.0][rank])

    counts = [int(np.sum(outside(float(n)) > 0.0)) for n in SHARES]
    roots = [
        float(optimize.brentq(excess, SHARES[i], SHARES[i + 1], (rank,), 1e-13 * SHARES[i + 1], 1e-14))
        for i, (one, other) in enumerate(pairwise(counts))
        for rank in range(min(one, other), max(one, other))
    ]
    return [n for n in roots if np.min(np.abs(outside(n))) < SMALL]


def _on_the_circle(loop: Loop, n: float, near: complex | None = None) -> tuple[complex, Complex, Matrix]:
    """The pole nearest to the circle, or to another one; its vector for a twist of 1 rad; what is read."""
    poles, vectors, read = oscillating(loop, n)
    nearest = int(np.argmin(np.abs(np.abs(poles) - 1.0) if near is None else np.abs(poles - near)))
    return complex(poles[nearest]), vectors[:, nearest] / vectors[1, nearest], read
