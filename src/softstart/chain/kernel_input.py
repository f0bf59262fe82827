"""A chain, its motor and its exciting torques as the kernel's arrays."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from softstart.balancing.periodic_torque import PeriodicTorque
from softstart.chain import kernel_layout as at
from softstart.chain.model import Chain, ChainArrays
from softstart.chain.vibration import natural_vibration
from softstart.errors import InputError
from softstart.plant import layout as plant
from softstart.plant.vector import COUNTS_PER_LINE, LAWS

__all__ = ["Numbers", "elastic_period", "numbers"]

SAME_SPEED = (
    1e-6  # speeds of masses joined rigidly, typed with the digits of a data sheet at their own shafts
)


@dataclass(frozen=True, eq=False)
class Numbers:
    """What the kernel is given: `p` of the motor, `place`, `masses`, `shafts` and `tones`."""

    p: at.Vector
    place: at.Vector
    masses: at.Matrix
    shafts: at.Matrix
    tones: at.Matrix

    @property
    def count(self) -> int:
        """How many masses there are."""
        return int(self.masses.shape[0])

    def scratch(self) -> tuple[at.Vector, at.Vector, at.Matrix, at.Matrix, at.Cube, at.Matrix]:
        """x, m, mass, shaft, series and lines, which the kernel fills."""
        return (
            np.zeros(plant.N_X),
            np.zeros(plant.N_M),
            np.zeros((self.count, at.N_MASS)),
            np.zeros((self.count - 1, at.N_SHAFT)),
            np.zeros((at.N_SERIES, self.count, at.ORDERS)),
            np.zeros((at.N_LINES, at.ORDERS)),
        )


def elastic_period(chain: Chain) -> float:
    """The period of the first natural frequency with all gaps closed, s; 0 where every joint is rigid.

    >>> round(elastic_period(Chain.load("crane-4-mass")), 4)
    0.0548
    """
    if chain.at_motor_shaft().rigid.all():
        return 0.0
    return 2.0 * math.pi / float(natural_vibration(chain).Omega[1])


def numbers(
    chain: Chain,
    excitation: Mapping[str | int, PeriodicTorque] | None,
    time_limit: float | None,
    max_events: int,
) -> Numbers:
    """The arrays of a chain at its motor shaft."""
    arrays = chain.at_motor_shaft()
    _refuse(chain, arrays)
    count = arrays.J.size
    masses = np.zeros((count, at.N_MASSES))
    masses[:, at.J], masses[:, at.GROUND], masses[:, at.MC] = arrays.J, arrays.d_ground, arrays.Mc
    # a reactive load without torque never sticks: it is the same as an active one
    reactive = arrays.reactive & (arrays.Mc > 0.0)
    lossy = arrays.efficiency != 1.0
    masses[:, at.RUBS] = reactive
    masses[arrays.gear[lossy], at.RUBS] = 1.0
    beside = (masses[:, at.RUBS] != 0.0) & ~reactive
    masses[beside, at.ACTIVE], masses[beside, at.MC] = arrays.Mc[beside], 0.0
    masses[:, at.W_0] = arrays.w0
    for k in range(count - 1):
        if _welded(arrays, k):  # one body has one speed, not two that differ by rounding
            masses[k + 1, at.W_0] = masses[k, at.W_0]
    shafts = np.zeros((count - 1, at.N_SHAFTS))
    shafts[:, at.C] = np.where(arrays.rigid, 0.0, arrays.c)
    shafts[:, at.D], shafts[:, at.HALF] = arrays.d, 0.5 * arrays.gap
    shafts[:, at.RIGID] = arrays.rigid
    shafts[:, at.RESTITUTION] = np.nan_to_num(arrays.restitution)
    shafts[:, at.LAW] = [LAWS[law] for law in arrays.law]
    shafts[:, at.THETA_0] = arrays.theta0
    shafts[:, at.ETA], shafts[:, at.GEAR] = arrays.efficiency, arrays.gear - np.arange(count - 1)
    low, high = sorted((arrays.motor, arrays.load))
    at_motor = arrays.motor if arrays.load > arrays.motor or arrays.motor == 0 else arrays.motor - 1
    place = np.array([arrays.motor, arrays.load, low, high, at_motor], dtype=np.float64)
    tones = _tones(chain, arrays, excitation or {}, masses)
    return Numbers(_motor(chain, arrays, time_limit, max_events), place, masses, shafts, tones)


def _welded(arrays: ChainArrays, k: int) -> bool:
    """Whether shaft k joins its masses rigidly, without a gap."""
    return bool(arrays.rigid[k] and arrays.gap[k] == 0.0)


def _refuse(chain: Chain, arrays: ChainArrays) -> None:
    wrong = []
    for k, shaft in enumerate(chain.shafts):
        if shaft.efficiency != 1.0 and arrays.rigid[k]:
            wrong.append(
                f"[shaft] {k + 1}, efficiency = {shaft.efficiency}: the loss of a gear goes with the torque "
                "of a spring, and this shaft is rigid; give it a stiffness, or leave the efficiency out."
            )
        if _welded(arrays, k) and not math.isclose(arrays.w0[k], arrays.w0[k + 1], rel_tol=SAME_SPEED):
            wrong.append(
                f"[shaft] {k + 1}: it is rigid, so the masses it joins start with one speed, and they have "
                f"{arrays.w0[k]:.12g} and {arrays.w0[k + 1]:.12g} rad/s at the motor shaft; give both the "
                "same initial_speed, divided by the ratio."
            )
    if wrong:
        raise InputError(wrong)


def _motor(chain: Chain, arrays: ChainArrays, time_limit: float | None, max_events: int) -> at.Vector:
    """The vector p of the two-mass plant, as far as motor, encoder and controller go."""
    p = np.zeros(plant.N_P)
    period = elastic_period(chain)
    p[plant.PERIOD] = period
    p[plant.EVENT_CAP] = max_events
    p[plant.RATE] = math.inf
    p[plant.TARGET] = math.inf if chain.target_speed is None else chain.target_speed
    p[plant.TIME_LIMIT] = math.inf if time_limit is None else time_limit
    motor = chain.motor
    if motor is None:
        return p
    p[plant.RATE] = motor.torque_rate
    p[plant.U_MIN], p[plant.U_MAX] = motor.minimum_torque, motor.maximum_torque
    if motor.encoder_lines > 0.0:
        p[plant.ENCODER] = 2.0 * math.pi / (COUNTS_PER_LINE * motor.encoder_lines)
    p[plant.ENCODER_PHASE] = motor.encoder_phase
    p[plant.TORQUE_NOISE], p[plant.NOISE_SEED] = motor.torque_noise, motor.noise_seed
    p[plant.DEAD_TIME] = motor.computing_delay
    p[plant.LAG] = motor.torque_lag if motor.torque_lag > 1e-12 * period else 0.0
    if time_limit is None:
        heavier = 1.0 / arrays.efficiency_from_motor
        left = motor.starting_torque - float((arrays.Mc * heavier).sum())
        speeds = p[plant.TARGET] + float(np.abs(arrays.w0).sum())
        if left > 0.0:
            p[plant.TIME_LIMIT] = 100.0 * (float((arrays.J * heavier).sum()) * speeds / left + period)
    return p


def _tones(
    chain: Chain, arrays: ChainArrays, excitation: Mapping[str | int, PeriodicTorque], masses: at.Matrix
) -> at.Matrix:
    """The harmonics of all exciting torques at the motor shaft; their means go into `masses`."""
    rows = []
    for name, torque in excitation.items():
        i = chain.index(name)
        brought = arrays.speed_ratio[i]
        masses[i, at.MEAN] += brought * torque.mean
        for omega, cosine, sine in zip(torque.frequencies, torque.cosine, torque.sine, strict=True):
            rows.append((i, omega, brought * cosine, brought * sine))
    return np.array(rows, dtype=np.float64).reshape(-1, at.N_TONES)
