"""The drives of the study, the start times that are asked, and how much of it all is worked out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from softstart import Drive, simulate
from softstart.controller import ready_controller_names
from softstart.optimal.front import Front, FrontPoint, pareto
from softstart.optimal.optimize import shortest_start_time
from softstart.optimal.problem import Problem, Terminal
from softstart.study import Progress
from softstart_studies.crane import CRANE, TARGET, prefixed, published

NEAREST, LONGEST = 1.06, 1.6  # of the start time of direct


@dataclass(frozen=True)
class Extent:
    """How much is worked out: the whole study, or a part of it for a quick look."""

    gaps: tuple[float, ...] = (0.5, 2.0)  # rad, new and worn
    multiples: tuple[float, ...] = (1.05, 1.2, 1.5)  # of the start time of direct
    points: int = 8  # of each front
    controllers: tuple[str, ...] | None = None  # beside the fronts; None: all that are shipped


def crane(gap: float = 0.5) -> Drive:
    """The drive of [G] with this total gap in rad."""
    return CRANE.replace(gap=gap, target_speed=TARGET, name=f"Crane of [G], gap {gap:g} rad")


@cache
def direct_time(gap: float) -> float:
    """Start time of constant torque in s, undamped, active load.

    >>> round(direct_time(0.5), 6)
    0.240253
    """
    return float(simulate(crane(gap), "direct").start_time)


@cache
def shortest_time(gap: float) -> float:
    """Shortest start time found in s, terminal reached, undamped, active load."""
    return float(shortest_start_time(Problem(crane(gap), 1.0, "reached")))


def front_times(gap: float, count: int) -> list[float]:
    """Start times in s from just above that of direct on, closer together where the curve is steep.

    >>> [round(t, 3) for t in front_times(0.5, 3)]
    [0.255, 0.287, 0.384]
    """
    first, last = NEAREST * direct_time(gap), LONGEST * direct_time(gap)
    times: list[float] = (first + (last - first) * np.linspace(0.0, 1.0, count) ** 2).tolist()
    return times


def optima(
    drive: Drive, times: Sequence[float], terminal: Terminal, progress: Progress,
    controllers: Sequence[str] | None = (),
) -> Front:  # fmt: skip
    """The least K_dyn for each of the start times, beside these controllers (None: all that are shipped)."""
    told = prefixed(progress, f"gap {drive.gap:g} rad, {terminal}")
    beside = [published(name) for name in (ready_controller_names() if controllers is None else controllers)]
    return pareto(drive, times, terminal=terminal, controllers=beside, progress=told)


def gap_of(front: Front) -> float:
    """The gap of its drive, rad."""
    assert isinstance(front.drive, Drive)
    return float(front.drive.gap)


def of_points(points: Sequence[FrontPoint]) -> dict[str, list[Any]]:
    """Columns of a table: what each optimum comes to."""
    return {
        "start time, s": [p.start_time_bound for p in points],
        "K_dyn": [p.k_dyn for p in points],
        "at least": [p.k_dyn_lower_bound for p in points],
        "bound": [p.bound_kind if p.found else p.status.lower() for p in points],
        "above it, %": [p.optimality_gap_percent for p in points],
        "method": [p.method or None for p in points],
    }
