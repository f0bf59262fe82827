"""The drive of the study, what its controllers are told of it, and how much of it all is worked out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softstart import Drive, Records, records
from softstart.controller import Controller
from softstart.drive import LoadKind
from softstart.optimal.optimize import optimize
from softstart.optimal.result import OptimumError
from softstart.start.batch import prepared
from softstart_studies.paper_g.crane import published

TARGET = 60.0  # rad/s
LAG = 0.002  # s
# [G] with the lag of an inverter; 4096 encoder lines and 1 kHz are the defaults. Its gap (0.5 rad) and load
# inertia (5 J1) are what the controllers are told, whatever they are.
TOLD = Drive.load("crane-4amtkf").replace(target_speed=TARGET, torque_lag=LAG)


@dataclass(frozen=True)
class Extent:
    """How much is worked out: the whole study, or a part of it for a quick look."""

    kinds: tuple[LoadKind, ...] = ("reactive", "active")
    gaps: tuple[float, ...] = (0.5, 1.0, 1.5, 2.0)  # rad
    ratios: tuple[float, ...] = (2.0, 3.0, 4.0, 5.0)  # J2/J1
    phases: int = 16  # of the encoder, evenly over a count
    tolerance_gaps: tuple[float, ...] = (0.5, 2.0)
    tolerance_ratios: tuple[float, ...] = (2.0, 5.0)
    deviations: tuple[float, ...] = (-1.0, 0.0, 1.0)  # of stiffness and motor inertia, in tolerances


def starts(
    kind: LoadKind,
    gaps: Sequence[float],
    ratios: Sequence[float],
    phases: int,
    **changed: Any,
) -> Records:
    """Drives over (gap, J2, encoder phase); J2 in J1 of the drive that the controllers are told.

    >>> starts("active", (0.5, 2.0), (2.0, 5.0), 4).shape
    (2, 2, 4)
    """
    return records(
        TOLD,
        load_kind=kind,
        gap=np.asarray(gaps)[:, None, None],
        load_inertia=float(TOLD.J1) * np.asarray(ratios)[None, :, None],
        encoder_phase=(np.arange(phases) / phases)[None, None, :],
        **changed,
    )


@dataclass(frozen=True)
class Starts:
    """What came out of a batch; arrays over (gap, J2, encoder phase)."""

    k_dyn: NDArray[np.float64]
    start_time: NDArray[np.float64]  # s
    contacts: NDArray[np.float64]


def run(batch: Records, controller: str | Controller, told: Drive) -> Starts:
    """Start all drives of the batch under a controller set up for the drive that it is told."""
    ready = published(controller) if isinstance(controller, str) else controller
    found = prepared(batch).figures(ready.set_ups(told), batch.mean_torque)
    return Starts(*(found[name][0].reshape(batch.shape) for name in ("k_dyn", "start_time", "contacts")))


def ideal(kind: LoadKind, gap: float, ratio: float, **changed: Any) -> Drive:
    """The drive of a cell as the optimum gets it: its torque follows at once, which is the harder bar."""
    drive = TOLD.replace(load_kind=kind, gap=gap, load_inertia=ratio * float(TOLD.J1), **changed)
    return drive.replace(torque_lag=0.0, computing_delay=0.0)


@cache
def optimum(drive: Drive, start_time: float) -> float:
    """K_dyn of the optimum, terminal reached, at this start time.

    Where `optimize` finds none it can confirm, 0.01 % more time is given: that can only lower the bar.
    """
    for _ in range(20):
        try:
            return optimize(drive, start_time, terminal="reached").k_dyn
        except OptimumError:
            start_time *= 1.0001
    raise OptimumError(f"no confirmed optimum of {drive.name} near {start_time:g} s.")
