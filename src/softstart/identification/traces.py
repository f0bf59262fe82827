"""The signals of a trace: a CSV file as inverters, scopes and spreadsheets write it, or an MDF file."""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from io import BytesIO
from itertools import pairwise
from pathlib import Path
from typing import Final, Literal, NamedTuple

import numpy as np

from softstart.arrays import Vector
from softstart.errors import InputError
from softstart.input.columns import Wanted, read_columns
from softstart.input.files import ABSENT, FOLDER, read_text, refusal_of
from softstart.quantities import RefusedError, nearest, parse, read_unit, show, with_points

Kind = Literal["angle", "speed"]

COLUMNS: Final = {
    "time": Wanted(("time", "t"), "s"),
    "torque": Wanted(("torque", "u", "demand"), "N*m"),
    "angle": Wanted(("angle", "phi", "position"), "rad"),
    "speed": Wanted(("speed", "w", "omega", "n"), "rad/s"),
    "current": Wanted(("current", "i", "iq"), "A"),
}
# parts of names that people give to signals, by which a name is proposed and never taken
WORDS: Final = {
    "torque": r"torq|trq|moment|couple|^m[_ ]|^m$",
    "angle": r"angle|pos|phi|winkel|theta|lage",
    "speed": r"speed|vel|drehz|vitesse|rpm|^n[_ ]|^n$",
    "current": r"curr|strom|^i_?q",
}
TIMES: Final = r"(t|time|zeit|temps)([ _]?[0-9]+)?"  # what columns of times are called
LABELS: Final = ("name", "names", "signal", "channel", "variable")  # of the row of names in a preamble
UNITS: Final = ("unit", "units", "einheit", "einheiten")
MEASUREMENTS: Final = (".mf4", ".mdf", ".dat")  # how names of MDF files end
OTHERS: Final = {
    ".mat": "a MATLAB file", ".xlsx": "a workbook", ".xls": "a workbook", ".ods": "a workbook",
    ".tdms": "a LabVIEW file", ".svdx": "a TwinCAT file", ".h5": "an HDF5 file", ".hdf5": "an HDF5 file",
    ".npy": "a NumPy file", ".npz": "a NumPy file", ".parquet": "a Parquet file", ".zip": "an archive",
}  # fmt: skip
FEWEST: Final = 30  # samples
SAME_INSTANT: Final = 1e-3  # of a sample period: two channels have a sample at the same time


class Asked(NamedTuple):
    """What a file calls a signal: name, sign, and a unit that takes the place of its own."""

    name: str
    sign: float
    unit: str


class Signals(NamedTuple):
    """Signals of a file in SI: what moves the motor (torque or current), and how it moved."""

    time: Vector
    cause: Vector
    kind: Kind
    values: Vector
    notes: tuple[str, ...] = ()


def asked_columns(columns: Mapping[str, str]) -> dict[str, Asked]:
    """The columns as people write them.

    >>> asked_columns({"speed": "-n_act [rpm]"})
    {'speed': Asked(name='n_act', sign=-1.0, unit='rpm')}
    """
    found = {}
    for key, text in columns.items():
        if key not in COLUMNS:
            near = nearest(key, COLUMNS)
            hint = f"did you mean {near}?" if near else f"name {', '.join(COLUMNS)}, as speed=n_act."
            raise InputError(f"columns: {show(key)} is no signal of a log; {hint}")
        part = re.fullmatch(r"\s*(-?)\s*(.+?)\s*(?:\[([^\]]*)\])?\s*", text)
        if part is None:
            raise InputError(f"columns: {key} = {show(text)}: write the name of a column, as {key}=NAME.")
        unit = part[3] or ""
        try:
            _scale(unit, key, 1.0)
        except RefusedError as refusal:
            raise InputError(f"columns: {key} = {show(text)}: {refusal.reason}.") from None
        found[key] = Asked(part[2], -1.0 if part[1] else 1.0, unit)
    return found


def read_signals(
    where: str, asked: Mapping[str, Asked], cause: str, rated: float | None, held: bool
) -> Signals:
    """The signals of a file; `rated`: the torque at 100 %; `held`: it keeps its value between samples."""
    channels = _channels_of if where.lower().endswith(MEASUREMENTS) else _columns_of
    return _signals(channels(where, asked), where, asked, cause, rated, held)


