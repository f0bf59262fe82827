"""TOML documents of tables of parameters: read with all mistakes at once, and written in SI.

A document is described by its tables, a table by its parameters. What is read is plain data by table and key;
the classes made from it check what parameters say about one another.
"""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from softstart.errors import MOST, InputError
from softstart.hints import did_you_mean, nearest, term
from softstart.input.gear import behind
from softstart.input.parameters import Mistake, Parameter, Wording, meant_by
from softstart.quantities import doubtful_comma, shortest, show

PROJECT = "# A project of softstart"  # how the file of one begins
MOST_TEXT = 1_000_000  # characters of a TOML file: what is longer takes longer than anyone waits
# a key with this many dots takes memory by their square, and no table is nested like that
_DEEP = re.compile(r"""(?<![\w"'.-])(?:[\w"'-]+[ \t]*\.[ \t]*){9}[\w"'-]{0,9}""")


@dataclass(frozen=True)
class DocumentTable:
    """One table of a document: `name` as in [name], "" for the keys above the first table.

    With `many` it is a list of tables, [[name]], of at least `least` entries. A single one that is not
    `required` may be left out as a whole. For keys of other tables only the `suggested` ones are proposed.
    """

    name: str
    parameters: tuple[Parameter, ...]
    many: bool = False
    least: int = 0
    required: bool = True
    suggested: bool = True

    def __post_init__(self) -> None:
        parameters = (p if p.table == self.name else replace(p, table=self.name) for p in self.parameters)
        object.__setattr__(self, "parameters", tuple(parameters))

    @property
    def by_key(self) -> dict[str, Parameter]:
        """The parameters by their keys."""
        return {p.key: p for p in self.parameters}

    @property
    def bracket(self) -> str:
        """The line above its keys."""
        return f"[[{self.name}]]" if self.many else f"[{self.name}]"


# ---- reading --------------------------------------------------------------------------------------------


def parsed(text: str, wording: Wording, what: str, tables: Sequence[DocumentTable] = ()) -> dict[str, Any]:
    """The document that the TOML text holds; `what` names what it describes.

    Raises `InputError`, with the line, for text that is no TOML, or that is empty where there are `tables`.

    >>> parsed("gap = 0.5 rad", Wording(), "a drive")
    Traceback (most recent call last):
    softstart.errors.InputError: line 1, column 11, 'gap = 0.5 rad': this is not valid TOML (expected ...
    """
    subject, document = "", dict[str, Any]()
    if len(text) > MOST_TEXT:
        reason = (
            f"it has {len(text) / 1e6:.3g} million characters, and a TOML file at most {MOST_TEXT / 1e6:g}; "
            "a long profile is read from a CSV file"
        )
    elif (deep := _DEEP.search(text)) is not None:
        subject = f"line {text.count(chr(10), 0, deep.start()) + 1}, {show(deep.group())}"
        reason = "keys are nested too deeply"
    else:
        try:
            document = tomllib.loads(text)
            named = " and ".join(f"[{table.name}]" for table in tables if table.name)
            reason = "" if document or not tables else f"it is empty; {what} file has the tables {named}"
        except tomllib.TOMLDecodeError as error:
            subject, reason = _invalid(str(error), text)
        except ValueError:  # of int(): what else is wrong is a TOMLDecodeError
            reason = "a whole number in it has thousands of digits; shorten it"
        except RecursionError:
            reason = f"lists or tables are nested too deeply for {what} file"
    if reason:
        raise InputError(wording.sentence(subject, reason))
    return document


def kind_of_document(document: Mapping[str, Any]) -> str:
    """What a file holds: "project", "strategy", "duty", or else "machine".

    >>> kind_of_document({"choice": {}}), kind_of_document({"duty": [], "motor": {}})
    ('project', 'machine')
    """
    if {"version", "project", "machine", "choice"} & document.keys():
        return "project"
    if {"kind", "profile"} & document.keys():
        return "strategy"
    return "duty" if "duty" in document and not {"motor", "shaft", "mass"} & document.keys() else "machine"


def is_project(text: str) -> bool:
    """Whether a text is meant as a project, whole or not: by its first line, or by its tables.

    >>> is_project("[choice]"), is_project("[motor]"), is_project(PROJECT + "\\n[cho")
    (True, False, True)
    """
    if text.startswith(PROJECT):
        return True
    with suppress(InputError):  # no TOML
        return kind_of_document(parsed(text, Wording(), "a machine")) == "project"
    return False


