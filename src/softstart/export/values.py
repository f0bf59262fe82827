"""What an expression of Python stands for while it is translated, and how kinds of numbers meet."""

from __future__ import annotations

import ast
import inspect
import io
import math
import tokenize
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from softstart.export.statements import (
    ORDER,
    Apply,
    Array,
    Binary,
    Constant,
    Convert,
    Element,
    Expression,
    Field,
    Kind,
    Member,
    Struct,
    Type,
    Unary,
    Variable,
)  # fmt: skip


@dataclass(frozen=True)
class Tuple:
    """Several values."""

    items: tuple[Value, ...]


@dataclass(frozen=True)
class Known:
    """What is known beforehand and is no number: a function, a module, the type of a record."""

    thing: Any


@dataclass(frozen=True)
class Row:
    """A row of numbers of Python: a record, and behind it an array, of which one may be missing."""

    head: Expression | None
    tail: Expression | None


@dataclass(frozen=True)
class NoRows:
    """A matrix without rows: what would be recorded in it is left out."""


@dataclass(frozen=True)
class Choice:
    """One of two records, by a truth that stays."""

    condition: Expression
    left: Value
    right: Value


TEMPORARY = "value_"  # begin of the names of variables that the source does not have
Value = Choice | Expression | Tuple | Known | Row | NoRows


def joined(*kinds: Kind) -> Kind:
    """The widest of several kinds.

    >>> joined("whole", "real", "truth")
    'real'
    """
    return max(kinds, key=ORDER.index)


def is_number(value: Value) -> bool:
    """Whether a value is a number or truth."""
    return isinstance(value, Expression) and isinstance(value.type, str)


def kind_of(value: Expression) -> Kind:
    """The kind of a number."""
    assert isinstance(value.type, str)
    return value.type


def converted(value: Expression, kind: Kind) -> Expression:
    """The number in this kind.

    >>> converted(Constant(2, "whole"), "real")
    Constant(value=2.0, type='real')
    """
    if value.type == kind:
        return value
    if isinstance(value, Constant) and math.isfinite(value.value):
        convert: Any = {"truth": bool, "whole": int, "real": float, "double": float}[kind]
        return Constant(convert(value.value), kind)
    if isinstance(value, Constant) and kind in ("real", "double"):
        return Constant(float(value.value), kind)
    if kind == "truth":
        return Binary("!=", value, Constant(0 if value.type == "whole" else 0.0, kind_of(value)), "truth")
    return Convert(value, kind)


def is_simple(value: Expression) -> bool:
    """Whether a value may be written twice."""
    match value:
        case Constant() | Variable():
            return True
        case Field(base):
            return is_simple(base)
        case Element(base, indices):
            return is_simple(base) and all(isinstance(index, Constant | Variable) for index in indices)
        case _:
            return False


def number(value: Any) -> Constant | None:
    """A number of Python as a constant."""
    if isinstance(value, bool | np.bool_):
        return Constant(bool(value), "truth")
    if isinstance(value, int | np.integer):
        return Constant(int(value), "whole")
    if isinstance(value, float | np.floating):
        return Constant(float(value), "real")
    return None


OPERATORS: dict[type[ast.AST], str] = {
    ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/", ast.FloorDiv: "//", ast.Mod: "%",
    ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=", ast.Eq: "==", ast.NotEq: "!=",
}  # fmt: skip
_FOLDED: dict[str, Any] = {
    "+": lambda a, b: a + b, "-": lambda a, b: a - b, "*": lambda a, b: a * b, "/": lambda a, b: a / b,
    "//": lambda a, b: a // b, "%": lambda a, b: a % b, "<": lambda a, b: a < b, "<=": lambda a, b: a <= b,
    ">": lambda a, b: a > b, ">=": lambda a, b: a >= b, "==": lambda a, b: a == b, "!=": lambda a, b: a != b,
}  # fmt: skip


def operation(operator: str, left: Expression, right: Expression) -> Expression:
    """An arithmetic operation or comparison of two numbers, in the wider kind of both.

    >>> operation("*", Constant(2, "whole"), Variable("x", "double")).left
    Constant(value=2.0, type='double')
    """
    kind = joined(kind_of(left), kind_of(right))
    if operator == "/":
        kind = joined(kind, "real")
    compares = operator in ("<", "<=", ">", ">=", "==", "!=")
    if kind == "truth" and not (compares and operator in ("==", "!=")):
        kind = "whole"
    left, right = converted(left, kind), converted(right, kind)
    result: Kind = "truth" if compares else kind
    if (
        isinstance(left, Constant)
        and isinstance(right, Constant)
        and (operator not in ("/", "//", "%") or right.value != 0)
    ):
        folded = number(_FOLDED[operator](left.value, right.value))
        assert folded is not None
        return Constant(folded.value, result)
    return Binary(operator, left, right, result)


