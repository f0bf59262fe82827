"""The report as one HTML page, and the answer at its head in plain sentences."""

from __future__ import annotations

import math
import re
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from softstart.errors import listed
from softstart.reporting.choice import Candidate, Choice, choice_section
from softstart.reporting.drive_section import drive_section
from softstart.reporting.first_page import before_after_picture, before_and_after, first_page
from softstart.reporting.limit import limit_section
from softstart.reporting.markup import (
    Figures,
    Html,
    css_string,
    html,
    joined,
    table,
    tag,
    typeset,
    with_comma,
)
from softstart.reporting.project import Project
from softstart.reporting.result import Provenance, Report
from softstart.reporting.robustness import GAPS, INERTIAS, life_chapter, maps_picture, robustness_section
from softstart.reporting.shafts import chain_section, sentences, shafts_section
from softstart.reporting.sheet import sheet_section
from softstart.reporting.strategies import (
    for_customer,
    ordered,
    strategies_section,
    trace_groups,
    traces_picture,
    traces_section,
)
from softstart.start.comparison import Comparison
from softstart.views.drives import POSITIONS
from softstart.views.printed import digits, fixed, short, units_of

SAME = 0.005  # a peak within this share of another is the same
HARMED = 0.05  # rounded values that cost more than this share of K_dyn or start time are told at once
LONGEST = 70  # letters of a name in the head of a page
GUARD = "default-src 'none'; style-src 'unsafe-inline'"  # whatever stands in the file, nothing is loaded


def pictures(choice: Choice, comparison: Comparison) -> dict[str, Html]:
    """The figures that do not wait for the limit, by their keys: what is drawn while that is looked for."""
    with _any_script():
        made = {
            key: traces_picture(key, comparison.rows, some) for key, some, _ in trace_groups(comparison.rows)
        }
        made["before-after"] = before_after_picture(before_and_after(choice, comparison))
        if choice.mapped:
            made["maps"] = maps_picture(comparison.drive, choice.mapped)
        return made


