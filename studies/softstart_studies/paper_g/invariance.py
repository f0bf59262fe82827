"""How far the strategies depend on the gap, the inertia of the load and the stiffness."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from softstart import records
from softstart.arrays import Vector
from softstart.study import Claim, Table, Verdict
from softstart_studies.paper_g.crane import CRANE, GAP_1, GAP_2, HEAVY, LIGHT, SHARE, closed_form, many

TORQUE = SHARE * float(CRANE.Ms)
PEAK_DELAY = 0.5 * float(closed_form(CRANE, SHARE, 2).contact_duration)
# label, controller, its parameters where they are not the defaults
STRATEGIES: tuple[tuple[str, str, dict[str, float]], ...] = (
    ("direct", "direct", {}),
    ("acceleration-delay, (15)", "acceleration-delay", {"torque": TORQUE}),
    ("acceleration-delay, (14)", "acceleration-delay", {"torque": TORQUE, "delay": PEAK_DELAY}),
    ("current-limit-feedback", "current-limit-feedback", {}),
)
GAPS: Vector = np.linspace(GAP_1, GAP_2, 16)
INERTIAS: Vector = np.linspace(LIGHT, HEAVY, 13)  # over J1
STIFFNESSES: Vector = np.linspace(0.8, 1.2, 9)  # over nominal
INVARIANT = 0.05  # spread that may be called invariant


@dataclass(frozen=True)
class Spread:
    """K_dyn of the whole start, base of the nominal drive: one parameter at a time, and all combinations."""

    strategy: str
    by_gap: Vector
    by_inertia: Vector
    by_stiffness: Vector
    together: Vector  # a coarser grid of all three


def relative_spread(k: Vector) -> float:
    """Largest over smallest, less one.

    >>> round(relative_spread(np.array([1.0, 1.1])), 3)
    0.1
    """
    return float(np.max(k) / np.min(k)) - 1.0


def spread(label: str, controller: str, parameters: dict[str, float]) -> Spread:
    """All starts of a strategy set up for J2 = 5 J1, 0.5 rad and the nominal stiffness.

    >>> round(relative_spread(spread("direct", "direct", {}).by_gap), 2)
    0.56
    """
    gap, inertia, stiffness = (
        grid.ravel() for grid in np.meshgrid(GAPS[::5], INERTIAS[::4], STIFFNESSES[::2], indexing="ij")
    )
    batches = (
        records(CRANE, gap=GAPS),
        records(CRANE, load_inertia=INERTIAS * CRANE.J1),
        records(CRANE, stiffness=STIFFNESSES * CRANE.c),
        records(CRANE, gap=gap, load_inertia=inertia * CRANE.J1, stiffness=stiffness * CRANE.c),
    )
    return Spread(label, *(many(drives, controller, **parameters)[1] for drives in batches))


def table(spreads: list[Spread]) -> Table:
    """Least and largest K_dyn and the relative spread, for each parameter and all together."""
    changed = ("gap 0.5 to 2 rad", "J2 2 to 5 J1", "c -20 to +20 %", "all three")
    rows = []
    for one in spreads:
        for name, k in zip(
            changed, (one.by_gap, one.by_inertia, one.by_stiffness, one.together), strict=True
        ):
            rows.append(
                (
                    one.strategy,
                    name,
                    len(k),
                    round(float(k.min()), 4),
                    round(float(k.max()), 4),
                    f"{100 * relative_spread(k):.1f} %",
                )
            )
    return Table(
        "K_dyn of strategies set up once",
        ("strategy", "changed", "starts", "least K_dyn", "largest K_dyn", "largest/least - 1"),
        rows,
    )


def claims(spreads: list[Spread]) -> list[Claim]:
    """Feedback against the direct start."""
    by_name = {one.strategy: one for one in spreads}
    direct, feedback = by_name["direct"], by_name["current-limit-feedback"]
    whole, without = relative_spread(feedback.together), relative_spread(direct.together)
    told = "; ".join(
        f"{name} {100 * relative_spread(k):.1f} % (direct {100 * relative_spread(reference):.1f} %)"
        for name, k, reference in (
            ("gap 0.5 to 2 rad", feedback.by_gap, direct.by_gap),
            ("J2 2 to 5 J1", feedback.by_inertia, direct.by_inertia),
            ("c -20 to +20 %", feedback.by_stiffness, direct.by_stiffness),
            ("all together", feedback.together, direct.together),
        )
    )
    return [
        Claim(
            "Regulators acting on the current-limit level or as a flexible feedback are invariant to the "
            "gap and to the other "
            "mechanical parameters.",
            Verdict.CONFIRMED
            if whole < INVARIANT
            else Verdict.PARTLY
            if whole < 0.5 * without
            else Verdict.REFUTED,
            f"Spread of K over the whole start of current-limit-feedback, set up once: {told}. Not "
            "invariant, but its largest K of all "
            f"{len(feedback.together)} drives is {feedback.together.max():.4f} where the direct start has "
            f"{direct.together.max():.4f}.",
        )
    ]
