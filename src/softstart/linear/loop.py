"""The loop of a controller's linear law and the sampled plant, broken at the torque demand, and its margins.

"At which delay does this loop become unstable?" is `Loop.delay_margin`.

L is the negative of the controller's demand in response to a demand fed into the plant, so 1 + L = 0 at a
closed-loop pole and -1 is the critical point. All crossings are found, and the smallest margins chosen.

    gain crossover  |L(e^jwh)| = 1;   phase margin: the angle by which L there misses -180 degrees
    phase crossover  L(e^jwh) < 0;    gain margin -1/L, above 1 or (a loop that needs its gain) below 1
    delay margin: the least further dead time between demand and torque that puts a closed-loop pole on the
        unit circle, of the exactly sampled loop with that dead time (no phase approximation)
    modulus margin: the least distance |1 + L| from -1, the inverse of the peak of the sensitivity
    bandwidth: the first frequency at which |L/(1 + L)| is 3 dB below what it is at low frequency, of a loop
        that holds the speed: there L/(1 + L) leads from a change of the commanded speed to the speed measured

A delay is no mere turn of phase here: a controller that measures the torque it made measures the delay too,
and between samples a held demand is divided again, so L under a delay is not L e^(-jws).
"""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from softstart.arrays import Complex, Matrix, Vector
from softstart.drive.machine import Machine
from softstart.kernel import motor as exchange
from softstart.linear.law import OperatingPoint, SampledStart, closed_loop
from softstart.linear.plant import Plant, contact_plant, plant_scales
from softstart.linear.systems import Mode, System, frequencies, modes, zeros_of

if TYPE_CHECKING:
    import control

LARGEST_LOOP = 1e6  # |L| above which a change of sign is a pole on the circle; below its inverse L is 0
FRACTIONS = 0.5 - 0.5 * np.cos(np.linspace(0.0, math.pi, 49)[:-1])  # of a sample, close near a whole one
ROTATION = 1e-3  # of the elastic frequency: slower poles are the rotation as a whole
ROUNDING = 1e-10  # of the largest pole
MEASURED = {
    exchange.M_MOTOR_ANGLE: "motor_angle",
    exchange.M_MOTOR_SPEED: "motor_speed",
    exchange.M_MOTOR_TORQUE: "motor_torque",
    exchange.M_SHAFT_TORQUE: "shaft_torque",
    exchange.M_LOAD_SPEED: "load_speed",
}
SLOW = 1e-4 * math.pi  # rad a sample
HOLDING = 10.0  # |1 + L| there with the gap open, above which a loop holds its speed
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
    closed-loop pole on the unit circle; `sensitivity_peak` is the largest |1/(1 + L)|.
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
    sensitivity_peak: float


def margins(loop: System, period: float, delay_margin: tuple[float, float] | None = None) -> Margins:
    """Margins of L (one input, one output), and the delay margin given, or that of L e^(-jws).

    >>> integrator = System(*(np.array([[value]]) for value in (1.0, 1.0, 0.5, 0.0)))  # L = 0.5/(z - 1)
    >>> found = margins(integrator, 1.0)
    >>> round(found.gain_margin, 9), round(math.degrees(found.phase_margin), 3)
    (4.0, 75.522)
    """
    from scipy import optimize

    def L(w: Vector) -> Complex:
        return loop.at(w, period)

    grid = frequencies(period, loop)
    gain_crossovers = _gain_crossovers(loop, period)
    # at half the sample rate L is real
    real = np.array([*zeros_of(lambda w: np.sin(np.angle(L(w))), grid), math.pi / period])
    values = L(real).real
    kept = (values < -1.0 / LARGEST_LOOP) & (values > -LARGEST_LOOP)
    phase_crossovers = tuple(map(Crossing, real[kept].tolist(), (-1.0 / values[kept]).tolist()))
    factors = [one.margin for one in phase_crossovers]
    near = grid[np.clip(int(np.argmin(np.abs(1.0 + L(grid)))) + np.array([-1, 1]), 0, grid.size - 1)]
    nearest = optimize.minimize_scalar(
        lambda w: float(abs(1.0 + L(np.array([w]))[0])), bounds=near, method="bounded",
        options={"xatol": 1e-9 * near[1]},
    )  # fmt: skip
    least = float(nearest.fun)
    turning = [(one.margin % (2.0 * math.pi) / one.frequency, one.frequency) for one in gain_crossovers]
    return Margins(
        min((k for k in factors if k > 1.0), default=math.inf),
        max((k for k in factors if k <= 1.0), default=0.0),
        min((abs(one.margin) for one in gain_crossovers), default=math.inf),
        *(delay_margin or min(turning, default=(math.inf, math.nan))),
        least, float(nearest.x), gain_crossovers, phase_crossovers, 1.0 / least if least else math.inf,
    )  # fmt: skip


def _gain_crossovers(loop: System, period: float) -> tuple[Crossing, ...]:
    """Where |L| = 1, and the angle from -1 to L, -pi to pi: positive where more lag brings L to -1."""
    grid = frequencies(period, loop)
    crossovers = np.array(zeros_of(lambda w: np.log(np.abs(loop.at(w, period))), grid))
    return tuple(map(Crossing, crossovers.tolist(), np.angle(-loop.at(crossovers, period)).tolist()))


