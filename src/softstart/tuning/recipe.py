"""A controller as its name and parameters: what another process or a file can make it from again."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import MISSING, dataclass, fields
from typing import Any

from softstart.controller import Controller, make_controller
from softstart.controller.tuned import Tuned
from softstart.errors import InputError
from softstart.plugins import CONTROLLERS, registered

LOOSE = "softstart_loose_"  # how softstart.controller.finding names modules of loose files


@dataclass(frozen=True)
class Recipe:
    """The name of a controller and the parameters given to it, or the object where it has no such name.

    >>> recipe = recipe_of("ramp", {"initial": "10 N*m"})
    >>> recipe.name, recipe.given, recipe.make().initial
    ('ramp', {'initial': 10.0}, 10.0)
    """

    name: str
    given: dict[str, Any]
    object: Controller | None = None

    def make(self) -> Controller:
        """The controller."""
        return self.object if self.object is not None else make_controller(self.name, self.given)

    @property
    def label(self) -> str:
        """How the controller is called."""
        made = self.make()
        return made.name or type(made).__name__


def recipe_of(controller: str | Controller, parameters: Mapping[str, object] | None = None) -> Recipe:
    """The recipe of a controller; InputError for one whose gains are tuned already."""
    made = make_controller(controller, parameters)
    if isinstance(made, Tuned):
        raise InputError(
            f"controller = {made.name}: its gains are tuned already; tune the controller itself."
        )
    given = {
        f.name: value
        for f in fields(made)
        if (value := getattr(made, f.name)) is not None and (f.default is MISSING or value != f.default)
    }
    name = controller if isinstance(controller, str) else _name_of(made)
    return Recipe(name, given, None if name else made)


def _name_of(controller: Controller) -> str:
    """The name under which the controller's class is found, or nothing."""
    cls = type(controller)
    point = registered(CONTROLLERS).get(cls.name)
    if point is not None and point.value == f"{cls.__module__}:{cls.__qualname__}":
        return cls.name
    if cls.__module__.startswith(LOOSE):
        file = getattr(sys.modules.get(cls.__module__), "__file__", None)
        return f"{file}:{cls.__name__}" if file else ""
    return ""
