"""The report as one HTML page: the templates beside this file, and the tables that they show."""

from __future__ import annotations

import itertools
import math
import re
import tomllib
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup, escape

from softstart.drive import doubts
from softstart.errors import listed
from softstart.optimal.problem import REACTS, best_start
from softstart.reporting import choice, figures, limit
from softstart.reporting.resolution import rated_torque
from softstart.reporting.result import Report
from softstart.reporting.sheet import Sheet
from softstart.start import fatigue
from softstart.start.recommendation import SLOW
from softstart.vibration import natural_vibration
from softstart.views import chain_schemes, chains, drives, printed, starts
from softstart.views import fatigue as lives
from softstart.views.drawing import drawing
from softstart.views.numbers import Table
from softstart.views.printed import at_output, digits, fixed, percent, short, unit

HERE = Path(__file__).parent
HIDDEN = ("name", "source", "assumed", "units", "noise_seed", "encoder_phase")
MOST_SHAFTS = 6  # with a column each in a table
LONGEST = 70  # characters of a name in the head of a page
AS_IT_IS = "the drive as it is"
SAME = 0.005  # a peak within this share of another is the same
HARMED = 0.05  # rounded values that cost more than this share of K_dyn or start time are told at once
FUNCTIONS = {
    "limit": "torque limit",
    "braking": "torque limit, generating",
    "reference": "torque reference",
    "backlash": "torque limit after a change of direction, and its ramp",
    "ramp": "ramp and S-curve of the speed reference",
    "preload": "torque before the brake opens, and its ramp",
}
_BEFORE_UNIT = re.compile(r"(?<=[\d,]) (?=(?:N\xa0m|kg\xa0m|ms|s|rad|deg|rpm|mm|Hz|kW|W|%)(?!\w))")
_DECIMAL = re.compile(r"(?<![\w.])(\d+)\.(\d+)(?![\w]|\.\d)")


def typeset(text: object, comma: bool = False) -> Markup:
    """A text as HTML in which no line ends before a unit, with K_dyn set as such and decimal commas if asked.

    >>> print(typeset("K_dyn < 0.98 in 1 s", comma=True).replace("\\xa0", "~"))
    K<sub>dyn</sub> &lt; 0,98 in 1~s
    """
    if isinstance(text, Markup):
        return text
    shown = re.sub(r"\b(N|kg) m(?=\b|²)", "\\1\xa0m", "" if text is None else str(escape(text)))
    shown = with_comma(_BEFORE_UNIT.sub("\xa0", shown), comma)
    return Markup(shown.replace("K_dyn", "K<sub>dyn</sub>"))


def with_comma(text: str, comma: bool) -> str:
    """A text with decimal commas if asked; version numbers stay as they are."""
    return _DECIMAL.sub(r"\1,\2", text) if comma else text


def for_customer(text: str) -> str:
    """A text without what it tells the author to give.

    >>> for_customer("It depends: give [limits] in a file. Give more; give start.position. Nothing damps.")
    'It depends. Nothing damps.'
    """
    return re.sub(r"(?:[:;] give|\. Give) (?:[^.;]|\.(?=\S))*(?=[.;])", "", text)


def css_string(text: str) -> Markup:
    """Any text as a string of CSS that ends nowhere but at its end, cut where it is too long.

    >>> print(css_string('a"</style>'))
    "a\\22 \\3c \\2f style\\3e "
    """
    text = text if len(text) <= LONGEST else text[: LONGEST - 1] + "\N{HORIZONTAL ELLIPSIS}"
    written = (c if c.isascii() and (c.isalnum() or c == " ") else f"\\{ord(c):x} " for c in text)
    return Markup('"{}"').format(Markup("".join(written)))


def times(seconds: Iterable[float]) -> str:
    """Start times in words, each once, or how many there are."""
    words = [f"{digits(t)} s" for t in seconds]
    return f"{len(words)} start times" if len(set(words)) > 4 else listed(list(dict.fromkeys(words)))


FILTERS = {
    "digits": digits, "fixed": fixed, "short": short, "percent": percent, "listed": listed,
    "times": times, "factor": lives.factor, "printed": printed.printed, "for_customer": for_customer,
    "css_string": css_string,
    "capital": lambda text: text[0].upper() + text[1:], "short4": lambda value: short(float(f"{value:.4g}")),
}  # fmt: skip


def templates() -> Environment:
    """The templates of the report, which escape all text."""
    found = Environment(
        loader=FileSystemLoader(HERE), autoescape=True, trim_blocks=True, lstrip_blocks=True,
        undefined=StrictUndefined,
    )  # fmt: skip
    found.filters |= FILTERS
    found.tests |= {"nan": math.isnan, "finite": math.isfinite}
    found.globals |= {"SAME": SAME, "HARMED": HARMED}
    return found


