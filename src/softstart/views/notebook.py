"""Results as cells of a notebook show them: figures and tables as HTML, and the picture."""

from __future__ import annotations

import html
import io
from collections.abc import Sequence
from typing import Any

from softstart.start.comparison import Comparison
from softstart.views import fatigue, identification, optima, starts
from softstart.views.drawing import drawing
from softstart.views.numbers import Column, Table


def of_run(run: Any) -> str:
    """A start of a drive or a chain: its figures beside its traces."""
    title = f"{run.controller_name} on {run.drive.name}: {run.status.value}"
    return _cell(title, [_figures(starts.figure_rows(run))], run.plot())


def of_comparison(comparison: Comparison) -> str:
    """The table of the strategies, the gentlest first, and what is recommended."""
    rows = sorted(comparison.rows, key=lambda row: row.run.k_dyn)
    about = *starts.definitions(comparison), *starts.remarks(comparison)
    return _cell(
        comparison.drive.name, [starts.comparison_table(rows)], None, [comparison.recommendation.text, *about]
    )


def of_optimum(best: Any) -> str:
    """An optimum: its figures, how good it is, and its torque."""
    notes = [optima.bound_sentence(best)]
    return _cell(
        optima.question(best), [_figures(optima.figure_rows(best))], optima.optimum_figure(best), notes
    )


def of_identification(found: Any) -> str:
    """An identification: its table, what was left, and the notes."""
    lines = identification.headline(found)
    figure = identification.figure(found) if found.logs else None
    return _cell(lines[0], [identification.estimates_table(found)], figure, found.notes)


def of_front(front: Any) -> str:
    """A front over start times: its points, strategies, and the picture."""
    tables = optima.front_tables(front)
    return _cell(front.drive.name, tables, optima.front_figure(front), [optima.front_conclusion(front)])


def of_fatigue(found: Any) -> str:
    """Lives of the shaft line, and the spectrum of its cycles."""
    return _cell(
        found.drive.name,
        fatigue.fatigue_tables(found, found.rows),
        fatigue.fatigue_figure(found),
        [fatigue.conclusion(found), *fatigue.notes(found)],
    )


def _figures(rows: Sequence[Sequence[str]]) -> Table:
    return Table("", [Column("", False), Column("")], rows)


def _cell(title: str, tables: Sequence[Table], figure: Any, notes: Sequence[str] = ()) -> str:
    parts = [f"<p><b>{html.escape(title)}</b></p>", *map(_table, tables)]
    if figure is not None:
        parts.append(_svg(figure))
    parts += [f"<p>{html.escape(note)}</p>" for note in notes if note]
    return "\n".join(parts)


def _table(table: Table) -> str:
    """A table; numbers are set to the right, line breaks in headings kept."""

    def row(cells: Sequence[str], tag: str) -> str:
        written = (
            f'<{tag} style="text-align: {"right" if column.number else "left"}">'
            f"{html.escape(text).replace(chr(10), '<br>')}</{tag}>"
            for column, text in zip(table.columns, cells, strict=True)
        )
        return f"<tr>{''.join(written)}</tr>"

    headings = [column.heading for column in table.columns]
    head = f"<thead>{row(headings, 'th')}</thead>" if any(headings) else ""
    caption = f"<caption>{html.escape(table.title)}</caption>" if table.title else ""
    return f"<table>{caption}{head}<tbody>{''.join(row(cells, 'td') for cells in table.rows)}</tbody></table>"


def _svg(figure: Any) -> str:
    """A figure within a page."""
    written = io.StringIO()
    with drawing():
        figure.savefig(written, format="svg", metadata={"Date": None}, bbox_inches="tight")
    text = written.getvalue()
    return text[text.index("<svg") :]
