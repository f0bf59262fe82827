"""What is recommended, by the rule of `start.recommendation`, with the map of each strategy beside it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from softstart.controller.base import Effort
from softstart.errors import listed
from softstart.reporting.markup import Html, html, table, tag
from softstart.reporting.robustness import RobustnessMap
from softstart.reporting.strategies import realisable
from softstart.start.comparison import REFERENCE
from softstart.start.recommendation import SLOW, Recommendation, Row
from softstart.views.printed import fixed, short

MOST_MAPS = 4


@dataclass(frozen=True, eq=False)
class Candidate:
    """One strategy: its start, its map, whether drives can do it, and the verdict of the rule on it."""

    row: Row
    map: RobustnessMap | None  # none of a machine with several gaps
    realisable: bool
    verdict: str

    @property
    def name(self) -> str:
        """Its name in tables."""
        return self.row.name

    @property
    def ordinary(self) -> bool:
        """Whether an inverter does it that offers torque ramps and no more."""
        return self.row.effort is Effort.RAMPS

    @property
    def worst(self) -> float:
        """Largest K_dyn over the map; without one that of the start."""
        return self.row.run.k_dyn if self.map is None else self.map.worst


@dataclass(frozen=True, eq=False)
class Choice:
    """The strategies with the verdict on each.

    Attributes
    ----------
    candidates : tuple of Candidate
        All strategies.
    recommendation : Recommendation
        The text that is the same everywhere, and what it rests on.
    chosen : Candidate or None
        The recommended strategy; without limits the gentlest of those that no other one beats.
    ordinary : Candidate or None
        The strategy of an ordinary inverter with the least K_dyn over its map, of those that are not flagged
        and keep the limits.
    """

    candidates: tuple[Candidate, ...]
    recommendation: Recommendation
    chosen: Candidate | None
    ordinary: Candidate | None

    @property
    def rows(self) -> list[Row]:
        """The rows of all candidates."""
        return [one.row for one in self.candidates]

    @property
    def role(self) -> str:
        """What the chosen one is, in a word or two."""
        return "gentlest unbeaten" if self.recommendation.recommended is None else "recommended"

    def of(self, name: str) -> Candidate | None:
        """The candidate of this name."""
        return next((one for one in self.candidates if one.name == name), None)

    @property
    def mapped(self) -> list[Any]:
        """Those whose maps are shown: the two chosen, direct, and others with the least worst case."""
        others = sorted(
            (one for one in self.candidates if one.realisable),
            key=lambda one: math.inf if math.isnan(one.worst) else one.worst,
        )
        first = [self.chosen, self.ordinary, self.of(REFERENCE)]
        shown = dict.fromkeys([one for one in first if one is not None] + others)
        return [one for one in shown if one.map is not None][:MOST_MAPS]

    def summary(self) -> dict[str, Any]:
        """As plain data."""
        return {
            **self.recommendation.summary(),
            "chosen": self.chosen.name if self.chosen else None,
            "ordinary": self.ordinary.name if self.ordinary else None,
            "candidates": [
                {
                    "controller": one.name,
                    "effort": one.row.effort.value,
                    "worst_k_dyn": one.worst,
                    "realisable": one.realisable,
                    "ordinary": one.ordinary,
                    "verdict": one.verdict,
                }
                for one in self.candidates
            ],
        }


def choose(
    maps: Sequence[RobustnessMap | None], rows: Sequence[Row], recommendation: Recommendation
) -> Choice:
    """The verdict on each strategy; nothing is decided here."""
    found = [
        Candidate(row, one, realisable(row.run.controller), recommendation.verdict(row))
        for row, one in zip(rows, maps, strict=True)
    ]
    shown = recommendation.shown
    chosen = next((one for one in found if shown and one.row is shown[-1]), None)
    able = [one for one in found if one.ordinary and not one.row.flags and not math.isnan(one.worst)]
    ramps = [one for one in able if all(margin.kept for margin in one.row.margins(recommendation.limits))]
    ordinary = min(ramps, key=lambda one: one.worst, default=None)
    return Choice(tuple(found), recommendation, chosen, ordinary)


def choice_section(choice: Choice, answer: str) -> Html:
    """The answer, the rule behind it, and every strategy before it."""
    limits = bool(choice.recommendation.limits)
    cases = choice.candidates[0].row.worst_case
    worst = f"on the drive as it is, with {listed(list(cases))}" if cases else "on the drive as it is"
    rule = (
        (
            f"The rule: the simplest strategy that keeps the limits of the drive {worst}, of several of the "
            "same effort the one with the larger margin. Effort rises from what a contactor does to ramps, "
            "torque steps, code of your own, and the same with an encoder."
        )
        if limits
        else (
            "The rule: the drive has no limits, so nothing says which peak is low enough. Those "
            "strategies are named that no other one beats in K_dyn and settled time at once, with the "
            "cost of each step."
        )
    )
    timed = choice.candidates[0].row.run.drive.limits.start_time is not None
    never = (
        (
            "Never recommended: what is flagged (harder than direct start, not settled), and what needs a "
            "sensor that drives do not have."
        )
        if timed
        else (
            "Never recommended: what is flagged (harder than direct start, not settled, more than "
            f"{short(SLOW)} times as slow), and what needs a sensor that drives do not have."
        )
    )
    order = sorted(choice.candidates, key=lambda one: (one.row.effort.order, one.row.run.k_dyn))
    rows = [
        [one.name, one.row.run.controller.summary, one.row.effort.meaning, fixed(one.worst, 3), one.verdict]
        for one in order
    ]
    strong = [index for index, one in enumerate(order) if one.row in choice.recommendation.shown]
    worst_of = "K_dyn" if choice.candidates[0].map is None else "worst K_dyn on the map"
    heads = ["strategy", "what it does", "takes", worst_of, "verdict"]
    return html(
        tag("p", answer),
        tag("p", rule, " ", never),
        table(
            heads, rows, caption="Every strategy before the rule, in the order of effort",
            text_columns=(0, 1, 2, 4), strong=strong, class_="words",
        ),
    )  # fmt: skip
