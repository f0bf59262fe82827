"""What the studies of tuning share: the crane drive as it is sold, the controllers, the optimum."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cache

from softstart import Drive, simulate
from softstart.controller import make_controller, ready_controller_names
from softstart.optimal.result import InfeasibleError, OptimumError
from softstart.optimal.solving import optimize
from softstart.study import Progress
from softstart.tuning.outcome import Tuning
from softstart.tuning.ranges import tunable
from softstart.tuning.solving import tune

TARGET = 60.0  # rad/s
LAG = 0.002  # s, of the torque of an inverter
# [G]: J1 = 0.035 kg m2, Ms = 62 N m, Mc = 7.16 N m; encoder of 4096 lines; the lag is assumed
CRANE = Drive.load("crane-4amtkf").replace(target_speed=TARGET, torque_lag=LAG)


def tuned_controllers() -> tuple[str, ...]:
    """Names of the installed controllers that have something to tune.

    >>> "ramp" in tuned_controllers(), "direct" in tuned_controllers()
    (True, False)
    """
    return tuple(name for name in ready_controller_names() if tunable(make_controller(name)))


def tuned(
    drive: Drive,
    names: Sequence[str],
    gaps: Sequence[float],
    inertias: Sequence[float],
    start_time: str,
    restarts: int,
    generations: int,
    progress: Progress,
) -> dict[str, Tuning]:
    """All of them tuned alike: the same grid, bound, effort and seed."""
    found = {}
    for number, name in enumerate(names, start=1):
        head = f"{name} ({number} of {len(names)})"
        found[name] = tune(
            drive, name, gaps, inertias, start_time=start_time, certified=False, restarts=restarts,
            generations=generations, progress=lambda text, head=head: progress(f"{head}: {text}"),  # type: ignore[misc]
        )  # fmt: skip
    return found


@cache
def direct_time(drive: Drive) -> float:
    """Start time of constant torque in s."""
    return float(simulate(drive, "direct").start_time)


@cache
def least(drive: Drive, start_time: float) -> tuple[float, float]:
    """Least K_dyn in this start time and its lower bound, without lag; NaN where there is no such start."""
    try:
        best = optimize(drive.replace(torque_lag=0.0), start_time, terminal="reached")
    except (InfeasibleError, OptimumError):
        return math.nan, math.nan
    return best.k_dyn, best.k_dyn_lower_bound
