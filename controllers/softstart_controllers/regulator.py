"""LQR gains for the closed drive, in numbers without units.

Time is counted in 1/Omega, angles in any unit. With the damping ratio zeta, the twist z and its rate v, the
part y of the mean twist that the motor torque makes, and its demand r, the closed drive is, but for known
terms,

    z' = v,   v' = y - z - 2 zeta v,   y' = (r - y)/lag

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
SHORTEST_LAG = 1e-3  # in 1/Omega: below it there is none


def feedback_gains(
    step: float, ratio: float, lag: float, torque_weight: float, rate_weight: float
) -> list[float]:
    """Gains on z, v and y.

    They minimise the sum of torque_weight z^2 + rate_weight v^2 + r^2 over the samples, `step` apart; without
    lag the gain on y is 0.

    >>> [round(gain, 1) for gain in feedback_gains(0.1, 0.0, 0.0, 1.0, 1.0)]
    [0.3, 1.3, 0.0]
    """
    lags = round(PER_DECADE * math.log10(lag)) if lag >= SHORTEST_LAG else None
    group = round(PER_DECADE * math.log10(step)), round(ratio * RATIO_STEPS), lags
    weights = [WEIGHTS_PER_DECADE * math.log10(weight) for weight in (torque_weight, rate_weight)]
    i, j = (math.floor(weight) for weight in weights)
    across, along = weights[0] - i, weights[1] - j
    corners = (
        ((1.0 - across) * (1.0 - along), _gains(*group, i, j)),
        ((1.0 - across) * along, _gains(*group, i, j + 1)),
        (across * (1.0 - along), _gains(*group, i + 1, j)),
        (across * along, _gains(*group, i + 1, j + 1)),
    )
    return [sum(share * gains[k] for share, gains in corners) for k in range(3)]


@cache
def _gains(step: int, ratio: int, lag: int | None, torque_weight: int, rate_weight: int) -> list[float]:
    """K = (R + B' X B)^-1 B' X A of the stationary Riccati equation X = A' X (A - B K) + Q, with R = 1."""
    from scipy import linalg

    rate = 0.0 if lag is None else 10.0 ** (-lag / PER_DECADE)
    plant = np.array(
        [
            [0.0, 1.0, 0.0, 0.0],
            [-1.0, -2.0 * ratio / RATIO_STEPS, 1.0, 0.0],
            [0.0, 0.0, -rate, rate],
            [0.0, 0.0, 0.0, 0.0],
        ]
    )
    n = 2 if lag is None else 3  # without lag y is the demand itself
    whole = linalg.expm(10.0 ** (step / PER_DECADE) * plant)
    A, B = whole[:n, :n], whole[:n, n : n + 1]
    Q = np.diag([10.0 ** (weight / WEIGHTS_PER_DECADE) for weight in (torque_weight, rate_weight)] + [0.0])
    try:
        X = linalg.solve_discrete_are(A, B, Q[:n, :n], np.eye(1))
    except np.linalg.LinAlgError:
        raise InputError(
            "state-feedback: no gains can be designed for these weights and this sample period; give "
            "values nearer to the defaults."
        ) from None
    gains: list[float] = ((B.T @ X @ A) / (1.0 + B.T @ X @ B))[0].tolist()
    return [*gains, 0.0][:3]
