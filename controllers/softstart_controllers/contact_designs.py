"""LQR and Kalman gains for the closed drive, in numbers without units.

Time is counted in 1/Omega, angles in any unit. With mu = J2/(J1 + J2), the damping ratio zeta, the twist z
and its rate v, the part y of the mean twist that the motor torque makes, its demand r and the part m that the
load makes, the closed drive is, but for known terms,

    phi1' = w1,   w1' = -mu (z + 2 zeta v),   z' = v,   v' = y + m - z - 2 zeta v,   y' = (r - y)/lag

so that all drives with the same few groups share one design. Each group is rounded to the grid below, where a
step changes a gain by a few per cent; between the weights of the grid the gains are interpolated. So a tuning
of thousands of weights needs two hundred designs; a process makes each once.
"""

from __future__ import annotations

import math
from functools import cache

import numpy as np
from numpy.typing import NDArray

from softstart.errors import InputError

Array = NDArray[np.float64]

PER_DECADE = 20  # steps of sample period and lag
WEIGHTS_PER_DECADE = 5
RATIO_STEPS = 50  # steps of a damping ratio of 1
SHARE_STEPS = 40  # steps of mu
NOISE_PER_DECADE = 4
SHORTEST_LAG = 1e-3  # in 1/Omega: below it there is none
LOAD_NOISE = 0.1  # spectral density of m' over that of v'


def feedback_gains(
    step: float, ratio: float, lag: float, torque_weight: float, rate_weight: float
) -> list[float]:
    """Gains on z, v and y.

    They minimise the sum of torque_weight z^2 + rate_weight v^2 + r^2 over the samples, `step` apart; without
    lag the gain on y is 0.

    >>> [round(gain, 1) for gain in feedback_gains(0.1, 0.0, 0.0, 1.0, 1.0)]
    [0.3, 1.3, 0.0]
    """
    lags = _steps(lag, PER_DECADE) if lag >= SHORTEST_LAG else None
    group = _steps(step, PER_DECADE), round(ratio * RATIO_STEPS), lags
    weights = [WEIGHTS_PER_DECADE * math.log10(weight) for weight in (torque_weight, rate_weight)]
    i, j = (math.floor(weight) for weight in weights)
    across, along = weights[0] - i, weights[1] - j
    corners = (
        ((1.0 - across) * (1.0 - along), _feedback(*group, i, j)),
        ((1.0 - across) * along, _feedback(*group, i, j + 1)),
        (across * (1.0 - along), _feedback(*group, i + 1, j)),
        (across * along, _feedback(*group, i + 1, j + 1)),
    )
    return [sum(share * gains[k] for share, gains in corners) for k in range(3)]


def observer_gains(step: float, ratio: float, share: float, noise: float) -> list[float]:
    """Gains on phi1, w1, z, v and m after the measurement of phi1.

    `noise` is the variance of one angle over the spectral density of v', in samples `step` apart; m wanders
    with a tenth of that density.
    """
    shares = min(max(round(share * SHARE_STEPS), 1), SHARE_STEPS - 1)
    return _observer(
        _steps(step, PER_DECADE), round(ratio * RATIO_STEPS), shares, _steps(noise, NOISE_PER_DECADE)
    )


def _steps(value: float, per_decade: int) -> int:
    return round(per_decade * math.log10(value))


@cache
def _feedback(step: int, ratio: int, lag: int | None, torque_weight: int, rate_weight: int) -> list[float]:
    from scipy import linalg

    rate = 0.0 if lag is None else 10.0 ** (-lag / PER_DECADE)
    A = np.array([[0.0, 1.0, 0.0], [-1.0, -2.0 * ratio / RATIO_STEPS, 1.0], [0.0, 0.0, -rate]])
    Q = np.diag(
        [10.0 ** (torque_weight / WEIGHTS_PER_DECADE), 10.0 ** (rate_weight / WEIGHTS_PER_DECADE), 0.0]
    )
    B = np.array([[0.0], [0.0], [rate]])
    h = 10.0 ** (step / PER_DECADE)
    if lag is None:  # y is the demand itself
        whole = linalg.expm(h * A)
        return [*_regulator(whole[:2, :2], whole[:2, 2:], Q[:2, :2], 1.0), 0.0]
    whole = linalg.expm(h * np.block([[A, B], [np.zeros((1, 4))]]))
    return _regulator(whole[:3, :3], whole[:3, 3:], Q, 1.0)


@cache
def _observer(step: int, ratio: int, share: int, noise: int) -> list[float]:
    from scipy import linalg

    h, damping, mu = 10.0 ** (step / PER_DECADE), 2.0 * ratio / RATIO_STEPS, share / SHARE_STEPS
    A = np.zeros((5, 5))
    A[0, 1] = A[2, 3] = A[3, 4] = 1.0
    A[1, 2:4] = -mu, -damping * mu
    A[3, 2:4] = -1.0, -damping
    density = np.diag([0.0, 0.0, 0.0, 1.0, LOAD_NOISE])
    # Van Loan: the noise of one sample
    whole = linalg.expm(h * np.block([[-A, density], [np.zeros((5, 5)), A.T]]))
    Ad = whole[5:, 5:].T
    Q = Ad @ whole[:5, 5:]
    L = _regulator(Ad.T, np.eye(5, 1), 0.5 * (Q + Q.T), 10.0 ** (noise / NOISE_PER_DECADE))
    gains: list[float] = np.linalg.solve(Ad, np.array(L)).tolist()
    return gains


def _regulator(A: Array, B: Array, Q: Array, R: float) -> list[float]:
    """K = (R + B' X B)^-1 B' X A of the stationary Riccati equation X = A' X (A - B K) + Q.

    Of the transposed system it is the predictor of the stationary Kalman filter.
    """
    from scipy import linalg

    try:
        X = linalg.solve_discrete_are(A, B, Q, np.array([[R]]))
    except np.linalg.LinAlgError:
        raise InputError(
            "state-feedback: no gains can be designed for these weights, uncertainty and sample period; give "
            "values nearer to the defaults."
        ) from None
    gains: list[float] = ((B.T @ X @ A) / (R + B.T @ X @ B))[0].tolist()
    return gains
