"""Reading what is described by tables of quantities: chains, clutches, engines; all mistakes at once.

A file is described by its tables, a table by its fields. What comes out is plain data in SI, by table and
key; the classes made from it check what fields say about one another.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from softstart.drive.parameters import Limit
from softstart.drive.reading import LIMITS
from softstart.drive.sentences import Wording
from softstart.drive.toml_file import parsed
from softstart.errors import InputError
from softstart.units import RefusedError, nearest, parse, show

__all__ = ["REQUIRED", "Field", "Table", "read_document", "read_table", "text_of"]

# beyond these no quantity of a machine lies, in SI, and the powers that physics takes of them overflow
LEAST, MOST = 1e-30, 1e30


class _Required:
    def __repr__(self) -> str:
        return "REQUIRED"


REQUIRED = _Required()


@dataclass(frozen=True)
class Field:
    """One key of a table.

    `unit` is the SI unit; a field without one is text, or one of `choices`. `default` is REQUIRED, a value in
    SI, or None for "not given". A `many` field is a list of numbers. `example` is what to type.
    """

    key: str
    unit: str
    meaning: str
    example: str
    limit: Limit = "any"
    default: Any = REQUIRED
    choices: tuple[str, ...] = ()
    many: bool = False
    infinite: bool = False


@dataclass(frozen=True)
class Table:
    """One table of a file: `name` as in [name], "" for the keys above the first table.

    With `many` it is a list of tables, [[name]], of at least `least` entries. A single one that is not
    `required` may be left out as a whole: it is None then.
    """

    name: str
    fields: tuple[Field, ...]
    many: bool = False
    least: int = 0
    required: bool = True


def text_of(path: str | os.PathLike[str], what: str, form: str = "TOML") -> str:
    """The text of a file, or an InputError in one sentence that names it; `form` is that of the file.

    >>> text_of("nowhere.toml", "a chain file")
    Traceback (most recent call last):
    softstart.errors.InputError: "nowhere.toml": there is no such file; give the path of a chain file (TOML).
    """
    file = Path(path)
    try:
        return file.read_text("utf-8")
    except FileNotFoundError:
        reason = f"there is no such file; give the path of {what} ({form})"
    except IsADirectoryError:
        reason = f"this is a folder; give the path of {what} ({form})"
    except UnicodeDecodeError:
        reason = f"this file is no UTF-8 text; give the path of {what} ({form})"
    except OSError as error:
        reason = f"the file cannot be read ({error.strerror or error}); give the path of {what} ({form})"
    raise InputError(f"{show(str(path))}: {reason}.")


def read_document(
    text: str,
    tables: Sequence[Table],
    what: str,
    *,
    where: str = "",
    also: Mapping[str, object] | None = None,
) -> dict[str, Any]:
    """All tables of a TOML text: {table name: {key: value in SI}}, a list of such where there are many.

    `what` names the kind of file, as "a chain file"; `where` is put before each sentence; `also` holds
    changes as typed at a command line, {"table.key": value}, which go before what the text says. Raises one
    InputError for everything that is wrong.

    >>> shaft = Table("shaft", (Field("stiffness", "N*m/rad", "stiffness", '"5 N*m/rad"', "above 0"),))
    >>> read_document("[shaft]\\nstiffness = '2 kN*m/rad'", [shaft], "a test file")
    {'shaft': {'stiffness': 2000.0}}
    >>> read_document("[shaft]\\nstifness = -1", [shaft], "a test file")
    Traceback (most recent call last):
    softstart.errors.InputError: [shaft] stifness = -1: [shaft] has no such key; did you mean stiffness?
    """
    wording = Wording(where, style="toml")
    names = [table.name for table in tables if table.name]
    document = parsed(text, wording, what, names)
    wrong: list[str] = []
    for path, value in (also or {}).items():
        wrong += _changed(document, path, value, tables, what)
    top = next((table for table in tables if not table.name), Table("", ()))
    wrong += _strays(document, top, names, wording, what)
    found: dict[str, Any] = {}
    for table in tables:
        if not table.name:
            single = {key: value for key, value in document.items() if key not in names}
            found[""], more = _read(single, table, "", wording)
        else:
            found[table.name], more = _table(document, table, wording, what)
        wrong += more
    if wrong:
        raise InputError(wrong)
    return found


def read_table(given: Mapping[str, object], table: Table, *, style: str = "python") -> dict[str, Any]:
    """The values of one table given from Python, in SI; raises one InputError for everything that is wrong.

    >>> read_table({"i": "three"}, Table("gear", (Field("i", "1", "ratio", "3"),)))
    Traceback (most recent call last):
    softstart.errors.InputError: i = "three": this is no number with a unit; write a plain number such as ...
    """
    values, wrong = _read(given, table, "", Wording(style=style))
    known = {field.key for field in table.fields}
    wrong += [
        _unknown(key, given[key], "", sorted(known), Wording(style=style))
        for key in given
        if key not in known
    ]
    if wrong:
        raise InputError(wrong)
    return values


def _changed(
    document: dict[str, Any], path: str, value: object, tables: Sequence[Table], what: str
) -> Iterator[str]:
    """Put a change in its place, or say why there is none."""
    name, dot, key = path.rpartition(".")
    name, _, number = name.partition("[")
    table = next((one for one in tables if one.name == name), None)
    if table is None or key not in {field.key for field in table.fields}:
        paths = [f"{one.name}.{f.key}" if one.name else f.key for one in tables for f in one.fields]
        meant = nearest(path, paths)
        yield f"{path}: {what} has no such key; " + (
            f"did you mean {meant}?" if meant else f"it has {', '.join(paths)}."
        )
        return
    if not dot:
        document[key] = value
    elif not table.many:
        inner = document.setdefault(name, {})
        if isinstance(inner, dict):
            inner[key] = value
    else:
        rows = document.get(name)
        index = number.rstrip("]")
        count = len(rows) if isinstance(rows, list) else 0
        if not index.isdecimal() or not 1 <= int(index) <= count:
            yield f"{path}: write {name}[N].{key} with N from 1 to {count}."
        elif isinstance(rows, list) and isinstance(rows[int(index) - 1], dict):
            rows[int(index) - 1][key] = value


def _strays(
    document: Mapping[str, Any], top: Table, names: Sequence[str], wording: Wording, what: str
) -> Iterator[str]:
    """Keys and tables that the file should not have."""
    own = [field.key for field in top.fields]
    for key, value in document.items():
        if key in own or key in names:
            continue
        if isinstance(value, dict) or (isinstance(value, list) and value and isinstance(value[0], dict)):
            meant = nearest(key, names)
            rest = (
                f"did you mean [{meant}]?"
                if meant
                else f"its tables are {', '.join(f'[{n}]' for n in names)}"
            )
            yield wording.sentence(f"[{key}]", f"{what} has no such table; {rest}")
        else:
            yield _unknown(key, value, "", [*own, *names], wording)


def _unknown(key: str, value: object, place: str, known: Sequence[str], wording: Wording) -> str:
    meant = nearest(key, known)
    rest = f"did you mean {meant}?" if meant else f"the keys are {', '.join(known) or 'none'}"
    here = place.rstrip(", ") or ("this file" if wording.style == "toml" else "it")
    return wording.sentence(f"{place}{key} = {wording.show(value)}", f"{here} has no such key; {rest}")


def _table(document: Mapping[str, Any], table: Table, wording: Wording, what: str) -> tuple[Any, list[str]]:
    """The content of [name] or of all [[name]]."""
    content = document.get(table.name)
    bracket = f"[[{table.name}]]" if table.many else f"[{table.name}]"
    if table.many:
        rows = [] if content is None else content
        if not isinstance(rows, list) or any(not isinstance(row, dict) for row in rows):
            return [], [
                wording.sentence(f"[{table.name}]", f"there may be several; write {bracket} before each")
            ]
        if len(rows) < table.least:
            reason = f"{what} needs at least {table.least}, and there are {len(rows)}; add {bracket} tables"
            return [], [wording.sentence(bracket, reason)]
        values, wrong = [], []
        for i, row in enumerate(rows, start=1):
            one, more = _checked(row, table, f"[{table.name}] {i}, ", wording)
            values.append(one)
            wrong += more
        return values, wrong
    if content is None and not table.required:
        return None, []
    if content is not None and not isinstance(content, dict):
        return {}, [wording.sentence(table.name, f"this is one table; write {bracket} on a line of its own")]
    return _checked(content or {}, table, f"{bracket} ", wording)


def _checked(
    given: Mapping[str, object], table: Table, place: str, wording: Wording
) -> tuple[dict[str, Any], list[str]]:
    values, wrong = _read(given, table, place, wording)
    known = [field.key for field in table.fields]
    strays = [_unknown(key, given[key], place, known, wording) for key in given if key not in known]
    return values, [*strays, *wrong]


def _read(
    given: Mapping[str, object], table: Table, place: str, wording: Wording
) -> tuple[dict[str, Any], list[str]]:
    """The values of the fields, and a sentence for each that is wrong or missing."""
    values: dict[str, Any] = {}
    wrong: list[str] = []
    keys = [field.key for field in table.fields]
    misspelt = {nearest(key, keys) for key in given if key not in keys}
    for field in table.fields:
        if field.key not in given or (given[field.key] is None and field.default is None):
            if field.default is REQUIRED and field.key not in misspelt:
                needed = f"the {field.meaning} is needed; write for example {field.key} = {field.example}"
                wrong.append(wording.sentence(f"{place}{field.key} is missing", needed))
            elif field.default is not REQUIRED:
                values[field.key] = field.default
            continue
        value = given[field.key]
        try:
            values[field.key] = _value(field, value)
        except RefusedError as refusal:
            index = "" if refusal.index is None else f"[{', '.join(map(str, refusal.index))}]"
            shown = wording.show(value if refusal.index is None else refusal.value)
            wrong.append(wording.sentence(f"{place}{field.key}{index} = {shown}", refusal.reason))
    return values, wrong


def _value(field: Field, value: object) -> Any:
    """One value in SI, or a RefusedError with reason and remedy."""
    if not field.unit:
        if field.choices:
            if value not in field.choices:
                meant = nearest(value, field.choices) if isinstance(value, str) else None
                listed = " or ".join(show(one) for one in field.choices)
                raise RefusedError(
                    f"the {field.meaning} is {listed}" + (f"; did you mean {show(meant)}?" if meant else "")
                )
            return value
        if not isinstance(value, str) or not value.strip():
            raise RefusedError(f"the {field.meaning} must be text, such as {field.example}")
        return value
    number = parse(value, field.unit, infinite=field.infinite)
    if field.many:
        number = np.atleast_1d(number)
        if number.ndim > 1:
            raise RefusedError(f"the {field.meaning} is one list of numbers, such as {field.example}")
    elif np.ndim(number) != 0:
        raise RefusedError(f"the {field.meaning} is one number, not a list")
    values = np.asarray(number)
    _refuse(number, LIMITS[field.limit](values), f"the {field.meaning} must be {field.limit}")
    beyond = np.isfinite(values) & (np.abs(values) > MOST)
    if field.limit == "above 0":
        beyond |= values < LEAST
    size = f"its size in {field.unit}" if field.unit != "1" else "it"
    _refuse(number, ~beyond, f"{size} must be between {LEAST:g} and {MOST:g}; check number and unit")
    return number


def _refuse(number: Any, allowed: Any, reason: str) -> None:
    """Raise for the first value of a number or list that is not allowed."""
    allowed = np.asarray(allowed)
    if allowed.all():
        return
    if isinstance(number, float):
        raise RefusedError(reason)
    index = tuple(int(i) for i in np.argwhere(~allowed)[0])
    raise RefusedError(reason, float(number[index]), index)
