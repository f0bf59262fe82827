"""The drive file of a data sheet: each number where it is known, with its source in a comment."""

from __future__ import annotations

import math
from typing import NamedTuple

from softstart.drive.data_sheet_mechanics import MotorSide, parts_text, total_stiffness
from softstart.drive.data_sheet_values import SheetValues
from softstart.drive.data_sheet_words import BAND
from softstart.drive.model import Drive
from softstart.input.documents import literal
from softstart.quantities import Units, shortest

SHOWN_IN = {"kW": 1e3, "ms": 1e-3}  # units of a drive file that are not those of SI


class Entry(NamedTuple):
    """A line of a drive file: its value, in SI at the motor or as text "at output", its text, its source."""

    value: float | str | None
    text: str
    source: str


def drive_entries(sheet: SheetValues, side: MotorSide, motion: str) -> dict[str, Entry]:
    """The lines of the drive file by parameter of a drive; `motion` says how fast the load is."""
    gear, load, mark, given = side.gear, side.load, sheet.mark, sheet.given()
    stiffness, stiffness_from = total_stiffness(sheet, side)
    damping = 2.0 * sheet.damping_ratio * math.sqrt(stiffness * side.J1 * side.J2 / (side.J1 + side.J2))
    soft = stiffness * (BAND[0] / BAND[1]) ** 2 if mark("stiffness") else None
    gap, assumed = sum(side.gaps.values()), "; ".join(sheet.assumed.values())
    no_gap, unsaid = mark("backlash") and "none given, assumed", assumed and "source" not in given
    more = f", brake, fan and coupling {sheet.added_inertia:.5g}" if sheet.added_inertia else ""
    soft_behind = side.stiffnesses and "coupling" not in side.stiffnesses

    def of_ratio(name: str, ratio: float | None) -> Entry:
        torque, rated = getattr(sheet, f"{name}_torque"), sheet.rated
        if torque is not None or ratio is None or rated is None:
            return entry(torque, "N*m", "data sheet")
        return entry(ratio * rated, "N*m", f"{ratio:.5g} times the rated torque{mark(f'{name}_ratio')}")

    entries = {
        "name": entry(sheet.name),
        "source": entry(f"{sheet.source} and assumed values" if unsaid else sheet.source),
        "assumed": entry(assumed or None),
        "units": entry(sheet.units or None),
        "motor_inertia": entry(side.J1, "kg*m^2", f"rotor {sheet.motor_inertia:.5g}{more}"),
        "starting_torque": of_ratio("starting", sheet.starting_ratio),
        "maximum_torque": of_ratio("maximum", sheet.maximum_ratio),
        "rated_power": entry(sheet.rated_power, "kW", "plate"),
        "rated_torque": entry(sheet.rated_torque, "N*m", "plate"),
        "rated_speed": entry(sheet.rated_speed, "rad/s", "plate"),
        "torque_lag": entry(sheet.torque_lag or None, "ms", "of the inverter"),
        "stiffness": output_entry(sheet, side, stiffness, "N*m/rad", stiffness_from, soft_behind),
        "soft_stiffness": entry(soft, "N*m/rad", f"elastic frequency {BAND[0]:g} Hz; results count at both"),
        "damping": entry(damping, "N*m*s/rad",
                         f"damping ratio {sheet.damping_ratio:.5g}{mark('damping_ratio')}"),
        "gap": output_entry(sheet, side, gap, "rad", parts_text(side.gaps) if gap else no_gap or "given as 0",
                            gap and "coupling" not in side.gaps),
        "load_inertia": output_entry(sheet, side, side.J2, "kg*m^2",
                                     f"{load.inertia_from}; {through_gear(sheet, side, side.J2)}"),
        **load_entries(sheet, side),
        "target_speed": entry(sheet.rated_speed, "rad/s", f"rated speed: {motion}"),
    }  # fmt: skip
    limits = sheet.permissible_torque, sheet.permissible_output_torque
    if is_geared(sheet):
        entries["gear_ratio"] = Entry(gear.ratio, f"{gear.ratio!r}".removesuffix(".0"), "")
        efficiency = f"of all gears{mark('efficiency')}"
        entries["gear_efficiency"] = Entry(gear.efficiency, f"{gear.efficiency:.9g}", efficiency)
    else:  # one shaft, for which the smaller one counts
        limits = min((one for one in limits if one is not None), default=None), None
    names = "permissible_torque", "permissible_output_torque"
    entries |= {name: entry(value, "N*m") for name, value in zip(names, limits, strict=True)}
    return {name: one for name, one in entries.items() if one.value is not None}


