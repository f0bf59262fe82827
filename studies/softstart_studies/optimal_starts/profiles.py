"""Optimal starts at multiples of the start time of constant torque: their numbers, and how they look."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from softstart import Run, simulate
from softstart.controller import make_controller
from softstart.optimal.front import FrontPoint
from softstart.profile import TorqueProfile
from softstart.study import Progress
from softstart_studies.crane import K_DYN, starts_figure
from softstart_studies.optimal_starts.drives import Extent, crane, direct_time, optima

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class OptimalStart:
    """One start time asked, the optimum for it, and the exact plant under its profile, if there is one."""

    gap: float
    multiple: float
    point: FrontPoint
    run: Run | None


def starts(extent: Extent, progress: Progress) -> list[OptimalStart]:
    """All of them, terminal synchronous.

    >>> found = starts(Extent(gaps=(0.5,), multiples=(1.2,)), lambda text: None)
    >>> round(found[0].point.k_dyn, 5), found[0].run.contacts
    (0.90925, 1)
    """
    found = []
    for gap in extent.gaps:
        multiples = sorted(extent.multiples)
        times = [multiple * direct_time(gap) for multiple in multiples]
        points = optima(crane(gap), times, "synchronous", progress).points
        found += [OptimalStart(gap, *one, run_of(gap, one[1])) for one in zip(multiples, points, strict=True)]
    return found


def run_of(gap: float, point: FrontPoint) -> Run | None:
    """The start under the profile of an optimum, to one elastic period after t_f."""
    if not point.found or point.start_time is None:
        return None
    profile = TorqueProfile(list(point.time), list(point.torque))
    player = make_controller("profile", {"profile": profile})
    return simulate(crane(gap), player, point.start_time + float(crane(gap).elastic_period))


def figure(found: list[OptimalStart]) -> Figure:
    """Torques and speeds of the optimal starts, a column a gap, a colour a start time."""
    columns: dict[str, dict[str, Run]] = {}
    for gap in sorted({one.gap for one in found}):
        here = [one for one in found if one.gap == gap]
        refused = ", ".join(f"{one.multiple:g}" for one in here if one.run is None)
        columns[f"gap {gap:g} rad" + (f"; {refused} x: infeasible" if refused else "")] = {
            f"{one.multiple:g} x: {one.point.start_time_bound:.4f} s, {K_DYN} {one.point.k_dyn:.4f}": one.run
            for one in here
            if one.run is not None
        }
    return starts_figure(columns)
