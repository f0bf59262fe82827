"""The lives in numbers, and what they say."""

from __future__ import annotations

from typing import Any

import numpy as np

from softstart.arrays import Vector
from softstart.study import Claim, Table, Verdict
from softstart_studies.wear.life import WAYS, Course, Life

HELD = 1.05  # K_dyn at the end of life over that of the new drive, up to which gains count as holding


def tables(found: Life) -> tuple[Table, ...]:
    """From new to worn, and every point of every life."""
    return (_ends(found), *(_points(found, way) for way in WAYS))


def _ends(found: Life) -> Table:
    rows = []
    for name, ways in found.courses.items():
        for way, one in ways.items():
            rows.append(
                (
                    name, way, _number(one.k_dyn[0]), _number(one.k_dyn[-1]), _number(np.max(one.k_dyn)),
                    _number(one.start_time[0], 4), _number(one.start_time[-1], 4),
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
        rows.append((_number(gap, 4), _number(found.direct.k_dyn[i]), *cells))
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
    said, pays = [], 0
    for name, ways in found.courses.items():
        fixed, scheduled = ways["fixed"], ways["scheduled"]
        gain = float(np.max(fixed.k_dyn) / np.max(scheduled.k_dyn))
        pays += gain > HELD
        said.append(f"{name} {np.max(fixed.k_dyn):.2f} to {np.max(scheduled.k_dyn):.2f}")
    return Claim(
        "A schedule over a measured gap lowers the worst K_dyn of the life.",
        Verdict.CONFIRMED if pays == len(said) else Verdict.PARTLY if pays else Verdict.REFUTED,
        f"Largest K_dyn, fixed gains against scheduled ones: {'; '.join(said)}.",
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
    return _number(np.mean(ratio[np.isfinite(ratio)])) if np.isfinite(ratio).any() else None


def _largest(ratio: Vector) -> float | None:
    return _number(np.max(ratio[np.isfinite(ratio)])) if np.isfinite(ratio).any() else None


def _growth(course: Course) -> float:
    return float(np.max(course.k_dyn) / course.k_dyn[0])


def _number(value: Any, digits: int = 3) -> float | None:
    return round(float(value), digits) if np.isfinite(value) else None
