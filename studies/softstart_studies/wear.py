"""What wear does to a start: one drive, its gap from new to worn, under every controller.

The drive is the crane drive of [G], target speed 60 rad/s, torque lag 2 ms (assumed),
encoder of 4096 lines.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from softstart import Controller, Drive, Records, records, simulate
from softstart.arrays import Vector
from softstart.controller import make_controller
from softstart.study import Claim, Progress, Study, StudyResult, Table, Verdict
from softstart.tuning.outcome import Tuning
from softstart.views.drawing import COLOURS, DASHES, GREY, drawing
from softstart_studies.paper_g.crane import published
from softstart_studies.tuned_alike import CRANE, Front, front, panel_grid, rounded, tuned, tuned_controllers

if TYPE_CHECKING:
    from matplotlib.figure import Figure


NEW = 0.5  # rad, [G]; the widest gap of [G], 2 rad, is half way through this life


@dataclass(frozen=True)
class Extent:
    """The life, where the schedule has its cells, the effort."""

    life: tuple[float, ...] = tuple(np.geomspace(NEW, 8 * NEW, 7).tolist())
    scheduled: tuple[float, ...] = (NEW, 2 * NEW, 4 * NEW, 8 * NEW)
    restarts: int = 2
    generations: int = 20
    controllers: tuple[str, ...] | None = None  # None: all that can be tuned
    front_points: int = 8  # optima from the quickest to the slowest start of each gap; between, interpolated


GAINS = ("defaults", "fixed", "one set", "scheduled")


@dataclass(frozen=True)
class Course:
    """K_dyn and start time over the life."""

    k_dyn: Vector
    start_time: Vector


@dataclass(frozen=True)
class Life:
    """All courses, by controller and way of setting up.

    *Defaults*: set up for the new drive, nothing tuned. *Fixed*: tuned for the new drive. *One set*: tuned
    for the worst case over the life, set up for the new drive. *Scheduled*: tuned for several gaps and
    interpolated by the gap that somebody has measured. None may be slower than the defaults
    where it was tuned.
    """

    extent: Extent
    gaps: Vector
    direct: Course
    courses: Mapping[str, Mapping[str, Course]]
    fronts: Sequence[Front]

    def ratio(self, course: Course) -> Vector:
        """K_dyn over the least K_dyn of any start in the same time; NaN where there is no such start."""
        least = [one.at(time) for one, time in zip(self.fronts, course.start_time, strict=True)]
        return np.asarray(course.k_dyn / np.array(least))


def live(extent: Extent, progress: Progress) -> Life:
    """All starts of all lives."""
    drive = CRANE
    names = extent.controllers or tuned_controllers()
    tunings = tuned(
        drive, names, extent.scheduled, [float(drive.J2)], extent.restarts, extent.generations, progress
    )
    gaps = np.array(extent.life)
    worn = records(drive, gap=gaps)
    courses = {}
    for name, tuning in tunings.items():
        progress(f"{name}: starts over the life")
        ways = {
            "defaults": (published(name), drive),
            "fixed": (_fixed(tuning), drive),
            "one set": (_robust(tuning), drive),
            "scheduled": (tuning.scheduled, None),
        }
        courses[name] = {way: _course(worn, made, own) for way, (made, own) in ways.items()}
    fronts = []
    for i, one in enumerate(worn.elements()):
        progress(f"optima at gap {one.gap:.3g} rad")
        own = [course.start_time[i] for ways in courses.values() for course in ways.values()]
        fronts.append(front(one, own, extent.front_points))
    direct = _course(worn, make_controller("direct"), None)
    return Life(extent, gaps, direct, courses, fronts)


def _fixed(tuning: Tuning) -> Controller:
    """The controller with the gains of the new drive."""
    assert tuning.schedule is not None
    cell = tuning.schedule.isel(gap=0, load_inertia=0)
    gains: dict[str, Any] = {one.name: float(cell[one.name]) for one in tuning.question.ranges}
    return published(tuning.controller, **gains)


def _robust(tuning: Tuning) -> Controller:
    assert tuning.robust is not None
    return tuning.robust.controller


def _course(worn: Records, controller: Controller, fitted_to: Drive | None) -> Course:
    found: Any = simulate(worn, controller, fitted_to=fitted_to)
    return Course(np.asarray(found.k_dyn), np.asarray(found.start_time))


HELD = 1.05  # K_dyn at the end of life over that of the new drive, up to which gains count as holding


def tables(found: Life) -> tuple[Table, ...]:
    """From new to worn, and every point of every life."""
    return (_ends(found), *(_points(found, way) for way in GAINS))


def _ends(found: Life) -> Table:
    rows = []
    for name, ways in found.courses.items():
        for way, one in ways.items():
            rows.append(
                (
                    name, way, rounded(one.k_dyn[0]), rounded(one.k_dyn[-1]), rounded(np.max(one.k_dyn)),
                    rounded(one.start_time[0], 4), rounded(one.start_time[-1], 4),
                    _mean(found.ratio(one)), _largest(found.ratio(one)),
                )
            )  # fmt: skip
    return Table(
        f"From {found.gaps[0]:g} to {found.gaps[-1]:g} rad of gap",
        (
            "strategy", "gains", "K_dyn new", "worn", "largest", "start time new, s", "worn, s",
            "over optimum mean", "largest",
        ),
        rows,
    )  # fmt: skip


def _points(found: Life, way: str) -> Table:
    courses = {name: ways[way] for name, ways in found.courses.items()}
    rows = []
    for i, gap in enumerate(found.gaps):
        cells = [f"{one.k_dyn[i]:.3f} in {one.start_time[i]:.3f}" for one in courses.values()]
        rows.append((rounded(gap, 4), rounded(found.direct.k_dyn[i]), *cells))
    return Table(f"K_dyn and start time in s, gains: {way}", ("gap, rad", "direct", *courses), rows)


def claims(found: Life) -> tuple[Claim, ...]:
    """Whether fixed gains hold, and what knowing the gap is worth."""
    return (_fixed_hold(found), _schedule_pays(found), _one_set_suffices(found))


def _fixed_hold(found: Life) -> Claim:
    worse = {name: _growth(ways["fixed"]) for name, ways in found.courses.items()}
    held = [name for name, factor in worse.items() if factor <= HELD]
    listed = ", ".join(f"{name} {factor:.2f}" for name, factor in sorted(worse.items(), key=lambda p: p[1]))
    return Claim(
        "Gains tuned for the new drive serve it for life.",
        Verdict.CONFIRMED if len(held) == len(worse) else Verdict.PARTLY if held else Verdict.REFUTED,
        f"Largest K_dyn of the life over that of the new drive: {listed}.",
    )


def _schedule_pays(found: Life) -> Claim:
    """At the end of life, among the starts that are in time."""
    changes, pays = [], 0
    for name, ways in found.courses.items():
        fixed, scheduled = ways["fixed"], ways["scheduled"]
        gain = float(np.max(fixed.k_dyn) / np.max(scheduled.k_dyn))
        pays += gain > HELD
        changes.append(f"{name} {np.max(fixed.k_dyn):.2f} to {np.max(scheduled.k_dyn):.2f}")
    return Claim(
        "A schedule over a measured gap lowers the worst K_dyn of the life.",
        Verdict.CONFIRMED if pays == len(changes) else Verdict.PARTLY if pays else Verdict.REFUTED,
        f"Largest K_dyn, fixed gains against scheduled ones: {'; '.join(changes)}.",
    )


def _one_set_suffices(found: Life) -> Claim:
    largest = {name: _largest(found.ratio(ways["one set"])) for name, ways in found.courses.items()}
    ratios = {name: value for name, value in largest.items() if value is not None}
    best = min(ratios, key=ratios.__getitem__)
    near = ratios[best] < 1.1
    course = found.courses[best]["one set"]
    return Claim(
        "There is a controller whose one set of gains stays within 10 % of the optimum for life, the gap "
        "unknown.",
        Verdict.CONFIRMED if near else Verdict.REFUTED,
        f"Nearest is {best}: K_dyn {np.min(course.k_dyn):.3f} to {np.max(course.k_dyn):.3f}, at most "
        f"{ratios[best]:.3f} times the least K_dyn of any start in the same time.",
    )


def _mean(ratio: Vector) -> float | None:
    return rounded(np.mean(ratio[np.isfinite(ratio)])) if np.isfinite(ratio).any() else None


def _largest(ratio: Vector) -> float | None:
    return rounded(np.max(ratio[np.isfinite(ratio)])) if np.isfinite(ratio).any() else None


def _growth(course: Course) -> float:
    return float(np.max(course.k_dyn) / course.k_dyn[0])


MOST = 6.0  # K_dyn shown at the most


def life_figure(found: Life) -> Figure:
    """K_dyn over the gap, a panel per controller, a line per way of setting up."""
    return _panels(found, lambda one: one.k_dyn, "$K_{dyn}$", "dotted: direct")


def ratio_figure(found: Life) -> Figure:
    """K_dyn over the optimum at the controller's own start time."""
    return _panels(found, found.ratio, "$K_{dyn}$ / optimum", "optimum: in the start's own time, lag-free")


