"""What tuning has found as tables, and the price of robustness beside the optimum of each cell."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from softstart.arrays import Vector
from softstart.controller.tuned import GainSchedule, RobustGains, derived_from_nominal
from softstart.drive.machine import Machine
from softstart.errors import InputError
from softstart.optimal.optimize import optimize
from softstart.optimal.result import InfeasibleError, OptimumError
from softstart.parallel import Pool
from softstart.store import PartStore
from softstart.tuning.gains import GainSearch, StartCounter
from softstart.tuning.outcome import RobustSet, gains_on_grid
from softstart.tuning.problem import TuningProblem
from softstart.tuning.search import agreement
from softstart.tuning.trials import Judged, Trials, excess, upper

if TYPE_CHECKING:
    import xarray

Columns = dict[str, tuple[Any, str, str]]  # name -> values of the cells, unit, meaning


def schedule_table(trials: Trials, search: GainSearch) -> xarray.Dataset:
    """The schedule with what it reaches."""
    columns: Columns = {
        one.name: (search.values[one.name], one.unit, f"tuned, within {one.text()}")
        for one in trials.problem.ranges
    }
    columns |= {f"{one.name}_default": (trials.defaults[one.name], one.unit, "default")
                for one in trials.problem.ranges}  # fmt: skip
    columns |= _figures(trials, search.judged)
    near = np.array(list(map(agreement, search.restart_costs, search.costs)))
    columns["agreement"] = (near, "1", "searches within 1 % of the best")
    return _dataset(trials.problem, columns)


def robust_outcome(trials: Trials, search: GainSearch) -> RobustSet:
    """The robust set with what it reaches."""
    quantile = trials.problem.quantile
    values = {name: float(value[0]) for name, value in search.values.items()}
    ready, nominal = replace(trials.controller, **values).set_up(trials.drives[0])
    if len(trials.problem.drive.positions) > 1:  # controllers are set up for mid-gap; the drive has no such
        nominal = nominal.replace(start_position="unknown")
    problem = trials.problem
    names, tuned = problem.names, RobustGains("robust", ready, nominal, problem.gaps, problem.load_inertias)
    given = replace(trials.controller, **{name: values[name] for name in names})
    cells = [trials.problem.drive_of(cell).design_drive for cell in range(len(trials.problem.cells))]
    ends = None
    if trials.problem.soft is not None:  # scenarios of the stiff end, then as many of the soft one
        each = _by_cell(trials, search.judged.metric).reshape(len(trials.problem.cells), 2, -1)
        stiff, soft = (float(_over_scenarios(each[:, k].ravel(), quantile)) for k in range(2))
        ends = stiff, soft
    both = search.judged, trials.default
    worst, worst_default = (float(_over_scenarios(one.metric[0], quantile)) for one in both)
    return RobustSet(
        parameters=ready.parameters,
        gains={name: values[name] for name in names},
        defaults={name: float(value[0]) for name, value in trials.defaults.items()},
        worst=worst,
        worst_default=worst_default,
        excess=float(excess(search.judged.start_time, trials.bound, quantile)[0]),
        agreement=agreement(search.restart_costs[0], float(search.costs[0])),
        restarts=trials.problem.restarts,
        cells=_dataset(trials.problem, _figures(trials, search.judged)),
        controller=tuned,
        derived=derived_from_nominal(tuned, given, cells),
        ends=ends,
    )


def between_table(trials: Trials, search: GainSearch) -> xarray.Dataset | None:
    """The schedule half way between the cells, where its gains are interpolated; None for a single cell."""
    problem = trials.problem
    if len(problem.cells) == 1:
        return None
    gains = gains_on_grid(problem, search.values)
    halves = replace(problem, gaps=_halves(problem.gaps), load_inertias=_halves(problem.load_inertias))
    between = Trials(halves, robust=False)
    schedule = GainSchedule(
        "schedule", trials.controller, *problem.declared(),
        tuple((name, *gain) for name, gain in gains.items()),
    )  # fmt: skip
    each = [schedule.gains_at(one.gap, one.load_inertia) for one in between.drives]
    interpolated = {name: np.array([gains[name] for gains in each]) for name in search.values}
    judged = between.judged(np.arange(len(each)), interpolated, to_the_end=True)
    return _dataset(halves, _figures(between, judged))


def _halves(axis: tuple[float, ...]) -> tuple[float, ...]:
    """The middles between values; of one value itself."""
    return tuple(0.5 * (a + b) for a, b in pairwise(axis)) or axis


def price_table(sides: dict[str, tuple[Trials, GainSearch]], best: Optima) -> xarray.Dataset | None:
    """Schedule, robust set and optimum within the same time, side by side."""
    both = len(sides) == 2
    if not (both or best):
        return None
    columns: Columns = {}
    late: NDArray[np.bool_] | bool = False
    for side, (trials, search) in sides.items():
        problem, bounds = trials.problem, _by_cell(trials, trials.bound)[:, 0]
        values = _over_scenarios(_by_cell(trials, search.judged.metric), problem.quantile)
        # what is later than allowed is no match for an optimum, or another set, within that time
        over = excess(
            _by_cell(trials, search.judged.start_time), _by_cell(trials, trials.bound), problem.quantile
        )
        late = late | (over > 0.0)
        columns[side] = (values, "1", f"{problem.metric_name} of the {side}")
        columns[f"{side}_bound"] = (bounds, "s", "bound on the start time")
        if best:
            nothing = None, None
            each = [best.get((cell, float(bound)), nothing) for cell, bound in enumerate(bounds)]
            least, low = np.array(each, dtype=np.float64).T  # None becomes NaN
            columns[f"{side}_optimum"] = (least, "1", "minimum K_dyn of any start within the bound")
            columns[f"{side}_lower_bound"] = (low, "1", "its lower bound")
            ratio = np.where(over > 0.0, math.nan, values / least)
            columns[f"{side}_over_optimum"] = (ratio, "1", f"{side} over optimum, if in time")
    if both:
        schedule = columns["schedule"][0]  # 0 where an overshoot is avoided
        ratio = columns["robust"][0] / np.where(late | (schedule == 0.0), math.nan, schedule)
        columns["robust_over_schedule"] = (ratio, "1", "robust set over schedule, if both are in time")
    return _dataset(problem, columns)


def _by_cell(trials: Trials, values: Vector) -> Vector:
    """Values of all starts. Axes: cell, scenario."""
    return np.reshape(values, (-1, len(trials.problem.scenarios)))


def _figures(trials: Trials, judged: Judged) -> Columns:
    """Metric and start time, tuned and with the defaults, of each cell."""
    problem, bound = trials.problem, _by_cell(trials, trials.bound)
    name, share, columns = problem.metric_name, problem.quantile, Columns()
    over = "" if len(problem.scenarios) == 1 else f", quantile {share:g} over the tolerances"
    for end, what, one in (("", "tuned", judged), ("_default", "of the defaults", trials.default)):
        metric, time = (_by_cell(trials, part) for part in one)
        shown = np.where(time == 0.0, math.nan, time)  # of a duty without a start
        columns[f"{problem.time}{end}"] = (shown[:, 0], "s", f"{problem.time_name}, {what}, nominal")
        columns[f"{name}{end}"] = (_over_scenarios(metric, share), "", f"{name}, {what}{over}")
        if over and not end:
            columns[f"{name}_as_is"] = (metric[:, 0], "", f"{name}, tuned, nominal")
        late = excess(time, bound, share)
        columns[f"excess{end}"] = (late, "1", f"relative violation of the bound on the time, {what}")
    columns[f"{problem.time}_bound"] = (bound[:, 0], "s", f"bound on the {problem.time_name}, nominal")
    within = f"whether the {problem.time_name} is within its bound"
    columns["in_time"] = (columns["excess"][0] == 0.0, "", within)
    return columns


def _over_scenarios(values: Vector, share: float) -> Vector:
    """The quantile over the scenarios of each cell; NaN where a start fails."""
    worst = upper(np.where(np.isnan(values), np.inf, values), share)
    return np.where(np.isinf(worst), np.nan, worst)


def _dataset(problem: TuningProblem, columns: Columns) -> xarray.Dataset:
    import xarray

    shape, dims = (len(problem.gaps), len(problem.load_inertias)), ("gap", "load_inertia")
    data = {
        name: (dims, np.asarray(values).reshape(shape), {"units": unit, "long_name": meaning})
        for name, (values, unit, meaning) in columns.items()
    }
    coordinates = {
        "gap": ("gap", np.array(problem.gaps), {"units": "rad", "long_name": "total gap"}),
        "load_inertia": (
            "load_inertia", np.array(problem.load_inertias), {"units": "kg*m^2", "long_name": "inertia J2"}
        ),
    }  # fmt: skip
    return xarray.Dataset(data, coords=coordinates)


# least K_dyn and its lower bound by cell and bound in s; None where there is none
Optima = dict[tuple[int, float], tuple[float | None, float | None]]


class CellOptimum(NamedTuple):
    """An optimum: its cell, the bound on the start time in s, and the drive, to which K_dyn refers."""

    cell: int
    bound: float
    drive: Machine


def cell_optima(pool: Pool, sides: Iterable[Trials], saved: PartStore, log: StartCounter) -> Optima:
    """The least K_dyn of each cell within its bounds on the start time, each with its lower bound."""
    optima: Optima = {}
    missing: dict[tuple[int, float], CellOptimum] = {}
    for trials in sides:
        for cell, bound in enumerate(_by_cell(trials, trials.bound)[:, 0].tolist()):
            if record := saved.find(("optimum", cell, bound)):
                optima[cell, bound] = record["k_dyn"], record["lower_bound"]
            elif math.isfinite(bound):
                missing[cell, bound] = CellOptimum(cell, bound, trials.problem.drive_of(cell))
    for done, (one, best) in enumerate(pool.results(optimum_of, missing.values())):
        log.tell("optima", done, len(missing), "cell")
        optima[one.cell, one.bound] = best
        if best[0] is not None:  # else another attempt may find it
            part = ("optimum", one.cell, one.bound)
            saved.add({"part": part, "k_dyn": best[0], "lower_bound": best[1]})
    return optima


def optimum_of(task: CellOptimum) -> tuple[float | None, float | None]:
    """The optimum of a drive or chain, its motor without torque lag and rate limit: the harder yardstick.

    Where the start position is unknown, that of the hardest one as if it were known: no gains beat it.
    """
    names = {"torque_lag": 0.0, "torque_rate": math.inf, "computing_delay": 0.0, "torque_noise": 0.0}
    ideal = task.drive.with_values(names)
    try:
        each = [optimize(one, task.bound, terminal="reached") for one in ideal.positions.values()]
    except (InfeasibleError, OptimumError, InputError):
        return None, None
    best = max(each, key=lambda one: one.k_dyn)
    return best.k_dyn, None if best.bound.kind == "none" else best.bound.k_dyn
