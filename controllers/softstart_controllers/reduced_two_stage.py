"""Method 2 of [G]: reduced torque through the first gap and the first contact."""

from __future__ import annotations

import math
from dataclasses import dataclass

from softstart.controller import Numbers, parameter
from softstart.drive import Drive
from softstart_controllers.reduced import ReducedTorque, delay_of, raise_parameter


@dataclass(frozen=True)
class ReducedTwoStage(ReducedTorque):
    """Torque reduced through stages 1 and 2, then Ms (method 2 of [G]), switched at the gap's own events.

    The torque is raised at the peak of stage 2, after the time of [G](14) for the nominal drive (`raise_at`
    "peak"): the gap then stays closed.

    [G] raises it at the end of stage 2 (`raise_at` "end"), (18) with M1(2) = M1(1)
    (`run.k_dyn_first_contact`). But then the gap opens again, and the second contact is as hard as the first
    one of method 1 (`run.k_dyn`).

    Where damping keeps the gap closed, stage 2 has no end; the torque is then raised `contact_timeout` after
    contact.

    >>> from softstart import Drive, simulate
    >>> run = simulate(Drive.load("crane-4amtkf"), ReducedTwoStage(torque=0.25 * 62, raise_at="end"))
    >>> round(run.k_dyn_first_contact, 4), round(run.k_dyn, 4)
    (1.2677, 2.3894)
    """

    name = "reduced-two-stage"
    summary = "torque reduced through the first gap and the first contact, then Ms (method 2)"
    source = "[G](18)"

    contact_timeout: float = parameter(
        "s", "longest wait after contact", lambda drive, p: 2.0 * drive.elastic_period,
        "two elastic periods; an undamped stage 2 lasts less than one",
    )  # fmt: skip
    raise_at: str = raise_parameter()

    def numbers(self, drive: Drive) -> Numbers:
        """The wait: until the torque peak, or until the gap opens, at most `contact_timeout`."""
        peak = delay_of(drive, self.torque, "peak") if self.raise_at == "peak" else math.inf
        return {"wait": min(peak, self.contact_timeout)}
