"""K_dyn against start time, beside what any start can reach."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from softstart.reporting.markup import Html, html, joined, table, tag
from softstart.reporting.pictures import limit_figure
from softstart.reporting.strategies import label_of
from softstart.reporting.strategies_section import ordered
from softstart.reporting.values import digits, fixed, listed, short

if TYPE_CHECKING:
    from softstart.reporting.figure_list import Figures
    from softstart.reporting.result import Report

TIGHT = 1.0  # per cent between an optimum and its bound that counts as certified


def limit_section(report: Report, figures: Figures) -> Html:
    """Figure, table and what can and cannot be said."""
    limit, choice = report.limit, report.choice
    if limit.refusal:
        return tag("p", "For this drive there is no limit to compare with. ", limit.refusal)
    direct = report.row("direct")
    caption = (
        "Every strategy (filled: recommended, and best of an ordinary inverter) by its start time and "
        "K_dyn. Below "
        "the dashed line (hatched) no start is possible, with whatever motor torque within its limits and "
        "however it is controlled."
    )
    if limit.found:
        caption += " The solid line joins optimal starts, each simulated exactly."
    title = "K_dyn against start time: " + "; ".join(
        f"{one.name} {fixed(one.row.run.k_dyn, 3)} at {digits(one.row.run.start_time)} s"
        for one in choice.candidates
    )
    rows = []
    for row in ordered(report):
        run = row.run
        best = limit.optimum_at(run.start_time)
        bound = report.lower_bound(row)
        certified = max(filter(None, [bound, best.k_dyn_lower_bound if best else None]), default=None)
        rows.append([
            label_of(run.controller), digits(run.start_time), fixed(run.k_dyn, 3), fixed(bound, 3),
            fixed(best.k_dyn if best else None, 3),
            fixed(run.k_dyn / best.k_dyn if best and best.k_dyn else None, 2),
            fixed(run.k_dyn / certified if certified else None, 2),
        ])  # fmt: skip
    heads = [
        "strategy", "start time, s", "K_dyn", "lower bound at that time", "optimum at that time",
        "times the optimum", "times the bound, at most",
    ]  # fmt: skip
    made = table(heads, rows, caption="How near each strategy comes to the limit in its own start time")
    return html(
        figures.drawn(limit_figure(choice, limit), title, caption) if direct else None,
        made,
        tag("ul", joined(tag("li", one) for one in _notes(report)), class_="notes"),
    )


def _notes(report: Report) -> list[str]:
    limit, drive = report.limit, report.drive
    notes = [
        "Lower bound: proved from the momentum of the load, for every torque from "
        f"{short(float(drive.minimum_torque))} to {short(float(min(drive.Ms, drive.maximum_torque)))} N m "
        f"over time "
        "and any number of contacts. A dash: no bound at that start time."
    ]
    found = limit.found
    if found:
        gaps = [p.gap_percent for p in found if p.gap_percent is not None]
        widest = max(gaps, default=math.inf)
        if len(gaps) == len(found) and widest <= TIGHT:
            notes.append(
                f"All {len(found)} optima are certified: none lies more than "
                f"{digits(max(widest, 0.001), 1)} % above its "
                "lower bound, so no other start is noticeably gentler."
            )
        else:
            notes.append(
                f"{sum(g <= TIGHT for g in gaps)} of {len(found)} optima are certified to {short(TIGHT)} "
                f"%; the others are "
                f"the best starts found, up to {digits(widest, 2)} % above their lower bound. Gentler ones "
                f"may exist "
                "between the two."
            )
        if any(p.bound_kind == "certificate" for p in found):
            notes.append(
                "Where the solid line is close to the shortest start time its own bound is the sharper "
                "one: it covers "
                "every start whose gap closes once."
            )
    refused = [p for p in limit.points if p.status == "INFEASIBLE" and p.shortest_start_time is not None]
    if refused:
        times = listed([f"{digits(p.start_time_bound)} s" for p in refused])
        notes.append(
            f"In {times} there is no start whose gap closes only once; the shortest such start takes "
            f"{digits(refused[0].shortest_start_time)} s. Quicker starts bounce in the gap."
        )
    if limit.missing:
        times = f"{len(limit.missing)} start times" if len(limit.missing) > 4 else listed(
            [f"{digits(t)} s" for t in limit.missing]
        )  # fmt: skip
        why = _why_hard(report)
        notes.append(
            f"For {times} no optimum is shown: {why}, and none was found within the {short(limit.budget)} "
            f"s given. The "
            "lower bound holds all the same. A longer search: softstart pareto."
        )
    return notes


def _why_hard(report: Report) -> str:
    from softstart.optimal.linear_search import not_linear
    from softstart.optimal.problem import Problem
    from softstart.optimal.pulse_coast_hold import applies

    problem = Problem(report.drive, 1.0, "reached")
    if reason := not_linear(problem):
        return f"they need a numerical search (direct collocation), because {reason}"
    if reason := applies(problem):
        return f"there is no formula ({reason}), only a search by linear programs"
    return "so near the shortest start time there is no formula, and a linear program has to be certified"
