"""Find an engine: a shipped one by its name, another by the path of its TOML file."""

from __future__ import annotations

import os
from functools import lru_cache
from importlib import resources
from pathlib import Path

from softstart.errors import InputError
from softstart.input_tables import text_of
from softstart.units import nearest, show

__all__ = ["find", "names"]


@lru_cache(maxsize=1)
def names() -> tuple[str, ...]:
    """The names of the shipped engines, in order.

    >>> "vaz-11113" in names()
    True
    """
    entries = (entry.name for entry in resources.files("softstart.balancing").joinpath("library").iterdir())
    return tuple(sorted(name.removesuffix(".toml") for name in entries if name.endswith(".toml")))


def find(engine: str | os.PathLike[str]) -> tuple[str, str, Path]:
    """The TOML text, what to call it in sentences, and the folder that paths in it start from.

    A string that is the name of a shipped engine means that engine; `./name` means a file.

    >>> find("vaz-1113")
    Traceback (most recent call last):
    softstart.errors.InputError: "vaz-1113": there is no such file, and no shipped engine of this name; did
    you mean vaz-11113?
    """
    if isinstance(engine, str) and engine in names():
        library = resources.files("softstart.balancing").joinpath("library")
        return library.joinpath(f"{engine}.toml").read_text("utf-8"), engine, Path()
    path = os.fspath(engine)
    if "\0" in path:
        raise InputError(f"{show(path)}: this cannot be the path of a file.")
    if not os.path.exists(path):
        meant = nearest(path, names())
        hint = f"did you mean {meant}?" if meant else f"shipped engines are {', '.join(names())}."
        raise InputError(f"{show(path)}: there is no such file, and no shipped engine of this name; {hint}")
    return text_of(path, "an engine file"), path, Path(path).parent
