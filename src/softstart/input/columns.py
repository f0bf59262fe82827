"""Columns of numbers in text files, as programs and spreadsheets write them: the one reader of CSV files."""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Sequence
from typing import Literal, NamedTuple

import numpy as np

from softstart.arrays import Vector
from softstart.errors import InputError
from softstart.quantities import RefusedError, parse, read_unit, show, with_points

_NUMBER = re.compile(r"[+-]?[.,]?[0-9]|[+-]?(inf|nan)\b", re.IGNORECASE)
Heading = Literal["any", "names"]
SHARES = ("%", "‰")  # of a torque that a file does not name
CLOCK = re.compile(
    r"(?:[0-9]{1,4}[-./][0-9]{1,2}[-./][0-9]{1,4},?[ T])?\s*"
    r"([0-9]{1,2}):([0-9]{2}):([0-9]{2})(?:[.,:]([0-9]+))?(?:Z|[+-][0-9]{2}:?[0-9]{2})?"
)
_BRACKETS = r"\[[^\]]*\]|\([^)]*\)"
# a cell between spaces: a date with its time, what is in quotes, a name with its unit, a unit
_SPACED = re.compile(
    rf"{CLOCK.pattern}(?!\S)|\"[^\"]*\"|[^\s\[(\"][^\s\[(]*(?:\s*(?:{_BRACKETS}))*\S*|{_BRACKETS}|\S+"
)

Row = tuple[int, list[str]]  # the number of a line, and its cells


class Wanted(NamedTuple):
    """A column to be read: the names that it may have, its own first, and its SI unit."""

    names: tuple[str, ...]
    unit: str


class Columns(NamedTuple):
    """The numbers of each column that was wanted, in SI, and the line that each row stands in."""

    lines: list[int]
    values: list[Vector]


def read_columns(
    text: str, where: str, wanted: Sequence[Wanted], *, headed: Heading = "any", missing: bool = False
) -> Columns:
    """The columns of a text in SI; `where` is put before each sentence of an `InputError`.

    Semicolons, tabs, commas or else spaces divide columns; between semicolons and tabs, or in quotes, numbers
    may have decimal commas. Blank lines and lines that begin with # are passed over. A first line without
    numbers names the columns, with units as `torque [kN*m]`, or in the line below it; if there are no more
    columns than wanted, other names will do, in this order. Without it there are exactly the columns wanted,
    in SI. `headed`: it must be there and give "names". `missing`: an empty cell, or "nan", is NaN. What can
    be read in two ways is refused.

    >>> time, torque = Wanted(("time", "t"), "s"), Wanted(("torque", "u"), "N*m")
    >>> read_columns("t [ms];u [N*m]\\n0;1,5\\n9;2,5", "here", [time, torque])
    Columns(lines=[2, 3], values=[array([0.   , 0.009]), array([1.5, 2.5])])
    >>> read_columns("t [ms] u [N*m]\\n  0  1.5\\n  9  2.5", "here", [time, torque]).values[0].tolist()
    [0.0, 0.009]
    >>> read_columns("0,0,10,5", "here", [time, torque])
    Traceback (most recent call last):
    softstart.errors.InputError: here: line 1, "0,0,10,5", has 4 values instead of 2, time and torque; with
    decimal commas divide the values by semicolons, as 0,5;10,5, or write decimal points.
    """
    numbered = enumerate(text.splitlines(), start=1)
    lines = [(n, line) for n, line in numbered if line.strip() and not line.lstrip().startswith("#")]
    mark = next((mark for mark in (";", "\t", ",") if any(mark in line for _, line in lines)), " ")
    rows = split_rows(lines, mark, where)
    heading = [cell.strip() for cell in rows[0][1]] if rows else []
    first = show(mark.join(heading))
    units = [""] * len(wanted)
    if rows and not any(map(_NUMBER.match, heading)):
        rows = rows[1:]
        heading, units = map(list, zip(*map(split_heading, heading), strict=True))
        if rows and len(rows[0][1]) == len(heading) and not any(units) and are_units(rows[0][1]):
            units = [split_heading(f"[{cell.strip('[]() ')}]")[1] for cell in rows[0][1]]
            rows = rows[1:]
    else:
        heading = [""] * len(wanted)
    try:
        places = _places(heading, units, wanted, headed)
    except RefusedError as refusal:
        raise InputError(f"{where}: its first line is {first}: {refusal.reason}.") from None
    if not rows:
        names = " and ".join(one.names[0] for one in wanted)
        raise InputError(f"{where}: there are no numbers in it; write a line for each {names}.")
    table = CellTable(rows, len(heading), mark)
    return read_numbers(table, where, wanted, places, [units[place] for place in places], missing=missing)


class CellTable(NamedTuple):
    """Lines of cells: each has this number of them, divided by this mark."""

    rows: list[Row]
    width: int
    mark: str


