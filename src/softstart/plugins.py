"""Controllers and studies that packages register as entry points: the built-in ones have no privilege.

A source checkout registers what its pyproject.toml names, even if it was installed before that was added, and
under [tool.softstart.entry-points] what is not part of the wheel (the benchmarks).
"""

from __future__ import annotations

import tomllib
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path

from softstart.errors import InputError
from softstart.hints import did_you_mean

CONTROLLERS, STUDIES = "softstart.controllers", "softstart.studies"  # the groups
CHECKOUT = Path(__file__).resolve().parents[2] / "pyproject.toml"  # elsewhere in an installed package


@cache
def registered(group: str) -> dict[str, EntryPoint]:
    """Entry points of a group by name, in alphabetical order.

    >>> "direct" in registered("softstart.controllers")
    True
    """
    points = [*_of_checkout(group), *entry_points(group=group)]
    return {point.name: point for point in sorted(points, key=lambda point: point.name)}


def controller_names() -> tuple[str, ...]:
    """Names of all installed controllers, the built-in ones and those of other packages; none is imported.

    >>> "direct" in controller_names()
    True
    """
    return tuple(registered(CONTROLLERS))


def _of_checkout(group: str) -> list[EntryPoint]:
    if not CHECKOUT.is_file():
        return []
    document = tomllib.loads(CHECKOUT.read_text("utf-8"))
    if document.get("project", {}).get("name") != "softstart":
        return []
    own = document["project"].get("entry-points", {}).get(group, {})
    found = own | document["tool"]["softstart"]["entry-points"].get(group, {})
    return [EntryPoint(name, value, group) for name, value in found.items()]


def load(group: str, kind: str, name: str, lists: str) -> object:
    """What is registered under a name; error sentences name `kind`, and `lists`, the command that lists all.

    Raises InputError in one sentence for an unknown name and for one that does not load.

    >>> load("softstart.studies", "study", "papper-g", "softstart study")
    Traceback (most recent call last):
    softstart.errors.InputError: study = "papper-g": there is no study of this name; did you mean "paper-g"?
    """
    known = registered(group)
    if name not in known:
        hint = did_you_mean(name, known, otherwise=f"`{lists}` lists them.", quote='"')
        raise InputError(f'{kind} = "{name}": there is no {kind} of this name; {hint}')
    try:
        found: object = known[name].load()
    except (ImportError, AttributeError) as error:
        raise InputError(f'{kind} = "{name}": {known[name].value} cannot be loaded: {error}.') from error
    return found
