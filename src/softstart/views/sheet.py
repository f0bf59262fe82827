"""What is shown of a result, the same on a terminal, in the folder of --out and in a notebook: a `Sheet`."""

from __future__ import annotations

import html
import io
import math
import platform
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, TextIO

from softstart import __version__
from softstart.drive import Machine
from softstart.views.drawing import narrowed, save_figure, svg_of
from softstart.views.drives import controllers_set_up
from softstart.views.markdown import markdown, write_table, write_text
from softstart.views.numbers import Column, TextTable, printed, titled, units_for, units_of
from softstart.views.terminal import blocks_of, console, print_lines, print_table, sentence

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FITTED_TO = "fitted-to.toml"
COLUMN_HEAD, ROW_HEAD = 'th scope="col"', 'th scope="row"'
LETTER, PADDING = 6.5, 8.0  # pixels of a table on the page

Writer = Callable[[Path], object]


@dataclass(frozen=True)
class Sheet:
    """What is shown of a result, in the order in which it is shown; what is empty is left out.

    Not what a user gives (`DataSheet`: the plates of a drive) and not what is set on an inverter
    (`reporting.ParameterSheet`): it holds only texts, tables and functions that draw.

    Attributes
    ----------
    title : str
        The heading of report.md.
    lines : sequence of str
        The machine and what was asked, the first line a title.
    status : str
        How it ended, a sentence.
    facts : sequence of (str, str)
        Figures, each a name and its value.
    tables : sequence of TextTable
        The main one first.
    conclusions, notes : sequence of str
        What came out; what the figures mean.
    figures : mapping of str to callable
        By the stem of their files, each drawn when it is needed; the first one is that of a notebook.
    panel : callable, optional
        Draws the main panel of the first figure on given axes.
    no_figure : str
        Why there is no figure.
    records : sequence of mapping
        The rows of the main table as plain data, for a DataFrame.
    files : mapping of str to str or callable
        Further files of --out by their names: a text, or what writes a path.
    machine : Drive or Chain, optional
        Its parameters close report.md, and its TOML file is written.
    fitted_to : Drive or Chain, optional
        For which machine the controllers are set up, if another.
    varied : bool
        Whether parameters of the machine are varied.
    behind : sequence of str
        Further sections of report.md, Markdown.
    commands : sequence of (str, str)
        What to type next, and what it gives.
    """

    title: str
    lines: Sequence[str] = ()
    status: str = ""
    facts: Sequence[Sequence[str]] = ()
    tables: Sequence[TextTable] = ()
    conclusions: Sequence[str] = ()
    notes: Sequence[str] = ()
    figures: Mapping[str, Callable[..., Figure]] = field(default_factory=dict)
    panel: Callable[[Axes], object] | None = None
    no_figure: str = ""
    records: Sequence[Mapping[str, object]] = ()
    files: Mapping[str, str | Writer] = field(default_factory=dict)
    machine: Machine | None = None
    fitted_to: Machine | None = None
    varied: bool = False
    behind: Sequence[str] = ()
    commands: Sequence[tuple[str, str]] = ()

    def __post_init__(self) -> None:
        texts = {name: list(filter(None, vars(self)[name])) for name in ("lines", "conclusions", "notes")}
        facts, tables = [fact for fact in self.facts if fact[1]], [one for one in self.tables if one.rows]
        vars(self).update(texts, facts=facts, tables=tables)


# terminal --------------------------------------------------------------------------------------------------


def sheet_text(sheet: Sheet) -> str:
    """What is printed of a sheet in a pipe."""
    stream = io.StringIO()
    print_sheet(sheet, stream)
    return stream.getvalue()


def print_sheet(sheet: Sheet, stream: TextIO | None = None) -> None:
    """Print a sheet, or write it into a stream of text."""
    to = console(stream)
    print_lines(to, sheet.lines)
    if sheet.status or sheet.facts:
        to.print()
    if sheet.status:
        sentence(to, sheet.status, "bold")
    if sheet.facts:
        print_table(to, TextTable.of_texts(("", ""), sheet.facts), headings=False)
    for table in sheet.tables:
        to.print()
        print_table(to, table)
    if sheet.conclusions or sheet.notes:
        to.print()
    for style, texts in (("bold", sheet.conclusions), ("dim", sheet.notes)):
        for text in texts:
            sentence(to, text, style)
    if sheet.commands:
        wide = max(len(command) for command, _ in sheet.commands)
        to.print("\nNext:")
        for command, gives in sheet.commands:
            to.print(f"  {command:{wide}}   {gives}", soft_wrap=True)


