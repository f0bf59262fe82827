"""Figures 2, 3 and 4 of [G] with the exact plant on top, and what became of each of its conclusions.

[G]: R. P. Gerasymiak, V. V. Subbotin, Dual-mass mechanical part electromechanical system behavior analysis,
pages 18-22.
"""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import ClassVar

from softstart.input.files import write_whole
from softstart.study import Progress, Study, StudyResult
from softstart_studies.paper_g import (
    curves,
    damping,
    durations,
    frequency,
    from_flank,
    invariance,
    pictures,
    wear,
    whole_start,
)
from softstart_studies.paper_g.crane import GAP_1, GAP_2, SHARE, crane, simulated

__all__ = ["PaperG"]


class PaperG(Study):
    """Every figure and conclusion of [G], recomputed.

    >>> PaperG.name, len(PaperG.pictures)
    ('paper-g', 8)
    """

    name: ClassVar[str] = "paper-g"
    title: ClassVar[str] = "Figures 2-4 and the conclusions of Gerasymiak & Subbotin [G], recomputed"
    pictures: ClassVar[tuple[str, ...]] = (
        "paper-g-figure-2",
        "paper-g-figure-3",
        "paper-g-figure-4",
        "paper-g-method-2-whole-start",
        "paper-g-method-2-torque",
        "paper-g-wear",
        "paper-g-frequency",
        "paper-g-invariance",
    )

    def run(self, out: Path | None, progress: Progress) -> StudyResult:
        """All of it; `out` receives the curves of figs. 2-4 as paper-g-curves.csv."""
        progress("figures 2, 3 and 4, closed form and plant")
        figures = {"2": curves.figure_2(), "3": curves.figure_3(), "4": curves.figure_4()}
        if out is not None:
            text = curves_csv(figures)
            write_whole(out / "paper-g-curves.csv", lambda stream: stream.write(text))
        progress("the whole start under method 2")
        starts = [whole_start.whole_start(gap) for gap in (GAP_1, GAP_2)]
        progress("wear")
        worn = wear.wear()
        progress("elastic frequency")
        sweeps = [frequency.detuned("load inertia"), frequency.detuned("stiffness")]
        progress("gap, inertia and stiffness")
        spreads = [invariance.spread(*strategy) for strategy in invariance.STRATEGIES]
        progress("from the flanks")
        flanks = from_flank.table()
        progress("drawing")
        traces = [
            ("method 2: raised at the end of stage 2, (15)", simulated(crane(), SHARE, 2)),
            ("raised at the peak of stage 2, (14)", whole_start.at_peak(GAP_1, SHARE)),
        ]
        drawn = (
            pictures.curves_figure(
                figures["2"], 2, "Fig. 2 of [G]: $\\delta_1 = 0.5$ rad, base of $J_2''$", pictures.K_DYN, 3.5
            ),
            pictures.curves_figure(figures["3"], 2, "Fig. 3 of [G]: $J_2'' = 5\\,J_1$", pictures.K_DYN, 5.2),
            pictures.curves_figure(figures["4"], 3, "Fig. 4 of [G]: $J_2'' = 5\\,J_1$", "time, ms", 250.0),
            pictures.whole_start_figure(starts),
            pictures.traces_figure(traces, 0.26),
            pictures.wear_figure(worn),
            pictures.frequency_figure(sweeps),
            pictures.invariance_figure(spreads),
        )
        return self.result(
            tables=(
                curves.worked_table(),
                curves.agreement_table(figures),
                durations.durations_table(),
                whole_start.table(starts),
                wear.table(worn),
                frequency.table(sweeps),
                invariance.table(spreads),
                flanks,
            ),
            claims=(
                *damping.of_methods(),
                *whole_start.claims(starts),
                *damping.of_gap_and_inertia(),
                *durations.claims(),
                *wear.claims(worn),
                *frequency.claims(sweeps),
                *invariance.claims(spreads),
                from_flank.claim(),
            ),
            figures=drawn,
        )


def curves_csv(figures: Mapping[str, Sequence[curves.Curve]]) -> str:
    """Curves and points as text, one row per value; the plant's column is empty where it was not asked."""
    stream = io.StringIO()
    stream.write("figure,curve,M1/Ms,closed form,plant\n")
    for number, drawn in figures.items():
        for curve in drawn:
            name = "".join(sign for sign in curve.label if sign not in '$\\,"')
            for r, value in zip(curve.r, curve.values, strict=True):
                stream.write(f'{number},"{name}",{r:.17g},{value:.17g},\n')
            for r, value, point in zip(curve.at, curve.exact, curve.points, strict=True):
                stream.write(f'{number},"{name}",{r:.17g},{value:.17g},{point:.17g}\n')
    return stream.getvalue()
