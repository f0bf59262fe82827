"""Method 1 of [G]: reduced torque while the gap is open for the first time."""

from __future__ import annotations

from dataclasses import dataclass

from softstart.controller import Numbers
from softstart.drive import Drive
from softstart_controllers.reduced import ReducedTorque


@dataclass(frozen=True)
class ReducedFirstStage(ReducedTorque):
    """Torque reduced in stage 1, then Ms (method 1 of [G]), switched at the very instant of contact.

    K_dyn = 1 + sqrt(1 + (c dw12/(Omega M12avg))^2) [G](17): the softer landing lowers dw12, but the step to
    Ms at contact alone gives 2, so K_dyn never falls below 2. An idealised strategy: it sees the gap.

    >>> from softstart import Drive, simulate
    >>> round(simulate(Drive.load("crane-4amtkf"), ReducedFirstStage(torque=0.25 * 62)).k_dyn, 4)
    2.3894
    """

    name = "reduced-first-stage"
    summary = "torque reduced while the gap is first open, Ms from contact on (method 1)"
    source = "[G](17)"

    def numbers(self, drive: Drive) -> Numbers:
        """The torque is raised at once."""
        return {"wait": 0.0}
