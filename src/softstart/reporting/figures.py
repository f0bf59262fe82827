"""The figures of a report, and each of them as an <svg> element of the page."""

from __future__ import annotations

import io
import math
import re
from collections.abc import Sequence
from typing import Any

import matplotlib as mpl
import numpy as np
from markupsafe import Markup
from matplotlib import colors, patches, ticker
from matplotlib.axes import Axes

from softstart.optimal.problem import best_start
from softstart.quantities import Units
from softstart.reporting.choice import Choice
from softstart.reporting.limit import OptimumCurve
from softstart.start.recommendation import Row
from softstart.start.run import Run
from softstart.views.drawing import (
    COLOURS,
    DASHES,
    GREY,
    SHAFTS,
    drawing,
    mark_points,
    new_figure,
    plain_ticks,
    shade_open_gap,
)
from softstart.views.numbers import units_of
from softstart.views.starts import run_figure

ACROSS = 4  # panels side by side
LATE = 1.6  # times the median start time, up to which traces are shown
SMALL, WIDE = 8.5, 7.1  # points; inches: what an A4 page holds
RED = "#B00020"
K_DYN = r"$\mathregular{K_{dyn}}$"  # on an axis
LONGEST = 32  # characters of a name in a figure
STYLE: Any = {
    **dict.fromkeys(("font.size", "axes.titlesize", "axes.labelsize", "legend.fontsize"), SMALL),
    **dict.fromkeys(("xtick.labelsize", "ytick.labelsize"), SMALL - 0.5),
    "axes.titlelocation": "left",
}
# what a page does not need: ids that nothing refers to would be in it twice, a <style> would hold for all
UNUSED = (
    r"<\?xml.*?\?>|<!DOCTYPE.*?>|<metadata>.*?</metadata>|<style.*?</style>|<!--.*?-->"
    r'| id="[A-Za-z0-9.]+_\d+"'
)


def svg(figure: Any, key: str, title: str) -> Markup:
    """The figure as an <svg> element; the same one gives the same text. Screen readers read `title`."""
    stream = io.StringIO()
    with drawing(), mpl.rc_context({"svg.hashsalt": key}):
        figure.savefig(stream, format="svg", metadata=dict.fromkeys(("Date", "Creator", "Format", "Type")))
    text = Markup(re.sub(UNUSED, "", stream.getvalue(), flags=re.DOTALL).strip())
    return text.replace("<svg ", Markup('<svg class="plot" role="img" aria-label="{}" ').format(title), 1)


def name_in_figure(name: str) -> str:
    """A name as it is, not set as a formula, and cut where it is too long for a figure."""
    text = name if len(name) <= LONGEST else name[: LONGEST - 1] + "\N{HORIZONTAL ELLIPSIS}"
    return text.replace("$", r"\$")


def shown_until(rows: Sequence[Row]) -> float:
    """Until when traces are shown, s."""
    reached = [row.run for row in rows if not math.isnan(row.run.start_time)]
    if not reached:
        return max(float(row.run.end_time) for row in rows)
    most = LATE * float(np.median([run.start_time for run in reached]))
    return min(max(float(run.end_time) for run in reached), most)


