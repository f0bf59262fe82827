"""Every conclusion of [G] with its verdict and number, and its figures 2 to 4 with the exact plant on top.

[G]: R. P. Gerasymiak, V. V. Subbotin, Dual-mass mechanical part electromechanical system behavior analysis,
pages 18-22. What does not come out (all numbers: docs/paper-g.md, `softstart study paper-g`):

- refuted: method 2 is to be preferred. The second contact has K_dyn 2.3894 (the first 1.2677), as method 1.
- refuted: the least K_dyn is proportional to J2. J2 by 0.4 changes it by 0.856.
- partly: a smaller J2 lowers K_dyn; stage 2 is as long under both methods, stage 1 for every J2 (stages.py);
  switching by time fails with wear and the delay does not; the delay fits within 10-20 % of the elastic
  frequency; feedback is invariant (set_up_once.py); the conclusions hold from a flank (from_flank.py).
"""

from __future__ import annotations

from pathlib import Path
from typing import ClassVar

from softstart.study import Progress, Study, StudyResult
from softstart_studies.paper_g import curves, from_flank, set_up_once, stages, whole_start
from softstart_studies.paper_g.crane import GAP_1, GAP_2

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
        """All of it; nothing is written beyond tables and pictures."""
        progress("figures 2, 3 and 4, closed form and plant")
        drawn = curves.figures()
        progress("the whole start under method 2")
        starts = [whole_start.whole_start(gap) for gap in (GAP_1, GAP_2)]
        progress("wear")
        worn = set_up_once.worn()
        progress("elastic frequency")
        by_load, by_shaft = set_up_once.detuned("load inertia"), set_up_once.detuned("stiffness")
        progress("gap, inertia and stiffness")
        spreads = set_up_once.spreads()
        progress("from the flanks")
        tables = (
            curves.worked_table(),
            curves.agreement_table(drawn),
            set_up_once.spreads_table(spreads),
            from_flank.table(),
        )
        claims = (
            stages.method_1_stays_above_2(),
            stages.method_2_goes_below_2(),
            whole_start.method_2_is_gentler(starts),
            whole_start.raising_at_the_peak(starts),
            stages.wider_gap(),
            stages.smaller_inertia(),
            stages.least_k_dyn(),
            stages.stage_2_alike(),
            stages.stage_1_decides(),
            stages.stage_1_keeps_with_inertia(),
            set_up_once.time_fails(worn),
            set_up_once.acceleration_holds(worn),
            set_up_once.delay_fits(by_load, by_shaft),
            set_up_once.feedback_is_invariant(spreads),
            from_flank.claim(),
        )
        progress("drawing")
        figures = (
            *(curves.figure(*one) for one in drawn.items()),
            whole_start.figure(starts),
            whole_start.traces_figure(),
            set_up_once.wear_figure(worn),
            set_up_once.frequency_figure(by_load, by_shaft),
            set_up_once.spreads_figure(spreads),
        )
        return self.result(tables, claims, figures)
