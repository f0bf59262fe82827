"""The recommendation and why."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from softstart.reporting.choice import ALIKE
from softstart.reporting.markup import Html, html, table, tag
from softstart.reporting.values import digits, fixed, percent, short

if TYPE_CHECKING:
    from softstart.reporting.choice import Candidate
    from softstart.reporting.result import Report


def choice_section(report: Report) -> Html:
    """The rule, what it finds, and every strategy before it."""
    choice = report.choice
    cells = len(report.choice.candidates[0].map.k_dyn.ravel())
    than = f"than {choice.reference}" if choice.reference else ""
    rule = (
        "The rule: among the strategies that work with what a drive itself measures (motor encoder and "
        "motor torque), "
        f"that reach the target speed in all {cells} cells of the map and whose start is at most "
        f"{short(100.0 * choice.slower)}\N{NO-BREAK SPACE}% slower {than}, take the one with the least "
        "worst-case K_dyn over the map; "
        f"of several within {percent(ALIKE, 0)}, the one with the least K_dyn on the drive as it is. "
        f"Strategies that "
        "must see the gap or the shaft torque are shown as yardsticks and not recommended: drives have no "
        "such "
        "sensor."
    )
    order = sorted(
        choice.candidates, key=lambda one: (bool(one.out), math.inf if math.isnan(one.worst) else one.worst)
    )
    rows = []
    for one in order:
        verdict = "recommended" if one is choice.recommended else f"out: {one.out}" if one.out else "in"
        if one is choice.ordinary and one is not choice.recommended:
            verdict += "; best of an ordinary inverter"
        rows.append([
            one.name, fixed(one.worst, 3), digits(one.map.worst_at[0], 3), digits(one.map.worst_at[1], 3),
            fixed(one.row.run.k_dyn, 3), fixed(100.0 * one.slower, 1), verdict,
        ])  # fmt: skip
    strong = [index for index, one in enumerate(order) if one in (choice.recommended, choice.ordinary)]
    heads = ["strategy", "worst K_dyn", "at gap, rad", "and J2, kg m²", "K_dyn here", "slower, %", "verdict"]
    made = table(
        heads, rows, caption="Every strategy before the rule", text_columns=(0, 6), strong=strong,
        class_="names",
    )  # fmt: skip
    return html(
        tag("p", *_found(report)),
        tag("p", rule),
        made,
    )


def _next_one(best: Candidate, nearest: Candidate) -> str:
    """How far the next one in is behind, or why it is not taken though its worst case is no worse."""
    worst, here = fixed(nearest.worst, 3), fixed(nearest.row.run.k_dyn, 3)
    if nearest.worst <= best.worst * (1.0 + ALIKE):
        return (
            f"; {nearest.name} is as good there within {percent(ALIKE, 0)} ({worst}), but no gentler on the "
            f"drive as it is ({here}). "
        )
    return f"; the next one in, {nearest.name}, reaches {worst}. "


def _found(report: Report) -> list[Html | str]:
    choice = report.choice
    best, plain = choice.recommended, choice.ordinary
    said: list[Html | str] = []
    if best is None:
        said.append("No strategy fulfils the rule below, so none is recommended. ")
    else:
        second = [one for one in choice.candidates if not one.out and one is not best]
        nearest = min(second, key=lambda one: one.worst, default=None)
        gap, inertia = best.map.worst_at
        said += [
            tag("strong", f"Recommended: {best.name}. "),
            f"Its K_dyn is {fixed(best.row.run.k_dyn, 3)} on the drive as it is and nowhere on the map above "
            f"{fixed(best.worst, 3)} (gap {digits(gap, 3)} rad, J2 {digits(inertia, 3)} kg m²)",
            _next_one(best, nearest) if nearest else ". ",
            f"It measures: {best.means.measures}. "
            f"Can an ordinary inverter do it? {best.means.inverter.capitalize()}. ",
        ]
    if plain is None:
        said.append("No ramp was examined, so nothing is said for an ordinary inverter.")
        if any(one.means.ordinary for one in choice.candidates):
            said[-1] = (
                "No torque ramp reaches the target speed everywhere, so none is offered for an ordinary "
                "inverter."
            )
    elif plain is not best:
        slow = (
            f", though {percent(plain.slower)} slower, beyond the limit of the rule"
            if choice.too_slow
            else ""
        )
        said += [
            tag("strong", f"On an ordinary inverter: {plain.name}"),
            f"{slow}. K_dyn {fixed(plain.row.run.k_dyn, 3)}, worst {fixed(plain.worst, 3)}.",
        ]
    else:
        said.append("It is also the best that an ordinary inverter offers.")
    return said