# ---- which signal is which ------------------------------------------------------------------------------


class _Channel(NamedTuple):
    """A signal of a file; `read` gives its instants and values in SI, with a unit in place of its own."""

    name: str
    unit: str
    read: Callable[[str, str], tuple[Vector, Vector]]


def _signals(
    channels: Sequence[_Channel], where: str, asked: Mapping[str, Asked], cause: str, rated: float | None,
    held: bool,
) -> Signals:  # fmt: skip
    def called(key: str) -> list[_Channel]:
        known = [asked[key].name] if key in asked else COLUMNS[key].names
        return [one for one in channels if one.name in known] or [
            one for one in channels if one.name.lower() in {name.lower() for name in known}
        ]

    kinds = [kind for kind in ("angle", "speed") if kind in asked] or [
        kind for kind in ("angle", "speed") if called(kind)
    ]
    if cause == "torque" and not called("torque") and "torque" not in asked and called("current"):
        raise InputError(
            f"log = {where}: it has a current and no torque; give the torque constant of the motor, as "
            '--torque-constant "1.2 N*m/A".'
        )
    if len(kinds) != 1 or any(len(called(key)) != 1 for key in (cause, kinds[0])):
        raise InputError(f"log = {where}: {_choice(channels, called, asked, cause, kinds, rated)}.")
    kind: Kind = "angle" if kinds[0] == "angle" else "speed"
    read, notes = {}, list[str]()
    for key in (cause, kind):
        (one,) = called(key)
        given = unit = (asked[key].unit if key in asked else "") or one.unit
        try:
            factor, unit = _scale(unit, key, rated)
        except RefusedError as refusal:
            rest, share = "", "%" in unit
            if "--" not in refusal.reason and not (share and key != "torque"):
                meant = f"{key}={one.name} [{'%' if share else COLUMNS[key].unit}]"
                rest = f'; or name the unit that is meant, as --columns "{meant}"{_at_100(share, rated)}'
            raise InputError(f"log = {where}: {show(one.name)}: {refusal.reason}{rest}.") from None
        notes += [f"{one.name} is in % of {rated:.5g} N m"] if key == "torque" and _percent(given) else []
        instants, values = one.read(key, unit)
        read[key] = instants, factor * values
    (times, first), (others, values) = read[cause], read[kind]
    if np.array_equal(times, others, equal_nan=True):
        return Signals(times, first, kind, values, tuple(notes))
    time, torque, values = _together(times, first, others, values, held, where)
    told = f"{cause} and {kind} are sampled at different instants; the torque between its samples is "
    return Signals(time, torque, kind, values, (*notes, told + ("held" if held else "straight")))


def _choice(
    channels: Sequence[_Channel], called: Callable[[str], list[_Channel]], asked: Mapping[str, Asked],
    cause: str, kinds: Sequence[str], rated: float | None,
) -> str:  # fmt: skip
    """Which signal is not named, or more than once, and the options that name all of them."""
    words, options, percent, twice = [], [], False, False
    for key in (cause, *(kinds if len(kinds) == 1 else ["motion"])):
        each, wanted = called(key) if key in COLUMNS else [], [key] if key in COLUMNS else ["angle", "speed"]
        if len(each) != 1:
            many = "more than one is" if each else "none is"
            twice |= [one.name for one in each].count(each[0].name if each else "") > 1
            words.append(
                f"{many} called {show(asked[key].name) if key in asked else key}"
                if key in COLUMNS
                else f"they name {'both' if kinds else 'neither'} of angle and speed"
            )
        likely = [(one, like) for one in wanted for like in (each[:1] or _likely(channels, one))]
        name, one = likely[0] if likely else (wanted[0], None)
        if len(each) != 1 or key in asked:
            options.append(f"{name}={'NAME' if one is None else one.name}")
        percent |= name == "torque" and one is not None and _percent(one.unit) > 0.0
    text = ",".join(options)
    text = f'"{text}"' if re.search(r"[^-=,.\w]", text) else text
    remedy = "rename one of them" if twice else f"write --columns {text}{_at_100(percent, rated)}"
    names = [f"{one.name} [{one.unit}]" if one.unit else one.name for one in channels]
    shown = ", ".join(names[:12]) + (f" and {len(names) - 12} more" if len(names) > 12 else "")
    return f"there are the columns {shown}; {' and '.join(words)}; {remedy}"


