"""`engage`: one engagement of a clutch."""

from __future__ import annotations

import math

from softstart.clutch.engaging import history
from softstart.clutch.model import Clutch
from softstart.clutch.result import Engagement, figures_of
from softstart.errors import InputError
from softstart.units import to_si

__all__ = ["engage"]

PATIENCE = 20.0


def engage(clutch: Clutch, *, until: float | str | None = None) -> Engagement:
    """Engage the clutch from rest, the shaft in the middle of its gap.

    The run ends at `until` (s), or else one elastic period 2 pi sqrt(Ic/cp) after the first lock-up (with a
    gap not before the twist has turned twice, and not while it slips again), so that the peak behind the
    lock-up is in it. Without damping a clutch may slip again in each period, ever less: give `until` to see
    more of that. Times of events, peaks and work are exact to about 1e-12 of their size: Taylor series of the
    24th order, located roots, no output grid. Raises InputError for an `until` that is none, SimulationError
    if the engagement cannot be finished.

    >>> run = engage(Clutch.load("paper-c"))
    >>> run.status, round(run.slip_time, 4), round(run.peak_ratio, 4), run.energy.residual < 1e-12
    ('LOCKED', 4.1527, 1.2123, True)
    """
    end: float | None = None
    if until is not None:
        end = float(to_si(until, "s", name="until"))
        if not end > 0.0:
            raise InputError(f"until = {until!r}: the end of the run is a time above 0 s.")
    law = clutch.friction
    periods = 2.0 * math.pi / clutch.locked_frequency + 2.0 * math.pi / clutch.B
    limit = PATIENCE * (max(clutch.rigid_slip_time, law.engaged_at) + periods)
    return figures_of(clutch, law, history(clutch, law, end, limit))
