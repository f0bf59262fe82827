"""A controller with its guard as a block of a cyclic program: what a drive's own controller executes."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from softstart.controller.base import (
    CompiledController,
    Controller,
    PlainController,
    period_of,
    reply_of,
)
from softstart.drive import Drive
from softstart.errors import InputError
from softstart.kernel import records as rec
from softstart.kernel.block import (
    BLOCK_INPUT,
    BLOCK_LIMITS,
    BLOCK_OUTPUT,
    BLOCK_STATE,
    after_plain_step,
    before_plain_step,
    run_block,
)  # fmt: skip
from softstart.kernel.guard import FAULTS
from softstart.kernel.motor import NEW_STATE
from softstart.quantities import time_above_0
from softstart.start.kernel_input import kernel_input

CYCLE = 0.001  # s, of strategies that are not sampled
LOST = 2**31  # cycles that have passed when the time is no number


class BlockOutput(NamedTuple):
    """What a block gives out: the torque demand until the next cycle, N m, and the fault, "" for none."""

    torque: float
    fault: str


class ControlBlock:
    """A controller, set up for a drive, and its guard; called once in each cycle.

    The torque is always a number within the limits of the drive. After a fault it is 0, or the limit nearest
    to that, until `run` goes from 0 to 1: that is a new start, with time and angle counted from it. So is
    each `run` from 0 to 1 of a strategy that cannot stop; until then, and while the set speed has a direction
    that it cannot follow, its torque is 0. To the others a change of command is handed on with their state.
    """

    def __init__(self, controller: Controller, drive: Drive, period: float | None = None) -> None:
        self.controller, self.drive = controller.set_up(drive)
        self.period = period or period_of(self.controller) or CYCLE
        self.sees = int(self.controller.sensors)
        if isinstance(self.controller, CompiledController):
            self._kernel = self.controller.compiled_kernel()
            self.parameters = np.array(self.controller.vector(self.drive), dtype=np.float64).ravel()
            self._state = np.zeros(self.controller.state_size)
        elif isinstance(self.controller, PlainController):
            self._plain = self.controller
            self._state = np.array(self.controller.initial_state, dtype=float)
        else:
            raise InputError("controller: derive it from PlainController or CompiledController.")
        self.limits = _limits(self.controller, self.drive, self.period)
        self._block = np.zeros(rec.size(BLOCK_STATE))
        self._command = np.zeros(NEW_STATE + self._state.size)
        self._measured = np.zeros(rec.size(rec.MEASURED))
        self._input, self._output = np.zeros(rec.size(BLOCK_INPUT)), np.zeros(rec.size(BLOCK_OUTPUT))
        self._time: float | None = None  # of the first cycle
        self._cycles = 0  # since then

    def step(self, measured: rec.Measured) -> BlockOutput:
        """One cycle: what is measured, and what is then demanded.

        Its time only tells how many cycles have passed; the block itself counts the time of the command.
        """
        since = (measured.time - (self._time or 0.0)) / self.period
        if self._time is None:
            self._time, since = measured.time, 0.0
        cycles = round(since) - self._cycles if math.isfinite(since) else LOST
        self._cycles = round(since) if math.isfinite(since) else self._cycles
        self._input[:] = (
            measured.run, measured.set_speed, measured.motor_angle, measured.motor_speed,
            measured.motor_torque, measured.stage, measured.shaft_torque, measured.load_speed,
            cycles,
        )  # fmt: skip
        if isinstance(self.controller, CompiledController):
            run_block(
                self._kernel, self.sees, self.limits, self.parameters, self._block, self._state,
                self._command, self._measured, self._input, self._output,
            )  # fmt: skip
        else:
            self._plain_step()
        torque, fault = self._output.tolist()
        return BlockOutput(torque, FAULTS[int(fault)])

    def _plain_step(self) -> None:
        """The same with a strategy in plain Python."""
        asked = before_plain_step(
            self.limits, self._block, self._state, self._measured, self._input, self.sees
        )
        if asked and self._block.view(BLOCK_STATE)[0].asked == 0.0 == self._measured[0]:
            self._state = np.array(self._plain.initial_state, dtype=float)
        if asked:
            measured, state = rec.Measured(*self._measured.tolist()), tuple(self._state.tolist())
            torque, ask_at, after, slope = reply_of(self._plain, measured, state)
            self._command[:NEW_STATE] = torque, ask_at, slope
            self._state = np.array(after, dtype=np.float64)
        after_plain_step(self.limits, self._block, self._measured, self._command, asked, self._output)


def _limits(controller: Controller, drive: Drive, period: float) -> np.ndarray:
    """The numbers of the block that drive and strategy give."""
    row = np.zeros(rec.size(BLOCK_LIMITS))
    limits = row.view(BLOCK_LIMITS)[0]
    limits["guard"] = kernel_input(drive).guarded(period).machine.guard
    limits["guard"]["commanded"] = controller.can_stop or controller.can_reverse
    limits["period"], limits["forward"] = period, math.copysign(1.0, drive.target_speed)
    limits["can_stop"], limits["can_reverse"] = controller.can_stop, controller.can_reverse
    return row


def control_block(controller: Controller, drive: Drive, period: float | str | None = None) -> ControlBlock:
    """A controller for a drive, with its guard, as a block that a cyclic program calls.

    Parameters
    ----------
    controller : from `make_controller`, or a class of your own; it is set up for the drive.
    drive : the drive, whose torque limits, lag, encoder and inertias the guard needs.
    period : time between two calls, s or with a unit; by default the controller's own, or 1 ms.

    Returns
    -------
    The block: `block.step(measured)` in each cycle gives the torque demand in N m, and a fault or "".

    Raises
    ------
    InputError
        For a controller that is neither plain nor compiled, or a period that is no time above 0.

    Examples
    --------
    >>> from softstart import Drive, Measured, make_controller
    >>> block = control_block(make_controller("speed-ramp"), Drive.load("crane-4amtkf"))
    >>> block.step(Measured(0.0, 0.0, 0.0, 0.0, set_speed=92.0, command_time=0.0)).fault
    ''
    >>> block.step(Measured(0.001, float("nan"), 0.0, 0.0, set_speed=92.0, command_time=0.001))
    BlockOutput(torque=0.0, fault='measured value not finite')
    """
    return ControlBlock(controller, drive, None if period is None else time_above_0(period, "period", ""))