def _invalid(message: str, text: str) -> tuple[str, str]:
    """Where text is no TOML, and why, from the message of tomllib."""
    match = re.fullmatch(r"(.*) \(at (?:line (\d+), column (\d+)|end of document)\)", message, re.DOTALL)
    what, line, column = match.groups() if match else (message, None, None)
    lines = text.splitlines() or [""]
    number = min(int(line or len(lines)), len(lines))
    shown = lines[number - 1].strip()
    subject = f"line {number}{f', column {column}' * bool(column)}{f', {shown[:60]!r}' * bool(shown)}"
    what = what[0].lower() + what[1:]
    unquoted = what.startswith(("invalid value", "expected newline or end of document"))
    remedy = '; write text and quantities in quotes: gap = "0.5 rad"' if unquoted else ""
    if comma := re.fullmatch(r"[\w.-]+\s*=\s*([+-]?\d+,\d+[^,\[\]#]*?)\s*(?:#.*)?", shown):
        what, remedy = doubtful_comma(comma[1]), ""
    return subject, f"this is not valid TOML ({what}){remedy}"


def apply_changes(
    document: dict[str, Any], changes: Mapping[str, object], tables: Sequence[DocumentTable], what: str
) -> Iterator[str]:
    """Put changes by path into the document; a sentence for each that cannot be."""
    paths = {p.path: (one, p) for one in tables for p in one.parameters}
    for path, value in changes.items():
        plain = re.sub(r"\[.*\]", "", path)
        if plain not in paths:
            remedy = did_you_mean(plain, paths, otherwise=f"it has {', '.join(paths)}.")
            yield f"{path}: {what} file has no such key; {remedy}"
            continue
        table, p = paths[plain]
        place: Any = document
        if table.many:
            rows, row = document.get(table.name), path[len(table.name) + 1 : -len(p.key) - 2]
            count = len(rows) if isinstance(rows, list) else 0
            if not row.isdecimal() or not 1 <= int(row) <= count:
                yield f"{path}: write {table.name}[N].{p.key} with N from 1 to {count}."
                continue
            place = document[table.name][int(row) - 1]
        elif table.name:
            place = document.setdefault(table.name, {})
        if isinstance(place, dict):
            place[p.key] = value


def placed(
    document: Mapping[str, Any], tables: Sequence[DocumentTable], what: str, wording: Wording
) -> tuple[dict[str, Any], list[Mistake]]:
    """What stands in each table, by its name, and every key or table that stands where it should not."""
    named = {"": DocumentTable("", ())} | {table.name: table for table in tables}
    everywhere = [p for table in tables for p in table.parameters]
    given: dict[str, Any] = {}
    mistakes: list[Mistake] = []

    def note(subject: str, reason: str, meant: Iterable[Parameter] = ()) -> None:
        mistakes.append(Mistake(wording.sentence(subject, reason), (), tuple(p.path for p in meant)))

    def take(table: DocumentTable, content: object, written: str = "") -> None:
        name = table.name
        if table.many:
            rows = isinstance(content, list) and all(isinstance(row, dict) for row in content)
            given[name] = content if rows else None
            if not rows:
                note(f"[{name}]", f"there may be several; write {table.bracket} before each")
            for i, row in enumerate(given[name] or [], start=1):
                mistakes.extend(
                    _unknown(f"[{name}] {i}, ", key, value, table, tables, what, wording)
                    for key, value in row.items()
                    if key not in table.by_key
                )
            return
        if not isinstance(content, dict):
            form = "one table, not a list of tables" if isinstance(content, list) else "a table"
            reason = f"{name} is {form}; write [{name}] on a line of its own and its keys below"
            note(f"{name} = {wording.show(content)}", reason, table.parameters)
            return
        values = given.setdefault(name, {})
        for key, value in content.items():
            path = f"{name}.{key}" if name else key
            if path in named:
                take(named[path], value)
            elif key in table.by_key:
                values[key] = value
            elif len(mistakes) > MOST:
                note(key, "there is no such key")  # in short: it is counted, not shown
            elif not name and isinstance(value, dict) and not any(p.key == key for p in everywhere):
                meant = nearest(key, [one for one in named if one])
                listed = ", ".join(one.bracket for one in tables if one.name)
                remedy = f"did you mean {named[meant].bracket}?" if meant else f"its tables are {listed}"
                note(f"[{key}]", f"{what} has no such table; {remedy}")
                if meant:
                    take(named[meant], value, key)
            else:
                place = f"[{written or name}] " if name else ""
                mistakes.append(_unknown(place, key, value, table, tables, what, wording))

    take(named[""], document)
    for table in tables:
        rows = given.setdefault(table.name, []) if table.many else None
        if rows is not None and len(rows) < table.least:
            needed = f"{what} file needs at least {table.least}, and there are {len(rows)}"
            note(table.bracket, f"{needed}; add {table.bracket} tables")
    return given, mistakes


