"""Which of two candidates is better: one number that ranks them by one rule."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from softstart.arrays import Vector

TOO_SLOW = 1e30  # where the costs of candidates begin that start, but not in time
UNFINISHED = 1e60  # where those begin that do not start at all
SLACK = 1e-9  # of the bound on the start time, for rounding


def upper(values: Any, quantile: float) -> Any:
    """The value that the share `quantile` of the last axis does not exceed; one of the values.

    >>> float(upper(np.array([3.0, 1.0, 2.0, np.inf]), 0.75)), float(upper(np.array([3.0, 1.0]), 1.0))
    (3.0, 3.0)
    """
    count = np.shape(values)[-1]
    index = max(math.ceil(quantile * count - 1e-9), 1) - 1
    return np.sort(values, axis=-1)[..., index]


def excess(start_time: Any, bound: Any, quantile: float) -> Any:
    """By which share the start time is beyond its bound, 0 or more; infinite where a start fails."""
    share = np.where(np.isnan(start_time), np.inf, np.maximum(start_time / bound - 1.0, 0.0))
    over = upper(share, quantile)
    return np.where(over <= SLACK, 0.0, over)


def cost(metric: Any, start_time: Any, bound: Any, quantile: float) -> Vector:
    """The lower the better: in time beats too slow, less too slow beats more, then the metric decides.

    The last axis are the starts that one candidate is judged by; metric and start time both count at their
    `quantile` over these. A start that fails or does not reach its target speed is the worst of all, and
    candidates with fewer of them are better.

    >>> t = np.array([[0.3], [0.4], [0.5], [np.nan]])
    >>> cost(np.array([[2.0], [1.0], [1.0], [1.0]]), t, 0.35, 1.0).argsort().tolist()
    [0, 1, 2, 3]
    """
    failed = np.isnan(metric) | np.isnan(start_time)
    value = upper(np.where(failed, np.inf, metric), quantile)
    over = excess(np.where(failed, np.nan, start_time), bound, quantile)
    timely = np.isfinite(over)
    ranked = np.where(over == 0.0, value, TOO_SLOW * (1.0 + np.where(timely, over, 0.0)))
    unfinished = UNFINISHED * (1.0 + failed.mean(axis=-1))
    return np.asarray(np.where(timely & np.isfinite(value), ranked, unfinished))


def in_time(found: Any) -> Any:
    """Whether a cost is that of a candidate within its bound on the start time."""
    return np.asarray(found) < TOO_SLOW
