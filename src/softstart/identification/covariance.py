"""What an encoder tells of the motion, and the factor of a covariance that rounding cannot break."""

from __future__ import annotations

import math

import numpy as np
from scipy.linalg import lapack

from softstart.arrays import Matrix, Vector


def edges(time: Vector, angle: Vector, count: float) -> tuple[Vector, Vector]:
    """What an encoder tells in each sample: the angle and its variance, infinite where others tell it.

    Samples on one count have nearly the same error while the motor creeps, and together they tell one thing:
    when the count ended. In the last of them the motor was before that edge by less than it then moved to the
    next sample: by half of that on average, and uniformly about it. How far it moves follows from the times
    to the neighbouring edges, the shorter of which is taken for the variance. A motor that passes a count or
    more from sample to sample has the variance of a rounded number, count^2/12. The first sample, and the
    last, are rounded numbers.

    All this depends on the log alone: a covariance that follows the fitted motion fits what it rounds, and
    found the torque error of a single start with 64 lines a quarter too small.

    >>> angle, variance = edges(np.arange(7.0), np.array([0.0, 0.0, 1.0, 1.0, 2.0, 2.0, 2.0]), 1.0)
    >>> angle.round(2).tolist(), (12.0 * variance).round(2).tolist()
    ([0.0, 0.21, 1.0, 1.28, 2.0, 2.0, 2.0], [1.0, 0.44, inf, 0.25, inf, inf, 1.0])
    """
    told, variance = angle.copy(), np.full(angle.size, math.inf)
    ends = np.flatnonzero(np.abs(np.diff(angle)) > 0.5 * count)
    variance[[0, -1]] = count**2 / 12.0
    if ends.size == 0:
        return told, variance
    steps, passed = angle[ends + 1] - angle[ends], time[ends + 1] - time[ends]
    at = np.concatenate([[time[0]], 0.5 * (time[ends] + time[ends + 1]), [time[-1]]])
    before, after = np.diff(at)[:-1], np.diff(at)[1:]
    moved = 2.0 * count * passed / np.maximum(before + after, 1e-300)
    most = np.minimum(count * passed / np.maximum(np.minimum(before, after), 1e-300), count)
    single = (np.abs(steps) < 1.5 * count) & (moved < count)
    inner = np.where(single, 0.5 * (count - moved), 0.0)
    told[ends] += np.sign(steps) * inner
    variance[ends] = np.where(single, most, count) ** 2 / 12.0
    return told, variance


def root_of_covariance(noise: float, seen: Matrix) -> Matrix:
    """The lower triangle L of L L' = noise^2 I + seen seen', with a positive diagonal.

    By a QR decomposition of [noise I, seen]', which rounding cannot break: seen seen', whose error is that of
    its largest entry, is never formed. (The product has no Cholesky factor once a torque error moves the
    signal by 1e7 times its rounding.)

    >>> root_of_covariance(3.0, np.array([[4.0], [0.0]])).round(12).tolist()
    [[5.0, 0.0], [0.0, 3.0]]
    >>> float(root_of_covariance(1.0, np.array([[1e10], [1e10]]))[1, 1].round(6))  # the root of 2
    1.414214
    """
    size = seen.shape[0]
    root: Matrix = np.triu(lapack.dtpqrt(0, min(32, size), noise * np.eye(size), seen.T)[0]).T
    root *= np.copysign(1.0, np.diag(root))
    return root + 0.0
