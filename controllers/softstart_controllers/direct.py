"""Constant starting torque: the baseline."""

from __future__ import annotations

import math
from dataclasses import dataclass

from softstart.controller import CompiledController, Effort, compiled_step, parameter
from softstart.controller.compiled import Reply, Vector, as_record, record


class Parameters:
    """What the step is given."""

    torque: float


PARAMETERS, COMMAND = record(Parameters), record(Reply)


@compiled_step(PARAMETERS)
def step(parameters: Vector, measured: Vector, state: Vector, command: Vector) -> None:
    """One torque, once and for all."""
    y = as_record(command, COMMAND)
    y.torque = as_record(parameters, PARAMETERS).torque
    y.ask_again = math.inf


@dataclass(frozen=True)
class Direct(CompiledController):
    """Direct start: u = Ms from the first instant on.

    [G]: K_dyn = 1 + sqrt(1 + (c dw12/(Omega M12avg))^2), (17) with M1(1) = Ms.

    >>> from softstart import Drive, simulate
    >>> round(simulate(Drive.load("crane-4amtkf"), Direct()).k_dyn, 4)
    3.1179
    """

    name = "direct"
    summary = "constant starting torque, the baseline"
    source = "[G]"
    effort = Effort.CONTACTOR
    kernel = step

    torque: float = parameter("N*m", "motor torque", lambda drive, p: drive.Ms, "starting torque Ms")
