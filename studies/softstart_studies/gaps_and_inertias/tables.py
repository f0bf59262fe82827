"""What became of every controller, in numbers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from softstart.study import Table
from softstart_studies.gaps_and_inertias.cells import Grid

# name, prefix and suffix of the variables
WAYS = (("defaults", "", "_default"), ("tuned", "", ""), ("one set", "robust.", ""))


def tables(found: Sequence[Grid]) -> tuple[Table, ...]:
    """All tables, one kind of load after the other."""
    return tuple(table for grid in found for table in (_controllers(grid), *_cells(grid)))


def _controllers(grid: Grid) -> Table:
    """Each controller over the whole grid, and over its usual part."""
    core = grid.core()
    rows = []
    for name in grid.tunings:
        for way, prefix, suffix in WAYS:
            k = grid.values(name, f"{prefix}k_dyn{suffix}")
            ratio = grid.ratio(name, prefix, suffix)
            known = ratio[np.isfinite(ratio)]
            low, high = float(np.min(k[core])), float(np.max(k[core]))
            late = 0 if suffix else int(np.sum(grid.late(name, prefix)))
            rows.append(
                (
                    name, way, _number(np.mean(k)), _number(np.max(k)),
                    _number(np.mean(known)) if known.size else None,
                    _number(np.max(known)) if known.size else None,
                    _number(low), _number(high), _number(100.0 * (high / low - 1.0), 1), late,
                )
            )  # fmt: skip
    e = grid.extent
    return Table(
        f"{grid.kind} load, gaps {e.gaps[0]:g}-{e.gaps[-1]:g} rad, inertias {e.inertias[0]:g}-"
        f"{e.inertias[-1]:g} J1; core: gaps {e.core_gaps[0]:g}-{e.core_gaps[1]:g} rad, inertias "
        f"{e.core_inertias[0]:g}-{e.core_inertias[1]:g} J1",
        (
            "strategy", "gains", "K_dyn mean", "worst", "over optimum mean", "worst", "core least", "largest",
            "spread, %", "late cells",
        ),
        rows,
    )  # fmt: skip


def _cells(grid: Grid) -> list[Table]:
    """K_dyn in every cell, and how far it is from the optimum."""
    made = []
    for way, prefix, suffix in WAYS:
        for what, maps in (
            ("K_dyn", {name: grid.values(name, f"{prefix}k_dyn{suffix}") for name in grid.tunings}),
            ("K_dyn over optimum", {name: grid.ratio(name, prefix, suffix) for name in grid.tunings}),
        ):
            rows = [
                (gap, inertia, *(_number(values[i, j]) for values in maps.values()))
                for i, gap in enumerate(grid.extent.gaps)
                for j, inertia in enumerate(grid.extent.inertias)
            ]
            made.append(Table(f"{grid.kind} load, {way}: {what}", ("gap, rad", "J2/J1", *maps), rows))
    return made


def _number(value: Any, digits: int = 3) -> float | None:
    return round(float(value), digits) if np.isfinite(value) else None
