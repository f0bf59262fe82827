"""What the studies of tuning share: all controllers tuned alike, and the optimum over the start time."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import PchipInterpolator

from softstart import Drive
from softstart.arrays import Vector
from softstart.controller import make_controller, ready_controller_names
from softstart.optimal.optimize import optimize, shortest_start_time
from softstart.optimal.problem import Problem
from softstart.optimal.result import InfeasibleError, OptimumError
from softstart.study import Progress
from softstart.tuning.outcome import Tuning
from softstart.tuning.ranges import tunable_parameters
from softstart.tuning.solving import tune
from softstart_studies.crane import prefixed, published


def tuned_controllers() -> tuple[str, ...]:
    """Names of the installed controllers that have something to tune.

    >>> "ramp" in tuned_controllers(), "direct" in tuned_controllers()
    (True, False)
    """
    return tuple(name for name in ready_controller_names() if tunable_parameters(make_controller(name)))


def tuned(
    drive: Drive,
    names: Sequence[str],
    gaps: Sequence[float],
    inertias: Sequence[float],
    restarts: int,
    generations: int,
    progress: Progress,
) -> dict[str, Tuning]:
    """All of them tuned alike: the same grid, effort and seed, and no start slower than with the defaults."""
    found = {}
    for number, name in enumerate(names, start=1):
        found[name] = tune(
            drive, published(name), gaps, inertias, certified=False, restarts=restarts,
            generations=generations, progress=prefixed(progress, f"{name} ({number} of {len(names)})"),
        )  # fmt: skip
    return found


@dataclass(frozen=True)
class Front:
    """The least K_dyn of one drive at some start times (s), rising; between them it is interpolated."""

    start_times: Vector
    k_dyn: Vector

    def at(self, start_time: float) -> float:
        """By a monotone cubic in the logarithms (PCHIP); NaN outside."""
        if not self.start_times.size or not self.start_times[0] <= start_time <= self.start_times[-1]:
            return math.nan
        if self.start_times.size == 1:
            return float(self.k_dyn[0])
        curve = PchipInterpolator(np.log(self.start_times), np.log(self.k_dyn))
        return float(np.exp(curve(math.log(start_time))))


def front(drive: Drive, times: Sequence[float], points: int) -> Front:
    """Optima from the quickest of these times at which there is a start to the slowest.

    The optimum is that of a torque without lag, terminal `reached`: a yardstick no controller can pass.
    """
    ideal = drive.replace(torque_lag=0.0)
    slowest, quickest = float(np.nanmax(times)), float(np.nanmin(times))
    quickest = max(quickest, shortest_start_time(Problem(ideal, 1.0, "reached")))
    if not quickest < slowest:
        return Front(np.zeros(0), np.zeros(0))
    found = []
    for time in np.geomspace(quickest * (1.0 + 1e-6), slowest, points).tolist():
        try:
            found.append((time, optimize(ideal, time, terminal="reached").k_dyn))
        except (InfeasibleError, OptimumError):
            continue
    solved = np.array(found).reshape(-1, 2)
    return Front(solved[:, 0], solved[:, 1])
