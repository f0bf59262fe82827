"""The strategies compared: what each needs, its figures, its traces over time."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from softstart.controller import Controller
from softstart.controller.base import Effort, effort_of, label_of
from softstart.drive import Drive
from softstart.errors import listed
from softstart.reporting.markup import Figures, Html, html, inlined, joined, table, tag
from softstart.start.comparison import LIGHT_INERTIA, WORN_GAP
from softstart.start.metrics import SETTLED_BAND
from softstart.start.recommendation import Row
from softstart.start.run import Run
from softstart.views.drawing import COLOURS, DASHES, drawing, new_figure, shade_open_gap
from softstart.views.printed import at_output, digits, fixed, short, units_of
from softstart.views.starts import INTERVALS_NOTE, row_remarks

if TYPE_CHECKING:
    from matplotlib.axes import Axes

ORDINARY = ("ramp", "s-curve")  # whose sheets say how an inverter names their settings
ACROSS, AT_ONCE = 4, 20  # panels side by side, and in one figure: what a page holds
LATE = 1.6  # times the median start time, up to which traces are shown
GREY, SMALL = "#666666", 8.5
WIDE = 7.1  # inches: what an A4 page holds
K_DYN = r"$\mathregular{K_{dyn}}$"  # on an axis
LONGEST = 32  # letters of a name in a figure


def kind_of(controller: Controller) -> str:
    """The name of the strategy behind a controller, tuned or not."""
    inner = getattr(controller, "controller", controller)
    return str(type(inner).name or type(inner).__name__)


def realisable(controller: Controller) -> bool:
    """Whether a drive measures what the controller needs: motor encoder and motor torque.

    >>> from softstart.controller import make_controller
    >>> [realisable(make_controller(name)) for name in ("ramp", "reduced-first-stage")]
    [True, False]
    """
    return effort_of(controller) is not Effort.SENSOR


def ordered(rows: Sequence[Row]) -> list[Row]:
    """The strategies, the gentlest first; those that do not reach the target speed last."""
    return sorted(rows, key=lambda row: (math.isnan(row.run.start_time), float(f"{row.run.k_dyn:.9g}")))


OUTPUT = ("at the output, N m",)  # heading of the peak torque there
LIMITS, FLAG = "limits, least margin", "flag"


def outputs(row: Row) -> list[str]:
    """The peak torque at the output shaft, N m; nothing where no gear ratio is known."""
    return [one for one in [at_output(row.run.drive, row.run.peak_torque)] if one]


def strategies_section(
    drive: Drive, compared: Sequence[Row], chosen: Sequence[Row], failed: Sequence[tuple[str, str]]
) -> Html:
    """The table of strategies and what its columns mean; the rows in `chosen` stand out."""
    rows = ordered(compared)
    columns = {
        "strategy": [label_of(row.run.controller) for row in rows],
        "K_dyn": [fixed(row.run.k_dyn, 3) + _interval(row) for row in rows],
        f"K_dyn, gap × {short(WORN_GAP)}": [fixed(row.k_dyn_worn_gap, 3) for row in rows],
        f"K_dyn, J2 × {short(LIGHT_INERTIA)}": [fixed(row.k_dyn_light_load, 3) for row in rows],
        "peak torque, N m": [digits(row.run.peak_torque) for row in rows],
        OUTPUT[0]: [at_output(drive, row.run.peak_torque) for row in rows],
        "start time, s": [digits(row.run.start_time) for row in rows],
        "settled, s": [digits(row.run.settled_time) for row in rows],
        "later, s": [fixed(row.time_lost, _decimals(row.run.start_time)) for row in rows],
        "contacts": [str(row.run.contacts) for row in rows],
        LIMITS: [row.against_limits.replace(" ", "\N{NO-BREAK SPACE}") for row in rows],
        FLAG: [", ".join(flag.word for flag in row.flags) for row in rows],
    }
    columns = {heading: cells for heading, cells in columns.items() if any(cells)}
    strong = [rows.index(row) for row in chosen]
    base = drive.mean_torque
    notes = [
        (
            f"K_dyn is the largest shaft torque of the whole start, divided by {digits(base)} N m, the mean "
            "shaft torque under the full starting torque. It is located in the exact solution, not read off "
            "a grid."
        ),
        (
            f"Gap × {short(WORN_GAP)}, J2 × {short(LIGHT_INERTIA)}: the strategy as it was set up for this "
            f"drive, when the gap is {short(WORN_GAP)} times as wide or the load inertia "
            f"{short(LIGHT_INERTIA)} times as large."
        ),
        (
            f"Settled: from then on the load speed is never more than {short(100.0 * SETTLED_BAND)} % below "
            "the target. Later: start time beyond that of direct start."
        ),
        *(
            [
                f"At the output: torque at the motor shaft times the ratio {short(float(drive.gear_ratio))}, "
                "without losses."
            ]
            if drive.gear_ratio is not None
            else []
        ),
        *([_limits_note(rows[0])] if LIMITS in columns else []),
        *([INTERVALS_NOTE] if rows[0].intervals else []),
        *row_remarks(rows),
        *(f"{name} could not be examined: {reason}" for name, reason in failed),
    ]
    first = table(
        list(columns),
        list(zip(*columns.values(), strict=True)),
        caption="Strategies on this drive, the gentlest first",
        text_columns=[index for index, one in enumerate(columns) if one in ("strategy", LIMITS, FLAG)],
        strong=strong,
        class_="names",
    )
    return html(first, tag("ul", joined(tag("li", one) for one in notes), class_="notes"))


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
    """Torques of all strategies."""
    parts = []
    for key, some, note in trace_groups(rows):
        names = ", ".join(row.marked for row in some)
        caption = (
            f"Shaft torque (solid) and motor torque (dashed), with the K_dyn, under {names}. Grey: "
            "the gap is open; dot: peak; dotted: start time, and the permissible torque where one "
            "is given. All panels share both scales."
        )
        parts.append(
            figures.shown(key, partial(traces_picture, key, rows, some), f"{caption} {note}".strip())
        )
    return html(*parts)


def trace_groups(rows: Sequence[Row]) -> list[tuple[str, list[Row], str]]:
    """Of each figure of traces its key, its rows, the gentlest first, and what goes on beyond it."""
    rows = ordered(rows)
    shown, _, _ = _frame(rows)
    late = [label_of(row.run.controller) for row in rows if row.run.start_time > shown]
    cut = f"The start of {listed(late)} goes on beyond the {digits(shown)} s shown." if late else ""
    pieces = -(-len(rows) // AT_ONCE)
    size = -(-len(rows) // pieces)
    return [(f"traces-{i}", rows[i : i + size], cut) for i in range(0, len(rows), size)]


def traces_picture(key: str, rows: Sequence[Row], some: Sequence[Row]) -> Html:
    """The figure of `some` rows in the frame of all."""
    title = "; ".join(
        (
            f"{row.marked}: peak shaft torque {digits(row.run.peak_torque)} N m, start time "
            f"{digits(row.run.start_time)} s"
        )
        for row in some
    )
    return inlined(traces_figure(some, *_frame(rows)), key, f"Traces over time. {title}.")


def _frame(rows: Sequence[Row]) -> tuple[float, float, float]:
    """Until when traces are shown, s, and the least and largest torque of all, N m."""
    runs = [row.run for row in rows]
    times = [run.start_time for run in runs if not math.isnan(run.start_time)]
    ends = [run.end_time for run in runs if not math.isnan(run.start_time)]
    shown = min(max(ends), LATE * float(np.median(times))) if times else max(run.end_time for run in runs)
    highest = max(float(max(run.peak_torque, run.u.max())) for run in runs)
    return shown, min(float(min(run.T.min(), run.u.min())) for run in runs), highest


def traces_figure(rows: Sequence[Row], longest: float, lowest: float, highest: float) -> Any:
    """Torques of several starts, with their flags, in small panels of one scale; grey where the gap is open.

    Up to `longest` s; torques from `lowest` to `highest` N m, with some room.
    """
    down = -(-len(rows) // ACROSS)
    with drawing():
        size = (WIDE, 0.75 + 1.0 * down)  # four rows stand below the table of strategies on a page
        figure, axes = new_figure(down, ACROSS, size, sharex=True, sharey=True, squeeze=False)
        for row, panel in zip(rows, axes.flat, strict=False):
            run = row.run
            shade_open_gap(panel, run, longest)
            _torques(panel, run, ("motor torque u", "shaft torque T"))
            title = f"{name_in_figure(row.marked)}: {run.k_dyn:.3f}"
            panel.set_title(title, loc="left", fontsize=SMALL, pad=3)
            if not math.isnan(run.start_time):
                panel.axvline(run.start_time, color=GREY, lw=0.8, ls=":")
            panel.tick_params(labelsize=SMALL - 0.5)
        axes[0, 0].set_xlim(0.0, longest)
        axes[0, 0].set_ylim(min(-0.06 * highest, 1.06 * lowest), 1.12 * highest)
        for panel in axes.flat[len(rows) :]:
            panel.set_axis_off()
        for column in range(ACROSS):
            last = axes[down - 1 - (len(rows) <= (down - 1) * ACROSS + column), column]
            last.tick_params(labelbottom=True)
            last.set_xlabel("time, s", fontsize=SMALL)
        for panel in axes[:, 0]:
            panel.set_ylabel("N m", fontsize=SMALL)
        handles = axes[0, 0].get_legend_handles_labels()[0]
        figure.legend(handles=handles, loc="outside upper center", ncols=3, fontsize=SMALL)
    return figure


def before_after_figure(rows: Sequence[Row]) -> Any:
    """Shaft torque and load speed of `direct` and of another start, with the permissible torque as a line."""
    with drawing():
        figure, (torque, speed) = new_figure(1, 2, (WIDE, 2.9), width_ratios=(1.7, 1.0))
        longest = max(
            run.start_time if run.start_time > 0.0 else run.end_time for run in (r.run for r in rows)
        )
        units = units_of(rows[0].run.drive)
        styles = ((COLOURS[1], DASHES[0], 1.1), (COLOURS[0], DASHES[0], 2.0))[-len(rows) :]
        for row, (colour, dash, width) in zip(rows, styles, strict=True):
            run, name = row.run, name_in_figure(row.name)
            torque.plot(run.t, run.T, color=colour, ls=dash, lw=width, label=name)
            torque.plot([run.peak_time], [_peak(run)], "o", ms=4, color=colour)
            speed.plot(run.t, units.shown(run.w2, "rad/s"), color=colour, ls=dash, lw=width)
        permissible = rows[0].run.drive.limits.shaft_torque
        if permissible is not None:
            torque.axhline(permissible, color="#B00020", lw=1.4, ls=DASHES[1], label="permissible torque")
        torque.set_ylim(bottom=min(0.0, torque.get_ylim()[0]))  # "15 % less" is seen as that
        labels = "shaft torque, N m", f"load speed, {units.speed}"
        for panel, what in zip((torque, speed), labels, strict=True):
            panel.set_xlim(0.0, 1.1 * longest)
            panel.set_ylabel(what, fontsize=SMALL)
            panel.set_xlabel("time, s", fontsize=SMALL)
            panel.tick_params(labelsize=SMALL - 0.5)
        target = units.shown(float(rows[0].run.drive.target_speed), "rad/s")
        speed.axhline(target, color=GREY, lw=0.8, ls=":")
        figure.legend(
            handles=torque.get_legend_handles_labels()[0], loc="outside upper left", ncols=3, fontsize=SMALL
        )
    return figure


def _torques(panel: Axes, run: Run, labels: tuple[str, str]) -> None:
    """Motor and shaft torque of a start with its peak, and the permissible torque."""
    panel.plot(run.t, run.u, color=COLOURS[1], ls=DASHES[1], lw=0.9, label=labels[0])
    panel.plot(run.t, run.T, color=COLOURS[0], lw=1.1, label=labels[1])
    panel.plot([run.peak_time], [_peak(run)], "o", ms=3.0, color=COLOURS[0])
    permissible = run.drive.limits.shaft_torque
    if permissible is not None:
        panel.axhline(permissible, color="#B00020", lw=0.9, ls=":", label="permissible torque")


def name_in_figure(name: str) -> str:
    """A name as it is, not set as a formula, and cut where it is too long for a figure."""
    text = name if len(name) <= LONGEST else name[: LONGEST - 1] + "\N{HORIZONTAL ELLIPSIS}"
    return text.replace("$", r"\$")


def _peak(run: Run) -> float:
    return float(run.recorded.shafts["peak"][run.worst_shaft])
