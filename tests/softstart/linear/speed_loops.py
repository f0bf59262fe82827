"""Linear controllers in plain Python whose loops are known, and drives for them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from softstart import Command, Drive, Measured, PlainController

CRANE = Drive.load("crane-4amtkf")
# no torque limit is in the way of a linear loop
FREE = CRANE.replace(maximum_torque=1e5, minimum_torque=-1e5, encoder_lines=0)


@dataclass(frozen=True)
class SpeedPI(PlainController):
    """Proportional and integral control of the motor's speed, with a sample counter in its state."""

    name: ClassVar[str] = "speed-pi"
    kp: float = 2.0
    ki: float = 0.0
    reference: float = 20.0
    period: float = 0.001
    initial_state: ClassVar[tuple[float, ...]] = (0.0, 0.0)

    def step(self, measured: Measured, state: tuple[float, ...]) -> Command:
        count, integral = state
        error = self.reference - measured.motor_speed
        integral += self.period * self.ki * error
        return Command(self.kp * error + integral, (count + 1.0) * self.period, (count + 1.0, integral))


@dataclass(frozen=True)
class Filtered(PlainController):
    """A known linear law of three measured quantities, beside a counter, a mode and a schedule."""

    name: ClassVar[str] = "filtered"
    initial_state: ClassVar[tuple[float, ...]] = (0.0, 1.0, 0.0, 0.0)
    A: ClassVar[tuple[float, ...]] = (0.5, 0.3, -0.2, 0.6)
    B: ClassVar[tuple[float, ...]] = (0.2, -0.01, 0.03, 0.0, 0.02, -0.01)
    C: ClassVar[tuple[float, ...]] = (0.4, -0.6)
    D: ClassVar[tuple[float, ...]] = (0.0, -0.5, 0.05)

    def step(self, measured: Measured, state: tuple[float, ...]) -> Command:
        count, mode, x1, x2 = state
        y = (measured.motor_angle, measured.motor_speed, measured.motor_torque)
        new = (
            self.A[0] * x1 + self.A[1] * x2 + sum(b * v for b, v in zip(self.B[:3], y, strict=True)),
            self.A[2] * x1 + self.A[3] * x2 + sum(b * v for b, v in zip(self.B[3:], y, strict=True)),
        )
        demand = self.C[0] * x1 + self.C[1] * x2 + sum(d * v for d, v in zip(self.D, y, strict=True))
        scheduled = 40.0 + (5.0 if mode == 1.0 else 0.0) + min(0.01 * count, 1.0)
        return Command(scheduled + demand, (count + 1.0) * 0.001, (count + 1.0, mode, *new))
