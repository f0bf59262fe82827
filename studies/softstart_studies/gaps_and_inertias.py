"""Which controller, over all gaps and load inertias that a machine may have: all of them tuned alike.

The drive is the crane drive of [G], target speed 60 rad/s, torque lag 2 ms (assumed), encoder of 4096 lines.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from softstart.study import Claim, Progress, Study, StudyResult, Table, Verdict
from softstart.tuning.outcome import Tuning
from softstart.views.drawing import colour_scale, drawing, heat_map
from softstart_studies.tuned_alike import (
    ACROSS,
    CRANE,
    Front,
    front,
    panel_grid,
    rounded,
    tuned,
    tuned_controllers,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure


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


Map = NDArray[np.float64]  # one row per gap, one column per load inertia
BETTER = 1e-9


@dataclass(frozen=True)
class Grid:
    """One kind of load: all tunings, and the optima of each cell."""

    kind: str
    extent: Extent
    tunings: dict[str, Tuning]
    fronts: list[list[Front]]

    def core(self) -> Any:
        """The cells for which spreads are named, as a mask."""
        e = self.extent
        rows = [e.core_gaps[0] <= gap <= e.core_gaps[1] for gap in e.gaps]
        columns = [e.core_inertias[0] <= inertia <= e.core_inertias[1] for inertia in e.inertias]
        return np.outer(rows, columns)

    def values(self, name: str, what: str) -> Map:
        """A map of one controller: a variable of its schedule, or of the cells of its robust set."""
        tuning = self.tunings[name]
        table, _, variable = what.rpartition(".")
        assert tuning.schedule is not None
        assert tuning.robust is not None
        source = tuning.robust.cells if table == "robust" else tuning.schedule
        return np.asarray(source[variable], dtype=np.float64)

    def ratio(self, name: str, prefix: str = "", suffix: str = "") -> Map:
        """K_dyn over the least K_dyn of any start in the same time; NaN where there is no such start."""
        k, times = (self.values(name, f"{prefix}{what}{suffix}") for what in ("k_dyn", "start_time"))
        least = [
            [front.at(time) for front, time in zip(row, own, strict=True)]
            for row, own in zip(self.fronts, times, strict=True)
        ]
        return np.asarray(k / np.array(least))

    def late(self, name: str, prefix: str = "") -> Any:
        """Where a start is slower than with the defaults."""
        return self.values(name, f"{prefix}excess") > 0.0

    def never_worse(self, name: str) -> bool:
        """Whether every cell is at least as gentle and as quick as with the defaults."""
        k, k_default = self.values(name, "k_dyn"), self.values(name, "k_dyn_default")
        return bool(np.all(~self.late(name) & (k <= k_default * (1.0 + BETTER))))


def grids(extent: Extent, progress: Progress) -> list[Grid]:
    """One for each kind of load."""
    names = extent.controllers or tuned_controllers()
    found = []
    for kind in extent.kinds:
        drive = CRANE.replace(load_kind=kind, name=f"Crane of [G], {kind} load")
        inertias = [ratio * float(drive.J1) for ratio in extent.inertias]
        report = _prefixed(progress, kind)
        tunings = tuned(drive, names, extent.gaps, inertias, extent.restarts, extent.generations, report)
        grid = Grid(kind, extent, tunings, [])
        for i, gap in enumerate(extent.gaps):
            row = []
            for j, J2 in enumerate(inertias):
                report(f"optima at gap {gap:g} rad, J2 = {extent.inertias[j]:g} J1")
                times = [
                    float(grid.values(name, what)[i, j])
                    for name in names
                    for what in (
                        "start_time_default",
                        "start_time",
                        "robust.start_time_default",
                        "robust.start_time",
                    )
                ]
                row.append(front(drive.replace(gap=gap, load_inertia=J2), times, extent.front_points))
            grid.fronts.append(row)
        found.append(grid)
    return found


def _prefixed(progress: Progress, what: str) -> Progress:
    return lambda text: progress(f"{what} load, {text}")


# name, prefix and suffix of the variables
GAINS = (("defaults", "", "_default"), ("tuned", "", ""), ("one set", "robust.", ""))


def tables(found: Sequence[Grid]) -> tuple[Table, ...]:
    """All tables, one kind of load after the other."""
    return tuple(table for grid in found for table in (_controllers(grid), *_cells(grid)))


def _controllers(grid: Grid) -> Table:
    """Each controller over the whole grid, and over its usual part."""
    core = grid.core()
    rows = []
    for name in grid.tunings:
        for way, prefix, suffix in GAINS:
            k = grid.values(name, f"{prefix}k_dyn{suffix}")
            ratio = grid.ratio(name, prefix, suffix)
            known = ratio[np.isfinite(ratio)]
            low, high = float(np.min(k[core])), float(np.max(k[core]))
            late = 0 if suffix else int(np.sum(grid.late(name, prefix)))
            rows.append(
                (
                    name, way, rounded(np.mean(k)), rounded(np.max(k)),
                    rounded(np.mean(known)) if known.size else None,
                    rounded(np.max(known)) if known.size else None,
                    rounded(low), rounded(high), rounded(100.0 * (high / low - 1.0), 1), late,
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
    for way, prefix, suffix in GAINS:
        for what, maps in (
            ("K_dyn", {name: grid.values(name, f"{prefix}k_dyn{suffix}") for name in grid.tunings}),
            ("K_dyn over optimum", {name: grid.ratio(name, prefix, suffix) for name in grid.tunings}),
        ):
            rows = [
                (gap, inertia, *(rounded(values[i, j]) for values in maps.values()))
                for i, gap in enumerate(grid.extent.gaps)
                for j, inertia in enumerate(grid.extent.inertias)
            ]
            made.append(Table(f"{grid.kind} load, {way}: {what}", ("gap, rad", "J2/J1", *maps), rows))
    return made


INVARIANT = 5.0  # percent of spread that still counts as invariant
DELAY, FEEDBACK = "acceleration-delay", "current-limit-feedback"


def claims(found: Sequence[Grid]) -> tuple[Claim, ...]:
    """All claims."""
    made = [never_worse(found), nearest(found)]
    if all(FEEDBACK in grid.tunings for grid in found):
        made.append(feedback_is_invariant(found))
    if all(DELAY in grid.tunings for grid in found):
        made.append(delay_holds(found))
    return tuple(made)


def never_worse(found: Sequence[Grid]) -> Claim:
    """In every cell, for every controller."""
    worse = [f"{name} ({grid.kind})" for grid in found for name in grid.tunings if not grid.never_worse(name)]
    cells = sum(grid.core().size * len(grid.tunings) for grid in found)
    return Claim(
        "Tuned for a cell, no controller is harder or slower there than with its defaults.",
        Verdict.REFUTED if worse else Verdict.CONFIRMED,
        f"{cells} cells and controllers compared. Worse: {', '.join(worse) or 'none'}.",
    )


def nearest(found: Sequence[Grid]) -> Claim:
    """Which controller comes nearest to the optimum within the same time, gap and load unknown."""
    said, best = [], set()
    for grid in found:
        means = {}
        for name in grid.tunings:
            ratio = grid.ratio(name, "robust.")
            if np.isfinite(ratio).any():
                means[name] = float(np.mean(ratio[np.isfinite(ratio)]))
        order = sorted(means, key=means.__getitem__)
        best.add(order[0])
        listed = ", ".join(f"{name} {means[name]:.2f}" for name in order)
        said.append(f"{grid.kind} load: {listed}")
    one = len(best) == 1
    return Claim(
        "With one set of gains, one controller is nearest to the optimum on every kind of load tried.",
        Verdict.CONFIRMED if one else Verdict.REFUTED,
        f"Mean over the grid of K_dyn over the least K_dyn of any start in the same time: {'; '.join(said)}.",
    )


def feedback_is_invariant(found: Sequence[Grid]) -> Claim:
    """[G]'s best: a regulator on the current limit."""
    said, spreads = [], []
    for grid in found:
        inside = grid.values(FEEDBACK, "robust.k_dyn")[grid.core()]
        spread = 100.0 * (float(np.max(inside)) / float(np.min(inside)) - 1.0)
        spreads.append(spread)
        others = {}
        for name in grid.tunings:
            k = grid.values(name, "robust.k_dyn")[grid.core()]
            others[name] = 100.0 * (float(np.max(k)) / float(np.min(k)) - 1.0)
        least = min(others, key=others.__getitem__)
        said.append(
            f"{grid.kind} load: K_dyn {np.min(inside):.3f} to {np.max(inside):.3f}, {spread:.0f} % apart "
            f"(smallest spread of all: {least}, {others[least]:.0f} %)"
        )
    return Claim(
        "Regulators acting on the current-limit level are invariant to the gap and the other mechanical "
        "parameters.",
        Verdict.CONFIRMED if max(spreads) < INVARIANT else Verdict.REFUTED,
        f"One set of gains, tuned for the worst case, {_core(found[0])}: {'; '.join(said)}.",
    )


