"""The parameter sheets."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from softstart.reporting.markup import Html, html, joined, table, tag
from softstart.reporting.resolution import rated_torque
from softstart.reporting.values import RPM, decimals_of, digits, fixed, short, unit

if TYPE_CHECKING:
    from softstart.drive import Drive
    from softstart.reporting.result import Report
    from softstart.reporting.sheet import Setting, Sheet

RAMPS = ("ramp", "s-curve")


def sheet_section(report: Report) -> Html:
    """One sheet for each chosen strategy."""
    if not report.sheets:
        return tag("p", "There is no sheet, because no strategy is recommended.")
    steps = "; ".join(f"{what} to {step}" for what, step in report.resolution.told(report.drive))
    return html(
        tag(
            "p",
            f"Every value is rounded to what the inverter can be set to: {steps}. The drive was then "
            f"started again with "
            "the rounded values, and once more with every value half a step off, as a display that rounds "
            "may hide.",
        ),
        joined(_sheet(sheet, report) for sheet in report.sheets),
    )


def _sheet(sheet: Sheet, report: Report) -> Html:
    drive = report.drive
    rows = [_setting(one, drive) for one in sheet.settings]
    best = report.choice.recommended
    role = "recommended" if best is not None and sheet.name == best.name else "for an ordinary inverter"
    heads = ["parameter", "meaning", "set to", "unit", "that is", "exact"]
    return tag(
        "section",
        tag("h3", f"{sheet.name} ({role})"),
        table(
            heads, rows, caption=f"Parameter sheet: {sheet.name}", text_columns=(0, 1, 3, 4), class_="sheet"
        ),
        _outcome(sheet),
        tag("ul", joined(tag("li", one) for one in _notes(sheet, drive)), class_="notes"),
        class_="sheet",
    )


def _setting(one: Setting, drive: Drive) -> list[str]:
    name = one.name.replace("_", " ")
    if isinstance(one.exact, str) or isinstance(one.rounded, str):
        return [name, one.meaning, str(one.rounded), "", "", str(one.exact)]
    value, exact, step, shown = one.rounded, one.exact, one.step, unit(one.unit)
    other = ""
    if one.unit == "s":
        value, exact, step, shown = 1e3 * value, 1e3 * exact, step and 1e3 * step, "ms"
    elif one.unit == "rad/s":
        other, shown = f"{digits(value)} rad/s", "Hz" if "frequency" in one.name else "rpm"
        factor = 0.5 / math.pi if "frequency" in one.name else RPM
        value, exact, step = factor * value, factor * exact, step and factor * step
    elif one.unit == "N*m":
        rated, meant = rated_torque(drive)
        share = step and 100.0 * step / rated
        other = f"{_multiple(100.0 * value / rated, share)} % of the {meant}"
    text = digits(value) if one.unit == "N*m" and step and decimals_of(step) > 3 else _multiple(value, step)
    kept = "" if one.step is not None else " (not rounded)" if one.name != "period" else "at most"
    if one.name == "period":
        return [name, one.meaning + " of the control code", f"≤ {short(value)}", shown, "", short(value)]
    return [name, one.meaning + kept, text, shown, other, short(float(f"{exact:.5g}"))]


def _multiple(value: float | None, step: float | None) -> str:
    """A multiple of a step with the decimals that show it."""
    assert value is not None
    if step is None:
        return short(value)
    step = float(f"{step:.9g}")
    return fixed(value, decimals_of(step)) if decimals_of(step) <= 6 else digits(value)


def _outcome(sheet: Sheet) -> Html:
    if sheet.rounded is None:
        return tag("p", "The start with the rounded values could not be made: ", sheet.failure)
    exact, rounded = sheet.exact, sheet.rounded
    rows = [
        ["exact values", fixed(exact.k_dyn, 4), digits(exact.peak_torque), digits(exact.start_time, 5)],
        ["rounded values, as in the sheet", fixed(rounded.k_dyn, 4), digits(rounded.peak_torque),
         digits(rounded.start_time, 5)],
    ]  # fmt: skip
    if sheet.variants:
        peak = sheet.worst_k_dyn * exact.peak_torque / exact.k_dyn if exact.k_dyn > 0.0 else math.nan
        rows.append(
            ["worst with the values half a step off", fixed(sheet.worst_k_dyn, 4), digits(peak),
             digits(sheet.slowest, 5)]
        )  # fmt: skip
    return table(
        ["start with", "K_dyn", "peak torque, N m", "start time, s"], rows,
        caption=f"{sheet.name}: started again after rounding",
    )  # fmt: skip


def _limits(sheet: Sheet, drive: Drive) -> str:
    """The torque limits that leave this start as it is."""
    run = sheet.rounded or sheet.exact
    rated, meant = rated_torque(drive)
    low, high = min(float(np.min(run.u)), 0.0), float(np.max(run.u))
    said = [f"{digits(v)} N m ({fixed(100.0 * v / rated, 1)} % of the {meant})" for v in (high, low) if v]
    return f"Torque limits of the inverter, not tighter than what this start takes: {' and '.join(said)}."


def _notes(sheet: Sheet, drive: Drive) -> list[str]:
    notes = []
    if sheet.variants:
        which = "all combinations of" if sheet.corners else "each value alone, and all together,"
        notes.append(f"Half a step off: {sheet.variants} starts, {which} half a step down or up.")
        if math.isnan(sheet.worst_k_dyn):
            notes.append("In at least one of them the load does not reach its target speed: set finer steps.")
    notes.append(_limits(sheet, drive))
    coarse = [one.name.replace("_", " ") for one in sheet.settings if one.coarse]
    if coarse:
        notes.append(f"The steps are coarse against {', '.join(coarse)}: look for a finer setting.")
    values = {one.name: one.rounded for one in sheet.settings}
    if sheet.kind in RAMPS:
        low, high, time = (float(values[key]) for key in ("initial", "full_torque", "time"))
        rated, meant = rated_torque(drive)
        if high > low and time > 0.0:
            rate = (high - low) / time
            notes.append(
                f"Some inverters ask for the time of a ramp from 0 to 100 % of torque "
                f"({short(float(f'{rated:.4g}'))} "
                f"N m, the {meant}): that is {digits(1e3 * rated / rate)} ms, a mean rise of "
                f"{digits(rate)} N m/s."
            )
        if sheet.kind == "s-curve":
            share = float(values["rounding"])
            notes.append(
                f"S-curve share {short(100.0 * share)} %: rounded ends of {digits(500.0 * share * time)} "
                f"ms each at the "
                "beginning and at the end of the rise."
            )
    elif sheet.kind != "direct":
        known = ["J1", "J2", "c"] + (["d"] if drive.d else []) + ["Mc"]
        notes.append(
            "The strategy is code of its own (equations: docs/controllers.md of softstart); it also "
            "computes with "
            f"{', '.join(known)} and the torque lag from the data of the drive."
        )
    return notes
