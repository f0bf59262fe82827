"""What is recommended, by the rule of `start.recommendation`, and how strategies fare on changed drives."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from softstart.arrays import Matrix
from softstart.chain.machines import varied
from softstart.controller import Controller
from softstart.controller.base import Effort
from softstart.drive import Drive
from softstart.results import OneLine
from softstart.start.batch import prepared
from softstart.start.comparison import REFERENCE, Comparison
from softstart.start.recommendation import Recommendation, Row, keeps
from softstart.start.results import limited_time

GAPS = (0.5, 0.7, 1.0, 1.4, 2.0, 2.8, 4.0)  # of the drive's own
INERTIAS = (0.4, 0.6, 0.8, 1.0, 1.25)
MOST_MAPS = 4
SAME = 0.005  # a peak within this share of another is the same


@dataclass(frozen=True, eq=False, repr=False)
class RobustnessMap(OneLine):
    """K_dyn and start time (s) of one strategy: a row per gap (rad), a column per load inertia (kg m2).

    K_dyn refers to the mean torque of the nominal drive, so that it compares shaft torques. NaN where the
    start was not finished or the load did not reach its target speed. Under a strategy that holds the speed
    `start_time` is the settled time.
    """

    gaps: tuple[float, ...]
    inertias: tuple[float, ...]
    k_dyn: Matrix
    start_time: Matrix

    @property
    def worst(self) -> float:
        """The largest K_dyn; NaN if a cell has none."""
        return float(np.max(self.k_dyn))

    def summary(self) -> dict[str, Any]:
        """As plain data."""
        axes = {"gaps": list(self.gaps), "load_inertias": list(self.inertias)}
        figures = {"k_dyn": self.k_dyn.tolist(), "start_time": self.start_time.tolist()}
        return {**axes, **figures, "worst_k_dyn": self.worst}


def robustness(drive: Drive, controller: Controller) -> RobustnessMap:
    """The map of a controller that was set up for `drive`; of a drive without a gap it has one row.

    >>> from softstart.controller import make_controller
    >>> robustness(Drive.load("crane-4amtkf"), make_controller("direct")).gaps
    (0.25, 0.35, 0.5, 0.7, 1.0, 1.4, 2.0)
    """
    gaps = tuple(float(f"{share * float(drive.gap):.12g}") for share in (GAPS if drive.gap > 0.0 else (0.0,)))
    inertias = tuple(float(f"{share * float(drive.J2):.12g}") for share in INERTIAS)
    many = varied(drive, {"gap": np.array(gaps)[:, None], "load_inertia": np.array(inertias)[None, :]})
    found = prepared(many).figures(controller.set_ups(drive), drive.mean_torque)
    k_dyn, time = (
        np.asarray(values, dtype=np.float64).reshape(len(gaps), len(inertias))
        for values in (found["k_dyn"][0], limited_time(found))
    )
    return RobustnessMap(gaps, inertias, np.where(np.isnan(time), np.nan, k_dyn), time)


@dataclass(frozen=True, eq=False, repr=False)
class Choice(OneLine):
    """The strategies compared, their maps by name (of a machine with one gap), and which are best."""

    comparison: Comparison
    maps: Mapping[str, RobustnessMap]

    @property
    def recommendation(self) -> Recommendation:
        """The text that is the same everywhere, and what it rests on."""
        return self.comparison.recommendation

    @cached_property
    def chosen(self) -> Row | None:
        """The recommended strategy; without limits that with the lowest K_dyn of the Pareto-optimal ones."""
        return self.recommendation.shown[-1] if self.recommendation.shown else None

    @cached_property
    def ordinary(self) -> Row | None:
        """That of an ordinary inverter with the lowest worst-case K_dyn, unflagged, within the limits."""
        return self._gentlest(Effort.RAMPS)

    @cached_property
    def speed_controlled(self) -> Row | None:
        """That of an inverter with closed-loop speed control, by the same rule."""
        return self._gentlest(Effort.SPEED)

    def _gentlest(self, effort: Effort) -> Row | None:
        rows = [
            row
            for row in self.comparison.rows
            if row.effort is effort and not row.flags and not math.isnan(self.worst(row))
            if all(margin.kept for margin in row.margins(self.recommendation.limits))
        ]
        return min(rows, key=self.worst, default=None)

    @property
    def foremost(self) -> list[Row]:
        """The chosen strategy, and those of an ordinary inverter and of one with speed control, each once."""
        rows = (self.chosen, self.ordinary, self.speed_controlled)
        return list(dict.fromkeys(row for row in rows if row is not None))

    @property
    def of_sheets(self) -> list[Row]:
        """Those with a parameter sheet: the foremost, and all others that keep the limits."""
        limits = self.recommendation.limits
        keeping = [row for row in self.comparison.rows if limits and keeps(row, limits)]
        return list(dict.fromkeys([*self.foremost, *keeping]))

    @property
    def role(self) -> str:
        """What the chosen one is, in a word or two."""
        return "lowest K_dyn" if self.recommendation.recommended is None else "recommended"

    def worst(self, row: Row) -> float:
        """Largest K_dyn over the map; without one that of the start."""
        return self.maps[row.name].worst if row.name in self.maps else float(row.run.k_dyn)

    @property
    def _able(self) -> list[Row]:
        """Those for which a drive measures what they need: motor encoder and motor torque."""
        return [row for row in self.comparison.rows if row.effort is not Effort.SENSOR]

    @property
    def direct(self) -> Row:
        """The reference."""
        return next(row for row in self.comparison.rows if row.name == REFERENCE)

    @property
    def mapped(self) -> list[Row]:
        """Those whose maps are shown: the two chosen, direct, and others with the lowest worst case."""
        others = sorted(self._able, key=lambda row: np.nan_to_num(self.worst(row), nan=math.inf))
        shown = dict.fromkeys([*self.foremost, self.direct, *others])
        return [row for row in shown if row.name in self.maps][:MOST_MAPS]

    @property
    def shown(self) -> list[Row]:
        """Direct, and the chosen strategy; where none keeps the limits, the one that comes nearest."""
        able = [row for row in self._able if not row.flags]
        shares = {row: row.least_margin.share for row in able if row.least_margin is not None}
        known = {row: share for row, share in shares.items() if not math.isnan(share)}
        best = self.chosen or max(known, key=lambda row: known[row], default=self.direct)
        return list(dict.fromkeys([self.direct, best]))

    @property
    def more_effort(self) -> list[Row]:
        """Direct, the chosen one, and the best of each class of effort that is below all simpler ones.

        With limits the best of those that keep them, if any does.
        """
        limits, able = self.recommendation.limits, [row for row in self._able if not row.flags]
        able = [row for row in able if keeps(row, limits)] or able
        found = [self.direct, *([self.chosen] if self.chosen else [])]
        lowest = self.direct.run.k_dyn
        for effort in Effort:
            rows = [row for row in able if row.effort is effort]
            best = min(rows, key=lambda row: row.run.k_dyn, default=None)
            if best is not None and best.run.k_dyn < (1.0 - SAME) * lowest:
                found.append(best)
                lowest = best.run.k_dyn
        return sorted(dict.fromkeys(found), key=lambda row: (row.effort.order, -row.run.k_dyn))

    def summary(self) -> dict[str, Any]:
        """As plain data."""
        candidates = [
            {
                "controller": row.name,
                "effort": row.effort.value,
                "worst_k_dyn": self.worst(row),
                "realisable": row in self._able,
                "ordinary": row.effort is Effort.RAMPS,
                "verdict": self.recommendation.verdict(row),
            }
            for row in self.comparison.rows
        ]
        named = {"chosen": self.chosen, "ordinary": self.ordinary}
        names = {key: row.name if row else None for key, row in named.items()}
        return {**self.recommendation.summary(), **names, "candidates": candidates}
