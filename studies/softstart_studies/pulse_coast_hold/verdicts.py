"""What was asked of the controller, and whether it holds."""

from __future__ import annotations

import numpy as np

from softstart.drive import LoadKind
from softstart.study import Claim, Verdict
from softstart_studies.pulse_coast_hold.cells import CONTROLLER, Cell, spread, spread_of_optimum
from softstart_studies.pulse_coast_hold.rivals import REDUCED, Rival
from softstart_studies.pulse_coast_hold.tolerances import Case

MOST = {"reactive": 1.10, "active": 1.15}  # over the optimum, in every cell
MEAN = {"reactive": 1.06, "active": 1.08}
K_DYN, SPREAD = 1.05, 0.03  # reactive load
WITH_TOLERANCES = 1.30


def of_grid(kind: LoadKind, found: list[Cell]) -> list[Claim]:
    """How near the optimum; and K_dyn itself."""
    over = np.concatenate([cell.over for cell in found])
    worst = max(found, key=lambda cell: float(cell.over.max()))
    near = over.max() <= MOST[kind] and over.mean() <= MEAN[kind]
    k = np.concatenate([cell.k_dyn for cell in found])
    own, best = spread(found), spread_of_optimum(found)
    claims = [
        Claim(
            f"Load {kind}, its inertia, its speed and the gap unknown: K_dyn is at most "
            f"{MOST[kind]:.2f} of the optimum at its own start time in every cell, {MEAN[kind]:.2f} on the "
            "mean.",
            Verdict.CONFIRMED if near else Verdict.REFUTED,
            f"At most {over.max():.3f} (gap {worst.gap:g} rad, J2 = {worst.ratio:g} J1), on the mean "
            f"{over.mean():.3f}, over {over.size} starts in {len(found)} cells.",
        )
    ]
    if kind == "reactive":
        claims.append(
            Claim(
                f"With a reactive load K_dyn is at most {K_DYN:.2f} and the same over the gaps within "
                f"{100 * SPREAD:.0f} %.",
                Verdict.CONFIRMED if k.max() <= K_DYN and own <= SPREAD else Verdict.REFUTED,
                f"K_dyn {k.min():.3f} to {k.max():.3f}; over gaps and encoder phases it varies by "
                f"{100 * own:.1f} % at the worst inertia (that of the optimum by {100 * best:.1f} %).",
            )
        )
    else:
        claims.append(
            Claim(
                "With an active load no controller can be invariant to the gap: the optimum is not.",
                Verdict.CONFIRMED if best > SPREAD else Verdict.REFUTED,
                f"K_dyn {k.min():.3f} to {k.max():.3f}; over the gaps it varies by {100 * own:.0f} % at the "
                f"worst inertia, that of the optimum at the same start times by {100 * best:.0f} %.",
            )
        )
    return claims


def of_tolerances(found: list[Case]) -> Claim:
    """The worst of all deviations."""
    worst = max(found, key=lambda case: case.over)
    return Claim(
        "Stiffness 10 % off, motor inertia 5 % off, half or one and a half of the lag assumed, a dead time "
        f"of one sample: never more than {WITH_TOLERANCES:.2f} of the optimum.",
        Verdict.CONFIRMED if worst.over <= WITH_TOLERANCES else Verdict.REFUTED,
        f"At most {worst.over:.3f} ({worst.kind} load, {worst.what}).",
    )


def of_rivals(found: list[Rival]) -> Claim:
    """What the reduced torques of [G] and a feedback make of the same unknowns."""
    parts, softer = [], True
    for kind in dict.fromkeys(one.kind for one in found):
        here = {one.name: one for one in found if one.kind == kind}
        ours, reduced = here[CONTROLLER], min((here[name] for name in REDUCED), key=lambda one: one.most)
        feedback = here["current-limit-feedback"]
        softer = softer and ours.most < min(reduced.most, feedback.most)
        parts.append(
            f"{kind} load: {reduced.name} {reduced.least:.2f} to {reduced.most:.2f}, current-limit-feedback "
            f"{feedback.least:.2f} to {feedback.most:.2f} with starts {100 * (feedback.slower - 1):+.0f} %, "
            f"pulse-coast-hold {ours.least:.2f} to {ours.most:.2f}"
        )
    return Claim(
        "On the same grid it starts more softly than every strategy of [G], all with their defaults.",
        Verdict.CONFIRMED if softer else Verdict.REFUTED,
        f"K_dyn, {'; '.join(parts)}.",
    )