def answer(report: Report) -> str:
    """The answer without HTML."""
    return Markup(
        templates().get_template("answer.html.j2").render(report=report, choice=report.choice)
    ).striptags()


def document(report: Report) -> str:
    """The whole file."""
    drive, comma, positions = report.drive, report.project.decimal == "comma", list(report.drive.positions)
    plain = templates()
    page = plain.overlay(finalize=lambda text: typeset(text, comma))

    def svg(figure: Any, key: str, title: str) -> Markup:
        return in_page(figures.svg(figure, key, title))

    def in_page(text: str) -> Markup:
        return Markup(re.sub(r">[^<]+<", lambda found: with_comma(found[0], comma), text))

    def scheme() -> Markup:
        return in_page(plain.get_template("scheme.svg.j2").render(drive=drive, units=printed.units_of(drive)))

    several, what = len(drive.shaft_names) > 1, drive.WHAT.removeprefix("a ")
    sections = {
        "recommendation": "The recommendation, and why",
        "strategies": "The strategies compared",
        "traces": "Torques of each start",
        "shafts": "What each shaft carries" if several else "",
        "drive": f"The {what}",
        "limit": "How gentle could a start be?",
        "robustness": "When the gap wears and the load changes" if report.choice.mapped else "",
        "sheets": "Parameter sheets for the inverter",
        "life": "How long the shaft line lasts" if several or drive.limits.fatigue is not None else "",
        "validity": "What this report assumes, and where it holds",
        "provenance": "About this document",
    }
    values = {
        "report": report, "drive": drive, "choice": report.choice, "limit": report.limit, "what": what,
        "project": report.project, "sections": [(key, title) for key, title in sections.items() if title],
        "several": several, "few": len(drive.shaft_names) <= MOST_SHAFTS, "tables": Tables(report),
        "shown": report.choice.shown, "cases": list(report.comparison.rows[0].worst_case),
        "doubts": doubts.doubts(drive), "units": printed.units_of(drive), "most_torque": report.most_torque,
        "rated": rated_torque(drive.design_drive), "shown_until": figures.shown_until(report.ordered),
        "position": positions[0] if len(positions) == 1 else "unknown",
        "natural_vibration": natural_vibration,
        "drive_file": re.sub(r" *#[^\"\n]*$", "", report.provenance["drive"], flags=re.MULTILINE),
        "inverters": inverters(), "number": itertools.count(1).__next__, "svg": svg, "scheme": scheme,
        "chain_scheme": lambda: in_page(chain_schemes.scheme_svg(drive)), "at_output": at_output,
        "best_start": best_start, "figures": figures, "starts": starts, "chains": chains, "lives": lives,
        "drive_lines": drives.drive_lines, "POSITIONS": drives.POSITIONS, "GAPS": choice.GAPS,
        "INERTIAS": choice.INERTIAS, "SLOW": SLOW, "TIGHT": limit.TIGHT, "REACTS": REACTS,
        "DEFAULT_SLOPE": fatigue.DEFAULT_SLOPE,
    }  # fmt: skip
    with drawing():  # a name may have characters that the font of the figures has not
        return page.get_template("report.html.j2").render(values)


def inverters() -> dict[str, Any]:
    """Names of functions in manuals, and what a parameter means at an inverter."""
    return tomllib.loads((HERE / "inverters.toml").read_text("utf-8"))


