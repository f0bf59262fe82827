"""The least K_dyn over the start time, and how far each controller is from it at its own start time."""

from __future__ import annotations

import math

from softstart.optimal.bounds import momentum_bound
from softstart.optimal.front import ControllerPoint, Front
from softstart.optimal.problem import Problem
from softstart.study import Claim, Progress, Table, Verdict
from softstart_studies.optimal_starts.crane import (
    Extent,
    crane,
    direct_time,
    front_times,
    gap_of,
    optima,
    percent,
    rounded,
    shortest_time,
)


def fronts(extent: Extent, progress: Progress) -> list[Front]:
    """One a gap, terminal reached, the controllers beside it."""
    return [
        optima(crane(gap), front_times(gap, extent.points), "reached", progress, extent.controllers)
        for gap in extent.gaps
    ]


def table(found: list[Front]) -> Table:
    """The curves."""
    return Table(
        "Least K_dyn over the start time, reached",
        ("gap, rad", "start time, s", "x direct", "K_dyn", "at least", "bound", "above it, %", "method"),
        [
            (
                gap_of(front),
                rounded(point.start_time_bound),
                rounded(point.start_time_bound / direct_time(gap_of(front)), 3),
                rounded(point.k_dyn),
                rounded(point.k_dyn_lower_bound),
                point.bound_kind if point.found else point.status.lower(),
                rounded(point.gap_percent, 4),
                point.method or None,
            )
            for front in found
            for point in front.points
        ],
    )


def any_contacts_bound(front: Front, one: ControllerPoint) -> float | None:
    """What no torque over time undercuts at the controller's start time, however often the gap closes."""
    if math.isnan(one.start_time):
        return None
    return momentum_bound(Problem(front.drive, one.start_time, "reached")).k_dyn


def controllers_table(found: list[Front]) -> Table:
    """Each controller against the optimum, and against the bound of any start at all."""
    rows = []
    for front in found:
        for one in sorted(front.controllers, key=lambda c: c.ratio or math.inf):
            bound = any_contacts_bound(front, one)
            rows.append(
                (
                    gap_of(front),
                    one.name,
                    rounded(one.start_time, 4),
                    rounded(one.k_dyn, 4),
                    rounded(one.optimum.k_dyn if one.optimum else None, 4),
                    rounded(one.ratio, 3),
                    rounded(bound, 4),
                    rounded(one.k_dyn / bound if bound else None, 3),
                )
            )
    return Table(
        "Controllers against the limit at their own start time",
        (
            "gap, rad",
            "controller",
            "start time, s",
            "K_dyn",
            "optimum",
            "ratio",
            "any contacts: at least",
            "ratio at most",
        ),
        rows,
    )


def nearest(front: Front) -> ControllerPoint:
    """The controller with the smallest ratio to the optimum."""
    return min((one for one in front.controllers if one.ratio is not None), key=lambda one: one.ratio or 0.0)


def claims(found: list[Front]) -> list[Claim]:
    """Method 2, the controllers, and constant torque."""
    return [method_2(found), no_controller_below(found), constant_torque(found)]


def method_2(found: list[Front]) -> Claim:
    """As shipped, over the whole start."""
    said, ratios = [], []
    for front in found:
        (one,) = (c for c in front.controllers if c.name == "reduced-two-stage")
        assert one.optimum is not None
        if one.ratio is not None:
            ratios.append(one.ratio)
            said.append(
                f"{one.k_dyn:.3f} at {gap_of(front):g} rad, where {one.optimum.k_dyn:.3f} can be had in "
                f"the same {one.start_time:.4f} s (x{one.ratio:.2f})"
            )
    near = max(ratios) < 1.1
    closest = "; ".join(
        f"{nearest(front).name} x{nearest(front).ratio:.2f} at {gap_of(front):g} rad" for front in found
    )
    return Claim(
        "Method 2 of [G] is close to the optimum.",
        Verdict.CONFIRMED if near else Verdict.REFUTED,
        f"Over the whole start it has K_dyn {'; '.join(said)}. Nearest of all controllers: {closest}.",
    )


def no_controller_below(found: list[Front]) -> Claim:
    """None contradicts the bound for any number of contacts."""
    least, count = math.inf, 0
    for front in found:
        for one in front.controllers:
            bound = any_contacts_bound(front, one)
            if bound is not None:
                count += 1
                least = min(least, one.k_dyn / bound)
    return Claim(
        "No controller gets below the bound that holds for any number of contacts.",
        Verdict.CONFIRMED if least >= 1.0 else Verdict.REFUTED,
        f"The smallest ratio of K_dyn to that bound is {least:.3f}, over {count} starts of all shipped "
        "controllers, at their own start times.",
    )


def constant_torque(found: list[Front]) -> Claim:
    """The quickest start found beside the one under the full torque all the way."""
    gaps = [gap_of(front) for front in found]
    ratios = [shortest_time(gap) / direct_time(gap) for gap in gaps]
    said = "; ".join(
        f"{gap:g} rad: {shortest_time(gap):.4f} s, constant torque {direct_time(gap):.4f} s "
        f"({percent(ratio)})"
        for gap, ratio in zip(gaps, ratios, strict=True)
    )
    return Claim(
        "(Not in [G]) No start is quicker than one under constant torque.",
        Verdict.REFUTED if min(ratios) < 1.0 else Verdict.CONFIRMED,
        f"Shortest start time found, reached, K_dyn free: {said}. The load has its speed first at the top "
        "of a swing of the shaft, and a pause in the torque can make that swing larger.",
    )
