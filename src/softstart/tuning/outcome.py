"""What tuning has found: the schedule, the robust set, the price of robustness."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from softstart import __version__
from softstart.arrays import plain_fields
from softstart.controller.tuned import (
    Gain,
    GainSchedule,
    RobustFile,
    RobustGains,
    ScheduleFile,
    meanings_of,
    robust_text,
    schedule_csv,
    schedule_text,
    scheduled,
)
from softstart.errors import InputError
from softstart.input.files import write_whole
from softstart.linear.view import loop_in_words
from softstart.results import OneLine, Result
from softstart.tuning.problem import TuningProblem, given_to
from softstart.views.numbers import units_of

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes

    from softstart.drive.machine import Machine

What = Literal["schedule", "robust"]
SAME = 1e-9  # within this share two values are one


@dataclass(frozen=True, eq=False, repr=False)
class RobustSet(OneLine):
    """One set of gains for all cells and scenarios.

    `parameters` are all parameters of the controller, set up for the nominal drive; `gains` those that were
    tuned, `defaults` what these were. `derived` are values that follow from the nominal drive, and from the
    drive of a cell, with the gains alone, otherwise (SI units). `worst` is the metric at the quantile over
    all starts, `worst_default` that of the defaults, `ends` the first at the stiff and at the soft end of an
    unknown stiffness; `excess` by which share the start times are beyond their bounds at the same quantile
    (0: in time). `cells` has the figures of each cell. `agreement` of `restarts` searches came within 1 % of
    the best.
    """

    parameters: dict[str, Any]
    gains: dict[str, float]
    defaults: dict[str, float]
    worst: float
    worst_default: float
    excess: float
    agreement: int
    restarts: int
    cells: xarray.Dataset
    controller: RobustGains
    derived: dict[str, Any]
    ends: tuple[float, float] | None = None

    @property
    def feasible(self) -> bool:
        """Whether the bound on the start time is kept."""
        return self.excess == 0.0

    def summary(self) -> dict[str, Any]:
        """Everything as plain data, for JSON."""
        plain = plain_fields(self, "cells", "controller")
        return {**plain, "feasible": self.feasible, "cells": _rows(self.cells)}


@dataclass(frozen=True, eq=False, repr=False)
class Tuning(Result, view="tuning.tuning_sheet"):
    """Tuned gains of one controller over a grid of gaps and load inertias; the result of `tune`.

    Attributes
    ----------
    problem : TuningProblem
        What was tuned, over what, within which bounds.
    schedule : xarray.Dataset or None
        Over `gap` (rad) and `load_inertia` (kg m2): each tuned parameter, the metric tuned and with the
        defaults, start times (s), their bounds (s), and how many searches agree. None if not asked for.
    robust : RobustSet or None
        The one set of gains for all cells. None if not asked for.
    price : xarray.Dataset or None
        For each cell: the robust set, the schedule, and the optimum within the same time.
    between : xarray.Dataset or None
        The schedule half way between the cells, where its gains are interpolated: where these differ much
        from cell to cell, nothing says that it does well there.
    starts : int
        Simulated starts, with those that were given up.
    seconds : float
        How long that took, s.

    Examples
    --------
    >>> from softstart import tune
    >>> options = {"free": ["torque"], "certified": False, "generations": 3, "restarts": 1}
    >>> tuned = tune("crane-4amtkf", "reduced-first-stage", ["1x"], ["1x"], **options)
    >>> tuned.controller, tuned.metric, dict(tuned.schedule.sizes)
    ('reduced-first-stage', 'k_dyn', {'gap': 1, 'load_inertia': 1})
    """

    problem: TuningProblem
    schedule: xarray.Dataset | None
    robust: RobustSet | None
    price: xarray.Dataset | None
    between: xarray.Dataset | None
    starts: int
    seconds: float

    @property
    def drive(self) -> Machine:
        """The nominal drive or chain."""
        return self.problem.drive

    @property
    def controller(self) -> str:
        """Name of the controller."""
        return self.problem.recipe.label

    @property
    def metric(self) -> str:
        """Name of the figure that was made small."""
        return self.problem.metric_name

    @property
    def scheduled(self) -> GainSchedule:
        """The controller that takes its gains from the schedule. InputError if none was asked for."""
        return scheduled(self._schedule_file(), "schedule", self.problem.recipe.make())

    @property
    def plausibility_warnings(self) -> list[str]:
        """Warnings: a drive outside the gaps and inertias tuned over.

        >>> from softstart import tune
        >>> options = {"free": ["torque"], "certified": False, "generations": 1, "restarts": 1}
        >>> tuned = tune("crane-4amtkf", "reduced-first-stage", [0.01], ["1x"], **options)
        >>> tuned.plausibility_warnings[0][:75]
        'the gap of the drive, 0.5 rad, is outside the tuned range, 0.01 rad: the re'
        """
        q, (gap, inertia), units = self.problem, self.drive.gap_and_inertia, units_of(self.drive)

        def words(values: Iterable[float], si: str) -> str:
            numbers = dict.fromkeys(f"{units.shown(value, si):.5g}" for value in values)
            return f"{' to '.join(numbers)} {units.label(si)}"

        return [
            f"the {name} of the drive, {words([value], si)}, is outside the tuned range, "
            f"{words((axis[0], axis[-1]), si)}: the results "
            'do not apply to this drive. Values at the output of a gear are written "at output".'
            for name, si, value, axis in (
                ("gap", "rad", gap, q.gaps), ("load inertia", "kg*m^2", inertia, q.load_inertias)
            )
            if not axis[0] * (1.0 - SAME) <= value <= axis[-1] * (1.0 + SAME)
        ]  # fmt: skip

    def summary(self) -> dict[str, Any]:
        """Everything as plain data, for JSON."""
        tables = {name: getattr(self, name) for name in ("schedule", "price", "between")}
        return {
            **self._asked(),
            "plausibility_warnings": self.plausibility_warnings,
            "controller": self.controller,
            "given": given_to(self.problem.recipe.make()),
            "free": {one.name: one.text() for one in self.problem.ranges},
            **{name: None if table is None else _rows(table) for name, table in tables.items()},
            "robust": None if self.robust is None else self.robust.summary(),
            "starts": self.starts,
            "seconds": self.seconds,
        }

    @cached_property
    def robust_loop(self) -> str:
        """Margins of the robust set on the nominal drive, if its strategy holds the speed; else ""."""
        if self.robust is None:
            return ""
        return loop_in_words(self.robust.controller.nominal, self.robust.controller.controller)

    def plot(
        self, what: Literal["gains", "metric", "robust", "price"] | None = None, *, ax: Axes | None = None
    ) -> Any:
        """A figure: maps of the gains, of the metric tuned and by default, of the robust set, of its price.

        By default the price of robustness if there is one, else the maps of the metric.
        """
        figures = self.figures
        if what is None or ax is not None:
            return super().plot(ax=ax)
        if what not in figures:
            raise InputError(f"what = {what!r}: this tuning has no such figure; choose {', '.join(figures)}.")
        return figures[what]()

    def to_toml(self, path: str | Path, what: What | None = None) -> None:
        """Write the schedule or the robust set as TOML, which any controller's name may stand for.

        By default the schedule, or the robust set if there is no schedule.
        """
        about = {"softstart": __version__, **self._asked(), "free": list(self.problem.names)}
        if what == "schedule" or (what is None and self.schedule is not None):
            text = schedule_text(self._schedule_file(), about, meanings_of(self.problem.recipe.make()))
        elif (robust := self.robust) is None:
            raise InputError("robust: no robust set was tuned; call tune with robust=True.")
        else:
            saved = RobustFile(self._name(), robust.parameters, robust.controller.nominal)
            worst, before = (float(f"{value:.6g}") for value in (robust.worst, robust.worst_default))
            reached = {"worst": worst, "worst_default": before, "in_time": robust.feasible}
            meanings = meanings_of(robust.controller.controller)
            text = robust_text(saved, about | reached, meanings, robust.derived)
        write_whole(Path(path), lambda stream: stream.write(text))

    def to_csv(self, path: str | Path) -> None:
        """Write the schedule as CSV, as a table with the figures of each cell; it is not read back."""
        saved = self._schedule_file()
        assert self.schedule is not None
        columns = {
            str(name): one.to_numpy() for name, one in self.schedule.items() if name not in saved.gains
        }
        text = schedule_csv(saved, columns)
        write_whole(Path(path), lambda stream: stream.write(text))

    def _asked(self) -> dict[str, Any]:
        q = self.problem
        return {
            "drive": self.drive.name,
            "metric": self.metric,
            f"{q.time}_bound": q.bound,
            **({} if q.plan is None else {"duty": q.plan.words()}),
            "gaps": list(q.gaps),
            "load_inertias": list(q.load_inertias),
            "scenarios": len(q.scenarios),
            **{name: getattr(q, name) for name in ("quantile", "seed", "restarts")},
        }

    def _schedule_file(self) -> ScheduleFile:
        if self.schedule is None:
            raise InputError("schedule: no schedule was tuned; call tune with schedule=True.")
        q = self.problem
        gains = gains_on_grid(q, {one.name: self.schedule[one.name].to_numpy() for one in q.ranges})
        fixed = {k: value for k, value in given_to(q.recipe.make()).items() if k not in gains}
        return ScheduleFile(q.recipe.name, *q.declared(), gains, fixed)

    def _name(self) -> str:
        if name := self.problem.recipe.name:
            return name
        raise InputError(
            f"controller = {self.controller}: it has no name under which a file could call it; give tune "
            "its name or path/to/file.py:ClassName instead of the object."
        )


def gains_on_grid(problem: TuningProblem, values: Mapping[str, Any]) -> dict[str, Gain]:
    """The gains of all cells as tables; a gain searched in the logarithm is interpolated in it too."""
    gains = {}
    for tuned in problem.ranges:
        table = np.asarray(values[tuned.name]).reshape(len(problem.gaps), len(problem.load_inertias))
        curved = tuned.logarithmic and bool(np.all(table > 0.0))
        gains[tuned.name] = Gain("logarithmic" if curved else "linear", table)
    return gains


def _rows(dataset: xarray.Dataset) -> dict[str, Any]:
    """A dataset over the grid as nested lists, one row per gap; what is not finite is None."""
    return {
        str(name): [
            [one if math.isfinite(one) else None for one in row] for row in values.to_numpy().tolist()
        ]
        for name, values in dataset.items()
    }
