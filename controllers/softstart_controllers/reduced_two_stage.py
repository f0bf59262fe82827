"""Method 2 of [G]: reduced torque through the first gap and the first contact."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from softstart.controller import CompiledController, Sensor, parameter
from softstart.controller.compiled import size
from softstart.drive import Drive
from softstart_controllers.reduced import (
    PARAMETERS,
    STATE,
    delay_of,
    raise_parameter,
    reduced_torque_parameter,
    step_of_gap,
)
from softstart_controllers.sampled import full_torque_parameter


@dataclass(frozen=True)
class ReducedTwoStage(CompiledController):
    """Torque reduced through stages 1 and 2, then Ms (method 2 of [G]), switched at the gap's own events.

    The torque is raised at the peak of stage 2, after the time of [G](14) for the nominal drive (`raise_at`
    "peak"): the gap then stays closed.

    [G] raises it at the end of stage 2 (`raise_at` "end"). The peak of stage 2 follows [G](18) with
    M1(2) = M1(1) and may lie far below 2. But stage 2 ends with the gap open again and the masses parting at
    the speed they met with: raised then, the torque drives them into the second contact as hard as method 1
    does into the first. The K_dyn of the whole start is therefore that of method 1; the one of [G](18) is
    `run.k_dyn_first_contact`.

    Where damping keeps the gap closed, stage 2 has no end; the torque is then raised `contact_timeout` after
    contact.

    >>> from softstart import Drive, simulate
    >>> run = simulate(Drive.load("crane-4amtkf"), ReducedTwoStage(torque=0.25 * 62, raise_at="end"))
    >>> round(run.k_dyn_first_contact, 4), round(run.k_dyn, 4)
    (1.2677, 2.3894)
    """

    name: ClassVar[str] = "reduced-two-stage"
    summary: ClassVar[str] = "torque reduced through the first gap and the first contact, then Ms (method 2)"
    source: ClassVar[str] = "[G](18)"
    sensors: ClassVar[Sensor] = Sensor.STAGE
    kernel: ClassVar[Any] = step_of_gap
    state_size: ClassVar[int] = size(STATE)
    record: ClassVar[Any] = PARAMETERS

    torque: float | None = reduced_torque_parameter("reduced torque of stages 1 and 2")
    full_torque: float | None = full_torque_parameter("torque from stage 3 on")
    contact_timeout: float | None = parameter(
        "s", "longest wait after contact", lambda drive, p: 2.0 * drive.elastic_period,
        "two elastic periods; an undamped stage 2 lasts less than one",
    )  # fmt: skip
    raise_at: str | None = raise_parameter()

    def numbers(self, drive: Drive) -> dict[str, Any]:
        """The wait: until the torque peak, or until the gap opens, at most `contact_timeout`."""
        wait: Any = self.contact_timeout
        if self.raise_at == "peak":
            wait = min(delay_of(drive, self.torque, "peak"), wait)
        return {"wait": wait}
