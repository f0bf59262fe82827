"""What a strategy asks of the inverter: what it measures, and whether an ordinary one can do it."""

from __future__ import annotations

from dataclasses import dataclass

from softstart.controller import Controller, Sensor

ORDINARY = ("ramp", "s-curve")
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
