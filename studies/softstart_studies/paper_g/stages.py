"""What [G] says of stages 1 and 2: K_dyn under both methods, gap and inertia; how long the stages last."""

from __future__ import annotations

import numpy as np

from softstart.study import Claim, Verdict
from softstart_studies.crane import CRANE, percent
from softstart_studies.paper_g.crane import (
    GAP_1,
    GAP_2,
    HEAVY,
    LIGHT,
    METHODS,
    RATIOS,
    SHARE,
    closed_form,
    crane,
    k_dyn,
    ratio_where,
    simulated,
)

SHOWN = (1.0, 0.75, 0.5, 0.25)  # M1/Ms
NEARLY = 0.10  # what "almost the same" may mean


def method_1_stays_above_2() -> Claim:
    """The least K_dyn of method 1 is that of r -> 0: it rises with r."""
    direct = [k_dyn(HEAVY, gap, 1.0, 1) for gap in (GAP_1, GAP_2)]
    least = [k_dyn(HEAVY, gap, 0.0, 1) for gap in (GAP_1, GAP_2)]
    own = k_dyn(LIGHT, GAP_1, 0.0, 1, None)
    return Claim(
        "Method 1 damps the peak but cannot bring K_dyn below 2 at fixed J2.",
        Verdict.of(min(*least, own) > 2.0),
        f"J2 = 5 J1: from {direct[0]:.4f} (direct) K falls to {least[0]:.4f} as M1 -> 0 at 0.5 rad, and "
        f"from {direct[1]:.4f} to {least[1]:.4f} at 2 rad. J2 = 2 J1 measured against the base of 5 J1 does "
        f"go below 2 for M1/Ms < {ratio_where(2.0, LIGHT, GAP_1, 1):.3f}, down to "
        f"{k_dyn(LIGHT, GAP_1, 0.0, 1):.4f}; against its own base it stays above {own:.4f}.",
    )


def method_2_goes_below_2() -> Claim:
    """Up to which r the peak of stage 2 stays below 2."""
    reach = [ratio_where(2.0, HEAVY, gap, 2) for gap in (GAP_1, GAP_2)]
    at_quarter = [k_dyn(HEAVY, gap, SHARE, 2) for gap in (GAP_1, GAP_2)]
    return Claim(
        "Method 2 can bring K_dyn of stage 2 below 2.",
        Verdict.of(min(reach) > 0.0),
        f"In stage 2 K < 2 for M1/Ms < {reach[0]:.4f} at 0.5 rad and < {reach[1]:.4f} at 2 rad; at M1/Ms = "
        f"0.25 it is {at_quarter[0]:.4f} and {at_quarter[1]:.4f}. What comes after stage 2 is the next "
        "claim.",
    )


def wider_gap() -> Claim:
    """0.5 rad against 2 rad, all r."""
    first, second = (k_dyn(HEAVY, GAP_2, RATIOS, m) / k_dyn(HEAVY, GAP_1, RATIOS, m) for m in METHODS)
    quarter = int(np.argmin(np.abs(RATIOS - SHARE)))
    return Claim(
        "A wider gap raises K_dyn markedly.",
        Verdict.CONFIRMED if min(first.min(), second.min()) > 1.0 else Verdict.PARTLY,
        f"From 0.5 to 2 rad: {percent(first[-1])} for the direct start, at M1/Ms = 0.25 "
        f"{percent(first[quarter])} with method 1 and {percent(second[quarter])} with method 2; for every "
        f"M1/Ms from 0.01 on at least {percent(first.min())} and {percent(second.min())}.",
    )


def smaller_inertia() -> Claim:
    """J2 = 2 J1 against 5 J1, common base and own base."""
    turn, low = float(CRANE.Mc) / float(CRANE.Ms), 0.05
    first, second = (k_dyn(LIGHT, GAP_1, RATIOS, m) < k_dyn(HEAVY, GAP_1, RATIOS, m) for m in METHODS)
    as_said = bool(np.all(first) and np.all(second == (turn < RATIOS)))
    return Claim(
        "A smaller J2 lowers K_dyn.",
        Verdict.PARTLY if as_said else Verdict.REFUTED,
        "From 5 J1 to 2 J1 at 0.5 rad, both against the base of 5 J1: direct "
        f"{k_dyn(HEAVY, GAP_1, 1.0, 1):.4f} to {k_dyn(LIGHT, GAP_1, 1.0, 1):.4f}, and so for every M1 with "
        f"method 1; with method 2 only while M1 > Mc (M1/Ms > {turn:.4f}): at {low:g} it rises from "
        f"{k_dyn(HEAVY, GAP_1, low, 2):.4f} to {k_dyn(LIGHT, GAP_1, low, 2):.4f}. Against its own mean "
        f"torque the lighter drive is loaded more: direct {k_dyn(LIGHT, GAP_1, 1.0, 1, None):.4f}.",
    )


