"""What method 2 comes to over the whole start: the second contact, which [G] does not look at."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from softstart import Run, simulate
from softstart.arrays import Vector
from softstart.study import Claim, Table, Verdict
from softstart_studies.paper_g.crane import (
    CRANE,
    GAP_1,
    GAP_2,
    HEAVY,
    METHODS,
    RATIOS,
    SHARE,
    closed_form,
    crane,
    ratio_where,
    simulated,
)
from softstart_studies.paper_g.switching import SwitchAfterContact

R: Vector = RATIOS[4:]  # 0.05 to 1, as the points of figs. 2-4
TABLED = (5, 10, 15, 20, 25, 30, 40, 50, 75, 100)  # hundredths of M1/Ms
DAMPING_RATIO = 0.05  # d Omega/(2 c), what a real shaft may have; [G] has none


@dataclass(frozen=True)
class WholeStart:
    """K_dyn over M1/Ms at one gap, by simulation of the whole start."""

    gap: float
    r: Vector
    method_1: Vector
    first_contact: Vector  # method 2
    whole: Vector  # method 2
    at_peak: Vector  # torque raised at the peak of stage 2, whole start


def at_peak(gap: float, r: float) -> Run:
    """A start with the torque raised at the peak of stage 2, [G](14): half of stage 2 after contact.

    T is then at its turning point: it goes on to swing about M12avg_base by what it is away from it, so
    K_dyn = max(K, 2 - K) with K of [G](18), for the whole start.

    >>> round(at_peak(0.5, 0.25).k_dyn, 4)
    1.2677
    """
    drive = crane(HEAVY, gap)
    half = 0.5 * float(closed_form(drive, r, 2).contact_duration)
    return simulate(drive, SwitchAfterContact(torque=r * float(drive.Ms), delay=half))


def whole_start(gap: float) -> WholeStart:
    """All starts at one gap.

    >>> found = whole_start(0.5)
    >>> bool(np.allclose(found.whole, found.method_1, rtol=1e-12))
    True
    """
    drive = crane(HEAVY, gap)
    second = [simulated(drive, float(r), 2) for r in R]
    return WholeStart(
        gap,
        R,
        np.array([simulated(drive, float(r), 1).k_dyn for r in R]),
        np.array([run.k_dyn_first_contact for run in second]),
        np.array([run.k_dyn for run in second]),
        np.array([at_peak(gap, float(r)).k_dyn for r in R]),
    )


def table(starts: list[WholeStart]) -> Table:
    """Method 2 at first contact and over the whole start, beside method 1 and the torque raised at the "
    "peak.
    """
    rows = [
        tuple(round(float(x), 6) for x in (start.gap, *values))
        for start in starts
        for values in zip(
            start.r, start.method_1, start.first_contact, start.whole, start.at_peak, strict=True
        )
        if round(100 * float(values[0])) in TABLED
    ]
    return Table(
        "K_dyn over the whole start",
        (
            "gap, rad",
            "M1/Ms",
            "method 1",
            "method 2: first contact",
            "whole start",
            "at peak: whole start",
        ),
        rows,
    )


def claims(starts: list[WholeStart]) -> list[Claim]:
    """The preference of [G] for method 2, and what would keep its promise."""
    return [method_2_is_gentler(starts), raising_at_the_peak(starts)]


def method_2_is_gentler(starts: list[WholeStart]) -> Claim:
    """The torque raised at the end of stage 2 meets an open gap whose flanks part at the speed of impact."""
    apart = max(float(np.max(np.abs(start.whole / start.method_1 - 1.0))) for start in starts)
    first, second = (simulated(crane(), SHARE, method) for method in METHODS)
    damped = crane().replace(damping=2 * DAMPING_RATIO * CRANE.c / CRANE.Omega)
    soft_1, soft_2 = (simulated(damped, SHARE, method) for method in METHODS)
    worn = starts[-1]
    quarter = int(np.argmin(np.abs(worn.r - SHARE)))
    return Claim(
        "Method 2 is to be preferred, for it lowers the shock further than method 1.",
        Verdict.REFUTED if apart < 1e-9 else Verdict.PARTLY,
        "Only until stage 3. The gap opens again with the flanks parting at the speed they met with, and "
        "Ms, raised there, "
        "brings them back at it: over the whole start method 2 has the K of method 1 at every M1/Ms and "
        "both gaps (largest "
        f"difference {apart:.0e}, {sum(len(s.r) for s in starts)} pairs of starts). At M1/Ms = 0.25 and "
        "0.5 rad: first "
        f"contact {second.k_dyn_first_contact:.4f}, second {second.k_dyn:.4f}, method 1 "
        f"{first.k_dyn:.4f}, and "
        f"{1000 * (second.start_time - first.start_time):.0f} ms later at its target speed; at 2 rad "
        f"{worn.first_contact[quarter]:.4f}, {worn.whole[quarter]:.4f}, {worn.method_1[quarter]:.4f}. "
        "Damping of "
        f"{100 * DAMPING_RATIO:.0f} % of the critical one leaves {soft_2.k_dyn_first_contact:.4f}, "
        f"{soft_2.k_dyn:.4f} and "
        f"{soft_1.k_dyn:.4f} at 0.5 rad.",
    )


def raising_at_the_peak(starts: list[WholeStart]) -> Claim:
    """Not in [G]: half the delay does what method 2 promises."""
    promised = [np.maximum(start.first_contact, 2.0 - start.first_contact) for start in starts]
    apart = max(
        float(np.max(np.abs(start.at_peak / k - 1.0))) for start, k in zip(starts, promised, strict=True)
    )
    best = ratio_where(1.0, crane(), 2)
    return Claim(
        "(Not in [G]) Raised at the peak of stage 2, (14), instead of its end, (15), the torque keeps "
        "what (18) promises.",
        Verdict.CONFIRMED if apart < 1e-9 else Verdict.PARTLY,
        f"K of the whole start is max(K, 2 - K) with K of (18), to {apart:.0e} in "
        f"{sum(len(s.r) for s in starts)} starts: "
        f"{at_peak(GAP_1, SHARE).k_dyn:.4f} at 0.5 rad and {at_peak(GAP_2, SHARE).k_dyn:.4f} at 2 rad for "
        "M1/Ms = 0.25, and "
        f"{at_peak(GAP_1, best).k_dyn:.4f}, with no oscillation left, for M1/Ms = {best:.4f} at 0.5 rad.",
    )
