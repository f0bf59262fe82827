"""What became of the statements of [C], each with the number that decides it."""

from __future__ import annotations

import math

from softstart.clutch import Engagement, EngagementFront
from softstart.clutch.least_work import Slip
from softstart.study import Claim, Table
from softstart_studies.paper_c.printed import KGF, PRINTED, clutch


def claims(
    runs: dict[str, Engagement], search: Table, several: bool, found: tuple[EngagementFront, ...]
) -> tuple[Claim, ...]:
    """All of them."""
    return (
        _table(runs, search, several),
        _order(runs),
        _law_matters(runs),
        _best(runs, found),
        _slips_again(runs),
    )


def _table(runs: dict[str, Engagement], search: Table, several: bool) -> Claim:
    met = sum(isinstance(row[3], int) and row[3] > 0 for row in search.rows)
    linear = runs["linear"].slip_peak_torque / KGF
    more = "some choices meet several" if several else "no set of choices meets more than one"
    return Claim(
        "The table of results follows from equations (1)-(3) and the data printed with it.",
        "refuted",
        f"Only the linear peak does: {linear:.2f}, printed 64.6 (cut, not rounded). Of the six figures {met} "
        f"is met by "
        f"any of the readings tried, and {more}.",
    )


def _order(runs: dict[str, Engagement]) -> Claim:
    """Energy alone forbids the printed order of the linear and the exponential law."""
    slip = Slip.of(clutch())
    radius = max(row.Md for row in PRINTED) * KGF - slip.Tm
    v = slip.B * radius / slip.cp
    stored = 0.5 * slip.Ic * v**2 + slip.Mc * (slip.kappa * v) ** 2 / (2.0 * slip.g)
    stored += 4.0 * (slip.Tm - slip.T0) * radius / (2.0 * slip.cp)
    lag = _steady_work(slip, "exponential") - _steady_work(slip, "linear")
    ours = (runs["exponential"].slip_work - runs["linear"].slip_work) / KGF
    by_row = {row.law: row.L for row in PRINTED}
    gap = by_row["exponential"] - by_row["linear"]
    least = (lag - stored) / KGF
    return Claim(
        "The exponential law costs less friction work than the linear one.",
        "confirmed" if ours < 0 else "refuted",
        f"It costs {ours:.0f} kgf m more; printed: {-gap:.0f} less. Its torque is below the linear one at "
        f"every instant, "
        f"so the masses lag {lag / KGF:.0f} kgf m behind, and what the oscillation stores at the lock-up can "
        f"take back at "
        f"most {stored / KGF:.0f} even with the largest printed peak: the difference is above {least:.0f}, "
        f"so the "
        "printed order cannot come from these equations and data, whatever the oscillation.",
    )


def _steady_work(slip: Slip, law: str) -> float:
    """I w0^2/2 + Mc (A + D^2/2g): the friction work without what the oscillation stores, J."""
    # first and second integral of M/MM over 0..tM
    once, twice = {
        "linear": (0.5, 1.0 / 6.0),
        "exponential": ((math.e - 2.0) / (math.e - 1.0), (math.e - 2.5) / (math.e - 1.0)),
    }[law]
    gained = slip.MM * once * slip.tM - slip.Mc * slip.tM
    D = slip.w0 - gained / slip.I
    A = slip.w0 * slip.tM - (slip.MM * twice - 0.5 * slip.Mc) * slip.tM**2 / slip.I
    return 0.5 * slip.I * slip.w0**2 + slip.Mc * (A + D**2 / (2.0 * slip.g))


def _law_matters(runs: dict[str, Engagement]) -> Claim:
    works = {name: run.slip_work / KGF for name, run in runs.items()}
    peaks = {name: run.slip_peak_torque / KGF for name, run in runs.items()}
    least, most = min(works, key=lambda n: works[n]), max(works, key=lambda n: works[n])
    low, high = min(peaks, key=lambda n: peaks[n]), max(peaks, key=lambda n: peaks[n])
    return Claim(
        "The engagement law changes the load of the elements: the linear law has the lowest peak, the "
        "quadratic one "
        "the least friction work.",
        "confirmed" if low == "linear" and least == "quadratic-concave" else "partly",
        f"Work from {works[least]:.0f} ({least}) to {works[most]:.0f} kgf m ({most}), peak from "
        f"{peaks[low]:.2f} ({low}) "
        f"to {peaks[high]:.2f} kgf m ({high}). I w0^2/2 = "
        f"{0.5 * Slip.of(clutch()).I * 230.0**2 / KGF:.0f} kgf m of the work is the same for every law.",
    )


def _best(runs: dict[str, Engagement], found: tuple[EngagementFront, ...]) -> Claim:
    any_law, rising = (one.points[0] for one in found)
    linear = runs["linear"]
    bound = min(any_law.work_bound, rising.work_bound) / KGF
    return Claim(
        "By the law of engagement the load of the elements can be made the least possible.",
        "confirmed",
        f"No law that slips a period beyond tM has a peak below {any_law.run.clutch.mean_torque / KGF:.2f} "
        f"kgf m. At that "
        f"peak the least work found is {any_law.slip_work / KGF:.0f} kgf m for any law (none has less than "
        f"{bound:.0f}) "
        f"and {rising.slip_work / KGF:.0f} for a nondecreasing one (bound {rising.work_bound / KGF:.0f}): "
        f"against the "
        f"linear law {100 * (1 - any_law.peak_torque / linear.slip_peak_torque):.1f} % less peak and "
        f"{100 * (1 - any_law.slip_work / linear.slip_work):.1f} % less work at once. All laws of [C] are "
        f"dominated.",
    )


def _slips_again(runs: dict[str, Engagement]) -> Claim:
    again = {name: run for name, run in runs.items() if run.friction_work > run.slip_work * (1.0 + 1e-12)}
    told = "; ".join(
        f"{name}: shaft torque reaches {run.locked_peak_torque / KGF:.2f} kgf m, the clutch slips again and "
        f"takes "
        f"{(run.friction_work - run.slip_work) / KGF:.0f} kgf m more"
        for name, run in again.items()
    )
    return Claim(
        "The engagement is over when slip ends (tau1).",
        "partly" if again else "confirmed",
        (f"{told}. " if told else "") + "With the other laws the clutch holds.",
    )
