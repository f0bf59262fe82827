"""`report_chain`: the report of a chain, from the contents of `softstart compare CHAIN`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import partial
from pathlib import Path
from typing import Any

from softstart.chain.fatigue import chain_fatigue
from softstart.chain.model import Chain
from softstart.controller import Controller
from softstart.controller.base import label_of
from softstart.controller.finding import ready_controller_names
from softstart.errors import InputError, SimulationError, listed
from softstart.input.files import write_whole
from softstart.quantities import Units
from softstart.reporting import document
from softstart.reporting.first_page import answer, for_customer, tiles, to_check, verdicts
from softstart.reporting.limit import Limit, chain_limit, how_near, limit_figure
from softstart.reporting.markup import Figures, Html, html, inlined, joined, printed, tag
from softstart.reporting.project import Project
from softstart.reporting.resolution import Resolution
from softstart.reporting.result import (
    Progress,
    Provenance,
    checked_steps,
    controllers_of,
    provenance,
)
from softstart.reporting.sheet import Sheet, make_sheet, sheet_section
from softstart.start.comparison import REFERENCE, Comparison, compared
from softstart.start.recommendation import Row
from softstart.start.simulation import simulate
from softstart.vibration import natural_vibration
from softstart.views import chain_schemes, chains, starts
from softstart.views import fatigue as lives
from softstart.views.printed import digits, fixed, short, unit, units_of

CHAIN_BUDGET = 60.0  # s, for the search of the optimum
MOST_SHAFTS = 6  # with a column each in the table of strategies


@dataclass(frozen=True, eq=False, repr=False)
class ChainReport:
    """All data behind the report of a chain: the strategies compared, and those that could not be started.

    Attributes
    ----------
    drive : Chain
        The chain that is started.
    comparison : Comparison
        The strategies that could be started, one row each.
    failed : tuple of (str, str)
        Name of each strategy whose start could not be finished, and the reason.
    provenance : Provenance
        Versions, date, the chain's file and command.
    project : Project
        Customer, author, revisions; see `Project`.
    limit : Limit
        The bound that no start goes below, and the optimum found for the start time of the chosen strategy.
    sheets : tuple of Sheet
        The parameter sheet of the chosen strategy.
    resolution : Resolution
        The steps in which the inverter can be set.

    Examples
    --------
    >>> from softstart.reporting import report_chain
    >>> report_chain("crane-4-mass", controllers=["ramp"], budget=0.0).headline[:36]
    'Gentlest start: ramp. The largest sh'
    """

    drive: Chain
    comparison: Comparison
    failed: tuple[tuple[str, str], ...]
    provenance: Provenance
    project: Project = field(default_factory=Project)
    limit: Limit = field(default_factory=Limit)
    sheets: tuple[Sheet, ...] = ()
    resolution: Resolution = field(default_factory=Resolution)

    @property
    def chosen(self) -> Row | None:
        """The recommended strategy; without limits, the gentlest of those that no other one beats."""
        shown = self.comparison.recommendation.shown
        return shown[-1] if shown else None

    @property
    def direct(self) -> Row:
        """The row of `direct`."""
        return next(row for row in self.comparison.rows if label_of(row.run.controller) == REFERENCE)

    @property
    def headline(self) -> str:
        """The answer in one sentence or two."""
        what = "The largest shaft torque, brought to the motor shaft,"
        return answer(self.comparison.recommendation, self.chosen, self.direct, what)

    def summary(self) -> dict[str, Any]:
        """Everything as plain data, for JSON: as `compare` gives it, what is chosen, and where it is from."""
        return {
            **self.comparison.summary(),
            "chosen": self.chosen.name if self.chosen else None,
            "limit": self.limit.summary(),
            "sheets": [sheet.summary() for sheet in self.sheets],
            "failed": dict(self.failed),
            "provenance": self.provenance.summary(),
        }

    def to_html(self) -> str:
        """The report as one HTML file that needs nothing else."""
        return document.whole(self.project, lambda: _page(self))

    def write(self, path: str | Path) -> None:
        """Write the HTML file, whole or not at all."""
        text = self.to_html()
        write_whole(Path(path), lambda stream: stream.write(text))


def report_chain(
    chain: Chain | str | Path,
    *,
    controllers: Sequence[str | Controller] | None = None,
    parameters: Mapping[str, Mapping[str, object]] | None = None,
    resolution: Resolution | Mapping[str, object] | str | None = None,
    budget: float = CHAIN_BUDGET,
    progress: Progress | None = None,
    command: str = "",
    project: Project | str | Path | None = None,
) -> ChainReport:
    """Start a chain under each strategy, for a report of it.

    Parameters
    ----------
    chain : Chain, str or Path
        The chain, or the name or file of one.
    controllers, parameters, resolution, budget, progress, command, project
        As in `report`; the project's file must have no [[source]], which are for parameters of a drive.

    Returns
    -------
    ChainReport
        The data; `write` makes one HTML file of it.

    Raises
    ------
    InputError
        Bad input.
    SimulationError
        Not even the start under `direct` can be finished.

    Examples
    --------
    >>> found = report_chain("crane-4-mass", controllers=["ramp"], budget=0.0)
    >>> [row.name for row in found.comparison.rows]
    ['ramp', 'direct']

    References
    ----------
    docs/howto/read-a-report.md; K_dyn: [G] (16); chains: docs/theory/reduction.md.
    """
    chain = chain if isinstance(chain, Chain) else Chain.load(chain)
    about = project if isinstance(project, Project) else Project.load(project) if project else Project()
    if about.sources:
        raise InputError(
            f'project: [[source]] "{about.sources[0].parameter}" is a parameter of a drive, and '
            f'"{chain.name}" is a chain; leave these tables out, and name assumed values in its file.'
        )
    steps = checked_steps(chain, resolution, budget)
    made = controllers_of(controllers, parameters or {})
    reference = simulate(chain, REFERENCE)
    rows: list[Row] = []
    failed: list[tuple[str, str]] = []
    for number, one in enumerate(made):
        if progress is not None:
            progress(0.4 * number / len(made), f"starting the chain under {label_of(one)}")
        try:
            rows.append(compared(chain, one, reference))
        except SimulationError as error:
            if label_of(one) == REFERENCE:
                raise
            failed.append((label_of(one), " ".join(str(error).split())))
    comparison = Comparison(chain, tuple(rows), worst_case=rows[0].worst_case)
    found = ChainReport(chain, comparison, tuple(failed), provenance(chain, command), about, resolution=steps)
    return _with_limit_and_sheet(found, made, budget, progress or (lambda share, what: None))


def _with_limit_and_sheet(
    report: ChainReport, made: Sequence[Controller], budget: float, progress: Progress
) -> ChainReport:
    """The report with the sheet of the chosen strategy, and how gentle a start could be."""
    best, chain, rows = report.chosen, report.drive, report.comparison.rows
    sheets: list[Sheet] = []

    def sheet() -> None:
        if best is not None:
            controller = next(one for one in made if label_of(one) == best.name)
            sheets.append(make_sheet(chain, controller, best.run, report.resolution, best))

    limit = chain_limit(
        chain,
        [row.run.start_time for row in rows],
        [] if best is None else [best.run.start_time],
        budget,
        lambda share, what: progress(0.4 + 0.6 * share, what),
        sheet,
        seeds=[best.name] if best is not None and best.name in ready_controller_names() else None,
    )
    return replace(report, limit=limit, sheets=tuple(sheets))


def _page(report: ChainReport) -> str:
    figures = Figures()
    first = _first_page(report, figures)
    sections = [
        ("compared", "The strategies compared", _strategies(report)),
        ("starts", "The starts in detail", _starts(report, figures)),
        ("gentlest", "How gentle could a start be?", _limit(report, figures)),
        ("sheet", "Parameter sheets for the inverter", _sheets(report)),
        ("chain", "The chain", _chain(report.drive, figures)),
        ("validity", "What this report assumes, and where it holds", _validity(report.drive)),
        (
            "provenance",
            "About this document",
            document.provenance_section(report.provenance, report.project, chain=True),
        ),
    ]
    return document.page(report.drive.name, report.project, report.provenance.made, first, sections)


def _first_page(report: ChainReport, figures: Figures) -> Html:
    """Answer, picture, tiles, limits and the table of strategies."""
    direct, best = report.direct, report.chosen
    rows = _shown(report)
    limits = report.comparison.recommendation.limits
    caption = (
        f"{listed([row.name for row in rows])}: torques of motor and shafts, brought to the motor "
        "shaft, computed for the chain as it is."
    )
    return html(
        tag("section", tag("p", report.headline), class_="answer", aria_label="The answer"),
        tag("p", " ".join(_sentences(report.drive)[:2]), class_="small"),
        figures.shown(
            "before-after",
            lambda: inlined(starts.comparison_figure(rows, ""), "before-after", "Before and after."),
            caption,
        ),
        _tiles(report, best, direct) if best is not None else None,
        verdicts(limits, rows)
        if limits
        else tag(
            "p",
            "Neither passed nor failed: no permissible torque is agreed for a shaft of this chain.",
            class_="verdict",
        ),
        to_check(report.drive),
        _table(_gentlest_first(report), (*starts.GENTLE, *starts.QUICK), "Strategies on this chain", best),
    )


def _tiles(report: ChainReport, best: Row, direct: Row) -> Html:
    names = report.drive.shaft_names
    worst = f"direct: {names[direct.run.worst_shaft]}"
    where = "is largest in", names[best.run.worst_shaft], worst
    return tiles(best, direct, "largest shaft torque", where)


def _shown(report: ChainReport) -> list[Row]:
    """Direct, and the chosen strategy, if there is one."""
    return list(dict.fromkeys(row for row in (report.direct, report.chosen) if row is not None))


def _gentlest_first(report: ChainReport) -> list[Row]:
    return sorted(report.comparison.rows, key=lambda row: row.run.k_dyn)


def _table(rows: Sequence[Row], columns: Sequence[starts.Figure], title: str, best: Row | None) -> Html:
    strong = [index for index, row in enumerate(rows) if row is best]
    return printed(starts.comparison_table(rows, columns, title), strong)


def _strategies(report: ChainReport) -> Html:
    """Times, K_dyn of each shaft, and what the columns mean."""
    rows, best = _gentlest_first(report), report.chosen
    count = len(report.drive.shaft_names)
    shafts, others = starts.details(report.drive)[:-1], starts.details(report.drive)[-1:]
    if report.drive.limits:
        shafts, others = shafts[:-1], (*shafts[-1:], *others)
    notes = [
        *map(for_customer, (*starts.definitions(report.comparison), *starts.remarks(report.comparison))),
        *(f"{name} could not be examined: {reason}" for name, reason in report.failed),
    ]
    return html(
        tag("p", for_customer(report.comparison.recommendation.text)),
        _table(rows, (*starts.TIMES, *others), "How quick, and how often gaps close", best),
        _table(rows, shafts, "K_dyn of each shaft", best) if 1 < count <= MOST_SHAFTS else None,
        tag("ul", joined(tag("li", one) for one in notes), class_="notes"),
    )


def _starts(report: ChainReport, figures: Figures) -> Html:
    """Torques, speeds and twists, and what each shaft carries, of the chosen strategy and of direct."""
    parts, pictures = [], []
    for row in reversed(_shown(report)):
        key = f"start-{label_of(row.run.controller)}"
        title = f"{row.name}: torques, speeds and twists"
        parts += [
            tag("h3", row.name),
            tag("p", f"Parameters: {values}.")
            if (values := _parameters(row.run.controller, units_of(report.drive)))
            else None,
            printed(starts.shaft_table(row.run)),
        ]
        pictures.append(
            figures.shown(
                key,
                partial(_start_picture, row, key, title),
                (
                    f"{row.name}: torques with their peaks, speeds, and the twist of each shaft with a gap "
                    "over half its gap (within -1 and 1 the gap is open)."
                ),
            )
        )
    return html(*parts, *pictures, _life(report))


def _limit(report: ChainReport, figures: Figures) -> Html:
    """Every strategy beside what no start goes below, and the optimum that was found."""
    chain, limit, best, rows = report.drive, report.limit, report.chosen, report.comparison.rows
    if limit.refusal:
        return tag("p", limit.refusal)
    motor = chain.motor
    assert motor is not None
    least, most = motor.minimum_torque, min(motor.starting_torque, motor.maximum_torque)
    bound = (
        "Lower bound: proved from the momentum of the load mass, for every torque from "
        f"{short(float(least))} to {short(float(most))} N m over time, however often and in whichever "
        "order the gaps close."
    )
    none = "There is no bound for this chain: gears with losses, or a motor on the load mass."
    caption = (
        "Every strategy (filled: the chosen one) by its start time and K_dyn. Below the dashed "
        "line (hatched) no start is possible, with whatever motor torque and however it is "
        "controlled."
    )
    title = "K_dyn of the chain against start time"
    return html(
        figures.shown(
            "limit",
            lambda: inlined(limit_figure(rows, [best] if best else [], limit), "limit", title),
            caption,
        ),
        how_near(chain, rows, limit),
        tag(
            "ul",
            joined(tag("li", one) for one in (bound if limit.bounds else none, *_on_optimum(limit))),
            class_="notes",
        ),
    )


def _on_optimum(limit: Limit) -> list[str]:
    """What the search on the chain found."""
    notes = [
        (
            f"In {digits(p.start_time_bound)} s, the start time of the chosen strategy, the gentlest start "
            f"found has K_dyn {fixed(p.k_dyn, 3)}: by linear programs on the exact start of the chain, from "
            "the torque of that strategy. It is simulated exactly, and not proved the gentlest."
        )
        for p in limit.found
    ]
    if limit.missing and limit.budget > 0.0:
        notes.append(f"No optimum was found within the {short(limit.budget)} s of search.")
    return notes


def _sheets(report: ChainReport) -> Html:
    """The sheet of the chosen strategy; its percentages are of the chain's motor."""
    recommended = report.comparison.recommendation.recommended is not None
    return sheet_section(
        report.drive.design_drive,
        report.sheets,
        report.resolution,
        report.chosen.name if report.chosen else "",
        "recommended" if recommended else "gentlest unbeaten",
    )


