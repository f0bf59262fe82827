"""Every controller, tuned alike, in every cell of the grid."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softstart.study import Progress
from softstart.tuning.outcome import Tuning
from softstart_studies.gaps_and_inertias.extent import Extent
from softstart_studies.tuned_alike import CRANE, Front, front, tuned, tuned_controllers

Map = NDArray[np.float64]  # one row a gap, one column a load inertia
BETTER = 1e-9


@dataclass(frozen=True)
class Grid:
    """One kind of load: all tunings, and the optima of each cell."""

    kind: str
    extent: Extent
    tunings: dict[str, Tuning]
    fronts: list[list[Front]]

    def core(self) -> Any:
        """The cells for which spreads are named, as a mask."""
        e = self.extent
        rows = [e.core_gaps[0] <= gap <= e.core_gaps[1] for gap in e.gaps]
        columns = [e.core_inertias[0] <= inertia <= e.core_inertias[1] for inertia in e.inertias]
        return np.outer(rows, columns)

    def values(self, name: str, what: str) -> Map:
        """A map of one controller: a variable of its schedule, or of the cells of its robust set."""
        tuning = self.tunings[name]
        table, _, variable = what.rpartition(".")
        assert tuning.schedule is not None
        assert tuning.robust is not None
        source = tuning.robust.cells if table == "robust" else tuning.schedule
        return np.asarray(source[variable], dtype=np.float64)

    def ratio(self, name: str, prefix: str = "", suffix: str = "") -> Map:
        """K_dyn over the least K_dyn of any start in the same time; NaN where there is no such start."""
        k, times = (self.values(name, f"{prefix}{what}{suffix}") for what in ("k_dyn", "start_time"))
        least = [
            [front.at(time) for front, time in zip(row, own, strict=True)]
            for row, own in zip(self.fronts, times, strict=True)
        ]
        return np.asarray(k / np.array(least))

    def late(self, name: str, prefix: str = "") -> Any:
        """Where a start is slower than with the defaults."""
        return self.values(name, f"{prefix}excess") > 0.0

    def never_worse(self, name: str) -> bool:
        """Whether every cell is at least as gentle and as quick as with the defaults."""
        k, k_default = self.values(name, "k_dyn"), self.values(name, "k_dyn_default")
        return bool(np.all(~self.late(name) & (k <= k_default * (1.0 + BETTER))))


def grids(extent: Extent, progress: Progress) -> list[Grid]:
    """One for each kind of load."""
    names = extent.controllers or tuned_controllers()
    found = []
    for kind in extent.kinds:
        drive = CRANE.replace(load_kind=kind, name=f"Crane of [G], {kind} load")
        inertias = [ratio * float(drive.J1) for ratio in extent.inertias]
        told = _prefixed(progress, kind)
        tunings = tuned(drive, names, extent.gaps, inertias, extent.restarts, extent.generations, told)
        grid = Grid(kind, extent, tunings, [])
        for i, gap in enumerate(extent.gaps):
            row = []
            for j, J2 in enumerate(inertias):
                told(f"optima at gap {gap:g} rad, J2 = {extent.inertias[j]:g} J1")
                times = [
                    float(grid.values(name, what)[i, j])
                    for name in names
                    for what in (
                        "start_time_default",
                        "start_time",
                        "robust.start_time_default",
                        "robust.start_time",
                    )
                ]
                row.append(front(drive.replace(gap=gap, load_inertia=J2), times, extent.front_points))
            grid.fronts.append(row)
        found.append(grid)
    return found


def _prefixed(progress: Progress, what: str) -> Progress:
    return lambda text: progress(f"{what} load, {text}")
