"""The drives of the study, the start times that are asked, and how much of it all is worked out."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np

from softstart import Drive, simulate
from softstart.controller import ready_controller_names
from softstart.optimal.front import Front, pareto
from softstart.optimal.optimize import shortest_start_time
from softstart.optimal.problem import Problem, Terminal
from softstart.study import Progress
from softstart_studies.paper_g.crane import published

TARGET = 60.0  # rad/s, that of the anchors in docs/optimal-starts.md
CRANE = Drive.load("crane-4amtkf").replace(target_speed=TARGET)  # [G]: J2 = 5 J1, active load, undamped
GAP_1, GAP_2 = 0.5, 2.0  # rad, new and worn
DAMPING = 1.0  # N m s/rad, assumed: 15 % of the critical one; [G] has none
NEAREST, LONGEST = 1.06, 1.6  # of the start time of direct


@dataclass(frozen=True)
class Extent:
    """How much is worked out: the whole study, or a part of it for a quick look."""

    gaps: tuple[float, ...] = (GAP_1, GAP_2)
    multiples: tuple[float, ...] = (1.05, 1.2, 1.5)  # of the start time of direct
    points: int = 8  # of each front
    sensor_multiples: tuple[float, ...] = (1.2, 1.35)  # of the start time of direct at the first gap
    sensor_gaps: tuple[float, ...] = (GAP_1, 1.0, GAP_2)
    rates: tuple[float, ...] = (20000.0, 5000.0, 2000.0)  # N m/s
    lags: tuple[float, ...] = (0.0, 0.002)  # s
    weights: tuple[float, ...] = (1e-4, 1e-3, 1e-2)  # s
    kinds: tuple[str, ...] = ("reactive", "damped", "reactive, damped")
    kind_multiples: tuple[float, ...] = (1.2, 1.5)
    controllers: tuple[str, ...] | None = None  # beside the fronts; None: all that are shipped
    kind_controllers: tuple[str, ...] = ("current-limit-feedback", "reduced-two-stage")


def crane(gap: float = GAP_1, kind: str = "") -> Drive:
    """The drive of [G] with this total gap in rad; `kind` names what is different: reactive, damped, or both.

    >>> crane(2.0, "reactive, damped").load_kind, crane().d
    ('reactive', 0.0)
    """
    drive = CRANE.replace(gap=gap, name=f"Crane of [G], gap {gap:g} rad")
    if "reactive" in kind:
        drive = drive.replace(load_kind="reactive")
    return drive.replace(damping=DAMPING) if "damped" in kind else drive


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
    drive: Drive,
    times: Sequence[float],
    terminal: Terminal,
    progress: Progress,
    controllers: Sequence[str] | None = (),
) -> Front:
    """The least K_dyn for each of the start times, beside these controllers (None: all that are shipped)."""
    told = _prefixed(progress, f"gap {drive.gap:g} rad, {terminal}")
    beside = [published(name) for name in (ready_controller_names() if controllers is None else controllers)]
    return pareto(drive, times, terminal=terminal, controllers=beside, progress=told)


def _prefixed(progress: Progress, what: str) -> Callable[[str], None]:
    return lambda text: progress(f"{what}: {text}")


def gap_of(front: Front) -> float:
    """The gap of its drive, rad."""
    assert isinstance(front.drive, Drive)
    return float(front.drive.gap)


def percent(ratio: float, digits: int = 1) -> str:
    """How much more or less than 1, as text.

    >>> percent(1.0123), percent(0.827, 0)
    ('+1.2 %', '-17 %')
    """
    return f"{100 * (ratio - 1):+.{digits}f} %"


def rounded(value: float | None, digits: int = 5) -> float | None:
    """For a table."""
    return None if value is None else round(float(value), digits)