def delay_holds(found: Sequence[Grid]) -> Claim:
    """[G]: acceleration and delay fit where the elastic frequency stays within 10-20 %."""
    said, gains = [], []
    for grid in found:
        own, one = grid.values(DELAY, "k_dyn")[grid.core()], grid.values(DELAY, "robust.k_dyn")[grid.core()]
        gains.append(float(np.max(one / own)))
        said.append(
            f"{grid.kind} load: tuned for each cell {np.min(own):.3f} to {np.max(own):.3f}, one set "
            f"{np.min(one):.3f} to {np.max(one):.3f}"
        )
    ratio = np.sqrt(
        (1.0 + 1.0 / found[0].extent.core_inertias[0]) / (1.0 + 1.0 / found[0].extent.core_inertias[1])
    )
    return Claim(
        "Torque reduced until the acceleration drops, then for a delay, fits where the elastic frequency "
        "stays within 10-20 %.",
        Verdict.CONFIRMED if max(gains) < 1.2 else Verdict.PARTLY,
        f"{_core(found[0])}, over which the elastic frequency changes by {100 * (ratio - 1):.0f} %: "
        f"{'; '.join(said)}. Not knowing the cell costs a factor of up to {max(gains):.2f}.",
    )


def _core(grid: Grid) -> str:
    e = grid.extent
    return (
        f"gaps {e.core_gaps[0]:g}-{e.core_gaps[1]:g} rad and inertias "
        f"{e.core_inertias[0]:g}-{e.core_inertias[1]:g} J1"
    )


