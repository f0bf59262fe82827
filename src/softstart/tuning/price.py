"""The certified optimum of each cell: how good any start within the same time could be."""

from __future__ import annotations

import math
from typing import Any

from softstart.errors import InputError
from softstart.tuning.log import Log
from softstart.tuning.saved import SavedParts
from softstart.tuning.trials import Trials
from softstart.tuning.workers import Workers

Optima = dict[tuple[int, float], dict[str, Any]]  # by cell and bound in s


def optima(workers: Workers, saved: SavedParts, log: Log, bounds: list[tuple[int, float]]) -> Optima:
    """The least K_dyn of cells within bounds on the start time, each with its lower bound."""
    asked = list(dict.fromkeys((cell, bound) for cell, bound in bounds if math.isfinite(bound)))
    found: Optima = {}
    for one in asked:
        record = saved.find(("optimum", *one))
        if record is not None:
            found[one] = record
    missing = [one for one in asked if one not in found]
    log.begin("certified optima", len(asked), len(found))
    for k, record in workers.each(optimum_of, missing):
        found[missing[k]] = record
        if record["status"] != "NOT_FOUND":  # another attempt may find it
            saved.add(("optimum", *missing[k]), record)
        log.did(0)
    return found


def optimum_of(trials: Trials, cell: int, bound: float) -> dict[str, Any]:
    """The optimum of a cell's drive, its motor without torque lag and rate limit: the harder yardstick."""
    from softstart.optimal.collocation import NotConverged
    from softstart.optimal.result import InfeasibleError, OptimumError
    from softstart.optimal.solving import optimize

    question = trials.question
    ideal = question.drive_of(cell).replace(
        torque_lag=0.0, torque_rate=math.inf, computing_delay=0.0, torque_noise=0.0
    )
    nothing = {"k_dyn": None, "k_dyn_lower_bound": None, "method": ""}
    try:
        best = optimize(ideal, bound, terminal="reached", base=question.base)
    except InfeasibleError:
        return {**nothing, "status": "INFEASIBLE"}
    except (OptimumError, NotConverged, InputError):
        return {**nothing, "status": "NOT_FOUND"}
    low = best.k_dyn_lower_bound
    return {
        "k_dyn": best.k_dyn,
        "k_dyn_lower_bound": low if low is not None and math.isfinite(low) else None,
        "method": best.method,
        "status": "OPTIMAL",
    }
