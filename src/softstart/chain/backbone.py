"""Free vibration of two masses with a gap: the frequency falls with the amplitude (the backbone curve)."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from softstart.drive.reading import elastic_frequency
from softstart.errors import InputError
from softstart.units import Value

__all__ = ["backbone"]


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
    amplitudes: NDArray[np.float64] = np.asarray(amplitude, np.float64)
    if not np.all(amplitudes > 0.0):
        raise InputError("amplitude: the largest twist of the spring must be above 0.")
    Omega = elastic_frequency(J1, J2, c)
    return Omega / (1.0 + gap / (math.pi * amplitudes))
