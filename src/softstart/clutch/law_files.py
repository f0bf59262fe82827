"""A law from a CSV file: instants and friction torques, straight lines between."""

from __future__ import annotations

import csv
import os
import re

from softstart.clutch.parameters import PARAMETERS
from softstart.errors import InputError
from softstart.input.files import text_of
from softstart.quantities import RefusedError, parse, show

__all__ = ["read_law"]

_UNIT = re.compile(r"\[(.+)\]\s*$")
MOST_SENTENCES = 5


def read_law(path: str | os.PathLike[str]) -> tuple[list[float], list[float]]:
    """(times in s, torques in N m) of a CSV file with two columns.

    A first line that holds no numbers is a heading, which may give units, as `t [ms],M [kgf*m]`; without them
    numbers are s and N m. Two lines with the same instant are a step. Raises InputError for all lines that
    are wrong.
    """
    where = show(os.fspath(path))
    rows = [
        row
        for row in enumerate(csv.reader(text_of(path, "a table of the law", "CSV").splitlines()), 1)
        if any(row[1])
    ]
    units = ["", ""]
    if rows and not _is_number(rows[0][1][0]):
        found = [_UNIT.search(cell) for cell in rows[0][1][:2]]
        units = [match.group(1) if match else "" for match in found] + [""] * (2 - len(found))
        rows = rows[1:]
    if not rows:
        raise InputError(f"{where}: there are no numbers in it; write lines of time, torque, as 0.5,200.")
    fields = {p.name: p for p in PARAMETERS}
    columns: tuple[list[float], list[float]] = [], []
    wrong = []
    for number, row in rows:
        if len(row) != 2:
            wrong.append(
                f"{where}, line {number}: {len(row)} columns; write two, time and torque, as 0.5,200."
            )
            continue
        for column, cell, unit, name in zip(columns, row, units, ("law_times", "law_torques"), strict=True):
            field = fields[name]
            text = f"{cell.strip()} {unit}".strip() if _is_number(cell) else cell.strip()
            try:
                column.append(float(parse(text, field.unit)))
            except RefusedError as refusal:
                wrong.append(f"{where}, line {number}, {show(text)}: {refusal.reason}.")
    if wrong:
        more = len(wrong) - MOST_SENTENCES
        raise InputError(
            [*wrong[:MOST_SENTENCES], *([f"{where}: {more} more lines are wrong."] if more > 0 else [])]
        )
    return columns


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
