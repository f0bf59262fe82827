"""What became of every controller, in numbers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from softstart.study import Table
from softstart_studies.gaps_and_inertias.cells import Grid


def tables(found: Sequence[Grid]) -> tuple[Table, ...]:
    """All tables, one kind of load after the other."""
    return tuple(table for grid in found for table in (_controllers(grid), _core(grid), *_cells(grid)))


def _controllers(grid: Grid) -> Table:
    """Each controller over the whole grid."""
    rows = []
    for name in grid.tunings:
        default, own = grid.values(name, "k_dyn_default"), grid.values(name, "k_dyn")
        one = grid.values(name, "robust.k_dyn")
        rows.append(
            (
                name,
                _number(np.max(default)), _number(np.mean(default)), _share(grid.defaults_in_time(name)),
                _number(np.max(own)), _number(np.mean(own)), _share(grid.in_time(name)),
                _number(np.nanmean(own / grid.optimum)),
                _number(np.max(one)), _number(np.mean(one)), _share(grid.in_time(name, "robust.")),
            )
        )  # fmt: skip
    return Table(
        f"{grid.kind} load: controllers over {_extent(grid)}",
        (
            "strategy", "defaults: worst K_dyn", "mean", "cells in time",
            "tuned per cell: worst K_dyn", "mean", "cells in time", "mean K_dyn / optimum",
            "one set: worst K_dyn", "mean", "cells in time",
        ),
        rows,
    )  # fmt: skip


def _core(grid: Grid) -> Table:
    """Least and largest K_dyn, and the spread, over the usual gaps and inertias."""
    core = grid.core()
    rows = []
    for name in grid.tunings:
        cells: list[Any] = []
        for what in ("k_dyn_default", "k_dyn", "robust.k_dyn"):
            inside = grid.values(name, what)[core]
            low, high = float(np.min(inside)), float(np.max(inside))
            cells += [_number(low), _number(high), _number(100.0 * (high / low - 1.0), 1)]
        late = int(np.sum(~grid.in_time(name)[core]))
        rows.append((name, *cells, late))
    e = grid.extent
    return Table(
        f"{grid.kind} load: spread of K_dyn over gaps {e.core_gaps[0]:g}-{e.core_gaps[1]:g} rad and "
        f"inertias {e.core_inertias[0]:g}-{e.core_inertias[1]:g} J1",
        (
            "strategy", "defaults: least", "largest", "spread, %", "tuned per cell: least", "largest",
            "spread, %", "one set: least", "largest", "spread, %", "cells too late, tuned per cell",
        ),
        rows,
    )  # fmt: skip


def _cells(grid: Grid) -> tuple[Table, Table]:
    """K_dyn in every cell: tuned for it, and under one set."""
    e = grid.extent
    columns = (
        "gap, rad", "J2/J1", "start time allowed, s", "optimum", "lower bound", *grid.tunings,
    )  # fmt: skip
    made = []
    for title, prefix in (("tuned for the cell", ""), ("one set for all", "robust.")):
        rows = []
        for i, gap in enumerate(e.gaps):
            for j, inertia in enumerate(e.inertias):
                values = [
                    _marked(grid.values(name, f"{prefix}k_dyn")[i, j], grid.in_time(name, prefix)[i, j])
                    for name in grid.tunings
                ]
                known = (grid.bound[i, j], grid.optimum[i, j], grid.optimum_bound[i, j])
                rows.append((gap, inertia, *(_number(v, 4) for v in known), *values))
        made.append(Table(f"{grid.kind} load: K_dyn {title} (in brackets: too late)", columns, rows))
    return made[0], made[1]


def _extent(grid: Grid) -> str:
    e = grid.extent
    return (
        f"gaps {e.gaps[0]:g}-{e.gaps[-1]:g} rad and inertias {e.inertias[0]:g}-{e.inertias[-1]:g} J1, "
        f"start time at most {e.start_time} that of direct"
    )


def _number(value: Any, digits: int = 3) -> float | None:
    return round(float(value), digits) if np.isfinite(value) else None


def _share(cells: Any) -> str:
    return f"{int(np.sum(cells))} of {cells.size}"


def _marked(value: float, in_time: bool) -> str:
    if not np.isfinite(value):
        return "-"
    return f"{value:.3f}" if in_time else f"({value:.3f})"
