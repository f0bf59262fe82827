"""How long a shaft line lasts, in words, tables, a figure and the files of --out."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from softstart.drive import Machine, SNCurve
from softstart.start.fatigue import HOURS_PER_YEAR, Fatigue, Life
from softstart.start.metrics import REFERENCE
from softstart.views.drawing import (
    GREY,
    MARKERS,
    drawing,
    entitle,
    head,
    line_of,
    new_figure,
    strategy_colours,
)
from softstart.views.markdown import file_stem
from softstart.views.numbers import DataColumn, TextTable, number, seen, short, titled, units_of
from softstart.views.sheet import Sheet, Writer, columns_file, records_file, rows_file
from softstart.views.starts import machine_lines

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SPECTRUM = ("range N m", "mean N m", "count")
EQUIVALENT = (
    "Damage-equivalent torque: one 0-T-0 cycle per start causes the same damage (rainflow cycles after ASTM "
    "E1049, Miner's rule, no endurance limit)."
)


def factor(value: float) -> str:
    """A life beside another one, three digits.

    >>> factor(101.29), factor(1.0), factor(0.0123), factor(math.inf), factor(math.nan), factor(16523.0)
    ('101', '1.00', '0.0123', 'inf', '-', '16500')
    """
    if math.isnan(value) or math.isinf(value) or value == 0.0:
        return number(value, 2)
    rounded = float(f"{value:.3g}")
    return number(rounded, max(0, 2 - math.floor(math.log10(rounded))))


def counted(value: float) -> str:
    """A number that may be large, three digits: 2730, 1.44e+09."""
    return f"{value:.3g}" if 1e6 <= value < math.inf else factor(value)


STRATEGY = DataColumn("strategy", lambda row: row.run.controller_name)
FIGURES = (  # of a single shaft
    DataColumn("K_dyn", lambda row: row.start.k_dyn, 3),
    DataColumn("start\ntime s", lambda row: row.start.start_time),
    DataColumn("equivalent\ntorque N m", lambda row: row.equivalent_torque, si="N*m"),
    DataColumn("life over\ndirect", lambda row: row.relative, text=factor),
    DataColumn("half\ndamping", lambda row: _end_of(row, 0), text=factor, optional=True),
    DataColumn("twice\ndamping", lambda row: _end_of(row, 1), text=factor, optional=True),
    DataColumn("starts to\nfailure", lambda row: row.starts, text=counted, optional=True),
    DataColumn("years", lambda row: row.years, text=counted, optional=True),
    DataColumn("life over\ndirect, worn", lambda row: row.worn_relative, text=factor, optional=True),
    DataColumn("years,\nworn", lambda row: row.worn_years, text=counted, optional=True),
    DataColumn("impacts", lambda row: row.impacts, 0),
    DataColumn("impact\nenergy J", lambda row: row.impact_energy, digits=3),
)
OF_SHAFTS = (  # a table each, with a column for each of several shafts
    DataColumn("Life over that under direct", lambda row: row.relative, text=factor),
    DataColumn("Damage-equivalent torque at the motor shaft, N m", lambda row: row.equivalent_torque, 1,
               si="N*m"),
    DataColumn("Life with half the damping", lambda row: _end_of(row, 0), text=factor, optional=True),
    DataColumn("Life with twice the damping", lambda row: _end_of(row, 1), text=factor, optional=True),
    DataColumn("Life over that under direct, worn", lambda row: row.worn_relative, text=factor,
               optional=True),
    DataColumn("Largest torque, % of the permissible torque", lambda row: 100.0 * row.utilisation, 1,
               optional=True),
)  # fmt: skip


def _end_of(row: Life, end: int) -> float:
    """The relative life with half or twice the damping; NaN where the damping is not estimated."""
    return row.relative_range[end] if row.relative_range else math.nan


def fatigue_tables(found: Fatigue, rows: Sequence[Life], title: str = "") -> list[TextTable]:
    """The strategies with all figures of a single shaft, or with a table a figure of several shafts."""
    shafts, units = found.drive.shaft_names, units_of(found.drive)
    if len(shafts) == 1:
        return [TextTable.of_data(title, (STRATEGY, *FIGURES), rows, units)]
    return [
        TextTable.of(
            figure.heading,
            {
                "strategy": STRATEGY.cells(rows[:: len(shafts)]),
                **{name: figure.cells(rows[k :: len(shafts)]) for k, name in enumerate(shafts)},
            },
            ("strategy",),
        )
        for figure in (one.seen(units) for one in OF_SHAFTS)
        if figure.is_shown(rows)
    ]


def fatigue_conclusion(found: Fatigue) -> str:
    """The strategy with the longest life of the shaft that gains least."""
    worn = not math.isnan(found.worn_gap)

    def life(row: Life) -> float:
        return row.worn_relative if worn else row.relative

    shortest = [min(rows, key=life) for rows in found.by_run]
    best = max([row for row in shortest if not math.isnan(row.start.limited_time)] or shortest, key=life)
    name, wear = best.run.controller_name, ", with wear" if worn else ""
    if name == REFERENCE:
        return f"Longest life: direct{wear}."
    where = f", shaft {best.shaft_name}" if len(found.drive.shaft_names) > 1 else ""
    years = best.worn_years if worn else best.years
    after = "" if math.isnan(years) else f", {counted(years)} years"
    return f"Longest life: {name}, {factor(life(best))} times that of direct{where}{wear}{after}."


def slope_sentence(curve: SNCurve, given: bool) -> str:
    """The S-N curve in a sentence, and where its slope is from.

    >>> slope_sentence(SNCurve(6.6), True)
    'Slope of the S-N curve: m = 6.6.'
    """
    if curve.slope is None:
        return f"The S-N curve has the {len(curve.points)} points of limits.fatigue."
    origin = "" if given else ", that of pitting of case-hardened gears (ISO 6336-2), as no slope is given"
    return f"Slope of the S-N curve: m = {short(curve.slope)}{origin}."


def estimated_damping(machine: Machine, estimate: Mapping[str, int]) -> str:
    """From what the damping of a machine is estimated, the begin of a sentence."""
    parts = " and ".join(f"{count} {name}" for name, count in estimate.items())
    return f"Damping is estimated (ratio {100.0 * machine.damping_ratio:.2g} % from {parts})"


def fatigue_notes(found: Fatigue) -> list[str]:
    """What the figures mean, and what they rest on."""
    drive, limits, curve = found.drive, found.drive.limits, found.curve
    worn, several = not math.isnan(found.worn_gap), len(drive.shaft_names) > 1
    units = units_of(drive)
    ratio = f"{100.0 * drive.damping_ratio:.2g} %"
    damping = f"Damping ratio of the {'first natural vibration' if several else 'shaft'}: {ratio}."
    if found.estimate:
        estimated = estimated_damping(drive, found.estimate)
        damping = f"{estimated}; lives are also given for half and twice the estimate."
    text = [f"{EQUIVALENT} {slope_sentence(curve, found.slope_given)}", damping]
    if worn:
        over = f"{limits.life / 3600.0 / HOURS_PER_YEAR:.3g} years" if limits.life else "the life"
        error = float(f"{100.0 * max(row.wear_error for row in found.rows):.1g}")
        new = short(float(units.shown(float(drive.gaps.sum()), "rad")))
        text.append(
            f"Worn: the backlash grows linearly from {new} to {seen(found.worn_gap, 'rad', units)} over "
            f"{over}; integration error at most {error:g} %."
        )
    if limits.starts_per_hour is not None and curve.points:
        text.append(f"Years of 8766 h with {short(float(limits.starts_per_hour))} starts in each hour.")
        if limits.starts is not None:
            asked = limits.starts / limits.starts_per_hour
            names: dict[bool, list[str]] = {True: [], False: []}
            for rows in found.by_run:
                hours = min(row.worn_hours if worn else row.hours for row in rows)
                names[hours >= asked].append(rows[0].run.controller_name)
            kept = f"{limits.starts:.3g} starts: reached by {', '.join(names[True]) or 'none'}"
            missed = f"; not by {', '.join(names[False])}" if names[False] else ""
            text.append(f"Required life, {kept}{missed}.")
    if len(drive.positions) > 1:
        worst = (
            f"{rows[0].run.controller_name} {'/'.join(sorted({row.run.position for row in rows}))}"
            for rows in found.by_run
        )
        text.append(f"The start position is unknown; largest damage from {', '.join(worst)}.")
    return text


def fatigue_figure(found: Fatigue) -> Figure:
    """Ranges of the cycles of a start over their number, of the most damaged shaft; lives of all shafts."""
    runs = sorted(found.by_run, key=lambda rows: -min(row.relative for row in rows))
    names, units = [rows[0].run.controller_name for rows in runs], units_of(found.drive)
    colours = strategy_colours(names)
    with drawing():
        figure, (left, right) = new_figure(1, 2, (9.0, 1.9 + 0.28 * max(6, len(runs))))
        for index, (rows, name) in enumerate(zip(runs, names, strict=True)):
            line = line_of(index, dashed=True) | {"color": colours[name][0]}
            spectrum = max(rows, key=lambda row: row.equivalent_torque).spectrum
            counts = np.concatenate([[0.5], np.cumsum(spectrum[:, 2])])
            ranges = np.concatenate([spectrum[:1, 0], spectrum[:, 0]])
            left.step(counts, units.shown(ranges, "N*m"), where="pre", label=name, **line)
            lives = [row.relative for row in rows if math.isfinite(row.relative)]
            marker = MARKERS[index % len(MARKERS)]
            right.plot(lives, [index] * len(lives), marker, color=line["color"], ms=8)
        left.set_xscale("log")
        left.set_ylim(bottom=0.0)
        left.legend(fontsize=8)
        up = f"range of the shaft torque, {units.label('N*m')}"
        head(left, "cycles of one start", up, "cycles of at least this range")
        right.axvline(1.0, color=GREY, lw=0.8, ls=":")
        right.set_xscale("log")
        right.set_yticks(range(len(runs)), names)
        right.invert_yaxis()
        slope = "" if found.curve.slope is None else f", m = {short(found.curve.slope)}"
        estimated = " (estimated)" if found.estimate else ""
        damping = f"damping ratio {100.0 * found.drive.damping_ratio:.2g} %{estimated}"
        head(right, f"{damping}{slope}", "", "life over that of direct")
        entitle(figure, titled(found.drive.name, units))
    return figure


def fatigue_sheet(found: Fatigue, rows: Sequence[Life] = (), fitted_to: Machine | None = None) -> Sheet:
    """What is shown of lives; `rows` are its rows in another order."""
    files: dict[str, str | Writer] = {}
    stems: list[str] = []
    several = len(found.drive.shaft_names) > 1
    for row in found.rows:
        shaft = f" shaft {row.shaft + 1}" if several else ""
        stems.append(stem := file_stem(f"{row.run.controller_name}{shaft}", stems))
        times, torques = row.turning_points.T.tolist()
        files[f"spectrum-{stem}.csv"] = rows_file(SPECTRUM, row.spectrum.tolist())
        files[f"turning-points-{stem}.csv"] = columns_file({"time s": times, "shaft torque N m": torques})
    left_out = {"spectrum", "relative_life_range"}
    records = [{k: v for k, v in row.summary().items() if k not in left_out} for row in found.rows]
    return Sheet(
        titled(f"{found.drive.name}: life of the shaft line", units_of(found.drive)),
        machine_lines(found.drive, fitted_to),
        tables=fatigue_tables(found, rows or found.rows),
        conclusions=[fatigue_conclusion(found)],
        notes=fatigue_notes(found),
        figures={"fatigue": lambda: fatigue_figure(found)},
        files={"fatigue.csv": records_file(records), **files},
        machine=found.drive,
        records=records,
        fitted_to=fitted_to,
    )
