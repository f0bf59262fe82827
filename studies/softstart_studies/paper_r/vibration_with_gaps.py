"""Vibration with gaps, free and forced, by exact simulation.

Free: the frequency falls with the amplitude (the backbone curve). Forced: the steady vibration under harmonic
torques, with and without a constant torque that locks the gaps [R].
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from numbers import Real
from typing import Any

import numpy as np
from scipy import optimize

from softstart.arrays import Vector
from softstart.chain.elements import Mass, Shaft
from softstart.chain.model import Chain, ChainArrays
from softstart.chain.periodic_torque import PeriodicTorque
from softstart.drive.checks import elastic_frequency
from softstart.errors import InputError
from softstart.quantities import Value
from softstart.start.simulation import simulate
from softstart.vibration import reduce_chain
from softstart_studies.paper_r.last_bits import natural_vibration


@dataclass(frozen=True, eq=False)
class Motion:
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

    Load torques, friction and losses are left out, damping as well unless it is asked for.
    """
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


@dataclass(frozen=True, eq=False)
class Backbone:
    """Frequency against amplitude of the free vibration of a chain with its gaps, at the motor shaft, in SI.

    `torque` is the largest shaft torque with which the vibration is released, N m. `frequency` is that of the
    motion along the gap-free shape, rad/s, by simulation; `two_masses` that of the two masses of the modal
    reduction, by the exact formula of `backbone`; `Omega` the gap-free frequency of the mode.
    """

    chain: Chain
    mode: int
    Omega: float
    torque: Vector
    frequency: Vector
    two_masses: Vector


HELD = "inertia = inf: vibrations with gaps are those of masses that all move; leave ground out."


def chain_backbone(chain: Chain, torque: Value, mode: int = 1, periods: int = 60) -> Backbone:
    """The free vibration of the chain with its gaps, released from rest with the shaft torques of a mode.

    `torque` holds the largest shaft torques (N m at the motor shaft), in the ratio of the gap-free mode among
    the shafts. The chain is simulated exactly, without damping, friction, load and motor torque, for so many
    gap-free periods. The frequency is the strongest line of the motion along the gap-free shape, under a Hann
    window: for a motion that is not periodic it is known to about one over the length of the run.

    >>> found = chain_backbone(Chain([Mass(1), Mass(1)], [Shaft(2, gap=0.1)]), 2 * 0.1 / math.pi)
    >>> round(float(found.frequency[0]), 4), round(float(found.two_masses[0]), 4)
    (1.0, 1.0)
    """
    vibration = natural_vibration(chain)
    if not 1 <= mode < vibration.Omega.size:
        raise InputError(f"mode = {mode}: the elastic modes are 1 to {vibration.Omega.size - 1}.")
    torques: Vector = np.atleast_1d(np.asarray(torque, np.float64))
    if not (torques.size and np.all(torques > 0.0) and np.all(np.isfinite(torques))):
        raise InputError("torque: the largest shaft torques at release must be above 0 N m.")
    arrays = chain.at_motor_shaft()
    if arrays.rigid.any():
        raise InputError("chain: a free vibration with gaps needs a spring in every shaft; one is rigid.")
    if arrays.held is not None:
        raise InputError(HELD)
    share = vibration.torque[mode] / np.abs(vibration.torque[mode]).max()
    Omega = float(vibration.Omega[mode])
    t = np.linspace(0.0, periods * 2.0 * math.pi / Omega, 64 * periods + 1)
    motions = (let_go(arrays, twists(arrays, size * share), t) for size in torques)
    found = [main_line(one, arrays, vibration.shape[mode], Omega, mode) for one in motions]
    two = np.full(torques.size, math.nan)
    if mode == 1:
        reduced = reduce_chain(chain, force=True)
        two = np.asarray(backbone(reduced.J1, reduced.J2, reduced.c, reduced.gap, torques / reduced.c))
    return Backbone(chain, mode, Omega, torques, np.array(found), two)


PERIODS = 20  # over which an amplitude is measured
SAMPLES = 64  # a period
DECAY = math.log(1e4)  # by so much the slowest transient has fallen before


