"""Limit cycles through the gap: predicted by its describing function, and tried on the exact plant.

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
twist is nearly a sinusoid.

The check on the exact plant: a start is placed on the cycle (the eigenvector of that pole) in the middle of
the gap and continues under the controller itself, with its torque limits and modes. For a cycle predicted to
be stable, frequency and amplitude after many periods are compared with the predicted ones. A cycle predicted
to be unstable is a boundary: two starts, below and above its amplitude, should diverge from it.
"""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise

import numpy as np

from softstart.arrays import Complex, Matrix, Vector
from softstart.kernel import records as at
from softstart.linear.law import Sample, SampledRun
from softstart.linear.loop import ROUNDING, Loop
from softstart.linear.plant import in_contact
from softstart.linear.systems import SMALL, zeros_of

SHARES = np.geomspace(1e-4, 1.0, 200)  # n, of the grid
SLOW = 1e-4 * math.pi  # rad a sample
HOLDING = 10.0  # |1 + L| there with the gap open, above which a loop holds its speed
LARGEST = 100.0  # amplitude, in half gaps and mean windups
AMPLITUDES = 1500  # of the grid
SETTLING, MEASURED = 60, 10  # periods
POINTS = 200  # per period
AGREED = 0.1  # relative difference of frequency and amplitude up to which a stable cycle counts as confirmed
BELOW, ABOVE = 0.7, 1.4  # of the amplitude, for a cycle predicted to be unstable
GONE = 1e-3
STILL = 0.2  # of the predicted amplitude: below, the vibration counts as gone


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
    found = optimize.brentq(
        lambda bias: mean_twist_beyond(amplitude, half_gap, bias) - wound, -reach, reach,
        xtol=1e-15 * (reach + amplitude), rtol=1e-14,
    )  # fmt: skip
    return float(found)


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
    """A predicted limit cycle, and what the exact plant does when it is started there.

    `share` is n. Frequencies in rad/s, twist amplitudes and bias in rad, torques in N m. `beyond_limits` is
    true if its demand exceeds what the motor can deliver; the measured figures are NaN where no vibration
    remains.
    """

    share: float
    frequency: float
    amplitude: float
    bias: float
    mean_torque: float
    demand_amplitude: float
    stable: bool
    beyond_limits: bool = False
    measured_frequency: float = math.nan
    measured_amplitude: float = math.nan
    confirmed: bool = False
    verdict: str = ""


def limit_cycles(loop: Loop, run: SampledRun) -> tuple[Cycle, ...]:
    """All limit cycles, predicted about the mean torque of the start, and checked on the exact plant.

    A loop that holds its speed carries the load torque in the mean, another one the torque of its start.
    """
    drive = loop.machine.design_drive
    if not drive.gap:
        return ()
    alone = replace(loop, open=True).broken
    holds = bool(abs(1.0 + alone.at(np.array([SLOW / loop.period]), loop.period)[0]) > HOLDING)
    base = run.last if holds else run.kept[run.contact[-1]]
    if holds:
        w1, w2 = base.plant["w"][:2].tolist()
        mean = float(drive.Mc + drive.load_viscous_friction * w2)
        demand = mean + float(drive.motor_friction + drive.motor_viscous_friction * w1)
    else:
        back = max(1, round(float(drive.elastic_period) / run.period))
        recent = [run.samples[index] for index in run.contact[-1 - back :]]
        mean, demand = np.mean([(one.shaft_torque, one.demand) for one in recent], axis=0).tolist()
    room = min(float(drive.maximum_torque) - demand, demand - float(drive.minimum_torque))
    found = [checked(loop, base, cycle) for cycle in predicted(loop, mean)]
    return tuple(replace(one, beyond_limits=one.demand_amplitude > room) for one in found)


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
    found = [
        float(optimize.brentq(excess, SHARES[i], SHARES[i + 1], (rank,), 1e-13 * SHARES[i + 1], 1e-14))
        for i, (one, other) in enumerate(pairwise(counts))
        for rank in range(min(one, other), max(one, other))
    ]
    return [n for n in found if np.min(np.abs(outside(n))) < SMALL]


def predicted(loop: Loop, mean_torque: float) -> list[Cycle]:
    """All limit cycles of the harmonic balance in order of frequency and amplitude."""
    drive = loop.machine.design_drive
    half, c = 0.5 * float(drive.gap), float(drive.c)
    wound = abs(mean_torque) / c
    amplitudes = (wound or half) + np.geomspace(1e-9, LARGEST, AMPLITUDES) * (half + wound)

    def excess(n: float, amplitudes: Vector) -> Vector:
        return np.array([n_at(float(one), half, c, mean_torque) for one in amplitudes]) - n

    found = []
    for n in crossings(loop):
        pole, vector, read = _on_the_circle(loop, n)
        w = cmath.phase(pole) / loop.period
        lower, upper = (abs(_on_the_circle(loop, n * by, pole)[0]) for by in (1.0 - 1e-5, 1.0 + 1e-5))
        for amplitude in zeros_of(partial(excess, n), amplitudes):
            less, more = excess(n, amplitude * np.array([1.0 - 1e-5, 1.0 + 1e-5]))
            demand = amplitude * abs(complex(read[1] @ vector))
            bias = bias_for(mean_torque, amplitude, half, c)
            stable = bool((upper - lower) * (more - less) < 0.0)
            found.append(Cycle(n, w, amplitude, bias, mean_torque, demand, stable))
    return sorted(found, key=lambda one: (one.frequency, one.amplitude))


