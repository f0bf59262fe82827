"""Limit cycles foretold: where the gap, as its describing function, and the rest of the loop balance.

G(jw) is the twist that the drive under its controller answers to a torque that the shaft takes, -T: motor and
load as free masses, the controller sampled, its demand held. With the shaft as n (c + jw d) a vibration
twist = B + A sin wt keeps itself up if

    1 + n(A, B) M(jw) = 0,      M(jw) = (c + jw d) G(jw)

n is real, so w is a phase crossover of M with M < -1, and n = -1/M. The bias B is that at which the mean
shaft torque is `mean_torque`, since the load must neither gain nor lose speed against the motor in the mean;
with zero mean torque the cycle is unbiased and n(A) that of Nordin and Gutman. With a mean torque there can
be two amplitudes: n falls from 1 as the vibration begins to leave the flank, and rises to 1 again for large
ones.

Assumed: the controller keeps the one linear law it has in contact in the gap too, no torque limit is reached,
and the twist is nearly a sinusoid (higher harmonics, and those that sampling mirrors, do not come back).
Stable or not is by Loeb's criterion, with F = 1 + n M: Re F_A Im F_w - Im F_A Re F_w > 0 for a stable cycle.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from softstart.drive import Drive
from softstart.linear.dead_zone import bias_for, share
from softstart.linear.realisation import System
from softstart.linear.response import Complex, Vector, at_points, zeros_of
from softstart.linear.sampled_plant import SampledPlant, motor_alone, sampled
from softstart.plant import start as kernel

POINTS = 4000
LARGEST = 100.0  # amplitude, in half gaps and mean windups
TRACE = 1500  # amplitudes tried


@dataclass(frozen=True)
class Cycle:
    """A limit cycle foretold: frequency in rad/s, twist amplitude and bias in rad, torques in N m."""

    frequency: float
    amplitude: float
    bias: float
    mean_torque: float
    demand_amplitude: float
    stable: bool


class Outside:
    """Everything but the shaft: from the shaft torque to twist, demand and what is measured."""

    def __init__(
        self, drive: Drive, law: System, inputs: tuple[int, ...], plant: SampledPlant, differencing: bool
    ) -> None:
        self.drive, self.law, self.inputs = drive, law, inputs
        self.period = plant.period
        self.delay = float(drive.computing_delay)
        self.lag = float(drive.torque_lag)
        self.differencing = differencing
        self.motor = sampled(motor_alone(drive), self.period, self.delay, inputs, differencing).system

    def measured_per_torque(self, w: Vector) -> Complex:
        """What is measured at the samples under T = sin wt without an answer: shape (inputs, points)."""
        J1, J2 = float(self.drive.J1), float(self.drive.J2)
        s = 1j * w
        angle = -1.0 / (J1 * s**2)
        speed = (1.0 - np.exp(-s * self.period)) / self.period * angle if self.differencing else s * angle
        quantities = {
            kernel.M_MOTOR_ANGLE: angle,
            kernel.M_MOTOR_SPEED: speed,
            kernel.M_MOTOR_TORQUE: 0.0 * s,
            kernel.M_SHAFT_TORQUE: 1.0 + 0.0 * s,
            kernel.M_LOAD_SPEED: 1.0 / (J2 * s),
        }
        return np.array([quantities[index] for index in self.inputs])

    def demand_per_torque(self, w: Vector) -> Complex:
        """The answered demand over the shaft torque, at the samples; exact, aliases included."""
        z = np.exp(1j * w * self.period)
        law = at_points(self.law, z)[:, 0, :]
        motor = at_points(self.motor, z)[:, :, 0]
        given = self.measured_per_torque(w).T
        answered: Complex = np.sum(law * given, axis=1) / (1.0 - np.sum(law * motor, axis=1))
        return answered

    def motor_torque_per_demand(self, w: Vector) -> Complex:
        """First harmonic of the motor torque: demand held over a period, delayed, lagged."""
        s = 1j * w
        held = (1.0 - np.exp(-s * self.period)) / (s * self.period)
        return np.asarray(held * np.exp(-s * self.delay) / (1.0 + s * self.lag))

    def twist(self, w: Vector) -> Complex:
        """G(jw): twist over -T, rad/(N m)."""
        s2 = -(w**2)
        J1, J2 = float(self.drive.J1), float(self.drive.J2)
        u = self.motor_torque_per_demand(w) * self.demand_per_torque(w)
        return np.asarray(-((u - 1.0) / J1 - 1.0 / J2) / s2)

    def contact(self, w: Vector) -> Complex:
        """M(jw) = (c + jw d) G(jw)."""
        return np.asarray((float(self.drive.c) + 1j * w * float(self.drive.d)) * self.twist(w))

    def holds_speed(self) -> bool:
        """Whether a lasting shaft torque is answered by as much motor torque: the loop holds a speed."""
        w = np.array([1e-4 * math.pi / self.period])
        return bool(abs(self.demand_per_torque(w)[0] - 1.0) < 0.1)


def frequency_grid(outside: Outside) -> Vector:
    """From a hundredth of the elastic frequency to just below half the sample rate."""
    lowest = min(0.01 * float(outside.drive.Omega), 1e-3 * math.pi / outside.period)
    return np.geomspace(lowest, math.pi / outside.period * (1.0 - 1e-9), POINTS)


def cycles(outside: Outside, mean_torque: float) -> tuple[Cycle, ...]:
    """All limit cycles in order of frequency and amplitude; none without a gap."""
    drive = outside.drive
    half = 0.5 * float(drive.gap)
    if half == 0.0:
        return ()
    grid = frequency_grid(outside)
    found = []
    for w in zeros_of(lambda v: np.sin(np.angle(outside.contact(v))), grid, largest=1e-6):
        value = complex(outside.contact(np.array([w]))[0])
        if value.real < -1.0:
            found += [
                _cycle(outside, w, amplitude, mean_torque)
                for amplitude in _amplitudes(-1.0 / value.real, half, float(drive.c), mean_torque)
            ]
    return tuple(sorted(found, key=lambda one: (one.frequency, one.amplitude)))


def _amplitudes(wanted: float, half: float, c: float, mean_torque: float) -> list[float]:
    """All amplitudes at which n is the wanted one."""
    wound = abs(mean_torque) / c
    first = max(wound, 0.0) if wound > 0.0 else half
    amplitudes = first + np.geomspace(1e-9, LARGEST, TRACE) * (half + wound)

    def n_less(values: Vector) -> Vector:
        return np.array([n_at(float(a), half, c, mean_torque) for a in values]) - wanted

    return zeros_of(n_less, amplitudes, largest=1e-6)


def n_at(amplitude: float, half: float, c: float, mean_torque: float) -> float:
    """The share n of a vibration of this amplitude about the bias that the mean torque asks for."""
    return share(amplitude, half, bias_for(mean_torque, amplitude, half, c))


def _cycle(outside: Outside, w: float, amplitude: float, mean_torque: float) -> Cycle:
    drive = outside.drive
    half, c = 0.5 * float(drive.gap), float(drive.c)
    step_w, step_a = 1e-5 * w, 1e-5 * amplitude
    M = outside.contact(np.array([w - step_w, w, w + step_w]))
    n = [n_at(amplitude + by, half, c, mean_torque) for by in (-step_a, 0.0, step_a)]
    F_A = complex((n[2] - n[0]) / (2.0 * step_a) * M[1])
    F_w = complex(n[1] * (M[2] - M[0]) / (2.0 * step_w))
    at = np.array([w])
    torque = amplitude / abs(complex(outside.twist(at)[0]))
    return Cycle(
        w, amplitude, bias_for(mean_torque, amplitude, half, c), mean_torque,
        torque * abs(complex(outside.demand_per_torque(at)[0])),
        F_A.real * F_w.imag - F_A.imag * F_w.real > 0.0,
    )  # fmt: skip