def _at_100(share: bool, rated: float | None) -> str:
    return ' --rated-torque "12 N*m" (the torque at 100 %)' if share and rated is None else ""


def _likely(channels: Sequence[_Channel], key: str) -> list[_Channel]:
    """The channels that are probably this signal, by their names."""
    return [one for one in channels if re.search(WORDS[key], one.name, re.IGNORECASE)]


def _percent(unit: str) -> float:
    """1 % or 1 per mille as a number, times what stands before the sign; 0 for any other unit."""
    part = re.fullmatch(r"\s*([0-9]+[.,]?[0-9]*)?\s*(%|percent|‰)\s*(?:Mn|rated)?\s*", unit)
    size = float((part[1] or "1").replace(",", ".")) if part else 0.0
    return size * (1e-3 if part and part[2] == "‰" else 1e-2)


def _scale(unit: str, key: str, rated: float | None) -> tuple[float, str]:
    """A factor and the unit that it takes: a torque in per cent is one of the rated torque."""
    share = _percent(unit) if key == "torque" else 0.0
    if "%" in unit and key != "torque":
        si = COLUMNS[key].unit
        raise RefusedError(f"a {key} in % is not read; write it in {si}: %/100 times the {key} at 100 %")
    if share and rated is None:
        raise RefusedError(
            'it is in %; give the torque at 100 %, as --rated-torque "12 N*m", or in the drive file the '
            "rated_torque, or rated_power and rated_speed, of the motor"
        )
    if not share:
        parse(f"1 {unit}", COLUMNS[key].unit)
    return (share * float(rated or 0.0), COLUMNS[key].unit) if share else (1.0, unit)


def _together(
    times: Vector, torque: Vector, instants: Vector, values: Vector, held: bool, where: str
) -> tuple[Vector, Vector, Vector]:
    """Both signals at the instants of both; values are NaN where they have no sample.

    >>> t, u, y = _together(np.arange(3.0), np.array([1.0, 2.0, 4.0]), np.array([0.0, 1.5, 2.0]),
    ...     np.array([0.0, 5.0, 9.0]), False, "here")
    >>> t.tolist(), u.tolist(), y.tolist()
    ([0.0, 1.0, 1.5, 2.0], [1.0, 2.0, 3.0, 4.0], [0.0, nan, 5.0, 9.0])
    """
    near = SAME_INSTANT * min(float(np.median(np.diff(times))), float(np.median(np.diff(instants))))
    closest = instants[np.clip(np.searchsorted(instants, times - near), 0, instants.size - 1)]
    times = np.where(np.abs(closest - times) <= near, closest, times)
    first, last = max(times[0], instants[0]), min(times[-1], instants[-1])
    if not first < last:
        raise InputError(f"log = {where}: torque and motion were not logged at the same time.")
    time = np.union1d(times, instants)
    time = time[(time >= first) & (time <= last)]
    if held:
        joined = torque[np.searchsorted(times, time, side="right") - 1]
    else:
        joined = np.interp(time, times, torque)
    seen = np.full(time.size, math.nan)
    inside = (instants >= first) & (instants <= last)
    seen[np.searchsorted(time, instants[inside])] = values[inside]
    return time, joined, seen


def check_times(time: Vector, name: str) -> None:
    """Refuse instants that do not rise, and too few."""
    if time.size < FEWEST:
        raise InputError(f"{name}: {time.size} samples; a fit needs {FEWEST} or more.")
    if not np.isfinite(time).all():
        raise InputError(f"{name}: the time of sample {int(np.argmin(np.isfinite(time))) + 1} is missing.")
    steps = np.diff(time)
    if np.any(steps <= 0.0):
        i = int(np.argmax(steps <= 0.0))
        raise InputError(
            f"{name}: time goes from {time[i]:g} s to {time[i + 1]:g} s at sample {i + 2}; it must rise."
        )


# ---- text -----------------------------------------------------------------------------------------------


class _Table(NamedTuple):
    """A table of text: name and unit of each column, and its lines, the first of numbers at `first`."""

    names: list[str]
    units: list[str]
    mark: str
    lines: list[str]
    first: int


