"""Torque profiles in files: CSV and TOML, read back to the last bit, and C code for a target."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import IO, TYPE_CHECKING, NamedTuple

import numpy as np

from softstart.arrays import Vector
from softstart.errors import InputError
from softstart.input.columns import Wanted, read_columns
from softstart.input.documents import literal, parsed
from softstart.input.files import read_text, write_whole
from softstart.input.parameters import Wording
from softstart.quantities import RefusedError, show, to_si

if TYPE_CHECKING:
    from softstart.profile import TorqueProfile

HEADER = "time [s],torque [N*m]"
TIME = Wanted(("time", "t"), "s")
TORQUE = Wanted(("torque", "u", "demand"), "N*m")
TABLES = ("controller", "profile", "after_contact", "about")
KEYS = ("time", "torque", "time_unit", "torque_unit")
PER_LINE = 4


class Knots(NamedTuple):
    """Times (s) and torques (N m) in a file, and `where` they are in it, for errors."""

    where: str
    time: Vector
    torque: Vector


def read_knots(path: Path) -> list[Knots]:
    """The knots in a file, by its suffix, and those after the contact if there are any.

    Raises InputError in one sentence that names place and value.
    """
    where, suffix = f"profile = {path}", path.suffix.lower()
    if suffix not in (".toml", ".csv", ".txt", ".dat"):
        raise InputError(f"{where}: its kind is unknown; give a file whose name ends in .csv or .toml.")
    try:
        text = read_text(path)
    except RefusedError as refusal:
        raise InputError(f"{where}: {refusal.reason}.") from None
    if suffix == ".toml":
        return _from_toml(text, where)
    return [Knots(where, *read_columns(text, where, (TIME, TORQUE)).values)]


def write_csv(profile: TorqueProfile, path: Path) -> None:
    """Two columns under a header with units, 17 digits: read back, each number has the same bits."""
    if profile.after_contact is not None:
        raise InputError(
            f"output = {path}: a CSV file has no place for what is played after the contact; "
            "write this profile as TOML."
        )

    def write(stream: IO[str]) -> None:
        table = np.column_stack([profile.time, profile.torque])
        np.savetxt(stream, table, delimiter=",", header=HEADER, comments="", fmt="%.17g")

    write_whole(path, write)


# ---- TOML ------------------------------------------------------------------------------------------------


def write_toml(profile: TorqueProfile, path: Path, about: Mapping[str, object]) -> None:
    """A file that the `profile` controller plays; each number in as few digits as give back its bits."""
    parts = [
        "# A torque profile: softstart simulate DRIVE --controller profile --param file=THIS_FILE",
        '[controller]\nname = "profile"',
        _table("profile", profile),
    ]
    if profile.after_contact is not None:
        parts.append(_table("after_contact", profile.after_contact))
    if about:
        lines = [f"{_text_literal(key)} = {_text_literal(value)}" for key, value in about.items()]
        parts.append("\n".join(["[about]", *lines]))
    write_whole(path, lambda stream: stream.write("\n\n".join(parts) + "\n"))


def _table(name: str, profile: TorqueProfile) -> str:
    lines = (f"{key} = {_rows(map(literal, vars(profile)[key].tolist()))}" for key in ("time", "torque"))
    return "\n".join([f"[{name}]", *lines])


def _rows(numbers: Iterable[str], begin: str = "[", end: str = "]") -> str:
    """The numbers of a list, a few a line."""
    texts = list(numbers)
    rows = (", ".join(texts[i : i + PER_LINE]) for i in range(0, len(texts), PER_LINE))
    return f"{begin}\n" + "".join(f"    {row},\n" for row in rows) + end


def _text_literal(value: object) -> str:
    return literal(str(value).encode("utf-8", "replace").decode("utf-8"))


def _from_toml(text: str, where: str) -> list[Knots]:
    """From the tables [profile] and, if there, [after_contact]: lists `time` in s and `torque` in N m.

    `time_unit` and `torque_unit` name other units.
    """
    document = parsed(text, Wording(where, style="toml"), "a profile")
    if unknown := [key for key in document if key not in TABLES]:
        tables = ", ".join(f"[{name}]" for name in TABLES)
        raise InputError(f"{where}: a profile has no {show(unknown[0])}; its tables are {tables}.")
    controller = document.get("controller", {})
    name = controller.get("name", "profile") if isinstance(controller, dict) else controller
    if name != "profile":
        raise InputError(
            f'{where}: it is for the controller {show(name)}; a torque profile has name = "profile".'
        )
    if "profile" not in document:
        raise InputError(f"{where}: it has no table [profile]; write one with the lists time and torque.")
    parts = [part for part in ("profile", "after_contact") if part in document]
    return [_knots(f"{where}: [{part}]", document[part]) for part in parts]


def _knots(where: str, table: object) -> Knots:
    if not isinstance(table, dict):
        raise InputError(f"{where} = {show(table)}: write a table with the lists time and torque.")
    if unknown := [key for key in table if key not in KEYS]:
        raise InputError(f"{where} has no key {show(unknown[0])}; it has {', '.join(KEYS)}.")
    columns = []
    for key, si in (("time", "s"), ("torque", "N*m")):
        values, unit = table.get(key), table.get(f"{key}_unit", si)
        if not isinstance(values, list):
            shown = f"{key} = {show(values)}" if key in table else f"{key} is missing"
            raise InputError(f"{where} {shown}: write a list of numbers, {key} = [0.0, 0.1].")
        size = to_si([f"1 {unit}"], si, name=f"{where} {key}_unit")
        columns.append(np.atleast_1d(to_si(values, si, name=f"{where} {key}")) * size)
    return Knots(where, *columns)


# ---- C ---------------------------------------------------------------------------------------------------


def write_c(
    profile: TorqueProfile,
    path: Path,
    name: str = "torque_profile",
    about: Mapping[str, object] | None = None,
) -> None:
    """C code for a target: `double name(double time)`, N m over s, tables and a bisection.

    At a step it gives the value after it, behind the last knot the last torque, as `TorqueProfile.at` does. A
    profile with `after_contact` has a second function `name_after_contact`, on a clock that starts there.
    `about` goes into the comment on top. Raises InputError for a name that C does not take.
    """
    if not re.fullmatch(r"[A-Za-z](_?[A-Za-z0-9])*", name):
        raise InputError(f'name = "{name}": a C function is named with letters, digits and single _.')
    after = profile.after_contact
    functions = {name: profile} | ({} if after is None else {f"{name}_after_contact": after})
    # */ would end the comment
    lines = [" ".join(f"{key}: {value}".split()).replace("*/", "* /") for key, value in (about or {}).items()]
    lines += [f"double {f}(double time);  {p.time.size} knots to {p.end:g} s" for f, p in functions.items()]
    text = C_HEADER % "".join(f"   {line}\n" for line in lines)
    for function, p in functions.items():
        time, torque = (_rows(map(repr, values.tolist()), "{", "}") for values in (p.time, p.torque))
        text += C_FUNCTION % {"name": function, "n": p.time.size, "time": time, "torque": torque}
    write_whole(path, lambda stream: stream.write(text))


C_HEADER = """/* Torque demand in N m over time in s, straight lines between knots. Generated by softstart.

%s
   At a step the value is the one after it; behind the last knot the last torque is held.
   The clock begins with the start, that of ..._after_contact where the gap first closes. */
"""
C_FUNCTION = """
double %(name)s(double time) {
  static const double t[%(n)d] = %(time)s;
  static const double u[%(n)d] = %(torque)s;
  int low = 0, high = %(n)d - 1;
  if (time >= t[high]) return u[high];
  if (time <= t[0]) time = t[0];
  while (high - low > 1) {  /* t[low] <= time < t[high] */
    int middle = low + (high - low) / 2;
    if (t[middle] <= time) low = middle; else high = middle;
  }
  return u[low] + (time - t[low]) / (t[high] - t[low]) * (u[high] - u[low]);
}
"""
