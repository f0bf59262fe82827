"""LQR and Kalman gains for the closed drive, by python-control, in numbers without units.

Time is counted in 1/Omega, angles in any unit. With mu = J2/(J1 + J2), the damping ratio zeta, the twist z
and its rate v, the part y of the mean twist that the motor torque makes, its demand r and the part m that the
load makes, the closed drive is, but for known terms,

    phi1' = w1,   w1' = -mu (z + 2 zeta v),   z' = v,   v' = y + m - z - 2 zeta v,   y' = (r - y)/lag

so that all drives with the same few groups share one design. Each group is rounded to the grid below, where a
step changes a gain by a few per cent; between the weights of the grid the gains are interpolated. So a tuning
of thousands of weights needs two hundred designs; all are kept on disk.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from softstart.errors import InputError
from softstart.late import late
from softstart_controllers.design_store import kept_all

if TYPE_CHECKING:
    import control
    from scipy import linalg
else:
    control = late("control")
    linalg = late("scipy.linalg")

Array = NDArray[np.float64]

PER_DECADE = 20  # steps of sample period and lag
WEIGHTS_PER_DECADE = 5
RATIO_STEPS = 50  # steps of a damping ratio of 1
SHARE_STEPS = 40  # steps of mu
NOISE_PER_DECADE = 4
SHORTEST_LAG = 1e-3  # in 1/Omega: below it there is none
LOAD_NOISE = 0.1  # spectral density of m' over that of v'

_known: dict[str, dict[tuple[int, ...], list[float]]] = {"lqr": {}, "kalman": {}}


def feedback_gains(step: Any, ratio: Any, lag: Any, torque_weight: Any, rate_weight: Any) -> Array:
    """Gains on z, v and y, last axis; broadcast over the arguments.

    Minimises the sum of torque_weight z^2 + rate_weight v^2 + r^2 over the samples (`control.dlqr`), `step`
    apart; without lag the gain on y is 0.

    >>> feedback_gains(0.1, 0.0, 0.0, 1.0, 1.0).round(1).tolist()
    [0.3, 1.3, 0.0]
    """
    lagging = np.asarray(lag) >= SHORTEST_LAG
    groups = (
        _decades(step, PER_DECADE),
        np.rint(np.asarray(ratio) * RATIO_STEPS),
        np.where(lagging, _decades(np.maximum(lag, SHORTEST_LAG), PER_DECADE), NO_LAG),
    )
    weights = [WEIGHTS_PER_DECADE * np.log10(weight) for weight in (torque_weight, rate_weight)]
    below = [np.floor(weight) for weight in weights]
    gains: Any = 0.0
    for i, j in itertools.product((0, 1), (0, 1)):
        corner = _designs("lqr", (*groups, below[0] + i, below[1] + j), _feedback)
        part = [np.abs(1 - k - (weight - low)) for k, weight, low in zip((i, j), weights, below, strict=True)]
        gains = gains + np.asarray(part[0] * part[1])[..., None] * corner
    return np.asarray(gains)


def observer_gains(step: Any, ratio: Any, share: Any, noise: Any) -> Array:
    """Gains on phi1, w1, z, v and m after the measurement of phi1, last axis.

    `noise` is the variance of one angle over the spectral density of v', in samples `step` apart, for
    `control.dlqe`; m wanders with a tenth of that density.
    """
    groups = (
        _decades(step, PER_DECADE),
        np.rint(np.asarray(ratio) * RATIO_STEPS),
        np.clip(np.rint(np.asarray(share) * SHARE_STEPS), 1, SHARE_STEPS - 1),
        _decades(noise, NOISE_PER_DECADE),
    )
    return _designs("kalman", groups, _observer)


NO_LAG = 1000  # in place of the steps of a lag


def _decades(value: Any, per_decade: int) -> Array:
    return np.rint(per_decade * np.log10(value))


def _designs(kind: str, groups: tuple[Array, ...], make: Callable[[tuple[int, ...]], list[float]]) -> Array:
    """One design for each distinct row of the groups, from memory, from disk or made."""
    table = np.stack(np.broadcast_arrays(*groups), axis=-1).astype(np.int64)
    kinds, where = np.unique(table.reshape(-1, table.shape[-1]), axis=0, return_inverse=True)
    rows = [tuple(row) for row in kinds.tolist()]
    known = _known[kind]
    missing = [row for row in rows if row not in known]
    if missing:
        names = {f"{kind} {' '.join(map(str, row))}": row for row in missing}
        found = kept_all(list(names), Path(__file__), lambda name: make(names[name]))
        known.update({names[name]: gains for name, gains in found.items()})
    gains = np.array([known[row] for row in rows])
    return gains[where.ravel()].reshape(*table.shape[:-1], gains.shape[1])


def _feedback(group: tuple[int, ...]) -> list[float]:
    step = 10.0 ** (group[0] / PER_DECADE)
    torque_weight, rate_weight = (10.0 ** (group[i] / WEIGHTS_PER_DECADE) for i in (3, 4))
    ratio = group[1] / RATIO_STEPS
    lagging = group[2] != NO_LAG
    A = np.array([[0.0, 1.0, 0.0], [-1.0, -2.0 * ratio, 1.0], [0.0, 0.0, 0.0]])
    B = np.zeros((3, 1))
    Q = np.diag([torque_weight, rate_weight, 0.0])
    if lagging:
        rate = 10.0 ** (-group[2] / PER_DECADE)
        A[2, 2], B[2, 0] = -rate, rate
        whole = linalg.expm(step * np.block([[A, B], [np.zeros((1, 4))]]))
        K = _solved(control.dlqr, whole[:3, :3], whole[:3, 3:], Q, np.eye(1))
        return [float(k) for k in K[0]]
    whole = linalg.expm(step * A)
    K = _solved(control.dlqr, whole[:2, :2], whole[:2, 2:], Q[:2, :2], np.eye(1))
    return [float(K[0, 0]), float(K[0, 1]), 0.0]


def _observer(group: tuple[int, ...]) -> list[float]:
    step, noise = 10.0 ** (group[0] / PER_DECADE), 10.0 ** (group[3] / NOISE_PER_DECADE)
    ratio, share = group[1] / RATIO_STEPS, group[2] / SHARE_STEPS
    A = np.zeros((5, 5))
    A[0, 1] = A[2, 3] = A[3, 4] = 1.0
    A[1, 2:4] = -share, -2.0 * ratio * share
    A[3, 2:4] = -1.0, -2.0 * ratio
    density = np.diag([0.0, 0.0, 0.0, 1.0, LOAD_NOISE])
    # Van Loan: the noise of one sample
    whole = linalg.expm(step * np.block([[-A, density], [np.zeros((5, 5)), A.T]]))
    Ad = whole[5:, 5:].T
    Q = Ad @ whole[:5, 5:]
    C = np.eye(1, 5)
    L = _solved(control.dlqe, Ad, np.eye(5), C, 0.5 * (Q + Q.T), np.array([[noise]]))
    return [float(k) for k in np.linalg.solve(Ad, L)[:, 0]]


def _solved(design: Callable[..., Any], *matrices: Array) -> Array:
    """The gains by python-control."""
    try:
        gains, _, _ = design(*matrices)
    except np.linalg.LinAlgError:
        raise InputError(
            "state-feedback: no gains can be designed for these weights, uncertainty and sample period; give "
            "values nearer to the defaults."
        ) from None
    return np.asarray(gains)
