"""Limit cycles through the gap: predicted by its describing function, and tried on the exact plant.

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
from dataclasses import dataclass

import numpy as np

from softstart.arrays import Complex, Vector
from softstart.drive import Drive
from softstart.kernel import motor as exchange
from softstart.kernel import records as at
from softstart.linear.operating_point import OperatingPoint
from softstart.linear.sampled_plant import SampledPlant, motor_alone, sampled
from softstart.linear.sampled_start import Part, Sample, SampledStart
from softstart.linear.systems import System, at_points, zeros_of
from softstart.start.recorded import FIRST_ROWS

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


def free_vibration(drive: Drive, amplitudes: Vector) -> tuple[Vector, Vector]:
    """Frequency in rad/s of the unbiased free vibration of two masses through the gap: exact, and by N(A).

    `amplitudes` of the twist, rad, above gap/2. Exact: the masses cross the gap at the speed v and turn round
    in half an elastic period, T = 2 pi/Omega + 2 gap/v, v = Omega (A - gap/2). By the describing function:
    w^2 = N(A) (J1 + J2)/(J1 J2). Undamped, no load torque.

    >>> exact, described = free_vibration(Drive.load("crane-4amtkf"), np.array([0.3, 0.5, 50.0]))
    >>> (described / exact).round(3).tolist()
    [1.18, 1.023, 1.0]
    """
    A = np.asarray(amplitudes, dtype=np.float64)
    gap, Omega = float(drive.gap), float(drive.Omega)
    with np.errstate(divide="ignore"):
        exact = 2.0 * math.pi / (2.0 * math.pi / Omega + 2.0 * gap / (Omega * (A - 0.5 * gap)))
    described = Omega * np.sqrt([share(float(one), 0.5 * gap) for one in A])
    return exact, described


@dataclass(frozen=True)
class Cycle:
    """A predicted limit cycle: frequency in rad/s, twist amplitude and bias in rad, torques in N m."""

    frequency: float
    amplitude: float
    bias: float
    mean_torque: float
    demand_amplitude: float
    stable: bool


class Outside:
    """Everything but the shaft: from the shaft torque to twist, demand and the measured quantities."""

    def __init__(
        self, drive: Drive, law: System, inputs: tuple[int, ...], plant: SampledPlant, differencing: bool
    ) -> None:
        self.drive, self.law, self.inputs = drive, law, inputs
        self.period = plant.period
        self.delay = float(drive.computing_delay)
        self.lag = float(drive.torque_lag)
        # the rates at which viscous friction takes the speeds of motor and load
        _, b1, b2 = drive.frictions
        self.decays = float(b1 / drive.J1), float(b2 / drive.J2)
        self.differencing = differencing
        self.motor = sampled(motor_alone(drive), self.period, self.delay, inputs, differencing).system

    def measured_per_torque(self, w: Vector) -> Complex:
        """Measured quantities at the samples under T = sin wt without any demand: shape (inputs, points)."""
        J1, J2 = float(self.drive.J1), float(self.drive.J2)
        s = 1j * w
        b1, b2 = self.decays
        angle = -1.0 / (J1 * (s * (s + b1)))
        speed = (1.0 - np.exp(-s * self.period)) / self.period * angle if self.differencing else s * angle
        quantities = {
            exchange.M_MOTOR_ANGLE: angle,
            exchange.M_MOTOR_SPEED: speed,
            exchange.M_MOTOR_TORQUE: 0.0 * s,
            exchange.M_SHAFT_TORQUE: 1.0 + 0.0 * s,
            exchange.M_LOAD_SPEED: 1.0 / (J2 * (s + b2)),
        }
        return np.array([quantities[index] for index in self.inputs])

    def demand_per_torque(self, w: Vector) -> Complex:
        """The controller's demand over the shaft torque, at the samples; exact, with aliases."""
        z = np.exp(1j * w * self.period)
        law = at_points(self.law, z)[:, 0, :]
        motor = at_points(self.motor, z)[:, :, 0]
        given = self.measured_per_torque(w).T
        demand: Complex = np.sum(law * given, axis=1) / (1.0 - np.sum(law * motor, axis=1))
        return demand

    def motor_torque_per_demand(self, w: Vector) -> Complex:
        """First harmonic of the motor torque: demand held over a period, delayed, lagged."""
        s = 1j * w
        held = (1.0 - np.exp(-s * self.period)) / (s * self.period)
        return np.asarray(held * np.exp(-s * self.delay) / (1.0 + s * self.lag))

    def twist(self, w: Vector) -> Complex:
        """G(jw): twist over -T, rad/(N m)."""
        J1, J2 = float(self.drive.J1), float(self.drive.J2)
        b1, b2 = self.decays
        s = 1j * w
        u = self.motor_torque_per_demand(w) * self.demand_per_torque(w)
        if b1 == b2 == 0.0:
            return np.asarray(((u - 1.0) / J1 - 1.0 / J2) / w**2)
        return np.asarray(-((u - 1.0) / (J1 * (s + b1)) - 1.0 / (J2 * (s + b2))) / s)

    def contact(self, w: Vector) -> Complex:
        """M(jw) = (c + jw d) G(jw)."""
        return np.asarray((float(self.drive.c) + 1j * w * float(self.drive.d)) * self.twist(w))

    def holds_speed(self) -> bool:
        """Whether a constant shaft torque leads to an equal motor torque: the loop holds a speed."""
        w = np.array([1e-4 * math.pi / self.period])
        return bool(abs(self.demand_per_torque(w)[0] - 1.0) < 0.1)


