"""Typed statements executed in Python: what they mean, independently of the languages they are written in."""

from __future__ import annotations

import copy
import math
from typing import Any

import numpy as np

from softstart.export.statements import (
    Apply,
    Array,
    Assign,
    Binary,
    Call,
    Constant,
    Convert,
    Copy,
    Element,
    Expression,
    Field,
    For,
    Function,
    If,
    Leave,
    Return,
    Statement,
    Struct,
    Type,
    Unary,
    Variable,
    While,
)  # fmt: skip


class Left(Exception):  # noqa: N818  no error
    """A loop or function is left."""

    def __init__(self, word: str, values: tuple[Any, ...] = ()) -> None:
        super().__init__(word)
        self.word, self.values = word, values


def zero(kind: Type) -> Any:
    """The first value of a type: of a structure a dict, of an array nested lists."""
    if isinstance(kind, Struct):
        return {member.name: zero(member.type) for member in kind.members}
    if isinstance(kind, Array):
        size, *rest = kind.shape
        return [zero(Array(kind.element, tuple(rest)) if rest else kind.element) for _ in range(size)]
    return {"truth": False, "whole": 0}.get(kind, 0.0)


def run(function: Function, *arguments: Any, tables: dict[str, Any] | None = None) -> tuple[Any, ...]:
    """Call a function; structures and arrays are changed in place."""
    names = dict(tables or {})
    names |= {one.name: value for one, value in zip(function.parameters, arguments, strict=True)}
    names |= {name: zero(kind) for name, kind in function.locals.items()}
    try:
        block(function.body, names)
    except Left as end:
        return end.values
    return ()


def block(statements: tuple[Statement, ...], names: dict[str, Any]) -> None:
    for statement in statements:
        execute(statement, names)


def loop(body: tuple[Statement, ...], names: dict[str, Any]) -> bool:
    """One pass; whether the loop goes on."""
    try:
        block(body, names)
    except Left as end:
        if end.word == "return":
            raise
        return end.word == "continue"
    return True


def execute(statement: Statement, names: dict[str, Any]) -> None:
    match statement:
        case Assign(place, given) | Copy(place, given):
            assert place.type == given.type, statement
            store(place, copy.deepcopy(value(given, names)), names)
        case If(condition, body, otherwise):
            block(body if value(condition, names) else otherwise, names)
        case For(variable, start, stop, step, body):
            for at in range(value(start, names), value(stop, names), step):
                names[variable.name] = at
                if not loop(body, names):
                    break
        case While(condition, body):
            while value(condition, names) and loop(body, names):
                pass
        case Leave(word):
            raise Left(word)
        case Return(values):
            raise Left("return", tuple(value(one, names) for one in values))
        case Call(function, arguments, places):
            tables = {name: names[name] for name in names if name.isupper()}
            answers = run(function, *(value(one, names) for one in arguments), tables=tables)
            for place, answer in zip(places, answers, strict=True):
                if place is not None:
                    names[place.name] = answer


def store(place: Expression, given: Any, names: dict[str, Any]) -> None:
    match place:
        case Variable(name):
            names[name] = given
        case Field(base, name):
            value(base, names)[name] = given
        case Element(base, (*rows, last)):
            within = value(base, names)
            for row in rows:
                within = within[value(row, names)]
            at = value(last, names)
            assert 0 <= at < len(within)
            within[at] = given
        case _:
            raise AssertionError(place)


def value(one: Expression, names: dict[str, Any]) -> Any:
    """The value of an expression."""
    result = _value(one, names)
    kinds = {"truth": bool, "whole": int, "real": float, "double": float}
    if isinstance(one.type, str):
        assert type(result) is kinds[one.type], (one, result)
    return result


def _value(one: Expression, names: dict[str, Any]) -> Any:
    match one:
        case Constant(number):
            return number
        case Variable(name):
            return names[name]
        case Field(base, name):
            return value(base, names)[name]
        case Element(base, indices):
            within = value(base, names)
            for index in indices:
                at = value(index, names)
                assert 0 <= at < len(within), one
                within = within[at]
            return within
        case Unary(operator, operand):
            inner = value(operand, names)
            return not inner if operator == "not" else -inner
        case Convert(operand, kind):
            inner = value(operand, names)
            return int(inner) if kind == "whole" else float(inner)
        case Binary(operator, left, right):
            return binary(operator, left, right, names)
        case Apply(function, arguments):
            return apply(function, [value(argument, names) for argument in arguments])


def binary(operator: str, left: Expression, right: Expression, names: dict[str, Any]) -> Any:
    first = value(left, names)
    if operator in ("and", "or"):
        return first if first == (operator == "or") else value(right, names)
    assert left.type == right.type, (left, right)
    second = value(right, names)
    with np.errstate(all="ignore"):
        a, b = (np.float64(x) if isinstance(x, float) else x for x in (first, second))
        match operator:
            case "+" | "-" | "*" | "/":
                table = {"+": a + b, "-": a - b, "*": a * b} | ({"/": a / b} if operator == "/" else {})
                result = table[operator]
            case "//":
                return first // second
            case "%":
                return first % second
            case _:
                compare = {"<": a < b, "<=": a <= b, ">": a > b, ">=": a >= b, "==": a == b, "!=": a != b}
                return bool(compare[operator])
    return float(result) if isinstance(first, float) else int(result)


def apply(function: str, given: list[Any]) -> Any:
    match function:
        case "min":
            return given[1] if given[1] < given[0] else given[0]
        case "max":
            return given[1] if given[1] > given[0] else given[0]
        case "floor" | "ceil":
            return float(getattr(math, function)(given[0]))
        case "sign":
            return float(np.sign(given[0]))
        case "abs":
            return abs(given[0])
        case _:
            return getattr(math, function)(*given)
