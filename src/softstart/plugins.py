"""Finding what packages register in an entry-point group: the built-in ones have no privilege."""

from __future__ import annotations

import difflib
from functools import cache
from importlib.metadata import EntryPoint, entry_points

from softstart.errors import InputError


@cache
def registered(group: str) -> dict[str, EntryPoint]:
    """Entry points of a group by name, in alphabetical order.

    >>> "direct" in registered("softstart.controllers")
    True
    """
    return {point.name: point for point in sorted(entry_points(group=group), key=lambda point: point.name)}


def load(group: str, kind: str, name: str, lists: str) -> object:
    """What is registered under a name; `kind` is the key in the sentences, `lists` the command to list all.

    Raises InputError in one sentence for an unknown name and for one that does not load.

    >>> load("softstart.studies", "study", "papper-g", "softstart study --list")
    Traceback (most recent call last):
    softstart.errors.InputError: study = "papper-g": there is no study of this name; did you mean "paper-g"?
    """
    known = registered(group)
    if name not in known:
        near = difflib.get_close_matches(name, known, n=1, cutoff=0.4)
        hint = f'did you mean "{near[0]}"?' if near else f"`{lists}` lists them."
        raise InputError(f'{kind} = "{name}": there is no {kind} of this name; {hint}')
    try:
        found: object = known[name].load()
    except (ImportError, AttributeError) as error:
        raise InputError(f'{kind} = "{name}": {known[name].value} cannot be loaded: {error}.') from error
    return found
