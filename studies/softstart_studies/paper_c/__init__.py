"""[C] recomputed: its table, which reading gives the printed numbers, and the best engagement law there is.

[C]: Influence of the engagement law of a friction clutch on the load of its elements. Which law engages the
clutch with least friction work, and how that is shown: `least_work.py`; for any clutch:

>>> from softstart.clutch import Clutch
>>> front = optimize_engagement(Clutch.load("paper-c"), 1, laws=False, steps=60)
>>> round(front.points[0].peak_torque / printed.KGF, 2)
53.33
"""

from __future__ import annotations

from pathlib import Path
from typing import ClassVar

from softstart.study import Progress, Study, StudyResult
from softstart.views.clutches import engagement_figure
from softstart_studies.paper_c import fronts, printed, readings, verdicts
from softstart_studies.paper_c.fronts import EngagementFront, optimize_engagement
from softstart_studies.paper_c.printed import IN_KGF

__all__ = ["IN_KGF", "EngagementFront", "PaperC", "optimize_engagement"]


class PaperC(Study):
    """The table of [C] and what follows from its model.

    >>> PaperC.name, len(PaperC.pictures)
    ('paper-c', 3)
    """

    name: ClassVar[str] = "paper-c"
    title: ClassVar[str] = "The engagement laws of [C], recomputed, and the optimal ones"
    pictures: ClassVar[tuple[str, ...]] = ("paper-c-laws", "paper-c-optimal-laws", "paper-c-front")
    points: ClassVar[int] = 8
    optimize_engagement = staticmethod(optimize_engagement)  # for `softstart clutch --optimal`

    def run(self, out: Path | None, progress: Progress) -> StudyResult:
        """All of it; `out` is not needed beyond what the caller writes."""
        progress("the laws of [C]")
        runs = printed.engagements()
        progress("readings of the paper")
        search, several = readings.search_table()
        found = tuple(
            optimize_engagement(printed.clutch(), self.points, law_class=law_class, progress=progress)
            for law_class in fronts.COVERS
        )
        tables = (*printed.tables(runs), search, *fronts.tables(found))
        progress("drawing")
        names = ["linear", *(f"optimal, {one.law_class}" for one in found)]
        best = [runs["linear"], *(one.points[0].run for one in found)]
        title = "The linear law, and the laws of the least peak with the least work"
        figures = (
            engagement_figure(list(runs.values()), "The laws of [C]", list(runs), IN_KGF),
            engagement_figure(best, title, names, IN_KGF),
            fronts.front_figure(list(found)),
        )
        return self.result(tables, verdicts.claims(runs, search, several, found), figures)
