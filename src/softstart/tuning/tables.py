"""What tuning has found as tables, and the price of robustness beside the optimum of each cell."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from softstart.chain.machines import Machine
from softstart.controller.tuned import GainSchedule, RobustGains
from softstart.errors import InputError
from softstart.optimal.optimize import optimize
from softstart.optimal.result import InfeasibleError, OptimumError
from softstart.parallel import Pool
from softstart.store import Records
from softstart.tuning.gains import ScheduleFound, SetFound
from softstart.tuning.outcome import RobustSet, gains_on_grid
from softstart.tuning.question import Question
from softstart.tuning.search import agreement
from softstart.tuning.trials import Judged, Trials, excess, in_time, single, upper
from softstart.tuning.work import Log

if TYPE_CHECKING:
    import xarray

Columns = dict[str, tuple[Any, str, str]]  # name -> values of the cells, unit, meaning


def check_metric(trials: Trials) -> None:
    """Refuse a metric that no start has. Raises InputError."""
    for judged in (trials.yardstick.own, trials.yardstick.nominal):
        if np.any(np.isfinite(judged.metric)):
            return
    raise InputError(
        f"metric = {trials.question.metric_name}: no start of {trials.question.recipe.label} with its "
        "defaults has this figure; choose another metric, or give parameters with which it starts."
    )


def schedule_table(trials: Trials, found: ScheduleFound) -> xarray.Dataset:
    """The schedule with what it reaches."""
    question, yardstick = trials.question, trials.yardstick
    columns: Columns = {
        one.name: (found.values[one.name], one.unit, f"tuned, within {one.text()}") for one in question.ranges
    }
    columns |= {
        f"{one.name}_default": (trials.own_defaults[one.name], one.unit, "default") for one in question.ranges
    }
    columns |= _figures(trials, found.judged, yardstick.own, yardstick.own_bound)
    near = [
        agreement(row, min(best, row.min()))
        for row, best in zip(found.restart_costs, found.costs, strict=True)
    ]
    sure = in_time(found.restart_costs).all(axis=1)
    columns["agreement"] = (np.array([n for n, _ in near]), "1", "searches within 1 % of the best")
    columns["spread"] = (
        np.where(sure, [apart for _, apart in near], np.nan), "1", "how far apart the searches end",
    )  # fmt: skip
    columns["kept_default"] = (found.kept_default, "", "whether the defaults were best")
    return _dataset(trials, columns)


def robust_outcome(trials: Trials, found: SetFound) -> RobustSet:
    """The robust set with what it reaches."""
    question, yardstick = trials.question, trials.yardstick
    controller = single(trials.controller, found.values)
    ready, own = controller.set_up(trials.nominal)
    near, apart = agreement(found.restart_costs, min(found.cost, found.restart_costs.min()))
    both = (found.judged, yardstick.nominal)
    worst, worst_default = (_quantile(one.metric.ravel(), question.quantile) for one in both)
    over, over_default = (
        float(excess(one.start_time.ravel(), yardstick.nominal_bound.ravel(), question.quantile))
        for one in both
    )
    return RobustSet(
        parameters=ready.parameters,
        gains=found.values,
        defaults=trials.nominal_defaults,
        worst=worst,
        worst_default=worst_default,
        excess=over,
        excess_default=over_default,
        agreement=near,
        restarts=question.restarts,
        spread=apart if bool(in_time(found.restart_costs).all()) else float("nan"),
        kept_default=found.kept_default,
        cells=_dataset(trials, _figures(trials, found.judged, yardstick.nominal, yardstick.nominal_bound)),
        controller=RobustGains("robust", ready, own),
    )


def between_table(trials: Trials, found: ScheduleFound) -> xarray.Dataset | None:
    """The schedule half way between the cells, where its gains are interpolated; None for a single cell."""
    question = trials.question
    if len(question.cells) == 1:
        return None
    gains = gains_on_grid(question, found.values)
    halves = replace(question, gaps=_halves(question.gaps), load_inertias=_halves(question.load_inertias))
    there = Trials(halves)
    schedule = GainSchedule(
        "schedule", trials.controller, *question.declared(),
        tuple((name, *gain) for name, gain in gains.items()),
    )  # fmt: skip
    each = [schedule.gains_at(one.gap, one.load_inertia) for one in there.fitted]
    gains_there = {name: np.array([gains[name] for gains in each]) for name in found.values}
    judged = there.to_the_end().of_pairs(gains_there, range(len(halves.cells)))
    return _dataset(there, _figures(there, judged, there.yardstick.own, there.yardstick.own_bound))


def _halves(axis: tuple[float, ...]) -> tuple[float, ...]:
    """The middles between values; of one value itself."""
    return tuple(0.5 * (a + b) for a, b in pairwise(axis)) or axis


def price_table(
    trials: Trials, found: ScheduleFound | None, one: SetFound | None, best: Optima
) -> xarray.Dataset | None:
    """Robust set, schedule and optimum within the same time, side by side."""
    question, yardstick = trials.question, trials.yardstick
    name, columns = question.metric_name, {}
    both = found is not None and one is not None
    if not (both or best):
        return None
    sides = (
        ("schedule", found.judged if found else None, yardstick.own_bound),
        ("robust", one.judged if one else None, yardstick.nominal_bound),
    )
    for side, judged, bounds in sides:
        if judged is None:
            continue
        values = _over_scenarios(judged.metric, question.quantile)
        columns[side] = (values, "1", f"{name} of the {side}")
        columns[f"{side}_bound"] = (bounds[:, 0], "s", "bound on the start time")
        if best:
            records = [best.get((cell, float(bound)), {}) for cell, bound in enumerate(bounds[:, 0])]
            least = _column(records, "k_dyn")
            columns[f"{side}_optimum"] = (least, "1", "least K_dyn of any start within the bound")
            columns[f"{side}_lower_bound"] = (_column(records, "k_dyn_lower_bound"), "1", "its lower bound")
            columns[f"{side}_over_optimum"] = (values / least, "1", f"{side} over optimum")
    if both:
        columns["robust_over_schedule"] = (
            columns["robust"][0] / columns["schedule"][0], "1", "what one set for all costs"
        )  # fmt: skip
    return _dataset(trials, columns)


def _column(records: list[dict[str, Any]], key: str) -> Any:
    return np.array([np.nan if record.get(key) is None else record[key] for record in records])


def _figures(trials: Trials, tuned: Judged, default: Judged, bound: Any) -> Columns:
    """Metric and start time, tuned and with the defaults, of each cell."""
    question = trials.question
    name, share = question.metric_name, question.quantile
    over = "" if len(question.scenarios) == 1 else f", quantile {share:g} over the tolerances"
    columns: Columns = {
        name: (_over_scenarios(tuned.metric, share), "", f"{name}, tuned{over}"),
        f"{name}_default": (_over_scenarios(default.metric, share), "", f"{name} of the defaults{over}"),
    }
    if over:
        columns[f"{name}_as_is"] = (tuned.metric[:, 0], "", f"{name}, tuned, nothing off")
    if name != "start_time":
        columns["start_time"] = (tuned.start_time[:, 0], "s", "start time, tuned, nothing off")
        columns["start_time_default"] = (
            default.start_time[:, 0],
            "s",
            "start time of the defaults, nothing off",
        )
    columns["start_time_bound"] = (bound[:, 0], "s", "bound on the start time, nothing off")
    late = excess(tuned.start_time, bound, share)
    columns["excess"] = (late, "1", "share by which the start time is beyond its bound, 0 if not")
    columns["excess_default"] = (excess(default.start_time, bound, share), "1", "the same of the defaults")
    columns["in_time"] = (late == 0.0, "", "whether the bound is kept")
    return columns


def _over_scenarios(values: Any, share: float) -> Any:
    """The quantile over the scenarios of each cell; NaN where a start fails."""
    found = upper(np.where(np.isnan(values), np.inf, values), share)
    return np.where(np.isinf(found), np.nan, found)


def _quantile(values: Any, share: float) -> float:
    return float(_over_scenarios(values, share))


def _dataset(trials: Trials, columns: Columns) -> xarray.Dataset:

    import xarray

    question = trials.question
    shape = (len(question.gaps), len(question.load_inertias))
    data = {
        name: (
            ("gap", "load_inertia"),
            np.asarray(values).reshape(shape),
            {"units": unit, "long_name": meaning},
        )
        for name, (values, unit, meaning) in columns.items()
    }
    coordinates = {
        "gap": ("gap", np.array(question.gaps), {"units": "rad", "long_name": "total gap"}),
        "load_inertia": (
            "load_inertia", np.array(question.load_inertias), {"units": "kg*m^2", "long_name": "inertia J2"},
        ),
    }  # fmt: skip
    return xarray.Dataset(data, coords=coordinates)


Optima = dict[tuple[int, float], dict[str, Any]]  # by cell and bound in s


class Asked(NamedTuple):
    """An optimum: its cell, the bound on the start time in s, the drive, and that to which K_dyn refers."""

    cell: int
    bound: float
    drive: Machine
    base: Machine | None


def optima(
    pool: Pool, question: Question, saved: Records, log: Log, bounds: list[tuple[int, float]]
) -> Optima:
    """The least K_dyn of cells within bounds on the start time, each with its lower bound."""
    asked = list(dict.fromkeys((cell, bound) for cell, bound in bounds if math.isfinite(bound)))
    found: Optima = {}
    for cell, bound in asked:
        record = saved.find(("optimum", cell, bound))
        if record is not None:
            found[cell, bound] = {name: value for name, value in record.items() if name != "part"}
    missing = [
        Asked(cell, bound, question.drive_of(cell), question.base)
        for cell, bound in asked
        if (cell, bound) not in found
    ]
    log.begin("optima", len(asked), len(found))
    for one, record in pool.results(optimum_of, missing):
        found[one.cell, one.bound] = record
        if record["status"] != "NOT_FOUND":  # another attempt may find it
            saved.add({"part": ("optimum", one.cell, one.bound), **record})
        log.did(0)
    return found


def optimum_of(asked: Asked) -> dict[str, Any]:
    """The optimum of a drive or chain, its motor without torque lag and rate limit: the harder yardstick.

    Where the start position is unknown, that of the hardest one as if it were known: no gains beat it.
    """
    names = {"torque_lag": 0.0, "torque_rate": math.inf, "computing_delay": 0.0, "torque_noise": 0.0}
    ideal = asked.drive.with_values(names)
    nothing = {"k_dyn": None, "k_dyn_lower_bound": None, "method": ""}
    try:
        each = [
            optimize(one, asked.bound, terminal="reached", base=asked.base)
            for one in ideal.positions.values()
        ]
    except InfeasibleError:
        return {**nothing, "status": "INFEASIBLE"}
    except (OptimumError, InputError):
        return {**nothing, "status": "NOT_FOUND"}
    best = max(each, key=lambda one: one.k_dyn)
    low = None if best.bound.kind == "none" else best.bound.k_dyn
    return {"k_dyn": best.k_dyn, "k_dyn_lower_bound": low, "method": best.method, "status": "OPTIMAL"}
