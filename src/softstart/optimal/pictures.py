"""Figures of optima: one optimal start, the curve over start times, what a contact sensor is worth."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from softstart.optimal.labels import name_points
from softstart.views.drawing import COLOURS, DASHES, drawing, new_figure, shade_open_gap

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from softstart.drive import Drive
    from softstart.optimal.front import ControllerPoint, Front
    from softstart.optimal.result import Optimum
    from softstart.optimal.robust import SensorWorth

GREY = "#666666"
MARKERS = "osD^vPX*"
SMALL = 9.5
TALL = 4.0  # largest over smallest K_dyn from which on the axis is logarithmic
TICKS = (0.1, 0.15, 0.2, 0.3, 0.5, 0.7, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 7.0, 10.0, 15.0, 20.0, 30.0, 50.0)


def optimum_figure(best: Optimum) -> Any:
    """Motor torque, shaft torque with its bound, speeds and twist of an optimal start, with all limits."""
    run = best.run
    with drawing():
        figure, panels = new_figure(4, 1, (8.0, 9.0), sharex=True)
        for axes in panels:
            shade_open_gap(axes, run)
            axes.axvline(best.end_time, color=GREY, lw=0.8, ls=":")
        motor, shaft, speed, twist = panels
        _motor_torque(motor, best)
        _shaft_torque(shaft, best)
        _speeds(speed, best)
        _twist(twist, best)
        twist.set_xlabel("time, s     (grey: gap open; dotted: end of the start)")
        twist.set_xlim(0.0, run.end_time)
        aim = {"k_dyn": "K_dyn", "start_time": "start time"}.get(best.problem.minimise, best.problem.minimise)
        asked = f"least {aim}, terminal {best.problem.terminal}, {best.method}"
        figure.suptitle(f"{run.drive.name}: {asked}", x=0.01, ha="left", fontsize=11)
    return figure


def _legend(axes: Axes, columns: int) -> None:
    axes.legend(
        loc="lower right",
        bbox_to_anchor=(1.0, 1.0),
        ncols=columns,
        borderaxespad=0.1,
        columnspacing=1.2,
        handlelength=1.8,
    )


def _headed(axes: Axes, title: str, unit: str) -> None:
    axes.set_title(title, loc="left", fontsize=SMALL)
    axes.set_ylabel(unit)


def _motor_torque(axes: Axes, best: Optimum) -> None:
    run, problem = best.run, best.problem
    t = run.t
    for limit in (problem.lowest_torque, problem.highest_torque):
        axes.axhline(limit, color=COLOURS[3], lw=1.0, ls=DASHES[1], label="limits" if limit else None)
    if problem.torque_speed:
        speeds, torques = np.array(problem.torque_speed).T
        axes.plot(
            t, np.interp(run.w1, speeds, torques), color=COLOURS[3], lw=1.0, ls=":", label="limit at w1"
        )
    axes.plot(t, run.u, color=COLOURS[1], label="realised u")
    knots_t, knots_u = _steps_until(best, run.end_time)
    axes.plot(knots_t, knots_u, color=COLOURS[6], lw=0.9, ls=DASHES[3], label="demand")
    low, high = float(np.min(run.u)), float(np.max(run.u))
    least, most = problem.lowest_torque, problem.highest_torque
    _headed(axes, f"motor torque {low:.4g} to {high:.4g} of {least:.4g} to {most:.4g} N m", "N m")
    axes.margins(y=0.08)
    _legend(axes, 4)


def _steps_until(best: Optimum, end: float) -> tuple[Any, Any]:
    """The knots of the demand up to the end of the run, where its last torque is held."""
    profile = best.profile
    inside = profile.time <= end
    return (
        np.append(profile.time[inside], end),
        np.append(profile.torque[inside], profile.at(end)),
    )


def _shaft_torque(axes: Axes, best: Optimum) -> None:
    run, base = best.run, best.problem.base_torque
    axes.plot(run.t, run.T, color=COLOURS[0], label="shaft torque")
    peak = run.peak_torque
    axes.axhline(peak, color=COLOURS[0], lw=0.9, ls=DASHES[1], label="peak")
    if best.bound.kind != "none":
        least = best.bound.k_dyn * base
        axes.axhline(least, color=COLOURS[4], lw=1.6, ls=DASHES[3], label="bound")
    axes.axhline(base, color=GREY, lw=0.8, ls=":", label="K_dyn = 1")
    axes.plot([run.peak_time], [peak], "o", ms=4, color=COLOURS[0])
    if not math.isnan(run.first_contact):
        axes.plot([run.first_contact], [0.0], "^", ms=6, color=COLOURS[1], clip_on=False, label="contact")
    title = f"K_dyn {best.k_dyn:.4f}"
    if best.bound.kind != "none":
        title += f", at least {best.bound.k_dyn:.4f}"
    _headed(axes, title, "N m")
    _legend(axes, 5)


def _speeds(axes: Axes, best: Optimum) -> None:
    run, problem = best.run, best.problem
    axes.plot(run.t, run.w1, color=COLOURS[1], ls=DASHES[1], label="motor w1")
    axes.plot(run.t, run.w2, color=COLOURS[0], label="load w2")
    axes.axhline(problem.target, color=GREY, lw=0.8, ls=":", label="target")
    title = f"start time {best.end_time:.4f} s"
    if problem.start_time is not None:
        title += f", {problem.start_time:.4f} s allowed"
        axes.axvline(problem.start_time, color=COLOURS[3], lw=1.0, ls=DASHES[1], label="allowed")
    _headed(axes, title, "rad/s")
    _legend(axes, 4)


def _twist(axes: Axes, best: Optimum) -> None:
    run = best.run
    half = 0.5 * float(run.drive.gap)
    axes.plot(run.t, run.theta, color=COLOURS[2], label="twist phi1 - phi2")
    for flank in (half, -half):
        axes.axhline(flank, color="#444444", lw=0.8, ls=DASHES[1], label="flanks" if flank == half else None)
    contacts = "1 contact" if run.contacts == 1 else f"{run.contacts} contacts"
    at = "" if math.isnan(run.first_contact) else f", first at {run.first_contact:.4f} s"
    _headed(axes, contacts + at, "rad")
    _legend(axes, 2)


# the front --------------------------------------------------------------------------------------------------


def front_figure(front: Front) -> Any:
    """Least K_dyn over start time with its lower bound, and the controllers as labelled points."""
    found = [(p.start_time_bound, p.k_dyn, p.k_dyn_lower_bound) for p in front.points if p.k_dyn is not None]
    placed = [one for one in front.controllers if not math.isnan(one.start_time)]
    with drawing():
        figure, axes = new_figure(1, 1, (8.0, 5.4))
        _curve(axes, found)
        for index, one in enumerate(placed):
            axes.plot([one.start_time], [one.k_dyn], MARKERS[index % 8], ms=7, mfc="none", mew=1.8,
                      color=COLOURS[(index + 1) % 8], clip_on=False, zorder=4)  # fmt: skip
        _scale(axes, [k for _, k, _ in found] + [one.k_dyn for one in placed])
        _where_nothing_starts(axes, front)
        axes.set_xlabel("start time, s     (x: K_dyn over the least K_dyn at the same start time)")
        axes.set_ylabel("K_dyn")
        axes.set_title(f"{front.drive.name}: least K_dyn, terminal {front.terminal}", loc="left")
        if axes.get_legend_handles_labels()[0]:
            axes.legend(loc="upper right")
        name_points(figure, axes, [(_said(one), one.start_time, one.k_dyn) for one in placed])
    return figure


def _said(one: ControllerPoint) -> str:
    """Its name, and how many times the least K_dyn at its start time it has."""
    return one.name if one.ratio is None else f"{one.name}, x{one.ratio:.2f}"


def _curve(axes: Axes, found: Sequence[tuple[float, float, float | None]]) -> None:
    if not found:
        return
    times, k = [one[0] for one in found], [one[1] for one in found]
    bounded = [(t, k, low) for t, k, low in found if low is not None]
    axes.plot(times, k, "o-", ms=3.5, color=COLOURS[0], label="optimum", zorder=3)
    if bounded:
        t, above, below = (list(column) for column in zip(*bounded, strict=True))
        axes.fill_between(t, below, above, color=COLOURS[5], alpha=0.45, lw=0)
        axes.plot(t, below, ls=DASHES[1], lw=1.2, color=COLOURS[4], label="lower bound", zorder=3)


def _where_nothing_starts(axes: Axes, front: Front) -> None:
    """Hatched, where a start with one contact is impossible; crosses at the start times that were refused."""
    refused = [p.start_time_bound for p in front.points if not p.found]
    if refused:
        axes.plot(refused, [0.03] * len(refused), "x", ms=6, mew=1.5, color=GREY, clip_on=False,
                  transform=axes.get_xaxis_transform(), label="no optimum")  # fmt: skip
    shortest = front.shortest_start_time
    if not math.isnan(shortest):
        left, right = axes.get_xlim()
        if left < shortest:
            axes.axvspan(left, shortest, fc="#F6F6F6", ec="#DDDDDD", hatch="///", lw=0, zorder=0)
            axes.set_xlim(left, right)
        label = f"shortest with one contact, {shortest:.4f} s"
        axes.axvline(shortest, color=GREY, lw=1.0, ls=DASHES[1], label=label)


def _scale(axes: Axes, values: Sequence[float]) -> None:
    """From 0 on, or logarithmic where the largest would press the smallest flat."""
    shown = [k for k in values if k > 0.0]
    if not shown:
        return
    low, high = min(shown), max(shown)
    if high < TALL * low:
        axes.set_ylim(0.0, 1.08 * high)
    else:
        from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

        axes.set_yscale("log")
        axes.yaxis.set_major_locator(FixedLocator(list(TICKS)))
        axes.yaxis.set_major_formatter(FuncFormatter(lambda k, _: f"{k:g}"))
        axes.yaxis.set_minor_locator(NullLocator())
        axes.set_ylim(0.85 * low, 1.15 * high)
    axes.axhline(1.0, color=GREY, lw=0.8, ls=":")
    axes.margins(x=0.04)


# one profile for several drives -----------------------------------------------------------------------------


def worth_figure(worth: SensorWorth) -> Any:
    """Demand and shaft torques of all drives under one profile: without a contact sensor, and with one."""
    sides = (("without a contact sensor", worth.blind), ("with a contact sensor", worth.reacting))
    with drawing():
        figure, axes = new_figure(2, 2, (9.5, 6.0), sharex=True, sharey="row")
        for column, (title, best) in enumerate(sides):
            motor, shaft = axes[:, column]
            base = best.runs[0].peak_torque / best.k_dyn_each[0]
            for index, (drive, run) in enumerate(zip(best.scenarios, best.runs, strict=True)):
                look = {"color": COLOURS[index % 8], "ls": DASHES[index % 8], "lw": 1.2}
                motor.plot(run.t, run.u, **look)
                shaft.plot(run.t, run.T, **look, label=_differing(drive, best.scenarios))
            shaft.axhline(best.k_dyn * base, color=GREY, lw=1.0, ls=DASHES[1], label="largest peak")
            if best.lower_bound.kind != "none":
                least = best.lower_bound.k_dyn * base
                shaft.axhline(least, color=COLOURS[4], lw=1.6, ls=DASHES[3], label="bound")
            for panel in (motor, shaft):
                panel.axvline(best.start_time, color=COLOURS[3], lw=1.0, ls=DASHES[1])
            motor.set_title(title, loc="left", fontsize=SMALL)
            shaft.set_title(f"largest K_dyn {best.k_dyn:.4f}", loc="left", fontsize=SMALL)
            shaft.set_xlabel("time, s     (dashed: start time allowed)")
        axes[0, 0].set_ylabel("motor torque u, N m")
        axes[1, 0].set_ylabel("shaft torque T, N m")
        handles, labels = axes[1, 0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=min(6, len(labels)))
        figure.suptitle(f"{worth.blind.base.name}: one profile for all", x=0.01, ha="left", fontsize=11)
    return figure


def _differing(drive: Drive, drives: Sequence[Drive]) -> str:
    """What sets a drive apart from the others."""
    figures = {
        "gap": (one.gap for one in drives),
        "J2": (one.J2 for one in drives),
        "Mc": (one.Mc for one in drives),
    }
    varied = [name for name, values in figures.items() if len(set(values)) > 1]
    return ", ".join(f"{name} {getattr(drive, name):.4g}" for name in varied) or "the drive"
