"""Of a machine with several shafts: what each carries and how long it lasts, and the chain itself."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields
from functools import partial
from typing import Any

from softstart.controller import Controller
from softstart.controller.base import label_of
from softstart.errors import InputError
from softstart.quantities import Units
from softstart.reporting.markup import Figures, Html, html, inlined, printed, tag
from softstart.reporting.strategies import for_customer
from softstart.start.fatigue import fatigue
from softstart.start.recommendation import Row
from softstart.vibration import natural_vibration
from softstart.views import chain_schemes, chains, starts
from softstart.views import fatigue as lives
from softstart.views.drives import drive_lines
from softstart.views.printed import short, unit, units_of

MOST_SHAFTS = 6  # with a column each in a table


def shafts_section(rows: Sequence[Row], shown: Sequence[Row], figures: Figures) -> Html:
    """K_dyn of each shaft under all strategies; of those `shown` parameters, tables, pictures; lives."""
    machine = rows[0].run.drive
    few = len(machine.shaft_names) <= MOST_SHAFTS
    units, parts, pictures = units_of(machine), [], []
    for row in shown:
        key = f"start-{label_of(row.run.controller)}"
        title = f"{row.name}: torques, speeds and twists"
        values = _parameters(row.run.controller, units)
        parts += [
            tag("h3", row.name),
            tag("p", f"Parameters: {values}.") if values else None,
            printed(starts.shaft_table(row.run)),
        ]
        caption = (
            f"{row.name}: torques with their peaks, speeds, and the twist of each shaft with a gap over half "
            "its gap (within -1 and 1 the gap is open)."
        )
        pictures.append(figures.shown(key, partial(_picture, row, key, title), caption))
    of_shafts = starts.details(machine)[: len(machine.shaft_names)]
    strong = [rows.index(row) for row in shown[:1]]
    return html(
        printed(starts.comparison_table(rows, of_shafts, "K_dyn of each shaft"), strong) if few else None,
        *parts,
        *pictures,
        _lives(rows),
    )


def _picture(row: Row, key: str, title: str) -> Html:
    figure = starts.run_figure(row.run)
    if len(row.run.drive.shaft_names) <= MOST_SHAFTS:
        figure.set_size_inches(8.0, 5.2)  # two on a page
    return inlined(figure, key, title)


def _parameters(controller: Controller | None, units: Units) -> str:
    """What the controller is set up with, each value in its unit."""
    assert controller is not None
    words = []
    for one in fields(controller):
        value, si = getattr(controller, one.name), one.metadata.get("unit")
        if value is not None and si is not None:
            number = short(float(f"{units.shown(value, si):.4g}")) if isinstance(value, float) else str(value)
            words.append(f"{one.name.replace('_', ' ')} {number} {unit(units.of(si))}".strip())
    return ", ".join(words)


def _lives(rows: Sequence[Row]) -> Html:
    """The life of each shaft beside that under direct, or why it is not counted."""
    title = tag("h3", "Life of the shafts")
    try:
        found = fatigue([row.run for row in rows])
    except InputError as error:
        return html(title, tag("p", f"Not counted: {for_customer(' '.join(error.sentences))}"))
    shown = lives.fatigue_tables(found, found.rows)[0] if len(found.by_run[0]) <= MOST_SHAFTS else None
    notes = [lives.conclusion(found), *lives.notes(found)]
    return html(title, shown and printed(shown), tag("p", " ".join(notes)))


def chain_section(machine: Any, figures: Figures) -> Html:
    """Scheme, natural frequencies, and lowest shapes."""
    vibration = natural_vibration(machine)
    return html(
        figures.shown(
            "scheme",
            lambda: Html(chain_schemes.scheme_svg(machine)),
            "The chain: masses, shafts, gaps and gears, and below them its first elastic shape.",
        ),
        printed(chains.frequencies_table(vibration)),
        figures.shown(
            "shapes",
            lambda: inlined(chains.shapes_figure(vibration), "shapes", "Lowest elastic shapes"),
            "Lowest elastic shapes with the gaps closed; circles: nodes.",
        ),
    )


def sentences(machine: Any) -> list[str]:
    """The machine in sentences: masses, gaps and sums; motor and load; how it starts, and what is assumed."""
    lines = [" ".join(line.split()) for line in drive_lines(machine)[1:]]
    return [f"{line[0].upper()}{line[1:]}." for line in lines]
