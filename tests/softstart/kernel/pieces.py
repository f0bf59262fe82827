"""A controller that plays torque pieces, plain and compiled: for tests."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from softstart import Command, CompiledController, Drive, Measured, PlainController
from softstart.arrays import Vector
from softstart.controller import compiled_step, stack
from softstart.controller.compiled import ASK_AGAIN, TIME, TORQUE


@dataclass(frozen=True)
class Pieces(PlainController):
    """Demand in pieces: (instant, torque) or (instant, torque, slope), ... in order of time; zero before.

    A slope acts until the next piece, that of the last one until `end`. It is not asked in between.
    """

    name: ClassVar[str] = "pieces"
    pieces: tuple[tuple[float, ...], ...] = ()
    end: float = math.inf

    def step(self, measured: Measured, state: tuple[float, ...]) -> Command:
        """The piece of the moment, and when the next one begins."""
        torque, *slope = next((rest for t, *rest in reversed(self.pieces) if t <= measured.time), [0.0])
        return Command(torque, next((t for t, *_ in self.pieces if t > measured.time), self.end), (), *slope)


@compiled_step
def two_steps(parameters: Vector, measured: Vector, state: Vector, command: Vector) -> None:
    """parameters = (first torque, switch instant, second torque)."""
    early = measured[TIME] < parameters[1]
    command[TORQUE] = parameters[0] if early else parameters[2]
    command[ASK_AGAIN] = parameters[1] if early else np.inf


@dataclass(frozen=True)
class TwoSteps(CompiledController):
    """One torque until an instant, then another."""

    name: ClassVar[str] = "two-steps"
    kernel: ClassVar[Any] = two_steps
    first: float = 0.0
    switch: float = 0.0
    second: float = 0.0

    def vector(self, drive: Drive) -> Vector:
        """(first, switch, second)."""
        return stack(self.first, self.switch, self.second)
