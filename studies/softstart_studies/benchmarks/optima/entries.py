"""Who takes part: one table of names, how each is used, and how long its code is."""

from __future__ import annotations

import ast
import io
import tokenize
from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from softstart_studies.benchmarks.contest import version_of
from softstart_studies.benchmarks.optima.task import Answer, Task

HOME = "softstart_studies.benchmarks.optima"
OURS = "softstart"
SILENT = {
    tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT, tokenize.ENDMARKER,
}  # fmt: skip


@dataclass(frozen=True)
class Entry:
    """A contender: its package, the module whose `solve` it is, the options of that, and how it is used.

    `imports` are the modules whose import is timed apart. `trap` marks a formulation that is shown as a
    warning and takes no part in the claims about the peers.
    """

    package: str
    module: str
    imports: tuple[str, ...]
    how: str
    options: Mapping[str, Any] = field(default_factory=dict)
    trap: bool = False


_OURS = ("softstart.optimal.optimize",)
ENTRIES = {
    "closed-form": Entry(
        OURS, "softstart_optimize", _OURS, "pulse, coast, hold", {"method": "closed-form"}
    ),
    "descent": Entry(
        OURS, "softstart_optimize", _OURS, "successive linear programs on the exact start, HiGHS",
        {"method": "descent"},
    ),
    "collocation": Entry(
        OURS, "softstart_optimize", _OURS, "CasADi, phases of free duration, IPOPT", {"method": "collocation"}
    ),
    "rockit": Entry(
        "rockit-meco", "rockit_phases", ("rockit",),
        "two stages of free duration, multiple shooting (25 + 75 intervals, RK4), IPOPT",
    ),
    "dymos": Entry(
        "dymos", "dymos_phases", ("openmdao.api", "dymos"),
        "two linked phases, Gauss-Lobatto of order 3 (15 + 45 segments), SLSQP",
    ),
    "gekko": Entry(
        "gekko", "gekko_phases", ("gekko",),
        "two time-scaled phases on one axis (30 + 120 intervals, 3 nodes), its own IPOPT",
    ),
    "rockit-max": Entry(
        "rockit-meco", "rockit_one_phase", ("rockit",), "one phase, T = c max(0, z), 100 intervals", trap=True
    ),
    "rockit-rounded": Entry(
        "rockit-meco", "rockit_one_phase", ("rockit",), "one phase, max(0, z) rounded off by 0.01 rad",
        {"rounding": 0.01}, trap=True,
    ),
}  # fmt: skip


def installed(name: str) -> str | None:
    """Version of the package behind a contender, None if it is not installed.

    >>> installed("descent") is None
    False
    """
    return version_of(ENTRIES[name].package)


def solve(name: str, task: Task, **more: Any) -> Answer:
    """The answer of a contender; `more` are options beyond those of its entry. This imports its package."""
    entry = ENTRIES[name]
    answer: Answer = import_module(f"{HOME}.{entry.module}").solve(task, **{**entry.options, **more})
    return answer


def lines_of_code(name: str) -> int:
    """Lines of a contender's file that hold code: not blank, no comment, no docstring; imports included.

    >>> lines_of_code("closed-form") < lines_of_code("rockit")
    True
    """
    found = find_spec(f"{HOME}.{ENTRIES[name].module}")
    if found is None or found.origin is None:
        raise ValueError(f"{name}: its file cannot be found.")
    return count_lines(Path(found.origin).read_text())


def count_lines(text: str) -> int:
    """Lines that hold code.

    >>> count_lines('"a docstring"\\n# a comment\\n\\nx = 1  # and code\\ny = (\\n  2)\\n')
    3
    """
    docstrings: set[int] = set()
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            docstrings.update(range(node.lineno, (node.end_lineno or node.lineno) + 1))
    code: set[int] = set()
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type not in SILENT:
            code.update(range(token.start[0], token.end[0] + 1))
    return len(code - docstrings)
