"""Reactive loads and a damped shaft: the optimum at the start times of the undamped active drive."""

from __future__ import annotations

from dataclasses import dataclass

from softstart.optimal.front import Front
from softstart.study import Claim, Progress, Table, Verdict
from softstart_studies.optimal_starts.crane import (
    DAMPING,
    Extent,
    crane,
    direct_time,
    optima,
    percent,
    rounded,
)
from softstart_studies.optimal_starts.fronts import nearest
from softstart_studies.optimal_starts.profiles import OptimalStart


@dataclass(frozen=True)
class Kind:
    """The optima of one kind of drive, terminal synchronous; its controllers beside it at the first gap."""

    name: str
    gap: float
    front: Front


def kinds(extent: Extent, progress: Progress) -> list[Kind]:
    """All kinds at all gaps."""
    found = []
    for name in extent.kinds:
        for index, gap in enumerate(extent.gaps):
            times = [m * direct_time(gap) for m in extent.kind_multiples]
            beside = extent.kind_controllers if index == 0 else ()
            found.append(Kind(name, gap, optima(crane(gap, name), times, "synchronous", progress, beside)))
    return found


def table(found: list[Kind], plain: list[OptimalStart]) -> Table:
    """K_dyn of each beside that of the undamped active drive."""
    rows = []
    for kind in found:
        known = {
            round(one.point.start_time_bound, 9): one.point.k_dyn for one in plain if one.gap == kind.gap
        }
        for point in kind.front.points:
            rows.append(
                (
                    kind.name,
                    kind.gap,
                    rounded(point.start_time_bound),
                    rounded(known.get(round(point.start_time_bound, 9))),
                    rounded(point.k_dyn),
                    rounded(point.k_dyn_lower_bound),
                    point.bound_kind if point.found else point.status.lower(),
                    rounded(point.gap_percent, 3),
                    point.method or None,
                )
            )
    return Table(
        f"Reactive load and damped shaft (d = {DAMPING:g} N m s/rad, assumed), synchronous",
        (
            "drive",
            "gap, rad",
            "start time, s",
            "undamped, active",
            "K_dyn",
            "at least",
            "bound",
            "above it, %",
            "method",
        ),
        rows,
    )


def claims(found: list[Kind]) -> list[Claim]:
    """The optimum beside the controllers of these drives."""
    judged = [kind for kind in found if kind.front.controllers]
    names = ", ".join(one.name for one in judged[0].front.controllers)
    ratios = [one.ratio for kind in judged for one in kind.front.controllers if one.ratio is not None]
    said = "; ".join(
        f"{kind.name}, {kind.gap:g} rad: {nearest(kind.front).name} {nearest(kind.front).k_dyn:.4f}, "
        f"{percent(nearest(kind.front).ratio or 1.0)} above the optimum"
        for kind in judged
    )
    return [
        Claim(
            "(Not in [G]) With a reactive load or a damped shaft too, the optimum is well below the "
            "controllers.",
            Verdict.CONFIRMED if min(ratios) > 1.05 else Verdict.REFUTED,
            f"At equal start time, {len(ratios)} starts of {names}; nearest: {said}.",
        )
    ]
