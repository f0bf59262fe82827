"""`DataSheet`: a machine as plates, catalogues and drawings give it, each number at its own part."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Iterable, Iterator, Mapping
from functools import cached_property
from typing import Any, ClassVar, NamedTuple, Self, get_args

from softstart.drive.data_sheet_checks import contradictions
from softstart.drive.data_sheet_file import Entry, drive_entries, drive_text
from softstart.drive.data_sheet_mechanics import BAND, METAL, MotorSide, arm, motor_side, slope_sine
from softstart.drive.data_sheet_words import RESISTANCE, ROPE, STIFFNESSES, USUAL, MachineKind, converted
from softstart.drive.model import OTHER_DOCUMENTS, Drive
from softstart.drive.plausibility import motion_warnings, plausibility_warnings
from softstart.errors import InputError
from softstart.input.documents import document_text, parsed
from softstart.input.files import file_text
from softstart.input.parameter_set import MaybeNumber, Number, ParameterSet, parameter
from softstart.input.parameters import Mistake, Wording, bare, without_unit

_IN_SI = re.compile(r" or as a bare number in \S+(?=[.;])")  # refused, or in another unit
# the parameters of the drive that, where they are set themselves, leave nothing of what is assumed here
FORCES = {"load_torque", "load_friction"}
SETTLE = {
    "starting_ratio": {"starting_torque"}, "efficiency": {"stiffness", "load_inertia", *FORCES},
    "backlash": {"gap"}, "rope": {"stiffness"}, "rope_modulus": {"stiffness"}, "resistance": FORCES,
    "damping_ratio": {"damping"}, "stiffness": {"stiffness"},
}  # fmt: skip


def _maybe(path: str, unit: str, meaning: str, example: str, **more: Any) -> Any:
    """A quantity above 0 that need not be given."""
    return parameter(path, unit, meaning, example, "above 0", default=None, **more)


def _nothing(path: str, unit: str, meaning: str, example: str, **more: Any) -> Any:
    """A quantity that is 0 where it is not given."""
    return parameter(path, unit, meaning, example, "0 or more", default=0.0, **more)


class UnknownStiffness(NamedTuple):
    """A drive of unknown stiffness: at the stiff end of what is usual, and at the soft end."""

    drive: Drive
    soft: Drive

    @property
    def name(self) -> str:
        """Name of the drive."""
        return self.drive.name


class DataSheet(ParameterSet):
    """A machine as plates, catalogues and drawings give it; `drive` is what follows for the motor shaft.

    With the ratio i and the efficiency eta of the gears, an inertia J, a stiffness c and a torque M behind
    them are J/(i^2 eta), c/(i^2 eta) and M/(i eta) at the motor shaft, a backlash i times as wide.
    Stiffnesses in series add by their reciprocals, backlashes directly. A mass m on a radius r is m r^2; a
    rope that is reeved n times makes the radius r/n. A steel shaft of diameter D and length L has
    c = G pi D^4/(32 L), G = 79.3e9 N/m^2. One fall of a rope of diameter d and length L has k = E 0.46 d^2/L;
    n falls on the radius r/n store k n (r/n)^2 angle^2/2, so that they have c = k r^2/n at the drum. Several
    motors share load and rope; shaft and gears are one motor's own. A ratio may be written "38:1" or "4/2".

    In a file and in `from_settings` a bare number is refused where people seldom mean SI (`USUAL`): speed,
    power, backlash, plays, diameters, lag. As an argument every number is in SI. An efficiency of 10 to 100
    is read as per cent. `assumed` lists what nobody gave and is filled in.

    Parameters
    ----------
    {parameters}

    Raises
    ------
    InputError
        If any value is wrong or missing; with one sentence for each.

    References
    ----------
    Metallic cross-section of a rope: EN 12385-4, class 6x36 with steel core, C = 0.46.

    Examples
    --------
    >>> sheet = DataSheet(
    ...     machine="hoist", rated_power="15 kW", rated_speed="970 rpm", motor_inertia=0.17, ratio=45,
    ...     mass="6300 kg", radius="0.2 m", reeving=4, gear_stiffness="2 kN*m/arcmin", backlash="7 arcmin",
    ... )
    >>> drive = sheet.drive
    >>> round(drive.Mc, 1), round(drive.gap, 4), drive.start_position
    (72.3, 0.0916, 'hanging')
    >>> drive.assumed
    'starting torque 1.5 times the rated torque; efficiency 0.95; rigid rope; damping ratio 0.02'
    """

    WHAT: ClassVar[str] = "a data sheet"

    # fmt: off
    name: str = parameter("name", "", "name of the drive", '"hoist A"', "one line", default="unnamed drive")
    source: str = parameter("source", "", "where the numbers are from", '"motor plate"', "one line",
        default="data sheets")
    machine: MachineKind = parameter("load.machine", "", "kind of the machine", '"travel"',
        choices=get_args(MachineKind))
    rated_power: MaybeNumber = parameter("motor.rated_power", "W", "rated power", '"3 kW"', "above 0",
        default=None)
    rated_torque: MaybeNumber = _maybe("motor.rated_torque", "N*m", "rated torque", '"20 N*m"')
    rated_speed: Number = parameter("motor.rated_speed", "rad/s", "rated speed", '"1430 rpm"', "above 0")
    motor_inertia: Number = parameter("motor.inertia", "kg*m^2", "inertia of the motor's own rotor",
        '"0.0119 kg*m^2"', "above 0")
    added_inertia: Number = _nothing("motor.added_inertia", "kg*m^2",
        "inertia of brake, fan and coupling at the motor", '"0.0066 kg*m^2"')
    starting_torque: MaybeNumber = _maybe("motor.starting_torque", "N*m", "starting torque", '"44 N*m"')
    starting_ratio: Number = parameter("motor.starting_ratio", "1", "starting torque over rated torque",
        "2.2", "above 0", default=1.5)
    maximum_torque: MaybeNumber = _maybe("motor.maximum_torque", "N*m", "largest torque", '"52 N*m"')
    maximum_ratio: MaybeNumber = _maybe("motor.maximum_ratio", "1", "largest torque over rated torque", "2.6")
    torque_lag: Number = _nothing("motor.torque_lag", "s", "lag of the torque behind its demand", '"2 ms"')
    coupling_stiffness: MaybeNumber = _maybe("coupling.stiffness", "N*m/rad",
        "stiffness of the coupling on the motor shaft", '"1500 N*m/rad"')
    coupling_play: Number = _nothing("coupling.play", "m", "play of the coupling along its circumference",
        '"0.1 mm"')
    coupling_diameter: MaybeNumber = _maybe("coupling.diameter", "m",
        "diameter on which the coupling has its play", '"60 mm"')
    ratio: Number = parameter("gear.ratio", "1", "turns of the motor for one of the output", "31.5",
        "above 0", default=1.0)
    efficiency: Number = parameter("gear.efficiency", "1", "efficiency of all gears", "0.94",
        "above 0 and at most 1", default=0.95)
    gear_stiffness: MaybeNumber = _maybe("gear.stiffness", "N*m/rad", "stiffness of the gears at the output",
        '"25 N*m/arcmin"', at_output="here")
    backlash: Number = _nothing("gear.backlash", "rad", "backlash of the gears at the output", '"15 arcmin"',
        at_output="here")
    shaft_diameter: MaybeNumber = _maybe("output.diameter", "m",
        "diameter of the steel shaft behind the gears", '"55 mm"')
    shaft_length: MaybeNumber = _maybe("output.length", "m", "length of the steel shaft behind the gears",
        '"900 mm"')
    output_play: Number = _nothing("output.play", "m",
        "play of couplings and open gears behind it, along the circumference", '"0.4 mm"')
    play_diameter: MaybeNumber = _maybe("output.play_diameter", "m", "diameter on which they have this play",
        '"120 mm"')
    mass: MaybeNumber = _maybe("load.mass", "kg", "mass that is moved", '"12000 kg"')
    goods: MaybeNumber = _maybe("load.goods", "kg", "mass of goods or passengers on an inclined belt",
        '"4000 kg"')
    counterweight: Number = _nothing("load.counterweight", "kg", "mass of the counterweight", '"1400 kg"')
    diameter: MaybeNumber = _maybe("load.diameter", "m", "diameter of wheel or drum", '"315 mm"')
    radius: MaybeNumber = _maybe("load.radius", "m", "radius of wheel or drum", '"0.1575 m"')
    reeving: Number = parameter("load.reeving", "1",
        "falls of rope that carry the load for one that is wound", "2", "above 0", default=1.0)
    rope_stiffness: MaybeNumber = _maybe("rope.stiffness", "N/m",
        "stiffness of one fall, times the ropes that the drum winds", '"0.8 MN/m"')
    rope_length: MaybeNumber = _maybe("rope.length", "m", "length of one fall of the rope", '"12 m"')
    rope_diameter: MaybeNumber = _maybe("rope.diameter", "m", "nominal diameter of the rope", '"14 mm"')
    rope_modulus: Number = parameter("rope.modulus", "Pa",
        "modulus of the rope on its metallic cross-section", '"105 GPa"', "above 0", default=100e9)
    resistance: MaybeNumber = parameter("load.resistance", "1", "resistance to motion over weight", "0.008",
        "from 0 to 1", default=None)
    slope: Number = parameter("load.slope", "rad",
        "slope of track or belt, angle or per cent, below 0 downhill", '"2 deg"', default=0.0)
    rise: MaybeNumber = parameter("load.rise", "m", "rise of track or belt, below 0 downhill", '"6 m"',
        default=None)
    length: MaybeNumber = _maybe("load.length", "m", "length of track or belt along which it rises so much",
        '"40 m"')
    output_inertia: Number = _nothing("load.inertia", "kg*m^2",
        "inertia of drum, wheels or turning machine at the output", '"1.2 kg*m^2"', at_output="here")
    friction: Number = _nothing("load.friction", "N*m",
        "further friction of the load at the output, against the motion only", '"20 N*m"',
        at_output="here")
    active_torque: Number = parameter("load.torque", "N*m",
        "further torque of the load at the output that acts always, as wind; below 0 where it helps",
        '"20 N*m"', default=0.0, at_output="here")
    motors: Number = parameter("load.motors", "1", "motors on one load and rope", "2", "above 0", default=1.0)
    elastic_frequency: MaybeNumber = _maybe("shaft.elastic_frequency", "Hz",
        "frequency at which motor and load oscillate against each other, gap closed", '"8 Hz"')
    damping_ratio: Number = parameter("shaft.damping_ratio", "1", "damping ratio of the elastic mode", "0.03",
        "from 0 to 1", default=0.02)
    permissible_output_torque: MaybeNumber = _maybe("limits.output_torque", "N*m",
        "permissible peak torque at the output, by the catalogue of the gearbox", '"1.6 kN*m"',
        at_output="here")
    permissible_torque: MaybeNumber = _maybe("limits.shaft_torque", "N*m",
        "permissible peak torque at the motor shaft, as of a coupling there", '"130 N*m"')
    # fmt: on

    # making one -------------------------------------------------------------------------------------------

    @classmethod
    def load(cls, path: str | os.PathLike[str], also: Mapping[str, object] | None = None) -> Self:
        """The TOML file at this path; `also` holds changes by path, as {"load.mass": "5000 kg"}."""
        return cls.from_toml(file_text(path, cls.WHAT), where=os.fspath(path), also=also)

    @classmethod
    def from_toml(cls, text: str, where: str = "", also: Mapping[str, object] | None = None) -> Self:
        """A data sheet from the tables of a TOML text: [load], [motor], [coupling], [gear], [output], ..."""
        wording = Wording(where, style="toml")
        document = parsed(text, wording, cls.WHAT, cls.TABLES)
        if "start" in document and not cls.describes(document):
            raise InputError(
                wording.sentence("", "this is the file of a drive already; softstart compare takes it")
            )
        return cls._from_document(document, where, also)

    @classmethod
    def from_settings(cls, settings: Mapping[str, object]) -> Self:
        """A data sheet from values by path, as {"motor.rated_power": "3 kW", "gear.ratio": 31.5}."""
        return cls._from_document({}, "", settings)

    @classmethod
    def describes(cls, document: Mapping[str, Any]) -> bool:
        """Whether TOML tables are those of a data sheet, not of a drive: by a key or table no drive has.

        >>> DataSheet.describes({"load": {"machine": "hoist"}}), DataSheet.describes({"load": {"torque": 7}})
        (True, False)
        """
        sheet_paths = {p.path for p in cls.PARAMETERS.values()} - {p.path for p in Drive.PARAMETERS.values()}
        tables = {name: keys for name, keys in document.items() if isinstance(keys, dict)}
        of_drive = {"stiffness", "gap"} & tables.get("shaft", {}).keys()
        keys_of_a_sheet = any(f"{name}.{key}" in sheet_paths for name, keys in tables.items() for key in keys)
        return not of_drive and (keys_of_a_sheet or bool({"coupling", "output", "rope"} & document.keys()))

    def to_toml(self) -> str:
        """The data sheet as a file that `load` reads.

        >>> sheet = DataSheet(machine="rotor", rated_power=1e3, rated_speed=150, motor_inertia=0.01,
        ...     output_inertia=0.1, coupling_stiffness=900)
        >>> DataSheet.from_toml(sheet.to_toml()) == sheet
        True
        """
        units = {name: f" {self.PARAMETERS[name].unit}" for name in USUAL}
        given = {
            name: f"{value!r}{units[name]}" if name in units else value
            for name, value in self.given().items()
        }
        return document_text((table, given) for table in self.TABLES)

    def _fill(
        self, given: Mapping[str, object], wording: Wording, mistakes: Iterable[Mistake], *known: Any
    ) -> None:
        """As any parameters; in a file or setting without the bare numbers that may be in another unit."""
        toml = wording.style == "toml"
        wrong = [*mistakes, *(without_unit(given, self.PARAMETERS, USUAL, wording) if toml else ())]
        share = bare(given.get("efficiency"))
        per_cent = share and 10.0 <= float(share) <= 100.0
        vars(self)["_read"] = {"read": f"efficiency {share} is {share} %"} if per_cent else {}
        given = {name: converted(name, value) for name, value in given.items()}
        given |= {"efficiency": f"{share} %"} if per_cent else {}
        try:
            super()._fill(given, wording, wrong, *known)
        except InputError as error:
            raise InputError([_IN_SI.sub("", one) if toml else one for one in error.sentences]) from None

    def _check(self, values: Mapping[str, Any], wording: Wording) -> Iterator[str]:
        given, of = vars(self)["_given"], self.PARAMETERS
        by_ratio = "starting_torque" not in given or "maximum_ratio" in given
        if by_ratio and not {"rated_power", "rated_torque"} & given:
            other = wording.label(of["rated_torque"])
            yield wording.missing(of["rated_power"], f", or {other} in its place").sentence

    def contradictions(self) -> Iterator[str]:
        return contradictions(self)

    # what is filled in ------------------------------------------------------------------------------------

    @cached_property
    def assumed(self) -> dict[str, str]:
        """What nobody gave and is filled in, by parameter, as it is said; and what was read as per cent."""
        given, assumptions = self.given(), dict[str, str]()
        if not {"starting_torque", "starting_ratio"} & given.keys():
            assumptions["starting_ratio"] = f"starting torque {self.starting_ratio:g} times the rated torque"
        if "efficiency" not in given and "ratio" in given:
            assumptions["efficiency"] = f"efficiency {self.efficiency:g}"
        if not {"coupling_play", "backlash", "output_play"} & given.keys():
            assumptions["backlash"] = "no backlash"
        if not STIFFNESSES & given.keys():
            usual = f"{BAND[0]:g} to {BAND[1]:g} Hz of most drives with gears"
            assumptions["stiffness"] = f"elastic frequency {BAND[1]:g} Hz, the stiff end of the {usual}"
        elif self.machine == "hoist" and not ROPE & given.keys():
            assumptions["rope"] = "rigid rope"
        if "rope_diameter" in given:
            more = "" if "rope_modulus" in given else f"modulus {self.rope_modulus / 1e9:g} GPa on a "
            assumptions["rope_modulus"] = f"rope {more}metallic cross-section of {METAL:g} d^2"
        if self.machine in RESISTANCE and "resistance" not in given:
            assumptions["resistance"] = f"resistance {RESISTANCE[self.machine]:g} of the weight"
        if "damping_ratio" not in given:
            assumptions["damping_ratio"] = f"damping ratio {self.damping_ratio:g}"
        read: dict[str, str] = vars(self)["_read"]
        return assumptions | read

    def assumed_still(self, settled: Iterable[str]) -> str:
        """What is assumed, less what no longer counts where these parameters of the drive are set."""
        settled = {*settled, *({"load_friction"} - self._entries.keys())}
        return "; ".join(one for name, one in self.assumed.items() if not SETTLE.get(name, {""}) <= settled)

    def mark(self, name: str) -> str:
        """A mark behind a value that is assumed."""
        return ", assumed" if name in self.assumed else ""

    # at the motor shaft -----------------------------------------------------------------------------------

    @property
    def rated(self) -> float | None:
        """Rated torque, or rated power over rated speed, N m; None where neither is given."""
        if self.rated_torque is not None or self.rated_power is None:
            return self.rated_torque
        return self.rated_power / self.rated_speed

    @property
    def possible(self) -> Drive | UnknownStiffness:
        """The drive; where no stiffness is known, with that at the soft end of what it may be.

        >>> sheet = DataSheet(machine="rotor", rated_power=1e3, rated_speed=150, motor_inertia=0.01,
        ...     output_inertia=0.1)
        >>> [round(drive.Omega / (2 * math.pi), 9) for drive in sheet.possible]
        [30.0, 3.0]
        """
        if STIFFNESSES & self.given().keys():
            return self.drive
        soft = self.replace(elastic_frequency=BAND[0]).drive
        return UnknownStiffness(self.drive, soft.replace(assumed=self.drive.assumed))

    @cached_property
    def _motor_side(self) -> MotorSide:
        return motor_side(self)

    @cached_property
    def _entries(self) -> dict[str, Entry]:
        return drive_entries(self, self._motor_side)

    @property
    def speed(self) -> float:
        """Speed of the load at the rated speed of the motor: m/s, of a rotor rad/s."""
        return self.rated_speed / self.ratio * (1.0 if self.machine == "rotor" else arm(self))

    @property
    def acceleration(self) -> float:
        """Mean acceleration of the load under the starting torque, m/s2, of a rotor rad/s2."""
        side = self._motor_side
        accelerating = side.Ms - side.active - side.friction
        return self.speed / self.rated_speed * accelerating / (side.J1 + side.J2)

    @property
    def motion(self) -> str:
        """Speed and acceleration of the load, as they are said.

        >>> DataSheet(machine="travel", rated_power="3 kW", rated_speed="1410 rpm", motor_inertia=0.0062,
        ...     starting_ratio=2.2, ratio=38.1, mass="6.5 t", diameter="315 mm", gear_stiffness=35e3).motion
        'load 36.62 m/min, accelerated by 1.426 m/s^2 on average'
        """
        if self.machine == "rotor":
            speed, unit = f"{self.speed * 30.0 / math.pi:.4g} rpm", "rad/s^2"
        else:
            speed, unit = f"{60.0 * self.speed:.4g} m/min", "m/s^2"
        return f"load {speed}, accelerated by {self.acceleration:.4g} {unit} on average"

    @property
    def motion_warnings(self) -> list[str]:
        """What can hardly be of the motion of the load, which a drive does not know."""
        if self.machine == "rotor":
            return []
        a, balanced = self.acceleration, self.counterweight > 0.0
        return list(motion_warnings(self.machine, self.speed, a, slope_sine(self), balanced))

    @property
    def plausibility_warnings(self) -> list[str]:
        """What is possible and hardly ever true, of the drive and of the motion of its load."""
        return [*plausibility_warnings(self.drive), *self.motion_warnings]

    def drive_toml(self) -> str:
        """The drive file: each number where it is known, with what it is from in a comment.

        That of a part behind the gear is "at output" there, which `Drive` brings to the motor shaft. What is
        computed has five or six digits, what is typed all.
        """
        return drive_text(self._entries)

    @cached_property
    def drive(self) -> Drive:
        """The drive that follows, exactly; the numbers of `drive_toml` may have fewer digits."""
        values = {name: one.value for name, one in self._entries.items()}
        try:
            return Drive._made(values, Wording("the drive that follows", style="toml"), [])
        except InputError as error:
            cause = " Is [gear] ratio inverted (turns of the motor for one of the output), or a power in W?"
            raise InputError([one + cause * ("cannot move" in one) for one in error.sentences]) from None


OTHER_DOCUMENTS.append(
    (DataSheet.describes, lambda tables, where: DataSheet._from_document(tables, where).drive)
)
