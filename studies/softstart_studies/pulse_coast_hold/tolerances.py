"""What is left of it when stiffness, motor inertia, lag and dead time are not as the controller is told."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from softstart.drive import LoadKind
from softstart.study import Progress, Table
from softstart_studies.pulse_coast_hold.cells import CONTROLLER
from softstart_studies.pulse_coast_hold.crane import LAG, TOLD, Extent, ideal, optimum, run, starts

STIFFNESS, INERTIA = 0.10, 0.05  # tolerances
PERIOD = 0.001  # s


@dataclass(frozen=True)
class Case:
    """One deviation, the worst of its cells and phases."""

    kind: LoadKind
    what: str
    k_dyn: float  # the most
    over: float  # the optimum of the drive as it is: the most, at most


def cases(kind: LoadKind, extent: Extent, progress: Progress) -> list[Case]:
    """As told; stiffness and motor inertia together; the lags that are assumed; the dead time.

    The optimum is that of the longest start time of a cell, rounded up to whole per cent, where it is
    smaller than at the others: a ratio so is an upper bound of those of all phases.
    """
    asked: list[tuple[str, dict[str, Any], dict[str, Any]]] = [("as told", {}, {})]
    for by_c, by_J in product(extent.deviations, repeat=2):
        really = {
            "stiffness": float(TOLD.c) * (1.0 + by_c * STIFFNESS),
            "motor_inertia": float(TOLD.J1) * (1.0 + by_J * INERTIA),
        }
        if (by_c, by_J) != (0.0, 0.0):
            asked.append((f"c {_percent(by_c * STIFFNESS)}, J1 {_percent(by_J * INERTIA)}", {}, really))
    asked += [(f"lag assumed {1000 * lag:g} ms", {"torque_lag": lag}, {}) for lag in (0.5 * LAG, 1.5 * LAG)]
    asked.append((f"dead time {1000 * PERIOD:g} ms", {}, {"computing_delay": PERIOD}))
    found = []
    for name, told, really in asked:
        progress(f"{kind} load, {name}")
        found.append(_case(kind, name, told, really, extent))
    return found


def _percent(deviation: float) -> str:
    return f"{100 * deviation:+.0f} %" if deviation else "as told"


def rounded_up(time: float) -> float:
    """To the next power of 1.01: starts that take about as long then share an optimum.

    >>> round(rounded_up(0.25), 6)
    0.250801
    """
    return float(1.01 ** np.ceil(np.log(time) / np.log(1.01)))


def _case(kind: LoadKind, name: str, told: dict[str, Any], really: dict[str, Any], extent: Extent) -> Case:
    batch = starts(kind, extent.tolerance_gaps, extent.tolerance_ratios, extent.phases, **really)
    runs = run(batch, CONTROLLER, TOLD.replace(load_kind=kind, **told))
    most = runs.k_dyn.max(axis=-1)
    latest = runs.start_time.max(axis=-1)
    over = np.array(
        [
            [most[i, j] / optimum(ideal(kind, gap, ratio, **really), rounded_up(latest[i, j]))
             for j, ratio in enumerate(extent.tolerance_ratios)]
            for i, gap in enumerate(extent.tolerance_gaps)
        ]
    )  # fmt: skip
    return Case(kind, name, float(most.max()), float(over.max()))


def table(found: list[Case]) -> Table:
    """A row a deviation."""
    return Table(
        "pulse-coast-hold, tolerances: the worst gap, inertia and encoder phase",
        ("load", "really", "K_dyn, most", "over the optimum, most"),
        [(case.kind, case.what, round(case.k_dyn, 4), round(case.over, 4)) for case in found],
    )
