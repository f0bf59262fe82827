"""Torque profiles in files: CSV and TOML, read back to the last bit."""

from __future__ import annotations

import csv
import json
import math
import re
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import IO, Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from softstart.errors import InputError
from softstart.input.files import write_whole
from softstart.quantities import to_si

Vector = NDArray[np.float64]

HEADER = "time [s],torque [N*m]"
TIME_NAMES = ("time", "t")
TORQUE_NAMES = ("torque", "u", "demand")
TABLES = ("controller", "profile", "after_contact", "about")
KEYS = ("time", "torque", "time_unit", "torque_unit")
PER_LINE = 4


class Profile(Protocol):
    """What can be written: a torque profile, see `softstart.profile`."""

    @property
    def time(self) -> Vector: ...

    @property
    def torque(self) -> Vector: ...

    @property
    def after_contact(self) -> Profile | None: ...


class Knots(NamedTuple):
    """What has been read: s, N m, and the knots of the profile after the contact."""

    time: Vector
    torque: Vector
    after_contact: Knots | None = None


def read_profile(path: Path) -> Knots:
    """Knots from a file, by its suffix. Raises InputError in one sentence that names line and value."""
    suffix = path.suffix.lower()
    if suffix == ".toml":
        return read_toml(path)
    if suffix in (".csv", ".txt", ".dat"):
        return read_csv(path)
    raise InputError(
        f"profile = {path}: its name does not tell its kind; give a file whose name ends in .csv or .toml."
    )


# CSV -----------------------------------------------------------------------------------------------------


def write_csv(profile: Profile, path: Path) -> None:
    """Two columns under a header with units, 17 digits: read back, each number has the same bits."""
    if profile.after_contact is not None:
        raise InputError(
            f"output = {path}: a CSV file has no place for what is played after the contact; "
            "write this profile as TOML."
        )

    def write(stream: IO[Any]) -> None:
        table = np.column_stack([profile.time, profile.torque])
        np.savetxt(stream, table, delimiter=",", header=HEADER, comments="", fmt="%.17g")

    write_whole(path, write)


def read_csv(path: Path) -> Knots:
    """Knots from two columns, time and torque.

    A header is optional; it may name units as `torque [kN*m]`, and more than two columns if one is named
    time (or t) and one torque (or u). Columns are separated by commas, semicolons or tabs; blank lines and
    lines that begin with # are passed over.
    """
    lines = [
        (number, line)
        for number, line in enumerate(_text(path).splitlines(), start=1)
        if line.strip() and not line.lstrip().startswith("#")
    ]
    if not lines:
        raise _wrong(path, "it is empty; give one line a knot: time in s, a comma, torque in N m")
    first = lines[0][1]
    separator = next((mark for mark in (";", "\t") if mark in first), ",")
    rows = [(number, next(csv.reader([line], delimiter=separator))) for number, line in lines]
    heading = [cell.strip() for cell in rows[0][1]]
    headed = not any(_looks_like_a_number(cell) for cell in heading)
    columns, factors = _columns(path, heading if headed else [], rows[0][0])
    width = len(heading)
    times: list[float] = []
    torques: list[float] = []
    for number, row in rows[1:] if headed else rows:
        if len(row) != width or width < 2:
            comma = (
                "; write decimal points, not decimal commas" if separator == "," and len(row) > width else ""
            )
            raise _wrong(
                path,
                f"line {number}, {_shown(separator.join(row))}, has {len(row)} "
                f"value{'s' if len(row) > 1 else ''} instead of {max(width, 2)}{comma}",
            )
        cells = [row[column] for column in columns]
        t, u = (
            _number(path, number, cell, separator) * factor
            for cell, factor in zip(cells, factors, strict=True)
        )
        if not times and t != 0.0:
            raise _wrong(path, f"line {number}: the first time is {t:g} s; a profile begins at 0 s")
        if times and t < times[-1]:
            raise _wrong(
                path, f"line {number}: time falls from {times[-1]:g} s to {t:g} s; sort the lines by time"
            )
        times.append(t)
        torques.append(u)
    if not times:
        raise _wrong(path, "there is no knot below its header; give one line a knot: time, a comma, torque")
    return Knots(np.array(times), np.array(torques))