@contextmanager
def _any_script() -> Iterator[None]:
    """A name may have letters that the font of the figures has not."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Glyph .* missing from", UserWarning)
        yield


def document(report: Report) -> str:
    """The whole file."""
    with _any_script():
        text = typeset(_document(report))
    return with_comma(text) if report.project.decimal == "comma" else text


def _document(report: Report) -> str:
    drive, choice, rows, project = report.drive, report.choice, report.comparison.rows, report.project
    figures = Figures(report.pictures)
    chosen = [one.row for one in (choice.chosen, choice.ordinary) if one is not None]
    best, what = choice.chosen.name if choice.chosen else "", drive.WHAT.removeprefix("a ")
    first = first_page(report, figures)
    several = len(drive.shaft_names) > 1
    shown = list(dict.fromkeys(reversed(before_and_after(choice, report.comparison))))
    sections: list[tuple[str, str, Html]] = [
        ("recommendation", "The recommendation, and why", choice_section(choice, answer(report))),
        (
            "strategies",
            "The strategies compared",
            strategies_section(drive, rows, chosen, report.failed),
        ),
        ("traces", "Torques of each start", traces_section(rows, figures)),
        *(
            [("shafts", "What each shaft carries", shafts_section(ordered(rows), shown, figures))]
            if several
            else []
        ),
        (
            "drive",
            f"The {what}",
            chain_section(drive, figures) if several else drive_section(drive, project, figures),
        ),
        ("limit", "How gentle could a start be?", limit_section(drive, choice, report.limit, figures)),
        *(
            [
                (
                    "robustness",
                    "When the gap wears and the load changes",
                    robustness_section(drive, choice.mapped, figures),
                )
            ]
            if choice.mapped
            else []
        ),
        (
            "sheets",
            "Parameter sheets for the inverter",
            sheet_section(drive.design_drive, report.sheets, report.resolution, best, choice.role),
        ),
        *life_chapter(report.lives),
        ("validity", "What this report assumes, and where it holds", validity_section(report)),
        ("provenance", "About this document", provenance_section(report.provenance, project, what)),
    ]
    return page(str(drive.name), project, report.provenance.made, first, sections)


def page(
    name: str, project: Project, made: str, first: Html, sections: Sequence[tuple[str, str, Html]]
) -> str:
    """A whole file: head, first page, contents, and numbered sections, each (key, title, content)."""
    contents = tag(
        "nav",
        tag("h2", "Contents", id="contents"),
        tag("ol", joined(tag("li", tag("a", title, href=f"#{key}")) for key, title, _ in sections)),
        aria_labelledby="contents",
    )
    heads = [*project.lines, ("Date", made)]
    names = [tag("div", tag("dt", what), tag("dd", value)) for what, value in heads]
    body = tag(
        "main",
        tag(
            "header",
            tag(
                "img",
                src=project.logo,
                alt=f"Logo of {project.company or project.author}",
            )
            if project.logo
            else None,
            tag("p", "Soft start of a drive with backlash in its transmission", class_="kind"),
            tag("h1", name),
            tag("dl", *names, class_="made"),
        ),
        first,
        contents,
        joined(
            tag(
                "section",
                tag("h2", f"{number}. {title}"),
                content,
                id=key,
            )
            for number, (key, title, content) in enumerate(sections, start=1)
        ),
    )
    guard = GUARD + "; img-src data:" if project.logo else GUARD
    head = tag(
        "head",
        tag("meta", charset="utf-8"),
        tag("meta", http_equiv="Content-Security-Policy", content=guard),
        tag("meta", name="viewport", content="width=device-width, initial-scale=1"),
        tag("meta", name="color-scheme", content="light"),
        tag("title", f"{name}: soft start report"),
        tag("style", Html(style(name, " · ".join(filter(None, (project.number, made))), project.paper))),
    )
    return html(
        Html("<!DOCTYPE html>\n"),
        tag("html", head, "\n", tag("body", body), lang="en"),
        "\n",
    )


def validity_section(report: Report) -> Html:
    """The assumptions behind all figures, and where their data are from."""
    drive, project, motor = report.drive, report.project, report.drive.motor
    motor_is = _motor_sentence(
        float(motor.minimum_torque), float(motor.maximum_torque), float(motor.torque_lag)
    )
    if len(drive.shaft_names) > 1:
        notes = [
            *sentences(drive),
            motor_is,
            "Controllers are set up for the two masses that stand for the chain, and start the chain itself.",
            "The equations are solved as Taylor series from event to event; peaks are located, not read off "
            "a grid.",
        ]
    else:
        notes = [*_of_two_masses(drive, motor_is), *_on_maps(report.choice)]
        notes.append(
            "The equations are solved in closed form from event to event; peaks are located, not read off a "
            "grid. The figures are as good as the data, above all gap, stiffness and inertias."
        )
    guessed = [one.parameter for one in project.sources if one.origin == "guessed"]
    if guessed:
        notes.append(
            f"Guessed, so to be checked before the values of the sheets are used: {listed(guessed)}."
        )
    elif not (project.sources or drive.source):
        notes.append("Where the values of the drive are from is not stated.")
    return tag("ul", joined(tag("li", one) for one in notes), class_="notes")


def _of_two_masses(drive: Any, motor_is: str) -> list[str]:
    units, two, where = units_of(drive), drive.lumped, list(drive.positions)
    damping = (
        f"damping of the shaft: {short(float(two.d))} N m s/rad, proportional to the speed of its twist"
        if two.d
        else "no damping: oscillations do not die out, as those of a real shaft do"
    )
    load = (
        "Load: the load torque acts always, also at rest (a hanging load); its torque and inertia are "
        "constant during the start."
        if two.active
        else "Load: the load torque is friction: it holds the load at rest and opposes its motion; its "
        "torque and inertia are constant during the start."
    )
    begins = (
        f"The start begins {POSITIONS[where[0] if len(where) == 1 else 'unknown']}."
        if where[0]
        else (
            f"The start begins at a twist of {digits(units.shown(float(drive.theta0), 'rad'))} {units.angle}."
        )
    )
    return [
        "Two masses, one elastic shaft, one gap. Elastic modes above the first are not in the model.",
        motor_is,
        f"Contact law: {drive.contact_laws[0]}; {damping}.",
        load,
        begins,
    ]


def _on_maps(choice: Choice) -> list[str]:
    if not choice.mapped:
        return []
    return [
        f"Statements on wear and load hold from {short(GAPS[0])} to {short(GAPS[-1])} times the gap and "
        f"from {short(INERTIAS[0])} to {short(INERTIAS[-1])} times the load inertia, for the values "
        "computed. Other stiffness, damping or load torque was not examined."
    ]


def _motor_sentence(least: float, most: float, lag: float) -> str:
    """What stands for the motor: its torques (N m) and the lag of its torque (s)."""
    follows = f"with a lag of {short(1e3 * lag)} ms" if lag else "without lag"
    return (
        f"The motor is a source of torque from {short(least)} to {short(most)} N m that follows its demand "
        f"{follows}. Currents, fluxes and a motor started directly at the mains are not in the model."
    )


def provenance_section(about: Provenance, project: Project, what: str) -> Html:
    """Revisions, approval, versions, date, command, and the drive's file with all changes."""
    signed = [
        ["made by", project.author, ""],
        ["checked by", project.checked, ""],
        ["approved by", project.approved, ""],
    ]
    libraries = ", ".join(f"{name} {version}" for name, version in about.libraries)
    made = tag("code", f"softstart {about.softstart}, Python {about.python}; {libraries}")
    revisions = [[one.number, one.date, one.author, one.change] for one in project.revisions]
    return html(
        table(
            ["revision", "date", "author", "change"],
            revisions,
            caption="Revisions",
            text_columns=range(4),
        )
        if revisions
        else None,
        table(
            ["", "name, date", "signature"],
            signed,
            caption="Approval",
            text_columns=range(3),
            class_="signed",
        )
        if any(who for _, who, _ in signed)
        else None,
        tag("p", f"Made on {about.made} with ", made, ".", class_="small"),
        tag("p", "Command: ", tag("code", about.command)) if about.command else None,
        tag(
            "p",
            f"The {what} as a file for softstart, with all changes, SI units unless stated:",
            class_="lead",
        ),
        tag("pre", re.sub(r" *#[^\"\n]*$", "", about.drive_toml, flags=re.MULTILINE), class_="file"),
    )