@dataclass(frozen=True, eq=False)
class ForcedResponse:
    """Steady vibration under harmonic torques, at the motor shaft, in SI; a row for each frequency.

    `amplitude` is that of the angle of each mass about their common mean motion, `torque` that of each shaft
    torque about its mean (sqrt(2) times the root of the mean square, so that of a sine is its height);
    `without_gaps` and `torque_without_gaps` are those of the chain without gaps, by the linear equations.
    `spread` is the largest change of an angle's amplitude from the first to the second half of what was
    measured, as a share of the largest one: a motion with gaps need not be periodic.
    """

    chain: Chain
    locking: float
    frequency: Vector
    amplitude: Vector
    torque: Vector
    without_gaps: Vector
    torque_without_gaps: Vector
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
    wrong = _wrong(arrays, speeds, locking, settle)
    force = np.zeros(arrays.J.size)
    for name, size in excitation.items():
        index = chain.index(name)
        if isinstance(size, bool) or not isinstance(size, Real) or not math.isfinite(size):
            wrong.append(f"excitation of {chain.masses[index].name} = {size!r}: give its amplitude in N m.")
        else:
            force[index] += arrays.speed_ratio[index] * float(size)
    if not force.any() and not any(s.startswith("excitation") for s in wrong):
        wrong.append("excitation: name the masses on which torques act, as {'rotor': 5.0}.")
    if wrong:
        raise InputError(wrong)
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
        rows.append(_steady(arrays, w, force, linear, begins, constant, locking, settle))
    columns = [np.array(column) for column in zip(*rows, strict=True)]
    return ForcedResponse(chain, float(locking), speeds, *columns)


def _wrong(arrays: ChainArrays, speeds: Vector, locking: float, settle: float | None) -> list[str]:
    wrong = []
    if not (speeds.ndim == 1 and speeds.size and np.all(speeds > 0.0) and np.all(np.isfinite(speeds))):
        wrong.append("frequency: give one or more frequencies above 0 rad/s.")
    if not math.isfinite(locking):
        wrong.append(f"locking = {locking}: give a constant torque in N m at the motor shaft.")
    if locking and arrays.motor == arrays.load:
        wrong.append("locking: motor and load are one mass; name another load_mass.")
    if settle is not None and not (math.isfinite(settle) and settle >= 0.0):
        wrong.append(f"settle = {settle}: give the time in s after which the vibration is measured.")
    if arrays.rigid.any():
        wrong.append("chain: a forced vibration with gaps needs a spring in every shaft; one is rigid.")
    if arrays.held is not None:
        wrong.append(HELD)
    if not (arrays.d.any() or arrays.d_ground.any()):
        wrong.append("chain: without damping nothing settles; give a shaft or a mass some.")
    return wrong


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


def _steady(
    arrays: ChainArrays,
    w: float,
    force: Vector,
    linear: Any,
    begins: Any,
    constant: Vector,
    locking: float,
    settle: float,
) -> tuple[Vector, Vector, Vector, Vector, float]:
    """Amplitudes of angles and shaft torques, those without gaps, and how far they still change."""
    law = arrays.c + 1j * w * arrays.d
    twist = begins[:-1] - begins[1:]
    flank = np.sign(constant + (law * twist).real)
    begin = constant / arrays.c + twist.real + 0.5 * arrays.gap * flank
    speed = (1j * w * begins).real
    mean = np.zeros(arrays.J.size)
    mean[arrays.motor] += locking
    mean[arrays.load] -= locking
    period = 2.0 * math.pi / w
    first = math.ceil(settle / period)
    t = first * period + np.linspace(0.0, PERIODS * period, PERIODS * SAMPLES, endpoint=False)
    motion = let_go(arrays, begin, t, speed=speed, acting=harmonic(mean, force, w), damped=True)
    swing = motion.angle
    halves = np.array([_height(part) for part in np.split(swing, 2)])
    spread = float(np.abs(halves[1] - halves[0]).max() / halves.max())
    without_gaps: Vector = np.abs(about_mean(arrays, linear[None, :])[0])
    torque: Vector = np.abs(law * (linear[:-1] - linear[1:]))
    return _height(swing), _height(motion.torque), without_gaps, torque, spread


def _height(rows: Vector) -> Vector:
    found: Vector = np.sqrt(2.0 * np.mean((rows - rows.mean(axis=0)) ** 2, axis=0))
    return found
