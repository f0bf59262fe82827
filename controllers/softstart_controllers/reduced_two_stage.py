"""Method 2 of [G]: reduced torque through the first gap and the first contact."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar

from softstart.controller import CompiledController, Sensor, compiled_step, parameter, stack
from softstart.controller.compiled import MEASURED, NEVER, Answer, Vector, named, record
from softstart.drive import Drive
from softstart_controllers.reduced import RAISE_AT, delay_of, raise_parameter, reduced_torque
from softstart_controllers.sampled import check


class Parameters:
    """What the step is given."""

    reduced: float
    full: float
    patience: float


class State:
    """By when the torque is raised at the latest; 0 before contact."""

    deadline: float


PARAMETERS, STATE, COMMAND = record(Parameters), record(State), record(Answer, State)


@compiled_step
def step(parameters: Vector, measured: Vector, state: Vector, command: Vector) -> None:
    """Reduced until the gap opens again, or the deadline has passed."""
    p = named(parameters, PARAMETERS)
    m = named(measured, MEASURED)
    y = named(command, COMMAND)
    y.deadline = named(state, STATE).deadline
    if m.stage >= 2.0 and y.deadline == 0.0:
        y.deadline = m.time + p.patience
    waiting = m.stage < 2.0 or (m.stage < 3.0 and m.time < y.deadline)
    y.torque = p.reduced if waiting else p.full
    if waiting:
        y.ask_again = y.deadline if y.deadline > m.time else math.inf
    else:
        y.ask_again = NEVER


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

    Where damping keeps the gap closed, stage 2 has no end; the torque is then raised `patience` after
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

    raise_at: str | None = raise_parameter()

    def __post_init__(self) -> None:
        check(self)

    def defaults(self, drive: Drive) -> dict[str, Any]:
        """Reduced torque from load and starting torque, patience from the elastic period."""
        return {
            "torque": reduced_torque(drive),
            "full_torque": drive.Ms,
            "patience": 2.0 * drive.elastic_period,
            "raise_at": RAISE_AT,
        }

    def vector(self, drive: Drive) -> Vector:
        """(torque, full torque, longest time from contact on)."""
        longest: Any = self.patience
        if self.raise_at == "peak":
            longest = min(delay_of(drive, self.torque, "peak"), longest)
        return stack(self.torque, self.full_torque, longest)
