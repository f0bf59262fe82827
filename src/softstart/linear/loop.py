"""The loop of a controller's linear law and the sampled plant, broken at the torque demand, and its margins.

L is the negative of the controller's demand in response to a demand fed into the plant, so 1 + L = 0 at a
closed-loop pole and -1 is the critical point. All crossings are found, and the smallest margins chosen.

    gain crossover  |L(e^jwh)| = 1;   phase margin: the angle by which L there misses -180 degrees
    phase crossover  L(e^jwh) < 0;    gain margin -1/L, above 1 or (a loop that needs its gain) below 1
    delay margin: the least further dead time between demand and torque that puts a closed-loop pole on the
        unit circle, of the exactly sampled loop with that dead time (no phase approximation)
    modulus margin: the least distance |1 + L| from -1, the inverse of the peak of the sensitivity

A delay is no mere turn of phase here: a controller that measures the torque it made measures the delay too,
and between samples a held demand is divided again, so L under a delay is not L e^(-jws). But whole samples
are: with s = n h + f, 0 <= f < h,

    L_s(z) = z^-n L_f(z)

since all measurements come n samples later. A pole crosses the unit circle where L_s(e^jwh) = -1, hence where
|L_f| = 1. So for some fractions f the frequencies of |L_f| = 1 are found; the phase gives the number n, which
is rounded, and Newton's method finds (s, w) from there. The least s of all is the margin. A measured torque
changes fastest where a demand takes effect just before or after a sample, so the fractions crowd there.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from softstart.arrays import Complex, Vector
from softstart.chain.machines import Machine
from softstart.kernel.motor import M_MOTOR_TORQUE
from softstart.linear.operating_point import OperatingPoint, closed
from softstart.linear.sampled_plant import (
    Continuous,
    SampledPlant,
    Sizes,
    in_contact,
    motor_side,
    sampled,
    sizes_of,
)
from softstart.linear.systems import (
    TOLERANCE,
    Mode,
    System,
    at_points,
    frequencies,
    minimal,
    modes,
    poles,
    scaled,
    unscaled,
    zeros_of,
)

if TYPE_CHECKING:
    import control

LARGEST_LOOP = 1e6  # |L| above which a change of sign is a pole on the circle; below its inverse L is 0
FRACTIONS = 14  # of a sample
NEAR = 0.5  # of a sample: how far from a whole number a guess may be
TURNS = 2
SEARCHED = 60  # samples
RIGID_ROTATION = 1e-3  # poles this near to 1 are the rotation of the drive as a whole
CLOSE = 1e-9  # |log(-L)| at a crossing
COARSEST = 1e-5  # tolerance for what shows in the closed loop
SLOW = 1e-4  # of the elastic frequency: slower poles are the rotation as a whole, but for rounding
ON_THE_CIRCLE = 1e-9  # poles this near to the unit circle do not count as stable


@dataclass(frozen=True)
class Crossing:
    """A frequency in rad/s at which the loop crosses, and the margin there: rad, or a factor on the gain."""

    frequency: float
    margin: float


@dataclass(frozen=True)
class Margins:
    """Stability margins of a loop. Angles in rad, delay in s; infinite where no such change is harmful.

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

    unity = zeros_of(lambda w: np.log(np.abs(L(w))), grid, largest=1e-6)
    gain_crossovers = tuple(Crossing(w, _from_minus_one(complex(L(np.array([w]))[0]))) for w in unity)
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
    from scipy import optimize

    distance = np.abs(1.0 + L(grid))
    index = int(np.argmin(distance))
    left, right = grid[max(index - 1, 0)], grid[min(index + 1, grid.size - 1)]
    refined = optimize.minimize_scalar(
        lambda w: float(abs(1.0 + L(np.array([w]))[0])), bounds=(left, right), method="bounded",
        options={"xatol": 1e-9 * right},
    )  # fmt: skip
    if refined.fun < distance[index]:
        return float(refined.fun), float(refined.x)
    return float(distance[index]), float(grid[index])


