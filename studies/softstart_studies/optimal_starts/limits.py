"""The least K_dyn over the start time: what no start undercuts, where it is 1, and the controllers."""

from __future__ import annotations

import math
from dataclasses import dataclass

from softstart.optimal.bounds import momentum_bound
from softstart.optimal.descent import Descent
from softstart.optimal.front import ControllerPoint, Front
from softstart.optimal.optimize import optimize
from softstart.optimal.problem import Problem
from softstart.optimal.pulse_coast_hold import PulseCoastHoldStarts
from softstart.profile import TorqueProfile
from softstart.study import Claim, Progress, Table, Verdict
from softstart_studies.crane import percent
from softstart_studies.optimal_starts.drives import (
    Extent,
    crane,
    direct_time,
    front_times,
    gap_of,
    of_points,
    optima,
    shortest_time,
)

AGREE = 2.5e-3  # of two methods
MULTIPLE = 1.2  # of the start time of direct, at which the descent is asked too
GAPS, MULTIPLES = (0.5, 1.0, 2.0), (1.2, 1.35)  # rad; of the start time of direct at the first gap


def fronts(extent: Extent, progress: Progress) -> list[Front]:
    """One a gap, terminal reached, the controllers beside it."""
    return [
        optima(crane(gap), front_times(gap, extent.points), "reached", progress, extent.controllers)
        for gap in extent.gaps
    ]


@dataclass(frozen=True)
class Limit:
    """Figures of one gap that the closed form gives."""

    gap: float
    time_of_one: float  # s: the start time whose least K_dyn is 1
    floor: float  # K_dyn that even the load, falling back through the gap by itself, brings


def limit(gap: float) -> Limit:
    """From the closed form.

    >>> one = limit(0.5)
    >>> round(one.time_of_one, 4), round(one.floor, 3)
    (0.2593, 0.304)
    """
    drive = crane(gap)
    starts = PulseCoastHoldStarts.of(Problem(drive, 1.0))
    P = drive.mean_torque
    course = starts.course(P)
    at_peak = starts.load_speed(course, course.t_peak, P)
    time = course.t_peak + (float(drive.target_speed) - at_peak) * starts.J2 / (P - starts.Mc)
    return Limit(gap, time, starts.least_peak / P)


def any_contacts_bound(front: Front, one: ControllerPoint) -> float:
    """What no torque over time undercuts at the controller's start time, however often the gap closes."""
    if math.isnan(one.start_time):
        return math.nan
    return momentum_bound(Problem(front.drive, one.start_time, "reached")).k_dyn


def tables(found: list[Front]) -> tuple[Table, ...]:
    """The curves, and each controller against the optimum and the bound of any start."""
    points = [(gap_of(front), point) for front in found for point in front.points]
    judged = [
        (gap_of(front), one, any_contacts_bound(front, one))
        for front in found
        for one in sorted(front.controllers, key=lambda c: c.ratio or math.inf)
    ]
    return (
        Table.of("Least K_dyn over the start time, reached", {
            "gap, rad": [gap for gap, _ in points],
            "x direct": [point.start_time_bound / direct_time(gap) for gap, point in points],
            **of_points([point for _, point in points]),
        }),
        Table.of("Controllers against the limit at their own start time", {
            "gap, rad": [gap for gap, _, _ in judged],
            "controller": [one.name for _, one, _ in judged],
            "start time, s": [one.start_time for _, one, _ in judged],
            "K_dyn": [one.k_dyn for _, one, _ in judged],
            "optimum": [one.optimum.k_dyn if one.optimum else None for _, one, _ in judged],
            "ratio": [one.ratio for _, one, _ in judged],
            "any contacts: at least": [bound for *_, bound in judged],
            "ratio at most": [one.k_dyn / bound for _, one, bound in judged],
        }),
    )  # fmt: skip


def claims(found: list[Front], progress: Progress) -> list[Claim]:
    """The form of the optimum, the range below 1, the controllers, and constant torque."""
    return [
        pulse_coast_hold(found, progress), below_one(found), method_2(found), no_controller_below(found),
        constant_torque(found),
    ]  # fmt: skip


def pulse_coast_hold(found: list[Front], progress: Progress) -> Claim:
    """K_dyn of the form against a bound proved without it, and against another method."""
    points = [p for front in found for p in front.points if p.k_dyn is not None]
    formed = [p for p in points if p.method == "closed-form"]
    others = [p.k_dyn for p in points if p.method == "descent"]
    most = max((p.k_dyn or 0.0 for p in formed), default=0.0)
    apart = max(abs((p.k_dyn or 0.0) / (p.k_dyn_lower_bound or 1.0) - 1.0) for p in formed)
    gap = gap_of(found[0])
    time = MULTIPLE * direct_time(gap)
    progress(f"gap {gap:g} rad: descent beside the closed form")
    form, program = optimize(crane(gap), time, terminal="reached").k_dyn, descended(gap, time)
    return Claim(
        "Pulse, coast, hold is optimal for an undamped drive with an active load while the hold is within "
        "Ms.",
        Verdict.of(apart < 1e-6 and abs(program / form - 1.0) < AGREE),
        f"At {len(formed)} start times K_dyn, {most:.3f} at most, is that of the bound to {apart:.0e}; the "
        "bound is proved for every torque from 0 to Ms and any number of contacts. The descent from "
        f"constant torque, which does not know the form, finds {program:.5f} for {form:.5f} at {gap:g} rad "
        f"and {time:.4f} s. u_eq(P) = Ms at K_dyn = 1: at the {len(others)} shorter start times the least "
        f"K_dyn is {min(filter(None, others), default=math.nan):.3f} or more, and another form is needed.",
    )