# folder ----------------------------------------------------------------------------------------------------


def rows_file(columns: Sequence[str], rows: Sequence[Sequence[object]]) -> Writer:
    """A CSV file of rows; numbers with all their digits, None as an empty cell."""
    return lambda path: write_table(path, columns, rows)


def columns_file(columns: Mapping[str, Sequence[object]]) -> Writer:
    """A CSV file of columns by their headings; NaN as an empty cell."""
    rows = [
        [None if isinstance(cell, float) and math.isnan(cell) else cell for cell in row]
        for row in zip(*columns.values(), strict=True)
    ]
    return rows_file(list(columns), rows)


def records_file(records: Sequence[Mapping[str, object]]) -> Writer:
    """A CSV file of records with the same keys."""
    return rows_file(list(records[0]), [list(one.values()) for one in records])


def export(sheet: Sheet, folder: Path, command: str) -> None:
    """Write a sheet into a folder: report.md, figures (SVG, PNG), further files, and the machine (TOML)."""
    for stem, draw in sheet.figures.items():
        save_figure(draw(), folder, stem)
    for name, content in sheet.files.items():
        if isinstance(content, str):
            write_text(folder / name, content)
        else:
            content(folder / name)
    links = ", ".join(f"[{name}]({name})" for name in sheet.files)
    about, machine = _machine(sheet, folder)
    behind = "".join(sheet.behind)
    parts = [
        f"# {markdown(sheet.title)}",
        "\n".join(f"- {markdown(line.strip())}" for line in sheet.lines[1:]),
        markdown(sheet.status),
        *map(markdown, sheet.conclusions),
        *(
            table_parts(TextTable("", [Column("figure", False), Column("value")], sheet.facts))
            if sheet.facts
            else ()
        ),
        *(f"![{stem}]({stem}.svg)" for stem in sheet.figures if f"({stem}.svg)" not in behind),
        *(part for one in sheet.tables for part in table_parts(one)),
        *map(markdown, sheet.notes),
        f"Files: {links}." if links else "",
        *machine,
        *sheet.behind,
        "## Where this comes from",
        f"softstart {__version__}, Python {platform.python_version()}, with the command",
        f"```sh\n{command}\n```",
        about,
    ]
    write_text(folder / "report.md", "\n\n".join(part for part in parts if part) + "\n")


def table_parts(table: TextTable) -> list[str]:
    """A table and its title in Markdown; numbers are set to the right."""
    headings = [column.in_a_line for column in table.columns]
    rule = ["---:" if column.number else "---" for column in table.columns]
    rows = "\n".join(f"| {' | '.join(map(markdown, cells))} |" for cells in (headings, rule, *table.rows))
    return [f"## {markdown(table.title)}", rows] if table.title else [rows]


def _machine(sheet: Sheet, folder: Path) -> tuple[str, list[str]]:
    """The files of the machine, what is said of them, and the section with its parameters."""
    machine = sheet.machine
    if machine is None:
        return "", []
    what = machine.WHAT.removeprefix("a ")
    write_text(folder / f"{what}.toml", machine.to_toml())
    text = f"```toml\n{machine.to_toml()}```"
    about = f"on the {what} of [{what}.toml]({what}.toml), which holds all changes:\n\n{text}"
    if sheet.fitted_to is not None:
        write_text(folder / FITTED_TO, sheet.fitted_to.to_toml())
        set_up = controllers_set_up(None if sheet.varied else machine, sheet.fitted_to)
        about += (
            f"\n\nThe {markdown(set_up)}. That drive is in "
            f"[{FITTED_TO}]({FITTED_TO}):\n\n```toml\n{sheet.fitted_to.to_toml()}```"
        )
    return about, [f"## The {what}", *table_parts(_parameters(machine))]


