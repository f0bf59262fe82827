"""Limit cycles through the gap: predicted by its describing function, and tried on the exact plant.

"Where does the describing function of backlash come from?" From the first harmonic of a dead zone, as here:

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

G(jw) is the response of the twist to a torque that the shaft takes, -T: motor and load as free masses, the
controller sampled, its demand held. With the shaft as n (c + jw d) a vibration twist = B + A sin wt sustains
itself if

    1 + n(A, B) M(jw) = 0,      M(jw) = (c + jw d) G(jw)

n is real, so w is a phase crossover of M with M < -1, and n = -1/M. The bias B is that at which the mean
shaft torque is `mean_torque`, since the load must neither gain nor lose speed against the motor in the mean;
with zero mean torque the cycle is unbiased and n(A) that of Nordin and Gutman. With a mean torque there can
be two amplitudes: n falls from 1 as the vibration begins to leave the flank, and rises to 1 again for large
ones.

Assumed: the controller keeps in the gap the linear law it has in contact, no torque limit is reached, and the
twist is nearly a sinusoid (higher harmonics, and those that sampling mirrors, do not come back). Stability is
by Loeb's criterion, with F = 1 + n M: Re F_A Im F_w - Im F_A Re F_w > 0 for a stable cycle.

The check on the exact plant: a start is placed on the cycle (twist, speeds, motor torque and the controller's
states from the first harmonic) in the middle of the gap and continues under the controller itself, with its
torque limits and modes. For a cycle predicted to be stable, frequency and amplitude after many periods are
compared with the predicted ones. A cycle predicted to be unstable is a boundary: two starts, below and above
its amplitude, should diverge from it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from softstart.arrays import Complex, Vector
from softstart.drive import Drive
from softstart.kernel import motor as exchange
from softstart.kernel import records as at
from softstart.linear.law import OperatingPoint, Sample, SampledRun, SampledStart
from softstart.linear.plant import in_contact, sampled
from softstart.linear.systems import zeros_of
from softstart.start.recorded import Recorder

FREQUENCIES = 4000  # of the grid
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

    Frequencies in rad/s, twist amplitudes and bias in rad, torques in N m. `beyond_limits` is true if its
    demand exceeds what the motor can deliver; the measured figures are NaN where no vibration remains.
    """

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


class Outside:
    """Everything but the shaft: from the shaft torque to twist, demand and the measured quantities."""

    def __init__(self, start: SampledStart, point: OperatingPoint) -> None:
        self.start, self.point, self.period = start, point, point.period
        self.drive: Drive = start.machine.design_drive
        drive = self.drive
        self.delay = float(drive.computing_delay)
        # the rates at which viscous friction takes the speeds of motor and load
        _, b1, b2 = drive.frictions
        self.decays = float(b1 / drive.J1), float(b2 / drive.J2)
        motor = in_contact(drive, masses=range(1))
        self.motor = sampled(motor, self.period, self.delay, start.inputs, start.differencing).system

    def speeds(self, s: Any) -> tuple[Any, Any]:
        """Speed of the motor over a torque on it, and of the load over one on it."""
        b1, b2 = self.decays
        return 1.0 / (float(self.drive.J1) * (s + b1)), 1.0 / (float(self.drive.J2) * (s + b2))

    def measured_per_torque(self, w: Vector) -> Complex:
        """Measured quantities at the samples under T = sin wt without any demand: shape (inputs, points)."""
        s = 1j * w
        motor, load = self.speeds(s)
        differenced = (1.0 - np.exp(-s * self.period)) / (s * self.period)
        quantities = {
            exchange.M_MOTOR_ANGLE: -motor / s,
            exchange.M_MOTOR_SPEED: -motor * differenced if self.start.differencing else -motor,
            exchange.M_MOTOR_TORQUE: 0.0 * s,
            exchange.M_SHAFT_TORQUE: 1.0 + 0.0 * s,
            exchange.M_LOAD_SPEED: load,
        }
        return np.array([quantities[index] for index in self.start.inputs])

    def demand_per_torque(self, w: Vector) -> Complex:
        """The controller's demand over the shaft torque, at the samples; exact, with aliases."""
        z = np.exp(1j * w * self.period)
        law, motor = self.point.law.response(z)[:, 0, :], self.motor.response(z)[:, :, 0]
        given = self.measured_per_torque(w).T
        return np.asarray(np.sum(law * given, axis=1) / (1.0 - np.sum(law * motor, axis=1)))

    def motor_torque_per_demand(self, w: Vector) -> Complex:
        """First harmonic of the motor torque: demand held over a period, delayed, lagged."""
        s = 1j * w
        held = (1.0 - np.exp(-s * self.period)) / (s * self.period)
        return np.asarray(held * np.exp(-s * self.delay) / (1.0 + s * float(self.drive.torque_lag)))

    def twist(self, w: Vector) -> Complex:
        """G(jw): twist over -T, rad/(N m)."""
        s = 1j * w
        motor, load = self.speeds(s)
        u = self.motor_torque_per_demand(w) * self.demand_per_torque(w)
        return np.asarray(((1.0 - u) * motor + load) / s)

    def contact(self, w: Vector) -> Complex:
        """M(jw) = (c + jw d) G(jw)."""
        return np.asarray((float(self.drive.c) + 1j * w * float(self.drive.d)) * self.twist(w))

    def holds_speed(self) -> bool:
        """Whether a constant shaft torque leads to an equal motor torque: the loop holds a speed."""
        w = np.array([1e-4 * math.pi / self.period])
        return bool(abs(self.demand_per_torque(w)[0] - 1.0) < 0.1)

    def grid(self) -> Vector:
        """Frequencies from a hundredth of the elastic one to just below half the sample rate."""
        lowest = min(0.01 * float(self.drive.Omega), 1e-3 * math.pi / self.period)
        return np.geomspace(lowest, math.pi / self.period * (1.0 - 1e-9), FREQUENCIES)


