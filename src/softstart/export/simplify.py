"""Statements without what nothing reads, and without detours."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from softstart.export.statements import (
    Assign,
    Call,
    For,
    If,
    Place,
    Statement,
    Variable,
    While,
    expressions,
    parts,
    walk,
)  # fmt: skip
from softstart.export.values import TEMPORARY, negated


def simplified(statements: Iterable[Statement]) -> tuple[Statement, ...]:
    """The statements without values that nothing reads, and without what they leave empty.

    A value of a branch or call that is only stored in one place goes there at once.
    """
    before: tuple[Statement, ...] = ()
    kept = tuple(statements)
    while kept != before:
        before, kept = kept, _direct(_reading(kept, set(_reads(kept))), _reads(kept))
    return kept


def _reads(statements: Iterable[Statement]) -> dict[str, int]:
    """How often each variable is read."""
    counts: dict[str, int] = {}
    for statement in walk(tuple(statements)):
        read = expressions(statement)
        if isinstance(statement, Assign | For) and isinstance(read[0], Variable):
            read = read[1:]
        if isinstance(statement, Call):
            read = statement.arguments
        for part in (part for one in read for part in parts(one) if isinstance(part, Variable)):
            counts[part.name] = counts.get(part.name, 0) + 1
    return counts


def _reading(statements: tuple[Statement, ...], read: set[str]) -> tuple[Statement, ...]:
    found: list[Statement] = []
    for statement in statements:
        match statement:
            case Assign(Variable(name), _) if name not in read:
                continue
            case If(condition, body, otherwise):
                first, second = _reading(body, read), _reading(otherwise, read)
                if first:
                    found.append(If(condition, first, second))
                elif second:
                    found.append(If(negated(condition), second))
            case For(body=body) | While(body=body):
                found.append(replace(statement, body=_reading(body, read)))
            case Call(function, arguments, places):
                needed = tuple(place if place and place.name in read else None for place in places)
                if function.changed or any(needed):
                    found.append(Call(function, arguments, needed))
            case _:
                found.append(statement)
    return tuple(found)


def _direct(statements: tuple[Statement, ...], reads: dict[str, int]) -> tuple[Statement, ...]:
    found: list[Statement] = []
    for statement in statements:
        match statement:
            case If(condition, body, otherwise):
                found.append(If(condition, _direct(body, reads), _direct(otherwise, reads)))
            case For(body=body) | While(body=body):
                found.append(replace(statement, body=_direct(body, reads)))
            case Assign(place, Variable(name)) if name.startswith(TEMPORARY) and reads[name] == 1 and found:
                stored = _storing(found[-1], name, place)
                found[-1:] = [found[-1], statement] if stored is None else [stored]
            case _:
                found.append(statement)
    return tuple(found)


def _storing(statement: Statement, name: str, place: Place) -> Statement | None:
    """A statement that ends by assigning to a variable, with another place; None if it is another one."""
    match statement:
        case Assign(Variable(stored), value) if stored == name:
            return replace(statement, place=place) if value.type == place.type else None
        case If(_, body, otherwise) if body and otherwise:
            left, right = (_storing(branch[-1], name, place) for branch in (body, otherwise))
            if left is None or right is None:
                return None
            return replace(statement, body=(*body[:-1], left), otherwise=(*otherwise[:-1], right))
        case Call(_, _, (Variable(stored, kind),)) if stored == name and isinstance(place, Variable):
            return replace(statement, places=(place,)) if kind == place.type else None
        case _:
            return None