def _parameters(machine: Machine) -> TextTable:
    """All parameters of a machine that are set."""
    rows = []
    for path, (parameter, value) in machine.parameters_by_path().items():
        if value is not None and value != "" and path != "name":
            values = value if isinstance(value, tuple) else (value,)
            si, seen = parameter.unit, units_for(machine, parameter)
            shown = ", ".join(f"{seen.shown(v, si):.10g}" if isinstance(v, float) else str(v) for v in values)
            unit = "" if si == "1" or isinstance(value, str) else seen.of(si)
            rows.append([path, parameter.symbol, shown, unit, parameter.meaning])
    headings = ("key", "symbol", "value", "unit", "meaning")
    return TextTable.of_texts(headings, rows)._replace(title=titled("", units_of(machine)))


# notebook --------------------------------------------------------------------------------------------------


def as_html(sheet: Sheet, figures: int = 1, *, first: bool = False, width: float = math.inf) -> str:
    """A sheet in a notebook or on a page: what came out, facts, tables, the first figures, notes.

    `first`: figures before the tables, where the picture is what was asked for. `width`: pixels for figures
    and tables; what of these has no room beside its first columns goes on below.
    """
    facts = [TextTable("", [Column("", False), Column("")], sheet.facts)] if sheet.facts else []
    parts = [f"<p><b>{html.escape(sheet.title)}</b></p>"]
    parts += [f"<p>{html.escape(text)}</p>" for text in (sheet.status, *sheet.conclusions) if text]
    tables = [
        html_table(block)
        for table in (*facts, *sheet.tables)
        for block in blocks_of(table, _pixels(table), width)
    ]  # fmt: skip
    pictures = [
        f'<figure tabindex="0" role="img" aria-label="{html.escape(f"{sheet.title}: {stem}")}">'
        f"{svg_of(draw() if math.isinf(width) else narrowed(draw()), stem)}</figure>"
        for stem, draw in tuple(sheet.figures.items())[:figures]
    ]
    parts += [*pictures, *tables] if first else [*tables, *pictures]
    parts += [f"<p>{html.escape(text)}</p>" for text in sheet.notes]
    return "\n".join(parts)


def _pixels(table: TextTable) -> list[float]:
    """What each column of a table needs at least: its longest word, as a browser breaks lines."""
    found = []
    for i, (heading, is_number) in enumerate(table.columns):
        cells = " ".join([heading, *(row[i] for row in table.rows)])
        words = re.split(r"\s" if is_number else r"\s|(?<=-)", cells)
        found.append(PADDING + LETTER * max(map(len, words)))
    return found


def html_table(table: TextTable, look: str = "", typeset: Callable[[str], str] = html.escape) -> str:
    """A table as HTML; its first cells name the rows.

    Cells have their alignment themselves, since a notebook knows no classes. `look`: the class of the table;
    `typeset` makes HTML of a text.
    """
    columns = table.columns

    def row(cells: Iterable[str], tags: Iterable[str], strong: str = "") -> str:
        html_cells = ""
        for column, cell, tag in zip(columns, cells, tags, strict=True):
            kind, side = ("number", "right") if column.number else ("text", "left")
            text = typeset(printed(cell) if column.number else cell)
            html_cells += f'<{tag} class="{kind}" style="text-align: {side}">{text}</{tag[:2]}>'
        return f"<tr{strong}>{html_cells}</tr>"

    headings = [column.in_a_line for column in columns]
    head = f"<thead>{row(headings, [COLUMN_HEAD] * len(columns))}</thead>" if any(headings) else ""
    caption = f"<caption>{typeset(table.title)}</caption>" if table.title else ""
    tags, strong = [ROW_HEAD, *["td"] * (len(columns) - 1)], ' class="strong" style="font-weight: 700"'
    rows = (row(cells, tags, strong if i in table.bold else "") for i, cells in enumerate(table.rows))
    named = f' class="{look}"' if look else ""
    return f"<table{named}>{caption}{head}<tbody>{''.join(rows)}</tbody></table>"
