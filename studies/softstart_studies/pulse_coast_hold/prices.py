"""What each unknown and each imperfection costs, one after the other."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from softstart.study import Progress, Table
from softstart_controllers.pulse_coast_hold import PulseCoastHold
from softstart_studies.pulse_coast_hold.crane import TOLD, Extent, ideal, optimum, run, starts

CELLS = ((0.5, 3.0), (0.5, 5.0), (1.0, 4.0), (2.0, 5.0))  # gap in rad, J2/J1: K_dyn below 1
PERFECT: dict[str, Any] = {"torque_lag": 0.0, "encoder_lines": 0}


@dataclass(frozen=True)
class Price:
    """K_dyn over the optimum of an ideal torque, over cells and phases."""

    what: str
    mean: float
    most: float


def prices(extent: Extent, progress: Progress) -> list[Price]:
    """From everything known and ideal to the controller as it is."""
    steps: tuple[tuple[str, dict[str, Any], dict[str, Any]], ...] = (
        ("ideal; J2 told", PERFECT, {"hold_share": 0.0, "inertia_ratio": None}),
        ("J2 unknown", PERFECT, {"hold_share": 0.0}),
        ("4096 encoder lines", {"torque_lag": 0.0}, {"hold_share": 0.0}),
        ("torque lag 2 ms", {}, {"hold_share": 0.0}),
        ("peak raised to 0.98 M12avg", {}, {}),
    )
    found = []
    for name, changed, given in steps:
        progress(f"price of: {name}")
        over = np.concatenate([_over(gap, ratio, changed, given, extent) for gap, ratio in CELLS])
        found.append(Price(name, float(over.mean()), float(over.max())))
    return found


def _over(gap: float, ratio: float, changed: dict[str, Any], given: dict[str, Any], extent: Extent) -> Any:
    given = {name: ratio if value is None else value for name, value in given.items()}
    batch = starts("active", (gap,), (ratio,), extent.phases, **changed)
    runs = run(batch, PulseCoastHold(**given), TOLD.replace(**changed))
    best = [optimum(ideal("active", gap, ratio), float(time)) for time in runs.start_time.ravel()]
    return runs.k_dyn.ravel() / np.array(best)


def table(found: list[Price]) -> Table:
    """A row a step; each keeps what the ones before brought."""
    return Table(
        "What each costs, active load, cells with K_dyn below 1",
        ("and then", "over the optimum, mean", "over the optimum, most"),
        [(price.what, round(price.mean, 4), round(price.most, 4)) for price in found],
    )
