"""Describing function of the gap: the shaft as a spring that is softer the less the twist leaves the gap.

For a twist B + A sin(wt) the dead zone of half width h = gap/2 passes on the torque

    T = T0 + n A (c sin wt + d w cos wt) + higher harmonics,     n = n(A, B, h), 0 <= n <= 1

with (dead-zone law: spring and damper act while the flank is touched)

    n = 1 - (f((h - B)/A) + f((h + B)/A))/2,   f(x) = (2/pi)(asin x + x sqrt(1 - x^2)), +-1 beyond +-1
    T0 = c (B - (A/2)(g((h + B)/A) - g((h - B)/A))),   g(x) = (2/pi)(x asin x + sqrt(1 - x^2)), |x| beyond

For B = 0 and A > h this is N(A) = c n = c (1 - (2/pi)(asin(h/A) + (h/A) sqrt(1 - (h/A)^2))), as in M. Nordin
and P.-O. Gutman, Controlling mechanical systems with backlash: a survey, Automatica 38 (2002) 1633-1649,
doi:10.1016/S0005-1098(02)00047-X. For B = 0 it is the sinusoidal, otherwise the dual-input (bias and
sinusoid) describing function (A. Gelb, W. E. Vander Velde, Multiple-Input Describing Functions, 1968).
The functions hold for mean and first harmonic exactly; that the others do not matter is the assumption.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from softstart.drive import Drive

Vector = NDArray[np.float64]


def share(amplitude: float, half_gap: float, bias: float = 0.0) -> float:
    """n: the first harmonic of the shaft torque over that of a shaft without gap, 0 to 1.

    >>> share(1.0, 2.0), share(1.0, 0.0), round(share(2.0, 1.0), 6)
    (0.0, 1.0, 0.391002)
    """
    return 1.0 - 0.5 * (_f((half_gap - bias) / amplitude) + _f((half_gap + bias) / amplitude))


def mean_twist_beyond(amplitude: float, half_gap: float, bias: float) -> float:
    """T0/c in rad: the mean twist of the shaft itself.

    >>> mean_twist_beyond(0.1, 0.5, 1.0), mean_twist_beyond(3.0, 0.5, 0.0)
    (0.5, 0.0)
    """
    above, below = (half_gap + bias) / amplitude, (half_gap - bias) / amplitude
    return bias - 0.5 * amplitude * (_g(above) - _g(below))


def bias_for(mean_torque: float, amplitude: float, half_gap: float, stiffness: float) -> float:
    """The bias B in rad at which the mean shaft torque is `mean_torque`; it grows with it, so it is the one.

    >>> bias_for(0.0, 2.0, 1.0, 5.0), round(bias_for(3.0, 0.1, 1.0, 5.0), 12)
    (0.0, 1.6)
    """
    from scipy.optimize import brentq

    if mean_torque == 0.0:
        return 0.0
    wound = mean_torque / stiffness
    if amplitude <= abs(wound):  # never leaves the flank
        return math.copysign(half_gap, wound) + wound
    reach = half_gap + abs(wound)
    found = brentq(
        lambda bias: mean_twist_beyond(amplitude, half_gap, bias) - wound, -reach, reach,
        xtol=1e-15 * (reach + amplitude), rtol=1e-14,
    )  # fmt: skip
    return float(found)


def _f(x: float) -> float:
    if abs(x) >= 1.0:
        return math.copysign(1.0, x)
    return 2.0 / math.pi * (math.asin(x) + x * math.sqrt(1.0 - x * x))


def _g(x: float) -> float:
    if abs(x) >= 1.0:
        return abs(x)
    return 2.0 / math.pi * (x * math.asin(x) + math.sqrt(1.0 - x * x))


def free_vibration(drive: Drive, amplitudes: Vector) -> tuple[Vector, Vector]:
    """Frequency in rad/s of the unbiased free vibration of two masses through the gap: exact, and by N(A).

    `amplitudes` of the twist, rad, above gap/2. Exact: the masses cross the gap at the speed v and turn round
    in half an elastic period, T = 2 pi/Omega + 2 gap/v, v = Omega (A - gap/2). By the describing function:
    w^2 = N(A) (J1 + J2)/(J1 J2). Undamped, no load torque.

    >>> exact, described = free_vibration(Drive.load("crane-4amtkf"), np.array([0.3, 0.5, 50.0]))
    >>> (described / exact).round(3).tolist()
    [1.18, 1.023, 1.0]
    """
    A = np.asarray(amplitudes, dtype=np.float64)
    gap, Omega = float(drive.gap), float(drive.Omega)
    with np.errstate(divide="ignore"):
        exact = 2.0 * math.pi / (2.0 * math.pi / Omega + 2.0 * gap / (Omega * (A - 0.5 * gap)))
    described = Omega * np.sqrt([share(float(one), 0.5 * gap) for one in A])
    return exact, described
