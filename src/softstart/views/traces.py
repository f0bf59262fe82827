"""Figures of starts: torques, speeds and twists over time, several starts side by side, K_dyn over time."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from softstart.start.duty import DutyRun
from softstart.start.recommendation import Row
from softstart.start.run import Run
from softstart.views.drawing import (
    COLOURS,
    DASHES,
    GREY,
    LIMIT,
    MOTOR,
    SHAFTS,
    drawing,
    entitle,
    head,
    legend_above,
    legend_beside,
    line_of,
    mark_points,
    new_figure,
    panels,
    plain_ticks,
    shade_open_gap,
    strategy_colours,
    verbatim,
)
from softstart.views.numbers import units_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FEW = 8  # masses or shafts with a name each in a figure
ACROSS = 4  # starts side by side
LATE = 1.6  # times the median start time, up to which several starts are shown
TALL = 4.0  # largest over smallest K_dyn from which on the axis is logarithmic
TICKS = (0.1, 0.15, 0.2, 0.3, 0.5, 0.7, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 7.0, 10.0, 15.0, 20.0, 30.0, 50.0)
BELOW_BOUND: Any = {"fc": "#F1F1F1", "ec": "#DADADA", "hatch": "////", "lw": 0.0, "zorder": 0}


def over_time(run: Run, panels: Sequence[Callable[[Axes, Run], None]], title: str, note: str = "") -> Figure:
    """Panels over the time of a start; of a single shaft grey where its gap is open."""
    single = len(run.drive.shaft_names) == 1
    with drawing():
        figure, axes = new_figure(len(panels), 1, (8.0, 0.6 + 2.25 * len(panels)), sharex=True)
        for panel, draw in zip(axes, panels, strict=True):
            if single:
                shade_open_gap(panel, run)
            draw(panel, run)
            if not panel.get_legend_handles_labels()[0]:
                continue
            if single:
                legend_above(panel, 5, columnspacing=1.2, handlelength=1.8)
            else:
                legend_beside(panel, 1 + len(run.drive.mass_names) // FEW, fontsize=6.5)
        notes = "; ".join(filter(None, ["grey: gap open" if single else "", note]))
        axes[-1].set_xlabel(f"time, s     ({notes})" if notes else "time, s")
        axes[-1].set_xlim(0.0, run.end_time)
        entitle(figure, f"{title}{units_of(run.drive).at}")
    return figure


def run_figure(run: Run) -> Figure:
    """Torques, speeds and twists over time."""
    return over_time(run, (torques, speeds, twists), f"{run.drive.name}: {run.controller_name}")


def torques(axes: Axes, run: Run) -> None:
    """Motor and shaft torques, and the permissible one."""
    units = units_of(run.drive)
    axes.plot(run.t, units.shown(run.u, "N*m"), lw=1.0, label="motor torque u", **MOTOR)
    shaft_torques(axes, run)
    head(axes, f"K_dyn = {run.k_dyn:.3f}", f"torque, {units.label('N*m')}")


def shafts_of(run: Run | DutyRun) -> list[tuple[str, dict[str, Any]]]:
    """Name and line of each shaft, a single one in the colour of the strategy."""
    names = run.drive.shaft_names
    if len(names) == 1:
        return [("shaft torque T", {"color": colour_of(run)})]
    return [(name, line_of(k) | {"color": SHAFTS[k % len(SHAFTS)]}) for k, name in enumerate(names)]


def masses_of(run: Run | DutyRun) -> list[tuple[str, dict[str, Any]]]:
    """Name and line of each mass, the load of a motor in the colour of the strategy."""
    names = run.drive.mass_names
    if len(names) == 2:
        return [("motor w1", MOTOR | {"lw": 1.0}), ("load w2", {"color": colour_of(run)})]
    return [(name, line_of(i)) for i, name in enumerate(names)]


def colour_of(run: Run | DutyRun) -> str:
    """The colour of the strategy of a run."""
    return strategy_colours([run.controller_name])[run.controller_name][0]


def shaft_torques(axes: Axes, run: Run) -> None:
    """The torque of each shaft with its peak, the permissible one, and where K_dyn is 1."""
    units, shafts = units_of(run.drive), run.trajectory.shafts
    for (name, line), torque, time, peak in zip(
        shafts_of(run), units.shown(run.T.reshape(run.t.size, -1).T, "N*m"), shafts["peak_time"],
        units.shown(shafts["peak"], "N*m"), strict=True,
    ):  # fmt: skip
        axes.plot(run.t, torque, label=name, **line)
        axes.plot([time], [peak], "o", ms=4, color=line["color"])
    if run.k_dyn > 0.0:
        mean = units.shown(run.peak_torque / run.k_dyn, "N*m")
        axes.axhline(mean, color=GREY, lw=0.8, ls=":", label="K_dyn = 1")
    permissible_line(axes, run)


def permissible_line(axes: Axes, run: Run) -> None:
    """The permissible shaft torque, if there is one."""
    if not math.isnan(run.permissible_torque):
        most = units_of(run.drive).shown(run.permissible_torque, "N*m")
        axes.axhline(most, color=LIMIT, lw=1.0, ls=DASHES[1], label="permissible")


def speeds(axes: Axes, run: Run) -> None:
    """The speeds of all masses, the target speed, and the end of the start."""
    machine, units = run.drive, units_of(run.drive)
    for (name, line), speed in zip(masses_of(run), run.w.T, strict=True):
        axes.plot(run.t, units.shown(speed, "rad/s"), label=name, **line)
    if machine.target_speed is not None:
        target = float(units.shown(machine.target_speed, "rad/s"))
        axes.axhline(target, color=GREY, lw=0.8, ls=":", label="target")
    reached = not math.isnan(run.limited_time)
    if reached:
        axes.axvline(run.shown.limited_time, color=GREY, lw=0.8, ls=":")
    title = f"{run.limited_name} {run.limited_time:.4f} s" if reached else run.status.value
    head(axes, title, f"speed, {units.of('rad/s')}")


def twists(axes: Axes, run: Run) -> None:
    """The twist of a single shaft as an angle, of several each in its gap."""
    gaps, units = run.drive.gaps, units_of(run.drive)
    if len(gaps) == 1:
        axes.plot(run.t, units.shown(run.twist[:, 0], "rad"), color=colour_of(run))
        flanks, title, unit = float(units.shown(0.5 * gaps[0], "rad")), "phi1 - phi2", units.of("rad")
    else:
        for (name, line), gap, twist in zip(shafts_of(run), gaps, run.twist.T, strict=True):
            if gap > 0.0:
                axes.plot(run.t, 2.0 * twist / gap, label=name, **line)
        flanks, title, unit = 1.0, "over half the gap", "half gaps"
    for flank in (flanks, -flanks):
        axes.axhline(flank, color="#444444", lw=0.8, ls="--")
    contacts = f"{run.contacts} contact{'' if run.contacts == 1 else 's'}"
    head(axes, f"twist {title}, flanks dashed; {contacts}", f"twist, {unit}")


def shown_until(rows: Sequence[Row]) -> float:
    """Until when several starts are shown, s."""
    reached = [row.run for row in rows if not math.isnan(row.run.limited_time)]
    if not reached:
        return max(float(row.run.end_time) for row in rows)
    most = LATE * float(np.median([run.limited_time for run in reached]))
    return min(max(float(run.end_time) for run in reached), most)


def comparison_figure(rows: Sequence[Row], title: str = "") -> Figure:
    """Torques of several starts in small panels of one scale; grey where the gap is open."""
    from matplotlib.lines import Line2D

    runs, latest = [row.run for row in rows], shown_until(rows)
    units = units_of(runs[0].drive)
    lowest = min(float(min(run.T.min(), run.u.min())) for run in runs)
    highest = max(float(max(run.peak_torque, run.u.max())) for run in runs)
    with drawing():
        figure, axes = panels(len(rows), (2.0, 1.2), ACROSS, "time, s", f"{units.label('N*m')}{units.at}")
        for row, run, panel in zip(rows, runs, axes, strict=True):
            if len(run.drive.shaft_names) == 1:
                shade_open_gap(panel, run, latest)
            torque = units.shown(run.u, "N*m")
            panel.plot(run.t, torque, lw=0.7, label="motor torque u", **MOTOR)
            shaft_torques(panel, run)
            panel.set_title(f"{verbatim(row.name)}: {run.k_dyn:.3f}", loc="left", pad=3, fontsize=8.0)
            if not math.isnan(run.shown.limited_time):
                panel.axvline(run.shown.limited_time, color=GREY, lw=0.8, ls=":")
        axes[0].set_xlim(0.0, latest)
        ends = np.array([min(-0.06 * highest, 1.06 * lowest), 1.12 * highest])
        axes[0].set_ylim(units.shown(ends, "N*m"))
        lines = axes[0].get_legend_handles_labels()[0][:FEW]
        if len(runs[0].drive.shaft_names) == 1:  # each panel has a colour of its own
            lines[1] = Line2D([], [], color=GREY, label="shaft torque T")
        figure.legend(handles=lines, loc="outside lower center", ncols=4)
        if title:
            entitle(figure, title)
    return figure


def _shown_end(run: Run) -> float:
    return run.limited_time if run.limited_time > 0.0 else float(run.end_time)


def before_after_figure(rows: Sequence[Row]) -> Figure:
    """Shaft torque and load speed of `direct` and of another start, with the permissible torque as a line.

    Of several shafts the torque of the one that is loaded most.
    """
    machine, runs = rows[0].run.drive, [row.run for row in rows]
    units, latest = units_of(machine), max(map(_shown_end, runs))
    with drawing():
        figure, (torque, speed) = new_figure(1, 2, (8.0, 3.2), width_ratios=(1.7, 1.0))
        colours, widths = strategy_colours([row.name for row in rows]), (1.1, 2.0)[-len(rows) :]
        for row, run, width in zip(rows, runs, widths, strict=True):
            colour = colours[row.name][0]
            worst = run.T.reshape(run.t.size, -1)[:, run.worst_shaft]
            torque.plot(run.t, units.shown(worst, "N*m"), color=colour, lw=width, label=verbatim(row.name))
            peak = units.shown(float(run.trajectory.shafts["peak"][run.worst_shaft]), "N*m")
            torque.plot([run.peak_time], [peak], "o", ms=4, color=colour)
            speed.plot(run.t, units.shown(run.w2, "rad/s"), color=colour, lw=width)
        permissible_line(torque, runs[0])
        torque.set_ylim(bottom=min(0.0, torque.get_ylim()[0]))  # so that "15 % less" looks like 15 %
        head(torque, "", f"shaft torque{units.at}, {units.label('N*m')}", "time, s")
        head(speed, "", f"load speed{units.at}, {units.speed}", "time, s")
        for panel in (torque, speed):
            panel.set_xlim(0.0, 1.1 * latest)
        speed.axhline(units.shown(float(machine.target_speed), "rad/s"), color=GREY, lw=0.8, ls=":")
        figure.legend(handles=torque.get_legend_handles_labels()[0], loc="outside upper left", ncols=3)
    return figure


Points = Sequence[tuple[float, float]]  # start time in s, K_dyn


def trade_off_figure(points: Sequence[tuple[str, float, float]], **options: Any) -> Figure:
    """K_dyn against start time, one point a strategy: (name, time in s, K_dyn)."""
    with drawing():
        figure, axes = new_figure(1, 1, (8.0, 4.6))
        draw_trade_off(axes, points, **options)
    return figure


def draw_trade_off(
    axes: Axes,
    points: Sequence[tuple[str, float, float]],
    *,
    title: str = "",
    filled: Sequence[int] = (),
    optima: Points = (),
    best: str = "optimum",
    bound: Points = (),
    note: str = "",
    notes: Mapping[str, str] | None = None,
    time: str = "start time",
) -> None:
    """The same on given axes, with optima and with the lower bound, below which no start is possible."""
    from matplotlib import ticker

    times = [t for _, t, _ in points] + [t for t, _ in optima]
    values = [k for *_, k in points] + [k for _, k in optima]
    if bound:
        t, k = zip(*bound, strict=True)
        axes.fill_between(t, 0.0, k, **BELOW_BOUND)
        axes.plot(t, k, ls=DASHES[1], lw=1.4, color=COLOURS[4], label="lower bound", zorder=3)
        values.append(min(k))
    if optima:
        axes.plot(*zip(*optima, strict=True), "o-", ms=3.5, color=COLOURS[0], label=best, zorder=3)
    mark_points(axes, points, filled, notes)
    axes.axhline(1.0, color=GREY, lw=0.8, ls=":")
    if times:
        room = max(max(times) - min(times), 1e-3 * max(times))
        axes.set_xlim(min(times) - 0.1 * room, max(times) + 0.06 * room)
    positive = [k for k in values if k > 0.0]
    if positive and max(positive) > TALL * min(positive):
        axes.set_yscale("log")
        plain_ticks(axes.yaxis, ticker.FixedLocator(list(TICKS)))
        axes.set_ylim(0.85 * min(positive), 1.15 * max(positive))
    elif positive:
        axes.set_ylim(0.0, 1.08 * max(positive))
    head(axes, title, "K_dyn", f"{time}, s{note}")
