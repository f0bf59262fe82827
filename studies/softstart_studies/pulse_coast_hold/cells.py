"""The grid of gaps and inertias: K_dyn over the optimum at its own start time, cell by cell."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from softstart.drive import LoadKind
from softstart.study import Progress, Table
from softstart_studies.pulse_coast_hold.crane import TOLD, Extent, ideal, optimum, run, starts

CONTROLLER = "pulse-coast-hold"


@dataclass(frozen=True)
class Cell:
    """One gap and one load inertia; arrays over the encoder phases.

    The optimum is that at the longest of the start times. It is smaller there than at the others, so `over`
    is what it says, or a little too large.
    """

    gap: float  # rad
    ratio: float  # J2/J1
    k_dyn: NDArray[np.float64]
    start_time: NDArray[np.float64]  # s
    optimum: float  # K_dyn
    contacts: int  # the most

    @property
    def over(self) -> NDArray[np.float64]:
        """K_dyn over that of the optimum."""
        return self.k_dyn / self.optimum


def grid(kind: LoadKind, extent: Extent, progress: Progress) -> list[Cell]:
    """All the cells, gaps slowest."""
    batch = starts(kind, extent.gaps, extent.ratios, extent.phases)
    runs = run(batch, CONTROLLER, TOLD.replace(load_kind=kind))
    found = []
    for i, gap in enumerate(extent.gaps):
        for j, ratio in enumerate(extent.ratios):
            progress(f"optimum, {kind} load, gap {gap:g} rad, J2 = {ratio:g} J1")
            times = runs.start_time[i, j]
            best = optimum(ideal(kind, gap, ratio), float(times.max()))
            contacts = int(runs.contacts[i, j].max())
            found.append(Cell(gap, ratio, runs.k_dyn[i, j], times, best, contacts))
    return found


def spread(found: list[Cell]) -> float:
    """Largest K_dyn less the smallest over gaps and phases, over their mean; the worst inertia."""
    return max(_spread([cell.k_dyn for cell in found if cell.ratio == one.ratio]) for one in found)


def spread_of_optimum(found: list[Cell]) -> float:
    """The same of the optimum."""
    return max(
        _spread([np.array(cell.optimum) for cell in found if cell.ratio == one.ratio]) for one in found
    )


def _spread(values: list[NDArray[np.float64]]) -> float:
    together = np.concatenate([np.ravel(value) for value in values])
    return float(np.ptp(together) / together.mean())


def table(kind: LoadKind, found: list[Cell]) -> Table:
    """A row a cell."""
    return Table(
        f"pulse-coast-hold, {kind} load, {found[0].k_dyn.size} encoder phases",
        (
            "gap, rad",
            "J2/J1",
            "K_dyn, least",
            "K_dyn, most",
            "start time, s, longest",
            "optimum there",
            "over the optimum, mean",
            "over the optimum, most",
            "contacts",
        ),
        [
            (
                cell.gap,
                cell.ratio,
                round(float(cell.k_dyn.min()), 4),
                round(float(cell.k_dyn.max()), 4),
                round(float(cell.start_time.max()), 4),
                round(cell.optimum, 4),
                round(float(cell.over.mean()), 4),
                round(float(cell.over.max()), 4),
                cell.contacts,
            )
            for cell in found
        ],
    )
