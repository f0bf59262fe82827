"""The report as one HTML page, and the answer at its head in plain sentences."""

from __future__ import annotations

import math
import warnings
from pathlib import Path

from softstart.reporting.choice import ALIKE, Candidate, choice_section, choose
from softstart.reporting.drive_section import drive_section
from softstart.reporting.limit import limit_section
from softstart.reporting.markup import Figures, Html, css_string, html, joined, table, tag
from softstart.reporting.result import Provenance, Report
from softstart.reporting.robustness import life_chapter, robustness_section
from softstart.reporting.sheet import sheet_section
from softstart.reporting.strategies import kind_of, strategies_section, traces_section
from softstart.start.comparison import REFERENCE, Row
from softstart.views.printed import RPM, digits, fixed, percent, short

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
    chosen = [one.row for one in (choice.recommended, choice.ordinary) if one is not None]
    best = choice.recommended.name if choice.recommended else ""
    maps = [(one.name, one.map) for one in choice.mapped]
    sections: list[tuple[str, str, Html]] = [
        ("drive", "The drive", drive_section(drive, figures)),
        ("strategies", "The strategies compared", strategies_section(drive, rows, chosen, report.failed)),
        ("traces", "Torques and speeds of each start", traces_section(rows, figures)),
        ("limit", "How gentle could a start be?", limit_section(drive, choice, report.limit, figures)),
        ("robustness", "When the gap wears and the load changes", robustness_section(drive, maps, figures)),
        ("recommendation", "The recommended strategy, and why", choice_section(choice)),
        (
            "sheets",
            "Parameter sheets for the inverter",
            sheet_section(drive, report.sheets, report.resolution, best),
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
    best, direct = report.choice.recommended, report.row(REFERENCE)
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
    best, direct = report.choice.recommended, report.row(REFERENCE)
    text = _nothing(report)
    if best:
        text = _recommended(report, best, direct) + _after_rounding(report, best)
        text += _with_more_time(report, best)
    return text + _on_an_ordinary_inverter(report) + (_compared(report, best) if best else "")


def _on_an_ordinary_inverter(report: Report) -> str:
    best, plain = report.choice.recommended, report.choice.ordinary
    if plain is None or plain is best:
        return ""
    run = plain.row.run
    figures = f"K_dyn {fixed(run.k_dyn, 3)} and {digits(run.start_time)} s"
    if best is not None and kind_of(best.row.run.controller) == "direct":
        if _no_gentler(plain, best):
            return f" Torque ramps are no gentler: the best of them, {plain.name}, has {figures}."
        best = None
    praise = ""
    if best is not None and max(plain.worst / best.worst, run.k_dyn / best.row.run.k_dyn) <= 1.0 + ALIKE:
        praise = ", and as gentle within a per cent"
    slow = (
        f", {percent(plain.slower)} slower than {report.choice.reference}" if report.choice.too_slow else ""
    )
    return (
        " On an ordinary inverter, one that offers torque ramps and no more, "
        f"{plain.name} is the best{praise}: {figures}{slow}."
    ) + _after_rounding(report, plain)


def _no_gentler(one: Candidate, other: Candidate) -> bool:
    return not (one.row.run.k_dyn < other.row.run.k_dyn * (1.0 - SAME))


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


def _direct(report: Report, best: Candidate, figures: str) -> str:
    """Direct start is recommended: whether as nothing is gentler, or as what is gentler is out."""
    others = [one for one in report.choice.candidates if one is not best and one.means.realisable]
    if not others:
        return f"Only direct start was examined of what can be realised: {figures}."
    gentler = [one for one in others if not math.isnan(one.row.run.start_time) and not _no_gentler(one, best)]
    if not gentler:
        return (
            "For this drive direct start is as good as any strategy examined that can be realised: "
            f"{figures}. A soft start brings nothing here."
        )
    gentler.sort(key=lambda one: one.row.run.k_dyn)
    why = "; ".join(
        f"{one.name} (K_dyn {fixed(one.row.run.k_dyn, 3)}, {one.out or 'no better over gaps and loads'})"
        for one in gentler[:MENTIONED]
    )
    return f"The rule leaves direct start: {figures}. Gentler on the drive as it is, but not chosen: {why}."


def _with_more_time(report: Report, best: Candidate) -> str:
    """What the rule would take if the start might last as long as it likes, where that is worth much."""
    candidates = report.choice.candidates
    eased = choose([one.row for one in candidates], [one.map for one in candidates], math.inf).recommended
    if eased is None or max(eased.worst / best.worst, eased.row.run.k_dyn / best.row.run.k_dyn) > MUCH:
        return ""
    run = eased.row.run
    return (
        f" A slower start is much gentler: with --slower {math.ceil(100.0 * eased.slower)}% the rule takes "
        f"{eased.name}, K_dyn {fixed(run.k_dyn, 3)} after {digits(run.start_time)} s."
    )


def _recommended(report: Report, best: Candidate, direct: Row | None) -> str:
    run = best.row.run
    speed = f"{short(float(f'{float(report.drive.target_speed) * RPM:.5g}'))} rpm"
    if kind_of(run.controller) == "direct":
        return _direct(
            report,
            best,
            f"K_dyn {fixed(run.k_dyn, 3)}, peak shaft torque {digits(run.peak_torque)} N m, {speed} after "
            f"{digits(run.start_time)} s",
        )
    text = (
        f"We recommend {best.name}. With it the shaft carries at most {digits(run.peak_torque)} N m (dynamic "
        f"coefficient K_dyn {fixed(run.k_dyn, 3)}), and the load has its {speed} after "
        f"{digits(run.start_time)} s."
    )
    if direct is None:
        return text
    hard, saved = direct.run, 1.0 - run.peak_torque / direct.run.peak_torque
    torque = float(getattr(hard.controller, "torque", None) or report.drive.Ms)
    full = "the full torque" if torque == float(report.drive.Ms) else f"{short(torque)} N m"
    beside = (
        f"Direct start, with {full} from the first instant on, loads the shaft with "
        f"{digits(hard.peak_torque)} N m (K_dyn {fixed(hard.k_dyn, 3)})"
    )
    if saved > SAME:
        beside += f": {percent(saved, 0 if saved >= 0.1 else 1)} of the peak are saved"
    else:
        beside += ": on this drive as it is the peak is no lower, but over the range of gaps and loads it is"
    late = run.start_time - hard.start_time
    if math.isnan(late):
        return f"{text} {beside}; direct start does not reach the target speed at all."
    share = percent(abs(late) / hard.start_time)
    if abs(late) < 1e-4 * hard.start_time:
        return f"{text} {beside}, at no cost in time."
    more = "costs" if late > 0.0 else "saves"
    return f"{text} {beside}. The strategy {more} {digits(abs(late), 3)} s of start time, {share}."


def _nothing(report: Report) -> str:
    """Honestly, where the rule finds nothing."""
    choice = report.choice
    reasons = [f"{one.name} ({one.out})" for one in choice.candidates if one.out]
    text = "None of the strategies examined can be recommended for this drive: " + "; ".join(reasons) + "."
    if not any(not math.isnan(one.row.run.start_time) for one in choice.candidates):
        return text + " No strategy brings the load to its target speed."
    return text + " Allow a slower start, give tuned gains, or examine more strategies."


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