def least_k_dyn() -> Claim:
    """Whether the least K_dyn is proportional to J2."""
    impact_free = k_dyn(LIGHT, 0.0, 1.0, 1) / k_dyn(HEAVY, 0.0, 1.0, 1)
    least = k_dyn(LIGHT, GAP_1, 0.0, 1) / k_dyn(HEAVY, GAP_1, 0.0, 1)
    return Claim(
        "The least K_dyn changes in direct proportion to J2.",
        Verdict.of(abs(least - LIGHT / HEAVY) < 0.02),
        f"From 5 J1 to 2 J1, J2 changes by {LIGHT / HEAVY:g}; the least K of method 1 (M1 -> 0) by "
        f"{least:.3f} at 0.5 rad, and without any impact, where it is 2 (Ms J2 + J1 Mc)/(J1 + J2) over the "
        f"base, by {impact_free:.3f}.",
    )


def stage_2_alike() -> Claim:
    """Stage 2 of method 1 over that of method 2."""
    longer = []
    for gap in (GAP_1, GAP_2):
        first, second = (closed_form(crane(HEAVY, gap), SHOWN[1:], m).contact_duration for m in METHODS)
        longer.append(np.asarray(first) / np.asarray(second) - 1.0)
    said = [", ".join(f"{100 * x:.0f} %" for x in values) for values in longer]
    return Claim(
        "Stage 2 lasts almost the same under both methods.",
        Verdict.of(np.max(longer) < NEARLY, np.min(longer) < NEARLY),
        f"With method 1 it is longer by {said[0]} at 0.5 rad and {said[1]} at 2 rad, for M1/Ms = 0.75, 0.5, "
        "0.25: nearly equal only near the starting torque.",
    )


def stage_1_decides() -> Claim:
    """How much of what t1 + t2 grows by is stage 1, and what is left of it in the start time."""
    grown, swings = [], []
    for gap in (GAP_1, GAP_2):
        for method in METHODS:
            full, reduced = (closed_form(crane(HEAVY, gap), r, method) for r in (1.0, SHARE))
            longer = float(reduced.open_duration - full.open_duration)
            swings.append(longer / abs(float(reduced.contact_duration - full.contact_duration)))
            whole, part = (float(one.open_duration + one.contact_duration) for one in (full, reduced))
            grown.append(f"{whole:.4f} to {part:.4f} s")
    times = [simulated(crane(), 1.0, 1).start_time]
    times += [simulated(crane(), SHARE, method).start_time for method in METHODS]
    return Claim(
        "The total time t1 + t2 is set by stage 1.",
        Verdict.CONFIRMED if min(swings) > 2.0 else Verdict.PARTLY,
        f"From M1/Ms = 1 to 0.25 t1 + t2 grows from {grown[0]} (method 1) and {grown[1]} (method 2) at 0.5 "
        f"rad, {grown[2]} and {grown[3]} at 2 rad; stage 1 changes by at least {min(swings):.1f} times as "
        f"much as stage 2. It does not set when the load is at its target speed: {times[0]:.4f} s direct, "
        f"{times[1]:.4f} s with method 1, {times[2]:.4f} s with method 2 (0.25, 0.5 rad); the impacts that "
        "follow do.",
    )


def stage_1_keeps_with_inertia() -> Claim:
    """Stage 1 for J2 = 2 J1 against 5 J1."""
    light, heavy = (
        np.asarray(closed_form(crane(n), (1.0, SHARE, 0.05), 1).open_duration) for n in (LIGHT, HEAVY)
    )
    change = light / heavy - 1.0
    full, quarter, least = (f"{100 * one:+.1f} %" for one in change)
    return Claim(
        "Stage 1 lasts the same whatever J2.",
        Verdict.of(abs(change[0]) < 0.05, abs(change[-1]) <= 0.05),
        f"From 5 J1 to 2 J1 at 0.5 rad stage 1 changes by {full} at M1/Ms = 1, {quarter} at 0.25 and "
        f"{least} at 0.05: an active load turns back faster when light.",
    )
