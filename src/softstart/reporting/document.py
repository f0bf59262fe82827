"""The report as one HTML page: the templates beside this file, and the tables that they show."""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from jinja2 import Environment, FileSystemLoader, StrictUndefined, pass_context
from markupsafe import Markup, escape
from matplotlib.patches import Rectangle

from softstart.drive import Machine, plausibility
from softstart.errors import fact_of, listed
from softstart.input.parameters import Parameter
from softstart.quantities import Units
from softstart.reporting import choice, limit, sheet_view
from softstart.reporting.inverters import inverters
from softstart.start import fatigue
from softstart.start.comparison import Comparison
from softstart.start.recommendation import SLOW
from softstart.start.resolution import rated_torque
from softstart.vibration import natural_vibration
from softstart.views import beside, chains, drives, duties, starts, traces
from softstart.views import fatigue as lives
from softstart.views.drawing import COLOURS, SMALL, colour_scale, drawing, heat_map, panels, svg_of, verbatim
from softstart.views.numbers import (
    RPM,
    Column,
    DataColumn,
    TextTable,
    at_output,
    cut,
    digits,
    fixed,
    gear_in_words,
    percent,
    printed,
    short,
    unit,
    units_for,
    units_of,
)
from softstart.views.optima import REACTS, best_start
from softstart.views.sheet import html_table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from softstart.reporting.result import Report
    from softstart.start.duty_comparison import DutyRow
    from softstart.start.recommendation import Row

HERE = Path(__file__).parent
HIDDEN = ("name", "source", "assumed", "units", "noise_seed", "encoder_phase")
OWN_SECTION = ("duty", "shift")  # tables of a machine that are shown with the duty
LEFT_OUT = (
    "to the limit",
    "impact\nenergy J",
    "start\ntime s",
    "settled\ns",
)  # columns of the steps of a duty
MOST_SHAFTS = 6  # with a column each in a table
LONGEST = 70  # characters of a name in the head of a page
HARMED = 0.05  # rounded values that cost more than this share of K_dyn or start time are told at once
FUNCTIONS = {
    "limit": "torque limit",
    "braking": "torque limit, generating",
    "reference": "torque reference",
    "backlash": "torque limit after a change of direction, and its ramp",
    "ramp": "ramp and S-curve of the speed reference",
    "preload": "torque before the brake opens, and its ramp",
}
_BEFORE_UNIT = re.compile(
    r"(?<=[\d,]) (?=(?:k?N\xa0m|kg\xa0m|lbf|ms|s|rad|deg|arcmin|rpm|mm|Hz|kW|W|%)(?!\w))"
)
_KEY = re.compile(r"\b[a-z]+(?:_[a-z]+)+(?= \d| settles)")  # of a parameter, before its value
_DECIMAL = re.compile(r"(?<![\w.])(x?\d+)\.(\d+)(?![\w]|\.\d)")


def typeset(text: object, comma: bool = False) -> Markup:
    """A text as HTML: no break before a unit, K_dyn is set as such, keys are words; decimal commas if asked.

    >>> print(typeset("K_dyn < 0.98 in 1 s, full_torque 62", comma=True).replace("\\xa0", "~"))
    K<sub>dyn</sub> &lt; 0,98 in 1~s, full torque 62
    """
    if isinstance(text, Markup):
        return text
    shown = re.sub(r"\b(k?N|kg) m(?=\b|²)", "\\1\xa0m", "" if text is None else str(escape(text)))
    shown = _KEY.sub(lambda key: key[0].replace("_", " "), shown)
    shown = with_comma(_BEFORE_UNIT.sub("\xa0", shown), comma)
    return Markup(shown.replace("K_dyn", "K<sub>dyn</sub>"))


def with_comma(text: str, comma: bool) -> str:
    """A text with decimal commas if asked; version numbers stay as they are.

    >>> with_comma("exceeded x2.17, J2 x0.4, softstart 0.1.0", True)
    'exceeded x2,17, J2 x0,4, softstart 0.1.0'
    """
    return _DECIMAL.sub(r"\1,\2", text) if comma else text


