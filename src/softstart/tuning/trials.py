"""Candidates tried: their starts in every cell and scenario, in one batch, and which candidate is better."""

from __future__ import annotations

import copy
import math
import threading
from collections.abc import Mapping, Sequence
from concurrent.futures import CancelledError
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from softstart.arrays import Vector
from softstart.chain.machines import varied
from softstart.controller import CompiledController, Controller, make_controller
from softstart.drive import Drive
from softstart.errors import InputError
from softstart.quantities import nearest
from softstart.start.batch import Batch, Figures, prepared
from softstart.tuning.question import MARGIN, Question

Cells = NDArray[np.int64]  # axes: candidate, cell
Values = Mapping[str, Any]  # name -> one value a candidate

PATIENCE = 3.0  # a start is given up at so many times the longest bound


class Judged(NamedTuple):
    """Metric and start time in s of starts, with the scenario as last axis. NaN where a start failed."""

    metric: Vector
    start_time: Vector


@dataclass(frozen=True, eq=False)
class Yardstick:
    """What the defaults reach, and the bounds on the start time in s: axes cell, scenario.

    `own` is for a controller set up for the drive of each cell, `nominal` for one set up for the nominal
    drive.
    """

    own: Judged
    nominal: Judged
    own_bound: Vector
    nominal_bound: Vector

    @property
    def time_limit(self) -> float | None:
        """When a start is given up, s: far beyond every bound."""
        longest = max(float(self.own_bound.max()), float(self.nominal_bound.max()))
        return PATIENCE * longest if np.isfinite(longest) else None


class Trials:
    """Tries candidates for a question."""

    def __init__(self, question: Question, yardstick: Yardstick | None = None) -> None:
        self.question = question
        self.controller = question.recipe.make()
        gaps, inertias = (np.array(axis) for axis in zip(*question.cells, strict=True))
        self.gap, self.load_inertia = gaps, inertias
        self.starts = self._starts()
        bases = [(question.base or question.drive_of(i)).mean_torque for i in range(len(gaps))]
        self.base_torque = np.array(bases, dtype=np.float64)
        self.fitted = question.fitted()
        self.nominal = question.drive.design_drive
        self.own_defaults = self._defaults(self.fitted)
        self.nominal_defaults = {
            name: float(value[0]) for name, value in self._defaults([self.nominal]).items()
        }
        self.time_limit: float | None = None
        self.stopping: threading.Event | None = None  # set when nobody wants the answer any more
        self.compiled = isinstance(self.controller.set_up(self.nominal)[0], CompiledController)
        self.yardstick = self._measured() if yardstick is None else yardstick
        self.time_limit = self.yardstick.time_limit

    def _starts(self) -> Batch:
        """The machines that start: of each cell, one after another, those of all scenarios."""
        question = self.question
        own: dict[str, Any] = {"gap": self.gap, "load_inertia": self.load_inertia}
        found = {}
        for name in sorted({*own, *(name for one in question.scenarios for name in one)}):
            value = own.get(name)
            if value is None:
                value = np.array([question.value_in(cell, name) for cell in range(self.gap.size)])
            columns = [one[name].of(value) if name in one else value for one in question.scenarios]
            found[name] = np.stack(columns, axis=1).ravel()
        return prepared(varied(question.drive, found))

    def _defaults(self, drives: Sequence[Drive]) -> dict[str, Vector]:
        """The tuned parameters as derived from the drives."""
        rows = [self.controller.set_up(one)[0].parameters for one in drives]
        found = {}
        for name in self.question.names:
            values = [row[name] for row in rows]
            if None in values:
                raise InputError(
                    f"free: the controller {self.question.recipe.label} derives no default for {name}; "
                    "tuning starts from the default, so give the parameter one."
                )
            found[name] = np.array(values, dtype=np.float64)
        return found

    def _measured(self) -> Yardstick:
        """The defaults, and the bounds that follow."""
        bound = self.question.bound
        own = self.of_pairs({}, range(self.gap.size))
        nominal = Judged(*(part[0] for part in self.of_set({})))
        if bound.kind in ("seconds", "limits"):
            both = [np.full(own.start_time.shape, bound.value)] * 2
        elif bound.kind == "direct":
            both = [bound.value * self._direct()] * 2
        else:
            both = [np.where(np.isnan(t), np.inf, t) for t in (own.start_time, nominal.start_time)]
        return Yardstick(own, nominal, *both)

    def _direct(self) -> Vector:
        """Start time of `direct` in every cell and scenario."""
        shape = (self.gap.size, len(self.question.scenarios))
        direct = make_controller("direct")
        figured = self.starts.figures(direct.set_ups(self.fitted), 1.0)
        found: Vector = figured["start_time"][0].reshape(shape)
        if np.any(np.isnan(found)):
            gap, inertia = self.question.cells[int(np.argwhere(np.isnan(found))[0][0])]
            raise InputError(
                f"start_time: direct does not bring a load of {inertia:g} kg m2 behind a gap of {gap:g} rad "
                "to its target speed; give the start time in s instead of a multiple."
            )
        return found

    # candidates -------------------------------------------------------------------------------------------

    def to_the_end(self) -> Trials:
        """These trials for gains that are settled: their figures are those of `simulate` to the bit.

        A start flies through its gaps in spans that end with the time limit, and rounds by their length.
        """
        whole = copy.copy(self)
        whole.time_limit = None
        return whole

    def of_pairs(self, values: Values, cells: Any) -> Judged:
        """Candidates each for a cell of its own, and set up for it. Axes: candidate, scenario."""
        which = np.asarray(cells, dtype=np.int64).reshape(-1, 1)
        judged = self._judged(values, which, own=True)
        return Judged(judged.metric[:, 0], judged.start_time[:, 0])

    def of_set(self, values: Values) -> Judged:
        """Candidates for all cells, set up for the nominal drive. Axes: candidate, cell, scenario.

        Without values it is one, the defaults.
        """
        count = max((np.size(value) for value in values.values()), default=1)
        return self._judged(values, np.tile(np.arange(self.gap.size), (count, 1)), own=False)

    def _judged(self, values: Values, which: Cells, own: bool) -> Judged:
        """Candidate k in the cells which[k] and all scenarios; NaN where the controller refuses it."""
        if self.stopping is not None and self.stopping.is_set():
            raise CancelledError
        try:
            figured = self._figured(values, which, own)
        except InputError:
            if not values:
                raise  # the defaults are no candidate: the input is wrong
            if len(which) == 1:
                nothing = np.full((*which.shape, len(self.question.scenarios)), np.nan)
                return Judged(nothing, nothing)
            each = [
                self._judged(
                    {name: value[k : k + 1] for name, value in values.items()}, which[k : k + 1], own
                )
                for k in range(len(which))
            ]
            return Judged(*(np.concatenate(parts) for parts in zip(*each, strict=True)))
        return self._read(figured, which)

    def _figured(self, values: Values, which: Cells, own: bool) -> Figures:
        """The figures of all starts, in one call."""
        scenarios = len(self.question.scenarios)
        starts = (which[..., None] * scenarios + np.arange(scenarios)).ravel()
        set_ups = [
            single(self.controller, {name: value[k] for name, value in values.items()}).set_up(
                self.fitted[cell] if own else self.nominal
            )
            for k, cell in enumerate(which[:, 0].tolist())
        ]
        base = np.repeat(self.base_torque[which.ravel()], scenarios)
        return self.starts.figures(set_ups, base, starts, time_limit=self.time_limit)

    def _read(self, figured: Figures, which: Cells) -> Judged:
        shape = (*which.shape, len(self.question.scenarios))
        found = {name: values for name, (values, _, _) in figured.items()}
        metric = self.question.metric
        if metric == MARGIN:
            return Judged((1.0 - found[MARGIN]).reshape(shape), found["start_time"].reshape(shape))
        if isinstance(metric, str) and metric not in found:
            near = nearest(metric, found)
            hint = f"did you mean {near}?" if near else f"choose one of {', '.join(found)}."
            raise InputError(f'metric = "{metric}": a start has no such figure; {hint}')
        value = found[metric] if isinstance(metric, str) else metric(found)
        numbers = np.asarray(value)
        count = math.prod(shape)
        if numbers.shape != (count,) or numbers.dtype.kind not in "fiu":
            raise InputError(
                f"metric = {self.question.metric_name}: for {count} starts it gives {numbers.dtype} "
                f"of shape {numbers.shape}; it has to be one number a start."
            )
        return Judged(numbers.astype(np.float64).reshape(shape), found["start_time"].reshape(shape))