def _on_the_circle(loop: Loop, n: float, near: complex | None = None) -> tuple[complex, Complex, Matrix]:
    """The pole nearest to the circle, or to another one; its vector for a twist of 1 rad; what is read."""
    poles, vectors, read = oscillating(loop, n)
    nearest = int(np.argmin(np.abs(np.abs(poles) - 1.0) if near is None else np.abs(poles - near)))
    return complex(poles[nearest]), vectors[:, nearest] / vectors[1, nearest], read


def checked(loop: Loop, base: Sample, cycle: Cycle) -> Cycle:
    """The cycle with what the exact plant does, started on it from the sample `base`."""
    if cycle.stable:
        frequency, amplitude = _after(loop, base, cycle, 1.0)
        if math.isnan(frequency) or amplitude < STILL * cycle.amplitude:
            return replace(cycle, measured_amplitude=amplitude, verdict="not confirmed: the vibration decays")
        off_w, off_a = frequency / cycle.frequency - 1.0, amplitude / cycle.amplitude - 1.0
        confirmed = max(abs(off_w), abs(off_a)) <= AGREED
        verdict = "confirmed" if confirmed else "there is a limit cycle, further off"
        return replace(
            cycle, measured_frequency=frequency, measured_amplitude=amplitude, confirmed=confirmed,
            verdict=f"{verdict}: frequency {100.0 * off_w:+.1f} %, amplitude {100.0 * off_a:+.1f} % from "
            "predicted",
        )  # fmt: skip
    ends = [_after(loop, base, cycle, factor) for factor in (BELOW, ABOVE)]
    lower, upper = (0.0 if math.isnan(w) or a < GONE * cycle.amplitude else a for w, a in ends)
    confirmed = lower < BELOW * cycle.amplitude and upper > cycle.amplitude
    verdict = "confirmed as a boundary" if confirmed else "not confirmed as a boundary"
    return replace(
        cycle, confirmed=confirmed,
        verdict=f"{verdict}: from {BELOW:g} and {ABOVE:g} times its amplitude the vibration ends at "
        f"{lower:.2g} and {upper:.2g} rad",
    )  # fmt: skip


def _after(loop: Loop, base: Sample, cycle: Cycle, factor: float) -> tuple[float, float]:
    """Frequency and amplitude after many periods; NaN and the amplitude if it no longer oscillates.

    The frequency is the mean between upward crossings of the mid value, the amplitude half the range.
    """
    period = 2.0 * math.pi / cycle.frequency
    end = base.time + (SETTLING + MEASURED) * period
    recorder = loop.start.recorder(256)
    for _ in loop.start.samples(end, _on_the_cycle(loop, base, cycle, factor * cycle.amplitude), recorder):
        pass
    times = np.linspace(end - MEASURED * period, end * (1.0 - 1e-12), MEASURED * POINTS)
    twist = recorder.finished().at(times)["twist"][:, 0]
    beyond = twist - 0.5 * (twist.min() + twist.max())
    up = np.flatnonzero((beyond[:-1] < 0.0) & (beyond[1:] >= 0.0))
    amplitude = 0.5 * float(np.ptp(twist))
    if up.size < 3:
        return math.nan, amplitude
    crossed = times[up] + beyond[up] / (beyond[up] - beyond[up + 1]) * (times[1] - times[0])
    return 2.0 * math.pi * (up.size - 1) / float(crossed[-1] - crossed[0]), amplitude


def _on_the_cycle(loop: Loop, base: Sample, cycle: Cycle, amplitude: float) -> Sample:
    """A sample with the gap open, in the middle of the part of it that the twist crosses, going up."""
    half, bias, states = 0.5 * float(loop.machine.design_drive.gap), cycle.bias, loop.point.states
    low, high = max(-half, bias - amplitude), min(half, bias + amplitude)
    if low >= high:  # this vibration does not leave the flank: start just off it
        low, high = half * (1.0 - 1e-3), half
    sine = min(max((0.5 * (low + high) - bias) / amplitude, -1.0), 1.0)
    turn = amplitude * complex(math.sqrt(1.0 - sine * sine), sine)  # twist = bias + Im(turn e^jwt)
    state = np.imag(turn * _on_the_circle(loop, cycle.share)[1])
    now = base.plant
    # twist and its rate as such, all else about the sample
    state[1] = 0.5 * (low + high) - float(now["theta"][0])
    state[2] = state[3] + cycle.frequency * turn.real - float(now["w"][0] - now["w"][1])
    begin = base.displaced(in_contact(loop.machine), state)
    if loop.start.differencing:
        begin.plant["sample_angle"] += state[-1 - len(states)]
    begin.plant["mode"][0] = at.OPEN
    begin.plant["stage"] += 1.0 - begin.plant["stage"] % 2.0  # the gap is open: an odd stage
    begin.state[states] += state[state.size - len(states) :]
    return begin
