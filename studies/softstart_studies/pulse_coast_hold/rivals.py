"""The other strategies on the same grid, told the same."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from softstart.drive import LoadKind
from softstart.study import Progress, Table
from softstart_studies.pulse_coast_hold.cells import CONTROLLER
from softstart_studies.pulse_coast_hold.crane import TOLD, Extent, run, starts

REDUCED = ("reduced-first-stage", "reduced-two-stage", "acceleration-delay")
OTHERS = ("direct", *REDUCED, "current-limit-feedback")


@dataclass(frozen=True)
class Rival:
    """One controller with its defaults for the drive that it is told, on the whole grid."""

    kind: LoadKind
    name: str
    least: float  # K_dyn
    most: float
    spread: float  # over gaps and phases, of their mean; the worst inertia
    slower: float  # start time over that of pulse-coast-hold, on the mean


def rivals(kind: LoadKind, extent: Extent, progress: Progress) -> list[Rival]:
    """All of them, pulse-coast-hold last."""
    batch = starts(kind, extent.gaps, extent.ratios, extent.phases)
    told = TOLD.replace(load_kind=kind)
    ours = run(batch, CONTROLLER, told).start_time
    found = []
    for name in (*OTHERS, CONTROLLER):
        progress(f"{kind} load, {name}")
        runs = run(batch, name, told)
        k = runs.k_dyn
        spread = float((np.ptp(k, axis=(0, 2)) / k.mean(axis=(0, 2))).max())
        slower = float((runs.start_time / ours).mean())
        found.append(Rival(kind, name, float(k.min()), float(k.max()), spread, slower))
    return found


def table(found: list[Rival]) -> Table:
    """A row a controller."""
    return Table(
        "All strategies on the same grid, set up for gap 0.5 rad and J2 = 5 J1",
        (
            "load",
            "controller",
            "K_dyn, least",
            "K_dyn, most",
            "spread over gaps, %",
            "start time over ours",
        ),
        [
            (one.kind, one.name, round(one.least, 3), round(one.most, 3), round(100 * one.spread, 1),
             round(one.slower, 3))
            for one in found
        ],
    )  # fmt: skip
