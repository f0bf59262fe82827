"""The drive: its parameters in SI, checked, frozen, and what follows from them at once."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Iterator, Mapping
from typing import TYPE_CHECKING, Any, Literal, Self, Unpack, cast, overload

import numpy as np
from pydantic import BaseModel, Field, ValidationError, ValidationInfo, field_validator

from softstart.drive import toml_file
from softstart.drive.frozen import FrozenModel
from softstart.drive.keywords import DriveChanges, DriveKeywords
from softstart.drive.parameters import PARAMETERS, ContactLaw, LoadKind, library
from softstart.drive.reading import cross_checks, elastic_frequency, read_parameter
from softstart.drive.sentences import Mistake, Wording, mistakes_of, told
from softstart.drive.settings import read_settings
from softstart.errors import InputError
from softstart.quantities import RefusedError, Value

if TYPE_CHECKING:
    import control

__all__ = ["Drive"]


def _default(name: str) -> Any:
    """The field of a parameter that may be left out: its default is in the table of parameters."""
    parameter = PARAMETERS[name]
    if parameter.follows:
        followed = parameter.follows
        return Field(default_factory=lambda earlier: earlier[followed])
    return Field(default=parameter.default)


class Drive(FrozenModel):
    """Motor, shaft with a gap, load and start: the parameters that everything else is computed from.

    Each quantity is a number in SI, a string with a unit, or an array of such (a batch: arrays broadcast
    together to `shape`). Angles are in rad at the motor shaft. A drive is frozen and its arrays are
    read-only; equal drives hash alike. All mistakes of one input raise a single `InputError`.

    >>> drive = Drive(
    ...     motor_inertia=0.035, starting_torque="62 N*m", stiffness=368.465, gap="0.5 rad",
    ...     load_inertia="0.175 kg*m^2", load_torque=7.16, rated_speed="880 rpm",
    ... )
    >>> round(drive.Omega, 3), round(drive.elastic_period, 5), drive.target_speed == drive.rated_speed
    (112.397, 0.0559, True)
    >>> Drive(motor_inertia=-1, starting_torque="6 N", stiffness=368, load_inertia=0.175, load_torque=7)
    Traceback (most recent call last):
    softstart.errors.InputError: motor_inertia = -1: the inertia of the motor must be above 0.
    starting_torque = "6 N": N is a force, not a torque; write a torque as "62 N*m" or as ...
    gap is missing: the total angular gap is needed; write for example gap="0.5 rad".
    target_speed is missing: the speed that the load is to reach is needed, or rated_speed ...
    """

    name: str = _default("name")
    source: str = _default("source")
    motor_inertia: Value
    starting_torque: Value
    maximum_torque: Value = _default("maximum_torque")
    minimum_torque: Value = _default("minimum_torque")
    rated_power: Value | None = _default("rated_power")
    rated_speed: Value | None = _default("rated_speed")
    torque_lag: Value = _default("torque_lag")
    torque_rate: Value = _default("torque_rate")
    encoder_lines: Value = _default("encoder_lines")
    encoder_phase: Value = _default("encoder_phase")
    torque_noise: Value = _default("torque_noise")
    noise_seed: Value = _default("noise_seed")
    computing_delay: Value = _default("computing_delay")
    stiffness: Value
    damping: Value = _default("damping")
    gap: Value
    contact_law: ContactLaw = _default("contact_law")
    start_position: Value = _default("start_position")
    load_inertia: Value
    load_torque: Value
    load_kind: LoadKind = _default("load_kind")
    target_speed: Value = _default("target_speed")
    initial_load_speed: Value = _default("initial_load_speed")
    initial_motor_speed: Value = _default("initial_motor_speed")

    def __init__(self, **given: Unpack[DriveKeywords]) -> None:
        self._fill(given, Wording(), [])

    def _fill(self, given: Mapping[str, object], wording: Wording, mistakes: list[Mistake]) -> None:
        """Read all parameters, or raise one `InputError` for everything that is wrong with them."""
        # None stands for "not given" where there is no default of its own, so that what follows can follow.
        left_out = {p.name for p in PARAMETERS.values() if p.default is None and not p.required}
        given = {name: v for name, v in given.items() if not (v is None and name in left_out)}
        try:
            BaseModel.__init__(self, **given)
        except ValidationError as error:
            mistakes = [*mistakes, *mistakes_of(error, wording, given)]
            values = _valid(given)
        else:
            values = dict(self)
        named = given.keys() | {mistake.meant for mistake in mistakes}
        if not {"target_speed", "rated_speed"} & named:
            mistakes = [*mistakes, Mistake(wording.missing("target_speed"), missing="target_speed")]
        sentences = [*told(mistakes), *cross_checks(values, wording)]
        if sentences:
            raise InputError(sentences)

    @field_validator("*", mode="plain")
    @classmethod
    def _read(cls, value: object, info: ValidationInfo) -> object:
        return read_parameter(PARAMETERS[str(info.field_name)], value)

    # ---- where drives come from --------------------------------------------------------------------------

    @classmethod
    def load(cls, drive: str | os.PathLike[str]) -> Self:
        """A drive from its TOML file, or a shipped one by its name (`softstart.drive.library.names()`).

        >>> Drive.load("crane-4amtkf").gap
        0.5
        """
        text, where = library.find(drive)
        return cls.from_toml(text, where=where)

    @classmethod
    def from_toml(cls, text: str, *, where: str = "") -> Self:
        """A drive from TOML text; `where` is put before each sentence of an `InputError`.

        >>> drive = Drive.load("crane-4amtkf")
        >>> Drive.from_toml(drive.to_toml()) == drive
        True
        """
        wording = Wording(where, style="toml")
        given, mistakes = toml_file.flatten(text, wording)
        return cls._made(given, wording, mistakes)

    @classmethod
    def _made(cls, given: Mapping[str, object], wording: Wording, mistakes: list[Mistake]) -> Self:
        drive = cls.__new__(cls)
        drive._fill(given, wording, mistakes)
        return drive

    # ---- the drive changed -------------------------------------------------------------------------------

    def replace(self, **changes: Unpack[DriveChanges]) -> Self:
        """The same drive with some parameters changed; those that follow another one follow it still.

        >>> Drive.load("crane-4amtkf").replace(gap="2 rad", load_inertia="700 kg*cm^2").gap
        2.0
        """
        return self._made(self.given() | dict(changes), Wording(), [])

    __replace__ = replace  # copy.replace of Python 3.13

    def with_settings(self, settings: Iterable[str]) -> Self:
        """The drive with changes as typed at a command line: `table.key=value` or `name=value`.

        >>> Drive.load("crane-4amtkf").with_settings(["load.inertia=0.07", "gap=2 rad"]).J2
        0.07
        """
        changes, wording, mistakes = read_settings(settings)
        return self._made(self.given() | changes, wording, mistakes)

    def to_toml(self) -> str:
        """The drive as TOML text in SI units, which `from_toml` reads back to an equal drive.

        >>> print(Drive.load("crane-4amtkf").to_toml().splitlines()[4])
        inertia = 0.035  # kg*m^2: inertia of the motor
        """
        return toml_file.write(self.given())

    # ---- batches -----------------------------------------------------------------------------------------

    @property
    def shape(self) -> tuple[int, ...]:
        """The shape that the arrays among the parameters broadcast to; () for a single drive.

        >>> Drive.load("crane-4amtkf").replace(gap=[0.5, 1, 2]).shape
        (3,)
        """
        return np.broadcast_shapes(*(v.shape for _, v in self if isinstance(v, np.ndarray)))

    def elements(self) -> Iterator[Self]:
        """The single drives of a batch, last index fastest; a single drive is its own only element.

        >>> [drive.gap for drive in Drive.load("crane-4amtkf").replace(gap=[0.5, 1, 2]).elements()]
        [0.5, 1.0, 2.0]
        """
        shape = self.shape
        if shape == ():
            yield self
            return
        fixed = {name: value for name, value in self if not isinstance(value, np.ndarray)}
        varied = {
            name: np.broadcast_to(value, shape).ravel().tolist()
            for name, value in self
            if isinstance(value, np.ndarray)
        }
        for row in zip(*varied.values(), strict=True):
            # each element was checked with the batch
            one = fixed | dict(zip(varied, row, strict=True))
            yield cast("Self", type(self).model_construct(set(self.model_fields_set), **one))

    # ---- what follows from the parameters, under the symbols of [G] --------------------------------------

    @property
    def J1(self) -> Value:
        """Inertia of the motor, kg m2."""
        return self.motor_inertia

    @property
    def J2(self) -> Value:
        """Inertia of the load, kg m2."""
        return self.load_inertia

    @property
    def c(self) -> Value:
        """Stiffness of the shaft, N m/rad."""
        return self.stiffness

    @property
    def d(self) -> Value:
        """Damping of the shaft, N m s/rad."""
        return self.damping

    @property
    def Mc(self) -> Value:
        """Torque of the load, N m."""
        return self.load_torque

    @property
    def Ms(self) -> Value:
        """Starting torque of the motor, N m."""
        return self.starting_torque

    @property
    def Omega(self) -> Value:
        """Elastic frequency in contact, undamped: `sqrt(c (J1 + J2)/(J1 J2))`, rad/s, [G](8)."""
        return elastic_frequency(self.J1, self.J2, self.c)

    @property
    def elastic_period(self) -> Value:
        """`2 pi/Omega`, s."""
        return 2.0 * math.pi / self.Omega

    @overload
    def to_control(self, *, nonlinear: Literal[False] = False) -> control.StateSpace: ...

    @overload
    def to_control(self, *, nonlinear: bool) -> control.StateSpace | control.NonlinearIOSystem: ...

    def to_control(self, *, nonlinear: bool = False) -> control.StateSpace | control.NonlinearIOSystem:
        """The drive for the python-control library: in contact (linear), or the whole of it.

        The linear system has the inputs `motor_torque` and `load_torque`, as states and outputs the twist `z`
        beyond the gap and the speeds `w1` and `w2`, and the output `shaft_torque`. The nonlinear one has the
        input `demand` and the outputs `phi1, w1, phi2, w2, u, T`; start it from
        `control_systems.initial_state(drive)`. Both are described in `softstart.drive.control_systems`.
        Raises `InputError` for a batch.

        >>> sorted(round(float(abs(pole)), 3) for pole in Drive.load("crane-4amtkf").to_control().poles())
        [0.0, 112.397, 112.397]
        """
        from softstart.drive import control_systems

        if nonlinear:
            return control_systems.whole_drive(self)
        return control_systems.in_contact(self)


def _valid(given: Mapping[str, object]) -> dict[str, object]:
    """Those parameters that are right in themselves, read."""
    values: dict[str, object] = {}
    for name, value in given.items():
        if name in PARAMETERS:
            try:
                values[name] = read_parameter(PARAMETERS[name], value)
            except RefusedError:
                continue
    return values
