"""A drive as TOML text: from tables and keys to flat names, and back."""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

import numpy as np

from softstart.drive.parameters import PARAMETERS, TABLES, Parameter
from softstart.drive.sentences import Mistake, Wording
from softstart.errors import InputError
from softstart.quantities import nearest

__all__ = ["flatten", "parsed", "write"]

_TOP = {p.key: p for p in PARAMETERS.values() if not p.table}
_KEYS = {table: {p.key: p for p in PARAMETERS.values() if p.table == table} for table in TABLES}


def flatten(text: str, wording: Wording) -> tuple[dict[str, object], list[Mistake]]:
    """The values by flat name, and every key or table that stands where it should not.

    A misplaced value is read as if it stood in its place, so that its own mistakes are found in the same go.
    Raises `InputError` for text that is no TOML, or that is empty.

    >>> given, mistakes = flatten('gap = 0.5\\n[motor]\\ninertia = "350 kg*cm^2"', Wording(style="toml"))
    >>> given
    {'motor_inertia': '350 kg*cm^2', 'gap': 0.5}
    >>> mistakes[0].sentence
    'gap = 0.5: gap belongs below [shaft].'
    """
    document = parsed(text, wording, "a drive file", TABLES)
    reader = _Reader(wording)
    for key, value in document.items():
        reader.take_top(key, value)
    return reader.settled(), reader.mistakes


def parsed(text: str, wording: Wording, what: str, tables: Iterable[str]) -> dict[str, Any]:
    """The document that the TOML text holds; `what` and its `tables` are named if it holds none.

    Raises `InputError`, with the line, for text that is no TOML, or that is empty.

    >>> parsed("gap = 0.5 rad", Wording(), "a drive file", ["shaft"])
    Traceback (most recent call last):
    softstart.errors.InputError: line 1, column 11, 'gap = 0.5 rad': this is not valid TOML (expected ...
    """
    try:
        document = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InputError(_invalid(str(error), text, wording)) from None
    except RecursionError:
        raise InputError(wording.whole(f"lists or tables are nested too deeply for {what}")) from None
    if not document:
        named = " and ".join(f"[{table}]" for table in tables)
        raise InputError(wording.whole(f"it is empty; {what} has the tables {named}"))
    return document


def _invalid(message: str, text: str, wording: Wording) -> str:
    found = re.fullmatch(r"(.*) \(at (?:line (\d+), column (\d+)|end of document)\)", message, re.DOTALL)
    if found is None:
        return wording.whole(f"it is not valid TOML: {message}")
    what, line, column = found.groups()
    lines = text.splitlines() or [""]
    number = int(line) if line else len(lines)
    where = f"line {number}" + (f", column {column}" if column else "")
    shown = lines[number - 1].strip() if 0 < number <= len(lines) else ""
    what = what[0].lower() + what[1:]
    remedy = (
        '; write text and quantities in quotes: gap = "0.5 rad"' if what.startswith(_NEEDS_QUOTES) else ""
    )
    cut = shown if len(shown) <= 60 else f"{shown[:60]}..."
    return wording.sentence(
        f"{where}, {cut!r}" if shown else where, f"this is not valid TOML ({what}){remedy}"
    )


_NEEDS_QUOTES = ("invalid value", "expected newline or end of document")


