"""The strategies compared: what each needs, its figures, its traces over time."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from softstart.controller import Controller, Sensor
from softstart.controller.base import Effort, effort_of, label_of
from softstart.drive import Drive
from softstart.errors import listed
from softstart.reporting.markup import Figures, Html, html, joined, table, tag
from softstart.start import metrics
from softstart.start.comparison import LIGHT_INERTIA, WORN_GAP
from softstart.start.metrics import SETTLED_BAND
from softstart.start.recommendation import Row
from softstart.start.run import Run
from softstart.views.drawing import COLOURS, DASHES, drawing, new_figure, shade_open_gap
from softstart.views.printed import digits, fixed, short
from softstart.views.starts import INTERVALS_NOTE, clipped_torque, position_notes

if TYPE_CHECKING:
    from matplotlib.axes import Axes

ORDINARY = ("ramp", "s-curve")  # whose sheets say how an inverter names their settings
_OPEN_LOOP = {
    "direct": "switching on at a torque limit",
    "ramp": "a torque ramp",
    "s-curve": "a torque ramp with an S-curve",
}
_SENSORS = {
    Sensor.STAGE: "sensor in the gap",
    Sensor.SHAFT_TORQUE: "sensor of the shaft torque",
    Sensor.LOAD_SPEED: "encoder at the load",
}
AT_ONCE = 5  # strategies in one figure of traces: what a page holds
LATE = 1.6  # times the median start time, up to which traces are shown
GREY, SMALL = "#666666", 8.5
WIDE = 7.1  # inches: what an A4 page holds
MOST_STAGES = 6  # numbered
LONGEST = 32  # letters of a name in a figure


@dataclass(frozen=True)
class Means:
    """What a strategy needs.

    `realisable`: with what a drive itself measures, motor encoder and motor torque. `ordinary`: on an
    inverter that offers torque ramps and no more.
    """

    measures: str
    inverter: str
    realisable: bool
    ordinary: bool


def kind_of(controller: Controller) -> str:
    """The name of the strategy behind a controller, tuned or not."""
    inner = getattr(controller, "controller", controller)
    return str(type(inner).name or type(inner).__name__)


def means_of(controller: Controller) -> Means:
    """What a controller needs.

    >>> from softstart.controller import make_controller
    >>> [means_of(make_controller(name)).realisable for name in ("ramp", "reduced-first-stage")]
    [True, False]
    """
    kind = kind_of(controller)
    effort = effort_of(controller)
    extra = [name for sensor, name in _SENSORS.items() if controller.sensors & sensor]
    if extra and effort is Effort.SENSOR:
        return Means(" and ".join(extra), "no: drives have no such sensor", False, False)
    if kind in _OPEN_LOOP:
        return Means("nothing", f"yes: {_OPEN_LOOP[kind]}", True, effort is Effort.RAMPS)
    if effort is Effort.STEPS:
        return Means("motor speed", "yes: torque steps, timed by the speed", True, False)
    return Means(
        "motor encoder, motor torque",
        "no: it takes one that runs control code of its user in each cycle",
        True,
        False,
    )


def ordered(rows: Sequence[Row]) -> list[Row]:
    """The strategies, the gentlest first; those that do not reach the target speed last."""
    return sorted(rows, key=lambda row: (math.isnan(row.run.start_time), float(f"{row.run.k_dyn:.9g}")))


def strategies_section(
    drive: Drive, compared: Sequence[Row], chosen: Sequence[Row], failed: Sequence[tuple[str, str]]
) -> Html:
    """The table of strategies and what its columns mean; the rows in `chosen` stand out."""
    rows = ordered(compared)
    limited = any(row.against_limits for row in rows)
    cells, needs = [], []
    for row in rows:
        run, name, means = row.run, label_of(row.run.controller), means_of(row.run.controller)
        cells.append([
            name, fixed(run.k_dyn, 3) + _interval(row), fixed(row.k_dyn_worn_gap, 3),
            fixed(row.k_dyn_light_load, 3), digits(run.peak_torque), digits(run.start_time),
            digits(run.settled_time), fixed(row.time_lost, _decimals(run.start_time)),
            fixed(row.settled_lost, _decimals(run.start_time)), str(run.contacts),
            *([row.against_limits] if limited else []), ", ".join(flag.word for flag in row.flags),
        ])  # fmt: skip
        needs.append([name, run.controller.summary, means.measures, means.inverter])
    strong = [rows.index(row) for row in chosen]
    base = float(metrics.base_torque(drive))
    notes = [
        f"K_dyn is the largest shaft torque of the whole start, divided by {digits(base)} N m, the mean "
        f"shaft torque "
        "under the full starting torque. It is located in the exact solution, not read off a grid.",
        f"Gap × {short(WORN_GAP)} and J2 × {short(LIGHT_INERTIA)}: the strategy as it was set up for this "
        f"drive, when "
        f"the gap is {short(WORN_GAP)} times as wide or the load inertia {short(LIGHT_INERTIA)} times as "
        f"large.",
        f"Settled: from then on the load speed is never more than {short(100.0 * SETTLED_BAND)} % below the "
        "target. Time lost: start time, and settled time, beyond that of direct start.",
        *([_limits_note(rows[0])] if limited else []),
        *([INTERVALS_NOTE] if rows[0].intervals else []),
        *position_notes([row.run for row in rows]),
        *(
            f"{row.name} is flagged: {'; '.join(flag.text for flag in row.flags)}."
            for row in rows
            if row.flags and not math.isnan(row.run.start_time)
        ),
        *(
            f"{label_of(row.run.controller)}: {row.run.status.value}"
            for row in rows
            if math.isnan(row.run.start_time)
        ),
        *(
            f"{row.run.controller_name}, torque cut off: {clipped}."
            for row in rows
            if (clipped := clipped_torque(row.run))
        ),
        *(f"{name} could not be examined: {reason}" for name, reason in failed),
    ]
    first = table(
        [
            "strategy", "K_dyn", f"K_dyn, gap × {short(WORN_GAP)}", f"K_dyn, J2 × {short(LIGHT_INERTIA)}",
            "peak torque, N m", "start time, s", "settled, s", "time lost, s", "settled, lost, s", "contacts",
            *(["limits, least margin"] if limited else []), "flag",
        ],
        cells, caption="Strategies on this drive, the gentlest first",
        text_columns=(0, 10, 11) if limited else (0, 10),
        strong=strong, class_="names",
    )  # fmt: skip
    second = table(
        ["strategy", "what it does", "what it measures", "can an ordinary inverter do it?"], needs,
        caption="What each strategy needs", text_columns=(0, 1, 2, 3), strong=strong, class_="words",
    )  # fmt: skip
    return html(first, tag("ul", joined(tag("li", one) for one in notes), class_="notes"), second)


def _interval(row: Row) -> str:
    """The interval of K_dyn, where the drive is known within intervals."""
    if not row.intervals:
        return ""
    lower, upper = row.intervals["k_dyn"]
    return f" ({fixed(lower, 3)} to {fixed(upper, 3)})"


def _limits_note(row: Row) -> str:
    worst = ["the drive as it is", *row.worst_case]
    return f"Limits: the least share left of any limit, in the worst of {listed(worst)}."


def _decimals(start_time: float) -> int:
    """Decimals of start times of this size."""
    if not start_time > 0.0:
        return 4
    return min(max(3 - math.floor(math.log10(start_time)), 0), 9)


def traces_section(rows: Sequence[Row], figures: Figures) -> Html:
    """Torques and speeds of all strategies."""
    rows = ordered(rows)
    runs = [row.run for row in rows]
    times = [run.start_time for run in runs if not math.isnan(run.start_time)]
    ends = [run.end_time for run in runs if not math.isnan(run.start_time)]
    shown = min(max(ends), LATE * float(np.median(times))) if times else max(run.end_time for run in runs)
    late = [label_of(run.controller) for run in runs if run.start_time > shown]
    cut = f" The start of {listed(late)} goes on beyond the {digits(shown)} s shown." if late else ""
    highest = max(float(max(run.peak_torque, run.u.max())) for run in runs)
    lowest = min(float(min(run.T.min(), run.u.min())) for run in runs)
    parts = []
    pieces = -(-len(runs) // AT_ONCE)
    size = -(-len(runs) // pieces)
    for first in range(0, len(runs), size):
        some = rows[first : first + size]
        names = ", ".join(row.marked for row in some)
        caption = (
            f"Torques (left) and speeds (right) under {names}. Grey: the gap is open; numbers: stages, odd "
            f"with the "
            "gap open, even with the gap closed. Dot: the peak. Dotted: target speed and start time. All "
            "torques "
            f"have one scale.{cut}"
        )
        title = "; ".join(
            f"{row.marked}: peak shaft torque {digits(row.run.peak_torque)} N m, start time "
            f"{digits(row.run.start_time)} s"
            for row in some
        )
        parts.append(
            figures.drawn(traces_figure(some, shown, lowest, highest), f"Traces over time. {title}.", caption)
        )
    return html(*parts)


def traces_figure(rows: Sequence[Row], longest: float, lowest: float, highest: float) -> Any:
    """Torques (left) and speeds (right) of several starts, with their flags; grey where the gap is open.

    Up to `longest` s; torques from `lowest` to `highest` N m, with some room, in all panels.
    """
    with drawing():
        size = (WIDE, 0.55 + 1.72 * len(rows))
        figure, axes = new_figure(len(rows), 2, size, sharex=True, squeeze=False)
        for index, row in enumerate(rows):
            run = row.run
            torque, speed = axes[index]
            for panel in (torque, speed):
                shade_open_gap(panel, run)
            torque.plot(run.t, run.u, color=COLOURS[1], ls=DASHES[1], lw=1.0, label="motor torque u")
            torque.plot(run.t, run.T, color=COLOURS[0], lw=1.3, label="shaft torque T")
            torque.plot([run.peak_time], [_peak(run)], "o", ms=3.5, color=COLOURS[0])
            torque.set_ylim(min(-0.06 * highest, 1.06 * lowest), 1.12 * highest)
            torque.set_ylabel("N m", fontsize=SMALL)
            torque.set_title(
                f"{name_in_figure(row.marked)}: K_dyn {run.k_dyn:.3f}",
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
            title = f"start time {run.start_time:.4g} s" if reached else "target speed not reached"
            speed.set_title(title, loc="left", fontsize=SMALL + 0.5, pad=3)
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


def name_in_figure(name: str) -> str:
    """A name as it is, not set as a formula, and cut where it is too long for a figure."""
    text = name if len(name) <= LONGEST else name[: LONGEST - 1] + "\N{HORIZONTAL ELLIPSIS}"
    return text.replace("$", r"\$")


def _peak(run: Run) -> float:
    return max(run.stages, key=lambda one: abs(one.peak_torque)).peak_torque


def _number_stages(axes: Axes, run: Run, longest: float) -> None:
    """The number of each stage at the top, as far as there is room."""
    for stage in run.stages[:MOST_STAGES]:
        if min(stage.end, longest) - stage.start > 0.025 * longest:
            middle = 0.5 * (stage.start + min(stage.end, longest))
            axes.text(middle, 0.985, str(stage.number), transform=axes.get_xaxis_transform(),
                      fontsize=SMALL - 1.5, ha="center", va="top", color=GREY)  # fmt: skip
