"""Each answer as a point: how long it took, and how far its re-simulated K_dyn lies above the least one."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, cast

from softstart.views.drawing import COLOURS, drawing, new_figure
from softstart_studies.benchmarks.optima.entries import ENTRIES
from softstart_studies.benchmarks.optima.verdicts import Outcome

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def optima_figure(outcomes: Sequence[Outcome]) -> Figure:
    """K_dyn over computing time, a panel a start time, by package; hollow where a condition breaks."""
    from matplotlib.ticker import LogLocator

    tasks = list(dict.fromkeys(one.task for one in outcomes))
    packages = list(dict.fromkeys(entry.package for entry in ENTRIES.values()))
    with drawing():
        figure, grid = new_figure(1, max(1, len(tasks)), (5.2 * max(1, len(tasks)), 4.2), squeeze=False)
        for axes, task in zip(grid[0], tasks, strict=False):
            for one in outcomes:
                if one.task != task or one.judged is None:
                    continue
                colour = COLOURS[packages.index(ENTRIES[one.name].package)]
                place = (one.seconds, one.judged.k_dyn)
                axes.plot(*place, "o", color=colour, markerfacecolor=colour if one.kept else "white")
                axes.annotate(one.name, place, (5, 4), textcoords="offset points", color=colour)
            axes.set_xscale("log")
            for formatter in (axes.xaxis.set_major_formatter, axes.xaxis.set_minor_formatter):
                formatter(lambda seconds, _: f"{seconds:g}")
            axes.xaxis.set_minor_locator(LogLocator(subs=(2.0, 5.0)))
            axes.ticklabel_format(axis="y", useOffset=False)
            axes.margins(x=0.25, y=0.12)
            axes.set_xlabel("computing time, s")
            axes.set_title(f"start within {task.start_time:g} s", loc="left")
        grid[0][0].set_ylabel("$K_{dyn}$ re-simulated (hollow: a condition is not kept)")
    return cast("Figure", figure)
