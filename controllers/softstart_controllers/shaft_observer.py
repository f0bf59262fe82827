"""Shaft torque from motor angle and motor torque alone: an observer whose gains python-control designs."""

from __future__ import annotations

import math
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numba import njit

from softstart.drive import Drive
from softstart.errors import InputError
from softstart.late import late
from softstart.kernel.motor import encoder_count
from softstart_controllers.design_store import kept
from softstart_controllers.sampled import number

if TYPE_CHECKING:
    import control
else:
    control = late("control")

# One sample of x = (phi1, h w1, h^2 T/J1, h^3 T'/J1), without the known torque; h is the sample period.
# In these scales the matrices are the same for every drive.
TRANSITION = (
    (1.0, 1.0, -1 / 2, -1 / 6),
    (0.0, 1.0, -1.0, -1 / 2),
    (0.0, 0.0, 1.0, 1.0),
    (0.0, 0.0, 0.0, 1.0),
)
DISTURBANCE = ((-1 / 24,), (-1 / 6,), (1 / 2,), (1.0,))  # a constant T'' over the sample, in h^4 T''/J1
OUTPUT = ((1.0, 0.0, 0.0, 0.0),)
SMALLEST_INDEX = -18.0  # decades
FASTEST = (
    6.0  # bandwidth of the observer in elastic frequencies; faster it would only learn the torque's ripple
)
DECADES = 0.05  # designs are shared between drives whose index differs by less


class Design(NamedTuple):
    """Gains without units, standard deviations in encoder units, lag of T' in samples."""

    angle: float
    speed: float
    torque: float
    rate: float
    torque_deviation: float
    rate_deviation: float
    rate_lag: float


class Observer(NamedTuple):
    """Gains for `observe`, and what the design promises: SI units, floats or arrays of the drive's shape."""

    angle_gain: Any  # 1
    speed_gain: Any  # 1/s
    torque_gain: Any  # N m/rad
    rate_gain: Any  # N m/(rad s)
    torque_deviation: Any  # N m, standard deviation of the error of T
    rate_deviation: Any  # N m/s, of T'
    rate_lag: Any  # s, lag of T' behind a T' that changes unforeseen


@cache
def design(steps: int) -> Design:
    """The stationary Kalman filter for the index steps*DECADES, by `control.dlqe`.

    The index is the decimal logarithm of (variance of h^4 T''/J1) / (variance of the encoder's rounding).
    `control.dlqe` gives the gain L = A K of the predictor; `observe` corrects with K after the sample.
    """
    return Design._make(kept(str(steps), Path(__file__), lambda: _designed(steps)))


def _designed(steps: int) -> list[float]:
    A, G, C = (np.array(matrix) for matrix in (TRANSITION, DISTURBANCE, OUTPUT))
    try:
        L, P, _ = control.dlqe(A, G, C, np.array([[10.0 ** (steps * DECADES)]]), np.array([[1.0]]))
    except np.linalg.LinAlgError:
        raise InputError(
            "period: no observer can be designed for so long a sample period against the elastic period of "
            "the drive; give a shorter one."
        ) from None
    K = np.linalg.solve(A, np.asarray(L))
    keep = np.eye(4) - K @ C
    after = keep @ np.asarray(P)
    # the error settles to this under a T'' of 1 that never ends: how far behind T' stays
    behind = np.linalg.solve(np.eye(4) - keep @ A, keep @ G)
    numbers = [*K[:, 0], math.sqrt(after[2, 2]), math.sqrt(after[3, 3]), behind[3, 0]]
    return [float(value) for value in numbers]


def observer(drive: Drive, period: Any, uncertainty: Any) -> Observer:
    """The observer of a drive, or of a batch.

    The model is J1 w1' = u - T with T'' = model + noise: `uncertainty` Omega^2 Ms is the part of T'' that
    the model misses, changing at random within 1/Omega, so of spectral density
    S = (uncertainty Omega^2 Ms)^2/Omega. The encoder's rounding is taken as noise of variance q^2/12 in each
    sample, R = h q^2/12. The bandwidth is near (S/(J1^2 R))^(1/8); with a fine encoder R is taken as large as
    keeps it at 6 Omega. Nothing about the gap enters.

    >>> crane = observer(Drive.load("crane-4amtkf"), 0.001, 0.05)
    >>> round(crane.angle_gain, 2), round(crane.rate_lag, 4), 0.5 < crane.torque_deviation < 1.5
    (0.66, 0.0059, True)
    """
    h = np.asarray(period, dtype=np.float64)
    deviation = np.asarray(encoder_count(drive.encoder_lines)) / math.sqrt(12.0)
    noise = np.asarray(uncertainty) * drive.Omega**2 * drive.Ms / np.sqrt(drive.Omega * h) * h**4 / drive.J1
    slowest = 10.0 ** (0.5 * SMALLEST_INDEX)
    fastest = np.maximum((FASTEST * drive.Omega * h) ** 4, slowest)
    index = 2.0 * np.log10(noise / np.clip(deviation, noise / fastest, noise / slowest))
    steps = np.rint(index / DECADES).astype(np.int64)
    steps = np.broadcast_to(steps, drive.shape)
    kinds, where = np.unique(steps, return_inverse=True)
    table = np.array([design(int(kind)) for kind in kinds])
    values = Design(*(table[where.reshape(steps.shape), i] for i in range(table.shape[1])))
    unit = drive.J1 / h**2
    return Observer(
        number(values.angle),
        number(values.speed / h),
        number(values.torque * unit),
        number(values.rate * unit / h),
        number(values.torque_deviation * unit * deviation),
        number(values.rate_deviation * unit / h * deviation),
        number(values.rate_lag * h),
    )


@njit(cache=True, nogil=True, error_model="numpy")
def predict(
    angle: float,
    speed: float,
    torque: float,
    rate: float,
    bend: float,
    motor_torque: float,
    J1: float,
    h: float,
) -> tuple[float, float, float, float]:
    """phi1, w1, T and T' one sample on, under a constant motor torque and a constant T'' = bend.

    >>> predict(0.0, 0.0, 0.0, 0.0, 0.0, 2.0, 1.0, 0.5)
    (0.25, 1.0, 0.0, 0.0)
    """
    a = (motor_torque - torque) / J1
    jerk = rate / J1
    snap = bend / J1
    return (
        angle + h * (speed + h * (a / 2.0 - h * (jerk / 6.0 + h * snap / 24.0))),
        speed + h * (a - h * (jerk / 2.0 + h * snap / 6.0)),
        torque + h * (rate + h * bend / 2.0),
        rate + h * bend,
    )
