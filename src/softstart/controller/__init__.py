"""The controller interface, and how controllers are found."""

from softstart.controller.base import (
    NEVER,
    Command,
    CompiledController,
    Controller,
    Effort,
    Numbers,
    PlainController,
    Sensor,
)
from softstart.controller.compiled import compiled_step
from softstart.controller.finding import (
    controller_class,
    make_controller,
    ready_controller_names,
)
from softstart.controller.parameters import ParameterValues, declared_parameters, parameter
from softstart.kernel.records import Measured
from softstart.plugins import controller_names

__all__ = [
    "NEVER",
    "Command",
    "CompiledController",
    "Controller",
    "Effort",
    "Measured",
    "Numbers",
    "ParameterValues",
    "PlainController",
    "Sensor",
    "compiled_step",
    "controller_class",
    "controller_names",
    "declared_parameters",
    "make_controller",
    "parameter",
    "ready_controller_names",
]  # fmt: skip
