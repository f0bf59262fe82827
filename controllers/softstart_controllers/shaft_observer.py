"""Shaft torque from motor angle and motor torque alone: a stationary Kalman filter in closed form.

Under a constant T'' one sample, h long, makes of x = (phi1, h w1, h^2 T/J1, h^3 T'/J1), but for the torque,
A x + G h^4 T''/J1 with

    A = 1  1 -1/2 -1/6       G = -1/24       and phi1 is measured, in units of the encoder's deviation.
           1   -1 -1/2           -1/6
                1    1            1/2
                     1            1

In these scales the filter is the same for every drive with the same variance q of h^4 T''/J1. With
w = (z - 1)(1/z - 1) its spectral factorisation, 1 + q H(z) H(1/z) with H = C (z - A)^-1 G, has the zeros

    w^4 + q (4 - w)(12 - w)^2/576 = 0

and those inside the unit circle are the poles of the filter.
"""

from __future__ import annotations

import cmath
import math
from functools import cache
from typing import NamedTuple

import numpy as np
from numba import njit

from softstart.controller.compiled import record
from softstart.drive import Drive
from softstart.kernel.motor import encoder_count

SMALLEST_INDEX = -18.0  # decades
FASTEST = (
    6.0  # bandwidth of the observer in elastic frequencies; faster it would only learn the torque's ripple
)
DECADES = 0.05  # designs are shared between drives whose index differs by less


class Gains:
    """By which the estimate is corrected: of phi1, 1; w1, 1/s; T, N m/rad; T', N m/(rad s)."""

    angle: float
    speed: float
    torque: float
    rate: float


GAINS = record(Gains)


class Design(NamedTuple):
    """Gains without units, standard deviation of T in encoder units, lag of T' in samples."""

    angle: float
    speed: float
    torque: float
    rate: float
    torque_deviation: float
    rate_lag: float


class Observer(NamedTuple):
    """The gains by name, and what the design promises, in SI units."""

    gains: dict[str, float]
    torque_deviation: float  # N m, standard deviation of the error of T
    rate_lag: float  # s, lag of T' behind a T' that changes unforeseen


@cache
def design(steps: int) -> Design:
    """The stationary Kalman filter for the index steps*DECADES, the decimal logarithm of q.

    The gains K correct x after the sample; A K places the poles. Row by row the covariance after the sample
    follows from K and from P = A (P - s K K') A' + q G G' with s = 1/(1 - K[0]), the variance of what is new
    in a measurement; so does the error that stays under a T'' of 1 that never ends, the lag of T'.

    >>> [round(number, 4) for number in design(-150)]
    [0.2605, 0.0392, -0.0035, -0.0002, 0.011, 22.1507]
    """
    q = 10.0 ** (steps * DECADES)
    r = q**0.25
    poles = []
    for w in r * np.roots([576.0, -(r**3), 28.0 * r**2, -240.0 * r, 576.0]):
        # z - 1 and 1/z - 1, whose product is w
        root = cmath.sqrt(w * w - 4.0 * w)
        larger = -0.5 * (w + root if abs(w + root) > abs(w - root) else w - root)
        poles.append(larger if abs(1.0 + larger) < 1.0 else w / larger)
    _, a3, a2, a1, a0 = np.poly(poles).real.tolist()
    L3, L2 = -a0, a0 - a1
    K3, K2 = L3, L2 - L3
    K1 = a2 + 0.5 * L2 + L3 / 6.0 + K2 + 0.5 * K3
    K0 = a3 - K1 + 0.5 * K2 + K3 / 6.0
    s = 1.0 / (1.0 - K0)
    P33 = s * K2 * K3 - q / 2.0
    P23 = -s * K1 * K3 - q / 6.0 - P33 / 2.0
    P13 = s * K0 * K3 + q / 24.0 + P23 / 2.0 + P33 / 6.0
    P22 = -s * K1 * K2 - q / 12.0 + P13 - 1.5 * P23 - 0.5 * P33
    return Design(K0, K1, K2, K3, math.sqrt(P22), K2 / K3 - 0.5)


def observer(drive: Drive, period: float, uncertainty: float) -> Observer:
    """The observer of a drive.

    The model is J1 w1' = u - T with T'' = model + noise: `uncertainty` Omega^2 Ms is the part of T'' that
    the model misses, changing at random within 1/Omega, so of spectral density
    S = (uncertainty Omega^2 Ms)^2/Omega. The encoder's rounding is taken as noise of variance q^2/12 in each
    sample, R = h q^2/12. The bandwidth is near (S/(J1^2 R))^(1/8); with a fine encoder R is taken as large as
    keeps it at 6 Omega. Nothing about the gap enters.

    >>> crane = observer(Drive.load("crane-4amtkf"), 0.001, 0.05)
    >>> round(crane.gains["angle"], 2), round(crane.rate_lag, 4), 0.5 < crane.torque_deviation < 1.5
    (0.66, 0.0059, True)
    """
    h, Omega, unit = period, drive.Omega, drive.J1 / period**2
    deviation = encoder_count(drive.encoder_lines) / math.sqrt(12.0)
    noise = uncertainty * Omega**2 * drive.Ms / math.sqrt(Omega * h) * h**4 / drive.J1
    slowest = 10.0 ** (0.5 * SMALLEST_INDEX)
    fastest = max((FASTEST * Omega * h) ** 4, slowest)
    index = 2.0 * math.log10(noise / min(max(deviation, noise / fastest), noise / slowest))
    of = design(round(index / DECADES))
    return Observer(
        {"angle": of.angle, "speed": of.speed / h, "torque": of.torque * unit, "rate": of.rate * unit / h},
        of.torque_deviation * unit * deviation,
        of.rate_lag * h,
    )


@njit(cache=True, nogil=True, error_model="numpy")
def predict(
    angle: float, speed: float, torque: float, rate: float, motor_torque: float, J1: float, h: float
) -> tuple[float, float, float, float]:
    """phi1, w1, T and T' one sample on, under a constant motor torque and a constant T'.

    >>> predict(0.0, 0.0, 0.0, 0.0, 2.0, 1.0, 0.5)
    (0.25, 1.0, 0.0, 0.0)
    """
    a = (motor_torque - torque) / J1
    jerk = rate / J1
    return (
        angle + h * (speed + h * (a / 2.0 - h * jerk / 6.0)),
        speed + h * (a - h * jerk / 2.0),
        torque + h * rate,
        rate,
    )
