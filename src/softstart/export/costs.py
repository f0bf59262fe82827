"""What a program costs: operations of a step at most, and bytes of its structures."""

from __future__ import annotations

from softstart.export.statements import (
    Apply,
    Array,
    Binary,
    Call,
    Constant,
    Expression,
    For,
    Function,
    If,
    Statement,
    Struct,
    Type,
    Unary,
    While,
    expressions,
    parts,
)  # fmt: skip

FUNCTION = 20  # operations that a mathematical function counts as


def operations(function: Function, counted: dict[str, int | None] | None = None) -> int | None:
    """Operations of a call, at most: arithmetic and comparisons 1 each, functions of `math.h` 20.

    None for a loop without constant bounds.
    """
    known: dict[str, int | None] = {} if counted is None else counted
    if function.name not in known:
        known[function.name] = _of_block(function.body, known)
    return known[function.name]


def _of_block(statements: tuple[Statement, ...], known: dict[str, int | None]) -> int | None:
    total = 0
    for statement in statements:
        own = 1 + sum(map(_of_expression, expressions(statement)))
        inner: int | None = 0
        match statement:
            case If(_, body, otherwise):
                branches = [_of_block(one, known) for one in (body, otherwise)]
                inner = None if None in branches else max(one for one in branches if one is not None)
            case For(_, Constant(start), Constant(stop), by, body):
                once, times = _of_block(body, known), len(range(int(start), int(stop), by))
                inner = None if once is None else times * (once + 2)
            case For() | While():
                inner = None
            case Call(function):
                inner = operations(function, known)
        if inner is None:
            return None
        total += own + inner
    return total


def _of_expression(expression: Expression) -> int:
    weights = (
        FUNCTION if isinstance(one, Apply) and one.function not in ("min", "max", "abs", "isnan") else 1
        for one in parts(expression)
        if isinstance(one, Apply | Binary | Unary)
    )
    return sum(weights)


def bytes_of(kind: Type, single: bool) -> int:
    """Bytes of a type, as usual compilers of 64 bits lay it out.

    >>> bytes_of("real", True), bytes_of(Array("double", (3, 2)), False)
    (4, 48)
    """
    return _layout(kind, single)[0]


def _layout(kind: Type, single: bool) -> tuple[int, int]:
    """Size and alignment."""
    if isinstance(kind, Array):
        size, even = _layout(kind.element, single)
        for one in kind.shape:
            size *= max(one, 1)
        return size, even
    if isinstance(kind, Struct):
        total, most = 0, 1
        for member in kind.members:
            size, even = _layout(member.type, single)
            total, most = (total + even - 1) // even * even + size, max(most, even)
        return (total + most - 1) // most * most, most
    size = 4 if kind == "truth" or (kind == "real" and single) else 8
    return size, size
