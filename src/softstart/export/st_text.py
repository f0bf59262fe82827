"""A text of Structured Text while it is written: its types, functions and names."""

from __future__ import annotations

from dataclasses import dataclass, field

from softstart.export.st_helpers import HELPERS
from softstart.export.st_names import INFINITY, Names, literal, prefixed
from softstart.export.st_units import Declared, TypeBlock, Unit, function_of
from softstart.export.statements import Array, Kind, Struct, Type


@dataclass(frozen=True)
class Signature:
    """How a function is called: its name, and the names of its parameters and values, as they are written."""

    name: str
    inputs: list[str]
    outputs: list[str]


@dataclass
class Text:
    """The parts of a text: each is written once, and behind what it needs.

    Parameters
    ----------
    prefix : the beginning of all names that are seen outside a function.
    single : whether the numbers of the export are REAL; else LREAL.
    """

    prefix: str
    single: bool = False
    names: Names = field(default_factory=Names)
    types: list[TypeBlock] = field(default_factory=list)
    units: list[Unit] = field(default_factory=list)
    handed_on: set[Array] = field(default_factory=set)
    _arrays: dict[Array, str] = field(default_factory=dict)
    _structs: dict[str, str] = field(default_factory=dict)
    _fields: dict[str, Names] = field(default_factory=dict)
    _helpers: dict[str, str] = field(default_factory=dict)
    tables: dict[str, tuple[Array, tuple[float, ...]]] = field(default_factory=dict)
    signatures: dict[str, Signature] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.block_name = self.names.of(self.prefix)

    def type_name(self, kind: Type) -> str:
        """A type as it is written."""
        if isinstance(kind, Struct):
            if kind.name not in self._structs:
                self._structs[kind.name] = self.names.new(prefixed(self.prefix, kind.name))
            return self._structs[kind.name]
        if isinstance(kind, Array):
            if kind in self.handed_on:
                return self._array_name(kind)
            ranges = ", ".join(f"0..{size - 1}" for size in kind.shape)
            return f"ARRAY[{ranges}] OF {self.type_name(kind.element)}"
        return {"truth": "BOOL", "whole": "LINT", "double": "LREAL"}.get(kind) or (
            "REAL" if self.single else "LREAL"
        )

    def _array_name(self, kind: Array) -> str:
        """The type of an array that functions are handed: two are the same if they have the same name."""
        if kind not in self._arrays:
            element = self.type_name(kind.element).removeprefix(f"{self.prefix}_")
            plain = "_".join(["array", *map(str, kind.shape), element])
            name = self._arrays[kind] = self.names.new(prefixed(self.prefix, plain))
            ranges = ", ".join(f"0..{size - 1}" for size in kind.shape)
            array = f"ARRAY[{ranges}] OF {self.type_name(kind.element)}"
            self.types.append(TypeBlock(name, (), array=array))
        return self._arrays[kind]

    def field_name(self, struct: Struct, name: str) -> str:
        """A field as it is written."""
        if struct.name not in self._fields:
            fields = self._fields[struct.name] = Names()
            for member in struct.members:
                fields.of(member.name)
        return self._fields[struct.name].of(name)

    def add_struct(self, struct: Struct) -> None:
        """Its TYPE block."""
        fields = (
            Declared(self.field_name(struct, one.name), self.type_name(one.type), comment=one.comment)
            for one in struct.members
        )
        self.types.append(TypeBlock(self.type_name(struct), tuple(fields), struct.comment))

    def helper(self, name: str, kind: Kind = "double") -> str:
        """The name of a helper, which is written when it is first asked for."""
        text, needs, of_kind = HELPERS[name]
        real = self.type_name(kind)
        key = f"{name}_{real.lower()}" if of_kind and real != self.type_name("real") else name
        if key not in self._helpers:
            called = {need: self.helper(other) for need, other in needs.items()}
            found = self._helpers[key] = self.names.new(prefixed(self.prefix, key))
            to, back = ("REAL_TO_LREAL", "LINT_TO_REAL") if real == "REAL" else ("", "LINT_TO_LREAL")
            infinity = literal(INFINITY, kind, self.single)
            body = text.format(name=found, real=real, to=to, back=back, infinity=infinity, **called)
            self.units.append(function_of(body))
        return self._helpers[key]

    def __str__(self) -> str:
        return "\n".join(map(str, (*self.types, *self.units)))