def _parameters(controller: Controller, units: Units) -> str:
    """What the controller is set up with, each value in its unit."""
    words = []
    for one in fields(controller):
        value, si = getattr(controller, one.name), one.metadata.get("unit")
        if value is not None and si is not None:
            number = short(float(f"{units.shown(value, si):.4g}")) if isinstance(value, float) else str(value)
            words.append(f"{one.name.replace('_', ' ')} {number} {unit(units.of(si))}".strip())
    return ", ".join(words)


def _life(report: ChainReport) -> Html:
    """The life of each shaft beside that under direct, or why it is not counted."""
    title = tag("h3", "Life of the shafts")
    rows = _gentlest_first(report)
    try:
        found = chain_fatigue([row.run for row in rows])
    except InputError as error:
        return html(title, tag("p", f"Not counted: {for_customer(' '.join(error.sentences))}"))
    shown = lives.chain_tables(found)[1] if len(report.drive.shafts) <= MOST_SHAFTS else None
    notes = [lives.chain_conclusion(found), *lives.chain_notes(found)]
    return html(title, shown and printed(shown), tag("p", " ".join(notes)))


def _start_picture(row: Row, key: str, title: str) -> Html:
    figure = starts.run_figure(row.run)
    if len(row.run.drive.shafts) <= MOST_SHAFTS:
        figure.set_size_inches(8.0, 5.2)  # two on a page
    return inlined(figure, key, title)


