"""What a data sheet holds: its parameters, what is filled in where nobody gave it, and the rated torque."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import Any, ClassVar, get_args

from softstart.drive.data_sheet_words import BAND, METAL, RESISTANCE, ROPE, STIFFNESSES, USUAL, MachineKind
from softstart.input.parameter_file import ParameterFile
from softstart.input.parameter_set import MaybeNumber, Number, parameter


def _maybe(path: str, unit: str, meaning: str, example: str, **more: Any) -> Any:
    """A quantity above 0 that need not be given."""
    return parameter(path, unit, meaning, example, "above 0", default=None, **more)


def _nothing(path: str, unit: str, meaning: str, example: str, **more: Any) -> Any:
    """A quantity that is 0 where it is not given."""
    return parameter(path, unit, meaning, example, "0 or more", default=0.0, **more)


class SheetValues(ParameterFile, what="a data sheet"):
    """The parameters of a `DataSheet`, which follow from no other ones."""

    USUAL: ClassVar[Mapping[str, str]] = USUAL

    # fmt: off
    name: str = parameter("name", "", "name of the drive", '"hoist A"', "one line", default="unnamed drive")
    source: str = parameter("source", "", "where the numbers are from", '"motor plate"', "one line",
        default="data sheets")
    units: str = parameter("units", "", "units and shaft in which results are shown",
        '"arcmin, rpm, kN m, at output"', "one line", default="")
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

    def mark(self, name: str) -> str:
        """A mark behind a value that is assumed."""
        return ", assumed" if name in self.assumed else ""

    @property
    def balanced(self) -> bool:
        """Whether a counterweight balances the load."""
        return self.counterweight > 0.0

    @property
    def rated(self) -> float | None:
        """Rated torque, or rated power over rated speed, N m; None where neither is given."""
        if self.rated_torque is not None or self.rated_power is None:
            return self.rated_torque
        return self.rated_power / self.rated_speed
