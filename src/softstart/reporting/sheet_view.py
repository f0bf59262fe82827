"""What is shown of a parameter sheet, the same in a report, on a terminal and as a text to be copied."""

from __future__ import annotations

import math
from collections.abc import Sequence

from softstart.controller.tuned import GainSchedule
from softstart.errors import listed
from softstart.quantities import Units
from softstart.reporting.inverters import at_inverters, inverters, speed_values
from softstart.reporting.sheet import ParameterSheet
from softstart.start.resolution import RATED, gain_base, rated_torque
from softstart.views.numbers import (
    Column,
    TextTable,
    at_output,
    column_of,
    number,
    plural,
    seen,
    short,
    titled,
    units_of,
    with_unit,
)
from softstart.views.sheet import Sheet
from softstart.views.starts import machine_lines


def shown_sheet(sheet: ParameterSheet) -> Sheet:
    """The whole sheet.

    >>> from softstart import parameter_sheet
    >>> shown_sheet(parameter_sheet("crane-4amtkf", "direct")).conclusions
    ['With these values: K_dyn 3.1178, start time 0.37352 s; with the exact ones 3.1179 and 0.37351 s.']
    """
    title = f"Parameter sheet: {sheet.name}"
    lines = [title, *machine_lines(sheet.drive)[1:]]
    lines.insert(1, f"  for    {sheet.drive.name}")
    tables = [settings(sheet), at_each_inverter(sheet), starts(sheet), cells(sheet)]
    return Sheet(
        title,
        lines,
        tables=tables,
        conclusions=[outcome(sheet)],
        notes=[*notes(sheet), *common_notes([sheet])],
    )


def settings(sheet: ParameterSheet) -> TextTable:
    """The values; no rows where they could not be rounded."""
    what, rows, drive = inverters()["setting"], list[list[str]](), sheet.drive.design_drive
    units = units_of(sheet.drive)
    for one in sheet.settings if sheet.rounded else ():
        rows.append([one.name.replace("_", " "), *one.shown(drive, units), what.get(one.name, one.meaning)])
    that_is = f"that is{units.at}".replace(", ", ",\n")
    heads = [("parameter", False), ("set to", True), ("unit", False), (that_is, True), ("exact", True)]
    columns = [Column(*one) for one in (*heads, ("what it is at the inverter", False))]
    return TextTable("", columns, rows, keys=1)


def at_each_inverter(sheet: ParameterSheet) -> TextTable:
    """A speed ramp in the functions of inverters; no rows for other strategies."""
    drive, rows = sheet.drive.design_drive, list[list[str]]()
    if sheet.kind == "speed-ramp" and sheet.rounded:
        at, (basis, speed) = speed_values(sheet.values, drive), (rated_torque(drive)[1], gain_base(drive)[1])
        in_units = (
            f"ramp time {at['ramp_s']} s ({at['rate']} rpm/s, to {at['target_rpm']} rpm), rounding "
            f"{at['rounding_s']} s at each end, Kp {at['kp']} N m s/rad, Tn {at['tn_ms']} ms, torque limit "
            f"{at['limit_percent']} % of the {basis}"
        )
        percent = f"{at['kp_percent']} (100 %: {basis}, {speed})"
        rows = [
            ["units of this sheet", in_units],
            ["Kp in per cent of torque per per cent of speed", percent],
            *map(list, at_inverters(sheet.values, drive)),
        ]
    where = ", at the motor shaft" if units_of(sheet.drive).gear else ""
    return TextTable(
        f"{sheet.name} at inverters{where}", [Column("inverter", False), Column("settings", False)], rows
    )


def starts(sheet: ParameterSheet) -> TextTable:
    """The start with exact values, with those of the sheet, and with values half a step off."""
    exact, rounded = sheet.exact, sheet.rounded
    if rounded is None:
        return TextTable("", [], [])
    found = [
        ("exact values", exact.k_dyn, exact.peak_torque, exact.limited_time),
        ("values of the sheet", rounded.k_dyn, rounded.peak_torque, rounded.limited_time),
    ]
    if sheet.variants:
        found.append(
            ("worst with values half a step off", sheet.worst_k_dyn, sheet.worst_peak, sheet.slowest)
        )
    units, peaks = units_of(sheet.drive), [peak for _, _, peak, _ in found]
    columns = {
        "start with": [name for name, *_ in found],
        "K_dyn": [number(k_dyn, 4) for _, k_dyn, *_ in found],
        f"peak torque\n{units.label('N*m')}": column_of([units.shown(p, "N*m") for p in peaks]),
    }
    if sheet.drive.gear and not units.gear:
        columns[f"at the output\n{units.label('N*m')}"] = [at_output(sheet.drive, peak) for peak in peaks]
    columns[f"{exact.limited_name}\ns"] = column_of([time for *_, time in found], 5)
    return TextTable.of(titled(f"{sheet.name}: started again after rounding", units), columns, ["start with"])


