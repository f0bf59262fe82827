"""The least K_dyn through several gaps: the chain of four masses, its two-mass drive, and the strategies.

The chain is `crane-4-mass` with a damping ratio of 2 % in each shaft. The start times go from long to short;
each optimum is one more first demand for the next one.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar

from softstart import Drive, optimize, simulate
from softstart.chain import Chain, reduce_chain
from softstart.controller import ready_controller_names
from softstart.optimal.result import InfeasibleError, Optimum, OptimumError
from softstart.study import Claim, Progress, Study, StudyResult, Table, Verdict
from softstart.views.drawing import drawing, mark_points, new_figure
from softstart_studies.crane import draw_lines

RATIO = 0.02  # of each shaft
REPLAYED = 1e-6


def chain(ratio: float = RATIO) -> Chain:
    """The crane with four masses, damped.

    >>> chain().shafts[0].damping_ratio
    0.02
    """
    crane = Chain.load("crane-4-mass")
    return replace(crane, shafts=tuple(one.replace(damping_ratio=ratio) for one in crane.shafts))


@dataclass(frozen=True)
class Extent:
    """What is computed."""

    start_times: tuple[float, ...] = (0.40, 0.42, 0.44, 0.47, 0.52, 0.60)
    strategies: tuple[str, ...] | None = None  # None: all that need no parameter


@dataclass(frozen=True)
class Row:
    """One start time: the optimum of the chain, and that of its two-mass drive."""

    start_time: float
    best: Optimum
    two_masses: Optimum | None


@dataclass(frozen=True)
class Findings:
    """All rows, and the strategies on the chain."""

    rows: tuple[Row, ...]
    runs: tuple[Any, ...]


def find(extent: Extent, progress: Progress) -> Findings:
    """All of it."""
    machine = chain()
    drive = reduce_chain(machine).to_drive()
    rows: list[Row] = []
    for t in sorted(extent.start_times, reverse=True):
        progress(f"start time {t:g} s")
        best = optimize(machine, t, near=rows[-1].best if rows else None)
        rows.append(Row(t, best, _two_masses(drive, t)))
    rows.reverse()
    names = ready_controller_names() if extent.strategies is None else extent.strategies

    return Findings(tuple(rows), tuple(simulate(machine, name) for name in names))


def _two_masses(drive: Drive, start_time: float) -> Optimum | None:
    with suppress(InfeasibleError, OptimumError):
        return optimize(drive, start_time, terminal="reached")
    return None


def table(found: Findings) -> Table:
    """K_dyn over start time."""
    two = [row.two_masses for row in found.rows]
    return Table.of("Least K_dyn of all shafts", {
        "start time, s": [row.start_time for row in found.rows],
        "chain": [row.best.k_dyn for row in found.rows],
        "momentum bound, chain": [row.best.bound.k_dyn for row in found.rows],
        "two masses": [one.k_dyn if one else None for one in two],
        "bound, two masses": [one.bound.k_dyn if one else None for one in two],
        "contacts": [row.best.run.contacts for row in found.rows],
    })  # fmt: skip


def strategies(found: Findings) -> Table:
    """The strategies on the chain."""
    rows = sorted(found.runs, key=lambda run: run.k_dyn)
    cells = [(run.controller_name, run.k_dyn, run.start_time) for run in rows]
    return Table("Strategies on the chain", ("strategy", "K_dyn", "start time, s"), cells)


def claims(found: Findings) -> list[Claim]:
    """What the table says."""
    rows = found.rows
    pairs = [(row, run) for row in rows for run in found.runs]
    beaten = sum(run.start_time <= row.start_time and run.k_dyn < row.best.k_dyn for row, run in pairs)
    least = min(found.runs, key=lambda run: run.k_dyn)
    replayed = max(abs(row.best.claimed / row.best.k_dyn - 1.0) for row in rows)
    dearer = [row.best.k_dyn / row.two_masses.k_dyn - 1.0 for row in rows if row.two_masses is not None]
    return [
        Claim(
            "No strategy that is as quick is gentler than the start found.",
            Verdict.of(beaten == 0),
            f"{beaten} of {len(pairs)} comparisons say otherwise; the gentlest strategy of all, "
            f"{least.controller_name}, has {least.k_dyn:.3f} in {least.start_time:.4g} s.",
        ),
        Claim(
            "What is claimed is what the exact chain does.",
            Verdict.of(replayed <= REPLAYED),
            f"Claim and replay differ by {replayed:.1e} of K_dyn at most.",
        ),
        Claim(
            "Two masses promise less than several gaps allow.",
            Verdict.of(*(one > 0.0 for one in dearer)),
            f"The chain needs {100.0 * min(dearer):.1f} to {100.0 * max(dearer):.1f} % more K_dyn than its "
            "two-mass drive in the same time."
            if dearer
            else "The two-mass drive has no start at these times.",
        ),
    ]


def figure(found: Findings) -> Any:
    """K_dyn over start time: chain, bound, two masses, strategies."""
    rows = found.rows
    two = [(row.start_time, row.two_masses.k_dyn) for row in rows if row.two_masses is not None]
    times = [row.start_time for row in rows]
    lines = {
        "chain, best found": (times, [row.best.k_dyn for row in rows]),
        "its two-mass drive": ([time for time, _ in two], [k for _, k in two]),
        "momentum bound of the chain": (times, [row.best.bound.k_dyn for row in rows]),
    }
    with drawing():
        drawn, axes = new_figure(1, 1, (7.0, 4.5))
        title = "Crane with four masses, three gaps, damping ratio 2 %"
        draw_lines(axes, lines, title, "start time, s", "K_dyn", markers=("o", "s", ""))
        shown = [run for run in found.runs if run.start_time <= 1.1 * times[-1]]
        axes.set_yscale("log")
        axes.set_yticks([0.7, 1.0, 1.5, 2.0, 3.0, 4.0], ["0.7", "1", "1.5", "2", "3", "4"])
        axes.minorticks_off()
        mark_points(axes, [(run.controller_name, run.start_time, run.k_dyn) for run in shown])
    return drawn


class SeveralGaps(Study):
    """The optimum through several gaps."""

    name: ClassVar[str] = "several-gaps"
    title: ClassVar[str] = "The gentlest start through several gaps: a chain and its two-mass drive"
    pictures: ClassVar[tuple[str, ...]] = ("several-gaps",)

    def __init__(self, extent: Extent | None = None) -> None:
        self.extent = extent or Extent()

    def run(self, out: Path | None, progress: Progress) -> StudyResult:
        """Search, replay, compare."""
        found = find(self.extent, progress)
        if out is not None:
            for row in found.rows:
                row.best.profile.to_csv(out / f"profile-{row.start_time:g}.csv")
        return self.result([table(found), strategies(found)], claims(found), [figure(found)])
