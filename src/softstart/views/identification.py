"""What is shown of an identification, of a plan of experiments, and of wear."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from softstart.drive import PARAMETERS
from softstart.identification.model import FILTER
from softstart.identification.result import AT_LIMIT
from softstart.identification.wear import YEAR, deviation
from softstart.quantities import Units
from softstart.views.drawing import COLOURS, GREY, drawing, entitle, head, new_figure
from softstart.views.numbers import IN_SI, NOTHING, TextTable, number, seen, short, titled, units_of
from softstart.views.sheet import Sheet, Writer, columns_file, rows_file

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from softstart.drive import Machine
    from softstart.identification.planning import Experiment, ExperimentPlan
    from softstart.identification.result import Estimate, Identification
    from softstart.identification.wear import Wear

UNITS = {one.name: (one.path, one.unit) for one in PARAMETERS.values()}
FIGURES = {"peak": ("peak shaft torque", "N*m"), "travel": ("load moves", "rad"), "end": ("lasts", "s")}
SIGNIFICANT = 3.0  # standard deviations by which a parameter has changed
NOT_LINEAR = 0.01  # chance below which the gap does not grow along a line
SIMULATED = "simulated, not measured: the torque demand, and the motor as its encoder would count it"


def table_file(table: TextTable) -> Writer:
    """A table as a CSV file."""
    return rows_file([column.heading.replace("\n", " ") for column in table.columns], table.rows)


def _lines(found: Identification) -> list[str]:
    """What was identified from what."""
    if not found.logs:
        return [f"{found.drive.name}: {found.drive.source}"]
    logs = f"{len(found.logs)} logs" if len(found.logs) > 1 else found.logs[0].name
    kinds = " and ".join(sorted({one.kind for one in found.logs}))
    known = f"{sum(one.known for one in found.shared)} of {len(found.shared)} parameters are identifiable"
    return [
        f"{found.drive.name}: identified from {logs}",
        f"  {sum(one.time.size for one in found.logs)} samples of torque and {kinds}; "
        f"{known if found.stated else 'best fit, no intervals'}",
        f"  {found.agreed} of {found.searches} searches ended at the best minimum; torque error "
        f"{_torque(found.ripple, found.drive)} in each sample",
    ]


def _torque(error: float, machine: Machine) -> str:
    """A torque error, three digits."""
    units = units_of(machine)
    return f"{units.shown(error, 'N*m'):.3g} {units.label('N*m')}"


def estimates_table(found: Identification) -> TextTable:
    """A row for each parameter: guess, value, interval."""
    units = units_of(found.drive)

    def row(one: Estimate) -> list[str]:
        shared = one.name in UNITS
        words = one.name.replace("position", "position in gap, log").replace("_", " ")
        name, unit = UNITS[one.name] if shared else (words, "s" if one.name == FILTER else "1")
        unknown = AT_LIMIT if one.reason == AT_LIMIT else "unknown"
        guess = short(float(units.shown(getattr(found.guess, one.name), unit))) if shared else NOTHING
        one = _in_units(one, unit, units)
        return [
            name,
            units.of(unit),
            guess,
            _digits(one.value, one) if one.known or math.isnan(one.upper) else unknown,
            number(100.0 * one.half_width, 2) if one.known and one.value and shared else NOTHING,
            _digits(one.lower, one),
            _digits(one.upper, one),
        ]

    title = "Estimates with 95 % intervals" if found.stated else "Best fit, no intervals"
    numbers = ("guess", "estimate", "+- %", "from", "to")
    return TextTable.of_rows(
        titled(title, units), ("parameter", "unit"), numbers, list(map(row, found.estimates))
    )


def _in_units(one: Estimate, si: str, units: Units) -> Estimate:
    """The estimate as it is seen."""
    value, lower, upper = (float(units.shown(each, si)) for each in (one.value, one.lower, one.upper))
    return replace(one, value=value, lower=lower, upper=upper)


def _digits(value: float, one: Estimate) -> str:
    """As many digits as the interval leaves meaning, one more than are certain."""
    width = 0.5 * (one.upper - one.lower)
    if math.isnan(width):  # no interval is stated
        return NOTHING if math.isnan(value) else f"{value:.3g}"
    if not (math.isfinite(width) and width > 0.0 and value):
        return short(value)
    digits = max(2, min(7, 2 + math.ceil(math.log10(max(abs(value) / width, 1.0)))))
    return f"{value:.{digits}g}"


def identification_sheet(
    found: Identification, k_dyns: Mapping[str, tuple[float, float, float]] | None = None
) -> Sheet:
    """What is shown of an identification; `k_dyns`: K_dyn of strategies on its drive, with its interval."""
    each = sorted((k_dyns or {}).items(), key=lambda one: one[1][0])
    rows = [[name, *(number(value, 3) for value in three)] for name, three in each]
    title = "K_dyn of the identified drive" + (", 95 % intervals" if found.stated else "")
    files: dict[str, str | Writer] = {"identification.json": lambda path: found.save(path.parent)}
    for i, (log, left) in enumerate(zip(found.logs, found.residuals, strict=True), 1):
        columns = {"time [s]": log.time[np.isfinite(log.values)].tolist(), "drive - log": left.tolist()}
        files[f"residuals-{i}.csv"] = columns_file(columns)
    return Sheet(
        f"{found.drive.name}: identified from its logs",
        _lines(found),
        tables=[
            estimates_table(found),
            TextTable.of_rows(title, ("strategy",), ("K_dyn", "from", "to"), rows),
        ],
        notes=found.notes,
        figures={"logs": partial(identification_figure, found)} if found.logs else {},
        no_figure="logs: an identification that was loaded has none; their figure is beside it.",
        files=files,
        machine=found.drive,
    )


def identification_figure(found: Identification) -> Figure:
    """Each log beside the start of the drive found, and the residuals."""
    count, units = len(found.logs), units_of(found.drive)
    with drawing():
        made, axes = new_figure(3, count, (4.5 + 3.5 * count, 6.0), squeeze=False, sharex="col")
        entitle(made, titled(f"{found.drive.name}: logs and simulated starts", units))
        for i, (log, left) in enumerate(zip(found.logs, found.residuals, strict=True)):
            known, si = np.isfinite(log.values), "rad" if log.kind == "angle" else "rad/s"
            values, off, unit = units.shown(log.values, si), units.shown(left, si), units.label(si)
            time, steps = log.time - log.time[0], "steps-post" if log.torque_is == "demand" else "default"
            torque, motion, rest = axes[:, i]
            head(torque, log.name, f"torque, {units.label('N*m')}")
            torque.plot(time, units.shown(log.torque, "N*m"), color=COLOURS[0], drawstyle=steps)
            head(motion, "", f"{log.kind}, {unit}")
            motion.plot(time[known], values[known], ".", ms=2.5, color=GREY, label="log")
            motion.plot(time[known], values[known] + off, color=COLOURS[1], lw=1.0, label="model")
            motion.legend(loc="best")
            head(rest, "", f"drive - log, {unit}", "time, s")
            rest.plot(time[known], off, color=COLOURS[2], lw=0.8)
            rest.axhline(0.0, color=GREY, lw=0.6)
    return made


def plan_table(plan: ExperimentPlan, units: Units = IN_SI) -> TextTable:
    """Half an interval of 95 % of each parameter, in %, under each experiment."""
    shown = plan.experiments
    rows = [
        [UNITS[name][0], *(f"{100.0 * one.widths[name]:.2g}".replace("inf", "unknown") for one in shown)]
        for name in shown[0].widths
    ]
    rows += [
        [f"{words}, {units.label(si)}", *(f"{units.shown(getattr(one, name), si):.3g}" for one in shown)]
        for name, (words, si) in FIGURES.items()
    ]
    names = [one.name.replace(", ", ",\n") for one in shown]
    return TextTable.of_rows(
        titled("Half intervals of 95 %, in % of the value", units), ("parameter",), names, rows
    )


def plan_sheet(plan: ExperimentPlan) -> Sheet:
    """What is shown of a plan of experiments."""
    lines = float(plan.drive.encoder_lines)
    encoder = f"{lines:g} encoder lines" if lines else "an ideal encoder"
    files: dict[str, str | Writer] = {"plan.csv": table_file(plan_table(plan))}
    for one in plan.experiments:
        stem = one.name.replace(", ", "-").replace(" ", "-")
        files |= {f"{stem}.csv": one.profile.to_csv, f"{stem}.toml": one.profile.to_toml}
        files[f"simulated-{stem}.csv"] = partial(_write_log, plan, one)
    lost = ", ".join(name for name, width in plan.best.widths.items() if math.isinf(width))
    title = f"{plan.drive.name}: what an experiment would tell"
    return Sheet(
        title,
        [
            title,
            f"  a sample each {1e3 * plan.log_period:g} ms, {encoder}, a torque error of "
            f"{_torque(plan.ripple, plan.drive)} in each",
        ],
        tables=[plan_table(plan, units_of(plan.drive))],
        conclusions=[
            f'Smallest intervals: "{plan.best.name}"{f"; {lost} not identifiable" if lost else ""}.'
        ],
        figures={"experiments": partial(plan_figure, plan)},
        files=files,
        machine=plan.drive,
    )


def _write_log(plan: ExperimentPlan, one: Experiment, path: Path) -> None:
    """A simulated log of an experiment."""
    from softstart.identification.planning import simulated_log

    log = simulated_log(plan.drive, one, log_period=plan.log_period, ripple=plan.ripple)
    log.to_csv(path, SIMULATED)


def plan_figure(plan: ExperimentPlan) -> Figure:
    """The torque of each experiment."""
    count, units = len(plan.experiments), units_of(plan.drive)
    with drawing():
        made, axes = new_figure(count, 1, (7.0, 1.3 * count + 1.0), sharex=True, squeeze=False)
        entitle(made, titled(f"{plan.drive.name}: torque demand of each experiment", units))
        for axis, one, colour in zip(axes[:, 0], plan.experiments, COLOURS, strict=False):
            time = np.linspace(0.0, one.end, 1000)
            axis.plot(time, units.shown(one.profile.at(time), "N*m"), color=colour)
            axis.axhline(0.0, color=GREY, lw=0.6)
            head(axis, one.name, units.label("N*m"))
        axes[-1, 0].set_xlabel("time, s")
    return made


def wear_conclusion(wear: Wear) -> list[str]:
    """How fast the gap grows, and when it reaches its limit."""
    units = units_of(wear.found[-1].drive)
    growth, lower, upper = units.shown(np.array(wear.line.growth), "rad")
    said = [
        f"Growth of the gap{units.at}: {growth:.3g} {units.label('rad')} a year ({lower:.3g} to {upper:.3g})."
    ]
    if wear.limit is None or wear.worn is None:
        return said
    reached, earliest, latest = wear.worn
    if math.isinf(wear.line.reaches(wear.limit)[1]):
        said.append(f"It does not reach {seen(wear.limit, 'rad', units)}: it does not grow.")
    else:
        said.append(
            f"It reaches {seen(wear.limit, 'rad', units)} "
            f"{f'on {reached}' if reached else 'not on this line'}; the "
            f"interval of 95 % goes from {earliest or 'before any of these dates'} to "
            f"{latest or 'never, as the growth may be none'}, if wear goes on as it has."
        )
    return said


def wear_notes(wear: Wear) -> list[str]:
    """What else has changed, and what the line cannot tell."""
    notes, units = list[str](), units_of(wear.found[-1].drive)
    if wear.line.chance < NOT_LINEAR:
        notes.append(
            f"The gaps do not lie on a line within their intervals (chance {wear.line.chance:.1g}): wear "
            "that runs in or speeds up, a repair, or a log that misleads. Their scatter has widened the "
            "intervals."
        )
    first, last = (
        {estimate.name: estimate for estimate in identification.shared if estimate.known}
        for identification in (wear.found[0], wear.found[-1])
    )
    for name in (name for name in first if name in last and name != "gap"):
        both = first[name], last[name]
        if abs(both[1].value - both[0].value) > SIGNIFICANT * math.hypot(*map(deviation, both)):
            si = PARAMETERS[name].unit
            before, now = (float(units.shown(one.value, si)) for one in both)
            unit = f" {units.label(si)}{units.behind * units.is_at_output(si)}" if units.label(si) else ""
            notes.append(
                f"{name} has changed from {before:.4g} to {now:.4g}{unit}, by more than its "
                "intervals: another load or temperature, wear of more than the gap, or, if it is an inertia, "
                "another scale of the torque signal."
            )
    return notes


def wear_table(wear: Wear, units: Units = IN_SI) -> TextTable:
    """The gap at each date, with its interval."""
    gaps = [
        [str(day), name, *(_digits(value, one) for value in (one.value, one.lower, one.upper))]
        for day, name, gap in zip(wear.dates, wear.names, wear.gaps, strict=True)
        for one in (_in_units(gap, "rad", units),)
    ]
    title, heading = titled("Gap, with intervals of 95 %", units), f"gap {units.label('rad')}"
    return TextTable.of_rows(title, ("date", "identification"), (heading, "from", "to"), gaps)


def wear_sheet(wear: Wear) -> Sheet:
    """What is shown of wear."""
    drive = wear.found[-1].drive
    return Sheet(
        f"{drive.name}: wear of the gap",
        [f"{drive.name}: wear from {wear.dates[0]} to {wear.dates[-1]}"],
        tables=[wear_table(wear, units_of(drive))],
        conclusions=wear_conclusion(wear),
        notes=wear_notes(wear),
        figures={"wear": partial(wear_figure, wear)},
        files={"wear.csv": table_file(wear_table(wear))},
        machine=drive,
    )


def wear_figure(wear: Wear) -> Figure:
    """The gaps over time, the line with its interval, and the limit."""
    units = units_of(wear.found[-1].drive)
    years = [(one - wear.dates[0]).days / YEAR for one in wear.dates]
    reached = wear.line.reaches(wear.limit)[0] if wear.limit else 0.0
    end = np.nanmax([1.3 * years[-1], min(reached, 4.0 * years[-1])])
    with drawing():
        made, axes = new_figure(1, 1, (7.0, 4.0))
        entitle(made, f"{wear.found[-1].drive.name}: wear")
        time = np.linspace(0.0, end, 200)
        line, half = (units.shown(one, "rad") for one in wear.line.at(time))
        axes.fill_between(time, line - half, line + half, color=COLOURS[0], alpha=0.2, lw=0.0)
        axes.plot(time, line, color=COLOURS[0], label="line, interval of 95 %")
        gaps = [_in_units(one, "rad", units) for one in wear.gaps]
        values = [one.value for one in gaps]
        reach = np.array([(one.value - one.lower, one.upper - one.value) for one in gaps]).T
        axes.errorbar(years, values, reach, fmt="o", ms=5, capsize=3, color=COLOURS[1], label="identified")
        if wear.limit is not None:
            axes.axhline(units.shown(wear.limit, "rad"), color=GREY, ls="--", lw=1.0, label="limit")
        head(axes, "", f"gap{units.at}, {units.label('rad')}", f"years after {wear.dates[0]}")
        axes.set_ylim(bottom=0.0)
        axes.legend(loc="best")
    return made
