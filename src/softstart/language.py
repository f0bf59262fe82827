"""The language of what is shown: each sentence is one template, and a table may have it in another language.

Templates are in English, with named values in braces; a table maps each to its sentence in another language:

    said("{name}: peak {peak} N m", name=row.name, peak=digits(row.run.peak_torque))

`later` marks a template that stands apart from where it is said. `templates` finds both in a source file, so
that `softstart report --sentences` knows them all.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path

_TABLE: ContextVar[Mapping[str, str]] = ContextVar("_TABLE", default={})  # noqa: B039 - never changed


def said(template: str, /, **values: object) -> str:
    """The sentence of a template in the language that is in use, with its values.

    >>> said("{name} takes {time:.2f} s", name="ramp", time=0.4567)
    'ramp takes 0.46 s'
    """
    sentence = _TABLE.get().get(template, template)
    return sentence.format(**values) if values else sentence


def later(template: str, /) -> str:
    """The template itself, to be said where it is shown."""
    return template


@contextmanager
def speaking(table: Mapping[str, str]) -> Iterator[None]:
    """What is said meanwhile is said by this table: template -> sentence.

    >>> with speaking({"{n} starts": "{n} Anläufe"}):
    ...     said("{n} starts", n=3)
    '3 Anläufe'
    """
    token = _TABLE.set(table)
    try:
        yield
    finally:
        _TABLE.reset(token)


def templates(source: Path) -> list[str]:
    """All templates that a Python file says, in their order."""
    found = []
    for node in ast.walk(ast.parse(source.read_text("utf-8"))):
        if (
            isinstance(node, ast.Call)
            and isinstance(node.func, ast.Name)
            and node.func.id in ("said", "later")
        ):
            first = node.args[0]
            if isinstance(first, ast.Constant):
                found.append((node.lineno, node.col_offset, str(first.value)))
    return [text for *_, text in sorted(found)]
