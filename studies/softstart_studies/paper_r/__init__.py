"""Reducing torsional systems with gaps [R]: its tables, its reduction, and its six findings.

[R]: V. S. Popovich, R. E. Pestretsov, on reducing torsional systems of machine units with gaps. The paper
prints speed ratios and gaps of the tractor T-4, but neither inertias nor stiffnesses: the findings are tried
on a tractor-like chain whose inertias and stiffnesses are assumed, and named so in every output.
"""

from __future__ import annotations

from pathlib import Path
from typing import ClassVar

from softstart.study import Progress, Study, StudyResult
from softstart_studies.paper_r import findings, four_to_two, free, lever, locked, pictures, tables

__all__ = ["PaperR"]


class PaperR(Study):
    """Tables 1 and 2, the reduction of four masses to two, and the findings of [R].

    >>> PaperR.name, len(PaperR.pictures)
    ('paper-r', 4)
    """

    name: ClassVar[str] = "paper-r"
    title: ClassVar[str] = "Reducing chains with gaps [R], and what gaps do to a tractor-like chain"
    pictures: ClassVar[tuple[str, ...]] = (
        "paper-r-four-to-two",
        "paper-r-shapes",
        "paper-r-nodes",
        "paper-r-locking",
    )

    def run(self, out: Path | None, progress: Progress) -> StudyResult:
        """All of it; `out` receives the chain with its assumed values and its scheme."""
        if out is not None:
            from softstart.input.files import write_whole
            from softstart.vibration import natural_vibration
            from softstart.views.drawing import save_figure

            chain = free.tractor()
            write_whole(out / "tractor-like.toml", lambda stream: stream.write(chain.to_toml()))
            save_figure(natural_vibration(chain).plot(), out, "tractor-like")
        progress("reducing four masses to two")
        errors = four_to_two.error_map()
        progress("letting the tractor-like chain swing")
        of_free = (
            findings.masses_table(),
            findings.sections_table(),
            free.node_table(),
            free.backbone_table(),
            findings.widths_table(),
        )
        progress("driving it, with and without a constant torque")
        of_locked = (locked.locked_table(), locked.forced_table())
        claims = [*tables.claims(), *four_to_two.claims(errors), *findings.claims()]
        progress("drawing")
        figures = (
            pictures.map_figure(errors),
            pictures.shapes_figure(),
            pictures.node_figure(),
            pictures.locking_figure(),
        )
        shown = (
            tables.recomputed_table(),
            four_to_two.map_table(),
            lever.chains_table(),
            *of_free,
            *of_locked,
        )
        return self.result(shown, claims, figures)