def _columns_of(where: str, asked: Mapping[str, Asked]) -> list[_Channel]:
    """The columns of a CSV file but those of times; each has the times that stand left of it."""
    kind = OTHERS.get(Path(where).suffix.lower())
    try:
        if kind and refusal_of(where) is None:
            raise RefusedError(f"this is {kind}")
        text = read_text(Path(where), also="cp1252")
        if "\0" in text:
            raise RefusedError("this is not a text file")
    except RefusedError as refusal:
        export = (
            "; export the signals as CSV, with names and units in the first line, as "
            "time [ms];torque [N*m];speed [rpm]"
        )
        raise InputError(
            f"log = {where}: {refusal.reason}{export if refusal.reason.startswith('this is') else ''}."
        ) from None
    table = _table(text)
    if not any(table.names):
        raise InputError(
            f"log = {where}: no line above the numbers names the columns; write names and units there, as "
            "time [ms];torque [N*m];speed [rpm]."
        )
    if len(table.names) == 1:
        raise InputError(f"log = {where}: it has one column; divide columns by semicolons, commas or tabs.")
    written = re.escape(asked["time"].name) if "time" in asked else TIMES
    times = [i for i, name in enumerate(table.names) if re.fullmatch(written, name, re.IGNORECASE)]
    if not times:
        called = (
            f"is called {show(asked['time'].name)}" if "time" in asked else "has a name of times, as time"
        )
        raise InputError(
            f"log = {where}: there are the columns {', '.join(filter(None, table.names))}; none {called}; "
            'write --columns "time=NAME [ms]" with its name and its unit.'
        )
    unit_of_time = asked["time"].unit if "time" in asked else ""

    def reader(index: int) -> Callable[[str, str], tuple[Vector, Vector]]:
        own = max((i for i in times if i < index), default=times[0])
        unit_time = unit_of_time or table.units[own]

        def read(key: str, unit: str) -> tuple[Vector, Vector]:
            heading = [""] * len(table.names)
            heading[own] = f"time [{unit_time}]" if unit_time else "time"
            heading[index] = f"{key} [{unit}]" if unit else key
            lines = ["#"] * (table.first - 1) + [table.mark.join(heading), *table.lines[table.first :]]
            wanted = [Wanted((name,), COLUMNS[name].unit) for name in ("time", key)]
            _, (instants, values) = read_columns(
                "\n".join(lines), f"log = {where}", wanted, headed="names", missing=True
            )
            kept = np.isfinite(instants) | np.isfinite(values) | (len(times) == 1)
            return instants[kept], values[kept]

        return read

    channels = [
        _Channel(name, table.units[i], reader(i))
        for i, name in enumerate(table.names)
        if name and i not in times
    ]
    return channels


def _table(text: str) -> _Table:
    """The table of a text: names, units and numbers below a preamble, if there is one.

    >>> table = _table(
    ...     "Name;A\\nSampleTime[ms];4\\nName;M;;Name;phi\\nUnit;%;;Unit;deg\\n0;1;;0;2\\n4;1;;4;2"
    ... )
    >>> table.names, table.units, table.first
    (['time', 'M', '', 'time', 'phi'], ['ms', '%', '', 'ms', 'deg'], 4)
    """
    lines = text.splitlines()
    counts = [i for i, line in enumerate(lines) if line.strip() and not line.lstrip().startswith("#")]
    mark = next((one for one in ";\t" if 2 * sum(one in lines[i] for i in counts) > len(counts)), ",")
    rows = {i: _cells(lines[i], mark) for i in counts}
    first = next((i for i, j in pairwise(counts) if _numbers(rows[i]) and _numbers(rows[j])), 0)
    head = [rows[i] for i in counts if i < first] or [rows[i] for i in counts[:1] if not _numbers(rows[i])]
    if not head:
        return _Table([""] * len(rows.get(0, [])), [], mark, lines, 0)
    width = len(rows[first]) if first else len(head[0])
    wide = [row for row in head if len(row) >= width - 1 and sum(map(bool, row)) > 1] or head[-1:]
    names = next((row for row in reversed(wide) if row[0].lower() in LABELS), None)
    units = next((row for row in reversed(wide) if row[0].lower() in UNITS), None)
    labels = {one for row in (names, units) if row for one in [row[0].lower()]}
    if units is None and len(wide) > 1 and _are_units(wide[-1]):
        units = wide[-1]
    names = names or [row for row in wide if row is not units][-1]
    pairs = [_named(one) for one in names]
    called = ["time" if one.lower() in labels else one for one, _ in pairs]
    own = [unit for _, unit in pairs]
    for i, one in enumerate(units or ()):
        if i < len(own) and not own[i] and one.lower() not in labels:
            own[i] = one.strip("[]() ")
    data = [rows[i] for i in counts if i >= first][:2]
    for i, name in enumerate(called):
        if re.fullmatch(TIMES, name, re.IGNORECASE) and not own[i]:
            own[i] = _unit_of_times(head, data, i)
    return _Table(called, own, mark, lines, first or counts[0] + 1)


