"""Typed statements: what a compiled function of Python is translated into before it is written in a language.

A `Program` holds structures and functions, the entry last. Everything that a language could do in its own
way has been settled: kinds are explicit (`Convert`), calls of functions are statements, conditional
expressions are `If`s, what is evaluated first stands first, names are unique in each function.
Structures and arrays are handed on by reference, numbers by value. Expressions change nothing.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, fields
from typing import Literal

Kind = Literal["truth", "whole", "real", "double"]
"""truth; 64-bit integer; number in the precision of the export; number that is always of 64 bits."""
ORDER: tuple[Kind, ...] = ("truth", "whole", "real", "double")


@dataclass(frozen=True)
class Member:
    """A field of a structure; the comment says what it is, with its unit."""

    name: str
    type: Type
    comment: str = ""


@dataclass(frozen=True)
class Struct:
    """A structure. Two are the same if their names are."""

    name: str
    members: tuple[Member, ...] = field(compare=False)
    comment: str = field(default="", compare=False)

    def member(self, name: str) -> Member:
        """The member of this name."""
        return next(member for member in self.members if member.name == name)


@dataclass(frozen=True)
class Array:
    """An array of one or two dimensions, from index 0 on."""

    element: Kind | Struct
    shape: tuple[int, ...]


Type = Kind | Struct | Array


# expressions ------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Constant:
    """A number: bool for truth, int for whole, float else, infinity and NaN included."""

    value: bool | int | float
    type: Kind


@dataclass(frozen=True)
class Variable:
    """A parameter or local variable of the function."""

    name: str
    type: Type


@dataclass(frozen=True)
class Field:
    """A field of a structure."""

    base: Expression
    name: str
    type: Type


@dataclass(frozen=True)
class Element:
    """An element of an array, with as many whole indices as it has dimensions; with one less a row of it."""

    base: Expression
    indices: tuple[Expression, ...]
    type: Type


@dataclass(frozen=True)
class Binary:
    """An operation of two numbers of one kind.

    `+ - * / // %` has the kind of its operands; `< <= > >= == !=` is a truth; `and or` of truths evaluates
    the right one only if it decides.

    `//` and `%` round to minus infinity as Python does, and `/` of wholes does not occur.
    """

    operator: str
    left: Expression
    right: Expression
    type: Kind


@dataclass(frozen=True)
class Unary:
    """`-` of a number or `not` of a truth."""

    operator: str
    operand: Expression
    type: Kind


@dataclass(frozen=True)
class Convert:
    """The same number in another kind; to `whole` it is cut towards 0, a truth is 0 or 1."""

    operand: Expression
    type: Kind


@dataclass(frozen=True)
class Apply:
    """A mathematical function, with arguments of the kind of its result unless said otherwise.

    sqrt exp log expm1 log1p sin cos tan atan atan2 hypot pow abs copysign floor ceil nextafter sign,
    isnan isfinite (truth of a number), min max (two arguments; the first unless the second is
    smaller, or larger: which also says what is done with NaN), gauss (noise number b of the sequence a).
    """

    function: str
    arguments: tuple[Expression, ...]
    type: Kind


Expression = Constant | Variable | Field | Element | Binary | Unary | Convert | Apply
Place = Variable | Field | Element


# statements -------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Assign:
    """A number is stored; the value has the kind of the place."""

    place: Place
    value: Expression


@dataclass(frozen=True)
class Copy:
    """A structure or array is copied to another of the same type."""

    place: Place
    value: Expression


@dataclass(frozen=True)
class If:
    """Two branches, of which the second may be empty."""

    condition: Expression
    body: tuple[Statement, ...]
    otherwise: tuple[Statement, ...] = ()


@dataclass(frozen=True)
class For:
    """For `variable` from `start` to before `stop` by a `step` other than 0, as `range` does.

    `start` and `stop` are constants or variables that the loop does not change, the body does not assign to
    the variable, and nothing reads it behind the loop.
    """

    variable: Variable
    start: Expression
    stop: Expression
    step: int
    body: tuple[Statement, ...]


@dataclass(frozen=True)
class While:
    """While the condition holds; a constant one is left by `Leave`."""

    condition: Expression
    body: tuple[Statement, ...]


@dataclass(frozen=True)
class Leave:
    """`break` or `continue` of the innermost loop."""

    word: Literal["break", "continue"]


@dataclass(frozen=True)
class Return:
    """The end of the function, with its values."""

    values: tuple[Expression, ...] = ()


@dataclass(frozen=True)
class Call:
    """A function is called; local variables take its values, None where a value is not needed."""

    function: Function
    arguments: tuple[Expression, ...]
    places: tuple[Variable | None, ...] = ()


Statement = Assign | Copy | If | For | While | Leave | Return | Call


@dataclass(eq=False)
class Function:
    """A function. `locals` are all its variables but the parameters, numbers all of them.

    `changed` are the parameters (structures and arrays) that it or a function that it calls may write to.
    """

    name: str
    parameters: tuple[Variable, ...] = ()
    returns: tuple[Kind, ...] = ()
    locals: dict[str, Kind] = field(default_factory=dict)
    body: tuple[Statement, ...] = ()
    changed: frozenset[str] = frozenset()
    comment: str = ""


@dataclass
class Program:
    """Structures and functions, each behind those that it needs; the last function is the entry."""

    structs: list[Struct] = field(default_factory=list)
    functions: list[Function] = field(default_factory=list)
    tables: dict[str, tuple[Array, tuple[float, ...]]] = field(default_factory=dict)  # constant arrays

    @property
    def entry(self) -> Function:
        """What is called from outside."""
        return self.functions[-1]


def parts(expression: Expression) -> Iterator[Expression]:
    """The expression itself and all expressions in it."""
    yield expression
    for one in fields(expression):
        value = getattr(expression, one.name)
        for part in value if isinstance(value, tuple) else (value,):
            if isinstance(part, Expression):
                yield from parts(part)


def expressions(statement: Statement) -> tuple[Expression, ...]:
    """The expressions of a statement itself, without those in its branches or body; places included."""
    match statement:
        case Assign(place, value) | Copy(place, value):
            return place, value
        case If(condition) | While(condition):
            return (condition,)
        case For(variable, start, stop):
            return variable, start, stop
        case Return(values):
            return values
        case Call(_, arguments, places):
            return *arguments, *(place for place in places if place is not None)
        case _:
            return ()


def changing(statements: Iterable[Statement]) -> bool:
    """Whether a function is called that changes what it is handed."""
    return any(isinstance(one, Call) and bool(one.function.changed) for one in walk(tuple(statements)))


def ends(body: tuple[Statement, ...]) -> bool:
    """Whether the function always ends in these statements."""
    return any(
        isinstance(one, Return)
        or (isinstance(one, If) and ends(one.body) and ends(one.otherwise))
        or (isinstance(one, While) and isinstance(one.condition, Constant) and not _left(one.body))
        for one in body
    )


def _left(body: tuple[Statement, ...]) -> bool:
    return any(
        one == Leave("break") or (isinstance(one, If) and (_left(one.body) or _left(one.otherwise)))
        for one in body
    )


def walk(statements: tuple[Statement, ...]) -> Iterator[Statement]:
    """All statements, those in branches and bodies too."""
    for statement in statements:
        yield statement
        match statement:
            case If(_, body, otherwise):
                yield from walk(body)
                yield from walk(otherwise)
            case For(body=body) | While(body=body):
                yield from walk(body)
            case _:
                pass
