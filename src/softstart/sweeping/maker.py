"""The controller of a sweep as something that can be sent to another process: how it is made."""

from __future__ import annotations

import hashlib
import pickle
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from softstart.controller.base import Controller
from softstart.controller.finding import GAIN_FILES, controller_class, make_controller
from softstart.controller.tuned import Tuned
from softstart.drive.records import is_machine
from softstart.errors import InputError, Mistakes
from softstart.parallel import why_not_sendable
from softstart.quantities import show


class Known(NamedTuple):
    """What is known of a controller's parameter."""

    unit: str
    meaning: str
    kind: str


class Parameters(dict[str, Known]):
    """Parameters by name; `lacking` says that one is not among them, `fixed` names those with one value."""

    lacking = ""
    fixed: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Maker:
    """A controller by name and parameters, or a finished one; "" where the controllers are an axis.

    >>> Maker("ramp", {"initial": 5.0}).make({"time": "120 ms"}).parameters["time"]
    0.12
    """

    given: str | Controller = ""
    values: Mapping[str, object] = field(default_factory=dict)
    allow_code: bool = False  # of files of tuned gains

    @property
    def shown(self) -> str:
        """The controller's name, for a sentence or a title."""
        if isinstance(self.given, Controller):
            return self.given.name or type(self.given).__name__
        return self.given

    def make(self, more: Mapping[str, object], name: str = "") -> Controller:
        """The controller with further parameters, which may be arrays; `name` where it is from an axis."""
        if isinstance(self.given, Controller):
            return replace(self.given, **more) if more else self.given
        return make_controller(name or self.given, {**self.values, **more}, allow_code=self.allow_code)

    def parameters(self, names: Sequence[str] | None = None) -> Parameters:
        """Those of the controller; or those that all controllers of these names have."""
        wrong, tables = Mistakes(), list[Parameters]()
        for one in [self.given] if names is None else names:
            with wrong.noted():
                tables.append(_parameters_of(self._class_of(one), self.shown if names is None else str(one)))
        wrong.settle()
        shared, *others = tables or [Parameters()]
        if others:
            same = [
                n
                for n, one in shared.items()
                if all(table.get(n, one[:0])[::2] == one[::2] for table in others)
            ]
            shared = Parameters({name: shared[name] for name in same})
            shared.lacking = f"not all of {', '.join(map(str, names or ()))} have this parameter"
        shared.fixed = tuple(self.values) if names is None else ()
        return shared

    def _class_of(self, given: str | Controller) -> type[Controller]:
        if isinstance(given, str) and not given.lower().endswith(GAIN_FILES):
            return controller_class(given)
        return type(make_controller(given, allow_code=self.allow_code))

    def about(self) -> Any:
        """What it is, as plain data: two makers of the same data make controllers that answer alike."""
        if isinstance(self.given, Controller):
            return _digested(self.given)
        values = {name: _digested(value) for name, value in self.values.items()}
        return {**about_name(self.given), "parameters": values}

    def check_sendable(self) -> None:
        """Raise InputError for a controller that no other process can load."""
        if why_not_sendable(self.given):
            raise InputError(
                f"controller = {self.shown}: another process cannot load this object of class "
                f"{type(self.given).__qualname__}; give it as path/to/file.py:ClassName with parameters, or "
                "say workers=1."
            )


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
    if name.lower().endswith(GAIN_FILES):
        return Path(name), ""
    end = name.index(".py") + 3 if ".py" in name else 0
    return (Path(name[:end]), name[end:]) if end else (None, name)


def _parameters_of(cls: type[Controller], shown: str) -> Parameters:
    found = Parameters()
    if not issubclass(cls, Tuned):  # whose fields are the gains that stand in its file
        for f in fields(cls):
            about = f.metadata
            found[f.name] = Known(
                about.get("unit", ""), about.get("meaning", ""), about.get("kind", "quantity")
            )
    found.lacking = f"the controller {shown} has no such parameter"
    return found


def _digested(value: object) -> Any:
    """A value as plain data that tells it from others, with a fingerprint of what is long."""
    if value is None or isinstance(value, bool | int | float):
        return value
    if isinstance(value, str | Path):
        path = Path(value)
        return [path.name, _of_file(path)] if path.suffix and path.is_file() else str(value)
    if is_machine(value):
        return value.to_toml()  # type: ignore[attr-defined]
    if isinstance(value, np.ndarray):
        return [list(value.shape), hashlib.sha256(value.tobytes()).hexdigest()]
    if isinstance(value, list | tuple):
        return [_digested(one) for one in value]
    if is_dataclass(value):
        cls = type(value)
        content = {f.name: _digested(getattr(value, f.name)) for f in fields(value)}
        return {"class": f"{cls.__module__}.{cls.__qualname__}", **content}
    try:
        return hashlib.sha256(pickle.dumps(value)).hexdigest()
    except (pickle.PicklingError, AttributeError, TypeError):
        return show(value)


def _of_file(path: Path) -> str:
    try:
        return hashlib.sha256(path.read_bytes()).hexdigest()
    except OSError:
        return "not readable"
