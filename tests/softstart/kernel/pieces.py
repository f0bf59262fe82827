"""A controller that plays torque pieces: for tests."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from softstart import Command, Measured, PlainController


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
