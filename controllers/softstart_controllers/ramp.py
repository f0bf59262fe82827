"""Torque ramp: what every soft starter offers."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar

from softstart.controller import CompiledController, Effort, compiled_step, parameter, stack
from softstart.controller.compiled import MEASURED, Answer, Vector, named, record
from softstart.drive import Drive
from softstart_controllers.sampled import PERIOD_DEFAULT, check, pulling_load, sample_period


class Parameters:
    """What the step is given."""

    initial: float
    full: float
    time: float
    period: float


class State:
    """How many samples were taken."""

    sample: float


PARAMETERS, STATE, COMMAND = record(Parameters), record(State), record(Answer, State)


@compiled_step
def step(parameters: Vector, measured: Vector, state: Vector, command: Vector) -> None:
    """A straight line over time, sampled."""
    p = named(parameters, PARAMETERS)
    x = named(state, STATE)
    y = named(command, COMMAND)
    t = named(measured, MEASURED).time
    y.sample = x.sample + 1.0
    if t < p.time:
        y.torque = p.initial + (p.full - p.initial) * (t / p.time)
        y.ask_again = y.sample * p.period
    else:
        y.torque = p.full
        y.ask_again = math.inf


@dataclass(frozen=True)
class Ramp(CompiledController):
    """Torque that rises in a straight line, without any measurement.

    At the samples t_k = k `period`, held until the next one:

        u(t_k) = initial + (full_torque - initial) min(1, t_k/time)

    By default it begins with the load torque, so that an active load does not run back, and takes two elastic
    periods: in a closed, undamped drive a ramp over whole elastic periods leaves no oscillation behind. It
    knows nothing of the gap, so a wide gap closes under a torque already high.

    Source: practice of soft starters and inverters.

    >>> from softstart import Drive, simulate
    >>> run = simulate(Drive.load("crane-4amtkf"), Ramp(initial=20, time=0.1))
    >>> run.at([0.0505])["u"].round(9).tolist()
    [41.0]
    """

    name: ClassVar[str] = "ramp"
    summary: ClassVar[str] = "torque rises in a straight line from the load torque to the starting torque"
    source: ClassVar[str] = "practice"
    effort: ClassVar[Effort | None] = Effort.RAMPS
    kernel: ClassVar[Any] = step
    state_size: ClassVar[int] = 1

    initial: float | None = parameter(
        "N*m", "torque at the start", "load torque, 0 where it does not brake", multiples=(0.3, 4.0)
    )
    time: float | None = parameter("s", "duration of the rise", "two elastic periods", multiples=(0.1, 10.0))
    full_torque: float | None = parameter(
        "N*m", "torque after the rise", "starting torque Ms", multiples=(0.4, 1.0)
    )
    period: float | None = parameter("s", "sample period", PERIOD_DEFAULT)

    def __post_init__(self) -> None:
        check(self, above_zero=("period",), not_negative=("time",))

    def defaults(self, drive: Drive) -> dict[str, Any]:
        """From load torque, starting torque and elastic period."""
        return {
            "initial": pulling_load(drive),
            "time": 2.0 * drive.elastic_period,
            "full_torque": drive.Ms,
            "period": sample_period(drive),
        }

    def vector(self, drive: Drive) -> Vector:
        """The numbers of `Parameters`."""
        return stack(self.initial, self.full_torque, self.time, self.period)
