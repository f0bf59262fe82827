"""What [G] says of the two methods, the gap and the inertia: K_dyn of stage 2."""

from __future__ import annotations

import numpy as np

from softstart.study import Claim, Verdict
from softstart_studies.paper_g.crane import (
    CRANE,
    GAP_1,
    GAP_2,
    HEAVY,
    LIGHT,
    METHODS,
    RATIOS,
    SHARE,
    Method,
    base,
    closed_form,
    crane,
    percent,
    ratio_where,
)


def k_dyn(ratio: float, gap: float, r: float, method: Method, *, own_base: bool = False) -> float:
    """K_dyn of stage 2 by the closed form, on the base of J2'' = 5 J1 unless that of the drive is asked for.

    >>> round(k_dyn(2, 0.5, 1.0, 1), 4), round(k_dyn(2, 0.5, 1.0, 1, own_base=True), 4)
    (2.7157, 3.2834)
    """
    return float(closed_form(crane(ratio, gap), r, method, None if own_base else base()).k_dyn)


def of_methods() -> list[Claim]:
    """The two methods.

    >>> [claim.verdict.value for claim in of_methods()]
    ['confirmed', 'confirmed']
    """
    return [method_1_stays_above_2(), method_2_goes_below_2()]


def of_gap_and_inertia() -> list[Claim]:
    """Gap and inertia.

    >>> [claim.verdict.value for claim in of_gap_and_inertia()]
    ['confirmed', 'partly', 'refuted']
    """
    return [wider_gap(), smaller_inertia(), least_k_dyn()]


def method_1_stays_above_2() -> Claim:
    """The least K_dyn of method 1 is that of r -> 0: it rises with r."""
    least_1, least_2 = (k_dyn(HEAVY, gap, 0.0, 1) for gap in (GAP_1, GAP_2))
    light, crossing = k_dyn(LIGHT, GAP_1, 0.0, 1), ratio_where(2.0, crane(LIGHT), 1, base())
    own = k_dyn(LIGHT, GAP_1, 0.0, 1, own_base=True)
    return Claim(
        "Method 1 damps the peak but cannot bring K_dyn below 2 at fixed J2.",
        Verdict.CONFIRMED if min(least_1, least_2, own) > 2.0 else Verdict.REFUTED,
        f"J2 = 5 J1: from {k_dyn(HEAVY, GAP_1, 1.0, 1):.4f} (direct) K falls to {least_1:.4f} as M1 -> 0 "
        "at 0.5 rad, "
        f"and from {k_dyn(HEAVY, GAP_2, 1.0, 1):.4f} to {least_2:.4f} at 2 rad. J2 = 2 J1 measured "
        "against the base "
        f"of 5 J1 does go below 2 for M1/Ms < {crossing:.3f}, down to {light:.4f}; against its own base "
        "it stays "
        f"above {own:.4f}.",
    )


def method_2_goes_below_2() -> Claim:
    """Up to which r the peak of stage 2 stays below 2."""
    reach = [ratio_where(2.0, crane(HEAVY, gap), 2) for gap in (GAP_1, GAP_2)]
    at_quarter = [k_dyn(HEAVY, gap, SHARE, 2) for gap in (GAP_1, GAP_2)]
    return Claim(
        "Method 2 can bring K_dyn of stage 2 below 2.",
        Verdict.CONFIRMED if min(reach) > 0.0 else Verdict.REFUTED,
        f"In stage 2 K < 2 for M1/Ms < {reach[0]:.4f} at 0.5 rad and < {reach[1]:.4f} at 2 rad; at M1/Ms "
        "= 0.25 it is "
        f"{at_quarter[0]:.4f} and {at_quarter[1]:.4f}. What comes after stage 2 is the next claim.",
    )


def wider_gap() -> Claim:
    """0.5 rad against 2 rad, all r."""
    rises = [
        np.asarray(closed_form(crane(HEAVY, GAP_2), RATIOS, method).k_dyn)
        / np.asarray(closed_form(crane(HEAVY, GAP_1), RATIOS, method).k_dyn)
        for method in METHODS
    ]
    first, second = (k_dyn(HEAVY, GAP_2, SHARE, m) / k_dyn(HEAVY, GAP_1, SHARE, m) for m in METHODS)
    direct = k_dyn(HEAVY, GAP_2, 1.0, 1) / k_dyn(HEAVY, GAP_1, 1.0, 1)
    return Claim(
        "A wider gap raises K_dyn markedly.",
        Verdict.CONFIRMED if min(float(rise.min()) for rise in rises) > 1.0 else Verdict.PARTLY,
        f"From 0.5 to 2 rad: {percent(direct)} for the direct start, at M1/Ms = 0.25 {percent(first)} "
        "with method 1 and "
        f"{percent(second)} with method 2; for every M1/Ms from 0.01 on at least "
        f"{percent(float(rises[0].min()))} and "
        f"{percent(float(rises[1].min()))}.",
    )


def smaller_inertia() -> Claim:
    """J2 = 2 J1 against 5 J1, common base and own base."""
    turn = float(CRANE.Mc) / float(CRANE.Ms)
    lower = {
        method: np.asarray(closed_form(crane(LIGHT), RATIOS, method, base()).k_dyn)
        < np.asarray(closed_form(crane(HEAVY), RATIOS, method, base()).k_dyn)
        for method in METHODS
    }
    as_said = bool(np.all(lower[1]) and np.all(lower[2] == (turn < RATIOS)))
    low = 0.05
    return Claim(
        "A smaller J2 lowers K_dyn.",
        Verdict.PARTLY if as_said else Verdict.REFUTED,
        f"From 5 J1 to 2 J1 at 0.5 rad, both against the base of 5 J1: direct "
        f"{k_dyn(HEAVY, GAP_1, 1.0, 1):.4f} to {k_dyn(LIGHT, GAP_1, 1.0, 1):.4f}, and so for every M1 "
        "with method 1; with "
        f"method 2 only while M1 > Mc (M1/Ms > {turn:.4f}): at {low:g} it rises from "
        f"{k_dyn(HEAVY, GAP_1, low, 2):.4f} to "
        f"{k_dyn(LIGHT, GAP_1, low, 2):.4f}. Against its own mean torque the lighter drive is loaded "
        "more: direct "
        f"{k_dyn(LIGHT, GAP_1, 1.0, 1, own_base=True):.4f}.",
    )


def least_k_dyn() -> Claim:
    """Whether the least K_dyn is proportional to J2."""
    impact_free = k_dyn(LIGHT, 0.0, 1.0, 1) / k_dyn(HEAVY, 0.0, 1.0, 1)
    least = k_dyn(LIGHT, GAP_1, 0.0, 1) / k_dyn(HEAVY, GAP_1, 0.0, 1)
    return Claim(
        "The least K_dyn changes in direct proportion to J2.",
        Verdict.CONFIRMED if abs(least - LIGHT / HEAVY) < 0.02 else Verdict.REFUTED,
        f"From 5 J1 to 2 J1, J2 changes by {LIGHT / HEAVY:g}; the least K of method 1 (M1 -> 0) by "
        f"{least:.3f} at 0.5 rad, "
        "and without any impact, where it is 2 (Ms J2 + J1 Mc)/(J1 + J2) over the base, by "
        f"{impact_free:.3f}.",
    )