def _chain(chain: Chain, figures: Figures) -> Html:
    """Scheme, natural frequencies, and lowest shapes."""
    vibration = natural_vibration(chain)
    return html(
        figures.shown(
            "scheme",
            lambda: Html(chain_schemes.scheme_svg(chain)),
            "The chain: masses, shafts, gaps and gears, and below them its first elastic shape.",
        ),
        printed(chains.frequencies_table(vibration)),
        figures.shown(
            "shapes",
            lambda: inlined(chains.shapes_figure(vibration), "shapes", "Lowest elastic shapes"),
            "Lowest elastic shapes with the gaps closed; circles: nodes.",
        ),
    )


def _sentences(chain: Chain) -> list[str]:
    """The chain in sentences: masses, gaps and sums; motor and load; where it starts, and what is assumed."""
    lines = [line.strip() for line in chains.chain_lines(chain)[1:]]
    return [f"{line[0].upper()}{line[1:]}." for line in lines]


def _validity(chain: Chain) -> Html:
    motor = chain.motor
    assert motor is not None  # or nothing would have started
    notes = [
        *_sentences(chain),
        document.motor_sentence(
            float(motor.minimum_torque), float(motor.maximum_torque), float(motor.torque_lag)
        ),
        "Controllers are set up for the two masses that stand for the chain, and start the chain itself.",
        (
            "The equations are solved as Taylor series from event to event; peaks are located, not read off "
            "a grid."
        ),
    ]
    return tag("ul", joined(tag("li", one) for one in notes), class_="notes")
