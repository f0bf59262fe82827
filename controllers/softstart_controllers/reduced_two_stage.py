"""Method 2 of [G]: reduced torque through the first gap and the first contact."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar

from softstart.controller import CompiledController, Sensor, compiled_step, parameter, stack
from softstart.controller.compiled import ASK_AGAIN, NEVER, STAGE, STATE, TIME, TORQUE, Vector
from softstart.drive import Drive
from softstart_controllers.reduced import reduced_torque


@compiled_step
def step(parameters: Vector, measured: Vector, state: Vector, command: Vector) -> None:
    """State = (instant by which the torque is raised at the latest, 0 before contact)."""
    t = measured[TIME]
    deadline = state[0]
    if measured[STAGE] >= 2.0 and deadline == 0.0:
        deadline = t + parameters[2]
    waiting = measured[STAGE] < 2.0 or (measured[STAGE] < 3.0 and t < deadline)
    command[TORQUE] = parameters[0] if waiting else parameters[1]
    if waiting:
        command[ASK_AGAIN] = deadline if deadline > t else math.inf
    else:
        command[ASK_AGAIN] = NEVER
    command[STATE] = deadline


@dataclass(frozen=True)
class ReducedTwoStage(CompiledController):
    """Torque reduced through stages 1 and 2, then Ms (method 2 of [G]), switched at the gap's own events.

    The peak of stage 2 follows [G](18) with M1(2) = M1(1) and may lie far below 2. But stage 2 ends with the
    gap open again and the masses parting at the speed they met with: raised then, the torque drives them
    into the second contact as hard as method 1 does into the first. The K_dyn of the whole start is
    therefore that of method 1; the one of [G](18) is `run.k_dyn_first_contact`.

    Where damping keeps the gap closed, stage 2 has no end; the torque is then raised `patience` after
    contact.

    >>> from softstart import Drive, simulate
    >>> run = simulate(Drive.load("crane-4amtkf"), ReducedTwoStage(torque=0.25 * 62))
    >>> round(run.k_dyn_first_contact, 4), round(run.k_dyn, 4)
    (1.2677, 2.3894)
    """

    name: ClassVar[str] = "reduced-two-stage"
    summary: ClassVar[str] = "torque reduced through the first gap and the first contact, then Ms (method 2)"
    source: ClassVar[str] = "[G](18)"
    sensors: ClassVar[Sensor] = Sensor.STAGE
    kernel: ClassVar[Any] = step
    state_size: ClassVar[int] = 1

    torque: float | None = parameter(
        "N*m",
        "reduced torque of stages 1 and 2",
        "load torque plus 15 % of the accelerating torque",
        multiples=(0.3, 4.0),
    )
    full_torque: float | None = parameter(
        "N*m", "torque from stage 3 on", "starting torque Ms", multiples=(0.4, 1.0)
    )
    patience: float | None = parameter(
        "s", "longest wait after contact", "two elastic periods; an undamped stage 2 lasts less than one"
    )

    def defaults(self, drive: Drive) -> dict[str, Any]:
        """Reduced torque from load and starting torque, patience from the elastic period."""
        return {
            "torque": reduced_torque(drive),
            "full_torque": drive.Ms,
            "patience": 2.0 * drive.elastic_period,
        }

    def vector(self, drive: Drive) -> Vector:
        """(torque, full torque, patience)."""
        return stack(drive, self.torque, self.full_torque, self.patience)
