"""The figures of a report; they draw what was computed, for paper."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from softstart.optimal.labels import name_points
from softstart.reporting.strategies import label_of
from softstart.views.drawing import COLOURS, DASHES, drawing, new_figure, shade_open_gap

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from softstart.reporting.choice import Candidate, Choice
    from softstart.reporting.limit import Limit
    from softstart.start.run import Run

GREY, SMALL = "#666666", 8.5
WIDE = 7.1  # inches: what an A4 page holds
MARKERS = "osD^vPX*"
MAP = "cividis"
MOST_STAGES = 6  # numbered
LONGEST = 32  # letters of a name in a figure


def traces_figure(runs: Sequence[Run], longest: float, lowest: float, highest: float) -> Any:
    """Torques (left) and speeds (right) of several starts; grey where the gap is open.

    Up to `longest` s; torques from `lowest` to `highest` N m, with some room, in all panels.
    """
    with drawing():
        size = (WIDE, 0.55 + 1.72 * len(runs))
        figure, axes = new_figure(len(runs), 2, size, sharex=True, squeeze=False)
        for index, run in enumerate(runs):
            torque, speed = axes[index]
            for panel in (torque, speed):
                shade_open_gap(panel, run)
            torque.plot(run.t, run.u, color=COLOURS[1], ls=DASHES[1], lw=1.0, label="motor torque u")
            torque.plot(run.t, run.T, color=COLOURS[0], lw=1.3, label="shaft torque T")
            torque.plot([run.peak_time], [_peak(run)], "o", ms=3.5, color=COLOURS[0])
            torque.set_ylim(min(-0.06 * highest, 1.06 * lowest), 1.12 * highest)
            torque.set_ylabel("N m", fontsize=SMALL)
            torque.set_title(
                f"{_literally(label_of(run.controller))}: K_dyn {run.k_dyn:.3f}",
                loc="left",
                fontsize=SMALL + 0.5,
                pad=3,
            )
            speed.plot(run.t, run.w1, color=COLOURS[1], ls=DASHES[1], lw=1.0, label="motor speed w1")
            speed.plot(run.t, run.w2, color=COLOURS[0], lw=1.3, label="load speed w2")
            speed.axhline(float(run.drive.target_speed), color=GREY, lw=0.8, ls=":")
            reached = not math.isnan(run.start_time)
            if reached:
                speed.axvline(run.start_time, color=GREY, lw=0.8, ls=":")
            said = f"start time {run.start_time:.4g} s" if reached else "target speed not reached"
            speed.set_title(said, loc="left", fontsize=SMALL + 0.5, pad=3)
            speed.set_ylabel("rad/s", fontsize=SMALL)
            _number_stages(torque, run, longest)
        for panel in axes.flat:
            panel.tick_params(labelsize=SMALL - 0.5)
            panel.set_xlim(0.0, longest)
        for panel in axes[-1]:
            panel.set_xlabel("time, s", fontsize=SMALL)
        handles = [*axes[0, 0].get_legend_handles_labels()[0], *axes[0, 1].get_legend_handles_labels()[0]]
        figure.legend(handles=handles, loc="outside upper center", ncols=4, fontsize=SMALL)
    return figure


def _literally(name: str) -> str:
    """A name as it is, not set as a formula, and cut where it is too long for a figure."""
    short = name if len(name) <= LONGEST else name[: LONGEST - 1] + "\N{HORIZONTAL ELLIPSIS}"
    return short.replace("$", r"\$")


def _peak(run: Run) -> float:
    return max(run.stages, key=lambda one: abs(one.peak_torque)).peak_torque


def _number_stages(axes: Axes, run: Run, longest: float) -> None:
    """The number of each stage at the top, as far as there is room."""
    for stage in run.stages[:MOST_STAGES]:
        if min(stage.end, longest) - stage.start > 0.025 * longest:
            middle = 0.5 * (stage.start + min(stage.end, longest))
            axes.text(middle, 0.985, str(stage.number), transform=axes.get_xaxis_transform(),
                      fontsize=SMALL - 1.5, ha="center", va="top", color=GREY)  # fmt: skip


def limit_figure(choice: Choice, limit: Limit) -> Any:
    """K_dyn against start time: the bound that nothing goes below, optima, every strategy."""
    placed = [one for one in choice.candidates if not math.isnan(one.row.run.start_time)]
    optima = limit.found
    own = [one.row.run.start_time for one in placed] + [p.start_time_bound for p in optima]
    own += [one.start_time for one in limit.known]
    left, right = min(own), max(own)
    right = max(right, 1.001 * left)  # a single start
    values = [one.row.run.k_dyn for one in placed] + [p.k_dyn for p in optima if p.k_dyn is not None]
    values += [one.k_dyn for one in limit.known]
    with drawing():
        figure, axes = new_figure(1, 1, (WIDE, 3.6))
        left, right = left - 0.15 * (right - left), right + 0.04 * (right - left)
        if limit.times:
            t, k = _within(limit, left, right, 2.0 * max(values))
            axes.fill_between(t, 0.0, k, fc="#F1F1F1", ec="#DADADA", hatch="////", lw=0.0, zorder=0)
            axes.plot(t, k, color=COLOURS[4], ls=DASHES[1], lw=1.8, label="lower bound: no torque goes below")
            values.append(float(k.min()))
        if optima:
            axes.plot(
                [p.start_time_bound for p in optima], [p.k_dyn for p in optima], "-", color=COLOURS[0],
                lw=1.2, marker=".", ms=7, label="optimum found", zorder=3,
            )  # fmt: skip
        if limit.known:
            axes.plot(
                [one.start_time for one in limit.known], [one.k_dyn for one in limit.known], ls=DASHES[2],
                color="black", lw=1.0, marker="+", ms=6, label="start found: possible, not proved best",
                zorder=3,
            )  # fmt: skip
        for index, one in enumerate(placed):
            best = one is choice.recommended or one is choice.ordinary
            axes.plot([one.row.run.start_time], [one.row.run.k_dyn], MARKERS[index % 8],
                      ms=8 if best else 6.5, mfc=COLOURS[(index + 1) % 8] if best else "white", mew=1.6,
                      color=COLOURS[(index + 1) % 8], zorder=4)  # fmt: skip
        axes.axhline(1.0, color=GREY, lw=0.8, ls=":")
        low, high = min(values), max(values)
        if high > 4.0 * low:
            _logarithmic(axes, low, high)
        else:
            axes.set_ylim(0.0, 1.1 * high)
        axes.set_xlim(left, right)
        axes.set_xlabel("start time, s")
        axes.set_ylabel("K_dyn")
        handles = axes.get_legend_handles_labels()[0]
        if handles:
            figure.legend(handles=handles, loc="outside upper center", ncols=3, fontsize=SMALL)
        points = [(_literally(one.name), one.row.run.start_time, one.row.run.k_dyn) for one in placed]
        name_points(figure, axes, points)
    return figure


def _within(limit: Limit, left: float, right: float, most: float) -> tuple[Any, Any]:
    """The curve of the bound in the frame: near the shortest start time it rises beyond all others."""
    times, bounds = np.array(limit.times), np.minimum(limit.bounds, most)
    inside = times[(times > left) & (times < right)]
    ends = [t for t in (left, right) if times[0] <= t <= times[-1]]
    t = np.union1d(inside, ends) if inside.size or ends else times
    return t, np.interp(t, times, bounds)


def _logarithmic(axes: Axes, low: float, high: float) -> None:
    from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

    axes.set_yscale("log")
    axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 1.5, 2.0, 3.0, 5.0, 7.0)))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda k, _: f"{k:g}"))
    axes.yaxis.set_minor_locator(NullLocator())
    axes.set_ylim(0.8 * low, 1.2 * high)


def maps_figure(shown: Sequence[Candidate], nominal: tuple[float, float]) -> Any:
    """K_dyn over gap and load inertia, one map a strategy, all in one scale of colours."""
    from matplotlib.colors import LogNorm, Normalize

    first = shown[0].map
    rows, columns = len(first.gaps), len(first.inertias)
    finite = np.concatenate([one.map.k_dyn[np.isfinite(one.map.k_dyn)] for one in shown])
    low, high = (float(finite.min()), float(finite.max())) if finite.size else (1.0, 2.0)
    high = max(high, low * 1.02)
    scale = LogNorm(low, high) if high > 3.0 * low else Normalize(low, high)
    down = math.ceil(len(shown) / 2)
    inertia, gap = _thousand(first.inertias), _thousand(first.gaps)
    with drawing():
        size = (WIDE, 0.35 + down * (0.75 + 0.31 * max(rows, 2)))
        figure, axes = new_figure(down, 2, size, squeeze=False)
        drawn: Any = None
        for panel, one in zip(axes.flat, shown, strict=False):
            panel.grid(visible=False)
            panel.set_facecolor("#D0D0D0")
            edges = np.arange(columns + 1) - 0.5, np.arange(rows + 1) - 0.5
            cells = np.ma.masked_invalid(one.map.k_dyn)
            drawn = panel.pcolormesh(*edges, cells, cmap=MAP, norm=scale, edgecolors="face", linewidth=0.3)
            for (i, j), value in np.ndenumerate(one.map.k_dyn):
                dark = math.isnan(value) or float(scale(value)) > 0.55
                text = f"{value:.2f}" if math.isfinite(value) else "none"
                panel.text(j, i, text, ha="center", va="center", fontsize=SMALL - 1.0,
                           color="black" if dark else "white")  # fmt: skip
            _frame(panel, first.gaps.index(nominal[0]), first.inertias.index(nominal[1]))
            panel.set_title(f"{_literally(one.name)}: {_worst(one)}", loc="left", fontsize=SMALL + 0.5)
            panel.set_xticks(
                range(columns), [f"{v / inertia:.3g}" for v in first.inertias], fontsize=SMALL - 0.5
            )
            panel.set_yticks(range(rows), [f"{v / gap:.3g}" for v in first.gaps], fontsize=SMALL - 0.5)
            panel.tick_params(length=0)
        for panel in axes.flat[len(shown) :]:
            panel.set_axis_off()
        for panel in axes[:, 0]:
            panel.set_ylabel(f"gap, {_powers(gap)}rad", fontsize=SMALL)
        for panel in axes.flat[max(0, len(shown) - 2) : len(shown)]:
            panel.set_xlabel(f"load inertia J2, {_powers(inertia)}kg m²", fontsize=SMALL)
        bar = figure.colorbar(drawn, ax=axes, shrink=0.9, aspect=28)
        bar.set_label("K_dyn", fontsize=SMALL)
        bar.solids.set_rasterized(False)  # a picture of pixels would have to be loaded
        bar.solids.set_edgecolor("face")
        _plain_ticks(bar, low, high)
    return figure


def _thousand(values: Sequence[float]) -> float:
    """The power of a thousand in whose multiples small or large numbers are short, 1 for usual ones."""
    if max(values) == 0.0 or (values[0] >= 1e-2 and max(values) < 1e3):
        return 1.0
    return 1e3 ** math.floor(math.log10(max(values)) / 3.0)


def _powers(unit: float) -> str:
    """Such a power, to stand before a unit."""
    return "" if unit == 1.0 else f"$10^{{{round(math.log10(unit))}}}$ "


def _worst(one: Candidate) -> str:
    return f"worst {one.worst:.3f}" if math.isfinite(one.worst) else "grey: no start"


def _plain_ticks(bar: Any, low: float, high: float) -> None:
    from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

    ticks = [float(f"{v:.2g}") for v in np.geomspace(low, high, 6)]
    bar.ax.yaxis.set_major_locator(FixedLocator([v for v in ticks if low <= v <= high]))
    bar.ax.yaxis.set_minor_locator(NullLocator())
    bar.ax.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    bar.ax.tick_params(labelsize=SMALL - 0.5)


def _frame(axes: Axes, row: int, column: int) -> None:
    """A frame around the drive as it is."""
    from matplotlib.patches import Rectangle

    for colour, width in (("white", 3.4), ("#D55E00", 1.8)):
        axes.add_patch(
            Rectangle((column - 0.5, row - 0.5), 1.0, 1.0, fc="none", ec=colour, lw=width, zorder=5)
        )
