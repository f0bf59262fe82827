"""The certified optimum of each cell: how good any start within the same time could be."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from softstart.drive import Drive
from softstart.errors import InputError
from softstart.processes import Pool
from softstart.store import Records
from softstart.tuning.log import Log
from softstart.tuning.question import Question

Optima = dict[tuple[int, float], dict[str, Any]]  # by cell and bound in s


class Asked(NamedTuple):
    """An optimum: its cell, the bound on the start time in s, the drive, and that to which K_dyn refers."""

    cell: int
    bound: float
    drive: Drive
    base: Drive | None


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
    log.begin("certified optima", len(asked), len(found))
    for one, record in pool.results(optimum_of, missing):
        found[one.cell, one.bound] = record
        if record["status"] != "NOT_FOUND":  # another attempt may find it
            saved.add({"part": ("optimum", one.cell, one.bound), **record})
        log.did(0)
    return found


def optimum_of(asked: Asked) -> dict[str, Any]:
    """The optimum of a drive, its motor without torque lag and rate limit: the harder yardstick."""
    from softstart.optimal.result import InfeasibleError, NotConverged, OptimumError
    from softstart.optimal.solving import optimize

    ideal = asked.drive.replace(torque_lag=0.0, torque_rate=math.inf, computing_delay=0.0, torque_noise=0.0)
    nothing = {"k_dyn": None, "k_dyn_lower_bound": None, "method": ""}
    try:
        best = optimize(ideal, asked.bound, terminal="reached", base=asked.base)
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