def _columns(path: Path, heading: list[str], line: int) -> tuple[tuple[int, int], tuple[float, float]]:
    """Which columns are time and torque, and what turns them into s and N m."""
    if not heading:
        return (0, 1), (1.0, 1.0)
    parts = [re.fullmatch(r"(.*?)\s*(?:[\[(](.*)[\])])?", cell) for cell in heading]
    names = [part.group(1).lower() if part else "" for part in parts]
    time = next((i for i, name in enumerate(names) if name in TIME_NAMES), None)
    torque = next((i for i, name in enumerate(names) if name in TORQUE_NAMES), None)
    if len(heading) == 2 and (time is None or torque is None):
        time, torque = (0, 1) if time != 1 and torque != 0 else (1, 0)
    if time is None or torque is None:
        raise _wrong(
            path, f"line {line}, {_shown(','.join(heading))}, names no column time and torque; name them so"
        )
    units = [part.group(2) if part else None for part in (parts[time], parts[torque])]
    factors = (_factor(path, "unit of time", units[0], "s"), _factor(path, "unit of torque", units[1], "N*m"))
    return (time, torque), factors


def _looks_like_a_number(cell: str) -> bool:
    return re.match(r"[+-]?\.?[0-9]|[+-]?(inf|nan)\b", cell, re.IGNORECASE) is not None


def _number(path: Path, line: int, cell: str, separator: str) -> float:
    shown = _shown(cell.strip())
    if separator != "," and re.fullmatch(r"\s*[+-]?[0-9]+,[0-9]+(e[+-]?[0-9]+)?\s*", cell, re.IGNORECASE):
        raise _wrong(path, f"line {line}, {shown}: this is a decimal comma; write a decimal point")
    try:
        value = float(cell)
    except ValueError:
        raise _wrong(
            path, f"line {line}, {shown}: this is no number; write one with a decimal point"
        ) from None
    if not math.isfinite(value):
        raise _wrong(path, f"line {line}, {shown}: this is not finite; give a finite number")
    return value


# TOML ----------------------------------------------------------------------------------------------------


def write_toml(profile: Profile, path: Path, about: Mapping[str, object]) -> None:
    """A file that the `profile` controller plays; each number in as few digits as give back its bits."""
    parts = [
        "# A torque profile: softstart simulate DRIVE --controller profile --param file=THIS_FILE",
        '[controller]\nname = "profile"',
        _table("profile", profile),
    ]
    if profile.after_contact is not None:
        parts.append(_table("after_contact", profile.after_contact))
    if about:
        lines = [f"{_quoted(key)} = {_quoted(value)}" for key, value in about.items()]
        parts.append("\n".join(["[about]", *lines]))
    write_whole(path, lambda stream: stream.write("\n\n".join(parts) + "\n"))


def _table(name: str, profile: Profile) -> str:
    def written(values: Vector) -> str:
        texts = [repr(value) for value in values.tolist()]
        rows = (", ".join(texts[i : i + PER_LINE]) for i in range(0, len(texts), PER_LINE))
        return "[\n" + "".join(f"    {row},\n" for row in rows) + "]"

    return f"[{name}]\ntime = {written(profile.time)}\ntorque = {written(profile.torque)}"


