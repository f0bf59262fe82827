"""TOML documents of tables of parameters: read with all mistakes at once, and written in SI.

A document is described by its tables, a table by its parameters. What is read is plain data by table and key;
the classes made from it check what parameters say about one another.
"""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeVar

import numpy as np

from softstart.errors import MOST, InputError
from softstart.input.parameters import Mistake, Parameter, Wording, read_values, sentences_of, without_unit
from softstart.quantities import doubtful_comma, nearest, shortest, show

T = TypeVar("T")

MOST_TEXT = 1_000_000  # characters of a TOML file: what is longer takes longer than anyone waits
# a key with this many dots takes memory by their square, and no table is nested like that
_DEEP = re.compile(r"""(?<![\w"'.-])(?:[\w"'-]+[ \t]*\.[ \t]*){9}[\w"'-]{0,9}""")

__all__ = [
    "Table", "changed", "document_text", "literal", "made", "parsed", "placed", "read_document",
    "read_table", "renamed", "table_text",
]  # fmt: skip


@dataclass(frozen=True)
class Table:
    """One table of a document: `name` as in [name], "" for the keys above the first table.

    With `many` it is a list of tables, [[name]], of at least `least` entries. A single one that is not
    `required` may be left out as a whole: it is None then.
    """

    name: str
    parameters: tuple[Parameter, ...]
    many: bool = False
    least: int = 0
    required: bool = True

    def __post_init__(self) -> None:
        own = (p if p.table == self.name else replace(p, table=self.name) for p in self.parameters)
        object.__setattr__(self, "parameters", tuple(own))

    @property
    def by_key(self) -> dict[str, Parameter]:
        """The parameters by their keys."""
        return {p.key: p for p in self.parameters}

    @property
    def bracket(self) -> str:
        """The line above its keys."""
        return f"[[{self.name}]]" if self.many else f"[{self.name}]"


# ---- reading --------------------------------------------------------------------------------------------


def read_document(
    text: str,
    tables: Sequence[Table],
    what: str,
    *,
    where: str = "",
    also: Mapping[str, object] | None = None,
    usual: Mapping[str, str] | None = None,
) -> dict[str, Any]:
    """All tables of a TOML text: {table name: {key: value in SI}}, a list of such where there are many.

    `what` names what is described, as "a chain"; `where` is put before each sentence; `also` holds changes as
    typed at a command line, {"table.key": value}, which go before what the text says; keys in `usual` have
    units, see `without_unit`. Raises one InputError for everything that is wrong.

    >>> shaft = Table("shaft", (Parameter("stiffness", "N*m/rad", "stiffness", '"5 N*m/rad"', "above 0"),))
    >>> read_document("[shaft]\\nstiffness = '2 kN*m/rad'", [shaft], "a test")
    {'shaft': {'stiffness': 2000.0}}
    >>> read_document("[shaft]\\nstifness = -1", [shaft], "a test")
    Traceback (most recent call last):
    softstart.errors.InputError: [shaft] stifness = -1: [shaft] has no key stifness; did you mean stiffness?
    """
    wording = Wording(where, style="toml")
    document = parsed(text, wording, what, tables)
    wrong = list(changed(document, also or {}, tables, what))
    given, mistakes = placed(document, tables, what, wording)
    found: dict[str, Any] = {}
    in_rows: list[str] = []
    for table in tables:
        content = given.get(table.name)
        if table.many:
            found[table.name], more_sentences = _rows(content or [], table, tables, what, wording)
            in_rows += more_sentences
        elif content is None and not table.required:
            found[table.name] = None
        else:
            found[table.name], more = read_values(content or {}, table.by_key, wording)
            mistakes += [*more, *without_unit(content or {}, table.by_key, usual or {}, wording)]
    wrong += [*sentences_of(mistakes), *in_rows]
    if wrong:
        bare = " or as a bare number in rad/s" if usual else "\0"  # it would be refused
        raise InputError(one.replace(bare, "") for one in wrong)
    return found


