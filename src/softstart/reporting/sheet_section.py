"""The parameter sheets."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from softstart.reporting.markup import Html, html, joined, table, tag
from softstart.reporting.resolution import rated_torque
from softstart.reporting.strategies import DOCUMENTED, ORDINARY
from softstart.reporting.values import RPM, decimals_of, digits, fixed, listed, short, unit

if TYPE_CHECKING:
    from softstart.drive import Drive
    from softstart.reporting.result import Report
    from softstart.reporting.sheet import Setting, Sheet

EVEN = 1e-9  # of a step: what lies above a multiple by no more than this is that multiple


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
        )
        if rows
        else tag("p", "This strategy has no parameters."),
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
    text = _multiple(value, step)
    kept = "" if one.step is not None else " (not rounded)" if one.name != "period" else "at most"
    if one.name == "period":
        return [name, one.meaning + " of the control code", f"≤ {short(value)}", shown, "", short(value)]
    return [name, one.meaning + kept, text, shown, other, short(float(f"{exact:.5g}"))]


def _multiple(value: float | None, step: float | None) -> str:
    """A multiple of a step: all its decimals if the step is a short decimal, else those that tell it apart.

    >>> _multiple(62.0, 0.5), _multiple(34.5683, 0.0238732), _multiple(123.4567, 0.0238732)
    ('62.0', '34.57', '123.46')
    """
    assert value is not None
    if not step:
        return short(value)
    step = float(f"{step:.9g}")
    if decimals_of(step) <= 6 and step == float(f"{step:.4g}"):
        return fixed(value, decimals_of(step))
    order = math.floor(math.log10(abs(value))) if value else 0
    if not -4 <= order <= 6:
        return digits(value, 7)
    enough = max(math.ceil(-math.log10(step)), 3 - order, 0)
    return fixed(value, min(enough, max(6 - order, 0)))


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
    """The torque limits that leave this start as it is, in steps of the inverter."""
    run = sheet.rounded or sheet.exact
    rated, meant = rated_torque(drive)
    low, high = min(float(np.min(run.u)), 0.0), float(np.max(run.u))
    step = sheet.torque_step
    said = []
    for torque in (high, low):
        if torque:
            limit = math.copysign(math.ceil(abs(torque) / step * (1.0 - EVEN)) * step, torque)
            share = _multiple(100.0 * limit / rated, 100.0 * step / rated)
            said.append(f"{_multiple(limit, step)} N m ({share} % of the {meant})")
    current = " A limit of the torque-producing current: the same percentages." if meant[0] == "r" else ""
    return (
        f"Torque limits of the inverter, not tighter than what this start takes: {' and '.join(said)}."
        f"{current}"
    )


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
    if sheet.kind in ORDINARY:
        return notes + _on_ramps(sheet, drive)
    if sheet.kind != "direct":
        notes.append(_on_code(sheet, drive))
    return notes


def _on_ramps(sheet: Sheet, drive: Drive) -> list[str]:
    """The same rise as inverters ask for it."""
    notes = []
    if rise := sheet.full_rise:
        rated, meant = rated_torque(drive)
        notes.append(
            f"Some inverters ask for the time of a ramp from 0 to 100 % of torque "
            f"({short(float(f'{rated:.4g}'))} N m, the {meant}): that is {digits(1e3 * rise.exact)} ms, a "
            f"mean rise of {digits(rated / rise.exact)} N m/s. Set to {short(1e3 * rise.rounded)} ms the "
            f"rise takes {digits(1e3 * rise.rise)} ms, K_dyn is {fixed(rise.run.k_dyn, 4)} and the start "
            f"time {digits(rise.run.start_time, 5)} s."
        )
    if sheet.kind == "s-curve":
        values = {one.name: one.rounded for one in sheet.settings}
        share, time = float(values["rounding"]), float(values["time"])
        notes.append(
            f"S-curve share {short(100.0 * share)} %: rounded ends of {digits(500.0 * share * time)} ms each "
            "at the beginning and at the end of the rise."
        )
    return notes


def _on_code(sheet: Sheet, drive: Drive) -> str:
    """What an inverter must run and know for a strategy that is a program."""
    said = "The strategy is code of its own"
    if sheet.kind in DOCUMENTED:
        said += " (equations: docs/controllers.md of softstart)"
    if sheet.computes_with:
        whose = "the drive" if sheet.own == drive else "the drive that its gains were tuned for"
        said += f"; beside the sheet it computes with {listed(list(sheet.computes_with))} of {whose}"
    return said + "."
