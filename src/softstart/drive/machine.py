"""What drives and chains have in common: the one interface by which analyses see a machine."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any, ClassVar, Literal, NamedTuple, Self

from softstart.arrays import Vector
from softstart.drive.limits import Limits
from softstart.input.gear import Gear
from softstart.input.parameters import Parameter, ParameterValue

LoadKind = Literal["active", "reactive"]


class TwoMasses(NamedTuple):
    """A machine as two masses at the motor shaft; NaN for what it does not have.

    `travel` is that through the gap to the driving flank, `speed` what the load is to reach.
    """

    J1: float  # kg m2
    J2: float  # kg m2
    c: float  # N m/rad
    d: float  # N m s/rad
    gap: float  # rad
    travel: float  # rad
    Ms: float  # N m, less the friction of the motor
    Mc: float  # N m
    active: bool  # whether a part of Mc acts always
    friction: float  # the rest of Mc, N m, Coulomb friction
    speed: float  # rad/s
    ratio: float  # turns of the motor for one of the output

    @property
    def falling(self) -> float:
        """The torque that moves the load while the gap is open, in size, N m: 0 where friction holds it."""
        return max(abs(self.Mc - self.friction) - self.friction, 0.0)


class Machine(ABC):
    """A machine that can be started: a `Drive` of two masses, or a `Chain` of many.

    Inertias, torques, gaps and angles are in SI at the motor shaft unless stated otherwise; arrays have one
    entry per shaft. Annotate with it arguments that take either kind.

    Attributes
    ----------
    name, source, assumed, units : str
        Title; source of the numbers; what is assumed; units in which results are shown.
    target_speed : float or None
        Speed that the load is to reach, rad/s; None for a chain that is only analysed.
    motor : Drive, Motor or None
        The object that has the parameters of the motor; None for a chain without one.
    brake : str
        "motor" where a brake holds the motor until its release, else "none".
    brake_torque : float
        Torque with which the closed brake slips, N m; infinite for an ideal lock, 0 without a brake.
    closing_delay, opening_delay : float
        Time from a command to the brake until it acts, s.
    duty : Duty or None
        The cycle of steps that the machine repeats.
    initial_motor_speed, initial_load_speed : float
        Speeds at the start, rad/s.

    Examples
    --------
    >>> from softstart import Chain, Drive, Machine
    >>> isinstance(Drive.load("crane-4amtkf"), Machine), isinstance(Chain.load("crane-4-mass"), Machine)
    (True, True)

    References
    ----------
    docs/reference/drive-file.md, docs/reference/chain-file.md.
    """

    WHAT: ClassVar[str]  # in sentences, as "a drive"
    KIND: ClassVar[str]  # the word alone
    LIMITS_GIVEN: ClassVar[str]  # where permissible values are given

    # a dataclass would take properties for defaults: declared for type checkers only
    if TYPE_CHECKING:

        @property
        def name(self) -> str: ...
        @property
        def source(self) -> str: ...
        @property
        def assumed(self) -> str: ...
        @property
        def units(self) -> str: ...
        @property
        def target_speed(self) -> float | None: ...
        @property
        def motor(self) -> Any: ...  # what has its parameters: a Drive, a Motor, or None
        @property
        def brake(self) -> str: ...
        @property
        def brake_torque(self) -> float: ...
        @property
        def closing_delay(self) -> float: ...
        @property
        def opening_delay(self) -> float: ...
        @property
        def duty(self) -> Any: ...  # a Duty, which reads this module, or None
        @property
        def initial_motor_speed(self) -> float: ...
        @property
        def initial_load_speed(self) -> float: ...

    # ---- masses, shafts, motor ---------------------------------------------------------------------------

    @property
    @abstractmethod
    def mass_names(self) -> tuple[str, ...]:
        """The names of the masses, from one end to the other."""

    @property
    @abstractmethod
    def shaft_names(self) -> tuple[str, ...]:
        """The names of the shafts, each made of those of the two masses that it joins."""

    @property
    @abstractmethod
    def motor_index(self) -> int:
        """The index of the mass on which the motor acts; 0 for a chain without a motor."""

    @property
    @abstractmethod
    def load_index(self) -> int:
        """The index of the mass that is to reach the target speed."""

    @property
    @abstractmethod
    def gear(self) -> Gear | None:
        """The gear between the motor shaft and the output; None for a chain, whose shafts have gears."""

    @property
    @abstractmethod
    def gaps(self) -> Vector:
        """The total gap of each shaft, rad."""

    @property
    @abstractmethod
    def local_gaps(self) -> tuple[float, ...]:
        """The total gap of each shaft at that shaft itself, rad, as it was given."""

    @property
    @abstractmethod
    def stiffnesses(self) -> Vector:
        """The stiffness of each shaft, N m/rad; infinite for a rigid one."""

    @property
    @abstractmethod
    def dampings(self) -> Vector:
        """The damping of each shaft, N m s/rad."""

    @property
    @abstractmethod
    def contact_laws(self) -> tuple[str, ...]:
        """The contact law of each shaft."""

    @property
    @abstractmethod
    def frictions(self) -> tuple[float, float, float]:
        """Coulomb friction of the motor, N m; viscous friction of the motor and the load, N m s/rad."""

    @property
    @abstractmethod
    def elastic_period(self) -> float:
        """The period of the first natural frequency in contact, s."""

    @property
    @abstractmethod
    def damping_ratio(self) -> float:
        """The damping ratio of the first natural mode in contact."""

    @abstractmethod
    def with_damping_ratio(self, ratio: float) -> Self:
        """The machine with damping of this ratio in each elastic shaft that has none."""

    # ---- torques and limits ------------------------------------------------------------------------------

    @property
    @abstractmethod
    def mean_torque(self) -> float:
        """M12avg, N m: the mean shaft torque under full starting torque, to which K_dyn refers, [G](16)."""

    @property
    @abstractmethod
    def shaft_means(self) -> Vector:
        """The mean torque of each shaft under full starting torque, N m; NaN without a motor."""

    @property
    @abstractmethod
    def permissible_torques(self) -> Vector:
        """The permissible torque of each shaft, N m; NaN where none is given."""

    @property
    @abstractmethod
    def limits(self) -> Limits:
        """The permissible values; empty where none are given."""

    # ---- the start ---------------------------------------------------------------------------------------

    @property
    @abstractmethod
    def positions(self) -> Mapping[str, Self]:
        """The machine at each position at which it may start: one, or three if that is unknown."""

    @property
    @abstractmethod
    def position_given(self) -> bool:
        """Whether the start position is given, not derived from brake, load and reversal."""

    @property
    @abstractmethod
    def release_time(self) -> float:
        """When the brake of the motor is released, s: infinite for torque proving, 0 without a brake."""

    # ---- simpler machines --------------------------------------------------------------------------------

    @property
    @abstractmethod
    def design_drive(self) -> Any:  # a Drive, which derives from this
        """The drive for which controllers are set up: of two masses, at one position."""

    @property
    @abstractmethod
    def two_masses(self) -> Any:  # a Drive
        """The machine as a drive: itself, or the modal reduction of a chain, whatever its error."""

    @property
    @abstractmethod
    def lever_rule_model(self) -> TwoMasses:
        """The machine as two masses by the lever rule: each mass split by the compliance on both sides."""

    @property
    @abstractmethod
    def gap_and_inertia(self) -> tuple[float, float]:
        """The sum of the gaps, rad, and the inertia of the load mass at its own shaft, kg m2."""

    @property
    @abstractmethod
    def motor_inertia_at_load(self) -> float:
        """The inertia of the motor at the shaft of the load mass, kg m2."""

    @abstractmethod
    def scaled(self, gaps: float = 1.0, load_inertia: float = 1.0) -> Self:
        """The machine with all gaps and the load inertia multiplied; start angles keep their share."""

    @abstractmethod
    def with_gap_and_inertia(self, gap: float, inertia: float, origin: Self | None = None) -> Self:
        """The machine with this sum of the gaps and this load inertia.

        A chain whose gaps are all closed widens them in the proportions of `origin`.
        """

    # ---- the load ----------------------------------------------------------------------------------------

    @property
    @abstractmethod
    def overhauling_torque(self) -> float:
        """With what torque the load turns a motor without torque, N m; 0 where friction holds it.

        Positive backwards, as an active load torque.
        """

    @abstractmethod
    def with_load(self, values: Mapping[str, Any], mass: str = "") -> Self:
        """The machine with another load: torque, kind, inertia and friction by their keys, as they are given.

        Of a chain those of a mass, by default the load mass; a drive has one load.
        """

    # ---- parameters --------------------------------------------------------------------------------------

    @abstractmethod
    def parameters_by_path(self) -> dict[str, tuple[Parameter, Any]]:
        """All parameters of its file by their paths, each with its value."""

    @abstractmethod
    def parameter_keys(self) -> Iterator[str]:
        """The keys of all parameters that can be varied, as in a file."""

    @abstractmethod
    def parameter_value(self, key: str) -> ParameterValue | None:
        """The parameter that a key names, as in a file or in Python; None if there is none."""

    @abstractmethod
    def with_values(self, values: Mapping[str, Any]) -> Self:
        """The machine with these values by key or name; with a gap as `with_gap`."""

    @abstractmethod
    def gear_with(self, **given: object) -> Gear | str:
        """The gear for values "at output" among those to be set, or the reason why there is none."""

    @abstractmethod
    def to_toml(self) -> str:
        """The machine as TOML text in SI, which `from_toml` reads back to an equal machine."""

    # ---- results -----------------------------------------------------------------------------------------

    @property
    @abstractmethod
    def warnings(self) -> tuple[str, ...]:
        """Sentences on what the model leaves out that decides its shaft torques."""

    @property
    def saved_as(self) -> str:
        """The file without its units, which change no result: what saved results belong to.

        >>> from softstart import Drive
        >>> crane = Drive.load("crane-4amtkf")
        >>> crane.replace(units="deg, kN m").saved_as == crane.saved_as
        True
        """
        machine: Any = self
        return str(machine.replace(units="").to_toml())

    @property
    @abstractmethod
    def identity(self) -> dict[str, object]:
        """What the summary of a start says about the machine."""

    @abstractmethod
    def columns_of(self, states: Mapping[str, Vector]) -> dict[str, Vector]:
        """The states of a start by the headings of a table."""
