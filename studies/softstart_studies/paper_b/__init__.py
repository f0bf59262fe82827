"""The balancer of the engine VAZ-11113 in [B], with an engine model beside the printed formulas.

[B]: Khalaakin, on reducing the dynamic load of piston engines with balancing mechanisms. The paper prints
neither dimensions nor masses nor pressures: they are assumed, and named so in every output.
"""

from __future__ import annotations

from pathlib import Path
from typing import ClassVar

from softstart.input.files import write_whole
from softstart.study import Progress, Study, StudyResult
from softstart_studies.paper_b import convergence, over_speed, printed, sensitivity, verdicts
from softstart_studies.paper_b.vaz import VAZ, balanced

__all__ = ["PaperB"]


class PaperB(Study):
    """Formulas (1) to (5), figures 2 and 3 and the claims of [B].

    >>> PaperB.name, len(PaperB.pictures)
    ('paper-b', 5)
    """

    name: ClassVar[str] = "paper-b"
    title: ClassVar[str] = "The two-shaft balancer of the VAZ-11113 [B], beside an engine model"
    pictures: ClassVar[tuple[str, ...]] = (
        "paper-b-figure-2",
        "paper-b-figure-3",
        "paper-b-torque",
        "paper-b-residual",
        "paper-b-forces",
    )

    def run(self, out: Path | None, progress: Progress) -> StudyResult:
        """All of it; `out` receives the engine with its assumed values as vaz-11113.toml."""
        progress("balancing the engine over its speeds")
        found = balanced()
        if out is not None:
            write_whole(out / "vaz-11113.toml", lambda stream: stream.write(VAZ.to_toml()))
        progress("varying what is assumed")
        tables = (
            printed.table(),
            over_speed.curves_table(found),
            over_speed.designs_table(found),
            over_speed.loads_table(),
            sensitivity.table(),
            convergence.table(),
        )
        claims = verdicts.claims(found)
        progress("drawing")
        curves = over_speed.curves(found)
        drawn = found.figures()
        figures = (
            over_speed.figure_2(curves),
            over_speed.figure_3(curves),
            drawn["torque"],
            drawn["residual"],
            drawn["forces"],
        )
        return self.result(tables, claims, figures)
