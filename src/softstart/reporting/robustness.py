"""K_dyn over gap and load inertia, each strategy as it was set up for the nominal drive."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softstart.controller import Controller
from softstart.drive import Drive
from softstart.start import metrics
from softstart.start.batch import array_starts, figures

Matrix = NDArray[np.float64]

GAPS = (0.5, 0.7, 1.0, 1.4, 2.0, 2.8, 4.0)  # of the drive's own
INERTIAS = (0.4, 0.6, 0.8, 1.0, 1.25)


@dataclass(frozen=True, eq=False)
class RobustnessMap:
    """K_dyn and start time (s) of one strategy: a row a gap (rad), a column a load inertia (kg m2).

    K_dyn refers to the mean torque of the nominal drive, so that it compares shaft torques. NaN where the
    start was not finished or the load did not reach its target speed.
    """

    gaps: tuple[float, ...]
    inertias: tuple[float, ...]
    k_dyn: Matrix
    start_time: Matrix

    @property
    def failed(self) -> int:
        """In how many cells there is no start."""
        return int(np.isnan(self.k_dyn).sum())

    @property
    def worst(self) -> float:
        """The largest K_dyn; NaN if a cell has none."""
        return float(np.max(self.k_dyn))

    @property
    def worst_at(self) -> tuple[float, float]:
        """Gap (rad) and load inertia (kg m2) of the worst cell."""
        row, column = np.unravel_index(
            int(np.argmax(np.nan_to_num(self.k_dyn, nan=math.inf))), self.k_dyn.shape
        )
        return self.gaps[row], self.inertias[column]

    def summary(self) -> dict[str, Any]:
        """As plain data."""
        return {
            "gaps": list(self.gaps),
            "load_inertias": list(self.inertias),
            "k_dyn": self.k_dyn.tolist(),
            "start_time": self.start_time.tolist(),
            "worst_k_dyn": self.worst,
        }


def axes_of(drive: Drive) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Gaps (rad) and load inertias (kg m2) of the map; a drive without a gap has one row.

    >>> axes_of(Drive.load("crane-4amtkf"))[0]
    (0.25, 0.35, 0.5, 0.7, 1.0, 1.4, 2.0)
    """
    gap, inertia = float(drive.gap), float(drive.J2)
    gaps = tuple(float(f"{share * gap:.12g}") for share in GAPS) if gap > 0.0 else (0.0,)
    return gaps, tuple(float(f"{share * inertia:.12g}") for share in INERTIAS)


def robustness(drive: Drive, controller: Controller) -> RobustnessMap:
    """The map of a controller that was set up for `drive`."""
    gaps, inertias = axes_of(drive)
    shape = len(gaps), len(inertias)
    many = drive.replace(gap=np.array(gaps)[:, None], load_inertia=np.array(inertias)[None, :])
    notes = array_starts(many, controller, fitted_to=drive)
    found = figures(notes, metrics.base_torque(drive))
    time = np.asarray(found["start_time"][0], dtype=np.float64).reshape(shape)
    k = np.asarray(found["k_dyn"][0], dtype=np.float64).reshape(shape)
    return RobustnessMap(gaps, inertias, np.where(np.isnan(time), np.nan, k), time)
