"""K_dyn over gap and load inertia: the starts of a strategy on a grid of drives, row by row."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from softstart.controller.base import Controller
from softstart.drive import Drive
from softstart.page.scales import rounded
from softstart.start import metrics
from softstart.start.batch import array_starts, figures

Vector = NDArray[np.float64]

GAPS, INERTIAS = 25, 17
MAX_EVENTS = 20_000  # of one start of a map; a cell beyond stays empty


@dataclass(frozen=True)
class Axes:
    """The gaps (rad) and load inertias (kg m2) of a map, ascending."""

    gaps: tuple[float, ...]
    inertias: tuple[float, ...]

    def nearest(self, gap: float, inertia: float) -> tuple[int, int]:
        """Indices of the cell in which a drive lies: the gap's scale is even, the inertia's logarithmic."""
        column = int(np.argmin(np.abs(np.array(self.gaps) - gap)))
        row = int(np.argmin(np.abs(np.log(np.array(self.inertias) / inertia))))
        return column, row


def axes_about(origin: Drive, gaps: int = GAPS, inertias: int = INERTIAS) -> Axes:
    """Gaps up to four times that of the drive as it was loaded, inertias from a fifth to five times its own.

    >>> axes = axes_about(Drive.load("crane-4amtkf"), 5, 3)
    >>> axes.gaps, axes.inertias
    ((0.0, 0.5, 1.0, 1.5, 2.0), (0.035, 0.175, 0.875))
    """
    gap, inertia = float(origin.gap), float(origin.load_inertia)
    widest = 4.0 * gap if gap > 0.0 else 0.1
    return Axes(
        tuple(rounded(v, 6) for v in np.linspace(0.0, widest, gaps)),
        tuple(rounded(v, 6) for v in np.geomspace(inertia / 5.0, inertia * 5.0, inertias)),
    )


def k_dyn_row(
    drive: Drive,
    controller: Controller,
    gaps: tuple[float, ...],
    inertia: float,
    nominal: Drive | None = None,
) -> Vector:
    """K_dyn at one load inertia over the gaps; NaN where a start fails or is refused.

    The controller is set up for each drive, or for `nominal`, to whose mean torque K_dyn then refers. These
    are the figures of `softstart.simulate`, to the bit.
    """
    drives = drive.replace(gap=list(gaps), load_inertia=inertia)
    notes = array_starts(drives, controller, fitted_to=nominal, max_events=MAX_EVENTS)
    base = np.broadcast_to(metrics.base_torque(nominal or drives), (len(gaps),))
    k: Vector = figures(notes, base)["k_dyn"][0]
    return k
