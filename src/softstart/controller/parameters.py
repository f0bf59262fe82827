"""Parameters of controllers: declared once, as fields of the class, and read as those of drives are."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cache
from pathlib import Path
from typing import Any, Literal

from softstart.drive import Drive
from softstart.errors import InputError
from softstart.input.parameters import LEAST, LIMITS, MOST, Limit, Parameter, Wording, read_value
from softstart.quantities import RefusedError, Units, show

Interval = tuple[float, float]
Default = Callable[[Drive, "ParameterValues"], Any] | float | str | None


@dataclass(frozen=True)
class ControllerParameter(Parameter):
    """What a controller declares of a parameter; its fields are the arguments of `parameter`."""

    example: str = ""
    default: Default = None
    default_text: str = ""
    multiples: Interval | None = None
    between: Interval | None = None
    python_only: bool = False

    @property
    def kind(self) -> Literal["quantity", "text", "object"]:
        """How a value is given: an object from Python only."""
        return "object" if self.python_only else "quantity" if self.unit else "text"

    @property
    def declared(self) -> bool:
        """Whether it was declared by `parameter`; a plain field of the class is a number without a unit."""
        return bool(self.meaning)

    def read(self, value: object) -> Any:
        """A value in SI, a text, or an array of values for many starts; None stands for the default."""
        if value is None or self.python_only:
            return value
        # most values are floats that are right: batches and tuning make controllers by the thousand
        if type(value) is float and LEAST <= abs(value) <= MOST and LIMITS.get(self.limit, bool)(value):
            return value
        given = str(value) if isinstance(value, Path) else value
        try:
            return read_value(self, given, batch=True)
        except RefusedError as refusal:
            if not self.declared:
                refusal.reason = (
                    "this parameter has no unit; give a bare number, as 0.02, or declare it in its class "
                    "with parameter(unit, meaning)"
                )
            raise InputError(Wording().refused(self, value, refusal)) from None


def parameter(
    unit: str,
    meaning: str,
    default: Default = None,
    default_text: str = "",
    limit: Limit = "any",
    *,
    multiples: Interval | None = None,
    between: Interval | None = None,
    choices: tuple[str, ...] = (),
    python_only: bool = False,
) -> Any:
    """A parameter of a controller, as a field of its class.

    Parameters
    ----------
    unit : SI unit of a bare number; "" for a text.
    meaning : noun phrase without an article; sentences begin with it.
    default : a constant in SI, or a function of the drive and of the other parameters p (in any order, but
        without a simulation).
    default_text : how the default follows from the drive; a constant needs none.
    limit : what a number must be, as "above 0".
    multiples, between : the range of tuning: multiples of the default (evenly in the logarithm), or two
        values in `unit` (evenly), or both, which narrows the first. Without either the parameter is tuned
        only in a range that the user names.
    choices : the texts that are allowed.
    python_only : the value is an object, which only Python can give.

    Returns
    -------
    A dataclass field; its value is None until the controller is set up, unless it was given.

    Raises
    ------
    InputError
        When a controller is made with a value that is no such quantity or beyond the limit, not here.

    Examples
    --------
    >>> from dataclasses import dataclass
    >>> from softstart import PlainController
    >>> @dataclass(frozen=True)
    ... class Half(PlainController):
    ...     torque: float = parameter("N*m", "torque", lambda drive, p: 0.5 * drive.Ms, "Ms/2", "above 0")
    ...     def step(self, measured, state):
    ...         return self.torque
    >>> Half(torque="3 kgf*m").torque, Half().fitted(Drive.load("crane-4amtkf")).torque
    (29.41995, 31.0)
    """
    shown = default_text or ("" if default is None or callable(default) else str(default).removesuffix(".0"))
    declaration = ControllerParameter(
        "", unit, meaning, show(choices[0]) if choices else '"text"', limit, default, choices,
        default_text=shown, multiples=multiples, between=between, python_only=python_only,
    )  # fmt: skip
    return field(default=None, metadata={"parameter": declaration})


def declared_parameters(controller: object) -> Mapping[str, ControllerParameter]:
    """The parameters of a controller or of its class, by name.

    >>> from softstart.controller import controller_class
    >>> time = declared_parameters(controller_class("ramp"))["time"]
    >>> time.unit, time.meaning, time.default_text, time.limit, time.multiples
    ('s', 'duration of the rise', 'two elastic periods', '0 or more', (0.1, 10.0))
    """
    return _of_class(controller if isinstance(controller, type) else type(controller))


@cache
def _of_class(cls: type) -> Mapping[str, ControllerParameter]:
    plain = ControllerParameter("", "1", "")
    return {f.name: replace(f.metadata.get("parameter", plain), key=f.name, name=f.name) for f in fields(cls)}


def set_to_text(controller: object, setting: Mapping[str, float], units: Units) -> str:
    """Values in these units, under the names of the parameters.

    >>> from softstart.controller import make_controller
    >>> set_to_text(make_controller("ramp"), {"time": 0.134, "initial": 7.0}, Units())
    'time 0.134 s, initial 7 N m'
    """
    si = {name: one.unit for name, one in declared_parameters(controller).items()}
    seen = {name: units.of_setting(name, si[name]) for name in setting}
    return ", ".join(
        f"{name} {seen[name].shown(value, si[name]):.4g} {seen[name].label(si[name])}".rstrip()
        for name, value in setting.items()
    )


class ParameterValues:
    """The parameters of a controller as attributes: as given, or derived when they are first read."""

    def __init__(self, controller: object, drive: Drive) -> None:
        self._controller, self._drive = controller, drive

    def __getattr__(self, name: str) -> Any:
        value = getattr(self._controller, name)
        if value is None:
            value = self.derived(declared_parameters(self._controller)[name])
        setattr(self, name, value)
        return value

    def derived(self, parameter: ControllerParameter) -> Any:
        """The default of a parameter."""
        default = parameter.default
        return default(self._drive, self) if callable(default) else default
