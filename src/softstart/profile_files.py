"""Torque profiles in files: CSV and TOML, read back to the last bit, and C code for a target."""

from __future__ import annotations

import json
import math
import re
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

import numpy as np

from softstart.arrays import Vector
from softstart.errors import InputError
from softstart.input.columns import Wanted, read_columns
from softstart.input.documents import literal, parsed
from softstart.input.files import read_text, write_whole
from softstart.input.parameters import Wording
from softstart.late import late
from softstart.profile import TorqueProfile
from softstart.quantities import RefusedError, to_si

if TYPE_CHECKING:
    import casadi
else:
    casadi = late("casadi")


HEADER = "time [s],torque [N*m]"
TIME = Wanted(("time", "t"), "s")
TORQUE = Wanted(("torque", "u", "demand"), "N*m")
TABLES = ("controller", "profile", "after_contact", "about")
KEYS = ("time", "torque", "time_unit", "torque_unit")
PER_LINE = 4


Knots = tuple[Vector, Vector, TorqueProfile | None]  # s, N m, and the profile after the contact


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


def write_csv(profile: TorqueProfile, path: Path) -> None:
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
    """Knots from two columns, time and torque, or from two among more that are named so (or t and u)."""
    lines, (times, torques) = read_columns(_text(path), f"profile = {path}", (TIME, TORQUE))
    if times[0] != 0.0:
        raise _wrong(path, f"line {lines[0]}: the first time is {times[0]:g} s; a profile begins at 0 s")
    for i in np.flatnonzero(np.diff(times) < 0.0)[:1].tolist():
        raise _wrong(
            path,
            f"line {lines[i + 1]}: time falls from {times[i]:g} s to {times[i + 1]:g} s; "
            "sort the lines by time",
        )
    return times, torques, None


# TOML ----------------------------------------------------------------------------------------------------


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
    def written(values: Vector) -> str:
        texts = [literal(value) for value in values.tolist()]
        rows = (", ".join(texts[i : i + PER_LINE]) for i in range(0, len(texts), PER_LINE))
        return "[\n" + "".join(f"    {row},\n" for row in rows) + "]"

    return f"[{name}]\ntime = {written(profile.time)}\ntorque = {written(profile.torque)}"


def _text_literal(value: object) -> str:
    return literal(str(value).encode("utf-8", "replace").decode("utf-8"))


def read_toml(path: Path) -> Knots:
    """Knots from the tables [profile] and, if there, [after_contact]: lists time and torque in s and N m.

    `time_unit` and `torque_unit` name other units.
    """
    document = parsed(_text(path), Wording(f"profile = {path}", style="toml"), "a profile")
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
    time, torque = _knots(path, "profile", document["profile"])
    return time, torque, None if after is None else TorqueProfile(*_knots(path, "after_contact", after))


def _knots(path: Path, name: str, table: object) -> tuple[Vector, Vector]:
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
    return time, torque


def _list(path: Path, name: str, key: str, values: object) -> Vector:
    if not isinstance(values, list) or not values:
        raise _wrong(path, f"[{name}] {key} = {_shown(values)}: write a list of numbers, {key} = [0.0, 0.1]")
    for i, value in enumerate(values, start=1):
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise _wrong(path, f"[{name}] {key}: number {i} of the list is {_shown(value)}; write a number")
        if not math.isfinite(value):
            raise _wrong(path, f"[{name}] {key}: number {i} of the list is {value}; give a finite number")
    return np.array(values, dtype=np.float64)


# C -----------------------------------------------------------------------------------------------------


def write_c(
    profile: TorqueProfile,
    path: Path,
    name: str = "torque_profile",
    about: Mapping[str, object] | None = None,
) -> None:
    """C code for a target: `double name(double time)`, N m over s, generated by CasADi.

    At a step it gives the value after it, behind the last knot the last torque, as `TorqueProfile.at` does. A
    profile with `after_contact` has a second function `name_after_contact`, on a clock that starts there.
    `about` goes into the comment on top. Raises InputError for a name that C does not take.
    """
    if not re.fullmatch(r"[A-Za-z](_?[A-Za-z0-9])*", name):
        raise InputError(f'name = "{name}": a C function is named with letters, digits and single _.')
    functions = {name: profile}
    if profile.after_contact is not None:
        functions[f"{name}_after_contact"] = profile.after_contact
    text = "\n".join([_c_header(functions, about or {}), _generated(functions, name)])
    write_whole(path, lambda stream: stream.write(text))


