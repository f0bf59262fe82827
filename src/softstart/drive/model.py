"""The drive: its parameters in SI, checked, frozen, and what follows from them at once."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Iterator, Mapping
from typing import TYPE_CHECKING, Any, ClassVar, Literal, Self, get_args, overload

import numpy as np

from softstart.drive.checks import contradictions, elastic_frequency
from softstart.input.documents import document_text, parsed
from softstart.input.files import Library
from softstart.input.parameter_set import MaybeNumbers, Numbers, ParameterSet, parameter, read_settings
from softstart.input.parameters import Parameter, Wording
from softstart.late import late
from softstart.quantities import Value

if TYPE_CHECKING:
    import control

control_systems = late("softstart.drive.control_systems")

__all__ = ["PARAMETERS", "TABLES", "ContactLaw", "Drive", "LoadKind", "library"]

LoadKind = Literal["active", "reactive"]
ContactLaw = Literal["no-pull", "dead-zone", "modelica"]

library = Library("softstart.drive", "a drive", "drives")


class Drive(ParameterSet):
    """Motor, shaft with a gap, load and start: the parameters that everything else is computed from.

    Each quantity is a number in SI, a string with a unit, or an array of such (a batch: arrays broadcast
    together to `shape`). Angles are in rad at the motor shaft. A drive is frozen and its arrays are
    read-only; equal drives hash alike.

    Parameters
    ----------
    {parameters}

    Raises
    ------
    InputError
        With a sentence for every mistake of the input.

    Examples
    --------
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

    References
    ----------
    Equations of motion: [G] (1), docs/theory/stages.md; contact laws: docs/theory/contact-laws.md.
    """

    WHAT: ClassVar[str] = "a drive"
    BATCH: ClassVar[bool] = True

    name: str = parameter("name", "", "name of the drive", '"my drive"', "one line", default="unnamed drive")
    source: str = parameter("source", "", "source of the numbers", '"data sheet"', default="")
    motor_inertia: Numbers = parameter(
        "motor.inertia", "kg*m^2", "inertia of the motor", '"0.035 kg*m^2"', "above 0", symbol="J1"
    )
    starting_torque: Numbers = parameter(
        "motor.starting_torque", "N*m", "starting torque of the motor", '"62 N*m"', "above 0", symbol="Ms"
    )
    maximum_torque: Numbers = parameter(
        "motor.maximum_torque", "N*m", "largest torque of the motor", '"64 N*m"', "above 0",
        default=None, follows="starting_torque",
    )  # fmt: skip
    minimum_torque: Numbers = parameter(
        "motor.minimum_torque", "N*m", "smallest (braking) torque of the motor", '"-20 N*m"', "0 or less",
        default=0.0,
    )  # fmt: skip
    rated_power: MaybeNumbers = parameter(
        "motor.rated_power", "W", "rated power of the motor", '"2.2 kW"', "above 0", default=None
    )
    rated_speed: MaybeNumbers = parameter(
        "motor.rated_speed", "rad/s", "rated speed of the motor", '"880 rpm"', "above 0", default=None
    )
    torque_lag: Numbers = parameter(
        "motor.torque_lag", "s", "time constant of the torque behind its demand", '"2 ms"', "0 or more",
        default=0.0,
    )  # fmt: skip
    torque_rate: Numbers = parameter(
        "motor.torque_rate", "N*m/s", "largest rate of the torque demand", '"500 N*m/s"', "above 0",
        default=math.inf, infinite=True,
    )  # fmt: skip
    encoder_lines: Numbers = parameter(
        "motor.encoder_lines", "1", "number of encoder lines (four counts each; 0 for an ideal encoder)",
        "4096", "a whole number, 0 or more", default=4096.0,
    )  # fmt: skip
    encoder_phase: Numbers = parameter(
        "motor.encoder_phase", "1",
        "where between two edges of the encoder the start lies, as a share of a count",
        "0.5", "from 0 to 1", default=0.0,
    )  # fmt: skip
    torque_noise: Numbers = parameter(
        "motor.torque_noise", "N*m",
        "standard deviation of the noise on the measured motor torque, in each sample",
        '"0.2 N*m"', "0 or more", default=0.0,
    )  # fmt: skip
    noise_seed: Numbers = parameter(
        "motor.noise_seed", "1", "number of the noise: the same number gives the same noise",
        "1", "a whole number, 0 or more", default=0.0,
    )  # fmt: skip
    computing_delay: Numbers = parameter(
        "motor.computing_delay", "s",
        "dead time between what a controller measures and the torque demand that follows from it",
        '"1 ms"', "0 or more", default=0.0,
    )  # fmt: skip
    stiffness: Numbers = parameter(
        "shaft.stiffness", "N*m/rad", "stiffness of the shaft", '"368 N*m/rad"', "above 0", symbol="c"
    )
    damping: Numbers = parameter(
        "shaft.damping", "N*m*s/rad", "damping of the shaft", '"1.5 N*m*s/rad"', "0 or more",
        default=0.0, symbol="d",
    )  # fmt: skip
    gap: Numbers = parameter("shaft.gap", "rad", "total angular gap", '"0.5 rad"', "0 or more", symbol="gap")
    contact_law: ContactLaw = parameter(
        "shaft.contact_law", "", "law of the shaft torque in contact", '"no-pull"',
        default="no-pull", choices=get_args(ContactLaw),
    )  # fmt: skip
    start_position: Numbers = parameter(
        "shaft.start_position", "rad", "twist phi1 - phi2 at the start (0 is mid-gap)", '"-0.25 rad"',
        default=0.0, symbol="theta",
    )  # fmt: skip
    load_inertia: Numbers = parameter(
        "load.inertia", "kg*m^2", "inertia of the load at the motor shaft", '"0.175 kg*m^2"', "above 0",
        symbol="J2",
    )  # fmt: skip
    load_torque: Numbers = parameter(
        "load.torque", "N*m", "torque of the load at the motor shaft", '"7.16 N*m"', symbol="Mc"
    )
    load_kind: LoadKind = parameter(
        "load.kind", "", "kind of the load torque", '"active"', default="active", choices=get_args(LoadKind)
    )
    target_speed: Numbers = parameter(
        "start.target_speed", "rad/s", "speed that the load is to reach", '"880 rpm"', "above 0",
        default=None, follows="rated_speed",
    )  # fmt: skip
    initial_load_speed: Numbers = parameter(
        "start.initial_load_speed", "rad/s", "speed of the load at the start", '"0 rad/s"', default=0.0
    )
    initial_motor_speed: Numbers = parameter(
        "start.initial_motor_speed", "rad/s", "speed of the motor at the start", '"0 rad/s"', default=0.0
    )

    def _check(self, values: Mapping[str, Any], wording: Wording) -> Iterable[str]:
        return contradictions(values, self.PARAMETERS, wording)

    # ---- where drives come from --------------------------------------------------------------------------

    @classmethod
    def load(cls, drive: str | os.PathLike[str]) -> Self:
        """A drive from its TOML file, or a shipped one by its name (`softstart.drive.library.names()`).

        Parameters
        ----------
        drive : str or path
            A shipped name, or the path of a TOML file.

        Raises
        ------
        InputError
            With a sentence for every mistake, each with the file, the table and the key.

        Examples
        --------
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
        return cls.from_tables(parsed(text, Wording(where, style="toml"), cls.WHAT, cls.TABLES), where=where)

    @classmethod
    def from_tables(cls, document: Mapping[str, Any], *, where: str = "") -> Self:
        """A drive from the tables of a document, {"shaft": {"gap": 0.5}, ...}; `where` as in `from_toml`."""
        return cls._from_document(dict(document), where)

    # ---- the drive changed -------------------------------------------------------------------------------

    def replace(self, **changes: Any) -> Self:
        """The same drive with some parameters changed; those that follow another one follow it still.

        >>> Drive.load("crane-4amtkf").replace(gap="2 rad", load_inertia="700 kg*cm^2").gap
        2.0
        """
        return self._changed(changes, Wording(), [])

    def with_settings(self, settings: Iterable[str]) -> Self:
        """The drive with changes as typed at a command line: `table.key=value` or `name=value`.

        >>> Drive.load("crane-4amtkf").with_settings(["load.inertia=0.07", "gap=2 rad"]).J2
        0.07
        """
        return self._changed(*read_settings(settings, PARAMETERS))

    def to_toml(self) -> str:
        """The drive as TOML text in SI units, which `from_toml` reads back to an equal drive.

        >>> print(Drive.load("crane-4amtkf").to_toml().splitlines()[4])
        inertia = 0.035  # kg*m^2: inertia of the motor
        """
        given = self.given()
        return document_text((table, given) for table in self.TABLES)

    # ---- batches -----------------------------------------------------------------------------------------

    @property
    def shape(self) -> tuple[int, ...]:
        """The shape that the arrays among the parameters broadcast to; () for a single drive.

        >>> Drive.load("crane-4amtkf").replace(gap=[0.5, 1, 2]).shape
        (3,)
        """
        return np.broadcast_shapes(*(v.shape for v in vars(self).values() if isinstance(v, np.ndarray)))

    def elements(self) -> Iterator[Self]:
        """The single drives of a batch, last index fastest; a single drive is its own only element.

        >>> [drive.gap for drive in Drive.load("crane-4amtkf").replace(gap=[0.5, 1, 2]).elements()]
        [0.5, 1.0, 2.0]
        """
        shape = self.shape
        if shape == ():
            yield self
            return
        varied = {
            name: np.broadcast_to(value, shape).ravel().tolist()
            for name, value in vars(self).items()
            if isinstance(value, np.ndarray)
        }
        for row in zip(*varied.values(), strict=True):
            # each element was checked with the batch
            one = type(self).__new__(type(self))
            vars(one).update(vars(self) | dict(zip(varied, row, strict=True)))
            yield one

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
        if nonlinear:
            return control_systems.whole_drive(self)
        return control_systems.in_contact(self)


PARAMETERS: Mapping[str, Parameter] = Drive.PARAMETERS
TABLES: tuple[str, ...] = tuple(table.name for table in Drive.TABLES if table.name)
