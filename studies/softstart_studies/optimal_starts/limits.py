"""Where K_dyn = 1 lies, what no start undercuts, and whether pulse, coast, hold is the optimum."""

from __future__ import annotations

from dataclasses import dataclass

from softstart.optimal.descent import Descent
from softstart.optimal.front import Front
from softstart.optimal.optimize import optimize
from softstart.optimal.problem import Problem
from softstart.optimal.pulse_coast_hold import PulseCoastHold
from softstart.profile import TorqueProfile
from softstart.study import Claim, Progress, Table, Verdict
from softstart_studies.optimal_starts.crane import crane, direct_time, gap_of, rounded, shortest_time

AGREE = 2.5e-3  # of two methods
MULTIPLE = 1.2  # of the start time of direct, at which the descent is asked too


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
    starts = PulseCoastHold.of(Problem(drive, 1.0))
    P = drive.mean_torque
    course = starts.course(P)
    at_peak = starts.load_speed(course, course.t_peak, P)
    time = course.t_peak + (float(drive.target_speed) - at_peak) * starts.J2 / (P - starts.Mc)
    return Limit(gap, time, starts.least_peak / P)


def table(found: list[Front]) -> Table:
    """Both figures of each gap."""
    rows = []
    for front in found:
        one = limit(gap_of(front))
        rows.append(
            (
                one.gap,
                rounded(direct_time(one.gap)),
                rounded(shortest_time(one.gap)),
                rounded(one.time_of_one),
                rounded(one.time_of_one / direct_time(one.gap), 3),
                rounded(one.floor, 4),
            )
        )
    return Table(
        "Landmarks: undamped, active load, reached",
        (
            "gap, rad",
            "direct, s",
            "shortest found, s",
            "K_dyn = 1 at, s",
            "x direct",
            "K_dyn however long it takes",
        ),
        rows,
    )


def claims(found: list[Front], progress: Progress) -> list[Claim]:
    """The form of the optimum, and the range below 1."""
    return [pulse_coast_hold(found, progress), below_one(found)]


def pulse_coast_hold(found: list[Front], progress: Progress) -> Claim:
    """K_dyn of the form against a bound proved without it, and against another method."""
    points = [p for front in found for p in front.points if p.method == "closed-form"]
    apart = max(abs((p.k_dyn or 0.0) / (p.k_dyn_lower_bound or 1.0) - 1.0) for p in points)
    others = [
        p.k_dyn for front in found for p in front.points if p.method == "descent" and p.k_dyn is not None
    ]
    gap = gap_of(found[0])
    time = MULTIPLE * direct_time(gap)
    progress(f"gap {gap:g} rad: descent beside the closed form")
    form, program = optimize(crane(gap), time, terminal="reached").k_dyn, descended(gap, time)
    holds = apart < 1e-6 and abs(program / form - 1.0) < AGREE
    return Claim(
        "Pulse, coast, hold is optimal for an undamped drive with an active load while the hold is within "
        "Ms.",
        Verdict.CONFIRMED if holds else Verdict.REFUTED,
        f"At {len(points)} start times K_dyn, {max(p.k_dyn or 0.0 for p in points):.3f} at most, is that "
        "of the bound to "
        f"{apart:.0e}; the bound is proved for every torque from 0 to Ms and any number of contacts. The "
        "descent from constant torque, which does not know the form, finds "
        f"{program:.5f} for {form:.5f} at {gap:g} rad and {time:.4f} s. "
        f"u_eq(P) = Ms at K_dyn = 1: at the {len(others)} shorter start times the least K_dyn is "
        f"{min(others, default=float('nan')):.3f} or more, and another form is needed.",
    )


def descended(gap: float, time: float) -> float:
    """K_dyn of the descent from constant torque, terminal reached.

    >>> round(descended(0.5, 0.2883042), 3)
    0.909
    """
    search = Descent(Problem(crane(gap), time, "reached"))
    found = search.down(TorqueProfile([0.0], [search.high]), time)
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
        Verdict.CONFIRMED if least < 1.0 else Verdict.REFUTED,
        f"{said}; down to {least:.3f} within the start times shown. However long it takes, not below "
        f"{floors}: so hard does the active load fall on the flank by itself, with no motor torque at all.",
    )