def negated(value: Expression) -> Expression:
    """The truth turned round."""
    if isinstance(value, Constant):
        return Constant(not value.value, "truth")
    if isinstance(value, Unary) and value.operator == "not":
        return value.operand
    return Unary("not", value, "truth")


def both(operator: str, left: Expression, right: Expression) -> Expression:
    """`and` or `or` of two truths."""
    for one, other in ((left, right), (right, left)):
        if isinstance(one, Constant):
            decides = bool(one.value) == (operator == "or")
            return one if decides else other
    return Binary(operator, left, right, "truth")


def truth(value: Expression) -> Expression:
    """Whether a number is not 0."""
    return converted(value, "truth")


def power(base: Expression, exponent: int) -> Expression:
    """A small whole power as products, in the order in which numba takes them."""
    result: Expression | None = None
    while True:
        if exponent & 1:
            result = base if result is None else operation("*", result, base)
        exponent >>= 1
        if not exponent:
            assert result is not None
            return result
        base = operation("*", base, base)


def applied(function: str, arguments: Sequence[Expression], result: Kind | None = None) -> Expression:
    """A mathematical function of numbers, which have one kind."""
    kind = joined("real", *(kind_of(argument) for argument in arguments))
    return Apply(function, tuple(converted(argument, kind) for argument in arguments), result or kind)


def extreme(function: str, arguments: Sequence[Expression]) -> Expression:
    """`min` or `max` of two or more numbers."""
    kind = joined(*(kind_of(argument) for argument in arguments))
    result, *others = (converted(argument, kind) for argument in arguments)
    for other in others:
        result = Apply(function, (result, other), kind)
    return result


# records ---------------------------------------------------------------------------------------------


def comments_of(cls: type) -> dict[str, str]:
    """The comments beside the fields of a class; one line may have its comment above it."""
    try:
        lines = inspect.getsource(cls)
    except (OSError, TypeError):
        return {}
    found: dict[str, str] = {}
    name = ""
    for token in tokenize.generate_tokens(io.StringIO(lines).readline):
        if token.type == tokenize.NAME and token.line.strip().startswith(f"{token.string}:"):
            name = token.string
        elif token.type == tokenize.COMMENT and name and not token.line.lstrip().startswith("#"):
            found[name] = token.string.lstrip("# ")
    return found


class Structs:
    """The structures of the records of NumPy, with the sizes of arrays that an export shrinks."""

    def __init__(self, sizes: dict[int, int] | None = None) -> None:
        self.sizes = sizes or {}
        self._made: dict[Any, Struct] = {}

    def of(self, dtype: Any) -> Struct:
        """The structure of a record."""
        key = (dtype.type, tuple((name, str(dtype[name])) for name in dtype.names))
        if key not in self._made:
            kinds: dict[str, Kind] = getattr(dtype.type, "kinds", {})
            comments: dict[str, str] = {}
            for cls in getattr(dtype.type, "classes", ()):
                comments |= comments_of(cls)
            members = tuple(
                Member(name, self._type(dtype[name], kinds.get(name)), comments.get(name, ""))
                for name in dtype.names
            )
            self._made[key] = Struct(self._name(dtype), members)
        return self._made[key]

    def _name(self, dtype: Any) -> str:
        base = str(dtype.type.__name__)
        for prefix in ("softstart_controllers_", "softstart_kernel_records_", "softstart_kernel_"):
            base = base.removeprefix(prefix)
        words = [word[:1].upper() + word[1:] for word in base.split("_") if word]
        words = [
            word
            for at, word in enumerate(words)
            if not (at + 1 < len(words) and words[at + 1].startswith(word))
        ]
        if dtype.names[:3] == ("torque", "ask_again", "slope") and len(dtype.names) > 3:
            words[-1:] = ["Command"]
        name, taken, count = "".join(words), {struct.name.lower() for struct in self._made.values()}, 2
        made = name
        while made.lower() in taken:
            made, count = f"{name}{count}", count + 1
        return made

    def _type(self, dtype: Any, kind: Kind | None) -> Type:
        if dtype.subdtype:
            base, shape = dtype.subdtype
            element = self._type(base, kind)
            assert not isinstance(element, Array)
            return Array(element, tuple(self.sizes.get(size, size) for size in shape))
        if dtype.names:
            return self.of(dtype)
        return "whole" if dtype == np.int64 else kind or "real"