def answer(report: Report) -> str:
    """The paragraph at the head of the report."""
    best = report.choice.chosen
    text = for_customer(report.choice.recommendation.text)
    if best is None:
        return text
    sentences = [
        text,
        _sheet_of(report, best),
        _after_rounding(report, best),
        *_on_an_ordinary_inverter(report),
        _compared(report, best),
    ]
    return " ".join(filter(None, sentences))


def _sheet_of(report: Report, best: Candidate) -> str:
    """Which strategy the figures that follow are those of, where the text names several."""
    several = report.choice.recommendation.recommended is None and len(report.choice.recommendation.best) > 1
    return f"The parameters below are those of the gentlest, {best.name}." if several else ""


def _on_an_ordinary_inverter(report: Report) -> list[str]:
    best, plain = report.choice.chosen, report.choice.ordinary
    if plain is None or plain is best or report.choice.recommendation.limits:
        return []
    run = plain.row.run
    text = (
        f"On an ordinary inverter, one that offers torque ramps and no more, {plain.name} is the best: "
        f"K_dyn {fixed(run.k_dyn, 3)} and {digits(run.start_time)} s."
    )
    return [text, _after_rounding(report, plain)]


def _compared(report: Report, best: Candidate) -> str:
    """What no start, and what the best start known, has in the same time."""
    bound, known = report.lower_bound(best.row), report.lowest_known(best.row)
    if bound is None:
        return ""
    motor = report.drive.motor
    figures = {
        "least": short(float(motor.minimum_torque)),
        "most": short(float(min(motor.starting_torque, motor.maximum_torque))),
        "bound": fixed(math.floor(bound * 1000.0) / 1000.0, 3),
    }
    if known is None or known >= best.row.run.k_dyn * (1.0 - SAME):
        return (
            "For comparison: no motor torque from {least} to {most} N m, however it is controlled, "
            "brings this load to speed in that time with a K_dyn below {bound}."
        ).format(**figures)
    figures["known"] = fixed(math.ceil(known * 1000.0) / 1000.0, 3)
    return (
        "For comparison: no motor torque from {least} to {most} N m, however it is controlled, brings "
        "this load to speed in that time with a K_dyn below {bound}; the gentlest start known has "
        "{known}."
    ).format(**figures)


def _after_rounding(report: Report, one: Candidate) -> str:
    """What the steps of the inverter do to a chosen strategy, where that matters."""
    sheet = next((sheet for sheet in report.sheets if sheet.name == one.name), None)
    if sheet is None:
        return ""
    if sheet.rounded is None:
        return "But its values cannot be set in the steps given."
    exact, rounded = sheet.exact, sheet.rounded
    if math.isnan(rounded.start_time):
        return "But rounded to the steps given, its values do not bring the load to its target speed."
    harm = max(rounded.k_dyn / exact.k_dyn, rounded.start_time / exact.start_time) - 1.0
    if harm > HARMED:
        return (
            "But these are exact values: rounded to the steps given, they make it K_dyn "
            f"{fixed(rounded.k_dyn, 3)} and {digits(rounded.start_time)} s."
        )
    if not max(sheet.worst_k_dyn / exact.k_dyn, sheet.slowest / exact.start_time) - 1.0 <= HARMED:
        if sheet.variants and math.isnan(sheet.worst_k_dyn + sheet.slowest):
            return "But with values half a step off, the load may not reach its target speed."
        if sheet.variants:
            return (
                f"With values half a step off, K_dyn may be {fixed(sheet.worst_k_dyn, 3)} and the "
                f"start time {digits(sheet.slowest)} s."
            )
    return ""


def style(header: str, footer: str, paper: str) -> str:
    """The style sheet with what stands at the head and the foot of each printed page."""
    header = header if len(header) <= LONGEST else header[: LONGEST - 1] + "\N{HORIZONTAL ELLIPSIS}"
    values = {"HEADER": css_string(header), "FOOTER": css_string(footer), "PAPER": paper}
    sheet = Path(__file__).with_name("style.css").read_text("utf-8")
    return re.sub("|".join(values), lambda found: values[found[0]], sheet)