def _quoted(value: object) -> str:
    text = str(value).encode("utf-8", "replace").decode("utf-8")
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def read_toml(path: Path) -> Knots:
    """Knots from the tables [profile] and, if there, [after_contact]: lists time and torque in s and N m.

    `time_unit` and `torque_unit` name other units.
    """
    try:
        document = tomllib.loads(_text(path))
    except tomllib.TOMLDecodeError as error:
        raise _wrong(path, f"it is not valid TOML: {str(error)[:1].lower()}{str(error)[1:]}") from None
    unknown = [key for key in document if key not in TABLES]
    if unknown:
        tables = ", ".join(f"[{name}]" for name in TABLES)
        raise _wrong(path, f"a profile has no {_shown(unknown[0])}; its tables are {tables}")
    controller = document.get("controller", {})
    name = controller.get("name", "profile") if isinstance(controller, dict) else controller
    if name != "profile":
        raise _wrong(path, f'it is for the controller {_shown(name)}; a torque profile has name = "profile"')
    if "profile" not in document:
        raise _wrong(path, "it has no table [profile]; write one with the lists time and torque")
    after = document.get("after_contact")
    return _knots(path, "profile", document["profile"])._replace(
        after_contact=None if after is None else _knots(path, "after_contact", after)
    )


def _knots(path: Path, name: str, table: object) -> Knots:
    if not isinstance(table, dict):
        raise _wrong(path, f"{name} = {_shown(table)}: write a table [{name}] with the lists time and torque")
    unknown = [key for key in table if key not in KEYS]
    if unknown:
        raise _wrong(path, f"[{name}] has no key {_shown(unknown[0])}; it has {', '.join(KEYS)}")
    time, torque = (
        _list(path, name, key, table.get(key)) * _factor(path, f"{key}_unit", table.get(f"{key}_unit"), unit)
        for key, unit in (("time", "s"), ("torque", "N*m"))
    )
    if time.size != torque.size:
        raise _wrong(
            path, f"[{name}] has {time.size} times for {torque.size} torques; give one torque a time"
        )
    if time[0] != 0.0:
        raise _wrong(path, f"[{name}] time: the first is {time[0]:g} s; a profile begins at 0 s")
    for i in np.flatnonzero(np.diff(time) < 0.0)[:1].tolist():
        raise _wrong(
            path,
            f"[{name}] time: it falls from {time[i]:g} s to {time[i + 1]:g} s at number {i + 2}; "
            "give the knots in order of time",
        )
    return Knots(time, torque)


def _list(path: Path, name: str, key: str, values: object) -> Vector:
    if not isinstance(values, list) or not values:
        raise _wrong(path, f"[{name}] {key} = {_shown(values)}: write a list of numbers, {key} = [0.0, 0.1]")
    for i, value in enumerate(values, start=1):
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise _wrong(path, f"[{name}] {key}: number {i} of the list is {_shown(value)}; write a number")
        if not math.isfinite(value):
            raise _wrong(path, f"[{name}] {key}: number {i} of the list is {value}; give a finite number")
    return np.array(values, dtype=np.float64)


# both ----------------------------------------------------------------------------------------------------


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8-sig")
    except OSError as error:
        reason = error.strerror or str(error)
        raise _wrong(path, f"the file cannot be read: {reason[:1].lower()}{reason[1:]}") from None
    except UnicodeDecodeError:
        raise _wrong(path, "it is not text in UTF-8; save it as such") from None


def _factor(path: Path, key: str, unit: object, wanted: str) -> float:
    """What turns a number in `unit` into one in `wanted`; 1 without a unit."""
    if unit is None:
        return 1.0
    try:
        return float(to_si(f"1 {unit}", wanted, name=f"profile = {path}: {key}"))
    except InputError as error:
        told = [sentence.replace(f'"1 {unit}"', f'"{unit}"', 1) for sentence in error.sentences]
        raise InputError(told) from None


def _shown(value: object) -> str:
    text = value if isinstance(value, str) else repr(value)
    text = text if len(text) <= 60 else f"{text[:60]}..."
    return json.dumps(text, ensure_ascii=False) if isinstance(value, str) else text


def _wrong(path: Path, reason: str) -> InputError:
    return InputError(f"profile = {path}: {reason}.")
