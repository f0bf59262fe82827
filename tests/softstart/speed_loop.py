"""A plain loop that holds the speed, compiled: for tests of commands, bands and overshoot."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from softstart import CompiledController, Drive, compiled_step, parameter
from softstart.controller.base import Regulation
from softstart.controller.compiled import MEASURED, Reply, Vector, as_record, record


class Parameters:
    kp: float
    tn: float
    inertia: float
    ramp_time: float
    limit: float
    target: float
    period: float


class State:
    integral: float
    begin: float  # speed at the last change of command
    command_time: float
    samples: float


PARAMETERS, STATE, COMMAND = record(Parameters), record(State), record(Reply, State)


@compiled_step(PARAMETERS, STATE)
def step(parameters: Vector, measured: Vector, state: Vector, command: Vector) -> None:
    p, x = as_record(parameters, PARAMETERS), as_record(state, STATE)
    m, y = as_record(measured, MEASURED), as_record(command, COMMAND)
    y.begin, y.integral = x.begin, x.integral
    if x.samples > 0.0 and m.command_time < x.command_time:  # a new command
        y.begin, y.integral = m.motor_speed, 0.0
    end = m.set_speed if m.run != 0.0 else 0.0
    rate = p.target / p.ramp_time if end > y.begin else -p.target / p.ramp_time
    ramps = abs(rate) * m.command_time < abs(end - y.begin)
    n = y.begin + rate * m.command_time if ramps else end
    error = n - m.motor_speed
    torque = p.kp * error + y.integral + (p.inertia * rate if ramps else 0.0)
    y.torque = min(max(torque, -p.limit), p.limit)
    if y.torque == torque:
        y.integral += p.kp * error / p.tn * p.period
    y.command_time, y.samples = m.command_time, x.samples + 1.0
    y.ask_again = y.samples * p.period


@dataclass(frozen=True)
class SpeedLoop(CompiledController):
    """PI control of the motor speed along a ramp, with the torque limited on both sides."""

    name: ClassVar[str] = "speed-loop"
    can_stop: ClassVar[bool] = True
    can_reverse: ClassVar[bool] = True
    kernel: ClassVar = step

    kp: float = parameter("N*m*s/rad", "gain", lambda drive, p: 20.0 * (drive.J1 + drive.J2), "20 (J1 + J2)")
    tn: float = parameter("s", "integral time", 0.1)
    inertia: float = parameter("kg*m^2", "fed forward", lambda drive, p: drive.J1 + drive.J2, "J1 + J2")
    ramp_time: float = parameter("s", "from standstill to the target speed", 0.5)
    limit: float = parameter("N*m", "largest torque", lambda drive, p: drive.Ms, "Ms")
    target: float = parameter("rad/s", "speed of the ramp", lambda drive, p: drive.target_speed, "target")
    period: float = parameter("s", "sample period", 0.001)

    def regulation(self, drive: Drive) -> Regulation:
        """In a band of 2 % for 0.2 s after the ramp."""
        return Regulation(0.02, self.ramp_time, 0.2)
