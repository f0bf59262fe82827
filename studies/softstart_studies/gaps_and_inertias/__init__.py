"""Which controller, over all gaps and load inertias that a machine may have: all of them tuned alike.

The drive is the crane drive of [G], target speed 60 rad/s, torque lag 2 ms (assumed), encoder of 4096 lines.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import ClassVar

from softstart.study import Progress, Study, StudyResult
from softstart_studies.gaps_and_inertias.cells import Grid, grids
from softstart_studies.gaps_and_inertias.claims import claims
from softstart_studies.gaps_and_inertias.extent import Extent
from softstart_studies.gaps_and_inertias.pictures import maps_figure
from softstart_studies.gaps_and_inertias.tables import tables

__all__ = ["Extent", "GapsAndInertias", "grids", "present"]


class GapsAndInertias(Study):
    """Every controller tuned for each cell of the grid, and with one set for all.

    >>> GapsAndInertias.name, len(GapsAndInertias.pictures)
    ('gaps-and-inertias', 2)
    """

    name: ClassVar[str] = "gaps-and-inertias"
    title: ClassVar[str] = "All controllers tuned alike over gaps and load inertias of the crane drive of [G]"
    pictures: ClassVar[tuple[str, ...]] = tuple(
        f"gaps-and-inertias-{kind}-{which}" for kind in Extent().kinds for which in ("cells", "one-set")
    )

    def run(self, out: Path | None, progress: Progress) -> StudyResult:
        """All of it; `out` receives each controller's schedule (CSV) and robust set (TOML)."""
        found = grids(Extent(), progress)
        if out is not None:
            for grid in found:
                for name, tuning in grid.tunings.items():
                    tuning.to_csv(out / f"{grid.kind}-{name}-schedule.csv")
                    tuning.to_toml(out / f"{grid.kind}-{name}-robust.toml", "robust")
        return present(found, progress)


def present(found: Sequence[Grid], progress: Progress) -> StudyResult:
    """Tables, claims and figures of what was found."""
    progress("drawing")
    figures = {}
    for grid in found:
        stem = f"gaps-and-inertias-{grid.kind}"
        figures[f"{stem}-cells"] = maps_figure(grid, "", "tuned for each cell")
        figures[f"{stem}-one-set"] = maps_figure(grid, "robust.", "one set for all cells")
    return StudyResult(tables=tables(found), claims=claims(found), figures=figures)