def css_string(text: str) -> Markup:
    """Any text as a string of CSS that ends nowhere but at its end, cut where it is too long.

    >>> print(css_string('a"</style>'))
    "a\\22 \\3c \\2f style\\3e "
    """
    written = (
        c if c.isascii() and (c.isalnum() or c == " ") else f"\\{ord(c):x} " for c in cut(text, LONGEST)
    )
    return Markup('"{}"').format(Markup("".join(written)))


def times(seconds: Iterable[float]) -> str:
    """Start times in words, each once, or how many there are."""
    words = [f"{digits(t)} s" for t in seconds]
    return f"{len(words)} start times" if len(set(words)) > 4 else listed(list(dict.fromkeys(words)))


def table(
    comma: bool,
    title: str,
    heads: str,
    rows: Sequence[Sequence[str]],
    look: str = "",
    strong: Sequence[str] = (),
) -> Markup:
    """A table with its heads in one text, those of numbers with # before them; see `view`."""
    columns = [Column(head.removeprefix("#"), head.startswith("#")) for head in heads.split("|")]
    return view(comma, TextTable(title, columns, rows), look, strong)


def view(comma: bool, shown: TextTable, look: str = "", strong: Sequence[str] = ()) -> Markup:
    """A table of a view; rows whose first cell is one of `strong` stand out."""
    bold = [index for index, row in enumerate(shown.rows) if row[0] in strong]
    cells = html_table(shown._replace(bold=bold), look, lambda text: typeset(text, comma))
    return Markup(f'<div class="wide">{cells}</div>')


def seen(value: float, units: Units, si: str, text: Callable[[float], str] = digits) -> str:
    """A value in SI at the motor shaft as it is seen, with its unit as a page has it.

    >>> seen(1500.0, Units(torque="kN*m"), "N*m/rad")
    '1.500 kN m/rad'
    """
    return f"{text(float(units.shown(value, si)))} {unit(units.of(si))}"


def exact(value: float, units: Units, si: str) -> str:
    """As `seen`, in as many digits as in the terminal."""
    return seen(value, units, si, lambda one: printed(short(one)))


FILTERS = {
    "digits": digits, "fixed": fixed, "short": lambda value: printed(short(value)),
    "percent": percent, "listed": listed, "times": times, "factor": lives.factor,
    "printed": printed, "fact": fact_of, "seen": seen, "exact": exact,
    "css_string": css_string,
    "capital": lambda text: text[0].upper() + text[1:], "short3": lambda value: f"{value:.3g}",
    "short4": lambda value: printed(short(float(f"{value:.4g}"))),
}  # fmt: skip


def templates() -> Environment:
    """The templates of the report, which escape all text."""
    found = Environment(
        loader=FileSystemLoader(HERE), autoescape=True, trim_blocks=True, lstrip_blocks=True,
        undefined=StrictUndefined, extensions=["jinja2.ext.do"],
    )  # fmt: skip
    found.filters |= FILTERS
    found.tests |= {"nan": math.isnan, "finite": math.isfinite}
    found.globals |= {
        "SAME": choice.SAME, "HARMED": HARMED, "POSITIONS": drives.POSITIONS, "GAPS": choice.GAPS,
        "INERTIAS": choice.INERTIAS, "SLOW": SLOW, "TIGHT": limit.TIGHT, "RPM": RPM, "REACTS": REACTS,
        "DEFAULT_SLOPE": fatigue.DEFAULT_SLOPE,
        "load_kind": lambda two, units: drives.load_kind(two, lambda one: exact(one, units, "N*m")),
    }  # fmt: skip
    return found


def text_answer(report: Report) -> str:
    """The answer without HTML."""
    return Markup(
        templates().get_template("answer.html.j2").render(report=report, choice=report.choice)
    ).striptags()


