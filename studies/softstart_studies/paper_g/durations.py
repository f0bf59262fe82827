"""What [G] says of time: stage 2 under both methods, stage 1, and the whole start."""

from __future__ import annotations

import numpy as np

from softstart.study import Claim, Table, Verdict
from softstart_studies.paper_g.crane import (
    GAP_1,
    GAP_2,
    HEAVY,
    LIGHT,
    METHODS,
    SHARE,
    closed_form,
    crane,
    percent,
    simulated,
)

RATIOS_SHOWN = (1.0, 0.75, 0.5, 0.25)
NEARLY = 0.10  # what "almost the same" may mean


def claims() -> list[Claim]:
    """Stage 2, total time, and stage 1 under another inertia.

    >>> [claim.verdict.value for claim in claims()]
    ['partly', 'confirmed', 'partly']
    """
    return [stage_2_alike(), stage_1_decides(), stage_1_keeps_with_inertia()]


def durations_table() -> Table:
    """Stages 1 and 2 of both methods at some M1/Ms, and how much longer stage 2 is with method 1."""
    rows = []
    for gap in (GAP_1, GAP_2):
        for r in RATIOS_SHOWN:
            first, second = (closed_form(crane(HEAVY, gap), r, method) for method in METHODS)
            rows.append(
                (
                    gap,
                    r,
                    round(float(first.open_duration), 6),
                    round(float(first.contact_duration), 6),
                    round(float(second.contact_duration), 6),
                    percent(float(first.contact_duration / second.contact_duration)),
                )
            )
    return Table(
        "Stages 1 and 2, J2 = 5 J1",
        ("gap, rad", "M1/Ms", "t1, s", "t2 method 1, s", "t2 method 2, s", "method 1 over method 2"),
        rows,
    )


def stage_2_alike() -> Claim:
    """Stage 2 of method 1 over that of method 2."""
    r = np.array(RATIOS_SHOWN[1:])
    longer = {}
    for gap in (GAP_1, GAP_2):
        first, second = (closed_form(crane(HEAVY, gap), r, method) for method in METHODS)
        longer[gap] = np.asarray(first.contact_duration) / np.asarray(second.contact_duration)
    told = {gap: ", ".join(f"{100 * (x - 1):.0f} %" for x in values) for gap, values in longer.items()}
    worst = max(float(values.max()) for values in longer.values())
    close = min(float(values.min()) for values in longer.values()) - 1.0 < NEARLY
    return Claim(
        "Stage 2 lasts almost the same under both methods.",
        Verdict.CONFIRMED if worst - 1.0 < NEARLY else Verdict.PARTLY if close else Verdict.REFUTED,
        f"With method 1 it is longer by {told[GAP_1]} at 0.5 rad and {told[GAP_2]} at 2 rad, for M1/Ms = "
        "0.75, "
        "0.5, 0.25: "
        "nearly equal only near the starting torque.",
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
    first, second = (simulated(crane(), SHARE, method) for method in METHODS)
    direct = simulated(crane(), 1.0, 1)
    return Claim(
        "The total time t1 + t2 is set by stage 1.",
        Verdict.CONFIRMED if min(swings) > 2.0 else Verdict.PARTLY,
        f"From M1/Ms = 1 to 0.25 t1 + t2 grows from {grown[0]} (method 1) and {grown[1]} (method 2) at "
        "0.5 rad, "
        f"{grown[2]} and {grown[3]} at 2 rad; stage 1 changes by at least {min(swings):.1f} times as much as "
        f"stage 2. It does not set when the load is at its target speed: {direct.start_time:.4f} s direct, "
        f"{first.start_time:.4f} s with method 1, {second.start_time:.4f} s with method 2 (0.25, 0.5 "
        "rad); the "
        "impacts that follow do.",
    )


def stage_1_keeps_with_inertia() -> Claim:
    """Stage 1 for J2 = 2 J1 against 5 J1."""
    ratios = (1.0, SHARE, 0.05)
    light, heavy = (np.asarray(closed_form(crane(n), ratios, 1).open_duration) for n in (LIGHT, HEAVY))
    change = light / heavy - 1.0
    small, large = abs(change[0]) < 0.05, abs(change[-1]) > 0.05
    return Claim(
        "Stage 1 lasts the same whatever J2.",
        Verdict.CONFIRMED if not large else Verdict.PARTLY if small else Verdict.REFUTED,
        f"From 5 J1 to 2 J1 at 0.5 rad stage 1 changes by {100 * change[0]:+.1f} % at M1/Ms = 1, "
        f"{100 * change[1]:+.1f} % at 0.25 and {100 * change[2]:+.1f} % at 0.05: an active load turns "
        "back faster when light.",
    )