def limit_cycles(outside: Outside, run: SampledRun) -> tuple[Cycle, ...]:
    """All limit cycles, predicted about the mean torque of the start, and checked on the exact plant.

    A loop that holds its speed carries the load torque in the mean, another one the torque of its start.
    """
    drive, start = outside.drive, outside.start
    if not drive.gap:
        return ()
    holds = outside.holds_speed()
    base = start.kept(len(run.samples) - 1 if holds else run.contact[-1])
    back = max(1, round(float(drive.elastic_period) / run.period))
    recent = [run.samples[index] for index in run.contact[-1 - back :]]
    w1, w2 = base.plant["w"][:2].tolist()
    if holds:
        mean = float(drive.Mc + drive.load_viscous_friction * w2)
        demand = mean + float(drive.motor_friction + drive.motor_viscous_friction * w1)
    else:
        mean, demand = np.mean([(one.shaft_torque, one.demand) for one in recent], axis=0).tolist()
    room = min(float(drive.maximum_torque) - demand, demand - float(drive.minimum_torque))
    found = [checked(outside, base, cycle) for cycle in predicted(outside, mean)]
    return tuple(replace(one, beyond_limits=one.demand_amplitude > room) for one in found)


def predicted(outside: Outside, mean_torque: float) -> tuple[Cycle, ...]:
    """All limit cycles of the harmonic balance in order of frequency and amplitude; none without a gap."""
    half, c = 0.5 * float(outside.drive.gap), float(outside.drive.c)
    if half == 0.0:
        return ()
    wound = abs(mean_torque) / c
    amplitudes = (wound or half) + np.geomspace(1e-9, LARGEST, AMPLITUDES) * (half + wound)
    found = []
    for w in zeros_of(lambda v: np.sin(np.angle(outside.contact(v))), outside.grid()):
        M = float(outside.contact(np.array([w]))[0].real)
        if M < -1.0:
            excess = partial(_excess, -1.0 / M, half, c, mean_torque)
            found += [_cycle(outside, w, one, mean_torque) for one in zeros_of(excess, amplitudes)]
    return tuple(sorted(found, key=lambda one: (one.frequency, one.amplitude)))


def _excess(wanted: float, half: float, c: float, mean_torque: float, amplitudes: Vector) -> Vector:
    return np.array([n_at(float(one), half, c, mean_torque) for one in amplitudes]) - wanted


def n_at(amplitude: float, half: float, c: float, mean_torque: float) -> float:
    """The share n of a vibration of this amplitude about the bias that the mean torque asks for."""
    return share(amplitude, half, bias_for(mean_torque, amplitude, half, c))


