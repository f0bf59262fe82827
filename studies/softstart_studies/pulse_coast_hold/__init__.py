"""How near `pulse-coast-hold` comes to the optimum with one set of gains: gap, J2 and load speed unknown.

The theory is in docs/pulse-coast-hold.md.
"""

from __future__ import annotations

from pathlib import Path
from typing import ClassVar

from softstart.study import Progress, Study, StudyResult
from softstart_studies.pulse_coast_hold import cells, prices, rivals, tolerances, verdicts
from softstart_studies.pulse_coast_hold.crane import Extent

__all__ = ["PulseCoastHoldStudy"]


class PulseCoastHoldStudy(Study):
    """The optimum as feedback, measured against the optimum.

    >>> PulseCoastHoldStudy.name, len(PulseCoastHoldStudy.pictures)
    ('pulse-coast-hold', 3)
    """

    name: ClassVar[str] = "pulse-coast-hold"
    title: ClassVar[str] = "The optimum as feedback, with gap, load inertia and load speed unknown"
    pictures: ClassVar[tuple[str, ...]] = (
        "pulse-coast-hold-starts",
        "pulse-coast-hold-ratios",
        "pulse-coast-hold-tolerances",
    )

    def run(self, out: Path | None, progress: Progress) -> StudyResult:
        """All of it: the grid for both kinds of load, the tolerances, the other controllers."""
        return present(Extent(), progress)


def present(extent: Extent, progress: Progress) -> StudyResult:
    """Work it out, and say and draw what came out."""
    grids = {kind: cells.grid(kind, extent, progress) for kind in extent.kinds}
    steps = prices.prices(extent, progress)
    cases = [case for kind in extent.kinds for case in tolerances.cases(kind, extent, progress)]
    others = [one for kind in extent.kinds for one in rivals.rivals(kind, extent, progress)]
    progress("drawing")
    from softstart_studies.pulse_coast_hold import pictures

    drawn = (
        pictures.starts_figure(extent),
        pictures.ratios_figure(grids),
        pictures.tolerances_figure(cases),
    )
    return PulseCoastHoldStudy.result(
        tables=(
            *(cells.table(kind, found) for kind, found in grids.items()),
            prices.table(steps),
            tolerances.table(cases),
            rivals.table(others),
        ),
        claims=(
            *(claim for kind, found in grids.items() for claim in verdicts.of_grid(kind, found)),
            verdicts.of_tolerances(cases),
            verdicts.of_rivals(others),
        ),
        figures=drawn,
    )
