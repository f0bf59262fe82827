"""Torque ramp with rounded ends: what every inverter offers as S-curve."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar

from softstart.controller import CompiledController, Effort, compiled_step, parameter, stack
from softstart.controller.compiled import MEASURED, Answer, Vector, named, record
from softstart.drive import Drive
from softstart.errors import InputError
from softstart_controllers.sampled import PERIOD_DEFAULT, check, pulling_load, sample_period


class Parameters:
    """What the step is given."""

    initial: float
    full: float
    time: float
    rounding: float
    period: float


class State:
    """How many samples were taken."""

    sample: float


PARAMETERS, STATE, COMMAND = record(Parameters), record(State), record(Answer, State)


@compiled_step
def step(parameters: Vector, measured: Vector, state: Vector, command: Vector) -> None:
    """An S over time, sampled."""
    p = named(parameters, PARAMETERS)
    x = named(state, STATE)
    y = named(command, COMMAND)
    t = named(measured, MEASURED).time
    y.sample = x.sample + 1.0
    end = 0.5 * p.rounding  # each rounded end, as a share of the time
    if t < p.time:
        passed = t / p.time
        left = 1.0 - passed
        if passed < end:
            share = 0.5 * passed * passed / (end * (1.0 - end))
        elif passed <= 1.0 - end:
            share = (passed - 0.5 * end) / (1.0 - end)
        else:
            share = 1.0 - 0.5 * left * left / (end * (1.0 - end))
        y.torque = p.initial + (p.full - p.initial) * share
        y.ask_again = y.sample * p.period
    else:
        y.torque = p.full
        y.ask_again = math.inf


@dataclass(frozen=True)
class SCurve(CompiledController):
    """Torque that rises in an S: its rate is a trapezoid over time, so the jerk of the motor is limited.

    With x = t_k/time, e = rounding/2 and the samples t_k = k `period`, each held until the next one:

        u(t_k) = initial + (full_torque - initial) s(x)
        s(x) = x^2/(2 e (1 - e))               x < e
               (x - e/2)/(1 - e)               e <= x <= 1 - e
               1 - (1 - x)^2/(2 e (1 - e))     x > 1 - e

    rounding = 0 is the ramp, 1 (default) has no straight part. By default it begins with the load torque and
    takes two elastic periods: the full S is a ramp over one elastic period passed through a mean over another
    one, and each alone leaves no oscillation in a closed, undamped drive; so it is forgiving where the
    elastic frequency is not well known.

    Source: practice of inverters.

    >>> from softstart import Drive, simulate
    >>> run = simulate(Drive.load("crane-4amtkf"), SCurve(initial=0, time=0.1))
    >>> run.at([0.0255, 0.0505, 0.0755])["u"].round(9).tolist()
    [7.75, 31.0, 54.25]
    """

    name: ClassVar[str] = "s-curve"
    summary: ClassVar[str] = "torque rises in an S from the load torque to the starting torque"
    source: ClassVar[str] = "practice"
    effort: ClassVar[Effort | None] = Effort.RAMPS
    kernel: ClassVar[Any] = step
    state_size: ClassVar[int] = 1

    initial: float | None = parameter(
        "N*m", "torque at the start", "load torque, 0 where it does not brake", multiples=(0.3, 4.0)
    )
    time: float | None = parameter("s", "duration of the rise", "two elastic periods", multiples=(0.1, 10.0))
    rounding: float | None = parameter(
        "1", "share of the time spent in the rounded ends, 0 to 1", "1", between=(0.0, 1.0)
    )
    full_torque: float | None = parameter(
        "N*m", "torque after the rise", "starting torque Ms", multiples=(0.4, 1.0)
    )
    period: float | None = parameter("s", "sample period", PERIOD_DEFAULT)

    def __post_init__(self) -> None:
        check(self, above_zero=("period",), not_negative=("time", "rounding"))
        if isinstance(self.rounding, float | int) and self.rounding > 1.0:
            raise InputError(
                f"rounding = {self.rounding:g}: the parameter of the controller s-curve is a "
                "share of the time, 0 to 1."
            )

    def defaults(self, drive: Drive) -> dict[str, Any]:
        """From load torque, starting torque and elastic period."""
        return {
            "initial": pulling_load(drive),
            "time": 2.0 * drive.elastic_period,
            "rounding": 1.0,
            "full_torque": drive.Ms,
            "period": sample_period(drive),
        }

    def vector(self, drive: Drive) -> Vector:
        """The numbers of `Parameters`."""
        return stack(self.initial, self.full_torque, self.time, self.rounding, self.period)
