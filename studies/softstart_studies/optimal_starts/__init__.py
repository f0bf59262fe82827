"""The gentlest starts of the crane drive of [G]: how they look, how near controllers come, what they cost.

The optimal start of the crane is drawn by profiles.py (figure optimal-starts-profiles: motor torque, shaft
torque and speeds, both gaps); limits.py has the least K_dyn over the start time, what no start undercuts and
the controllers beside it; costs.py the terminal conditions. The theory is in docs/optimal-starts.md, the
drive in drives.py.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

from softstart.optimal.front import Front
from softstart.study import Progress, Study, StudyResult
from softstart_studies.optimal_starts import costs, limits, profiles
from softstart_studies.optimal_starts.drives import Extent

__all__ = ["OptimalStarts"]


@dataclass(frozen=True)
class Found:
    """Everything that was worked out."""

    profiles: list[profiles.OptimalStart]
    fronts: list[Front]
    endings: list[costs.Endings]


def find(extent: Extent, progress: Progress) -> Found:
    """All the optima."""
    curves = limits.fronts(extent, progress)
    return Found(
        profiles.starts(extent, progress),
        curves,
        [costs.endings(front, progress) for front in curves],
    )


class OptimalStarts(Study):
    """The limit of every controller, with its lower bound.

    >>> OptimalStarts.name, len(OptimalStarts.pictures)
    ('optimal-starts', 4)
    """

    name: ClassVar[str] = "optimal-starts"
    title: ClassVar[str] = (
        "The gentlest starts of the crane drive of [G], and how near controllers come to them"
    )
    pictures: ClassVar[tuple[str, ...]] = (
        "optimal-starts-profiles",
        "optimal-starts-front-new",
        "optimal-starts-front-worn",
        "optimal-starts-terminals",
    )

    def run(self, out: Path | None, progress: Progress) -> StudyResult:
        """All of it; `out` receives each front with its controllers as CSV, numbers with all their digits."""
        found = find(Extent(), progress)
        if out is not None:
            for stem, front in zip(self.pictures[1:3], found.fronts, strict=True):
                front.to_csv(out / f"{stem}.csv")
        return present(found, progress)


def present(found: Found, progress: Progress) -> StudyResult:
    """Tables, claims and figures of what was found."""
    from softstart.views.optima import front_figure

    claims = (
        *limits.claims(found.fronts, progress),
        costs.reached_is_lower(found.endings),
        costs.steady_costs(found.endings),
        limits.optimum_depends_on_gap(),
    )
    progress("drawing")
    fronts = front_figure(found.fronts[0]), front_figure(found.fronts[-1])
    drawn = profiles.figure(found.profiles), *fronts, costs.endings_figure(found.endings)
    return OptimalStarts.result(limits.tables(found.fronts), claims, drawn)