def delay_margin(
    period: float, delayed: Callable[[float], System], jumping: bool = False
) -> tuple[float, float]:
    """The margin in s and the frequency in rad/s at which the pole passes; `delayed(s)` is L_s.

    Infinite if no dead time is harmful. A torque without lag, measured just before a sample, is a different
    one as soon as the delay is a whole sample: L is `jumping` there, and a pole can leave the circle at once.
    Up to SEARCHED samples those delays are tried too.
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
            outside = found_poles[(np.abs(found_poles) > 1.0) & (np.abs(found_poles - 1.0) > RIGID_ROTATION)]
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
    from scipy import optimize

    def delay_and_frequency(shares: Vector) -> tuple[float, float]:
        return delay + (shares[0] - 1.0) * period, shares[1] * frequency

    def miss(shares: Vector) -> list[float]:
        s, w = delay_and_frequency(shares)
        value = turned(s, w, period, delayed)
        logarithm = cmath.log(-value) if value else complex(1e3, 1e3)
        return [logarithm.real, logarithm.imag]

    solved = optimize.root(miss, [1.0, 1.0], method="hybr", options={"xtol": 1e-14})
    s, w = (float(one) for one in delay_and_frequency(solved.x))
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


@dataclass(frozen=True, eq=False)
class Loop:
    """A controller linearised at `point`, on a machine that need not be that of the point.

    `open` is the loop of the motor with what turns with it while all gaps are open.
    """

    drive: Machine
    point: OperatingPoint
    differencing: bool
    open: bool = False

    @property
    def period(self) -> float:
        """Sample period, s."""
        return self.point.plant.period

    @property
    def tolerance(self) -> float:
        """What counts as not showing in the closed loop: above the error of the law, 1e-8 to 1e-5."""
        return min(max(TOLERANCE, 100.0 * self.point.mismatch), COARSEST)

    @cached_property
    def plant(self) -> SampledPlant:
        """The drive in contact at the samples."""
        return self._plant(0.0)

    @cached_property
    def broken(self) -> System:
        """L(z), minimal: from a demand fed into the plant to the negative of the controller's demand."""
        return self._minimal(self.plant)

    @cached_property
    def minimal_law(self) -> System:
        """The controller's minimal realisation, from the measured quantities to the demand."""
        law, inputs, outputs = self.point.law, self.point.derivative.input_scales, self._base
        return unscaled(minimal(scaled(law, self._law_scales, inputs, outputs)), inputs, outputs)

    def broken_delayed(self, delay: float) -> System:
        """L(z) with this much further dead time, s, between demand and torque; not minimal."""
        return self._broken(self._plant(delay))

    def broken_with_gain(self, gain: float) -> System:
        """L(z) with this factor on the demand."""
        L = self.broken
        return System(L.A, L.B * gain, L.C, L.D * gain)

    def margins(self) -> Margins:
        """The margins of L."""
        return margins(self.broken, self.period, self.broken_delayed, self._torque_jumps)

    @property
    def _torque_jumps(self) -> bool:
        """Whether the measured torque has no lag and the controller makes use of it."""
        used = np.any(np.vstack([self.point.law.B, self.point.law.D]) != 0.0, axis=0)
        return "u" not in self._continuous.rows and bool(
            used[self.point.derivative.inputs.index(M_MOTOR_TORQUE)]
        )

    def modes(self) -> tuple[Mode, ...]:
        """The closed loop's poles that show in the shaft torque or in the demand.

        The rotation of the whole drive, which a torque controller leaves free (poles at 1), is excluded.
        """
        found = modes(self._closed_outputs, self.period, self.tolerance)
        return tuple(mode for mode in found if mode.frequency > SLOW * self._sizes.Omega)

    @cached_property
    def stable(self) -> bool:
        """Whether all these modes decay."""
        return all(abs(mode.value) < 1.0 - ON_THE_CIRCLE for mode in self.modes())

    def control_system(self, into: str, out: str) -> control.StateSpace:
        """L(z) for python-control."""
        import control

        return control.StateSpace(*self.broken, self.period, inputs=[into], outputs=[out])

    @cached_property
    def _closed_outputs(self) -> System:
        whole, read = closed(self.plant, self.point.law)
        torque = np.hstack([self.plant.rows["T"], np.zeros((1, len(self.point.states)))])
        system = System(whole, np.zeros((whole.shape[0], 0)), np.vstack([torque, read]), np.zeros((2, 0)))
        outputs = np.concatenate([self._base, self._base])
        return scaled(system, self._scales(self.plant), np.zeros(0), outputs)

    def _plant(self, further: float) -> SampledPlant:
        motor: Any = self.drive.motor
        delay = float(motor.computing_delay) + further
        inputs = self.point.derivative.inputs
        return sampled(self._continuous, self.period, delay, inputs, self.differencing)

    @cached_property
    def _continuous(self) -> Continuous:
        side = motor_side if self.open else in_contact
        return side(self.drive, self.point.sample.plant["incline"])

    def _broken(self, plant: SampledPlant) -> System:
        A, B, C, _ = plant.system
        law = self.point.law
        whole = np.block([[A, np.zeros((A.shape[0], law.A.shape[0]))], [law.B @ C, law.A]])
        into = np.vstack([B, np.zeros((law.A.shape[0], 1))])
        return System(whole, into, -np.hstack([law.D @ C, law.C]), np.zeros((1, 1)))

    def _minimal(self, plant: SampledPlant) -> System:
        system = scaled(self._broken(plant), self._scales(plant), self._base, self._base)
        return unscaled(minimal(system), self._base, self._base)

    @cached_property
    def _sizes(self) -> Sizes:
        return sizes_of(self.drive)

    @property
    def _base(self) -> Vector:
        return np.array([self._sizes.base])

    @property
    def _law_scales(self) -> Vector:
        return np.asarray(self.point.derivative.scales[list(self.point.states)])

    def _scales(self, plant: SampledPlant) -> Vector:
        """The size of each state: windup, elastic speed, mean torque."""
        own, angles = self._sizes, self._continuous.angles
        sizes = np.full(plant.system.A.shape[0], own.base)
        sizes[:angles] = own.windup
        sizes[angles : angles + self._continuous.speeds] = own.speed
        if self.differencing:
            sizes[-1] = own.windup
        return np.concatenate([sizes, self._law_scales])