def frequency_grid(outside: Outside) -> Vector:
    """From a hundredth of the elastic frequency to just below half the sample rate."""
    lowest = min(0.01 * float(outside.drive.Omega), 1e-3 * math.pi / outside.period)
    return np.geomspace(lowest, math.pi / outside.period * (1.0 - 1e-9), FREQUENCIES)


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
    amplitudes = first + np.geomspace(1e-9, LARGEST, AMPLITUDES) * (half + wound)

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
    point = np.array([w])
    torque = amplitude / abs(complex(outside.twist(point)[0]))
    return Cycle(
        w, amplitude, bias_for(mean_torque, amplitude, half, c), mean_torque,
        torque * abs(complex(outside.demand_per_torque(point)[0])),
        F_A.real * F_w.imag - F_A.imag * F_w.real > 0.0,
    )  # fmt: skip


@dataclass(frozen=True)
class Verdict:
    """Frequency in rad/s and amplitude in rad on the exact plant (NaN: none), and what that means."""

    frequency: float
    amplitude: float
    confirmed: bool
    sentence: str


def check_cycle(
    start: SampledStart, point: OperatingPoint, base: Sample, outside: Outside, cycle: Cycle
) -> Verdict:
    """The check of a cycle on the exact plant, started from the sample `base`."""
    if cycle.stable:
        frequency, amplitude = _after(start, point, base, outside, cycle, 1.0)
        if math.isnan(frequency) or amplitude < STILL * cycle.amplitude:
            return Verdict(math.nan, amplitude, False, "not confirmed: the vibration decays")
        off_w, off_a = frequency / cycle.frequency - 1.0, amplitude / cycle.amplitude - 1.0
        confirmed = max(abs(off_w), abs(off_a)) <= AGREED
        verdict = "confirmed" if confirmed else "there is a limit cycle, further off"
        return Verdict(
            frequency, amplitude, confirmed,
            f"{verdict}: frequency {100.0 * off_w:+.1f} %, amplitude {100.0 * off_a:+.1f} % from predicted",
        )  # fmt: skip
    ends = [_after(start, point, base, outside, cycle, factor) for factor in (BELOW, ABOVE)]
    lower, upper = (0.0 if math.isnan(w) or a < GONE * cycle.amplitude else a for w, a in ends)
    confirmed = lower < BELOW * cycle.amplitude and upper > cycle.amplitude
    verdict = "confirmed as a boundary" if confirmed else "not confirmed as a boundary"
    return Verdict(
        math.nan, math.nan, confirmed,
        f"{verdict}: from {BELOW:g} and {ABOVE:g} times its amplitude the vibration ends at {lower:.2g} and "
        f"{upper:.2g} rad",
    )  # fmt: skip


def _after(
    start: SampledStart, point: OperatingPoint, base: Sample, outside: Outside, cycle: Cycle, factor: float
) -> tuple[float, float]:
    """Frequency and amplitude after many periods; NaN and the amplitude if it no longer oscillates."""
    first = _on_the_cycle(start, point, base, outside, cycle, factor)
    period = 2.0 * math.pi / cycle.frequency
    end = first.time + (SETTLING + MEASURED) * period
    recorder = start.begun(end, room=FIRST_ROWS)
    for _ in start.from_sample(first, end, recorder):
        pass
    times = np.linspace(end - MEASURED * period, end * (1.0 - 1e-12), MEASURED * POINTS)
    return _read(times, recorder.finished().at(times)["twist"][:, 0])


def _read(times: Vector, twist: Vector) -> tuple[float, float]:
    """Mean frequency between upward crossings of the mid value, and half the range."""
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
    """A sample with the gap open, in the middle of the part of it that the twist crosses, going up."""
    half = 0.5 * float(outside.drive.gap)
    amplitude, bias = factor * cycle.amplitude, cycle.bias
    low, high = max(-half, bias - amplitude), min(half, bias + amplitude)
    if low >= high:  # this vibration does not leave the flank: start just off it
        low, high = half * (1.0 - 1e-3), half
    twist = 0.5 * (low + high)
    sine = min(max((twist - bias) / amplitude, -1.0), 1.0)
    turn = amplitude * complex(math.sqrt(1.0 - sine * sine), sine)  # twist = bias + Im(turn e^jwt)
    w = np.array([cycle.frequency])
    s = 1j * cycle.frequency
    torque = -turn / complex(outside.twist(w)[0])
    demand = torque * complex(outside.demand_per_torque(w)[0])
    u = demand * complex(outside.motor_torque_per_demand(w)[0])
    J1, J2 = float(outside.drive.J1), float(outside.drive.J2)
    b1, b2 = outside.decays
    phi1, w2 = (u - torque) / (J1 * (s * (s + b1))), torque / (J2 * (s + b2))
    plant = base.plant
    (w1, load_speed), (theta, _) = plant["w"], plant["theta"]
    changes: dict[Part, float] = {
        ("theta", 0): twist - theta,
        ("phi", 0): phi1.imag - twist + theta,  # of the load
        ("w", 0): load_speed - w1 + (w2 + s * turn).imag,
        ("w", 1): w2.imag,
        ("mode", 0): at.OPEN - plant["mode"][0],
        ("stage", 0): 1.0 - plant["stage"] % 2.0,  # the gap is open: an odd stage
        ("sample_angle", 0): (phi1 * np.exp(-s * outside.period)).imag,
    }
    if outside.lag > 0.0:
        changes["u", 0] = u.imag
    return base.displaced(changes, _state(point, base, outside, cycle, torque, demand))


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