def _unknown(
    place: str,
    key: str,
    value: object,
    table: DocumentTable,
    tables: Sequence[DocumentTable],
    what: str,
    wording: Wording,
) -> Mistake:
    """That a table has no such key, and those that were probably meant, in this table or in others."""
    everywhere = [p for one in tables if one.suggested or one == table for p in one.parameters]
    meant = meant_by(key.removeprefix(f"{table.name}_"), everywhere, table.parameters)
    brackets = {one.name: one.bracket for one in tables}

    def called(p: Parameter) -> str:
        elsewhere = f"{brackets[p.table]} {p.key}" if p.table else f"{p.key} above the first table"
        return p.key if p.table == table.name else elsewhere

    listed = [*table.by_key, *(one.bracket for one in tables if one.name and not table.name)]
    other = term(key) or f"it has {', '.join(listed)}"
    remedy = f"did you mean {' or '.join(map(called, meant))}?" if meant else other
    reason = f"{f'[{table.name}]' if table.name else f'{what} file'} has no key {key}; {remedy}"
    sentence = wording.sentence(f"{place}{key} = {wording.show(value)}", reason)
    row = place if table.many else ""
    return Mistake(sentence, (), tuple(f"{row}{p.path}" for p in meant) if len(meant) == 1 else ())


# ---- writing --------------------------------------------------------------------------------------------


def table_text(table: DocumentTable, values: Mapping[str, object], *, units: bool = True) -> str:
    """The lines of a table, each with unit and meaning in a comment (`units`), or speeds with units.

    Numbers are in SI, or as `shortest` writes them; None is left out.

    >>> shaft = DocumentTable("shaft", (Parameter("gap", "rad", "total gap", '"0.5 rad"'),))
    >>> print(table_text(shaft, {"gap": 0.5}), table_text(shaft, {"gap": 0.06981317007977318}), sep="\\n")
    [shaft]
    gap = 0.5  # rad: total gap
    [shaft]
    gap = "4 deg"  # total gap
    """
    lines = [table.bracket] if table.name else []
    for p in table.parameters:
        value = values.get(p.name)
        if value is not None:
            if isinstance(value, float) and p.limit.startswith("a whole number"):
                value = int(value)
            text = literal(value, p.unit, always=p.unit == "rad/s" and not units)
            unit = "" if p.unit == "1" or text.startswith('"') else f"{p.unit}: "
            meaning = p.meaning.removesuffix(" at the motor shaft") if behind(value) else p.meaning
            lines.append(f"{p.key} = {text}" + (f"  # {unit}{meaning}" if p.unit and units else ""))
    return "\n".join(lines)


def document_text(blocks: Iterable[tuple[DocumentTable, Mapping[str, object]]], *, units: bool = True) -> str:
    """The text of a document: one table after the other, without those that have no keys."""
    texts = ((table.name, table_text(table, values, units=units)) for table, values in blocks)
    return "\n\n".join(text for name, text in texts if text and (name == "" or "\n" in text)) + "\n"


def literal(value: object, unit: str = "", *, always: bool = False) -> str:
    """A value as TOML; numbers in as few digits as give back their bits, of the quantity with this SI unit.

    >>> literal(0.1), literal("a \\"b\\""), literal((1.0, True)), literal(np.array([1.0, 2.0]))
    ('0.1', '"a \\\\"b\\\\""', '[1.0, true]', '[1.0, 2.0]')
    """
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, list | tuple):
        return f"[{', '.join(literal(one, unit, always=always) for one in value)}]"
    if isinstance(value, float):
        text = shortest(value, unit)
        text += f" {unit}" if always and " " not in text else ""
        return f'"{text}"' if " " in text else text
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    return repr(value)
