"""The report as one HTML page, and the answer at its head in plain sentences."""

from __future__ import annotations

import math
import warnings
from pathlib import Path

from softstart.reporting.choice import Candidate, choice_section
from softstart.reporting.drive_section import drive_section
from softstart.reporting.limit import limit_section
from softstart.reporting.markup import Figures, Html, css_string, html, joined, table, tag
from softstart.reporting.result import Provenance, Report
from softstart.reporting.robustness import life_chapter, robustness_section
from softstart.reporting.sheet import sheet_section
from softstart.reporting.strategies import strategies_section, traces_section
from softstart.start.comparison import REFERENCE
from softstart.start.recommendation import Row
from softstart.views.printed import digits, fixed, percent, short

SAME = 0.005  # a peak within this share of that of direct is no saving
MENTIONED = 3  # strategies that are gentler than direct start and out
MUCH = 0.75  # times the K_dyn of the recommended strategy, here and at worst
HARMED = 0.05  # rounded values that cost more than this share of K_dyn or start time are told at once
BREAKS = ("strategies", "traces", "limit", "robustness")  # sections that begin a printed page
LONGEST = 70  # letters of a name in the head of a page
GUARD = "default-src 'none'; style-src 'unsafe-inline'"  # whatever stands in the file, nothing is loaded


def document(report: Report) -> str:
    """The whole file."""
    with warnings.catch_warnings():  # a name may have letters that the font of the figures has not
        warnings.filterwarnings("ignore", "Glyph .* missing from", UserWarning)
        return _document(report)


def _document(report: Report) -> str:
    drive, choice, rows, figures = report.drive, report.choice, report.comparison.rows, Figures()
    chosen = [one.row for one in (choice.chosen, choice.ordinary) if one is not None]
    best = choice.chosen.name if choice.chosen else ""
    maps = [(one.name, one.map) for one in choice.mapped]
    sections: list[tuple[str, str, Html]] = [
        ("drive", "The drive", drive_section(drive, figures)),
        ("strategies", "The strategies compared", strategies_section(drive, rows, chosen, report.failed)),
        ("traces", "Torques and speeds of each start", traces_section(rows, figures)),
        ("limit", "How gentle could a start be?", limit_section(drive, choice, report.limit, figures)),
        ("robustness", "When the gap wears and the load changes", robustness_section(drive, maps, figures)),
        ("recommendation", "The recommendation, and why", choice_section(choice)),
        (
            "sheets",
            "Parameter sheets for the inverter",
            sheet_section(drive, report.sheets, report.resolution, best, choice.role),
        ),
        *life_chapter(report.lives, figures),
        ("provenance", "Where this report comes from", provenance_section(report.provenance)),
    ]
    name, made = str(drive.name), report.provenance.made
    contents = tag(
        "nav",
        tag("h2", "Contents", id="contents"),
        tag("ol", joined(tag("li", tag("a", title, href=f"#{key}")) for key, title, _ in sections)),
        aria_labelledby="contents",
    )
    body = tag(
        "main",
        tag(
            "header",
            tag("p", "Soft start of a drive with a gap in its transmission", class_="kind"),
            tag("h1", name),
            tag("p", f"Report of softstart {report.provenance.softstart}, {made}", class_="made"),
        ),
        tag("section", tag("p", answer(report)), class_="answer", aria_label="The answer"),
        _tiles(report),
        contents,
        joined(
            tag(
                "section",
                tag("h2", f"{number}. {title}"),
                content,
                id=key,
                class_="page" if key in BREAKS else None,
            )
            for number, (key, title, content) in enumerate(sections, start=1)
        ),
    )
    head = tag(
        "head",
        tag("meta", charset="utf-8"),
        tag("meta", http_equiv="Content-Security-Policy", content=GUARD),
        tag("meta", name="viewport", content="width=device-width, initial-scale=1"),
        tag("meta", name="color-scheme", content="light"),
        tag("title", f"{name}: soft start report"),
        tag("style", Html(style(name, made))),
    )
    return html(Html("<!DOCTYPE html>\n"), tag("html", head, "\n", tag("body", body), lang="en"), "\n")


def _tiles(report: Report) -> Html | None:
    """The four numbers that matter."""
    best, direct = report.choice.chosen, report.row(REFERENCE)
    if best is None or direct is None:
        return None
    run, hard = best.row.run, direct.run
    tiles = [
        (report.choice.role, best.name, f"worst K_dyn on the map {fixed(best.worst, 3)}"),
        ("K_dyn", fixed(run.k_dyn, 3), f"direct {fixed(hard.k_dyn, 3)}"),
        (
            "peak shaft torque",
            f"{digits(run.peak_torque)} N m",
            f"direct {digits(hard.peak_torque)} N m, saved {share_saved(report, best.row)}",
        ),
        (
            "start time",
            f"{digits(run.start_time)} s",
            f"direct {digits(hard.start_time)} s, lost {percent(run.start_time / hard.start_time - 1.0)}",
        ),
    ]
    return tag(
        "dl",
        *(
            tag("div", tag("dt", what), tag("dd", value, tag("small", beside)))
            for what, value, beside in tiles
        ),
        class_="tiles",
    )


