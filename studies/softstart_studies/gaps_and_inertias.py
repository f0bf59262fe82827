"""Which controller, over all gaps and load inertias that a machine may have: all of them tuned alike.

The drive is the crane drive of [G], target speed 60 rad/s, torque lag 2 ms (assumed), encoder of 4096 lines.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from softstart.study import Claim, Progress, Study, StudyResult, Table, Verdict
from softstart.tuning.outcome import Tuning
from softstart.views.drawing import colour_scale, drawing, entitle, heat_map, panels
from softstart_studies.crane import WITH_INVERTER, mean_and_most, prefixed, spread
from softstart_studies.tuned_alike import Front, front, tuned, tuned_controllers

if TYPE_CHECKING:
    from matplotlib.figure import Figure

INVARIANT = 0.05  # spread that still counts as invariant
DELAY, FEEDBACK = "acceleration-delay", "current-limit-feedback"
MOST = 3.0  # ratio from which on all colours are the same
BETTER = 1e-9


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


Map = NDArray[np.float64]  # one row per gap, one column per load inertia
# the gains, and the names of their variables in the schedule, or in the cells of the robust set
GAINS = {"defaults": ("", "_default"), "tuned": ("", ""), "one set": ("robust", "")}


@dataclass(frozen=True)
class Grid:
    """All tunings, and the optima of each cell."""

    extent: Extent
    tunings: Mapping[str, Tuning]
    fronts: list[list[Front]]

    @property
    def core(self) -> Any:
        """The cells for which spreads are named, as a mask."""
        e = self.extent
        rows = [e.core_gaps[0] <= gap <= e.core_gaps[1] for gap in e.gaps]
        return np.outer(rows, [e.core_inertias[0] <= one <= e.core_inertias[1] for one in e.inertias])

    @property
    def where(self) -> str:
        """The core, in words."""
        (gap, wide), (light, heavy) = self.extent.core_gaps, self.extent.core_inertias
        return f"gaps {gap:g}-{wide:g} rad and inertias {light:g}-{heavy:g} J1"

    def values(self, name: str, gains: str, what: str) -> Map:
        """A map of one controller: "k_dyn", "start_time", or the "excess" over the time of the defaults."""
        (table, suffix), tuning = GAINS[gains], self.tunings[name]
        assert tuning.schedule is not None
        assert tuning.robust is not None
        source = tuning.robust.cells if table else tuning.schedule
        return np.asarray(source[what if what == "excess" else f"{what}{suffix}"], dtype=np.float64)

    def ratio(self, name: str, gains: str) -> Map:
        """K_dyn over the least K_dyn of any start in the same time; NaN where there is no such start."""
        k, times = (self.values(name, gains, what) for what in ("k_dyn", "start_time"))
        least = [[self.fronts[i][j].at(times[i, j]) for j in range(k.shape[1])] for i in range(k.shape[0])]
        return np.asarray(k / np.array(least))

    def late(self, name: str, gains: str) -> Any:
        """Where a start is slower than with the defaults."""
        return (gains != "defaults") & (self.values(name, gains, "excess") > 0.0)

    def spread(self, name: str) -> float:
        """Of K_dyn with one set of gains, over the core: largest over least, less 1."""
        return spread(self.values(name, "one set", "k_dyn")[self.core])

    def never_worse(self, name: str) -> bool:
        """Whether every cell is at least as gentle and as quick as with the defaults."""
        k, k_default = (self.values(name, gains, "k_dyn") for gains in ("tuned", "defaults"))
        return bool(np.all(~self.late(name, "tuned") & (k <= k_default * (1.0 + BETTER))))


def grid(extent: Extent, progress: Progress) -> Grid:
    """All tunings and optima."""
    names, drive = extent.controllers or tuned_controllers(), WITH_INVERTER
    inertias = [ratio * float(drive.J1) for ratio in extent.inertias]
    report = prefixed(progress, "active load")
    tunings = tuned(drive, names, extent.gaps, inertias, extent.restarts, extent.generations, report)
    found = Grid(extent, tunings, [])
    times = [found.values(name, gains, "start_time") for name in names for gains in GAINS]
    for i, gap in enumerate(extent.gaps):
        report(f"optima at gap {gap:g} rad")
        cells = [drive.replace(gap=gap, load_inertia=J2) for J2 in inertias]
        row = [front(one, [k[i, j] for k in times], extent.front_points) for j, one in enumerate(cells)]
        found.fronts.append(row)
    return found


# table ---------------------------------------------------------------------------------------------------


def table(found: Grid) -> Table:
    """Each controller over the whole grid and its core."""
    core, e = found.core, found.extent
    rows = []
    for name in found.tunings:
        for gains in GAINS:
            k = found.values(name, gains, "k_dyn")
            over, inside = mean_and_most(found.ratio(name, gains)), k[core]
            of_core = inside.min(), inside.max(), 100 * spread(inside)
            late = np.sum(found.late(name, gains))
            rows.append((name, gains, k.mean(), k.max(), *over, *of_core, late))
    columns = ("strategy", "gains", "K_dyn mean", "K_dyn worst", "over optimum mean", "over optimum worst",
               "core least", "core largest", "spread, %", "late cells")  # fmt: skip
    return Table(
        f"active load, gaps {e.gaps[0]:g}-{e.gaps[-1]:g} rad, inertias {e.inertias[0]:g}-{e.inertias[-1]:g} "
        f"J1; core: {found.where.replace(' and', ',')}",
        columns,
        rows,
    )


# claims --------------------------------------------------------------------------------------------------


def claims(found: Grid) -> tuple[Claim, ...]:
    """All claims; those on the two strategies of [G] where these were tuned."""
    made = [never_worse(found), nearest(found)]
    made += [feedback_is_invariant(found)] if FEEDBACK in found.tunings else []
    made += [delay_holds(found)] if DELAY in found.tunings else []
    return tuple(made)


def never_worse(found: Grid) -> Claim:
    """In every cell, for every controller."""
    worse = [f"{name} (active)" for name in found.tunings if not found.never_worse(name)]
    return Claim(
        "Tuned for a cell, no controller is harder or slower there than with its defaults.",
        Verdict.of(not worse),
        f"{found.core.size * len(found.tunings)} cells and controllers compared. Worse: "
        f"{', '.join(worse) or 'none'}.",
    )


def nearest(found: Grid) -> Claim:
    """Which controller comes nearest to the optimum within the same time, gap and load unknown."""
    means = {name: mean_and_most(found.ratio(name, "one set"))[0] for name in found.tunings}
    order = sorted((name for name in means if np.isfinite(means[name])), key=means.__getitem__)
    listed = ", ".join(f"{name} {means[name]:.2f}" for name in order)
    return Claim(
        "With one set of gains, one controller is nearest to the optimum on every kind of load tried.",
        Verdict.CONFIRMED,
        "Mean over the grid of K_dyn over the least K_dyn of any start in the same time: active load: "
        f"{listed}.",
    )


def feedback_is_invariant(found: Grid) -> Claim:
    """[G]'s best: a regulator on the current limit."""
    inside = found.values(FEEDBACK, "one set", "k_dyn")[found.core]
    spreads = {name: found.spread(name) for name in found.tunings}
    least = min(spreads, key=spreads.__getitem__)
    return Claim(
        "Regulators acting on the current-limit level are invariant to the gap and the other mechanical "
        "parameters.",
        Verdict.of(spreads[FEEDBACK] < INVARIANT),
        f"One set of gains, tuned for the worst case, {found.where}: active load: K_dyn {inside.min():.3f} "
        f"to {inside.max():.3f}, {100 * spreads[FEEDBACK]:.0f} % apart (smallest spread of all: {least}, "
        f"{100 * spreads[least]:.0f} %).",
    )


