"""What a data sheet says about the mechanics: the load at the output, and everything at the motor shaft."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

from softstart.drive.checks import GRAVITY
from softstart.drive.data_sheet_values import SheetValues
from softstart.drive.data_sheet_words import BAND, METAL, RESISTANCE
from softstart.input.gear import Gear

STEEL = 79.3e9  # N/m^2, shear modulus


class OutputLoad(NamedTuple):
    """The load at the output: inertia, kg m2, and torques, N m, each with its source."""

    inertia: float
    inertia_from: str
    active: float
    active_from: str
    friction: float
    friction_from: str


class MotorSide(NamedTuple):
    """One motor and its share of the load, in SI at the motor shaft; stiffnesses and gaps by part."""

    gear: Gear
    load: OutputLoad
    J1: float
    J2: float
    Ms: float
    active: float
    friction: float
    stiffnesses: dict[str, float]
    gaps: dict[str, float]

    @property
    def overhauling(self) -> bool:
        """Whether the load drives the motor."""
        return bool(self.gear.load < 0.0)


def arm(sheet: SheetValues) -> float:
    """Radius on which the load moves with the output, m."""
    radius = sheet.radius if sheet.diameter is None else 0.5 * sheet.diameter
    return (radius or 0.0) / sheet.reeving


def load_speed(sheet: SheetValues) -> float:
    """Speed of the load at the rated speed of the motor: m/s, of a rotor rad/s."""
    return sheet.rated_speed / sheet.ratio * (1.0 if sheet.machine == "rotor" else arm(sheet))


def mean_acceleration(sheet: SheetValues, side: MotorSide) -> float:
    """Mean acceleration of the load under the starting torque, m/s2, of a rotor rad/s2."""
    accelerating = side.Ms - side.active - side.friction
    return load_speed(sheet) / sheet.rated_speed * accelerating / (side.J1 + side.J2)


def slope_sine(sheet: SheetValues) -> float:
    """Sine of the slope of track or belt."""
    return sheet.rise / sheet.length if sheet.rise and sheet.length else math.sin(sheet.slope)


def motor_side(sheet: SheetValues) -> MotorSide:
    """The machine at the shaft of one of its motors."""
    load, motors = output_load(sheet), sheet.motors
    efficiency = sheet.efficiency if {"efficiency", "ratio"} & sheet.given().keys() else 1.0
    gear = Gear(sheet.ratio, efficiency, load.active + load.friction)
    starting = sheet.starting_torque
    if starting is None:
        starting = sheet.starting_ratio * (sheet.rated or math.nan)
    return MotorSide(
        gear, load,
        J1=sheet.motor_inertia + sheet.added_inertia, J2=gear.to_motor(load.inertia / motors, "kg*m^2"),
        Ms=starting, active=gear.to_motor(load.active / motors, "N*m"),
        friction=gear.to_motor(load.friction / motors, "N*m"),
        stiffnesses=stiffnesses(sheet, gear), gaps=gaps(sheet, gear),
    )  # fmt: skip


def output_load(sheet: SheetValues) -> OutputLoad:
    """The whole load at the output."""
    inertia, friction, active = sheet.output_inertia, sheet.friction, sheet.active_torque
    J = [f"{inertia:.5g} kg m^2 at the output"] if inertia else []
    F = [f"{friction:.5g} N m of friction at the output"] if friction else []
    M = [f"{active:.5g} N m at the output"] if active else []
    if sheet.machine != "rotor":
        mass, radius, balance, sine = sheet.mass or 0.0, arm(sheet), sheet.counterweight, slope_sine(sheet)
        inertia += (mass + balance) * radius**2
        moved = f"{mass:.5g} kg" + (f" and a counterweight of {balance:.5g} kg" if balance else "")
        J.insert(0, f"{moved} on a radius of {radius:.5g} m")
        if sheet.machine == "hoist":
            lifted = mass - balance
            what = f"the weight of {lifted:.5g} kg" if balance else "the weight"
        else:
            # the two strands of a belt balance one another: what an incline lifts is the goods on it
            rising = mass if sheet.goods is None else sheet.goods
            lifted, share = rising * sine, sheet.resistance
            share = RESISTANCE[sheet.machine] if share is None else share
            what = f"the weight of {rising:.5g} kg times {sine:.5g}, the sine of the slope"
            friction += share * mass * GRAVITY * radius * math.sqrt(1.0 - sine**2)
            F.insert(0, f"{share:.5g} of the weight{sheet.mark('resistance')} on {radius:.5g} m")
        if lifted:
            active += lifted * GRAVITY * radius
            M.insert(0, f"{what} on {radius:.5g} m")
    return OutputLoad(inertia, ", ".join(J), active, ", ".join(M), friction, ", ".join(F))


def stiffnesses(sheet: SheetValues, gear: Gear) -> dict[str, float]:
    """By part that is given, N m/rad at the motor shaft."""
    rope, parts = sheet.rope_stiffness, {}
    if sheet.rope_length and sheet.rope_diameter:
        rope = sheet.rope_modulus * METAL * sheet.rope_diameter**2 / sheet.rope_length
    if sheet.coupling_stiffness is not None:
        parts["coupling"] = sheet.coupling_stiffness
    if sheet.gear_stiffness is not None:
        parts["gears"] = gear.to_motor(sheet.gear_stiffness, "N*m/rad")
    if sheet.shaft_diameter and sheet.shaft_length:
        twist = STEEL * math.pi * sheet.shaft_diameter**4 / (32.0 * sheet.shaft_length)
        parts["output shaft"] = gear.to_motor(twist, "N*m/rad")
    if rope:
        # car and counterweight hang on ropes of their own; they store (m1^2 + m2^2) a^2/(2 k) together
        m1, m2 = sheet.mass or 0.0, sheet.counterweight
        both = (m1 + m2) ** 2 / (m1**2 + m2**2)
        drum = rope * sheet.reeving * arm(sheet) ** 2 * both / sheet.motors
        parts[f"rope{sheet.mark('rope_modulus')}"] = gear.to_motor(drum, "N*m/rad")
    return parts


def gaps(sheet: SheetValues, gear: Gear) -> dict[str, float]:
    """By part that has one, rad at the motor shaft."""
    parts = {}
    if sheet.coupling_play and sheet.coupling_diameter:
        parts["coupling"] = 2.0 * sheet.coupling_play / sheet.coupling_diameter
    if sheet.backlash:
        parts["gears"] = gear.to_motor(sheet.backlash, "rad")
    if sheet.output_play and sheet.play_diameter:
        parts["behind the gears"] = gear.to_motor(2.0 * sheet.output_play / sheet.play_diameter, "rad")
    return parts


def total_stiffness(sheet: SheetValues, side: MotorSide) -> tuple[float, str]:
    """Of all parts in series, N m/rad at the motor shaft, and its source."""
    if side.stiffnesses:
        rigid = "; rope assumed rigid" if "rope" in sheet.assumed else ""
        series = 1.0 / sum(1.0 / one for one in side.stiffnesses.values())
        return series, f"in series, {parts_text(side.stiffnesses)}{rigid}"
    frequency = sheet.elastic_frequency or BAND[1]
    c = (2.0 * math.pi * frequency) ** 2 * side.J1 * side.J2 / (side.J1 + side.J2)  # [G](8)
    return c, f"elastic frequency {frequency:g} Hz{sheet.mark('stiffness')}"


def parts_text(values: Mapping[str, float]) -> str:
    """Parts of a sum at the motor shaft."""
    return "at the motor: " + ", ".join(f"{part} {value:.4g}" for part, value in values.items())