def document(report: Report) -> str:
    """The whole file."""
    drive, comma, positions = report.drive, report.project.decimal == "comma", list(report.drive.positions)
    plain, units = templates(), units_of(report.drive)

    @pass_context  # else constants are escaped before they come here
    def finalize(_: object, text: object) -> Markup:
        return typeset(text, comma)

    page = plain.overlay(finalize=finalize)

    def svg(figure: Figure, key: str, title: str) -> Markup:
        return in_page(svg_of(figure, key, title))

    def in_page(text: str) -> Markup:
        return Markup(re.sub(r">[^<]+<", lambda found: with_comma(found[0], comma), text))

    def scheme() -> Markup:
        return in_page(plain.get_template("scheme.svg.j2").render(drive=drive, units=units))

    several, what = len(drive.shaft_names) > 1, drive.WHAT.removeprefix("a ")
    asked = several or drive.limits.fatigue is not None  # for lives
    lasts = asked and not isinstance(report.lives, str)
    sections = {
        "recommendation": "Recommendation",
        "strategies": "The strategies compared",
        "beside": "Two machines side by side" if report.beside else "",
        "traces": "Torques of each start",
        "shafts": "Torques of the shafts" if several else "",
        "drive": f"The {what}",
        "limit": "Lower bound and optimum",
        "robustness": "Robustness to wear and load" if report.choice.mapped else "",
        "sheets": "Parameter sheets for the inverter",
        "life": "Fatigue life of the shaft line" if lasts else "",
        "duty": "" if drive.duty is None else "Duty: stops, reversals, jogs and the life of a shift",
        "validity": "Assumptions and validity",
        "provenance": "About this document",
    }
    values = {
        "report": report, "drive": drive, "choice": report.choice, "limit": report.limit, "what": what,
        "no_lives": report.lives if asked and not lasts else "",
        "project": report.project, "sections": [(key, title) for key, title in sections.items() if title],
        "several": several, "few": len(drive.shaft_names) <= MOST_SHAFTS,
        "geared": drive.gear is not None and not units.gear, "gear_in_words": gear_in_words(drive),
        "shown": report.choice.shown, "cases": list(report.comparison.rows[0].worst_case),
        "ends": starts.both_ends(report.comparison),
        "plausibility_warnings": plausibility.plausibility_warnings(drive), "units": units,
        "rated": rated_torque(drive.design_drive), "shown_until": traces.shown_until(report.ordered),
        "position": positions[0] if len(positions) == 1 else "unknown",
        "natural_vibration": natural_vibration,
        "drive_file": re.sub(r" *#[^\"\n]*$", "", report.provenance["drive"], flags=re.MULTILINE),
        "inverters": inverters(), "sheet_view": sheet_view,
        "table": partial(table, comma), "view": partial(view, comma),
        "number": itertools.count(1).__next__, "svg": svg, "scheme": scheme,
        "at_output": at_output, "best_start": best_start, "traces": traces, "limit_figure": limit_figure,
        "maps_figure": maps_figure, "starts": starts,
        "chains": chains, "beside": beside, "lives": lives, "duties": duties, "duty_steps": duty_steps,
        "output": f"|#at the output, {units.label('N*m')}" if drive.gear and not units.gear else "",
        "strategies": strategies, "equal_time": equal_time,
        "data_of": data_of, "functions": functions(report), "start_in_words": start_in_words,
        "drive_lines": drives.drive_lines, "curves": list(drives.curves(drive)),
    }  # fmt: skip
    with drawing():  # a name may have characters that the font of the figures has not
        return page.get_template("report.html.j2").render(values)


def start_in_words(drive: Any, rows: Sequence[Row] = ()) -> str:
    """Where the starts of a figure begin, and at which shaft they are seen; each of `rows` from its worst.

    >>> from softstart import Drive
    >>> start_in_words(Drive.load("crane-4amtkf"))
    'Start in the middle of the gap; torques and speeds at the motor shaft.'
    """
    units, (first, *others) = units_of(drive), drive.positions
    where = f"Start {drives.POSITIONS[first]}" if first else ""
    if others:
        each = [f"{row.name} {drives.POSITIONS[row.run.position]}" for row in rows]
        worst = listed(each) if rows else "the worst of both flanks and the middle counts"
        where = f"Start position unknown: {worst}"
    where = where or f"Start at a twist of {digits(units.shown(float(drive.theta0), 'rad'))} {units.angle}"
    return f"{where}; torques and speeds at the {'output' if units.gear else 'motor'} shaft."


