"""Optimal starts at multiples of the start time of constant torque."""

from __future__ import annotations

from dataclasses import dataclass

from softstart import Run, simulate
from softstart.controller import make_controller
from softstart.optimal.front import FrontPoint
from softstart.profile import TorqueProfile
from softstart.study import Progress, Table
from softstart_studies.optimal_starts.crane import Extent, crane, direct_time, optima, rounded


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
    return [
        OptimalStart(gap, multiple, point, run_of(gap, point))
        for gap in extent.gaps
        for multiple, point in zip(
            sorted(extent.multiples),
            optima(
                crane(gap), [m * direct_time(gap) for m in extent.multiples], "synchronous", progress
            ).points,
            strict=True,
        )
    ]


def run_of(gap: float, point: FrontPoint) -> Run | None:
    """The start under the profile of an optimum, to one elastic period after t_f."""
    if not point.found or point.start_time is None:
        return None
    drive = crane(gap)
    profile = TorqueProfile(list(point.time), list(point.torque))
    player = make_controller("profile", {"profile": profile})
    return simulate(drive, player, point.start_time + float(drive.elastic_period))


def table(found: list[OptimalStart]) -> Table:
    """What each comes to, or the shortest start time where there is none."""
    return Table(
        "Optimal starts, synchronous, undamped, active load",
        (
            "gap, rad",
            "x direct",
            "start time, s",
            "K_dyn",
            "at least",
            "bound",
            "above it, %",
            "method",
            "contacts",
            "heat, s",
            "shortest, s",
        ),
        [
            (
                one.gap,
                one.multiple,
                rounded(one.point.start_time_bound),
                rounded(one.point.k_dyn),
                rounded(one.point.k_dyn_lower_bound),
                one.point.bound_kind if one.point.found else one.point.status.lower(),
                rounded(one.point.gap_percent, 4),
                one.point.method or None,
                one.point.contacts,
                rounded(one.point.heat, 4),
                rounded(one.point.shortest_start_time),
            )
            for one in found
        ],
    )
