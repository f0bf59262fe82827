"""K_dyn against start time, beside what any start can reach."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from softstart.reporting.limit import bound_at
from softstart.reporting.markup import Html, html, joined, table, tag
from softstart.reporting.pictures import limit_figure
from softstart.reporting.strategies import label_of
from softstart.reporting.strategies_section import ordered
from softstart.reporting.values import digits, fixed, listed, percent, short

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
    if limit.known:
        caption += " The dash-dotted line joins starts that a quick search found: possible, not proved best."
    title = "K_dyn against start time: " + "; ".join(
        f"{one.name} {fixed(one.row.run.k_dyn, 3)} at {digits(one.row.run.start_time)} s"
        for one in choice.candidates
    )
    return html(
        figures.drawn(limit_figure(choice, limit), title, caption) if direct else None,
        _how_near(report),
        tag("ul", joined(tag("li", one) for one in _notes(report)), class_="notes"),
    )


def _how_near(report: Report) -> Html:
    """Each strategy beside the bound, the optimum and the gentlest start known in its own start time."""
    limit = report.limit
    in_doubt = any(limit.optimum_at(row.run.start_time) is None for row in report.comparison.rows)
    heads = ["strategy", "start time, s", "K_dyn", "lower bound at that time"]
    heads += ["optimum at that time", "times the optimum"] if limit.found else []
    heads += ["gentlest start known in that time"] if in_doubt else []
    heads.append("times the bound")
    rows = []
    for row in ordered(report):
        run, bound = row.run, report.lower_bound(row)
        cells = [label_of(run.controller), digits(run.start_time), fixed(run.k_dyn, 3), fixed(bound, 3)]
        if limit.found:
            best = limit.optimum_at(run.start_time)
            cells.append(fixed(best.k_dyn if best else None, 3))
            cells.append(fixed(run.k_dyn / best.k_dyn if best and best.k_dyn else None, 2))
        if in_doubt:
            cells.append(fixed(report.gentlest_known(row), 3))
        rows.append([*cells, fixed(run.k_dyn / bound if bound else None, 2)])
    caption = "How near each strategy comes to the limit in its own start time"
    return table(heads, rows, caption=caption, class_="names")


def _notes(report: Report) -> list[str]:
    drive = report.drive
    return [
        "Lower bound: proved from the momentum of the load, for every torque from "
        f"{short(float(drive.minimum_torque))} to {short(float(min(drive.Ms, drive.maximum_torque)))} N m "
        "over time and any number of contacts. A dash: no bound at that start time.",
        *_on_optima(report),
        *_on_missing(report),
        *_on_the_recommended(report),
    ]


def _on_optima(report: Report) -> list[str]:
    """Of how many optima it is proved that nothing is gentler, and among which starts."""
    limit = report.limit
    every, single, loose = [], [], []
    for p in limit.found:
        bound, above = bound_at(report.drive, p.start_time_bound), p.gap_percent
        if bound and p.k_dyn is not None and 100.0 * (p.k_dyn / bound - 1.0) <= TIGHT:
            every.append(100.0 * (p.k_dyn / bound - 1.0))
        elif above is not None and above <= TIGHT:
            single.append(p)
        else:
            loose.append(math.inf if above is None else above)
    notes = []
    if every:
        notes.append(
            f"{len(every)} of {len(limit.found)} optima are certified against every other start: none lies "
            f"more than {digits(max(*every, 0.001), 1)} % above the lower bound."
        )
    if single:
        notes.append(
            f"{'That' if len(single) == 1 else 'Those'} at {_times([p.start_time_bound for p in single])} "
            f"{'is' if len(single) == 1 else 'are'} certified among starts whose gap closes only once, to "
            f"{digits(max(*(p.gap_percent or 0.0 for p in single), 0.001), 1)} %. That a start that bounces "
            "in the gap is gentler, down to the lower bound, is not ruled out."
        )
    if loose:
        far = f", up to {digits(max(loose), 2)} % above their lower bound" if max(loose) < math.inf else ""
        notes.append(
            f"{len(loose)} of {len(limit.found)} optima are the best starts found{far}: gentler ones may "
            "exist."
        )
    return notes + _on_the_shortest(report)


def _on_the_shortest(report: Report) -> list[str]:
    """Start times for which there is no start with a single contact, or just one."""
    refused = [p for p in report.limit.points if p.status == "INFEASIBLE"]
    once = [row.run.start_time for row in report.comparison.rows if row.run.contacts == 1]
    soonest = min((time for time in once if not math.isnan(time)), default=math.inf)
    # within rounding of the shortest time the search may refuse a start that a strategy has made
    none = [p for p in refused if p.start_time_bound < soonest and p.shortest_start_time is not None]
    only = [p for p in refused if p.start_time_bound >= soonest]
    notes = []
    if none:
        notes.append(
            f"In {_times([p.start_time_bound for p in none])} there is no start whose gap closes only once; "
            f"the shortest such start takes {digits(none[0].shortest_start_time, 5)} s. Quicker starts "
            "bounce in the gap."
        )
    if only:
        notes.append(
            f"In {_times([p.start_time_bound for p in only])} there is no choice: no start whose gap closes "
            "only once was found that is noticeably quicker, so there is no optimum to tell."
        )
    return notes


def _on_missing(report: Report) -> list[str]:
    """Where there is no optimum, why, and what is shown instead."""
    limit, notes = report.limit, []
    if limit.missing:
        ended = (
            f"none was found within the {short(limit.budget)} s given (more: --budget)"
            if limit.budget
            else "none was looked for (--budget 0)"
        )
        if gave_up := limit.gave_up:
            ended += f"; at {_times([p.start_time_bound for p in gave_up])} the search ended without one"
        notes.append(
            f"For {_times(limit.missing)} no optimum is shown: {_why_hard(report)}, and {ended}. The lower "
            "bound holds all the same. A longer search: softstart pareto."
        )
    if limit.known:
        notes.append(
            "Starts found: the best of some thousand torques over time that a quick search tried, each "
            "simulated exactly. They are known to be possible, not known to be the gentlest: the limit lies "
            "between them and the lower bound."
        )
    return notes


def _on_the_recommended(report: Report) -> list[str]:
    """Between which figures the least K_dyn lies in the start time of the recommended strategy."""
    best = report.choice.recommended
    if best is None:
        return []
    bound, known, own = report.lower_bound(best.row), report.gentlest_known(best.row), best.row.run.k_dyn
    if bound is None or known is None:
        return []
    optimum = report.limit.optimum_at(best.row.run.start_time)
    if optimum is not None and 100.0 * (known / bound - 1.0) <= TIGHT:
        return []
    said = (
        f"In the {digits(best.row.run.start_time)} s of {best.name} the least possible K_dyn thus lies "
        f"between {fixed(bound, 3)} (proved) and {fixed(known, 3)} "
    )
    most = percent(1.0 - bound / own)
    if known < own:
        return [
            f"{said}(found): {best.name} with {fixed(own, 3)} could be undercut by "
            f"{percent(1.0 - known / own)} for certain, by {most} at most."
        ]
    return [f"{said}(that of {best.name} itself, the gentlest start known): {most} less at most."]


def _times(times: Sequence[float]) -> str:
    """Start times in words, each once, or how many there are."""
    words = list(dict.fromkeys(f"{digits(t)} s" for t in times))
    return f"{len(times)} start times" if len(words) > 4 else listed(words)


def _why_hard(report: Report) -> str:
    from softstart.optimal import linear_search, whole
    from softstart.optimal.problem import Problem
    from softstart.optimal.pulse_coast_hold import applies

    problem = Problem(report.drive, 1.0, "reached")
    if linear_search.not_linear(problem) and (reason := whole.not_linear(problem)):
        return f"they need a numerical search (direct collocation), because {reason}"
    if reason := applies(problem):
        return f"there is no formula ({reason}), only a search by linear programs"
    return "so near the shortest start time there is no formula, and a linear program has to be certified"
