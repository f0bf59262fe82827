"""From when on a start is settled."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import brentq

from softstart import metrics, stages
from softstart.errors import InputError

if TYPE_CHECKING:
    from softstart.run import Run

POINTS_PER_PERIOD = 64


def settling_time(run: Run, band: float) -> float:
    """First instant from which |T - M12avg(u)| <= band * M12avg_base holds with the gap closed, s.

    It must hold for one elastic period at least, to the end of the run; NaN otherwise.
    Scanned at 64 points an elastic period, the crossing itself located by root finding.
    """
    if not 0.0 < band < math.inf:
        raise InputError(f"band = {band}: the settling band is a share of the mean torque above 0, e.g. 0.1.")
    drive = run.drive
    if not run.stages or run.stages[-1].side == 0:
        return math.nan
    limit = band * float(metrics.base_torque(run.base))

    def excess(times: float | np.ndarray) -> np.ndarray:
        state = run.at(times)
        return np.abs(state["T"] - stages.mean_shaft_torque(state["u"], drive.J1, drive.J2, drive.Mc)) - limit

    begin = run.stages[-1].start
    period = float(drive.elastic_period)
    if run.end_time - begin < period:
        return math.nan  # too short a look to call it settled
    count = max(2, math.ceil((run.end_time - begin) / period * POINTS_PER_PERIOD))
    grid = np.linspace(begin, run.end_time, count)
    outside = np.flatnonzero(excess(grid) > 0.0)
    if outside.size == 0:
        return float(begin)
    last = int(outside[-1])
    if last == count - 1 or run.end_time - grid[last + 1] < period:
        return math.nan
    if excess(grid[last + 1]) == 0.0:
        return float(grid[last + 1])
    return float(brentq(lambda time: float(excess(time)), grid[last], grid[last + 1], xtol=1e-12))
