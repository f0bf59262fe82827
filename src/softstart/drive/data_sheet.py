"""`DataSheet`: a machine as plates, catalogues and drawings give it, each number at its own part."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator, Mapping
from functools import cached_property
from typing import Any, ClassVar, Literal, NamedTuple, Self, get_args

from softstart.drive.model import Drive
from softstart.input.documents import document_text, literal, parsed
from softstart.input.files import text_of
from softstart.input.parameter_set import MaybeNumber, Number, ParameterSet, parameter
from softstart.input.parameters import Wording

__all__ = ["TYPICAL", "DataSheet", "Machine"]

Machine = Literal["hoist", "travel", "belt", "rotor"]

GRAVITY = 9.80665  # m/s^2
STEEL = 79.3e9  # N/m^2, shear modulus
RESISTANCE = {"travel": 0.008, "belt": 0.02}  # share of the weight
ROLLING = ("travel", "belt")

# what to write where a number is not known, and where it is from
TYPICAL: Mapping[str, str] = {
    "starting_ratio": "1.5 is what inverters allow for a minute in their heavy-duty rating; at the "
    "mains 2 to 3, by the data sheet of the motor",
    "efficiency": "0.97 to 0.98 for each stage of spur, helical or bevel gears",
    "resistance": "travel on rolling bearings 0.006 to 0.01, usually 0.008; belts 0.016 to 0.03, usually "
    "0.02, DIN 22101",
    "damping_ratio": "0.02 for gears and steel shafts; with an elastomer coupling 0.06, psi/(4 pi) by its "
    "catalogue",
}
# parameters that say something about these machines only
ABOUT: Mapping[str, tuple[Machine, ...]] = {
    "mass": ("hoist", "travel", "belt"),
    "radius": ("hoist", "travel", "belt"),
    "reeving": ("hoist",),
    "resistance": ("travel", "belt"),
}


class _Entry(NamedTuple):
    """One line of a drive file: the key, its value as TOML, and what it is from."""

    key: str
    value: str
    about: str


class DataSheet(ParameterSet):
    """A machine as plates, catalogues and drawings give it; `drive` is what follows for the motor shaft.

    With the ratio i and the efficiency eta of the gears, an inertia J, a stiffness c and a torque M behind
    them are J/(i^2 eta), c/(i^2 eta) and M/(i eta) at the motor shaft, a backlash i times as wide.
    Stiffnesses in series add by their reciprocals, backlashes directly. A mass m on a radius r is m r^2; a
    rope that is reeved n times makes the radius r/n. A steel shaft of diameter D and length L has
    c = G pi D^4/(32 L), G = 79.3e9 N/m^2.

    Parameters
    ----------
    {parameters}

    Raises
    ------
    InputError
        If any value is wrong or missing; with one sentence for each.

    References
    ----------
    docs/howto/own-drive.md derives the same numbers by hand.

    Examples
    --------
    >>> sheet = DataSheet(
    ...     machine="hoist", power="15 kW", speed="970 rpm", motor_inertia=0.17, ratio=45, mass="6300 kg",
    ...     radius="0.2 m", reeving=4, gear_stiffness="2 kN*m/arcmin", backlash="7 arcmin",
    ... )
    >>> drive = sheet.drive
    >>> round(drive.Mc, 1), round(drive.gap, 4), drive.start_position
    (72.3, 0.0916, 'hanging')
    """

    WHAT: ClassVar[str] = "a data sheet"

    name: str = parameter("name", "", "name of the drive", '"hoist A"', "one line", default="unnamed drive")
    source: str = parameter(
        "source", "", "where the numbers are from", '"data sheets"', "one line", default="data sheets"
    )
    machine: Machine = parameter(
        "load.machine", "", "kind of the machine", '"travel"', choices=get_args(Machine)
    )
    power: Number = parameter("motor.power", "W", "rated power", '"3 kW"', "above 0")
    speed: Number = parameter("motor.speed", "rad/s", "rated speed", '"1430 rpm"', "above 0")
    motor_inertia: Number = parameter(
        "motor.inertia", "kg*m^2", "inertia of the rotor", '"0.0119 kg*m^2"', "above 0"
    )
    added_inertia: Number = parameter(
        "motor.added_inertia", "kg*m^2", "inertia of brake disc, fan and coupling on the motor shaft",
        '"0.0066 kg*m^2"', "0 or more", default=0.0,
    )  # fmt: skip
    starting_ratio: Number = parameter(
        "motor.starting_ratio", "1", "starting torque over rated torque", "1.5", "above 0", default=1.5
    )
    maximum_ratio: MaybeNumber = parameter(
        "motor.maximum_ratio", "1", "largest torque over rated torque", "2.6", "above 0", default=None
    )
    torque_lag: Number = parameter(
        "motor.torque_lag", "s", "lag of the torque behind its demand", '"2 ms"', "0 or more", default=0.0
    )
    coupling_stiffness: MaybeNumber = parameter(
        "coupling.stiffness", "N*m/rad", "stiffness of the coupling on the motor shaft", '"1500 N*m/rad"',
        "above 0", default=None,
    )  # fmt: skip
    coupling_play: Number = parameter(
        "coupling.play",
        "m",
        "play of the coupling along its circumference",
        '"0.1 mm"',
        "0 or more",
        default=0.0,
    )
    coupling_diameter: MaybeNumber = parameter(
        "coupling.diameter",
        "m",
        "diameter on which the coupling has its play",
        '"60 mm"',
        "above 0",
        default=None,
    )
    ratio: Number = parameter(
        "gear.ratio", "1", "turns of the motor for one of the output", "31.5", "above 0", default=1.0
    )
    efficiency: Number = parameter(
        "gear.efficiency", "1", "efficiency of all gears", "0.95", "above 0", default=0.95
    )
    gear_stiffness: MaybeNumber = parameter(
        "gear.stiffness",
        "N*m/rad",
        "stiffness of the gears at the output",
        '"25 N*m/arcmin"',
        "above 0",
        default=None,
    )
    backlash: Number = parameter(
        "gear.backlash", "rad", "backlash of the gears at the output", '"15 arcmin"', "0 or more", default=0.0
    )
    shaft_diameter: MaybeNumber = parameter(
        "output.diameter",
        "m",
        "diameter of the steel shaft behind the gears",
        '"55 mm"',
        "above 0",
        default=None,
    )
    shaft_length: MaybeNumber = parameter(
        "output.length", "m", "its length", '"0.9 m"', "above 0", default=None
    )
    output_play: Number = parameter(
        "output.play", "m", "play of couplings and open gears behind it, along the circumference", '"0.4 mm"',
        "0 or more", default=0.0,
    )  # fmt: skip
    play_diameter: MaybeNumber = parameter(
        "output.play_diameter",
        "m",
        "diameter on which they have this play",
        '"120 mm"',
        "above 0",
        default=None,
    )
    mass: MaybeNumber = parameter(
        "load.mass", "kg", "mass that is moved", '"12000 kg"', "above 0", default=None
    )
    radius: MaybeNumber = parameter(
        "load.radius", "m", "radius of wheel or drum", '"0.1575 m"', "above 0", default=None
    )
    reeving: Number = parameter(
        "load.reeving", "1", "ropes that carry the load for one that is wound", "2", "above 0", default=1.0
    )
    resistance: MaybeNumber = parameter(
        "load.resistance", "1", "resistance to motion over weight", "0.008", "0 or more", default=None
    )
    output_inertia: Number = parameter(
        "load.inertia", "kg*m^2", "inertia of drum, wheels or rotor at the output", '"1.2 kg*m^2"',
        "0 or more", default=0.0,
    )  # fmt: skip
    output_torque: Number = parameter(
        "load.torque", "N*m", "further torque of the load at the output", '"20 N*m"', "0 or more", default=0.0
    )
    motors: Number = parameter("load.motors", "1", "motors that share the load", "2", "above 0", default=1.0)
    damping_ratio: Number = parameter(
        "shaft.damping_ratio", "1", "damping ratio of the elastic mode", "0.02", "from 0 to 1", default=0.02
    )

    # making one -------------------------------------------------------------------------------------------

    @classmethod
    def load(cls, path: str | os.PathLike[str], also: Mapping[str, object] | None = None) -> Self:
        """The TOML file at this path; `also` holds changes by path, as {"load.mass": "5000 kg"}."""
        return cls.from_toml(text_of(path, cls.WHAT), where=os.fspath(path), also=also)

    @classmethod
    def from_toml(cls, text: str, where: str = "", also: Mapping[str, object] | None = None) -> Self:
        """A data sheet from the tables [motor], [coupling], [gear], [output], [shaft] and [load]."""
        return cls._from_document(
            parsed(text, Wording(where, style="toml"), cls.WHAT, cls.TABLES), where, also
        )

    @classmethod
    def from_settings(cls, settings: Mapping[str, object]) -> Self:
        """A data sheet from values by path, as {"motor.power": "3 kW", "gear.ratio": 31.5}."""
        return cls._from_document({}, "", settings)

    def to_toml(self) -> str:
        """The data sheet as a file that `load` reads, in SI.

        >>> sheet = DataSheet(machine="rotor", power=1e3, speed=150, motor_inertia=0.01, output_inertia=0.1,
        ...     coupling_stiffness=900)
        >>> DataSheet.from_toml(sheet.to_toml()) == sheet
        True
        """
        return document_text((table, self.given()) for table in self.TABLES)

    def contradictions(self) -> Iterator[str]:
        """What is missing for this machine, and what stands alone."""
        if self.machine != "rotor":
            for name in ("mass", "radius"):
                if getattr(self, name) is None:
                    p = self.PARAMETERS[name]
                    yield (
                        f"{p.place} is missing: a {self.machine} needs the {p.meaning}; "
                        f"write for example {p.key} = {p.example}."
                    )
        elif self.output_inertia == 0.0:
            yield (
                "[load] inertia is missing: a rotor needs its inertia; write for example "
                'inertia = "1.2 kg*m^2".'
            )
        for name, machines in ABOUT.items():
            if name in self.given() and self.machine not in machines:
                place = self.PARAMETERS[name].place
                yield f"{place} is for a {' or '.join(machines)}, and this is a {self.machine}; leave it out."
        pairs = (
            ("coupling_play", "coupling_diameter"),
            ("output_play", "play_diameter"),
            ("shaft_length", "shaft_diameter"),
            ("shaft_diameter", "shaft_length"),
        )
        for one, other in pairs:
            if getattr(self, one) and not getattr(self, other):
                p, q = self.PARAMETERS[one], self.PARAMETERS[other]
                yield f"{p.place} says nothing without {q.place}; write for example {q.key} = {q.example}."
        if not self._stiffnesses:
            yield (
                "nothing here is elastic: give [coupling] stiffness, [gear] stiffness, or [output] diameter "
                "and length of a shaft, as far as they are known."
            )

    # at the motor shaft -----------------------------------------------------------------------------------

    @property
    def rated_torque(self) -> float:
        """Rated power over rated speed, N m."""
        return self.power / self.speed

    @cached_property
    def _stiffnesses(self) -> dict[str, float]:
        """By part, N m/rad at the motor shaft."""
        behind = self.ratio**2 * self.efficiency
        found = {}
        if self.coupling_stiffness is not None:
            found["coupling"] = self.coupling_stiffness
        if self.gear_stiffness is not None:
            found["gears"] = self.gear_stiffness / behind
        if self.shaft_diameter and self.shaft_length:
            found["output shaft"] = (
                STEEL * math.pi * self.shaft_diameter**4 / (32.0 * self.shaft_length) / behind
            )
        return found

    @cached_property
    def _gaps(self) -> dict[str, float]:
        """By part, rad at the motor shaft."""
        found = {}
        if self.coupling_play and self.coupling_diameter:
            found["coupling"] = 2.0 * self.coupling_play / self.coupling_diameter
        if self.backlash:
            found["gears"] = self.backlash * self.ratio
        if self.output_play and self.play_diameter:
            found["behind the gears"] = 2.0 * self.output_play / self.play_diameter * self.ratio
        return found

    @cached_property
    def _load(self) -> tuple[float, str, float, str]:
        """Inertia and torque of the whole load at the output, each with what it is from."""
        inertia, torque = self.output_inertia, self.output_torque
        J = [f"{inertia:.5g} kg m^2 at the output"] if inertia else []
        M = [f"{torque:.5g} N m at the output"] if torque else []
        if self.machine != "rotor":
            assert self.mass is not None
            assert self.radius is not None
            arm = self.radius / self.reeving if self.machine == "hoist" else self.radius
            inertia += self.mass * arm**2
            J.insert(0, f"{self.mass:.5g} kg on a radius of {arm:.5g} m")
            if self.machine == "hoist":
                share, what = 1.0, "the weight"
            else:
                known = self.resistance is not None
                share = self.resistance if self.resistance is not None else RESISTANCE[self.machine]
                what = f"{share:.5g} of the weight{'' if known else ', assumed'}"
            torque += share * self.mass * GRAVITY * arm
            M.insert(0, f"{what} on {arm:.5g} m")
        return inertia, ", ".join(J), torque, ", ".join(M) or "none"

    def entries(self) -> dict[str, list[_Entry]]:
        """The lines of the drive file by table: key, value as TOML, and what it is from."""
        i, eta = self.ratio, self.efficiency
        stiffness = 1.0 / sum(1.0 / one for one in self._stiffnesses.values())
        through = f"through {i:.5g}:1, efficiency {eta:.5g}" if i != 1.0 or eta != 1.0 else "no gears"
        shared = f", shared by {self.motors:.5g} motors" if self.motors != 1.0 else ""
        at_output, inertia_from, torque, torque_from = self._load
        J1 = self.motor_inertia + self.added_inertia
        J2 = at_output / (i**2 * eta) / self.motors
        Mc = torque / (i * eta) / self.motors
        damping = 2.0 * self.damping_ratio * math.sqrt(stiffness * J1 * J2 / (J1 + J2))
        rated = self.rated_torque
        speed = f"{self.speed * 30.0 / math.pi:.6g} rpm"

        def parts(found: Mapping[str, float]) -> str:
            return ", ".join(f"{part} {value:.4g}" for part, value in found.items())

        def line(key: str, number: float, unit: str, about: str) -> _Entry:
            return _Entry(key, f'"{number:.5g} {unit}"', about)

        rotor = f"rotor {self.motor_inertia:.5g}"
        more = f", brake, fan and coupling {self.added_inertia:.5g}" if self.added_inertia else ""
        motor = [
            line("inertia", J1, "kg*m^2", rotor + more),
            line("starting_torque", self.starting_ratio * rated, "N*m",
                 f"{self.starting_ratio:.5g} times the rated torque"),
        ]  # fmt: skip
        if self.maximum_ratio is not None:
            motor.append(
                line("maximum_torque", self.maximum_ratio * rated, "N*m", f"{self.maximum_ratio:.5g} times")
            )
        motor.append(line("rated_power", self.power / 1e3, "kW", "plate"))
        motor.append(_Entry("rated_speed", f'"{speed}"', "plate"))
        if self.torque_lag:
            motor.append(line("torque_lag", 1e3 * self.torque_lag, "ms", "of the inverter"))
        start = [_Entry("target_speed", f'"{speed}"', "rated speed")]
        if self.machine == "hoist":
            start = [
                _Entry("position", '"hanging"', "the brake holds the motor, the load winds up the shaft"),
                _Entry("brake", '"motor"', ""),
                _Entry("release", '"torque"', "torque proving"),
                *start,
            ]
        elif self._gaps:
            start.insert(
                0, _Entry("position", '"unknown"', "every figure is the worst of both flanks and mid-gap")
            )
        load = [
            line("inertia", J2, "kg*m^2", f"{inertia_from}; {through}{shared}"),
            line("torque", Mc, "N*m", f"{torque_from}; {through}{shared}"),
            _Entry("kind", '"active"' if self.machine == "hoist" else '"reactive"',
                   "a load that hangs" if self.machine == "hoist" else "friction"),
        ]  # fmt: skip
        return {
            "": [_Entry("name", literal(self.name), ""), _Entry("source", literal(self.source), "")],
            "motor": motor,
            "shaft": [
                line(
                    "stiffness", stiffness, "N*m/rad", f"in series, at the motor: {parts(self._stiffnesses)}"
                ),
                line("damping", damping, "N*m*s/rad", f"damping ratio {self.damping_ratio:.5g}"),
                line(
                    "gap",
                    sum(self._gaps.values()),
                    "rad",
                    f"at the motor: {parts(self._gaps) or 'none given'}",
                ),
            ],
            "load": load,
            "start": start,
        }

    def drive_toml(self) -> str:
        """The drive file: every number at the motor shaft, with what it is from in a comment."""
        blocks = []
        for table, lines in self.entries().items():
            wide = max(len(f"{key} = {value}") for key, value, about in lines if about or not table)
            rows = [
                f"{f'{key} = {value}':{wide}}  # {about}" if about else f"{key} = {value}"
                for key, value, about in lines
            ]
            blocks.append("\n".join([f"[{table}]", *rows] if table else rows))
        return "\n\n".join(blocks) + "\n"

    @cached_property
    def drive(self) -> Drive:
        """The drive of `drive_toml`: its numbers have five digits, as those of the file."""
        return Drive.from_toml(self.drive_toml(), where="the drive that follows")

    def summary(self) -> dict[str, Any]:
        """The parameters as plain data, for JSON."""
        return self.values()
