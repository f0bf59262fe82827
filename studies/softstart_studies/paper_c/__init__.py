"""[C] recomputed: its table, which reading gives the printed numbers, and the best engagement law there is.

[C]: Influence of the engagement law of a friction clutch on the load of its elements.
"""

from __future__ import annotations

from pathlib import Path
from typing import ClassVar

from softstart.study import Progress, Study, StudyResult
from softstart.views.clutches import engagement_figure, front_figure
from softstart_studies.paper_c import fronts, printed, readings, verdicts

__all__ = ["PaperC"]

IN_KGF = (printed.KGF, "kgf m")


class PaperC(Study):
    """The table of [C] and what follows from its model.

    >>> PaperC.name, len(PaperC.pictures)
    ('paper-c', 3)
    """

    name: ClassVar[str] = "paper-c"
    title: ClassVar[str] = "The engagement laws of [C], recomputed, and the optimal ones"
    pictures: ClassVar[tuple[str, ...]] = ("paper-c-laws", "paper-c-optimal-laws", "paper-c-front")

    points: ClassVar[int] = fronts.POINTS

    def run(self, out: Path | None, progress: Progress) -> StudyResult:
        """All of it; `out` is not needed beyond what the caller writes."""
        progress("the laws of [C]")
        runs = printed.engagements()
        progress("readings of the paper")
        search, several = readings.search_table()
        found = fronts.fronts(progress, self.points)
        progress("the same by collocation")
        checked = fronts.collocation_table(found)
        progress("drawing")
        best = [one.points[0].run for one in found]
        drawn = (
            engagement_figure(list(runs.values()), "The laws of [C]", list(runs), IN_KGF),
            engagement_figure(
                [runs["linear"], *best], "The linear law, and the laws of the least peak with the least work",
                ["linear", *(f"optimal, {one.law_class}" for one in found)], IN_KGF,
            ),
            front_figure(found, IN_KGF),
        )  # fmt: skip
        return self.result(
            tables=(
                printed.comparison_table(runs),
                printed.behind_table(runs),
                search,
                fronts.front_table(found),
                fronts.distance_table(found),
                fronts.simple_table(found),
                checked,
            ),
            claims=verdicts.claims(runs, search, several, found),
            figures=drawn,
        )
