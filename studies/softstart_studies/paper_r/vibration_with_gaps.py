"""Vibration with gaps, free and forced, by exact simulation.

Free: the frequency falls with the amplitude (the backbone curve). Forced: the steady vibration under harmonic
torques, with and without a constant torque that locks the gaps [R].
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from scipy import optimize

from softstart.arrays import Vector
from softstart.chain.arrays import ChainArrays
from softstart.chain.elements import Mass, Shaft
from softstart.chain.model import Chain
from softstart.chain.periodic_torque import PeriodicTorque
from softstart.drive.checks import elastic_frequency
from softstart.errors import InputError
from softstart.quantities import Value
from softstart.start.simulation import simulate
from softstart.vibration import reduce_chain
from softstart_studies.paper_r.last_bits import natural_vibration


class Motion(NamedTuple):
    """Instants in s; there angles about the common mean motion, speeds, twists, torques of the shafts."""

    t: Vector
    angle: Vector
    w: Vector
    twist: Vector
    torque: Vector


def twists(arrays: ChainArrays, torque: Vector) -> Vector:
    """The twists at which the shafts carry these torques: spring and half of the gap."""
    found: Vector = torque / arrays.c + 0.5 * arrays.gap * np.sign(torque)
    return found


def let_go(
    arrays: ChainArrays, twist: Vector, t: Vector, *, speed: Vector | None = None,
    acting: Mapping[str | int, PeriodicTorque] | None = None, damped: bool = False,
) -> Motion:  # fmt: skip
    """The exact motion at the motor shaft from these twists (rad) and speeds, at rest by default.

    Load torques, friction and losses are left out, damping as well unless it is asked for. InputError for a
    chain with a rigid shaft or a mass that is held.
    """
    if arrays.rigid.any() or arrays.held is not None:
        raise InputError("chain: a vibration with gaps needs a spring in every shaft, and no ground.")
    speed = np.zeros(arrays.J.size) if speed is None else speed
    d, d_ground = (one if damped else 0.0 * one for one in (arrays.d, arrays.d_ground))
    masses = [
        Mass(float(J), damping=float(b), initial_speed=float(v))
        for J, b, v in zip(arrays.J, d_ground, speed, strict=True)
    ]
    shafts = [
        Shaft(float(c), damping=float(b), gap=float(gap), contact_law=law, start_position=float(z))
        for c, b, gap, law, z in zip(arrays.c, d, arrays.gap, arrays.law, twist, strict=True)
    ]
    found = simulate(Chain(masses, shafts), None, float(t[-1]), excitation=acting).at(t)
    angle = about_mean(arrays, found["phi"] - found["phi"][:, :1])
    return Motion(t, angle, found["w"], found["twist"], found["torques"])


def harmonic(mean: Vector, size: Vector, w: float) -> dict[str | int, PeriodicTorque]:
    """Constant torques and sizes of cosines in N m, one a mass, as torques that act on the masses."""
    one, none = np.ones(1), np.zeros(1)
    return {
        index: PeriodicTorque(float(mean[index]), one, size[index] * one, none, w)
        for index in np.flatnonzero((mean != 0.0) | (size != 0.0)).tolist()
    }


def about_mean(arrays: ChainArrays, angle: Any) -> Any:
    """Angles without the motion of the whole: their mean, weighted with the inertias, is 0."""
    return angle - (angle @ arrays.J / arrays.J.sum())[:, None]


def windowed(signal: Vector) -> Vector:
    """A signal without its mean, under a Hann window of mean 1 over its length."""
    window = np.hanning(signal.shape[0])
    found: Vector = (signal - signal.mean()) * window / window.sum()
    return found


def lines(signal: Vector, t: Vector, w: Any) -> Any:
    """The spectral lines of a signal at the frequencies w in rad/s."""
    return np.exp(-1j * np.outer(w, t)) @ signal


def main_line(motion: Motion, arrays: ChainArrays, shape: Vector, Omega: float, mode: int = 1) -> float:
    """The strongest line of the motion along the gap-free shape of a mode, rad/s, under a Hann window."""
    t, signal = motion.t, windowed(motion.angle @ (arrays.J * shape))
    step = 0.5 * math.pi / float(t[-1])
    lowest = 0.1 if mode == 1 else 0.5  # below lie the lines of lower modes
    places = np.arange(max(lowest * Omega, 4.0 * step), 1.15 * Omega, step)
    best = float(places[int(np.argmax(np.abs(lines(signal, t, places))))])
    refined = optimize.minimize_scalar(
        lambda w: -float(np.abs(lines(signal, t, w)[0])),
        bounds=(best - step, best + step),
        method="bounded",
        options={"xatol": 1e-7 * best},
    )
    return float(refined.x)


def backbone(J1: float, J2: float, c: float, gap: float, amplitude: Value) -> Value:
    """Frequency in rad/s of the free vibration of two masses without drive torque, exact.

    `amplitude` is the largest shaft torque over c, the largest twist of the spring in rad. The masses swing
    through the gap with the relative speed `v = Omega amplitude`, and half a sine on each side:

        T = 2 pi/Omega + 2 gap/v                                                          [R]

    so `w/Omega = 1/(1 + gap/(pi amplitude))`: half of Omega where the amplitude is gap/pi, none at rest.

    >>> float(backbone(1.0, 1.0, 2.0, 0.0, 0.1))
    2.0
    >>> round(float(backbone(1.0, 1.0, 2.0, 0.1, 0.1 / math.pi)), 12)
    1.0
    """
    amplitudes: Vector = np.asarray(amplitude, np.float64)
    if not np.all(amplitudes > 0.0):
        raise InputError("amplitude: the largest twist of the spring must be above 0.")
    Omega: Vector = elastic_frequency(J1, J2, c)
    return Omega / (1.0 + gap / (math.pi * amplitudes))


class Backbone(NamedTuple):
    """Frequency against amplitude of the free vibration of a chain with its gaps, at the motor shaft, in SI.

    `torque` is the largest shaft torque with which the vibration is released, N m. `frequency` is that of the
    motion along the gap-free shape, rad/s, by simulation; `two_masses` that of the two masses of the modal
    reduction, by the exact formula of `backbone`; `Omega` the gap-free frequency of the first mode.
    """

    Omega: float
    torque: Vector
    frequency: Vector
    two_masses: Vector


def chain_backbone(chain: Chain, torque: Value, periods: int = 60) -> Backbone:
    """The free vibration of the chain with its gaps, released from rest with the shaft torques of mode 1.

    `torque` holds the largest shaft torques (N m at the motor shaft), in the ratio of the gap-free mode among
    the shafts. The chain is simulated exactly, without damping, friction, load and motor torque, for so many
    gap-free periods. The frequency is the strongest line of the motion along the gap-free shape, under a Hann
    window: for a motion that is not periodic it is known to about one over the length of the run.

    >>> found = chain_backbone(Chain([Mass(1), Mass(1)], [Shaft(2, gap=0.1)]), 2 * 0.1 / math.pi)
    >>> round(float(found.frequency[0]), 4), round(float(found.two_masses[0]), 4)
    (1.0, 1.0)
    """
    arrays, vibration = chain.at_motor_shaft(), natural_vibration(chain)
    torques: Vector = np.atleast_1d(np.asarray(torque, np.float64))
    share = vibration.torque[1] / np.abs(vibration.torque[1]).max()
    Omega = float(vibration.Omega[1])
    t = np.linspace(0.0, periods * 2.0 * math.pi / Omega, 64 * periods + 1)
    motions = (let_go(arrays, twists(arrays, size * share), t) for size in torques)
    found = [main_line(one, arrays, vibration.shape[1], Omega) for one in motions]
    reduced = reduce_chain(chain, force=True)
    two = np.asarray(backbone(reduced.J1, reduced.J2, reduced.c, reduced.gap, torques / reduced.c))
    return Backbone(Omega, torques, np.array(found), two)


PERIODS = 20  # over which an amplitude is measured
SAMPLES = 64  # a period
DECAY = math.log(1e4)  # by so much the slowest transient has fallen before


class ForcedResponse(NamedTuple):
    """Steady vibration under harmonic torques, at the motor shaft, in SI; a row for each frequency.

    `amplitude` is that of the angle of each mass about their common mean motion (sqrt(2) times the root of
    the mean square, so that of a sine is its height), `without_gaps` that of the chain without gaps, by the
    linear equations. `spread` is the largest change of an amplitude from the first to the second half of what
    was measured, as a share of the largest one: a motion with gaps need not be periodic.
    """

    frequency: Vector
    amplitude: Vector
    without_gaps: Vector
    spread: Vector


def forced_response(
    chain: Chain,
    frequency: Value,
    excitation: Mapping[str | int, float],
    *,
    locking: float = 0.0,
    from_rest: bool = False,
    settle: float | None = None,
) -> ForcedResponse:
    """The steady vibration of a chain with its gaps under torques that swing in step, by exact simulation.

    `excitation` holds the amplitudes in N m by the names (or indices) of the masses on which the torques act,
    each at its own shaft; `frequency` in rad/s. `locking` is a constant torque, N m at the motor shaft, with
    which motor and load pull against each other: a gap on the way between them stays closed where it exceeds
    the alternating torque, and with all gaps closed the response is that without gaps [R].

    Damping is that of the chain; load torques, friction and losses of gears are left out. The run begins in
    the steady motion without gaps, on the flanks that are pressed then, or `from_rest` under the constant
    torque alone: with gaps several steady motions may exist at one frequency, and the beginning decides.
    It is measured after `settle` seconds, by default when the slowest transient of the gap-free chain has
    fallen to a ten-thousandth. Raises InputError for a chain that does not settle.

    >>> chain = Chain([Mass(1), Mass(1)], [Shaft(200, damping=2, gap=0.01)])
    >>> free = forced_response(chain, 15.0, {0: 1.0})
    >>> free.amplitude[0].round(5), free.without_gaps[0].round(5)
    (array([0.00914, 0.00914]), array([0.0027, 0.0027]))
    >>> locked = forced_response(chain, 15.0, {0: 1.0}, locking=5.0)
    >>> bool(abs(locked.amplitude / locked.without_gaps - 1.0).max() < 1e-9)
    True
    """
    arrays = chain.at_motor_shaft()
    speeds: Vector = np.atleast_1d(np.asarray(frequency, np.float64))
    force, mean = np.zeros(arrays.J.size), np.zeros(arrays.J.size)
    for name, size in excitation.items():
        force[chain.index(name)] += arrays.speed_ratio[chain.index(name)] * size
    mean[arrays.motor] += locking
    mean[arrays.load] -= locking
    stiffness, damping = _matrices(arrays)
    if settle is None:
        settle = DECAY / _slowest(arrays, stiffness, damping)
    constant = np.zeros(arrays.c.size)
    low, high = sorted((arrays.motor, arrays.load))
    constant[low:high] = locking if arrays.load > arrays.motor else -locking
    rows = []
    for w in speeds.tolist():
        linear = np.linalg.solve(stiffness - w * w * np.diag(arrays.J) + 1j * w * damping, force)
        begins = np.zeros_like(linear) if from_rest else linear
        twist = begins[:-1] - begins[1:]
        flank = np.sign(constant + ((arrays.c + 1j * w * arrays.d) * twist).real)
        begin = constant / arrays.c + twist.real + 0.5 * arrays.gap * flank
        period = 2.0 * math.pi / w
        first = math.ceil(settle / period)
        t = first * period + np.linspace(0.0, PERIODS * period, PERIODS * SAMPLES, endpoint=False)
        acting, speed = harmonic(mean, force, w), (1j * w * begins).real
        swing = let_go(arrays, begin, t, speed=speed, acting=acting, damped=True).angle
        halves = np.array([_height(part) for part in np.split(swing, 2)])
        spread = float(np.abs(halves[1] - halves[0]).max() / halves.max())
        rows.append((_height(swing), np.abs(about_mean(arrays, linear[None, :])[0]), spread))
    return ForcedResponse(speeds, *(np.array(column) for column in zip(*rows, strict=True)))


def _matrices(arrays: ChainArrays) -> tuple[Vector, Vector]:
    """Stiffness and damping of the chain without gaps."""
    differences = np.eye(arrays.J.size)[:-1] - np.eye(arrays.J.size)[1:]
    stiffness = differences.T @ (arrays.c[:, None] * differences)
    damping = differences.T @ (arrays.d[:, None] * differences) + np.diag(arrays.d_ground)
    return stiffness, damping


def _slowest(arrays: ChainArrays, stiffness: Vector, damping: Vector) -> float:
    """The decay of the slowest vibration of the chain without gaps, 1/s; the rigid motion is none."""
    n = arrays.J.size
    upper = np.hstack([np.zeros((n, n)), np.eye(n)])
    system = np.vstack([upper, -np.hstack([stiffness, damping]) / arrays.J[:, None]])
    found = np.linalg.eigvals(system)
    swinging = found[np.abs(found) > 1e-6 * np.abs(found).max()]
    slowest = float(-swinging.real.max())
    if slowest <= 1e-9 * float(np.abs(swinging).max()):
        raise InputError("chain: one of its vibrations has no damping and never settles; give settle in s.")
    return slowest


def _height(rows: Vector) -> Vector:
    found: Vector = np.sqrt(2.0 * np.mean((rows - rows.mean(axis=0)) ** 2, axis=0))
    return found