def _named(heading: str) -> tuple[str, str]:
    """Name and unit of a column.

    >>> _named("M [Nm]"), _named("n / min-1"), _named("v / (m/s)"), _named("left / right")
    (('M', 'Nm'), ('n', 'min-1'), ('v', 'm/s'), ('left / right', ''))
    """
    shape = r"(.*?)\s*(?:(?:\s/\s*)?[\[(]([^\[(]*)[\])]|\s/\s+(.+))?"
    part = re.fullmatch(shape, heading, re.DOTALL)
    if part is None or (part[3] and not _are_units([part[3]])):
        return heading, ""
    return part[1].strip(), part[2] or part[3] or ""


def _cells(line: str, mark: str) -> list[str]:
    try:
        return [cell.strip() for cell in next(csv.reader([line], delimiter=mark, skipinitialspace=True))]
    except csv.Error:
        return [line]


def _numbers(cells: Sequence[str]) -> bool:
    """Whether a row begins with a number and has another one."""
    found = [re.fullmatch(r"[+-]?[.,]?[0-9][0-9.,]*(e[+-]?[0-9]+)?", one, re.IGNORECASE) for one in cells]
    return bool(found and found[0]) and sum(map(bool, found)) > 1


def _are_units(cells: Sequence[str]) -> bool:
    written = [one.strip("[]() ") for one in cells if one]
    return all(_percent(one) or not isinstance(read_unit(one), str) for one in written)


def _unit_of_times(head: Sequence[Sequence[str]], data: Sequence[Sequence[str]], column: int) -> str:
    """The unit of a column of times: that in which its step is the sample time of the preamble."""
    for row in head:
        part = re.search(r"sampl\D*[\[(](\w+)[\])]", row[0], re.IGNORECASE)
        if part and len(row) > 1:
            try:
                period, begin, after = map(float, with_points([row[1], *(one[column] for one in data)]))
            except (RefusedError, ValueError, IndexError):
                continue
            if math.isclose(after - begin, period, rel_tol=1e-6):
                return part[1]
    return ""


# ---- measurement files ----------------------------------------------------------------------------------


def _channels_of(where: str, asked: Mapping[str, Asked]) -> list[_Channel]:
    """The channels of an MDF file, each as often as there are some of its name."""
    if (reason := refusal_of(where)) in (ABSENT, FOLDER):
        raise InputError(f"log = {where}: {reason}.")
    if "time" in asked:
        raise InputError("columns: time: each channel of a measurement file has its own; leave time out.")
    try:
        import asammdf

        file = asammdf.MDF(BytesIO(Path(where).read_bytes()))
    except ImportError:
        raise InputError(
            f"log = {where}: measurement files need the package asammdf; install it with "
            '"pip install softstart[mdf]", or write the channels to a CSV file.'
        ) from None
    except Exception as error:  # what its parser meets in a damaged file
        raise InputError(f"log = {where}: this cannot be read as an MDF file ({error}).") from None

    def read(name: str, key: str, unit: str) -> tuple[Vector, Vector]:
        signal = file.get(name)
        try:
            times, values = (np.asarray(one, dtype=np.float64) for one in (signal.timestamps, signal.samples))
        except (TypeError, ValueError):
            raise InputError(f"log = {where}: channel {name} holds text, and no numbers.") from None
        if values.ndim != 1:
            raise InputError(f"log = {where}: channel {name} has more than one number in a sample.")
        check_times(times, f"{where}, {name}")
        return times, float(parse(f"1 {unit}" if unit else 1.0, COLUMNS[key].unit)) * values

    return [
        _Channel(name, file.get_channel_unit(name, *place) or "", partial(read, name))
        for name in file.channels_db
        for place in file.whereis(name)
        if file.masters_db.get(place[0]) != place[1]
    ]
