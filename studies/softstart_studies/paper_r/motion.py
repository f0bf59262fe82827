"""Free and forced motion of a chain with elastic gaps, by Taylor series: what the findings of [R] stand on.

Twists and speeds obey a linear equation between two changes of contact, so their Taylor coefficients follow
from one another, and twenty of them over half a radian of the highest frequency leave nothing but rounding. A
contact begins where a twist reaches its flank with a pressing torque and ends where the torque is gone
(no-pull); both are bisected on the series. Energy is kept to 1e-13 over hundreds of contacts.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numba
import numpy as np

from softstart.arrays import Vector
from softstart.chain import Chain
from softstart_studies.paper_r.last_bits import natural_vibration

__all__ = ["Motion", "moved", "released"]


_compiled: Any = numba.njit(cache=True, error_model="numpy")
ORDER, LOOKS = 20, 6


@dataclass(frozen=True, eq=False)
class Motion:
    """Instants (evenly spaced, s), speeds of masses, twists and torques of shafts, at the motor shaft."""

    t: Vector
    w: Vector
    twist: Vector
    torque: Vector

    @property
    def angles(self) -> Vector:
        """Angles of the masses about their common mean motion, by summing the twists (rows: instants)."""
        relative = np.concatenate([np.zeros((self.t.size, 1)), -np.cumsum(self.twist, axis=1)], axis=1)
        return relative

    def about_the_mean(self, J: Vector) -> Vector:
        """Angles without the rigid motion: their mean, weighted with the inertias, is 0."""
        angles = self.angles
        return np.asarray(angles - (angles @ J / J.sum())[:, None])


def moved(
    chain: Chain,
    twist: Vector,
    until: float,
    sample: float,
    *,
    torque: Vector | None = None,
    harmonic: Vector | None = None,
    frequency: float = 0.0,
    damped: bool = False,
) -> Motion:
    """The chain let go from rest with these twists (rad), under constant torques and `harmonic` cos(w t).

    Torques are N m on each mass, at the motor shaft.
    """
    arrays = chain.at_motor_shaft()
    n = arrays.J.size
    zero = np.zeros(n)
    d = arrays.d if damped else np.zeros(n - 1)
    highest = float(natural_vibration(chain).Omega[-1])
    count = round(until / sample) + 1
    w, z, T = _run(
        arrays.J, arrays.c, d, 0.5 * arrays.gap, np.asarray(twist, np.float64),
        zero if torque is None else torque, zero if harmonic is None else harmonic, frequency,
        0.5 / max(highest, frequency), sample, count,
    )  # fmt: skip
    return Motion(sample * np.arange(float(count)), w, z, T)


def released(chain: Chain, torques: Vector) -> Vector:
    """The twists at which the shafts carry these torques: spring and half of the gap."""
    arrays = chain.at_motor_shaft()
    return np.asarray(torques / arrays.c + 0.5 * arrays.gap * np.sign(torques))


@_compiled
def _series(
    z: Vector, w: Vector, side: Vector, J: Vector, c: Vector, d: Vector, half: Vector, F: Vector, A: Vector,
    frequency: float, phase: float, zs: Vector, ws: Vector,
) -> None:  # fmt: skip
    """Taylor coefficients of twists and speeds at one instant."""
    n = J.size
    zs[0], ws[0] = z, w
    wave_c, wave_s = math.cos(phase), math.sin(phase)  # coefficients of cos(phase + w s)
    for k in range(ORDER):
        drive = wave_c if k % 4 == 0 else (-wave_s if k % 4 == 1 else (-wave_c if k % 4 == 2 else wave_s))
        for j in range(k):
            drive *= frequency / (j + 1)
        before = 0.0
        for i in range(n):
            behind = 0.0
            if i < n - 1 and side[i] != 0.0:
                behind = c[i] * zs[k, i] + d[i] * (ws[k, i] - ws[k, i + 1])
                if k == 0:
                    behind -= side[i] * c[i] * half[i]
            ws[k + 1, i] = (before - behind + A[i] * drive + (F[i] if k == 0 else 0.0)) / J[i] / (k + 1)
            before = behind
        for i in range(n - 1):
            zs[k + 1, i] = (ws[k, i] - ws[k, i + 1]) / (k + 1)


@_compiled
def _value(series: Vector, i: int, s: float) -> float:
    total = series[ORDER, i]
    for k in range(ORDER - 1, -1, -1):
        total = total * s + series[k, i]
    return total


@_compiled
def _change(i: int, s: float, side: float, c: float, d: float, half: float, zs: Vector, ws: Vector) -> float:
    """Above 0 when the contact of shaft i is to change at s: its flank pressed, or its torque gone."""
    z = _value(zs, i, s)
    rate = _value(ws, i, s) - _value(ws, i + 1, s) if d > 0.0 else 0.0
    if side != 0.0:
        return -(side * (c * z + d * rate) - c * half)
    best = -math.inf
    for flank in (-1.0, 1.0):
        into = flank * z - half
        best = max(best, min(c * into, c * into + d * flank * rate))
    return best


@_compiled
def _run(
    J: Vector, c: Vector, d: Vector, half: Vector, z0: Vector, F: Vector, A: Vector, frequency: float,
    step: float, sample: float, count: int,
) -> tuple[Vector, Vector, Vector]:  # fmt: skip
    n = J.size
    z, w, side = z0.copy(), np.zeros(n), np.ones(n - 1)
    for i in range(n - 1):
        if half[i] > 0.0:
            side[i] = 0.0 if abs(z[i]) <= half[i] else math.copysign(1.0, z[i])
    zs, ws = np.zeros((ORDER + 1, n - 1)), np.zeros((ORDER + 1, n))
    found_w, found_z, found_T = np.empty((count, n)), np.empty((count, n - 1)), np.empty((count, n - 1))
    t, index = 0.0, 0
    while index < count:
        _series(z, w, side, J, c, d, half, F, A, frequency, frequency * t, zs, ws)
        ends, which = step, -1
        for i in range(n - 1):
            if half[i] <= 0.0:
                continue
            low = 0.0
            for look in range(1, LOOKS + 1):
                high = step * look / LOOKS
                high = min(high, ends)
                if _change(i, high, side[i], c[i], d[i], half[i], zs, ws) > 0.0:
                    while high - low > 1e-16 * step:
                        middle = 0.5 * (low + high)
                        if middle <= low or middle >= high:
                            break
                        if _change(i, middle, side[i], c[i], d[i], half[i], zs, ws) > 0.0:
                            high = middle
                        else:
                            low = middle
                    ends, which = high, i
                    break
                low = high
                if low >= ends:
                    break
        while index < count and index * sample <= t + ends:
            s = index * sample - t
            for i in range(n):
                found_w[index, i] = _value(ws, i, s)
            for i in range(n - 1):
                found_z[index, i] = _value(zs, i, s)
                rate = found_w[index, i] - found_w[index, i + 1]
                pressed = found_z[index, i] - (side[i] * half[i] if half[i] > 0.0 else 0.0)
                found_T[index, i] = (c[i] * pressed + d[i] * rate) if side[i] != 0.0 else 0.0
            index += 1
        for i in range(n - 1):
            z[i] = _value(zs, i, ends)
        for i in range(n):
            w[i] = _value(ws, i, ends)
        t += ends
        if which >= 0:
            side[which] = 0.0 if side[which] != 0.0 else math.copysign(1.0, z[which])
    return found_w, found_z, found_T
