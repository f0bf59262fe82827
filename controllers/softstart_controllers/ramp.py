"""Torque ramp: what every soft starter offers; with rounded ends it is the S-curve of every inverter."""

from __future__ import annotations

import math
from dataclasses import dataclass

from softstart.controller import CompiledController, Effort, Numbers, compiled_step, parameter
from softstart.controller.compiled import MEASURED, Double, Reply, Vector, as_record, record
from softstart.drive import Drive
from softstart_controllers.sampled import full_torque_parameter, period_parameter, pulling_load


class Parameters:
    """What the step is given."""

    initial: float
    full_torque: float
    time: Double
    rounding: float
    period: Double


class State:
    """How many samples were taken."""

    sample: int


PARAMETERS, STATE, COMMAND = record(Parameters), record(State), record(Reply, State)


@compiled_step(PARAMETERS, STATE)
def step(parameters: Vector, measured: Vector, state: Vector, command: Vector) -> None:
    """A line over time, straight or with rounded ends, sampled."""
    p = as_record(parameters, PARAMETERS)
    x = as_record(state, STATE)
    y = as_record(command, COMMAND)
    t = as_record(measured, MEASURED).time
    y.sample = x.sample + 1
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
        y.torque = p.initial + (p.full_torque - p.initial) * share
        y.ask_again = y.sample * p.period
    else:
        y.torque = p.full_torque
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

    name = "ramp"
    summary = "torque rises in a straight line from the load torque to the starting torque"
    source = "practice"
    effort = Effort.RAMPS
    time_parameter = "time"
    settings = ("initial", "full_torque")
    kernel = step

    # fmt: off
    initial: float = parameter("N*m", "torque at the start", lambda drive, p: pulling_load(drive),
        "load torque, 0 where it does not brake", multiples=(0.3, 4.0))
    time: float = parameter("s", "duration of the rise", lambda drive, p: 2.0 * drive.elastic_period,
        "two elastic periods", "0 or more", multiples=(0.1, 10.0))
    full_torque: float = full_torque_parameter("torque after the rise")
    period: float = period_parameter()
    # fmt: on

    def numbers(self, drive: Drive) -> Numbers:
        """Straight from end to end."""
        return {"rounding": 0.0}
