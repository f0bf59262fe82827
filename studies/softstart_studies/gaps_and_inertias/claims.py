"""What the study says about the claims of [G], and about tuning itself."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from softstart.study import Claim, Verdict
from softstart_studies.gaps_and_inertias.cells import Grid

INVARIANT = 5.0  # percent of spread that still counts as invariant
DELAY, FEEDBACK = "acceleration-delay", "current-limit-feedback"


def claims(found: Sequence[Grid]) -> tuple[Claim, ...]:
    """All claims."""
    made = [never_worse(found), nearest(found)]
    if all(FEEDBACK in grid.tunings for grid in found):
        made.append(feedback_is_invariant(found))
    if all(DELAY in grid.tunings for grid in found):
        made.append(delay_holds(found))
    return tuple(made)


def never_worse(found: Sequence[Grid]) -> Claim:
    """In every cell, for every controller."""
    worse = [f"{name} ({grid.kind})" for grid in found for name in grid.tunings if not grid.never_worse(name)]
    cells = sum(grid.core().size * len(grid.tunings) for grid in found)
    return Claim(
        "Tuned for a cell, no controller is harder or slower there than with its defaults.",
        Verdict.REFUTED if worse else Verdict.CONFIRMED,
        f"{cells} cells and controllers compared. Worse: {', '.join(worse) or 'none'}.",
    )


def nearest(found: Sequence[Grid]) -> Claim:
    """Which controller comes nearest to the optimum within the same time, gap and load unknown."""
    said, best = [], set()
    for grid in found:
        means = {}
        for name in grid.tunings:
            ratio = grid.ratio(name, "robust.")
            if np.isfinite(ratio).any():
                means[name] = float(np.mean(ratio[np.isfinite(ratio)]))
        order = sorted(means, key=means.__getitem__)
        best.add(order[0])
        listed = ", ".join(f"{name} {means[name]:.2f}" for name in order)
        said.append(f"{grid.kind} load: {listed}")
    one = len(best) == 1
    return Claim(
        "With one set of gains, one controller is nearest to the optimum on every kind of load tried.",
        Verdict.CONFIRMED if one else Verdict.REFUTED,
        f"Mean over the grid of K_dyn over the least K_dyn of any start in the same time: {'; '.join(said)}.",
    )


def feedback_is_invariant(found: Sequence[Grid]) -> Claim:
    """[G]'s best: a regulator on the current limit."""
    said, spreads = [], []
    for grid in found:
        inside = grid.values(FEEDBACK, "robust.k_dyn")[grid.core()]
        spread = 100.0 * (float(np.max(inside)) / float(np.min(inside)) - 1.0)
        spreads.append(spread)
        others = {}
        for name in grid.tunings:
            k = grid.values(name, "robust.k_dyn")[grid.core()]
            others[name] = 100.0 * (float(np.max(k)) / float(np.min(k)) - 1.0)
        least = min(others, key=others.__getitem__)
        said.append(
            f"{grid.kind} load: K_dyn {np.min(inside):.3f} to {np.max(inside):.3f}, {spread:.0f} % apart "
            f"(smallest spread of all: {least}, {others[least]:.0f} %)"
        )
    return Claim(
        "Regulators acting on the current-limit level are invariant to the gap and the other mechanical "
        "parameters.",
        Verdict.CONFIRMED if max(spreads) < INVARIANT else Verdict.REFUTED,
        f"One set of gains, tuned for the worst case, {_core(found[0])}: {'; '.join(said)}.",
    )


def delay_holds(found: Sequence[Grid]) -> Claim:
    """[G]: acceleration and delay fit where the elastic frequency stays within 10-20 %."""
    said, gains = [], []
    for grid in found:
        own, one = grid.values(DELAY, "k_dyn")[grid.core()], grid.values(DELAY, "robust.k_dyn")[grid.core()]
        gains.append(float(np.max(one / own)))
        said.append(
            f"{grid.kind} load: tuned for each cell {np.min(own):.3f} to {np.max(own):.3f}, one set "
            f"{np.min(one):.3f} to {np.max(one):.3f}"
        )
    ratio = np.sqrt(
        (1.0 + 1.0 / found[0].extent.core_inertias[0]) / (1.0 + 1.0 / found[0].extent.core_inertias[1])
    )
    return Claim(
        "Torque reduced until the acceleration drops, then for a delay, fits where the elastic frequency "
        "stays within 10-20 %.",
        Verdict.CONFIRMED if max(gains) < 1.2 else Verdict.PARTLY,
        f"{_core(found[0])}, over which the elastic frequency changes by {100 * (ratio - 1):.0f} %: "
        f"{'; '.join(said)}. Not knowing the cell costs a factor of up to {max(gains):.2f}.",
    )


def _core(grid: Grid) -> str:
    e = grid.extent
    return (
        f"gaps {e.core_gaps[0]:g}-{e.core_gaps[1]:g} rad and inertias "
        f"{e.core_inertias[0]:g}-{e.core_inertias[1]:g} J1"
    )
