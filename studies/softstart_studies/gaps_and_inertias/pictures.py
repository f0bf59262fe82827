"""Maps of K_dyn over the optimum, over gap and load inertia, a panel a controller."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from softstart.views.drawing import drawing, new_figure
from softstart_studies.gaps_and_inertias.cells import Grid

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

ACROSS = 3
MAP = "cividis"
MOST = 3.0  # ratio from which on all colours are the same
LIGHT = 0.55
LATE = "#D55E00"


def maps_figure(grid: Grid, prefix: str, heading: str) -> Figure:
    """K_dyn of every controller over its optimum; `heading` says which gains."""
    panels = [(name, grid.ratio(name, prefix), grid.late(name, prefix)) for name in grid.tunings]
    rows = math.ceil(len(panels) / ACROSS)
    finite = np.concatenate([values[np.isfinite(values)] for _, values, _ in panels])
    low, high = 1.0, min(float(np.max(finite, initial=1.1)), MOST)
    with drawing():
        figure, axes = new_figure(rows, ACROSS, (3.0 * ACROSS, 0.6 + 2.2 * rows), squeeze=False)
        for index, (name, values, late) in enumerate(panels):
            _map(axes[index // ACROSS, index % ACROSS], grid, values, late, (low, high))
            axes[index // ACROSS, index % ACROSS].set_title(name, loc="left")
        for index in range(len(panels), rows * ACROSS):
            axes[index // ACROSS, index % ACROSS].set_axis_off()
        for row in axes:
            row[0].set_ylabel("gap, rad")
        for index in range(max(0, len(panels) - ACROSS), len(panels)):
            axes[index // ACROSS, index % ACROSS].set_xlabel("J2/J1")
        figure.suptitle(
            f"$K_{{dyn}}$ over the optimum in the same time, {grid.kind} load, {heading} "
            "(struck through: slower than the defaults)",
            x=0.01, ha="left", fontsize=11,
        )  # fmt: skip
    return figure  # type: ignore[no-any-return]


def _map(axes: Axes, grid: Grid, values: Any, late: Any, limits: tuple[float, float]) -> None:
    low, high = limits
    axes.grid(False)
    axes.imshow(values, cmap=MAP, vmin=low, vmax=high, origin="lower", aspect="auto")
    for (i, j), value in np.ndenumerate(values):
        share = (value - low) / (high - low) if math.isfinite(value) else 1.0
        text = f"{value:.2f}" if math.isfinite(value) else "-"
        axes.text(
            j, i, text, ha="center", va="center", fontsize=8, color="#000000" if share > LIGHT else "#FFFFFF"
        )
        if math.isfinite(value) and late[i, j]:
            axes.plot([j - 0.45, j + 0.45], [i - 0.45, i + 0.45], color=LATE, lw=1.2)
    axes.set_xticks(range(len(grid.extent.inertias)), [f"{v:g}" for v in grid.extent.inertias])
    axes.set_yticks(range(len(grid.extent.gaps)), [f"{v:g}" for v in grid.extent.gaps])
    axes.tick_params(length=0)
    for spine in axes.spines.values():
        spine.set_visible(False)
