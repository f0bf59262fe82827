"""One drive as its gap grows: every controller with fixed gains, one set for life, and scheduled gains."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from softstart import Controller, Drive, simulate
from softstart.arrays import Vector
from softstart.controller import make_controller
from softstart.study import Progress
from softstart.tuning.outcome import Tuning
from softstart_studies.tuned_alike import CRANE, Front, front, tuned, tuned_controllers

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


WAYS = ("defaults", "fixed", "one set", "scheduled")


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
    worn = drive.replace(gap=gaps)
    courses = {}
    for name, tuning in tunings.items():
        progress(f"{name}: the life with its gains, ")
        ways = {
            "defaults": (make_controller(name), drive),
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
    return make_controller(tuning.controller, gains)


def _robust(tuning: Tuning) -> Controller:
    assert tuning.robust is not None
    return tuning.robust.controller


def _course(worn: Drive, controller: Controller, fitted_to: Drive | None) -> Course:
    found: Any = simulate(worn, controller, fitted_to=fitted_to)
    return Course(np.asarray(found.k_dyn), np.asarray(found.start_time))