def cells(sheet: ParameterSheet) -> TextTable:
    """Exact values and those of the sheet in each cell of a tuned set."""
    units, found = units_of(sheet.drive), [cell.summary() for cell in sheet.cells]
    gaps = [units.shown(one["gap"], "rad") for one in found]
    inertias = [units.shown(one["load_inertia"], "kg*m^2") for one in found]
    return TextTable.of(
        titled(f"{sheet.name}: all cells that it was tuned for", units),
        {
            f"gap\n{units.angle}": column_of(gaps),
            "load inertia\nkg m2": column_of(inertias),
            "K_dyn\nexact": [number(one["k_dyn"], 4) for one in found],
            "K_dyn\nof the sheet": [number(one["k_dyn_rounded"], 4) for one in found],
            "start time\nexact, s": column_of([one["start_time"] for one in found], 5),
            "start time\nof the sheet, s": column_of([one["start_time_rounded"] for one in found], 5),
        },
        keys=2,
    )


def outcome(sheet: ParameterSheet) -> str:
    """What the values of the sheet do, beside the exact ones."""
    exact, rounded = sheet.exact, sheet.rounded
    if rounded is None:
        return f"The start with the rounded values could not be made: {sheet.failure}"
    text = (
        f"With these values: K_dyn {number(rounded.k_dyn, 4)}, {rounded.limited_name} "
        f"{_time(rounded.limited_time)}; with the exact ones {number(exact.k_dyn, 4)} and "
        f"{_time(exact.limited_time)}."
    )
    if not sheet.cells:
        return text
    worst = [
        max((one[key] for one in (cell.summary() for cell in sheet.cells)), key=lambda v: (math.isnan(v), v))
        for key in ("k_dyn_rounded", "start_time_rounded", "k_dyn", "start_time")
    ]
    return (
        f"{text} In the worst of the {plural(len(sheet.cells), 'cell')} that they were tuned for: K_dyn "
        f"{number(worst[0], 4)}, {rounded.limited_name} {_time(worst[1])}; with the exact ones "
        f"{number(worst[2], 4)} and {_time(worst[3])}."
    )


def common_notes(sheets: Sequence[ParameterSheet]) -> list[str]:
    """What holds for several sheets beside one another, said once; of which ones, if it is not all of them.

    >>> from softstart import parameter_sheet
    >>> pair = [parameter_sheet("crane-4amtkf", name) for name in ("ramp", "take-up")]
    >>> [note[:46] for note in common_notes(pair)][:2]
    ['ramp: Half a step off: all combinations of hal', 'take-up: Half a step off: each value alone, an']
    """
    found, every = list[str](), [one.name for one in sheets]
    for notes_of_one_kind in zip(*map(_general, sheets), strict=True):
        for note in filter(None, dict.fromkeys(notes_of_one_kind)):
            pairs = list(zip(every, notes_of_one_kind, strict=True))
            names, others = ([name for name, one in pairs if (one == note) == so] for so in (True, False))
            of = f"All but {listed(others)}: " if len(others) < len(names) else f"{listed(names)}: "
            found.append(f"{of if others else ''}{note}")
    return found


def _general(sheet: ParameterSheet) -> tuple[str, str, str]:
    """What is to be known of most sheets alike: half steps, per cent and program; "" for none."""
    rated, basis = rated_torque(sheet.drive.design_drive)
    every = "all combinations of" if sheet.corners else "each value alone, and all together,"
    current = " A limit of the torque-producing current: the same percentages as of the torque."
    base = f"100 % of torque is the {basis} of {torque_in_words(rated, units_of(sheet.drive))}."
    program = (
        "softstart exports the strategy with the values of its sheet as a program for a PLC, an inverter or "
        "a simulator (Structured Text, C, FMU), with a test by real starts."
    )
    return (
        f"Half a step off: {every} half a step down or up." if sheet.variants else "",
        base + current if basis == RATED else base,
        "" if sheet.computes_with is None else program,
    )