def _generated(functions: Mapping[str, TorqueProfile], name: str) -> str:
    """CasADi's code, with a plain function around each of its own."""
    generator = casadi.CodeGenerator(f"{name}_code.c", {"with_header": False})
    wrappers = []
    for own, profile in functions.items():
        t = casadi.MX.sym("time")
        made = casadi.Function(f"{own}_at", [t], [_torque(t, profile)], ["time"], ["torque"])
        generator.add(made)
        wrappers.append(_c_wrapper(own, made.sz_arg(), made.sz_res(), made.sz_iw(), made.sz_w()))
    with tempfile.TemporaryDirectory() as folder:
        generator.generate(f"{folder}/")  # CasADi takes a folder only with a slash at the end
        code = (Path(folder) / f"{name}_code.c").read_text(encoding="utf-8")
    return "".join([code, *wrappers])


def _torque(t: Any, profile: TorqueProfile) -> Any:
    """Tables and a bisection: sharp at the steps, and as quick for many knots as for few.

    Each line has its own torques at its start and over its length, so no rounding of one reaches the next.
    """
    time, torque = profile.time, profile.torque
    lines = np.flatnonzero(np.diff(time) > 0.0)
    starts = np.append(time[lines], time[-1])
    lengths = np.append(time[lines + 1] - time[lines], 1.0)
    before = np.append(torque[lines], torque[-1])
    rises = np.append(torque[lines + 1] - torque[lines], 0.0)
    line = casadi.low(np.append(starts, starts[-1] + 1.0), t, {"lookup_mode": "binary"})
    start, length, first, rise = (
        casadi.MX(casadi.DM(table))[line] for table in (starts, lengths, before, rises)
    )
    share = casadi.fmin(casadi.fmax((t - start) / length, 0.0), 1.0)
    return first + share * rise


def _c_header(functions: Mapping[str, TorqueProfile], about: Mapping[str, object]) -> str:
    about_lines = [" ".join(f"{key}: {value}".split()).replace("*/", "* /") for key, value in about.items()]
    lines = [
        f"   double {own}(double time);  {p.time.size} knots to {p.time[-1]:g} s"
        for own, p in functions.items()
    ]
    return "\n".join(
        [
            "/* Torque demand in N m over time in s, straight lines between knots.",
            "   Generated by softstart with CasADi.",
            "",
            *(f"   {line}" for line in about_lines),
            *([""] if about_lines else []),
            *lines,
            "",
            "   At a step the value is the one after it; behind the last knot the last torque is held.",
            "   The clock begins with the start, that of ..._after_contact where the gap first closes. */",
        ]
    )


def _c_wrapper(own: str, arguments: int, results: int, integers: int, reals: int) -> str:
    return f"""
double {own}(double time) {{
  const casadi_real* arg[{arguments}];
  casadi_real* res[{results}];
  casadi_int iw[{max(1, integers)}];
  casadi_real w[{max(1, reals)}];
  casadi_real torque = 0.0;
  arg[0] = &time;
  res[0] = &torque;
  {own}_at(arg, res, iw, w, 0);
  return torque;
}}
"""


# both ----------------------------------------------------------------------------------------------------


def _text(path: Path) -> str:
    try:
        return read_text(path)
    except RefusedError as refusal:
        raise _wrong(path, refusal.reason) from None


def _factor(path: Path, key: str, unit: object, wanted: str) -> float:
    """What turns a number in `unit` into one in `wanted`; 1 without a unit."""
    if unit is None:
        return 1.0
    try:
        return float(to_si(f"1 {unit}", wanted, name=f"profile = {path}: {key}"))
    except InputError as error:
        sentences = [one.replace(f'"1 {unit}"', f'"{unit}"', 1) for one in error.sentences]
        raise InputError(sentences) from None


def _shown(value: object) -> str:
    text = value if isinstance(value, str) else repr(value)
    text = text if len(text) <= 60 else f"{text[:60]}..."
    return json.dumps(text, ensure_ascii=False) if isinstance(value, str) else text


def _wrong(path: Path, reason: str) -> InputError:
    return InputError(f"profile = {path}: {reason}.")