def _cycle(outside: Outside, w: float, amplitude: float, mean_torque: float) -> Cycle:
    half, c = 0.5 * float(outside.drive.gap), float(outside.drive.c)
    around = np.array([1.0 - 1e-5, 1.0, 1.0 + 1e-5])
    M = outside.contact(w * around)
    n = np.array([n_at(float(one), half, c, mean_torque) for one in amplitude * around])
    # F = 1 + n M, and its derivatives times amplitude and frequency
    F_A, F_w = complex((n[2] - n[0]) * M[1]), complex(n[1] * (M[2] - M[0]))
    point = np.array([w])
    demand = amplitude * abs(complex((outside.demand_per_torque(point) / outside.twist(point))[0]))
    stable = F_A.real * F_w.imag - F_A.imag * F_w.real > 0.0
    return Cycle(w, amplitude, bias_for(mean_torque, amplitude, half, c), mean_torque, demand, stable)


def checked(outside: Outside, base: Sample, cycle: Cycle) -> Cycle:
    """The cycle with what the exact plant does, started on it from the sample `base`."""
    if cycle.stable:
        frequency, amplitude = _after(outside, base, cycle, 1.0)
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
    ends = [_after(outside, base, cycle, factor) for factor in (BELOW, ABOVE)]
    lower, upper = (0.0 if math.isnan(w) or a < GONE * cycle.amplitude else a for w, a in ends)
    confirmed = lower < BELOW * cycle.amplitude and upper > cycle.amplitude
    verdict = "confirmed as a boundary" if confirmed else "not confirmed as a boundary"
    return replace(
        cycle, confirmed=confirmed,
        verdict=f"{verdict}: from {BELOW:g} and {ABOVE:g} times its amplitude the vibration ends at "
        f"{lower:.2g} and {upper:.2g} rad",
    )  # fmt: skip


def _after(outside: Outside, base: Sample, cycle: Cycle, factor: float) -> tuple[float, float]:
    """Frequency and amplitude after many periods; NaN and the amplitude if it no longer oscillates.

    The frequency is the mean between upward crossings of the mid value, the amplitude half the range.
    """
    period = 2.0 * math.pi / cycle.frequency
    end = base.time + (SETTLING + MEASURED) * period
    recorder = Recorder(outside.start.rows, outside.start.sees | exchange.SEES_SHAFT_TORQUE)
    begin = _on_the_cycle(outside, base, cycle, factor * cycle.amplitude)
    for _ in outside.start.samples(end, begin=begin, recorder=recorder):
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


def _on_the_cycle(outside: Outside, base: Sample, cycle: Cycle, amplitude: float) -> Sample:
    """A sample with the gap open, in the middle of the part of it that the twist crosses, going up."""
    half, bias = 0.5 * float(outside.drive.gap), cycle.bias
    low, high = max(-half, bias - amplitude), min(half, bias + amplitude)
    if low >= high:  # this vibration does not leave the flank: start just off it
        low, high = half * (1.0 - 1e-3), half
    twist = 0.5 * (low + high)
    sine = min(max((twist - bias) / amplitude, -1.0), 1.0)
    turn = amplitude * complex(math.sqrt(1.0 - sine * sine), sine)  # twist = bias + Im(turn e^jwt)
    w, s = np.array([cycle.frequency]), 1j * cycle.frequency
    z = np.exp(s * outside.period)
    motor, load = outside.speeds(s)
    T = -turn / complex(outside.twist(w)[0])
    demand = T * complex(outside.demand_per_torque(w)[0])
    u = demand * complex(outside.motor_torque_per_demand(w)[0])
    phi1 = (u - T) * motor / s
    begin = base.copied()
    plant = begin.plant
    theta = float(plant["theta"][0])
    plant["phi"] += phi1.imag - twist + theta  # of the load
    plant["theta"][0] = twist
    plant["w"][1] += (T * load).imag
    plant["w"][0] = plant["w"][1] + (s * turn).imag
    plant["sample_angle"] += (phi1 / z).imag
    if float(outside.drive.torque_lag) > 0.0:
        plant["u"] += u.imag
    plant["mode"][0] = at.OPEN
    plant["stage"] += 1.0 - plant["stage"] % 2.0  # the gap is open: an odd stage
    measured = outside.measured_per_torque(w)[:, 0] * T
    measured = measured + outside.motor.response(np.array([z]))[0, :, 0] * demand
    law, states = outside.point.law, list(outside.point.states)
    begin.state[states] += np.linalg.solve(z * np.eye(len(states)) - law.A, law.B @ measured).imag
    return begin