def single(controller: Controller, values: Values) -> Controller:
    """The controller with these values as single numbers."""
    return replace(controller, **{name: float(value) for name, value in values.items()})


TOO_SLOW = 1e30  # where the costs of candidates begin that start, but not in time
UNFINISHED = 1e60  # where those begin that do not start at all
SLACK = 1e-9  # of the bound on the start time, for rounding


def upper(values: Any, quantile: float) -> Any:
    """The value that the share `quantile` of the last axis does not exceed; one of the values.

    >>> float(upper(np.array([3.0, 1.0, 2.0, np.inf]), 0.75)), float(upper(np.array([3.0, 1.0]), 1.0))
    (3.0, 3.0)
    """
    count = np.shape(values)[-1]
    index = max(math.ceil(quantile * count - 1e-9), 1) - 1
    return np.sort(values, axis=-1)[..., index]


def excess(start_time: Any, bound: Any, quantile: float) -> Any:
    """By which share the start time is beyond its bound, 0 or more; infinite where a start fails."""
    share = np.where(np.isnan(start_time), np.inf, np.maximum(start_time / bound - 1.0, 0.0))
    over = upper(share, quantile)
    return np.where(over <= SLACK, 0.0, over)


def cost(metric: Any, start_time: Any, bound: Any, quantile: float) -> Vector:
    """The lower the better: in time beats too slow, less too slow beats more, then the metric decides.

    The last axis are the starts that one candidate is judged by; metric and start time both count at their
    `quantile` over these. A start that fails or does not reach its target speed is the worst of all, and
    candidates with fewer of them are better.

    >>> t = np.array([[0.3], [0.4], [0.5], [np.nan]])
    >>> cost(np.array([[2.0], [1.0], [1.0], [1.0]]), t, 0.35, 1.0).argsort().tolist()
    [0, 1, 2, 3]
    """
    failed = np.isnan(metric) | np.isnan(start_time)
    value = upper(np.where(failed, np.inf, metric), quantile)
    over = excess(np.where(failed, np.nan, start_time), bound, quantile)
    timely = np.isfinite(over)
    ranked = np.where(over == 0.0, value, TOO_SLOW * (1.0 + np.where(timely, over, 0.0)))
    unfinished = UNFINISHED * (1.0 + failed.mean(axis=-1))
    return np.asarray(np.where(timely & np.isfinite(value), ranked, unfinished))


def in_time(found: Any) -> Any:
    """Whether a cost is that of a candidate within its bound on the start time."""
    return np.asarray(found) < TOO_SLOW