@dataclass(frozen=True, eq=False)
class Loop:
    """A controller linearised at `point`, on a machine that need not be that of the start; `name` says which.

    With `open` it is the loop of the motor with what turns with it while all gaps are open; the shafts have
    the `share` of their stiffness and damping.
    """

    start: SampledStart
    point: OperatingPoint
    machine: Machine
    name: str = ""
    open: bool = False
    share: float = 1.0

    @property
    def period(self) -> float:
        """Sample period, s."""
        return self.point.period

    @cached_property
    def broken(self) -> System:
        """L(z): from a demand fed into the plant to the negative of the controller's demand."""
        return self.broken_delayed(0.0)

    def broken_delayed(self, delay: float) -> System:
        """L(z) with this much further dead time, s, between demand and torque."""
        loop, into, read = self.closed(delay)
        whole = System(loop - np.outer(into, read[1]), into[:, None], -read[[1]], np.zeros((1, 1)))
        return whole.part(whole.connected())

    @cached_property
    def with_gaps_open(self) -> Loop:
        """The loop of the motor and what turns with it, with all gaps open."""
        return self if self.open else replace(self, name="all gaps open", open=True)

    @cached_property
    def holds_speed(self) -> bool:
        """Whether the loop holds the motor speed in the long run."""
        slowly = np.array([SLOW / self.period])
        return bool(abs(1.0 + self.with_gaps_open.broken.at(slowly, self.period)[0]) > HOLDING)

    @cached_property
    def bandwidth(self) -> float:
        """Bandwidth in rad/s; NaN of a loop that does not hold the speed, or that is unstable."""
        if not (self.holds_speed and self.stable):
            return math.nan

        def excess(w: Vector) -> Vector:
            L = self.broken.at(w, self.period)
            return np.abs(L / (1.0 + L)) - 0.5**0.5

        crossovers = zeros_of(excess, frequencies(self.period, self.broken))
        return min(crossovers, default=math.nan)

    @property
    def system(self) -> control.StateSpace:
        """L(z) for python-control."""
        import control

        return control.StateSpace(*self.broken, self.period, inputs=["demand"], outputs=["minus_answer"])

    @property
    def controller_system(self) -> control.StateSpace:
        """The controller's law: from the measured quantities to the demand in N m."""
        import control

        inputs = [MEASURED[i] for i in self.start.inputs]
        return control.StateSpace(*self.point.law, self.period, inputs=inputs, outputs=["demand"])

    @cached_property
    def margins(self) -> Margins:
        """The margins of L."""
        return margins(self.broken, self.period, self.delay_margin)

    @cached_property
    def delay_margin(self) -> tuple[float, float]:
        """The least further dead time that makes the loop unstable, s, and the frequency there, rad/s.

        A dead time of n samples and a fraction f of one turns the phase of L_f by n samples:
        L(z) = z^-n L_f(z). Where |L_f| = 1 its phase says how many samples it takes to be at -1. From there
        on the spectral radius of the closed loop is looked at for some fractions of every sample, and the
        first rise above 1 is located by bracketing; it is 0 for an unstable loop. A torque without lag,
        measured just before a sample, is a different one as soon as the delay is a whole sample, and a pole
        can leave the circle at once there.
        """
        from scipy import optimize

        whole = min(
            (one.margin % (2.0 * math.pi) / (one.frequency * self.period)
             for fraction in FRACTIONS[::6] * self.period
             for one in _gain_crossovers(self.broken_delayed(fraction), self.period)),
            default=math.inf,
        )  # fmt: skip
        if not self.stable or self._excess(0.0) > 0.0:
            return 0.0, self._largest_pole(0.0)[1]
        if math.isinf(whole):
            return math.inf, math.nan
        first = max(int(whole) - 1, 0)
        delays = ((np.arange(first, first + 4)[:, None] + FRACTIONS) * self.period).ravel()
        delays[0] = 0.0  # there it is stable for certain
        harmful = next((k for k in range(1, delays.size) if self._excess(delays[k]) > 0.0), None)
        if harmful is None:
            return math.inf, math.nan
        last, least = delays[harmful - 1 : harmful + 1]
        margin = float(optimize.brentq(self._excess, last, least, xtol=1e-13 * least, rtol=1e-14))
        return margin, self._largest_pole(margin)[1]

    def _excess(self, delay: float) -> float:
        """By how much the largest pole is outside of the unit circle with a further dead time."""
        return self._largest_pole(delay)[0] - 1.0 - ROUNDING

    def _largest_pole(self, delay: float) -> tuple[float, float]:
        """Size and frequency in rad/s of the largest pole, but for the rotation, with a further dead time."""
        poles = np.linalg.eigvals(self.closed(delay)[0])
        poles = poles[np.abs(poles - 1.0) > self.rotation]
        pole = complex(poles[np.argmax(np.abs(poles))])
        return abs(pole), abs(cmath.phase(pole)) / self.period

    @cached_property
    def modes(self) -> tuple[Mode, ...]:
        """The poles of the closed loop but for the rotation as a whole, which no torque holds (at 1)."""
        poles = modes(self.closed()[0], self.period)
        return tuple(mode for mode in poles if abs(mode.value - 1.0) > self.rotation)

    @property
    def stable(self) -> bool:
        """Whether all these modes decay."""
        return all(abs(mode.value) < 1.0 - ON_THE_CIRCLE for mode in self.modes)

    @property
    def least_damping(self) -> float:
        """The least damping ratio of these modes."""
        return min((mode.damping_ratio for mode in self.modes), default=math.nan)

    @cached_property
    def rotation(self) -> float:
        """Distance from 1 within which poles are the rotation as a whole."""
        return ROTATION * plant_scales(self.machine).Omega * self.period

    def closed(self, delay: float = 0.0) -> tuple[Matrix, Vector, Matrix]:
        """The closed loop with a further dead time, as `law.closed_loop` has it."""
        return closed_loop(self.start.sampled(self._plant, self.period, delay), self.point.law)

    @cached_property
    def _plant(self) -> Plant:
        inclines = self.point.sample.plant["incline"]
        return contact_plant(self.machine, inclines, share=self.share, gaps_open=self.open)
