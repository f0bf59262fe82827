"""`DataSheet`: a machine as plates, catalogues and drawings give it, each number at its own part."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Iterable, Iterator, Mapping
from functools import cached_property
from typing import Any, ClassVar, Literal, Self, get_args

from softstart.drive.model import Drive
from softstart.errors import InputError
from softstart.input.documents import document_text, literal, parsed
from softstart.input.files import text_of
from softstart.input.gear import Gear
from softstart.input.parameter_set import MaybeNumber, Number, ParameterSet, parameter
from softstart.input.parameters import Mistake, Parameter, Wording, bare, read_value, without_unit
from softstart.quantities import Units, shortest

__all__ = [
    "ABOUT", "INSTEAD", "MACHINES", "TYPICAL", "USUAL", "DataSheet", "Machine", "echo", "if_empty", "typed",
]  # fmt: skip

Machine = Literal["hoist", "travel", "belt", "rotor"]
MACHINES: Mapping[str, str] = {
    "hoist": "a load on ropes",
    "travel": "a crane, trolley or vehicle on wheels",
    "belt": "a belt conveyor",
    "rotor": "slewing gear, fan, rotary table: anything that turns about the output axis",
}

GRAVITY = 9.80665  # m/s^2
STEEL = 79.3e9  # N/m^2, shear modulus
RESISTANCE = {"travel": 0.008, "belt": 0.02}  # share of the weight
METAL = 0.46  # metallic cross-section of a rope over its diameter squared, EN 12385: class 6x36, steel core

# what is filled in where a number is not given, and where that is from
TYPICAL: Mapping[str, tuple[str, str]] = {
    "starting_ratio": ("1.5", "1.5 is what inverters allow for a minute in their heavy-duty rating; at the "
                       "mains 2 to 3, by the data sheet of the motor"),
    "efficiency": ("0.95", "0.97 to 0.98 for each stage of spur, helical or bevel gears"),
    "rope_modulus": ("100 GPa", "90 to 120 GPa on the metallic cross-section, 0.46 d^2, of a rope in use"),
    "resistance": ("0.008, of a belt 0.02", "travel on rolling bearings 0.006 to 0.01; belts 0.016 to 0.03, "
                   "DIN 22101"),
    "damping_ratio": ("0.02", "0.02 for gears and steel shafts; with an elastomer coupling 0.06, psi/(4 pi) "
                      "by its catalogue"),
}  # fmt: skip
# the unit that a bare number has at the prompt and in the form, where it is not that of SI; in a file such a
# number is refused
USUAL: Mapping[str, str] = {
    "rated_power": "kW", "rated_speed": "rpm", "torque_lag": "ms", "backlash": "arcmin",
    "rope_modulus": "GPa", **dict.fromkeys(
        ("coupling_play", "coupling_diameter", "shaft_diameter", "shaft_length", "output_play",
         "play_diameter", "rope_diameter"), "mm"),
}  # fmt: skip
# parameters that say something about these machines only
ABOUT: Mapping[str, tuple[Machine, ...]] = {
    **dict.fromkeys(("mass", "radius"), ("hoist", "travel", "belt")), "resistance": ("travel", "belt"),
    **dict.fromkeys(("reeving", "rope_stiffness", "rope_length", "rope_diameter", "rope_modulus"), ("hoist",))
}  # fmt: skip
# parameters that need not be given where the other one is
INSTEAD: Mapping[str, str] = {
    "rated_torque": "rated_power", "starting_ratio": "starting_torque", "maximum_ratio": "maximum_torque",
    "rope_length": "rope_stiffness",
}  # fmt: skip
FORMER = {"power": "rated_power", "speed": "rated_speed"}  # keywords of former versions
_QUOTIENT = re.compile(r"\s*(\d+\.?\d*)\s*[:/]\s*(\d+\.?\d*)\s*")
_IN_SI = re.compile(r" or as a bare number in \S+(?=[.;])")  # refused, or in another unit
# the parameters of the drive that, where they are set themselves, leave nothing of what is assumed here
SETTLE = {
    "starting_ratio": {"starting_torque"}, "efficiency": {"stiffness", "load_inertia", "load_torque"},
    "backlash": {"gap"}, "rope": {"stiffness"}, "rope_modulus": {"stiffness"}, "resistance": {"load_torque"},
    "damping_ratio": {"damping"},
}  # fmt: skip


def _maybe(path: str, unit: str, meaning: str, example: str, **more: Any) -> Any:
    """A quantity above 0 that need not be given."""
    return parameter(path, unit, meaning, example, "above 0", default=None, **more)


def _nothing(path: str, unit: str, meaning: str, example: str, **more: Any) -> Any:
    """A quantity that is 0 where it is not given."""
    return parameter(path, unit, meaning, example, "0 or more", default=0.0, **more)


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
    docs/howto/own-drive.md derives the same numbers by hand. Metallic cross-section of a rope: EN 12385-4,
    class 6x36 with steel core, C = 0.46.

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
        default=None, formerly="motor.power")
    rated_torque: MaybeNumber = _maybe("motor.rated_torque", "N*m", "rated torque", '"20 N*m"')
    rated_speed: Number = parameter("motor.rated_speed", "rad/s", "rated speed", '"1430 rpm"', "above 0",
        formerly="motor.speed")
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
    output_inertia: Number = _nothing("load.inertia", "kg*m^2",
        "inertia of drum, wheels or turning machine at the output", '"1.2 kg*m^2"', at_output="here")
    output_torque: Number = _nothing("load.torque", "N*m", "further torque of the load at the output",
        '"20 N*m"', at_output="here")
    motors: Number = parameter("load.motors", "1", "motors on one load and rope", "2", "above 0", default=1.0)
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
        return cls.from_toml(text_of(path, cls.WHAT), where=os.fspath(path), also=also)

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
        """Whether TOML tables are those of a data sheet, not of a drive: by a key that no drive has.

        >>> DataSheet.describes({"load": {"machine": "hoist"}}), DataSheet.describes({"load": {"torque": 7}})
        (True, False)
        """

        def paths(parameters: Mapping[str, Parameter]) -> set[str]:
            return {path for p in parameters.values() for path in (p.path, p.formerly)}

        own = paths(cls.PARAMETERS) - paths(Drive.PARAMETERS)
        tables = {name: keys for name, keys in document.items() if isinstance(keys, dict)}
        of_drive = {"stiffness", "gap"} & tables.get("shaft", {}).keys()
        return not of_drive and any(f"{name}.{key}" in own for name, keys in tables.items() for key in keys)

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
        given = {FORMER.get(name, name): value for name, value in given.items()}
        toml = wording.style == "toml"
        wrong = [*mistakes, *(without_unit(given, self.PARAMETERS, USUAL, wording) if toml else ())]
        share = bare(given.get("efficiency"))
        per_cent = share and 10.0 <= float(share) <= 100.0
        vars(self)["_read"] = {"read": f"efficiency {share} is {share} %"} if per_cent else {}
        given |= {name: _quotient(name, given[name]) for name in ("ratio", "reeving") if name in given}
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
        for name in ("output_inertia",) if self.machine == "rotor" else ("mass", "radius"):
            if not getattr(self, name):
                p = of[name]
                yield (
                    f"{p.place} is missing: a {self.machine} needs the {p.meaning}; "
                    f"write for example {p.key} = {p.example}."
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
            ("rope_modulus", "rope_diameter"),
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
        yield from self._said_twice()
        if not self._stiffnesses:
            yield (
                "nothing here is elastic: give [coupling] stiffness, [gear] stiffness, [output] diameter "
                "and length of a shaft, or [rope] stiffness of a hoist, as far as they are known."
            )

    def _said_twice(self) -> Iterator[str]:
        """Pairs of values that say the same thing, and not the same value."""
        given, of, rated = self.given(), self.PARAMETERS, self.rated
        for name, other in INSTEAD.items():
            if not {name, other} <= given.keys():
                continue
            if name == "rope_length":
                yield "[rope] stiffness and [rope] length both say how stiff the rope is; leave one out."
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
        if self.machine == "hoist" and not {"rope_stiffness", "rope_length"} & given.keys():
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
        settled = {*settled}
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
        return Gear(self.ratio, self._eta)

    @property
    def _arm(self) -> float:
        """Radius on which the load moves with the output, m."""
        return (self.radius or 0.0) / self.reeving

    @cached_property
    def _stiffnesses(self) -> dict[str, float]:
        """By part, N m/rad at the motor shaft."""
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
            drum = rope * self.reeving * self._arm**2 / self.motors
            found[f"rope{self._mark('rope_modulus')}"] = gear.to_motor(drum, "N*m/rad")
        return found

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
    def _load(self) -> tuple[float, str, float, str]:
        """Inertia and torque of the whole load at the output, each with what it is from."""
        inertia, torque = self.output_inertia, self.output_torque
        J = [f"{inertia:.5g} kg m^2 at the output"] if inertia else []
        M = [f"{torque:.5g} N m at the output"] if torque else []
        if self.machine != "rotor":
            mass, arm = self.mass or 0.0, self._arm
            inertia += mass * arm**2
            J.insert(0, f"{mass:.5g} kg on a radius of {arm:.5g} m")
            share, what = 1.0, "the weight"
            if self.machine != "hoist":
                share = RESISTANCE[self.machine] if self.resistance is None else self.resistance
                what = f"{share:.5g} of the weight{self._mark('resistance')}"
            torque += share * mass * GRAVITY * arm
            M.insert(0, f"{what} on {arm:.5g} m")
        return inertia, ", ".join(J), torque, ", ".join(M) or "none"

    def _lines(self) -> dict[str, tuple[str, str]]:
        """The drive file by parameter of a drive: the value as TOML, and what it is from."""
        geared = bool({"ratio", "efficiency"} & self.given().keys())
        gear, rated, mark = self._gear, self.rated, self._mark
        i, eta = gear
        stiffness = 1.0 / sum(1.0 / one for one in self._stiffnesses.values())
        through = "no gears"
        if i != 1.0 or eta != 1.0:
            through = f"through {i:.5g}:1, efficiency {eta:.5g}{mark('efficiency')}"
        shared = f", shared by {self.motors:.5g} motors" if self.motors != 1.0 else ""
        inertia, inertia_from, torque, torque_from = self._load
        J1 = self.motor_inertia + self.added_inertia
        J2 = gear.to_motor(inertia / self.motors, "kg*m^2")
        Mc = gear.to_motor(torque / self.motors, "N*m")
        damping = 2.0 * self.damping_ratio * math.sqrt(stiffness * J1 * J2 / (J1 + J2))
        speed = f'"{self.rated_speed * 30.0 / math.pi:.6g} rpm"'
        hoist, gap = self.machine == "hoist", sum(self._gaps.values())
        assumed, no_gap = "; ".join(self.assumed.values()), mark("backlash") and "none given, assumed"
        unsaid = assumed and "source" not in self.given()
        more = f", brake, fan and coupling {self.added_inertia:.5g}" if self.added_inertia else ""

        def at_motor(number: float) -> str:
            return f"at the motor {number:.5g}, " if geared else ""

        def parts(found: Mapping[str, float]) -> str:
            return "at the motor: " + ", ".join(f"{part} {value:.4g}" for part, value in found.items())

        def si(number: float | None, unit: str) -> str:
            return "" if number is None else f'"{number:.5g} {unit}"'

        def there(number: float, unit: str, behind: object = True) -> str:
            """At the output, where it can be known there: as the sheet says it."""
            if not (geared and behind):
                return si(number, unit)
            value = float(gear.to_output(number, unit))
            if unit == "rad":  # as catalogues give a backlash
                return f'"{Units("arcmin").shown(value, unit):.9g} arcmin at output"'
            text = shortest(value, unit, within=1e-12)
            text = f"{value:.6g}" if len(text) > 15 else text  # computed
            return f'"{text} at output"' if " " in text else f'"{text} {unit} at output"'

        def of_ratio(torque: float | None, ratio: float | None, mark: str) -> tuple[str, str]:
            if torque is not None or ratio is None or rated is None:
                return si(torque, "N*m"), "data sheet"
            return si(ratio * rated, "N*m"), f"{ratio:.5g} times the rated torque{mark}"

        found = {
            "name": (literal(self.name), ""),
            "source": (literal(f"{self.source} and assumed values" if unsaid else self.source), ""),
            "assumed": (literal(assumed) if assumed else "", ""),
            "motor_inertia": (si(J1, "kg*m^2"), f"rotor {self.motor_inertia:.5g}{more}"),
            "starting_torque": of_ratio(self.starting_torque, self.starting_ratio, mark("starting_ratio")),
            "maximum_torque": of_ratio(self.maximum_torque, self.maximum_ratio, ""),
            "rated_power": (si(self.rated_power and self.rated_power / 1e3, "kW"), "plate"),
            "rated_torque": (si(self.rated_torque, "N*m"), "plate"),
            "rated_speed": (speed, "plate"),
            "torque_lag": (si(1e3 * self.torque_lag or None, "ms"), "of the inverter"),
            "gear_ratio": (f"{i!r}".removesuffix(".0") if geared else "", ""),
            "gear_efficiency": (f"{eta:.9g}" if geared else "", f"of all gears{mark('efficiency')}"),
            "stiffness": (there(stiffness, "N*m/rad", "coupling" not in self._stiffnesses),
                          f"in series, {parts(self._stiffnesses)}"
                          f"{'; rope assumed rigid' if 'rope' in self.assumed else ''}"),
            "damping": (si(damping, "N*m*s/rad"),
                        f"damping ratio {self.damping_ratio:.5g}{mark('damping_ratio')}"),
            "gap": (there(gap, "rad", gap and "coupling" not in self._gaps),
                    parts(self._gaps) if gap else no_gap or "given as 0"),
            "load_inertia": (there(J2, "kg*m^2"), f"{inertia_from}; {at_motor(J2)}{through}{shared}"),
            "load_torque": (there(Mc, "N*m"), f"{torque_from}; {at_motor(Mc)}{through}{shared}"),
            "load_kind": ('"active"', "a load that hangs") if hoist else ('"reactive"', "friction"),
            "target_speed": (speed, "rated speed"),
        }  # fmt: skip
        limits = self.permissible_torque, self.permissible_output_torque
        if not geared:  # one shaft, for which the smaller one counts
            limits = min((one for one in limits if one is not None), default=None), None
        found["permissible_torque"], found["permissible_output_torque"] = (
            (si(one, "N*m"), "") for one in limits
        )
        if hoist:
            found |= {
                "start_position": ('"hanging"', "the brake holds the motor, the load winds up the shaft"),
                "brake": ('"motor"', ""),
                "release": ('"torque"', "torque proving"),
            }
        elif gap:
            found["start_position"] = ('"unknown"', "every figure is the worst of both flanks and mid-gap")
        return found

    def drive_toml(self) -> str:
        """The drive file: each number where it is known, with what it is from in a comment.

        That of a part behind the gear is "at output" there, which `Drive` brings to the motor shaft.
        """
        blocks, found = [], self._lines()
        for table in Drive.TABLES:
            lines = [(p.key, *found[p.name]) for p in table.parameters if found.get(p.name, ("",))[0]]
            wide = max((len(f"{key} = {value}") for key, value, about in lines if about), default=0)
            rows = [
                f"{f'{key} = {value}':{wide}}  # {about}" if about else f"{key} = {value}"
                for key, value, about in lines
            ]
            if rows:
                blocks.append("\n".join([f"[{table.name}]", *rows] if table.name else rows))
        return "\n\n".join(blocks) + "\n"

    @cached_property
    def drive(self) -> Drive:
        """The drive of `drive_toml`: what is computed has five or six digits there, what is typed all."""
        try:
            return Drive.from_toml(self.drive_toml(), where="the drive that follows")
        except InputError as error:
            cause = " Is [gear] ratio inverted (turns of the motor for one of the output), or a power in W?"
            raise InputError([one + cause * ("cannot move" in one) for one in error.sentences]) from None


# what is typed -------------------------------------------------------------------------------------------


def _quotient(name: str, value: object) -> object:
    """The quotient that "38:1" or "4/2" is where a ratio or a reeving is written; anything else as it is."""
    found = _QUOTIENT.fullmatch(str(value)) if name in ("ratio", "reeving") else None
    return float(found[1]) / float(found[2]) if found and float(found[2]) else value


def typed(p: Parameter, text: str) -> str:
    """What is typed at a prompt or in a form for one parameter: a bare number has its usual unit.

    >>> [typed(DataSheet.PARAMETERS[name], "95") for name in ("backlash", "mass", "efficiency", "ratio")]
    ['95 arcmin', '95 kg', '95 %', '95']
    """
    text = str(_quotient(p.name, text))
    number, unit = bare(text), USUAL.get(p.name, p.unit)
    if p.name == "efficiency" and number and float(number) >= 10.0:
        unit = "%"
    return f"{number} {unit}" if number and unit not in ("", "1") else text.strip()


def if_empty(p: Parameter) -> str:
    """What is used where nothing is typed for a parameter.

    >>> [if_empty(DataSheet.PARAMETERS[name]) for name in ("efficiency", "backlash", "rated_power", "motors")]
    ['0.95, assumed', 'none', 'by rated torque', '1']
    """
    if p.name in TYPICAL:
        return f"{TYPICAL[p.name][0]}, assumed"
    other = next((name for name, instead in INSTEAD.items() if instead == p.name), "")
    if other:
        return f"by {DataSheet.PARAMETERS[other].key.replace('_', ' ')}"
    return f"{p.default:g}" if isinstance(p.default, float) and p.default else p.default or "none"


def echo(p: Parameter, text: str) -> str:
    """What is typed for one parameter, with its value in SI; "" for a word or a plain number.

    >>> [echo(DataSheet.PARAMETERS[name], "1460") for name in ("rated_speed", "mass", "ratio")]
    ['1460 rpm = 152.9 rad/s', '1460 kg', '']
    """
    written = typed(p, text)
    if not p.unit or bare(written):
        return ""
    value = f"{float(f'{read_value(p, written):.4g}'):.10g} {p.unit}".removesuffix(" 1")
    return written if written.endswith(f" {p.unit}") else f"{written} = {value}"