def _rows(
    rows: Sequence[Mapping[str, object]], table: Table, tables: Sequence[Table], what: str, wording: Wording
) -> tuple[list[dict[str, Any]], list[str]]:
    """The values of each of several tables, and what is wrong in them."""
    found, wrong = [], []
    for i, row in enumerate(rows, start=1):
        numbered = replace(wording, row=f"[{table.name}] {i}, ")
        strays = [
            _misspelt(f"{numbered.row}{key} = {wording.show(value)}", key, table, tables, what, wording)
            for key, value in row.items()
            if key not in table.by_key
        ]
        values, mistakes = read_values(row, table.by_key, numbered)
        found.append(values)
        wrong += sentences_of([*strays, *mistakes])
    return found, wrong


def made(make: Callable[..., T], values: Mapping[str, Any], place: str, wrong: list[str]) -> T | None:
    """What `make` returns for the values; where it refuses them, its sentences go to `wrong`."""
    try:
        return make(**values)
    except InputError as error:
        wrong.extend(place + sentence for sentence in error.sentences)
        return None


def read_table(given: Mapping[str, object], table: Table, *, style: str = "python") -> dict[str, Any]:
    """The values of one table given from Python, in SI; raises one InputError for everything that is wrong.

    >>> read_table({"i": "three"}, Table("gear", (Parameter("i", "1", "ratio", "3"),)))
    Traceback (most recent call last):
    softstart.errors.InputError: i = "three": this is no number with a unit; write a plain number such as ...
    """
    wording = Wording(style=style)
    known = [p.name for p in table.parameters]
    values, mistakes = read_values(given, {p.name: p for p in table.parameters}, wording)
    for name, value in given.items():
        if name not in known:
            meant = nearest(name, known)
            rest = f"did you mean {meant}?" if meant else f"there are {', '.join(known)}"
            reason = f"there is no parameter {name}; {rest}"
            mistakes.append(Mistake(wording.sentence(f"{name} = {wording.show(value)}", reason), meant=meant))
    if mistakes:
        raise InputError(sentences_of(mistakes))
    return values


def parsed(text: str, wording: Wording, what: str, tables: Sequence[Table] = ()) -> dict[str, Any]:
    """The document that the TOML text holds; `what` names what it describes.

    Raises `InputError`, with the line, for text that is no TOML, or that is empty where there are `tables`.

    >>> parsed("gap = 0.5 rad", Wording(), "a drive")
    Traceback (most recent call last):
    softstart.errors.InputError: line 1, column 11, 'gap = 0.5 rad': this is not valid TOML (expected ...
    """
    if len(text) > MOST_TEXT:
        size = f"it has {len(text) / 1e6:.3g} million characters, and a TOML file at most {MOST_TEXT / 1e6:g}"
        raise InputError(wording.whole(f"{size}; a long profile is read from a CSV file"))
    if (deep := _DEEP.search(text)) is not None:
        line = text.count("\n", 0, deep.start()) + 1
        raise InputError(wording.whole(f"line {line}, {show(deep.group())}: keys are nested too deeply"))
    try:
        document = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InputError(_invalid(str(error), text, wording)) from None
    except ValueError:  # of int(): what else is wrong is a TOMLDecodeError
        raise InputError(wording.whole("a whole number in it has thousands of digits; shorten it")) from None
    except RecursionError:
        raise InputError(wording.whole(f"lists or tables are nested too deeply for {what} file")) from None
    if tables and not document:
        named = " and ".join(f"[{table.name}]" for table in tables if table.name)
        raise InputError(wording.whole(f"it is empty; {what} file has the tables {named}"))
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
    unquoted = what.startswith(("invalid value", "expected newline or end of document"))
    remedy = '; write text and quantities in quotes: gap = "0.5 rad"' if unquoted else ""
    if comma := re.fullmatch(r"[\w.-]+\s*=\s*([+-]?\d+,\d+[^,\[\]#]*?)\s*(?:#.*)?", shown):
        what, remedy = doubtful_comma(comma[1]), ""
    cut = shown if len(shown) <= 60 else f"{shown[:60]}..."
    subject = f"{where}, {cut!r}" if shown else where
    return wording.sentence(subject, f"this is not valid TOML ({what}){remedy}")


def changed(
    document: dict[str, Any], changes: Mapping[str, object], tables: Sequence[Table], what: str
) -> Iterator[str]:
    """Put changes by path into the document; a sentence for each that cannot be."""
    former = {p.formerly: p.path for table in tables for p in table.parameters if p.formerly}
    for path, value in changes.items():
        yield from _changed(document, former.get(path, path), value, tables, what)


