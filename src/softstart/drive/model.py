"""The drive: its parameters in SI, checked, frozen, and what follows from them at once."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from functools import cached_property
from typing import Any, ClassVar, Final, Literal, Self, get_args

import numpy as np

from softstart.arrays import Vector
from softstart.drive.checks import FRICTIONS, contradictions, elastic_frequency, mean_torque_of, wrong_units
from softstart.drive.duty import Duty
from softstart.drive.limits import Limits, contradicting_limits, limits_of
from softstart.drive.machine import LoadKind, Machine, TwoMasses
from softstart.errors import InputError
from softstart.input.files import Library
from softstart.input.gear import NO_GEAR, Gear
from softstart.input.parameter_file import ParameterFile
from softstart.input.parameter_set import (
    MaybeNumber,
    MaybeSeries,
    Number,
    NumberOrWord,
    component,
    parameter,
    read_settings,
)  # fmt: skip
from softstart.input.parameters import Mistake, Parameter, ParameterValue, Wording, read_value
from softstart.quantities import RefusedError, show

ContactLaw = Literal["no-pull", "dead-zone", "modelica"]
Position = Literal["mid-gap", "driving-flank", "opposite-flank", "hanging", "unknown"]
Brake = Literal["none", "motor"]
# where a start whose position is unknown may begin; the worst of them counts
UNKNOWN_POSITIONS: Final = ("driving-flank", "mid-gap", "opposite-flank")
SPEEDS: Final = ("initial_load_speed", "initial_motor_speed")
LOAD: Final = ("load_torque", "load_friction")  # the parts of the load torque
OF_DUTY: Final = re.compile(r"\s*(duty\[|shift\.)")
BRAKE: Final = ("brake_torque", "closing_delay", "opening_delay")

# documents of another kind from which a drive follows: a test for them, and the drive; see `DataSheet`
OTHER_DOCUMENTS: list[tuple[Callable[[Mapping[str, Any]], bool], Callable[[dict[str, Any], str], Drive]]] = []

library = Library("softstart.drive", "a drive", "drives")


def has_brake(values: Mapping[str, Any]) -> bool:
    """Whether the parameters of [brake] describe one: any of them is above 0."""
    given = (values.get(name) for name in BRAKE)
    return any(value is not None and np.any(np.asarray(value) > 0.0) for value in given)


def _rests(values: Mapping[str, Any]) -> Any:
    """Whether friction holds the load of these parameters while the gap is open: a bool, or an array."""
    friction = values.get("load_friction", 0.0)
    held = (friction > 0.0) & (abs(values.get("load_torque", math.inf)) <= friction)
    return values.get("load_kind") == "reactive" or held


class Drive(ParameterFile, Machine, library=library):
    """Motor, shaft with a gap, load and start: the parameters that everything else is computed from.

    Each quantity is a number in SI or a string with a unit; many drives are a `softstart.machine_table`.
    Angles are in rad at the motor shaft. A drive is frozen; equal drives hash alike.

    The load torque has an active part, which acts always, and a reactive one, Coulomb friction: `load_torque`
    is of the `load_kind`, `load_friction` is friction besides it. Forward motion takes the sum, Mc.

    Without `start_position`, an active load behind a brake hangs, a reversal begins on the opposite flank,
    and a load at rest that its friction holds, with a gap, is at an unknown position: wherever the last stop
    left it. Any other start begins in mid-gap.

    Parameters
    ----------
    {parameters}
    duty : Duty, default None
        The cycle of steps that the machine repeats.

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
    Equations of motion: [G] (1).
    """

    KIND: ClassVar[str] = "drive"
    GEARED: ClassVar[frozenset[str]] = frozenset(("gear_ratio", "gear_efficiency", *LOAD))
    LIMITS_GIVEN: ClassVar[str] = "[limits] in the drive file"
    # as a chain has it
    motor_index, load_index = 0, 1
    mass_names: ClassVar[tuple[str, ...]] = ("motor", "load")
    shaft_names: ClassVar[tuple[str, ...]] = ("motor - load",)
    warnings: ClassVar[tuple[str, ...]] = ()  # what it leaves out that decides its shaft torques
    SEVERAL: ClassVar[str] = (
        "a drive has one value; for several use sweep, in Python machine_table(drive, {name}=...)"
    )

    # fmt: off
    name: str = parameter("name", "", "name of the drive", '"my drive"', "one line", default="unnamed drive")
    source: str = parameter("source", "", "source of the numbers", '"data sheet"', default="")
    assumed: str = parameter("assumed", "", "what is assumed rather than known",
        '"efficiency 0.95; damping ratio 0.02"', default="")
    units: str = parameter("units", "", "units and shaft in which results are shown",
        '"arcmin, rpm, kN m, at output"', default="")
    motor_inertia: Number = parameter("motor.inertia", "kg*m^2", "inertia of the motor", '"0.035 kg*m^2"',
        "above 0", symbol="J1")
    starting_torque: Number = parameter("motor.starting_torque", "N*m", "starting torque of the motor",
        '"62 N*m"', "above 0", symbol="Ms")
    maximum_torque: Number = parameter("motor.maximum_torque", "N*m", "largest torque of the motor",
        '"64 N*m"', "above 0", default=None, follows="starting_torque", label="largest torque")
    minimum_torque: Number = parameter("motor.minimum_torque", "N*m",
        "smallest (braking) torque of the motor", '"-20 N*m"', "0 or less", default=0.0,
        label="braking torque")
    motor_friction: Number = parameter("motor.friction", "N*m", "Coulomb friction of the motor", '"1.2 N*m"',
        "0 or more", default=0.0)
    motor_viscous_friction: Number = parameter("motor.viscous_friction", "N*m*s/rad",
        "viscous friction of the motor", '"0.01 N*m*s/rad"', "0 or more", default=0.0, symbol="b1")
    rated_power: MaybeNumber = parameter("motor.rated_power", "W", "rated power of the motor", '"2.2 kW"',
        "above 0", default=None)
    rated_speed: MaybeNumber = parameter("motor.rated_speed", "rad/s", "rated speed of the motor",
        '"880 rpm"', "above 0", default=None)
    rated_torque: MaybeNumber = parameter("motor.rated_torque", "N*m", "rated torque of the motor",
        '"23.9 N*m"', "above 0", default=None)
    torque_lag: Number = parameter("motor.torque_lag", "s", "time constant of the torque behind its demand",
        '"2 ms"', "0 or more", default=0.0)
    torque_rate: Number = parameter("motor.torque_rate", "N*m/s", "largest rate of the torque demand",
        '"500 N*m/s"', "above 0", default=math.inf, infinite=True)
    encoder_lines: Number = parameter("motor.encoder_lines", "1",
        "number of encoder lines (four counts each; 0 for an ideal encoder)", "4096",
        "a whole number, 0 or more", default=4096.0)
    encoder_phase: Number = parameter("motor.encoder_phase", "1",
        "where between two edges of the encoder the start lies, as a share of a count", "0.5", "from 0 to 1",
        default=0.0)
    torque_noise: Number = parameter("motor.torque_noise", "N*m",
        "standard deviation of the noise on the measured motor torque, in each sample", '"0.2 N*m"',
        "0 or more", default=0.0)
    noise_seed: Number = parameter("motor.noise_seed", "1",
        "number of the noise: the same number gives the same noise", "1", "a whole number, 0 or more",
        default=0.0)
    computing_delay: Number = parameter("motor.computing_delay", "s",
        "dead time between what a controller measures and the torque demand that follows from it", '"1 ms"',
        "0 or more", default=0.0, label="dead time")
    gear_ratio: MaybeNumber = parameter("gear.ratio", "1", "turns of the motor for one of the output", "31.5",
        "above 0", default=None)
    gear_efficiency: Number = parameter("gear.efficiency", "1", "efficiency of all gears", "0.94",
        "above 0 and at most 1", default=1.0)
    stiffness: Number = parameter("shaft.stiffness", "N*m/rad", "stiffness of the shaft", '"368 N*m/rad"',
        "above 0", symbol="c", at_output="value")
    soft_stiffness: MaybeNumber = parameter("shaft.soft_stiffness", "N*m/rad",
        "smallest stiffness that the shaft may have, where its stiffness is not known", '"37 N*m/rad"',
        "above 0", default=None, label="soft end of c", at_output="value")
    damping: Number = parameter("shaft.damping", "N*m*s/rad", "damping of the shaft", '"1.5 N*m*s/rad"',
        "0 or more", default=0.0, symbol="d", at_output="value")
    gap: Number = parameter("shaft.gap", "rad", "total angular gap", '"0.5 rad"', "0 or more", symbol="gap",
        label="total gap", at_output="value")
    contact_law: ContactLaw = parameter("shaft.contact_law", "", "law of the shaft torque in contact",
        '"no-pull"', default="no-pull", choices=get_args(ContactLaw))
    load_inertia: Number = parameter("load.inertia", "kg*m^2", "inertia of the load at the motor shaft",
        '"0.175 kg*m^2"', "above 0", symbol="J2", at_output="value")
    load_torque: Number = parameter("load.torque", "N*m", "torque of the load at the motor shaft",
        '"7.16 N*m"', symbol="Mc", at_output="value")
    load_kind: LoadKind = parameter("load.kind", "", "kind of the load torque", '"active"', default="active",
        choices=get_args(LoadKind))
    load_friction: Number = parameter("load.friction", "N*m",
        "Coulomb friction of the load besides its torque", '"0.7 N*m"', "0 or more", default=0.0,
        at_output="value")
    load_viscous_friction: Number = parameter("load.viscous_friction", "N*m*s/rad",
        "viscous friction of the load at the motor shaft", '"0.02 N*m*s/rad"', "0 or more", default=0.0,
        symbol="b2", at_output="value")
    target_speed: Number = parameter("start.target_speed", "rad/s", "speed that the load is to reach",
        '"880 rpm"', "above 0", default=None, follows="rated_speed", at_output="value")
    start_position: NumberOrWord = parameter("start.position", "rad",
        "position in the gap at the start, or twist phi1 - phi2", '"-0.25 rad"', default="mid-gap",
        choices=get_args(Position), symbol="theta", at_output="value")
    brake: Brake = parameter("start.brake", "", "brake that holds the motor until its release", '"motor"',
        default="none", choices=get_args(Brake))
    release: NumberOrWord = parameter("start.release", "s",
        "release of the brake, by torque proving or at a time", '"0.1 s"', "0 or more", default="torque",
        choices=("torque",))
    initial_speed: NumberOrWord = parameter("start.initial_speed", "rad/s",
        "speed of motor and load at the start, or minus the target speed", '"-20 rad/s"', default=0.0,
        choices=("reversal",), at_output="value")
    initial_load_speed: Number = parameter("start.initial_load_speed", "rad/s",
        "speed of the load at the start", '"0 rad/s"', default=0.0, follows="initial_speed",
        label="speed before", at_output="value")
    initial_motor_speed: Number = parameter("start.initial_motor_speed", "rad/s",
        "speed of the motor at the start", '"0 rad/s"', default=0.0, follows="initial_speed")

    brake_torque: Number = parameter("brake.torque", "N*m",
        "torque with which the brake of the motor slips (without it the brake never does)", '"40 N*m"',
        "0 or more", default=None, infinite=True)
    closing_delay: Number = parameter("brake.closing_delay", "s",
        "time from the command until the brake is closed", '"60 ms"', "0 or more", default=0.0)
    opening_delay: Number = parameter("brake.opening_delay", "s",
        "time from the command until the brake is open", '"100 ms"', "0 or more", default=0.0)
    permissible_torque: MaybeNumber = parameter("limits.shaft_torque", "N*m",
        "permissible peak of the shaft torque at the motor shaft", '"130 N*m"', "above 0", default=None,
        at_output="value")
    permissible_output_torque: MaybeNumber = parameter("limits.output_torque", "N*m",
        "permissible peak of the torque at the output of the gear", '"1.6 kN*m"', "above 0", default=None,
        at_output="here")
    permissible_start_time: MaybeNumber = parameter("limits.start_time", "s",
        "longest permissible start time", '"1.5 s"', "above 0", default=None)
    starts_per_hour: MaybeNumber = parameter("limits.starts_per_hour", "1",
        "number of starts in an hour of operation", "60", "above 0", default=None)
    required_life: MaybeNumber = parameter("limits.life", "s",
        "time of operation that the shaft line must last", '"20000 h"', "above 0", default=None)
    fatigue_slope: MaybeNumber = parameter("limits.fatigue.slope", "1", "slope m of the S-N curve", "6.6",
        "above 0", default=None, label="slope of S-N")
    fatigue_torque: MaybeSeries = parameter("limits.fatigue.torque", "N*m",
        "torque of the points of the S-N curve", '"90 N*m"', "above 0", default=None, many=True,
        label="S-N torque", at_output="value")
    fatigue_cycles: MaybeSeries = parameter("limits.fatigue.cycles", "1",
        "number of cycles at the points of the S-N curve", "2e6", "above 0", default=None, many=True,
        label="S-N cycles")
    duty: Duty | None = component(Duty, default=None)
    # fmt: on

    def _fill(self, given: Mapping[str, object], *rest: Any) -> None:
        super()._fill(given, *rest)
        vars(self).update(self._derived(vars(self)))

    def _derived(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """Brake, and where and how fast the start begins, if not given: by [brake], load and reversal.

        An array of initial speeds counts as motion, so that no start of a batch depends on those beside it.
        """
        given, derived = vars(self)["_given"], dict[str, Any]()
        braked = has_brake(values)
        if braked and "brake" not in given:
            derived["brake"] = "motor"
            if "release" not in given:  # opened by the command of a start
                derived["release"] = values.get("opening_delay", 0.0)
        brake = derived.get("brake", values.get("brake"))
        if "brake_torque" not in given:
            derived["brake_torque"] = math.inf if brake == "motor" or braked else 0.0
        reversal = isinstance(values.get("initial_speed"), str)
        if reversal and values.get("target_speed") is not None:
            derived |= {name: -values["target_speed"] for name in SPEEDS if name not in given}
        if "start_position" not in given:
            rests = np.all(_rests(values))
            hangs = brake == "motor" and not rests
            gap = np.asarray(values.get("gap", 0.0))
            anywhere = rests and np.any(gap > 0.0)
            moves = any(np.ndim(values.get(name, 0.0)) or values.get(name, 0.0) != 0.0 for name in SPEEDS)
            at_rest = "unknown" if anywhere and not moves else "mid-gap"
            derived["start_position"] = "hanging" if hangs else "opposite-flank" if reversal else at_rest
        return derived

    @classmethod
    def _gear_in(cls, given: Mapping[str, object]) -> Gear | str:
        ratio, efficiency = (given.get(f"gear_{key}") for key in ("ratio", "efficiency"))
        if ratio is None:
            return NO_GEAR
        numbers = []
        for name, value in (
            ("gear_ratio", ratio),
            ("gear_efficiency", 1.0 if efficiency is None else efficiency),
        ):
            try:
                numbers.append(read_value(cls.PARAMETERS[name], value, batch=cls.BATCH))
            except RefusedError:
                numbers.append(1.0)  # it is refused under its own name
        gear, load = Gear(*numbers), 0.0
        for name in LOAD:  # at the output, as far as they can be read
            p, value = cls.PARAMETERS[name], given.get(name, 0.0)
            with suppress(RefusedError, ValueError):  # refused under its own name
                load += gear.to_output(read_value(p, value, batch=cls.BATCH, gear=gear), p.unit)
        return gear._replace(load=load)

    def _check(self, values: Mapping[str, Any], wording: Wording) -> Iterable[str]:
        derived = self._derived(values)
        seen = {**values, **derived, "release": values.get("release")}  # as it is given
        yield from contradictions(seen, self.PARAMETERS, wording)
        rests = np.asarray(_rests(values))
        if "start_position" in derived and rests.any() != rests.all():
            label = wording.label(self.PARAMETERS["start_position"])
            yield wording.sentence(
                f"{label} is missing", "friction holds some of these loads at rest and others not; give it"
            )
        yield from contradicting_limits(values, self.PARAMETERS, wording)
        if values.get("units"):
            yield from wrong_units(values, self.PARAMETERS["units"], wording, self._gear_in(values))

    # ---- where drives come from --------------------------------------------------------------------------

    @classmethod
    def from_tables(cls, document: Mapping[str, Any], *, where: str = "") -> Self:
        """A drive from the tables of a document, {"shaft": {"gap": 0.5}, ...}; `where` as in `from_toml`.

        The tables of a data sheet give the drive that follows from it (`softstart.DataSheet`).
        """
        return cls._from_document(dict(document), where)

    @classmethod
    def _from_document(
        cls, document: dict[str, Any], where: str, also: Mapping[str, object] | None = None
    ) -> Self:
        for describes, drive_of in OTHER_DOCUMENTS:
            if describes(document):
                drive = drive_of(document, where)
                return cls._made(drive.written(), Wording(where, style="toml"), [])
        return super()._from_document(document, where, also)

    # ---- the drive changed -------------------------------------------------------------------------------

    def with_settings(self, settings: Iterable[str]) -> Self:
        """The drive with changes as typed at a command line: `table.key=value` or `name=value`.

        >>> Drive.load("crane-4amtkf").with_settings(["load.inertia=0.07", "gap=2 rad"]).J2
        0.07
        """
        texts = [settings] if isinstance(settings, str) else list(settings)
        of_duty = [text for text in texts if isinstance(text, str) and OF_DUTY.match(text)]
        given, wording, mistakes = read_settings([one for one in texts if one not in of_duty], PARAMETERS)
        try:
            if of_duty:
                given["duty"] = self._duty_with(of_duty)
        except InputError as error:
            mistakes += [Mistake(sentence) for sentence in error.sentences]
        return self._changed(given, wording, mistakes)

    def _changed(self, changes: Mapping[str, object], wording: Wording, mistakes: Iterable[Mistake]) -> Self:
        """As any parameters; a stiffness that is set is known, and has no soft end."""
        also: dict[str, object] = {"soft_stiffness": None} if "stiffness" in changes else {}
        duty = changes.get("duty", self.duty)
        if isinstance(duty, Duty) and isinstance(gear := self._new_gear(changes), Gear):
            changes = {**changes, "duty": duty.through(gear)}
        return super()._changed(also | dict(changes), wording, mistakes)

    @cached_property
    def soft(self) -> Self | None:
        """The drive at the soft end of an unknown stiffness, with its damping ratio; None if it is known.

        >>> crane = Drive.load("crane-4amtkf").replace(soft_stiffness=92.11625, damping=0.3)
        >>> crane.soft.stiffness, crane.soft.damping, crane.soft.soft
        (92.11625, 0.15, None)
        """
        if self.soft_stiffness is None:
            return None
        share = self.soft_stiffness / self.stiffness
        return self.replace(stiffness=self.soft_stiffness, damping=math.sqrt(share) * self.damping)

    def _duty_with(self, settings: list[str]) -> Duty:
        """The duty with changes of its steps as typed, as "duty[2].time=3 s"."""
        if self.duty is None:
            raise InputError(f"{one}: the drive has no duty; add [[duty]] to its file." for one in settings)
        pairs = (one.partition("=") for one in settings)
        changes = {key.strip(): value.strip(" \"'") for key, _, value in pairs}
        return Duty.read_for(self, self.duty.text(self.gear), also=changes)

    # ---- what follows from the parameters, under the symbols of [G] --------------------------------------

    @property
    def J1(self) -> float:
        """Inertia of the motor, kg m2."""
        return self.motor_inertia

    @property
    def J2(self) -> float:
        """Inertia of the load, kg m2."""
        return self.load_inertia

    @property
    def c(self) -> float:
        """Stiffness of the shaft, N m/rad."""
        return self.stiffness

    @property
    def d(self) -> float:
        """Damping of the shaft, N m s/rad."""
        return self.damping

    @property
    def Mc(self) -> float:
        """Torque of the load against forward motion, N m: `load_torque` and `load_friction`.

        >>> Drive.load("crane-4amtkf").replace(load_friction="0.84 N*m").Mc
        8.0
        """
        return self.load_torque + self.load_friction

    @property
    def active_torque(self) -> float:
        """The part of Mc that acts always, N m: backwards if positive, whatever the motion."""
        return self.load_torque if self.load_kind == "active" else 0.0 * self.load_torque

    @property
    def reactive_torque(self) -> float:
        """The part of Mc that is Coulomb friction, N m: holds the load at rest, opposes any motion.

        >>> belt = Drive.load("conveyor-11kw").replace(load_kind="active", load_friction="5 N*m")
        >>> belt.reactive_torque, belt.Mc - belt.active_torque == belt.reactive_torque
        (5.0, True)
        """
        return self.load_friction + (0.0 if self.load_kind == "active" else self.load_torque)

    @property
    def backward_torque(self) -> float:
        """The load torque in backward motion, N m: the active torque less the friction.

        >>> crane = Drive.load("crane-4amtkf")
        >>> [crane.replace(load_kind=one).backward_torque for one in ("active", "reactive")]
        [7.16, -7.16]
        """
        return self.active_torque - self.reactive_torque

    @property
    def falling_torque(self) -> float:
        """With what torque the load leaves its rest while the gap is open, N m: 0 where friction holds it.

        Positive backwards: the active torque less the friction.

        >>> crane = Drive.load("crane-4amtkf")
        >>> [crane.replace(load_friction=one).falling_torque for one in (0.0, 2.16, 7.16)]
        [7.16, 5.0, 0.0]
        """
        active: Any = self.active_torque
        falling = np.copysign(np.maximum(np.abs(active) - self.reactive_torque, 0.0), active)
        return falling if falling.ndim else float(falling)

    @property
    def overhauling_torque(self) -> float:
        """With what torque the load turns a motor without torque, N m; 0 where friction holds it.

        >>> Drive.load("crane-4amtkf").replace(load_friction=2.16, motor_friction=1.0).overhauling_torque
        4.0
        """
        return math.copysign(max(abs(self.falling_torque) - self.motor_friction, 0.0), self.falling_torque)

    def with_load(self, values: Mapping[str, Any], mass: str = "") -> Self:
        """The drive with another load: its torque, kind, inertia and friction by their keys.

        >>> Drive.load("crane-4amtkf").with_load({"torque": 5.0, "kind": "reactive"}).reactive_torque
        5.0
        """
        if mass:
            raise InputError(f"mass = {show(mass)}: a drive has one load; leave it out.")
        changes = {f"load_{key}": value for key, value in values.items()}
        if self.position_given and isinstance(self.start_position, str):  # a reactive load does not hang
            changes["start_position"] = "mid-gap"
        return self.replace(**changes)

    @property
    def rests(self) -> Any:
        """Whether friction holds the load at rest while the gap is open; columns have as many answers."""
        return _rests(vars(self))

    @property
    def Ms(self) -> float:
        """Starting torque of the motor, N m."""
        return self.starting_torque

    @property
    def rated(self) -> float | None:
        """Rated torque, or rated power over rated speed, N m; None where neither is given."""
        if self.rated_torque is not None or self.rated_power is None or self.rated_speed is None:
            return self.rated_torque
        return self.rated_power / self.rated_speed

    @property
    def frictions(self) -> tuple[float, float, float]:
        """Coulomb and viscous friction of the motor, and viscous friction of the load: N m, N m s/rad twice.

        >>> Drive.load("crane-4amtkf").replace(motor_friction="1.5 N*m").frictions
        (1.5, 0.0, 0.0)
        """
        return self.motor_friction, self.motor_viscous_friction, self.load_viscous_friction

    def without_friction(self, reason: str) -> Iterator[str]:
        """A sentence with this reason for each friction that the drive has, where none may be.

        >>> list(Drive.load("crane-4amtkf").replace(motor_friction=1.5).without_friction("a chain has none"))
        ['motor_friction = 1.5 N*m: a chain has none; set it to 0.']
        """
        for name in FRICTIONS:
            value = getattr(self, name)
            if np.any(value != 0.0):
                yield f"{name} = {show(value)} {self.PARAMETERS[name].unit}: {reason}; set it to 0."

    @property
    def gear(self) -> Gear | None:
        """The gear, between the motor shaft, at which everything counts, and the output; None without ratio.

        >>> Drive.load("crane-4amtkf").replace(gear_ratio=38.1, gear_efficiency="95 %").gear
        Gear(ratio=38.1, efficiency=0.95, load=7.16)
        """
        return None if self.gear_ratio is None else Gear(self.gear_ratio, self.gear_efficiency, self.Mc)

    def gear_with(self, **given: object) -> Gear | str:
        """What "... at output" goes through in values that are to be set, or why there is nothing.

        >>> hoist = Drive.load("crane-4amtkf").replace(gear_ratio=40, load_torque=-4.0)
        >>> hoist.gear_with(load_friction="100 N*m at output").load
        -60.0
        """
        return self._gear_in(self.given() | given)

    @property
    def at_output(self) -> dict[str, Any]:
        """The values of the drive that may be given at the output, in SI *there*, by name; {} without a gear.

        >>> geared = Drive.load("crane-4amtkf").replace(gear_ratio=38.1, gear_efficiency=0.95)
        >>> sheet = geared.replace(gap="9 arcmin at output", stiffness="35 kN*m/rad at output")
        >>> round(sheet.stiffness, 3), [round(sheet.at_output[name], 9) for name in ("stiffness", "gap")]
        (25.38, [35000.0, 0.002617994])
        """
        if (gear := self.gear) is None:
            return {}
        values = dict[str, Any]()
        for name, p in PARAMETERS.items():
            value = getattr(self, name)
            if p.at_output == "here":
                values[name] = value
            elif p.at_output and not isinstance(value, str) and value is not None:
                several = isinstance(value, tuple)
                values[name] = (
                    tuple(gear.to_output(np.array(value), p.unit).tolist())
                    if several
                    else gear.to_output(value, p.unit)
                )
        return {name: value for name, value in values.items() if value is not None}

    @property
    def Omega(self) -> float:
        """Elastic frequency in contact, undamped: `sqrt(c (J1 + J2)/(J1 J2))`, rad/s, [G](8)."""
        Omega: float = elastic_frequency(self.J1, self.J2, self.c)
        return Omega

    @property
    def elastic_period(self) -> float:
        """`2 pi/Omega`, s."""
        return 2.0 * math.pi / self.Omega

    def scaled(self, gaps: float = 1.0, load_inertia: float = 1.0) -> Self:
        """The drive with so many times its gap, its start where it was in the gap, and its load inertia.

        >>> Drive.load("crane-4amtkf").scaled(gaps=4.0).gap
        2.0
        """
        one = self if gaps == 1.0 else self.with_gap(gaps * self.gap)
        return one if load_inertia == 1.0 else one.replace(load_inertia=load_inertia * self.load_inertia)

    # ---- by the words of a sweep --------------------------------------------------------------------------

    @property
    def gap_and_inertia(self) -> tuple[float, float]:
        """Gap, rad, and inertia of the load, kg m2.

        >>> Drive.load("crane-4amtkf").gap_and_inertia
        (0.5, 0.175)
        """
        return self.gap, self.load_inertia

    @property
    def motor_inertia_at_load(self) -> float:
        """Inertia of the motor at the shaft of the load, kg m2: the load is at the motor shaft here."""
        return self.motor_inertia

    def with_gap_and_inertia(self, gap: float, inertia: float, origin: Self | None = None) -> Self:
        """The drive with another gap, as `with_gap`, and another load inertia; `origin` is for chains."""
        return self.with_gap(gap, load_inertia=inertia)

    def parameter_value(self, key: str) -> ParameterValue | None:
        """The parameter that a key names, as in a file or in Python; None where there is none.

        >>> Drive.load("crane-4amtkf").parameter_value("load.inertia").name
        'load_inertia'
        """
        name = BY_PATH.get(key, key)
        return ParameterValue(name, PARAMETERS[name], getattr(self, name)) if name in PARAMETERS else None

    def parameter_keys(self) -> Iterator[str]:
        """The keys of all parameters that can be varied, as in a file."""
        return iter(BY_PATH)

    def with_values(self, values: Mapping[str, Any]) -> Self:
        """The drive with these values; with a gap as `with_gap`."""
        return self.with_gap(**values) if "gap" in values else self.replace(**values)

    # ---- what starts ask of any machine ------------------------------------------------------------------

    @property
    def mean_torque(self) -> float:
        """M12avg_base = (Ms J2 + J1 Mc)/(J1 + J2), N m, [G](16): the mean shaft torque under full torque.

        What the Coulomb friction of the motor takes does not reach the shaft: Ms - friction stands for Ms.
        Viscous friction is left out, it is zero as the motion begins: K_dyn does not depend on the target
        speed.

        >>> crane = Drive.load("crane-4amtkf")
        >>> round(crane.mean_torque, 2), round(crane.replace(motor_friction=6.0).mean_torque, 2)
        (52.86, 47.86)
        """
        return mean_torque_of(self.Ms - self.motor_friction, self.J1, self.J2, self.Mc)

    @property
    def lever_rule_model(self) -> TwoMasses:
        """The drive as two masses at the motor shaft, as its doubts see it."""
        travels = (0.5 * self.gap - one.theta0 for one in self.positions.values())
        return TwoMasses(
            J1=self.J1, J2=self.J2, c=self.c, d=self.d, gap=self.gap, travel=max(0.0, *travels),
            Ms=self.Ms - self.motor_friction, Mc=self.Mc, active=self.load_kind == "active",
            friction=self.reactive_torque, speed=self.target_speed,
            ratio=math.nan if self.gear_ratio is None else self.gear_ratio,
        )  # fmt: skip

    @property
    def motor(self) -> Self:
        """What has the data of the motor: the drive itself."""
        return self

    @property
    def gaps(self) -> Vector:
        """The gap of the shaft, rad, as an array."""
        return np.array([self.gap])

    @property
    def local_gaps(self) -> tuple[float, ...]:
        """The gap of each shaft at that shaft itself, rad, as it was given."""
        return (float(self.gap),)

    @property
    def shaft_means(self) -> Vector:
        """The mean torque of the shaft under full starting torque, N m, as an array."""
        return np.array([self.mean_torque])

    @property
    def permissible_torques(self) -> Vector:
        """What the shaft permits, N m, as an array; NaN where nothing is given."""
        most = self.limits.shaft_torque
        return np.array([math.nan if most is None else most])

    @property
    def identity(self) -> dict[str, object]:
        """What a summary of a start says of the machine."""
        both = self.load_kind == "active" and np.any(self.load_friction > 0.0)
        kind = "active and reactive" if both else self.load_kind
        output = {} if self.gear is None else {"at_output": self.at_output}
        return {"drive": self.name, "contact_law": self.contact_law, "load_kind": kind, **output}

    def columns_of(self, states: Mapping[str, Vector]) -> dict[str, Vector]:
        """The states of a start under the headings of a table."""
        units = {"phi1": "rad", "phi2": "rad", "w1": "rad/s", "w2": "rad/s", "u": "N*m", "T": "N*m"}
        return {f"{name} [{unit}]": states[name] for name, unit in units.items()}

    @property
    def limits(self) -> Limits:
        """What the machine withstands and must do; empty where the file has no table `[limits]`.

        >>> Drive.load("crane-4amtkf").replace(permissible_torque="130 N*m").limits.shaft_torque
        130.0
        """
        return limits_of(vars(self), self.gear)

    @property
    def stiffnesses(self) -> Vector:
        """The stiffness of the shaft, N m/rad, as an array."""
        return np.array([self.stiffness])

    @property
    def dampings(self) -> Vector:
        """The damping of the shaft, N m s/rad, as an array."""
        return np.array([self.damping])

    @property
    def damping_ratio(self) -> float:
        """Share of the critical damping: d/(2 J Omega) with J = J1 J2/(J1 + J2).

        >>> round(Drive.load("hoist-15kw").damping_ratio, 4)
        0.0602
        """
        return float(0.5 * self.d * (1.0 / self.J1 + 1.0 / self.J2) / self.Omega)

    @property
    def contact_laws(self) -> tuple[str, ...]:
        """The contact law of the shaft, as of one shaft of several."""
        return (self.contact_law,)

    @property
    def position_given(self) -> bool:
        """Whether the file says where the start begins; else that follows from brake, load and reversal."""
        return "start_position" in self.given()

    @property
    def two_masses(self) -> Self:
        """The drive of two masses that stands for the machine: the drive itself."""
        return self

    def with_damping_ratio(self, ratio: float) -> Self:
        """The drive with this damping ratio, if it has no damping."""
        d = 2.0 * ratio * self.Omega / (1.0 / self.J1 + 1.0 / self.J2)
        return self if self.damping > 0.0 else self.replace(damping=float(d))

    # ---- where the start begins --------------------------------------------------------------------------

    @property
    def theta0(self) -> float:
        """Twist phi1 - phi2 at the start, rad: that of `start_position` in this gap.

        A load that hangs has wound up the shaft by its active torque over c beyond the flank that it rests
        on, as if friction carried nothing of it. Raises `InputError` for an unknown position, which is not
        one but three (`positions`).

        >>> crane = Drive.load("crane-4amtkf")
        >>> [crane.replace(start_position=one).theta0 for one in ("opposite-flank", "mid-gap", 0.1)]
        [-0.25, 0.0, 0.1]
        """
        where = self.start_position
        if not isinstance(where, str):
            return where
        if where == "unknown":
            wanted = " or ".join(map(show, UNKNOWN_POSITIONS))
            raise InputError(
                f"start_position = {show(where)}: this question takes one position; give {wanted}."
            )
        if where == "hanging":
            pull = self.active_torque
            angle = np.copysign(0.5 * self.gap + np.abs(pull) / self.c, pull)
            return angle if angle.ndim else float(angle)
        return {"mid-gap": 0.0, "driving-flank": 0.5, "opposite-flank": -0.5}[where] * self.gap

    @property
    def positions(self) -> Mapping[str, Self]:
        """The drive at each position at which it may start: one, or three if that is unknown.

        >>> list(Drive.load("crane-4amtkf").replace(start_position="unknown").positions)
        ['driving-flank', 'mid-gap', 'opposite-flank']
        """
        where = self.start_position
        if not isinstance(where, str) or where != "unknown":
            return {where if isinstance(where, str) else "": self}
        return {one: self._at(one) for one in UNKNOWN_POSITIONS}

    def _at(self, where: str) -> Self:
        """The drive, whose position is unknown, at one that it may have: there is nothing more to check."""
        one = type(self).__new__(type(self))
        vars(one).update(vars(self))
        one._derive(start_position=where)
        return one

    @property
    def design_drive(self) -> Self:
        """The drive that controllers are set up for: where the position is unknown, the middle of the gap."""
        where = self.start_position
        return self._at("mid-gap") if isinstance(where, str) and where == "unknown" else self

    @property
    def release_time(self) -> float:
        """When the brake of the motor is released, s: infinite for torque proving, 0 without a brake."""
        if self.brake == "none":
            return 0.0
        return math.inf if isinstance(self.release, str) else self.release

    def with_gap(self, gap: object, **changes: object) -> Self:
        """The drive with another gap, its start where it was in the gap: as `replace`, for maps and wear.

        A position that is a word moves with the flanks anyway. An angle in the gap keeps its share of the
        gap, one beyond a flank its overlap.

        >>> hanging = Drive.load("crane-4amtkf").replace(start_position=0.26)
        >>> round(hanging.with_gap(2.0).start_position, 9)
        1.01
        """
        one = self.replace(gap=gap, **changes)
        if isinstance(self.start_position, str) or "start_position" in changes:
            return one
        before, after = 0.5 * np.asarray(self.gap), 0.5 * np.asarray(one.gap)
        theta = np.asarray(self.start_position)
        overlap = np.maximum(abs(theta) - before, 0.0)
        share = np.divide(theta, before, out=np.zeros(np.broadcast(theta, before).shape), where=before > 0.0)
        moved = np.where(overlap > 0.0, np.copysign(after + overlap, theta), share * after)
        moved = np.where(before == after, theta, moved)
        return one.replace(start_position=moved if moved.ndim else float(moved))

    def to_control(self, *, nonlinear: bool = False) -> Any:
        """The drive for the python-control library: in contact (linear), or the whole of it.

        The linear system has the inputs `motor_torque` and `load_torque`, as states and outputs the twist `z`
        beyond the gap and the speeds `w1` and `w2`, and the output `shaft_torque`. The nonlinear one has the
        input `demand` and the outputs `phi1, w1, phi2, w2, u, T`; start it from
        `control_systems.initial_state(drive)`. Both are described in `softstart.drive.control_systems`.

        >>> sorted(round(float(abs(pole)), 3) for pole in Drive.load("crane-4amtkf").to_control().poles())
        [0.0, 112.397, 112.397]
        """
        from softstart.drive import control_systems

        return control_systems.whole_drive(self) if nonlinear else control_systems.in_contact(self)


PARAMETERS: Mapping[str, Parameter] = Drive.PARAMETERS
BY_PATH = {p.path: p.name for p in PARAMETERS.values()}
TABLES: tuple[str, ...] = tuple(table.name for table in Drive.TABLES if table.name)