MOST = 3.0  # ratio from which on all colours are the same


def maps_figure(grid: Grid, prefix: str, heading: str) -> Figure:
    """K_dyn of every controller over its optimum; `heading` says which gains."""
    panels = [(name, grid.ratio(name, prefix), grid.late(name, prefix)) for name in grid.tunings]
    finite = np.concatenate([values[np.isfinite(values)] for _, values, _ in panels])
    scale = colour_scale(np.array([1.0, min(float(np.max(finite, initial=1.1)), MOST)]))
    ratios, gaps = ([f"{v:g}" for v in axis] for axis in (grid.extent.inertias, grid.extent.gaps))
    with drawing():
        figure, axes = panel_grid(len(panels), (3.0, 2.2))
        for panel, (name, values, late) in zip(axes.flat, panels, strict=False):
            heat_map(panel, ratios, gaps, values, scale, decimals=2, struck=late & np.isfinite(values))
            panel.set_title(name, loc="left")
        for row in axes:
            row[0].set_ylabel("gap, rad")
        for panel in axes.flat[max(0, len(panels) - ACROSS) : len(panels)]:
            panel.set_xlabel("J2/J1")
        figure.suptitle(
            f"$K_{{dyn}}$ over the optimum in the same time, {grid.kind} load, {heading} "
            "(struck through: slower than the defaults)",
            x=0.01, ha="left", fontsize=11,
        )  # fmt: skip
    return figure  # type: ignore[no-any-return]


class GapsAndInertias(Study):
    """Every controller tuned for each cell of the grid, and with one set for all.

    >>> GapsAndInertias.name, len(GapsAndInertias.pictures)
    ('gaps-and-inertias', 2)
    """

    name: ClassVar[str] = "gaps-and-inertias"
    title: ClassVar[str] = "All controllers tuned alike over gaps and load inertias of the crane drive of [G]"
    pictures: ClassVar[tuple[str, ...]] = tuple(
        f"gaps-and-inertias-{kind}-{which}" for kind in Extent().kinds for which in ("cells", "one-set")
    )

    def run(self, out: Path | None, progress: Progress) -> StudyResult:
        """All of it; `out` receives each controller's schedule (CSV) and robust set (TOML)."""
        found = grids(Extent(), progress)
        if out is not None:
            for grid in found:
                for name, tuning in grid.tunings.items():
                    tuning.to_csv(out / f"{grid.kind}-{name}-schedule.csv")
                    tuning.to_toml(out / f"{grid.kind}-{name}-robust.toml", "robust")
        return present(found, progress)


def present(found: Sequence[Grid], progress: Progress) -> StudyResult:
    """Tables, claims and figures of what was found."""
    progress("drawing")
    figures = {}
    for grid in found:
        stem = f"gaps-and-inertias-{grid.kind}"
        figures[f"{stem}-cells"] = maps_figure(grid, "", "tuned for each cell")
        figures[f"{stem}-one-set"] = maps_figure(grid, "robust.", "one set for all cells")
    return StudyResult(tables=tables(found), claims=claims(found), figures=figures)