class Tables:
    """The tables of a report."""

    def __init__(self, report: Report) -> None:
        self.report, self.drive, self.choice = report, report.drive, report.choice
        self.geared = report.drive.gear_ratio is not None

    def _at_output(self, torques: Sequence[float]) -> dict[str, list[str]]:
        """A column of torques at the output shaft, where a gear ratio is known."""
        return {"at the output, N m": [at_output(self.drive, one) for one in torques]} if self.geared else {}

    def verdicts(self) -> Table:
        """Pass or fail of direct and of the chosen strategy, limit by limit, in the worst case."""
        rows, cells = self.choice.shown, []
        for row in rows:
            for one in row.margins(self.choice.recommendation.limits):
                left = (
                    percent(one.share) if not one.share < -1.0 else f"{1.0 - one.share:.3g} times the limit"
                )
                verdict = Markup('<b class="{0}">{0}</b>').format("pass" if one.kept else "fail")
                cells.append([row.name, f"{one.name}, {one.unit}", digits(one.value), digits(one.limit), left,
                              one.case or AS_IT_IS, verdict])  # fmt: skip
        heads = ("strategy", "limit", "worst value", "permitted", "margin", "worst with", "verdict")
        worst = listed([AS_IT_IS, *rows[0].worst_case])
        return _table(
            f"Pass or fail, in the worst of {worst}",
            heads,
            cells,
            ("strategy", "limit", "worst with", "verdict"),
        )

    def choices(self) -> Table:
        """Direct, what an ordinary inverter can do, and the strategies that no other one beats."""
        ordinary = [self.choice.ordinary] if self.choice.ordinary else []
        found = dict.fromkeys([self.choice.direct, *ordinary, *self.choice.recommendation.shown])
        rows = sorted(found, key=lambda row: (row.effort.order, -row.run.k_dyn))
        cells = {
            "strategy": [row.name for row in rows],
            "takes": [row.effort.meaning for row in rows],
            "peak torque, N m": [digits(row.run.peak_torque) for row in rows],
            **self._at_output([row.run.peak_torque for row in rows]),
            "less than direct": [self.report.share_saved(row) for row in rows],
            "K_dyn": [fixed(row.run.k_dyn, 3) for row in rows],
            "start time, s": [digits(row.run.start_time) for row in rows],
        }
        return Table.of("What more effort buys", cells, ("strategy", "takes"))

    def rule(self) -> Table:
        """The verdict on every strategy."""
        choice, rows = self.choice, self.choice.comparison.rows
        cells = [
            [
                r.name,
                r.run.controller.summary,
                r.effort.meaning,
                fixed(choice.worst(r), 3),
                choice.recommendation.verdict(r),
            ]
            for r in sorted(rows, key=lambda row: (row.effort.order, row.run.k_dyn))
        ]
        heads = [
            "strategy",
            "what it does",
            "takes",
            "worst K_dyn on the map" if choice.maps else "K_dyn",
            "verdict",
        ]
        texts = ("strategy", "what it does", "takes", "verdict")
        return _table("Every strategy before the rule, in the order of effort", heads, cells, texts)

    def strategies(self) -> Table:
        """The figures of all strategies, the gentlest first."""
        rows = self.report.ordered
        output = starts.Figure(
            "at the\noutput\nN m", lambda row: row.run.peak_torque * float(self.drive.gear_ratio)
        )
        columns = (
            *starts.GENTLE, *([output] if self.geared else []),
            *(starts.INTERVALS if rows[0].intervals else []), starts.TIMES[0], *starts.QUICK,
            starts.TIMES[1], starts.AT_THE_GAP[-1],
        )  # fmt: skip
        return starts.comparison_table(rows, columns, "Strategies on this drive, the gentlest first")

    def shafts(self) -> Table:
        """K_dyn of each shaft of a chain under all strategies."""
        of_shafts = starts.details(self.drive)[: len(self.drive.shaft_names)]
        return starts.comparison_table(self.report.ordered, of_shafts, "K_dyn of each shaft")

    def data(self) -> tuple[Table, list[str]]:
        """What is known of the drive and from where, and what is absent."""
        project, units, rows, absent = self.report.project, printed.units_of(self.drive), [], []
        for path, (parameter, value) in self.drive.by_path().items():
            source, si = project.source_of(path), parameter.unit
            if value is None or value == "" or parameter.name in HIDDEN:
                continue
            if value == parameter.default and not source:
                absent += [parameter.meaning] if value == 0.0 else []
                continue
            of, other, text, there = unit(units.of(si)), "", str(value), ""
            numbers = [
                units.shown(v, si)
                for v in (value if isinstance(value, tuple) else [value])
                if isinstance(v, float)
            ]
            if numbers:
                text, there = ", ".join(map(short, numbers)), at_output(self.drive, numbers[0], si)
            if path == "limits.life":
                hours = value / 3600.0
                text, of, other = digits(hours / fatigue.HOURS_PER_YEAR, 3), "years", f"{short(hours)} h"
            elif numbers and of != unit(si):
                other = f"{digits(value)} {unit(si)}"
            elif si == "rad/s":
                other = f"{short(float(f'{value * printed.RPM:.6g}'))} rpm"
            elif si == "rad" and numbers:
                other = f"{short(float(f'{math.degrees(value):.4g}'))}°"
            cells = [parameter.meaning, parameter.symbol, text, of if numbers else "", other]
            cells += [f"{there} {of}" if there else ""] if self.geared else []
            rows.append([*cells, source or "not stated"] if project.sources else cells)
        heads = ["parameter", "symbol", "value", "unit", "that is"]
        heads += [*(["at the output shaft"] if self.geared else []), *(["source"] if project.sources else [])]
        texts = ("parameter", "symbol", "unit", "source")
        return _table("Data of the drive, at the motor shaft", heads, rows, texts), absent

    def near(self) -> Table:
        """Each strategy beside the bound and the lowest K_dyn known in its own start time."""
        rows, bounded = [], bool(self.report.limit.bounds)
        for row in self.report.ordered:
            run, bound, known = row.run, self.report.lower_bound(row), self.report.lowest_known(row)
            best = self.report.limit.optimum_at(run.start_time)
            is_best = best is not None and best.k_dyn == known
            cells = [row.name, digits(run.start_time), fixed(run.k_dyn, 3)]
            cells.append(fixed(known, 3) + (f" ({best_start(self.drive)})" if is_best else ""))
            cells.append(fixed(run.k_dyn / known if known else None, 2))
            cells += [fixed(bound, 3), fixed(run.k_dyn / bound if bound else None, 2)] if bounded else []
            rows.append(cells)
        heads = ["strategy", "start time, s", "K_dyn", "lowest known in that time", "times the lowest known"]
        heads += ["lower bound at that time", "times the bound"] if bounded else []
        title = "How near each strategy comes to the limit in its own start time"
        return _table(title, heads, rows, ("strategy",))

    def settings(self, sheet: Sheet) -> Table:
        """What to set at the inverter."""
        rows, explained = [], inverters()["setting"]
        for one in sheet.settings:
            more = " of the control code" if one.name == "period" else ""
            more += " (not rounded)" if one.step is None and isinstance(one.exact, float) and not more else ""
            note = Markup("<small>; {}</small>").format(explained[one.name]) if one.name in explained else ""
            meaning = Markup("{}{}").format(typeset(one.meaning + more), note)
            rows.append([one.name.replace("_", " "), meaning, *one.shown(self.drive.design_drive)])
        heads = ["parameter", "meaning, and what it is at the inverter", "set to", "unit", "that is", "exact"]
        return _table(f"Parameter sheet: {sheet.name}", heads, rows, (*heads[:2], "unit", "that is"))

    def outcome(self, sheet: Sheet) -> Table:
        """The starts with the exact, the rounded, and the worst values."""
        named = {"exact values": sheet.exact, "rounded values, as in the sheet": sheet.rounded}
        found = {name: (r.k_dyn, r.peak_torque, r.start_time) for name, r in named.items() if r is not None}
        if sheet.variants:
            found["worst with the values half a step off"] = (
                sheet.worst_k_dyn,
                sheet.worst_peak,
                sheet.slowest,
            )
        cells = {
            "start with": list(found),
            "K_dyn": [fixed(k_dyn, 4) for k_dyn, _, _ in found.values()],
            "peak torque, N m": [digits(peak) for _, peak, _ in found.values()],
            **self._at_output([peak for _, peak, _ in found.values()]),
            "start time, s": [digits(time, 5) for _, _, time in found.values()],
        }
        return Table.of(f"{sheet.name}: started again after rounding", cells, ("start with",))

    def families(self) -> Table:
        """Where inverters have what the sheets name: names as public manuals print them, and no others."""
        low = min(float(np.min((sheet.rounded or sheet.exact).u)) for sheet in self.report.sheets)
        left_out = {"braking"} if low >= 0.0 else set()
        left_out |= {"preload"} if self.drive.design_drive.brake != "motor" else set()
        line, rows = Markup("{}: <code>{}</code>"), []
        for number, family in enumerate(inverters()["family"], start=1):
            if asked := [key for key in FUNCTIONS if key in family and key not in left_out]:
                lines = Markup("<br>").join(line.format(FUNCTIONS[key], family[key]) for key in asked)
                rows.append([f"{family['name']} [{number}]", lines])
        heads = ["inverter", "functions, with the names in its manual"]
        return _table("Where to set it: names of these functions in manuals", heads, rows, heads)

    def lives(self) -> Table:
        """The life of the shaft line under each strategy, of several shafts that of each."""
        found = self.report.lives
        assert not isinstance(found, str)
        if len(self.drive.shaft_names) > 1:
            return lives.fatigue_tables(found, found.rows)[0]
        rows = sorted(found.rows, key=lambda row: -row.relative)
        return lives.fatigue_table(found, rows, "Life of the shaft line under each strategy")

    def revisions(self) -> Table:
        """What has changed from one revision to the next."""
        heads = ["revision", "date", "author", "change"]
        return _table("Revisions", heads, [[*one.values()] for one in self.report.project.revisions], heads)

    def approval(self) -> Table:
        """Who made, checked and approved the report."""
        project = self.report.project
        signed = [
            ["made by", project.author],
            ["checked by", project.checked],
            ["approved by", project.approved],
        ]
        heads = ["", "name, date", "signature"]
        return _table("Approval", heads, [[*one, ""] for one in signed], heads)


def _table(title: str, heads: Sequence[str], rows: Sequence[Sequence[str]], texts: Sequence[str]) -> Table:
    """A table of rows; columns with these `texts` as heads hold text."""
    return Table.of(title, {head: [row[k] for row in rows] for k, head in enumerate(heads)}, texts)
