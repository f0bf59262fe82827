"""Functions of Python as source, and what is said of code that cannot be translated."""

from __future__ import annotations

import ast
import inspect
import textwrap
from collections.abc import Callable
from typing import Any

from softstart.errors import InputError
from softstart.export.values import Row, Tuple, Value

REMEDIES: dict[type[ast.AST], tuple[str, str]] = {
    ast.ListComp: ("a list", "write a loop over `range`"),
    ast.GeneratorExp: ("a generator", "write a loop over `range`"),
    ast.List: ("a list", "use a tuple, or an array in the record of the state"),
    ast.Dict: ("a dictionary", "use fields of a record"),
    ast.Lambda: ("a lambda", "write a function with `@compiled`"),
    ast.JoinedStr: ("a text", "use numbers"),
    ast.Try: ("try", "test the numbers before"),
    ast.Raise: ("raise", "answer a safe torque"),
    ast.With: ("with", "leave it out"),
    ast.Assert: ("assert", "test the numbers in Python, before the start"),
    ast.FunctionDef: ("a function in a function", "write it beside, with `@compiled`"),
    ast.Starred: ("a starred value", "write the values one by one"),
    ast.NamedExpr: ("`:=`", "assign on a line of its own"),
    ast.Global: ("global", "keep it in the record of the state"),
    ast.Nonlocal: ("nonlocal", "keep it in the record of the state"),
    ast.Delete: ("del", "leave it out"),
    ast.Slice: ("a slice", "read the elements in a loop"),
}


def python_function(thing: Any) -> Callable[..., Any] | None:
    """The function of Python within what numba makes of it."""
    for _ in range(4):
        if inspect.isfunction(thing):
            return thing
        code = getattr(getattr(thing, "code", None), "_pyfunc", None)
        thing = getattr(thing, "py_func", None) or getattr(thing, "function", None) or code
    return None


def parsed(function: Callable[..., Any]) -> ast.FunctionDef:
    """The syntax tree of a function; its lines count from that of the function."""
    try:
        lines = inspect.getsource(function)
    except OSError:
        sentence = f"{function.__name__}: its source is not to be found; write it in a file to export it."
        raise InputError(sentence) from None
    try:
        tree = ast.parse(textwrap.dedent(lines)).body[0]
    except SyntaxError:  # a part of a line
        tree = ast.Pass()
    if not isinstance(tree, ast.FunctionDef):
        sentence = f"{function.__code__.co_filename}:{function.__code__.co_firstlineno}: {function.__name__}"
        raise InputError(f"{sentence}: this cannot be exported; write a function with `def`.")
    return tree


def leaves(value: Value) -> list[Any]:
    """The parts of an argument that are handed on one by one."""
    match value:
        case Tuple(items):
            return [leaf for item in items for leaf in leaves(item)]
        case Row(head, tail):
            return [piece for piece in (head, tail) if piece is not None]
        case _:
            return [value]