def load_entries(sheet: SheetValues, side: MotorSide) -> dict[str, Entry]:
    """The torque of the load by its parts, and the start position that they decide."""
    load, active, friction, hoist = side.load, side.active, side.friction, sheet.machine == "hoist"

    def torque(value: float, source: str) -> Entry:
        source = f"{source or 'none'}; {through_gear(sheet, side, value)}"
        return output_entry(sheet, side, value, "N*m", source)

    if not active:
        unknown = entry("unknown", "", "every figure is the worst of both flanks and mid-gap")
        return {
            "load_torque": torque(friction, load.friction_from),
            "load_kind": entry("reactive", "", "friction"),
            **({"start_position": unknown} if side.gaps else {}),
        }
    entries = {
        "load_torque": torque(active, load.active_from),
        "load_kind": entry("active", "", "a load that hangs" if hoist else "it acts always"),
        **({"load_friction": torque(friction, load.friction_from)} if friction else {}),
    }
    if friction >= abs(active):
        return entries | {"start_position": entry("unknown", "", "friction holds the load where it stopped")}
    holds = f"the {'brake' if hoist else 'brake or backstop'} holds the motor"
    return entries | {
        "start_position": entry("hanging", "", f"{holds}, the load winds up the shaft"),
        "brake": entry("motor"),
        "release": entry("torque", "", "torque proving"),
    }


def is_geared(sheet: SheetValues) -> bool:
    """Whether there is a gear, so that values at the output are others than at the motor."""
    return bool({"ratio", "efficiency"} & sheet.given().keys())


def through_gear(sheet: SheetValues, side: MotorSide, at_motor: float) -> str:
    """What a value comes through from the load, and its size at the motor."""
    gear, driven = side.gear, "driving the motor " * side.overhauling
    shared = f", shared by {sheet.motors:.5g} motors" if sheet.motors != 1.0 else ""
    if gear.ratio == gear.efficiency == 1.0:
        return f"{driven}without gears{shared}" if driven else f"no gears{shared}"
    before = f"at the motor {at_motor:.5g}, " if is_geared(sheet) else ""
    efficiency = f"efficiency {gear.efficiency:.5g}{sheet.mark('efficiency')}"
    return f"{before}{driven}through {gear.ratio:.5g}:1, {efficiency}{shared}"


def output_entry(
    sheet: SheetValues, side: MotorSide, value: float, unit: str, source: str, behind: object = True
) -> Entry:
    """An entry that is shown at the output, where it can be known there: as the sheet says it."""
    if not (is_geared(sheet) and behind):
        return entry(value, unit, source)
    at_output = float(side.gear.to_output(value, unit))
    whole = shortest(at_output, unit, within=1e-12)
    there = f"{whole if ' ' in whole else f'{whole} {unit}'} at output"
    if unit == "rad":  # as catalogues give a backlash
        return Entry(there, f'"{Units("arcmin").shown(at_output, unit):.9g} arcmin at output"', source)
    return Entry(there, f'"{quantity_text(at_output, unit, 6)} at output"', source)


def entry(value: float | str | None, unit: str = "", source: str = "") -> Entry:
    """A word or a number in SI, shown in this unit.

    >>> entry(147.65485471872029, "rad/s").text, entry("hanging").text, entry(2e3 / 3.0, "kW").text
    ('"1410 rpm"', '"hanging"', '"0.66667 kW"')
    """
    if not unit or not isinstance(value, float | int):
        return Entry(value, literal(value), source)
    return Entry(value, f'"{quantity_text(value / SHOWN_IN.get(unit, 1.0), unit, 5)}"', source)


def quantity_text(value: float, unit: str, digits: int) -> str:
    """A value as it was typed, at whichever shaft; a computed one with so many digits.

    >>> quantity_text(0.1 + 0.2, "N*m", 5), quantity_text(1.0 / 3.0, "N*m", 5)
    ('0.3 N*m', '0.33333 N*m')
    """
    text = shortest(value, unit, within=1e-12)
    return text if " " in text else f"{text if len(text) <= 15 else f'{value:.{digits}g}'} {unit}"


def drive_text(entries: dict[str, Entry]) -> str:
    """The lines of the file, with aligned comments, table by table."""
    blocks = []
    for table in Drive.TABLES:
        rows = [(f"{p.key} = {entries[p.name].text}", entries[p.name].source)
                for p in table.parameters if p.name in entries]  # fmt: skip
        width = max((len(line) for line, source in rows if source), default=0)
        lines = [f"[{table.name}]"] * bool(table.name)
        lines += [f"{line:{width}}  # {source}" if source else line for line, source in rows]
        blocks += ["\n".join(lines)] * bool(rows)
    return "\n\n".join(blocks) + "\n"