def _panels(found: Life, pick: Any, label: str, note: str) -> Figure:
    absolute = "optimum" not in label
    with drawing():
        figure, axes = panel_grid(len(found.courses), (3.6, 2.5), sharex=True, sharey=True)
        for panel, (name, ways) in zip(axes.flat, found.courses.items(), strict=False):
            if absolute:
                panel.plot(found.gaps, found.direct.k_dyn, color=GREY, lw=1.0, ls=":")
            for number, way in enumerate(GAINS):
                panel.plot(found.gaps, pick(ways[way]), color=COLOURS[number], ls=DASHES[number], label=way)
            panel.set_title(name, loc="left")
            panel.set_xscale("log")
            panel.set_xticks(found.extent.scheduled, [f"{gap:g}" for gap in found.extent.scheduled])
            panel.minorticks_off()
        axes[0, 0].set_ylim(0.8 if absolute else 0.95, MOST)
        if not absolute:
            axes[0, 0].set_yscale("log")
            axes[0, 0].set_yticks([1, 1.2, 1.5, 2, 3, 5], ["1", "1.2", "1.5", "2", "3", "5"])
            for panel in axes.flat:
                panel.minorticks_off()
        axes[0, 0].legend(loc="upper left")
        for row in axes:
            row[0].set_ylabel(label)
        for panel in axes[-1]:
            panel.set_xlabel("gap, rad")
        figure.suptitle(f"{label} while the gap wears ({note})", x=0.01, ha="left", fontsize=11)
    return figure  # type: ignore[no-any-return]


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
    return Wear.result(tables(found), claims(found), (life_figure(found), ratio_figure(found)))
