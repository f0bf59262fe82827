"""A compiled controller in plain Python: the same lines, not compiled."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from softstart import Command, Drive, PlainController
from softstart.controller import Measured, Sensor
from softstart.controller.compiled import STATE


@dataclass(frozen=True)
class PlainTwin(PlainController):
    """The twin of a fitted controller, with the numbers of its kernel."""

    twin: Any
    numbers: tuple[float, ...]

    @property
    def sensors(self) -> Sensor:  # type: ignore[override]
        """Those of the compiled controller."""
        return self.twin.sensors  # type: ignore[no-any-return]

    def step(self, measured: Measured, state: tuple[float, ...]) -> Command:
        size = self.twin.state_size
        command = np.zeros(STATE + size)
        before = np.array(state) if state else np.zeros(size)
        kernel = type(self.twin).kernel
        lines = getattr(kernel, "py_func", kernel)
        lines(np.array(self.numbers), np.array(measured), before, command)
        torque, ask_again, slope, *after = command.tolist()
        return Command(torque, ask_again, tuple(after), slope)


def plain(controller: Any, drive: Drive) -> PlainTwin:
    """The twin of a compiled controller that is set up for a drive."""
    fitted = controller.fitted(drive)
    return PlainTwin(fitted, tuple(fitted.vector(drive).tolist()))