def notes(sheet: ParameterSheet) -> list[str]:
    """What else is to be known of the values of this sheet."""
    drive, units = sheet.drive.design_drive, units_of(sheet.drive)
    (rated, basis), found = rated_torque(drive), [sheet.loop]
    if sheet.margins and sheet.rounded:
        found.append(f"With these values: {'; '.join(map(str, sheet.margins))}.")
    if isinstance(sheet.controller, GainSchedule):
        found.append("The gains of the schedule at the gap and load inertia of this machine.")
    if not sheet.settings:
        found.append("This strategy has no parameters.")
    if sheet.moved:
        names = listed([one.replace("_", " ") for one in sheet.moved])
        found.append(f"Not at the nearest step, which would break the rule of the recommendation: {names}.")
    if sheet.variants:
        found += _half_a_step_off(sheet)
    limits = listed(sheet.torque_limits(drive, units))
    found.append(f"Torque limits of the inverter, not tighter than what this start takes: {limits}.")
    if coarse := [one.name.replace("_", " ") for one in sheet.settings if one.coarse]:
        found.append(f"The steps are coarse against {', '.join(coarse)}: look for a finer setting.")
    found += _ramps(sheet, rated, basis)
    if sheet.is_code:
        also = ""
        if sheet.computes_with:
            tuned = " that its gains were tuned for" if sheet.own != drive else ""
            also = f"; beside the sheet it computes with {listed(sheet.computes_with)} of the drive{tuned}"
        found.append(f"The law is code{also}.")
    return [one for one in found if one]


def _half_a_step_off(sheet: ParameterSheet) -> list[str]:
    """What values half a step off may break."""
    permitted, found, units = sheet.drive.limits.shaft_torque, list[str](), units_of(sheet.drive)
    if permitted is not None and sheet.worst_peak > permitted:
        peak, of = column_of([float(units.shown(sheet.worst_peak, "N*m"))])[0], units.label("N*m")
        found.append(
            f"Half a step off, the {'output' if units.gear else 'shaft'} torque may reach {peak} {of}, more "
            f"than the {seen(float(permitted), 'N*m', units)} that are permitted: set these values exactly, "
            "or finer ones."
        )
    if math.isnan(sheet.worst_k_dyn):
        found.append("Half a step off, the load may not reach its target speed: set finer steps.")
    return found


def _ramps(sheet: ParameterSheet, rated: float, basis: str) -> list[str]:
    """The ramp of the torque as other inverters ask for it, and the S-curve in ms."""
    found, units = list[str](), units_of(sheet.drive)
    if rise := sheet.full_rise:
        mean = column_of([float(units.shown(rated / rise.exact, "N*m/s"))])[0]
        found.append(
            "Some inverters ask for the time of a ramp from 0 to 100 % of torque: that is "
            f"{_ms(rise.exact)}, a mean rise of {mean} {units.label('N*m/s')}{units.behind}. Set to "
            f"{short(1e3 * rise.rounded)} ms the rise takes {_ms(rise.rise)}, K_dyn is "
            f"{number(rise.run.k_dyn, 4)} and the start time {_time(rise.run.start_time)}."
        )
    if gear := sheet.gear_ramp:
        found.append(
            f"ABB DCS 500B, gear backlash compensation (4000 counts of the {basis}, each 3.3 ms at 50 Hz): "
            f"GEAR.START TORQ is the initial torque, GEAR.TORQ TIME 0, GEAR.TORQ RAMP "
            f"{column_of([gear.exact])[0]}, set to {short(gear.rounded)}. The rise then takes "
            f"{_ms(gear.rise)}, K_dyn is {number(gear.run.k_dyn, 4)} and the start time "
            f"{_time(gear.run.start_time)}."
        )
    if sheet.kind == "s-curve" and sheet.rounded:
        share, time = sheet.value("rounding"), sheet.value("time")
        found.append(
            f"S-curve share {short(100.0 * share)} %: rounded ends of {_ms(0.5 * share * time)} each at the "
            "beginning and at the end of the rise."
        )
    return found


def torque_in_words(torque: float, units: Units) -> str:
    """A torque of the motor as it is seen and, where that is at the output, at the motor shaft.

    >>> from softstart.input.gear import Gear
    >>> torque_in_words(23.87, Units(torque="kN*m", gear=Gear(38.0, 0.95)))
    '0.86171 kN m at the output, 0.02387 kN m at the motor shaft'
    """
    here = seen(float(f"{torque:.5g}"), "N*m", units.at_motor)
    if not units.gear:
        return here
    there = with_unit(float(f"{units.shown(torque, 'N*m'):.5g}"), units.label("N*m"))
    return f"{there} at the output, {here} at the motor shaft"


def _time(seconds: float) -> str:
    return f"{column_of([seconds], 5)[0]} s"


def _ms(seconds: float) -> str:
    return f"{column_of([1e3 * seconds])[0]} ms"
