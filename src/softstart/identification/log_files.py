"""The file of a log, as inverters, scopes and spreadsheets write it: its columns, their units, its clock."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
from scipy.integrate import cumulative_trapezoid

from softstart.arrays import Vector
from softstart.errors import InputError
from softstart.hints import nearest
from softstart.input.columns import (
    CLOCK,
    SHARES,
    CellTable,
    Wanted,
    are_units,
    cells_of,
    read_numbers,
    split_heading,
    split_rows,
)  # fmt: skip
from softstart.input.files import read_text
from softstart.quantities import RefusedError, parse, show

SIGNALS: Final = {
    "time": Wanted(("time", "t"), "s"),
    "torque": Wanted(("torque", "u", "demand"), "N*m"),
    "angle": Wanted(("angle", "phi", "position"), "rad"),
    "speed": Wanted(("speed", "w", "omega", "n", "w1", "n1"), "rad/s"),
}
MOTIONS: Final = {"angle": ("rad", "deg", "turn"), "speed": ("rad/s", "rpm", "deg/s", "turn/s")}
FORM: Final = "time [ms];torque [N*m];speed [rpm]"
CLOCKS: Final = "time of a channel"
SEARCHED: Final = 400  # lines in which the numbers must begin
LONGEST_PERIOD: Final = 0.1  # s between samples; a larger number without a unit is one in ms or us
ALIKE, MATCHED = 0.01, 0.01  # error of an angle that is the integral of a speed; of the ratio of their units
NUMBER: Final = r"[+-]?(?:[0-9]+[.,]?[0-9]*|[.,][0-9]+)(?:[eE][+-]?[0-9]+)?"
CELL: Final = re.compile(rf"{NUMBER}|[+-]?(?:nan|inf)|{CLOCK.pattern}|", re.IGNORECASE)
COUNTS: Final = re.compile(r"(counts?|cts?|incr?(ements?)?|ticks?|pulses?)", re.IGNORECASE)


class WantedColumn(NamedTuple):
    """A column as people write it: its name, a factor, and a unit."""

    name: str
    factor: float
    unit: str


class LogTable(NamedTuple):
    """The columns of a file: name and unit of each, and the lines of numbers."""

    names: list[str]
    units: list[str]
    table: CellTable

    def titled(self, i: int) -> str:
        """A column as a sentence calls it."""
        return self.names[i] + (f" [{self.units[i]}]" if self.units[i] else "")

    def unit(self, i: int, key: str) -> str:
        """The unit of a column, in brackets, in the line below or at the end of its name; empty if none."""
        tail = _tail(self.names[i])[1]
        try:
            ends = tail in SHARES or bool(tail and parse(f"1 {tail}", SIGNALS[key].unit))
        except RefusedError:  # a name that ends like a unit
            ends = False
        return self.units[i] or (tail if ends else "")


def read_log(where: str, columns: Mapping[str, str]) -> tuple[dict[str, Vector], list[str]]:
    """Time, torque, and angle or speed of a file in SI, and what was taken for granted."""
    wanted_columns = asked_columns(columns)
    place = f"log = {where}"
    try:
        text = read_text(Path(where), also="cp1252")
        if "\0" in text:
            raise RefusedError(f"this is not a text file; export the signals as CSV, as {FORM}")
        reader = LogReader(*_sheet(text, wanted_columns, place), wanted_columns, place)
        return reader.signals(), reader.notes
    except RefusedError as refusal:
        raise InputError(f"{place}: {refusal.reason}.") from None


def asked_columns(columns: Mapping[str, str]) -> dict[str, WantedColumn]:
    """Name, factor and unit of the columns as people write them.

    >>> asked_columns({"speed": "-n_act [rpm]", "angle": "1/4096 * pos[turn]"})["angle"]
    WantedColumn(name='pos', factor=0.000244140625, unit='turn')
    """
    number = r"(?:[0-9]*\.?[0-9]+(?:[eE][+-]?[0-9]+)?)"
    form = rf"\s*(-?)\s*(?:({number})\s*(?:/\s*({number}))?\s*\*)?\s*(.+?)\s*(?:\[([^\]]*)\])?\s*"
    columns_found = {}
    for key, text in columns.items():
        part = re.fullmatch(form, text)
        if key not in SIGNALS or part is None:
            near = nearest(key, SIGNALS) if key not in SIGNALS else key
            remedy = f"did you mean {near}=NAME?" if near else f"name {', '.join(SIGNALS)}, as speed=n_act."
            raise InputError(f"columns: {key} = {show(text)}: {remedy}")
        minus, above, below, name, unit = part.groups("")
        factor = float(f"{minus}{above or 1}") / (float(below or 1) or math.nan)
        if not (math.isfinite(factor) and factor):
            raise InputError(f"columns: {key} = {show(text)}: its factor is 0 or none.")
        columns_found[key] = WantedColumn(name, factor, unit)
    return columns_found


# ---- where the numbers are, and what they are called ---------------------------------------------------


def _sheet(
    text: str, wanted_columns: Mapping[str, WantedColumn], where: str
) -> tuple[LogTable, dict[str, int]]:
    """The columns of a text, and in which of them each signal stands."""
    lines = text.splitlines()
    rows = [i for i, line in enumerate(lines) if line.strip() and not line.lstrip().startswith("#")]
    if not rows:
        raise RefusedError(f"there are no numbers in it; write them below a line of names, as {FORM}")
    marks = {mark: _first_row([(i, lines[i]) for i in rows[:SEARCHED]], mark) for mark in ";\t, "}
    mark = max(marks, key=lambda one: marks[one][2])
    first, width, count = marks[mark]
    if not count:
        raise RefusedError(
            f"no line of its first {SEARCHED} has numbers in two columns or more, divided by semicolons, "
            f"tabs, commas or spaces; write them below a line of names, as {FORM}"
        )
    last = max(i for i in rows if sum(map(bool, _cells(lines[i], mark))) > 1)  # behind it words, as EOF
    numbers = split_rows([(i + 1, lines[i]) for i in rows if first <= i <= last], mark, where)
    width = len(numbers[0][1])  # without a mark at the end of each line
    above = [_heading(lines[i].lstrip("# "), mark, width) for i in range(first) if lines[i].strip()]
    headings = list(_headings([row for row in above if len(row) >= width], width))
    if not headings:
        raise RefusedError(f"no line above the numbers names the columns, as {FORM.replace(';', mark)}")
    refusals = []
    for names, units in headings:
        sheet = LogTable(names, units, CellTable(numbers, width, mark))
        try:
            places = _places(names, wanted_columns)
            _check_clocks(sheet, places)
            return sheet, places
        except RefusedError as refusal:
            refusals.append(refusal)
    raise refusals[0]


def _cells(line: str, mark: str) -> list[str]:
    return [cell.strip() for cell in cells_of(line, mark)]


def _heading(line: str, mark: str, width: int) -> list[str]:
    """The cells of a line above so many columns; between wide gaps names may have spaces.

    >>> _heading("% time  M  n", " ", 3), _heading("Motor torque [Nm]   Motor speed [rpm]", " ", 2)
    (['time', 'M', 'n'], ['Motor torque [Nm]', 'Motor speed [rpm]'])
    """
    if mark != " ":
        return _cells(line, mark)
    bare = re.sub(r"^[%!]\s*", "", line)  # of a comment, if no unit is meant
    ways = [re.split(r"\s{2,}|\t", bare.strip()), _cells(bare, mark), _cells(line, mark)]
    return next((way for way in ways if len(way) == width), ways[-1])


def _first_row(lines: Sequence[tuple[int, str]], mark: str) -> tuple[int, int, int]:
    """Where the numbers begin, how many a line has, and how many such lines there are; 0 if none."""
    widths = {}
    for i, line in lines:
        cells = _cells(line, mark)
        if sum(map(bool, cells)) > 1 and all(map(CELL.fullmatch, cells)):
            widths[i] = len(cells)
    if not widths:
        return 0, 0, 0
    counts = list(widths.values())
    width = max(counts, key=counts.count)
    order = [i for i, _ in lines]
    alike = [i for i in order if widths.get(i) == width]
    # a line of numbers alone, among lines of words, is none of them
    first = next(i for k, i in enumerate(order) if i in alike and (i == alike[-1] or order[k + 1] in alike))
    return first, width, len(alike)


def _headings(above: Sequence[list[str]], width: int) -> Iterator[tuple[list[str], list[str]]]:
    """Names and units that the lines above the numbers may give to the columns, the likeliest first."""
    if channels := [row for row in above if row[0] and row.count(row[0]) > 1]:
        yield _channels(channels, width)
    rows = [row[:width] for row in above if not any(row[width:])]
    for k in range(len(rows) - 1, -1, -1):
        names, units = map(list, zip(*map(split_heading, rows[k]), strict=True))
        for other in rows[max(k - 1, 0) : k + 2]:
            if other is not rows[k] and are_units(other) and not are_units(rows[k]):
                units = [unit or cell.strip("[]() ") for unit, cell in zip(units, other, strict=True)]
        if not are_units(rows[k]) or len(rows) == 1:
            yield names, units


def _channels(rows: Sequence[list[str]], width: int) -> tuple[list[str], list[str]]:
    """Of a block with a line for each property: the name of the property, and beside it its value.

    In the column under the name of the property stand the times of the channel.

    >>> _channels([["Name", "M", "Name", "n"], ["Unit", "%", "Unit", "rpm"]], 4)
    (['time', 'M', 'time of a channel', 'n'], ['', '%', '', 'rpm'])
    """
    of = {row[0].casefold(): row for row in reversed(rows)}
    named = of.get("name", rows[0])
    names, units = [""] * width, [""] * width
    keys = [i for i, cell in enumerate(named) if cell == named[0] and i + 1 < width]
    for i in keys:
        names[i + 1] = named[i + 1]
        units[i + 1] = next((of[one][i + 1] for one in ("unit", "units") if one in of), "")
    for i in keys:
        names[i] = CLOCKS if i else "time"
    units[keys[0]] = next((split_heading(one)[1] for one in of if one.startswith("sampletime")), "")
    return names, units


def _check_clocks(sheet: LogTable, places: Mapping[str, int]) -> None:
    """Refuse channels whose samples are of other times than those of the first."""
    for key in (key for key in places if sheet.names[places[key] - 1] == CLOCKS):
        i = places[key] - 1
        if any(row[i] != row[places["time"]] for _, row in sheet.table.rows if len(row) > i):
            raise RefusedError(
                f"{show(sheet.names[i + 1])} has samples at other times than the first channel; export the "
                "channels with one sample time"
            )


def _tail(name: str) -> tuple[str, str]:
    """A name and the unit that may be its end.

    >>> _tail("t / ms"), _tail("speed_rpm"), _tail("M in Nm"), _tail("phi_r"), _tail("n_act")
    (('t', 'ms'), ('speed', 'rpm'), ('M', 'Nm'), ('phi_r', ''), ('n_act', ''))
    """
    part = re.fullmatch(r"(.+?)(\s*/\s*|\s+in\s+|,\s*|[\s_])([^\s_]+)", name)
    # r, of a rotor, is a revolution too
    if part is None or (len(part[3]) == 1 and part[2] in ("_", " ") and part[3] not in SHARES):
        return name, ""
    return (part[1], part[3]) if are_units([part[3]]) else (name, "")


def _places(names: Sequence[str], wanted_columns: Mapping[str, WantedColumn]) -> dict[str, int]:
    """In which column each signal stands."""
    places: dict[str, list[int]] = {}
    for key, signal in SIGNALS.items():
        names_known = [wanted_columns[key].name] if key in wanted_columns else signal.names
        known = [name.lower() for name in names_known]
        # T is a torque beside t, a time, as in the traces of a start
        whole = [i for i, name in enumerate(names) if name in names_known]
        whole = whole or [i for i, name in enumerate(names) if name.lower() in known]
        places[key] = whole or [i for i, name in enumerate(names) if _tail(name)[0].lower() in known]
    motions = [key for key in ("angle", "speed") if key in wanted_columns]
    motions = motions or [key for key in ("angle", "speed") if places[key]]
    wanted, wrong = ("time", "torque", *motions), list[str]()
    for key in wanted:
        if len(places[key]) != 1:
            many = f"{len(places[key])} are" if places[key] else "none is"
            wrong.append(f"{many} called {wanted_columns[key].name if key in wanted_columns else key}")
    if len(motions) != 1:
        wrong.append(f"they name {'both' if motions else 'neither'} of angle and speed")
    if wrong:
        raise RefusedError(
            f"there are the columns {', '.join(filter(None, names))}; {' and '.join(wrong)}; set columns "
            'to "time=NAME [ms],torque=NAME,speed=NAME [rpm]" with names of this file'
        )
    return {key: places[key][0] for key in wanted}


# ---- numbers and units ----------------------------------------------------------------------------------


@dataclass(frozen=True)
class LogReader:
    """Reads the signals of a table in SI; `notes` says what was taken for granted."""

    sheet: LogTable
    places: Mapping[str, int]  # of each signal, the index of its column
    wanted_columns: Mapping[str, WantedColumn]
    where: str
    notes: list[str] = field(default_factory=list)

    def signals(self) -> dict[str, Vector]:
        """Time, torque, and angle or speed."""
        time = self._seconds()
        signals = {"time": time}
        for key in [key for key in self.places if key != "time"]:
            raw = self._numbers(self.places[key], key)
            signals[key] = self._wanted(key).factor * self._unit_size(key, time, raw) * raw
        return signals

    def _wanted(self, key: str) -> WantedColumn:
        return self.wanted_columns.get(key, WantedColumn("", 1.0, ""))

    def _seconds(self) -> Vector:
        """The times, of a clock or in a unit, s."""
        place = self.places["time"]
        _, factor, unit = self._wanted("time")
        cells = [row[place].strip() if place < len(row) else "" for _, row in self.sheet.table.rows]
        clocks = [CLOCK.fullmatch(cell) for cell in cells]
        if any(clocks):
            if wrong := [i for i, one in enumerate(clocks) if one is None]:
                number, cell = self.sheet.table.rows[wrong[0]][0], show(cells[wrong[0]])
                raise RefusedError(f"line {number}, time = {cell}: this is no time of day, as 10:00:00.004")
            return np.array([
                3600.0 * int(h) + 60.0 * int(m) + int(s) + float(f"0.{rest or 0}")
                for h, m, s, rest in (one.groups() for one in clocks if one)
            ])  # fmt: skip
        ticks = self._numbers(place, "time")
        if unit := unit or self.sheet.unit(place, "time"):
            return factor * _in_si(unit, "time", self.sheet.titled(place)) * ticks
        steps = np.diff(ticks)
        period = abs(factor) * float(np.median(steps[steps > 0.0])) if np.any(steps > 0.0) else 0.0
        sizes = {"s": 1.0, "ms": 1e-3, "us": 1e-6}
        unit = next((one for one, size in sizes.items() if period * size < LONGEST_PERIOD), "us")
        self.notes.append(f"{show(self.sheet.names[place])} has no unit and was taken for a time in {unit}")
        return factor * sizes[unit] * ticks

    def _unit_size(self, key: str, time: Vector, raw: Vector) -> float:
        """One of the unit of a column in SI: as asked for, as the file says, or as other columns tell."""
        place, unit = self.places[key], self._wanted(key).unit
        if unit:
            return _in_si(unit, key, self.sheet.titled(place))
        name, unit = self.sheet.names[place], self.sheet.unit(place, key)
        if key == "torque" and not unit:
            self.notes.append(
                f"{show(name)} has no unit and was taken for a torque in N m, which no motion can check; if "
                f'it is in % or a current, set columns to "torque={name}[% of 35 N*m]" or '
                f'"torque=1.2*{name}[N*m]"'
            )
            return 1.0
        if key == "torque":
            return _in_si(unit, key, self.sheet.titled(place))
        return self._motion_unit_size(key, time, raw)

    def _motion_unit_size(self, key: str, time: Vector, raw: Vector) -> float:
        """The unit of an angle or a speed in SI; a column that is its derivative or integral checks it."""
        place, other = self.places[key], "speed" if key == "angle" else "angle"
        title, si, name = self.sheet.titled(place), SIGNALS[key].unit, self.sheet.names[place]
        unit = self.sheet.unit(place, key)
        size = _in_si(unit, key, title) if unit else None
        hints = []
        for i, ratio in self._derivatives_and_integrals(key, time, raw):
            beside = show(self.sheet.titled(i))
            try:
                beside_in = self.sheet.unit(i, other) or self.sheet.units[i]
                known = float(parse(f"1 {beside_in}", SIGNALS[other].unit)) if beside_in else None
            except RefusedError:
                continue
            if known is None:
                pairs = [
                    f"{name} in {one} with {self.sheet.names[i]} in {two}"
                    for one in MOTIONS[key] for two in MOTIONS[other]
                    if _matches(_unit(two, other) / _unit(one, key), 1.0 / ratio)
                    and not _matches(ratio, 1.0)
                ]  # fmt: skip
                hints += [f"the column {beside} beside it fits {pairs[0]}"] if len(pairs) == 1 else []
                continue
            right = known * ratio
            unit = next((one for one in MOTIONS[key] if _matches(_unit(one, key), right)), "")
            if size is None and unit:
                self.notes.append(f"{show(name)} has no unit; it is in {unit}, as the column {beside} tells")
                return _unit(unit, key)
            if size is None:
                hints.append(f"one of it is {right:.5g} {si}, by the column {beside}")
            elif unit and not _matches(size, right):
                raise RefusedError(
                    f"{show(title)} and {show(self.sheet.titled(i))} cannot both be right: by the second "
                    f'the first is in {unit}; set columns to "{key}={name}[{unit}]"'
                )
        if size is not None:
            return size
        ways = ", ".join(f'"{key}={name}[{one}]"' for one in MOTIONS[key])
        counts = f'; of 4096 counts a turn "angle=1/4096*{name}[turn]"' if key == "angle" else ""
        hint = f"; {'; '.join(hints)}" if hints else ""
        raise RefusedError(
            f"{show(name)}, the {key}, has no unit, and with another one another drive explains the log as "
            f"well; set columns to one of {ways}{counts}{hint}"
        )

    def _derivatives_and_integrals(self, key: str, time: Vector, raw: Vector) -> Iterator[tuple[int, float]]:
        """The columns whose integral or derivative this one is, and by which ratio of the units.

        With the sizes A and W of their units, A d(angle)/dt = W speed: an angle has A/W, a speed W/A.
        """
        for i in (
            i for i in range(self.sheet.table.width) if i not in self.places.values() and self.sheet.names[i]
        ):
            try:
                column = self._numbers(i, self.sheet.names[i])
            except InputError:
                continue
            seen = np.isfinite(raw) & np.isfinite(column)
            if int(seen.sum()) < 8 or not np.all(np.diff(time) >= 0.0):
                continue
            angle, speed = (raw[seen], column[seen]) if key == "angle" else (column[seen], raw[seen])
            steps = np.diff(angle)
            jumps = np.abs(steps) > 0.5 * float(np.ptp(angle))  # of a counter that overflows
            travel = np.where(jumps, 0.0, steps).cumsum()
            wanted = np.where(
                jumps, 0.0, np.diff(cumulative_trapezoid(speed, time[seen], initial=0.0))
            ).cumsum()
            if not np.ptp(travel) or not np.ptp(wanted):
                continue
            ratio = float(travel @ wanted) / float(wanted @ wanted)  # W/A
            if ratio > 0.0 and float(np.std(travel - ratio * wanted)) < ALIKE * float(np.ptp(travel)):
                yield i, 1.0 / ratio if key == "angle" else ratio

    def _numbers(self, place: int, name: str) -> Vector:
        """A column as it stands there; NaN where it is empty."""
        return read_numbers(
            self.sheet.table, self.where, [Wanted((name,), "1")], [place], [""], missing=True
        ).values[0]


def _matches(one: float, other: float) -> bool:
    return abs(one / other - 1.0) < MATCHED


def _unit(unit: str, key: str) -> float:
    return float(parse(f"1 {unit}", SIGNALS[key].unit))


def _in_si(unit: str, key: str, cell: str) -> float:
    """One of this unit in SI; of `% of 35 N*m` a hundredth of that."""
    si, share = SIGNALS[key].unit, re.fullmatch(r"\s*(%|‰|per ?cent|per ?mill?e?)\s+of\s+(.+)", unit)
    try:
        if share:
            return float(parse(share[2], si)) / (1000.0 if share[1][-1] in "‰le" else 100.0)
        return float(parse(f"1 {unit.strip()}", si))
    except RefusedError as refusal:
        reason, ways = refusal.reason, f'"{key}=NAME [{si}]"'
        if COUNTS.fullmatch(unit.strip()):
            reason, ways = "a count has no size", f'"{key}=1/4096*NAME [turn]" with the counts of a turn'
        if key == "torque":
            part = unit.strip() if unit.strip() in SHARES else "%"
            ways += f'; of {part}, as "torque=NAME [{part} of 35 N*m]"'
            ways += '; of a current in A, as "torque=1.2*NAME [N*m]"'
        raise RefusedError(f"{show(cell)}: {reason}; or set columns to {ways}") from None
