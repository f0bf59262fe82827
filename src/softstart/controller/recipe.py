"""A controller as data: what makes it again, in another process too, and what tells it from others."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, is_dataclass, replace
from pathlib import Path

import numpy as np

from softstart.controller.base import Controller, label_of
from softstart.controller.finding import Named, controller_class, make_controller
from softstart.controller.tuned import is_gain_file
from softstart.drive.machine import Machine
from softstart.plugins import CONTROLLERS, registered


@dataclass(frozen=True, eq=False)
class Recipe:
    """A controller by name or class with parameters, or a finished one; "" where names are an axis.

    `allow_code` is that of files of tuned gains, see `make_controller`.

    >>> recipe = Recipe("ramp", {"initial": "10 N*m"})
    >>> recipe.make({"time": "120 ms"}).parameters["time"], recipe.make().initial
    (0.12, 10.0)
    """

    given: Named = ""
    values: Mapping[str, object] = field(default_factory=dict)
    allow_code: bool = False

    def make(self, more: Mapping[str, object] | None = None, name: str = "") -> Controller:
        """The controller with further parameters, which may be arrays; `name` where it is from an axis."""
        if isinstance(self.given, Controller) and more:
            return replace(self.given, **more)
        values = {**self.values, **(more or {})}
        return make_controller(name or self.given, values, allow_code=self.allow_code)

    def class_of(self, name: str = "") -> type[Controller]:
        """The class of the controller; `name` where it is from an axis."""
        source = name or self.given
        if isinstance(source, Controller) or (isinstance(source, str) and is_gain_file(source)):
            return type(make_controller(source, allow_code=self.allow_code))
        return controller_class(source)

    @property
    def label(self) -> str:
        """What the controller is called in a sentence or a title."""
        return self.given if isinstance(self.given, str) else label_of(self.given)

    @property
    def name(self) -> str:
        """The name under which files find the controller, "" for one whose class is not installed."""
        if isinstance(self.given, str):
            return self.given
        cls = self.given if isinstance(self.given, type) else type(self.given)
        point = registered(CONTROLLERS).get(cls.name)
        address = f"{cls.__module__}:{cls.__qualname__}"
        return cls.name if point is not None and point.value == address else ""

    def about(self) -> object:
        """All of it as plain data: equal data make controllers that answer alike."""
        if isinstance(self.given, Controller):
            return _plain(self.given)
        about = about_name(self.given) if isinstance(self.given, str) else {"class": _address(self.given)}
        return {**about, "parameters": _plain(dict(self.values))}


def with_whole_path(name: str) -> str:
    """The name of a controller with the whole path of its file, so that it is found from anywhere.

    >>> with_whole_path("ramp")
    'ramp'
    """
    path, rest = _split(name)
    return name if path is None else f"{path.resolve()}{rest}"


def about_name(name: str) -> dict[str, str]:
    """A controller's name as plain data, with a fingerprint of the file that it leads to, if it does."""
    path, rest = _split(name)
    return {"name": name} if path is None else {"name": f"{path.name}{rest}", "file": _of_file(path)}


def _split(name: str) -> tuple[Path | None, str]:
    """The file that a name begins with, and what follows."""
    if is_gain_file(name):
        return Path(name), ""
    end = name.index(".py") + 3 if ".py" in name else 0
    return (Path(name[:end]), name[end:]) if end else (None, name)


def _plain(value: object) -> object:
    """A value as plain data that tells it from others, with fingerprints of files and arrays."""
    if isinstance(value, str | Path):
        path = Path(value)
        return [path.name, _of_file(path)] if path.suffix and path.is_file() else str(value)
    if value is None or isinstance(value, bool | int | float):
        return value
    if isinstance(value, Machine):
        return value.to_toml()
    if isinstance(value, np.ndarray):
        return [list(value.shape), hashlib.sha256(value.tobytes()).hexdigest()]
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if is_dataclass(value):
        values = {f.name: _plain(getattr(value, f.name)) for f in fields(value)}
        return {"class": _address(type(value)), **values}
    return repr(value)


def _address(cls: type) -> str:
    return f"{cls.__module__}.{cls.__qualname__}"


def _of_file(path: Path) -> str:
    try:
        return hashlib.sha256(path.read_bytes()).hexdigest()
    except OSError:
        return "not readable"
