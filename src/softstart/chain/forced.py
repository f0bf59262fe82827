"""Forced vibration with gaps, with and without a constant torque that locks them [R]."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from numbers import Real
from typing import TYPE_CHECKING, Any

import numpy as np

from softstart.arrays import Vector
from softstart.balancing.periodic_torque import PeriodicTorque
from softstart.chain.arrays import ChainArrays
from softstart.chain.model import Chain, Mass, Shaft
from softstart.chain.simulation import simulate_chain
from softstart.errors import InputError
from softstart.quantities import Value

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["ForcedResponse", "forced_response"]


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

    def summary(self) -> dict[str, Any]:
        """All of it as plain data."""
        return {
            "chain": self.chain.name,
            "assumed": self.chain.assumed,
            "masses": [mass.name for mass in self.chain.masses],
            "locking": self.locking,
            "frequency": self.frequency.tolist(),
            "amplitude": self.amplitude.tolist(),
            "torque": self.torque.tolist(),
            "without_gaps": self.without_gaps.tolist(),
            "torque_without_gaps": self.torque_without_gaps.tolist(),
            "spread": self.spread.tolist(),
        }

    def plot(self, mass: str | int = 0) -> Figure:
        """The amplitude of one mass against the frequency, with gaps and without."""
        from softstart.views.drawing import COLOURS, drawing, new_figure

        index = self.chain.index(mass)
        with drawing():
            figure, axes = new_figure(size=(6.5, 4.0))
            with_gaps = f"with gaps, {self.locking:g} N m constant"
            axes.plot(self.frequency, self.amplitude[:, index], "o-", color=COLOURS[0], label=with_gaps)
            axes.plot(self.frequency, self.without_gaps[:, index], "--", color=COLOURS[1], label="no gaps")
            axes.set_xlabel("frequency of the exciting torque, rad/s")
            axes.set_ylabel("amplitude, rad")
            axes.set_title(f"{self.chain.name}: forced response of {self.chain.masses[index].name}")
            axes.legend()
        drawn: Figure = figure
        return drawn


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
    masses = [
        Mass(float(J), damping=float(d), initial_speed=float(v))
        for J, d, v in zip(arrays.J, arrays.d_ground, speed, strict=True)
    ]
    shafts = [
        Shaft(float(c), damping=float(d), gap=float(gap), contact_law=law, start_position=float(at))
        for c, d, gap, law, at in zip(arrays.c, arrays.d, arrays.gap, arrays.law, begin, strict=True)
    ]
    mean = np.zeros(arrays.J.size)
    mean[arrays.motor] += locking
    mean[arrays.load] -= locking
    one, none = np.ones(1), np.zeros(1)
    acting: dict[str | int, PeriodicTorque] = {
        index: PeriodicTorque(float(mean[index]), one, size * one, none, w)
        for index, size in enumerate(force)
        if size or mean[index]
    }
    period = 2.0 * math.pi / w
    first = math.ceil(settle / period)
    end = (first + PERIODS) * period
    run = simulate_chain(Chain(masses, shafts), None, end, excitation=acting)
    t = np.linspace(first * period, end, PERIODS * SAMPLES, endpoint=False)
    found = run.at(t)
    angle = np.concatenate([np.zeros((t.size, 1)), -np.cumsum(found["twist"], axis=1)], axis=1)
    swing = _about_mean(arrays, angle)
    halves = np.array([_height(part) for part in np.split(swing, 2)])
    spread = float(np.abs(halves[1] - halves[0]).max() / halves.max())
    without_gaps: Vector = np.abs(_about_mean(arrays, linear[None, :])[0])
    torque: Vector = np.abs(law * (linear[:-1] - linear[1:]))
    return _height(swing), _height(found["T"]), without_gaps, torque, spread


def _about_mean(arrays: ChainArrays, angle: Any) -> Any:
    """Angles without the motion of the whole: their mean, weighted with the inertias, is 0."""
    return angle - (angle @ arrays.J / arrays.J.sum())[:, None]


def _height(rows: Vector) -> Vector:
    found: Vector = np.sqrt(2.0 * np.mean((rows - rows.mean(axis=0)) ** 2, axis=0))
    return found
