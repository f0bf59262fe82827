"""A controller with its guard as a block of a cyclic program: what a drive's own controller executes."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from softstart.controller.base import (
    NEVER,
    SAME_SAMPLE,
    CompiledController,
    Controller,
    PlainController,
    Sensor,
    period_of,
    reply_of,
)  # fmt: skip
from softstart.drive import Drive
from softstart.errors import InputError
from softstart.kernel import records as rec
from softstart.kernel.guard import FAULTS, bounded, check_row, follow_row
from softstart.kernel.motor import M_MOTOR_ANGLE, M_RUN, M_SET_SPEED, M_STAGE, M_TIME, NEW_STATE
from softstart.quantities import time_above_0
from softstart.start.kernel_input import kernel_input

CYCLE = 0.001  # s, of strategies that are not sampled


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
        self.compiled = isinstance(self.controller, CompiledController)
        if isinstance(self.controller, CompiledController):
            self._kernel = self.controller.compiled_kernel()
            self._numbers = np.array(self.controller.vector(self.drive), dtype=np.float64).ravel()
            self._first = np.zeros(self.controller.state_size)
        elif isinstance(self.controller, PlainController):
            self._plain, self._first = self.controller, np.array(self.controller.initial_state, dtype=float)
        else:
            raise InputError("controller: derive it from PlainController or CompiledController.")
        self._limits, self._watch = np.zeros(rec.size(rec.GUARD_LIMITS)), np.zeros(rec.size(rec.GUARD_STATE))
        limits = self._limits.view(rec.GUARD_LIMITS)
        limits[0] = kernel_input(drive).guarded(self.period).machine.guard
        limits["commanded"] = self.controller.can_stop or self.controller.can_reverse
        self._low, self._high = float(limits["low"][0]), float(limits["high"][0])
        self._runs, self._code = False, 0
        self._begin(0.0, 0.0)

    def _begin(self, time: float, angle: float) -> None:
        """A new start, here and now."""
        self._watch[:] = 0.0
        self._state = self._first.copy()
        self._time, self._angle = time, angle
        self._asked, self._ask_at, self._torque, self._slope, self._stage = 0.0, 0.0, 0.0, 0.0, math.nan

    def step(self, measured: rec.Measured) -> BlockOutput:
        """One cycle: what is measured, and what is then demanded."""
        row = np.array(measured, dtype=np.float64)
        reverses = float(row[M_SET_SPEED]) * self.drive.target_speed < 0.0
        runs = bool(row[M_RUN] == 1.0) and (self.controller.can_reverse or not reverses)
        if runs and not self._runs and (self._code or not self.controller.can_stop):
            self._begin(float(row[M_TIME]), float(row[M_MOTOR_ANGLE]))
        self._runs = runs
        self._code = int(check_row(self._limits, self._watch, row, int(self.controller.sensors)))
        torque, now = 0.0, float(row[M_TIME])
        if self._code == 0:
            if runs or self.controller.can_stop:
                torque = self._demand(row)
            follow_row(self._limits, self._watch, torque, now + self.period, 0.0)
            self._code = int(self._watch.view(rec.GUARD_STATE)[0].fault)  # no number is demanded
        return BlockOutput(float(bounded(torque, self._low, self._high)), FAULTS[self._code])

    def _demand(self, row: np.ndarray) -> float:
        """The demand now: of the strategy if it is to be asked, else the line that it has answered."""
        row = row.copy()
        row[M_TIME] -= self._time
        row[M_MOTOR_ANGLE] -= self._angle
        now = float(row[M_TIME])
        seen, self._stage = self._stage, float(row[M_STAGE])
        event = self.controller.sensors & Sensor.STAGE and seen != self._stage and self._ask_at != NEVER
        if event or (self._ask_at != NEVER and now >= self._ask_at - SAME_SAMPLE * self.period):
            self._asked = now
            self._ask(row)
        return self._torque if self._slope == 0.0 else self._torque + self._slope * (now - self._asked)

    def _ask(self, row: np.ndarray) -> None:
        if not self.compiled:
            measured, state = rec.Measured(*row.tolist()), tuple(self._state.tolist())
            self._torque, self._ask_at, after, self._slope = reply_of(self._plain, measured, state)
            self._state = np.array(after, dtype=np.float64)
            return
        command = np.zeros(NEW_STATE + self._state.size)
        self._kernel(self._numbers, row, self._state, command)
        self._torque, self._ask_at, self._slope = command[:NEW_STATE].tolist()
        self._state = command[NEW_STATE:].copy()


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
