"""Find a chain: a shipped one by its name, another by the path of its TOML file."""

from __future__ import annotations

import os
from functools import lru_cache
from importlib import resources

from softstart.errors import InputError
from softstart.input_tables import text_of
from softstart.units import nearest, show

__all__ = ["find", "names"]


@lru_cache(maxsize=1)
def names() -> tuple[str, ...]:
    """The names of the shipped chains, in order.

    >>> names()
    ('crane-4-mass', 'tractor-like')
    """
    entries = (entry.name for entry in resources.files("softstart.chain").joinpath("library").iterdir())
    return tuple(sorted(name.removesuffix(".toml") for name in entries if name.endswith(".toml")))


def find(chain: str | os.PathLike[str]) -> tuple[str, str]:
    """The TOML text, and what to call it in sentences.

    A string that is the name of a shipped chain means that chain; `./name` means a file.

    >>> find("tractor-lik")
    Traceback (most recent call last):
    softstart.errors.InputError: "tractor-lik": there is no such file, and no shipped chain of this name; did
    you mean tractor-like?
    """
    if isinstance(chain, str) and chain in names():
        library = resources.files("softstart.chain").joinpath("library")
        return library.joinpath(f"{chain}.toml").read_text("utf-8"), chain
    path = os.fspath(chain)
    if not os.path.exists(path):
        meant = nearest(path, names())
        hint = f"did you mean {meant}?" if meant else f"shipped chains are {', '.join(names())}."
        raise InputError(f"{show(path)}: there is no such file, and no shipped chain of this name; {hint}")
    return text_of(path, "a chain file"), path
