"""Text for people: plain in a pipe, with lines and bold on a terminal."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from rich.console import Console

    from softstart.drive import Drive

NARROWEST, IN_A_PIPE = 80, 100
GUTTER, LONGEST_NAME, SHORTEST_TEXT = 2, 28, 12
NOTHING = "-"


class Column(NamedTuple):
    """A column: its heading (may hold line breaks), and whether its cells are numbers, set to the right."""

    heading: str
    number: bool = True

    def width(self, cells: Sequence[str]) -> int:
        """Letters that the column needs."""
        return max(len(line) for text in (self.heading, *cells) for line in text.split("\n"))


def console() -> Console:
    """Standard output. Square brackets are text here, not markup: sources are called [G]."""
    from rich.console import Console

    class Pipe(Console):
        """Leaves it to `main` to end quietly when the reader goes away."""

        def on_broken_pipe(self) -> None:
            raise BrokenPipeError

    made = Pipe(file=sys.stdout, highlight=False, markup=False, emoji=False, soft_wrap=False)
    if made.is_terminal or "COLUMNS" in made._environ:
        made.width = max(NARROWEST, made.width)
    else:
        made.width = IN_A_PIPE
    return made


def plain(value: Any) -> Any:
    """Results as JSON has them: NaN and infinity become null, numpy's numbers and arrays plain ones.

    >>> plain({"k_dyn": float("nan"), "stages": (1, 2)})
    {'k_dyn': None, 'stages': [1, 2]}
    """
    if isinstance(value, Mapping):
        return {str(key): plain(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [plain(one) for one in value]
    if hasattr(value, "tolist"):
        return plain(value.tolist())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if value is None or isinstance(value, str | int | bool):
        return value
    return str(value)


def print_json(data: Any) -> None:
    """One JSON object on standard output."""
    print(json.dumps(plain(data), indent=2, allow_nan=False))


def print_table(
    to: Console,
    columns: Sequence[Column],
    rows: Sequence[Sequence[str]],
    *,
    title: str = "",
    bold: Sequence[int] = (),
    headings: bool = True,
) -> None:
    """A table; rows numbered in `bold` stand out on a terminal. Text is wrapped, numbers are never cut."""
    from rich import box
    from rich.table import Table
    from rich.text import Text

    framed = to.is_terminal and not to.options.ascii_only
    table = Table(
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
        to.print(Text(title, style="bold"))
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


def fits(to: Console, columns: Sequence[Column], rows: Sequence[Sequence[str]]) -> bool:
    """Whether a table has room as it is."""
    widths = [column.width([row[i] for row in rows]) for i, column in enumerate(columns)]
    return sum(widths) + GUTTER * (len(columns) - 1) <= to.width


def sentence(to: Console, text: str, style: str = "") -> None:
    """A paragraph, wrapped; further lines are indented like the first."""
    from textwrap import wrap

    from rich.text import Text

    clean = printable(text)
    indent = " " * (len(clean) - len(clean.lstrip()))
    lines = wrap(clean, to.width, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False)
    to.print(Text("\n".join(lines), style=style), soft_wrap=True)


def printable(text: str) -> str:
    """The text without control characters, which could steer the terminal."""
    return "".join(c if c.isprintable() or c == "\n" else " " for c in text)


def number(value: float | None, decimals: int) -> str:
    """A number with so many decimals; a dash for what there is not.

    >>> number(0.01661, 4), number(float("nan"), 4), number(-0.00001, 3)
    ('0.0166', '-', '0.000')
    """
    if value is None or math.isnan(value):
        return NOTHING
    if math.isinf(value):
        return "inf" if value > 0 else "-inf"
    text = f"{value:.{decimals}f}"
    return text.lstrip("-") if not text.strip("-0.") else text


def column_of(values: Sequence[float | None], digits: int = 4) -> list[str]:
    """Numbers of one column: as many decimals for all, `digits` significant ones in the largest.

    >>> column_of([0.36774, 0.0166, float("nan")]), column_of([164.83, 62.0]), column_of([2e-7, 1e-9])
    (['0.3677', '0.0166', '-'], ['164.8', '62.0'], ['2.000e-07', '1.000e-09'])
    """
    finite = [abs(v) for v in values if v is not None and math.isfinite(v) and v != 0.0]
    if not finite:
        return [number(v, 0) for v in values]
    order = math.floor(math.log10(max(finite)))
    if not -4 <= order <= 6:
        return [NOTHING if v is None or math.isnan(v) else f"{v:.{digits - 1}e}" for v in values]
    return [number(v, max(0, digits - 1 - order)) for v in values]


def short(value: float) -> str:
    """One number for a line of text, at most six digits.

    >>> short(368.465), short(0.175), short(92.15338450)
    ('368.465', '0.175', '92.1534')
    """
    return f"{value:.6g}"


def drive_lines(drive: Drive, fitted_to: Drive | None = None) -> list[str]:
    """The drive in a few lines: its name, the parameters that matter, and under which laws it starts.

    With `fitted_to`, also for which drive the controllers are set up.
    """
    extra = []
    if drive.d:
        extra.append(f"d = {short(float(drive.d))} N m s/rad")
    if drive.start_position:
        extra.append(f"starts at twist {short(float(drive.start_position))} rad")
    if drive.torque_lag:
        extra.append(f"torque lag {short(float(drive.torque_lag))} s")
    if math.isfinite(float(drive.torque_rate)):
        extra.append(f"torque rate {short(float(drive.torque_rate))} N m/s")
    if drive.computing_delay:
        extra.append(f"computing delay {short(float(drive.computing_delay))} s")
    if drive.torque_noise:
        extra.append(f"noise of the measured torque {short(float(drive.torque_noise))} N m")
    if drive.initial_load_speed or drive.initial_motor_speed:
        w1, w2 = float(drive.initial_motor_speed), float(drive.initial_load_speed)
        extra.append(f"initial speeds w1 = {short(w1)}, w2 = {short(w2)} rad/s")
    rpm = float(drive.target_speed) * 30.0 / math.pi
    gap, c = short(float(drive.gap)), short(float(drive.c))
    return [
        printable(drive.name),
        f"  motor  J1 = {short(float(drive.J1))} kg m2, starting torque Ms = {short(float(drive.Ms))} N m",
        f"  shaft  c = {c} N m/rad, gap = {gap} rad, contact law {drive.contact_law}",
        f"  load   J2 = {short(float(drive.J2))} kg m2, Mc = {short(float(drive.Mc))} N m, {drive.load_kind}",
        f"  start  to {short(float(drive.target_speed))} rad/s ({rpm:.4g} rpm)",
        *(["  also   " + ", ".join(extra)] if extra else []),
        *([f"  {controllers_set_up(drive, fitted_to)}"] if fitted_to is not None else []),
    ]


def controllers_set_up(drive: Drive | None, fitted_to: Drive) -> str:
    """For which drive the controllers are set up, and by what that differs from the one that runs.

    >>> from softstart import Drive
    >>> crane = Drive.load("crane-4amtkf")
    >>> controllers_set_up(crane.replace(gap=2.0), crane)
    'controllers are set up for "Crane travel drive 4AMTKF(H)112L6": shaft.gap 0.5 there, 2 here'
    """
    from softstart.drive import PARAMETERS

    found = []
    for parameter in PARAMETERS.values() if drive is not None else ():
        there, here = getattr(fitted_to, parameter.name), getattr(drive, parameter.name)
        if parameter.name not in ("name", "source") and there != here:
            shown = [_set(value) for value in (there, here)]
            found.append(f"{parameter.path} {shown[0]} there, {shown[1]} here")
    most = 6
    more = f", and {len(found) - most} more" if len(found) > most else ""
    differs = ": " + "; ".join(found[:most]) + more if found else ""
    return f'controllers are set up for "{printable(fitted_to.name)}"{differs}'


def _set(value: object) -> str:
    return short(value) if isinstance(value, float) else "not set" if value in (None, "") else str(value)
