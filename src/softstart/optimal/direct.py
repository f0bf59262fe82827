"""The start time that multiples such as 1.2x refer to."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from softstart.errors import SimulationError

if TYPE_CHECKING:
    from softstart.drive import Drive


def start_time_of_direct(drive: Drive) -> float:
    """Start time of the drive under its constant starting torque, s. Raises SimulationError without one.

    >>> from softstart import Drive
    >>> round(start_time_of_direct(Drive.load("crane-4amtkf")), 4)
    0.3735
    """
    from softstart.start.simulation import simulate

    run = simulate(drive, "direct")
    if math.isnan(run.start_time):
        raise SimulationError(
            f"direct does not bring this load to its target speed ({run.status.value[:-1]}); "
            "give start times in s instead of multiples."
        )
    return run.start_time
