"""Which strategy is recommended, by a rule that is stated."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from softstart.reporting.robustness import RobustnessMap
from softstart.reporting.strategies import Means, label_of, means_of
from softstart.start.comparison import Row

SLOWER = 0.15  # of the start time of direct
ALIKE = 0.01  # worst K_dyn within this share of the least count as equal: then K_dyn on the drive as it is


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

    def of(self, name: str) -> Candidate | None:
        """The candidate of this name."""
        return next((one for one in self.candidates if one.name == name), None)

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
    direct = times.get("direct", math.nan)
    reference = "direct"
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
