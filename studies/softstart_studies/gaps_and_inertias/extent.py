"""How much of the study is worked out: all of it, or a part for a quick look."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

LoadKind = Literal["active", "reactive"]


@dataclass(frozen=True)
class Extent:
    """The grid and the effort.

    `core_gaps` and `core_inertias` are the part of the grid for which spreads are named.
    """

    gaps: tuple[float, ...] = (0.25, 0.5, 1.0, 2.0, 4.0)  # rad
    inertias: tuple[float, ...] = (1.0, 2.0, 5.0, 10.0)  # in J1
    core_gaps: tuple[float, float] = (0.5, 2.0)
    core_inertias: tuple[float, float] = (2.0, 5.0)
    front_points: int = 6  # optima from the quickest to the slowest start of each cell; between, interpolated
    restarts: int = 2
    generations: int = 20
    controllers: tuple[str, ...] | None = None  # None: all that can be tuned
    kinds: tuple[LoadKind, ...] = ("active",)  # that of [G]; optima of reactive loads take ten times as long