def read_numbers(
    table: CellTable,
    where: str,
    wanted: Sequence[Wanted],
    places: Sequence[int],
    units: Sequence[str],
    *,
    missing: bool,
) -> Columns:
    """The columns at these places, which have these units, in SI."""
    rows, width, mark = table
    names = " and ".join(one.names[0] for one in wanted)
    refused = []
    for number, row in rows:
        if len(row) != width:
            shown, count = show(mark.join(row)), f"{len(row)} value{'s' * (len(row) > 1)}"
            reason = f"line {number}, {shown}, has {count} instead of {width}, {names}"
            if mark == "," and len(row) > width:
                reason += "; with decimal commas divide the values by semicolons, as 0,5;10,5, or write "
                reason += "decimal points"
            refused.append(reason)
    values = []
    try:
        cells = [] if refused else with_points([row[place].strip() for place in places for _, row in rows])
    except RefusedError as refusal:
        refused.append(refusal.reason)
    for one, unit, place in (
        () if refused else zip(wanted, units, range(0, len(cells), len(rows)), strict=True)
    ):
        column = np.full(len(rows), math.nan)
        for i, cell in enumerate(cells[place : place + len(rows)]):
            if not (missing and cell.lower() in ("", "nan")):
                try:
                    column[i] = parse(f"{cell} {unit}", one.unit)
                except RefusedError as refusal:
                    refused.append(f"line {rows[i][0]}, {one.names[0]} = {show(cell)}: {refusal.reason}")
        values.append(column)
    if refused:
        more = f"; {len(refused) - 1} more like this" if refused[1:] else ""
        raise InputError(f"{where}: {refused[0]}{more}.")
    return Columns([number for number, _ in rows], values)


def split_heading(cell: str) -> tuple[str, str]:
    """Name and unit of a column.

    >>> split_heading("torque [N*m]"), split_heading("t (ms)"), split_heading("n")
    (('torque', 'N*m'), ('t', 'ms'), ('n', ''))
    """
    part = re.fullmatch(r"(.*?)\s*(?:[\[(](.*)[\])])?\s*", cell, re.DOTALL)
    return (part[1], part[2] or "") if part else ("", "")


def are_units(cells: Sequence[str]) -> bool:
    """Whether a line is one of units, below that of the names.

    >>> are_units(["s", "Nm", "[1/min]", "%"]), are_units(["t", "torque"]), are_units(["1", "1"])
    (True, False, False)
    """
    units = [cell.strip("[]() ") for cell in cells]
    known = (one in ("", "-", *SHARES) or not isinstance(read_unit(one), str) for one in units)
    return any(re.search(r"[^\W\d]|[%‰°]", one) for one in units) and all(known)


def cells_of(line: str, mark: str) -> list[str]:
    """The cells of a line, divided by a mark, or by any number of spaces and tabs if it is a space.

    >>> cells_of(" 0.0   1.5e+00 -2", " "), cells_of("t [ms] M (N m)  n", " "), cells_of("0, 1", ",")
    (['0.0', '1.5e+00', '-2'], ['t [ms]', 'M (N m)', 'n'], ['0', '1'])
    """
    if mark == " ":
        return [part[0].strip('"') for part in _SPACED.finditer(line)]
    return next(csv.reader([line], delimiter=mark, skipinitialspace=True))


def split_rows(lines: Sequence[tuple[int, str]], mark: str, where: str) -> list[Row]:
    """The cells of numbered lines, divided by a mark."""
    try:
        rows = [(n, cells_of(line, mark)) for n, line in lines]
    except csv.Error as error:
        raise InputError(f"{where}: it cannot be read as columns of numbers ({error}).") from None
    if all(len(row) > 1 and not row[-1].strip() for _, row in rows):  # a mark at the end of each line
        rows = [(n, row[:-1]) for n, row in rows]
    return rows


def _places(
    names: Sequence[str], units: Sequence[str], wanted: Sequence[Wanted], headed: Heading
) -> list[int]:
    """Which columns are wanted; their units are checked."""
    column_of: dict[int, int] = {}  # the column of each one wanted
    for k, one in enumerate(wanted):
        matches = [i for i, name in enumerate(names) if name in one.names] or [
            i for i, name in enumerate(names) if name.lower() in map(str.lower, one.names)
        ]
        if len(matches) > 1:
            raise RefusedError(f"it names {one.names[0]} twice; keep one of the two columns")
        column_of.update((k, i) for i in matches)
    if headed == "any" and len(names) == len(wanted):  # other names, in the order wanted
        free = iter(sorted(set(range(len(wanted))) - set(column_of.values())))
        column_of |= {k: next(free) for k in range(len(wanted)) if k not in column_of}
    places = [column_of[k] for k in sorted(column_of)]
    if len(places) < len(wanted):
        raise RefusedError(f"it must name the columns, as {','.join(one.names[0] for one in wanted)}")
    for one, place in zip(wanted, places, strict=True):
        try:
            parse(f"1 {units[place]}", one.unit)
        except RefusedError as refusal:
            raise RefusedError(f"unit of {one.names[0]} = {show(units[place])}: {refusal.reason}") from None
    return places
