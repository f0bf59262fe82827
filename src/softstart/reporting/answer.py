"""The answer in plain sentences."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from softstart.reporting.choice import ALIKE, choose
from softstart.reporting.strategies import kind_of
from softstart.reporting.values import RPM, digits, fixed, percent, short

if TYPE_CHECKING:
    from softstart.reporting.choice import Candidate
    from softstart.reporting.result import Report
    from softstart.start.comparison import Row

SAME = 0.005  # a peak within this share of that of direct is no saving
MENTIONED = 3  # strategies that are gentler than direct start and out
MUCH = 0.75  # times the K_dyn of the recommended strategy, here and at worst
HARMED = 0.05  # rounded values that cost more than this share of K_dyn or start time are told at once


def answer(report: Report) -> str:
    """The paragraph at the head of the report."""
    best, direct = report.choice.recommended, report.row("direct")
    said = _nothing(report)
    if best:
        said = _recommended(report, best, direct) + _after_rounding(report, best)
        said += _with_more_time(report, best)
    return said + _on_an_ordinary_inverter(report) + (_compared(report, best) if best else "")


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
    said = (
        f" For comparison: no motor torque from {limits}, however it is controlled, brings this load to "
        f"speed in that time with a K_dyn below {fixed(math.floor(bound * 1000.0) / 1000.0, 3)}"
    )
    if known is not None and known < best.row.run.k_dyn * (1.0 - SAME):
        said += f"; the gentlest start known has {fixed(math.ceil(known * 1000.0) / 1000.0, 3)}"
    return said + "."


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
    said = (
        f"We recommend {best.name}. With it the shaft carries at most {digits(run.peak_torque)} N m (dynamic "
        f"coefficient K_dyn {fixed(run.k_dyn, 3)}), and the load has its {speed} after "
        f"{digits(run.start_time)} s."
    )
    if direct is None:
        return said
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
        return f"{said} {beside}; direct start does not reach the target speed at all."
    share = percent(abs(late) / hard.start_time)
    if abs(late) < 1e-4 * hard.start_time:
        return f"{said} {beside}, at no cost in time."
    more = "costs" if late > 0.0 else "saves"
    return f"{said} {beside}. The strategy {more} {digits(abs(late), 3)} s of start time, {share}."


def _nothing(report: Report) -> str:
    """Honestly, where the rule finds nothing."""
    choice = report.choice
    reasons = [f"{one.name} ({one.out})" for one in choice.candidates if one.out]
    said = "None of the strategies examined can be recommended for this drive: " + "; ".join(reasons) + "."
    if not any(not math.isnan(one.row.run.start_time) for one in choice.candidates):
        return said + " No strategy brings the load to its target speed."
    return said + " Allow a slower start, give tuned gains, or examine more strategies."
