"""Which values of an engine are assumed: named in its file, marked wherever they are shown."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from softstart.balancing.tables import TABLES
from softstart.errors import InputError
from softstart.quantities import nearest, show

__all__ = ["assumed_keys"]


def assumed_keys(text: str, changed: Mapping[str, object], found: Mapping[str, Any]) -> tuple[str, ...]:
    """The keys named in a text as "masses.*, cycle.speeds", but those `changed` by the user.

    A star stands for all keys of a table that are there in `found`.

    >>> assumed_keys("masses.*", {"masses.rotating": 1}, {"masses": {"reciprocating": 1, "rotating": 2}})
    ('masses.reciprocating',)
    >>> assumed_keys("mases.*", {}, {})
    Traceback (most recent call last):
    softstart.errors.InputError: assumed = "mases.*": an engine file has no such key; did you mean masses.*?
    """
    known = [p.path for table in TABLES for p in table.parameters if table.name]
    stars = [f"{table.name}.*" for table in TABLES if table.name]
    named: dict[str, None] = {}
    wrong = []
    for name in (one.strip() for one in text.split(",")):
        if not name:
            continue
        if name in stars:
            values = found.get(name[:-2])
            here = values if isinstance(values, Mapping) else {}
            named |= {f"{name[:-1]}{key}": None for key, value in here.items() if value is not None}
        elif name in known:
            named[name] = None
        else:
            meant = nearest(name, [*stars, *known])
            hint = f"did you mean {meant}?" if meant else "write masses.rotating, or masses.* for all."
            wrong.append(f"assumed = {show(name)}: an engine file has no such key; {hint}")
    if wrong:
        raise InputError(wrong)
    return tuple(name for name in named if name not in changed)
