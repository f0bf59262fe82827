"""What the shaft carries while the gap is closed and the load is active: [G](7)-(9), (11)-(15).

In the doctests: mean shaft torque 52.86 N m, impact at 30.1027 rad/s, the crane drive of [G] with a gap of
0.5 rad.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from softstart.stages.arguments import Array, Value, checked, plain


def elastic_frequency(J1: ArrayLike, J2: ArrayLike, c: ArrayLike) -> Value:
    """Angular frequency of the closed drive in rad/s: `Omega = sqrt(c (J1 + J2)/(J1 J2))`, [G](8).

    It belongs to `M12''/Omega^2 + M12 = M12avg`, which follows from [G](7). Arguments and errors as in
    `softstart.stages`. Source: [G], page 18.

    >>> round(elastic_frequency(0.035, 0.175, 368.465), 4)
    112.397
    """
    J1, J2, c = checked(J1=J1, J2=J2, c=c)
    return plain(np.sqrt(c / J1 + c / J2))


def mean_shaft_torque(M1: ArrayLike, J1: ArrayLike, J2: ArrayLike, Mc: ArrayLike) -> Value:
    """Torque in N m that drives both masses alike: `M12avg = (M1 J2 + J1 Mc)/(J1 + J2)`, [G](12).

    With `M1 = Ms` it is `M12avg_base` of [G](16). Arguments and errors as in `softstart.stages`.
    Source: [G], page 19.

    >>> round(mean_shaft_torque(62, 0.035, 0.175, 7.16), 6)
    52.86
    """
    M1, J1, J2, Mc = checked(M1=M1, J1=J1, J2=J2, Mc=Mc)
    return plain((M1 * J2 + J1 * Mc) / (J1 + J2))


def shaft_torque(t: ArrayLike, mean: ArrayLike, dw12: ArrayLike, c: ArrayLike, Omega: ArrayLike) -> Value:
    """Shaft torque in N m at time t of the contact stage, active load, [G](11).

    `T = mean (1 - cos Omega t) + (c dw12/Omega) sin Omega t`, until it is back at zero
    (`contact_stage_duration`); later values pull and mean nothing. Arguments and errors as in
    `softstart.stages`. Source: [G], page 19.

    >>> round(shaft_torque(0.01, 52.86, 30.1027, 368.465, 112.397), 2)
    119.01
    """
    t, mean, dw12, c, Omega = checked(t=t, mean=mean, dw12=dw12, c=c, Omega=Omega)
    half = Omega * t / 2  # half angles: 1 - cos would cancel just after contact
    return plain(2 * np.sin(half) * (mean * np.sin(half) + c * dw12 / Omega * np.cos(half)))


def shaft_torque_amplitude(mean: ArrayLike, dw12: ArrayLike, c: ArrayLike, Omega: ArrayLike) -> Value:
    """Amplitude in N m of the swing about the mean: `sqrt(mean^2 + (c dw12/Omega)^2)`, [G](12).

    Arguments and errors as in `softstart.stages`. Source: [G], page 19.

    >>> round(shaft_torque_amplitude(52.86, 30.1027, 368.465, 112.397), 3)
    111.95
    """
    mean, dw12, c, Omega = checked(mean=mean, dw12=dw12, c=c, Omega=Omega)
    return plain(np.hypot(mean, c * dw12 / Omega))


def shaft_torque_phase(mean: ArrayLike, dw12: ArrayLike, c: ArrayLike, Omega: ArrayLike) -> Value:
    """Phase in rad of the swing: `psi = atan(Omega mean/(c dw12))`, [G](12).

    `T = mean + amplitude sin(Omega t - psi)`; `psi = pi/2` where the gap closes without speed. Arguments and
    errors as in `softstart.stages`. Source: [G], page 19.

    >>> round(shaft_torque_phase(52.86, 30.1027, 368.465, 112.397), 4)
    0.4918
    """
    mean, dw12, c, Omega = checked(mean=mean, dw12=dw12, c=c, Omega=Omega)
    return plain(np.arctan2(mean, c * dw12 / Omega))


def peak_shaft_torque(mean: ArrayLike, dw12: ArrayLike, c: ArrayLike, Omega: ArrayLike) -> Value:
    """Peak in N m of the contact stage, active load: `mean (1 + sqrt(1 + (c dw12/(Omega mean))^2))`, [G](13).

    Evaluated as mean plus amplitude, so it holds for `mean <= 0` (motor braking in stage 2) as well.
    Arguments and errors as in `softstart.stages`. Source: [G], page 19.

    >>> round(peak_shaft_torque(52.86, 30.1027, 368.465, 112.397), 3)
    164.81
    """
    mean, dw12, c, Omega = checked(mean=mean, dw12=dw12, c=c, Omega=Omega)
    return plain(peak_of_swing(mean, c * dw12 / Omega))


def time_of_peak(mean: ArrayLike, dw12: ArrayLike, c: ArrayLike, Omega: ArrayLike) -> Value:
    """Time in s from contact to the peak, active load: `(pi/2 + psi)/Omega`, [G](14).

    Arguments and errors as in `softstart.stages`. Source: [G], page 19.

    >>> round(time_of_peak(52.86, 30.1027, 368.465, 112.397), 5)
    0.01835
    """
    mean, dw12, c, Omega = checked(mean=mean, dw12=dw12, c=c, Omega=Omega)
    return plain(angle_to_peak(mean, c * dw12 / Omega) / Omega)


def contact_stage_duration(mean: ArrayLike, dw12: ArrayLike, c: ArrayLike, Omega: ArrayLike) -> Value:
    """Time in s from contact until `T` is back at zero, active load: `(pi + 2 psi)/Omega`, [G](15).

    Arguments and errors as in `softstart.stages`. Source: [G], page 19.

    >>> round(contact_stage_duration(52.86, 30.1027, 368.465, 112.397), 4)
    0.0367
    """
    mean, dw12, c, Omega = checked(mean=mean, dw12=dw12, c=c, Omega=Omega)
    return plain(2 * angle_to_peak(mean, c * dw12 / Omega) / Omega)


def peak_of_swing(mean: Array, impact: Array) -> Array:
    """`mean + sqrt(mean^2 + impact^2)` without cancellation where mean < 0; both in N m.

    >>> f"{peak_of_swing(np.asarray(-4e8), np.asarray(3.0)):.6g}"
    '1.125e-08'
    """
    amplitude = np.hypot(mean, impact)
    denominator = np.where(mean < 0, amplitude - mean, 1.0)
    return np.where(mean < 0, impact * (impact / denominator), mean + amplitude)


def angle_to_peak(mean: Array, impact: Array) -> Array:
    """`pi/2 + psi` in rad, accurate also where psi is near -pi/2 (motor braking hard in stage 2).

    >>> round(float(angle_to_peak(np.asarray(0.0), np.asarray(1.0))), 6)
    1.570796
    """
    return np.arctan2(impact, -mean)
