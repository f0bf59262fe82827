"""The report as one HTML page."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING

from softstart.reporting.answer import answer
from softstart.reporting.choice_section import choice_section
from softstart.reporting.drive_section import drive_section
from softstart.reporting.figure_list import Figures
from softstart.reporting.limit_section import limit_section
from softstart.reporting.markup import Html, html, joined, tag
from softstart.reporting.provenance_section import provenance_section
from softstart.reporting.robustness_section import robustness_section
from softstart.reporting.sheet_section import sheet_section
from softstart.reporting.strategies_section import share_saved, strategies_section, traces_section
from softstart.reporting.style import style
from softstart.reporting.values import digits, fixed, percent

if TYPE_CHECKING:
    from softstart.reporting.result import Report

BREAKS = ("strategies", "traces", "limit", "robustness")  # sections that begin a printed page
GUARD = "default-src 'none'; style-src 'unsafe-inline'"  # whatever stands in the file, nothing is loaded


def document(report: Report) -> str:
    """The whole file."""
    with warnings.catch_warnings():  # a name may have letters that the font of the figures has not
        warnings.filterwarnings("ignore", "Glyph .* missing from", UserWarning)
        return _document(report)


def _document(report: Report) -> str:
    figures = Figures()
    sections: list[tuple[str, str, Html]] = [
        ("drive", "The drive", drive_section(report, figures)),
        ("strategies", "The strategies compared", strategies_section(report)),
        ("traces", "Torques and speeds of each start", traces_section(report, figures)),
        ("limit", "How gentle could a start be?", limit_section(report, figures)),
        ("robustness", "When the gap wears and the load changes", robustness_section(report, figures)),
        ("recommendation", "The recommended strategy, and why", choice_section(report)),
        ("sheets", "Parameter sheets for the inverter", sheet_section(report)),
        ("provenance", "Where this report comes from", provenance_section(report)),
    ]
    name, made = str(report.drive.name), report.provenance.made
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
    best, direct = report.choice.recommended, report.row("direct")
    if best is None or direct is None:
        return None
    run, hard = best.row.run, direct.run
    tiles = [
        ("recommended", best.name, f"worst K_dyn on the map {fixed(best.worst, 3)}"),
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
