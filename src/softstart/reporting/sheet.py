"""The parameter sheet of a strategy: its values rounded to what can be set, and started again with them."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from softstart.controller import CompiledController, Controller
from softstart.drive import Drive
from softstart.errors import InputError, SimulationError
from softstart.reporting.resolution import Resolution, nearest_step, rated_torque
from softstart.reporting.strategies import ORDINARY, computes_with, kind_of, label_of
from softstart.start import metrics
from softstart.start.batch import array_starts, figures
from softstart.start.run import Run
from softstart.start.simulation import simulate

KEPT = ("period",)  # the cycle of the control code is what the inverter has, no setting
ALL_CORNERS = 9  # rounded values up to which every combination of half steps is started
COARSE = 0.1  # a step above this share of the value is said to be coarse


@dataclass(frozen=True)
class Setting:
    """One value of a strategy in SI: exact, and rounded to `step` (None: taken as it is)."""

    name: str
    meaning: str
    unit: str
    exact: float | str
    rounded: float | str
    step: float | None
    least: float = 0.0
    most: float = math.inf

    @property
    def coarse(self) -> bool:
        """Whether the step is large against the value."""
        return (
            self.step is not None
            and isinstance(self.exact, float)
            and self.step > COARSE * abs(self.exact) > 0.0
        )

    def off(self, side: int) -> float:
        """The value half a step too low (-1) or too high (+1), within what the parameter may be."""
        assert self.step is not None
        assert isinstance(self.rounded, float)
        return min(max(self.rounded + 0.5 * side * self.step, self.least), max(self.most, self.rounded))


@dataclass(frozen=True, eq=False)
class FullRise:
    """A ramp for an inverter that asks for the time from 0 to 100 % of torque, s: exact, and rounded.

    `rise` is the time between the torques of the sheet (s) that comes of the rounded one, `run` the start.
    """

    exact: float
    rounded: float
    rise: float
    run: Run

    def summary(self) -> dict[str, float]:
        """As plain data."""
        return {
            "exact": self.exact,
            "rounded": self.rounded,
            "k_dyn": self.run.k_dyn,
            "start_time": self.run.start_time,
        }


@dataclass(frozen=True, eq=False)
class Sheet:
    """What to set for one strategy, and what comes of it.

    `exact` and `rounded` are starts of the drive with the exact and the rounded values. `worst_k_dyn` is the
    largest K_dyn, `slowest` the longest start time (s) of `variants` starts in which the rounded values are
    half a step off, in the combinations that `corners` says; NaN if one of them fails. `worst_values`
    belong to it. `own` is the drive whose numbers the strategy works with, `computes_with` says with which
    of them. `torque_step` (N m) is that of the inverter.
    """

    name: str
    kind: str
    settings: tuple[Setting, ...]
    own: Drive
    exact: Run
    rounded: Run | None
    failure: str
    variants: int
    corners: bool
    worst_k_dyn: float
    slowest: float
    worst_values: Mapping[str, float]
    torque_step: float
    full_rise: FullRise | None
    computes_with: Sequence[str] | None

    @property
    def varied(self) -> list[Setting]:
        """The settings that were rounded."""
        return [one for one in self.settings if one.step is not None]

    def summary(self) -> dict[str, Any]:
        """As plain data."""
        return {
            "controller": self.name,
            "settings": [
                {"name": s.name, "unit": s.unit, "exact": s.exact, "rounded": s.rounded, "step": s.step}
                for s in self.settings
            ],
            "k_dyn": self.exact.k_dyn,
            "k_dyn_rounded": self.rounded.k_dyn if self.rounded else None,
            "start_time": self.exact.start_time,
            "start_time_rounded": self.rounded.start_time if self.rounded else None,
            "k_dyn_half_a_step_off": self.worst_k_dyn,
            "start_time_half_a_step_off": self.slowest,
            "time_0_to_100_percent": self.full_rise.summary() if self.full_rise else None,
            "variants": self.variants,
            "failure": self.failure,
        }


def make_sheet(drive: Drive, controller: Controller, exact: Run, resolution: Resolution) -> Sheet:
    """The sheet of a strategy on a drive; `exact` is its start there."""
    ready, own = controller.set_up(drive)
    settings = tuple(_settings(ready, drive, resolution))
    varied = [one for one in settings if one.step is not None]
    values = {one.name: one.rounded for one in varied}
    rounded: Run | None = None
    failure, variants, corners, worst, slowest = "", 0, False, math.nan, math.nan
    worst_values: dict[str, float] = {}
    full_rise: FullRise | None = None
    try:
        rounded = simulate(drive, replace(ready, **values), fitted_to=own)
        if kind_of(controller) in ORDINARY:
            full_rise = _full_rise(drive, replace(ready, **values), own, resolution)
        if varied:
            sides = _sides(len(varied))
            corners = len(varied) <= ALL_CORNERS
            k_dyn, time = _starts(drive, ready, own, varied, sides)
            variants, worst, slowest = len(sides), float(np.max(k_dyn)), float(np.max(time))
            if rounded.k_dyn > worst:  # the values as they are set are among what may be
                worst, worst_values = rounded.k_dyn, {one.name: float(one.rounded) for one in varied}
            slowest = max(slowest, rounded.start_time)
            at = sides[int(np.argmax(np.nan_to_num(k_dyn, nan=math.inf)))]
            off = {one.name: one.off(side) for one, side in zip(varied, at, strict=True)}
            worst_values = worst_values or off
    except (SimulationError, InputError) as error:
        failure = " ".join(str(error).split())
    return Sheet(
        name=label_of(exact.controller), kind=kind_of(controller), settings=settings,
        own=own, exact=exact, rounded=rounded, failure=failure, variants=variants, corners=corners,
        worst_k_dyn=worst, slowest=slowest, worst_values=worst_values,
        torque_step=resolution.step("", "N*m", rated_torque(drive)[0]) or 0.0, full_rise=full_rise,
        computes_with=computes_with(ready, own),
    )  # fmt: skip


def _full_rise(drive: Drive, ready: Any, own: Drive, resolution: Resolution) -> FullRise | None:
    """The ramp by its time from 0 to 100 % of torque; None where there is no rise."""
    share = (ready.full_torque - ready.initial) / rated_torque(drive)[0]
    if not (share > 0.0 and ready.time > 0.0):
        return None
    exact = float(ready.time / share)
    rounded = nearest_step(exact, resolution.time)
    run = simulate(drive, replace(ready, time=rounded * share), fitted_to=own)
    return FullRise(exact, rounded, rounded * share, run)


def _settings(ready: Controller, drive: Drive, resolution: Resolution) -> list[Setting]:
    rated = rated_torque(drive)[0]
    found = []
    for field in fields(ready):
        value, about = getattr(ready, field.name), field.metadata
        unit, meaning = str(about.get("unit", "")), str(about.get("meaning", ""))
        if value is None or about.get("kind", "quantity") == "object":
            continue
        if not isinstance(value, int | float) or isinstance(value, bool):
            found.append(Setting(field.name, meaning, unit, str(value), str(value), None))
            continue
        number = float(value)
        step = None if field.name in KEPT else resolution.step(field.name, unit, rated)
        if step is None or not math.isfinite(number):
            found.append(Setting(field.name, meaning, unit, number, number, None))
            continue
        least, most = about.get("between") or (-math.inf if number < 0.0 else 0.0, math.inf)
        most = float(drive.maximum_torque) if unit == "N*m" else float(most)
        rounded = nearest_step(number, step, max(most, 0.0))
        found.append(
            Setting(field.name, meaning, unit, number, rounded, step, min(float(least), rounded), most)
        )
    return found


def _sides(count: int) -> list[tuple[int, ...]]:
    """All combinations of half steps; each value alone and all together where they are too many."""
    if count <= ALL_CORNERS:
        return list(itertools.product((-1, 1), repeat=count))
    alone = [tuple(side if k == i else 0 for k in range(count)) for i in range(count) for side in (-1, 1)]
    return [*alone, (-1,) * count, (1,) * count]


def _starts(
    drive: Drive, ready: Controller, own: Drive, varied: Sequence[Setting], sides: Sequence[tuple[int, ...]]
) -> tuple[Any, Any]:
    """K_dyn and start times of the drive with the values off by these half steps."""
    columns = {
        one.name: np.array([one.off(row[k]) for row in sides])
        if any(row[k] for row in sides)
        else one.rounded
        for k, one in enumerate(varied)
    }
    count = len(sides)
    if isinstance(ready, CompiledController):
        notes = array_starts(_many(drive, count), replace(ready, **columns), fitted_to=_many(own, count))
    else:
        each = [
            {name: float(np.broadcast_to(v, count)[i]) for name, v in columns.items()} for i in range(count)
        ]
        notes = np.concatenate(
            [array_starts(drive, replace(ready, **values), fitted_to=own) for values in each]
        )
    found = figures(notes, metrics.base_torque(drive))
    time = np.asarray(found["start_time"][0], dtype=np.float64)
    return np.where(np.isnan(time), np.nan, found["k_dyn"][0]), time


def _many(drive: Drive, count: int) -> Drive:
    """The same drive so many times."""
    return drive.replace(gap=np.full(count, float(drive.gap)))
