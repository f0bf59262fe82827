"""Reducing torsional systems with gaps [R]: its tables, its reduction, and its six findings.

[R]: V. S. Popovich, R. E. Pestretsov, on reducing torsional systems of machine units with gaps. The paper
prints speed ratios and gaps of the tractor T-4, but neither inertias nor stiffnesses: the findings are
tried on a tractor-like chain whose inertias and stiffnesses are assumed, and named so in every output.
tables.py has tables 1 and 2, four_to_two.py and lever.py the reduction and its error, findings.py the
findings. No claim is refuted; what holds in part only, and why: docs/paper-r.md.
"""

from __future__ import annotations

from pathlib import Path
from typing import ClassVar

from softstart.input.files import write_whole
from softstart.study import Progress, Study, StudyResult
from softstart_studies.paper_r import findings, four_to_two, lever, tables

__all__ = ["PaperR"]


class PaperR(Study):
    """Tables 1 and 2, the reduction of four masses to two, and the findings of [R].

    >>> PaperR.name, len(PaperR.pictures)
    ('paper-r', 2)
    """

    name: ClassVar[str] = "paper-r"
    title: ClassVar[str] = "Reducing chains with gaps [R], and what gaps do to a tractor-like chain"
    pictures: ClassVar[tuple[str, ...]] = ("paper-r-four-to-two", "paper-r-shapes")

    def run(self, out: Path | None, progress: Progress) -> StudyResult:
        """All of it; `out` receives the chain with its assumed values."""
        if out is not None:
            text = findings.tractor().to_toml()
            write_whole(out / "tractor-like.toml", lambda stream: stream.write(text))
        progress("reducing four masses to two")
        errors = four_to_two.error_map()
        progress("letting the tractor-like chain swing, and driving it")
        shown = (
            tables.recomputed_table(),
            four_to_two.map_table(),
            lever.chains_table(),
            *findings.tables(),
        )
        claims = [*tables.claims(), *four_to_two.claims(errors), *findings.claims()]
        progress("drawing")
        return self.result(shown, claims, (four_to_two.map_figure(errors), findings.shapes_figure()))
