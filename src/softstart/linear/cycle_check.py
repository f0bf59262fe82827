"""What the exact plant says about a limit cycle that the describing function foretells.

A start is put on the cycle (twist, speeds, motor torque and the controller's states from the first harmonic)
in the middle of the gap and goes on under the controller itself, with its torque limits and modes. For a
cycle said to be stable, frequency and amplitude after many periods stand beside the foretold ones. A cycle
said to be unstable is a watershed: two starts, below and above its amplitude, should part.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from softstart.linear.harmonic_balance import Cycle, Outside
from softstart.linear.operating_point import OperatingPoint
from softstart.linear.response import Vector, at_points
from softstart.linear.sampled_start import Sample, SampledStart
from softstart.plant import layout as at
from softstart.plant import record
from softstart.start.engine import Book

SETTLING, MEASURED = 60, 10  # periods
POINTS = 200  # a period
AGREED = 0.1  # relative difference of frequency and amplitude up to which a stable cycle counts as confirmed
BELOW, ABOVE = 0.7, 1.4  # of the amplitude, for a cycle said to be unstable
GONE = 1e-3
STILL = 0.2  # of the foretold amplitude: below, the vibration counts as gone


@dataclass(frozen=True)
class Verdict:
    """Frequency in rad/s and amplitude in rad that the exact plant shows (NaN: none), and what that means."""

    frequency: float
    amplitude: float
    confirmed: bool
    sentence: str


def checked(
    start: SampledStart, point: OperatingPoint, base: Sample, outside: Outside, cycle: Cycle
) -> Verdict:
    """The cycle on the exact plant, begun about the sample `base`."""
    if cycle.stable:
        frequency, amplitude = _after(start, point, base, outside, cycle, 1.0)
        if math.isnan(frequency) or amplitude < STILL * cycle.amplitude:
            return Verdict(math.nan, amplitude, False, "not confirmed: the vibration dies out")
        off_w, off_a = frequency / cycle.frequency - 1.0, amplitude / cycle.amplitude - 1.0
        confirmed = max(abs(off_w), abs(off_a)) <= AGREED
        said = "confirmed" if confirmed else "there is one, less near"
        return Verdict(
            frequency, amplitude, confirmed,
            f"{said}: frequency {100.0 * off_w:+.1f} %, amplitude {100.0 * off_a:+.1f} % of the foretold",
        )  # fmt: skip
    ends = [_after(start, point, base, outside, cycle, factor) for factor in (BELOW, ABOVE)]
    lower, upper = (0.0 if math.isnan(w) or a < GONE * cycle.amplitude else a for w, a in ends)
    confirmed = lower < BELOW * cycle.amplitude and upper > cycle.amplitude
    parted = (
        f"begun at {BELOW:g} and {ABOVE:g} times its amplitude, it ends at {lower:.2g} and {upper:.2g} rad"
    )
    said = "confirmed as a watershed" if confirmed else "not confirmed as a watershed"
    return Verdict(math.nan, math.nan, confirmed, f"{said}: {parted}")


def _after(
    start: SampledStart, point: OperatingPoint, base: Sample, outside: Outside, cycle: Cycle, factor: float
) -> tuple[float, float]:
    """Frequency and amplitude after many periods; NaN and the amplitude if it no longer goes to and fro."""
    first = _on_the_cycle(start, point, base, outside, cycle, factor)
    period = 2.0 * math.pi / cycle.frequency
    end = first.time + (SETTLING + MEASURED) * period
    book = Book(start.sees)
    for _ in start.from_sample(first, end, book):
        pass
    segments = book.rows()[0]
    times = np.linspace(end - MEASURED * period, end * (1.0 - 1e-12), MEASURED * POINTS)
    index = (np.searchsorted(segments[:, at.S_START], times, side="right") - 1).clip(0)
    states = np.empty((times.size, record.N_OUT))
    record.states_at(start.p, segments, index, times, np.zeros(at.N_X), np.zeros(at.N_M), states)
    return _read(times, states[:, record.THETA_OUT])


def _read(times: Vector, twist: Vector) -> tuple[float, float]:
    """Mean frequency between upward crossings of the mid value, and half the way from least to largest."""
    low, high = float(twist.min()), float(twist.max())
    beyond = twist - 0.5 * (low + high)
    up = np.flatnonzero((beyond[:-1] < 0.0) & (beyond[1:] >= 0.0))
    amplitude = 0.5 * (high - low)
    if up.size < 3:
        return math.nan, amplitude
    step = beyond[up] / (beyond[up] - beyond[up + 1])
    instants = times[up] + step * (times[up + 1] - times[up])
    return 2.0 * math.pi * (up.size - 1) / float(instants[-1] - instants[0]), amplitude


def _on_the_cycle(
    start: SampledStart, point: OperatingPoint, base: Sample, outside: Outside, cycle: Cycle, factor: float
) -> Sample:
    """A sample with the gap open, at the middle of what the twist crosses of it, going up."""
    half = 0.5 * float(start.drive.gap)
    amplitude, bias = factor * cycle.amplitude, cycle.bias
    low, high = max(-half, bias - amplitude), min(half, bias + amplitude)
    if low >= high:  # below its amplitude this one does not leave the flank: begin just off it
        low, high = half * (1.0 - 1e-3), half
    twist = 0.5 * (low + high)
    sine = min(max((twist - bias) / amplitude, -1.0), 1.0)
    turn = amplitude * complex(math.sqrt(1.0 - sine * sine), sine)  # twist = bias + Im(turn e^jwt)
    w = np.array([cycle.frequency])
    s = 1j * cycle.frequency
    torque = -turn / complex(outside.twist(w)[0])
    demand = torque * complex(outside.demand_per_torque(w)[0])
    u = demand * complex(outside.motor_torque_per_demand(w)[0])
    J1, J2 = float(start.drive.J1), float(start.drive.J2)
    phi1, w2 = (u - torque) / (J1 * s**2), torque / (J2 * s)
    motor_angle = base.x[at.PHI2] + base.x[at.THETA] + phi1.imag
    moves = {
        at.THETA: twist - base.x[at.THETA],
        at.PHI2: motor_angle - twist - base.x[at.PHI2],
        at.V: (s * turn).imag - base.x[at.V],
        at.W2: w2.imag,
        at.SIDE: -base.x[at.SIDE],
        at.BEYOND: -base.x[at.BEYOND],
        at.DOUBLED: -base.x[at.DOUBLED],
        at.MASK: -base.x[at.MASK],
        at.SAMPLE_ANGLE: (phi1 * np.exp(-s * outside.period)).imag,
    }
    if base.x[at.SIDE] != 0.0:
        moves[at.STAGE] = 1.0  # the gap is open: an odd stage
    if outside.lag > 0.0:
        moves[at.U] = u.imag
    return base.elsewhere(moves, _state(point, base, outside, cycle, torque, demand))


def _state(
    point: OperatingPoint, base: Sample, outside: Outside, cycle: Cycle, torque: complex, demand: complex
) -> Vector:
    """The controller's state: as at the base, and those in the loop on the cycle."""
    w = np.array([cycle.frequency])
    z = complex(np.exp(1j * cycle.frequency * outside.period))
    measured = outside.measured_per_torque(w)[:, 0] * torque
    measured = measured + at_points(outside.motor, np.array([z]))[0, :, 0] * demand
    state = base.state.copy()
    law = point.law
    if point.states:
        inside = np.linalg.solve(z * np.eye(len(point.states)) - law.A, law.B @ measured)
        state[list(point.states)] += inside.imag
    return state
