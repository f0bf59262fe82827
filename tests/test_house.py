"""The size of the house: statements, the longest function and file, and no circle of imports.

A statement is a line with code on it: no blank line, no docstring, no line that only holds a comment.
Comments are free. A sum rises by what a new capability needs, with the reason in the commit; otherwise it
goes down.
"""

from __future__ import annotations

import ast
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
MOST = {"src, controllers": 45600, "tests": 32500}
LONGEST_FILE = 560  # statements
LONGEST_FUNCTION = 70  # statements
Function = ast.FunctionDef | ast.AsyncFunctionDef


def files(*folders: str) -> list[Path]:
    """All modules in these folders."""
    return [path for folder in folders for path in sorted((ROOT / folder).rglob("*.py"))]


@cache
def tree(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


@cache
def statements(path: Path) -> frozenset[int]:
    """Numbers of the lines with code on them."""
    without: set[int] = set()
    for node in ast.walk(tree(path)):
        if isinstance(node, ast.Module | ast.ClassDef | Function) and ast.get_docstring(node) is not None:
            without |= set(range(node.body[0].lineno, (node.body[0].end_lineno or 0) + 1))
    lines = enumerate(path.read_text(encoding="utf-8").splitlines(), 1)
    return frozenset(
        number
        for number, line in lines
        if number not in without and line.strip() and not line.lstrip().startswith("#")
    )


@pytest.mark.parametrize("folders", MOST)
def test_the_sum_of_statements(folders: str) -> None:
    now = sum(len(statements(path)) for path in files(*folders.split(", ")))
    assert now <= MOST[folders], f"{now} statements in {folders} where {MOST[folders]} are allowed"


def test_the_longest_file() -> None:
    path = max(files("src", "controllers", "studies", "tests"), key=lambda path: len(statements(path)))
    now = len(statements(path))
    assert now <= LONGEST_FILE, (
        f"{now} statements in {path.relative_to(ROOT)} where {LONGEST_FILE} are allowed: divide it"
    )


def test_the_longest_function() -> None:
    now, where = max(
        (
            len(statements(path) & set(range(node.lineno, (node.end_lineno or 0) + 1))),
            f"{path.name}: {node.name}",
        )
        for path in files("src", "controllers", "studies")
        for node in ast.walk(tree(path))
        if isinstance(node, Function)
    )
    assert now <= LONGEST_FUNCTION, (
        f"{now} statements in {where} where {LONGEST_FUNCTION} are allowed: divide it"
    )


def test_comments_and_docstrings_are_no_statements(tmp_path: Path) -> None:
    path = tmp_path / "one.py"
    lines = ['"""Of a module."""', "", "# alone", 'x = """of', "", 'nobody"""  # beside', "", "def f():"]
    lines += ['    """f."""', "    return (", "        1", "    )"]
    path.write_text("\n".join(lines))
    assert statements(path) == {4, 6, 8, 10, 11, 12}


def graph() -> dict[str, set[str]]:
    """What each module imports when it is imported, and for type checkers; a function may reach up."""
    found = {}
    for source in ("src", "controllers", "studies"):
        for path in files(source):
            parts = path.relative_to(ROOT / source).with_suffix("").parts
            found[".".join(parts).removesuffix(".__init__")] = path
    targets: dict[str, set[str]] = {name: set() for name in found}
    for name, path in found.items():
        rest: list[ast.AST] = [tree(path)]
        while rest:
            node = rest.pop()
            if not isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                rest.extend(ast.iter_child_nodes(node))
            if isinstance(node, ast.Import):
                targets[name] |= {one.name for one in node.names} & set(found)
            elif isinstance(node, ast.ImportFrom):
                base = node.module or ""
                inner = {f"{base}.{one.name}" for one in node.names}
                targets[name] |= {one if one in found else base for one in inner} & set(found) - {name}
    return targets


def test_no_module_reaches_itself() -> None:
    """No circle of imports, even through types."""
    left = graph()
    while free := [name for name, targets in left.items() if not targets & left.keys()]:
        for name in free:
            del left[name]
    # what is left are circles and what imports them; drop what nothing left imports
    while free := [n for n in left if not any(n in targets for m, targets in left.items() if m != n)]:
        for name in free:
            del left[name]
    assert not left, f"these import one another: {', '.join(sorted(left))}"
