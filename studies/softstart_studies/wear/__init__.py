"""What wear does to a start: one drive, its gap from new to worn, under every controller.

The drive is the crane drive of [G], target speed 60 rad/s, torque lag 2 ms (assumed),
encoder of 4096 lines.
"""

from __future__ import annotations

from pathlib import Path
from typing import ClassVar

from softstart.study import Progress, Study, StudyResult
from softstart_studies.wear.life import Extent, Life, live
from softstart_studies.wear.pictures import life_figure, ratio_figure
from softstart_studies.wear.tables import claims, tables

__all__ = ["Extent", "Wear", "live", "present"]


class Wear(Study):
    """Every controller's K_dyn and start time over the life of the drive, against the optimum.

    >>> Wear.name, Wear.pictures
    ('wear', ('wear-life', 'wear-over-optimum'))
    """

    name: ClassVar[str] = "wear"
    title: ClassVar[str] = "The crane drive of [G] from new to worn, with fixed and with scheduled gains"
    pictures: ClassVar[tuple[str, ...]] = ("wear-life", "wear-over-optimum")

    def run(self, out: Path | None, progress: Progress) -> StudyResult:
        """All of it; nothing is written beyond tables and pictures."""
        return present(live(Extent(), progress), progress)


def present(found: Life, progress: Progress) -> StudyResult:
    """Tables, claims and figures of what was found."""
    progress("drawing")
    drawn = (life_figure(found), ratio_figure(found))
    return StudyResult(tables(found), claims(found), dict(zip(Wear.pictures, drawn, strict=True)))
