"""The ratios as bars."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, cast

from softstart.views.drawing import COLOURS, drawing, new_figure
from softstart_studies.benchmarks.contenders import ENTRIES
from softstart_studies.benchmarks.contest import Outcome, shown

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SHORT = {
    "kernel": "kernel, batch",
    "batch": "simulate, batch",
    "run": "simulate, Run",
    "run-traces": "simulate, Run with traces",
    "lsoda": "LSODA",
    "lsoda-restarted": "LSODA, each stage",
    "lsoda-sampled": "LSODA, each sample",
    "control": "control, defaults",
    "control-tight": "control, 1e-8",
    "diffrax": "diffrax, vmapped batch",
}


def ratio_figure(outcomes: Sequence[Outcome]) -> Figure:
    """One bar a row of the table, coloured by peer; a black tick where a ratio was wanted."""
    packages = list(dict.fromkeys(ENTRIES[one.duel.peer].package for one in outcomes))
    with drawing():
        figure, axes = new_figure(1, 1, (8.0, 1.4 + 0.42 * len(outcomes)))
        for place, one in enumerate(outcomes):
            package = ENTRIES[one.duel.peer].package
            axes.barh(place, one.ratio, height=0.66, left=0.0, color=COLOURS[packages.index(package)])
            # at the right edge, where no bar and no tick can cross it
            axes.annotate(
                shown(one.ratio), (1.0, place), xycoords=("axes fraction", "data"), ha="right", va="center"
            )
            if one.duel.wanted is not None:
                axes.plot([one.duel.wanted] * 2, [place - 0.42, place + 0.42], color="black", lw=1.8)
        axes.set_xscale("log")
        wanted = [one.duel.wanted or 1.0 for one in outcomes]
        axes.set_xlim(1.0, 10.0 * max([1.0, *wanted, *(one.ratio for one in outcomes)]))
        axes.set_yticks(range(len(outcomes)))
        axes.set_yticklabels(
            [f"{one.duel.strategy}:  {SHORT[one.duel.ours]} : {SHORT[one.duel.peer]}" for one in outcomes]
        )
        axes.invert_yaxis()
        axes.grid(visible=False, axis="y")
        axes.set_xlabel("starts/s of softstart : starts/s of the peer     (black tick: wanted)")
        axes.set_title("Same starts, same end, one core, in one run", loc="left")
    return cast("Figure", figure)
