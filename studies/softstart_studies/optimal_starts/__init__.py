"""The gentlest starts of the crane drive of [G]: profiles, limits, and what a sensor or smoothness is worth.

The theory is in docs/optimal-starts.md, the drive in crane.py.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

from softstart.optimal.front import Front
from softstart.study import Progress, Study, StudyResult
from softstart_studies.optimal_starts import fronts, kinds, limits, profiles, sensor, smooth, terminals
from softstart_studies.optimal_starts.crane import CRANE, TARGET, Extent

__all__ = ["OptimalStarts"]


@dataclass(frozen=True)
class Found:
    """Everything that was worked out."""

    profiles: list[profiles.OptimalStart]
    fronts: list[Front]
    endings: list[terminals.Endings]
    sensed: list[sensor.Sensed]
    prices: list[smooth.Price]
    kinds: list[kinds.Kind]


def find(extent: Extent, progress: Progress) -> Found:
    """All the optima, in the order of docs/optimal-starts.md."""
    curves = fronts.fronts(extent, progress)
    return Found(
        profiles.starts(extent, progress),
        curves,
        [terminals.endings(front, progress) for front in curves],
        sensor.sensed(extent, progress),
        smooth.prices(extent, progress),
        kinds.kinds(extent, progress),
    )


class OptimalStarts(Study):
    """The limit of every controller, with its lower bound.

    >>> OptimalStarts.name, len(OptimalStarts.pictures)
    ('optimal-starts', 6)
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
        "optimal-starts-sensor",
        "optimal-starts-smooth",
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
    claims = (
        *limits.claims(found.fronts, progress),
        *fronts.claims(found.fronts),
        *terminals.claims(found.endings),
        *sensor.claims(found.sensed),
        *smooth.claims(found.prices),
        *kinds.claims(found.kinds),
    )
    progress("drawing")
    from softstart.views.optima import front_figure
    from softstart_studies.optimal_starts import pictures

    new, worn = found.fronts[0], found.fronts[-1]
    drawn = (
        pictures.profiles_figure(found.profiles, CRANE.mean_torque, TARGET),
        front_figure(new),
        front_figure(worn),
        pictures.terminals_figure(found.endings),
        pictures.sensor_figure(found.sensed),
        pictures.smooth_figure(found.prices),
    )
    return OptimalStarts.result(
        tables=(
            limits.table(found.fronts),
            profiles.table(found.profiles),
            fronts.table(found.fronts),
            fronts.controllers_table(found.fronts),
            terminals.table(found.endings),
            sensor.table(found.sensed),
            smooth.table(found.prices),
            kinds.table(found.kinds, found.profiles),
        ),
        claims=claims,
        figures=drawn,
    )
