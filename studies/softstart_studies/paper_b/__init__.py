"""The balancer of the engine VAZ-11113 in [B], with an engine model beside the printed formulas.

[B]: Khalaakin, on reducing the dynamic load of piston engines with balancing mechanisms. The paper prints
neither dimensions nor masses nor pressures: they are assumed, and named so in every output. Which orders the
two shafts remove: the first of the force, at all speeds; the sine of the first of the torque, at one
(`verdicts.py`).
"""

from __future__ import annotations

from pathlib import Path
from typing import ClassVar

from softstart.input.files import write_whole
from softstart.study import Progress, Study, StudyResult
from softstart_studies.paper_b import figures, tables, verdicts
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
        "paper-b-figure-2", "paper-b-figure-3", "paper-b-torque", "paper-b-residual", "paper-b-forces",
    )  # fmt: skip

    def run(self, out: Path | None, progress: Progress) -> StudyResult:
        """All of it; `out` receives the engine with its assumed values as vaz-11113.toml."""
        progress("balancing the engine over its speeds")
        found = balanced()
        if out is not None:
            write_whole(out / "vaz-11113.toml", lambda stream: stream.write(VAZ.to_toml()))
        progress("varying what is assumed")
        made = (
            tables.printed_and_model(), tables.loads(),
            tables.assumptions(),
        )  # fmt: skip
        claims = verdicts.claims(found)
        progress("drawing")
        return self.result(
            made, claims, (*figures.over_speed(found), *(draw() for draw in found.figures.values()))
        )
