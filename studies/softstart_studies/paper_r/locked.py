"""Finding 5 of [R]: a constant torque that locks the gaps, in free vibration and in forced response."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from softstart.arrays import Vector
from softstart.chain import Chain
from softstart.study import Table
from softstart_studies.paper_r.free import SAMPLES, analysed, scale_gaps, tractor
from softstart_studies.paper_r.last_bits import natural_vibration
from softstart_studies.paper_r.motion import moved, released

__all__ = ["Locked", "forced", "forced_table", "locked", "locked_table"]


NOSE = 1.0  # deg at the crank nose, gap-free
TORQUES = (0.0, 50.0, 100.0, 150.0, 200.0, 225.0, 250.0, 300.0, 540.0)  # N m at the crank
CYCLES = 40
FREQUENCIES = np.concatenate([np.arange(30.0, 62.0, 4.0), np.arange(62.0, 76.0, 2.0), [80.0, 90.0]])  # rad/s
SETTLE, WINDOW = 2.2, 0.8  # s


class Locked(NamedTuple):
    """A free vibration about a constant torque: it in N m, w/Omega, and how many gaps ever open."""

    torque: float
    frequency: float
    open_gaps: int


@lru_cache(maxsize=32)
def locked(torque: float) -> Locked:
    """Engine and track pull against each other with `torque`; the first mode is let go on top of it."""
    chain = tractor()
    vibration, arrays = natural_vibration(chain), chain.at_motor_shaft()
    alternating = vibration.torque[1] / vibration.shape[1, 0] * np.radians(NOSE)
    if alternating[arrays.motor] < 0.0:
        alternating = -alternating
    constant = _through(chain, torque)
    pull = np.zeros(arrays.J.size)
    pull[arrays.motor], pull[arrays.load] = torque, -torque
    sample = 2.0 * np.pi / float(vibration.Omega[1]) / SAMPLES
    motion = moved(
        chain, released(chain, constant + alternating), CYCLES * SAMPLES * sample, sample, torque=pull
    )
    opened = (np.abs(motion.torque[:, arrays.gap > 0.0]).min(axis=0) == 0.0).sum()
    return Locked(torque, analysed(chain, motion).Omega / float(vibration.Omega[1]), int(opened))


def _through(chain: Chain, torque: float) -> Vector:
    """Shaft torques under a constant torque from the motor to the load."""
    arrays = chain.at_motor_shaft()
    constant = np.zeros(arrays.c.size)
    constant[arrays.motor : arrays.load] = torque
    return constant


def locked_table() -> Table:
    """Frequency over the constant torque."""
    chain = tractor()
    vibration = natural_vibration(chain)
    largest = float(np.abs(vibration.torque[1]).max() / abs(vibration.shape[1, 0]) * np.radians(NOSE))
    rows = [
        (one.torque, round(one.torque / largest, 3), round(one.frequency, 4), one.open_gaps)
        for one in map(locked, TORQUES)
    ]
    return Table(
        "Free vibration about a constant torque (assumed chain), 1 deg at the crank nose without gaps",
        ("constant torque, N m", "over the largest alternating torque", "w/Omega", "gaps that open, of 6"),
        rows,
    )


@lru_cache(maxsize=4)
def forced(gaps: float, torque: float) -> tuple[float, ...]:
    """Amplitude at the crank nose in deg under a harmonic torque on the cylinders, at FREQUENCIES.

    The harmonic torque is the one that gives 1 deg at the resonance without gaps. Damping as in the file.
    """
    chain = scale_gaps(tractor(), gaps)
    return tuple(_amplitude(chain, float(w), torque, _drive()) for w in FREQUENCIES)


@lru_cache(maxsize=1)
def _drive() -> float:
    free_of_gaps = scale_gaps(tractor(), 0.0)
    w = float(natural_vibration(free_of_gaps).Omega[1])
    return NOSE / _amplitude(free_of_gaps, w, 0.0, 1.0)


def _amplitude(chain: Chain, w: float, torque: float, size: float) -> float:
    arrays = chain.at_motor_shaft()
    cylinders = np.array([mass.name.startswith("cylinder") for mass in chain.masses])
    harmonic = np.where(cylinders, size / cylinders.sum(), 0.0)
    pull = np.zeros(arrays.J.size)
    pull[arrays.motor], pull[arrays.load] = torque, -torque
    start = released(chain, _through(chain, torque))
    sample = 2.0 * np.pi / w / 32
    motion = moved(
        chain, start, SETTLE + WINDOW, sample, torque=pull, harmonic=harmonic, frequency=w, damped=True
    )
    nose = motion.about_the_mean(arrays.J)[motion.t >= SETTLE, 0]
    whole = nose[: 32 * (nose.size // 32)]  # whole periods
    return float(np.degrees(np.sqrt(2.0 * np.mean((whole - whole.mean()) ** 2))))


def forced_table() -> Table:
    """Amplitudes over the frequency: no gaps, all gaps, all gaps locked."""
    columns = [forced(0.0, 0.0), forced(1.0, 0.0), forced(1.0, 540.0)]
    rows = [(float(w), *(round(column[i], 4) for column in columns)) for i, w in enumerate(FREQUENCIES)]
    return Table(
        "Forced response (assumed chain): amplitude at the crank nose, deg",
        ("w, rad/s", "no gaps", "gaps, no constant torque", "gaps, 540 N m constant"),
        rows,
    )
