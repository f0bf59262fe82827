"""What may be given as a controller: a name, a Controller, or a torque over time in any form."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from numpy.typing import ArrayLike

from softstart.controller.base import Command, Controller, PlainController
from softstart.controller.finding import make_controller
from softstart.controller.parameters import parameter
from softstart.controller.recipe import Recipe
from softstart.kernel.records import Measured
from softstart.profile import TorqueProfile

OverTime = TorqueProfile | tuple[ArrayLike, ArrayLike] | Callable[[float], float]
ControllerLike = str | os.PathLike[str] | Controller | type[Controller] | OverTime
SAMPLE_PERIOD = 1e-3  # s, of a function of time


@dataclass(frozen=True)
class TorqueFunction(PlainController):
    """A torque demand u(t): straight between samples, and so exact where it is a line between them."""

    name: ClassVar[str] = "function"
    summary: ClassVar[str] = "a torque over time, as a Python function"

    function: Any = parameter("", "torque in N m over the time in s", python_only=True)  # noqa: RUF009

    def step(self, measured: Measured, state: tuple[float, ...]) -> Command:
        """The line to the next sample."""
        following = measured.time + SAMPLE_PERIOD
        torque, end = float(self.function(measured.time)), float(self.function(following))
        return Command(torque, following, slope=(end - torque) / SAMPLE_PERIOD)


def as_controller(controller: ControllerLike, parameters: Mapping[str, object] | None = None) -> Controller:
    """The controller that is meant: see `simulate`.

    >>> as_controller(lambda t: 62.0).name, as_controller(([0.0, 0.1], [0.0, 62.0])).name
    ('function', 'profile')
    """
    if isinstance(controller, os.PathLike):
        controller = os.fspath(controller)
    if isinstance(controller, tuple | list) and len(controller) == 2:
        controller = TorqueProfile(*controller)
    if isinstance(controller, TorqueProfile):
        return make_controller("profile", {**(parameters or {}), "profile": controller})
    if callable(controller) and not isinstance(controller, Controller | type):
        controller = TorqueFunction(controller)
    return make_controller(controller, parameters)  # which refuses anything else


def as_recipe(
    controller: ControllerLike, parameters: Mapping[str, object] | None = None, allow_code: bool = False
) -> Recipe:
    """The same as data. A name or a class stays one, so that its parameters may be axes of a sweep.

    >>> as_recipe("ramp", {"time": 0.1}).make().parameters["time"]
    0.1
    """
    given = os.fspath(controller) if isinstance(controller, os.PathLike) else controller
    if isinstance(given, str | type):
        return Recipe(given, dict(parameters or {}), allow_code)
    return Recipe(as_controller(given, parameters))
