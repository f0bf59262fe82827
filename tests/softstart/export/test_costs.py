"""Costs of a program: operations and bytes, counted by hand."""

from __future__ import annotations

from softstart.export.costs import FUNCTION, bytes_of, operations
from softstart.export.statements import (
    Apply,
    Assign,
    Binary,
    Constant,
    For,
    Function,
    If,
    Member,
    Struct,
    Variable,
    While,
)  # fmt: skip

X, K = Variable("x", "real"), Variable("i", "whole")
ADD = Assign(X, Binary("+", X, Constant(1.0, "real"), "real"))  # 2 operations: sum and store
ROOT = Assign(X, Apply("sqrt", (X,), "real"))
LESS = Binary("<", X, Constant(0.0, "real"), "truth")


def cost(*body) -> int | None:
    return operations(Function("f", body=tuple(body)))


def test_operations() -> None:
    assert cost(ADD) == 2
    assert cost(ROOT) == 1 + FUNCTION
    assert cost(If(LESS, (ADD, ADD), (ADD,))) == 2 + 4  # the longer branch
    assert cost(For(K, Constant(0, "whole"), Constant(6, "whole"), 2, (ADD,))) == 1 + 3 * (2 + 2)
    assert cost(While(LESS, (ADD,))) is None


def test_bytes_with_gaps_for_alignment() -> None:
    struct = Struct("s", (Member("a", "truth"), Member("b", "double"), Member("c", "real")))
    assert bytes_of(struct, single=False) == 24
    assert bytes_of(struct, single=True) == 24
    assert bytes_of(Struct("s", (Member("a", "real"), Member("b", "real"))), single=True) == 8
