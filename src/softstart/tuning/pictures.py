"""Figures of tuning: maps over gap and load inertia, each cell with its number."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from softstart.errors import InputError
from softstart.views.drawing import drawing, new_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from xarray import Dataset

    from softstart.tuning.outcome import Tuning

MAP = "cividis"  # even in lightness for colour-blind and grey readers alike
SMALL = 9.0
CELL, ROW = 0.62, 0.42  # inches a cell
FEWEST = 3.2, 1.6  # inches of a map, at the least
ACROSS = 3  # maps side by side
LIGHT = 0.55  # of the map from which on numbers are dark


def figure_of(tuning: Tuning, what: str | None) -> Any:
    """The figure asked for; InputError where there is nothing to draw."""
    if what is None:
        what = "price" if tuning.price is not None else "metric" if tuning.schedule is not None else "robust"
    made = {"gains": gain_maps, "metric": metric_maps, "robust": robust_maps, "price": price_maps}
    if what not in made:
        raise InputError(f"what = {what!r}: choose one of {', '.join(made)}.")
    return made[what](tuning)


def gain_maps(tuning: Tuning) -> Any:
    """Each tuned parameter over the grid."""
    table = _schedule(tuning)
    maps = [(one.name, one.name, one.unit) for one in tuning.question.ranges]
    return _maps(tuning, table, maps, "gains of each cell")


def metric_maps(tuning: Tuning) -> Any:
    """The metric with the defaults, tuned, and how many searches agree."""
    table, name, said = _schedule(tuning), tuning.metric, _said(tuning)
    maps = [
        (f"{name}_default", f"{said}, defaults", ""),
        (name, f"{said}, tuned for each cell", ""),
        ("start_time" if "start_time" in table else name, "start time, tuned", "s"),
    ]
    return _maps(tuning, table, maps, "each cell tuned by itself", together=2)


def robust_maps(tuning: Tuning) -> Any:
    """The metric of one set of gains, and of the defaults of the nominal drive."""
    table, name, said = tuning._robust().cells, tuning.metric, _said(tuning)
    maps = [
        (f"{name}_default", f"{said}, defaults", ""),
        (name, f"{said}, one set for all", ""),
        ("start_time" if "start_time" in table else name, "start time, one set", "s"),
    ]
    return _maps(tuning, table, maps, "set up for the nominal drive", together=2)


def price_maps(tuning: Tuning) -> Any:
    """What one set costs against gains for each cell, and both against the optimum."""
    table = tuning.price
    if table is None:
        raise InputError("price: it needs the schedule and the robust set, or the certified optima.")
    titles = {
        "robust_over_schedule": "one set / each cell tuned",
        "schedule_over_optimum": "each cell tuned / optimum",
        "robust_over_optimum": "one set / optimum",
    }
    maps = [(name, title, "") for name, title in titles.items() if name in table]
    return _maps(tuning, table, maps, f"price of robustness, ratios of {_said(tuning)}", together=3)


def _said(tuning: Tuning) -> str:
    """The metric as the papers write it."""
    return tuning.metric.replace("k_dyn", "K_dyn")


def _schedule(tuning: Tuning) -> Dataset:
    if tuning.schedule is None:
        raise InputError("schedule: no schedule was tuned; call tune with schedule=True.")
    return tuning.schedule


def _maps(
    tuning: Tuning, table: Dataset, maps: list[tuple[str, str, str]], title: str, together: int = 0
) -> Any:
    """Maps side by side; the first `together` share one scale of colours."""
    rows, columns = len(tuning.question.gaps), len(tuning.question.load_inertias)
    across = min(ACROSS, len(maps))
    down = math.ceil(len(maps) / across)
    width, height = max(FEWEST[0], 1.2 + CELL * columns), max(FEWEST[1], 0.9 + ROW * rows)
    shared = [np.asarray(table[name], dtype=np.float64) for name, _, _ in maps[:together]]
    with drawing():
        figure, axes = new_figure(down, across, (width * across, 0.5 + height * down), squeeze=False)
        for index, (name, heading, unit) in enumerate(maps):
            values = np.asarray(table[name], dtype=np.float64)
            limits = _limits(shared if index < together else [values])
            panel = axes[index // across, index % across]
            _map(panel, tuning, values, limits)
            panel.set_title(
                heading + (f", {unit}" if unit not in ("", "1") else ""), loc="left", fontsize=SMALL
            )
            if "in_time" in table and name in (tuning.metric, "start_time"):
                _cross_out(panel, ~np.asarray(table["in_time"], dtype=bool))
        for index in range(len(maps), down * across):
            axes[index // across, index % across].set_axis_off()
        for panel in axes[:, 0]:
            panel.set_ylabel("gap, rad")
        for index in range(len(maps)):
            if index + across >= len(maps):
                axes[index // across, index % across].set_xlabel("load inertia J2, kg m2")
        figure.suptitle(f"{tuning.drive.name}: {tuning.controller}, {title}", x=0.01, ha="left", fontsize=11)
    return figure


def _limits(values: list[Any]) -> tuple[float, float]:
    """Ends of the colours, from the finite values."""
    finite = np.concatenate([v[np.isfinite(v)] for v in values]) if values else np.zeros(0)
    if finite.size == 0:
        return 0.0, 1.0
    low, high = float(finite.min()), float(finite.max())
    return (
        (low, high)
        if high > low * (1.0 + 1e-9)
        else (low - 0.5 * abs(low) - 0.5, high + 0.5 * abs(high) + 0.5)
    )


def _map(axes: Axes, tuning: Tuning, values: Any, limits: tuple[float, float]) -> None:
    """One map, wide gaps at the top; every cell says its number."""
    low, high = limits
    axes.grid(False)
    axes.imshow(values, cmap=MAP, vmin=low, vmax=high, origin="lower", aspect="auto")
    texts = _texts(values)
    for (i, j), value in np.ndenumerate(values):
        share = (value - low) / (high - low) if math.isfinite(value) else 1.0
        colour = "#000000" if share > LIGHT else "#FFFFFF"
        axes.text(j, i, texts[i][j], ha="center", va="center", color=colour, fontsize=SMALL - 1.0)
    question = tuning.question
    axes.set_xticks(range(len(question.load_inertias)), [f"{v:.3g}" for v in question.load_inertias])
    axes.set_yticks(range(len(question.gaps)), [f"{v:.3g}" for v in question.gaps])
    axes.tick_params(length=0)
    for spine in axes.spines.values():
        spine.set_visible(False)


def _texts(values: Any) -> list[list[str]]:
    """Numbers with as many decimals as make three digits of the largest."""
    finite = np.abs(values[np.isfinite(values)])
    largest = float(finite.max()) if finite.size else 0.0
    decimals = 2 if largest <= 0.0 else min(max(2 - math.floor(math.log10(largest)), 0), 6)
    return [[f"{v:.{decimals}f}" if math.isfinite(v) else "-" for v in row] for row in values.tolist()]


def _cross_out(axes: Axes, late: Any) -> None:
    """A line through the cells whose start time is beyond its bound."""
    for i, j in np.argwhere(late):
        axes.plot([j - 0.5, j + 0.5], [i - 0.5, i + 0.5], color="#D55E00", lw=1.2)
