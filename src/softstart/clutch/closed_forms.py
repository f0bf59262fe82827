"""Closed forms of [C]'s clutch: linear law without load, and laws that leave no oscillation behind.

An undamped shaft without a gap and an active load, as everywhere in [C].
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from softstart.arrays import Vector
from softstart.clutch.model import Clutch

__all__ = ["linear_torque", "pulse_and_pause", "two_steps"]


def linear_torque(clutch: Clutch, t: ArrayLike) -> Vector:
    """T(t) in N m while the clutch slips under the linear law, [C] (4) and (5).

    With kappa = Ic/(IM + Ic) and T0 = Mc IM/(IM + Ic), up to tM

        T = kappa MM/tM (t - sin(B t)/B) + T0 (1 - cos B t)

    and the same law begun at tM with the other sign is added behind it.

    >>> peak = linear_torque(Clutch.load("paper-c"), np.linspace(1.0, 2.0, 100_001)).max()
    >>> round(float(peak) / 9.80665, 6)
    64.657778
    """
    times = np.asarray(t, dtype=np.float64)
    IM, Ic, B, tM = clutch.clutch_inertia, clutch.load_inertia, clutch.B, clutch.engagement_time
    slope = Ic / (IM + Ic) * clutch.clutch_torque / tM

    def ramp(s: Vector) -> Vector:
        return np.where(s > 0.0, s - np.sin(B * s) / B, 0.0)

    swing = clutch.load_torque * IM / (IM + Ic) * (1.0 - np.cos(B * times))
    return np.asarray(slope * (ramp(times) - ramp(times - tM)) + swing)


def pulse_and_pause(clutch: Clutch) -> tuple[list[float], list[float]]:
    """A table (s, N m): full torque, none, full torque, so that the shaft rests at its mean torque Tm from
    then on.

    In the plane of T and T'/B the shaft turns about Tm under full torque, about T0 under none. From (0, 0) on
    the circle with radius Tm about Tm to the circle with radius Tm - T0 about T0, and on that to (Tm, 0).

    >>> [round(t, 4) for t in pulse_and_pause(Clutch.load("paper-c"))[0]]
    [0.0, 0.1302, 0.1302, 0.2754, 0.2754]
    """
    IM, Ic = clutch.clutch_inertia, clutch.load_inertia
    Tm, T0 = clutch.mean_torque, clutch.load_torque * IM / (IM + Ic)
    across = Tm - T0
    # the circles meet where (T - Tm)^2 + y^2 = Tm^2 and (T - T0)^2 + y^2 = across^2
    T = T0 + (2.0 * across**2 - Tm**2) / (2.0 * across)
    first = math.acos((Tm - T) / Tm) / clutch.B
    second = first + math.acos((T - T0) / across) / clutch.B
    MM = clutch.clutch_torque
    return [0.0, first, first, second, second], [MM, MM, 0.0, 0.0, MM]


def two_steps(clutch: Clutch) -> tuple[list[float], list[float]]:
    """A table (s, N m): the torque about which the shaft swings up to Tm in half a period, then full torque.

    The nondecreasing law of two torques that leaves no oscillation, as posicast and zero-vibration shaping
    do.

    >>> times, torques = two_steps(Clutch.load("paper-c"))
    >>> round(times[1], 4), round(torques[0] / 9.80665, 6)
    (0.4056, 28.0)
    """
    IM, Ic = clutch.clutch_inertia, clutch.load_inertia
    half = math.pi / clutch.B
    first = (0.5 * clutch.mean_torque * (IM + Ic) - clutch.load_torque * IM) / Ic
    return [0.0, half, half], [first, first, clutch.clutch_torque]
