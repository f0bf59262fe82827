"""The same twice: a compiled controller in plain Python, a drive as a chain."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from softstart import Chain, Command, Drive, PlainController
from softstart.chain import Mass, Motor, Shaft
from softstart.controller import Measured, Sensor
from softstart.controller.base import Regulation
from softstart.kernel.motor import NEW_STATE


@dataclass(frozen=True)
class PlainTwin(PlainController):
    """The twin of a fitted controller, with the numbers of its kernel."""

    twin: Any
    numbers: tuple[float, ...]

    @property
    def sensors(self) -> Sensor:  # type: ignore[override]
        """Those of the compiled controller."""
        return self.twin.sensors  # type: ignore[no-any-return]

    @property
    def can_stop(self) -> bool:  # type: ignore[override]
        """As the compiled controller."""
        return self.twin.can_stop  # type: ignore[no-any-return]

    @property
    def can_reverse(self) -> bool:  # type: ignore[override]
        """As the compiled controller."""
        return self.twin.can_reverse  # type: ignore[no-any-return]

    def regulation(self, drive: Drive) -> Regulation | None:
        """That of the compiled controller."""
        return self.twin.regulation(drive)  # type: ignore[no-any-return]

    def step(self, measured: Measured, state: tuple[float, ...]) -> Command:
        size = self.twin.state_size
        command = np.zeros(NEW_STATE + size)
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


def chain_of(drive: Drive) -> Chain:
    """The chain of two masses that a drive without brake and friction is."""
    assert drive.brake == "none", "a chain has no brake"
    assert drive.frictions == (0.0, 0.0, 0.0), "a chain has no such friction"
    rotor = Mass(drive.J1, name="motor", initial_speed=drive.initial_motor_speed)
    load = Mass(
        drive.J2, name="load", torque=drive.load_torque, kind=drive.load_kind, friction=drive.load_friction,
        initial_speed=drive.initial_load_speed,
    )  # fmt: skip
    unknown = len(drive.positions) > 1
    where = None if unknown else drive.theta0 or None
    shaft = Shaft(
        drive.c, damping=drive.d, gap=drive.gap, contact_law=drive.contact_law, start_position=where
    )
    motor = Motor(**{key: getattr(drive, key) for key in Motor.PARAMETERS if key in Drive.PARAMETERS})
    return Chain(
        (rotor, load), (shaft,), motor, target_speed=drive.target_speed, name=drive.name, source=drive.source,
        assumed=drive.assumed, position="unknown" if unknown else "mid-gap", units=drive.units,
    )  # fmt: skip
