"""How much of the study is worked out: all of it, or a part for a quick look."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

LoadKind = Literal["active", "reactive"]


@dataclass(frozen=True)
class Extent:
    """The grid, the bound on the start time, the effort.

    `core_gaps` and `core_inertias` are the part of the grid for which spreads are named.
    """

    gaps: tuple[float, ...] = (0.25, 0.5, 1.0, 2.0, 4.0)  # rad
    inertias: tuple[float, ...] = (1.0, 2.0, 3.0, 5.0, 10.0)  # in J1
    core_gaps: tuple[float, float] = (0.5, 2.0)
    core_inertias: tuple[float, float] = (2.0, 5.0)
    start_time: str = "1.5x"  # of that of direct in the same cell
    restarts: int = 3
    generations: int = 40
    controllers: tuple[str, ...] | None = None  # None: all that can be tuned
    kinds: tuple[LoadKind, ...] = ("reactive", "active")
