"""The size of the house: three sums, which only ever go down, and no circle of imports."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
MOST = {"src, controllers": 46579, "tests": 22690}  # lines; lower a number when it has fallen, never raise it
LONGEST = 794  # lines of the longest file


def files(*folders: str) -> dict[Path, int]:
    """Lines of all modules in these folders."""
    paths = [path for folder in folders for path in (ROOT / folder).rglob("*.py")]
    return {path: len(path.read_text(encoding="utf-8").splitlines()) for path in paths}


@pytest.mark.parametrize("folders", MOST)
def test_the_sum_of_lines_only_goes_down(folders: str) -> None:
    now = sum(files(*folders.split(", ")).values())
    assert now <= MOST[folders], f"{now} lines in {folders} where {MOST[folders]} are allowed: take some away"


def test_the_longest_file_only_gets_shorter() -> None:
    path, lines = max(files("src", "controllers", "studies", "tests").items(), key=lambda one: one[1])
    assert lines <= LONGEST, f"{lines} lines in {path.relative_to(ROOT)} where {LONGEST} are allowed: part it"


def graph() -> dict[str, set[str]]:
    """What each module imports when it is imported, and for type checkers; a function may reach up."""
    found = {}
    for source in ("src", "controllers", "studies"):
        for path in files(source):
            parts = path.relative_to(ROOT / source).with_suffix("").parts
            found[".".join(parts).removesuffix(".__init__")] = path
    targets: dict[str, set[str]] = {name: set() for name in found}
    for name, path in found.items():
        rest: list[ast.AST] = [ast.parse(path.read_text(encoding="utf-8"))]
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
