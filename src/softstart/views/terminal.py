"""Text for people: plain in a pipe, with lines and bold on a terminal."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Sequence
from textwrap import wrap
from typing import TYPE_CHECKING, Any

from softstart.late import late
from softstart.views.numbers import Table, plain, printable

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


def present(
    data: Callable[[], Any], show: Callable[[rich_console.Console], None], as_json: bool, written: str | None
) -> None:
    """A command's answer: the JSON object of `data`, or what `show` prints and which files are `written`."""
    if as_json:
        print_json(data())
        return
    show(console())
    if written is not None:
        print(f"\nWritten to {written}.")


def print_table(
    to: rich_console.Console, shown: Table, *, bold: Sequence[int] = (), headings: bool = True
) -> None:
    """A table; rows numbered in `bold` stand out on a terminal. Text is wrapped, numbers are never cut."""
    title, columns, rows = shown
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
    needed = GUTTER * (len(columns) - 1)
    for index, column in enumerate(columns):
        width = column.width([row[index] for row in rows])
        least = width if column.number else min(width, LONGEST_NAME if index == 0 else SHORTEST_TEXT)
        needed += least
        table.add_column(
            "\n" * (depth - column.heading.count("\n")) + column.heading,
            justify="right" if column.number else "left",
            no_wrap=column.number,
            overflow="fold",
            min_width=least,
        )
    for index, row in enumerate(rows):
        table.add_row(*row, style="bold" if index in bold else "")
    if title:
        to.print(rich_text.Text(title, style="bold"))
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


def fits(to: rich_console.Console, table: Table) -> bool:
    """Whether a table has room as it is."""
    widths = [column.width([row[i] for row in table.rows]) for i, column in enumerate(table.columns)]
    return sum(widths) + GUTTER * (len(widths) - 1) <= to.width


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
