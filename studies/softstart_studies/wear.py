"""What wear does to a start: one drive, its gap from new to worn, under every controller.

The drive is the crane drive of [G], target speed 60 rad/s, torque lag 2 ms (assumed), encoder of 4096 lines.
Each controller has four kinds of gains. *Defaults*: set up for the new drive, nothing tuned. *Fixed*: tuned
for the new drive. *One set*: tuned for the worst case over the life, set up for the new drive. *Scheduled*:
tuned for several gaps and interpolated by the gap that somebody has measured. None may be slower than the
defaults where it was tuned.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from softstart import Controller, Drive, MachineTable, machine_table, simulate
from softstart.arrays import Vector
from softstart.controller import make_controller
from softstart.study import Claim, Progress, Study, StudyResult, Table, Verdict
from softstart.tuning.outcome import Tuning
from softstart.views.drawing import GREY, decade_ticks, drawing, entitle, panels
from softstart_studies.crane import WITH_INVERTER, draw_lines, mean_and_most, published
from softstart_studies.tuned_alike import Front, front, tuned, tuned_controllers

if TYPE_CHECKING:
    from matplotlib.figure import Figure

NEW = 0.5  # rad, [G]; the widest gap of [G], 2 rad, is half way through this life
GAINS = ("defaults", "fixed", "one set", "scheduled")
HELD = 1.05  # K_dyn at the end of life over that of the new drive, up to which gains count as holding
MOST = 6.0  # K_dyn shown at the most


@dataclass(frozen=True)
class Extent:
    """The life, where the schedule has its cells, the effort."""

    life: tuple[float, ...] = tuple(np.geomspace(NEW, 8 * NEW, 7).tolist())
    scheduled: tuple[float, ...] = (NEW, 2 * NEW, 4 * NEW, 8 * NEW)
    restarts: int = 2
    generations: int = 20
    controllers: tuple[str, ...] | None = None  # None: all that can be tuned
    front_points: int = 8  # optima from the quickest to the slowest start of each gap; between, interpolated


@dataclass(frozen=True)
class Course:
    """K_dyn and start time over the life; K_dyn over the least of any start in the same time, NaN without."""

    k_dyn: Vector
    start_time: Vector
    ratio: Vector


@dataclass(frozen=True)
class Life:
    """All courses, by controller and gains."""

    extent: Extent
    gaps: Vector
    direct: Vector  # K_dyn
    courses: Mapping[str, Mapping[str, Course]]
    fronts: Sequence[Front]

    def largest(self, gains: str) -> dict[str, float]:
        """The largest K_dyn of the life, by controller."""
        return {name: float(np.max(ways[gains].k_dyn)) for name, ways in self.courses.items()}


def live(extent: Extent, progress: Progress) -> Life:
    """All starts of all lives."""
    drive, effort = WITH_INVERTER, (extent.restarts, extent.generations)
    names = extent.controllers or tuned_controllers()
    tunings = tuned(drive, names, extent.scheduled, [float(drive.J2)], *effort, progress)
    gaps = np.array(extent.life)
    worn = machine_table(drive, gap=gaps)
    starts = {}
    for name, tuning in tunings.items():
        progress(f"{name}: starts over the life")
        assert tuning.robust is not None
        ways = (published(name), _fixed(tuning), tuning.robust.controller)
        starts[name] = [_starts(worn, made, drive) for made in ways] + [_starts(worn, tuning.scheduled, None)]
    fronts = []
    for i, one in enumerate(worn.elements()):
        progress(f"optima at gap {one.gap:.3g} rad")
        own = [times[i] for ways in starts.values() for _, times in ways]
        fronts.append(front(one, own, extent.front_points))

    def course(k: Vector, times: Vector) -> Course:
        return Course(k, times, k / np.array([one.at(t) for one, t in zip(fronts, times, strict=True)]))

    courses = {
        name: dict(zip(GAINS, (course(*one) for one in ways), strict=True)) for name, ways in starts.items()
    }
    return Life(extent, gaps, _starts(worn, make_controller("direct"), None)[0], courses, fronts)


def _fixed(tuning: Tuning) -> Controller:
    """The controller with the gains of the new drive."""
    assert tuning.schedule is not None
    cell = tuning.schedule.isel(gap=0, load_inertia=0)
    gains: dict[str, Any] = {one.name: float(cell[one.name]) for one in tuning.problem.ranges}
    return published(tuning.controller, **gains)


def _starts(worn: MachineTable, controller: Controller, fitted_to: Drive | None) -> tuple[Vector, Vector]:
    found = simulate(worn, controller, fitted_to=fitted_to)
    return np.asarray(found.k_dyn), np.asarray(found.start_time)


# table ---------------------------------------------------------------------------------------------------


def table(found: Life) -> Table:
    """From new to worn."""
    rows = [
        (name, gains, *one.k_dyn[[0, -1]], one.k_dyn.max(), *one.start_time[[0, -1]],
         *mean_and_most(one.ratio))
        for name, ways in found.courses.items()
        for gains, one in ways.items()
    ]  # fmt: skip
    columns = ("strategy", "gains", "K_dyn new", "K_dyn worn", "K_dyn largest", "start time new, s",
               "start time worn, s", "over optimum mean", "over optimum largest")  # fmt: skip
    return Table(f"From {found.gaps[0]:g} to {found.gaps[-1]:g} rad of gap", columns, rows)


# claims --------------------------------------------------------------------------------------------------


def fixed_gains_hold(found: Life) -> Claim:
    """The largest K_dyn of the life over that of the new drive."""
    worse = {
        name: largest / float(found.courses[name]["fixed"].k_dyn[0])
        for name, largest in found.largest("fixed").items()
    }
    listed = ", ".join(f"{name} {worse[name]:.2f}" for name in sorted(worse, key=worse.__getitem__))
    return Claim(
        "Gains tuned for the new drive serve it for life.",
        Verdict.of(*(factor <= HELD for factor in worse.values())),
        f"Largest K_dyn of the life over that of the new drive: {listed}.",
    )


def a_schedule_pays(found: Life) -> Claim:
    """At the end of life, among the starts that are in time."""
    fixed, scheduled = found.largest("fixed"), found.largest("scheduled")
    changes = (f"{name} {fixed[name]:.2f} to {scheduled[name]:.2f}" for name in fixed)
    return Claim(
        "A schedule over a measured gap lowers the worst K_dyn of the life.",
        Verdict.of(*(fixed[name] / scheduled[name] > HELD for name in fixed)),
        f"Largest K_dyn, fixed gains against scheduled ones: {'; '.join(changes)}.",
    )


def one_set_suffices(found: Life) -> Claim:
    """Over the optimum, the gap unknown."""
    largest = {name: mean_and_most(ways["one set"].ratio)[1] for name, ways in found.courses.items()}
    best = min((name for name in largest if np.isfinite(largest[name])), key=largest.__getitem__)
    k = found.courses[best]["one set"].k_dyn
    return Claim(
        "There is a controller whose one set of gains stays within 10 % of the optimum for life, the gap "
        "unknown.",
        Verdict.of(largest[best] < 1.1),
        f"Nearest is {best}: K_dyn {np.min(k):.3f} to {np.max(k):.3f}, at most {largest[best]:.3f} times "
        "the least K_dyn of any start in the same time.",
    )


# figures and the study -----------------------------------------------------------------------------------


def life_figure(found: Life, over: bool) -> Figure:
    """K_dyn over the gap, or its ratio to the optimum; a panel per controller, a line per kind of gains."""
    label = "$K_{dyn}$ / optimum" if over else "$K_{dyn}$"
    note = "optimum: in the start's own time, lag-free" if over else "dotted: direct"
    with drawing():
        figure, axes = panels(len(found.courses), (3.6, 2.5), 3, "gap, rad", label)
        for panel, (name, ways) in zip(axes, found.courses.items(), strict=True):
            lines = {gains: (found.gaps, one.ratio if over else one.k_dyn) for gains, one in ways.items()}
            draw_lines(panel, lines, name, panel.get_xlabel(), panel.get_ylabel())
            if not over:
                panel.plot(found.gaps, found.direct, color=GREY, lw=1.0, ls=":")
            panel.set_xscale("log")
            panel.set_xticks(found.extent.scheduled, [f"{gap:g}" for gap in found.extent.scheduled])
            panel.minorticks_off()
        axes[0].set_ylim(0.95 if over else 0.8, MOST)
        if over:
            axes[0].set_yscale("log")
            decade_ticks(axes[0].yaxis)
        axes[0].legend(loc="upper left")
        entitle(figure, f"{label} while the gap wears ({note})")
    return figure


class Wear(Study):
    """Every controller's K_dyn and start time over the life of the drive, against the optimum.

    >>> Wear.name, Wear.pictures
    ('wear', ('wear-life', 'wear-over-optimum'))
    """

    name: ClassVar[str] = "wear"
    title: ClassVar[str] = "The crane drive of [G] from new to worn, with fixed and with scheduled gains"
    pictures: ClassVar[tuple[str, ...]] = ("wear-life", "wear-over-optimum")

    def run(self, out: Path | None, progress: Progress) -> StudyResult:
        """All of it; nothing is written beyond tables and pictures."""
        return present(live(Extent(), progress), progress)


def present(found: Life, progress: Progress) -> StudyResult:
    """Tables, claims and figures of what was found."""
    progress("drawing")
    claims = fixed_gains_hold(found), a_schedule_pays(found), one_set_suffices(found)
    return Wear.result((table(found),), claims, (life_figure(found, False), life_figure(found, True)))
