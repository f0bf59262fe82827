"""Page 1, for the one who decides: the answer, before and after, pass or fail, cost and gain."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from softstart.drive.doubts import doubts
from softstart.drive.limits import Limits
from softstart.errors import listed
from softstart.reporting.choice import Choice
from softstart.reporting.markup import Figures, Html, html, inlined, joined, table, tag
from softstart.reporting.strategies import OUTPUT, before_after_figure, for_customer, outputs
from softstart.start.comparison import REFERENCE, Comparison
from softstart.start.recommendation import Recommendation, Row
from softstart.views.fatigue import factor
from softstart.views.printed import NOTHING, at_output, digits, fixed, percent

if TYPE_CHECKING:
    from softstart.reporting.result import Report

AS_IT_IS = "the drive as it is"
SAME = 0.005  # a peak within this share of that of direct is no saving


def headline(report: Report) -> str:
    """The answer: which strategy, what it does to the shaft torque, what it costs.

    >>> from softstart import report
    >>> headline(report("crane-4amtkf", controllers=["shaped"], budget=0.0))[:81]
    'Gentlest start: shaped. The shaft torque peaks at 53.06 N m instead of 164.8 N m '
    """
    best = report.choice.chosen
    several = len(report.drive.shaft_names) > 1
    what = "The largest shaft torque, brought to the motor shaft," if several else "The shaft torque"
    return answer(report.choice.recommendation, best.row if best else None, report.row(REFERENCE), what)


def answer(
    recommendation: Recommendation,
    best: Row | None,
    direct: Row | None,
    torque: str,
) -> str:
    """What the chosen strategy does to a `torque`, and what it costs; why there is none, else."""
    if best is None or direct is None:
        return for_customer(recommendation.text)
    named = recommendation.recommended is not None
    what = f"Recommended: {best.name}." if named else f"Gentlest start: {best.name}."
    run, hard = best.run, direct.run
    if best is direct or run.peak_torque > (1.0 - SAME) * hard.peak_torque:
        return f"{what} No strategy that was examined is noticeably gentler than direct start."
    return (
        f"{what} {torque} peaks at {digits(run.peak_torque)} N m instead of "
        f"{digits(hard.peak_torque)} N m under direct start, {share_saved(best, direct)} less; the "
        f"start takes {digits(run.start_time)} s instead of {digits(hard.start_time)} s."
    )


def to_check(machine: Any) -> Html | None:
    """What is assumed of the machine, and what is doubtful in its data; None where nothing is."""
    assumed = [one for one in machine.assumed.split("; ") if one]
    lists = [("Assumed, to be confirmed:", assumed), ("To be checked in the data:", doubts(machine))]
    parts = [
        part
        for title, items in lists
        if items
        for part in (tag("p", tag("b", title)), tag("ul", joined(tag("li", one) for one in items)))
    ]
    return tag("section", *parts, class_="check") if parts else None


def share_saved(row: Row, direct: Row | None) -> str:
    """What a strategy saves of the peak of direct; a dash for direct itself."""
    if row is direct:
        return NOTHING
    saved = 1.0 - row.run.peak_torque / direct.run.peak_torque if direct else math.nan
    return percent(saved, 0 if abs(saved) >= 0.1 else 1)


def first_page(report: Report, figures: Figures) -> Html:
    """Answer, picture, tiles and the table of limits."""
    rows, what = before_and_after(report.choice, report.comparison), report.drive.WHAT.removeprefix("a ")
    several = len(report.drive.shaft_names) > 1
    torque = "torque of the shaft loaded most, brought to the motor shaft," if several else "shaft torque"
    peak, third = (
        ("largest shaft torque", _where(rows)) if several else ("peak shaft torque", _gained(report))
    )
    caption = (
        f"{listed([row.name for row in rows])}: {torque} and load speed, computed for the "
        f"{what} as it is. Dots: the peaks. Dotted: the target speed."
    )
    return html(
        tag("section", tag("p", headline(report)), class_="answer", aria_label="The answer"),
        figures.shown("before-after", lambda: before_after_picture(rows), caption),
        tiles(rows[-1], rows[0], peak, third) if report.choice.chosen else None,
        verdicts(limits, rows)
        if (limits := report.choice.recommendation.limits)
        else tag(
            "p",
            "Neither passed nor failed: no permissible shaft torque, longest start time or life is agreed "
            "for this machine.",
            class_="verdict",
        ),
        to_check(report.drive),
        _choices(report),
    )


def before_and_after(choice: Choice, comparison: Comparison) -> list[Row]:
    """Direct, and the chosen strategy; where none keeps the limits, the one that comes nearest."""
    direct = next(row for row in comparison.rows if row.name == REFERENCE)
    if choice.chosen is not None:
        return list(dict.fromkeys([direct, choice.chosen.row]))
    able = [one.row for one in choice.candidates if one.realisable and not one.row.flags]
    margins = {row: row.least_margin for row in able}
    known = [row for row, margin in margins.items() if margin is not None and not math.isnan(margin.share)]
    return list(dict.fromkeys([direct, max(known, key=lambda row: margins[row].share, default=direct)]))  # type: ignore[union-attr]


def before_after_picture(rows: list[Row]) -> Html:
    """The two starts, as an <svg> element."""
    title = "; ".join(f"{row.name}: peak {digits(row.run.peak_torque)} N m" for row in rows)
    return inlined(before_after_figure(rows), "before-after", f"Before and after. {title}.")


def _where(rows: Sequence[Row]) -> tuple[str, str, str]:
    """In which shaft the largest torque is, and in which under direct."""
    direct, best = (row.run.drive.shaft_names[row.run.worst_shaft] for row in (rows[0], rows[-1]))
    return "is largest in", best, f"direct: {direct}"


def _gained(report: Report) -> tuple[str, str, str]:
    """What it gains in life."""
    gain = report.life_gain
    if gain is None:
        how = "the damping of the shaft is not known"
        return "life of the shaft line", "not given", how
    how = f"over that of direct, S-N slope {report.life_slope:g}"
    return "life of the shaft line", f"× {factor(gain)}", how


def tiles(best: Row, direct: Row, torque: str, third: tuple[str, str, str]) -> Html:
    """Figures side by side, each beside that of direct: peak, called `torque`, time, a third one, K_dyn."""
    run, hard = best.run, direct.run
    output = at_output(run.drive, run.peak_torque)
    shown = [
        (
            torque,
            f"{digits(run.peak_torque)} N m",
            f"direct {digits(hard.peak_torque)} N m"
            + (f": {share_saved(best, direct)} less" if best is not direct else "")
            + (f"; {output} N m at the output shaft" if output else ""),
        ),
        (
            "costs in time",
            f"{digits(1e3 * best.time_lost, 3)} ms",
            f"start time {digits(run.start_time)} s, direct {digits(hard.start_time)} s",
        ),
        third,
        (
            "K_dyn",
            fixed(run.k_dyn, 3),
            f"direct {fixed(hard.k_dyn, 3)}; 1 is the mean torque of the start",
        ),
    ]
    return tag(
        "dl",
        *(
            tag("div", tag("dt", what), tag("dd", value, tag("small", beside)))
            for what, value, beside in shown
        ),
        class_="tiles",
    )


def margin_of(share: float) -> str:
    """What is left of a limit; how often it is used up where that is more than twice.

    >>> margin_of(0.347), margin_of(-0.5), margin_of(-107.6)
    ('34.7\N{NO-BREAK SPACE}%', '\N{MINUS SIGN}50.0\N{NO-BREAK SPACE}%', '109 times the limit')
    """
    return percent(share) if not share < -1.0 else f"{1.0 - share:.3g} times the limit"


def verdicts(limits: Limits, rows: list[Row]) -> Html:
    """Pass or fail of direct and of the chosen strategy, limit by limit, in the worst case."""
    cells = []
    for row in rows:
        for margin in row.margins(limits):
            cells.append(
                [
                    row.name,
                    f"{margin.name}, {margin.unit}",
                    digits(margin.value),
                    digits(margin.limit),
                    margin_of(margin.share),
                    (margin.case or AS_IT_IS),
                    tag(
                        "b",
                        "pass" if margin.kept else "fail",
                        class_="pass" if margin.kept else "fail",
                    ),
                ]
            )
    cases = [AS_IT_IS, *rows[0].worst_case]
    return table(
        ["strategy", "limit", "worst value", "permitted", "margin", "worst with", "verdict"],
        cells,
        caption=f"Pass or fail, in the worst of {listed(cases)}",
        text_columns=(0, 1, 5, 6),
        class_="names",
    )


def _choices(report: Report) -> Html:
    """Direct, what an ordinary inverter can do, and the strategies that no other one beats."""
    choice, direct = report.choice, report.row(REFERENCE)
    ordinary = [choice.ordinary.row] if choice.ordinary else []
    shown = dict.fromkeys([*([direct] if direct else []), *ordinary, *choice.recommendation.shown])
    rows = sorted(shown, key=lambda row: (row.effort.order, -row.run.k_dyn))
    cells = [
        [
            row.name,
            row.effort.meaning,
            digits(row.run.peak_torque),
            *outputs(row),
            share_saved(row, direct),
            fixed(row.run.k_dyn, 3),
            digits(row.run.start_time),
        ]
        for row in rows
    ]
    best = choice.chosen.row if choice.chosen else None
    return table(
        [
            "strategy",
            "takes",
            "peak torque, N m",
            *OUTPUT[: len(outputs(rows[0]))],
            "less than direct",
            "K_dyn",
            "start time, s",
        ],
        cells,
        caption="What more effort buys",
        text_columns=(0, 1),
        strong=[index for index, row in enumerate(rows) if row is best],
        class_="names",
    )
