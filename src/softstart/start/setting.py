"""Parameters that are set for a machine: for a start within a given time, and for its limits.

A strategy declares the parameter that sets how long a start takes (its `time_parameter`) and at most two more
(its `settings`). Values have three digits, so that what a table names is what was simulated.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from softstart.arrays import Vector
from softstart.controller.base import Controller
from softstart.controller.parameters import declared_parameters
from softstart.drive import Limits, Machine
from softstart.parallel import checked_workers
from softstart.start.batch import Batch, prepared
from softstart.start.kernel_input import SETTLING_PERIODS
from softstart.start.results import limited_time

VALUES: Final = 64  # of the time parameter, for a start within a given time
LONGEST: Final = 2.0  # times the settled time of direct: what takes longer is slow
DIGITS: Final = 3
WIDE: Final = (0.1, 10.0)  # times the default, of a parameter without a range of its own
MOST: Final = 4.0  # times the default, of a parameter that is set with it
COARSE: Final = {1: (64,), 2: (24, 12), 3: (12, 6, 6)}  # values of each parameter, for limits
FINE: Final = 5  # turns, each with half the steps of the last one
HOPELESS: Final = 0.1  # of what is missing: a turn that gains less is the last
KEPT: Final = 2  # settings around which a turn searches
ENOUGH: Final = 0.1  # share left of the limits beyond which a quicker start is better than more
NEAR: Final = 1.1  # times the longest time: starts up to there are followed to their end
BROKEN: Final = -1e6  # the share left of a start that fails
FLAGGED: Final = -10.0  # added to the share of one that is never recommended
IN_THE_WAY: Final = -1e3  # added where a limit is exceeded on the machine as it is


def rounded(value: float) -> float:
    """The largest number of three digits that is not above a value of 0 or more.

    >>> rounded(0.13467), rounded(44.06), rounded(62.0), rounded(0.0)
    (0.134, 44.0, 62.0, 0.0)
    """
    if value <= 0.0:
        return 0.0
    unit = 10.0 ** (math.floor(math.log10(value)) + 1 - DIGITS)
    return float(f"{math.floor(value / unit * (1.0 + 1e-12) + 1e-9) * unit:.{DIGITS}g}")


@dataclass(frozen=True)
class Axis:
    """A parameter that is set, and between what: evenly in the logarithm where it is above 0."""

    name: str
    low: float
    high: float

    def values(self, places: Vector) -> Vector:
        """The values at places from 0 to 1."""
        share = np.clip(places, 0.0, 1.0)
        if self.low > 0.0:
            even = self.low * (self.high / self.low) ** share
        else:
            even = self.low + (self.high - self.low) * share
        return np.array([rounded(value) for value in even.tolist()])

    @staticmethod
    def of(controller: Controller, name: str, machine: Machine, longest: float) -> Axis:
        """The range that a strategy declares; a time ends at `longest`, a torque at the starting torque."""
        first = name == controller.time_parameter
        one, drive = declared_parameters(controller)[name], machine.design_drive
        default = float(getattr(controller.fitted(drive), name))
        low, high = one.between or (0.0, math.inf)
        if one.multiples is not None or one.between is None:
            multiples = one.multiples or WIDE
            most = multiples[1] if first else min(multiples[1], MOST)
            low, high = max(low, multiples[0] * default), min(high, most * default)
        if first and one.unit == "s":
            high = longest if longest > low else high
        if one.unit == "N*m":
            high = drive.Ms if first else min(high, drive.Ms)
        return Axis(name, min(low, high), high)


def free_parameters(controller: Controller, names: Sequence[str]) -> list[str]:
    """Those of these parameters that were not given."""
    return [name for name in names if name and getattr(controller, name) is None]


class AtTime(NamedTuple):
    """The values of the time parameter of a strategy that were tried, ascending, and their starts."""

    name: str
    values: Vector
    k_dyn: Vector
    settled_time: Vector

    def best(self, at: float) -> dict[str, float] | None:
        """The value with the lowest K_dyn of those that settle within this time, s."""
        able = (self.settled_time <= at) & np.isfinite(self.k_dyn)
        if not able.any():
            return None
        return {self.name: float(self.values[np.where(able, self.k_dyn, np.inf).argmin()])}

    @property
    def quickest(self) -> tuple[dict[str, float], float] | None:
        """The value with the shortest settled time, and that time in s; None where none settles."""
        if np.isnan(self.settled_time).all():
            return None
        i = int(np.nanargmin(self.settled_time))
        return {self.name: float(self.values[i])}, float(self.settled_time[i])


def over_time(
    machine: Machine, controller: Controller, direct: float, at: float, fitted_to: Machine | None = None
) -> AtTime | None:
    """Starts over the time parameter of a strategy; None where it has none or that was given.

    `direct` is the settled time of direct in s. The values do not depend on `at`: K_dyn cannot rise with it.
    """
    if not free_parameters(controller, [controller.time_parameter]):
        return None
    name, own = controller.time_parameter, fitted_to or machine
    axis = Axis.of(controller, name, own, MOST * direct)
    values = np.unique(axis.values(np.linspace(0.0, 1.0, VALUES)))
    figures = _starts(
        prepared([machine]),
        machine,
        controller,
        {name: values},
        own,
        np.zeros(1, np.int64),
        2.0 * max(at, direct),
    )
    return AtTime(name, values, figures["k_dyn"], figures["settled_time"])


def _starts(
    batch: Batch,
    machine: Machine,
    controller: Controller,
    setting: Mapping[str, Vector],
    own: Machine,
    each: NDArray[np.int64],
    latest: float | None,
) -> dict[str, Any]:
    """Figures of starts: each setting on the machines `each` of the batch, one after the other."""
    given: dict[str, Any] = dict(setting)
    set_ups = list(replace(controller, **given).set_ups(own))
    regulations = [one for ready, drive in set_ups if (one := ready.regulation(drive)) is not None]
    limit: Vector | None = None
    if latest is not None:  # and until it is known whether the load has settled
        dwell = np.full(len(set_ups), SETTLING_PERIODS * machine.design_drive.elastic_period)
        for i, one in enumerate(regulations):
            dwell[i] = one.dwell if one.command_end <= NEAR * latest else 0.0
        limit = np.repeat(latest + dwell, each.size)
    found = batch.figures(
        set_ups, float(machine.mean_torque), np.tile(each, len(set_ups)), time_limit=limit,
        workers=checked_workers(None), settled=True,
    )  # fmt: skip
    return {name: values for name, (values, *_) in found.items()} | {"start_time": limited_time(found)}


class Judge(NamedTuple):
    """The machine as it is and as it may change, what is permitted, and the start under direct."""

    machine: Machine
    changed: Sequence[Machine]
    limits: Limits
    k_dyn: float  # of direct, as the following
    settled_time: float
    slow: float  # times the settled time of direct
    higher: float  # times its K_dyn

    def shares(self, figures: Mapping[str, Any]) -> Vector:
        """What starts leave of the limits of torque and time; without those, of the torque of direct."""
        limits = replace(self.limits, life=None)
        if limits:
            judged = ("peak_torque", "used_torque", "start_time")
            share = limits.margin({name: figures[name] for name in judged if name in figures})
        else:
            share = 1.0 - figures["k_dyn"] / self.k_dyn
        return np.asarray(np.where(np.isnan(figures["start_time"]), BROKEN, np.nan_to_num(share, nan=BROKEN)))

    def flagged(self, figures: Mapping[str, Any]) -> Vector:
        """What is added to the share of a start that takes too long, or is harder than direct; else 0."""
        settled = np.nan_to_num(figures["settled_time"], nan=-BROKEN) / self.settled_time
        ratio = figures["k_dyn"] / self.k_dyn
        slower = np.where(settled > self.slow, FLAGGED - settled, 0.0)
        return np.asarray(slower + np.where(ratio > self.higher, FLAGGED - ratio, 0.0))

    def haste(self, figures: Mapping[str, Any]) -> Vector:
        """The settled time, as so small a share that it decides only between margins that are enough."""
        return np.asarray(1e-3 * np.nan_to_num(figures["settled_time"]) / self.settled_time)


def for_limits(
    controller: Controller, judge: Judge, fitted_to: Machine | None = None, alone: bool = False
) -> dict[str, float]:
    """The setting that leaves most of the limits in the worst case; empty where nothing can be set.

    That of the time parameter, unless `alone` also of what is set with it. A grid, then finer ones around its
    best settings. The changed machines are started only with settings that keep the limits of the machine as
    it is. Without a limit on the start time it is the quickest setting that leaves 10 %.
    """
    own = fitted_to or judge.machine
    more = () if alone else controller.settings
    names = free_parameters(controller, [controller.time_parameter, *more])
    if controller.time_parameter not in names:
        return {}
    latest = LONGEST * judge.settled_time
    if judge.limits.start_time is not None:
        latest = NEAR * judge.limits.start_time
    axes = [Axis.of(controller, name, own, latest) for name in names]
    batch = prepared([judge.machine, *judge.changed])
    rest = np.arange(1, 1 + len(judge.changed), dtype=np.int64)
    known: dict[tuple[float, ...], tuple[float, tuple[float, ...]]] = {}

    def start(rows: NDArray[np.float64], each: NDArray[np.int64], until: float | None) -> dict[str, Any]:
        return _starts(
            batch, judge.machine, controller, dict(zip(names, rows.T, strict=True)), own, each, until
        )

    def doubtful(rows: NDArray[np.float64]) -> list[bool]:
        given = ({name: float(v) for name, v in zip(names, row, strict=True)} for row in rows)
        set_ups = (replace(controller, **setting).set_up(own.design_drive) for setting in given)
        return [bool(ready.doubts(drive)) for ready, drive in set_ups]

    def look(places: NDArray[np.float64]) -> None:
        columns = [axis.values(column) for axis, column in zip(axes, places.T, strict=True)]
        new = {row: tuple(place) for row, place in zip(zip(*columns, strict=True), places, strict=True)}
        new = {row: place for row, place in new.items() if row not in known}
        if not new:
            return
        rows = np.array(list(new))
        figures = start(rows, np.zeros(1, np.int64), latest)
        share = judge.shares(figures) + judge.flagged(figures)
        share[doubtful(rows)] += FLAGGED
        able = share >= 0.0
        if able.any() and rest.size:
            until = None if judge.limits.start_time is None else latest
            worst = judge.shares(start(rows[able], rest, until)).reshape(-1, rest.size).min(axis=1)
            share[able] = np.minimum(share[able], worst)
        if judge.limits.start_time is None:
            share = np.minimum(share, ENOUGH) - np.where(share > 0.0, judge.haste(figures), 0.0)
        share = np.maximum(share, 0.4 * IN_THE_WAY)
        score = np.where(able, share, share + IN_THE_WAY)
        known.update(zip(new, zip(score.tolist(), new.values(), strict=True), strict=True))

    counts = COARSE[len(names)]
    look(np.array(list(product(*(np.linspace(0.0, 1.0, count) for count in counts)))))
    steps = np.array([1.0 / (count - 1) for count in counts])
    for _ in range(FINE):
        steps, before = 0.5 * steps, max(known.values())[0]
        best = sorted(known.values(), key=lambda one: -one[0])[:KEPT]
        moves = np.array(list(product((-1.0, 0.0, 1.0), repeat=len(names)))) * steps
        look(np.clip(np.concatenate([np.array(place) + moves for _, place in best]), 0.0, 1.0))
        now = max(known.values())[0]
        missing = -(now if now > 0.5 * IN_THE_WAY else now - IN_THE_WAY)
        if now - before < HOPELESS * missing:
            break
    chosen = max(known, key=lambda row: known[row][0])
    return dict(zip(names, map(float, chosen), strict=True))
