"""Which strategy is recommended, by a rule that is stated."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from softstart.controller.base import label_of
from softstart.reporting.markup import Html, html, table, tag
from softstart.reporting.robustness import RobustnessMap
from softstart.reporting.strategies import Means, means_of
from softstart.start.comparison import REFERENCE, Row
from softstart.views.printed import digits, fixed, percent, short

SLOWER = 0.15  # of the start time of direct
ALIKE = 0.01  # worst K_dyn within this share of the least count as equal: then K_dyn on the drive as it is

MOST_MAPS = 4


@dataclass(frozen=True, eq=False)
class Candidate:
    """One strategy before the rule: its start, its map, what it needs, and why it is out (empty: it is in).

    `slower`: its start time beyond that of the reference, as a share; NaN where it does not reach the speed.
    """

    row: Row
    map: RobustnessMap
    means: Means
    slower: float
    out: str

    @property
    def name(self) -> str:
        """Its name in tables."""
        return label_of(self.row.run.controller)

    @property
    def worst(self) -> float:
        """Largest K_dyn over the map."""
        return self.map.worst


@dataclass(frozen=True, eq=False)
class Choice:
    """The recommended strategy and the best of an ordinary inverter; None where there is none.

    `too_slow`: no ramp keeps the limit on the start time, and `ordinary` is the one with the least worst
    K_dyn.
    """

    candidates: tuple[Candidate, ...]
    recommended: Candidate | None
    ordinary: Candidate | None
    too_slow: bool
    slower: float
    reference: str

    @property
    def rows(self) -> list[Row]:
        """The rows of all candidates."""
        return [one.row for one in self.candidates]

    def of(self, name: str) -> Candidate | None:
        """The candidate of this name."""
        return next((one for one in self.candidates if one.name == name), None)

    @property
    def mapped(self) -> list[Candidate]:
        """Those whose maps are shown: the two chosen, direct, and others with the least worst case."""
        others = sorted(
            (one for one in self.candidates if one.means.realisable),
            key=lambda one: math.inf if math.isnan(one.worst) else one.worst,
        )
        first = [self.recommended, self.ordinary, self.of(REFERENCE)]
        return list(dict.fromkeys([one for one in first if one is not None] + others))[:MOST_MAPS]

    def summary(self) -> dict[str, Any]:
        """As plain data."""
        return {
            "recommended": self.recommended.name if self.recommended else None,
            "ordinary": self.ordinary.name if self.ordinary else None,
            "most_slower": self.slower,
            "candidates": [
                {
                    "controller": one.name,
                    "worst_k_dyn": one.worst,
                    "slower": one.slower,
                    "realisable": one.means.realisable,
                    "ordinary": one.means.ordinary,
                    "excluded": one.out,
                }
                for one in self.candidates
            ],
        }


def choose(rows: Sequence[Row], maps: Sequence[RobustnessMap], slower: float = SLOWER) -> Choice:
    """Apply the rule.

    A strategy is in if it works with what a drive itself measures, reaches the target speed in every cell
    of its map, and takes at most `slower` (a share) longer than direct. Of these the one with the least
    worst-case K_dyn over the map is recommended; among those within 1 % of that, the one with the least
    K_dyn on the drive as it is. Where direct does not reach the target speed
    the quickest strategy takes its place.
    """
    times = {label_of(row.run.controller): row.run.start_time for row in rows}
    direct = times.get(REFERENCE, math.nan)
    reference = REFERENCE
    if math.isnan(direct):
        reached = {name: time for name, time in times.items() if not math.isnan(time)}
        reference = min(reached, key=lambda name: reached[name]) if reached else ""
        direct = reached.get(reference, math.nan)
    found = []
    for row, one in zip(rows, maps, strict=True):
        means = means_of(row.run.controller)
        late = row.run.start_time / direct - 1.0
        found.append(Candidate(row, one, means, late, _why_out(means, one, late, slower)))
    inside = [one for one in found if not one.out]
    ordinary = [one for one in inside if one.means.ordinary]
    too_slow = False
    if not ordinary:
        ordinary = [one for one in found if one.means.ordinary and not math.isnan(one.worst)]
        ordinary = [one for one in ordinary if not math.isnan(one.slower)]
        too_slow = bool(ordinary)
    return Choice(tuple(found), _best(inside), _best(ordinary), too_slow, slower, reference)


def _why_out(means: Means, one: RobustnessMap, late: float, slower: float) -> str:
    if not means.realisable:
        return f"needs a {means.measures}"
    if math.isnan(late):
        return "does not reach the target speed"
    if one.failed:
        return f"no start in {one.failed} of {one.k_dyn.size} cells"
    if late > slower * (1.0 + 1e-9):
        return f"{100.0 * late:.1f} % slower"
    return ""


def _best(inside: Sequence[Candidate]) -> Candidate | None:
    if not inside:
        return None
    least = min(one.worst for one in inside)
    alike = [one for one in inside if one.worst <= least * (1.0 + ALIKE)]
    return min(alike, key=lambda one: one.row.run.k_dyn)


def choice_section(choice: Choice) -> Html:
    """The rule, what it finds, and every strategy before it."""
    cells = choice.candidates[0].map.k_dyn.size
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
        tag("p", *_found(choice)),
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


def _found(choice: Choice) -> list[Html | str]:
    best, plain = choice.recommended, choice.ordinary
    text: list[Html | str] = []
    if best is None:
        text.append("No strategy fulfils the rule below, so none is recommended. ")
    else:
        second = [one for one in choice.candidates if not one.out and one is not best]
        nearest = min(second, key=lambda one: one.worst, default=None)
        gap, inertia = best.map.worst_at
        text += [
            tag("strong", f"Recommended: {best.name}. "),
            f"Its K_dyn is {fixed(best.row.run.k_dyn, 3)} on the drive as it is and nowhere on the map above "
            f"{fixed(best.worst, 3)} (gap {digits(gap, 3)} rad, J2 {digits(inertia, 3)} kg m²)",
            _next_one(best, nearest) if nearest else ". ",
            f"It measures: {best.means.measures}. "
            f"Can an ordinary inverter do it? {best.means.inverter.capitalize()}. ",
        ]
    if plain is None:
        text.append("No ramp was examined, so nothing is said for an ordinary inverter.")
        if any(one.means.ordinary for one in choice.candidates):
            text[-1] = (
                "No torque ramp reaches the target speed everywhere, so none is offered for an ordinary "
                "inverter."
            )
    elif plain is not best:
        slow = (
            f", though {percent(plain.slower)} slower, beyond the limit of the rule"
            if choice.too_slow
            else ""
        )
        text += [
            tag("strong", f"On an ordinary inverter: {plain.name}"),
            f"{slow}. K_dyn {fixed(plain.row.run.k_dyn, 3)}, worst {fixed(plain.worst, 3)}.",
        ]
    else:
        text.append("It is also the best that an ordinary inverter offers.")
    return text
