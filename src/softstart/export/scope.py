"""What is known of a function of Python while it is translated: names, kinds and what stays."""

from __future__ import annotations

import ast
import inspect
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, NoReturn, Protocol

from softstart.errors import InputError
from softstart.export.source import REMEDIES, parsed
from softstart.export.statements import (
    Array,
    Assign,
    Constant,
    Element,
    Expression,
    Field,
    Function,
    Kind,
    Statement,
    Variable,
)  # fmt: skip
from softstart.export.values import (
    TEMPORARY,
    Choice,
    Structs,
    Tuple,
    Value,
    converted,
    is_number,
    joined,
    kind_of,
)  # fmt: skip


class Translations(Protocol):
    """What translates the functions that an expression calls."""

    structs: Structs
    in_bounds: bool  # all indices are 0 or more, known beforehand; else those below count from the end
    tables: dict[str, tuple[Array, tuple[float, ...]]]  # constant arrays
    taken: dict[Function, list[bool]]  # of the arguments of a function, which ones are handed on

    def function(
        self, function: Callable[..., Any], arguments: Sequence[Value], fail: Any = None
    ) -> Function:
        """The statements of a function for arguments of these types."""

    def masked(self, function: Callable[..., Any]) -> set[str]:
        """The names of parameters whose bits are read."""


class ScopeReader:
    """What is known of one function while it is read.

    `env` has what names stand for that are no variables, `kinds` the kinds of the variables; statements that
    an expression needs before it are appended to `out`.
    """

    env: dict[str, Value]
    out: list[Statement]
    changed: set[str]
    temporaries: int
    places: dict[str, str]  # variables that replace such parameters

    def __init__(
        self, translator: Translations, function: Callable[..., Any], arguments: Sequence[Value]
    ) -> None:
        self.translator, self.function = translator, function
        self.tree = parsed(function)
        self.first, self.file = function.__code__.co_firstlineno, function.__code__.co_filename
        self.arguments = arguments
        self.kinds: dict[str, Kind] = {}
        self.widened: dict[str, Kind] = {}  # parameters that become another kind of number
        self.counting: set[str] = set()  # variables of loops that count from 0 or more upwards
        self.returns: tuple[Kind, ...] | None = None
        names = [node for node in ast.walk(self.tree) if isinstance(node, ast.Name)]
        self.assigned = {node.id for node in names if isinstance(node.ctx, ast.Store)}
        self.words = {node.id for node in names} | set(inspect.signature(function).parameters)

    def fail(self, node: ast.AST, reason: str, remedy: str) -> NoReturn:
        """Refuse what cannot be translated."""
        line = self.first + getattr(node, "lineno", 1) - 1
        text = ast.unparse(node).splitlines()[0]
        raise InputError(f"{self.file}:{line}: {text}: {reason} cannot be exported; {remedy}.")

    def variable(self, name: str) -> Variable:
        """A variable that holds a number."""
        return Variable(name, self.kinds[name])

    def temporary(self, kind: Kind) -> Variable:
        """A variable of its own."""
        self.temporaries += 1
        name = self.fresh(f"{TEMPORARY}{self.temporaries}")
        self.kinds[name] = joined(kind, self.kinds.get(name, kind))
        return Variable(name, self.kinds[name])

    def fresh(self, name: str) -> str:
        """A name that the source does not have."""
        while name in self.words:
            name += "_"
        return name

    def stays(self, value: Expression) -> bool:
        """Whether it is a number that nothing changes."""
        return isinstance(value, Constant) or (
            isinstance(value, Variable)
            and value.name not in self.assigned
            and value.name not in self.places.values()
        )

    def _note_change(self, node: ast.AST, place: Expression) -> None:
        while isinstance(place, Field | Element):
            place = place.base
        assert isinstance(place, Variable)
        if place.name in self.translator.tables:
            self.fail(node, "a change of what is constant", "keep it in the record of the state")
        self.changed.add(place.name)

    def saved(self, value: Value) -> Expression:
        """A number in a variable of its own."""
        assert isinstance(value, Expression)
        variable = self.temporary(kind_of(value))
        self.out.append(Assign(variable, converted(value, kind_of(variable))))
        return variable

    def frozen(self, value: Value) -> Value:
        """Another name for a part of a record: indices and numbers of a tuple stay what they are now."""
        match value:
            case Element(base, indices):
                kept = tuple(index if self.stays(index) else self.saved(index) for index in indices)
                return replace(value, base=self._frozen_base(base), indices=kept)
            case Field(base):
                return replace(value, base=self._frozen_base(base))
            case Choice(condition, left, right):
                return Choice(condition, self.frozen(left), self.frozen(right))
            case Tuple(items):
                return Tuple(
                    tuple(
                        self.saved(one)
                        if is_number(one) and not isinstance(one, Constant)
                        else self.frozen(one)
                        for one in items
                    )
                )
            case _:
                return value

    def _frozen_base(self, base: Expression) -> Expression:
        kept = self.frozen(base)
        assert isinstance(kept, Expression)
        return kept

    def _refuse(self, node: ast.AST) -> NoReturn:
        name = type(node).__name__.lower()
        reason, remedy = REMEDIES.get(type(node), (f"`{name}`", "write it with if, for, while and numbers"))
        self.fail(node, reason, remedy)