def traces_figure(rows: Sequence[Row]) -> Any:
    """Torques of all starts in small panels of one scale; grey where the gap is open."""
    runs, down, longest = [row.run for row in rows], -(-len(rows) // ACROSS), shown_until(rows)
    lowest = min(float(min(run.T.min(), run.u.min())) for run in runs)
    highest = max(float(max(run.peak_torque, run.u.max())) for run in runs)
    with drawing(), mpl.rc_context(STYLE):
        size = (WIDE, 0.75 + 1.0 * down)  # four rows stand below the table of strategies on a page
        figure, axes = new_figure(down, ACROSS, size, sharex=True, sharey=True, squeeze=False)
        for row, panel in zip(rows, axes.flat, strict=False):
            run = row.run
            if len(run.drive.shaft_names) == 1:
                shade_open_gap(panel, run, longest)
            _torques(panel, run)
            panel.set_title(f"{name_in_figure(row.name)}: {run.k_dyn:.3f}", pad=3)
            if not math.isnan(run.shown.start_time):
                panel.axvline(run.shown.start_time, color=GREY, lw=0.8, ls=":")
        axes[0, 0].set_xlim(0.0, longest)
        axes[0, 0].set_ylim(min(-0.06 * highest, 1.06 * lowest), 1.12 * highest)
        for panel in axes.flat[len(rows) :]:
            panel.set_axis_off()
        for column in range(ACROSS):
            last = axes[down - 1 - (len(rows) <= (down - 1) * ACROSS + column), column]
            last.tick_params(labelbottom=True)
            last.set_xlabel("time, s")
        for panel in axes[:, 0]:
            panel.set_ylabel("N m")
        handles = axes[0, 0].get_legend_handles_labels()[0]
        figure.legend(handles=handles, loc="outside upper center", ncols=3)
    return figure


def _torques(panel: Axes, run: Run) -> None:
    """Motor and shaft torque of a start with its peak, and the permissible torque."""
    panel.plot(run.t, run.u, color=COLOURS[1], ls=DASHES[1], lw=0.9, label="motor torque u")
    names = run.drive.shaft_names if len(run.drive.shaft_names) > 1 else ("shaft torque T",)
    for k, (name, torque) in enumerate(zip(names, run.T.reshape(run.t.size, -1).T, strict=True)):
        panel.plot(run.t, torque, color=SHAFTS[k % len(SHAFTS)], lw=1.1, label=name)
    panel.plot([run.peak_time], [_peak(run)], "o", ms=3.0, color=SHAFTS[run.worst_shaft % len(SHAFTS)])
    if not math.isnan(permissible := run.permissible_torque):
        panel.axhline(permissible, color=RED, lw=0.9, ls=":", label="permissible torque")


def start_figure(run: Run) -> Any:
    """Torques, speeds and twists of a chain's start, of which two stand on a page."""
    figure = run_figure(run)
    figure.set_size_inches(8.0, 5.2)
    return figure


def _peak(run: Run) -> float:
    return float(run.trajectory.shafts["peak"][run.worst_shaft])


def before_after_figure(rows: Sequence[Row]) -> Any:
    """Shaft torque and load speed of `direct` and of another start, with the permissible torque as a line.

    Of several shafts the torque of the one that is loaded most.
    """
    drive, runs = rows[0].run.drive, [row.run for row in rows]
    units, longest = units_of(drive), max(r.start_time if r.start_time > 0.0 else r.end_time for r in runs)
    with drawing(), mpl.rc_context(STYLE):
        figure, (torque, speed) = new_figure(1, 2, (WIDE, 2.9), width_ratios=(1.7, 1.0))
        for row, (colour, width) in zip(
            rows, ((COLOURS[1], 1.1), (COLOURS[0], 2.0))[-len(rows) :], strict=True
        ):
            run, name = row.run, name_in_figure(row.name)
            worst = run.T.reshape(run.t.size, -1)[:, run.worst_shaft]
            torque.plot(run.t, worst, color=colour, lw=width, label=name)
            torque.plot([run.peak_time], [_peak(run)], "o", ms=4, color=colour)
            speed.plot(run.t, units.shown(run.w2, "rad/s"), color=colour, lw=width)
        if not math.isnan(permissible := runs[0].permissible_torque):
            torque.axhline(permissible, color=RED, lw=1.4, ls=DASHES[1], label="permissible torque")
        torque.set_ylim(bottom=min(0.0, torque.get_ylim()[0]))  # "15 % less" is seen as that
        for panel, what in ((torque, "shaft torque, N m"), (speed, f"load speed, {units.speed}")):
            panel.set_xlim(0.0, 1.1 * longest)
            panel.set_ylabel(what)
            panel.set_xlabel("time, s")
        speed.axhline(units.shown(float(drive.target_speed), "rad/s"), color=GREY, lw=0.8, ls=":")
        handles = torque.get_legend_handles_labels()[0]
        figure.legend(handles=handles, loc="outside upper left", ncols=3)
    return figure


def limit_figure(rows: Sequence[Row], strong: Sequence[Row], limit: OptimumCurve) -> Any:
    """K_dyn against start time: the bound that nothing goes below, optima, every strategy."""
    placed, optima = [row for row in rows if not math.isnan(row.run.start_time)], limit.found
    own = [row.run.start_time for row in placed] + [p.start_time_bound for p in optima]
    left, right = min(own), max(*own, 1.001 * min(own))
    left, right = left - 0.15 * (right - left), right + 0.04 * (right - left)
    values = [row.run.k_dyn for row in placed] + [p.k_dyn for p in optima if p.k_dyn is not None]
    with drawing(), mpl.rc_context(STYLE):
        figure, axes = new_figure(1, 1, (WIDE, 3.4))
        if limit.times:
            t, k = limit.times, np.minimum(limit.bounds, 2.0 * max(values))
            axes.fill_between(t, 0.0, k, fc="#F1F1F1", ec="#DADADA", hatch="////", lw=0.0, zorder=0)
            axes.plot(t, k, color=COLOURS[4], ls=DASHES[1], lw=1.8, label="lower bound")
            values.append(float(np.interp(right, t, k)))
        if optima:
            axes.plot(
                [p.start_time_bound for p in optima], [p.k_dyn for p in optima], ".-", color=COLOURS[0],
                lw=1.2, ms=7, label=f"{best_start(rows[0].run.drive)} found", zorder=3,
            )  # fmt: skip
        axes.axhline(1.0, color=GREY, lw=0.8, ls=":")
        low, high = min(values), max(values)
        if high > 4.0 * low:
            axes.set_yscale("log")
            plain_ticks(axes.yaxis, ticker.LogLocator(subs=(1.0, 1.5, 2.0, 3.0, 5.0, 7.0)))
            axes.set_ylim(0.8 * low, 1.2 * high)
        else:
            room = max(high - low, 0.1 * high)
            axes.set_ylim(max(0.0, low - 0.35 * room), high + 0.15 * room)
        axes.set_xlim(left, right)
        axes.set_xlabel("start time, s")
        axes.set_ylabel(K_DYN)
        points = [(name_in_figure(row.name), row.run.start_time, row.run.k_dyn) for row in placed]
        mark_points(axes, points, [index for index, row in enumerate(placed) if row in strong])
    return figure


def maps_figure(choice: Choice, drive: Any, units: Units) -> Any:
    """K_dyn over gap and load inertia, one map a strategy, all in one scale of colours."""
    shown = [(row.name, choice.maps[row.name]) for row in choice.mapped]
    first, down, nominal = shown[0][1], math.ceil(len(shown) / 2), (float(drive.gap), float(drive.J2))
    rows, columns = first.k_dyn.shape
    finite = np.concatenate([one.k_dyn[np.isfinite(one.k_dyn)] for _, one in shown])
    low, high = (float(finite.min()), float(finite.max())) if finite.size else (1.0, 2.0)
    high = max(high, low * 1.02)
    scale = colors.LogNorm(low, high) if high > 3.0 * low else colors.Normalize(low, high)
    gaps = [units.shown(one, "rad") for one in first.gaps]
    row, column = (
        min(range(len(values)), key=lambda i: abs(values[i] - own))
        for values, own in zip((first.gaps, first.inertias), nominal, strict=True)
    )
    with drawing(), mpl.rc_context(STYLE):
        size = (WIDE, 0.35 + down * (0.66 + 0.22 * max(rows, 2)))
        figure, axes = new_figure(down, 2, size, squeeze=False)
        drawn: Any = None
        for panel, (name, one) in zip(axes.flat, shown, strict=False):
            panel.grid(visible=False)
            panel.set_facecolor("#D0D0D0")
            edges = np.arange(columns + 1) - 0.5, np.arange(rows + 1) - 0.5
            cells = np.ma.masked_invalid(one.k_dyn)
            drawn = panel.pcolormesh(
                *edges, cells, cmap="cividis", norm=scale, edgecolors="face", linewidth=0.3
            )
            for (i, j), value in np.ndenumerate(one.k_dyn):
                dark = math.isnan(value) or float(scale(value)) > 0.55
                text = f"{value:.2f}" if math.isfinite(value) else "none"
                panel.text(j, i, text, ha="center", va="center", fontsize=SMALL - 1.0,
                           color="black" if dark else "white")  # fmt: skip
            for colour, width in (("white", 3.4), ("#D55E00", 1.8)):  # the drive as it is
                box = patches.Rectangle((column - 0.5, row - 0.5), 1.0, 1.0, fc="none", ec=colour, lw=width)
                panel.add_patch(box).set_zorder(5)
            worst = f"worst {one.worst:.3f}" if math.isfinite(one.worst) else "grey: no start"
            panel.set_title(f"{name_in_figure(name)}: {worst}")
            panel.set_xticks(range(columns), [f"{v:.3g}" for v in first.inertias])
            panel.set_yticks(range(rows), [f"{v:.4g}" for v in gaps])
            panel.tick_params(length=0)
        for panel in axes.flat[len(shown) :]:
            panel.set_axis_off()
        for panel in axes[:, 0]:
            panel.set_ylabel(f"gap, {units.angle}")
        for panel in axes.flat[max(0, len(shown) - 2) : len(shown)]:
            panel.set_xlabel("load inertia J2, kg m²")
        bar = figure.colorbar(drawn, ax=axes, shrink=0.9, aspect=28)
        bar.set_label(K_DYN)
        bar.solids.set_rasterized(False)  # a picture of pixels would have to be loaded
        bar.solids.set_edgecolor("face")
        ticks = [float(f"{v:.2g}") for v in np.geomspace(low, high, 6)]
        plain_ticks(bar.ax.yaxis, ticker.FixedLocator([v for v in ticks if low <= v <= high]))
    return figure
