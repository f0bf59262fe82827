"""Text for people: plain in a pipe, with lines and bold on a terminal."""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from textwrap import wrap
from typing import TYPE_CHECKING, TextIO

from softstart.views.numbers import Column, TextTable, json_ready, printable

if TYPE_CHECKING:
    from rich.console import Console

NARROWEST, IN_A_PIPE = 80, 100
GUTTER, LONGEST_NAME, SHORTEST_TEXT = 2, 28, 12


def console(stream: TextIO | None = None) -> Console:
    """Standard output, or a text. Square brackets are text here, not markup: sources are called [G]."""
    from rich.console import Console

    class Pipe(Console):
        """Leaves it to `main` to end quietly when the reader goes away."""

        def on_broken_pipe(self) -> None:
            raise BrokenPipeError

    made = Pipe(file=stream or sys.stdout, highlight=False, markup=False, emoji=False, soft_wrap=False)
    known = stream is None and (made.is_terminal or "COLUMNS" in made._environ)
    made.width = max(NARROWEST, made.width) if known else IN_A_PIPE
    return made


def print_json(data: object) -> None:
    """One JSON object on standard output."""
    print(json.dumps(json_ready(data), indent=2, allow_nan=False))


def print_table(to: Console, shown: TextTable, *, headings: bool = True) -> None:
    """A table; bold rows stand out on a terminal. Text is wrapped, numbers are never cut.

    Of a table that is too wide its keys are printed again before the columns that have no room beside them.
    """
    rows, count = shown.rows[: shown.most], len(shown.rows)
    cut = f" (the first {len(rows)} of {count}; --json and --out give all)" if count > len(rows) else ""
    shown = shown._replace(rows=rows)
    needed = [one + GUTTER for one in _least(shown)]
    for index, block in enumerate(blocks_of(shown, needed, to.width + GUTTER)):
        if index:
            to.print()
        _print_block(to, block if index else block._replace(title=block.title + cut), headings)


def blocks_of(table: TextTable, needed: Sequence[float], width: float) -> list[TextTable]:
    """The table in blocks of columns that fit beside each other; its keys stand in each of them.

    `needed` is what each column needs of the `width`. Keys are the first columns that hold text, or
    `TextTable.keys`.
    """
    columns, rows = table.columns, table.rows
    keys = table.keys or next((i for i, column in enumerate(columns) if column.number), len(columns)) or 1
    blocks, used = [list(range(keys))], sum(needed[:keys])
    for i in range(keys, len(columns)):
        if used + needed[i] > width and len(blocks[-1]) > keys:
            blocks.append(list(range(keys)))
            used = sum(needed[:keys])
        blocks[-1].append(i)
        used += needed[i]
    return [
        table._replace(
            title=f"{table.title}, continued".removeprefix(", ") if number else table.title,
            columns=[columns[i] for i in block],
            rows=[[row[i] for i in block] for row in rows],
        )
        for number, block in enumerate(blocks)
    ]


def _least(table: TextTable) -> list[int]:
    """Characters that each column needs at least: numbers all, text may be wrapped."""

    def least(index: int, column: Column) -> int:
        width = column.width([row[index] for row in table.rows])
        return width if column.number else min(width, SHORTEST_TEXT if index else LONGEST_NAME)

    return [least(*one) for one in enumerate(table.columns)]


def _print_block(to: Console, shown: TextTable, headings: bool) -> None:
    from rich import box
    from rich.table import Table as RichTable

    framed, least = to.is_terminal and not to.options.ascii_only, _least(shown)
    table = RichTable(
        box=box.SIMPLE_HEAD if framed else None,
        pad_edge=False,
        padding=(0, 1, 0, 0) if framed else (0, GUTTER, 0, 0),
        show_edge=False,
        show_header=headings,
        header_style="",
    )
    depth = max(column.heading.count("\n") for column in shown.columns)
    for (heading, number), width in zip(shown.columns, least, strict=True):
        table.add_column(
            "\n" * (depth - heading.count("\n")) + heading,
            justify="right" if number else "left",
            no_wrap=number,
            overflow="fold",
            min_width=width,
        )
    for index, row in enumerate(shown.rows):
        table.add_row(*row, style="bold" if index in shown.bold else "")
    if shown.title:
        to.print(shown.title, style="bold")
    needed = sum(least) + GUTTER * (len(least) - 1)
    before, to.width = to.width, max(to.width, needed)  # print(width=...) keeps to the console's own
    try:
        with to.capture() as captured:
            to.print(table, crop=False)
    finally:
        to.width = before
    print("\n".join(line.rstrip() for line in captured.get().rstrip().splitlines()), file=to.file)


def sentence(to: Console, text: str, style: str = "") -> None:
    """A paragraph, wrapped; further lines are indented like the first."""
    clean = printable(text)
    indent = " " * (len(clean) - len(clean.lstrip()))
    lines = wrap(clean, to.width, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False)
    to.print("\n".join(lines), style=style or None, soft_wrap=True)


def print_lines(to: Console, lines: Sequence[str]) -> None:
    """Paragraphs of which the first one is a title."""
    for index, line in enumerate(lines):
        sentence(to, line, "" if index else "bold")
