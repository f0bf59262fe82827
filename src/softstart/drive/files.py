"""Find a drive: a shipped one by its name, another by the path of its TOML file."""

from __future__ import annotations

import os
from pathlib import Path

from softstart.drive import library
from softstart.errors import InputError
from softstart.units import nearest, show

__all__ = ["find"]


def find(drive: str | os.PathLike[str]) -> tuple[str, str]:
    """The TOML text, and what to call it in sentences.

    A string that is the name of a shipped drive means that drive; `./name` means a file.

    >>> find("crane-4amtkf")[1]
    'crane-4amtkf'
    >>> find("crane-4amtk")
    Traceback (most recent call last):
    softstart.errors.InputError: "crane-4amtk": there is no such file, and no shipped drive of this name;
    did you mean crane-4amtkf?
    """
    if not isinstance(drive, str | os.PathLike):
        raise InputError(
            f"{show(drive)}: a drive is named by text, a shipped name or the path of a TOML file."
        )
    if isinstance(drive, str) and drive in library.names():
        return library.text(drive), drive
    path = Path(drive)
    shown = show(os.fspath(drive))
    if not os.fspath(drive):
        raise InputError(f"{shown}: the name of the drive is empty; give a path, or one of {_shipped()}.")
    try:
        content = path.read_bytes()
    except (FileNotFoundError, NotADirectoryError):
        raise InputError(f"{shown}: {_not_there(path)}") from None
    except IsADirectoryError:
        raise InputError(f"{shown}: this is a directory; give the TOML file of a drive in it.") from None
    except OSError as error:
        raise InputError(f"{shown}: the file cannot be read ({error.strerror}).") from None
    except ValueError as error:  # a NUL in the path
        raise InputError(f"{shown}: this cannot be the path of a file ({error}).") from None
    try:
        return content.decode("utf-8-sig"), os.fspath(drive)
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        reason = f"the file is not UTF-8 text (line {line}); save it as UTF-8"
        raise InputError(f"{shown}: {reason}.") from None


def _not_there(path: Path) -> str:
    try:
        beside = [str(path.parent / entry.name) for entry in path.parent.iterdir() if entry.suffix == ".toml"]
    except OSError:
        return f"there is no directory {show(str(path.parent))}; shipped drives are {_shipped()}."
    meant = nearest(path.stem, library.names()) or nearest(str(path), beside)
    hint = f"did you mean {meant}?" if meant else f"shipped drives are {_shipped()}."
    return f"there is no such file, and no shipped drive of this name; {hint}"


def _shipped() -> str:
    return ", ".join(library.names())
