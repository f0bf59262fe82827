"""Method 1 of [G]: reduced torque while the gap is open for the first time."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar

from softstart.controller import CompiledController, Sensor, compiled_step, parameter, stack
from softstart.controller.compiled import MEASURED, NEVER, Answer, Vector, named, record
from softstart.drive import Drive
from softstart_controllers.reduced import reduced_torque


class Parameters:
    """What the step is given."""

    reduced: float
    full: float


PARAMETERS, COMMAND = record(Parameters), record(Answer)


@compiled_step
def step(parameters: Vector, measured: Vector, state: Vector, command: Vector) -> None:
    """Reduced in stage 1; the stage number changes at the instant of contact."""
    p = named(parameters, PARAMETERS)
    y = named(command, COMMAND)
    waiting = named(measured, MEASURED).stage < 2.0
    y.torque = p.reduced if waiting else p.full
    y.ask_again = math.inf if waiting else NEVER


@dataclass(frozen=True)
class ReducedFirstStage(CompiledController):
    """Torque reduced in stage 1, then Ms (method 1 of [G]), switched at the very instant of contact.

    K_dyn = 1 + sqrt(1 + (c dw12/(Omega M12avg))^2) [G](17): the softer landing lowers dw12, but the step to
    Ms at contact alone gives 2, so K_dyn never falls below 2. An idealised strategy: it sees the gap.

    >>> from softstart import Drive, simulate
    >>> round(simulate(Drive.load("crane-4amtkf"), ReducedFirstStage(torque=0.25 * 62)).k_dyn, 4)
    2.3894
    """

    name: ClassVar[str] = "reduced-first-stage"
    summary: ClassVar[str] = "torque reduced while the gap is first open, Ms from contact on (method 1)"
    source: ClassVar[str] = "[G](17)"
    sensors: ClassVar[Sensor] = Sensor.STAGE
    kernel: ClassVar[Any] = step

    torque: float | None = parameter(
        "N*m",
        "reduced torque of stage 1",
        "load torque plus 15 % of the accelerating torque",
        multiples=(0.3, 4.0),
    )
    full_torque: float | None = parameter(
        "N*m", "torque from contact on", "starting torque Ms", multiples=(0.4, 1.0)
    )

    def defaults(self, drive: Drive) -> dict[str, Any]:
        """Reduced torque from the drive's load and starting torque."""
        return {"torque": reduced_torque(drive), "full_torque": drive.Ms}

    def vector(self, drive: Drive) -> Vector:
        """(torque, full torque)."""
        return stack(self.torque, self.full_torque)
