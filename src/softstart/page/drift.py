"""Results belong to the drive they were computed for: what to say when the bench has another one by now."""

from __future__ import annotations

from typing import Any

from softstart.drive import PARAMETERS, Drive
from softstart.input.parameters import Parameter

NAMED = 3  # parameters named in a sentence
WORDS = ("name", "source")  # they change no result
LONGEST = 60  # letters of a name in a sentence


def clipped(name: str) -> str:
    """A name short enough to stand in a sentence.

    >>> clipped("Crane"), len(clipped("Crane " * 100))
    ('Crane', 60)
    """
    return name if len(name) <= LONGEST else name[: LONGEST - 1] + "\N{HORIZONTAL ELLIPSIS}"


def drift(computed: Drive, now: Drive) -> str:
    """What a result was computed for, where that is not the drive of now; empty where it is.

    >>> crane = Drive.load("crane-4amtkf")
    >>> drift(crane, crane)
    ''
    >>> drift(crane, crane.replace(name="the same by another name"))
    ''
    >>> drift(crane, crane.replace(gap=1.0))
    'For shaft.gap 0.5 rad; the drive has changed since.'
    """
    changed = [p for p in changes(computed, now) if p.name not in WORDS]
    if not changed:
        return ""
    if computed.name != now.name:
        return f"For {clipped(computed.name)}; another drive is on the bench."
    named = ", ".join(f"{p.path} {_value(p, getattr(computed, p.name))}" for p in changed[:NAMED])
    more = f" and {len(changed) - NAMED} more" if len(changed) > NAMED else ""
    return f"For {named}{more}; the drive has changed since."


def changes(old: Drive, new: Drive) -> list[Parameter]:
    """The parameters in which two drives differ; those that follow another one only where they do not."""
    differing = [p for p in PARAMETERS.values() if getattr(old, p.name) != getattr(new, p.name)]
    names = {p.name for p in differing}
    return [
        p for p in differing
        if not (p.follows in names and all(getattr(d, p.name) == getattr(d, p.follows) for d in (old, new)))
    ]  # fmt: skip


def _value(parameter: Parameter, value: Any) -> str:
    if value is None:
        return "not given"
    if isinstance(value, str):
        return value
    unit = "" if parameter.unit in ("", "1") else " " + parameter.unit.replace("*", " ").replace("^", "")
    return f"{float(value):.6g}{unit}"
