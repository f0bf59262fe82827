"""The lives as curves; nothing is computed here."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from softstart.views.drawing import COLOURS, DASHES, drawing, new_figure
from softstart_studies.wear.life import WAYS, Life

if TYPE_CHECKING:
    from matplotlib.figure import Figure

ACROSS = 3
GREY = "#666666"
MOST = 6.0  # K_dyn shown at the most


def life_figure(found: Life) -> Figure:
    """K_dyn over the gap, a panel a controller, a line a way of setting up."""
    return _panels(found, lambda one: one.k_dyn, "$K_{dyn}$", "dotted: direct")


def ratio_figure(found: Life) -> Figure:
    """K_dyn over the optimum at the controller's own start time."""
    return _panels(found, found.ratio, "$K_{dyn}$ / optimum", "optimum: in the start's own time, lag-free")


def _panels(found: Life, pick: Any, label: str, note: str) -> Figure:
    rows = math.ceil(len(found.courses) / ACROSS)
    absolute = "optimum" not in label
    with drawing():
        figure, axes = new_figure(
            rows, ACROSS, (3.6 * ACROSS, 0.6 + 2.5 * rows), sharex=True, sharey=True, squeeze=False
        )
        for index, (name, ways) in enumerate(found.courses.items()):
            panel = axes[index // ACROSS, index % ACROSS]
            if absolute:
                panel.plot(found.gaps, found.direct.k_dyn, color=GREY, lw=1.0, ls=":")
            for number, way in enumerate(WAYS):
                panel.plot(found.gaps, pick(ways[way]), color=COLOURS[number], ls=DASHES[number], label=way)
            panel.set_title(name, loc="left")
            panel.set_xscale("log")
            panel.set_xticks(found.extent.scheduled, [f"{gap:g}" for gap in found.extent.scheduled])
            panel.minorticks_off()
        axes[0, 0].set_ylim(0.8 if absolute else 0.95, MOST)
        if not absolute:
            axes[0, 0].set_yscale("log")
            axes[0, 0].set_yticks([1, 1.2, 1.5, 2, 3, 5], ["1", "1.2", "1.5", "2", "3", "5"])
            for panel in axes.flat:
                panel.minorticks_off()
        axes[0, 0].legend(loc="upper left")
        for index in range(len(found.courses), rows * ACROSS):
            axes[index // ACROSS, index % ACROSS].set_axis_off()
        for row in axes:
            row[0].set_ylabel(label)
        for panel in axes[-1]:
            panel.set_xlabel("gap, rad")
        figure.suptitle(f"{label} while the gap wears ({note})", x=0.01, ha="left", fontsize=11)
    return figure  # type: ignore[no-any-return]