def _changed(
    document: dict[str, Any], path: str, value: object, tables: Sequence[Table], what: str
) -> Iterator[str]:
    name, dot, key = path.rpartition(".")
    name, _, number = name.partition("[")
    table = next((one for one in tables if one.name == name), None)
    if table is None or key not in table.by_key:
        paths = [p.path for one in tables for p in one.parameters]
        meant = nearest(path, paths)
        yield f"{path}: {what} file has no such key; " + (
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


def placed(
    document: Mapping[str, Any], tables: Sequence[Table], what: str, wording: Wording
) -> tuple[dict[str, Any], list[Mistake]]:
    """What stands in each table, by its name, and every key or table that stands where it should not.

    A misplaced value is returned as if it stood in its table, so that its own mistakes are found in the same
    go. The keys within the rows of [[tables]] are not looked at.
    """
    reader = _Reader(tables, what, wording)
    for key, value in renamed(document, tables).items():
        reader.take_top(key, value)
    for table in tables:
        reader.count(table)
    for parameter, value in reader.misplaced:
        reader.given.setdefault(parameter.table, {}).setdefault(parameter.key, value)
    return reader.given, reader.mistakes


def renamed(document: Mapping[str, Any], tables: Sequence[Table]) -> Mapping[str, Any]:
    """The document with keys of former versions under their present names, where these are not given."""
    for parameter in (p for table in tables for p in table.parameters if p.formerly):
        name, _, key = parameter.formerly.rpartition(".")
        old, new = document.get(name), document.get(parameter.table, {})
        if isinstance(old, dict) and key in old and isinstance(new, dict) and parameter.key not in new:
            document = {**document, name: {one: value for one, value in old.items() if one != key}}
            table = document.get(parameter.table, {})
            document = {**document, parameter.table: {**table, parameter.key: old[key]}}
    return document


class _Reader:
    """Takes the keys of a document one by one."""

    def __init__(self, tables: Sequence[Table], what: str, wording: Wording) -> None:
        self.tables, self.what, self.wording = tables, what, wording
        self.named = {table.name: table for table in tables if table.name}
        self.top = next((table for table in tables if not table.name), Table("", ()))
        self.given: dict[str, Any] = {}
        self.misplaced: list[tuple[Parameter, object]] = []
        self.mistakes: list[Mistake] = []

    def take_top(self, key: str, value: object) -> None:
        """A key above the first table, or a table."""
        if len(self.mistakes) > MOST and key not in self.top.by_key and key not in self.named:
            self._note(key, f"{self.what} file has no such key")  # in short: it is counted, not shown
            return
        if key in self.top.by_key:
            self.given.setdefault("", {})[key] = value
        elif key in self.named:
            self._take_table(self.named[key], value)
        elif isinstance(value, dict) and not any(key in table.by_key for table in self.tables):
            self._unknown_table(key, value)
        else:
            self._stray(f"{key} = {self.wording.show(value)}", key, value, self.top)

    def count(self, table: Table) -> None:
        """Whether there are enough of a table of which there may be several."""
        rows = self.given.setdefault(table.name, []) if table.many else []
        if table.many and rows is not None and len(rows) < table.least:
            needed = f"{self.what} file needs at least {table.least}, and there are {len(rows)}"
            self._note(table.bracket, f"{needed}; add {table.bracket} tables")

    def _take_table(self, table: Table, value: object) -> None:
        if table.many:
            if isinstance(value, list) and all(isinstance(row, dict) for row in value):
                self.given[table.name] = value
                return
            self.given[table.name] = None
            self._note(f"[{table.name}]", f"there may be several; write {table.bracket} before each")
        elif not isinstance(value, dict):
            form = "one table, not a list of tables" if isinstance(value, list) else "a table"
            reason = f"{table.name} is {form}; write [{table.name}] on a line of its own and its keys below"
            subject = f"{table.name} = {self.wording.show(value)}"
            self._note(subject, reason, *(p.path for p in table.parameters))
        else:
            own = self.given.setdefault(table.name, {})
            for key, content in value.items():
                inner = self.named.get(f"{table.name}.{key}")
                if inner is not None:
                    self._take_table(inner, content)
                elif key in table.by_key:
                    own[key] = content
                elif len(self.mistakes) > MOST:
                    self._note(key, f"[{table.name}] has no such key")
                else:
                    self._stray(f"[{table.name}] {key} = {self.wording.show(content)}", key, content, table)

    def _unknown_table(self, key: str, value: dict[str, object]) -> None:
        meant = nearest(key, self.named)
        if meant is None:
            listed = ", ".join(f"[{name}]" for name in self.named)
            self._note(f"[{key}]", f"{self.what} has no such table; its tables are {listed}")
            return
        self._note(f"[{key}]", f"{self.what} has no such table; did you mean [{meant}]?")
        table = self.named[meant]
        if table.many:
            return
        for inner, content in value.items():
            if inner in table.by_key:
                self.misplaced.append((table.by_key[inner], content))
            else:
                self._stray(f"[{key}] {inner} = {self.wording.show(content)}", inner, content, table)

    def _stray(self, subject: str, key: str, value: object, table: Table) -> None:
        """A key that this table does not have."""
        everywhere = [p for one in self.tables for p in one.parameters]
        flat = next((p for p in everywhere if p.name == key != p.key), None)
        if flat is not None:
            homes = [flat]
            remedy = f"in a file it is written {flat.key}, below [{flat.table}]"
        else:
            homes = [p for p in everywhere if p.key == key]
            places = " or ".join(_home(p, self.named) for p in homes)
            remedy = f"{key} belongs {places}"
        if not homes:
            self.mistakes.append(_misspelt(subject, key, table, self.tables, self.what, self.wording))
            return
        alone = len(homes) == 1
        if alone and not isinstance(value, dict) and not self._several(homes[0].table):
            self.misplaced.append((homes[0], value))
        self._note(subject, remedy, *(p.path for p in homes if alone))

    def _several(self, table: str) -> bool:
        return table in self.named and self.named[table].many

    def _note(self, subject: str, reason: str, *meant: str) -> None:
        sentence = self.wording.sentence(subject, reason)
        self.mistakes.extend([Mistake(sentence, meant=path) for path in meant] or [Mistake(sentence)])


def _home(parameter: Parameter, named: Mapping[str, Table]) -> str:
    return f"below {named[parameter.table].bracket}" if parameter.table else "above the first table"


def _misspelt(
    subject: str, key: str, table: Table, tables: Iterable[Table], what: str, wording: Wording
) -> Mistake:
    """A key that no table has: the one that was probably meant."""
    own = table.by_key
    by_symbol = {p.symbol: p for one in tables for p in one.parameters if p.symbol}
    meant = own.get(nearest(key.removeprefix(f"{table.name}_"), own) or "") or by_symbol.get(key)
    if meant is None:
        everywhere = {p.key: p for one in tables for p in one.parameters}
        meant = everywhere.get(nearest(key, everywhere) or "")
    where = f"[{table.name}]" if table.name else f"{what} file"
    if meant is None:
        names = ", ".join([*own, *(f"[{one.name}]" for one in tables if one.name and not table.name)])
        return Mistake(wording.sentence(subject, f"{where} has no key {key}; it has {names}"))
    name = meant.key if meant.table == table.name else meant.place
    sentence = wording.sentence(subject, f"{where} has no key {key}; did you mean {name}?")
    return Mistake(sentence, meant=meant.path)


# ---- writing --------------------------------------------------------------------------------------------


def table_text(table: Table, values: Mapping[str, object], *, units: bool = True) -> str:
    """The lines of a table, each with unit and meaning in a comment (`units`), or speeds with units.

    Numbers are in SI, or as `shortest` writes them; None is left out.

    >>> shaft = Table("shaft", (Parameter("gap", "rad", "total gap", '"0.5 rad"'),))
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
            text = literal(value, p.unit, always=p.unit == "rad/s" and not units)
            unit = "" if p.unit == "1" or text.startswith('"') else f"{p.unit}: "
            lines.append(f"{p.key} = {text}" + (f"  # {unit}{p.meaning}" if p.unit and units else ""))
    return "\n".join(lines)


def document_text(blocks: Iterable[tuple[Table, Mapping[str, object]]], *, units: bool = True) -> str:
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
