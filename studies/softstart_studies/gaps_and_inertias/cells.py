"""Every controller, tuned alike, in every cell of the grid."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softstart.study import Progress
from softstart.tuning.outcome import Tuning
from softstart_studies.gaps_and_inertias.extent import Extent
from softstart_studies.tuned_alike import CRANE, direct_time, least, tuned, tuned_controllers

Map = NDArray[np.float64]  # one row a gap, one column a load inertia
BETTER = 1e-9


@dataclass(frozen=True)
class Grid:
    """One kind of load: all tunings, and the optimum of each cell within the same bound."""

    kind: str
    extent: Extent
    tunings: dict[str, Tuning]
    bound: Map  # s
    optimum: Map
    optimum_bound: Map  # the certified lower bound

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

    def in_time(self, name: str, what: str = "") -> Any:
        """Where the bound on the start time is kept: `what` is "", "robust." or their "_default"."""
        return self.values(name, f"{what}excess") <= 0.0

    def defaults_in_time(self, name: str) -> Any:
        """Where the defaults keep the bound."""
        return self.values(name, "excess_default") <= 0.0

    def never_worse(self, name: str) -> bool:
        """Whether every cell is at least as good as with the defaults: first in time, then in K_dyn."""
        late, late_default = self.values(name, "excess"), self.values(name, "excess_default")
        k, k_default = self.values(name, "k_dyn"), self.values(name, "k_dyn_default")
        same = np.abs(late - late_default) <= BETTER
        return bool(np.all((late < late_default) | (same & (k <= k_default * (1.0 + BETTER)))))


def grids(extent: Extent, progress: Progress) -> list[Grid]:
    """One for each kind of load."""
    names = extent.controllers or tuned_controllers()
    found = []
    for kind in extent.kinds:
        drive = CRANE.replace(load_kind=kind, name=f"Crane of [G], {kind} load")
        inertias = [ratio * float(drive.J1) for ratio in extent.inertias]
        told = _prefixed(progress, kind)
        tunings = tuned(
            drive, names, extent.gaps, inertias, extent.start_time, extent.restarts, extent.generations, told
        )
        cells = [[drive.replace(gap=gap, load_inertia=J2) for J2 in inertias] for gap in extent.gaps]
        multiple = float(extent.start_time.rstrip("x"))
        bound = np.array([[multiple * direct_time(cell) for cell in row] for row in cells])
        best = []
        for row, times in zip(cells, bound, strict=True):
            told(f"optima at gap {row[0].gap:g} rad")
            best.append([least(cell, float(time)) for cell, time in zip(row, times, strict=True)])
        both = np.array(best)
        found.append(Grid(kind, extent, tunings, bound, both[..., 0], both[..., 1]))
    return found


def _prefixed(progress: Progress, what: str) -> Progress:
    return lambda text: progress(f"{what} load, {text}")
