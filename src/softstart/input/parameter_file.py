"""Parameter sets that are TOML files, found by name or path, read with all mistakes at once, and written."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from typing import Any, ClassVar, Self

from softstart.errors import InputError
from softstart.input.documents import (
    DocumentTable,
    apply_changes,
    document_text,
    kind_of_document,
    parsed,
    placed,
)
from softstart.input.files import Library
from softstart.input.gear import Gear
from softstart.input.parameter_set import ParameterSet
from softstart.input.parameters import Mistake, Parameter, Wording, without_unit

OTHER_FILES = {  # what to do with a file of another kind
    "project": '"softstart project open FILE" opens it, "softstart project report FILE" writes its report',
    "strategy": 'it is given as "softstart compare DRIVE --controllers FILE"',
    "duty": '"softstart duty DRIVE --duty FILE" carries it out',
}


class ParameterFile(ParameterSet):
    """A parameter set that is a TOML file; those in its `LIBRARY` are shipped."""

    LIBRARY: ClassVar[Library]

    def __init_subclass__(cls, library: Library | None = None, what: str = "", **more: Any) -> None:
        if library is not None:
            cls.LIBRARY, what = library, library.what
        super().__init_subclass__(what=what, **more)

    @classmethod
    def load(cls, given: str | os.PathLike[str], also: Mapping[str, object] | None = None) -> Self:
        """From a TOML file, or a shipped one by its name; `also` as in `from_toml`.

        Raises `InputError` with a sentence for every mistake, each with the file, the table and the key.

        >>> from softstart import Chain, Drive
        >>> Drive.load("crane-4amtkf").gap, len(Chain.load("crane-4-mass").masses)
        (0.5, 4)
        """
        text, where = cls.LIBRARY.find(given)
        return cls.from_toml(text, where=where, also=also)

    @classmethod
    def from_toml(cls, text: str, *, where: str = "", also: Mapping[str, object] | None = None) -> Self:
        """From TOML text; `also` holds changes as typed, {"mass[2].inertia": "0.7 kg*m^2"}.

        `where` is put before each sentence of an `InputError`.

        >>> from softstart import Drive
        >>> drive = Drive.load("crane-4amtkf")
        >>> Drive.from_toml(drive.to_toml()) == drive
        True
        """
        wording = Wording(where, style="toml")
        document = parsed(text, wording, cls.WHAT, cls.TABLES)
        if (kind := kind_of_document(document)) in OTHER_FILES and f"a {kind}" != cls.WHAT:
            raise InputError(wording.sentence("", f"this is a {kind}, not {cls.WHAT}; {OTHER_FILES[kind]}"))
        return cls._from_document(document, where, also)

    @classmethod
    def _from_document(
        cls, document: dict[str, Any], where: str, also: Mapping[str, object] | None = None
    ) -> Self:
        """From the tables of a TOML document, after the changes of `also` ({path: value})."""
        wording = Wording(where, style="toml")
        wrong = [Mistake(one) for one in apply_changes(document, also or {}, cls.TABLES, cls.WHAT)]
        content, mistakes = placed(document, cls.TABLES, cls.WHAT, wording)
        given: dict[str, Any] = {
            p.name: content[p.table][p.key]
            for p in cls.PARAMETERS.values()
            if p.key in content.get(p.table, ())
        }
        mistakes += without_unit(given, cls.PARAMETERS, cls.USUAL, wording)
        for name, part in cls.PARTS.items():
            parts, more = part.read(content, wording, cls._gear_in(given))
            mistakes += more
            if not more and len(parts) >= max(part.least, not part.many):
                given[name] = parts if part.many else parts[0]
        return cls._made(given, wording, [*wrong, *mistakes])

    def blocks(self) -> Iterator[tuple[str, DocumentTable, ParameterSet]]:
        """Each table of the file with its path, as mass[2], and the set that has its values."""
        field_of = {table.name: name for name, part in self.PARTS.items() for table in part.tables}
        for table in self.TABLES:
            holder = getattr(self, field_of[table.name]) if table.name in field_of else self
            if isinstance(holder, ParameterFile) and holder is not self:  # of several tables, as a duty
                yield from (block for block in holder.blocks() if block[1].name == table.name)
            elif isinstance(holder, tuple):
                yield from ((f"{table.name}[{i}]", table, row) for i, row in enumerate(holder, 1))
            elif holder is not None:
                yield table.name, table, holder

    def parameters_by_path(self) -> dict[str, tuple[Parameter, Any]]:
        """All parameters by their paths, each with its value.

        >>> from softstart import Chain
        >>> Chain.load("crane-4-mass").parameters_by_path()["shaft[2].gap"][1]
        0.2
        """
        return {
            f"{path}.{p.key}".lstrip("."): (p, getattr(holder, p.name))
            for path, table, holder in self.blocks()
            for p in table.parameters
        }

    def to_toml(self) -> str:
        """The TOML text in SI units, which `from_toml` reads back to an equal object.

        What was given "at output" of a gear is written as it was given.

        >>> from softstart import Drive
        >>> print(Drive.load("crane-4amtkf").to_toml().splitlines()[4])
        inertia = 0.035  # kg*m^2: inertia of the motor
        """
        gear = self._gear_in(self.given())
        return self.text(gear if isinstance(gear, Gear) else None)

    def text(self, gear: Gear | None) -> str:
        """As `to_toml`, to be read with this gear."""
        return document_text(
            (table, holder.given() if gear is None else holder.written())
            for _, table, holder in self.blocks()
        )