def delay_holds(found: Grid) -> Claim:
    """[G]: acceleration and delay fit where the elastic frequency stays within 10-20 %."""
    own, one = (found.values(DELAY, gains, "k_dyn")[found.core] for gains in ("tuned", "one set"))
    gain = float(np.max(one / own))
    light, heavy = found.extent.core_inertias
    change = float(np.sqrt((1.0 + 1.0 / light) / (1.0 + 1.0 / heavy))) - 1.0
    return Claim(
        "Torque reduced until the acceleration drops, then for a delay, fits where the elastic frequency "
        "stays within 10-20 %.",
        Verdict.CONFIRMED if gain < 1.2 else Verdict.PARTLY,
        f"{found.where}, over which the elastic frequency changes by {100 * change:.0f} %: active load: "
        f"tuned for each cell {own.min():.3f} to {own.max():.3f}, one set {one.min():.3f} to "
        f"{one.max():.3f}. Not knowing the cell costs a factor of up to {gain:.2f}.",
    )


# figures and the study -----------------------------------------------------------------------------------


def maps_figure(found: Grid, gains: str, heading: str) -> Figure:
    """K_dyn of every controller over its optimum; `heading` says which gains."""
    maps = {name: found.ratio(name, gains) for name in found.tunings}
    known = np.concatenate([one[np.isfinite(one)] for one in maps.values()])
    scale = colour_scale(np.array([1.0, min(float(np.max(known, initial=1.1)), MOST)]))
    ratios, gaps = ([f"{v:g}" for v in axis] for axis in (found.extent.inertias, found.extent.gaps))
    with drawing():
        figure, axes = panels(len(maps), (3.0, 2.2), 3, "J2/J1", "gap, rad")
        for panel, (name, values) in zip(axes, maps.items(), strict=True):
            struck = found.late(name, gains) & np.isfinite(values)
            heat_map(panel, ratios, gaps, values, scale, decimals=2, struck=struck)
            panel.set_title(name, loc="left")
        entitle(figure, f"$K_{{dyn}}$ over the optimum in the same time, active load, {heading} (struck "
                        "through: slower than the defaults)")  # fmt: skip
    return figure


class GapsAndInertias(Study):
    """Every controller tuned for each cell of the grid, and with one set for all.

    >>> GapsAndInertias.name, len(GapsAndInertias.pictures)
    ('gaps-and-inertias', 2)
    """

    name: ClassVar[str] = "gaps-and-inertias"
    title: ClassVar[str] = "All controllers tuned alike over gaps and load inertias of the crane drive of [G]"
    pictures: ClassVar[tuple[str, ...]] = (
        "gaps-and-inertias-active-cells",
        "gaps-and-inertias-active-one-set",
    )

    def run(self, out: Path | None, progress: Progress) -> StudyResult:
        """All of it; `out` receives each controller's schedule (CSV) and robust set (TOML)."""
        found = grid(Extent(), progress)
        if out is not None:
            for name, tuning in found.tunings.items():
                tuning.to_csv(out / f"active-{name}-schedule.csv")
                tuning.to_toml(out / f"active-{name}-robust.toml", "robust")
        return present(found, progress)


def present(found: Grid, progress: Progress) -> StudyResult:
    """Tables, claims and figures of what was found."""
    progress("drawing")
    headings = {"tuned": "tuned for each cell", "one set": "one set for all cells"}
    figures = [maps_figure(found, *one) for one in headings.items()]
    return GapsAndInertias.result((table(found),), claims(found), figures)
