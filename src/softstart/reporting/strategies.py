"""What a strategy asks of the inverter: what it measures, and whether an ordinary one can do it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from softstart.controller import CompiledController, Controller, Sensor
from softstart.drive import Drive
from softstart.errors import InputError

ORDINARY = ("ramp", "s-curve")
DOCUMENTED = (
    "acceleration-delay",
    "current-limit-feedback",
    "pulse-coast-hold",
    "shaped",
    "state-feedback",
)
_OPEN_LOOP = {
    "direct": "switching on at a torque limit",
    "ramp": "a torque ramp",
    "s-curve": "a torque ramp with an S-curve",
}
_SENSORS = {
    Sensor.STAGE: "sensor in the gap",
    Sensor.SHAFT_TORQUE: "sensor of the shaft torque",
    Sensor.LOAD_SPEED: "encoder at the load",
}
_DATA = {
    "motor_inertia": "J1",
    "load_inertia": "J2",
    "stiffness": "c",
    "damping": "d",
    "gap": "the gap",
    "starting_torque": "Ms",
    "load_torque": "Mc",
    "torque_lag": "the torque lag",
    "torque_rate": "the torque rate",
    "torque_noise": "the noise of the torque",
    "computing_delay": "the dead time",
}
_LEFT_OUT_AT_0 = ("damping", "torque_noise", "computing_delay")  # data that such a drive simply has not
_PROBE = 1e-3  # relative


@dataclass(frozen=True)
class Means:
    """What a strategy needs.

    `realisable`: with what a drive itself measures, motor encoder and motor torque. `ordinary`: on an
    inverter that offers torque ramps and no more.
    """

    measures: str
    inverter: str
    realisable: bool
    ordinary: bool


def kind_of(controller: Controller) -> str:
    """The name of the strategy behind a controller, tuned or not."""
    inner = getattr(controller, "controller", controller)
    return str(type(inner).name or type(inner).__name__)


def label_of(controller: Controller) -> str:
    """The name under which a controller stands in tables."""
    return controller.name or type(controller).__name__


def means_of(controller: Controller) -> Means:
    """What a controller needs.

    >>> from softstart.controller import make_controller
    >>> [means_of(make_controller(name)).realisable for name in ("ramp", "reduced-first-stage")]
    [True, False]
    """
    kind = kind_of(controller)
    extra = [said for sensor, said in _SENSORS.items() if controller.sensors & sensor]
    if extra:
        return Means(" and ".join(extra), "no: drives have no such sensor", False, False)
    if kind in _OPEN_LOOP:
        return Means("nothing", f"yes: {_OPEN_LOOP[kind]}", True, kind in ORDINARY)
    return Means(
        "motor encoder, motor torque",
        "no: it takes one that runs control code of its user in each cycle",
        True,
        False,
    )


def computes_with(ready: Controller, own: Drive) -> list[str] | None:
    """The data of the drive that a controller computes with, beside its parameters; None if it does not tell.

    >>> from softstart.controller import make_controller
    >>> computes_with(*make_controller("acceleration-delay").set_up(Drive.load("crane-4amtkf")))
    ['J1']
    """
    if not isinstance(ready, CompiledController):
        return None
    numbers = np.asarray(ready.vector(own), dtype=np.float64)
    found = []
    for key, symbol in _DATA.items():
        value = float(getattr(own, key))
        if (value == 0.0 and key in _LEFT_OUT_AT_0) or np.isinf(value):
            continue
        try:
            changes: dict[str, Any] = {key: (1.0 - _PROBE) * value or 1e-6}
            other = own.replace(**changes)
            moved = np.asarray(ready.vector(other), dtype=np.float64)
        except InputError:  # then it is read, at least
            found.append(symbol)
            continue
        if not np.array_equal(numbers, moved, equal_nan=True):
            found.append(symbol)
    return found
