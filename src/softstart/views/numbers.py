"""Numbers and text as people and programs read them: decimals, dashes, JSON. Imports nothing heavy."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

NOTHING = "-"


class Column(NamedTuple):
    """A column: its heading (may hold line breaks), and whether its cells are numbers, set to the right."""

    heading: str
    number: bool = True

    def width(self, cells: Sequence[str]) -> int:
        """Letters that the column needs."""
        return max(len(line) for text in (self.heading, *cells) for line in text.split("\n"))


class Table(NamedTuple):
    """A titled table of text cells; rows numbered in `bold` stand out, a terminal shows the first `most`."""

    title: str
    columns: list[Column]
    rows: Sequence[Sequence[str]]
    bold: Sequence[int] = ()
    most: int | None = None

    @classmethod
    def of(
        cls, title: str, cells: Mapping[str, Sequence[str]], texts: Sequence[str] = (), **options: Any
    ) -> Table:
        """From the cells below each heading; columns named in `texts` hold text, the others numbers."""
        columns = [Column(heading, heading not in texts) for heading in cells]
        return cls(title, columns, [list(row) for row in zip(*cells.values(), strict=True)], **options)

    @classmethod
    def of_rows(
        cls, title: str, texts: Sequence[str], numbers: Sequence[str], rows: Sequence[Sequence[str]]
    ) -> Table:
        """From rows; the headings of the first columns, which hold text, and of the others, numbers."""
        return cls(title, [*(Column(one, False) for one in texts), *map(Column, numbers)], rows)

    @classmethod
    def of_texts(cls, headings: Sequence[str], rows: Sequence[Sequence[str]]) -> Table:
        """Rows of text, without a title."""
        return cls("", [Column(heading, False) for heading in headings], rows)


def number(value: float | None, decimals: int) -> str:
    """A number with so many decimals; a dash for a missing value.

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

    A cell that would be left with less than two significant digits has three of its own; what is a millionth
    of the largest, and below 1e-7, is rounding and 0.

    >>> column_of([0.36774, 0.0166, float("nan")]), column_of([164.83, 62.0]), column_of([2e-7, 1e-9])
    (['0.3677', '0.0166', '-'], ['164.8', '62.0'], ['2.000e-07', '1.000e-09'])
    >>> column_of([251.3, 0.01984, 0.02213, 3e-17])
    ['251.3', '0.0198', '0.0221', '0.0']
    """
    finite = [abs(v) for v in values if v is not None and math.isfinite(v) and v != 0.0]
    if not finite:
        return [number(v, 0) for v in values]
    largest = max(finite)
    order = math.floor(math.log10(largest))
    if not -4 <= order <= 6:
        return [NOTHING if v is None or math.isnan(v) else f"{v:.{digits - 1}e}" for v in values]
    noise = min(1e-6 * largest, 1e-7)
    return [_cell(v, max(0, digits - 1 - order), noise) for v in values]


def _cell(value: float | None, decimals: int, noise: float) -> str:
    if value is None or not noise < abs(value) < 10.0 ** (1 - decimals):
        return number(value, decimals)
    own = math.floor(math.log10(abs(value)))
    return number(value, max(decimals, 2 - own)) if own >= -4 else f"{value:.2e}"


def first_of(count: int, shown: int) -> str:
    """What the title of a table says where it shows only the first rows; else nothing."""
    return f" (the first {shown} of {count}; --json and --out give all)" if count > shown else ""


def short(value: float) -> str:
    """One number for a line of text, at most six digits.

    >>> short(368.465), short(0.175), short(92.15338450)
    ('368.465', '0.175', '92.1534')
    """
    return f"{value:.6g}"


def label(name: str, unit: str = "", between: str = ", ") -> str:
    r"""A figure or a parameter in words, with its unit, as axes and headings name it.

    >>> label("k_dyn_first_contact"), label("load_inertia J2", "kg*m^2"), label("controller_time", "s", "\n")
    ('K_dyn first contact', 'load inertia J2, kg m2', 'time\ns')
    """
    words = name.removeprefix("controller_").replace("_", " ").replace("k dyn", "K_dyn")
    return words if unit in ("", "1") else f"{words}{between}{unit.replace('*', ' ').replace('^', '')}"


def printable(text: str) -> str:
    r"""The text without control characters, which could steer the terminal.

    >>> printable("a\x1b[31mb")
    'a [31mb'
    """
    return "".join(c if c.isprintable() or c == "\n" else " " for c in text)


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
