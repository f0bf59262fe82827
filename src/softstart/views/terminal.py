"""Text for people: plain in a pipe, with lines and bold on a terminal."""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from textwrap import wrap
from typing import TYPE_CHECKING, Any

from softstart.late import late
from softstart.views.numbers import Column, Table, first_of, plain, printable

if TYPE_CHECKING:
    import rich.console as rich_console
    import rich.table as rich_table
    import rich.text as rich_text
    from rich import box
else:
    box, rich_console = late("rich.box"), late("rich.console")
    rich_table, rich_text = late("rich.table"), late("rich.text")

NARROWEST, IN_A_PIPE = 80, 100
GUTTER, LONGEST_NAME, SHORTEST_TEXT = 2, 28, 12


def console() -> rich_console.Console:
    """Standard output. Square brackets are text here, not markup: sources are called [G]."""

    class Pipe(rich_console.Console):
        """Leaves it to `main` to end quietly when the reader goes away."""

        def on_broken_pipe(self) -> None:
            raise BrokenPipeError

    made = Pipe(file=sys.stdout, highlight=False, markup=False, emoji=False, soft_wrap=False)
    if made.is_terminal or "COLUMNS" in made._environ:
        made.width = max(NARROWEST, made.width)
    else:
        made.width = IN_A_PIPE
    return made


def print_json(data: Any) -> None:
    """One JSON object on standard output."""
    print(json.dumps(plain(data), indent=2, allow_nan=False))


def print_table(to: rich_console.Console, shown: Table, *, headings: bool = True) -> None:
    """A table; bold rows stand out on a terminal. Text is wrapped, numbers are never cut.

    Of a table that is too wide the first columns, as far as they hold text, are printed again before those
    that have no room beside them.
    """
    rows = shown.rows[: shown.most]
    cut = first_of(len(shown.rows), len(rows))
    for index, block in enumerate(_blocks(shown._replace(rows=rows), to.width)):
        if index:
            to.print()
        title = f"{shown.title}, continued" if index else shown.title + cut
        _print_block(to, block._replace(title=title), headings)


def _blocks(table: Table, width: int) -> list[Table]:
    """The table in blocks of columns that fit; the text columns on the left stand in each of them."""
    columns, rows = table.columns, table.rows
    needed = [_least(column, [row[i] for row in rows], i) + GUTTER for i, column in enumerate(columns)]
    keys = next((i for i, column in enumerate(columns) if column.number), len(columns)) or 1
    blocks, used = [list(range(keys))], sum(needed[:keys])
    for i in range(keys, len(columns)):
        if used + needed[i] - GUTTER > width and len(blocks[-1]) > keys:
            blocks.append(list(range(keys)))
            used = sum(needed[:keys])
        blocks[-1].append(i)
        used += needed[i]
    return [
        table._replace(columns=[columns[i] for i in block], rows=[[row[i] for i in block] for row in rows])
        for block in blocks
    ]


def _least(column: Column, cells: Sequence[str], index: int) -> int:
    """Letters that a column needs at least: numbers all, text may be wrapped."""
    width = column.width(cells)
    return width if column.number else min(width, LONGEST_NAME if index == 0 else SHORTEST_TEXT)


def _print_block(to: rich_console.Console, shown: Table, headings: bool) -> None:
    columns, rows = shown.columns, shown.rows
    framed = to.is_terminal and not to.options.ascii_only
    table = rich_table.Table(
        box=box.SIMPLE_HEAD if framed else None,
        pad_edge=False,
        padding=(0, 1, 0, 0) if framed else (0, GUTTER, 0, 0),
        show_edge=False,
        show_header=headings,
        header_style="",
    )
    depth = max(column.heading.count("\n") for column in columns)
    least = [_least(column, [row[i] for row in rows], i) for i, column in enumerate(columns)]
    for column, width in zip(columns, least, strict=True):
        table.add_column(
            "\n" * (depth - column.heading.count("\n")) + column.heading,
            justify="right" if column.number else "left",
            no_wrap=column.number,
            overflow="fold",
            min_width=width,
        )
    for index, row in enumerate(rows):
        table.add_row(*row, style="bold" if index in shown.bold else "")
    if shown.title:
        to.print(rich_text.Text(shown.title, style="bold"))
    needed = sum(least) + GUTTER * (len(least) - 1)
    before, to.width = to.width, max(to.width, needed)  # print(width=...) keeps to the console's own
    try:
        if framed:
            to.print(table, crop=False)
            return
        with to.capture() as captured:
            to.print(table, crop=False)
    finally:
        to.width = before
    print("\n".join(line.rstrip() for line in captured.get().rstrip().splitlines()))


def print_tables(to: rich_console.Console, tables: Sequence[Table]) -> None:
    """Tables with their titles, each after an empty line; empty ones are left out."""
    for table in tables:
        if table.rows:
            to.print()
            print_table(to, table)


def sentence(to: rich_console.Console, text: str, style: str = "") -> None:
    """A paragraph, wrapped; further lines are indented like the first."""
    clean = printable(text)
    indent = " " * (len(clean) - len(clean.lstrip()))
    lines = wrap(clean, to.width, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False)
    to.print(rich_text.Text("\n".join(lines), style=style), soft_wrap=True)


def print_lines(to: rich_console.Console, lines: Sequence[str]) -> None:
    """Paragraphs of which the first one is a title."""
    for index, line in enumerate(lines):
        sentence(to, line, "bold" if index == 0 else "")


def print_figures(to: rich_console.Console, rows: Sequence[Sequence[str]]) -> None:
    """Figures, each a name and its value."""
    print_table(to, Table.of_texts(("", ""), rows), headings=False)


def print_conclusion(to: rich_console.Console, found: Sequence[str], notes: Sequence[str]) -> None:
    """What came out, and below it the notes."""
    if found or notes:
        to.print()
    for text in found:
        sentence(to, text, "bold")
    for note in notes:
        sentence(to, note, "dim")


def print_commands(to: rich_console.Console, commands: Sequence[tuple[str, str]]) -> None:
    """What to type next, each command whole on a line of its own, and what it gives."""
    wide = max(len(command) for command, _ in commands)
    to.print("\nNext:")
    for command, gives in commands:
        to.print(f"  {command:{wide}}   {gives}", soft_wrap=True)