def limit_figure(report: Report) -> Figure:
    """K_dyn against start time: the bound below which no start is possible, optima, every strategy."""
    rows = [row for row in report.comparison.rows if not math.isnan(row.run.start_time)]
    curve = report.limit
    return traces.trade_off_figure(
        [(row.name, row.run.start_time, row.run.k_dyn) for row in rows],
        filled=[index for index, row in enumerate(rows) if row in report.choice.foremost],
        optima=[(p.start_time_bound, p.k_dyn) for p in curve.found if p.k_dyn is not None],
        best=f"{best_start(report.drive)} found",
        bound=list(zip(curve.times, curve.bounds, strict=True)),
    )


def maps_figure(report: Report) -> Figure:
    """K_dyn over gap and load inertia, one map a strategy, all in one scale of colours."""
    drive, units = report.drive.design_drive, units_of(report.drive)
    maps = {row.name: report.choice.maps[row.name] for row in report.choice.mapped}
    first = next(iter(maps.values()))
    gaps = [f"{units.shown(gap, 'rad'):.4g}" for gap in first.gaps]
    inertias = [f"{units.shown(inertia, 'kg*m^2'):.3g}" for inertia in first.inertias]
    # the cell of the drive as it is
    i, j = (
        min(range(len(axis)), key=lambda k: abs(axis[k] - value))
        for axis, value in ((first.gaps, float(drive.gap)), (first.inertias, float(drive.J2)))
    )
    scale = colour_scale(*(one.k_dyn for one in maps.values()))
    with drawing():
        size = (3.5, 0.7 + 0.22 * max(len(gaps), 2))
        figure, axes = panels(
            len(maps), size, 2, f"load inertia J2{units.at}, kg m²", f"gap{units.at}, {units.angle}"
        )
        for panel, (name, one) in zip(axes, maps.items(), strict=True):
            heat_map(panel, inertias, gaps, one.k_dyn, scale, decimals=2)
            box = Rectangle((j - 0.5, i - 0.5), 1.0, 1.0, fc="none", ec=COLOURS[1], lw=2.0, zorder=5)
            panel.add_patch(box)
            worst = f"worst {one.worst:.3f}" if math.isfinite(one.worst) else "grey: no start"
            panel.set_title(f"{verbatim(name)}: {worst}", loc="left", fontsize=SMALL)
    return figure


def strategies(report: Report) -> TextTable:
    """The figures of all strategies, by K_dyn."""
    rows, gear, units = report.ordered, report.drive.gear, units_of(report.drive)
    there = units._replace(gear=gear)
    heading = f"at the\noutput\n{units.label('N*m')}"
    output = DataColumn(heading, lambda row: there.shown(row.run.peak_torque, "N*m"))
    shown = (
        *starts.PEAK_COLUMNS, *([output] if gear and not units.gear else []), *starts.of_the_unknown(rows),
        starts.START_TIME, *starts.TIME_COLUMNS, starts.CONTACTS,
    )  # fmt: skip
    # a digit more than a terminal holds
    exact = [one._replace(digits=one.digits + 1) if one.decimals is None else one for one in shown]
    return starts.comparison_table(rows, exact, "Strategies on this drive, by K_dyn")


def equal_time(comparison: Comparison) -> TextTable:
    """The strategies at equal time, by K_dyn, with the values that set their time."""
    rows = sorted(comparison.rows, key=lambda row: row.run.k_dyn)
    title = f"At equal time: settled within {comparison.at_time:.4g} s, by K_dyn"
    return starts.comparison_table(rows, (*starts.PEAK_COLUMNS, *starts.TIME_COLUMNS), title)