class _Reader:
    """Takes the keys of a document one by one."""

    def __init__(self, wording: Wording) -> None:
        self.wording = wording
        self.mistakes: list[Mistake] = []
        self.given: dict[str, object] = {}
        self.misplaced: dict[str, object] = {}

    def settled(self) -> dict[str, object]:
        """What stands in its place goes before what does not."""
        return self.given | {name: v for name, v in self.misplaced.items() if name not in self.given}

    def take_top(self, key: str, value: object) -> None:
        if key in _TOP:
            self.given[key] = value
        elif key in TABLES:
            self._take_table(key, value)
        elif isinstance(value, dict) and not any(key in keys for keys in _KEYS.values()):
            self._unknown_table(key, value)
        else:
            self._stray(f"{key} = {self.wording.show(value)}", key, value, "")

    def _take_table(self, table: str, value: object) -> None:
        if not isinstance(value, dict):
            form = "one table, not a list of tables" if isinstance(value, list) else "a table"
            reason = f"{table} is {form}; write [{table}] on a line of its own and its keys below"
            subject = f"{table} = {self.wording.show(value)}"
            self._note(subject, reason, *(p.name for p in _KEYS[table].values()))
            return
        for key, content in value.items():
            if key in _KEYS[table]:
                self.given[_KEYS[table][key].name] = content
            else:
                self._stray(f"[{table}] {key} = {self.wording.show(content)}", key, content, table)

    def _unknown_table(self, key: str, value: dict[str, object]) -> None:
        meant = nearest(key, TABLES)
        if meant is None:
            tables = ", ".join(f"[{table}]" for table in TABLES)
            self._note(f"[{key}]", f"a drive has no such table; its tables are {tables}")
            return
        self._note(f"[{key}]", f"a drive has no such table; did you mean [{meant}]?")
        for inner, content in value.items():
            if inner in _KEYS[meant]:
                self.misplaced.setdefault(_KEYS[meant][inner].name, content)
            else:
                self._stray(f"[{key}] {inner} = {self.wording.show(content)}", inner, content, meant)

    def _stray(self, subject: str, key: str, value: object, table: str) -> None:
        """A key that this table does not have."""
        flat = PARAMETERS.get(key)
        if flat is not None and flat.key != key:
            homes = [flat]
            remedy = f"in a file it is written {flat.key}, below [{flat.table}]"
        else:
            homes = [p for p in PARAMETERS.values() if p.key == key]
            places = " or ".join(f"below [{p.table}]" if p.table else "above the first table" for p in homes)
            remedy = f"{key} belongs {places}"
        if len(homes) == 1 and not isinstance(value, dict):
            self.misplaced.setdefault(homes[0].name, value)
        if homes:
            self._note(subject, remedy, *(p.name for p in homes if len(homes) == 1))
            return
        self._misspelt(subject, key, table)

    def _misspelt(self, subject: str, key: str, table: str) -> None:
        where = f"[{table}]" if table else "a drive file"
        own = _KEYS[table] if table else _TOP
        by_symbol = {p.symbol: p for p in PARAMETERS.values() if p.symbol}
        plain = key.removeprefix(f"{table}_")
        meant = own.get(nearest(plain, own) or "") or by_symbol.get(key)
        if meant is None:
            everywhere = {p.key: p for p in PARAMETERS.values()}
            meant = everywhere.get(nearest(key, everywhere) or "")
        if meant is None:
            names = ", ".join(own) if table else ", ".join([*own, *(f"[{name}]" for name in TABLES)])
            self._note(subject, f"{where} has no key {key}; it has {names}")
        else:
            name = meant.key if meant.table == table else meant.place
            self._note(subject, f"{where} has no key {key}; did you mean {name}?", meant.name)

    def _note(self, subject: str, reason: str, *meant: str) -> None:
        sentence = self.wording.sentence(subject, reason)
        self.mistakes.extend([Mistake(sentence, meant=name) for name in meant] or [Mistake(sentence)])


def write(values: Mapping[str, object]) -> str:
    """The TOML text of the given parameters, in SI, each with its unit and meaning behind it.

    >>> print(write({"name": "crane", "gap": 0.5}))
    name = "crane"
    <BLANKLINE>
    [shaft]
    gap = 0.5  # rad: total angular gap
    <BLANKLINE>
    """
    top = [_line(p, values[p.key]) for p in _TOP.values() if values.get(p.key) is not None]
    blocks = ["\n".join(top)] if top else []
    for table, keys in _KEYS.items():
        lines = [_line(p, values[p.name]) for p in keys.values() if values.get(p.name) is not None]
        if lines:
            blocks.append("\n".join([f"[{table}]", *lines]))
    return "\n\n".join(blocks) + "\n"


def _line(parameter: Parameter, value: object) -> str:
    text = f"{parameter.key} = {_literal(value)}"
    if not parameter.unit:
        return text
    unit = "" if parameter.unit == "1" else f"{parameter.unit}: "
    return f"{text}  # {unit}{parameter.meaning}"


def _literal(value: object) -> str:
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    return "".join(_number(value))


def _number(value: object) -> Iterator[str]:
    yield repr(value.tolist() if isinstance(value, np.ndarray) else value)
