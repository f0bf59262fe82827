"""What became of the statements of [C], each with the number that decides it."""

from __future__ import annotations

import math

from softstart.clutch import Engagement
from softstart.study import Claim, Table
from softstart_studies.paper_c.fronts import EngagementFront
from softstart_studies.paper_c.least_work import Slip
from softstart_studies.paper_c.printed import KGF, PRINTED, clutch


def claims(
    runs: dict[str, Engagement], search: Table, several: bool, found: tuple[EngagementFront, ...]
) -> tuple[Claim, ...]:
    """All of them."""
    table, best = _table(runs, search, several), _best(runs, found)
    return table, _order(runs), _law_matters(runs), best, _slips_again(runs)


def _table(runs: dict[str, Engagement], search: Table, several: bool) -> Claim:
    met = sum(row[-1] != 0 for row in search.rows)
    linear = runs["linear"].slip_peak_torque / KGF
    more = "some choices meet several" if several else "no set of choices meets more than one"
    return Claim(
        "The table of results follows from equations (1)-(3) and the data printed with it.",
        "refuted",
        f"Only the linear peak does: {linear:.2f}, printed 64.6 (cut, not rounded). Of the six figures "
        f"{met} is met by any of the readings tried, and {more}.",
    )


def _order(runs: dict[str, Engagement]) -> Claim:
    """Energy alone forbids the printed order of the linear and the exponential law."""
    slip = Slip(clutch())
    # first and second integral of M/MM over 0 .. tM = 1 s
    e = math.e
    lag = _steady_work(slip, (e - 2.0) / (e - 1.0), (e - 2.5) / (e - 1.0)) - _steady_work(
        slip, 0.5, 1.0 / 6.0
    )
    radius = max(row.Md for row in PRINTED) * KGF - slip.Tm
    v = slip.B * radius / slip.cp
    stored = 0.5 * slip.Ic * v**2 + slip.Mc * (slip.kappa * v) ** 2 / (2.0 * slip.g)
    stored += 4.0 * (slip.Tm - slip.T0) * radius / (2.0 * slip.cp)
    ours = (runs["exponential"].slip_work - runs["linear"].slip_work) / KGF
    printed = {row.law: row.L for row in PRINTED}
    return Claim(
        "The exponential law costs less friction work than the linear one.",
        "confirmed" if ours < 0 else "refuted",
        f"It costs {ours:.0f} kgf m more; printed: {printed['linear'] - printed['exponential']} less. Its "
        f"torque is below the linear one at every instant, so the masses lag {lag / KGF:.0f} kgf m behind, "
        f"and what the oscillation stores at the lock-up can take back at most {stored / KGF:.0f} even "
        f"with the largest printed peak: the difference is above {(lag - stored) / KGF:.0f}, so the "
        "printed order cannot come from these equations and data, whatever the oscillation.",
    )


def _steady_work(slip: Slip, once: float, twice: float) -> float:
    """I w0^2/2 + Mc (A + D^2/2g): the friction work without what the oscillation stores, J."""
    D = slip.w0 - (slip.MM * once - slip.Mc) * slip.tM / slip.I
    A = slip.w0 * slip.tM - (slip.MM * twice - 0.5 * slip.Mc) * slip.tM**2 / slip.I
    return 0.5 * slip.I * slip.w0**2 + slip.Mc * (A + D**2 / (2.0 * slip.g))


def _law_matters(runs: dict[str, Engagement]) -> Claim:
    works = {name: run.slip_work / KGF for name, run in runs.items()}
    peaks = {name: run.slip_peak_torque / KGF for name, run in runs.items()}
    least, most = min(works, key=works.__getitem__), max(works, key=works.__getitem__)
    low, high = min(peaks, key=peaks.__getitem__), max(peaks, key=peaks.__getitem__)
    slip = Slip(clutch())
    return Claim(
        "The engagement law changes the load of the elements: the linear law has the lowest peak, the "
        "quadratic one the least friction work.",
        "confirmed" if low == "linear" and least == "quadratic-concave" else "partly",
        f"Work from {works[least]:.0f} ({least}) to {works[most]:.0f} kgf m ({most}), peak from "
        f"{peaks[low]:.2f} ({low}) to {peaks[high]:.2f} kgf m ({high}). I w0^2/2 = "
        f"{0.5 * slip.I * slip.w0**2 / KGF:.0f} kgf m of the work is the same for every law.",
    )


def _best(runs: dict[str, Engagement], found: tuple[EngagementFront, ...]) -> Claim:
    any_law, rising = (one.points[0] for one in found)
    linear = runs["linear"]
    bound = min(any_law.work_bound, rising.work_bound) / KGF
    return Claim(
        "By the law of engagement the load of the elements can be made the least possible.",
        "confirmed",
        f"No law that slips a period beyond tM has a peak below {any_law.run.clutch.mean_torque / KGF:.2f} "
        f"kgf m. At that peak the least work found is {any_law.slip_work / KGF:.0f} kgf m for any law "
        f"(none has less than {bound:.0f}) and {rising.slip_work / KGF:.0f} for a nondecreasing one (bound "
        f"{rising.work_bound / KGF:.0f}): against the linear law "
        f"{100 * (1 - any_law.peak_torque / linear.slip_peak_torque):.1f} % less peak and "
        f"{100 * (1 - any_law.slip_work / linear.slip_work):.1f} % less work at once. All laws of [C] are "
        "dominated.",
    )


def _slips_again(runs: dict[str, Engagement]) -> Claim:
    again = [
        f"{name}: shaft torque reaches {run.locked_peak_torque / KGF:.2f} kgf m, the clutch slips again "
        f"and takes {(run.friction_work - run.slip_work) / KGF:.0f} kgf m more"
        for name, run in runs.items()
        if run.friction_work > run.slip_work * (1.0 + 1e-12)
    ]
    return Claim(
        "The engagement is over when slip ends (tau1).",
        "partly" if again else "confirmed",
        (f"{'; '.join(again)}. " if again else "") + "With the other laws the clutch holds.",
    )