def duty_steps(row: DutyRow) -> TextTable:
    """The steps of a duty under a strategy, with the columns for which a page has room."""
    run = row.run
    assert run is not None
    columns = [one for one in duties.step_columns(run, row.life) if one.heading not in LEFT_OUT]
    return TextTable.of_data(
        "Steps", columns, run.rows, units_of(run.drive), bold=[run.worst.number - 1], keys=2
    )


def functions(report: Report) -> list[tuple[str, str]]:
    """The functions of inverters that these sheets need: keys and names."""
    low = min((float(np.min((sheet.rounded or sheet.exact).u)) for sheet in report.sheets), default=0.0)
    left_out = {"braking"} if low >= 0.0 else set()
    left_out |= {"preload"} if report.drive.design_drive.brake != "motor" else set()
    return [(key, name) for key, name in FUNCTIONS.items() if key not in left_out]


def there_of(drive: Machine, parameter: Parameter, numbers: list[float]) -> str:
    """Values of a parameter, as they are seen, at the output of the gear; "" where they have none there."""
    gear = drive.gear
    if gear is None or gear.factor(parameter.unit) is None:
        return ""
    return ", ".join(short(gear.to_output(one, parameter.unit)) for one in numbers)


def of_part(drive: Machine, path: str, parameter: Parameter) -> str:
    """What a parameter means, of a chain with the mass or shaft that has it: "fan: load torque"."""
    table, _, number = path.partition("]")[0].partition("[")
    names = {"mass": drive.mass_names, "shaft": drive.shaft_names}.get(table, ())
    return f"{names[int(number) - 1]}: {parameter.meaning}" if number else parameter.meaning


def data_of(report: Report) -> tuple[str, list[list[str]], list[str]]:
    """What is known of the drive and from where: heads and rows of the table, and what is absent."""
    project, gear, at_output = report.project, report.drive.gear, bool(units_of(report.drive).gear)
    rows, absent = list[list[str]](), list[str]()
    for path, (parameter, value) in report.drive.parameters_by_path().items():
        if parameter.table in OWN_SECTION:
            continue
        source, si, meaning = project.source_of(path), parameter.unit, of_part(report.drive, path, parameter)
        if value is None or value == "" or parameter.name in HIDDEN:
            continue
        if value == parameter.default and not source:
            absent += [meaning] if value == 0.0 else []
            continue
        units = units_for(report.drive, parameter)
        of, other, text, there = unit(units.of(si)), "", str(value), ""
        values = value if isinstance(value, tuple) else (value,)
        exact = [v for v in values if isinstance(v, float)]
        numbers = [float(units.shown(v, si)) for v in exact]
        if numbers:
            text, there = ", ".join(map(short, numbers)), there_of(report.drive, parameter, numbers)
            if gear is not None and parameter.at_output == "here":  # and the motor shaft is the other one
                exact = [gear.to_motor(exact[0], si)]
                text, there = (text if at_output else short(gear.to_motor(numbers[0], si))), text
        moved = units.is_at_output(si) or (at_output and parameter.at_output == "here")
        if path == "limits.life":
            hours = value / 3600.0
            text, of, other = digits(hours / fatigue.HOURS_PER_YEAR, 3), "years", f"{short(hours)} h"
        elif numbers and (of != unit(si) or moved):
            other = f"{', '.join(map(digits, exact))} {unit(si)}"
        elif numbers and si == "rad/s":
            other = f"{', '.join(short(float(f'{v * RPM:.6g}')) for v in exact)} rpm"
        elif numbers and si == "rad":
            other = ", ".join(f"{short(float(f'{math.degrees(v):.4g}'))}°" for v in exact)
        meaning = meaning.replace(" at the motor shaft", "") if at_output else meaning
        cells = [meaning, parameter.symbol, text, of if numbers else "", other]
        cells += [f"{there} {of}" if there else ""] if gear and not at_output else []
        rows.append([*cells, source or "not stated"] if project.sources else cells)
    heads = f"parameter|symbol|#value|unit|#{'at the motor shaft' if at_output else 'that is'}"
    heads += "|#at the output shaft" if gear and not at_output else ""
    return heads + ("|source" if project.sources else ""), rows, absent