def provenance_section(about: Provenance) -> Html:
    """Versions, date, command, and the drive's file with all changes."""
    rows = [
        ["date", about.made],
        ["softstart", about.softstart],
        ["Python", about.python],
        ["libraries", ", ".join(f"{name} {version}" for name, version in about.libraries)],
    ]
    return html(
        table(["what", "which"], rows, caption="Made with", text_columns=(0, 1)),
        tag("p", "The command that made this report:", class_="lead") if about.command else None,
        tag("pre", about.command, class_="command") if about.command else None,
        tag("p", "The drive as a file for softstart, with all changes (drive.toml):", class_="lead"),
        tag("pre", about.drive_toml),
        tag(
            "p",
            "All starts are computed in closed form from event to event. The figures are as good as the "
            "data of the "
            "drive: check gap, stiffness and inertias first where measured starts differ.",
        ),
    )


def answer(report: Report) -> str:
    """The paragraph at the head of the report."""
    best = report.choice.chosen
    text = report.choice.recommendation.text
    if best is None:
        return text
    text += _sheet_of(report, best) + _after_rounding(report, best)
    return text + _on_an_ordinary_inverter(report) + _compared(report, best)


def _sheet_of(report: Report, best: Candidate) -> str:
    """Which strategy the figures that follow are those of, where the text names several."""
    several = report.choice.recommendation.recommended is None and len(report.choice.recommendation.best) > 1
    return f" The parameters below are those of the gentlest, {best.name}." if several else ""


def _on_an_ordinary_inverter(report: Report) -> str:
    best, plain = report.choice.chosen, report.choice.ordinary
    if plain is None or plain is best or report.choice.recommendation.limits:
        return ""
    run = plain.row.run
    return (
        " On an ordinary inverter, one that offers torque ramps and no more, "
        f"{plain.name} is the best: K_dyn {fixed(run.k_dyn, 3)} and {digits(run.start_time)} s."
    ) + _after_rounding(report, plain)


def _compared(report: Report, best: Candidate) -> str:
    """What no start, and what the gentlest start known, has in the same time."""
    bound, known = report.lower_bound(best.row), report.gentlest_known(best.row)
    if bound is None:
        return ""
    drive = report.drive
    limits = (
        f"{short(float(drive.minimum_torque))} to {short(float(min(drive.Ms, drive.maximum_torque)))} N m"
    )
    text = (
        f" For comparison: no motor torque from {limits}, however it is controlled, brings this load to "
        f"speed in that time with a K_dyn below {fixed(math.floor(bound * 1000.0) / 1000.0, 3)}"
    )
    if known is not None and known < best.row.run.k_dyn * (1.0 - SAME):
        text += f"; the gentlest start known has {fixed(math.ceil(known * 1000.0) / 1000.0, 3)}"
    return text + "."


def _after_rounding(report: Report, one: Candidate) -> str:
    """What the steps of the inverter do to a chosen strategy, where that matters."""
    sheet = next((sheet for sheet in report.sheets if sheet.name == one.name), None)
    if sheet is None:
        return ""
    if sheet.rounded is None:
        return " But its values cannot be set in the steps given (section 7)."
    exact, rounded = sheet.exact, sheet.rounded
    if math.isnan(rounded.start_time):
        return " But rounded to the steps given, its values do not bring the load to its target speed."
    harm = max(rounded.k_dyn / exact.k_dyn, rounded.start_time / exact.start_time) - 1.0
    if harm > HARMED:
        return (
            " But these are exact values: rounded to the steps given, they make it K_dyn "
            f"{fixed(rounded.k_dyn, 3)} and {digits(rounded.start_time)} s."
        )
    if not max(sheet.worst_k_dyn / exact.k_dyn, sheet.slowest / exact.start_time) - 1.0 <= HARMED:
        if sheet.variants and math.isnan(sheet.worst_k_dyn + sheet.slowest):
            return " But with values half a step off, the load may not reach its target speed (section 7)."
        if sheet.variants:
            return (
                f" With values half a step off, K_dyn may be {fixed(sheet.worst_k_dyn, 3)} and the start "
                f"time {digits(sheet.slowest)} s."
            )
    return ""


def share_saved(report: Report, row: Row) -> str:
    """What a strategy saves of the peak of direct."""
    direct = report.row(REFERENCE)
    saved = 1.0 - row.run.peak_torque / direct.run.peak_torque if direct else math.nan
    return percent(saved, 0 if abs(saved) >= 0.1 else 1)


def style(header: str, footer: str) -> str:
    """The style sheet with what stands at the head and the foot of each printed page."""
    header = header if len(header) <= LONGEST else header[: LONGEST - 1] + "\N{HORIZONTAL ELLIPSIS}"
    sheet = Path(__file__).with_name("style.css").read_text("utf-8")
    return sheet.replace("HEADER", css_string(header)).replace("FOOTER", css_string(footer))
