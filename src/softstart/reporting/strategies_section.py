"""The strategies compared: table and traces."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from softstart.reporting.markup import Html, html, joined, table, tag
from softstart.reporting.pictures import traces_figure
from softstart.reporting.strategies import label_of
from softstart.reporting.values import digits, fixed, listed, percent, short
from softstart.start import metrics
from softstart.start.comparison import LIGHT_INERTIA, WORN_GAP

if TYPE_CHECKING:
    from softstart.reporting.figure_list import Figures
    from softstart.reporting.result import Report
    from softstart.start.comparison import Row

AT_ONCE = 5  # strategies in one figure of traces: what a page holds
LATE = 1.6  # times the median start time, up to which traces are shown


def ordered(report: Report) -> list[Row]:
    """The strategies, the gentlest first; those that do not reach the target speed last."""
    return sorted(
        report.comparison.rows,
        key=lambda row: (math.isnan(row.run.start_time), float(f"{row.run.k_dyn:.9g}")),
    )


def strategies_section(report: Report) -> Html:
    """The table of strategies and what its columns mean."""
    rows, choice = ordered(report), report.choice
    chosen = [one for one in (choice.recommended, choice.ordinary) if one is not None]
    cells, needs = [], []
    hard = report.row("direct")
    direct = hard.run.start_time if hard else math.nan
    for row in rows:
        run, name = row.run, label_of(row.run.controller)
        candidate = choice.of(name)
        assert candidate is not None
        lost = run.start_time - direct
        cells.append([
            name, fixed(run.k_dyn, 3), fixed(row.k_dyn_worn_gap, 3), fixed(row.k_dyn_light_load, 3),
            digits(run.peak_torque), digits(run.start_time), fixed(lost, _decimals(run.start_time)),
            fixed(100.0 * lost / direct, 1), str(run.contacts),
        ])  # fmt: skip
        what = run.controller.summary
        needs.append([name, what, candidate.means.measures, candidate.means.inverter])
    strong = [rows.index(one.row) for one in chosen]
    base = float(metrics.base_torque(report.drive))
    notes = [
        f"K_dyn is the largest shaft torque of the whole start, divided by {digits(base)} N m, the mean "
        f"shaft torque "
        "under the full starting torque. It is located in the exact solution, not read off a grid.",
        f"Gap × {short(WORN_GAP)} and J2 × {short(LIGHT_INERTIA)}: the strategy as it was set up for this "
        f"drive, when "
        f"the gap is {short(WORN_GAP)} times as wide or the load inertia {short(LIGHT_INERTIA)} times as "
        f"large.",
        "Time lost: start time beyond that of direct start.",
        *(
            f"{label_of(row.run.controller)}: {row.run.status.value}"
            for row in rows
            if math.isnan(row.run.start_time)
        ),
        *(f"{name} could not be examined: {reason}" for name, reason in report.failed),
    ]
    first = table(
        [
            "strategy", "K_dyn", f"K_dyn, gap × {short(WORN_GAP)}", f"K_dyn, J2 × {short(LIGHT_INERTIA)}",
            "peak torque, N m", "start time, s", "time lost, s", "time lost, %", "contacts",
        ],
        cells, caption="Strategies on this drive, the gentlest first", strong=strong, class_="names",
    )  # fmt: skip
    second = table(
        ["strategy", "what it does", "what it measures", "can an ordinary inverter do it?"], needs,
        caption="What each strategy needs", text_columns=(0, 1, 2, 3), strong=strong, class_="words",
    )  # fmt: skip
    return html(first, tag("ul", joined(tag("li", one) for one in notes), class_="notes"), second)


def traces_section(report: Report, figures: Figures) -> Html:
    """Torques and speeds of all strategies."""
    runs = [row.run for row in ordered(report)]
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
        some = runs[first : first + size]
        names = ", ".join(label_of(run.controller) for run in some)
        caption = (
            f"Torques (left) and speeds (right) under {names}. Grey: the gap is open; numbers: stages, odd "
            f"with the "
            "gap open, even with the gap closed. Dot: the peak. Dotted: target speed and start time. All "
            "torques "
            f"have one scale.{cut}"
        )
        title = "; ".join(
            f"{label_of(run.controller)}: peak shaft torque {digits(run.peak_torque)} N m, start time "
            f"{digits(run.start_time)} s"
            for run in some
        )
        parts.append(
            figures.drawn(traces_figure(some, shown, lowest, highest), f"Traces over time. {title}.", caption)
        )
    return html(*parts)


def _decimals(start_time: float) -> int:
    """Decimals of start times of this size."""
    if not start_time > 0.0:
        return 4
    return min(max(3 - math.floor(math.log10(start_time)), 0), 9)


def share_saved(report: Report, row: Row) -> str:
    """What a strategy saves of the peak of direct."""
    direct = report.row("direct")
    saved = 1.0 - row.run.peak_torque / direct.run.peak_torque if direct else math.nan
    return percent(saved, 0 if abs(saved) >= 0.1 else 1)