def descended(gap: float, time: float) -> float:
    """K_dyn of the descent from constant torque, terminal reached.

    >>> round(descended(0.5, 0.2883042), 3)
    0.909
    """
    search = Descent(Problem(crane(gap), time, "reached"), time)
    found = search.down(TorqueProfile([0.0], [search.high]), soft=40)
    assert found is not None
    return search.refined(found).peak / search.base


def below_one(found: list[Front]) -> Claim:
    """From which start time on."""
    limits = [limit(gap_of(front)) for front in found]
    least = min(p.k_dyn for front in found for p in front.points if p.k_dyn is not None)
    said = "; ".join(
        f"from {one.time_of_one:.4f} s on at {one.gap:g} rad ({one.time_of_one / direct_time(one.gap):.3f} "
        "x direct)"
        for one in limits
    )
    floors = ", ".join(f"{one.floor:.3f} at {one.gap:g} rad" for one in limits)
    return Claim(
        "K_dyn below 1 is possible.",
        Verdict.of(least < 1.0),
        f"{said}; down to {least:.3f} within the start times shown. However long it takes, not below "
        f"{floors}: so hard does the active load fall on the flank by itself, with no motor torque at all.",
    )


def method_2(found: list[Front]) -> Claim:
    """As shipped, over the whole start."""
    said, ratios, closest = [], [], []
    for front in found:
        (one,) = (c for c in front.controllers if c.name == "reduced-two-stage")
        best, gap = front.gentlest, gap_of(front)
        if best is not None:
            closest.append(f"{best.name} x{best.ratio:.2f} at {gap:g} rad")
        if one.ratio is not None and one.optimum is not None:
            ratios.append(one.ratio)
            said.append(
                f"{one.k_dyn:.3f} at {gap:g} rad, where {one.optimum.k_dyn:.3f} can be had in the same "
                f"{one.start_time:.4f} s (x{one.ratio:.2f})"
            )
    return Claim(
        "Method 2 of [G] is close to the optimum.",
        Verdict.of(max(ratios) < 1.1),
        f"Over the whole start it has K_dyn {'; '.join(said)}. The gentlest controller: "
        f"{'; '.join(closest)}.",
    )


def no_controller_below(found: list[Front]) -> Claim:
    """None contradicts the bound for any number of contacts."""
    all_ratios = [one.k_dyn / any_contacts_bound(front, one) for front in found for one in front.controllers]
    ratios = [ratio for ratio in all_ratios if not math.isnan(ratio)]
    return Claim(
        "No controller gets below the bound that holds for any number of contacts.",
        Verdict.of(min(ratios) >= 1.0),
        f"The smallest ratio of K_dyn to that bound is {min(ratios):.3f}, over {len(ratios)} starts of all "
        "shipped controllers, at their own start times.",
    )


def constant_torque(found: list[Front]) -> Claim:
    """The quickest start found beside the one under the full torque all the way."""
    gaps = [gap_of(front) for front in found]
    ratios = [shortest_time(gap) / direct_time(gap) for gap in gaps]
    said = "; ".join(
        f"{gap:g} rad: {shortest_time(gap):.4f} s, constant torque {direct_time(gap):.4f} s "
        f"({percent(ratio, 1)})"
        for gap, ratio in zip(gaps, ratios, strict=True)
    )
    return Claim(
        "(Not in [G]) No start is quicker than one under constant torque.",
        Verdict.of(min(ratios) >= 1.0),
        f"Shortest start time found, reached, K_dyn free: {said}. The load has its speed first at the top "
        "of a swing of the shaft, and a pause in the torque can make that swing larger.",
    )


def optimum_depends_on_gap() -> Claim:
    """At equal start time; what a wide gap takes is time."""
    times = [multiple * direct_time(GAPS[0]) for multiple in MULTIPLES]
    found = {time: [optimize(crane(gap), time, terminal="reached").k_dyn for gap in GAPS] for time in times}
    said = "; ".join(f"{time:.4f} s: {', '.join(f'{one:.4f}' for one in k)}" for time, k in found.items())
    spread = [max(k) / min(k) for k in found.values()]
    return Claim(
        "The optimum is invariant to the gap.",
        Verdict.of(max(spread) < 1.01),
        f"Least K_dyn at {', '.join(f'{gap:g}' for gap in GAPS)} rad in the same start time: {said}; "
        f"largest over least {max(spread):.3f} to {min(spread):.3f}. Torque profile and K_dyn both depend on "
        "it; what does not is the form (pulse, coast, hold).",
    )
