"""What is exported: a strategy with rounded parameters, set up for a machine, and how it starts in cycles."""

from __future__ import annotations

import hashlib
import json
import math
from dataclasses import dataclass, replace
from typing import Any

from softstart import __version__
from softstart.chain.machines import MachineLike, as_machine
from softstart.controller.base import CompiledController, Controller, Sensor, label_of
from softstart.controller.tuned import RobustGains
from softstart.drive import Drive
from softstart.drive.machine import Machine
from softstart.errors import InputError
from softstart.export.vectors import block_drive, run_in_cycles
from softstart.start.block import ControlBlock
from softstart.start.settings import Setting, rounded_settings
from softstart.start.simulation import simulate


@dataclass(frozen=True)
class Design:
    """A strategy as it is exported.

    Attributes
    ----------
    name : of the strategy; with tuned gains that of the strategy and of the gains.
    given : the controller as it was given; `controller` is the same with its rounded parameters.
    machine, own : the machine that starts; the drive with whose numbers the strategy computes.
    settings : the parameters, exact and rounded.
    period : s between two cycles.
    """

    name: str
    given: Controller
    controller: Controller
    machine: Machine
    own: Drive
    settings: tuple[Setting, ...]
    period: float

    @property
    def ready(self) -> CompiledController:
        """The strategy, with every parameter a number."""
        ready = self.controller.set_up(self.own)[0]
        assert isinstance(ready, CompiledController)
        return ready

    @property
    def sensors(self) -> Sensor:
        """What it sees beyond encoder and motor torque."""
        return self.controller.sensors

    def block(self) -> ControlBlock:
        """A block that has not been called yet."""
        return ControlBlock(self.controller, block_drive(self.machine), self.period)

    @property
    def limits(self) -> tuple[float, float]:
        """The lowest and highest torque that the block gives out, N m."""
        drive = block_drive(self.machine)
        return float(drive.minimum_torque), float(drive.maximum_torque)

    def digest(self) -> str:
        """SHA-256 of all that the export follows from."""
        inputs = {
            "softstart": __version__,
            "machine": self.machine.to_toml(),
            "own": self.own.to_toml(),
            "strategy": type(self.ready).__name__,
            "numbers": [float(one).hex() for one in self.ready.vector(self.own).ravel()],
            "period": self.period.hex(),
        }
        return hashlib.sha256(json.dumps(inputs, sort_keys=True).encode()).hexdigest()


def design_for(controller: Controller, drive: MachineLike, period: float | None = None) -> Design:
    """The strategy with rounded parameters for a machine.

    Raises
    ------
    InputError
        For a controller in plain Python, which cannot be translated.
    """
    machine = as_machine(drive)
    ready, own = controller.set_up(machine.design_drive)
    name = label_of(controller)
    if not isinstance(ready, CompiledController):
        raise InputError(
            f'controller = "{name}": it is plain Python, and only compiled controllers are exported; derive '
            "it from CompiledController and compile its step with compiled_step."
        )
    settings = rounded_settings(ready, machine.design_drive)
    values: dict[str, Any] = {one.name: one.rounded for one in settings if one.rounded != one.exact}
    set_to = replace(ready, **values)
    rounded = RobustGains("export", set_to, own)
    block = ControlBlock(rounded, block_drive(machine), period)
    return Design(name, controller, rounded, machine, own, settings, block.period)


def figures_of(design: Design) -> dict[str, Any]:
    """K_dyn of the strategy as `simulate` has it, with rounded parameters, and in cycles under its block."""
    exact = simulate(design.machine, design.given)
    rounded = simulate(design.machine, design.controller)
    each = [run_in_cycles(one, design.block()) for one in design.machine.positions.values()]
    return {
        "k_dyn_simulated": float(exact.k_dyn),
        "k_dyn_rounded": float(rounded.k_dyn),
        "k_dyn_in_cycles": max(float(run.k_dyn) for run in each),
        "start_time_in_cycles": max(_number(run.start_time) for run in each),
    }


def _number(value: float | None) -> float:
    return math.inf if value is None else float(value)
