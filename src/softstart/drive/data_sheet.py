"""`DataSheet`: a machine as plates, catalogues and drawings give it, each number at its own part."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Iterable, Iterator, Mapping
from functools import cached_property
from typing import Any, ClassVar, NamedTuple, Self, get_args

from softstart.drive.checks import GRAVITY
from softstart.drive.data_sheet_words import (
    ABOUT,
    INSTEAD,
    NEEDED,
    ROPE,
    STIFFNESSES,
    USUAL,
    Machine,
    converted,
)  # fmt: skip
from softstart.drive.model import Drive
from softstart.drive.plausibility import motion_warnings, plausibility_warnings
from softstart.errors import InputError
from softstart.input.documents import document_text, literal, parsed
from softstart.input.files import file_text
from softstart.input.gear import Gear
from softstart.input.parameter_set import MaybeNumber, Number, ParameterSet, parameter
from softstart.input.parameters import Mistake, Wording, bare, without_unit
from softstart.quantities import Units, shortest

# elastic frequencies of most drives with gears, Hz: where no stiffness is known, the stiff end counts, whose
# K_dyn is the higher one, and results are compared with those of the soft end
BAND = (3.0, 30.0)
STEEL = 79.3e9  # N/m^2, shear modulus
RESISTANCE = {"travel": 0.008, "belt": 0.02}  # share of the weight
METAL = 0.46  # metallic cross-section of a rope over its diameter squared, EN 12385: class 6x36, steel core

TWICE = {
    "rope_length": "how stiff the rope is", "radius": "how large the wheel or drum is",
    "rise": "how steep the track is",
}  # fmt: skip
_IN_SI = re.compile(r" or as a bare number in \S+(?=[.;])")  # refused, or in another unit
# the parameters of the drive that, where they are set themselves, leave nothing of what is assumed here
FORCES = {"load_torque", "load_friction"}
SETTLE = {
    "starting_ratio": {"starting_torque"}, "efficiency": {"stiffness", "load_inertia", *FORCES},
    "backlash": {"gap"}, "rope": {"stiffness"}, "rope_modulus": {"stiffness"}, "resistance": FORCES,
    "damping_ratio": {"damping"}, "stiffness": {"stiffness"},
}  # fmt: skip

SHOWN_IN = {"kW": 1e3, "ms": 1e-3}  # units of a drive file that are not those of SI


class _Load(NamedTuple):
    """The load at the output: kg m2 and N m, each with what it is from."""

    inertia: float
    inertia_from: str
    active: float
    active_from: str
    friction: float
    friction_from: str


class _MotorSide(NamedTuple):
    """One motor and its share of the load, at the motor shaft: kg m2 and N m."""

    J1: float
    J2: float
    Ms: float
    active: float
    friction: float
    overhauling: bool  # whether the load drives the motor


class _Entry(NamedTuple):
    """A line of a drive file: the value in SI at the motor shaft, as it is shown, and what it is from."""

    value: Any
    text: str
    about: str


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
    machine: Machine = parameter("load.machine", "", "kind of the machine", '"travel"',
        choices=get_args(Machine))
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
        own = {p.path for p in cls.PARAMETERS.values()} - {p.path for p in Drive.PARAMETERS.values()}
        tables = {name: keys for name, keys in document.items() if isinstance(keys, dict)}
        of_drive = {"stiffness", "gap"} & tables.get("shaft", {}).keys()
        keys_of_a_sheet = any(f"{name}.{key}" in own for name, keys in tables.items() for key in keys)
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
        """What is missing for this machine, what contradicts something else, and what stands alone."""
        given, of = self.given(), self.PARAMETERS
        for name in NEEDED[self.machine]:
            if not getattr(self, name) and not (name == "diameter" and self.radius):
                p, instead = of[name], ", or [load] radius" if name == "diameter" else ""
                yield (
                    f"{p.place} is missing: a {self.machine} needs the {p.meaning}; "
                    f"write for example {p.key} = {p.example}{instead}."
                )
        for name, machines in ABOUT.items():
            if name in given and self.machine not in machines:
                yield (
                    f"{of[name].place} is for a {' or '.join(machines)}, and this is a {self.machine}; "
                    "leave it out."
                )
        for one, other in (
            ("coupling_play", "coupling_diameter"), ("output_play", "play_diameter"),
            ("shaft_length", "shaft_diameter"), ("shaft_diameter", "shaft_length"),
            ("rope_length", "rope_diameter"), ("rope_diameter", "rope_length"),
            ("rope_modulus", "rope_diameter"), ("rise", "length"), ("length", "rise"),
        ):  # fmt: skip
            if given.get(one) and not given.get(other):
                p, q = of[one], of[other]
                yield f"{p.place} says nothing without {q.place}; write for example {q.key} = {q.example}."
        for name in ("starting_ratio", "maximum_ratio", "efficiency"):
            p, value, usual = of[name], given.get(name), "0.1 or more" if name == "efficiency" else "below 10"
            if value is not None and (value < 0.1 if name == "efficiency" else value >= 10.0):
                yield (
                    f"{p.place} is read as {value:.5g}, where the {p.meaning} is {usual}; write for example "
                    f'{p.example} or "{100.0 * float(p.example):g} %".'
                )
        yield from self._load_in_doubt()
        yield from self._said_twice()
        if self._stiffnesses and self.elastic_frequency is not None:
            yield (
                f"{of['elastic_frequency'].place} says how stiff all parts are together, and "
                f"{', '.join(self._stiffnesses)} are given as well; leave out the one or the others."
            )

    def _load_in_doubt(self) -> Iterator[str]:
        """What of the load would mean something else than what it says."""
        given, of = self.given(), self.PARAMETERS
        if self.active_torque and self.machine != "hoist" and "friction" not in given:
            yield (
                f"{of['active_torque'].place} = {self.active_torque:.5g} N*m: does it act always, as a lift, "
                "wind or an imbalance, or only against the motion? If always, write friction = 0 as well, or "
                f"what friction there is; if it is friction, write it as {of['friction'].place}."
            )
        if self.rise and self.length and abs(self.rise) >= self.length:
            yield (
                f"{of['rise'].place} = {self.rise:.5g} m: a track of {self.length:.5g} m cannot rise so far; "
                "give the length along the slope."
            )
        if abs(self.slope) >= 0.5 * math.pi:
            yield f"{of['slope'].place} = {self.slope:.5g} rad: a slope is below 90 deg; check the unit."
        if "goods" in given and not self._sine:
            yield f"{of['goods'].place} says nothing without a slope; give slope, or rise and length."
        if self.goods is not None and self.mass is not None and self.goods > self.mass:
            yield (
                f"{of['goods'].place} = {self.goods:.5g} kg is more than {of['mass'].place} = "
                f"{self.mass:.5g} kg, of which it is a part."
            )

    def _said_twice(self) -> Iterator[str]:
        """Pairs of values that say the same thing, and not the same value."""
        given, of, rated = self.given(), self.PARAMETERS, self.rated
        for name, other in INSTEAD.items():
            if not {name, other} <= given.keys():
                continue
            if name in TWICE:
                yield f"{of[other].place} and {of[name].place} both say {TWICE[name]}; leave one out."
                continue
            first = given[name] * (self.rated_speed if name == "rated_torque" else rated or math.nan)
            if abs(first - given[other]) > 0.05 * given[other]:
                p, q = of[name], of[other]
                yield (
                    f"{p.place} = {given[name]:.5g} and {q.place} = {given[other]:.5g} {q.unit} contradict "
                    f"each other: the first makes {first:.5g} {q.unit}; leave one out."
                )

    # what is filled in ------------------------------------------------------------------------------------

    @cached_property
    def assumed(self) -> dict[str, str]:
        """What nobody gave and is filled in, by parameter, as it is said; and what was read as per cent."""
        given, found = self.given(), dict[str, str]()
        if not {"starting_torque", "starting_ratio"} & given.keys():
            found["starting_ratio"] = f"starting torque {self.starting_ratio:g} times the rated torque"
        if "efficiency" not in given and "ratio" in given:
            found["efficiency"] = f"efficiency {self.efficiency:g}"
        if not {"coupling_play", "backlash", "output_play"} & given.keys():
            found["backlash"] = "no backlash"
        if not STIFFNESSES & given.keys():
            usual = f"{BAND[0]:g} to {BAND[1]:g} Hz of most drives with gears"
            found["stiffness"] = f"elastic frequency {BAND[1]:g} Hz, the stiff end of the {usual}"
        elif self.machine == "hoist" and not ROPE & given.keys():
            found["rope"] = "rigid rope"
        if "rope_diameter" in given:
            more = "" if "rope_modulus" in given else f"modulus {self.rope_modulus / 1e9:g} GPa on a "
            found["rope_modulus"] = f"rope {more}metallic cross-section of {METAL:g} d^2"
        if self.machine in RESISTANCE and "resistance" not in given:
            found["resistance"] = f"resistance {RESISTANCE[self.machine]:g} of the weight"
        if "damping_ratio" not in given:
            found["damping_ratio"] = f"damping ratio {self.damping_ratio:g}"
        read: dict[str, str] = vars(self)["_read"]
        return found | read

    def assumed_still(self, settled: Iterable[str]) -> str:
        """What is assumed, less what no longer counts where these parameters of the drive are set."""
        settled = {*settled, *({"load_friction"} - self._follows.keys())}
        return "; ".join(one for name, one in self.assumed.items() if not SETTLE.get(name, {""}) <= settled)

    def _mark(self, name: str) -> str:
        return ", assumed" if name in self.assumed else ""

    # at the motor shaft -----------------------------------------------------------------------------------

    @property
    def rated(self) -> float | None:
        """Rated torque, or rated power over rated speed, N m; None where neither is given."""
        if self.rated_torque is not None or self.rated_power is None:
            return self.rated_torque
        return self.rated_power / self.rated_speed

    @property
    def _eta(self) -> float:
        """The efficiency; 1 where there are no gears."""
        return self.efficiency if {"efficiency", "ratio"} & self.given().keys() else 1.0

    @property
    def _gear(self) -> Gear:
        return Gear(self.ratio, self._eta, self._load.active + self._load.friction)

    @property
    def _arm(self) -> float:
        """Radius on which the load moves with the output, m."""
        radius = self.radius if self.diameter is None else 0.5 * self.diameter
        return (radius or 0.0) / self.reeving

    @cached_property
    def _stiffnesses(self) -> dict[str, float]:
        """By part that is given, N m/rad at the motor shaft."""
        gear = self._gear
        rope, found = self.rope_stiffness, {}
        if self.rope_length and self.rope_diameter:
            rope = self.rope_modulus * METAL * self.rope_diameter**2 / self.rope_length
        if self.coupling_stiffness is not None:
            found["coupling"] = self.coupling_stiffness
        if self.gear_stiffness is not None:
            found["gears"] = gear.to_motor(self.gear_stiffness, "N*m/rad")
        if self.shaft_diameter and self.shaft_length:
            twist = STEEL * math.pi * self.shaft_diameter**4 / (32.0 * self.shaft_length)
            found["output shaft"] = gear.to_motor(twist, "N*m/rad")
        if rope:
            # car and counterweight hang on ropes of their own; they store (m1^2 + m2^2) a^2/(2 k) together
            m1, m2 = self.mass or 0.0, self.counterweight
            both = (m1 + m2) ** 2 / (m1**2 + m2**2)
            drum = rope * self.reeving * self._arm**2 * both / self.motors
            found[f"rope{self._mark('rope_modulus')}"] = gear.to_motor(drum, "N*m/rad")
        return found

    @property
    def _stiffness(self) -> tuple[float, str]:
        """Of all parts in series, N m/rad at the motor shaft, and what it is from."""
        if parts := self._stiffnesses:
            rigid = "; rope assumed rigid" if "rope" in self.assumed else ""
            return 1.0 / sum(1.0 / one for one in parts.values()), f"in series, {_parts(parts)}{rigid}"
        frequency, of = self.elastic_frequency or BAND[1], self._motor_side
        c = (2.0 * math.pi * frequency) ** 2 * of.J1 * of.J2 / (of.J1 + of.J2)  # [G](8)
        soft = (
            f"; {c * (BAND[0] / BAND[1]) ** 2:.5g} at {BAND[0]:g} Hz"
            if self.elastic_frequency is None
            else ""
        )
        return c, f"elastic frequency {frequency:g} Hz{self._mark('stiffness')}{soft}"

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
    def _gaps(self) -> dict[str, float]:
        """By part, rad at the motor shaft."""
        found = {}
        if self.coupling_play and self.coupling_diameter:
            found["coupling"] = 2.0 * self.coupling_play / self.coupling_diameter
        if self.backlash:
            found["gears"] = self._gear.to_motor(self.backlash, "rad")
        if self.output_play and self.play_diameter:
            play = 2.0 * self.output_play / self.play_diameter
            found["behind the gears"] = self._gear.to_motor(play, "rad")
        return found

    @cached_property
    def _load(self) -> _Load:
        """The whole load at the output."""
        inertia, friction, active = self.output_inertia, self.friction, self.active_torque
        J = [f"{inertia:.5g} kg m^2 at the output"] if inertia else []
        F = [f"{friction:.5g} N m of friction at the output"] if friction else []
        M = [f"{active:.5g} N m at the output"] if active else []
        if self.machine == "rotor":
            return _Load(inertia, ", ".join(J), active, ", ".join(M), friction, ", ".join(F))
        mass, arm, balance = self.mass or 0.0, self._arm, self.counterweight
        inertia += (mass + balance) * arm**2
        moved = f"{mass:.5g} kg" + (f" and a counterweight of {balance:.5g} kg" if balance else "")
        J.insert(0, f"{moved} on a radius of {arm:.5g} m")
        if self.machine == "hoist":
            lifted = mass - balance
            what = f"the weight of {lifted:.5g} kg" if balance else "the weight"
        else:
            # the two strands of a belt balance one another: what an incline lifts is the goods on it
            rising = mass if self.goods is None else self.goods
            lifted, share = rising * self._sine, self._share
            what = f"the weight of {rising:.5g} kg times {self._sine:.5g}, the sine of the slope"
            friction += share * mass * GRAVITY * arm * math.sqrt(1.0 - self._sine**2)
            F.insert(0, f"{share:.5g} of the weight{self._mark('resistance')} on {arm:.5g} m")
        if lifted:
            active += lifted * GRAVITY * arm
            M.insert(0, f"{what} on {arm:.5g} m")
        return _Load(inertia, ", ".join(J), active, ", ".join(M), friction, ", ".join(F))

    @property
    def _share(self) -> float:
        """Resistance to motion over weight."""
        return RESISTANCE.get(self.machine, 0.0) if self.resistance is None else self.resistance

    @property
    def _sine(self) -> float:
        """Of the slope of track or belt."""
        return self.rise / self.length if self.rise and self.length else math.sin(self.slope)

    @cached_property
    def _motor_side(self) -> _MotorSide:
        """Inertias and torques at the motor shaft, of one of the motors."""
        gear, load, starting = self._gear, self._load, self.starting_torque
        if starting is None:
            starting = self.starting_ratio * (self.rated or math.nan)
        return _MotorSide(
            J1=self.motor_inertia + self.added_inertia,
            J2=gear.to_motor(load.inertia / self.motors, "kg*m^2"), Ms=starting,
            active=gear.to_motor(load.active / self.motors, "N*m"),
            friction=gear.to_motor(load.friction / self.motors, "N*m"), overhauling=gear.load < 0.0,
        )  # fmt: skip

    @property
    def speed(self) -> float:
        """Speed of the load at the rated speed of the motor: m/s, of a rotor rad/s."""
        return self.rated_speed / self.ratio * (1.0 if self.machine == "rotor" else self._arm)

    @property
    def acceleration(self) -> float:
        """Mean acceleration of the load under the starting torque, m/s2, of a rotor rad/s2."""
        of = self._motor_side
        return self.speed / self.rated_speed * (of.Ms - of.active - of.friction) / (of.J1 + of.J2)

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
        return list(motion_warnings(self.machine, self.speed, a, self._sine, balanced))

    @property
    def plausibility_warnings(self) -> list[str]:
        """What is possible and hardly ever true, of the drive and of the motion of its load."""
        return [*plausibility_warnings(self.drive), *self.motion_warnings]

    @cached_property
    def _follows(self) -> dict[str, _Entry]:
        """What follows, by parameter of a drive."""
        gear, rated, mark, given = self._gear, self.rated, self._mark, self.given()
        of, load, (stiffness, stiffness_from) = self._motor_side, self._load, self._stiffness
        damping = 2.0 * self.damping_ratio * math.sqrt(stiffness * of.J1 * of.J2 / (of.J1 + of.J2))
        gap, assumed = sum(self._gaps.values()), "; ".join(self.assumed.values())
        no_gap, unsaid = mark("backlash") and "none given, assumed", assumed and "source" not in given
        more = f", brake, fan and coupling {self.added_inertia:.5g}" if self.added_inertia else ""
        soft_behind = self._stiffnesses and "coupling" not in self._stiffnesses

        def of_ratio(name: str, ratio: float | None) -> _Entry:
            torque = getattr(self, f"{name}_torque")
            if torque is not None or ratio is None or rated is None:
                return _entry(torque, "N*m", "data sheet")
            return _entry(ratio * rated, "N*m", f"{ratio:.5g} times the rated torque{mark(f'{name}_ratio')}")

        entries = {
            "name": _entry(self.name),
            "source": _entry(f"{self.source} and assumed values" if unsaid else self.source),
            "assumed": _entry(assumed or None),
            "motor_inertia": _entry(of.J1, "kg*m^2", f"rotor {self.motor_inertia:.5g}{more}"),
            "starting_torque": of_ratio("starting", self.starting_ratio),
            "maximum_torque": of_ratio("maximum", self.maximum_ratio),
            "rated_power": _entry(self.rated_power, "kW", "plate"),
            "rated_torque": _entry(self.rated_torque, "N*m", "plate"),
            "rated_speed": _entry(self.rated_speed, "rad/s", "plate"),
            "torque_lag": _entry(self.torque_lag or None, "ms", "of the inverter"),
            "stiffness": self._there(stiffness, "N*m/rad", stiffness_from, soft_behind),
            "damping": _entry(damping, "N*m*s/rad",
                              f"damping ratio {self.damping_ratio:.5g}{mark('damping_ratio')}"),
            "gap": self._there(gap, "rad", _parts(self._gaps) if gap else no_gap or "given as 0",
                               gap and "coupling" not in self._gaps),
            "load_inertia": self._there(of.J2, "kg*m^2", f"{load.inertia_from}; {self._through(of.J2)}"),
            **self._torques(),
            "target_speed": _entry(self.rated_speed, "rad/s", f"rated speed: {self.motion}"),
        }  # fmt: skip
        limits = self.permissible_torque, self.permissible_output_torque
        if self._geared:
            entries["gear_ratio"] = _Entry(gear.ratio, f"{gear.ratio!r}".removesuffix(".0"), "")
            efficiency = f"of all gears{mark('efficiency')}"
            entries["gear_efficiency"] = _Entry(gear.efficiency, f"{gear.efficiency:.9g}", efficiency)
        else:  # one shaft, for which the smaller one counts
            limits = min((one for one in limits if one is not None), default=None), None
        names = "permissible_torque", "permissible_output_torque"
        entries |= {name: _entry(value, "N*m") for name, value in zip(names, limits, strict=True)}
        return {name: one for name, one in entries.items() if one.value is not None}

    @property
    def _geared(self) -> bool:
        return bool({"ratio", "efficiency"} & self.given().keys())

    def _through(self, at_motor: float) -> str:
        """What a value comes through from the load, and what it is at the motor."""
        gear, driven = self._gear, "driving the motor " * self._motor_side.overhauling
        shared = f", shared by {self.motors:.5g} motors" if self.motors != 1.0 else ""
        if gear.ratio == gear.efficiency == 1.0:
            return f"{driven}without gears{shared}" if driven else f"no gears{shared}"
        before = f"at the motor {at_motor:.5g}, " if self._geared else ""
        efficiency = f"efficiency {gear.efficiency:.5g}{self._mark('efficiency')}"
        return f"{before}{driven}through {gear.ratio:.5g}:1, {efficiency}{shared}"

    def _there(self, value: float, unit: str, about: str, behind: object = True) -> _Entry:
        """An entry that is shown at the output, where it can be known there: as the sheet says it."""
        if not (self._geared and behind):
            return _entry(value, unit, about)
        there = float(self._gear.to_output(value, unit))
        if unit == "rad":  # as catalogues give a backlash
            return _Entry(value, f'"{Units("arcmin").shown(there, unit):.9g} arcmin at output"', about)
        return _Entry(value, f'"{_written(there, unit, 6)} at output"', about)

    def _torques(self) -> dict[str, _Entry]:
        """The torque of the load by its parts, and where a start begins that they decide."""
        load, of = self._load, self._motor_side
        active, friction, hoist = of.active, of.friction, self.machine == "hoist"

        def torque(value: float, about: str) -> _Entry:
            return self._there(value, "N*m", f"{about or 'none'}; {self._through(value)}")

        if not active:
            unknown = _entry("unknown", "", "every figure is the worst of both flanks and mid-gap")
            return {
                "load_torque": torque(friction, load.friction_from),
                "load_kind": _entry("reactive", "", "friction"),
                **({"start_position": unknown} if self._gaps else {}),
            }
        entries = {
            "load_torque": torque(active, load.active_from),
            "load_kind": _entry("active", "", "a load that hangs" if hoist else "it acts always"),
            **({"load_friction": torque(friction, load.friction_from)} if friction else {}),
        }
        if friction >= abs(active):
            return entries | {
                "start_position": _entry("unknown", "", "friction holds the load where it stopped")
            }
        holds = f"the {'brake' if hoist else 'brake or backstop'} holds the motor"
        return entries | {
            "start_position": _entry("hanging", "", f"{holds}, the load winds up the shaft"),
            "brake": _entry("motor"),
            "release": _entry("torque", "", "torque proving"),
        }

    def drive_toml(self) -> str:
        """The drive file: each number where it is known, with what it is from in a comment.

        That of a part behind the gear is "at output" there, which `Drive` brings to the motor shaft. What is
        computed has five or six digits, what is typed all.
        """
        blocks, follows = [], self._follows
        for table in Drive.TABLES:
            entries = [(p.key, follows[p.name]) for p in table.parameters if p.name in follows]
            lines = [(f"{key} = {one.text}", one.about) for key, one in entries]
            wide = max((len(line) for line, about in lines if about), default=0)
            rows = [f"{line:{wide}}  # {about}" if about else line for line, about in lines]
            if rows:
                blocks.append("\n".join([f"[{table.name}]", *rows] if table.name else rows))
        return "\n\n".join(blocks) + "\n"

    @cached_property
    def drive(self) -> Drive:
        """The drive that follows, exactly; the numbers of `drive_toml` may have fewer digits."""
        values = {name: one.value for name, one in self._follows.items()}
        try:
            return Drive._made(values, Wording("the drive that follows", style="toml"), [])
        except InputError as error:
            cause = " Is [gear] ratio inverted (turns of the motor for one of the output), or a power in W?"
            raise InputError([one + cause * ("cannot move" in one) for one in error.sentences]) from None


def _parts(values: Mapping[str, float]) -> str:
    """Parts of a sum at the motor shaft."""
    return "at the motor: " + ", ".join(f"{part} {value:.4g}" for part, value in values.items())


def _entry(value: Any, unit: str = "", about: str = "") -> _Entry:
    """A word or a number in SI, shown in this unit.

    >>> _entry(147.65485471872029, "rad/s").text, _entry("hanging").text, _entry(2e3 / 3.0, "kW").text
    ('"1410 rpm"', '"hanging"', '"0.66667 kW"')
    """
    if not unit or value is None:
        return _Entry(value, literal(value), about)
    return _Entry(value, f'"{_written(value / SHOWN_IN.get(unit, 1.0), unit, 5)}"', about)


def _written(value: float, unit: str, digits: int) -> str:
    """A value as it was typed, whatever shaft it was brought to since; if computed, with so many digits.

    >>> _written(0.1 + 0.2, "N*m", 5), _written(1.0 / 3.0, "N*m", 5)
    ('0.3 N*m', '0.33333 N*m')
    """
    text = shortest(value, unit, within=1e-12)
    return text if " " in text else f"{text if len(text) <= 15 else f'{value:.{digits}g}'} {unit}"
